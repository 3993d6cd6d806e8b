//! Things of the embedder's, which programs hold and cannot look into, and what a run leaves behind.

use esl::data::{HostType, Opaque};
use esl::engine::{Call, Ending, Failure};
use esl::host::VirtualHost;
use esl::{Config, Engine};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use super::{check, engine};

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
        // A value that Rust holds lives on without the program.
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

/// Data for which the memory has no room fail the call that they answer, and no other one; of a signal, they
/// are dropped with it.
#[test]
fn data_without_room_fail_their_own_call() {
    let config = Config { memory: 16 << 20, ..Config::default() };
    let mut engine = Engine::with(config, Box::new(VirtualHost::new())).expect("there is room");
    let text = "x".repeat(64 << 20);
    let (answer, calls) = (text.clone(), Arc::new(AtomicUsize::new(0)));
    let count = calls.clone();
    let big = move |_: Call| {
        count.fetch_add(1, Ordering::SeqCst);
        Ok::<String, Failure>(answer.clone())
    };
    engine.define("BIG", "()", "Much text.", big).expect("it is a name");
    engine.define("SMALL", "()", "A number.", |_| Ok::<i64, Failure>(7)).expect("it is a name");
    let outcome = "(flet ((outcome () (handler-case (big) (heap-exhausted () :full))))
                     (list (outcome) (small) (outcome) (small)))";
    check(&mut engine, outcome, "(:FULL 7 :FULL 7)");
    assert_eq!(calls.load(Ordering::SeqCst), 2);
    engine.eval("(define-input news)").expect("it compiles");
    engine.handle().signal("news", [text.into()]).expect("the program has the input");
    engine.handle().signal("news", [1_i64.into()]).expect("the program has the input");
    check(&mut engine, "(list (multiple-value-list (wait-for-event news)) (input-dropped news))", "((1) 1)");
}

#[test]
fn a_module_of_another_build_is_not_taken_for_a_file_that_may_not_be_read() {
    let mut engine = engine();
    check(&mut engine, "(require :json)", "T");
    let error = engine.eval("(require :ros)").expect_err("no crate has added it").to_string();
    assert!(error.contains("belongs to the feature robots"), "{error}");
    let error = engine.eval("(require :shared)").expect_err("the engine may read nothing").to_string();
    assert!(error.contains("not permitted"), "{error}");
}
