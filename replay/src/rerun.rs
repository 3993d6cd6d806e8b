//! A machine that runs a recorded run again.

use std::fmt;

use esl::Error;
use esl::program::{self, Ended, Program, Schedule};
use esl_host::{Host, HostFailure, Output, ReplayHost, RunCheck};
use esl_vm::embed::HostFunction;
use esl_vm::explore::FollowedRun;
use esl_vm::load::LoadError;
use esl_vm::run::RunOutcome;
use esl_vm::task::TaskId;
use esl_vm::vm::{Config, Vm};

use super::file::{Beginning, Recorded, RecordedError, is_own};
use super::kept::set_kept;

/// Why a recorded run cannot be run again.
#[derive(Debug)]
#[non_exhaustive]
pub enum RerunError {
    /// The recording is of no use to this machine.
    Recording(RecordedError),
    /// The program in it is refused.
    Program(LoadError),
    /// The machine cannot be made, or the program not begun.
    Machine(Error),
}

impl fmt::Display for RerunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RerunError::Recording(error) => error.fmt(f),
            RerunError::Program(error) => write!(f, "the program in it is refused: {error}"),
            RerunError::Machine(error) => write!(f, "it cannot be begun: {error}"),
        }
    }
}

impl std::error::Error for RerunError {}

/// Ticks after which the replay looks whether it has come to the last record.
const STRETCH: u64 = 100_000;

/// How a replay has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Replayed {
    /// As the recorded run has, with this exit status.
    Equal(u8),
    /// The recording ends here, before the run has: the recording process was killed.
    Cut,
    /// It was another run: what differs, in words.
    Diverged(String),
}

/// A recorded run that is being run again.
pub struct Rerun {
    pub(super) machine: Vm,
    pub(super) host: ReplayHost,
    recorded: Recorded,
    main: TaskId,
    /// The choices by which tasks take turns, if the run was one by a schedule.
    followed: Option<FollowedRun>,
    replayed: Option<Replayed>,
}

impl Rerun {
    /// Makes a machine that is about to run the program. Its output goes to `screen`.
    ///
    /// # Errors
    /// [`RerunError`].
    pub fn begin(
        recorded: &Recorded,
        screen: impl FnMut(Output, &[u8]) + Send + 'static,
    ) -> Result<Rerun, RerunError> {
        Rerun::begin_within(recorded, screen, |host| Box::new(host))
    }

    /// As [`Rerun::begin`], with a host that `wrap` makes around the one that replays. It must ask that for
    /// no more than the program asks for.
    ///
    /// # Errors
    /// [`RerunError`].
    pub fn begin_within(
        recorded: &Recorded,
        screen: impl FnMut(Output, &[u8]) + Send + 'static,
        wrap: impl FnOnce(ReplayHost) -> Box<dyn Host + Send>,
    ) -> Result<Rerun, RerunError> {
        let beginning = &recorded.beginning;
        if !is_own(&beginning.identity) {
            return Err(RerunError::Recording(RecordedError::OtherMachine));
        }
        let program = Program::from_bytes(&beginning.program).map_err(RerunError::Program)?;
        let host = match &recorded.start {
            None => ReplayHost::new(recorded.records.clone()),
            Some(_) => ReplayHost::preparing(recorded.records.clone()),
        };
        let host = host.with_screen(screen);
        let begun = match &recorded.start {
            None => begin_recorded(&recorded.beginning, &program, wrap(host.clone())),
            Some(start) => {
                let snapshot = start.snapshot.as_ref();
                let snapshot = snapshot.ok_or(RerunError::Recording(RecordedError::NoSnapshot))?;
                let machine = prepare_recorded(&recorded.beginning, Some(snapshot.range), wrap(host.clone()));
                let mut machine = machine.map_err(RerunError::Machine)?;
                let is_loaded = machine.load_state(&snapshot.state);
                let main = machine.main_task().filter(|_| is_loaded);
                let main = main.ok_or(RerunError::Recording(RecordedError::NoSnapshot))?;
                host.start(start.generation.not_due, start.generation.time());
                Ok((machine, main))
            }
        };
        // A world that has diverged has made the preparations fail.
        let (mut machine, main) = begun.map_err(|error| match host.divergence() {
            Some(_) => RerunError::Recording(RecordedError::Damaged {
                offset: 0,
                problem: "the records do not fit the beginning of the run",
            }),
            None => RerunError::Machine(error),
        })?;
        let followed = match &beginning.schedule {
            Some(text) => {
                let schedule = Schedule::parse(text).map_err(|_| {
                    let problem = "the schedule in it cannot be read";
                    RerunError::Recording(RecordedError::Damaged { offset: 0, problem })
                })?;
                Some(machine.begin_to_follow(&schedule.settings(), schedule.choices().to_vec()))
            }
            None => None,
        };
        Ok(Rerun { machine, host, recorded: recorded.clone(), main, followed, replayed: None })
    }

    /// Runs on for at most `ticks`. Returns how the replay has ended, once it has.
    pub fn run(&mut self, ticks: u64) -> Option<&Replayed> {
        if self.replayed.is_none() {
            let outcome = self.go_on(ticks);
            if outcome != RunOutcome::TicksUsed || self.host.has_diverged() {
                let replayed = self.end(outcome);
                self.replayed = Some(replayed);
            }
        }
        self.replayed.as_ref()
    }

