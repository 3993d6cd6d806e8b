//! `eslc lsp`, as an editor talks to it: a scripted session over standard input and output.

use esl_conformance::folder::Folder;
use esl_conformance::process::finish;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};

/// The position of the `occurrence`-th `word` in a text, counted from 0.
fn place(text: &str, word: &str, occurrence: usize) -> Value {
    let at = text.match_indices(word).nth(occurrence).expect("the word is there").0;
    let line_start = text[..at].rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[..at].matches('\n').count();
    json!({ "line": line, "character": text[line_start..at].encode_utf16().count() })
}

/// Returns the text that a hover shows.
fn hover(editor: &mut Editor, path: &str, place: Value) -> String {
    let answer = editor.ask_at("textDocument/hover", path, place, Value::Null);
    answer["contents"]["value"].as_str().unwrap_or_default().to_owned()
}

const ARM: &str = "(defpackage :arm (:use :esl :cl) (:export #:raise))\n(in-package :arm)\n\n\
    (defun raise (angle &key (speed 1))\n  \"Raises the arm by ANGLE.\"\n  (list angle speed))\n";

const MAIN: &str = "(require \"arm\")\n\
    (define-cause :stuck ())\n\
    \n\
    (defun grip (force)\n  \"Closes the hand — carefully.\"\n  (when (> force 3)\n    (fail :stuck force))\n  force)\n\
    \n\
    (defun work (force)\n  (with-recovery-procedures ((:stuck :retries 2 (retry)))\n    (arm:raise 30 :speed 2)\n\
    \x20   (grip force)))\n\
    (print (work 1))\n";

