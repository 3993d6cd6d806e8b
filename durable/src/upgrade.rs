//! Upgrades: the definitions of another program, made in a run that goes on.
//!
//! An upgrade is a call of the library's `%upgrade`, which the journal has as it has any other arrival. So a
//! replay makes the same definitions at the same place. The call comes before everything else that the new
//! process tells the program, and goes before all tasks.
//!
//! An upgrade is tried on a copy of the run first, whose journal is written nowhere: if it fails there, the
//! run is left as it is.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Wake, Waker};

use esl::program::Program;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_compiler::diagnostic::Sources;
use esl_host::{Answer, FunctionRef, Host, Inbox, Incoming, Pending, Question, Sender, VirtualHost};
use esl_replay::{JournalWriter, Recorded, RecordedError, begin_recorded, prepare_recorded};
use esl_vm::run::RunOutcome;
use esl_vm::vm::Vm;

use super::changes::{ProgramChanges, changes};
use super::control::DurableControl;
use super::disk::NowhereDisk;
use super::lasting::LastingCalls;
use super::log::JournalLog;
use super::resume::Resumption;
use super::snapshots::{SnapshotEvery, SnapshotTaker};
use super::standing::Standing;
use super::{Durability, DurableError, DurableRun, FoundRun};

/// Ticks between two looks of a trial.
pub(super) const STRETCH: u64 = 100_000;
/// Ticks that a trial takes at most behind the end of the journal.
pub(super) const PATIENCE: u64 = 2_000_000_000;

/// The effects of an upgrade.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UpgradeReport {
    /// Number of definitions that were made.
    pub definitions: usize,
    /// Number of structures that were given the slots of a new definition.
    pub structures: usize,
    /// Texts of changed forms that are not definitions. They do not run.
    pub left_out: Vec<String>,
}

/// The reason for which an upgrade has failed, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UpgradeFailure(pub(crate) String);

/// The effects of an upgrade, or the reason for which it has failed.
pub(crate) type UpgradeOutcome = Result<UpgradeReport, UpgradeFailure>;

/// An upgrade to be made.
#[derive(Clone, Debug)]
pub(crate) struct Upgrade {
    /// The program, as in an `.eslb` file.
    pub(crate) program: Vec<u8>,
    /// The program before.
    pub(crate) before: Vec<u8>,
    changes: ProgramChanges,
}

impl Upgrade {
    /// Asks the machine with this inbox for the upgrade. Returns the call, and the arrivals by which the
    /// machine is asked.
    pub(crate) fn ask(&self, inbox: &Inbox) -> (Pending, Vec<Incoming>) {
        let come = inbox.take();
        let sender = Sender::new(inbox);
        let call = sender.ask(self.question());
        drop(sender);
        let asked = inbox.take();
        come.into_iter().for_each(|one| inbox.put(one));
        (call, asked)
    }

    /// Returns the call that makes the upgrade.
    fn question(&self) -> Question {
        let text = |text: &str| Datum::string(text, Span::default());
        let sources = self.changes.sources.iter().map(|source| {
            let forms = source.forms.iter().map(|form| text(form));
            Datum::list(std::iter::once(text(source.package)).chain(forms), Span::default())
        });
        Question::Call {
            function: FunctionRef::Named("ESL::%UPGRADE".into()),
            arguments: vec![Datum::list(sources, Span::default())],
            goes_first: true,
        }
    }
}

struct Ringing(Inbox);

impl Wake for Ringing {
    fn wake(self: Arc<Self>) {
        self.0.ring();
    }
}

/// Returns the answer to a call if it has come; otherwise the inbox is rung when it comes.
pub(crate) fn poll_call(call: &mut Pending, inbox: &Inbox) -> Option<Answer> {
    let waker = Waker::from(Arc::new(Ringing(inbox.clone())));
    match Pin::new(call).poll(&mut Context::from_waker(&waker)) {
        Poll::Ready(answer) => Some(answer),
        Poll::Pending => None,
    }
}

/// Returns the outcome of the upgrade that an answer of `%upgrade` states.
pub(crate) fn outcome_of(answer: Answer) -> UpgradeOutcome {
    let reason = match answer {
        Answer::Values(values) => match values.first().and_then(read_report) {
            Some(report) => return Ok(report),
            None => "the library has answered something else than a report".into(),
        },
        Answer::Failed { message, .. } => message.trim_end_matches(['.', '\n']).to_owned(),
        Answer::Ended | Answer::Exited(_) => "the run is ending".into(),
        _ => "the call that makes the definitions was aborted".into(),
    };
    Err(UpgradeFailure(reason))
}

