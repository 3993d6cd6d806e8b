// Starts `eslc lsp`, and shows expansions.
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

async function showExpansion() {
  const editor = vscode.window.activeTextEditor;
  if (!editor || !client) return;
  const position = { line: editor.selection.active.line, character: editor.selection.active.character };
  const place = { textDocument: { uri: editor.document.uri.toString() }, position };
  try {
    const request = { command: "esl.expand", arguments: [place] };
    const content = await client.sendRequest("workspace/executeCommand", request);
    const document = await vscode.workspace.openTextDocument({ language: "esl", content });
    await vscode.window.showTextDocument(document, vscode.ViewColumn.Beside, true);
  } catch (error) {
    vscode.window.showErrorMessage(`ESL: ${error.message}`);
  }
}

async function activate(context) {
  const settings = vscode.workspace.getConfiguration("esl");
  const folders = settings.get("library", []).flatMap((folder) => ["--library", folder]);
  const server = { command: settings.get("command", "eslc"), args: ["lsp", ...folders] };
  client = new LanguageClient("esl", "ESL", server, { documentSelector: [{ language: "esl" }] });
  context.subscriptions.push(vscode.commands.registerCommand("esl.showExpansion", showExpansion));
  await client.start();
}

function deactivate() {
  return client && client.stop();
}

module.exports = { activate, deactivate };
