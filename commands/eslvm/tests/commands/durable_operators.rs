//! Durable runs that operators attend, and copies of durable runs.

use crate::attach::session;
use crate::durable::{Agent, Running};

/// An agent that adds up its orders, by a function that an operator may change.
const AGENT: &str = "(define-input order)
(defvar *sum* 0)
(defun add (number) (incf *sum* number))
(loop
  (add (wait-for-event order))
  (format t \"sum ~d~%\" *sum*)
  (finish-output))";

/// Starts an agent that operators can attach to. Returns their socket too.
fn attended(agent: &Agent, options: &[&str]) -> (Running, String) {
    let socket = agent.folder.join("socket");
    // One that was killed has left it.
    _ = std::fs::remove_file(&socket);
    let mut all = vec!["--listen", &socket];
    all.extend(options);
    let running = agent.start(&all);
    while !std::path::Path::new(&socket).exists() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    (running, socket)
}

#[test]
#[cfg(unix)]
fn evaluations_of_operators_are_part_of_a_durable_run() {
    let agent = Agent::new("durable-attended", AGENT);
    let (mut running, socket) = attended(&agent, &[]);
    let input = ":signal order 5\n(loop until (= *sum* 5) do (sleep 0.001))\n(defun add (n) (incf *sum* (* 10 n)))\n\
                 (list 'begun *sum*)\n(car 5)\n:signal order 2\n";
    let (output, status) = session(&socket, input);
    assert!(output.contains("(BEGUN 5)") && output.contains("not of type LIST"), "{output}");
    assert_eq!(status, Some(0));
    running.wait_for("sum 25");
    running.send("-KILL");
    running.end();
    let (status, output, errors) = agent.state(&[]);
    assert!(status == Some(0) && output.contains("process 1\n"), "{output}{errors}");
    let (status, output, errors) = agent.state(&["--patches"]);
    assert_eq!((status, &*output), (Some(0), "no patches are in force\n"), "{errors}");

    // The same machine, whose sessions are others, with a snapshot this time.
    let (mut running, socket) =
        attended(&agent, &["--snapshot-every", "1ms", "--monitor=0", "--metrics", "0"]);
    let patch = agent.folder.file("patch.esl", "(defun add (number) (incf *sum* (* 10 number)))");
    let input = format!(
        ":patch {patch}\n:signal order 1\n(loop until (= *sum* 35) do (sleep 0.001))\n(list 'then *sum*)\n"
    );
    let (output, _) = session(&socket, &input);
    assert!(output.contains("(THEN 35)"), "{output}");
    running.wait_for("sum 35");
    running.send("-KILL");
    running.end();
    let (status, output, errors) = agent.state(&["--patches"]);
    assert_eq!((status, &*output), (Some(0), "1 definition: function ADD\n"), "{errors}");

    // No operator can attach any more, so the run can never go on.
    let (status, _, errors) = agent.run(&[]);
    assert!(
        status == Some(4) && errors.contains("waits for input ORDER, which has no sender left"),
        "{errors}"
    );
}

/// An agent that counts.
const COUNTING: &str = "(dotimes (i 5)
  (format t \"count ~d~%\" i)
  (finish-output)
  (sleep 0.2))
(exit 3)";

#[test]
fn a_run_is_copied_as_it_was() {
    let agent = Agent::new("durable-copied", COUNTING);
    let mut running = agent.start(&["--snapshot-every", "never"]);
    running.wait_for("count 3");
    running.send("-KILL");
    running.end();
    let copy = agent.folder.join("copy");
    let (status, output, errors) = agent.state(&["--fork", &copy, "--back", "300ms"]);
    assert!(status == Some(0) && output.contains("before its last record, in process 1"), "{output}{errors}");
    let (status, _, errors) = agent.state(&["--fork", &copy]);
    assert!(status == Some(2) && errors.contains("has a durable run already"), "{errors}");
    // The copy and the run go on, each by itself.
    let mut command = crate::eslvm(&["run", "--state", &copy]);
    let done = command.arg(agent.folder.join("agent.esl")).output().expect("the command is there");
    let output = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.code() == Some(3) && output.starts_with("count 2\n"), "{output}");
    let (status, output, errors) = agent.run(&[]);
    assert!(
        status == Some(3) && !output.contains("count 2") && output.ends_with("count 4\n"),
        "{output}{errors}"
    );
}
