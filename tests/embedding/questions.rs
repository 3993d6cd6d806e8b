//! Requests to a running engine from other threads: signals, calls, new tasks, pauses, observers.

use esl::host::{RealHost, RecordingHost, ReplayHost, SendError};
use esl::{Config, Data, Engine, Error};
use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{check, engine};

#[test]
fn senders_outside_signal_inputs_by_name() {
    let mut engine = engine();
    check(&mut engine, "(define-input commands :capacity 3)", "COMMANDS");
    let waiting = "(list (wait-for-event commands) (multiple-value-list (wait-for-event commands)))";
    assert_eq!(engine.eval(waiting), Err(Error::Deadlocked));
    let handle = engine.handle();
    let thread = std::thread::spawn(move || {
        handle.signal("commands", [1_i64.into()])?;
        handle.signal("Commands", [2_i64.into(), 3_i64.into()])?;
        handle.signal("orders", [])
    });
    check(&mut engine, waiting, "(1 (2 3))");
    assert_eq!(thread.join().ok(), Some(Err(SendError::NoSuchInput("ORDERS".into()))));
    assert_eq!(engine.eval("(wait-for-event commands)"), Err(Error::Deadlocked));
}

#[test]
fn senders_wait_while_an_input_is_full() {
    let mut engine = engine();
    check(&mut engine, "(define-input commands :capacity 2 :when-full :wait)", "COMMANDS");
    let handle = engine.handle();
    let other = handle.clone();
    let thread =
        std::thread::spawn(move || (0..1000_i64).all(|n| other.signal("commands", [n.into()]).is_ok()));
    check(&mut engine, "(loop for i below 1000 always (eql (wait-for-event commands) i))", "T");
    assert_eq!(thread.join().ok(), Some(true));
    let full = (0..3).map(|_| handle.try_signal("commands", [])).find(Result::is_err);
    assert_eq!(full, Some(Err(SendError::Full("COMMANDS".into()))));
    drop(engine);
    assert_eq!(handle.signal("commands", []), Err(SendError::Ended));
}

#[test]
fn a_handle_calls_asserts_and_sets_in_order() {
    let mut engine = engine();
    let definitions = "(progn (define-input done) (define-property level (tank))
                              (defun twice (n) (signal-event done) (* 2 n)))";
    check(&mut engine, definitions, "TWICE");
    let handle = engine.handle();
    let level = |n: i64| ("level", [Data::Symbol("A".into())], n);
    let thread = std::thread::spawn(move || {
        let (property, tank, value) = level(3);
        let first = handle.set(property, tank.clone(), value);
        let second = handle.set(property, tank, 4_i64);
        let fact = Data::list([Data::Symbol("SEEN".into()), 1_i64.into()]);
        let seen = handle.assert(fact.clone());
        let gone = handle.retract(fact);
        let six: i64 = handle.call("twice", [3_i64.into()]).wait()?;
        Ok::<_, Error>((first.wait()?, second.wait()?, seen.wait()?, gone.wait()?, six))
    });
    check(&mut engine, "(progn (wait-for-event done) (level 'a))", "4");
    check(&mut engine, "(sleep 0.2)", "NIL");
    assert_eq!(thread.join().expect("it does not panic"), Ok((true, true, true, 1, 6)));
}

