//! Renaming by `eslc lsp` where names belong together: the renamed program does what it did.

use esl_conformance::folder::Folder;
use esl_conformance::process::run;
use serde_json::{Value, json};

use crate::editor::{Editor, uri};
use crate::eslvm;

/// An editor in which names of texts are changed.
struct Renaming {
    folder: Folder,
    editor: Editor,
    count: u32,
}

impl Renaming {
    fn new(test: &str) -> Renaming {
        let folder = Folder::new(test);
        let editor = Editor::new(&folder);
        Renaming { folder, editor, count: 0 }
    }

    /// Renames what stands where `word` ends in a text. Returns the new text, or the reason against it.
    fn rename(&mut self, text: &str, word: &str, new: &str) -> Result<String, String> {
        self.count += 1;
        let path = self.folder.join(&format!("{}.esl", self.count));
        self.editor.open(&path, text);
        let at = text.find(word).expect("the word is there") + word.len();
        let line = text[..at].matches('\n').count();
        let column = at - text[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let position = json!({ "line": line, "character": column });
        let asked = json!({ "textDocument": { "uri": uri(&path) }, "position": position, "newName": new });
        let answer = self.editor.request("textDocument/rename", asked);
        let Some(edits) = answer["result"]["changes"][uri(&path)].as_array() else {
            return Err(answer["error"]["message"].as_str().expect("there is a reason").to_owned());
        };
        Ok(edited(text, edits))
    }

    /// Checks that a text does the same after a renaming. Returns it.
    #[track_caller]
    fn check(&mut self, text: &str, word: &str, new: &str) -> String {
        let renamed = self.rename(text, word, new).unwrap_or_else(|reason| panic!("{word}: {reason}"));
        assert!(renamed != text, "{word} becomes {new}");
        let before = run(&mut eslvm(&["run", "--clock", "virtual", "-"]), text);
        let after = run(&mut eslvm(&["run", "--clock", "virtual", "-"]), &renamed);
        assert_eq!((before.status, &*before.errors), (Some(0), ""), "{text}");
        assert_eq!((after.status, &*after.errors), (Some(0), ""), "{word} becomes {new}:\n{renamed}");
        assert_eq!(after.output, before.output, "{renamed}");
        renamed
    }
}

/// Makes edits, from the last to the first.
fn edited(text: &str, edits: &[Value]) -> String {
    let starts: Vec<usize> =
        std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
    let number = |value: &Value| value.as_u64().expect("it is a number") as usize;
    let offset = |place: &Value| starts[number(&place["line"])] + number(&place["character"]);
    let mut text = text.to_owned();
    for edit in edits.iter().rev() {
        let range = offset(&edit["range"]["start"])..offset(&edit["range"]["end"]);
        text.replace_range(range, edit["newText"].as_str().expect("it is a text"));
    }
    text
}

const STRUCTURES: &str = "(defstruct point (x 1) (y 2))
(defstruct (spot (:include point (x 5))) z)
(defvar *p* (make-point :y 3))
(setf (point-x *p*) 7)
(print (list (point-p *p*) (point-x (copy-point *p*)) (mapcar #'point-y (list *p*))))
(print (list (spot-x (make-spot)) (point-x (apply #'make-spot :x 9 nil)) (spot-z (make-spot :z 4))))
(print (list (typep *p* 'point) (point-x #S(point :x 8))))
";

#[test]
fn a_structure_is_renamed_with_what_it_makes() {
    let mut renaming = Renaming::new("rename_structures");
    for (word, new) in [
        ("defstruct point", "place"),
        ("(make-point", "make-place"),
        ("(copy-point", "copy-place"),
        ("(point-p", "place-p"),
        ("defstruct (spot", "stain"),
        ("(point-x", "point-column"),
        ("(spot-x", "spot-column"),
        ("(spot-z", "spot-depth"),
    ] {
        renaming.check(STRUCTURES, word, new);
    }
    let renamed = renaming.check(STRUCTURES, "(point-x", "point-column");
    assert!(
        renamed
            .starts_with("(defstruct point (column 1) (y 2))\n(defstruct (spot (:include point (column 5)))")
    );
    for (word, new, reason) in [
        (
            "(make-point",
            "build",
            "is made by the structure `point`, so a new name is of the form `make-NAME`",
        ),
        ("(point-x", "column", "is made by the structure `point`, so a new name is of the form `point-NAME`"),
        ("point (x", "column", "`x` is a slot here; rename an accessor of it"),
        ("defstruct point", "spot", "`spot` is defined already, on line 2"),
    ] {
        let refused = renaming.rename(STRUCTURES, word, new).expect_err(word);
        assert!(refused.contains(reason), "{refused}");
    }
    let own = "(defstruct (point (:conc-name p-) (:constructor new-point (x)) (:copier nil)) x)
(print (p-x (new-point 3)))
";
    let renamed = renaming.check(own, "defstruct (point", "place");
    assert!(renamed.contains("(print (p-x (new-point 3)))"), "{renamed}");
    let refused = renaming.rename(own, "(p-x", "p-y").expect_err("the constructor has a parameter for it");
    assert!(refused.contains("the slot `x` is also named in a form `:constructor`"), "{refused}");
    let child = "(defstruct (spot (:include point)) z)\n";
    let refused = renaming.rename(child, "(spot", "stain").expect_err("the parent is elsewhere");
    assert!(refused.contains("`spot` includes the structure `point`"), "{refused}");
    renaming.editor.end();
}

const CONDITIONS: &str =
    "(define-condition stuck (error) ((wheel :initarg :wheel :initform 0 :reader stuck-wheel)))
(define-condition very-stuck (stuck) ())
(define-cause :lost (:very-stuck))
(defun go-on (&key stuck lost) (list stuck lost))
(print (with-recovery-procedures ((:stuck (abort 'helped))) (error 'very-stuck :wheel 3)))
(print (handler-case (error 'stuck :wheel 4) (stuck (problem) (stuck-wheel problem))))
(print (with-recovery-procedures ((:stuck (abort 'found))) (fail :lost)))
(print (go-on :stuck 1 :lost 2))
";

#[test]
fn a_condition_is_renamed_with_its_cause_and_no_keyword_of_a_call() {
    let mut renaming = Renaming::new("rename_conditions");
    for (word, new) in [
        ("condition stuck", "jammed"),
        ("((:stuck", "jammed"),
        ("((:stuck", ":jammed"),
        ("condition very-stuck", "hopeless"),
        ("(:very-stuck", "hopeless"),
        ("(stuck-wheel", "wheel-of"),
        (":reader stuck-wheel", "wheel-of"),
        (":lost", "astray"),
    ] {
        let renamed = renaming.check(CONDITIONS, word, new);
        assert!(renamed.contains("(go-on :stuck 1 :lost 2)"), "{renamed}");
    }
    let refused = renaming.rename(CONDITIONS, ":lost", "stuck").expect_err("that is a cause");
    assert!(refused.contains("`:stuck` is defined already"), "{refused}");
    let refused = renaming.rename(CONDITIONS, "(error 'stuck :wheel", "x").expect_err("it is an initarg");
    assert!(refused.contains("does not belong to this program"), "{refused}");
    renaming.editor.end();
}

const OTHERS: &str = "(define-property location (robot))
(define-rule (near ?a ?b) (location ?a ?x) (location ?b ?x))
(define-fluent charge 5)
(define-fluent (low) (< charge 3))
(define-input command :capacity 3)
(define-resource arm)
(defclass rover () ((pace :initarg :pace :accessor pace) (number :initform 1 :reader rover-number)))
(defclass fast-rover (rover) ())
(defvar *base* 'home)
(defvar *places* (list *base*))
(defun twice (x) (list x x))
(to-achieve (location robot place) (t (assert (list 'location robot place))))
(achieve (location 'r *base*))
(assert '(location s home))
(print (list (location 'r) (db-query '(near r s)) (twice *places*)))
(signal command 1)
(print (list (low) charge (with-resource (arm) 1)))
(let ((rover (make-instance 'fast-rover :pace 3)))
  (setf (pace rover) (* 2 (pace rover)))
  (print (list (pace rover) (rover-number rover) (slot-value rover 'pace)))
  (with-accessors ((v pace)) rover (print v))
  (with-slots (pace) rover (print pace)))
(deftest it-doubles (is (equal (twice *base*) '(home home))))
";

#[test]
fn names_of_other_definitions_are_found_wherever_they_stand() {
    let mut renaming = Renaming::new("rename_others");
    for (word, new, count) in [
        ("define-property location", "whereabouts", 8),
        ("define-fluent charge", "energy", 3),
        ("define-fluent (low", "weak", 2),
        ("define-input command", "order", 2),
        ("define-resource arm", "leg", 2),
        ("defclass rover", "vehicle", 2),
        (":accessor pace", "tempo", 5),
        (":reader rover-number", "id-of", 2),
        ("defvar *base*", "*start*", 4),
        ("defun twice", "doubled", 3),
        ("(near", "beside", 2),
    ] {
        let renamed = renaming.check(OTHERS, word, new);
        assert_eq!(renamed.matches(new).count(), count, "{word}: {renamed}");
    }
    for (text, word, reason) in [
        (OTHERS, "((pace", "`pace` is a slot here"),
        (OTHERS, "(slot-value rover 'pace", "`pace` is a slot here"),
        ("(defpackage :arm (:use :esl))", ":arm", "`:arm` is a package"),
    ] {
        let refused = renaming.rename(text, word, "other").expect_err(word);
        assert!(refused.contains(reason), "{refused}");
    }
    renaming.editor.end();
}