#[test]
fn an_editor_is_told_what_names_mean() {
    let folder = Folder::with("lsp_names", &[("arm.esl", ARM), ("main.esl", MAIN)]);
    let (main, arm) = (folder.join("main.esl"), folder.join("arm.esl"));
    let mut editor = Editor::new(&folder);
    editor.open(&main, MAIN);

    let shown = hover(&mut editor, &main, place(MAIN, "grip force", 0));
    assert!(shown.contains("(grip force)") && shown.contains("Closes the hand — carefully."), "{shown}");
    let shown = hover(&mut editor, &main, place(MAIN, "arm:raise", 0));
    assert!(shown.contains("(raise angle &key (speed 1))") && shown.contains("Raises the arm"), "{shown}");
    let shown = hover(&mut editor, &main, place(MAIN, "with-recovery-procedures", 0));
    assert!(shown.contains("*macro*"), "{shown}");
    let shown = hover(&mut editor, &main, place(MAIN, "when", 0));
    assert!(shown.contains("Evaluates BODY if TEST is true"), "{shown}");
    assert_eq!(hover(&mut editor, &main, place(MAIN, "3)", 0)), "", "there is nothing to say");

    let found = editor.ask_at("textDocument/definition", &main, place(MAIN, "arm:raise", 0), Value::Null);
    assert_eq!(
        (found[0]["uri"].as_str(), &found[0]["range"]["start"]["line"]),
        (Some(&*uri(&arm)), &json!(3))
    );
    let found = editor.ask_at("textDocument/definition", &main, place(MAIN, "force)", 2), Value::Null);
    assert_eq!(found["range"]["start"]["line"], 3, "a local variable: {found}");
    let found = editor.ask_at("textDocument/definition", &main, place(MAIN, "with-recovery", 0), Value::Null);
    let library =
        found[0]["uri"].as_str().expect("there is a place").trim_start_matches("file://").to_owned();
    assert!(library.ends_with("stdlib/recovery.esl"), "{library}");
    assert!(std::fs::read_to_string(library).expect("it is shown").contains("with-recovery-procedures"));

    let more = json!({ "context": { "includeDeclaration": true } });
    let uses = editor.ask_at("textDocument/references", &main, place(MAIN, "arm:raise", 0), more);
    assert_eq!(uses.as_array().map(Vec::len), Some(3), "{uses}");
    let edit = editor.ask_at(
        "textDocument/rename",
        &main,
        place(MAIN, "arm:raise", 0),
        json!({ "newName": "lift" }),
    );
    let edits = &edit["changes"];
    assert_eq!(edits[uri(&main)][0]["range"]["start"]["character"], 9, "the package stays: {edit}");
    assert_eq!(edits[uri(&arm)].as_array().map(Vec::len), Some(2), "exported, too: {edit}");
    let local =
        editor.ask_at("textDocument/rename", &main, place(MAIN, "force)", 0), json!({ "newName": "f" }));
    assert_eq!(local["changes"][uri(&main)].as_array().map(Vec::len), Some(4), "{local}");
    let refused = editor.request(
        "textDocument/rename",
        json!({ "textDocument": { "uri": uri(&main) }, "position": place(MAIN, "print", 0), "newName": "x" }),
    );
    assert!(refused["error"]["message"].as_str().is_some_and(|text| text.contains("`print`")), "{refused}");

    let range = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } });
    let whole = json!({ "textDocument": { "uri": uri(&main) }, "range": range });
    let hints = editor.ask("textDocument/inlayHint", whole);
    assert_eq!(hints[0]["label"], "handles line 7", "{hints}");
    let text = json!({ "textDocument": { "uri": uri(&main) } });
    let symbols = editor.ask("textDocument/documentSymbol", text.clone());
    let names: Vec<&str> =
        symbols.as_array().expect("a list").iter().filter_map(|s| s["name"].as_str()).collect();
    assert_eq!(names, [":stuck", "grip", "work"]);
    let symbols = editor.ask("workspace/symbol", json!({ "query": "rse" }));
    assert_eq!(symbols[0]["name"], "raise", "{symbols}");
    let folds = editor.ask("textDocument/foldingRange", text.clone());
    assert_eq!((&folds[0]["startLine"], &folds[0]["endLine"]), (&json!(3), &json!(7)), "{folds}");
    let tokens = editor.ask("textDocument/semanticTokens/full", text);
    assert!(tokens["data"].as_array().is_some_and(|data| data.len() > 50 && data.len() % 5 == 0), "{tokens}");
    let arguments = json!([{ "textDocument": { "uri": uri(&main) }, "position": place(MAIN, "(when", 0) }]);
    let expansion =
        editor.ask("workspace/executeCommand", json!({ "command": "esl.expand", "arguments": arguments }));
    assert!(expansion.as_str().is_some_and(|text| text.contains("if") || text.contains("IF")), "{expansion}");
    editor.end();
}

