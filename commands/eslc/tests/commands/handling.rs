//! `eslc lsp` about failures: those of a function, the share that a form handles, clauses that are missing.

use esl_conformance::folder::Folder;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};

const GRIP: &str = "(declaim (fails :tasks))
(define-cause :stuck ())
(define-cause :late ())
(defun grip (force)
  (when (> force 3) (fail :stuck force))
  (when (> force 9) (fail :late)))
(defun work (force)
  (with-recovery-procedures ((:stuck :retries 2 (retry)))
    (grip force)))
(work 1)
";

/// Titles of the lenses of a text, with their lines.
fn lenses(editor: &mut Editor, path: &str) -> Vec<(String, u64)> {
    let answer = editor.ask("textDocument/codeLens", json!({ "textDocument": { "uri": uri(path) } }));
    let title = |lens: &Value| lens["command"]["title"].as_str().unwrap_or_default().to_owned();
    let line = |lens: &Value| lens["range"]["start"]["line"].as_u64().unwrap_or_default();
    answer.as_array().expect("it is a list").iter().map(|lens| (title(lens), line(lens))).collect()
}

/// Titles of the repairs at a position, each with the text that it writes.
fn repairs(editor: &mut Editor, path: &str, at: (u32, u32), diagnostics: &[Value]) -> Vec<(String, String)> {
    let at = json!({ "line": at.0, "character": at.1 });
    let asked = json!({
        "textDocument": { "uri": uri(path) },
        "range": { "start": at, "end": at },
        "context": { "diagnostics": diagnostics },
    });
    let answer = editor.ask("textDocument/codeAction", asked);
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let shown =
        |action: &Value| (text(&action["title"]), text(&action["edit"]["changes"][uri(path)][0]["newText"]));
    answer.as_array().expect("it is a list").iter().map(shown).collect()
}

