//! Functions of the embedder's: operations, which park only the task that calls them, however the host
//! behaves.

use std::future::Future;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use esl::data::{HostType, Opaque};
use esl::engine::{Call, Ending, Failure, Operation, Poll};
use esl::host::{Host, Incoming, News, RealHost, RecordingHost, ReplayHost, SendError, VirtualHost};
use esl::{Config, Data, Engine, Error};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;

/// Returns an engine whose time is real and whose output is dropped.
fn engine() -> Engine {
    let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
    Engine::with(Config::default(), Box::new(host)).expect("there is room for the library")
}

#[track_caller]
fn check(engine: &mut Engine, text: &str, expected: &str) {
    match engine.eval(text) {
        Ok(value) => assert_eq!(value.to_string(), expected, "{text}"),
        Err(error) => panic!("{text}: {error}"),
    }
}

/// Defines `(lag milliseconds value)`, an operation that another thread completes after a time.
fn define_lag(engine: &mut Engine) {
    let begin = |operation: Operation| {
        std::thread::spawn(move || {
            let call = operation.call().clone();
            let time = call.get::<u32>("milliseconds").expect("the test passes an integer");
            std::thread::sleep(Duration::from_millis(time.into()));
            operation.complete(call.get::<Data>("value").expect("there is a value"));
        });
    };
    engine.define_operation("LAG", "(milliseconds &optional value)", "Lags.", begin).expect("it compiles");
}

#[test]
fn an_operation_parks_only_its_task() {
    let mut engine = engine();
    let (go, gone) = channel();
    let gone = Mutex::new(Some(gone));
    engine
        .define_operation("JOURNEY", "()", "Ends once it was told to go.", move |operation| {
            let gone = gone.lock().expect("no panic").take().expect("the test makes one journey");
            std::thread::spawn(move || {
                gone.recv().expect("the program says it");
                operation.complete(Data::from("there"));
            });
        })
        .expect("it compiles");
    engine
        .define("DEPART", "()", "Ends the journey.", move |_| {
            go.send(()).expect("the journey goes on");
            Ok(())
        })
        .expect("it compiles");
    let text = "(task-net (one (journey)) (two (dotimes (i 100) (sleep 0)) (depart)))";
    check(&mut engine, &format!("(multiple-value-list {text})"), "(\"there\" NIL)");
}

#[test]
fn arguments_have_names_and_types_and_values_are_data() {
    let mut engine = engine();
    engine
        .define("VELOCITY", "(metres &key ((:in seconds) 2) (tags '(a b)))", "Returns a speed.", |call| {
            let tags: Vec<Data> = call.get("tags")?;
            Ok(Data::list([
                (call.get::<f64>("metres")? / call.get::<f64>("seconds")?).into(),
                Data::list(tags),
            ]))
        })
        .expect("it compiles");
    check(&mut engine, "(velocity 3)", "(1.5 (A B))");
    check(&mut engine, "(velocity 3 :in 6 :tags #(1 2))", "(0.5 (1 2))");
    let failing = "(handler-case (velocity \"far\")
                     (type-error (e) (list (type-error-datum e) (type-error-expected-type e))))";
    check(&mut engine, failing, "(\"far\" REAL)");
    check(&mut engine, "(documentation 'velocity 'function)", "\"Returns a speed.\"");
    let errors = engine.define("CAR", "(x)", "", |_| Ok(Data::Nil));
    assert!(matches!(errors, Err(Error::DoesNotCompile(_))), "{errors:?}");
}

#[test]
fn a_failure_is_one_of_the_program_at_the_call() {
    let mut engine = engine();
    engine
        .define_operation("GRASP", "(what)", "Grasps.", |operation| {
            let what = operation.call().get::<Data>("what").expect("there is one");
            operation.fail(Failure::new("GRIPPER-STUCK", [what, 5_i64.into()]));
        })
        .expect("it compiles");
    let recovering =
        "(with-recovery-procedures (((:gripper-stuck what force) (values (list 'instead what force))))
                        (list (grasp 'ball) 'on))";
    check(&mut engine, recovering, "((INSTEAD BALL 5) ON)");
    check(&mut engine, "(handler-case (grasp 1) (failure (f) (failure-cause f)))", ":GRIPPER-STUCK");
    assert!(
        matches!(engine.eval("(grasp 1)"), Err(Error::Failed { cause, .. }) if cause == ":GRIPPER-STUCK")
    );
}