/// Reads a list of two numbers and a list of texts.
fn read_report(datum: &Datum) -> Option<UpgradeReport> {
    let [definitions, structures, left_out] = datum.as_list()?[..] else { return None };
    let count = |datum: &Datum| match datum.kind() {
        DatumKind::Integer(number) => usize::try_from(number).ok(),
        _ => None,
    };
    let text = |datum: &Datum| match datum.kind() {
        DatumKind::String(text) => Some(text.to_string()),
        _ => None,
    };
    Some(UpgradeReport {
        definitions: count(definitions)?,
        structures: count(structures)?,
        left_out: left_out.as_list()?.into_iter().map(text).collect::<Option<Vec<String>>>()?,
    })
}

impl DurableRun {
    /// Returns the program with which a machine has to begin this run, if `given` is its program: itself for
    /// a new run, otherwise the one with which the run has begun. `sources` are those from which `given` was
    /// compiled.
    ///
    /// If `given` is another program, it is an error, unless the run is to be upgraded to it
    /// (`is_upgrade`). Then the upgrade is tried on a copy of the run at once; the run makes it when it goes
    /// on.
    ///
    /// # Errors
    /// [`DurableError::OtherProgram`]; [`DurableError::Program`]; [`DurableError::NotUpgraded`], if the trial
    /// has failed: the folder is as before then.
    pub fn choose_program(
        &mut self,
        given: &Program,
        sources: &Sources,
        is_upgrade: bool,
    ) -> Result<Program, DurableError> {
        let Some(changes) = self.changes_to(given, sources)? else {
            return self.first_program().map(|first| first.unwrap_or_else(|| given.clone()));
        };
        if !is_upgrade {
            return Err(DurableError::OtherProgram(Box::new(changes)));
        }
        self.try_upgrade(given, &changes)?;
        if let Some(found) = &mut self.found {
            let program = given.to_bytes().map_err(DurableError::Program)?;
            found.upgrade = Some(Upgrade { program, before: found.current().to_vec(), changes });
        }
        self.first_program().map(|first| first.unwrap_or_else(|| given.clone()))
    }

    /// Returns the program with which the run has begun.
    fn first_program(&self) -> Result<Option<Program>, DurableError> {
        let read = |found: &FoundRun| read_program(&found.recorded.beginning.program);
        self.found.as_ref().map(read).transpose()
    }

    /// Returns the changes from the program of the run to another one; `None` if that is its program.
    ///
    /// # Errors
    /// [`DurableError`], if the program cannot be read.
    pub fn changes_to(
        &self,
        given: &Program,
        sources: &Sources,
    ) -> Result<Option<ProgramChanges>, DurableError> {
        let Some(found) = &self.found else { return Ok(None) };
        let current = read_program(found.current())?;
        let is_same = super::settings::is_same_program(&current, given);
        Ok((!is_same).then(|| changes(&current, given, sources)))
    }

    /// Tries an upgrade on a copy of the run. Nothing of it is written, and nothing leaves.
    ///
    /// # Errors
    /// [`DurableError::NotUpgraded`], and the reasons for which a run does not go on.
    pub fn try_upgrade(
        &self,
        program: &Program,
        changes: &ProgramChanges,
    ) -> Result<UpgradeReport, DurableError> {
        let upgrade = self.upgrade_to(program, changes)?;
        let found = self.found.as_ref().ok_or(DurableError::NoBeginning)?;
        let copy = DurableRun::copy_of(&found.recorded, found.resumption, Some(upgrade));
        copy.run_upgrade(&mut copy.copied_machine()?)
    }

    /// Returns an upgrade of the run.
    ///
    /// # Errors
    /// [`DurableError::NotUpgraded`], if it cannot be upgraded.
    pub(super) fn upgrade_to(
        &self,
        program: &Program,
        changes: &ProgramChanges,
    ) -> Result<Upgrade, DurableError> {
        let not_upgraded = |reason: &str| DurableError::NotUpgraded(reason.into());
        let found = self.found.as_ref().ok_or_else(|| not_upgraded("the run has not begun"))?;
        if found.recorded.end.is_some() {
            return Err(not_upgraded("the run has ended"));
        }
        if !found.recorded.beginning.has_operators {
            return Err(not_upgraded("it has begun without the part of the library for operators"));
        }
        if changes.sources.is_empty() {
            return Err(not_upgraded("an upgrade needs the source of the program, which is compiled"));
        }
        let program = program.to_bytes().map_err(DurableError::Program)?;
        Ok(Upgrade { program, before: found.current().to_vec(), changes: changes.clone() })
    }

