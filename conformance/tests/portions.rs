//! The ticks of a run may come in any portions: the schedule is the same, to the tick.

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_vm::run::RunOutcome;
use proptest::prelude::*;

/// Programs in which the end of a slice can be seen: by the order of output, by counts of ticks, by limits,
/// by collections, by critical sections, by cleanups.
const PROGRAMS: [&str; 7] = [
    // Round-robin.
    "(dolist (name '(1 2 3)) (let ((name name)) (spawn (dotimes (i 40) (dotimes (j 40) (car '(1))) (princ name)))))",
    // What tasks can learn of their own ticks.
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

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
