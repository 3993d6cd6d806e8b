//! Plans: programs that use the module `plans`, with their expectations beside the lines, in the form of
//! `conformance/README.md`. Each runs under the virtual clock with slices of the usual length, and with other
//! schedules.

use std::path::PathBuf;
use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::{Expectations, process};

use crate::{eslvm, listed, venv};

/// The ways in which a program runs.
const RUNS: [&[&str]; 3] = [&[], &["--slice", "7"], &["--seed", "5"]];

mod programs {
    test_files! { super::check, "plans/tests/programs", "esl":
        a_broken_plan_is_repaired_while_others_run =
            "a_broken_plan_is_repaired_while_others_run.esl",
        activities_are_dispatched_by_windows = "activities_are_dispatched_by_windows.esl",
        all_relations_bound_the_windows = "all_relations_bound_the_windows.esl",
        conditions_resources_and_locks_delay_a_start =
            "conditions_resources_and_locks_delay_a_start.esl",
        contradictions_name_their_constraints =
            "contradictions_name_their_constraints.esl",
        controllability_is_that_of_a_game = "controllability_is_that_of_a_game.esl",
        no_duration_breaks_a_controllable_plan =
            "no_duration_breaks_a_controllable_plan.esl",
        pictures_show_times_and_windows = "pictures_show_times_and_windows.esl",
        points_at_the_same_time_are_executed =
            "points_at_the_same_time_are_executed.esl",
        policies_choose_the_time_in_a_window = "policies_choose_the_time_in_a_window.esl",
        windows_are_those_of_bellman_ford = "windows_are_those_of_bellman_ford.esl",
    }
}

fn check(path: &str, text: &str) -> Result<(), String> {
    RUNS.iter().try_for_each(|run| {
        let options = [&["--clock", "virtual"], *run].concat();
        check_run(path, text, &options, &[]).map_err(|fault| format!("{run:?}: {fault}"))
    })
}

/// Runs a program with options and arguments, and compares with its expectations.
fn check_run(path: &str, text: &str, options: &[&str], arguments: &[&str]) -> Result<(), String> {
    let expected = Expectations::parse(text).map_err(|fault| fault.to_string())?;
    let path = esl_conformance::root().join(path);
    let mut command = eslvm(&["run"]);
    command.args(options).arg(&path).args(arguments);
    let found = process::run(&mut command, "");
    let lines: Vec<&str> = found.output.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let is_as_expected =
        lines == expected.output && found.status == Some(i32::from(expected.expected_status()));
    if is_as_expected {
        return Ok(());
    }
    Err(format!("status {:?}\n{}\n{}", found.status, lines.join("\n"), found.errors))
}

/// The pictures of the documents are those that the example draws.
#[test]
fn a_day_is_drawn_before_and_after_its_repair() {
    let folder = Folder::new("plans-pictures");
    let example = esl_conformance::root().join("examples/spacecraft");
    let names = ["day-before.svg", "day-after.svg"];
    let mut command = eslvm(&["run", "--clock", "virtual", "--allow-write"]);
    command.arg(example.join("day.esl")).args(names).current_dir(folder.path());
    let run = process::run(&mut command, "");
    assert_eq!(run.status, Some(0), "{}", run.errors);
    for name in names {
        let read = |path: PathBuf| std::fs::read_to_string(path).expect("it can be read");
        assert_eq!(read(folder.path().join(name)), read(example.join(name)), "{name}");
    }
}

/// The packages of Python that solve problems.
const PLANNERS: [&str; 3] = ["unified-planning==1.3.0", "up-aries==0.5.0", "up-tamer==1.1.6"];

/// Runs a program that uses a planner, by an engine. To start one takes Python more than a second.
fn check_with_planner(name: &str, engine: &str) {
    let Some(python) = venv::python("planners", &PLANNERS, "import unified_planning, up_aries, up_tamer")
    else {
        return;
    };
    let python = python.to_string_lossy();
    listed::run(&format!("plans/tests/planners/{name}.esl"), |path, text| {
        check_run(path, text, &["--allow-run"], &[engine, &python])
    });
}

#[test]
fn plans_of_planners_are_executed() {
    check_with_planner("match_cellar", "aries");
}

#[test]
fn a_broken_plan_is_made_anew_by_a_planner() {
    check_with_planner("replanned", "tamer");
}

/// Plans that engines have found for the test problems of unified-planning are executed.
#[test]
fn plans_of_test_problems_reach_their_goals() {
    let Some(python) = venv::python("planners", &PLANNERS, "import unified_planning, up_aries, up_tamer")
    else {
        return;
    };
    listed::run("plans/tests/planners/problems.esl", |path, text| {
        let expected = Expectations::parse(text).map_err(|fault| fault.to_string())?;
        let path = esl_conformance::root().join(path);
        let solved = process::run(Command::new(python).arg(path.with_extension("py")), "");
        let run = process::run(eslvm(&["run", "--clock", "virtual"]).arg(&path), &solved.output);
        let lines: Vec<&str> = run.output.lines().filter(|line| !line.is_empty()).collect();
        let found = format!("{}\n{}\n{}", run.output, run.errors, solved.errors);
        if run.status == Some(0) && lines == expected.output { Ok(()) } else { Err(found) }
    });
}

/// Explores a program, and compares the beginning of the verdict.
fn check_explored(name: &str, options: &[&str], verdict: &str) {
    let path = esl_conformance::root().join(format!("plans/tests/explored/{name}.esl"));
    let found = process::run(eslvm(&["explore"]).args(options).arg(path), "");
    assert!(found.output.contains(verdict), "{name}: {}{}", found.output, found.errors);
    assert_eq!(found.status, Some(7), "{name}: a search at this grain proves nothing");
}

#[test]
fn nothing_begins_twice_in_any_schedule_with_failures() {
    check_explored("failures", &["--grain", "changes"], "grain ticks does; no schedule so far ends badly");
}

#[test]
fn nothing_is_left_by_an_abort_in_any_schedule() {
    check_explored("aborts", &["--grain", "changes"], "grain ticks does; no schedule so far ends badly");
}

#[test]
fn nothing_is_left_in_random_schedules_of_three_activities_with_failures_and_aborts() {
    // All schedules at the grain `changes`, 49,326 states, take half a minute.
    check_explored("failures_and_aborts", &["--random", "40"], "no random schedule ends badly");
}

#[test]
fn nothing_is_left_in_random_schedules_with_failures_aborts_and_repairs() {
    check_explored("three_activities", &["--random", "60"], "no random schedule ends badly");
}

#[test]
fn the_day_of_the_spacecraft_is_repaired() {
    let day = esl_conformance::root().join("examples/spacecraft/day.esl");
    let found = process::run(eslvm(&["run", "--clock", "virtual"]).arg(day), "");
    assert_eq!(found.status, Some(0), "{}{}", found.output, found.errors);
    let is_repaired = found.output.contains("the dunes are dropped, because of burn ridge dunes");
    assert!(
        is_repaired && found.output.ends_with("course corrected, sent crater ridge\n"),
        "{}",
        found.output
    );
}