#[test]
fn an_editor_is_helped_while_a_program_is_typed() {
    let folder = Folder::with("lsp_typing", &[("arm.esl", ARM)]);
    let main = folder.join("main.esl");
    let mut editor = Editor::new(&folder);
    // It does not compile, and the list has no end.
    let text = "(require \"arm\")\n(defun work (force)\n(let ((other 1))\n(arm:raise 30 :sp\n(defun rest-of-it () 1)\n";
    editor.open(&main, text);
    let broken = editor.diagnostics(&main, |told| !told.is_empty());
    assert_eq!(broken[0]["code"], "unclosed-list", "{broken:?}");
    let labels = |answer: &Value| -> Vec<String> {
        let items = answer["items"].as_array().cloned().unwrap_or_default();
        items.iter().filter_map(|item| item["label"].as_str()).map(str::to_owned).collect()
    };
    let end = json!({ "line": 3, "character": 17 });
    let keys = editor.ask_at("textDocument/completion", &main, end.clone(), Value::Null);
    assert_eq!(labels(&keys), [":speed"]);
    let help = editor.ask_at("textDocument/signatureHelp", &main, end, Value::Null);
    assert_eq!(help["signatures"][0]["label"], "(raise angle &key (speed 1))", "{help}");
    let names = json!({ "line": 3, "character": 4 });
    let names = editor.ask_at("textDocument/completion", &main, names, Value::Null);
    assert!(
        labels(&names).is_empty() || labels(&names).iter().all(|name| name.starts_with("arm")),
        "{names}"
    );

    // The user types the rest; the columns are those of UTF-16.
    let range = json!({ "start": { "line": 2, "character": 0 }, "end": { "line": 3, "character": 17 } });
    let change = json!({ "range": range, "text": "(prnit \"é𝄞\" force))" });
    let identity = json!({ "uri": uri(&main), "version": 2 });
    editor.tell("textDocument/didChange", json!({ "textDocument": identity, "contentChanges": [change] }));
    let told =
        editor.diagnostics(&main, |told| told.iter().any(|found| found["code"] == "undefined-function"));
    let wrong = told.iter().find(|found| found["code"] == "undefined-function").expect("just seen").clone();
    let whole = wrong["range"].clone();
    let actions = editor.ask(
        "textDocument/codeAction",
        json!({ "textDocument": { "uri": uri(&main) }, "range": whole, "context": { "diagnostics": [wrong] } }),
    );
    assert_eq!(actions[0]["title"], "Write `print`", "{actions}");
    let edit = &actions[0]["edit"]["changes"][uri(&main)][0];
    assert_eq!(
        (&edit["newText"], &edit["range"]["start"]["character"]),
        (&json!("print"), &json!(1)),
        "{edit}"
    );
    let options = json!({ "tabSize": 8, "insertSpaces": true });
    let edits = editor
        .ask("textDocument/formatting", json!({ "textDocument": { "uri": uri(&main) }, "options": options }));
    assert_eq!(edits.as_array().map(Vec::len), Some(1), "{edits}");
    assert_eq!(edits[0]["newText"], "\n  ", "of a text that cannot be read, lines are indented");
    editor.end();
}

#[test]
fn a_misspelt_cause_is_written_as_declared() {
    let folder = Folder::new("lsp_causes");
    let path = folder.join("turn.esl");
    let mut editor = Editor::new(&folder);
    editor.open(
        &path,
        "(define-cause :wheel-stuck ())\n(defun turn (n)\n  (when n (fail :wheel-stuk n) None))\n",
    );
    let told = editor.diagnostics(&path, |told| !told.is_empty());
    let mut titles = Vec::new();
    for found in told {
        let context = json!({ "diagnostics": [found] });
        let asked =
            json!({ "textDocument": { "uri": uri(&path) }, "range": found["range"], "context": context });
        let actions = editor.ask("textDocument/codeAction", asked);
        for action in actions.as_array().cloned().unwrap_or_default() {
            let edit = &action["edit"]["changes"][uri(&path)][0];
            let start = &edit["range"]["start"]["character"];
            titles.push(format!("{} at {start}", action["title"].as_str().unwrap_or_default()));
        }
    }
    assert_eq!(titles, ["Write `:wheel-stuck` at 16", "Write `nil` at 31"]);
    editor.end();
}

