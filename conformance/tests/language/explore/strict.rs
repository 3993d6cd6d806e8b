//! Programs with points before the uses of shared places: they run as without, and a strict exploration finds
//! the updates that only the lack of a call keeps whole.

use esl::module_path::ModulePath;
use esl::program::{self, Ended, Program, Source};
use esl_testing::explore::{ScheduleEvent, Settings, Switch, explore, follow, grains, tell_steps};

use super::{compile, corpus, ways};

fn compile_with_points(text: &str) -> Program {
    let compiled = program::compile_with_points(&[Source::new("explored.esl", text)], &ModulePath::none());
    compiled.program.expect("the program compiles")
}

/// Returns the choices of a schedule that ends badly, if the default grain has one.
fn bad_schedule(text: &str, strict: bool) -> Option<(Settings, Vec<u32>)> {
    let program = if strict { compile_with_points(text) } else { compile(text) };
    grains(&compile(text), None).into_iter().find_map(|grain| {
        let settings = Settings { grain, strict, output: false, ..Settings::default() };
        let found = explore(&program, &settings).expect("the program can start");
        assert_eq!(found.limit, None, "{text}");
        let bad = found.endings.into_iter().find(|ending| ending.what.ended != Ended::Normally(0));
        bad.map(|ending| (settings, ending.choices))
    })
}

/// Updates of a place, each with a form for the place, that no tick divides.
const UPDATES: &[(&str, &str, &str)] = &[
    ("(defvar *n* 0)", "(setq *n* (+ *n* 1))", "*n*"),
    ("(defvar *n* (list 0))", "(setf (car *n*) (+ (car *n*) 1))", "(car *n*)"),
    ("(defvar *n* (vector 0))", "(setf (svref *n* 0) (+ (svref *n* 0) 1))", "(svref *n* 0)"),
    ("(defstruct tank (level 0)) (defvar *n* (make-tank))", "(incf (tank-level *n*))", "(tank-level *n*)"),
];

#[test]
fn an_update_that_no_tick_divides_is_fragile() {
    for (setup, update, place) in UPDATES {
        let text = |update: &str| {
            format!("{setup} (task-net (one {update}) (two {update})) (unless (= {place} 2) (exit 9))")
        };
        let fragile = text(update);
        assert_eq!(bad_schedule(&fragile, false).map(|(_, choices)| choices), None, "{fragile}");
        let (settings, choices) = bad_schedule(&fragile, true).unwrap_or_else(|| panic!("{fragile}"));
        let again = follow(&compile_with_points(&fragile), &settings, &choices).expect("it can start");
        assert_eq!(again.ended, Ended::Normally(9), "{fragile}");
        let safe = text(&format!("(without-interrupts {update})"));
        assert_eq!(bad_schedule(&safe, true).map(|(_, choices)| choices), None, "{safe}");
    }
    let text =
        "(let ((n 0)) (task-net (one (setq n (+ n 1))) (two (setq n (+ n 1)))) (unless (= n 2) (exit 9)))";
    assert!(bad_schedule(text, false).is_none() && bad_schedule(text, true).is_some());
}

#[test]
fn points_change_nothing_unless_the_exploration_is_strict() {
    for (file, text) in corpus::programs(".esl") {
        let settings = Settings { output: false, states: 3000, ..Settings::default() };
        let explored = |program: &Program| explore(program, &settings).expect("it can start");
        let (plain, marked) = (explored(&compile(&text)), explored(&compile_with_points(&text)));
        assert_eq!(plain.states, marked.states, "{}", file.display());
        let endings = |found| -> Vec<_> {
            ways(found)
                .into_iter()
                .map(|(what, choices, runs)| (what.ended, choices.to_vec(), runs))
                .collect()
        };
        assert_eq!(endings(&plain), endings(&marked), "{}", file.display());
    }
}

#[test]
fn points_tell_of_the_uses_of_objects() {
    let text = "(defun inc (n) (+ n 1)) (defstruct tank (level 0)) (defvar *tank* (make-tank))
         (defun bump () (setf (tank-level *tank*) (inc (tank-level *tank*))))
         (task-net (one (inc 0) (bump)) (two (inc 0) (bump))) (unless (= (tank-level *tank*) 2) (exit 9))";
    let (settings, choices) = bad_schedule(text, false).expect("an update is lost");
    let mut told = Vec::new();
    let program = compile_with_points(text);
    tell_steps(&program, &settings, &choices, true, &|_| Ok(()), &mut |step| told.push(step.event))
        .expect("it can start");
    let uses = told.iter().filter_map(|event| match event {
        ScheduleEvent::Use { task, target, value, is_set, place } => {
            let place =
                place.as_ref().map_or("?", |place| place.rsplit_once(':').map_or("", |(line, _)| line));
            Some(format!("{task} {target} {value} {is_set} {place}"))
        }
        _ => None,
    });
    let uses: Vec<String> = uses.filter(|text| text.contains("LEVEL of TANK")).collect();
    let use_of = |task: &str, value: u32, is_set: bool| {
        uses.iter()
            .filter(|text| **text == format!("task {task} LEVEL of TANK 1 {value} {is_set} explored.esl:2"))
            .count()
    };
    assert_eq!((use_of("ONE", 0, false), use_of("TWO", 0, false)), (1, 1), "{uses:#?}");
    assert_eq!((use_of("ONE", 1, true), use_of("TWO", 1, true)), (1, 1), "{uses:#?}");
    assert!(told.iter().any(|event| matches!(event, ScheduleEvent::Switch(Switch::Preemption { .. }))));
}
