//! `eslc format`: what it writes, shows and refuses.

use esl_conformance::process::run;

use crate::eslc;
use crate::folder::Folder;

const MODULE: &str = "(defmacro at-place (place &body body)\n  `(list ,place ,@body))\n";
const FLAT: &str = "(require \"places\")\n(at-place 'home\n(list 1\n2)) ; done\n";
const INDENTED: &str = "(require \"places\")\n(at-place 'home\n  (list 1\n        2)) ; done\n";

/// Returns the exit status of `eslc format` with these arguments, and what it prints.
fn format(arguments: &[&str], input: &str) -> (i32, String, String) {
    let done = run(eslc(&["format"]).args(arguments), input);
    (done.status.expect("no signal ends it"), done.output, done.errors)
}

#[test]
fn files_are_formatted_in_place_with_the_macros_of_their_modules() {
    let folder = Folder::with("format_in_place", &[("places.esl", MODULE), ("main.esl", FLAT)]);
    let main = folder.join("main.esl");
    assert_eq!(format(&["--check", &main], "").0, 1);
    let (status, diff, _) = format(&["--diff", &main], "");
    assert_eq!(status, 1);
    assert!(diff.contains("-(list 1\n") && diff.contains("+  (list 1\n"), "{diff}");
    assert_eq!(std::fs::read_to_string(&main).expect("it is there"), FLAT, "nothing was written");
    assert_eq!(format(&[&folder.path().display().to_string()], ""), (0, String::new(), String::new()));
    assert_eq!(std::fs::read_to_string(&main).expect("it is there"), INDENTED);
    assert_eq!(format(&["--check", &main], ""), (0, String::new(), String::new()));
}

#[test]
fn standard_input_is_formatted_to_standard_output() {
    assert_eq!(format(&["-"], "(when a\nb)"), (0, "(when a\n  b)\n".into(), String::new()));
    assert_eq!(format(&["-", "--lines", "3:3"], "(when a\nb\nc)\n").1, "(when a\nb\n  c)\n");
    assert_eq!(format(&["-", "--lines", "3:2"], "").0, 2);
    assert_eq!(format(&["no-such-file.esl"], "").0, 2);
}

#[test]
fn a_text_without_its_ends_is_left_as_it_is() {
    let folder = Folder::with("format_broken", &[("broken.esl", "(when a\nb\n")]);
    let broken = folder.join("broken.esl");
    let (status, _, messages) = format(&[&broken], "");
    assert_eq!(status, 3);
    assert!(messages.contains("unclosed-list") && messages.contains("repair it first"), "{messages}");
    assert_eq!(std::fs::read_to_string(&broken).expect("it is there"), "(when a\nb\n");
}
