//! A host of agents as a process: messages, sleep, kills, agents that fail.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;

use crate::eslvm;

/// An agent that adds numbers, and keeps its sum as a fact.
const ADDER: &str = "(define-input *resumed*)
(define-input add)
(define-input give-up)
(defvar *sum* 0)
(spawn (:name 'watcher :daemon t)
  (loop (wait-for-event *resumed*) (format t \"resumed~%\") (finish-output)))
(spawn (:name 'failing :daemon t) (wait-for-event give-up) (exit 5))
(format t \"hello ~{~a~}~%\" (command-line-arguments))
(loop
  (let ((number (wait-for-event add)))
    (retract (list 'sum *sum*))
    (incf *sum* number)
    (assert (list 'sum *sum*))
    (format t \"sum ~a~%\" *sum*)
    (finish-output)))";

struct AgentsFolder {
    folder: Folder,
}

struct Hosting {
    child: Child,
    output: String,
}

impl AgentsFolder {
    fn new(test: &str) -> AgentsFolder {
        let folder = Folder::new(test);
        folder.file("adder.esl", ADDER);
        AgentsFolder { folder }
    }

    fn agents(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let mut command = eslvm(&["agents", &self.folder.join("agents")]);
        let done = command.args(arguments).output().expect("the command is there");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (done.status.code(), text(&done.stdout), text(&done.stderr))
    }

    /// Does something with agents that succeeds, and returns its output.
    fn done(&self, arguments: &[&str]) -> String {
        let (status, output, errors) = self.agents(arguments);
        assert_eq!((status, &*errors), (Some(0), ""), "{arguments:?}");
        output
    }

    fn begin(&self, name: &str) {
        self.done(&["begin", name, &self.folder.join("adder.esl"), name]);
    }

    fn send(&self, name: &str, number: u32) {
        self.done(&["send", name, "add", &number.to_string()]);
    }

    /// Waits until the list has this line.
    fn wait_for(&self, line: &str) {
        let begun = Instant::now();
        let mut list = String::new();
        while !list.lines().any(|listed| listed == line) {
            assert!(begun.elapsed() < Duration::from_secs(60), "no `{line}` in\n{list}");
            std::thread::sleep(Duration::from_millis(5));
            list = self.done(&["list"]);
        }
    }

    fn host(&self, options: &[&str]) -> Hosting {
        let output = self.folder.join("output");
        let file = fs::OpenOptions::new().create(true).append(true).open(&output).expect("there is room");
        let mut command = eslvm(&["host"]);
        command.args(options).arg(self.folder.join("agents")).stdin(Stdio::null()).stdout(file);
        let child = command.stderr(Stdio::piped()).spawn().expect("the command is there");
        let begun = Instant::now();
        while self.agents(&["list"]).0 != Some(0) {
            assert!(begun.elapsed() < Duration::from_secs(60), "the host does not listen");
            std::thread::sleep(Duration::from_millis(5));
        }
        Hosting { child, output }
    }

    /// Returns the sum of an agent that rests.
    fn sum(&self, name: &str) -> String {
        let folder = self.folder.join(&format!("agents/{name}.state"));
        let done = eslvm(&["state", "--facts", "sum", &folder]).output().expect("the command is there");
        String::from_utf8_lossy(&done.stdout).trim().to_owned()
    }
}

impl Hosting {
    /// Ends the host, and returns its status, the output so far, and its errors.
    fn end(self, signal: &str) -> (Option<i32>, String, String) {
        let sent = Command::new("kill").args([signal, &self.child.id().to_string()]).status();
        assert!(sent.expect("there is a kill").success());
        let done = self.child.wait_with_output().expect("a child can be waited for");
        let output = fs::read_to_string(&self.output).expect("it is text");
        (done.status.code(), output, String::from_utf8_lossy(&done.stderr).into_owned())
    }
}

#[test]
fn agents_sleep_until_a_message_comes() {
    let agents = AgentsFolder::new("agents-sleep");
    agents.begin("one");
    let host = agents.host(&["--sleep-after", "10ms"]);
    agents.begin("two");
    for number in 1..=3 {
        for name in ["one", "two"] {
            agents.wait_for(&format!("{name}: asleep"));
            agents.send(name, number);
        }
    }
    agents.wait_for("one: asleep");
    agents.wait_for("two: asleep");
    let (status, output, errors) = host.end("-TERM");
    assert_eq!(status, Some(0));
    assert!(errors.ends_with("all agents are paused; the same command goes on\n"), "{errors}");
    // An agent that sleeps takes no notice of it.
    for name in ["one", "two"] {
        let own: Vec<&str> =
            output.lines().filter_map(|line| line.strip_prefix(&*format!("{name}: "))).collect();
        assert_eq!(own, [&*format!("hello {name}"), "sum 1", "sum 3", "sum 6"]);
        assert_eq!(agents.sum(name), "(SUM 6)");
    }
}

#[test]
fn a_host_that_is_killed_has_what_it_has_answered() {
    let agents = AgentsFolder::new("agents-killed");
    let names = ["one", "two", "three"];
    names.iter().for_each(|name| agents.begin(name));
    for (life, sleep) in ["1h", "1ms", "20ms"].into_iter().enumerate() {
        let host = agents.host(&["--sleep-after", sleep, "--snapshot-every", "1ms"]);
        for name in names {
            agents.send(name, 1);
            agents.send(name, 10);
        }
        let (status, output, _) = host.end("-KILL");
        assert_eq!(status, None);
        // An agent that is awake when its process dies is told of that by the next one.
        assert!(life != 1 || output.matches("resumed").count() == names.len(), "{output}");
    }
    let host = agents.host(&["--sleep-after", "1ms"]);
    names.iter().for_each(|name| agents.wait_for(&format!("{name}: asleep")));
    assert_eq!(host.end("-TERM").0, Some(0));
    names.iter().for_each(|name| assert_eq!(agents.sum(name), "(SUM 33)"));
}

#[test]
fn an_agent_that_fails_disturbs_no_other_one() {
    let agents = AgentsFolder::new("agents-fail");
    ["good", "bad", "over"].iter().for_each(|name| agents.begin(name));
    let journal = agents.folder.join("agents/bad.state/journal.eslj");
    let mut bytes = fs::read(&journal).expect("it is there");
    bytes[200] ^= 1;
    fs::write(&journal, bytes).expect("there is room");
    let host = agents.host(&["--sleep-after", "10ms"]);
    agents.send("good", 2);
    agents.done(&["send", "over", "GIVE-UP"]);
    agents.wait_for("over: ended with status 5");
    let refused = |arguments: &[&str], reason: &str| {
        let (status, _, errors) = agents.agents(arguments);
        assert!(status == Some(2) && errors.contains(reason), "{arguments:?}: {errors}");
    };
    refused(&["send", "over", "add", "1"], "the agent has ended with status 5");
    refused(&["send", "bad", "add", "1"], "the agent cannot go on: the journal cannot be read");
    refused(&["send", "none", "add", "1"], "there is no agent `none`");
    refused(&["send", "good", "ad", "1"], "the program has no input `AD`");
    refused(&["send", "good", "add", "(1"], "the arguments are not data");
    refused(&["begin", "good", &agents.folder.join("adder.esl")], "there is an agent `good` already");
    refused(&["begin", "../good", &agents.folder.join("adder.esl")], "is not the name of an agent");
    agents.done(&["stop", "good"]);
    agents.wait_for("good: stopped");
    refused(&["send", "good", "add", "1"], "the agent was stopped");
    // A second host is refused.
    let second = eslvm(&["host", &agents.folder.join("agents")]).output().expect("the command is there");
    assert_eq!(second.status.code(), Some(2));
    agents.done(&["start", "good"]);
    agents.send("good", 3);
    agents.done(&["end", "good"]);
    agents.wait_for("good: ended with status 143");
    assert_eq!(host.end("-TERM").0, Some(0));
    assert_eq!(agents.sum("good"), "(SUM 5)");
}

#[test]
fn a_timer_wakes_an_agent_and_few_places_serve_many() {
    let agents = AgentsFolder::new("agents-timer");
    let text = "(loop repeat 3 do (sleep 0.3)) (exit 9)";
    let program = agents.folder.file("timer.esl", text);
    let names: Vec<String> = (0..6).map(|number| format!("timer-{number}")).collect();
    names.iter().for_each(|name| _ = agents.done(&["begin", name, &program]));
    let host = agents.host(&["--sleep-after", "20ms", "--awake", "2", "--downtime", "stops"]);
    names.iter().for_each(|name| agents.wait_for(&format!("{name}: ended with status 9")));
    assert_eq!(host.end("-INT").0, Some(0));
}

#[test]
#[cfg(target_os = "linux")]
fn agents_with_the_same_addresses_take_turns() {
    let agents = AgentsFolder::new("agents-addresses");
    agents.begin("one");
    let host = agents.host(&["--sleep-after", "1ms", "--snapshot-every", "1ms"]);
    agents.send("one", 1);
    agents.wait_for("one: asleep");
    assert_eq!(host.end("-TERM").0, Some(0));
    let folder = agents.folder.path().join("agents");
    let copied =
        Command::new("cp").arg("-a").args([folder.join("one.state"), folder.join("two.state")]).status();
    assert!(copied.expect("there is a cp").success());
    let host = agents.host(&["--sleep-after", "1h", "--snapshot-every", "1ms"]);
    for number in 2..5 {
        agents.send("one", number);
        agents.send("two", 10 * number);
    }
    assert_eq!(host.end("-TERM").0, Some(0));
    assert_eq!((agents.sum("one"), agents.sum("two")), ("(SUM 10)".into(), "(SUM 91)".into()));
}

#[test]
fn agents_of_another_version_begin_anew_from_their_facts() {
    let agents = AgentsFolder::new("agents-facts");
    let text = "(define-input add) (defdurable *sum* 0)
(format t \"~a ~a~%\" (and *begun-from-facts* t) (command-line-arguments))
(loop (incf *sum* (wait-for-event add)) (format t \"sum ~a~%\" *sum*) (finish-output))";
    let program = agents.folder.file("sum.esl", text);
    agents.done(&["begin", "one", &program, "x"]);
    agents.done(&["begin", "new", &program]);
    let host = agents.host(&["--sleep-after", "1ms"]);
    agents.send("one", 5);
    agents.wait_for("one: asleep");
    agents.done(&["stop", "new"]);
    assert_eq!(host.end("-KILL").0, None);
    let trial = agents
        .folder
        .file("other.esl", text.replace("(incf *sum* (", "(incf *sum* (* 2 (").replace("add))", "add)))"));
    let one = agents.folder.join("agents/one.state");
    let tried = eslvm(&["state", "--upgrade", &trial, &one]).output().expect("the command is there");
    // An agent that waits for messages is in no deadlock.
    assert!(!String::from_utf8_lossy(&tried.stdout).contains("Deadlock"), "{tried:?}");
    let journal = agents.folder.join("agents/one.state/journal.eslj");
    let mut bytes = fs::read(&journal).expect("it is there");
    bytes[8..12].copy_from_slice(&1_u32.to_le_bytes());
    fs::write(&journal, bytes).expect("there is room");
    let host = agents.host(&[]);
    let (status, _, errors) = agents.agents(&["send", "one", "add", "1"]);
    assert!(status == Some(2) && errors.contains("type `--from-facts`"), "{errors}");
    assert_eq!(host.end("-TERM").0, Some(0));
    let host = agents.host(&["--from-facts", "--sleep-after", "1ms"]);
    agents.send("one", 6);
    agents.done(&["end", "one"]);
    agents.wait_for("one: ended with status 143");
    let (status, output, errors) = host.end("-TERM");
    assert!(status == Some(0) && errors.contains("one: begun by another version of eslvm"), "{errors}");
    assert!(output.ends_with("one: T (x)\none: sum 11\n"), "{output}");
}

#[test]
fn an_agent_whose_folder_is_gone_is_not_made_again() {
    let agents = AgentsFolder::new("agents-gone");
    agents.begin("one");
    let host = agents.host(&["--sleep-after", "1ms"]);
    agents.wait_for("one: asleep");
    fs::remove_dir_all(agents.folder.join("agents/one.state")).expect("it is there");
    let (status, _, errors) = agents.agents(&["send", "one", "add", "1"]);
    assert!(status == Some(2) && errors.contains("there is no durable run in"), "{errors}");
    assert!(!agents.folder.path().join("agents/one.state").exists());
    assert_eq!(host.end("-TERM").0, Some(0));
}