    /// Runs the machine of a copy to the end of the upgrade.
    pub(super) fn run_upgrade(&self, machine: &mut Vm) -> Result<UpgradeReport, DurableError> {
        let not_upgraded = |reason: &str| Err(DurableError::NotUpgraded(reason.into()));
        let mut left = PATIENCE;
        loop {
            let outcome = machine.run(STRETCH);
            if let Some(outcome) = self.control.upgraded() {
                return outcome.map_err(|UpgradeFailure(reason)| DurableError::NotUpgraded(reason));
            }
            self.check()?;
            if outcome != RunOutcome::TicksUsed {
                return not_upgraded("the run ends before the definitions are made");
            }
            if self.control.is_at_end_of_past() {
                left = left.saturating_sub(STRETCH);
            }
            if left == 0 {
                return not_upgraded("the definitions take too long");
            }
        }
    }

    /// Returns a copy of a run, whose journal is written nowhere.
    pub(super) fn copy_of(
        recorded: &Recorded,
        resumption: Resumption,
        upgrade: Option<Upgrade>,
    ) -> DurableRun {
        let writer = JournalWriter::default();
        let log = JournalLog::new(Box::new(NowhereDisk), writer, 0, Durability::Process, Standing::default());
        let recorded = recorded.clone();
        let snapshot = recorded.start.as_ref().and_then(|start| start.snapshot.as_ref());
        let range = snapshot.map(|snapshot| snapshot.range);
        let found = FoundRun { recorded, upgrades: Vec::new(), resumption, torn: None, upgrade };
        let (control, lasting) = (DurableControl::default(), LastingCalls::default());
        control.set_copy();
        let taker = SnapshotTaker::new(SnapshotEvery::Never, log.clone(), control.clone(), lasting.clone());
        DurableRun {
            folder: None,
            log,
            control,
            taker,
            lasting,
            range,
            warnings: Vec::new(),
            found: Some(found),
            kept: None,
        }
    }

    /// Runs a copy to the end of its journal. Returns its machine there.
    pub(super) fn run_to_end_of_journal(&self) -> Result<Vm, DurableError> {
        let mut machine = self.copied_machine()?;
        loop {
            let outcome = machine.run(STRETCH);
            self.check()?;
            if outcome != RunOutcome::TicksUsed {
                break;
            }
        }
        if self.control.is_at_end_of_past() {
            Ok(machine)
        } else {
            Err(DurableError::Diverged("the run has ended, and the journal has more of it".into()))
        }
    }

    /// Makes the machine of a copy, and begins its program.
    fn copied_machine(&self) -> Result<Vm, DurableError> {
        // An outside in memory, so that not even an interrupted write of a file is completed.
        let mut outside = VirtualHost::new();
        outside.advance(self.elapsed());
        self.copied_machine_on(outside)
    }

    /// Makes the machine of a copy with this outside, and begins its program.
    pub(super) fn copied_machine_on(&self, outside: impl Host + Send + 'static) -> Result<Vm, DurableError> {
        let Some(found) = &self.found else {
            return Err(DurableError::NotUpgraded("the run has not begun".into()));
        };
        let host = self.host(outside);
        let first = read_program(&found.recorded.beginning.program)?;
        let beginning = &found.recorded.beginning;
        let diverged = |error: esl::Error| DurableError::Diverged(error.to_string());
        if found.recorded.start.is_none() {
            return begin_recorded(beginning, &first, Box::new(host))
                .map(|(machine, _)| machine)
                .map_err(diverged);
        }
        let mut machine = prepare_recorded(beginning, self.range, Box::new(host)).map_err(diverged)?;
        self.restore(&mut machine)?;
        Ok(machine)
    }
}

/// Reads the program of a journal.
pub(super) fn read_program(bytes: &[u8]) -> Result<Program, DurableError> {
    // A journal of this machine has a program of this machine.
    Program::from_bytes(bytes).map_err(|_| DurableError::Journal(RecordedError::OtherMachine))
}