#[test]
fn operations_are_told_when_their_task_is_suspended_and_goes_on() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let mut engine = engine();
    let noted = log.clone();
    let drives = "Drives until it is told to stop.";
    let defined = engine.define_operation("DRIVE", "()", drives, move |operation| {
        let note = |what| {
            let noted = noted.clone();
            move || noted.lock().expect("no panic").push(what)
        };
        note("begins")();
        let (pauses, goes_on, stops) = (note("pauses"), note("goes on"), note("stops"));
        operation.on_suspension(move |is_suspended| if is_suspended { pauses() } else { goes_on() });
        let kept = Arc::new(Mutex::new(None));
        let dropped = kept.clone();
        operation.on_cancel(move || {
            stops();
            drop(dropped.lock().expect("no panic").take());
        });
        *kept.lock().expect("no panic") = Some(operation);
    });
    defined.expect("it compiles");
    let noted = log.clone();
    let counts = engine.define("NOTED", "()", "Returns how much has happened.", move |_| {
        Ok(noted.lock().expect("no panic").len() as i64)
    });
    counts.expect("it compiles");
    let text = "(let ((task (spawn (drive))) (other (spawn (drive))))
                  (loop (when (= (noted) 2) (return)) (sleep 0))
                  (suspend-task task)
                  (suspend-task task)
                  (resume-task task)
                  (resume-task task)
                  (loop (when (= (noted) 4) (return)) (sleep 0))
                  (suspend-task task)
                  (abort-task task)
                  (abort-task other)
                  (list (task-status task) (task-status other)))";
    check(&mut engine, text, "(:ABORTED :ABORTED)");
    let expected = ["begins", "begins", "pauses", "goes on", "pauses", "stops", "stops"];
    assert_eq!(*log.lock().expect("no panic"), expected);
}

#[test]
fn leaving_a_call_cancels_and_waits_until_the_outside_has_stopped() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let mut engine = engine();
    let noted = log.clone();
    engine
        .define_operation("DRIVE", "()", "Drives until it is told to stop.", move |operation| {
            let (stop, stopped) = channel();
            operation.on_cancel(move || _ = stop.send(()));
            let noted = noted.clone();
            std::thread::spawn(move || {
                stopped.recv().expect("the program cancels it");
                std::thread::sleep(Duration::from_millis(30));
                noted.lock().expect("no panic").push("stopped");
                drop(operation);
            });
        })
        .expect("it compiles");
    let noted = log.clone();
    engine
        .define("NOTE", "()", "Notes that the form is over.", move |_| {
            noted.lock().expect("no panic").push("over");
            Ok(())
        })
        .expect("it compiles");
    let ways = [
        "(handler-case (with-timeout 0.01 (drive)) (failure () nil))",
        "(let ((task (spawn (drive)))) (sleep 0.01) (abort-task task))",
        "(or-parallel (a (drive)) (b (sleep 0.01)))",
        "(block nil (with-guardian (sleep 0.01) (return) (drive)))",
        "(let ((handle (start (drive)))) (sleep 0.01) (cancel handle))",
    ];
    for way in ways {
        check(&mut engine, &format!("(progn {way} (note) 'ended)"), "ENDED");
        assert_eq!(std::mem::take(&mut *log.lock().expect("no panic")), ["stopped", "over"], "{way}");
    }
    engine.detach("DRIVE").expect("it is a name");
    check(&mut engine, "(progn (handler-case (with-timeout 0.01 (drive)) (failure () nil)) (note))", "NIL");
    assert_eq!(log.lock().expect("no panic")[0], "over");
}

