//! The ticks of a run may come in any portions, and between two of them the machine may return to an
//! earlier state: the schedule is the same, to the tick.

use esl::Config;
use esl::host::{Captured, VirtualHost};
use esl::program::{self, Program, Source};
use esl_vm::run::RunOutcome;
use esl_vm::vm::Vm;
use proptest::prelude::*;

/// Programs in which the end of a slice can be seen: by the order of output, by counts of ticks, by limits,
/// by collections, by critical sections, by cleanups.
const PROGRAMS: [&str; 7] = [
    // Round-robin.
    "(dolist (name '(1 2 3)) (let ((name name)) (spawn (dotimes (i 40) (dotimes (j 40) (car '(1))) (princ name)))))",
    // Tasks that read their own ticks.
    "(dotimes (i 3) (spawn (dotimes (j 200) (princ (esl::%task-ticks (current-task))) (dotimes (k j) (list k)))))",
    // Budgets of forms inside and outside of each other, and tasks made under them.
    "(dotimes (i 4)
       (let ((n (* 700 (+ i 1))))
         (spawn (princ (handler-case (with-budget n
                                       (dotimes (j 9) (with-budget 300 (dotimes (k 20) (car '(1)))) (princ j))
                                       (spawn (:budget 500) (loop (princ '-)))
                                       (loop (list 1)))
                         (failure () 'spent))))))",
    // The collector ends slices.
    "(dotimes (i 3)
       (let ((i i))
         (spawn (let ((kept nil)) (dotimes (j 3000) (push (make-array 40) kept) (when (zerop (mod j 100)) (princ i)))))))",
    // Critical sections, signals and waits with time limits.
    "(let ((event (make-event)) (n 0))
       (dotimes (i 3)
         (spawn (dotimes (j 60) (without-interrupts (dotimes (k 30) (incf n))) (signal event j) (princ n))))
       (spawn (dotimes (j 20) (princ (ignore-errors (wait-for-event event :timeout 0.001))))))",
    // Aborts, and cleanups that are cut off.
    "(dotimes (i 4)
       (let ((task (spawn (unwind-protect (loop (list i)) (dotimes (j 400) (princ j)) (sleep 1) (princ 'over)))))
         (spawn (dotimes (j (* 90 i)) (car '(1))) (abort-task task) (princ 'aborted))))",
    // Builtins that charge many ticks at once.
    "(dotimes (i 3)
       (let ((i i)) (spawn (dotimes (j 30) (reverse (make-list 4000)) (fill (make-array 4000) j) (princ i)))))",
];

/// Ticks after which a run is looked at, in the middle of its turns.
const MIDDLE: u64 = 5_003;

struct Course {
    /// Strict fingerprint after [`MIDDLE`] ticks.
    middle: u128,
    outcome: RunOutcome,
    output: String,
    ticks: u64,
    canary: u64,
    fingerprint: u128,
}

/// Runs a program in portions as `next` says, then to its end.
fn course(program: &Program, config: &Config, mut next: impl FnMut() -> Option<u64>) -> Course {
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine =
        program::machine(config.clone(), Box::new(host)).expect("there is room for the library");
    program::begin(&mut machine, program).expect("it can start");
    while machine.ticks() < MIDDLE {
        let portion = next().unwrap_or(u64::MAX).min(MIDDLE - machine.ticks());
        if machine.run(portion) != RunOutcome::TicksUsed {
            break;
        }
    }
    let middle = machine.fingerprint();
    let outcome = loop {
        match machine.run(next().unwrap_or(u64::MAX)) {
            RunOutcome::TicksUsed => {}
            outcome => break outcome,
        }
    };
    let fingerprint = machine.fingerprint();
    machine.end_run();
    machine.flush();
    let (ticks, canary) = (machine.ticks(), machine.canary());
    Course { middle, outcome, output: captured.output(), ticks, canary, fingerprint }
}

fn check(text: &str, config: &Config, portions: &[u64]) {
    let program = program::compile(&[Source::new("portions", text)]).program.expect("it compiles");
    let whole = course(&program, config, || None);
    let mut left = portions.iter().copied().cycle();
    let parts = course(&program, config, || left.next());
    assert_eq!(parts.output, whole.output, "portions {portions:?} of {text}");
    assert_eq!((parts.outcome, parts.ticks), (whole.outcome, whole.ticks), "portions {portions:?} of {text}");
    assert_eq!(parts.canary, whole.canary, "portions {portions:?} of {text}");
    assert_eq!(parts.middle, whole.middle, "portions {portions:?} of {text}");
    assert_eq!(parts.fingerprint, whole.fingerprint, "portions {portions:?} of {text}");
}

#[test]
fn portions_of_a_fixed_length_change_nothing() {
    for text in PROGRAMS {
        for portion in [1, 2, 7, 700, 1999, 2000, 2001] {
            check(text, &Config::default(), &[portion]);
        }
    }
}

/// Tasks that fork until there is no room have everything collected now and then, not at each failure.
#[test]
fn collections_near_the_limit_are_few() {
    let text = "(defun fork () (task-net (a (fork)) (b (fork)))) (fork)";
    let config = Config { memory: 24 << 20, budget: Some(400_000), ..Config::default() };
    check(text, &config, &[701, 1999]);
    let program = program::compile(&[Source::new("near", text)]).program.expect("it compiles");
    let mut machine =
        program::machine(config, Box::new(VirtualHost::new())).expect("there is room for the library");
    program::begin(&mut machine, &program).expect("it can start");
    while machine.run(u64::MAX) == RunOutcome::TicksUsed {}
    let cycles = machine.heap_stats().cycles;
    assert!(cycles > 3 && cycles < 100, "{cycles} cycles in {} ticks", machine.ticks());
}

/// Two machines have their objects at other addresses. The collector's marks and what it has yet to follow
/// are state, too, and are looked at while it works: among classes, and in compilations.
#[test]
fn addresses_change_nothing() {
    let compiles = "(let ((form (cons 'list (loop for i below 300 collect (list 'quote (list i))))))
                      (spawn (loop (make-array 400)))
                      (loop (eval form)))";
    for text in [PROGRAMS[6], compiles] {
        let program = program::compile(&[Source::new("addresses", text)]).program.expect("it compiles");
        let machines: [_; 2] = std::array::from_fn(|_| {
            let host = VirtualHost::new();
            let mut machine = program::machine(Config::default(), Box::new(host)).expect("there is room");
            program::begin(&mut machine, &program).expect("it can start");
            machine
        });
        let [mut one, mut other] = machines;
        for _ in 0..400 {
            let outcome = one.run(253);
            assert_eq!(other.run(253), outcome, "{text}");
            assert_eq!(other.fingerprint(), one.fingerprint(), "after {} ticks of {text}", one.ticks());
            if outcome != RunOutcome::TicksUsed {
                break;
            }
        }
        assert!(one.heap_stats().cycles > 0, "{} cycles of {text}", one.heap_stats().cycles);
    }
}

/// Surveys, as the monitor and the metrics use them, change nothing in a run.
#[test]
fn looking_changes_nothing() {
    use esl::host::{Inspection, SurveyRequest};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    for text in PROGRAMS {
        let program = program::compile(&[Source::new("looks", text)]).program.expect("it compiles");
        let fly = |portion: u64, looks: bool| {
            let host = VirtualHost::new();
            let captured = host.captured();
            let mut machine = program::machine(Config::default(), Box::new(host)).expect("there is room");
            machine.gather_figures(false);
            machine.keep_journal();
            program::begin(&mut machine, &program).expect("it can start");
            let told = Arc::new(AtomicU64::new(0));
            loop {
                if looks {
                    let told = told.clone();
                    let request = SurveyRequest {
                        tasks: 3,
                        frames_of: Some(machine.ticks() % 5 + 1),
                        data: true,
                        failures_after: Some(0),
                        facts: Some((String::new(), 0)),
                        ..SurveyRequest::default()
                    };
                    let tell = move |_| _ = told.fetch_add(1, Ordering::Relaxed);
                    machine.inbox().inspect(Inspection::Survey(request, Box::new(tell)));
                }
                if machine.run(portion) != RunOutcome::TicksUsed {
                    break;
                }
            }
            let told = told.load(Ordering::Relaxed);
            ((machine.ticks(), machine.canary(), machine.fingerprint(), captured.output()), told)
        };
        let (alone, _) = fly(u64::MAX, false);
        let (seen, looks) = fly(501, true);
        assert_eq!(seen, alone, "{text}");
        assert!(looks > 3, "{looks} looks at {text}");
    }
}

/// Returns the observable state of a run between two portions.
fn present(machine: &Vm, captured: &Captured) -> (u64, u64, u128, String) {
    (machine.ticks(), machine.canary(), machine.fingerprint(), captured.output())
}

/// Runs a program in portions, and between them returns to states of before: with `returns`, to that of the
/// portion with this number, in turn. Checks that it goes on from there as it did the first time.
fn check_returns(text: &str, config: &Config, portion: u64, returns: &[usize]) {
    let program = program::compile(&[Source::new("portions", text)]).program.expect("it compiles");
    let host = VirtualHost::new();
    let captured = host.captured();
    let config = Config { snapshots: true, ..config.clone() };
    let mut machine = program::machine(config, Box::new(host)).expect("there is room for the library");
    program::begin(&mut machine, &program).expect("it can start");
    let (mut course, mut snapshots) = (Vec::new(), Vec::<Option<_>>::new());
    for _ in 0..12 {
        let before = present(&machine, &captured);
        // While the collector works there is none.
        let snapshot = machine.save(snapshots.iter().flatten().last());
        assert_eq!(present(&machine, &captured), before, "to save changes nothing: {text}");
        course.push(before);
        snapshots.push(snapshot);
        if machine.run(portion) != RunOutcome::TicksUsed {
            break;
        }
    }
    assert!(snapshots[0].is_some(), "{text}");
    let last = present(&machine, &captured);
    for &number in returns {
        let from = number % snapshots.len();
        let Some(snapshot) = &snapshots[from] else { continue };
        assert!(machine.restore(snapshot), "portion {from} of {text}");
        for then in &course[from..] {
            assert_eq!(present(&machine, &captured), *then, "portion {from} of {text}");
            _ = machine.run(portion);
        }
        assert_eq!(present(&machine, &captured), last, "portion {from} of {text}");
    }
}

/// Programs whose state lies in more than objects.
const KEPT: [&str; 3] = [
    // Facts, locks, timers and files.
    r#"(define-property power (device))
     (to-achieve (power device value) (t (assert (list 'power device value))))
     (dotimes (i 3)
       (let ((i i))
         (spawn (dotimes (j 9)
                  (with-recovery-procedures ((:property-lock-unavailable (abort)))
                    (with-maintained-property (power 'camera i) (sleep 0.01) (print (power 'camera))))
                  (assert (list 'seen i j "text" 1.5 (expt 3 (* 9 j))))
                  (retract (list 'seen i (- j 2) "text" 1.5 (expt 3 (* 9 (- j 2)))))
                  (with-open-file (notes "notes" :direction :output :if-exists :append
                                       :if-does-not-exist :create)
                    (print j notes))))))"#,
    // Symbols, packages and classes that are made on the way,
    // dynamic bindings, functions that are loaded late.
    r#"(defvar *depth* 0)
     (define-condition odd (error) ((n)))
     (dotimes (i 3)
       (let ((i i))
         (spawn (dotimes (j 20)
                  (let ((*depth* (+ *depth* j)))
                    (setf (symbol-value (intern (format nil "N~a-~a" i j))) *depth*)
                    (princ (sort (loop for k below (mod j 5) collect (list k (gensym))) #'> :key #'first))
                    (princ (handler-case (error 'odd :n j) (odd (c) (type-of c)))))))))"#,
    // Large objects, some of which grow and go, and collections.
    r#"(dotimes (i 2)
       (let ((i i) (table (make-hash-table)) (kept (list nil nil nil)))
         (spawn (dotimes (j 400)
                  (setf (nth (mod j 3) kept) (make-array (* 50 j) :initial-element j))
                  (setf (gethash (mod (* j 7919) 1000) table) (make-string 40))
                  (princ (+ i (length (car kept))))))))"#,
];

#[test]
fn a_machine_returns_to_any_state_and_goes_on_as_before() {
    for text in KEPT.iter().chain(&PROGRAMS) {
        for portion in [700, 2001, 25_000] {
            check_returns(text, &Config::default(), portion, &[3, 0, 7, 2, 11, 0]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn returns_change_nothing(
        program in 0..PROGRAMS.len() + KEPT.len(),
        seed in 0_u64..20,
        slice in prop_oneof![Just(1_u32), 2..50_u32, Just(2000)],
        portion in 1_u64..20_000,
        returns in prop::collection::vec(0_usize..12, 1..5),
    ) {
        let text = PROGRAMS.iter().chain(&KEPT).nth(program).expect("it is one of them");
        check_returns(text, &Config { seed, slice, ..Config::default() }, portion, &returns);
    }

    #[test]
    fn portions_change_nothing(
        program in 0..PROGRAMS.len(),
        seed in 0_u64..20,
        slice in prop_oneof![Just(1_u32), 2..50_u32, Just(2000)],
        budget in prop_oneof![Just(None), (1000_u64..60_000).prop_map(Some)],
        portions in prop::collection::vec(1_u64..3000, 1..12),
    ) {
        check(PROGRAMS[program], &Config { seed, slice, budget, ..Config::default() }, &portions);
    }
}

/// The journal has the calls of the failure of a task that belongs to a form, and the arguments of one that
/// a recovery procedure applies to at once.
#[test]
fn the_journal_has_calls_and_arguments() {
    use esl::host::SurveyRequest;
    let text = "(defun inner () (fail :stuck 'drill 5))
(with-recovery-procedures ((:stuck (abort 'net)))
  (task-net (one (list (inner))) (two (sleep 9))))
(with-recovery-procedures (((:lost place) (abort place)))
  (fail :lost 'dock))";
    let program = program::compile(&[Source::new("journal.esl", text)]).program.expect("it compiles");
    let mut machine =
        program::machine(Config::default(), Box::new(VirtualHost::new())).expect("there is room");
    machine.keep_journal();
    program::begin(&mut machine, &program).expect("it can start");
    machine.run(u64::MAX);
    let survey = machine.survey(&SurveyRequest { failures_after: Some(0), ..SurveyRequest::default() });
    let rows = survey.failures;
    let stuck = rows.iter().find(|row| row.cause == ":STUCK" && row.report.is_some()).expect("it has ended");
    let own = stuck.frames.iter().filter(|frame| !frame.is_of_library);
    let functions: Vec<&str> = own.map(|frame| &*frame.function).collect();
    assert_eq!(functions, ["INNER", "(TASK ONE)"], "{rows:?}");
    assert_eq!(stuck.arguments, "DRILL, 5");
    let lost = rows.iter().find(|row| row.cause == ":LOST").expect("it is noted");
    assert_eq!(lost.arguments, "DOCK");
}
