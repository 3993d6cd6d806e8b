//! Small programs with faults, and what becomes of them.

use esl::program::{Source, compile};
use esl_bytecode::symbol::Symbol;
use esl_testing::inject::{InjectSettings, InjectionSubject, KnownFailures, inject};
use esl_testing::{Setup, list, may_define_tests};

/// The rows of the tests of a program, or of the program itself, as `name: outcome`.
fn rows(text: &str, settings: &InjectSettings, known: &[(&str, &str)]) -> Vec<String> {
    let program = compile(&[Source::new("faults.esl", text)]).program.expect("it compiles");
    let setup = Setup::default();
    let mut all_known = KnownFailures::new();
    for (name, cause) in known {
        all_known.entry((*name).into()).or_default().push(Symbol::keyword(cause));
    }
    let tests = list(&program, &setup).expect("it runs");
    let names: Vec<Option<&str>> =
        if tests.is_empty() { vec![None] } else { tests.iter().map(|test| Some(&*test.name)).collect() };
    let mut all = Vec::new();
    for test in names {
        let subject = InjectionSubject { program: &program, test, seed: 0, setup: &setup };
        let report = inject(&subject, &all_known, settings, &|_, _| ()).expect("it begins");
        assert_eq!(report.problem, None);
        all.extend(report.rows.iter().map(|row| format!("{}: {}", row.name, row.outcome.text())));
    }
    all
}

fn has(rows: &[String], wanted: &str) {
    assert!(rows.iter().any(|row| row == wanted), "{wanted} is not in\n{}", rows.join("\n"));
}

const WHEELS: &str = "
    (define-cause :wheel-stuck ())
    (define-property wheels ())
    (assert '(wheels :off))
    (define-mock set-wheels (state) (assert (list 'wheels state)))
    (define-mock drive (metres) (sleep metres) metres)";

#[test]
fn a_cleanup_tells_careful_from_careless() {
    let test = |body: &str| {
        let text = format!(
            "{WHEELS} (deftest drives (is (with-recovery-procedures ((:wheel-stuck (retry))) {body} t)))"
        );
        rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")])
    };
    let careless = test("(set-wheels :on) (drive 5) (set-wheels :off)");
    has(&careless, "drive#1:aborted: LEFT ON");
    has(&careless, "drive#1:wheel-stuck: recovered");
    has(&careless, "drive#1+:wheel-stuck: LEFT ON");
    has(&careless, "drive#1:never: DEADLOCK");
    has(&careless, "drive#1:late: recovered");
    let careful = test(
        "(with-cleanup-procedure (set-wheels :off)
           (set-wheels :on) (with-timeout 100 (drive 5)) (set-wheels :off))",
    );
    has(&careful, "drive#1:aborted: failed, cleanups run");
    has(&careful, "drive#1+:wheel-stuck: failed, cleanups run");
    has(&careful, "drive#1:never: failed, cleanups run");
}

#[test]
fn endless_retries_hang() {
    let text = format!(
        "{WHEELS} (deftest drives (is (with-recovery-procedures ((:wheel-stuck :retries :infinite (sleep 1) (retry)))
                                        (drive 5))))"
    );
    let found = rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")]);
    has(&found, "drive#1:wheel-stuck: recovered");
    has(&found, "drive#1+:wheel-stuck: HANGS");
}

#[test]
fn conditions_of_always_are_looked_at() {
    let text = format!(
        "{WHEELS} (define-fluent stops 0)
         (always one-stop (< stops 2))
         (defun stop () (setf stops (+ stops 1)) (sleep 1) (setf stops 0))
         (deftest drives (is (with-recovery-procedures ((:wheel-stuck (setf stops 1) (stop) (retry))) (drive 5))))"
    );
    let found = rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")]);
    has(&found, "drive#1:wheel-stuck: INVARIANT FALSE");
    has(&found, "drive#1:late: recovered");
}

#[test]
fn a_cleanup_that_does_not_end_is_seen() {
    let text = format!("{WHEELS} (unwind-protect (drive 5) (set-wheels :off))");
    let found = rows(&text, &InjectSettings { pairs: 50, ..InjectSettings::default() }, &[]);
    has(&found, "drive#1:never/set-wheels#1:never: DEADLOCK");
    let text = "(define-mock drive () (sleep 5))
                (define-mock stop () nil)
                (spawn (sleep 8))
                (unwind-protect (drive) (loop (stop) (sleep 1)
                  (when (> (now) 4) (return)))
                  (when (< (now) 4) (sleep 1000)))";
    let found = rows(text, &InjectSettings::default(), &[]);
    has(&found, "drive#1:late: recovered");
    let text = "(define-mock drive () (sleep 5))
                (unwind-protect (drive) (when (< (now) 4) (sleep 1000)))";
    has(&rows(text, &InjectSettings::default(), &[]), "drive#1:aborted: CLEANUP CUT OFF");
}

