//! Findings of `eslvm explore` and `eslvm test`, which the language server marks in their files.

use esl_conformance::folder::Folder;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};

/// Findings of an exploration are marked where their steps are, as long as the text is as it was.
#[test]
fn findings_of_explorations_are_marked() {
    let text = "(defvar *seen* 0)\n(defun see ()\n  (setq *seen* (1+ *seen*)))\n";
    let folder = Folder::with("lsp_findings", &[("count.esl", text)]);
    let main = folder.join("count.esl");
    let watching = json!({ "didChangeWatchedFiles": { "dynamicRegistration": true } });
    let mut editor = Editor::with_capabilities(&folder, watching);
    let watched = loop {
        let message = editor.receive();
        if message["method"] == "client/registerCapability" {
            break message["params"]["registrations"][0]["registerOptions"]["watchers"][0]["globPattern"]
                .clone();
        }
    };
    assert_eq!(watched, "**/*.findings.json");
    editor.open(&main, text);
    editor.diagnostics(&main, <[Value]>::is_empty);
    let step = |kind: &str, task: &str, place: &str, text: &str| json!({ "kind": kind, "task": task, "place": place, "text": text });
    let place = "count.esl:3:16";
    let steps = json!([
        step("read", "task LEFT", "count.esl:3:20", "reads *SEEN* = 0"),
        json!({ "kind": "preemption", "text": "has to stop before", "stops": { "task": "task LEFT", "place": place } }),
        step("set", "task RIGHT", "count.esl:3:3", "sets *SEEN* to 1"),
        step("set", "task RIGHT", "missing.esl:3:3", "sets *SEEN* to 1"),
        step("set", "task RIGHT", "count.esl:99:3", "sets *SEEN* to 1"),
        step("set", "task RIGHT", "pipe.findings.json:1:1", "is in a file that never ends"),
        json!(7),
    ]);
    // To read it would wait for ever; where it cannot be made, the place is in no file.
    _ = std::process::Command::new("mkfifo").arg(folder.join("pipe.findings.json")).status();
    let finding = json!({ "finding": "the program ends with status 1", "steps": steps, "schedule": "count-1.schedule" });
    let found = json!({ "folder": folder.path(), "program": "count.esl", "findings": [finding] });
    folder.file("count.findings.json", found.to_string());
    folder.file("broken.findings.json", "[");
    let changed = json!({ "uri": uri(&folder.join("count.findings.json")), "type": 1 });
    editor.tell("workspace/didChangeWatchedFiles", json!({ "changes": [&changed] }));
    let told = editor.diagnostics(&main, |told| told.len() == 3);
    let mark = told.iter().find(|mark| mark["severity"] == 2).expect("one is a warning");
    assert_eq!(mark["range"]["start"], json!({ "line": 2, "character": 15 }), "{mark}");
    assert_eq!(mark["range"]["end"], json!({ "line": 2, "character": 26 }), "{mark}");
    let message = mark["message"].as_str().unwrap_or_default();
    assert_eq!(
        message,
        "the program ends with status 1\nLEFT: has to stop before\nagain: eslvm run --schedule count-1.schedule count.esl"
    );
    let related = mark["relatedInformation"].as_array().expect("the steps are related");
    let messages: Vec<&str> = related.iter().filter_map(|step| step["message"].as_str()).collect();
    assert_eq!(messages, ["LEFT: reads *SEEN* = 0", "LEFT: has to stop before", "RIGHT: sets *SEEN* to 1"]);
    // That of a test names the command that runs it.
    let again = "eslvm test count.esl --filter COUNTING";
    let finding = json!({ "finding": "COUNTING: a check did not hold", "test": "COUNTING", "steps": steps, "again": again });
    let found = json!({ "folder": folder.path(), "findings": [finding] });
    folder.file("count.findings.json", found.to_string());
    editor.tell("workspace/didChangeWatchedFiles", json!({ "changes": [&changed] }));
    let is_of_test =
        |told: &[Value]| told.len() == 3 && told.iter().all(|mark| mark["source"] == "eslvm test");
    let told = editor.diagnostics(&main, is_of_test);
    let mark = told.iter().find(|mark| mark["severity"] == 2).expect("one is a warning");
    assert!(
        mark["message"].as_str().is_some_and(|text| text.ends_with(&format!("again: {again}"))),
        "{mark}"
    );
    // Of one with many steps, the last are shown.
    let many = vec![step("read", "task LEFT", "count.esl:3:20", "reads *SEEN* = 0"); 1200];
    let finding = json!({ "finding": "a deadlock", "steps": many, "again": again });
    let found = json!({ "folder": folder.path(), "findings": [finding] });
    folder.file("count.findings.json", found.to_string());
    editor.tell("workspace/didChangeWatchedFiles", json!({ "changes": [changed] }));
    let told = editor.diagnostics(&main, |told| told.len() == 1000);
    let first = "step 201 of 1200, a deadlock: LEFT: reads *SEEN* = 0";
    assert!(told.iter().any(|mark| mark["message"] == first), "{}", told[0]);
    // The text is another one now.
    let change = json!({ "text": format!("{text}\n") });
    let document = json!({ "uri": uri(&main), "version": 2 });
    editor.tell("textDocument/didChange", json!({ "textDocument": document, "contentChanges": [change] }));
    editor.diagnostics(&main, <[Value]>::is_empty);
    editor.end();
}
