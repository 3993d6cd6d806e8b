//! Rows of small programs: the causes that leave functions and tasks, as the semantics of the language has
//! it.

mod declared;
mod many;
mod spent;
mod values;
mod ways;

use esl::program::{Source, compile_with_core};
use esl_analysis::{AnalysisOptions, CauseRow, FailureTable, analyze};
use esl_bytecode::symbol::Symbol;

fn table(text: &str) -> FailureTable {
    let mut compiled =
        compile_with_core(&[Source::new("a.esl", text)], &esl::module_path::ModulePath::none());
    assert!(!compiled.has_errors(), "{text}: {:?}", compiled.diagnostics);
    analyze(std::mem::take(&mut compiled.core), &compiled.sources, &AnalysisOptions::default()).0
}

fn shown(rows: &[CauseRow]) -> String {
    rows.iter().map(|row| row.cause.as_str()).collect::<Vec<_>>().join(" ")
}

/// Checks the causes that leave the function `f`.
fn check(text: &str, expected: &str) {
    let table = table(text);
    let row = table.functions.iter().find(|row| row.name == "f").expect("it defines the function");
    assert_eq!(shown(&row.causes), expected, "{text}");
}

#[test]
fn clauses_take_failures_for_good_if_they_leave() {
    let clause = |clause: &str| {
        format!(
            "(defun work () (fail :a))
             (defun f () (with-recovery-procedures (({clause})) (work)))"
        )
    };
    check("(defun f () (fail :a))", ":a");
    check(&clause(":a (abort 1)"), "");
    check(&clause(":b (abort 1)"), ":a");
    check(&clause(":general-failure (abort 1)"), "");
    // These may be in vain.
    check(&clause(":a :retries 3 (retry)"), ":a");
    check(&clause(":a :retries :infinite (retry)"), "");
    check(&clause(":a (values 1)"), ":a");
    check(&clause(":a :retries :infinite (values 1)"), "");
    check(&clause(":a (fail :b)"), ":b");
    check(&clause(":a (if (zerop (random 2)) (retry) (abort 1))"), ":a");
    check(&clause("(:a &rest arguments) (print arguments) (abort nil)"), "");
    check(&clause(":a :retries 0 (abort 1)"), ":a");
}

#[test]
fn names_of_causes_are_as_programs_have_them() {
    let program = "(define-cause :|wheel stuck| ()) (define-cause :|Wheel stuck| ())
                   (defun f (n) (if n (fail :|wheel stuck|) (fail :|Wheel stuck|)))";
    check(program, ":|Wheel stuck| :|wheel stuck|");
    check(
        &format!("(declaim (fails f :|wheel stuck| :|Wheel stuck|)) {program}"),
        ":|Wheel stuck| :|wheel stuck|",
    );
    let table = table(&format!("(declaim (fails f :|wheel stuck|)) {program}"));
    let found: Vec<&str> = table.findings.iter().map(|found| found.message.as_str()).collect();
    assert_eq!(found, ["`f` may fail with :|Wheel stuck|, which it does not declare"]);
    let causes = &table.causes_by_name()["f"];
    assert_eq!(causes.iter().map(Symbol::name).collect::<Vec<_>>(), ["Wheel stuck", "wheel stuck"]);
}

#[test]
fn a_clause_whose_number_is_computed_may_never_run() {
    check("(defun f (n) (with-recovery-procedures ((:a :retries n (abort 1))) (fail :a)))", ":a");
}

#[test]
fn many_clauses_are_told_apart() {
    let causes: String = (0..300).map(|cause| format!("(:c{cause} (abort {cause}))")).collect();
    let fails: String = (0..300).map(|cause| format!("(when (= n {cause}) (fail :c{cause}))")).collect();
    let text = format!(
        "(defun f (n) (with-recovery-procedures ((:a (retry)) {causes} (:b (fail :c))) {fails} (fail :a) (fail :b)))"
    );
    check(&text, ":a :c");
    let answers: Vec<String> = table(&text).clauses.into_iter().map(|clause| clause.answer).collect();
    let ends = answers.iter().filter(|answer| *answer == "ends the form").count();
    assert_eq!((answers.len(), ends, answers[301].as_str()), (302, 300, "leaves otherwise"), "{answers:?}");
}

