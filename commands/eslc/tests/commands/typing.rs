//! `eslc lsp` beside a program that grows: links to modules, the indentation of a new line, tests to be run.

use esl_conformance::folder::Folder;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};

#[test]
fn required_modules_are_links_and_have_definitions() {
    let text = "(require \"robot\")\n(require 'json)\n(require \"no-such-module\")\n(list \"robot\")\n";
    let folder = Folder::with("lsp_links", &[("robot.esl", "(defun drive ())\n"), ("main.esl", text)]);
    let main = folder.join("main.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&main, text);
    let links = editor.ask("textDocument/documentLink", json!({ "textDocument": { "uri": uri(&main) } }));
    let links = links.as_array().expect("it is a list");
    assert_eq!(links.len(), 2, "{links:?}");
    assert_eq!(links[0]["target"], json!(uri(&folder.join("robot.esl"))));
    let range = json!({ "start": { "line": 0, "character": 9 }, "end": { "line": 0, "character": 16 } });
    assert_eq!(links[0]["range"], range);
    let json_module = links[1]["target"].as_str().expect("it is a URI").trim_start_matches("file://");
    assert!(std::fs::read_to_string(json_module).expect("it is shown").contains("(defpackage"));
    let mut definition = |line: u32, character: u32| {
        let at = json!({ "line": line, "character": character });
        editor.ask_at("textDocument/definition", &main, at, Value::Null)
    };
    assert_eq!(definition(0, 12)["uri"], json!(uri(&folder.join("robot.esl"))));
    assert_eq!(definition(1, 11)["uri"], links[1]["target"]);
    assert_eq!(definition(2, 12), Value::Null);
    assert_eq!(definition(3, 8), Value::Null, "only `require` takes a module");
    editor.end();
}

#[test]
fn a_line_that_was_begun_is_indented() {
    let folder = Folder::new("lsp_enter");
    let mut editor = Editor::new(&folder);
    let mut count = 0;
    // The text in which `@` is the position after Enter; what the line begins with afterwards.
    let mut indented = |text: &str| {
        count += 1;
        let path = folder.join(&format!("{count}.esl"));
        let at = text.find('@').expect("the position is marked");
        editor.open(&path, &text.replacen('@', "", 1));
        let line = text[..at].matches('\n').count();
        let column = at - text[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let asked = json!({
            "textDocument": { "uri": uri(&path) },
            "position": { "line": line, "character": column },
            "ch": "\n",
            "options": { "tabSize": 8, "insertSpaces": true },
        });
        let edits = editor.ask("textDocument/onTypeFormatting", asked);
        let edit = edits.as_array().and_then(|edits| edits.first()).cloned();
        edit.map(|edit| {
            assert_eq!(edit["range"]["start"], json!({ "line": line, "character": 0 }));
            edit["newText"].as_str().expect("it is a text").len()
        })
    };
    assert_eq!(indented("(defun f (x)\n@"), Some(2));
    assert_eq!(indented("(defun f (x)\n    @"), Some(2));
    assert_eq!(indented("(defun f (x)\n@)"), Some(2));
    assert_eq!(indented("(defun f (x)\n@\n(defun g ())\n"), Some(2));
    assert_eq!(indented("(list 1\n@2)"), Some(6));
    assert_eq!(indented("(let ((a 1)\n@"), Some(6));
    assert_eq!(indented("(with-recovery-procedures\n@"), Some(4));
    assert_eq!(indented("(list \"a\n@\")"), None, "strings stay as they are");
    assert_eq!(indented("(list 1)\n  @"), Some(0));
    editor.end();
}

#[test]
fn tests_can_be_run_from_where_they_stand() {
    let text = "(defun f ())\n\n(deftest it-docks\n  (is t))\n(deftest (odd) 1)\n";
    let folder = Folder::with("lsp_lens", &[]);
    let path = folder.join("test.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, text);
    let lenses = editor.ask("textDocument/codeLens", json!({ "textDocument": { "uri": uri(&path) } }));
    assert_eq!(lenses[0]["range"]["start"], json!({ "line": 2, "character": 9 }));
    let command =
        json!({ "title": "Run test", "command": "esl.runTest", "arguments": [uri(&path), "it-docks"] });
    assert_eq!(lenses[0]["command"], command);
    editor.end();
}
