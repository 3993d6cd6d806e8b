//! The schedules under which tests fail, to be told step by step.

use esl::Error;
use esl::program::{self, Program};
use esl_host::VirtualHost;
use esl_vm::explore::{Livelock, ScheduleStep, Settings};

use crate::explore::shortest_by;
use crate::{Setup, Test, Verdict, begin, verdict};

/// A schedule under which a test fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FailingSchedule {
    /// Settings of the exploration that has found it.
    pub settings: Settings,
    /// Choices at its points.
    pub choices: Vec<u32>,
    /// Whether the test comes to an end.
    pub ends: bool,
    /// Number of switches at its end that can be repeated for ever.
    pub repeated: usize,
}

impl FailingSchedule {
    /// Returns the schedule of an ending.
    pub(crate) fn of_ending(settings: &Settings, choices: &[u32]) -> Box<FailingSchedule> {
        Box::new(FailingSchedule { settings: *settings, choices: choices.into(), ends: true, repeated: 0 })
    }

    /// Returns a schedule that leads to where the test never ends.
    pub(crate) fn of_endless(settings: &Settings, choices: &[u32]) -> Box<FailingSchedule> {
        Box::new(FailingSchedule { ends: false, ..*FailingSchedule::of_ending(settings, choices) })
    }

    /// Returns a schedule that goes on for ever.
    pub(crate) fn of_livelock(settings: &Settings, livelock: &Livelock) -> Box<FailingSchedule> {
        let lap = &livelock.choices[livelock.lap..];
        let repeated = lap.iter().filter(|&&choice| choice > 0).count();
        Box::new(FailingSchedule { repeated, ..*FailingSchedule::of_endless(settings, &livelock.choices) })
    }

    /// Returns the steps of the schedule, without switches that make no difference. `program` is the program
    /// of the test, with points where places are used, if it can be had: with them the steps say where.
    ///
    /// # Errors
    /// As [`crate::run_test`].
    pub fn steps(&self, program: &Program, test: &Test, setup: &Setup) -> Result<Vec<ScheduleStep>, Error> {
        let choices = match self.ends {
            true => shortest_by(&self.choices, &mut |choices| follow(program, test, setup, self, choices))?,
            false => self.choices.clone(),
        };
        let (mut machine, _) = begin(program, test, 0, setup, Box::new(VirtualHost::new()))?;
        let mut steps = Vec::new();
        let mut told = |step| steps.push(step);
        match self.ends {
            true => _ = machine.follow_and_tell(&self.settings, &choices, &mut told),
            false => machine.follow_to(&self.settings, &choices, &mut told),
        }
        Ok(steps)
    }
}

/// Runs a test along choices, and returns what becomes of it.
fn follow(
    program: &Program,
    test: &Test,
    setup: &Setup,
    schedule: &FailingSchedule,
    choices: &[u32],
) -> Result<Verdict, Error> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let (mut machine, main) = begin(program, test, 0, setup, Box::new(host))?;
    let outcome = machine.follow(&schedule.settings, choices);
    let ended = program::end(&mut machine, main, outcome);
    Ok(verdict(ended, || captured.output() + &captured.error()))
}