/// Each change takes many slices, beside busy tasks.
#[test]
fn what_comes_after_a_change_finds_it_made() {
    let host = RealHost::new(Vec::new());
    let config = Config { slice: 200, ..Config::default() };
    let mut engine = Engine::with(config, Box::new(host)).expect("there is room for the library");
    let definitions = "(progn (define-input seen :capacity 99) (define-property path ())
                              (defun newest () (first (path)))
                              (defun number-of-items () (length (db-query '(item ?i))))
                              (dotimes (i 20000) (assert (list 'item i)))
                              (dotimes (i 5) (spawn (loop))))";
    check(&mut engine, definitions, "NIL");
    let handle = engine.handle();
    let thread = std::thread::spawn(move || {
        let item = [Data::Symbol("ITEM".into()), Data::Symbol("?I".into())];
        let gone = handle.retract(Data::list(item));
        handle.signal("seen", [])?;
        let path = |n: i64| Data::list((0..8_000).map(|_| Data::from(n)));
        let newest: Vec<_> = (0..20)
            .map(|n| {
                drop(handle.set("path", [], path(n - 1)));
                drop(handle.set("path", [], path(n)));
                handle.call::<i64>("newest", [])
            })
            .collect();
        let newest: Vec<_> = newest.into_iter().map(|reply| reply.wait()).collect();
        handle.signal("seen", [])?;
        Ok::<_, SendError>((gone.wait(), newest))
    });
    check(&mut engine, "(progn (wait-for-event seen) (number-of-items))", "0");
    check(&mut engine, "(progn (wait-for-event seen) (newest))", "19");
    let (gone, newest) = thread.join().expect("it does not panic").expect("there is the input");
    assert_eq!(gone, Ok(20_000));
    assert!(
        newest.iter().zip(0..).all(|(seen, set)| seen.as_ref().is_ok_and(|&seen| seen >= set)),
        "{newest:?}"
    );
}

#[test]
fn a_call_that_waits_for_a_change_can_be_aborted() {
    let mut engine = engine();
    let definitions = "(progn (defvar *calls* 0) (defun note () (incf *calls*))
                              (dotimes (i 20000) (assert (list 'item i))))";
    check(&mut engine, definitions, "NIL");
    let handle = engine.handle();
    let item = [Data::Symbol("ITEM".into()), Data::Symbol("?I".into())];
    let gone = handle.retract(Data::list(item));
    let (kept, aborted) = (handle.spawn("note", []), handle.spawn("note", []));
    aborted.abort();
    check(&mut engine, "(loop until (plusp *calls*) do (sleep 0.001))", "NIL");
    check(&mut engine, "(progn (sleep 0.05) *calls*)", "1");
    assert_eq!((gone.wait(), aborted.wait()), (Ok(20_000), Err(Error::Aborted)));
    assert_eq!(kept.wait(), Ok(Data::Integer(1)));
}

#[test]
fn what_goes_wrong_with_a_question_is_an_error_of_the_answer() {
    let mut engine = engine();
    check(&mut engine, "(define-input done)", "DONE");
    let handle = engine.handle();
    let thread = std::thread::spawn(move || {
        let errors = [
            handle.call::<i64>("no-such-function", []).wait().map(drop),
            handle.call::<i64>("car", [5_i64.into()]).wait().map(drop),
            handle.call::<String>("car", [Data::list([7_i64.into()])]).wait().map(drop),
            handle.set("no-property", [], 1_i64).wait().map(drop),
        ];
        handle.signal("done", []).expect("there is the input");
        (errors.map(|error| error.err()), handle)
    });
    check(&mut engine, "(wait-for-event done)", "NIL");
    let (errors, handle) = thread.join().expect("it does not panic");
    let [Some(undefined), Some(Error::Failed { cause, message, .. }), Some(of_type), Some(property)] = errors
    else {
        panic!("{errors:?}")
    };
    assert!(matches!(undefined, Error::Failed { cause, .. } if cause == ":UNDEFINED-FUNCTION"));
    assert_eq!((&*cause, &*message), (":TYPE-ERROR", "The value 5 is not of type LIST."));
    assert_eq!(of_type, Error::NotOfType { value: "7".into(), expected: "STRING" });
    assert!(matches!(property, Error::Failed { cause, .. } if cause.ends_with("PROGRAM-ERROR")));
    let unanswered = handle.call::<i64>("car", []);
    drop(engine);
    assert_eq!((unanswered.wait(), handle.tasks().wait()), (Err(Error::Ended), Err(Error::Ended)));
}

#[test]
fn tasks_are_started_seen_and_aborted_from_outside() {
    let mut engine = engine();
    check(
        &mut engine,
        "(progn (define-input done :capacity 9)
                (defun work () (unwind-protect (loop (sleep 60)) (signal done 'off))))",
        "WORK",
    );
    let handle = engine.handle();
    let thread = std::thread::spawn(move || {
        let (first, second) = (handle.spawn("work", []), handle.spawn("work", []));
        // A task that is aborted before its first step has no cleanup to run.
        let tasks = loop {
            let tasks = handle.tasks().wait()?;
            if tasks.iter().all(|task| task.waits_for.is_some()) {
                break tasks;
            }
        };
        assert_eq!(tasks.len(), 3, "{tasks:?}");
        first.abort();
        assert_eq!(first.wait(), Err(Error::Aborted));
        let last = handle.tasks().wait()?.pop().expect("there is a task");
        handle.abort(last.number);
        handle.abort(123_456);
        second.wait()
    });
    check(&mut engine, "(list (wait-for-event done) (wait-for-event done) (sleep 0.05))", "(OFF OFF NIL)");
    assert_eq!(thread.join().expect("it does not panic"), Err(Error::Aborted));
}

#[test]
fn a_pause_stops_tasks_until_it_is_over() {
    let mut engine = engine();
    check(&mut engine, "(progn (define-input done) (defvar *n* 0) (defun n () *n*))", "N");
    let handle = engine.handle();
    handle.pause();
    let other = handle.clone();
    let thread = std::thread::spawn(move || {
        // Requests during a pause are answered, calls excepted.
        let tasks = other.tasks().wait();
        other.resume();
        let n = other.call::<i64>("n", []).wait();
        other.signal("done", []).expect("there is the input");
        (tasks.map(|tasks| tasks.len()), n.is_ok())
    });
    check(&mut engine, "(progn (setq *n* 1) (wait-for-event done) *n*)", "1");
    assert_eq!(thread.join().expect("it does not panic"), (Ok(1), true));
    handle.pause();
    // The last handle ends a pause.
    drop(handle);
    check(&mut engine, "(incf *n*)", "2");
}

#[test]
fn observers_come_from_outside() {
    struct Count(Arc<AtomicUsize>);
    impl Observer for Count {
        fn see(&mut self, _time: u64, _task: TaskNumber, seen: Seen<'_>) {
            self.0.fetch_add(usize::from(matches!(seen, Seen::Runs)), Ordering::Relaxed);
        }
    }
    let mut engine = engine();
    let turns = Arc::new(AtomicUsize::new(0));
    engine.handle().subscribe(Count(turns.clone()));
    check(&mut engine, "(task-net (a (sleep 0)) (b (sleep 0)))", "NIL");
    assert!(turns.load(Ordering::Relaxed) >= 3);
}

#[test]
fn a_run_with_questions_is_replayed() {
    let run = |host: Box<dyn esl::host::Host + Send>, asks: bool| {
        let mut engine = Engine::with(Config::default(), host).expect("there is room for the library");
        check(&mut engine, "(progn (define-input done) (defun f (n) (signal done n) n))", "F");
        let thread = asks.then(|| {
            let handle = engine.handle();
            std::thread::spawn(move || {
                (1..50).all(|n: i64| handle.call::<i64>("f", [n.into()]).wait() == Ok(n))
            })
        });
        // In the replay no thread sends requests; the recording has them all.
        check(&mut engine, "(loop until (eql (wait-for-event done) 49))", "NIL");
        let canary = engine.canary();
        if let Some(thread) = thread {
            assert_eq!(engine.eval("(sleep 0.01)"), Ok(Data::Nil));
            assert_eq!(thread.join().ok(), Some(true));
        }
        canary
    };
    let host = RecordingHost::new(RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(()))));
    let recording = host.recording();
    let canary = run(Box::new(host), true);
    assert_eq!(run(Box::new(ReplayHost::new(recording.to_records())), false), canary);
}

#[test]
fn a_failure_has_its_arguments() {
    let mut engine = engine();
    let Err(Error::Failed { cause, arguments, .. }) = engine.eval("(fail :valve-stuck 'left 3)") else {
        panic!()
    };
    assert_eq!((&*cause, Data::list(arguments).to_string()), (":VALVE-STUCK", "(LEFT 3)".into()));
    let Err(Error::Failed { arguments, .. }) = engine.eval("(car 5)") else { panic!() };
    assert_eq!(arguments, []);
}
