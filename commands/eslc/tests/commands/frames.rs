//! `eslc lsp` with a client that breaks the protocol, or shows a text that nests deeply.

use std::io::Write;

use esl_conformance::folder::Folder;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};

fn send_frame(editor: &mut Editor, body: &[u8]) {
    write!(editor.input, "Content-Length: {}\r\n\r\n", body.len()).expect("the server reads");
    editor.input.write_all(body).expect("the server reads");
    editor.input.flush().expect("the server reads");
}

#[test]
fn a_frame_that_is_not_a_message_is_answered_and_the_server_goes_on() {
    let folder = Folder::new("lsp_frames");
    let mut editor = Editor::new(&folder);
    let deep = format!("{{\"id\":1,\"method\":\"a\",\"params\":{}{}}}", "[".repeat(200), "]".repeat(200));
    for (body, code) in [
        (&b"hello"[..], -32700),
        (b"{\"id\":", -32700),
        (b"{\"method\":\"\xff\xfe\"}", -32700),
        (deep.as_bytes(), -32700),
        (b"[{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"shutdown\"}]", -32600),
        (b"{\"id\":7}", -32600),
    ] {
        send_frame(&mut editor, body);
        let answer = editor.receive();
        assert_eq!(answer["error"]["code"], code, "{answer}");
        assert!(answer["error"]["message"].is_string(), "{answer}");
    }
    editor.input.write_all(b"Content-Length: some\r\n\r\n").expect("the server reads");
    assert_eq!(editor.receive()["error"]["code"], -32700);
    let again = editor.request("initialize", json!({ "capabilities": {} }));
    assert_eq!(again["error"]["code"], -32600, "{again}");
    let unknown = editor.request("textDocument/dance", Value::Null);
    assert_eq!(unknown["error"]["code"], -32601, "{unknown}");
    let lacking = editor.request("textDocument/hover", json!([1]));
    assert_eq!(lacking["error"]["code"], -32602, "{lacking}");
    editor.tell("textDocument/didOpen", json!({ "textDocument": 5 }));
    editor.end();
}

#[test]
fn a_text_that_nests_deeply_is_answered_about() {
    const DEPTH: usize = 20_000;
    let folder = Folder::new("lsp_deep");
    let mut editor = Editor::new(&folder);
    let path = folder.join("deep.esl");
    let place = json!({ "line": 0, "character": 2 * DEPTH + 2 });
    for unit in ["((", "(f", "'("] {
        let text = unit.repeat(DEPTH) + " name " + &")".repeat(unit.matches('(').count() * DEPTH);
        editor.open(&path, &text);
        let document = json!({ "textDocument": { "uri": uri(&path) } });
        let range = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 1, "character": 0 } });
        let options = json!({ "tabSize": 2, "insertSpaces": true });
        let asked = json!({ "textDocument": { "uri": uri(&path) }, "positions": [place] });
        let selections = editor.ask("textDocument/selectionRange", asked);
        let (mut steps, mut part) = (0, &selections[0]);
        let mut last = part;
        while part["range"].is_object() {
            (steps, last, part) = (steps + 1, part, &part["parent"]);
        }
        assert_eq!(steps, 64);
        assert_eq!(
            last["range"]["start"],
            json!({ "line": 0, "character": 0 }),
            "the whole text is the last"
        );
        for method in ["foldingRange", "documentSymbol", "semanticTokens/full", "codeLens", "documentLink"] {
            editor.ask(&format!("textDocument/{method}"), document.clone());
        }
        for method in
            ["hover", "completion", "definition", "signatureHelp", "documentHighlight", "prepareRename"]
        {
            editor.ask_at(&format!("textDocument/{method}"), &path, place.clone(), Value::Null);
        }
        for (method, more) in [
            ("inlayHint", json!({ "range": range })),
            ("semanticTokens/range", json!({ "range": range })),
            ("formatting", json!({ "options": options })),
            ("rangeFormatting", json!({ "range": range, "options": options })),
            ("onTypeFormatting", json!({ "position": place, "ch": "\n", "options": options })),
        ] {
            let mut parameters = document.clone();
            for (key, value) in more.as_object().expect("it is an object") {
                parameters[key] = value.clone();
            }
            editor.ask(&format!("textDocument/{method}"), parameters);
        }
    }
    editor.end();
}
