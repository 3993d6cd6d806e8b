//! Explores all schedules of small programs: proves what never happens, and finds what does.

mod aborts;
mod composition;
mod corpus;
mod crashes;
mod defects;
mod everywhere;
mod fluents;
mod generated;
mod keeping;
mod liveness;
mod oracle;
mod origins;
mod putting_back;
mod random;
mod resources;
mod strict;
mod suspension;
mod symmetry;
mod variables;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Ended, Program, Source};
use esl_testing::explore::{
    Behaviour, Exploration, Grain, Livelock, Settings, explore, explore_together, follow,
};

pub(crate) fn compile(text: &str) -> Program {
    let compiled = program::compile(&[Source::new("explored.esl", text)]);
    let messages: Vec<&String> = compiled.diagnostics.iter().map(|diagnostic| &diagnostic.message).collect();
    compiled.program.unwrap_or_else(|| panic!("the program compiles: {messages:?}"))
}

#[allow(clippy::print_stdout, reason = "an exploration prints its figures")]
fn say<T>(grain: Grain, found: &Exploration<T>) {
    println!("{grain:?}: {} states, {} runs, {} endings", found.states, found.runs, found.endings.len());
}

/// Explores a program, and checks that the choices of each ending lead to it again.
pub(crate) fn endings(text: &str, grain: Grain) -> Exploration<Behaviour> {
    let program = compile(text);
    let settings = Settings { grain, ..Settings::default() };
    let found = explore(&program, &settings).expect("the program can start");
    assert!(found.limit.is_none(), "more than {} states", found.states);
    for ending in &found.endings {
        let again = follow(&program, &settings, &ending.choices).expect("the program can start");
        assert_eq!(again, ending.what, "choices {:?}", ending.choices);
    }
    say(grain, &found);
    if found.states < 300 {
        // With room for few snapshots everything is found as it was.
        let again = explore(&program, &Settings { memory: 2 << 20, ..settings }).expect("it can start");
        let figures = |found: &Exploration<Behaviour>| (found.states, found.runs, found.has_cycle);
        assert_eq!((figures(&again), ways(&again)), (figures(&found), ways(&found)));
        // Without snapshots, each run has a machine of its own.
        let again = explore(&program, &Settings { snapshots: false, ..settings }).expect("it can start");
        assert_eq!((figures(&again), ways(&again)), (figures(&found), ways(&found)));
    }
    if found.states < 100 {
        // Several threads find what one does.
        let figures = |found: &Exploration<Behaviour>| (found.states, found.runs, found.has_cycle);
        let again = explore_together(&program, &settings, 3, &|_| Ok(()), |_| true).expect("it can start");
        assert_eq!((figures(&again), ways(&again)), (figures(&found), ways(&found)));
    }
    found
}

fn ways(found: &Exploration<Behaviour>) -> Vec<(&Behaviour, &[u32], usize)> {
    found.endings.iter().map(|ending| (&ending.what, &*ending.choices, ending.runs)).collect()
}

/// Returns the sorted outputs of an exploration whose runs have all ended well.
pub(crate) fn outputs(found: &Exploration<Behaviour>) -> Vec<String> {
    let mut outputs = Vec::new();
    for ending in &found.endings {
        let Behaviour { ended, output, errors } = &ending.what;
        assert_eq!(*ended, Ended::Normally(0), "choices {:?}\n{output}{errors}", ending.choices);
        outputs.push(output.split_whitespace().collect::<Vec<_>>().join(" "));
    }
    outputs.sort_unstable();
    outputs.dedup();
    outputs
}

/// Checks that a program ends well under every schedule, with exactly the `expected` outputs.
pub(crate) fn check(text: &str, grain: Grain, expected: &[&str]) -> Exploration<Behaviour> {
    let found = endings(text, grain);
    assert_eq!(outputs(&found), expected);
    assert_eq!((&found.endless, found.has_cycle), (&None, false), "a run may never end");
    found
}