#[test]
fn scripts_give_the_arguments_of_their_failures() {
    let text = "(define-cause :wheel-stuck ())
        (defun describe-place (x) (list 'at x))
        (deftest drives
          (with-world ((:answer (drive 9) :failing (:wheel-stuck left)) (:answer (drive *) :with 'there)
                       (:answer (describe-place *) :with 'here))
            (is (with-recovery-procedures (((:wheel-stuck wheel) (abort (if (eq wheel 'left) 'left (fail :worse)))))
                  (drive 5) (describe-place 1) t))))";
    let found = rows(text, &InjectSettings::default(), &[]);
    has(&found, "drive#1:wheel-stuck: recovered");
    has(&found, "describe-place#1:late: recovered");
    has(&found, "describe-place#1:never: DEADLOCK");
}

#[test]
fn rows_do_not_depend_on_threads_and_are_repeated_by_name() {
    let text = format!("{WHEELS} (deftest drives (dotimes (i 20) (drive i)) (is t))");
    let known = [("drive", "WHEEL-STUCK")];
    let alone = rows(&text, &InjectSettings::default(), &known);
    assert_eq!(alone, rows(&text, &InjectSettings { jobs: 4, ..InjectSettings::default() }, &known));
    assert_eq!(alone.len(), 5 * 4 + 2);
    let only = InjectSettings { only: Some("DRIVE#7:wheel-stuck".into()), ..InjectSettings::default() };
    assert_eq!(rows(&text, &only, &known), ["drive#7:wheel-stuck: failed, cleanups run"]);
    let pair =
        InjectSettings { only: Some("drive#7:late/drive#8:never".into()), ..InjectSettings::default() };
    assert_eq!(rows(&text, &pair, &known), ["drive#7:late/drive#8:never: DEADLOCK"]);
}

#[test]
fn an_undisturbed_run_that_fails_is_no_measure() {
    let program = compile(&[Source::new("bad.esl", "(define-mock look () 1) (look) (fail :dark)")]);
    let program = program.program.expect("it compiles");
    let subject = InjectionSubject { program: &program, test: None, seed: 0, setup: &Setup::default() };
    let report =
        inject(&subject, &KnownFailures::new(), &InjectSettings::default(), &|_, _| ()).expect("it begins");
    assert_eq!(report.problem.as_deref(), Some("A failure of cause :DARK."));
    assert!(report.rows.is_empty());
}

#[test]
fn a_run_without_an_end_is_no_measure() {
    let text = "(define-mock look () 1) (loop (look) (sleep 1))";
    let program = compile(&[Source::new("endless.esl", text)]).program.expect("it compiles");
    assert!(!may_define_tests(&program));
    let subject = InjectionSubject { program: &program, test: None, seed: 0, setup: &Setup::default() };
    let settings = InjectSettings { patience: 0.1, ..InjectSettings::default() };
    let report = inject(&subject, &KnownFailures::new(), &settings, &|_, _| ()).expect("it begins");
    let problem = report.problem.expect("it is told");
    assert!(problem.starts_with("it has not ended after"), "{problem}");
}

#[test]
fn programs_that_may_define_tests_are_known() {
    let may = |text: &str| {
        let program = compile(&[Source::new("a.esl", text)]).program.expect("it compiles");
        may_define_tests(&program)
    };
    assert!(may("(deftest a (is t))"));
    assert!(may("(load \"tests.esl\")"));
    assert!(!may("(print 1)"));
}

#[test]
fn pairs_disturb_remedies() {
    let text = format!(
        "{WHEELS} (define-mock reset-wheel () (sleep 1))
         (deftest drives (is (with-recovery-procedures ((:wheel-stuck (reset-wheel) (retry))) (drive 5))))"
    );
    let settings = InjectSettings { pairs: 20, ..InjectSettings::default() };
    let known = [("drive", "WHEEL-STUCK")];
    let name = "drive#1:wheel-stuck/reset-wheel#1:never";
    has(&rows(&text, &settings, &known), &format!("{name}: DEADLOCK"));
    let only = InjectSettings { only: Some(name.into()), ..InjectSettings::default() };
    assert_eq!(rows(&text, &only, &known), [format!("{name}: DEADLOCK")]);
}

#[test]
fn a_task_that_a_failure_ends_is_told() {
    let text = format!("{WHEELS} (deftest drives (spawn (:name \"left\") (drive 5)) (sleep 9) (is t))");
    let found = rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")]);
    has(&found, "drive#1:wheel-stuck: recovered, a task failed");
    has(&found, "drive#1:late: recovered");
    // A form that waits for it takes its failure.
    let text = format!(
        "{WHEELS} (deftest drives (handler-case (or-parallel (left (drive 5))) (failure () 1)) (is t))"
    );
    let found = rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")]);
    has(&found, "drive#1:wheel-stuck: recovered");
}

#[test]
fn a_run_that_comes_to_its_end_may_leave_a_motor_on() {
    let drive = |end: &str| {
        let text = format!(
            "{WHEELS} (deftest drives
               (is (handler-case (progn (set-wheels :on) (drive 5) (set-wheels :off) t) (failure () {end}))))"
        );
        rows(&text, &InjectSettings::default(), &[("drive", "WHEEL-STUCK")])
    };
    has(&drive("t"), "drive#1:wheel-stuck: LEFT ON");
    has(&drive("nil"), "drive#1:wheel-stuck: LEFT ON");
    has(&drive("(exit 0)"), "drive#1:wheel-stuck: LEFT ON");
    has(&drive("(set-wheels :off) t"), "drive#1:wheel-stuck: recovered");
    has(&drive("(set-wheels :off) nil"), "drive#1:wheel-stuck: recovered otherwise");
    has(&drive("(set-wheels :off) (exit 0)"), "drive#1:wheel-stuck: recovered otherwise");
    has(&drive("(set-wheels :off) (exit 3)"), "drive#1:wheel-stuck: failed, cleanups run");
}

#[test]
fn rows_with_odd_names_are_repeated_by_these() {
    let text = "(define-cause :never ()) (define-cause :|a b| ()) (define-cause :|x/y#1:late| ())
        (declaim (fails |op/b| :never :|a b|) (fails |Move| :|x/y#1:late|))
        (define-mock |op/b| () (sleep 1)) (define-mock |Move| () (sleep 1)) (define-mock move () (sleep 1))
        (deftest works (|op/b|) (|Move|) (move) (is t))";
    let all =
        rows(text, &InjectSettings::default(), &[("op/b", "NEVER"), ("op/b", "a b"), ("move", "x/y#1:late")]);
    has(&all, "|op/b|#1::never: failed, cleanups run");
    has(&all, "|op/b|#1:never: DEADLOCK");
    has(&all, "|op/b|#1:|a b|: failed, cleanups run");
    has(&all, "|Move|#1:|x/y#1:late|: failed, cleanups run");
    has(&all, "move#1:late: recovered");
    let known = [("op/b", "NEVER"), ("op/b", "a b"), ("move", "x/y#1:late")];
    let again = |name: &str| {
        let only = InjectSettings { only: Some(name.into()), ..InjectSettings::default() };
        rows(text, &only, &known)
    };
    for row in &all {
        let (name, _) = row.rsplit_once(": ").expect("an outcome follows");
        assert_eq!(again(name), [row.as_str()]);
    }
    assert_eq!(
        again("|op/b|#1:late/|Move|#1:|x/y#1:late|"),
        ["|op/b|#1:late/|Move|#1:|x/y#1:late|: failed, cleanups run"]
    );
}

#[test]
fn calls_are_those_of_their_tasks() {
    let text = format!(
        "{WHEELS} (deftest drives (spawn (drive 1)) (spawn (:name \"left\") (drive 2)) (drive 3) (sleep 9) (is t))"
    );
    let program = compile(&[Source::new("faults.esl", text.as_str())]).program.expect("it compiles");
    let subject =
        InjectionSubject { program: &program, test: Some("DRIVES"), seed: 0, setup: &Setup::default() };
    let report =
        inject(&subject, &KnownFailures::new(), &InjectSettings::default(), &|_, _| ()).expect("it begins");
    let mut tasks: Vec<&str> = report.rows.iter().map(|row| row.task.as_str()).collect();
    tasks.sort_unstable();
    tasks.dedup();
    let [left, main, unnamed] = tasks[..] else { panic!("there are three: {tasks:?}") };
    assert_eq!((left, main), ("left", "main"));
    assert!(unnamed.strip_prefix("task ").is_some_and(|number| number.parse::<u32>().is_ok()), "{unnamed}");
}
