//! Like tasks are exchanged: states become fewer, and endings stay the same.
//!
//! `ESL_ORACLE=1000` tries so many generated programs, from the number `ESL_ORACLE_FROM` on.

use esl_testing::explore::{Behaviour, Exploration, Grain, Settings, explore, grains};

use super::oracle::{ends, variable};
use super::{compile, corpus, generated, outputs};

/// Explores a program without and with symmetry, at its last grain.
fn both(text: &str, settings: Settings) -> [Exploration<Behaviour>; 2] {
    let program = compile(text);
    let grain = *grains(&program, None).last().expect("there is a grain");
    [false, true].map(|symmetry| {
        explore(&program, &Settings { grain, symmetry, ..settings }).expect("the program can start")
    })
}

#[test]
fn like_tasks_are_one_as_another() {
    let text = "(defvar *n* 0) (defun one-more (n) (+ n 1)) (defun bump () (setq *n* (one-more *n*)))
        (dotimes (i 3) (spawn (bump)))
        (sleep 1)
        (princ *n*)";
    let [plain, alike] = both(text, Settings::default());
    assert_eq!(
        (outputs(&plain), outputs(&alike)),
        (vec!["1".into(), "2".into(), "3".into()], outputs(&plain))
    );
    assert!(2 * alike.states < plain.states, "{} states, and {}", plain.states, alike.states);
}

/// The program sees which task is the older one: then its tasks are not alike.
#[test]
fn the_order_of_tasks_counts_if_it_is_seen() {
    let text = "(defvar *go* (make-event 'go))
        (defvar *done* nil)
        (dotimes (i 2) (spawn (wait-for-event *go*) (push (current-task) *done*) (wait-for-event *go*)))
        (sleep 1)
        (signal *go*)
        (sleep 1)
        (princ (position (first *done*) (list-tasks)))
        (exit 0)";
    let [plain, alike] = both(text, Settings::default());
    assert_eq!((ends(&plain.endings).len(), ends(&alike.endings)), (2, ends(&plain.endings)));
}

/// A number that a task is printed with depends on which tasks were made before.
#[test]
fn the_numbers_of_tasks_count_if_they_are_seen() {
    let text = "(defvar *kept* nil) (defvar *last* nil)
        (spawn (spawn (setq *last* 'helper)))
        (spawn (setq *kept* (spawn (sleep 1))) (setq *last* 'helper))
        (sleep 0.5)
        (princ *kept*)";
    let [plain, alike] = both(text, Settings { output: false, ..Settings::default() });
    assert_eq!((ends(&plain.endings).len(), ends(&alike.endings)), (2, ends(&plain.endings)));
}

#[test]
fn programs_of_the_corpus_end_the_same_with_symmetry() {
    for (file, text) in [".wrong.esl", ".right.esl"].into_iter().flat_map(corpus::programs) {
        let few = Settings { grain: Grain::Variables, states: 300, ..Settings::default() };
        let program = compile(&text);
        let plain = explore(&program, &few).expect("it can start");
        if plain.limit.is_some() {
            continue;
        }
        let alike = explore(&program, &Settings { symmetry: true, ..few }).expect("it can start");
        let verdict = |found: &Exploration<Behaviour>| {
            (ends(&found.endings), found.endless.is_some(), found.livelock.is_some(), found.limit)
        };
        assert_eq!(verdict(&alike), verdict(&plain), "{}", file.display());
        assert!(alike.states <= plain.states, "{}", file.display());
    }
}

#[test]
fn generated_programs_of_like_tasks_end_the_same_with_symmetry() {
    let (from, count) = (variable("ESL_ORACLE_FROM", 0), variable("ESL_ORACLE", 12));
    let (mut compared, mut figures) = (0, [0, 0]);
    for number in from..from + count {
        let text = generated::program(number).text_of_like_tasks(2 + number as usize % 2);
        let found = both(&text, Settings { states: 2_000, ..Settings::default() });
        if found[0].limit.is_some() {
            continue;
        }
        let [plain, alike] = &found;
        let verdict =
            |found: &Exploration<Behaviour>| (found.limit, found.endless.is_some(), ends(&found.endings));
        assert_eq!(verdict(alike), verdict(plain), "program {number}:\n{text}");
        compared += 1;
        figures = [figures[0] + plain.states, figures[1] + alike.states];
    }
    tell(&format!("{compared} of {count} compared, states without and with symmetry: {figures:?}"));
    assert!(compared > 0 && figures[1] < figures[0], "{compared} compared, {figures:?}");
}

#[allow(clippy::print_stdout, reason = "a run by hand prints its figures")]
fn tell(line: &str) {
    println!("{line}");
}
