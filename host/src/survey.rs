//! Inspections: requests from outside to inspect a run, without side effects.
//!
//! An inspection comes to the machine beside the contents of the inbox, and is answered between two turns,
//! also while the machine sleeps in its host. It belongs to no round, is in no recording and wakes no task,
//! so a run that is looked at is the run that it would have been. Everything here is plain data.

use esl_heap::store::{Stored, StoredBytes};
use std::fmt;

use esl_bytecode::compile::SourcePlace;

use super::Inbox;

/// A request for a survey of a run.
#[derive(Clone, Debug, Default)]
pub struct SurveyRequest {
    /// Most tasks that are told of, in the order of their numbers, beside those that are named.
    pub tasks: usize,
    /// Number after which the tasks begin.
    pub after: u64,
    /// Tasks that are told of in any case, by number.
    pub named: Vec<u64>,
    /// The task whose frames are wanted, by number.
    pub frames_of: Option<u64>,
    /// Whether relations, locks and inputs are wanted.
    pub data: bool,
    /// The facts that are wanted: the name of a relation in upper case, empty for all, and how many facts to
    /// pass over.
    pub facts: Option<(String, usize)>,
    /// Failures that are wanted: those after the one with this number.
    pub failures_after: Option<u64>,
}

/// The activity of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TaskStanding {
    /// It can run.
    Ready,
    /// It waits for a signal or for a time.
    Waits,
    /// It waits for standard input, or for room in an output.
    WaitsForStream,
    /// It stands still until it is resumed.
    Suspended,
}

impl TaskStanding {
    /// All of them, in order.
    pub const ALL: [TaskStanding; 4] =
        [TaskStanding::Ready, TaskStanding::Waits, TaskStanding::WaitsForStream, TaskStanding::Suspended];

    /// Returns it in a word.
    pub fn name(self) -> &'static str {
        match self {
            TaskStanding::Ready => "ready",
            TaskStanding::Waits => "waits",
            TaskStanding::WaitsForStream => "stream",
            TaskStanding::Suspended => "suspended",
        }
    }
}

/// A task that has not ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SurveyedTask {
    /// Number of the task.
    pub number: u64,
    /// Number of its maker; 0 if the embedder has made it.
    pub maker: u64,
    /// Its name in reports.
    pub name: String,
    /// Its activity.
    pub standing: TaskStanding,
    /// The object of its wait, as in reports.
    pub waits_for: Option<String>,
    /// Numbers of the tasks on which that depends: those whose end it waits for, or that hold what it wants.
    pub held_by: Vec<u64>,
    /// Place in the program, `FILE:LINE:COLUMN`.
    pub place: Option<String>,
    /// Time of the machine at which the wait ends at the latest, in nanoseconds, if it is a wait for a time
    /// or has a timeout.
    pub ends_at: Option<u64>,
    /// Ticks that it has used.
    pub ticks: u64,
    /// Whether the run may end without it.
    pub is_daemon: bool,
    /// Whether it is in a cleanup.
    pub runs_cleanup: bool,
}

/// A frame of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRow {
    /// Name of the function.
    pub function: String,
    /// Place in the program, `FILE:LINE:COLUMN`.
    pub place: Option<String>,
    /// The variables that are in scope there.
    pub variables: Vec<FrameVariable>,
}

/// A variable of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameVariable {
    /// Name.
    pub name: String,
    /// A short text for its value.
    pub value: String,
}

impl FrameVariable {
    /// Returns the lines that show variables below that of their frame.
    pub fn lines(variables: &[FrameVariable]) -> String {
        variables.iter().map(|FrameVariable { name, value }| format!("      {name} = {value}\n")).collect()
    }
}

/// A relation of the database.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RelationRow {
    /// Name.
    pub name: String,
    /// Number of arguments of its facts.
    pub width: usize,
    /// Number of its facts.
    pub facts: usize,
    /// Whether it is a property.
    pub is_property: bool,
}

/// A lock of a property.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LockRow {
    /// The property with the value that is wanted.
    pub property: String,
    /// State of the lock.
    pub state: String,
    /// Numbers of the tasks that want it, that of the owner first.
    pub subscribers: Vec<u64>,
}

/// An input of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputRow {
    /// Name, in upper case.
    pub name: String,
    /// Signals that are not taken yet.
    pub kept: usize,
    /// Signals for which there is room.
    pub capacity: usize,
    /// Signals so far.
    pub signals: u64,
    /// Signals that were dropped.
    pub dropped: u64,
}

/// A call that a failure has left unfinished, or one that a tail call of its function has replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FailureFrame {
    /// Name of its task in reports.
    pub task: String,
    /// Name of its function, as the program prints it.
    pub function: String,
    /// Where it stood, if that is known.
    pub place: Option<SourcePlace>,
    /// Whether the function belongs to the library, or to a module that comes with the machine.
    pub is_of_library: bool,
    /// Whether the function has left by a tail call. Where it stood is unknown if several of its tail calls
    /// may have led on.
    pub has_left: bool,
}

/// A failure that has happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FailureRow {
    /// Number of the note of it, from 1 on; another one once it has ended the task.
    pub number: u64,
    /// Time of the machine, in nanoseconds.
    pub time: u64,
    /// Number of the task.
    pub task: u64,
    /// Name of the task in reports.
    pub name: String,
    /// Its cause.
    pub cause: String,
    /// Its arguments, in a short text; of a condition, the values of its slots.
    pub arguments: String,
    /// Place in the program.
    pub place: Option<String>,
    /// The report, if it has ended the task.
    pub report: Option<String>,
    /// The report with all calls of the library, if that was kept as well.
    pub full_report: Option<String>,
    /// The calls that it has left unfinished, innermost first, if it has ended the task: those of the task,
    /// and before them those of the tasks whose failures it has failed with.
    pub frames: Vec<FailureFrame>,
}

