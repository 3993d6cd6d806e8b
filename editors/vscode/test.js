// Loads the extension without Visual Studio Code: `npm install && node test.js`. A stand-in answers for the
// module `vscode`; what the extension asks of it is looked at. No server is started.
const assert = require("node:assert");
const Module = require("node:module");

const registered = {};
let isStopped = false;

// Anything of the editor that the client library uses: a class, a function, an event, an enumeration.
function anything(name) {
  const made = class {
    dispose() {}
  };
  return new Proxy(made, {
    get: (target, key) => (key in target || typeof key === "symbol" ? target[key] : anything(`${name}.${String(key)}`)),
    apply: (_, __, callback) => ({ dispose() {}, event: () => ({ dispose() {} }), fire() {}, callback }),
  });
}

const settings = { command: "eslc", library: ["."], machine: "eslvm" };
const typed = [];
const event = () => ({ dispose() {} });
const some = (known, name) => new Proxy(known, { get: (at, key) => (key in at ? at[key] : anything(`${name}.${String(key)}`)) });
const vscode = some(
  {
    version: "1.90.0",
    workspace: some(
      {
        getConfiguration: () => ({ get: (key, otherwise) => settings[key] ?? otherwise, inspect: () => undefined }),
        textDocuments: [],
        workspaceFolders: undefined,
        notebookDocuments: [],
      },
      "workspace",
    ),
    commands: some(
      {
        registerCommand: (name, run) => {
          registered[name] = run;
          return { dispose() {} };
        },
      },
      "commands",
    ),
    env: some({ language: "en", appName: "test", clipboard: {} }, "env"),
    Uri: { parse: (text) => ({ fsPath: text.replace("file://", "") }) },
    window: some({ terminals: [], createTerminal: () => ({ show() {}, sendText: (text) => typed.push(text) }), activeTextEditor: undefined, visibleTextEditors: [], tabGroups: { all: [], onDidChangeTabs: event } }, "window"),
    EventEmitter: class {
      constructor() {
        this.event = event;
      }
      fire() {}
      dispose() {}
    },
  },
  "vscode",
);

const resolve = Module._resolveFilename;
Module._resolveFilename = (request, ...rest) => (request === "vscode" ? "vscode" : resolve(request, ...rest));
require.cache.vscode = { id: "vscode", filename: "vscode", loaded: true, exports: vscode };

const { LanguageClient } = require("vscode-languageclient/node");
const started = [];
LanguageClient.prototype.start = async function () {
  started.push(this);
};
LanguageClient.prototype.stop = async function () {
  isStopped = true;
};

(async () => {
  const extension = require(".");
  const context = { subscriptions: [] };
  await extension.activate(context);
  assert.strictEqual(started.length, 1, "one client is started");
  const [client] = started;
  assert.deepStrictEqual(client._serverOptions, { command: settings.command, args: ["lsp", "--library", "."] });
  assert.deepStrictEqual(client._clientOptions.documentSelector, [{ language: "esl" }]);
  const { contributes } = require("./package.json");
  // That of "Run test" has arguments, and is not offered in the palette.
  const offered = contributes.commands.map(({ command }) => command);
  assert.deepStrictEqual(Object.keys(registered), [...offered, "esl.runTest"]);
  assert.strictEqual(context.subscriptions.length, 2);
  await registered["esl.showExpansion"]();
  registered["esl.runTest"]("file:///robot/test.esl", "it-docks");
  const quote = process.platform === "win32" ? '"' : "'";
  assert.deepStrictEqual(typed, [`eslvm test ${quote}/robot/test.esl${quote} --filter ${quote}it-docks${quote}`]);
  await extension.deactivate();
  assert(isStopped, "the client is stopped");
  console.log("all is well");
})().catch((error) => {
  console.error(error);
  process.exitCode = 1;
});
