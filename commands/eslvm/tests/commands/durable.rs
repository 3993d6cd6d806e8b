//! Durable runs as processes: killed, paused, refused, looked at.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;

/// An agent that counts, with a fact for each number, and says when it goes on.
const AGENT: &str = "(define-input *resumed*)
(defvar *count* 0)
(defun say (control &rest arguments) (format t \"~?~%\" control arguments) (finish-output))
(spawn (:name 'watcher :daemon t)
  (loop (multiple-value-bind (downtime process) (wait-for-event *resumed*)
          (say \"process ~d ~a\" process (>= downtime 0)))))
(loop repeat 5
      do (incf *count*)
         (assert (list 'counted *count*))
         (say \"count ~d\" *count*)
         (sleep 0.2))
(say \"over ~d\" *count*)
(exit 7)";

pub(crate) struct Agent {
    pub(crate) folder: Folder,
}

pub(crate) struct Running {
    child: Child,
    output: BufReader<ChildStdout>,
}

impl Agent {
    pub(crate) fn new(name: &str, text: &str) -> Agent {
        let folder = Folder::new(name);
        folder.file("agent.esl", text);
        Agent { folder }
    }

    pub(crate) fn command(&self, options: &[&str]) -> Command {
        let mut command = eslvm(&["run", "--state", &self.folder.join("state")]);
        command.args(options).arg(self.folder.join("agent.esl"));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    pub(crate) fn start(&self, options: &[&str]) -> Running {
        let mut child = self.command(options).spawn().expect("the command is there");
        let output = BufReader::new(child.stdout.take().expect("the output is a pipe"));
        Running { child, output }
    }

    /// Runs the command to its end: its status, its output and its errors.
    pub(crate) fn run(&self, options: &[&str]) -> (Option<i32>, String, String) {
        let done = self.command(options).output().expect("the command is there");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (done.status.code(), text(&done.stdout), text(&done.stderr))
    }

    pub(crate) fn state(&self, options: &[&str]) -> (Option<i32>, String, String) {
        let mut command = eslvm(&["state"]);
        let done =
            command.args(options).arg(self.folder.join("state")).output().expect("the command is there");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (done.status.code(), text(&done.stdout), text(&done.stderr))
    }
}

impl Running {
    /// Waits for a line of output that is this.
    pub(crate) fn wait_for(&mut self, expected: &str) {
        let mut line = String::new();
        while line.trim() != expected {
            line.clear();
            assert!(self.output.read_line(&mut line).expect("output is text") > 0, "no line {expected}");
        }
    }

    pub(crate) fn send(&self, signal: &str) {
        let sent = Command::new("kill").args([signal, &self.child.id().to_string()]).status();
        assert!(sent.expect("there is a kill").success());
    }

    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        // A run whose output is closed ends by that.
        let mut rest = String::new();
        self.output.read_to_string(&mut rest).expect("output is text");
        let mut errors = String::new();
        let mut stream = self.child.stderr.take().expect("it is a pipe");
        stream.read_to_string(&mut errors).expect("errors are text");
        (self.child.wait().expect("a child can be waited for").code(), errors)
    }
}

#[test]
fn a_run_that_is_killed_goes_on() {
    let agent = Agent::new("durable-killed", AGENT);
    for (process, line) in ["count 1", "count 3", "count 4"].iter().enumerate() {
        let mut running = agent.start(&[]);
        running.wait_for(line);
        running.send("-KILL");
        let (status, errors) = running.end();
        assert_eq!(status, None);
        assert_eq!(errors.contains(&format!("the run goes on in process {}", process + 1)), process > 0);
    }
    let (status, output, errors) = agent.run(&[]);
    assert_eq!(status, Some(7), "{output}{errors}");
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!(lines.last(), Some(&"over 5"), "{output}");
    assert!(lines.contains(&"process 4 T") && !lines.contains(&"count 2"), "{output}");
    // It is over, and stays so.
    let (status, output, errors) = agent.run(&[]);
    assert_eq!((status, &*output), (Some(7), ""));
    assert!(errors.contains("has ended with status 7"), "{errors}");
}

/// Returns the names of the snapshots of an agent, oldest first.
#[cfg(target_os = "linux")]
fn snapshots(agent: &Agent) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(agent.folder.path().join("state")).expect("it is there");
    let paths = entries.map(|entry| entry.expect("it can be read").path());
    let mut found: Vec<_> =
        paths.filter(|path| path.extension().is_some_and(|extension| extension == "esls")).collect();
    found.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    found
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_goes_on_from_a_snapshot_or_from_the_one_before() {
    let agent = Agent::new("durable-snapshots", AGENT);
    for line in ["count 2", "count 4"] {
        let mut running = agent.start(&["--snapshot-every", "1ms"]);
        running.wait_for(line);
        // Another thread writes it.
        while snapshots(&agent).is_empty() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        running.send("-KILL");
        running.end();
        let (status, output, errors) = agent.state(&[]);
        assert_eq!(status, Some(0), "{errors}");
        assert!(output.contains("; goes on from snapshot "), "{output}");
        assert!((1..=3).contains(&snapshots(&agent).len()), "{:?}", snapshots(&agent));
    }
    let newest = snapshots(&agent).pop().expect("there is a snapshot");
    let mut bytes = std::fs::read(&newest).expect("it is there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&newest, bytes).expect("it can be written");
    let (status, output, errors) = agent.run(&["--snapshot-every", "never"]);
    assert_eq!(status, Some(7), "{output}{errors}");
    assert!(errors.contains(" is left out: it is damaged at byte 0"), "{errors}");
    assert_eq!(output.lines().last(), Some("over 5"), "{output}");
    assert!(!output.contains("count 2"), "{output}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_journal_without_its_end_before_another_one_is_refused() {
    let agent = Agent::new("durable-gap", AGENT);
    let mut running = agent.start(&["--snapshot-every", "1ms"]);
    running.wait_for("count 3");
    running.send("-TERM");
    assert_eq!(running.end().0, Some(0));
    // The run goes on from the snapshot before, by both journals.
    let mut all = snapshots(&agent);
    let newest = all.pop().expect("there is a snapshot");
    std::fs::remove_file(newest).expect("it is there");
    let journal =
        all.pop().expect("two generations are kept").to_string_lossy().replace("snapshot-", "journal-");
    let journal = journal.replace(".esls", ".eslj");
    let bytes = std::fs::read(&journal).expect("it is there");
    std::fs::write(&journal, &bytes[..bytes.len() - 3]).expect("it can be written");
    let (status, _, errors) = agent.run(&[]);
    assert!(
        status == Some(3) && errors.contains("its end is missing, and the next journal is there"),
        "{errors}"
    );
    std::fs::write(&journal, &bytes).expect("it can be written");
    assert_eq!(agent.run(&[]).0, Some(7));
}

/// Timers whose time has passed while there was no process.
#[test]
fn overdue_timers_fire_behind_the_news_of_the_restart_in_their_order() {
    let text = "(define-input *resumed*)
        (defun say (text) (format t \"~a~%\" text) (finish-output))
        (spawn (:name 'watcher :daemon t) (wait-for-event *resumed*) (say \"resumed\"))
        (spawn (sleep 0.30) (say \"second\"))
        (spawn (sleep 0.25) (say \"first\"))
        (spawn (sleep 0.35) (say \"third\"))
        (say \"ready\")
        (sleep 0.4)
        (say \"over\")";
    let agent = Agent::new("durable-overdue", text);
    let mut running = agent.start(&[]);
    running.wait_for("ready");
    running.send("-KILL");
    running.end();
    std::thread::sleep(std::time::Duration::from_millis(450));
    let (_, output, errors) = agent.run(&[]);
    let lines: Vec<&str> = output.lines().filter(|line| *line != "ready").collect();
    assert_eq!(lines, ["resumed", "first", "second", "third", "over"], "{errors}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_paused_run_goes_on_from_a_snapshot() {
    let agent = Agent::new("durable-snapshot-pause", AGENT);
    let mut running = agent.start(&["--snapshot-every", "1h"]);
    running.wait_for("count 3");
    running.send("-TERM");
    let (status, errors) = running.end();
    assert!(status == Some(0) && errors.contains("paused; the same command goes on"), "{errors}");
    assert_eq!(snapshots(&agent).len(), 1);
    let (status, output, errors) = agent.run(&[]);
    assert_eq!(status, Some(7), "{output}{errors}");
    assert_eq!(output.lines().last(), Some("over 5"), "{output}");
    assert!(!output.contains("count 3"), "{output}");
}

#[test]
fn sigterm_pauses_or_ends_a_run() {
    let agent = Agent::new("durable-paused", AGENT);
    let mut running = agent.start(&[]);
    running.wait_for("count 2");
    running.send("-TERM");
    let (status, errors) = running.end();
    assert_eq!((status, &*errors), (Some(0), "eslvm: paused; the same command goes on\n"));
    let (status, output, _) = agent.state(&[]);
    assert_eq!(status, Some(0));
    for line in ["run: paused", "facts: 2 in 1 relations", "tasks: 2", "verified: ", "written: 2"] {
        assert!(output.contains(line), "{line}: {output}");
    }
    let (_, tasks, _) = agent.state(&["--tasks"]);
    assert!(
        tasks.contains("the main task waits for a time")
            && tasks.contains("WATCHER waits for input *RESUMED*"),
        "{tasks}"
    );
    let (_, log, _) = agent.state(&["--log"]);
    let events: Vec<&str> =
        log.lines().filter_map(|line| line.split_once("Z  ")).map(|(_, event)| event).collect();
    assert_eq!(events, ["begun by process 1", "paused in process 1"]);
    assert_eq!(agent.state(&["--facts", "counted"]).1, "(COUNTED 1)\n(COUNTED 2)\n");
    assert_eq!(agent.state(&["--facts", "missing"]).0, Some(2));
    let mut running = agent.start(&["--on-term", "end"]);
    running.wait_for("count 3");
    running.send("-TERM");
    let (status, errors) = running.end();
    assert_eq!(status, Some(143), "{errors}");
    assert_eq!(agent.run(&[]).0, Some(143));
}

#[test]
fn a_second_process_and_another_program_are_refused() {
    let agent = Agent::new("durable-refused", AGENT);
    let mut running = agent.start(&[]);
    running.wait_for("count 1");
    let (status, output, errors) = agent.run(&[]);
    assert_eq!((status, &*output), (Some(2), ""));
    assert!(errors.contains("is in use by another process"), "{errors}");
    assert!(agent.state(&[]).2.contains("is in use by another process"));
    running.send("-KILL");
    running.end();
    agent.folder.file("agent.esl", AGENT.replace("\"~?~%\"", "\"~?.~%\""));
    let (status, _, errors) = agent.run(&[]);
    assert_eq!(status, Some(2));
    assert!(errors.contains("another program: changed functions: SAY;"), "{errors}");
    agent.folder.file("agent.esl", AGENT);
    for (options, why) in [(&["--seed", "4"][..], "limits"), (&["--trace", "tasks"][..], "traces")] {
        let (status, _, errors) = agent.run(options);
        assert_eq!(status, Some(2));
        assert!(errors.contains(why), "{errors}");
    }
    assert_eq!(agent.run(&[]).0, Some(7));
}

#[test]
fn a_journal_is_private_and_whole() {
    use std::os::unix::fs::PermissionsExt;
    let agent = Agent::new("durable-private", AGENT);
    let mut running = agent.start(&["--durability", "power"]);
    running.wait_for("count 2");
    running.send("-KILL");
    running.end();
    let journal = agent.folder.path().join("state/journal.eslj");
    let mode = |mode| std::fs::Permissions::from_mode(mode);
    assert_eq!(std::fs::metadata(&journal).expect("it is there").permissions().mode() & 0o777, 0o600);
    std::fs::set_permissions(&journal, mode(0o644)).expect("it is ours");
    let (status, _, errors) = agent.run(&[]);
    assert!(status == Some(2) && errors.contains("must belong to you"), "{errors}");
    std::fs::set_permissions(&journal, mode(0o600)).expect("it is ours");
    let whole = std::fs::read(&journal).expect("it is there");
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    std::fs::write(&journal, &flipped).expect("it is ours");
    let (status, _, errors) = agent.run(&[]);
    assert!(status == Some(3) && errors.contains("the journal cannot be read: it is damaged"), "{errors}");
    std::fs::write(&journal, &whole[..whole.len() - 3]).expect("it is ours");
    assert_eq!(agent.run(&[]).0, Some(7));
}

#[test]
fn a_stream_that_was_open_fails_at_its_next_use() {
    let text = "(with-recovery-procedures
    (((:interrupted-by-restart operation) (format t \"~a~%\" operation) (abort 'gone)))
  (with-open-file (file \"notes\" :direction :output :if-exists :supersede)
    (format file \"first~%\")
    (finish-output file)
    (format t \"open~%\")
    (finish-output)
    (sleep 0.3)
    (format file \"second~%\")))
(format t \"over~%\")";
    let agent = Agent::new("durable-stream", text);
    let options = [format!("--allow-write={}", agent.folder.path().display())];
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let in_folder = |command: &mut Command| {
        command.current_dir(agent.folder.path());
    };
    let mut command = agent.command(&options);
    in_folder(&mut command);
    let mut child = command.spawn().expect("the command is there");
    let output = BufReader::new(child.stdout.take().expect("the output is a pipe"));
    let mut running = Running { child, output };
    running.wait_for("open");
    running.send("-KILL");
    running.end();
    let mut command = agent.command(&options);
    in_folder(&mut command);
    let done = process::finish(command.spawn().expect("the command is there"));
    // Output just before the kill may be printed again.
    let output = done.output.strip_prefix("open\n").unwrap_or(&done.output);
    assert_eq!((done.status, output), (Some(0), "%FILE-WRITE\nover\n"), "{}", done.errors);
}

#[test]
fn a_program_that_cannot_be_read_leaves_no_folder() {
    let agent = Agent::new("durable-unread", "(print");
    let state = agent.folder.path().join("state");
    assert!(agent.run(&[]).0 != Some(0) && !state.exists());
    std::fs::create_dir(&state).expect("it is new");
    #[cfg(unix)]
    std::fs::set_permissions(&state, std::os::unix::fs::PermissionsExt::from_mode(0o700))
        .expect("it is ours");
    assert!(agent.run(&[]).0 != Some(0) && state.exists());
    agent.folder.file("agent.esl", "(exit 3)");
    assert_eq!(agent.run(&[]).0, Some(3));
    assert!(state.join("journal.eslj").exists());
}
