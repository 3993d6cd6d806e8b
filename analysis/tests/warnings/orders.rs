//! Programs whose tasks take resources: those that can wait for each other in a circle, and those that
//! cannot.

use esl::program::{Source, compile_with_core};
use esl_analysis::resource_orders;

/// Returns the messages about a program with the resources `a`, `b`, `c`, `g` and two units of `d`.
fn messages(text: &str) -> Vec<String> {
    let text = format!(
        "(define-resource a) (define-resource b) (define-resource c) (define-resource g)
         (define-resource d :capacity 2)
         {text}"
    );
    let mut compiled =
        compile_with_core(&[Source::new("a.esl", text.as_str())], &esl::module_path::ModulePath::none());
    assert!(!compiled.has_errors(), "{text}: {:?}", compiled.diagnostics);
    resource_orders(std::mem::take(&mut compiled.core)).into_iter().map(|found| found.message).collect()
}

fn check(text: &str, resources: &str) {
    let message = format!("tasks that take {resources} in different orders can wait for each other");
    assert_eq!(messages(text), [message], "{text}");
}

fn check_none(text: &str) {
    assert_eq!(messages(text), [""; 0], "{text}");
}

/// A task that takes resources, one inside of the other.
fn task(names: &str) -> String {
    let open: String = names.chars().map(|name| format!("(with-resource ({name}) ")).collect();
    format!("(spawn () {open}(sleep 1){})", ")".repeat(names.len()))
}

fn tasks(names: &[&str]) -> String {
    names.iter().map(|names| task(names)).collect()
}

#[test]
fn two_tasks_with_two_orders_can_wait_for_each_other() {
    check(&tasks(&["ab", "ba"]), "`a` and `b`");
    check(&tasks(&["acb", "ba"]), "`a` and `b`");
    check(&tasks(&["ab", "bc", "ca"]), "`a`, `b` and `c`");
    check_none(&tasks(&["ab", "ab"]));
    check_none(&tasks(&["ab", "bc", "ac"]));
    // The main task, and a task that it makes.
    check(
        "(spawn () (with-resource (a) (with-resource (b) 1))) (with-resource (b) (with-resource (a) 1))",
        "`a` and `b`",
    );
    // One task after itself.
    check_none("(with-resource (b) (with-resource (a) 1)) (with-resource (a) (with-resource (b) 1))");
}

#[test]
fn orders_are_found_across_calls() {
    check(
        "(defun take-a () (with-resource (a) 1))
         (defun call (f) (funcall f))
         (spawn () (with-resource (b) (call #'take-a)))
         (spawn () (with-resource (a) (call (lambda () (with-resource (b) 1)))))",
        "`a` and `b`",
    );
    // In the code of a body that failed, of a clause, and of a cleanup.
    check(
        "(spawn () (with-resource (a) (with-recovery-procedures ((:x (with-resource (b) (abort 1)))) (fail :x))))
         (spawn () (with-resource (b) (unwind-protect (sleep 1) (with-resource (a) 1))))",
        "`a` and `b`",
    );
}

#[test]
fn tasks_in_a_form_hold_the_resources_around_it() {
    check(
        "(spawn () (with-resource (a) (task-net (one (with-resource (b) 1)) (two 1))))
         (spawn () (with-resource (b) (with-resource (a) 1)))",
        "`a` and `b`",
    );
    // They keep no two of them apart.
    check(
        "(with-resource (g)
           (task-net (one (with-resource (a) (with-resource (b) 1)))
                     (two (with-resource (b) (with-resource (a) 1)))))",
        "`a` and `b`",
    );
}

#[test]
fn a_resource_that_all_hold_keeps_them_apart() {
    check_none(&tasks(&["gab", "gba"]));
    check(&tasks(&["gab", "ba"]), "`a` and `b`");
}

#[test]
fn resources_at_once_and_waits_that_end_are_no_trouble() {
    let other = task("ba");
    check_none(&format!("(spawn () (with-resources ((a) (b)) 1)) {other}"));
    check(&format!("(spawn () (with-resources ((a)) (with-resources ((b)) 1))) {other}"), "`a` and `b`");
    for inner in [
        "(with-resource (b :timeout 3) 1)",
        "(with-resource (b :if-denied :fail) 1)",
        "(with-resources ((b :if-denied :fail)) 1)",
        "(with-timeout 3 (with-resource (b) 1))",
    ] {
        check_none(&format!("(spawn () (with-resource (a) {inner})) {other}"));
    }
    check(
        &format!("(spawn () (with-resource (a) (with-budget 9 (with-resource (b) 1)))) {other}"),
        "`a` and `b`",
    );
    // There are two of it.
    check_none(&tasks(&["da", "ad"]));
}

#[test]
fn tasks_that_one_place_makes_may_meet() {
    let body = "(if x (with-resource (a) (with-resource (b) 1)) (with-resource (b) (with-resource (a) 1)))";
    check(&format!("(defun begin (x) (spawn () {body})) (begin t) (begin nil)"), "`a` and `b`");
    check(&format!("(dolist (x '(t nil)) (spawn () {body}))"), "`a` and `b`");
    check_none(&format!("(let ((x (read))) (spawn () {body}))"));
}

/// A clause of a form with tasks, which takes resources one inside of the other.
fn clause(id: &str, names: &str) -> String {
    task(names).replacen("(spawn ()", &format!("({id}"), 1)
}

#[test]
fn tasks_that_never_run_at_the_same_time_do_not_wait_for_each_other() {
    let (ab, ba) = (clause("one", "ab"), clause("two", "ba"));
    check(&format!("(task-net {ab} {ba})"), "`a` and `b`");
    // Tests run by themselves, with all their tasks.
    check_none(&format!("(deftest x {} (is t)) (deftest y {} (is t))", task("ab"), task("ba")));
    check(&format!("(deftest x {} {} (is t))", task("ab"), task("ba")), "`a` and `b`");
    // The bodies of one form, and forms one after another.
    check_none(&format!("(try-in-order {ab} {ba})"));
    check_none(&format!("(task-net {ab}) (task-net {ba})"));
    check_none(&format!("(task-net {ab}) (with-resource (b) (with-resource (a) 1))"));
    check_none(&format!("(defun f () (task-net {ab}) (or-parallel {ba})) (task-net (three (f)))"));
    // Not if the function, or the task around the forms, is there twice.
    let twice = format!("(defun f () (try-in-order {ab} {ba}))");
    check_none(&format!("{twice} (f)"));
    check(&format!("{twice} (spawn () (f)) (spawn () (f))"), "`a` and `b`");
    check(&format!("{twice} (spawn () (with-timeout 9 (f))) (f)"), "`a` and `b`");
    check(&format!("(dolist (x '(1 2)) (spawn () (try-in-order {ab} {ba})))"), "`a` and `b`");
    check(&format!("{} (task-net {ba})", task("ab")), "`a` and `b`");
}
