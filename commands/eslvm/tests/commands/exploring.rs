//! `eslvm explore`: findings, their schedules, what is said of limits, exit statuses.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// The radio may begin to wait after the camera has signalled.
pub(crate) const LOST_SIGNAL: &str = "(defvar *picture* nil)
(defvar *taken* (make-event 'taken))
(task-net
  (camera (setq *picture* t)
          (signal *taken*))
  (radio (unless *picture*
           (wait-for-event *taken*))))
";

/// Runs `eslvm` in a folder of its own, and returns its status and both outputs.
pub(crate) fn run(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String, String) {
    let finished = process::run(eslvm(arguments).current_dir(folder.path()), "");
    (finished.status, finished.output, finished.errors)
}

#[test]
fn a_finding_is_told_by_its_switches_and_repeated_by_its_schedule() {
    let folder = Folder::new("exploring-lost-signal");
    folder.file("lost.esl", LOST_SIGNAL);
    let files = ["--timeline", "lost.svg", "--svg", "finding.svg", "--findings", "lost.findings.json"];
    let (status, output, errors) = run(&folder, &[&["explore"], &files[..], &["lost.esl"]].concat());
    assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
    assert!(output.starts_with("finding 1: no task can ever run again\n  time  RADIO "), "{output}");
    assert!(output.contains("\n     0  reads *PICTURE* = NIL  "), "{output}");
    let stops = output.lines().find(|line| line.contains("has to stop before")).unwrap_or_default();
    assert!(stops.ends_with("  lost.esl:7:12: (wait-for-event *taken*)"), "{output}");
    let sets = output.lines().find(|line| line.contains("sets *PICTURE* to T")).unwrap_or_default();
    assert!(sets.ends_with("  lost.esl:4:11: (setq *picture* t)"), "{output}");
    assert!(output.contains("\n  again: eslvm run --schedule lost-1.schedule lost.esl\n"), "{output}");
    assert!(output.contains("\nviolation: findings: 1 (grain variables, timers idle; "), "{output}");
    let picture = std::fs::read_to_string(folder.path().join("lost.svg")).expect("the timeline is drawn");
    assert!(picture.contains("task RADIO"), "{picture}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("it is written");
    let picture = read("finding.svg");
    for text in [
        "<title>finding 1: no task can ever run again</title>",
        ">reads *PICTURE* = NIL</text>",
        ">has to stop before</text>",
        ">lost.esl:4:11: (setq *picture* t)</text>",
        ">  task RADIO waits for event TAKEN, lost.esl:7:12</text>",
        "prefers-color-scheme: dark",
    ] {
        assert!(picture.contains(text), "{text}: {picture}");
    }
    let found: serde_json::Value = serde_json::from_str(&read("lost.findings.json")).expect("it is JSON");
    assert_eq!(
        (&found["program"], &found["findings"][0]["schedule"]),
        (&"lost.esl".into(), &"lost-1.schedule".into())
    );
    assert_eq!(found["findings"][0]["steps"][0]["text"], "reads *PICTURE* = NIL", "{found}");
    let (status, _, errors) = run(&folder, &["run", "--schedule", "lost-1.schedule", "lost.esl"]);
    assert_eq!(status, Some(4), "{errors}");
    assert!(errors.contains("task RADIO waits for event TAKEN, lost.esl:7:12"), "{errors}");
    // Without the schedule, the program ends well.
    assert_eq!(run(&folder, &["run", "--clock", "virtual", "lost.esl"]).0, Some(0));
}

#[test]
fn a_schedule_is_of_one_program() {
    let folder = Folder::new("exploring-another");
    folder.file("lost.esl", LOST_SIGNAL);
    folder.file("other.esl", "(print 1)");
    folder.file("no.schedule", "choices 1 2 3");
    assert_eq!(run(&folder, &["explore", "lost.esl"]).0, Some(1));
    let (status, output, errors) = run(&folder, &["run", "--schedule", "lost-1.schedule", "other.esl"]);
    assert_eq!((status, output.as_str()), (Some(2), ""));
    assert!(errors.contains("explore again"), "{errors}");
    let (status, _, errors) = run(&folder, &["run", "--schedule", "no.schedule", "lost.esl"]);
    assert_eq!(status, Some(2));
    assert!(
        errors.contains("no.schedule is not a schedule: its first line is not `esl-schedule 2`"),
        "{errors}"
    );
}

#[test]
fn what_was_not_tried_is_no_proof() {
    let folder = Folder::new("exploring-bounded");
    folder.file("lost.esl", LOST_SIGNAL);
    let said = |option: &str, value: &str| {
        let (status, output, errors) = run(&folder, &["explore", option, value, "lost.esl"]);
        assert_eq!(status, Some(7), "{output}{errors}");
        output.lines().next().unwrap_or_default().to_string()
    };
    assert!(said("--switches", "0").starts_with("bounded, not proved: schedules with more switches"));
    assert!(said("--states", "2").starts_with("bounded, not proved: the limit of states"));
    assert!(said("--time", "0").starts_with("bounded, not proved: the time is over"));
}

#[test]
fn choices_are_tried_and_bounded() {
    let folder = Folder::new("exploring-choices");
    folder.file("choice.esl", "(when (and (choose nil t) (choose nil t))\n  (exit 9))\n");
    let (status, output, _) = run(&folder, &["explore", "choice.esl"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.starts_with("finding 1: the program ends with status 9\n"), "{output}");
    assert!(output.contains("     0  chooses form 2  choice.esl:1:12: (choose nil t)\n"), "{output}");
    assert!(output.contains("     0  chooses form 2  choice.esl:1:27: (choose nil t)\n"), "{output}");
    let (status, output, _) = run(&folder, &["explore", "--faults", "1", "choice.esl"]);
    assert_eq!(status, Some(7), "{output}");
}

#[test]
fn what_always_has_to_hold_is_checked_in_every_state() {
    let folder = Folder::new("exploring-always");
    let valves = "(define-property valve (name))
(assert '(valve a :closed))
(assert '(valve b :closed))
(always never-both-open (not (and (valve 'a :open) (valve 'b :open))))
(task-net
  (one (when (valve 'b :closed) (assert '(valve a :open))))
  (two (when (valve 'a :closed) (assert '(valve b :open)))))
";
    folder.file("valves.esl", valves);
    let (status, output, _) = run(&folder, &["explore", "valves.esl"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.contains("NEVER-BOTH-OPEN, which always has to hold, is false."), "{output}");
    // In a critical section no other task runs in between.
    let mended = valves
        .replace("(one (when", "(one (without-interrupts (when")
        .replace("(two (when", "(two (without-interrupts (when");
    let mended =
        mended.replace("a :open))))\n", "a :open)))))\n").replace("b :open)))))\n", "b :open))))))\n");
    folder.file("mended.esl", &mended);
    let (status, output, errors) = run(&folder, &["explore", "mended.esl"]);
    assert_eq!(status, Some(0), "{output}{errors}");
    assert!(
        output.starts_with("complete: no schedule ends badly (grain variables, timers idle; "),
        "{output}"
    );
}

#[test]
fn figures_and_findings_are_json_on_request() {
    let folder = Folder::new("exploring-json");
    folder.file("lost.esl", LOST_SIGNAL);
    let (status, output, _) = run(&folder, &["explore", "--json", "lost.esl"]);
    assert_eq!(status, Some(1));
    let lines: Vec<serde_json::Value> =
        output.lines().map(|line| serde_json::from_str(line).expect("each line is JSON")).collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[0]["schedule"], "lost-1.schedule");
    assert_eq!(lines[0]["switches"].as_array().map(Vec::len), Some(2), "{output}");
    assert_eq!((&lines[1]["findings"], &lines[1]["limit"]), (&1.into(), &serde_json::Value::Null));
    let scope = ["verdict", "grain", "timers"].map(|key| lines[1][key].as_str().unwrap_or_default());
    assert_eq!(scope, ["violation", "variables", "idle"]);
    let steps = lines[0]["steps"].as_array().expect("the steps are told");
    let read = steps.iter().find(|step| step["kind"] == "read").expect("the radio reads");
    assert_eq!(
        (&read["task"], &read["variable"], &read["value"], &read["time"]),
        (&"task RADIO".into(), &"*PICTURE*".into(), &"NIL".into(), &0.0.into())
    );
}

#[test]
fn what_does_not_compile_is_not_explored() {
    let folder = Folder::new("exploring-errors");
    folder.file("open.esl", "(print 1");
    assert_eq!(run(&folder, &["explore", "open.esl"]).0, Some(3));
    assert_eq!(run(&folder, &["explore", "missing.esl"]).0, Some(2));
}

/// A schedule that does not end is told up to where it is known not to, and a run that comes to new states
/// for ever is given up when the time is over.
#[test]
fn what_never_ends_is_told_or_given_up() {
    let folder = Folder::new("exploring-endless");
    folder.file("endless.esl", "(loop)");
    let (status, output, errors) = run(&folder, &["explore", "endless.esl"]);
    assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
    assert!(output.starts_with("finding 1: from here on, the program never ends\n"), "{output}");
    folder.file("counts.esl", "(let ((i 0)) (loop (incf i)))");
    let (status, output, _) = run(&folder, &["explore", "--time", "1", "counts.esl"]);
    assert_eq!(status, Some(7), "{output}");
    // The condition itself may not end.
    folder.file("check.esl", "(always never-told (loop))");
    assert_eq!(run(&folder, &["explore", "check.esl"]).0, Some(1));
}

/// Work that takes no time never exceeds a limit of time, unless timers may end at any point.
#[test]
fn timers_may_end_at_any_point() {
    let folder = Folder::new("exploring-timers");
    let text = "(defvar *done* (make-event 'done))
(spawn (signal *done*))
(with-timeout 5
  (wait-for-event *done* :unless-count 0))
";
    folder.file("hurry.esl", text);
    let (status, output, errors) = run(&folder, &["explore", "hurry.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
    assert!(
        output.ends_with(
            "\nnot tried: timers that end early (--timers any); aborts by an operator (--aborts)\n"
        ),
        "{output}"
    );
    let (status, output, _) = run(&folder, &["explore", "--timers", "any", "hurry.esl"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.starts_with("finding 1: a failure leaves the main task\n"), "{output}");
    assert!(output.contains("  5 s pass, and timers end\n"), "{output}");
    let (status, _, errors) = run(&folder, &["run", "--schedule", "hurry-1.schedule", "hurry.esl"]);
    assert_eq!(status, Some(1), "{errors}");
    // The time that a cleanup may take does not end at any point.
    let text = "(defvar *begun* (make-event 'begun))
(defvar *done* (make-event 'done))
(defvar *is-tidy* nil)
(defvar *task* (spawn (unwind-protect (progn (signal *begun*) (sleep 9))
                        (wait-for-event *done* :unless-count 0)
                        (setq *is-tidy* t))))
(wait-for-event *begun* :unless-count 0)
(spawn (signal *done*))
(abort-task *task*)
(wait-for-task *task*)
(unless *is-tidy* (fail :untidy))
";
    folder.file("tidy.esl", text);
    let (status, output, errors) = run(&folder, &["explore", "--timers", "any", "tidy.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
}

#[test]
fn memory_bounds_an_exploration() {
    let folder = Folder::new("exploring-memory");
    folder.file("lost.esl", LOST_SIGNAL);
    let figures =
        |output: &str| output.lines().find(|line| line.starts_with("violation")).map(str::to_string);
    let (_, much, _) = run(&folder, &["explore", "lost.esl"]);
    let (status, little, errors) = run(&folder, &["explore", "--memory", "4M", "lost.esl"]);
    assert_eq!((status, errors.as_str(), figures(&little)), (Some(1), "", figures(&much)));
    let (status, _, errors) = run(&folder, &["explore", "--memory", "much", "lost.esl"]);
    assert!(status == Some(2) && errors.contains("--memory <SIZE>"), "{errors}");
}

/// Several threads find what one does, in the same order and by the same schedules.
#[test]
fn threads_find_the_same_as_one() {
    let folder = Folder::new("exploring-jobs");
    let text = "(defvar *a* (make-event 'a))
(defvar *b* (make-event 'b))
(defvar *left* 3)
(task-net
  (one (signal *a*) (wait-for-event *b*) (decf *left*))
  (two (signal *b*) (wait-for-event *a*) (decf *left*))
  (three (signal *a*) (signal *b*) (when (choose nil t) (fail :dropped))))
";
    folder.file("signals.esl", text);
    let found = |jobs: &str| {
        let (status, output, errors) = run(&folder, &["explore", "--jobs", jobs, "signals.esl"]);
        assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
        (output, std::fs::read_to_string(folder.path().join("signals-1.schedule")).expect("it was written"))
    };
    let one = found("1");
    assert!(one.0.contains("finding 2: "), "{}", one.0);
    assert_eq!(one, found("2"));
    assert_eq!(one, found("5"));
}

/// A lost update is found without an option, and is not hidden by a coarser grain.
#[test]
fn a_lost_update_of_a_variable_is_found_by_default() {
    let folder = Folder::new("exploring-lost-update");
    let text = "(defvar *count* 0)
(defun inc (n) (+ n 1))
(defun bump () (let ((old *count*)) (setq *count* (inc old))))
(task-net (one (bump)) (two (bump)))
(unless (= *count* 2) (exit 9))
";
    folder.file("count.esl", text);
    for options in [&[][..], &["--grain", "variables"], &["--grain", "ticks"]] {
        let (status, output, errors) = run(&folder, &[&["explore"], options, &["count.esl"]].concat());
        assert_eq!((status, errors.as_str()), (Some(1), ""), "{output}");
        assert!(output.starts_with("finding 1: the program ends with status 9\n"), "{output}");
        for (told, times) in [("reads *COUNT* = 0", 2), ("sets *COUNT* to 1", 2), ("stop before", 1)] {
            assert_eq!(output.matches(told).count(), times, "{told}\n{output}");
        }
        assert_eq!(run(&folder, &["run", "--schedule", "count-1.schedule", "count.esl"]).0, Some(9));
    }
    let variables = "changes of special variables (count.esl:3:";
    for (grain, what) in
        [("changes", format!("data that tasks read, {variables}")), ("reads", variables.into())]
    {
        let (status, output, errors) = run(&folder, &["explore", "--grain", grain, "count.esl"]);
        assert_eq!((status, errors.as_str()), (Some(7), ""), "{output}");
        let said = format!("bounded, not proved: grain {grain} does not see {what}");
        assert!(output.starts_with(&said) && output.contains(", grain variables does; "), "{output}");
    }
}

/// Tasks that share an object that grain `variables` does not see: the finer grain is tried as well, and the
/// coarser one alone claims no proof.
#[test]
fn a_lost_update_of_an_object_is_found_by_default() {
    let folder = Folder::new("exploring-objects");
    // No special variable leads to the objects.
    let places = [
        ("slots", "(tank (make-tank :level 0))", "(tank-level tank)"),
        ("elements of arrays", "(levels (vector 0))", "(svref levels 0)"),
        ("pairs", "(levels (list 0))", "(car levels)"),
        (
            "hash tables",
            "(levels (let ((it (make-hash-table))) (setf (gethash 1 it) 0) it))",
            "(gethash 1 levels)",
        ),
        ("properties of symbols", "(level (progn (setf (get 'tank 'level) 0) 'level))", "(get 'tank level)"),
        ("variables of closures", "(level 0)", "level"),
    ];
    for (what, binding, place) in places {
        let update = format!("(setf {place} (inc {place}))");
        let text = |update: &str| {
            format!(
                "(defstruct tank level)\n(defun inc (n) (+ n 1))\n(let ({binding})\n  \
                 (task-net (one (inc 0) {update}) (two (inc 0) {update}))\n  (unless (= {place} 2) (exit 9)))\n"
            )
        };
        folder.file("tank.esl", text(&update));
        let (status, output, errors) = run(&folder, &["explore", "tank.esl"]);
        assert_eq!((status, errors.as_str()), (Some(1), ""), "{what}: {output}");
        assert!(output.contains("\nviolation: findings: 1 (grain ticks, timers idle; "), "{what}: {output}");
        let (status, output, _) = run(&folder, &["explore", "--grain", "variables", "tank.esl"]);
        assert_eq!(status, Some(7), "{what}: {output}");
        let said = "bounded, not proved: grain variables does not see changes of ";
        assert!(
            output.starts_with(said) && output.contains(&format!("{what} (tank.esl:")),
            "{what}: {output}"
        );
        assert!(output.contains(", grain ticks does; no schedule so far ends badly ("), "{what}: {output}");
        // In a critical section no other task runs in between, which grain `ticks` proves.
        folder.file("tank.esl", text(&format!("(without-interrupts {update})")));
        let (status, output, errors) = run(&folder, &["explore", "tank.esl"]);
        assert_eq!((status, errors.as_str()), (Some(0), ""), "{what}: {output}");
        assert!(output.starts_with("complete: no schedule ends badly (grain ticks, "), "{what}: {output}");
    }
    // A task that has slept is not where it was before it slept.
    folder.file("sleeps.esl", "(let ((cell (list 0))) (sleep 3) (setf (car cell) 1))");
    let (status, output, errors) = run(&folder, &["explore", "sleeps.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
    // A program that reads the clock is elsewhere when time has passed.
    for (text, wanted) in [
        ("(loop until (> (now) 3) do (sleep 1))", "complete: no schedule ends badly (grain variables, "),
        ("(loop (sleep 1) (when (> (now) 100) (fail :late)))", "finding 1: a failure leaves the main task"),
    ] {
        folder.file("clock.esl", format!("(define-cause :late ())\n{text}"));
        let (_, output, _) = run(&folder, &["explore", "clock.esl"]);
        assert!(output.starts_with(wanted), "{text}: {output}");
    }
    // When the finer grain is cut off, the verdict says so, and what the coarser one has shown.
    let (status, output, _) = run(&folder, &["explore", "--states", "50", "tank.esl"]);
    assert_eq!(status, Some(7), "{output}");
    assert!(output.starts_with("bounded, not proved: the limit of states is reached; "), "{output}");
}

/// A finding is recorded, and gone through forwards and backwards.
#[test]
fn a_run_by_a_schedule_is_recorded_and_replayed() {
    let folder = Folder::new("exploring-replay");
    folder.file("lost.esl", LOST_SIGNAL);
    assert_eq!(run(&folder, &["explore", "lost.esl"]).0, Some(1));
    let record = ["run", "--schedule", "lost-1.schedule", "--record", "lost.eslj", "lost.esl"];
    let (status, _, errors) = run(&folder, &record);
    assert_eq!(status, Some(4), "{errors}");
    let (status, _, errors) = run(&folder, &["replay", "lost.eslj"]);
    assert_eq!(status, Some(4), "{errors}");
    assert!(errors.contains("task RADIO waits for event TAKEN, lost.esl:7:12"), "{errors}");
    let commands = "break task:RADIO\ncontinue\nprint *picture*\ntick 1\ncontinue\nprint (list *picture*)\n";
    let replay = &mut eslvm(&["replay", "--until", "tick:1", "lost.eslj"]);
    let finished = process::run(replay.current_dir(folder.path()), commands);
    assert_eq!(finished.status, Some(0), "{}", finished.errors);
    assert!(finished.output.contains("NIL") || finished.output.contains("T"), "{}", finished.output);
}

/// The explorations of the manual find what it says, with its figures.
#[test]
fn the_manual_shows_what_is_found() {
    let manual = include_str!("../../../../docs/manual/testing.md");
    let folder = Folder::new("exploring-manual");
    let mut tried = 0;
    for block in manual.split("```text\n$ eslvm explore ").skip(1) {
        let (arguments, shown) = block.split_once('\n').expect("the command has a line");
        let shown = shown.split("```").next().expect("it ends");
        let before = manual.split(&format!("```text\n$ eslvm explore {arguments}\n")).next();
        // A program that goes on for ever is not one of those that the chapter's test runs.
        let program = before.and_then(|text| {
            let fences = ["```lisp\n", "```text\n"].into_iter();
            let begin = fences.filter_map(|fence| text.rfind(fence).map(|at| at + fence.len())).max()?;
            text[begin..].split("```").next()
        });
        let arguments: Vec<&str> = ["explore"].into_iter().chain(arguments.split(' ')).collect();
        let name = arguments.last().expect("there is the command");
        folder.file(name, program.expect("the program stands before"));
        let (status, output, errors) = run(&folder, &arguments);
        let expected = if arguments.contains(&"--strict") { 0 } else { 1 };
        assert_eq!((status, errors.as_str()), (Some(expected), ""), "{output}");
        assert!(output.starts_with(shown), "{output}\n{shown}");
        tried += 1;
    }
    assert_eq!(tried, 4);
}

/// An update that no tick divides is reported as fragile, with its two places.
#[test]
fn an_update_that_is_safe_by_chance_is_fragile() {
    let folder = Folder::new("exploring-fragile");
    let text = |update: &str| {
        format!(
            "(defvar *n* 0)
(defun bump ()
  {update})
(task-net (one (bump)) (two (bump)))
(unless (= *n* 2) (exit 9))
"
        )
    };
    folder.file("count.esl", text("(setq *n* (+ *n* 1))"));
    let (status, output, errors) = run(&folder, &["explore", "--strict", "count.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
    assert!(
        output.starts_with("complete: no schedule ends badly (grain variables, timers idle; "),
        "{output}"
    );
    assert!(output.contains("\nfragile 1: the program ends with status 9\n  time  "), "{output}");
    let places = "    count.esl:3:16: *n*\n    count.esl:3:3: (setq *n* (+ *n* 1))\n";
    assert!(output.contains("  *N* is used at two places") && output.contains(places), "{output}");
    assert!(output.contains("\nfragile: findings: 1 (grain variables, "), "{output}");
    assert_eq!(run(&folder, &["run", "--schedule", "count-1.schedule", "count.esl"]).0, Some(9));
    assert_eq!(run(&folder, &["explore", "--deny", "fragile", "count.esl"]).0, Some(1));
    let (_, output, _) = run(&folder, &["explore", "--strict", "--json", "count.esl"]);
    assert!(output.contains("{\"fragile\":\"the program ends with status 9\""), "{output}");
    folder.file("count.esl", text("(without-interrupts (setq *n* (+ *n* 1)))"));
    let (status, output, errors) = run(&folder, &["explore", "--deny", "fragile", "count.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
    assert!(
        output.contains("\nnot fragile: no schedule ends badly with switches before each use "),
        "{output}"
    );
}

/// Restarts of a durable run are choices, and the table of a finding names them.
#[test]
fn restarts_are_told() {
    let folder = Folder::new("exploring-restarts");
    let program = |procedure: &str| {
        format!(
            "(defvar *moved* 0)
(define-mock move-arm (place) (incf *moved*) place)
(define-mock arm-is-at (place) (and (> *moved* 0) place))
(define-idempotent arm-is-at)
(always at-most-once (<= *moved* 1))
(with-recovery-procedures (((:interrupted-by-restart) :retries :infinite {procedure}))
  (move-arm 'tray))
"
        )
    };
    folder.file("once.esl", program("(if (arm-is-at 'tray) (abort 'tray) (retry))"));
    folder.file("twice.esl", program("(retry)"));
    let (status, output, _) = run(&folder, &["explore", "twice.esl"]);
    assert!(status == Some(0) && output.contains("; restarts of a durable run (--crashes)"), "{output}");
    let (status, output, errors) = run(&folder, &["explore", "--crashes", "2", "once.esl"]);
    assert_eq!((status, errors.as_str()), (Some(0), ""), "{output}");
    assert!(
        output.starts_with("complete: no schedule ends badly (grain variables, timers idle, crashes 2;"),
        "{output}"
    );
    let (status, output, _) = run(&folder, &["explore", "--crashes", "1", "twice.esl"]);
    assert_eq!(status, Some(1), "{output}");
    assert!(output.contains("a restart interrupts it behind its effect"), "{output}");
    let (status, _, errors) = run(&folder, &["run", "--schedule", "twice-1.schedule", "twice.esl"]);
    assert!(
        status == Some(1) && errors.contains("AT-MOST-ONCE, which always has to hold, is false"),
        "{errors}"
    );
    let (_, output, _) = run(&folder, &["explore", "--crashes", "1", "--json", "twice.esl"]);
    assert!(output.contains("\"kind\":\"restart\"") && output.contains("\"crashes\":1"), "{output}");
}