/// How late timers were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    /// Number of timers.
    pub count: u64,
    /// Sum, in nanoseconds.
    pub total: u64,
    /// The greatest, in nanoseconds.
    pub longest: u64,
}

/// Figures of a run.
#[derive(Clone, Debug, Default)]
pub struct RunFigures {
    /// Number of tasks of the program in each standing, in the order of [`TaskStanding::ALL`].
    pub tasks: [u64; 4],
    /// Tasks of the program and of the library that were made so far.
    pub made: u64,
    /// Ticks of all tasks.
    pub ticks: u64,
    /// Turns of tasks.
    pub turns: u64,
    /// Times at which the machine has looked whose turn it is.
    pub rounds: u64,
    /// Last reading of the clock, in nanoseconds.
    pub time: u64,
    /// Nanoseconds in which all tasks waited.
    pub idled: u64,
    /// Whether the run is paused from outside.
    pub is_paused: bool,
    /// Whether time is virtual, so that it stands still while tasks work.
    pub is_virtual: bool,
    /// Number of facts.
    pub facts: u64,
    /// Bytes of objects that the last collection has left.
    pub live: u64,
    /// Bytes allocated.
    pub allocated: u64,
    /// Bytes taken from the system.
    pub committed: u64,
    /// Most bytes that objects may take.
    pub limit: u64,
    /// Collections that are complete.
    pub collections: u64,
    /// Number of pauses for the collector, their sum and the longest, in nanoseconds; 0 unless figures are
    /// gathered.
    pub pauses: [u64; 3],
    /// Failures by cause; empty unless a journal is kept.
    pub failures: Vec<(String, u64)>,
    /// Number of failures, as far as a journal is kept.
    pub failed: u64,
    /// Number of those that have ended a task.
    pub ended_by_failure: u64,
    /// Recovery procedures that have begun, as far as a journal is kept.
    pub recoveries: u64,
    /// Children that supervisors have restarted.
    pub restarts: u64,
    /// How late timers were, as far as a journal is kept.
    pub lateness: Lateness,
}

/// The state of a run between two turns, as data.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// Figures.
    pub figures: RunFigures,
    /// Tasks, in the order of their numbers.
    pub tasks: Vec<SurveyedTask>,
    /// Whether there are tasks after the last of these, beside those that were named.
    pub has_more_tasks: bool,
    /// Frames of the task that was asked for, innermost first.
    pub frames: Vec<FrameRow>,
    /// Relations, by name.
    pub relations: Vec<RelationRow>,
    /// Locks of properties.
    pub locks: Vec<LockRow>,
    /// Inputs, by name.
    pub inputs: Vec<InputRow>,
    /// Facts, as texts.
    pub facts: Vec<String>,
    /// Failures, oldest first.
    pub failures: Vec<FailureRow>,
}

/// A survey to be made, or observers to be registered.
pub enum Inspection {
    /// A survey, and the callback that receives it. It is dropped if the machine is gone.
    Survey(SurveyRequest, Box<dyn FnOnce(Survey) + Send>),
    /// Observers have arrived, which are to be registered.
    Watch,
}

impl fmt::Debug for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Inspection::Survey(request, _) => write!(f, "Survey({request:?})"),
            Inspection::Watch => f.write_str("Watch"),
        }
    }
}

/// The inspections that the machine has not taken yet.
#[derive(Debug, Default)]
pub(super) struct Inspections {
    pub(super) list: Vec<Inspection>,
    pub(super) is_closed: bool,
}

impl Inbox {
    /// Requests an inspection, from any thread, without any effect on the run.
    pub fn inspect(&self, inspection: Inspection) {
        {
            let mut inspections = self.inspections();
            if inspections.is_closed {
                return;
            }
            inspections.list.push(inspection);
        }
        self.ring();
    }

    /// Takes the requested inspections.
    #[doc(hidden)]
    pub fn take_inspections(&self) -> Vec<Inspection> {
        std::mem::take(&mut self.inspections().list)
    }

    /// Says that the machine is gone.
    #[doc(hidden)]
    pub fn end_inspections(&self) {
        let mut inspections = self.inspections();
        inspections.is_closed = true;
        inspections.list.clear();
    }
}

impl Stored for FailureFrame {
    fn store(&self, out: &mut Vec<u8>) {
        let FailureFrame { task, function, place, is_of_library, has_left } = self;
        (task.clone(), function.clone()).store(out);
        let place = place.as_ref().map(|place| (place.source.clone(), place.line, place.column));
        place.store(out);
        (*is_of_library, *has_left).store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<FailureFrame> {
        let (task, function) = Stored::load(from)?;
        let place: Option<(String, u32, u32)> = Stored::load(from)?;
        let place = place.map(|(source, line, column)| SourcePlace { source, line, column });
        let (is_of_library, has_left) = Stored::load(from)?;
        Some(FailureFrame { task, function, place, is_of_library, has_left })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Incoming, Wake};

    #[test]
    fn an_inspection_is_told_from_an_arrival() {
        let inbox = Inbox::new();
        inbox.inspect(Inspection::Watch);
        assert!(inbox.is_rung() && inbox.why_rung() == Wake::Inspection);
        inbox.put(Incoming::Stop);
        assert_eq!(inbox.why_rung(), Wake::Arrival);
        inbox.quieten();
        assert!(inbox.is_rung(), "the arrival is still there");
        inbox.take();
        assert!(!inbox.is_rung() && inbox.take_inspections().len() == 1);
        inbox.end_inspections();
        inbox.inspect(Inspection::Watch);
        assert!(!inbox.is_rung() && inbox.take_inspections().is_empty());
    }
}
