//! Runs of conformance programs in real time, interrupted somewhere, are recorded and replayed: the replay is
//! the same run to the tick, by all checks and by the end.
//!
//! Programs sleep in real time here, a million times faster.

use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use esl::Config;
use esl::host::{Incoming, ProcessSignal, RealHost, Rights};
use esl::program::{Source, compile};
use esl::replay::{Recorded, Replayed, Rerun, RunSetup, record};
use esl_conformance::{Expectations, programs};

/// A file that is removed when the test is over.
struct Removed(PathBuf);

impl Drop for Removed {
    fn drop(&mut self) {
        // One that is not there need not be removed.
        drop(std::fs::remove_file(&self.0));
    }
}

#[test]
fn programs_take_the_same_course_when_they_are_replayed() {
    let file = std::env::temp_dir().join(format!("esl-conformance-{}.eslj", std::process::id()));
    let file = Removed(file);
    let (mut run, mut checks, mut interrupted) = (0, 0, 0);
    for (index, path) in programs::paths("").into_iter().enumerate() {
        let text = std::fs::read_to_string(&path).expect("a program can be read");
        let expected = Expectations::parse(&text).expect("it is right");
        // Nobody types anything to a test.
        if !expected.errors.is_empty() || text.contains("standard-input") || text.contains("(read") {
            continue;
        }
        let Some(program) = compile(&[Source::new(path.display().to_string(), text)]).program else {
            continue;
        };
        // What is slept in these programs is hours; what loops is to end soon.
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
