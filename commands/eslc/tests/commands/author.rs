//! Commands of `eslc` for authors: formatting, completions and manual pages, new projects.

use esl_conformance::folder::Folder;
use esl_conformance::process::run;

use crate::eslc;

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
fn blanks_parentheses_and_long_lines_are_put_right() {
    let call = format!("(list {} 'end)", "'a-name-of-20-columns ".repeat(5));
    let text = format!("( when   a\n\n\n  (b)\n)\n{call}\n");
    let names = "'a-name-of-20-columns ".repeat(4);
    let expected =
        format!("(when a\n\n  (b))\n(list {}\n      'a-name-of-20-columns 'end)\n", names.trim_end());
    assert_eq!(format(&["-"], &text), (0, expected.clone(), String::new()));
    assert_eq!(run(eslc(&["fmt", "-"]).args([] as [&str; 0]), &*text).output, expected, "the short name");
}

#[test]
fn a_folder_without_programs_is_an_error() {
    let folder = Folder::with("format_nothing", &[("notes.txt", "")]);
    let (status, _, messages) = format(&[&folder.path().display().to_string()], "");
    assert!(status == 2 && messages.contains("holds no file `*.esl`"), "{messages}");
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

#[test]
fn shells_and_man_know_the_commands() {
    let folder = Folder::new("completions_and_man");
    for (make, name) in [(eslc as fn(&[&str]) -> std::process::Command, "eslc"), (crate::eslvm, "eslvm")] {
        for shell in ["bash", "zsh", "fish"] {
            let done = run(&mut make(&["completions", shell]), "");
            assert_eq!(done.status, Some(0));
            assert!(done.output.contains("completions"), "{name} {shell}");
        }
        let pages = folder.join("man");
        assert_eq!(run(&mut make(&["man", &pages]), "").status, Some(0));
        let page = std::fs::read_to_string(folder.path().join("man").join(format!("{name}.1")));
        assert!(page.expect("it was written").contains(".SH SYNOPSIS"));
        assert!(run(&mut make(&["man"]), "").output.contains(".SH SYNOPSIS"));
    }
}

#[test]
fn a_new_project_runs_and_its_tests_pass() {
    let folder = Folder::new("new_project");
    let project = folder.join("rover");
    let done = run(&mut eslc(&["new", &project]), "");
    assert_eq!((done.status, &*done.output), (Some(0), ""), "{}", done.errors);
    let main = format!("{project}/main.esl");
    let done = run(&mut crate::eslvm(&["run", "--clock", "virtual", &main]), "");
    assert_eq!((done.status, &*done.errors), (Some(0), ""));
    assert!(done.output.contains("(PICTURE HILL)"), "{}", done.output);
    let done = run(&mut crate::eslvm(&["test", &format!("{project}/test.esl")]), "");
    assert!(done.status == Some(0) && done.output.contains("3 passed"), "{}", done.output);
    assert_eq!(format(&["--check", &project], ""), (0, String::new(), String::new()));
    let readme = std::fs::read_to_string(format!("{project}/README.md")).expect("it was written");
    assert!(readme.starts_with("# rover\n"), "{readme}");
    assert_eq!(run(&mut eslc(&["new", &project]), "").status, Some(2), "it is there already");
}

#[test]
fn the_projects_own_files_are_formatted() {
    // Programs that show what the reader refuses cannot be among them.
    let root = esl_conformance::root();
    let folders = [
        "stdlib",
        "world/modules",
        "robots/modules",
        "plans/modules",
        "plans/tests",
        "examples",
        "benches",
        "playground",
        "commands/eslc/src/new/template",
    ];
    let folders = folders.into_iter().chain(["conformance/soak"]);
    let programs = std::fs::read_dir(root.join("conformance/programs")).expect("the folder can be listed");
    let programs = programs.map(|entry| entry.expect("the folder can be listed").path());
    let programs = programs.filter(|path| path.is_dir() && !path.ends_with("diagnostics"));
    let folders: Vec<String> = folders
        .map(|folder| root.join(folder))
        .chain(programs)
        .map(|folder| folder.display().to_string())
        .collect();
    let arguments: Vec<&str> = std::iter::once("--check").chain(folders.iter().map(|path| &**path)).collect();
    let (status, output, errors) = format(&arguments, "");
    assert_eq!(status, 0, "run `eslc format` on these:\n{output}{errors}");
}