/// Returns the program that stopped the Remote Agent in flight in May 1999: each of two tasks waits for the
/// other's signal unless its counter shows that there was one. `wait` is the body of a macro that waits for
/// `event` unless the event's count differs from `seen`.
fn remote_agent(wait: &str) -> String {
    format!(
        "(defvar *first* (make-event 'first))
         (defvar *second* (make-event 'second))
         (defmacro wait (event) {wait})
         (task-net
           (a (let ((seen 0))
                (dotimes (i 3)
                  (wait *first*)
                  (setq seen (event-count *first*))
                  (signal *second*))))
           (b (let ((seen 0))
                (dotimes (i 3)
                  (signal *first*)
                  (wait *second*)
                  (setq seen (event-count *second*))))))
         (princ 'done)"
    )
}

#[test]
fn a_counter_tested_before_the_wait_deadlocks() {
    let text = remote_agent("`(when (= seen (event-count ,event)) (wait-for-events ,event))");
    for grain in [Grain::Changes, Grain::Reads] {
        let found = endings(&text, grain);
        let deadlock = found.endings.iter().find(|ending| ending.what.ended == Ended::Deadlocked);
        let deadlock = deadlock.expect("a schedule deadlocks");
        // A single untimely switch suffices, between the test and the wait.
        let switches = deadlock.choices.iter().filter(|&&choice| choice != 0).count();
        assert!(switches <= 2, "{:?}", deadlock.choices);
        assert!(deadlock.what.errors.contains("waits for event FIRST"), "{}", deadlock.what.errors);
        assert!(found.endings.iter().any(|ending| ending.what.output == "DONE"), "other schedules end");
    }
}

#[test]
fn a_counter_tested_by_the_wait_does_not_deadlock() {
    let text = remote_agent("`(wait-for-events ,event :unless-count seen)");
    for grain in [Grain::Changes, Grain::Reads] {
        check(&text, grain, &["DONE"]);
    }
}

/// A property that can be achieved at once.
pub(crate) const POWER: &str = "
  (define-property power (device))
  (to-achieve (power device value)
    (t (assert (list 'power device value))))";

/// Returns a program with two tasks that want different values of a property, and a change from outside: the
/// case model-checked in 1997.
pub(crate) fn two_tasks() -> String {
    format!("{POWER} {TWO_TASKS}")
}

const TWO_TASKS: &str = "
  (defvar *outcomes* (list nil nil))
  (defvar *ended* 0)
  (defun want (number value)
    (setf (nth number *outcomes*)
          (with-recovery-procedures ((:property-lock-unavailable (abort :unavailable))
                                     (:maintained-property-violation (abort :violated)))
            (with-maintained-property (power 'camera value)
              (sleep 0)
              (power 'camera))))
    (when (= (incf *ended*) 2)
      (print *outcomes*)
      (print (hash-table-count esl::*%locks*))))
  (spawn (want 0 :on))
  (spawn (want 1 :off))
  (assert '(power camera :broken))";

pub(crate) const TWO_TASKS_ENDINGS: &[&str] = &[
    "(:ON :OFF) 0",
    "(:ON :UNAVAILABLE) 0",
    "(:ON :VIOLATED) 0",
    "(:UNAVAILABLE :OFF) 0",
    "(:UNAVAILABLE :VIOLATED) 0",
    "(:VIOLATED :OFF) 0",
    "(:VIOLATED :UNAVAILABLE) 0",
];

#[test]
fn two_tasks_a_change_and_the_daemon() {
    // The holder of the lock finds the value that it wants or is told of the violation; the other task fails
    // at once. The single change never violates the locks of both tasks, and no lock is left at the end.
    check(&two_tasks(), Grain::Changes, TWO_TASKS_ENDINGS);
}

#[test]
fn no_lock_is_held_by_a_task_that_has_ended() {
    // The last task looks once; under some schedule it looks at each reachable state.
    let text = "
      (defun held-by-the-dead ()
        (without-interrupts
          (let ((found nil))
            (maphash (lambda (key lock)
                       (dolist (subscription (svref lock 5))
                         (unless (member (task-status (svref subscription 0)) '(:running :waiting))
                           (setq found key))))
                     esl::*%locks*)
            found)))
      (let ((task (spawn (with-maintained-property (power 'camera :on) (sleep 0)))))
        (spawn (abort-task task))
        (spawn (print (held-by-the-dead))))";
    check(&format!("{POWER} {text}"), Grain::Reads, &["NIL"]);
}

#[test]
fn a_violated_subscriber_recovers() {
    let text = "
      (spawn
        (with-automatic-recoveries
          (with-maintained-property (power 'camera :on)
            (sleep 0)
            (without-interrupts (print (power 'camera))))))
      (assert '(power camera :off))";
    // The read happens before the change or after the recovery. If the change comes between the acquisition
    // of the lock and the read, the interrupt waits for the end of the critical section.
    check(&format!("{POWER} {text}"), Grain::Changes, &[":ON"]);
}

#[test]
fn endless_runs_are_distinguished_from_possibly_endless_ones() {
    let found = endings(
        "(defvar *stop* nil) (spawn (setq *stop* t)) (loop (when *stop* (return)) (sleep 0))",
        Grain::Changes,
    );
    assert!(found.has_cycle && found.endless.is_none(), "{found:?}");
    let found = endings("(spawn (loop (sleep 0)))", Grain::Changes);
    assert!(found.has_cycle && found.endless.is_some() && found.endings.is_empty(), "{found:?}");
}

/// Two tasks that take two things each, in different orders, and give back the first if the second is taken.
const POLITE: &str = "(defvar *left* nil)
    (defvar *right* nil)
    (defun take-up (thing) (without-interrupts (unless (symbol-value thing) (setf (symbol-value thing) t))))
    (defun eat (name first second)
      (loop
        (princ name)
        (loop until (take-up first) do (sleep 0))
        (sleep 0)
        (when (take-up second)
          (setf (symbol-value second) nil)
          (setf (symbol-value first) nil)
          (return))
        (setf (symbol-value first) nil)
        (sleep 0)))
    (task-net (a (eat 'a '*left* '*right*)) (b (eat 'b '*right* '*left*)))";

#[test]
fn a_livelock_goes_round_as_often_as_one_likes() {
    let program = compile(POLITE);
    let settings = Settings { grain: Grain::Changes, output: false, ..Settings::default() };
    let found = explore(&program, &settings).expect("it runs");
    assert!(found.endless.is_none() && found.limit.is_none(), "{found:?}");
    let Livelock { choices, lap } = found.livelock.expect("both can be polite for ever");
    let after = |rounds: usize| {
        let choices = [&choices[..lap], &choices[lap..].repeat(rounds)].concat();
        let host = VirtualHost::new();
        let captured = host.captured();
        let mut machine = program::machine(Config::default(), Box::new(host)).expect("there is room");
        program::begin(&mut machine, &program).expect("it begins");
        machine.follow_to(&settings, &choices, &mut |_| {});
        machine.flush();
        captured.output()
    };
    let [one, two, three] = [1, 2, 3].map(after);
    let round = two.len() - one.len();
    assert!(round > 0 && three.len() - two.len() == round, "{one} {two} {three}");
    // A loop that waits for an act of another task goes round only as long as the other one has no turn.
    let patient = "(defvar *stop* nil) (spawn (setq *stop* t)) (loop until *stop* do (sleep 0))";
    // And a loop that waits for a choice ends with the right one.
    for text in [patient, "(loop (when (choose nil t) (return)) (sleep 0))"] {
        let found = explore(&compile(text), &settings).expect("it runs");
        assert!(found.has_cycle && found.livelock.is_none() && found.endless.is_none(), "{text}: {found:?}");
    }
}

#[test]
fn a_condition_that_holds_in_no_state_of_a_schedule_is_found() {
    // It holds in between, and not at the end.
    let act = "(setq *on* t) (sleep 0) (setq *on* nil)";
    let text = |act: &str| {
        format!(
            "(defvar *on* nil)
             (eventually switched-on *on*)
             (task-net (one {act}) (two (sleep 0)))"
        )
    };
    let ended = |found: &Exploration<Behaviour>| -> Vec<Ended> {
        found.endings.iter().map(|ending| ending.what.ended).collect()
    };
    let found = endings(&text(act), Grain::Variables);
    assert_eq!(ended(&found), [Ended::Normally(0)], "{found:?}");
    let found = endings(&text(&format!("(when (choose t nil) {act})")), Grain::Variables);
    assert_eq!(ended(&found), [Ended::Normally(0), Ended::Normally(1)], "{found:?}");
    let expected = "SWITCHED-ON, which has to hold eventually, never did.";
    assert!(found.endings[1].what.errors.contains(expected), "{found:?}");
}
