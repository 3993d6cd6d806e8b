//! Runs of conformance programs in real time, interrupted somewhere, are recorded and replayed: the replay is
//! the same run to the tick, by all checks and by the end.
//!
//! Programs sleep in real time here, a million times faster.

use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use esl::Config;
use esl::host::{Incoming, ProcessSignal, RealHost, RecordingHost, ReplayHost, Rights};
use esl::program::{self, Program, Source, compile};
use esl_conformance::{Expectations, programs};
use esl_replay::{Recorded, Replayed, Rerun, RunSetup, record};
use esl_vm::run::RunOutcome;
use esl_vm::vm::Vm;

/// A file that is removed when the test is over.
struct Removed(PathBuf);

impl Drop for Removed {
    fn drop(&mut self) {
        // One that is not there need not be removed.
        drop(std::fs::remove_file(&self.0));
    }
}

/// Returns the programs that compile and read no typed input, since there is none.
fn silent_programs() -> impl Iterator<Item = (PathBuf, Program)> {
    programs::paths("").into_iter().filter_map(|path| {
        let text = std::fs::read_to_string(&path).expect("a program can be read");
        let expected = Expectations::parse(&text).expect("it is right");
        if !expected.errors.is_empty() || text.contains("standard-input") || text.contains("(read") {
            return None;
        }
        let program = compile(&[Source::new(path.display().to_string(), text)]).program?;
        Some((path, program))
    })
}

#[test]
fn programs_take_the_same_course_when_they_are_replayed() {
    let file = std::env::temp_dir().join(format!("esl-conformance-{}.eslj", std::process::id()));
    let file = Removed(file);
    let (mut run, mut checks, mut interrupted) = (0, 0, 0);
    for (index, (path, program)) in silent_programs().enumerate() {
        // These programs sleep for hours, hence the speed; their endless loops must end soon, hence the
        // budget.
        let config =
            Config { budget: Some(1_000_000), memory: 64 << 20, seed: index as u64, ..Config::DEFAULT };
        let setup = RunSetup { config, ..RunSetup::default() };
        let host = RealHost::new(Vec::new()).with_speed(1e6).with_rights(Rights::none());
        let host = host.with_screen(Box::new(|_| Ok(())));
        let outcome = record(&program, &setup, host, &file.0, |machine| {
            if index % 3 == 0 {
                let inbox = machine.inbox();
                // When it comes is all the same: it is in the recording, wherever that is.
                thread::spawn(move || {
                    thread::sleep(Duration::from_micros((index as u64 * 37) % 5000));
                    inbox.put(Incoming::Signal(ProcessSignal::Interrupt));
                });
            }
        });
        let Ok(summary) = outcome else { continue };
        let bytes = std::fs::read(&file.0).expect("the file is there");
        let recorded = Recorded::read(&bytes).expect("it is whole");
        let mut rerun = Rerun::begin(&recorded, |_, _| ()).expect("it can be begun");
        let replayed = rerun.run(u64::MAX).expect("it ends");
        assert!(matches!(replayed, Replayed::Equal(_)), "{}: {replayed:?}", path.display());
        assert_eq!(rerun.check().ticks, summary.ticks, "{}", path.display());
        run += 1;
        checks += u64::from(recorded.last_check().is_some());
        interrupted += u64::from(matches!(summary.ended, esl::program::Ended::Signalled(_)));
    }
    assert!(run > 300 && checks > 0, "{run} programs, {checks} with checks, {interrupted} interrupted");
}

/// Seeds of the runs whose states are compared; `ESL_SEEDS` sets another number of them, for longer runs by
/// hand.
fn seeds() -> u64 {
    std::env::var("ESL_SEEDS").ok().and_then(|count| count.parse().ok()).unwrap_or(1)
}

/// Ticks after which a run is looked at for the first time; then after twice as many, and so on.
const FIRST_LOOK: u64 = 300;

/// Runs a program, and returns what can be told of its state, the strict fingerprint included, at places that
/// the ticks determine, and in the end. At one of the places, `arrive` is called.
fn states(program: &Program, machine: &mut Vm, mut arrive: impl FnMut(&Vm, usize)) -> Vec<(u64, u64, u128)> {
    program::begin(machine, program).expect("it can start");
    let mut states = Vec::new();
    let mut portion = FIRST_LOOK;
    loop {
        let outcome = machine.run(portion);
        states.push((machine.ticks(), machine.canary(), machine.fingerprint()));
        if outcome != RunOutcome::TicksUsed {
            machine.end_run();
            states.push((machine.ticks(), machine.canary(), machine.fingerprint()));
            return states;
        }
        arrive(machine, states.len());
        portion *= 2;
    }
}

/// Not only the course of a replay is that of the run: all of its state is, wherever one looks.
#[test]
fn all_state_is_the_same_when_a_run_is_replayed() {
    let (mut run, mut looks) = (0, 0);
    for (index, (path, program)) in silent_programs().enumerate() {
        // A part of the programs for each seed, unless there are many.
        let seeds: Vec<u64> = match seeds() {
            1 if index % 4 != 0 => continue,
            1 => vec![index as u64],
            count => (0..count).collect(),
        };
        for seed in seeds {
            let config = Config { budget: Some(300_000), memory: 64 << 20, seed, ..Config::DEFAULT };
            let host = RealHost::new(Vec::new()).with_speed(1e6).with_rights(Rights::none());
            let host = RecordingHost::new(host.with_screen(Box::new(|_| Ok(()))));
            let recording = host.recording();
            let mut machine = program::machine(config.clone(), Box::new(host)).expect("there is room");
            let interrupted = (seed + index as u64) as usize % 9;
            let seen = states(&program, &mut machine, |machine, look| {
                if look == interrupted {
                    machine.inbox().put(Incoming::Signal(ProcessSignal::Interrupt));
                }
            });
            let host = ReplayHost::new(recording.to_records());
            let mut again = program::machine(config, Box::new(host.clone())).expect("there is room");
            assert_eq!(states(&program, &mut again, |_, _| ()), seen, "{} with seed {seed}", path.display());
            assert!(!host.has_diverged(), "{} with seed {seed}", path.display());
            run += 1;
            looks += seen.len();
        }
    }
    assert!(run > 100 && looks > 3 * run, "{run} runs, {looks} looks");
}
