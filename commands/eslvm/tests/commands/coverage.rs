//! Coverage of runs and tests: the figures are exact, and the run stays the same.

use esl_conformance::folder::Folder;
use esl_conformance::process::run;

use crate::eslvm;

const PROGRAM: &str = "(require \"gear\")
(define-cause :stuck ()) (define-cause :sand ())
(defvar *sticks* 2)

(defun unused (x)
  (list x
        (car x)))

(defun drive (metres)
  (when (plusp *sticks*)
    (decf *sticks*)
    (fail :stuck metres))
  (cond ((> metres 100) :far)
        ((> metres 10)
         (twice (shift metres))
         :near)
        (t nil)))

(with-recovery-procedures
    (((:stuck metres) :retries 3
      (format t \"stuck at ~a~%\" metres)
      (retry))
     ((:sand)
      (abort nil)))
  (drive 50))
(print (or (case (drive 5)
             ((:far :near) 1))
           (now)))
";

const GEAR: &str = "(defmacro twice (form)
  (if (consp form)
      `(progn ,form ,form)
      form))
(defun shift (metres)
  (if (plusp metres) 'up 'down))
";

/// Returns the records of a file in lcov's form, one for each file, by the names of their sources.
fn records(lcov: &str) -> Vec<(String, Vec<&str>)> {
    let record = |record: &str| {
        let name = record.lines().find_map(|line| line.strip_prefix("SF:")).expect("it names its source");
        name.rsplit('/').next().unwrap_or_default().to_owned()
    };
    let parts = lcov.split("end_of_record\n").filter(|part| !part.is_empty());
    parts.map(|part| (record(part), part.lines().collect())).collect()
}

#[test]
fn coverage_counts_lines_functions_and_arms_and_leaves_the_run_as_it_is() {
    let folder = Folder::with("coverage", &[("drive.esl", PROGRAM), ("gear.esl", GEAR)]);
    let (program, file) = (folder.join("drive.esl"), folder.join("drive.info"));
    let plain = run(&mut eslvm(&["run", "--clock", "virtual", "--stats", &program]), "");
    let arguments = ["run", "--clock", "virtual", "--stats=coverage", "--coverage", &file, &program];
    let covered = run(&mut eslvm(&arguments), "");
    assert_eq!((covered.status, &covered.output), (Some(0), &plain.output), "{}", covered.errors);
    let ticks = |errors: &str| errors.lines().find(|line| line.starts_with("ticks ")).map(str::to_owned);
    assert_eq!(ticks(&plain.errors), ticks(&covered.errors), "the run is the same");

    let lcov = std::fs::read_to_string(&file).expect("it was written");
    let records = records(&lcov);
    let lines_of = |name: &str, kind: &str| {
        let record = records.iter().find(|(known, _)| known == name).expect("the source is there");
        let lines = record.1.iter().filter_map(|line| line.strip_prefix(kind));
        lines.map(str::to_owned).collect::<Vec<_>>().join(" ")
    };
    // The first definitions are run by the compiler, too.
    assert_eq!(
        lines_of("drive.esl", "DA:"),
        "2,2 3,2 5,0 6,0 7,0 9,4 10,4 11,2 12,2 13,2 14,2 15,2 16,1 17,1 19,1 21,2 22,2 24,0 25,3 26,1 27,0 28,1"
    );
    assert_eq!(lines_of("drive.esl", "FNDA:"), "0,unused 4,drive");
    // `when`, `cond`, the two clauses, and `case` without a clause for `NIL`.
    assert_eq!(
        lines_of("drive.esl", "BRDA:"),
        "10,0,0,2 10,0,1,2 13,1,0,0 13,1,1,1 13,1,2,1 19,2,0,2 19,2,1,0 26,3,0,0 26,3,1,1"
    );
    // Code that macros run at compile time counts.
    assert_eq!(lines_of("gear.esl", "DA:"), "1,1 2,1 3,1 4,0 5,2 6,2");
    assert_eq!(lines_of("gear.esl", "BRDA:"), "2,0,0,1 2,0,1,0 6,1,0,2 6,1,1,0");
    for line in [
        ":13: `cond`: (> metres 100) is never taken",
        ":23: `with-recovery-procedures`: (:sand) is never taken",
        ": lines 5-7, 24, 27: never run",
    ] {
        assert!(covered.errors.lines().any(|found| found.ends_with(line)), "{line}\n{}", covered.errors);
    }
}

#[test]
fn tests_add_up_to_one_coverage() {
    let text = "(require \"gear\")
        (deftest up (is (eq (shift 1) 'up)))
        (deftest all-schedules :explore t
          (let ((gear nil))
            (task-net (a (setq gear (shift 2))) (b (now)))
            (is (eq gear 'up))))";
    let folder = Folder::with("coverage_of_tests", &[("test.esl", text), ("gear.esl", GEAR)]);
    let (program, file) = (folder.join("test.esl"), folder.join("test.info"));
    let tested = run(&mut eslvm(&["test", "--jobs", "1", "--coverage", &file, &program]), "");
    assert_eq!(tested.status, Some(0), "{}{}", tested.output, tested.errors);
    let lcov = std::fs::read_to_string(&file).expect("it was written");
    assert!(lcov.contains("\nBRDA:6,1,1,0\n"), "{lcov}");
    assert!(tested.output.lines().any(|line| line.ends_with("gear.esl:6: `if`: down is never taken")));

    let compiled = folder.join("gear.eslb");
    assert_eq!(run(&mut crate::eslc(&["compile", &folder.join("gear.esl")]), "").status, Some(0));
    let refused = run(&mut eslvm(&["run", "--coverage", &file, &compiled]), "");
    assert_eq!(refused.status, Some(2));
    assert!(refused.errors.contains("gear.eslb is compiled: name its source"), "{}", refused.errors);
    let refused = run(&mut eslvm(&["run", "--coverage", &program, &program]), "");
    assert_eq!(refused.status, Some(2), "the program itself is not overwritten");
}