#[test]
fn handles_are_events_and_tell_what_has_become_of_the_operation() {
    let mut engine = engine();
    define_lag(&mut engine);
    let begun: Arc<Mutex<Vec<Operation>>> = Arc::default();
    let other = begun.clone();
    let begin = move |operation| other.lock().expect("no panic").push(operation);
    engine.define_operation("SURVEY", "()", "Is completed by the test.", begin).expect("it compiles");
    let next = begun.clone();
    engine
        .define("ADVANCE", "()", "Reports, then completes.", move |_| {
            let mut begun = next.lock().expect("no panic");
            match begun.pop() {
                Some(operation) if operation.call().arguments().is_empty() => {
                    operation.report_progress(0.5);
                    operation.complete_with(&[1_i64.into(), 2_i64.into()]);
                }
                _ => return Err("nothing was begun".into()),
            }
            Ok(())
        })
        .expect("it compiles");
    let text = "(let ((handle (start (survey))) (seen nil))
                  (push (list (operation-status handle) (operation-progress handle) (typep handle 'event)
                              (typep handle 'operation) (type-of handle)) seen)
                  (advance)
                  (push (multiple-value-list (operation-result handle)) seen)
                  (push (list (operation-status handle) (operation-progress handle)) seen)
                  (cancel handle)
                  (push (operation-status handle) seen)
                  (reverse seen))";
    check(&mut engine, text, "((:PENDING NIL T T OPERATION) (1 2) (:COMPLETED 0.5) :COMPLETED)");
    let first = "(let ((slow (start (lag 5000))) (fast (start (lag 1 'x))))
                   (wait-for-events (list slow fast))
                   (list (operation-status slow) (operation-status fast) (operation-result fast)))";
    check(&mut engine, first, "(:PENDING :COMPLETED X)");
    let cancelled = "(let ((handle (start (survey))))
                       (spawn (sleep 0.01) (handler-case (advance) (error () nil)))
                       (cancel handle)
                       (list (operation-status handle)
                             (handler-case (operation-result handle) (failure (f) (failure-cause f)))))";
    check(&mut engine, cancelled, "(:CANCELLED :CANCELLED)");
    check(&mut engine, "(princ-to-string (start (lag 1)))", "\"#<OPERATION LAG 5>\"");
    check(&mut engine, "(handler-case (start (car 1)) (error () 'refused))", "REFUSED");
}

#[test]
fn code_of_the_host_that_misbehaves_is_a_failure() {
    let mut engine = engine();
    let dropping = |operation: Operation| drop(operation);
    engine.define_operation("FORGET", "()", "", dropping).expect("it compiles");
    engine.define_operation("SHATTER", "()", "", |_| panic!("broken")).expect("it compiles");
    engine.define("CRASH", "()", "", |_| if true { panic!("broken") } else { Ok(()) }).expect("it compiles");
    engine
        .define_async("EXPLODE", "()", "", |_| async { if true { panic!("broken") } else { Ok(()) } })
        .expect("it compiles");
    let cause = |call: &str| format!("(handler-case {call} (failure (f) (failure-cause f)))");
    check(&mut engine, &cause("(forget)"), ":OPERATION-DROPPED");
    for call in ["(shatter)", "(crash)", "(explode)"] {
        check(&mut engine, &cause(call), ":HOST-PANIC");
    }
    // A second time: the engine's thread is still there.
    check(&mut engine, &cause("(explode)"), ":HOST-PANIC");
}

#[test]
fn of_several_ends_of_an_operation_the_first_counts() {
    let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
    let inbox = host.inbox();
    let mut engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    // The type allows one end only; a host of somebody's own may put more into the inbox.
    let begin = move |operation: Operation| {
        let end = |number, text: &str| {
            let values = vec![Datum::string(text, Span::default())];
            inbox.put(Incoming::Operation { number, news: News::Completed(values) });
        };
        end(1_000_000, "of none");
        for text in ["first", "second"] {
            end(1, text);
        }
        operation.complete("third");
    };
    engine.define_operation("TWICE", "()", "", begin).expect("it compiles");
    let results = "(let ((h (start (twice)))) (list (operation-result h) (operation-result h)))";
    check(&mut engine, results, "(\"first\" \"first\")");
    check(&mut engine, "(list (twice) (sleep 0.001))", "(\"third\" NIL)");
}

#[test]
fn what_comes_after_the_engine_is_gone_has_no_effect() {
    let (sender, operations) = channel();
    let config = Config { cleanup_time: 10_000_000, ..Config::default() };
    let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
    let mut engine = Engine::with(config, Box::new(host)).expect("there is room for the library");
    engine
        .define_operation("HANG", "()", "", move |operation| drop(sender.send(operation)))
        .expect("it compiles");
    check(&mut engine, "(progn (spawn (hang)) (spawn (hang)) (sleep 0.01))", "NIL");
    drop(engine);
    let left: Vec<Operation> = operations.try_iter().collect();
    assert_eq!(left.len(), 2);
    left.into_iter().for_each(|operation| operation.complete(1_i64));
}

/// Something of Rust's that counts how many there are.
struct Motor {
    name: String,
    alive: Arc<AtomicUsize>,
}

impl HostType for Motor {
    const NAME: &'static str = "MOTOR";

    fn label(&self) -> String {
        self.name.clone()
    }
}

impl Drop for Motor {
    fn drop(&mut self) {
        self.alive.fetch_sub(1, Ordering::SeqCst);
        if self.name == "cursed" {
            panic!("what is dropped may panic");
        }
    }
}

/// Makes an engine with functions on motors, and returns how many of these are alive.
fn engine_with_motors(config: Config) -> (Engine, Arc<AtomicUsize>) {
    let mut engine = Engine::with(config, Box::new(VirtualHost::new())).expect("there is room");
    let alive = Arc::new(AtomicUsize::new(0));
    let count = alive.clone();
    engine
        .define("MAKE-MOTOR", "(name)", "A motor.", move |call| {
            count.fetch_add(1, Ordering::SeqCst);
            Ok(Opaque::new(Motor { name: call.get("name")?, alive: count.clone() }))
        })
        .unwrap();
    engine
        .define("MOTOR-NAME", "(motor)", "Its name.", |call| {
            call.get::<Opaque<Motor>>("motor")?.with(|motor| motor.name.clone())
        })
        .unwrap();
    engine.define("SAME-MOTOR", "(motor)", "The motor.", |call| call.get::<Opaque<Motor>>("motor")).unwrap();
    engine
        .define("CLOSE-MOTOR", "(motor)", "Whether it was open.", |call| {
            Ok(call.get::<Opaque<Motor>>("motor")?.close().is_some())
        })
        .unwrap();
    (engine, alive)
}

#[test]
fn things_of_the_embedder_are_held_and_compared_and_refused_where_they_do_not_belong() {
    let (mut engine, alive) = engine_with_motors(Config::default());
    check(&mut engine, "(defvar *left* (make-motor \"left\"))", "*LEFT*");
    check(&mut engine, "(list *left* (motor-name *left*))", "(#<MOTOR left> \"left\")");
    check(&mut engine, "(prin1-to-string (list *left* (make-motor \"\")))", "\"(#<MOTOR left> #<MOTOR>)\"");
    check(
        &mut engine,
        "(list (eq *left* (same-motor *left*)) (eq *left* (make-motor \"left\")) (typep *left* 'host-object)
               (type-of *left*) (gethash (same-motor *left*) (let ((h (make-hash-table))) (setf (gethash *left* h) 1) h)))",
        "(T NIL T HOST-OBJECT 1)",
    );
    let cause = |form: &str| {
        format!("(handler-case {form} (failure (f) (list (failure-cause f) (failure-arguments f))))")
    };
    let wrong = "(handler-case (motor-name 7) (type-error (e) (type-error-expected-type e)))";
    check(&mut engine, wrong, "MOTOR");
    let readably = "(handler-case (let ((*print-readably* t)) (prin1-to-string *left*))
                      (print-not-readable () 'refused))";
    check(&mut engine, readably, "REFUSED");
    check(&mut engine, "(list (close-motor *left*) (close-motor *left*))", "(T NIL)");
    check(&mut engine, &cause("(motor-name *left*)"), "(:HOST-OBJECT-CLOSED (#<MOTOR left>))");
    let recovered =
        "(with-recovery-procedures (((:host-object-closed motor) (values 'spare))) (motor-name *left*))";
    check(&mut engine, recovered, "SPARE");
    drop(engine);
    assert_eq!(alive.load(Ordering::SeqCst), 0);
}

#[test]
fn what_the_program_cannot_reach_any_more_is_dropped() {
    for collect_always in [false, true] {
        let (mut engine, alive) = engine_with_motors(Config { collect_always, ..Config::default() });
        engine.eval("(defvar *kept* (list (make-motor \"a\") (make-motor \"b\")))").unwrap();
        engine.eval("(progn (dotimes (i 50) (make-motor \"lost\")) (make-motor \"cursed\") nil)").unwrap();
        engine.eval("(dotimes (i 300) (make-array 10000))").unwrap();
        engine.eval("(dotimes (i 300) (make-array 10000))").unwrap();
        assert_eq!(alive.load(Ordering::SeqCst), 2, "with a collection at each safepoint: {collect_always}");
        check(&mut engine, "(mapcar #'motor-name *kept*)", "(\"a\" \"b\")");
        // What Rust holds lives on without the program.
        let held = Arc::new(std::sync::Mutex::new(None));
        let keep = held.clone();
        engine
            .define("HOLD", "(motor)", "Has Rust hold it.", move |call| {
                *keep.lock().unwrap() = Some(call.get::<Opaque<Motor>>("motor")?);
                Ok(())
            })
            .unwrap();
        engine.eval("(progn (hold (second *kept*)) (setq *kept* nil))").unwrap();
        drop(engine);
        assert_eq!(alive.load(Ordering::SeqCst), 1);
        assert!(
            held.lock().unwrap().take().is_some_and(|motor| motor.with(|motor| motor.name == "b").unwrap())
        );
        assert_eq!(alive.load(Ordering::SeqCst), 0);
    }
}

#[test]
fn a_thousand_are_cancelled_at_once() {
    let count = Arc::new(AtomicUsize::new(0));
    let mut engine = engine();
    let cancelled = count.clone();
    engine
        .define_operation("HOLD", "()", "Stops as soon as it is cancelled.", move |operation| {
            let place = Arc::new(Mutex::new(None));
            let (other, cancelled) = (place.clone(), cancelled.clone());
            operation.on_cancel(move || {
                cancelled.fetch_add(1, Ordering::Relaxed);
                drop(other.lock().expect("no panic").take());
            });
            *place.lock().expect("no panic") = Some(operation);
        })
        .expect("it compiles");
    let text = "(let ((tasks (loop repeat 1000 collect (spawn (hold)))))
                  (sleep 0.01)
                  (handler-case (with-timeout 0.01 (mapc #'wait-for-task tasks)) (failure () nil))
                  (mapc #'abort-task tasks)
                  (length (list-tasks)))";
    check(&mut engine, text, "1");
    assert_eq!(count.load(Ordering::Relaxed), 1000);
}

#[test]
fn futures_are_dropped_when_their_calls_are_left() {
    struct Noted(Arc<AtomicUsize>);
    impl Drop for Noted {
        fn drop(&mut self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }
    let count = Arc::new(AtomicUsize::new(0));
    let mut engine = engine();
    let dropped = count.clone();
    engine
        .define_async("PEND", "()", "", move |_| {
            let noted = Noted(dropped.clone());
            async move {
                std::future::pending::<()>().await;
                drop(noted);
                Ok(())
            }
        })
        .expect("it compiles");
    check(
        &mut engine,
        "(handler-case (with-timeout 0.01 (pend)) (failure (f) (failure-cause f)))",
        ":TIMEOUT",
    );
    assert_eq!(count.load(Ordering::Relaxed), 1);
}

#[test]
fn a_pending_operation_is_no_deadlock_and_reports_name_it() {
    let host = VirtualHost::new();
    let mut engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    define_lag(&mut engine);
    check(&mut engine, "(lag 20 'late)", "LATE");
    check(&mut engine, "(progn (spawn (:name 'slow) (lag 20)) (sleep 0))", "NIL");
    let report = engine.task_report();
    assert!(report.contains("task SLOW waits for operation LAG 2"), "{report}");
}

#[test]
fn a_recorded_run_is_replayed_without_the_host() {
    let text = "(let ((results nil))
                  (dotimes (i 5)
                    (let ((i i)) (spawn (push (lag (* 3 i) i) results) (push (count-calls) results))))
                  (push (handler-case (with-timeout 0.004 (lag 50 'never)) (failure () nil)) results)
                  (loop until (= (length results) 11) do (sleep 0.001))
                  (list (reverse results) (now)))";
    let run = |engine: &mut Engine, calls: Arc<AtomicUsize>| {
        define_lag(engine);
        engine
            .define("COUNT-CALLS", "()", "", move |_| Ok(calls.fetch_add(1, Ordering::Relaxed) as i64))
            .expect("it compiles");
        let value = engine.eval(text).expect("it returns");
        (value.to_string(), engine.canary(), engine.ticks())
    };
    let host = RecordingHost::new(RealHost::new(Vec::new()));
    let (recording, calls) = (host.recording(), Arc::new(AtomicUsize::new(0)));
    let mut live = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    let first = run(&mut live, calls.clone());
    assert_eq!(calls.load(Ordering::Relaxed), 5);
    let host = ReplayHost::new(recording.to_records());
    let mut replay =
        Engine::with(Config::default(), Box::new(host.clone())).expect("there is room for the library");
    let again = run(&mut replay, calls.clone());
    assert_eq!(again, first);
    assert!(host.is_at_end() && !host.has_diverged());
    assert_eq!(calls.load(Ordering::Relaxed), 5, "the host's functions are not called again");
}

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
fn motors_are_off_however_a_run_of_the_embedders_ends() {
    type End = fn(Engine);
    let ways: [(&str, End); 9] = [
        ("dropped", drop),
        ("deadlock", |mut engine| assert!(engine.eval("(wait-for-event (make-event))").is_err())),
        ("failure", |mut engine| assert!(engine.eval("(fail :lost)").is_err())),
        ("exit", |mut engine| assert!(engine.eval("(exit 3)").is_err())),
        ("budget", |mut engine| assert!(engine.eval("(loop)").is_err())),
        ("memory", |mut engine| assert!(engine.eval("(let ((l nil)) (loop (push (list 1 2) l)))").is_err())),
        ("panic of a function", |mut engine| assert!(engine.eval("(crash)").is_err())),
        ("stop", |mut engine| {
            drop(engine.begin("(loop)"));
            engine.handle().stop();
            assert_eq!(engine.run(), Ending::Stopped);
        }),
        ("panic of the embedder", |engine| {
            let thread = std::thread::spawn(move || {
                let _engine = engine;
                panic!("the embedder's code is wrong");
            });
            assert!(thread.join().is_err());
        }),
    ];
    for (way, end) in ways {
        let config = Config { budget: Some(3_000_000), memory: 16 << 20, ..Config::default() };
        let mut engine = Engine::with(config, Box::new(VirtualHost::new())).expect("there is room");
        let off: Arc<Mutex<Vec<String>>> = Arc::default();
        let noted = off.clone();
        let note = move |call: Call| {
            noted.lock().expect("nobody panics with it").push(call.get::<String>("name")?);
            Ok::<(), Failure>(())
        };
        engine.define("OFF", "(name)", "Switches a motor off.", note).expect("it compiles");
        engine
            .define("CRASH", "()", "", |_| if true { panic!("broken") } else { Ok(()) })
            .expect("it compiles");
        let motors = "(progn (dolist (name '(\"left\" \"right\"))
                                (let ((name name))
                                  (spawn (:daemon t)
                                    (unwind-protect (wait-for-event (make-event)) (sleep 0.1) (off name)))))
                              (sleep 1))";
        check(&mut engine, motors, "NIL");
        end(engine);
        assert_eq!(*off.lock().expect("nobody panics with it"), ["right", "left"], "{way}");
    }
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
        // What is asked while it pauses is answered, calls excepted.
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
        // Without the thread nobody asks; the recording has it all.
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
    // What is held survives collections.
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
