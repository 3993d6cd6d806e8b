//! `eslvm test --inject`: the table, its forms, its exit status, the defects that it finds in the spacecraft
//! of the examples.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// Returns the exit status and the output of `eslvm test` with these arguments, in a folder.
fn test(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String) {
    let arguments = [&["test"], arguments].concat();
    let run = process::run(eslvm(&arguments).current_dir(folder.path()), "");
    (run.status, run.output + &run.errors)
}

/// The blocks of the chapter in a language.
fn blocks(language: &str) -> Vec<String> {
    let path = esl_conformance::root().join("docs/manual/faults.md");
    let chapter = std::fs::read_to_string(path).expect("the chapter is there");
    let begin = format!("```{language}\n");
    let part = |part: &str| part.split_once("```").map(|(block, _)| block.to_string());
    chapter.split(&begin).skip(1).filter_map(part).collect()
}

#[test]
fn the_tables_of_the_chapter_are_those_of_its_program() {
    let folder = Folder::new("injecting-chapter");
    folder.file("drive.esl", blocks("lisp").concat());
    for block in blocks("text") {
        let (command, expected) = block.split_once('\n').expect("a command comes first");
        let arguments = command.strip_prefix("$ eslvm test ").expect("it is the command");
        let (status, output) = test(&folder, &arguments.split(' ').collect::<Vec<_>>());
        assert_eq!(output, expected, "{command}");
        assert_eq!(status, Some(1), "{command}");
    }
}

#[test]
fn a_table_has_several_forms() {
    let folder = Folder::new("injecting-forms");
    folder.file("drive.esl", blocks("lisp").concat());
    folder.file("look.esl", "(define-mock look () 7) (deftest looks (is (eql (with-timeout 100 (look)) 7)))");
    let (status, csv) = test(&folder, &["--inject", "--format", "csv", "look.esl"]);
    assert!(
        csv.contains("look.esl,LOOKS,0,look#1:never,look,1,never,0.000,main,\"failed, cleanups run\",,"),
        "{csv}"
    );
    assert_eq!(status, Some(0), "no row is bad: {csv}");
    let (_, markdown) = test(&folder, &["--inject", "--format", "md", "look.esl"]);
    assert!(
        markdown.contains("| look#1:late | look | 1 | late | 0.000 | main | recovered |  |  |"),
        "{markdown}"
    );
    let (status, json) = test(&folder, &["--inject", "--format", "json", "drive.esl"]);
    assert!(status == Some(1) && json.contains("\"outcome\": \"left on\""), "{json}");
    folder.file("injected.json", &json);
    let arguments = ["failures", "--fmea", "--injected", "injected.json", "--format", "csv", "drive.esl"];
    let run = process::run(crate::eslc(&arguments).current_dir(folder.path()), "");
    let fmea = run.output;
    let has = |text: &str| assert!(fmea.contains(text), "{text} is not in\n{fmea}");
    has("drive,:wheel-stuck,drive.esl:11,leaves drive,");
    has("left on 1× (drive#1+:wheel-stuck)");
    has("careless-drive (injected), careful-drive (injected)");
    has("drive,never answers,injected,none,none,none,");
    folder.file("wrong.json", "[]");
    let arguments = ["failures", "--fmea", "--injected", "wrong.json", "drive.esl"];
    let run = process::run(crate::eslc(&arguments).current_dir(folder.path()), "");
    assert_eq!(run.status, Some(2));
    assert!(
        run.errors.contains("it is not a table of `eslvm test --inject --format json`"),
        "{}",
        run.errors
    );
}

