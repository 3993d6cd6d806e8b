//! Reports of failures: the tasks and the places that they name.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// Runs a program that fails, and returns the lines of its report, with `f.esl` in place of the file's path.
#[track_caller]
fn report(name: &str, program: &str, options: &[&str]) -> Vec<String> {
    let folder = Folder::new(&format!("report-{name}"));
    let source = folder.file("f.esl", program);
    let run = process::run(&mut eslvm(&[&["run", "--clock", "virtual"], options, &[&*source]].concat()), "");
    assert_eq!(run.status, Some(1), "{}", run.errors);
    run.errors.replace(&source, "f.esl").lines().map(str::to_owned).collect()
}

const FUNCTIONS: &str = "(defun inner () (car (identity 5)))
(defun middle ()
  (list (inner)))
(defun outer (x) (list (middle) x))
";

/// Each form with tasks fails as its task has, with the calls of that.
#[test]
fn a_failure_of_a_task_keeps_its_calls_through_every_form() {
    let forms = [
        ("net", "(task-net\n  (one (list (middle))) (two (sleep 9)))"),
        ("pursue", "(pursue\n  (one (list (middle))) (two (sleep 9)))"),
        ("order", "(partial-order ((two 1) (one (list (middle)))) (:order two one))"),
    ];
    for (name, form) in forms {
        let lines = report(name, &format!("{FUNCTIONS}\n(print {form})"), &[]);
        let expected =
            ["The value 5 is not of type LIST.", "  in INNER, f.esl:1:17", "  in MIDDLE, f.esl:3:9"];
        assert_eq!(lines[..3], expected, "{lines:#?}");
        assert!(lines[3].starts_with("  in (TASK ONE), f.esl:"), "{lines:#?}");
        assert_eq!(
            lines[4..],
            [
                "  in task ONE, made at f.esl:6:8",
                "  in top level, f.esl:6:8",
                "Failure :TYPE-ERROR, no recovery available.",
                "Aborted",
            ],
            "{lines:#?}"
        );
    }
}