    fn go_on(&mut self, ticks: u64) -> RunOutcome {
        match &mut self.followed {
            Some(followed) => self.machine.go_on_following(followed, ticks),
            None => self.machine.run(ticks),
        }
    }

    /// Runs to the last record, and less than a second beyond it. The tasks stay as they are there if the
    /// recording does not have the end of the run. Returns how the replay has ended.
    pub fn run_to_last_record(&mut self) -> Replayed {
        loop {
            if let Some(replayed) = &self.replayed {
                return replayed.clone();
            }
            let outcome = self.go_on(STRETCH);
            let is_over = outcome != RunOutcome::TicksUsed || self.host.has_diverged();
            let is_equal = self.host.is_at_end() && self.host.divergence().is_none();
            if self.recorded.end.is_none() && is_equal {
                self.replayed = Some(Replayed::Cut);
            } else if is_over {
                // The last record may belong to the cleanups of a run that was over.
                let replayed = self.end(outcome);
                self.replayed = Some(replayed);
            }
        }
    }

    /// Returns how the replay has ended, if it has.
    pub fn replayed(&self) -> Option<&Replayed> {
        self.replayed.as_ref()
    }

    /// Returns the machine, for an observer of the replay.
    pub fn machine_mut(&mut self) -> &mut Vm {
        &mut self.machine
    }

    /// Returns the host that answers as the world did.
    pub fn host(&self) -> &ReplayHost {
        &self.host
    }

    /// Returns how far the run is.
    pub fn check(&self) -> RunCheck {
        self.machine.check()
    }

    /// Ends the run as it was ended then, and compares the ends.
    fn end(&mut self, outcome: RunOutcome) -> Replayed {
        let mut ended = None;
        if !self.host.has_diverged() {
            ended = Some(program::end(&mut self.machine, self.main, outcome));
            program::end_rest(&mut self.machine);
        }
        self.compare(ended)
    }

    fn compare(&self, ended: Option<Ended>) -> Replayed {
        let host = &self.host;
        if let Some(divergence) = host.divergence() {
            return Replayed::Diverged(divergence.to_string());
        }
        let (_, equal) = host.checks();
        let last = match equal {
            Some(check) => format!("the last equal check is at tick {}", check.ticks),
            None => "no equal check precedes it".into(),
        };
        let record = host.replayed() + 1;
        match (host.asked_at_end(), ended, self.recorded.end) {
            (Some(_), _, None) => Replayed::Cut,
            (Some(asked), _, Some(_)) => Replayed::Diverged(format!(
                "the replay has diverged at record {record}: the program asks {asked}; recorded is the end of the \
                 run; {last}"
            )),
            (None, Some(_), None) if host.is_at_end() => Replayed::Cut,
            (None, Some(ended), Some(end)) if host.is_at_end() => {
                let (status, check) = (ended.exit_status(), self.machine.check());
                if (status, check) == (end.status, end.check) {
                    return Replayed::Equal(status);
                }
                let say = |status: u8, check: RunCheck| {
                    format!("status {status}, tick {}, canary {:016x}", check.ticks, check.canary)
                };
                Replayed::Diverged(format!(
                    "the replay has diverged at its end: it ends with {}; recorded is {}; {last}",
                    say(status, check),
                    say(end.status, end.check)
                ))
            }
            _ => Replayed::Diverged(format!(
                "the replay has diverged at record {record}: the run has ended; recorded is more of it; {last}"
            )),
        }
    }
}

/// Makes a machine for a run that has begun so, and begins its program in it. The functions of the embedder
/// have no effects: the host answers in their place.
///
/// # Errors
/// [`Error`].
pub fn begin_recorded(
    beginning: &Beginning,
    program: &Program,
    host: Box<dyn Host + Send>,
) -> Result<(Vm, TaskId), Error> {
    let mut machine = prepare_recorded(beginning, None, host)?;
    let main = program::begin(&mut machine, program)?;
    Ok((machine, main))
}

/// Makes a machine as for [`begin_recorded`], up to the beginning of the program. Its heap is in a range of
/// addresses if there is one: then a state may be loaded.
///
/// # Errors
/// [`Error`].
pub fn prepare_recorded(
    beginning: &Beginning,
    range: Option<usize>,
    host: Box<dyn Host + Send>,
) -> Result<Vm, Error> {
    let mut machine = program::machine(Config { range, ..beginning.config.clone() }, host)?;
    if beginning.has_operators {
        program::load_operators(&mut machine)?;
    }
    for given in &beginning.functions {
        let function = if given.is_operation {
            HostFunction::Operation(Box::new(drop))
        } else {
            let missing = || HostFailure { cause: "NOT-IN-THIS-WORLD".into(), arguments: Vec::new() };
            HostFunction::AtOnce(Box::new(move |_| Err(missing())))
        };
        machine.add_guarded_function(&given.name, function, &given.needs);
    }
    program::set_module_folders(&mut machine, &beginning.folders)?;
    program::set_program_file(&mut machine, &beginning.program_file)?;
    program::set_traces(&mut machine, &beginning.traces)?;
    beginning.kept.iter().try_for_each(|kept| set_kept(&mut machine, kept))?;
    Ok(machine)
}
