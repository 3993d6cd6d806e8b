//! Runs the programs about tasks and locks under many schedules: the promises of the language hold under
//! each.
//!
//! A failure message names the seed, the slice and the scheduler's choices, from which `Choices::given`
//! reproduces the run. To reproduce it by hand, the command
//!
//! ```text
//! ESL_SCHEDULE="NAME.esl 7 0,1,1,0" cargo test -p esl-conformance --features thorough --test language \
//!     schedules::a_given -- --nocapture
//! ```
//!
//! runs a program of `programs/tasks` with slices of at most seven ticks and these choices, and prints the
//! result.

#![allow(clippy::print_stdout, reason = "a test prints its result")]

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Program, Source};
use esl_conformance::{Expectations, programs};
use esl_vm::schedule::Choices;

/// Seeds for each slice; 0 is plain round-robin. `ESL_SEEDS` sets another number of them, for longer runs by
/// hand.
fn seeds() -> u64 {
    std::env::var("ESL_SEEDS").ok().and_then(|count| count.parse().ok()).unwrap_or(25)
}

const SLICES: [u32; 4] = [1, 7, 100, 2000];

/// The result of a run: the lines that it wrote, its status, and the choices that led there.
struct Run {
    lines: Vec<String>,
    status: u8,
    choices: Vec<u32>,
    errors: String,
    ticks: u64,
}

fn run(program: &Program, choices: Choices, slice: u32) -> Run {
    let host = VirtualHost::new();
    let captured = host.captured();
    let config = Config { slice, ..Config::default() };
    let mut machine = program::machine(config, Box::new(host)).expect("there is room for the library");
    machine.set_choices(choices.recorded());
    let report = program::run_in(&mut machine, program).expect("the program can start");
    let output = captured.output();
    let lines = output.lines().map(str::trim_end).filter(|line| !line.is_empty()).map(String::from);
    Run {
        lines: lines.collect(),
        status: report.ended.exit_status(),
        choices: machine.choices().made().to_vec(),
        errors: captured.error(),
        ticks: report.ticks,
    }
}

fn compile(name: &str, text: &str) -> Program {
    program::compile(&[Source::new(name, text)]).program.expect("the program compiles")
}

#[test]
fn programs_with_tasks_do_what_they_say_under_every_schedule() {
    check_programs("tasks");
}

#[test]
fn programs_with_locks_do_what_they_say_under_every_schedule() {
    check_programs("locks");
}

fn check_programs(folder: &str) {
    let mut failures = Vec::new();
    for path in programs::paths(folder) {
        let name = path.file_name().expect("a program has a name").to_string_lossy();
        let text = std::fs::read_to_string(&path).expect("the program can be read");
        if text.lines().any(|line| line.starts_with("; schedules: skip")) {
            continue;
        }
        let expected = Expectations::parse(&text).expect("its comments are well-formed");
        let program = compile(&name, &text);
        'schedules: for slice in SLICES {
            for seed in 0..seeds() {
                let run = run(&program, Choices::seeded(seed), slice);
                if run.lines != expected.output || run.status != expected.expected_status() {
                    failures.push(format!(
                        "{name}, seed {seed}, slice {slice}: status {}\nexpected {:?}\nfound    {:?}\n\
                         {}ESL_SCHEDULE=\"{name} {slice} {}\"",
                        run.status,
                        expected.output,
                        run.lines,
                        run.errors,
                        as_text(&run.choices)
                    ));
                    break 'schedules;
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

/// Formats choices as `ESL_SCHEDULE` takes them.
fn as_text(choices: &[u32]) -> String {
    choices.iter().map(u32::to_string).collect::<Vec<_>>().join(",")
}

#[test]
fn a_given_schedule_is_reproduced() {
    let Ok(given) = std::env::var("ESL_SCHEDULE") else { return };
    let words: Vec<&str> = given.split(' ').collect();
    let [name, slice, choices] = words[..] else {
        panic!("expected a name, a slice and choices, found {given}")
    };
    let text = std::fs::read_to_string(programs::folder().join("tasks").join(name))
        .expect("the program can be read");
    let choices: Vec<u32> = choices.split(',').map(|choice| choice.parse().expect("a number")).collect();
    let run = run(&compile(name, &text), Choices::given(&choices), slice.parse().expect("a number of ticks"));
    println!("status {}\n{}\n{}", run.status, run.lines.join("\n"), run.errors);
}

/// Runs four tasks, each of which writes its name a few times.
const RACE: &str = "(dolist (name '(a b c d))
                      (let ((name name))
                        (spawn (dotimes (i 5) (princ name) (sleep 0)))))";

#[test]
fn seeds_vary_the_schedule() {
    let program = compile("race", RACE);
    let mut outputs: Vec<Vec<String>> =
        (0..100).map(|seed| run(&program, Choices::seeded(seed), 100).lines).collect();
    outputs.sort();
    outputs.dedup();
    assert!(outputs.len() > 90, "only {} different runs", outputs.len());
}

#[test]
fn the_same_seed_gives_the_same_run_to_the_tick() {
    let program = compile("race", RACE);
    for seed in [0, 1, 77] {
        let runs = [(); 2].map(|()| run(&program, Choices::seeded(seed), 7));
        assert_eq!((&runs[0].lines, runs[0].ticks), (&runs[1].lines, runs[1].ticks));
    }
}

#[test]
fn a_schedule_can_be_given_as_a_list_of_choices() {
    let program = compile("race", RACE);
    let first = run(&program, Choices::seeded(3), 50);
    assert!(!first.choices.is_empty());
    let again = run(&program, Choices::given(&first.choices), 50);
    assert_eq!((again.lines, again.ticks, again.choices), (first.lines, first.ticks, first.choices));
    // Any list is legal: every choice that it leaves open is the first.
    let other = run(&program, Choices::given(&[3, 1, 4, 1, 5, 9, 2, 6]), 50);
    let mut letters: Vec<char> = other.lines.concat().chars().collect();
    letters.sort_unstable();
    assert_eq!(String::from_iter(letters), "aaaaabbbbbcccccddddd".to_uppercase());
}