/// Nets in nets, with a cleanup between and a failure of a cleanup on the way.
#[test]
fn a_failure_keeps_the_tasks_of_nets_in_nets() {
    let program = "(defun inner () (fail :stuck 'drill))
(defun net () (task-net (deep (list (inner)))))
(defun nets ()
  (list (task-net (two (list (net))) (three (sleep 3)))))
(with-cleanup-procedure (print 'off)
  (list (pursue (one (with-cleanup-procedure (print 'done)
                       (list (nets)))))))";
    let lines = report("nets", program, &[]);
    let expected = [
        "A failure of cause :STUCK with DRILL.",
        "  in INNER, f.esl:1:17",
        "  in (TASK DEEP), f.esl:2:37",
        "  in task DEEP, made at f.esl:2:15",
        "  in NET, f.esl:2:15",
        "  in (TASK TWO), f.esl:4:30",
        "  in task TWO, made at f.esl:4:9",
        "  in NETS, f.esl:4:9",
        "  in (TASK ONE), f.esl:7:30",
        "  in task ONE, made at f.esl:6:9",
        "  in top level, f.esl:6:9",
        "Failure :STUCK, no recovery available.",
        "Aborted",
    ];
    assert_eq!(lines, expected);
}

/// Forms that fail because all their tasks have failed tell of each.
#[test]
fn failures_that_have_led_to_another_are_told() {
    let program = format!("{FUNCTIONS}(or-parallel (one (outer 1)) (two (list (fail :stuck 'drill))))");
    let lines = report("all", &program, &[]);
    let expected = [
        "A failure of cause :ALL-FAILED with ((:TYPE-ERROR #<TYPE-ERROR>) (:STUCK DRILL)).",
        "  in top level, f.esl:5:1",
        "In task ONE, made at f.esl:5:1:",
        "The value 5 is not of type LIST.",
        "  in INNER, f.esl:1:17",
        "  in MIDDLE, f.esl:3:9",
        "  in OUTER, f.esl:4:24",
        "  in (TASK ONE), f.esl:5:19 (tail call)",
        "In task TWO, made at f.esl:5:1:",
        "A failure of cause :STUCK with DRILL.",
        "  in (TASK TWO), f.esl:5:41",
        "Failure :ALL-FAILED, no recovery available.",
        "Aborted",
    ];
    assert_eq!(lines.len(), expected.len(), "{lines:#?}");
    assert_eq!(lines[1..], expected[1..], "{lines:#?}");
    let order = format!("{FUNCTIONS}(try-in-order (one (outer 1)) (two (list (fail :stuck 'drill))))");
    let in_order = expected.map(|line| line.replace(":5:41", ":5:42").replace(":5:19", ":5:20"));
    assert_eq!(report("in-order", &order, &[])[1..], in_order[1..]);
    let supervised =
        format!("{FUNCTIONS}(list (supervise (:restarts 1)\n  (one :backoff (0 1 0) (outer 1))))");
    let lines = report("supervised", &supervised, &[]);
    let told =
        ["In task ONE, made at f.esl:5:7:", "The value 5 is not of type LIST.", "  in INNER, f.esl:1:17"];
    assert_eq!(lines.windows(3).filter(|lines| *lines == told).count(), 2, "{lines:#?}");
}

/// A recovery procedure or a handler that fails tells where the failure began that it was called for.
#[test]
fn a_recovery_that_fails_keeps_the_calls_of_the_task() {
    let net = "(list (task-net\n    (one (list (middle)))))";
    let task = [
        "  in INNER, f.esl:1:17",
        "  in MIDDLE, f.esl:3:9",
        "  in (TASK ONE), f.esl:8:16",
        "  in task ONE, made at f.esl:7:9",
        "  in top level, f.esl:7:9",
        "Failure :OTHER, no recovery available.",
        "Aborted",
    ];
    let procedure = format!(
        "{FUNCTIONS}(defun recover () (fail :other))
(with-recovery-procedures ((:type-error (list (recover)) (retry)))
  {net})"
    );
    let lines = report("recovery", &procedure, &[]);
    assert_eq!(lines[..2], ["A failure of cause :OTHER.", "  in RECOVER, f.esl:5:19"], "{lines:#?}");
    let at = lines.iter().position(|line| line.starts_with("  while recovering from :TYPE-ERROR"));
    assert_eq!(lines[at.expect("it was recovering") + 1..], task, "{lines:#?}");
    let handler = format!(
        "{FUNCTIONS}(defun recover () (fail :other))
(handler-bind ((type-error (lambda (error) (list error (recover)))))
  {net})"
    );
    let lines = report("handler", &handler, &[]);
    let at = lines.iter().position(|line| line.starts_with("  while handling :TYPE-ERROR"));
    assert_eq!(lines[at.expect("it was handling") + 1..], task, "{lines:#?}");
}

/// After a cleanup, too, a recovery procedure knows where the failure began.
#[test]
fn a_recovery_that_fails_keeps_the_calls_before_a_cleanup() {
    let program = format!(
        "{FUNCTIONS}(with-recovery-procedures ((:type-error (list (fail :other)) (retry)))
  (list (with-cleanup-procedure (print 'off)
    (list (outer 1)))))"
    );
    let lines = report("recovery-cleanup", &program, &[]);
    let at = lines.iter().position(|line| line.starts_with("  while recovering from :TYPE-ERROR"));
    let expected = ["  in INNER, f.esl:1:17", "  in MIDDLE, f.esl:3:9", "  in OUTER, f.esl:4:24"];
    assert_eq!(lines[at.expect("it was recovering") + 1..][..3], expected, "{lines:#?}");
    assert_eq!(lines.iter().filter(|line| line.contains("OUTER")).count(), 1, "{lines:#?}");
}

/// Functions that have left by a tail call are told, with the place of the call if there is only one.
#[test]
fn functions_that_have_left_by_a_tail_call_are_told() {
    let of = |name: &str, program: &str| {
        let mut lines = report(name, program, &[]);
        lines.retain(|line| line.starts_with("  in ") && !line.starts_with("  in top level"));
        lines
    };
    let chain = "(defun inner (x) (car x))
(defun middle (x) (inner x))
(defun outer (x) (if (> x 3) (middle x) (list x)))
(list (outer 5))";
    let expected = [
        "  in INNER, f.esl:1:18",
        "  in MIDDLE, f.esl:2:19 (tail call)",
        "  in OUTER, f.esl:3:30 (tail call)",
    ];
    assert_eq!(of("tail", chain), expected);
    // The same by machine code.
    let loops = chain
        .replace("(list (outer 5))", "(dotimes (i 9) (outer i))")
        .replace("(car x)", "(car (if (> x 7) x nil))");
    let mut lines = report("tail-native", &loops, &["--tier", "native"]);
    lines.retain(|line| line.starts_with("  in "));
    assert_eq!(lines[1..3], expected[1..], "{lines:#?}");
    // Of two calls that may have led on, neither is claimed.
    let two = "(defun inner (x) (car x))
(defun outer (x) (if (> x 3) (inner x) (inner (- x))))
(list (outer 5))";
    assert_eq!(of("tail-two", two), ["  in INNER, f.esl:1:18", "  in OUTER (tail call)"]);
    // A function that was called as a value has left from a known place, for an unknown one.
    let value = "(defun inner (x) (car x))
(defun between (x) (inner x))
(defun outer (f x) (funcall f x))
(list (outer #'between 5))";
    assert_eq!(of("tail-value", value), ["  in INNER, f.esl:1:18", "  in OUTER, f.esl:3:20 (tail call)"]);
    // Functions that do not lead to the failed one have not been there.
    let redefined = "(defun inner (x) (car x))
(defun outer (x) (inner x))
(defun enter (x) (list (outer x)))
(defun change (x) (eval '(defun outer (x) (list x))) (car x))
(defun inner (x) (change x))
(enter 5)";
    let lines = of("tail-redefined", redefined);
    assert!(
        lines[0].starts_with("  in CHANGE, f.esl:4:") && lines[1].starts_with("  in ENTER"),
        "{lines:#?}"
    );
    // The body of a task is the first of its functions.
    let task = "(defun inner (x) (car x))
(task-net (one (inner 5)))";
    let lines = of("tail-task", task);
    assert_eq!(
        lines[..2],
        ["  in INNER, f.esl:1:18", "  in (TASK ONE), f.esl:2:16 (tail call)"],
        "{lines:#?}"
    );
}

/// The failure of an operation of the program keeps the calls of its body.
#[test]
fn a_failure_of_a_mock_keeps_its_calls() {
    let program = format!(
        "{FUNCTIONS}(define-mock drive (x)\n  (list (outer x)))\n(defun go-on () (list (drive 1)))\n(go-on)"
    );
    let lines = report("mock", &program, &[]);
    let expected = [
        "The value 5 is not of type LIST.",
        "  in INNER, f.esl:1:17",
        "  in MIDDLE, f.esl:3:9",
        "  in OUTER, f.esl:4:24",
        "  in (ESL::MOCK DRIVE), f.esl:6:9",
    ];
    assert_eq!(lines[..5], expected, "{lines:#?}");
    assert!(lines[5].starts_with("  in task DRIVE, made at f.esl:"), "{lines:#?}");
    assert!(lines.contains(&"  in GO-ON, f.esl:7:23".to_owned()), "{lines:#?}");
}

/// A mock runs in a task of its own, whose calls come before those of the task that called it.
#[test]
fn a_mock_that_fails_in_a_net_keeps_the_calls_of_both_tasks() {
    let program = "(defun turn () (fail :stuck 3))
(define-mock wheel (side) (list side (turn)))
(defun drive () (list (wheel :left)))
(task-net (a (list (drive))) (b (sleep 1)))";
    let lines = report("mock-in-a-net", program, &[]);
    let expected = [
        "A failure of cause :STUCK with 3.",
        "  in TURN, f.esl:1:16",
        "  in (ESL::MOCK WHEEL), f.esl:2:38",
        "  in task WHEEL, made at f.esl:2:1",
        "  in WHEEL, f.esl:2:1 (tail call)",
        "  in DRIVE, f.esl:3:23",
        "  in (TASK A), f.esl:4:20",
        "  in task A, made at f.esl:4:1",
        "  in top level, f.esl:4:1",
        "Failure :STUCK, no recovery available.",
        "Aborted",
    ];
    assert_eq!(lines, expected);
}

/// The report of a task that no other task waits for says where its body begins.
#[test]
fn a_task_of_its_own_says_where_it_begins() {
    let program = format!("{FUNCTIONS}(spawn (:name 'left) (list (outer 1)))\n(sleep 1)\n(fail :end)");
    let lines = report("spawn", &program, &[]);
    assert_eq!(
        lines[..2],
        ["In task LEFT, begun at f.esl:5:28:", "The value 5 is not of type LIST."],
        "{lines:#?}"
    );
}

/// Calls of the library, and of the modules that come with the machine, take a line.
#[test]
fn calls_of_the_library_are_folded() {
    let program = "(require :json)
(defun total (list)
  (list (reduce (lambda (a b) (list (+ a b))) list)))
(print (handler-case (json:parse \"[1,\") (parse-error () 'refused)))
(print (total '(1 2 3)))";
    let lines = report("folded", program, &[]);
    let expected = [
        "The value (3) is not of type NUMBER.",
        "  in (LAMBDA), f.esl:3:37",
        "  in REDUCE, of the library",
        "  in TOTAL, f.esl:3:9",
        "  in top level, f.esl:5:8",
        "Failure :TYPE-ERROR, no recovery available.",
        "Aborted",
    ];
    assert_eq!(lines, expected);
    let full = report("full", program, &["--full"]);
    assert!(full.iter().any(|line| line.starts_with("  in REDUCE, stdlib/")), "{full:#?}");
    // It begins at the failed call, without the search for a recovery and the report itself.
    assert_eq!(full[..2], ["The value (3) is not of type NUMBER.", "  in (LAMBDA), f.esl:3:37"]);
    let module = "(require :json)
(defun read-it (text)
  (list (json:parse text)))
(print (read-it \"[1,\"))";
    let lines = report("module", module, &[]);
    assert!(lines[1].starts_with("  in JSON::") && lines[1].ends_with(", of the library"), "{lines:#?}");
    assert_eq!(lines[2..4], ["  in READ-IT, f.esl:3:9", "  in top level, f.esl:4:8"], "{lines:#?}");
}

/// A task that has begun no more than it can, in nets without end, still ends with a report.
#[test]
fn nets_nested_very_deep_have_a_short_report() {
    let program = "(defun deep (n) (if (= n 0) (fail :bottom) (list (task-net (one (list (deep (- n 1))))))))
(deep 200)";
    let lines = report("deep", program, &[]);
    assert!(lines.len() < 120 && lines.iter().filter(|line| line.trim() == "…").count() == 1, "{lines:#?}");
}

#[test]
fn tasks_that_exhaust_the_memory_at_once_are_all_reported() {
    let text = "
(defun grow (list) (grow (cons (make-array 1000) list)))
(defun plain () (list (grow nil)))
(defun handling () (handler-bind ((type-error #'print)) (list (grow nil))))
(dotimes (i 4) (spawn (plain)) (spawn (handling)))
(sleep 60)
(print 'done)";
    let folder = Folder::with("reports-memory", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--memory", "64M", "--clock", "virtual", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()), "");
    assert_eq!((done.status, done.output.trim()), (Some(0), "DONE"), "{}", done.errors);
    let reports: Vec<&str> = done.errors.split("In task ").skip(1).collect();
    assert_eq!(reports.len(), 8, "{}", done.errors);
    for report in reports {
        assert!(
            report.contains("begun at main.esl:5:") && report.contains("Failure :HEAP-EXHAUSTED"),
            "{report}"
        );
        // A task without handlers has memory for its report while another one uses up the reserve.
        let is_plain = report.contains("begun at main.esl:5:24");
        assert!(!is_plain || report.contains("  in PLAIN, main.esl:3:"), "{report}");
    }
}