#[test]
fn an_editor_shows_what_can_fail_and_who_handles_it() {
    let folder = Folder::with("lsp_handling", &[("grip.esl", GRIP)]);
    let path = folder.join("grip.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, GRIP);
    editor.refreshed();

    let mut told = editor.diagnostics(&path, |told| !told.is_empty());
    let messages: Vec<&str> = told.iter().filter_map(|found| found["message"].as_str()).collect();
    let ends = |cause: &str| format!("no clause takes {cause}, which ends the task `main`");
    assert_eq!(messages, [ends(":late"), ends(":stuck")]);
    assert_eq!(
        (&told[0]["code"], &told[0]["range"]["start"]["line"]),
        (&json!("unhandled-failure"), &json!(0))
    );
    assert_eq!(told[0]["relatedInformation"][0]["location"]["range"]["start"]["line"], 5);

    let mut hover = |line: u32, character: u32| {
        let at = json!({ "line": line, "character": character });
        let answer = editor.ask_at("textDocument/hover", &path, at, Value::Null);
        answer["contents"]["value"].as_str().unwrap_or_default().to_owned()
    };
    // A call, and a definition.
    for place in [(8, 6), (3, 8)] {
        let shown = hover(place.0, place.1);
        assert!(shown.contains("May fail with `:late`, `:stuck`."), "{shown}");
        assert!(shown.contains("- `:late` begins in `grip`, line 6"), "{shown}");
    }
    let shown = hover(7, 8);
    assert!(shown.contains("This form handles 1 of 2: :stuck; not :late."), "{shown}");

    let lens = |line| vec![("handles 1 of 2: :stuck; not :late".to_owned(), line)];
    assert_eq!(lenses(&mut editor, &path), lens(7));
    let clause = "\n                             (:late :retries 1 (retry))".to_owned();
    assert_eq!(
        repairs(&mut editor, &path, (7, 5), &[]),
        [("Add a clause for :late".to_owned(), clause.clone())]
    );
    let (title, wrapped) = repairs(&mut editor, &path, (8, 6), &[]).remove(0);
    assert_eq!(title, "Recover from :late, :stuck here");
    assert!(wrapped.ends_with("(:stuck :retries 1 (retry)))\n      (grip force))"), "{wrapped}");
    let expected = [
        ("Declare :late".to_owned(), " :late".to_owned()),
        ("Add a clause for :late to the form on line 8".to_owned(), clause),
    ];
    assert_eq!(repairs(&mut editor, &path, (0, 10), &[told.remove(0)]), expected);

    // Before the text is looked at again, what is behind a change is where it was.
    let start = json!({ "line": 0, "character": 0 });
    let change = json!({ "range": { "start": start, "end": start }, "text": "; Grips.\n(" });
    let identity = json!({ "uri": uri(&path), "version": 2 });
    editor.tell("textDocument/didChange", json!({ "textDocument": identity, "contentChanges": [change] }));
    assert_eq!(lenses(&mut editor, &path), lens(8));
    // A text that does not compile keeps the findings, and loses them when it is closed.
    editor.diagnostics(&path, |told| told.iter().any(|found| found["code"] == "unclosed-list"));
    assert_eq!(lenses(&mut editor, &path), lens(8));
    editor.end();
}

#[test]
fn an_editor_is_warned_of_clauses_and_orders() {
    let text = "(define-resource arm)
(define-resource belt)
(define-cause :stuck ())
(define-cause :lost ())
(defun grip (force)
  (when (> force 3) (fail :stuck force)))
(spawn () (with-resource (arm) (with-resource (belt) (sleep 1))))
(spawn () (with-resource (belt) (with-resource (arm) (sleep 1))))
(with-recovery-procedures ((:stuck (abort))
                           (:lost (abort)))
  (grip 1))
(with-recovery-procedures ((:type-error :retries :infinite (retry)))
  (print (car (grip 2))))
";
    let folder = Folder::with("lsp_clauses", &[("grip.esl", text)]);
    let path = folder.join("grip.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, text);
    let told = editor.diagnostics(&path, |told| !told.is_empty());
    let mut found: Vec<(u64, &str)> = told
        .iter()
        .map(|found| {
            let line = found["range"]["start"]["line"].as_u64().unwrap_or_default();
            (line, found["code"].as_str().unwrap_or_default())
        })
        .collect();
    found.sort_unstable();
    assert_eq!(found.len(), 3, "{told:?}");
    assert_eq!(found[1..], [(9, "clause-never-applies"), (11, "endless-retry")]);
    assert_eq!(found[0].1, "resource-order");
    editor.end();
}

/// Repairs leave comments with what they are about, follow tabs, and are offered for calls only.
#[test]
fn repairs_keep_a_text_readable() {
    let text = "(define-cause :a ())\n(define-cause :b ())\n(defun g (x) (if x (fail :a) (fail :b)))\n\
        (declaim (fails (g f) :a :b))\n(defun f (x)\n\t(with-recovery-procedures ((:a (abort 1)) ; all of it\n\
        \t\t)\n\t\t(flet ((g (x) x))\n\t\t\t(g x))\n\t\t(g x)))\n(print '(g 1))\n";
    let folder = Folder::with("lsp_readable", &[("f.esl", text)]);
    let path = folder.join("f.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, text);
    editor.refreshed();
    let blanks = " ".repeat("(with-recovery-procedures (".len());
    let clause = ("Add a clause for :b".to_owned(), format!("\n\t{blanks}(:b :retries 1 (retry))"));
    assert_eq!(repairs(&mut editor, &path, (5, 3), &[]), [clause]);
    let at = json!({ "line": 5, "character": 3 });
    let asked = json!({
        "textDocument": { "uri": uri(&path) }, "range": { "start": at, "end": at }, "context": { "diagnostics": [] },
    });
    let answer = editor.ask("textDocument/codeAction", asked);
    let place = &answer[0]["edit"]["changes"][uri(&path)][0]["range"]["start"];
    let line = text.lines().nth(5).expect("it is there");
    assert_eq!(*place, json!({ "line": 5, "character": line.len() }), "behind the comment");
    let wrapped = repairs(&mut editor, &path, (9, 3), &[]).remove(0).1;
    assert!(
        wrapped.contains(&format!("\n\t\t{blanks}(:b")) && wrapped.ends_with("\n\t\t  (g x))"),
        "{wrapped}"
    );
    for (at, what) in [((3, 17), "a declaration"), ((7, 10), "a definition"), ((10, 9), "data")] {
        assert_eq!(repairs(&mut editor, &path, at, &[]), [], "{what}");
    }

    let text = "(defun f ()\n  (list 1 ; one (\n";
    let path = folder.join("open.esl");
    editor.open(&path, text);
    let told = editor.diagnostics(&path, |told| told.iter().any(|found| found["code"] == "unclosed-list"));
    let context = json!({ "diagnostics": told });
    let whole = &context["diagnostics"][0]["range"];
    let asked = json!({ "textDocument": { "uri": uri(&path) }, "range": whole, "context": context });
    let answer = editor.ask("textDocument/codeAction", asked);
    let edit = &answer[0]["edit"]["changes"][uri(&path)][0];
    assert_eq!(edit["range"]["start"], json!({ "line": 1, "character": 9 }), "before the comment: {answer}");
    editor.end();
}

/// The lines of repairs end as those of the text do.
#[test]
fn repairs_keep_the_ends_of_lines() {
    let text = GRIP.replace('\n', "\r\n") + "(defun idle (force)\r\n  0)\r\n(grip\r\n  (+ 1 2))\r\n";
    let folder = Folder::with("lsp_line_ends", &[("grip.esl", &text)]);
    let path = folder.join("grip.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, &text);
    editor.refreshed();
    let told = editor.diagnostics(&path, |told| told.iter().any(|found| found["code"] == "unused-variable"));
    let unused = told.into_iter().filter(|found| found["code"] == "unused-variable").collect::<Vec<_>>();
    for (at, diagnostics, count) in [((7, 5), &[][..], 1), ((12, 2), &[], 3), ((10, 13), &unused, 1)] {
        let (title, new) = repairs(&mut editor, &path, at, diagnostics).remove(0);
        let breaks = (new.matches("\r\n").count(), new.matches('\n').count());
        assert_eq!(breaks, (count, count), "{title}: {new:?}");
    }
    editor.end();
}

/// A form that has no clause yet has a lens as well, and the repair that adds the first one.
#[test]
fn a_form_without_clauses_shows_its_failures() {
    let text = "(define-cause :stuck ())
(defun grip () (fail :stuck))
(defun work ()
  (with-recovery-procedures ()
    (grip)))
";
    let folder = Folder::with("lsp_no_clauses", &[("grip.esl", text)]);
    let path = folder.join("grip.esl");
    let mut editor = Editor::new(&folder);
    editor.open(&path, text);
    editor.refreshed();
    assert_eq!(lenses(&mut editor, &path), [("handles 0 of 1; not :stuck".to_owned(), 3)]);
    let clause = ("Add a clause for :stuck".to_owned(), "(:stuck :retries 1 (retry))".to_owned());
    assert_eq!(repairs(&mut editor, &path, (3, 4), &[]), [clause]);
    editor.end();
}
