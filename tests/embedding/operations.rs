//! Operations: they park only the task that calls them, however the host behaves.

use esl::engine::{Call, Failure, Operation};
use esl::host::{Host, Incoming, News, RealHost, RecordingHost, ReplayHost, VirtualHost};
use esl::{Config, Data, Engine, Error};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::{check, define_lag, engine};

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
    let count = |call: Call| Ok::<_, Failure>(call.get::<Vec<Data>>("all")?.len() as i64);
    engine.define("COUNT-ALL", "(&rest all)", "", count).expect("it compiles");
    check(&mut engine, "(list (count-all) (count-all 1 'two \"three\"))", "(0 3)");
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
    // Each report signals the handle, while the operation goes on.
    let reports = begun.clone();
    let report = move |call: Call| {
        let far: Data = call.get("far")?;
        let begun = reports.lock().expect("no panic");
        let operation = begun.last().ok_or_else(|| Failure::from("nothing was begun"))?;
        operation.report_progress(far);
        Ok::<_, Failure>(())
    };
    engine.define("REPORT", "(far)", "Reports.", report).expect("it compiles");
    let watched = "(let ((handle (start (survey))) (seen nil))
                     (dolist (far '(1 2))
                       (let ((count (event-count handle)))
                         (report far)
                         (wait-for-event handle :unless-count count :timeout 60)
                         (push (list (operation-status handle) (operation-progress handle)) seen)))
                     (advance)
                     (reverse seen))";
    check(&mut engine, watched, "((:PENDING 1) (:PENDING 2))");
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
    check(&mut engine, "(princ-to-string (start (lag 1)))", "\"#<OPERATION LAG 6>\"");
    check(&mut engine, "(handler-case (start (car 1)) (error () 'refused))", "REFUSED");
}

#[test]
fn an_executor_that_polls_once_gets_only_what_has_to_wait() {
    let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
    let engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    let handed_on = Arc::new(Mutex::new(Vec::new()));
    let waiting = handed_on.clone();
    let mut engine = engine.with_executor(move |job| {
        let left = job.poll_once();
        waiting.lock().expect("no panic").extend(left);
    });
    let here = std::thread::current().id();
    let async_ready = move |call: Call| async move {
        assert_eq!(std::thread::current().id(), here);
        call.get::<i64>("x")
    };
    engine.define_async("READY", "(x)", "", async_ready).expect("it compiles");
    engine
        .define_async("EXPLODE", "()", "", |_| async { if true { panic!("broken") } else { Ok(()) } })
        .expect("it compiles");
    let (go, gone) = channel();
    let gone = Arc::new(Mutex::new(gone));
    engine
        .define_async("LATER", "()", "", move |_| {
            let gone = gone.clone();
            std::future::poll_fn(move |_| match gone.lock().expect("no panic").try_recv() {
                Ok(value) => std::task::Poll::Ready(Ok::<i64, Failure>(value)),
                Err(_) => std::task::Poll::Pending,
            })
        })
        .expect("it compiles");
    check(&mut engine, "(list (ready 1) (ready 2))", "(1 2)");
    check(&mut engine, "(handler-case (ready \"x\") (type-error () 'refused))", "REFUSED");
    check(&mut engine, "(handler-case (explode) (failure (f) (failure-cause f)))", ":HOST-PANIC");
    assert_eq!(handed_on.lock().expect("no panic").len(), 0);
    check(&mut engine, "(progn (defvar *later* (start (later))) (operation-status *later*))", ":PENDING");
    let job = handed_on.lock().expect("no panic").pop().expect("it waits");
    go.send(7).expect("the future is there");
    assert!(job.poll_once().is_none());
    check(&mut engine, "(operation-result *later*)", "7");
    // An operation that is left between polls is dropped at the next poll, and a dropped one fails.
    let left = "(handler-case (with-timeout 0.01 (unwind-protect (later) (give-up)))
                  (failure (f) (failure-cause f)))";
    let jobs = handed_on.clone();
    engine
        .define("GIVE-UP", "()", "Nothing.", move |_| {
            assert_eq!(jobs.lock().expect("no panic").len(), 0);
            Ok(())
        })
        .expect("it compiles");
    let jobs = handed_on.clone();
    let poller = std::thread::spawn(move || {
        loop {
            let job = jobs.lock().expect("no panic").pop();
            match job.map(esl::engine::HostFuture::poll_once) {
                Some(None) => break,
                Some(Some(job)) => jobs.lock().expect("no panic").push(job),
                None => std::thread::sleep(Duration::from_millis(1)),
            }
        }
    });
    check(&mut engine, left, ":TIMEOUT");
    poller.join().expect("it does not panic");
    check(&mut engine, "(progn (setq *later* (start (later))) (operation-status *later*))", ":PENDING");
    handed_on.lock().expect("no panic").clear();
    let lost = "(handler-case (operation-result *later*) (failure (f) (failure-cause f)))";
    check(&mut engine, lost, ":OPERATION-DROPPED");
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
    // The type allows one end only; a host of an embedder may put more into the inbox.
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
