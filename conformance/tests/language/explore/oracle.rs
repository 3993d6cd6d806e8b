//! Generated programs end at the default grain, with points left out, as they do with switches at all ticks
//! and nothing left out. A reduction of the exploration that loses an ending fails here.
//!
//! Where the default grain of a program is `ticks`, both are one search: then runs of the machine's own
//! scheduler are compared with it, as they are for all programs. A program with too many states loses an
//! action until it has few enough.
//!
//! `ESL_ORACLE=10000` tries so many programs, from the number `ESL_ORACLE_FROM` on, in `ESL_ORACLE_JOBS`
//! threads; by default there are few.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Ended, Program};
use esl_testing::explore::{
    Behaviour, Exploration, ExploredEnding, Grain, Settings, TimerGrain, explore, grains,
};
use esl_vm::run::RunOutcome;

use super::compile;
use super::generated::{self, GeneratedProgram};

/// Programs that are tried unless the variable says how many.
const PROGRAMS: u64 = 40;

/// Most states of a program at grain `ticks`.
const STATES: usize = 1_000;

/// Most states of a program at the default grain. One with more has too many at grain `ticks`, too.
const FEW_STATES: usize = 400;

/// Slices and seeds of the runs by the machine's own scheduler.
const RUNS: [(u32, u64); 6] = [(1, 0), (2, 0), (3, 0), (7, 0), (1, 1), (2, 2)];

/// The way in which a program ends, and its output.
type End = (String, String);

/// Returns the ways in which a program ends.
pub(super) fn ends(endings: &[ExploredEnding<Behaviour>]) -> BTreeSet<End> {
    endings.iter().map(|ending| end(&ending.what.ended, &ending.what.output)).collect()
}

fn end(ended: &Ended, output: &str) -> End {
    (format!("{ended:?}"), output.split_whitespace().collect::<Vec<_>>().join(" "))
}

pub(super) fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |count| count.parse().expect("a number"))
}

/// The figures of the comparison.
#[derive(Debug, Default)]
struct Figures {
    /// Programs whose endings at the default grain were compared with those at grain `ticks`.
    compared: u64,
    /// Programs whose default grain is `ticks`: compared with runs of the machine only.
    at_ticks: u64,
    /// Programs that have lost actions.
    shortened: u64,
    /// Programs with too many states that have no action to lose.
    too_large: u64,
    /// States at the default grain, without and with points left out, and at grain `ticks`.
    unreduced: usize,
    reduced: usize,
    all: usize,
    /// Seconds of the searches at the default grain with points left out, and at grain `ticks`.
    seconds: f64,
    seconds_of_all: f64,
    /// The programs of which an ending was lost.
    lost: Vec<String>,
}

/// Returns the end of a run by the machine's own scheduler; `None` if it goes on for too long.
fn run(program: &Program, (slice, seed): (u32, u64)) -> Option<End> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine =
        program::machine(Config { slice, seed, ..Config::default() }, Box::new(host)).expect("there is room");
    let main = program::begin(&mut machine, program).expect("it begins");
    let outcome = machine.run(2_000_000);
    if outcome == RunOutcome::TicksUsed {
        return None;
    }
    let ended = program::end(&mut machine, main, outcome);
    Some(end(&ended, &captured.output()))
}

/// Explores a program with as few actions as are needed for at most so many states at grain `ticks`.
fn explore_all(
    program: &mut GeneratedProgram,
    settings: Settings,
) -> Option<(String, Program, Exploration<Behaviour>)> {
    loop {
        let text = program.text();
        let compiled = compile(&text);
        let few = Settings { grain: Grain::Variables, states: FEW_STATES, reduce: true, ..settings };
        if explore(&compiled, &few).expect("it can start").limit.is_none() {
            let all = explore(&compiled, &settings).expect("it can start");
            if all.limit.is_none() {
                return Some((text, compiled, all));
            }
        }
        if !program.shorten() {
            return None;
        }
    }
}

