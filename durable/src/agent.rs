//! A run without a command of its own: its machine from its journal alone, and its sleep.
//!
//! A run that waits long and has no ties to its process needs none: it *sleeps* in its folder, and whoever
//! has a message for it, or sees that its time has come, wakes it. The program is told nothing of that.

use esl::program;
use esl_host::Host;
use esl_replay::JournalLife;
use esl_vm::task::TaskId;
use esl_vm::vm::Vm;

use super::log::JournalLog;
use super::rest::RunRest;
use super::resume::wall_clock;
use super::settings::compare_settings;
use super::upgrade::read_program;
use super::{DurableError, DurableRun};

/// The journal of a run that goes on, for hosts that answer for the safety of messages.
#[derive(Clone)]
pub struct DurableJournal(JournalLog);

impl DurableJournal {
    /// Makes everything that has reached the run so far as safe as its durability says. Returns whether it
    /// is.
    pub fn commit(&self) -> bool {
        self.0.commit()
    }

    /// Returns whether calls of the outside are under way, which would end with the process.
    pub fn has_open_calls(&self) -> bool {
        self.0.has_open_calls()
    }
}

impl DurableRun {
    /// Returns the journal.
    pub fn journal(&self) -> DurableJournal {
        DurableJournal(self.log.clone())
    }

    /// Makes the machine of a run that is there, with its own program and settings, and takes it to where it
    /// goes on. `prepare` gives the machine the functions of the outside, which have to be those with which
    /// the run has begun. Returns the main task too.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn go_on(
        &self,
        host: impl Host + Send + 'static,
        prepare: impl FnOnce(&mut Vm),
    ) -> Result<(Vm, TaskId), DurableError> {
        let Some(found) = &self.found else { return Err(DurableError::NoBeginning) };
        let beginning = &found.recorded.beginning;
        let config = self.config(beginning.config.clone());
        let mut machine =
            program::machine(config, Box::new(self.host(host))).map_err(DurableError::Machine)?;
        if beginning.has_operators {
            program::load_operators(&mut machine).map_err(DurableError::Machine)?;
        }
        prepare(&mut machine);
        program::set_module_folders(&mut machine, &beginning.folders).map_err(DurableError::Machine)?;
        program::set_program_file(&mut machine, &beginning.program_file).map_err(DurableError::Machine)?;
        program::set_traces(&mut machine, &beginning.traces).map_err(DurableError::Machine)?;
        self.prepare(&mut machine)?;
        compare_settings(beginning, &esl_replay::beginning_of(beginning, &machine))?;
        self.take_up(found)?;
        let main = match self.restore(&mut machine)? {
            Some(main) => main,
            None => {
                let program = read_program(&beginning.program)?;
                program::begin(&mut machine, &program).map_err(DurableError::Machine)?
            }
        };
        self.take_snapshots(&mut machine);
        Ok((machine, main))
    }

    /// Leaves a run that has just begun before its first turn. The process that goes on with it takes that.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn put_off(&self, machine: &Vm) -> Result<(), DurableError> {
        self.note_sleep(0);
        self.log.finish();
        self.keep_facts_asleep(machine);
        self.check()
    }

    /// Puts the run to sleep, in place of [`DurableRun::pause`]. Returns when it goes on by itself. A run
    /// that has not come to the end of its journal stays as it is, and may go on at once.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn sleep(&self, machine: &mut Vm) -> Result<RunRest, DurableError> {
        if self.log.life().is_none() {
            self.check()?;
            return Ok(RunRest::Asleep(Some(i64::MIN)));
        }
        let due = machine.next_turn();
        let time = self.control.paused_at().unwrap_or_else(|| machine.last_time());
        let wall = self.note_sleep(time);
        self.log.leave();
        self.taker.finish();
        self.keep_facts_asleep(machine);
        self.check()?;
        let until = due.map(|due| wall.saturating_add_unsigned(due.saturating_sub(time)));
        let rest = RunRest::Asleep(until);
        self.note_rest(rest);
        Ok(rest)
    }

    /// Returns the start of the addresses of the run's objects, unless it is never copied.
    pub fn range(&self) -> Option<usize> {
        self.range
    }

    /// Notes that the run sleeps from this time of its clock on. Returns the time of day.
    fn note_sleep(&self, time: u64) -> i64 {
        let wall = wall_clock();
        if let Some(life) = self.log.life() {
            self.log.note_life(JournalLife { is_pause: true, is_asleep: true, wall, time, ..life });
        }
        wall
    }
}
