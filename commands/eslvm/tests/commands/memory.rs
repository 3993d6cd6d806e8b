//! The resident memory of `eslvm` while programs use up what `--memory` allows, each in its own way.
//!
//! Guarantees: whatever a program fills the memory with, the process takes at most the limit and [`SLACK`]
//! more than for a program that does nothing, and what hits the limit is a failure. Programs that give back
//! what they use never reach it.

use std::path::Path;
use std::process::Stdio;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::{eslvm, most_memory};

/// Mebibytes of `--memory`.
const LIMIT: usize = 24;
/// Mebibytes that the process may take beside that and what it takes for a program that does nothing: what
/// the allocator keeps, and tables of the scheduler, which double when they are full.
const SLACK: usize = 26;

/// Longest time that a program may take: a bomb that goes off slowly has been seen for long enough then.
const PATIENCE: Duration = Duration::from_secs(20);

/// Programs that take memory without end, each below what it fills it with.
const BOMBS: &str = include_str!("../../../../conformance/bombs.esl");

/// Programs that use much memory over time and little at once, each below what it uses.
const LEAKS: &str = include_str!("../../../../conformance/leaks.esl");

/// Runs a program. Returns its exit status, and its most resident memory in mebibytes.
fn run(folder: &Path, name: &str, text: &str, limit: usize, options: &[&str]) -> (Option<i32>, usize) {
    let path = folder.join(format!("{}.esl", name.replace(' ', "-")));
    std::fs::write(&path, text).expect("the program can be written");
    let memory = format!("{limit}M");
    let mut command = eslvm(&["run", "--clock", "virtual", "--memory", &memory]);
    command.args(options).arg(&path);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().expect("eslvm starts");
    let (started, mut peak) = (Instant::now(), 0);
    loop {
        peak = peak.max(most_memory(&child).unwrap_or(0));
        if let Some(status) = child.try_wait().expect("the state of a child is known") {
            return (status.code(), peak);
        }
        if started.elapsed() > PATIENCE {
            child.kill().expect("a child can be killed");
            child.wait().expect("a child that was killed ends");
            return (None, peak);
        }
        thread::sleep(Duration::from_millis(2));
    }
}

/// Returns the mebibytes that a program may take whose limit is `limit`. How much of its code and its library
/// a process has in memory depends on the build.
fn most(folder: &Path, limit: usize) -> usize {
    let (status, idle) = run(folder, "idle", "(print 1)", limit, &[]);
    assert_eq!(status, Some(0), "a program that does nothing");
    idle + limit + SLACK
}

/// Returns the programs of a file: their names, which follow three semicolons, and texts.
fn sections(file: &'static str) -> Vec<(&'static str, &'static str)> {
    file.split("\n;;; ").skip(1).map(|section| section.split_once('\n').expect("a name has a line")).collect()
}

/// Runs programs, two at a time, and returns what `judge` says about them.
#[allow(clippy::print_stderr, reason = "whoever sets the variable wants to see the figures")]
fn run_all(
    programs: &'static str,
    options: &[&str],
    judge: impl Fn(Option<i32>) -> Option<&'static str> + Sync,
) -> Vec<String> {
    let folder = esl_conformance::folder::Folder::new(if options.is_empty() { "leaks" } else { "bombs" });
    let most = most(folder.path(), LIMIT);
    let programs: Vec<(&str, &str)> = sections(programs);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut faults = Vec::new();
        while let Some((name, text)) = programs.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (status, peak) = run(folder.path(), name, text, LIMIT, options);
            if std::env::var_os("ESL_SHOW_PEAKS").is_some() {
                eprintln!("{name:45} {peak:4} MiB, status {status:?}");
            }
            let fault = if peak > most {
                Some(format!("more memory than {most} MiB"))
            } else {
                judge(status).map(String::from)
            };
            if let Some(fault) = fault {
                faults.push(format!("{name}: {fault}, with {peak} MiB at most and status {status:?}"));
            }
        }
        faults
    };
    thread::scope(|scope| {
        let other = scope.spawn(work);
        let mut faults = work();
        faults.extend(other.join().expect("no thread panics"));
        faults
    })
}

#[test]
fn no_program_takes_much_more_memory_than_it_may() {
    let faults = run_all(BOMBS, &["--budget", "10000000"], |status| {
        // 1 is a failure for want of stack, 5 one for want of memory, or the end of the budget. A program
        // that takes its time has not been shown to stay within the limit for ever, but for long.
        (!matches!(status, Some(1 | 5) | None)).then_some("it did not end by a limit")
    });
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn what_is_given_back_is_used_again() {
    let faults = run_all(LEAKS, &[], |status| (!matches!(status, Some(0) | None)).then_some("it failed"));
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn stacks_that_grow_side_by_side_leave_no_holes() {
    let text = "(dotimes (i 100) (spawn (labels ((down (n) (1+ (down (1+ n))))) (down 0))))\n(sleep 1)";
    let folder = esl_conformance::folder::Folder::new("stacks");
    let (status, peak) = run(folder.path(), "stacks", text, 64, &["--budget", "10000000"]);
    assert!(peak <= most(folder.path(), 64), "{peak} MiB at most");
    assert!(matches!(status, Some(0 | 1 | 5) | None), "{status:?}");
}

#[test]
fn many_tasks_without_room_share_collections() {
    // Tens of thousands of tasks need memory at the same time, and end for want of it.
    let text = "(defun split () (or-parallel (a (split)) (b (split))))\n(split)";
    let folder = esl_conformance::folder::Folder::new("shared-collections");
    let path = folder.path().join("split.esl");
    std::fs::write(&path, text).expect("the program can be written");
    let memory = format!("{LIMIT}M");
    let mut command = eslvm(&["run", "--clock", "virtual", "--memory", &memory, "--budget", "2000000"]);
    let output = command.arg("--stats").arg(&path).output().expect("eslvm starts");
    let figures = String::from_utf8_lossy(&output.stderr).into_owned();
    let figure = |name: &str| -> u64 {
        let line = figures.lines().find(|line| line.split_whitespace().next() == Some(name));
        line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or_default()
    };
    let (tasks, collections) = (figure("tasks"), figure("collections"));
    assert!(tasks > 10_000, "{figures}");
    assert!(collections < tasks / 100, "{collections} collections for {tasks} tasks");
}
