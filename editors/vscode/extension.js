// Starts `eslc lsp`, shows expansions, and runs tests.
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

// The command of "Run test" above a test: runs it in a terminal, which all tests share.
function runTest(uri, name) {
  const machine = vscode.workspace.getConfiguration("esl").get("machine", "eslvm");
  const quoted = (text) => (process.platform === "win32" ? `"${text}"` : `'${text.replace(/'/g, "'\\''")}'`);
  const known = vscode.window.terminals.find((terminal) => terminal.name === "ESL tests");
  const terminal = known ?? vscode.window.createTerminal("ESL tests");
  terminal.show(true);
  terminal.sendText(`${machine} test ${quoted(vscode.Uri.parse(uri).fsPath)} --filter ${quoted(name)}`);
}

async function activate(context) {
  const settings = vscode.workspace.getConfiguration("esl");
  const folders = settings.get("library", []).flatMap((folder) => ["--library", folder]);
  const server = { command: settings.get("command", "eslc"), args: ["lsp", ...folders] };
  client = new LanguageClient("esl", "ESL", server, { documentSelector: [{ language: "esl" }] });
  context.subscriptions.push(vscode.commands.registerCommand("esl.showExpansion", showExpansion));
  context.subscriptions.push(vscode.commands.registerCommand("esl.runTest", runTest));
  await client.start();
}

function deactivate() {
  return client && client.stop();
}

module.exports = { activate, deactivate };
