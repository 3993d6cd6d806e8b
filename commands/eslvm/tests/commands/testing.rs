//! `eslvm test`: verdicts, what is said of failures, selections, reports, exit statuses.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

const TESTS: &str = "
(defun double (n) (if (> n 3) (* 3 n) (* 2 n)))
(deftest doubling (is (eql (double 2) 4)))
(deftest doubling-much (is (equal (list 1 (double 4)) '(1 8))) (is (eql (double 1) 2)))
(deftest unchecked (double 1))
(deftest failing (is t) (fail :lost 'in 'space))
(deftest expected :expect-failure :lost (fail :lost))
(deftest other-failure :expect-failure :lost (fail :found))
(deftest unlucky :seeds 20 (is (choose t t (not (eql (length (list-tasks)) 1)))))
(deftest waiting (is t) (wait-for-event (make-event 'never)))
(deftest leaving (is t) (exit 7))
(deftest racing :explore t
  (let ((n 0))
    (task-net (a (signal (make-event)) (incf n)) (b (incf n (choose 1 1 2))))
    (is (eql n 2))))
(deftest left-behind (spawn (loop (sleep 1))) (is t))
(deftest endless (is t) (loop))
";

fn folder(name: &str) -> Folder {
    Folder::with(name, &[("tests.esl", TESTS)])
}

/// Returns the exit status and the output of `eslvm test` with these arguments, in a folder.
fn test(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String) {
    let arguments = [&["test"], arguments].concat();
    let run = process::run(eslvm(&arguments).current_dir(folder.path()), "");
    (run.status, run.output)
}

#[test]
fn calls_of_the_library_are_shown_on_request() {
    let folder = folder("testing-full");
    folder.file("sort.esl", "(deftest sorts (is (sort (list 1 'a) (lambda (x y) (< x y)))))");
    let (status, folded) = test(&folder, &["sort.esl"]);
    assert_eq!(status, Some(1), "{folded}");
    assert!(folded.contains("  in STABLE-SORT, of the library") && !folded.contains("stdlib/"), "{folded}");
    let (status, full) = test(&folder, &["--full", "sort.esl"]);
    assert_eq!(status, Some(1), "{full}");
    assert!(full.contains("  in STABLE-SORT, stdlib/sort.esl:"), "{full}");
    let frames: Vec<&str> = full.lines().map(str::trim).filter(|line| line.starts_with("in ")).collect();
    assert!(frames[0].starts_with("in (LAMBDA), sort.esl:1:"), "{frames:#?}");
}

/// A file whose own forms use up the budget is told of in the words of the command.
#[test]
fn the_budget_is_also_that_of_the_file() {
    let folder = Folder::with("testing-budget", &[("t.esl", "(loop)\n(deftest one (is t))")]);
    let run = process::run(eslvm(&["test", "--budget", "10000", "t.esl"]).current_dir(folder.path()), "");
    let expected = "eslvm: t.esl has no tests to run: its top-level forms have spent the budget of ticks; raise it by \
                    --budget\n";
    assert_eq!((run.status, run.errors.as_str()), (Some(1), expected));
}

#[test]
fn failures_are_shown_with_what_repeats_them() {
    let folder = folder("testing-all");
    let (status, output) = test(&folder, &["--jobs", "2", "--budget", "3000000", "tests.esl"]);
    assert_eq!(status, Some(1), "{output}");
    for line in [
        "tests.esl\n  passed  DOUBLING\n  FAILED  DOUBLING-MUCH, seed 0: a check did not hold\n",
        "  (LIST 1 (DOUBLE 4)) is (1 12)\n",
        "they differ at element 1: 12 and 8\n",
        "again: eslvm test tests.esl --filter DOUBLING-MUCH --seed 0\n",
        "  FAILED  UNCHECKED, seed 0: it has no check: use IS, SIGNALS or FAILS\n",
        "  FAILED  FAILING, seed 0: a failure has left it\n          A failure of cause :LOST with",
        "  passed  EXPECTED\n",
        "  FAILED  OTHER-FAILURE, seed 0: a check did not hold\n          A failure :LOST was expected",
        "  FAILED  UNLUCKY, seed ",
        "  FAILED  WAITING, seed 0: it waits for an event that cannot occur\n          Deadlock:",
        "  FAILED  LEAVING, seed 0: it has ended the run with the status 7\n",
        "  FAILED  RACING: under a schedule, a check did not hold (grain variables, timers idle; ",
        "  passed  LEFT-BEHIND, explored: complete, ",
        "  FAILED  ENDLESS, seed 0: its budget of ticks is spent",
        "\n3 passed, 9 failed\n",
    ] {
        assert!(output.contains(line), "{line} is not in\n{output}");
    }
    // The command that is shown repeats the failure.
    let seed = output.split("--filter UNLUCKY --seed ").nth(1).and_then(|rest| rest.lines().next());
    let seed = seed.unwrap_or_else(|| panic!("no seed in\n{output}"));
    let again = test(&folder, &["tests.esl", "--filter", "UNLUCKY", "--seed", seed]);
    assert_eq!(again.0, Some(1), "{}", again.1);
    // A seed that is given is the only one.
    let other = test(&folder, &["tests.esl", "--filter", "UNLUCKY", "--seed", "0"]);
    assert_eq!(other.0, Some(0), "{}", other.1);
}

#[test]
fn tests_are_selected_and_reported() {
    let folder = folder("testing-some");
    let (status, output) = test(&folder, &["tests.esl", "--filter", "doubling", "--junit", "report.xml"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.ends_with("1 passed, 1 failed\n"), "{output}");
    let report = std::fs::read_to_string(folder.join("report.xml")).expect("the report is there");
    assert!(report.contains("<testsuites tests=\"2\" failures=\"1\">"), "{report}");
    assert!(report.contains("<testcase name=\"DOUBLING\" classname=\"tests.esl\""), "{report}");
    assert!(
        report.contains("<failure message=\"a check did not hold\">(EQUAL (LIST 1 (DOUBLE 4))"),
        "{report}"
    );
    let (status, output) = test(&folder, &["tests.esl", "--filter", "expected"]);
    assert_eq!((status, &*output), (Some(0), "tests.esl\n  passed  EXPECTED\n1 passed, 0 failed\n"));
}

#[test]
fn files_that_cannot_be_tested_have_a_status_of_their_own() {
    let folder = folder("testing-none");
    folder.file("broken.esl", "(deftest broken (is (let 5)))");
    folder.file("lost.esl", "(fail :lost)");
    assert_eq!(test(&folder, &["tests.esl", "broken.esl"]).0, Some(3));
    assert_eq!(test(&folder, &["missing.esl"]).0, Some(2));
    assert_eq!(test(&folder, &["lost.esl"]).0, Some(1));
}

/// Returns the exit status and both outputs of `eslvm test` with these arguments, in a folder.
fn test_with_errors(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String, String) {
    let arguments = [&["test"], arguments].concat();
    let run = process::run(eslvm(&arguments).current_dir(folder.path()), "");
    (run.status, run.output, run.errors)
}

#[test]
fn without_a_test_nothing_has_passed() {
    let folder = folder("testing-nothing");
    folder.file("plan.esl", "(defun drive () 1)");
    folder.file("docs/plan.esl", "(defun drive () 1)");
    for (arguments, said) in [
        (&["plan.esl"][..], "plan.esl has no tests: `deftest` defines one"),
        (&["tests.esl", "--filter", "xyz"], "no name of a test contains `xyz`; there are 12 tests in all"),
        (&["docs"], "no file with tests is in docs: their names are test.esl, *_test.esl or *-test.esl"),
    ] {
        let (status, output, errors) = test_with_errors(&folder, arguments);
        assert_eq!((status, &*output), (Some(5), "0 passed, 0 failed\n"), "{errors}");
        assert!(errors.contains(said), "{errors}");
    }
    let (status, ..) = test_with_errors(&folder, &["docs", "--junit", "report.xml"]);
    assert_eq!(status, Some(5));
    let report = std::fs::read_to_string(folder.join("report.xml")).expect("the report is there");
    assert!(report.contains("<testsuites tests=\"0\""), "{report}");
    // One file without tests among others is named.
    let (status, _, errors) = test_with_errors(&folder, &["plan.esl", "tests.esl", "--filter", "expected"]);
    assert_eq!(status, Some(0), "{errors}");
    assert!(errors.contains("plan.esl has no tests"), "{errors}");
}

#[test]
fn tests_are_found_in_folders() {
    let passing = |name: &str| format!("(deftest {name} (is t))");
    let folder = Folder::new("testing-folders");
    folder.file("drive_test.esl", passing("driving"));
    folder.file("arm-test.esl", passing("reaching"));
    folder.file("plan.esl", "(deftest never-run (is nil))");
    folder.file("tests/deep/camera.esl", passing("looking"));
    folder.file("target/copy_test.esl", passing("copied"));
    let names = ["DRIVING", "REACHING", "LOOKING"];
    for arguments in [&[][..], &["."], &["drive_test.esl", "."]] {
        let (status, output, errors) = test_with_errors(&folder, arguments);
        assert_eq!((status, &*errors), (Some(0), ""), "{output}");
        assert!(output.ends_with("\n3 passed, 0 failed\n"), "{output}");
        assert!(names.iter().all(|name| output.contains(&format!("  passed  {name}\n"))), "{output}");
    }
    let (status, output, _) = test_with_errors(&folder, &["tests"]);
    assert_eq!((status, output.contains("1 passed, 0 failed")), (Some(0), true), "{output}");
}

#[test]
fn two_tests_of_one_name_are_an_error() {
    let folder = Folder::new("testing-twice");
    folder.file(
        "twice.esl",
        "(deftest moving\n  (is nil))\n(deftest other (is t))\n(deftest moving\n  (is t))\n",
    );
    let (status, output, errors) = test_with_errors(&folder, &["twice.esl"]);
    assert_eq!((status, &*output), (Some(3), ""), "{errors}");
    let said = "twice.esl has two tests `MOVING`, at twice.esl:2:3 and at twice.esl:5:3: rename one";
    assert!(errors.contains(said), "{errors}");
}

#[test]
fn small_tests_of_several_tasks_are_explored_unasked() {
    let text = "(defvar *n* 0)
        (defun one-more (n) (+ n 1))
        (defun update () (setq *n* (one-more *n*)))
        (deftest alone (update) (is (= *n* 1)))
        (deftest lucky (task-net (a (update)) (b (update))) (is (= *n* 2)))
        (deftest careful
          (task-net (a (without-interrupts (update))) (b (without-interrupts (update))))
          (is (= *n* 2)))
        (deftest left-out :explore nil (task-net (a (update)) (b (update))) (is (= *n* 2)))";
    let folder = Folder::with("testing-unasked", &[("tests.esl", text)]);
    let (status, output) = test(&folder, &["tests.esl", "--findings", "sums.findings.json"]);
    assert_eq!(status, Some(1), "{output}");
    for line in [
        "  passed  ALONE\n  FAILED  LUCKY: under a schedule, a check did not hold (grain variables, ",
        "has to stop before",
        "again: eslvm test tests.esl --filter LUCKY\n",
        "  passed  CAREFUL, explored: complete, ",
        "  passed  LEFT-OUT\n",
        "3 passed, 1 failed\n",
    ] {
        assert!(output.contains(line), "{line}: {output}");
    }
    // The same schedule for editors.
    let found = std::fs::read(folder.join("sums.findings.json")).expect("it is written");
    let found: serde_json::Value = serde_json::from_slice(&found).expect("it is JSON");
    let findings = found["findings"].as_array().expect("it has findings");
    assert_eq!((findings.len(), &findings[0]["test"]), (1, &"LUCKY".into()), "{found}");
    assert_eq!(findings[0]["again"], "eslvm test tests.esl --filter LUCKY", "{found}");
    let steps = findings[0]["steps"].as_array().expect("it has steps");
    let is_switch = |step: &serde_json::Value| step["stops"]["place"].as_str() == Some("tests.esl:3:36");
    assert!(steps.iter().any(is_switch), "{found}");
    // Without a failure under a schedule, those of before go.
    test(&folder, &["tests.esl", "--filter", "CAREFUL", "--findings", "sums.findings.json"]);
    let found = std::fs::read_to_string(folder.join("sums.findings.json")).expect("it is written");
    assert!(found.contains("\"findings\":[]"), "{found}");
    for command in [&["test"][..], &["explore"][..]] {
        let run = process::run(
            eslvm(command).args(["--findings", "f.txt", "tests.esl"]).current_dir(folder.path()),
            "",
        );
        assert_eq!(run.status, Some(2), "{}", run.errors);
        assert!(run.errors.contains("a name that ends in `.findings.json`"), "{}", run.errors);
    }
    let (status, output) = test(&folder, &["--no-explore", "tests.esl"]);
    assert_eq!(status, Some(0), "{output}");
    assert!(output.contains("  passed  LUCKY\n  passed  CAREFUL\n"), "{output}");
}

#[test]
fn a_test_that_is_explored_strictly_fails_by_a_fragile_update() {
    let text = "(defvar *n* 0)
        (defun update () (setq *n* (+ *n* 1)))
        (deftest plain :explore t (task-net (a (update)) (b (update))) (is (= *n* 2)))
        (deftest strict :explore (:strict t) (task-net (a (update)) (b (update))) (is (= *n* 2)))
        (deftest sure
          :explore (:strict t)
          (task-net (a (without-interrupts (update))) (b (without-interrupts (update))))
          (is (= *n* 2)))";
    let folder = Folder::with("testing-strict", &[("tests.esl", text)]);
    let (status, output) = test(&folder, &["tests.esl"]);
    assert_eq!(status, Some(1), "{output}");
    for line in [
        "  passed  PLAIN, all schedules, grain variables, ",
        "  FAILED  STRICT: with switches before each use of a shared place, under a schedule, a check did not hold",
        "  passed  SURE, all schedules, grain variables, ",
        "; not fragile: all schedules, grain variables, ",
    ] {
        assert!(output.contains(line), "{line}: {output}");
    }
}

#[test]
fn a_test_says_at_which_grain_it_was_explored() {
    let folder = Folder::new("testing-grains");
    let text = |how: &str, place: &str| {
        format!(
            "(defvar *count* 0)
             (defstruct tank (level 0))
             (defun inc (n) (+ n 1))
             (defmacro bump () '(progn (inc 0) (let ((old {place})) (setf {place} (inc old)))))
             (deftest counting :explore {how}
               (let ((tank (make-tank)))
                 (task-net (a (bump)) (b (bump)))
                 (is (= {place} 2))
                 (is (tank-p tank))))"
        )
    };
    let said = |how: &str, place: &str| {
        folder.file("count.esl", text(how, place));
        let (status, output) = test(&folder, &["count.esl"]);
        (status, output.lines().nth(1).unwrap_or_default().to_string())
    };
    let check = |how: &str, place: &str, expected_status: i32, expected: &str| {
        let (status, line) = said(how, place);
        assert_eq!(status, Some(expected_status), "{how} {place}: {line}");
        assert!(line.contains(expected), "{how} {place}: {line}");
    };
    check(
        "t",
        "*count*",
        1,
        "FAILED  COUNTING: under a schedule, a check did not hold (grain variables, timers idle; ",
    );
    check("(:grain variables)", "*count*", 1, "(grain variables, ");
    check(
        "(:grain reads)",
        "*count*",
        0,
        "not proved: grain reads does not see changes of special variables (",
    );
    check("t", "(tank-level tank)", 1, "(grain ticks, timers idle; ");
    check(
        "(:grain :variables)",
        "(tank-level tank)",
        0,
        "not proved: grain variables does not see changes of slots (count.esl:",
    );
    check("(:grain ticks :timers any)", "(tank-level tank)", 1, "(grain ticks, timers any; ");
    check("(:states 3)", "*count*", 1, "not proved: schedules are left that were not tried (");
}

#[test]
fn options_that_a_test_does_not_have_are_refused() {
    let folder = Folder::new("testing-options");
    for (options, said) in [
        (":explor t", "has the options :SEEDS, :EXPLORE and :EXPECT-FAILURE, not :EXPLOR"),
        (
            ":explore (:grain fine)",
            "needs a grain behind :EXPLORE, one of CHANGES, READS, VARIABLES, TICKS, not FINE",
        ),
        (
            ":explore (:grian ticks)",
            "explores by :GRAIN, :TIMERS, :STATES, :STRICT, :ABORTS and :CRASHES, not by :GRIAN",
        ),
        (":explore (:aborts -1)", "needs a number of :ABORTS, not -1"),
        (":explore (:crashes t)", "needs a number of :CRASHES, not T"),
        (":explore (:timers 3)", "needs a way of timers behind :EXPLORE, one of IDLE, ANY, not 3"),
        (":explore (:states 0)", "needs a positive number of :STATES, not 0"),
        (":explore ticks", "needs T or a list such as (:GRAIN TICKS) behind :EXPLORE, not TICKS"),
        (":seeds 2 :explore t", "takes :SEEDS or :EXPLORE"),
        (":seeds 2 :seeds 3", "has :SEEDS twice"),
    ] {
        folder.file("options.esl", format!("(deftest odd {options} (is t))"));
        let (status, output, errors) = test_with_errors(&folder, &["options.esl"]);
        assert_eq!((status, &*output), (Some(3), ""), "{options}: {errors}");
        assert!(errors.contains(said), "{options}: {errors}");
    }
}

/// `--watch` runs tests again when a source that they require changes.
#[test]
fn tests_are_run_again_when_a_source_changes() {
    use std::io::{BufRead, BufReader};
    let folder = Folder::new("testing-watch");
    folder.file("plan.esl", "(defun drive () 1)");
    folder.file("plan_test.esl", "(require \"plan\") (deftest driving (is (eql (drive) 1)))");
    let mut command = eslvm(&["test", "--watch"]);
    command.current_dir(folder.path()).stdout(std::process::Stdio::piped());
    let mut child = command.spawn().expect("it starts");
    let mut lines = BufReader::new(child.stdout.take().expect("there is a pipe")).lines();
    let mut until = |wanted: &str| {
        lines.by_ref().map(|line| line.expect("it is text")).find(|line| line.contains(wanted)).is_some()
    };
    assert!(until("1 passed, 0 failed") && until("waiting for a change"));
    folder.file("plan.esl", "(defun drive () 22)");
    assert!(until("0 passed, 1 failed"));
    child.kill().expect("it runs");
    child.wait().expect("it ends");
}

/// Under all schedules, exclusive calls that are refused are not calls to the world and take no clause, and
/// the end of a call is noted.
#[test]
fn worlds_of_scripts_hold_under_all_schedules() {
    let text = "(define-mock drive (n) (sleep 1) n)
(define-exclusive drive)
(defun try () (with-recovery-procedures ((:operation-busy (abort 'busy))) (drive 1)))
(deftest exclusive :explore t
  (with-world ((:answer (drive 1) :after 1 :with 'one :times 1))
    (let ((values (multiple-value-list (task-net (a (try)) (b (try))))))
      (is (or (equal values '(one busy)) (equal values '(busy one))))
      (is (= (length (world-calls 'drive)) 1)))))
(deftest cancelled :explore t
  (with-world ((:answer (drive *) :after 2 :with 'there))
    (let ((handle (start (drive 1))))
      (spawn (:name 'canceller) (cancel handle))
      (handler-case (operation-result handle) (failure () nil))
      (is (find (fourth (first (world-calls 'drive))) '(:completed :cancelled))))))";
    let folder = Folder::with("testing-worlds", &[("t.esl", text)]);
    let (status, output) = test(&folder, &["t.esl"]);
    assert_eq!(status, Some(0), "{output}");
    assert_eq!(output.matches("all schedules").count(), 2, "{output}");
}
