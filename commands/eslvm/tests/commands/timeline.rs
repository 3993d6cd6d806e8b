//! `eslvm run --timeline`: the trace keeps the rules of the Trace Event Format, and holds what happened; so
//! does the drawing.

use std::collections::HashMap;

use esl_conformance::folder::Folder;
use esl_conformance::process;
use serde_json::Value;

use crate::eslvm;

/// Tasks that wait, signal, fail, recover and are aborted; and memory that is collected.
const PROGRAM: &str = r#"
(defvar *go* (make-event 'go))
(defun work (n) (dotimes (i n) (make-list 100)))
(let ((waiter (spawn (:name 'waiter) (list (wait-for-event *go*) (sleep 0.01))))
      (endless (spawn (:name "end\"less") (loop))))
  (sleep 0.01)
  (spawn (:name 'signaller) (signal *go* 1) (work 30000))
  (wait-for-task waiter)
  (abort-task endless)
  (with-recovery-procedures ((:oops (abort 'recovered)))
    (with-guardian (sleep 0.01) (fail :oops)
      (sleep 1)))
  (spawn (:name 'unlucky) (fail :lost)))
"#;

/// Runs a program with options; returns the timeline that it writes to a file of this name.
fn run(name: &str, program: &str, options: &[&str]) -> String {
    let folder = Folder::new(&format!("timeline-{name}"));
    let source = folder.file("program.esl", program);
    run_file(&folder.join(name), &source, options)
}

/// Runs the program in a file with options; returns the timeline, which it writes to `timeline`.
fn run_file(timeline: &str, source: &str, options: &[&str]) -> String {
    let run = process::run(eslvm(&["run"]).args(options).args(["--timeline", timeline, source]), "");
    assert_eq!(run.status, Some(0), "{}", run.errors);
    std::fs::read_to_string(timeline).expect("the timeline is there")
}

/// A member of an event that is a text.
fn text<'a>(event: &'a Value, member: &str) -> &'a str {
    event[member].as_str().unwrap_or_else(|| panic!("no {member} in {event}"))
}

/// Asserts that a trace keeps the rules: what each phase needs, times in order, slices that nest and end,
/// flows with two ends inside slices. Gives its events.
fn check(trace: &str) -> Vec<Value> {
    let mut trace: Value = serde_json::from_str(trace).expect("it is JSON");
    assert!(matches!(text(&trace, "displayTimeUnit"), "ms" | "ns"));
    let Value::Array(events) = trace["traceEvents"].take() else { panic!("no list of events") };
    let mut names: HashMap<(u64, u64), String> = HashMap::new();
    let mut processes: HashMap<u64, String> = HashMap::new();
    let mut slices: HashMap<(u64, u64), Vec<String>> = HashMap::new();
    let mut flows: HashMap<u64, (String, String, bool)> = HashMap::new();
    let mut latest = 0.0;
    for event in &events {
        let track = (event["pid"].as_u64().expect("a process"), event["tid"].as_u64().expect("a track"));
        let time = event["ts"].as_f64().expect("a time");
        assert!(time >= latest, "{event} comes before {latest}");
        latest = time;
        let name = text(event, "name").to_string();
        let open = slices.entry(track).or_default();
        match text(event, "ph") {
            "M" => {
                let of_track = match &name[..] {
                    "process_name" => processes.insert(track.0, text(&event["args"], "name").into()),
                    "thread_name" => names.insert(track, text(&event["args"], "name").into()),
                    "thread_sort_index" => event["args"]["sort_index"].as_i64().map(|_| String::new()),
                    _ => panic!("no such metadata: {event}"),
                };
                assert!(name != "thread_sort_index" || of_track.is_some(), "{event}");
                continue;
            }
            "B" => {
                assert!(!text(event, "cat").is_empty(), "{event}");
                open.push(name);
            }
            "E" => assert_eq!(open.pop(), Some(name), "{event}"),
            "i" => assert_eq!(text(event, "s"), "t"),
            "s" => {
                assert!(!open.is_empty(), "{event} is in no slice");
                let id = event["id"].as_u64().expect("a number");
                let flow = (name, text(event, "cat").to_string(), false);
                assert!(flows.insert(id, flow).is_none(), "{event} is there twice");
            }
            "f" => {
                assert!(!open.is_empty() && text(event, "bp") == "e", "{event} is in no slice");
                let flow = flows.get_mut(&event["id"].as_u64().expect("a number")).expect("it has begun");
                assert_eq!(*flow, (name, text(event, "cat").to_string(), false), "{event}");
                flow.2 = true;
            }
            phase => panic!("the phase {phase} is not used"),
        }
        assert!(names.contains_key(&track) && processes.contains_key(&track.0), "{event}: nameless track");
        assert!(event.get("dur").is_none(), "{event}: only complete events have one");
    }
    assert!(slices.values().all(Vec::is_empty), "slices that do not end: {slices:?}");
    assert!(flows.values().all(|(.., has_ended)| *has_ended), "flows that do not end: {flows:?}");
    events
}

fn check_contents(events: &[Value]) {
    let count = |phase: &str, name: &str| {
        let is_such = |event: &&Value| text(event, "ph") == phase && text(event, "name") == name;
        events.iter().filter(is_such).count()
    };
    let tracks: Vec<&str> = events
        .iter()
        .filter(|event| text(event, "name") == "thread_name")
        .map(|event| text(&event["args"], "name"))
        .collect();
    for name in ["the main task", "task WAITER", "task SIGNALLER", "task UNLUCKY", "task GUARDIAN"] {
        assert!(tracks.contains(&name), "no {name} among {tracks:?}");
    }
    assert!(count("B", "runs") > 5 && count("B", "ready") > 5 && count("B", "waits for event GO") == 1);
    assert!(count("s", "event GO") == 1 && count("i", "signals event GO") == 1);
    assert!(count("i", "fails with :OOPS") == 1 && count("i", "recovers from :OOPS") == 1);
    assert!(count("i", "fails with :LOST") == 1 && count("i", "failed") == 1);
    assert!(count("i", "abort requested") == 1 && count("i", "aborted") == 1);
    assert!(count("B", "collection") >= 1 && count("B", "pause") >= 2);
}

#[test]
fn a_trace_keeps_the_rules_of_its_format() {
    for clock in ["real", "virtual"] {
        let trace = run(&format!("{clock}.json"), PROGRAM, &["--clock", clock]);
        check_contents(&check(&trace));
    }
}

#[test]
fn the_trace_of_a_large_program_keeps_them_too() {
    let source = esl_conformance::root().join("examples/rover.esl").display().to_string();
    let timeline = Folder::new("timeline-rover").join("rover.json");
    let events = check(&run_file(&timeline, &source, &["--clock", "virtual"]));
    let is_there = |phase: &str, name: &str| {
        events.iter().any(|event| text(event, "ph") == phase && text(event, "name").starts_with(name))
    };
    assert!(is_there("B", "waits for") && is_there("s", "") && is_there("i", "recovers from"));
    assert!(events.len() > 300, "{}", events.len());
}

#[test]
fn with_a_virtual_clock_the_trace_is_the_same_every_time() {
    let options = ["--clock", "virtual", "--seed", "3"];
    // Describing a failure takes work in proportion to the length of the file's name.
    let is_same = run("one.json", PROGRAM, &options) == run("two.json", PROGRAM, &options);
    assert!(is_same, "one.json and two.json differ");
}

#[test]
fn a_trace_of_tasks_without_end_is_whole() {
    check(&run("exit.json", "(dotimes (i 100) (spawn (sleep 100))) (sleep 0.001) (exit 0)", &[]));
}

#[test]
fn a_drawing_shows_the_same() {
    let svg = run("picture.svg", PROGRAM, &["--clock", "virtual"]);
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    for shown in ["the main task", "task WAITER", "fails :OOPS", "end\"less", "event GO"] {
        assert!(svg.contains(shown), "no {shown}");
    }
    let count = |what: &str| svg.matches(what).count();
    // Once in the legend.
    assert_eq!(count("<circle class=\"v\""), 2);
    assert_eq!(count("<text"), count("</text>"));
    assert_eq!(count("<title"), count("</title>"));
}

#[test]
fn a_drawing_of_a_long_run_shows_its_beginning() {
    let program = "(dotimes (i 200) (spawn (dotimes (k 100) (sleep 1))))";
    let svg = run("long.svg", program, &["--clock", "virtual"]);
    assert!(svg.contains("Only the beginning of the run is shown") && svg.contains("101 more tasks"));
    assert!(svg.len() < 4 << 20);
}

#[test]
fn figures_tell_of_pauses_and_of_tasks() {
    let source = Folder::new("figures").file("figures.esl", PROGRAM);
    let run =
        |option: &str| process::run(&mut eslvm(&["run", "--clock", "virtual", option, &source]), "").errors;
    let all = run("--stats=tasks");
    let figure = |name: &str| {
        let line = all.lines().find(|line| line.trim_start().starts_with(name));
        let figure =
            line.and_then(|line| line.split_whitespace().rev().find_map(|word| word.parse::<f64>().ok()));
        figure.unwrap_or_else(|| panic!("no {name} in {all}"))
    };
    for name in ["ticks", "turns", "switches", "peak heap", "collections", "pauses", "longest"] {
        assert!(figure(name) > 0.0, "{name}");
    }
    assert!(figure("switches") <= figure("turns"));
    let tasks: Vec<&str> = all.lines().filter(|line| line.contains("  task ")).collect();
    // Most ticks first: the one that loops has had most.
    assert!(tasks[0].contains("aborted") && tasks[0].ends_with("less\""), "{all}");
    assert!(all.contains("succeeded  the main task") && all.contains("failed     task UNLUCKY"), "{all}");
    assert!(!run("--stats").contains("  task "));
}

#[cfg(unix)]
#[test]
fn a_wait_for_an_operation_has_its_name() {
    let folder = Folder::new("timeline-operation");
    let source = folder.file("program.esl", "(require :process) (process:run-program '(\"true\"))");
    for (file, expected) in [
        ("run.json", "\"waits for operation %PROCESS-RUN 1\""),
        ("run.svg", "<title>waits for operation %PROCESS-RUN 1,"),
    ] {
        let path = folder.join(file);
        let run = process::run(&mut eslvm(&["run", "--allow-run=true", "--timeline", &path, &source]), "");
        assert_eq!(run.status, Some(0), "{}", run.errors);
        let timeline = std::fs::read_to_string(path).expect("it is there");
        assert!(timeline.contains(expected), "{timeline}");
    }
}
