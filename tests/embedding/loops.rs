//! Engines that run in a loop of the embedder's, or as a future; functions as values.

use esl::engine::{Ending, Poll};
use esl::host::VirtualHost;
use esl::{Config, Data, Engine, Error};
use std::sync::Arc;
use std::time::Instant;

use super::{check, define_lag, engine};

/// Runs an engine by `poll` alone, and returns how it ends and how often it was idle.
fn poll_to_the_end(engine: &mut Engine, ticks: u64) -> (Ending, usize) {
    let mut idle = 0;
    loop {
        match engine.poll(Instant::now(), ticks) {
            Poll::Busy => {}
            Poll::Idle { .. } => {
                idle += 1;
                std::thread::yield_now();
            }
            Poll::Ended(ending) => return (ending, idle),
        }
    }
}

#[test]
fn a_loop_of_the_embedders_runs_timers_operations_and_questions() {
    let mut engine = engine();
    define_lag(&mut engine);
    let handle = engine.handle();
    let sum = engine.begin("(progn (sleep 0.01) (+ (lag 5 1) (lag 5 2)))");
    let called = handle.call::<i64>("+", [1_i64.into(), 5_i64.into()]);
    let failed = engine.begin("(car 5)");
    drop(handle);
    let (ending, idle) = poll_to_the_end(&mut engine, 100);
    assert!(ending == Ending::Done && idle > 0, "{ending:?}, {idle}");
    assert_eq!((sum.wait(), called.wait()), (Ok(Data::Integer(3)), Ok(6)));
    assert!(matches!(failed.wait(), Err(Error::Failed { cause, .. }) if cause == ":TYPE-ERROR"));
    let left = engine.begin("(unwind-protect (wait-for-event (make-event)) (princ 'off))");
    assert_eq!(poll_to_the_end(&mut engine, 100).0, Ending::Deadlocked);
    engine.end();
    assert_eq!(left.wait(), Err(Error::Aborted));
    engine.begin("(exit 7)");
    assert_eq!(engine.run(), Ending::Exited(7));
}

#[test]
fn virtual_time_goes_on_in_a_loop_of_the_embedders() {
    let host = VirtualHost::new();
    let mut engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    let now = engine.begin("(progn (sleep 3600) (now))");
    assert_eq!(poll_to_the_end(&mut engine, u64::MAX), (Ending::Done, 0));
    assert_eq!(now.wait(), Ok(Data::Float(3600.0)));
}

#[test]
fn a_future_of_a_run_waits_for_time_and_for_what_comes() {
    struct Unpark(std::thread::Thread);
    impl std::task::Wake for Unpark {
        fn wake(self: Arc<Self>) {
            self.0.unpark();
        }
    }
    let mut engine = engine();
    define_lag(&mut engine);
    let sum = engine.begin("(progn (sleep 0.02) (dotimes (i 300000)) (+ (lag 20 1) (lag 1 2)))");
    let waker = Arc::new(Unpark(std::thread::current())).into();
    let mut context = std::task::Context::from_waker(&waker);
    let mut polls = 0;
    {
        let mut run = std::pin::pin!(engine.run_async());
        while run.as_mut().poll(&mut context).is_pending() {
            polls += 1;
            std::thread::park();
        }
    }
    assert_eq!(sum.wait(), Ok(Data::Integer(3)));
    assert!(polls > 3, "{polls}");
}

#[test]
fn functions_are_held_and_called_from_anywhere() {
    let (mut engine, mut other) = (engine(), engine());
    let count = engine.function("(let ((n 0)) (lambda (&optional (by 1)) (incf n by)))").expect("it is one");
    // Held values survive collections.
    check(&mut engine, "(dotimes (i 200000) (list i i i))", "NIL");
    assert_eq!(engine.call::<i64>(&count, [5_i64.into()]), Ok(5));
    let handle = engine.handle();
    let shared = count.clone();
    let called = handle.call::<i64>(&shared, []);
    let started = handle.spawn(&count, [10_i64.into()]);
    drop((handle, count));
    assert_eq!(engine.run(), Ending::Done);
    assert_eq!((called.wait(), started.wait()), (Ok(6), Ok(Data::Integer(16))));
    assert!(matches!(other.call::<i64>(&shared, []), Err(Error::NotOfType { .. })));
    let elsewhere = other.handle().call::<i64>(&shared, []);
    assert_eq!(other.run(), Ending::Done);
    assert!(matches!(elsewhere.wait(), Err(Error::Failed { cause, .. }) if cause == ":PROGRAM-ERROR"));
    drop(shared);
    assert_eq!(engine.call::<i64>("+", [1_i64.into(), 2_i64.into()]), Ok(3));
    assert!(matches!(engine.function("5"), Err(Error::NotOfType { .. })));
}

#[test]
fn engines_in_several_threads_have_nothing_in_common() {
    let run = |number: i64| {
        let mut engine = engine();
        define_lag(&mut engine);
        engine.define("OWN-NUMBER", "()", "Returns the number.", move |_| Ok(number)).expect("it compiles");
        check(
            &mut engine,
            "(progn (defvar *own* (own-number)) (define-property level ()) 'defined)",
            "DEFINED",
        );
        let together = "(progn (assert (list 'level *own*))
                               (dotimes (i 3) (spawn (let ((more (lag i 10))) (incf *own* more))))
                               (loop until (= *own* (+ 30 (own-number))) do (sleep 0.001))
                               (list (level) (- *own* (lag 1 30)) (own-number)))";
        check(&mut engine, together, &format!("({number} {number} {number})"));
    };
    let threads: Vec<_> = (0..4).map(|number| std::thread::spawn(move || run(number))).collect();
    assert!(threads.into_iter().all(|thread| thread.join().is_ok()));
}