#[test]
fn renaming_changes_what_no_name_means() {
    let folder = Folder::new("lsp_rename");
    let mut editor = Editor::new(&folder);
    let mut count = 0;
    // The text with the first `@` taken out, where the name is; what the edits write, or the refusal.
    let mut rename = |text: &str, new: &str| {
        count += 1;
        let path = folder.join(&format!("{count}.esl"));
        let at = text.find('@').expect("a name is marked");
        editor.open(&path, &text.replace('@', ""));
        let position = json!({ "line": text[..at].matches('\n').count(), "character": at - text[..at].rfind('\n').map_or(0, |at| at + 1) });
        let asked = json!({ "textDocument": { "uri": uri(&path) }, "position": position, "newName": new });
        let answer = editor.request("textDocument/rename", asked);
        let edits = answer["result"]["changes"][uri(&path)].as_array();
        let texts =
            edits.map(|edits| edits.iter().filter_map(|edit| edit["newText"].as_str()).collect::<Vec<_>>());
        texts.map_or_else(|| answer["error"]["message"].to_string(), |texts| texts.join(" "))
    };
    for (text, new, expected) in [
        ("(let ((@x 1)) (print x) (print 'x))", "y", "y y"),
        ("(let ((@x 1) (y 2)) (+ x y))", "y", "\"`y` is another local name here: it is bound on line 1\""),
        (
            "(let ((@x 1))\n (let ((y 2)) (+ x y)))",
            "y",
            "\"`y` is another local name here: it is bound on line 2\"",
        ),
        ("(let ((y 2))\n (let ((@x 1))\n (+ x y)))", "y", "\"`y` on line 3 would mean the renamed one\""),
        ("(let ((@x 1)) (car x))", "list", "list list"),
        ("(flet ((@f () 1)) (f))", "car", "\"`car` belongs to the language\""),
        ("(defun @go-to () 1) (defun turn () 2)", "turn", "\"`turn` is defined already, on line 1\""),
        ("(defun @go-to () 1) (go-to)", "print", "\"`print` belongs to the language\""),
        (
            "(defun @go-to () 1) (flet ((turn () 2)) (go-to))",
            "turn",
            "\"`turn` is another local name here: it is bound on line 1\"",
        ),
        ("(defun go-to (&key @speed) speed) (go-to :speed 1)", "pace", "((:speed pace)) pace"),
        ("(defun go-to (&key (@speed 1)) speed)", "pace", "(:speed pace) pace"),
        ("(defmacro twice (@x) `(list ,x x))", "y", "y y"),
        ("(define-resource arm) (with-resource (@arm) 1)", "leg", "leg leg"),
    ] {
        assert_eq!(rename(text, new), expected, "{text}");
    }
    // Larger and larger parts of a text.
    let path = folder.join("select.esl");
    editor.open(&path, "(when a\n  (go 5))\n");
    let asked =
        json!({ "textDocument": { "uri": uri(&path) }, "positions": [{ "line": 1, "character": 6 }] });
    let mut part = &editor.ask("textDocument/selectionRange", asked)[0];
    let mut starts = Vec::new();
    while part["range"].is_object() {
        starts.push((part["range"]["start"]["line"].clone(), part["range"]["start"]["character"].clone()));
        part = &part["parent"];
    }
    let expected =
        [(1, 6), (1, 3), (1, 2), (0, 1), (0, 0), (0, 0)].map(|(line, column)| (json!(line), json!(column)));
    assert_eq!(starts, expected);
    editor.end();
}

#[test]
fn causes_of_the_language_are_known_with_its_conditions() {
    let folder = Folder::new("lsp_causes");
    let mut editor = Editor::new(&folder);
    let path = folder.join("causes.esl");
    let text = "(with-recovery-procedures ((:division-by-zero (abort))) (fail :timeou)) (error 'type-error)";
    editor.open(&path, text);
    let said = hover(&mut editor, &path, place(text, ":division", 0));
    assert!(said.contains("a kind of `:arithmetic-error`"), "{said}");
    let said = hover(&mut editor, &path, place(text, "type-error", 0));
    assert!(said.contains("*type*") && said.contains("the cause `:type-error`"), "{said}");
    let at = json!({ "line": 0, "character": text.find("timeou").map(|at| at + 6) });
    let offered = editor.ask_at("textDocument/completion", &path, at, json!({}));
    assert_eq!(offered["items"][0]["label"], ":timeout", "{offered}");
    editor.end();
}

#[test]
fn an_end_without_a_goodbye_has_another_status() {
    let folder = Folder::new("lsp_end");
    let mut editor = Editor::new(&folder);
    editor.tell("exit", Value::Null);
    drop(editor.input);
    assert_eq!(finish(editor.child).status, Some(1));
    let mut editor = Editor::new(&folder);
    editor.ask("shutdown", Value::Null);
    drop(editor.input);
    assert_eq!(finish(editor.child).status, Some(0), "the client is gone, but has said so");
}