fn compare(number: u64, figures: &Mutex<Figures>) {
    let mut program = generated::program(number);
    let actions = program.actions();
    let timers = if program.has_timers { TimerGrain::Any } else { TimerGrain::Idle };
    let most = Settings { states: STATES, timers, reduce: false, ..Settings::default() };
    let started = Instant::now();
    let found = explore_all(&mut program, Settings { grain: Grain::Ticks, ..most });
    let seconds_of_all = started.elapsed().as_secs_f64();
    let Some((text, compiled, all)) = found else {
        figures.lock().expect("no thread panics").too_large += 1;
        return;
    };
    let known = ends(&all.endings);
    let mut lost = Vec::new();
    // A run draws other numbers with another seed, and does not check what always has to hold.
    let (is_random, checks) = (text.contains("random"), text.contains("(always"));
    for how in RUNS.into_iter().filter(|(_, seed)| !checks && (!is_random || *seed == 0)) {
        let Some(end) = run(&compiled, how) else { continue };
        if !known.contains(&end) && end.0 != "BudgetSpent" {
            lost.push(format!("a run with slice and seed {how:?} ends as {end:?}"));
        }
    }
    let grain = *grains(&compiled, None).last().expect("there is a grain");
    let (mut reduced, mut unreduced, mut seconds) = (0, 0, 0.0);
    for reduce in [true, false].into_iter().filter(|_| grain != Grain::Ticks) {
        let started = Instant::now();
        let found = explore(&compiled, &Settings { grain, reduce, states: 20 * STATES, ..most });
        let found = found.expect("it can start");
        if reduce {
            (reduced, seconds) = (found.states, started.elapsed().as_secs_f64());
        } else {
            unreduced = found.states;
        }
        let verdict =
            |found: &Exploration<Behaviour>| (found.limit, found.endless.is_some(), ends(&found.endings));
        if verdict(&found) != verdict(&all) {
            let [some, more] = [&found, &all].map(verdict);
            lost.push(format!("reduced {reduce}:\n{some:?}\nat ticks:\n{more:?}"));
        }
        if reduce && !follows(&compiled, &Settings { grain, ..most }, &found) {
            lost.push("the choices of an ending lead elsewhere".into());
        }
    }
    let figures = &mut *figures.lock().expect("no thread panics");
    if grain == Grain::Ticks {
        figures.at_ticks += 1;
    } else {
        figures.compared += 1;
        figures.all += all.states;
        figures.seconds_of_all += seconds_of_all;
    }
    figures.shortened += u64::from(program.actions() < actions);
    figures.reduced += reduced;
    figures.unreduced += unreduced;
    figures.seconds += seconds;
    figures.lost.extend(lost.into_iter().map(|how| format!("program {number}, {timers:?}: {how}\n{text}")));
}

/// Returns whether the choices of the endings of a search lead to them again.
fn follows(program: &Program, settings: &Settings, found: &Exploration<Behaviour>) -> bool {
    found.endings.iter().take(3).all(|ending| {
        let again = esl_testing::explore::follow(program, settings, &ending.choices).expect("it can start");
        again == ending.what
    })
}

#[test]
fn programs_end_at_the_default_grain_as_with_switches_at_all_ticks() {
    let (from, count) = (variable("ESL_ORACLE_FROM", 0), variable("ESL_ORACLE", PROGRAMS));
    let (next, figures) = (AtomicU64::new(from), Mutex::new(Figures::default()));
    let started = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..variable("ESL_ORACLE_JOBS", 1) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= from + count {
                        break;
                    }
                    compare(number, &figures);
                    if (number + 1).is_multiple_of(500) {
                        tell(&format!("{number}: {:?}", figures.lock().expect("no thread panics")));
                    }
                }
            });
        }
    });
    let figures = figures.into_inner().expect("no thread panics");
    tell(&format!("{} s, {figures:?}", started.elapsed().as_secs()));
    assert!(figures.lost.is_empty(), "{} lost:\n{}", figures.lost.len(), figures.lost[..1].join("\n"));
    assert!(figures.compared + figures.at_ticks + figures.too_large == count, "{figures:?}");
    assert!(figures.reduced <= figures.unreduced && figures.unreduced < figures.all, "{figures:?}");
}

#[allow(clippy::print_stdout, reason = "a run by hand prints its figures")]
fn tell(line: &str) {
    println!("{line}");
}
