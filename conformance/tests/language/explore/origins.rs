//! Reports tell the place at which a failure began. States do not differ by it.

use esl_testing::explore::{Grain, Settings, explore, explore_together};

use super::{check, compile};

/// Ways of failing that differ in the place only, after a read of the flag `*is-late*`.
const PLACES: [&str; 2] =
    ["(if *is-late* (list (fail :stuck)) (vector (fail :stuck)))", "(progn *is-late* (list (fail :stuck)))"];

/// Forms around a net whose task fails; all have points after the failure.
const FORMS: [&str; 4] = [
    "(with-recovery-procedures ((:stuck (others {n}) (abort (princ 'recovered)))) {net})",
    "(handler-case (handler-bind ((failure (lambda (failure) (others {n})))) {net})
       (failure () (princ 'recovered)))",
    "(with-recovery-procedures ((:stuck (abort (princ 'recovered))))
       (with-cleanup-procedure (others {n}) {net}))",
    "(with-recovery-procedures ((:all-failed (others {n}) (abort (princ 'recovered))))
       (or-parallel (only {net})))",
];

fn programs(form: &str, rounds: u32) -> [String; 2] {
    PLACES.map(|place| {
        let net = format!("(task-net (one {place}) (two (setq *is-late* t)))");
        let others = "(defun others (n) (dotimes (i n) (task-net (a (incf *n*)) (b (incf *n*)))))";
        format!(
            "(defvar *is-late* nil) (defvar *n* 0) {others} {}",
            form.replace("{net}", &net).replace("{n}", &rounds.to_string())
        )
    })
}

/// The two ways differ in the states of the failing task; after its end, a further round of
/// other tasks has as many states in both.
#[test]
fn states_do_not_differ_by_the_origin_of_a_failure() {
    for form in FORMS {
        let further = |rounds| {
            let [two, one] =
                programs(form, rounds).map(|text| check(&text, Grain::Variables, &["RECOVERED"]).states);
            two - one
        };
        assert_eq!(further(1), further(2), "{form}");
    }
}

#[test]
fn several_threads_find_the_states_that_one_does() {
    for form in FORMS {
        let program = compile(&programs(form, 1)[0]);
        let settings = Settings { grain: Grain::Variables, ..Settings::default() };
        let alone = explore(&program, &settings).expect("it runs");
        for jobs in [1, 2, 2, 3, 4] {
            let found = explore_together(&program, &settings, jobs, &|_| Ok(()), |_| true).expect("it runs");
            assert_eq!((found.states, found.runs), (alone.states, alone.runs), "{jobs} threads: {form}");
        }
    }
}