#[test]
fn wrong_names_and_tests_that_fail_are_told() {
    let folder = Folder::new("injecting-wrong");
    folder.file("t.esl", "(define-mock look () 7)\n(deftest looks (is (eql (look) 8)))");
    folder.file(
        "good.esl",
        "(define-mock look () 7)\n(deftest looks (is (eql (look) 7)))\n(deftest idle (is t))",
    );
    let (status, output) = test(&folder, &["--inject", "t.esl"]);
    let problem = "  its undisturbed run is not one to compare with: a check did not hold\n";
    assert!(status == Some(1) && output.ends_with(problem), "{output}");
    folder.file("empty.esl", "(deftest empty)");
    let (_, output) = test(&folder, &["--inject", "empty.esl"]);
    assert!(output.contains(" it has no check: "), "{output}");
    let (status, output) = test(&folder, &["--inject-only", "look#9:melted", "good.esl"]);
    assert!(status == Some(2) && output.contains("no fault is called `look#9:melted`"), "{output}");
    let (_, output) = test(&folder, &["--inject", "--filter", "idle", "good.esl"]);
    assert!(output.ends_with("  undisturbed: 0.0 s; no operation is called\n"), "{output}");
    let (status, output) = test(&folder, &["--inject", "--filter", "nothing", "good.esl"]);
    assert_eq!(status, Some(5), "{output}");
}

/// A function of a module that a world answers fails as the module does, but not as for wrong arguments.
#[test]
fn functions_of_modules_fail_with_their_causes() {
    let folder = Folder::new("injecting-modules");
    let text = "(require :http)
        (deftest asks
          (with-world ((:answer (http:get *) :with \"x\"))
            (is (equal (http:get \"http://lab/\") \"x\"))))";
    folder.file("ask.esl", text);
    let (_, output) = test(&folder, &["--inject", "ask.esl"]);
    for cause in ["http-error", "socket-error", "timeout", "never"] {
        assert!(output.contains(&format!("\n  get#1:{cause} ")), "{cause}: {output}");
    }
    assert!(!output.contains("type-error") && !output.contains("simple-error"), "{output}");
}

/// The spacecraft of the examples with the faults of its world. Two rows are bad, which empty the battery:
/// nothing replaces wheels that never answer again, and the last turn has no limit. Three defects put into a
/// copy of its executive are found.
#[test]
fn defects_of_the_spacecraft_are_found() {
    let folder = Folder::new("injecting-spacecraft");
    let root = esl_conformance::root().join("examples/spacecraft");
    let read = |name: &str| std::fs::read_to_string(root.join(name)).expect("it is there");
    folder.file("scripted.esl", read("scripted.esl"));
    let executive = read("executive.esl");
    let bad_rows = |text: &str| {
        folder.file("executive.esl", text);
        let (status, output) = test(&folder, &["--inject", "--format", "csv", "scripted.esl"]);
        assert_eq!(status, Some(1), "{output}");
        let bad = output.lines().skip(1).filter(|line| line.contains(",bad,"));
        let cells = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            format!("{} {}", cells[3], cells[9])
        };
        bad.map(cells).collect::<Vec<String>>()
    };
    let empty_battery = ["slew#1+:never INVARIANT FALSE", "slew#12:never INVARIANT FALSE"];
    assert_eq!(bad_rows(&executive), empty_battery);
    let finds = |name: &str, (old, new): (&str, &str)| {
        assert_eq!(executive.matches(old).count(), 1, "{old}");
        let bad = bad_rows(&executive.replace(old, new));
        assert!(bad.iter().any(|row| row == name), "{name} is not in {bad:?}");
    };
    // The camera may hang for ever.
    finds(
        "expose#1+:never HANGS",
        ("(with-timeout 30\n        (expose target)", "(progn\n        (expose target)"),
    );
    // A wheel is reset for ever.
    let endless = (":retries 4 :backoff (2 2 30)", ":retries :infinite :backoff (2 2 30)");
    finds("slew#1+:wheel-stuck INVARIANT FALSE", endless);
    // The spacecraft points at the sun only if nothing ends the flight before.
    let flight = "(unwind-protect\n       (loop\n         (with-recovery-procedures (((:battery-low";
    finds("slew#12:aborted LEFT ON", (flight, &flight.replace("unwind-protect", "progn")));
}