/// Labels of what is offered where `here` stands in a text, which is taken out of it.
fn offered(editor: &mut Editor, path: &str, text: &str, here: &str) -> Vec<String> {
    let at = place(text, here, 0);
    editor.open(path, &text.replacen(here, "", 1));
    let answer = editor.ask_at("textDocument/completion", path, at, json!({}));
    let items = answer["items"].as_array().cloned().unwrap_or_default();
    items.iter().filter_map(|item| item["label"].as_str()).map(str::to_owned).collect()
}

#[test]
fn blocks_and_tags_are_names_of_their_own() {
    let folder = Folder::new("lsp_blocks");
    let mut editor = Editor::new(&folder);
    let path = folder.join("blocks.esl");
    let text = "(defun search (list)
  (block found
    (let ((found 1))
      (dolist (item list)
        (when item (return-from found item)))
      (tagbody
       found
         (go found))
      (labels ((inner (x) (return-from inner x)))
        (inner found))
      (return-from search found))))
";
    editor.open(&path, text);
    let mut places = |word: &str, nth: usize| -> Vec<(u64, u64)> {
        let more = json!({ "context": { "includeDeclaration": true } });
        let found = editor.ask_at("textDocument/references", &path, place(text, word, nth), more);
        let start = |place: &Value| {
            let start = &place["range"]["start"];
            (start["line"].as_u64().unwrap_or(99), start["character"].as_u64().unwrap_or(99))
        };
        found.as_array().map(|all| all.iter().map(start).collect()).unwrap_or_default()
    };
    let (block, variable, tag) = ([(1, 9), (4, 32)], [(2, 11), (9, 15), (10, 26)], [(6, 7), (7, 13)]);
    assert_eq!(places("found", 0), block);
    assert_eq!(places("found item", 0), block);
    assert_eq!(places("found 1", 0), variable);
    assert_eq!(places("found\n", 1), tag);
    assert_eq!(places("found))\n      (labels", 0), tag);
    assert_eq!(places("inner x", 0), [(8, 16), (8, 39), (9, 9)]);
    assert_eq!(places("search found", 0), [(0, 7), (10, 19)]);
    assert_eq!(
        hover(&mut editor, &path, place(text, "found item", 0)),
        "`found`: block, which begins on line 2"
    );
    let definition =
        editor.ask_at("textDocument/definition", &path, place(text, "found))\n      (labels", 0), json!({}));
    assert_eq!(definition["range"]["start"], json!({ "line": 6, "character": 7 }));
    let offers = offered(&mut editor, &path, "(defun f () (block out (tagbody again (return-from @))))", "@");
    assert_eq!(offers, ["out", "f"]);
    let offers = offered(&mut editor, &path, "(defun f () (block out (tagbody again (go a@))))", "@");
    assert_eq!(offers, ["again"]);
    editor.end();
}

#[test]
fn declarations_and_modules_are_completed() {
    let folder = Folder::with("lsp_declare", &[("arm.esl", ARM)]);
    let mut editor = Editor::new(&folder);
    let path = folder.join("main.esl");
    let mut offers = |text: &str| offered(&mut editor, &path, text, "@");
    assert_eq!(offers("(defun f (x y) (declare (ig@)))"), ["ignore", "ignorable"]);
    assert_eq!(offers("(defun f (left right) (let ((near 1)) (declare (ignore n@))))"), ["near"]);
    assert_eq!(offers("(defun f (left right) (declare (ignorable @)))"), ["left", "right"]);
    assert_eq!(offers("(declaim (optimize (sp@)))"), ["speed", "space"]);
    assert_eq!(offers("(declaim (optimize sp@))"), ["speed", "space"]);
    assert_eq!(offers("(require \"a@\")"), ["arm"]);
    assert_eq!(offers("(require \"js@\")"), ["json"]);
    editor.end();
}

