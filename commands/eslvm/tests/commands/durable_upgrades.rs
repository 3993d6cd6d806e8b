//! Upgrades of durable runs: what has changed, a trial, and the definitions made in flight.

use std::process::Stdio;

use crate::durable::{Agent, Running};
use crate::eslvm;

/// An agent that counts by `step`, and keeps what it has counted in structures. It says that it waits, long
/// enough to be killed then: what came before has its place in the journal.
const AGENT: &str = "(defstruct leg metres)
(defparameter *unit* \"m\")
(defvar *legs* nil)
(defun step-of (i) i)
(defun say (control &rest arguments) (format t \"~?~%\" control arguments) (finish-output))
(defun note (i)
  (push (make-leg :metres (step-of i)) *legs*)
  (say \"~d ~a\" (leg-metres (first *legs*)) *unit*))
(defun report () (say \"~a\" (mapcar #'leg-metres *legs*)))
(defvar *first* nil)
(dotimes (i 6)
  (note i)
  (unless *first* (setq *first* (first *legs*)))
  (say \"waits\")
  (sleep 1))
(report)
(say \"~a\" (eq *first* (first (last *legs*))))
(exit 7)";

/// Kills an agent while it waits behind a line. Returns its errors.
fn kill_behind(mut running: Running, line: &str) -> String {
    running.wait_for(line);
    running.wait_for("waits");
    running.send("-KILL");
    running.end().1
}

/// Starts an agent and kills it behind a line.
fn killed_behind(name: &str, text: &str, line: &str) -> Agent {
    let agent = Agent::new(name, text);
    kill_behind(agent.start(&[]), line);
    agent
}

/// Tries an upgrade on a copy of the run.
fn tried(agent: &Agent) -> (Option<i32>, String, String) {
    agent.state(&["--upgrade", &agent.folder.join("agent.esl")])
}

fn journal(agent: &Agent) -> Vec<u8> {
    std::fs::read(agent.folder.path().join("state/journal.eslj")).expect("it is there")
}

#[test]
fn definitions_are_made_in_flight() {
    let agent = killed_behind("durable-upgraded", AGENT, "2 m");
    let before = journal(&agent);
    let new = AGENT
        .replace("(defun step-of (i) i)", "(defvar *factor* 10)\n(defun step-of (i) (* i *factor*))")
        .replace("\"m\"", "\"cm\"")
        .replace("(exit 7)", "(exit 8)");
    agent.folder.file("agent.esl", &new);
    let (status, output, errors) = agent.run(&[]);
    assert_eq!((status, &*output), (Some(2), ""));
    for part in [
        "another program: changed functions: STEP-OF; ",
        "changed variables: *UNIT*; ",
        "new variables: *FACTOR*; ",
        "changed forms outside of definitions; ",
        "`--upgrade`",
    ] {
        assert!(errors.contains(part), "{part}: {errors}");
    }
    let (status, output, errors) = tried(&agent);
    assert_eq!(status, Some(0), "{output}{errors}");
    let expected = "on a copy of the run: 3 definitions; not definitions, and not run: `(exit 8)`\n\
                    its past has no messages and no calls to try the program on\n";
    assert!(output.ends_with(expected), "{output}");
    assert_eq!(journal(&agent), before, "neither has written anything");
    // The upgraded run is killed too; then the new program is its program.
    let errors = kill_behind(agent.start(&["--upgrade"]), "40 cm");
    assert!(errors.contains("eslvm: upgraded: 3 definitions; not definitions"), "{errors}");
    agent.folder.file("agent.esl", AGENT);
    let (status, _, errors) = agent.run(&[]);
    assert!(status == Some(2) && errors.contains("changed functions: STEP-OF; "), "{errors}");
    agent.folder.file("agent.esl", &new);
    let (status, output, errors) = agent.run(&[]);
    assert_eq!(status, Some(7), "{output}{errors}");
    assert!(output.ends_with("50 cm\nwaits\n(50 40 30 2 1 0)\nT\n"), "{output}");
    assert!(agent.state(&["--log"]).1.contains("upgraded in process 2"));
    let mut replay = eslvm(&["replay", &agent.folder.join("state/journal.eslj")]);
    let replayed = replay.stdin(Stdio::null()).output().expect("the command is there");
    assert_eq!(replayed.status.code(), Some(7), "{}", String::from_utf8_lossy(&replayed.stderr));
}

#[test]
fn an_upgrade_that_fails_leaves_the_run_as_it_is() {
    let agent = killed_behind("durable-not-upgraded", AGENT, "1 m");
    let before = journal(&agent);
    for (old, new, why) in [
        ("\"m\")", "(car 1))", "the value 1 is not of type LIST"),
        (
            "(defstruct leg metres)",
            "(defstruct leg metres speed)",
            "add (define-upgrade (leg) (old) (make-leg",
        ),
        (
            "(defstruct leg metres)",
            "(defstruct leg speed metres)",
            "keeps its slots, (METRES), in this order",
        ),
        (
            "(defstruct leg metres)",
            "(defstruct leg metres speed) (define-upgrade (leg) (old) (fail :no-speed old))",
            ":NO-SPEED",
        ),
    ] {
        agent.folder.file("agent.esl", AGENT.replace(old, new));
        for (status, _, errors) in [agent.run(&["--upgrade"]), tried(&agent)] {
            assert_eq!(status, Some(2), "{errors}");
            let is_told = errors.to_lowercase().contains(&why.to_lowercase());
            assert!(is_told && errors.contains("nothing has changed"), "{why}: {errors}");
        }
        assert_eq!(journal(&agent), before);
    }
    agent.folder.file("agent.esl", AGENT);
    let (status, output, _) = agent.run(&[]);
    assert_eq!((status, output.ends_with("(5 4 3 2 1 0)\nT\n")), (Some(7), true), "{output}");
}

#[test]
fn structures_get_the_slots_of_their_new_definition() {
    let agent = killed_behind("durable-structures", AGENT, "1 m");
    let first = AGENT.replace(
        "(defstruct leg metres)",
        "(defstruct leg metres (speed 5))
(define-upgrade (leg) (old) (make-leg :metres (leg-metres old) :speed (- (leg-metres old))))",
    );
    agent.folder.file("agent.esl", &first);
    let errors = kill_behind(agent.start(&["--upgrade"]), "3 m");
    assert!(errors.contains("new slots in 2 structures"), "{errors}");
    // Instances from before both upgrades, and from between them.
    let second = AGENT
        .replace(
            "(defstruct leg metres)",
            "(defstruct leg metres (speed 5) (fuel 9))
(define-upgrade (leg) (old) (make-leg :metres (leg-metres old) :speed (leg-speed old) :fuel (leg-speed old)))",
        )
        .replace("(mapcar #'leg-metres *legs*)", "(mapcar (lambda (leg) (incf (leg-fuel leg)) leg) *legs*)");
    agent.folder.file("agent.esl", &second);
    let (status, output, errors) = agent.run(&["--upgrade"]);
    assert_eq!(status, Some(7), "{output}{errors}");
    assert!(errors.contains("new slots in 4 structures"), "{errors}");
    let legs = [(5, 5, 10), (4, 5, 10), (3, 5, 6), (2, 5, 6), (1, -1, 0), (0, 0, 1)]
        .map(|(metres, speed, fuel)| format!("#S(LEG :METRES {metres} :SPEED {speed} :FUEL {fuel})"));
    assert!(output.ends_with(&format!("({})\nT\n", legs.join(" "))), "{output}");
}

/// The plant of the examples works on while its parts get a slot and its supervisor another rule.
#[test]
fn the_plant_is_upgraded_while_it_works() {
    let text =
        std::fs::read_to_string(esl_conformance::root().join("examples/plant.esl")).expect("it is there");
    let slow = "(finish-output) (sleep 0.2) (setf *day* day)";
    let text = text.replace("(setf *day* day)", slow);
    assert!(text.contains(slow));
    let agent = Agent::new("durable-plant", &text);
    let mut running = agent.start(&[]);
    running.wait_for("day  3: 120 finished,  0 lost, 8 parts replaced in advance");
    running.send("-TERM");
    assert_eq!(running.end().0, Some(0));
    let new = text
        .replace("  (state :ok))          ; :OK, :WORN or :BROKEN", "  (state :ok)\n  (shifts 0))")
        .replace(
            "(defun new-part (kind)",
            "(define-upgrade (part) (old)
  (make-part :name (part-name old) :wear (part-wear old) :state (part-state old) :shifts *day*))\n
(defun new-part (kind)",
        )
        .replace(
            "(defun run-shift (plant)",
            "(defun age-parts (plant)
  (dolist (station plant)
    (dolist (part (station-parts station))
      (incf (part-shifts part)))))\n
(defun run-shift (plant)",
        )
        .replace(
            "  (let ((finished 0)
        (lost 0))
    (dotimes (i 120",
            "  (age-parts plant)
  (let ((finished 0)
        (lost 0))
    (dotimes (i 120",
        )
        .replace(
            "(format t \"parts replaced: ",
            "(format t \"oldest part: ~d shifts~%\"
          (reduce #'max (mapcan (lambda (station) (mapcar #'part-shifts (station-parts station))) plant)))
  (format t \"parts replaced: ",
        );
    agent.folder.file("agent.esl", &new);
    let (status, output, errors) = agent.run(&["--upgrade"]);
    assert_eq!(status, Some(0), "{output}{errors}");
    assert!(errors.contains("new slots in 17 structures"), "{errors}");
    assert!(output.contains("\noldest part: "), "{output}");
}
