//! An editor that talks to the language server, over standard input and output.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout};

use esl_conformance::folder::Folder;
use esl_conformance::process::{finish, start};
use serde_json::{Value, json};

use crate::eslc;

/// An editor that talks to a server.
pub(crate) struct Editor {
    pub(crate) child: Child,
    pub(crate) input: ChildStdin,
    pub(crate) output: BufReader<ChildStdout>,
    pub(crate) last_id: u64,
    /// Diagnostics of each text, as they were told last.
    pub(crate) told: std::collections::HashMap<String, Value>,
}

impl Editor {
    /// Starts a server and says hello; its copies of the library go to `folder`.
    pub(crate) fn new(folder: &Folder) -> Editor {
        Editor::with_capabilities(folder, json!({ "codeLens": { "refreshSupport": true } }))
    }

    /// As [`Editor::new`], for a client with these capabilities of the workspace.
    pub(crate) fn with_capabilities(folder: &Folder, workspace: Value) -> Editor {
        let mut child = start(eslc(&["lsp"]).env("XDG_CACHE_HOME", folder.join("cache")));
        let input = child.stdin.take().expect("standard input is a pipe");
        let output = BufReader::new(child.stdout.take().expect("standard output is a pipe"));
        let mut editor = Editor { child, input, output, last_id: 0, told: Default::default() };
        let root = uri(&folder.path().display().to_string());
        let capabilities = json!({ "workspace": workspace });
        let hello =
            json!({ "capabilities": capabilities, "workspaceFolders": [{ "uri": root, "name": "test" }] });
        let answer = editor.ask("initialize", hello);
        assert_eq!(answer["serverInfo"]["name"], "eslc");
        editor.tell("initialized", json!({}));
        editor
    }

    pub(crate) fn send(&mut self, message: &Value) {
        let text = message.to_string();
        write!(self.input, "Content-Length: {}\r\n\r\n{text}", text.len()).expect("the server reads");
        self.input.flush().expect("the server reads");
    }

    pub(crate) fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            assert!(self.output.read_line(&mut line).expect("it can be read") > 0, "the server has ended");
            match line.trim_end().split_once(": ") {
                Some(("Content-Length", number)) => length = number.parse().expect("it is a number"),
                Some(_) => {}
                None => break,
            }
        }
        let mut bytes = vec![0; length];
        self.output.read_exact(&mut bytes).expect("it can be read");
        let message: Value = serde_json::from_slice(&bytes).expect("it is JSON");
        if message["method"] == "textDocument/publishDiagnostics" {
            let uri = message["params"]["uri"].as_str().expect("it names a text").to_owned();
            self.told.insert(uri, message["params"]["diagnostics"].clone());
        }
        message
    }

    pub(crate) fn tell(&mut self, method: &str, parameters: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": parameters }));
    }

    /// Sends a request. Returns the message that answers it.
    pub(crate) fn request(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let id = self.last_id;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": parameters }));
        loop {
            let message = self.receive();
            if message["id"] == id {
                return message;
            }
        }
    }

    #[track_caller]
    pub(crate) fn ask(&mut self, method: &str, parameters: Value) -> Value {
        let answer = self.request(method, parameters);
        assert!(answer["error"].is_null(), "{method}: {answer}");
        answer["result"].clone()
    }

    pub(crate) fn open(&mut self, path: &str, text: &str) {
        let document = json!({ "uri": uri(path), "languageId": "esl", "version": 1, "text": text });
        self.tell("textDocument/didOpen", json!({ "textDocument": document }));
    }

    /// Asks about the place at which the `occurrence`-th `word` of a text begins.
    #[track_caller]
    pub(crate) fn ask_at(&mut self, method: &str, path: &str, place: Value, more: Value) -> Value {
        let mut parameters = json!({ "textDocument": { "uri": uri(path) }, "position": place });
        for (key, value) in more.as_object().into_iter().flatten() {
            parameters[key] = value.clone();
        }
        self.ask(method, parameters)
    }

    /// Waits for diagnostics of a text that `wanted` likes.
    pub(crate) fn diagnostics(&mut self, path: &str, wanted: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        loop {
            let told = self.told.get(&uri(path)).and_then(Value::as_array).cloned();
            if let Some(told) = told.filter(|told| wanted(told)) {
                return told;
            }
            self.receive();
        }
    }

    /// Waits until the server has found the failures of a text, so that its lenses are to be asked for again.
    pub(crate) fn refreshed(&mut self) {
        while self.receive()["method"] != "workspace/codeLens/refresh" {}
    }

    /// Says goodbye.
    pub(crate) fn end(mut self) {
        self.ask("shutdown", Value::Null);
        let late = self.request("workspace/symbol", json!({ "query": "" }));
        assert_eq!(late["error"]["code"], -32600, "{late}");
        self.tell("exit", Value::Null);
        drop(self.input);
        assert_eq!(finish(self.child).status, Some(0));
    }
}

pub(crate) fn uri(path: &str) -> String {
    format!("file://{path}")
}