#[test]
fn names_of_the_language_are_told_as_the_reference_has_them() {
    let folder = Folder::new("lsp_reference");
    let mut editor = Editor::new(&folder);
    let path = folder.join("names.esl");
    let text = "(defclass rover () ((speed :initarg :speed)))
(defstruct valve (state (list 1)))
(if (gethash 1 table) (mapcar f list) (error 'error))
(make-instance 'rover :
";
    editor.open(&path, text);
    let mut said = |word: &str| hover(&mut editor, &path, place(text, word, 0));
    assert!(said("gethash").starts_with("```lisp\n(gethash key table &optional default)\n```\n*function*"));
    assert!(said("mapcar").starts_with("```lisp\n(mapcar function list &rest more-lists)\n```\n*function*"));
    assert!(said("if").starts_with("```lisp\n(if test then [else])\n```\n*special operator*"));
    let both = said("error 'error");
    assert!(both.contains("*function*") && both.contains("*type*"), "{both}");
    let at = json!({ "line": 3, "character": 23 });
    let offered = editor.ask_at("textDocument/completion", &path, at, json!({}));
    let labels: Vec<_> =
        offered["items"].as_array().expect("a list").iter().map(|item| &item["label"]).collect();
    assert_eq!(labels, [":speed"]);
    let help = json!({ "line": 2, "character": 4 });
    let help = editor.ask_at("textDocument/signatureHelp", &path, help, json!({}));
    assert_eq!(help["signatures"][0]["label"], "(if test then [else])", "{help}");
    // Slots and parents are not called.
    let document = json!({ "textDocument": { "uri": uri(&path) } });
    let tokens = editor.ask("textDocument/semanticTokens/full", document);
    let numbers: Vec<u64> =
        tokens["data"].as_array().expect("a list").iter().filter_map(Value::as_u64).collect();
    let second_line: Vec<&[u64]> = numbers.chunks(5).skip_while(|token| token[0] == 0).collect();
    let functions =
        second_line.iter().skip(1).take_while(|token| token[0] == 0).filter(|token| token[3] == 5);
    assert_eq!(functions.count(), 2, "the structure's name, and list");
    editor.end();
}

#[test]
fn a_qualifier_of_a_method_moves_nothing() {
    let folder = Folder::with("lsp_methods", &[]);
    let path = folder.join("methods.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, "(defmethod go :before ((r rover) (n (eql 3)) speed) (list r :n))\n");
    let document = json!({ "textDocument": { "uri": uri(&path) } });
    let tokens = editor.ask("textDocument/semanticTokens/full", document);
    let numbers: Vec<u64> =
        tokens["data"].as_array().expect("a list").iter().filter_map(Value::as_u64).collect();
    let mut column = 0;
    let mut told = Vec::new();
    for token in numbers.chunks(5) {
        column += token[1];
        told.push((column, token[3]));
    }
    // `defmethod` is a macro, `go`, `eql` and `list` are functions, `:before` is a keyword, `3` a number, and
    // `:n` a symbol; no parameter is called.
    let expected = [(1, 4), (11, 5), (14, 3), (37, 5), (41, 2), (53, 5), (60, 6)];
    assert_eq!(told, expected);
    editor.end();
}

#[test]
fn forms_about_failures_and_tasks_stand_out() {
    let folder = Folder::with("lsp_stand_out", &[]);
    let path = folder.join("forms.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, "(list 1)\n(spawn (fail :stuck))\n(car 2)\n");
    let range = json!({ "start": { "line": 1, "character": 0 }, "end": { "line": 1, "character": 21 } });
    let asked = json!({ "textDocument": { "uri": uri(&path) }, "range": range });
    let tokens = editor.ask("textDocument/semanticTokens/range", asked);
    // Line, column, length, type, modifiers: of the library (2), and of a failure (4) or a task (8).
    let expected = json!([1, 1, 5, 4, 10, 0, 7, 4, 5, 6, 0, 5, 6, 6, 0]);
    assert_eq!(tokens["data"], expected);
    editor.end();
}
