//! `eslvm test`: verdicts, what is said of failures, selections, reports, exit statuses.

use esl_conformance::process;

use crate::eslvm;
use crate::folder::Folder;

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
        "  FAILED  WAITING, seed 0: it waits for what cannot come\n          Deadlock:",
        "  FAILED  LEAVING, seed 0: it has ended the run with the status 7\n",
        "  FAILED  RACING: under one of ",
        "  passed  LEFT-BEHIND\n",
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
    assert_eq!(test(&folder, &[]).0, Some(2));
    assert_eq!(test(&folder, &["lost.esl"]).0, Some(1));
}