#[test]
fn a_failure_with_the_cause_of_an_error_is_no_error() {
    let again = |form: &str| {
        format!(
            "(define-condition slip (error) ())
             (defun f () (ignore-errors (handler-case (error 'slip) (slip (one) ({form} one)))))"
        )
    };
    check(&again("error"), "");
    check(&again("(lambda (one) (fail (failure-cause one)))"), ":slip");
    check(
        "(defun f () (handler-case (fail (failure-cause (make-condition 'simple-error))) (error () 1)))",
        ":simple-error",
    );
}

/// Checks the programming errors that may leave the function `f`.
fn check_mistakes(text: &str, expected: &[&str]) {
    let mut compiled =
        compile_with_core(&[Source::new("a.esl", text)], &esl::module_path::ModulePath::none());
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions { all: true, explained: None });
    let row = table.functions.iter().find(|row| row.name == "f").expect("it defines the function");
    let mistakes: Vec<&str> =
        row.causes.iter().filter(|row| row.is_mistake).map(|row| row.cause.as_str()).collect();
    assert_eq!(mistakes, expected, "{text}");
}

#[test]
fn programming_errors_have_kinds() {
    check_mistakes(
        "(defun f () (without-interrupts (sleep 1)))",
        &[":type-error", ":cell-error", ":program-error", ":error", ":would-block"],
    );
    check_mistakes("(defun g (&key one) one) (defun f () (g :one 1))", &[]);
    check_mistakes("(defun g (&key one) one) (defun f () (g :two 1))", &[":program-error"]);
    check_mistakes("(defun g (&key one) one) (defun f () (g :one))", &[":program-error"]);
    check_mistakes("(defun g (one) one) (defun f () (g))", &[":program-error"]);
    check_mistakes("(defun f () (throw 'place 1))", &[":program-error"]);
    check_mistakes("(defun f () (with-recovery-procedures ((:a (retry)) (:b (abort 1))) 3))", &[]);
    check_mistakes(
        "(defun f () (handler-case (car 'a) (type-error (one) (fail (failure-cause one)))))",
        &[":type-error", ":cell-error", ":program-error", ":error", ":error (as a cause)"],
    );
}

#[test]
fn a_module_fails_by_the_program_s_code() {
    check(
        "(defstruct activity failer)
         (defvar *activity*
           (make-activity :failer (lambda (causes cause &rest arguments)
                                    (apply #'esl::%fail-because-of causes cause arguments))))
         (defun fail-by (activity cause &rest arguments)
           (apply (activity-failer activity) nil cause arguments))
         (defun f () (fail-by *activity* :broken 1))",
        ":broken",
    );
}

#[test]
fn clauses_of_one_form_call_each_other() {
    // The example of the paper, which ends with the cause :FOO.
    check(
        "(defun f () (with-recovery-procedures ((:foo (fail :baz)) (:baz (fail :foo))) (fail :foo)))",
        ":baz :foo",
    );
    check("(defun f () (with-recovery-procedures ((:foo (fail :baz)) (:baz (abort))) (fail :foo)))", "");
}

#[test]
fn a_failing_clause_comes_back_if_an_outer_one_resumes() {
    let inner = "(with-recovery-procedures ((:a (fail :b))) (list (fail :a) (fail :a)))";
    check(&format!("(defun f () {inner})"), ":b");
    check(
        &format!("(defun f () (with-recovery-procedures ((:b :retries :infinite (values 1))) {inner}))"),
        ":a",
    );
}

#[test]
fn clauses_are_shown_at_their_own_places() {
    let table = table(
        "(handler-case (fail :a)
(failure ()
(with-recovery-procedures (
(:b (abort 1)))
(fail :b))))",
    );
    let lines: Vec<(&str, u32)> =
        table.clauses.iter().map(|clause| (clause.wanted.as_str(), clause.place.line)).collect();
    assert_eq!(lines, [("failure", 3), (":b", 4)]);
}

#[test]
fn causes_have_a_hierarchy() {
    let causes = "(define-cause :top ()) (define-cause :low (:top))";
    check(&format!("{causes} (defun f () (with-recovery-procedures ((:top (abort))) (fail :low)))"), "");
    check(&format!("{causes} (defun f () (with-recovery-procedures ((:low (abort))) (fail :top)))"), ":top");
    check("(define-condition slip (error) ()) (defun f () (ignore-errors (error 'slip)))", "");
    check("(define-condition slip (error) ()) (defun f () (error 'slip))", ":slip");
    check("(defun f () (with-recovery-procedures ((:error (abort))) (error \"no\")))", "");
}

#[test]
fn handlers_take_types() {
    check("(defun f () (handler-case (fail :a) (failure () 1)))", "");
    check("(defun f () (handler-case (fail :a) (error () 1)))", ":a");
    check("(defun f () (ignore-errors (fail :a) (error \"no\")))", ":a");
    check("(defun f () (handler-case (fail :a) (failure (one) (error one))))", ":a");
    check("(defun f () (handler-case (fail :a) (failure (one) (fail (failure-cause one)))))", ":a");
    check(
        "(defun f () (block nil (handler-bind ((failure (lambda (one) (print one) (return 1)))) (fail :a))))",
        "",
    );
    check("(defun f () (handler-bind ((failure #'print)) (fail :a)))", ":a");
    check("(defun f () (unwind-protect (fail :a) (fail :b)))", ":a :b");
    check("(defun f () (with-cleanup-procedure (fail :b) (fail :a)))", ":a :b");
}

#[test]
fn functions_are_followed_as_values() {
    check("(defun f () (mapcar (lambda (x) (if x (fail :a) 1)) '(1 2)))", ":a");
    check("(defun bad (x) (fail :a x)) (defun f () (mapcar #'bad '(1 2)) (mapc 'bad '(1)))", ":a");
    check(
        "(defun bad () (fail :a)) (defun f () (let ((all (list #'bad #'car))) (funcall (first all))))",
        ":a",
    );
    check(
        "(defstruct part act) (defun bad () (fail :a))
         (defun f () (let ((one (make-part :act #'bad))) (funcall (part-act one))))",
        ":a",
    );
    check(
        "(defvar *acts* (make-hash-table)) (setf (gethash 1 *acts*) (lambda () (fail :a)))
         (defun f () (funcall (gethash 1 *acts*)))",
        ":a",
    );
    check("(defun f () (let ((causes '(:a :b))) (fail (nth (random 2) causes))))", ":a :b");
    check("(defun f (cause) (fail cause))", "any (a computed cause)");
    check("(defun f () (labels ((go-on (n) (if (> n 3) (fail :a) (go-on (+ n 1))))) (go-on 0)))", ":a");
    check(
        "(defgeneric act (x)) (defmethod act ((x integer)) (fail :a)) (defmethod act ((x string)) (fail :b))
         (defun f (x) (act x))",
        ":a :b",
    );
}

#[test]
fn a_function_of_one_caller_does_not_leak_into_another() {
    let helper = "(defun twice (function) (funcall function) (funcall function))
                  (defun outer (function) (twice (lambda () (funcall function))))";
    check(
        &format!("{helper} (defun g () (outer (lambda () (fail :g)))) (defun f () (outer (lambda () 1)))"),
        "",
    );
    check(
        &format!(
            "{helper} (defun g () (outer (lambda () (fail :g)))) (defun f () (outer (lambda () (fail :f))))"
        ),
        ":f",
    );
}

#[test]
fn forms_of_tasks_fail_as_their_tasks() {
    check("(defun f () (task-net (a (fail :a)) (b (fail :b))))", ":a :b");
    check("(defun f () (task-net :allow-failures (a (fail :a))))", "");
    check("(defun f () (or-parallel (a (fail :a)) (b (fail :b))))", ":all-failed");
    check("(defun f () (or-parallel (a (fail :a)) (b (sleep 1))))", "");
    check("(defun f () (try-in-order (a (fail :a)) (b (fail :b))))", ":all-failed");
    check("(defun f () (pursue (a (fail :a)) (b (sleep 1))))", ":a");
    check("(defun f () (supervise (:restarts 3) (a (fail :a))))", ":restarts-exhausted");
    check("(defun f () (spawn (fail :a)))", "");
    check("(defun f () (with-guardian (sleep 1) (fail :a) (sleep 2)))", ":a");
    // The options of a task are not those of tasks in its body.
    let nested = table("(spawn (:budget nil) (task-net (look (spawn (:name 'inner :budget 9) (fail :a)))))");
    let names: Vec<&str> = nested.tasks.iter().map(|task| task.name.as_str()).collect();
    assert_eq!(names, ["main", "spawned", "look", "inner"]);
    let spawned = table("(spawn (:name 'scout) (fail :a))");
    let scout = spawned.tasks.iter().find(|task| task.name == "scout").expect("there is such a task");
    assert_eq!(shown(&scout.causes), ":a");
    assert!(spawned.tasks[0].causes.is_empty(), "the main task goes on");
}

#[test]
fn forms_of_the_library_have_causes_of_their_own() {
    check("(defun f () (with-timeout 3 (sleep 4)))", ":timeout");
    check("(defun f () (with-budget 100 (sleep 4)))", ":budget-exhausted");
    check("(defun f () (with-quota (:tasks 1) (sleep 4)))", ":quota-exhausted");
    check("(defvar *e* (make-event)) (defun f () (wait-for-event *e*))", "");
    check("(defvar *e* (make-event)) (defun f () (wait-for-event *e* :timeout 3))", ":timeout");
    check("(define-fluent *x* 1) (defun f () (wait-until (> *x* 2)))", "");
    check("(define-fluent *x* 1) (defun f () (wait-until (> *x* 2) :timeout 3))", ":timeout");
    check(
        "(defun f () (with-query-bindings '(a ?x) (print #?x) (next-bindings)))",
        ":no-bindings :no-more-bindings",
    );
    check("(define-resource arm) (defun f () (with-resource (arm :if-denied :fail) 1))", ":resource-denied");
    check(
        "(defvar *on* nil) (defun on-p () *on*) (to-achieve (on-p) (t (fail :a))) (defun f () (achieve (on-p)))",
        ":a :condition-not-achieved",
    );
    check(
        "(defvar *on* nil) (defun on-p () *on*) (to-achieve (on-p) (*on* (setq *on* t))) (defun f () (achieve (on-p)))",
        ":condition-not-achieved :no-applicable-method",
    );
}

#[test]
fn operations_fail_as_their_mocks_and_declarations() {
    check("(define-mock slew (to) (sleep 1) (fail :stuck to)) (defun f () (slew 1))", ":stuck");
    check(
        "(define-mock slew (to) (fail :stuck to)) (defun f () (operation-result (start (slew 1))))",
        ":cancelled :stuck",
    );
    check("(declaim (fails slew :stuck)) (defun f () (slew 1))", ":stuck");
    check("(defun f () (slew 1))", "unknown (slew declares no failures)");
    check(
        "(define-mock slew (to) to) (defun f () (with-world ((:answer (slew *) :failing (:stuck 1))) (slew 1)))",
        ":stuck",
    );
}

#[test]
fn without_a_clause_its_failures_go_outward() {
    let mission = |clauses: &str| {
        format!(
            "(defun turn () (fail :stuck)) (defun look () (fail :dark))
             (defun f () (with-recovery-procedures ({clauses}) (turn) (look)))"
        )
    };
    check(&mission("(:stuck (abort)) (:dark (abort))"), "");
    check(&mission("(:stuck (abort))"), ":dark");
    check(&mission("(:dark (abort))"), ":stuck");
}

/// Returns the codes of the findings about a program, with the lines that these are about; those of the
/// compiler about clauses are among them.
fn findings(text: &str) -> Vec<(String, usize)> {
    let mut compiled =
        compile_with_core(&[Source::new("a.esl", text)], &esl::module_path::ModulePath::none());
    assert!(!compiled.has_errors(), "{text}: {:?}", compiled.diagnostics);
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions::default());
    esl_analysis::sharpen(&mut compiled.diagnostics, &table);
    compiled.diagnostics.retain(|found| found.code == "clause-falls-off");
    let all = compiled.diagnostics.into_iter().chain(table.findings);
    all.map(|found| {
        let line = text[..found.primary.span.start as usize].matches('\n').count() + 1;
        (found.code.to_string(), line)
    })
    .collect()
}

#[track_caller]
fn check_findings(text: &str, expected: &[(&str, usize)]) {
    let expected: Vec<(String, usize)> =
        expected.iter().map(|(code, line)| ((*code).to_string(), *line)).collect();
    assert_eq!(findings(text), expected, "{text}");
}

#[test]
fn clauses_that_never_apply_are_found() {
    let drive = "(define-cause :stuck ()) (define-cause :lost ()) (define-cause :jammed (:stuck))
(defun drive (n) (when (> n 3) (fail :stuck n)))\n";
    let never = |rest: &str, lines: &[usize]| {
        let lines: Vec<(&str, usize)> = lines.iter().map(|line| ("clause-never-applies", *line)).collect();
        check_findings(&format!("{drive}{rest}"), &lines);
    };
    never("(with-recovery-procedures ((:stuck (abort)))\n(drive 5))", &[]);
    never("(with-recovery-procedures ((:stuck (abort))\n(:lost (abort)))\n(drive 5))", &[4]);
    // A cause below the one that comes is not that one.
    never("(with-recovery-procedures (\n(:jammed (abort)))\n(drive 5))", &[4]);
    // Clauses whose bodies call a function that comes from a caller, an operation that is not known, a mock;
    // limits and errors, which may come to any code.
    never("(defun twice (f) (with-recovery-procedures ((:lost (abort))) (funcall f)))", &[]);
    never(
        "(define-mock look () (when (> (random 3) 1) (fail :stuck)))
(with-recovery-procedures ((:lost (abort))) (look))",
        &[],
    );
    never("(with-recovery-procedures ((:heap-exhausted (abort)) (:type-error (abort))) (drive 5))", &[]);
    // A guard fails in the task that it guards.
    never(
        "(define-fluent low nil)
(defun work () (with-recovery-procedures ((:lost (abort))) (drive 5)))
(with-guardian (wait-until low) (fail :lost) (work))",
        &[],
    );
}

#[test]
fn endless_retries_and_clauses_that_fall_off_are_found() {
    let again = |cause: &str, clause: &str| {
        format!("(with-recovery-procedures (({cause} :retries :infinite\n{clause}))\n(print (car (read))))")
    };
    check_findings(&again(":type-error", "(retry)"), &[("endless-retry", 2)]);
    check_findings(&again(":type-error", "(print 'again) (retry)"), &[("endless-retry", 2)]);
    check_findings(&again(":type-error", "(sleep 1) (retry)"), &[]);
    check_findings(&again(":end-of-file", "(retry)"), &[]);

    let clause = |rest: &str| {
        format!(
            "(define-cause :stuck ()) (define-cause :over ())\n{rest}
(with-recovery-procedures (\n(:stuck (give-up)))\n(print (fail :stuck)))"
        )
    };
    // The function may come back, or never does.
    check_findings(&clause("(defun give-up () (print 1))"), &[("clause-falls-off", 4)]);
    check_findings(&clause("(defun give-up () (stop))\n(defun stop () (fail :over))"), &[]);
    check_findings(&clause("(defun give-up () (if (read) (fail :over) (give-up)))"), &[]);
    // Another clause may answer the failure in its place.
    let answered = "(define-cause :stuck ()) (define-cause :over ())
(defun give-up () (fail :over))
(with-recovery-procedures ((:over (values 1)))
(with-recovery-procedures (
(:stuck (give-up)))
(print (fail :stuck))))";
    check_findings(answered, &[("clause-falls-off", 5)]);
}

#[test]
fn failures_pass_as_many_tasks_as_there_are() {
    // The functions are found from the innermost to the outermost.
    let mut text = String::from("(defun f0 () (fail :a))\n");
    for number in 1..700 {
        text.push_str(&format!("(defun f{number} () (task-net (part (f{}))))\n", number - 1));
    }
    text.push_str("(defun f () (f699))\n");
    for number in 0..700 {
        text.push_str(&format!("(f{number})\n"));
    }
    check(&text, ":a");
}

#[test]
fn a_task_has_all_clauses_of_a_form() {
    let clauses: Vec<String> = (0..100).map(|number| format!("(:c{number} (abort))")).collect();
    let text = format!("(with-recovery-procedures ({}) (fail :c99))", clauses.join(" "));
    let table = table(&text);
    assert_eq!(table.tasks[0].clauses.len(), 100);
}

#[test]
fn tasks_that_come_along_by_data_are_not_those_of_a_form() {
    // The value of a clause for errors may stand for any that the form returns from inside.
    check(
        "(define-cause :a ())
         (defun f () (or-parallel (one (partial-order ((two (fail :a)))))))
         (defun g () (with-recovery-procedures ((:error (spawn (:name \"other\") 1))) (error \"no\")))
         (f) (g)",
        ":all-failed",
    );
}
