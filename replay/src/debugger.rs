//! Moving through a recorded run, forwards and backwards.
//!
//! A place is a number of ticks. To go forward the machine runs on; to go back a new machine runs from the
//! beginning, which takes no longer than the run itself has worked. To stop where something happens, the
//! machine runs in portions until it has happened in one, and then from the beginning to that portion and
//! tick by tick through it.
//!
//! Guarantees: a place is always the same state, whatever way led there.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::datum::Datum;
use esl_host::{FrameVariable, Output};
use esl_vm::run::RunOutcome;
use esl_vm::task::TaskResult;

use super::breakpoint::{Breakpoint, Happened, Target, Witness, lock};
use super::file::Recorded;
use super::rerun::{Replayed, Rerun, RerunError};

/// Ticks of a portion.
const PORTION: u64 = 4096;
/// Most ticks of the evaluation of a form.
const FORM_TICKS: u64 = 10_000_000;

/// Output of the program, of which no piece is shown twice.
#[derive(Debug, Default)]
struct Shown {
    /// Bytes that the present machine has written.
    written: u64,
    /// Bytes shown so far.
    shown: u64,
    /// Pieces that were not shown yet, since no place behind them was stopped at.
    kept: VecDeque<(Output, Vec<u8>)>,
}

impl Shown {
    /// Takes a piece that the machine writes.
    fn take(&mut self, output: Output, bytes: &[u8]) {
        let known = self.shown + self.kept.iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>();
        let seen = usize::try_from(known.saturating_sub(self.written)).unwrap_or(usize::MAX);
        self.written += bytes.len() as u64;
        if let Some(new) = bytes.get(seen..).filter(|new| !new.is_empty()) {
            self.kept.push_back((output, new.into()));
        }
    }

    /// Shows what was written up to here, by `show`.
    fn show(&mut self, show: fn(Output, &[u8])) {
        while self.shown < self.written
            && let Some((output, mut bytes)) = self.kept.pop_front()
        {
            let here = usize::try_from(self.written - self.shown).unwrap_or(usize::MAX).min(bytes.len());
            let rest = bytes.split_off(here);
            show(output, &bytes);
            self.shown += bytes.len() as u64;
            if !rest.is_empty() {
                self.kept.push_front((output, rest));
            }
        }
    }
}

/// Where a replay stands, as far as it can be said of every place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Marks {
    ticks: u64,
    turns: u64,
    time: u64,
    records: u64,
    happened: u64,
    failures: u64,
    is_over: bool,
}

/// A recorded run, at some place of it.
pub struct Debugger {
    recorded: Recorded,
    rerun: Rerun,
    happened: Arc<Mutex<Happened>>,
    shown: Arc<Mutex<Shown>>,
    show: fn(Output, &[u8]),
    /// The place, if the machine has been used for something else since.
    left_at: Option<u64>,
}

impl Debugger {
    /// Begins the run.
    pub fn begin(
        recorded: Recorded,
        breakpoints: Vec<Breakpoint>,
        show: fn(Output, &[u8]),
    ) -> Result<Debugger, RerunError> {
        let happened = Arc::new(Mutex::new(Happened { breakpoints, ..Happened::default() }));
        let shown = Arc::new(Mutex::new(Shown::default()));
        let rerun = begin(&recorded, &happened, &shown)?;
        Ok(Debugger { recorded, rerun, happened, shown, show, left_at: None })
    }

    /// Returns the canary of the run up to here.
    #[cfg(test)]
    pub fn canary(&self) -> u64 {
        self.rerun.check().canary
    }

    /// Returns the breakpoints.
    pub fn breakpoints(&self) -> Vec<Breakpoint> {
        lock(&self.happened).breakpoints.clone()
    }

    /// Adds a breakpoint, from here on.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn add_breakpoint(&mut self, breakpoint: Breakpoint) -> Result<(), RerunError> {
        lock(&self.happened).breakpoints.push(breakpoint);
        // The events are counted anew.
        let here = self.ticks();
        self.restart()?;
        self.go_to(here)
    }

    fn restart(&mut self) -> Result<(), RerunError> {
        {
            let happened = &mut *lock(&self.happened);
            (happened.count, happened.failures) = (0, 0);
            happened.names.clear();
        }
        lock(&self.shown).written = 0;
        self.rerun = begin(&self.recorded, &self.happened, &self.shown)?;
        self.left_at = None;
        Ok(())
    }

    /// Returns the place.
    pub fn ticks(&self) -> u64 {
        self.left_at.unwrap_or_else(|| self.rerun.check().ticks)
    }

    /// Returns how the replay has ended, if this is its end.
    pub fn replayed(&self) -> Option<&Replayed> {
        self.rerun.replayed()
    }

    fn marks(&self) -> Marks {
        let machine = &self.rerun.machine;
        let happened = lock(&self.happened);
        Marks {
            ticks: self.rerun.check().ticks,
            turns: machine.tasks_turns_and_switches().1,
            time: machine.last_time(),
            records: self.rerun.host.replayed() as u64,
            happened: happened.count,
            failures: happened.failures,
            is_over: self.rerun.replayed().is_some(),
        }
    }

    /// Goes to a place, or to the end if that comes first.
    ///
    /// # Errors
    /// [`RerunError`], which the machine that ran the beginning before did not have, so for want of memory.
    pub fn go_to(&mut self, ticks: u64) -> Result<(), RerunError> {
        if self.left_at.is_some() || self.rerun.check().ticks > ticks || self.rerun.replayed().is_some() {
            self.restart()?;
        }
        let here = self.rerun.check().ticks;
        if ticks > here {
            self.rerun.run(ticks - here);
        }
        Ok(())
    }

    /// Makes the machine one that stands at this place again.
    fn come_back(&mut self) -> Result<(), RerunError> {
        match self.left_at {
            Some(ticks) => self.go_to(ticks),
            None => Ok(()),
        }
    }

    /// Goes on until `holds`, which once it holds does so for the rest of the run. Returns whether it came to
    /// hold; otherwise this is the end.
    fn go_until(&mut self, holds: &dyn Fn(&Marks) -> bool) -> Result<bool, RerunError> {
        self.come_back()?;
        loop {
            let before = self.marks();
            if holds(&before) {
                return Ok(true);
            }
            if before.is_over {
                return Ok(false);
            }
            self.rerun.run(PORTION);
            let after = self.marks();
            if holds(&after) || after.is_over {
                self.go_to(before.ticks)?;
                while !holds(&self.marks()) && self.rerun.run(1).is_none() {}
                return Ok(holds(&self.marks()));
            }
        }
    }

    /// Goes to the target, forwards or backwards.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn go(&mut self, target: &Target) -> Result<bool, RerunError> {
        self.come_back()?;
        let here = self.marks();
        match *target {
            Target::Tick(ticks) => {
                self.go_to(ticks)?;
                Ok(self.rerun.replayed().is_none())
            }
            Target::Turn(turn) => {
                if here.turns >= turn {
                    self.restart()?;
                }
                self.go_until(&|marks| marks.turns >= turn)
            }
            Target::Time(time) => {
                if here.time >= time {
                    self.restart()?;
                }
                self.go_until(&|marks| marks.time >= time)
            }
            Target::Record(number) => {
                if here.records >= number {
                    self.restart()?;
                }
                self.go_until(&|marks| marks.records >= number)
            }
            Target::Failure => self.go_until(&|marks| marks.failures > here.failures),
        }
    }

    /// Goes so many ticks forward, or back.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn step(&mut self, ticks: i64) -> Result<(), RerunError> {
        let here = self.ticks();
        self.go_to(here.saturating_add_signed(ticks))
    }

    /// Goes to the beginning of the turn so many turns ahead, or back: 0 is the present one.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn turn(&mut self, turns: i64) -> Result<bool, RerunError> {
        self.come_back()?;
        let turn = self.marks().turns.saturating_add_signed(turns);
        self.go(&Target::Turn(turn))
    }

    /// Goes on to the next breakpoint; returns what happens there, or nothing at the end.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn go_on(&mut self) -> Result<Option<String>, RerunError> {
        self.come_back()?;
        let functions = self.functions();
        let before = self.marks().happened;
        if functions.is_empty() {
            let found = self.go_until(&|marks| marks.happened > before)?;
            return Ok(found.then(|| lock(&self.happened).last.clone()));
        }
        while self.rerun.run(1).is_none() {
            if self.marks().happened > before {
                return Ok(Some(lock(&self.happened).last.clone()));
            }
            if let Some(what) = self.stands_before(&functions) {
                return Ok(Some(what));
            }
        }
        Ok(None)
    }

    /// Goes back to the last breakpoint before this place; returns what happens there, or nothing at the
    /// beginning.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn go_back(&mut self) -> Result<Option<String>, RerunError> {
        let end = self.ticks();
        let functions = self.functions();
        let portion = if functions.is_empty() { PORTION } else { 1 };
        self.restart()?;
        let mut found = self.last_stop(end, portion, &functions);
        if let Some((begin, ..)) = found
            && portion > 1
        {
            // Something happens within this portion: which of its ticks is it?
            self.go_to(begin)?;
            found = self.last_stop(end.min(begin + 2 * PORTION), 1, &functions);
        }
        let Some((_, ticks, what)) = found else {
            self.restart()?;
            return Ok(None);
        };
        self.go_to(ticks)?;
        Ok(Some(what))
    }

    /// Runs to the last place before `end` in portions; returns the last of these in which something happens,
    /// by its ends, and what.
    fn last_stop(&mut self, end: u64, portion: u64, functions: &[String]) -> Option<(u64, u64, String)> {
        let mut found = None;
        loop {
            let before = self.marks();
            let left = end.saturating_sub(1).saturating_sub(before.ticks);
            if left == 0 || self.rerun.run(portion.min(left)).is_some() {
                return found;
            }
            let after = self.marks();
            let stands = self.stands_before(functions);
            if after.ticks < end && (after.happened > before.happened || stands.is_some()) {
                let what = stands.unwrap_or_else(|| lock(&self.happened).last.clone());
                found = Some((before.ticks, after.ticks, what));
            }
        }
    }

    fn functions(&self) -> Vec<String> {
        let breakpoints = &lock(&self.happened).breakpoints;
        let name = |breakpoint: &Breakpoint| match breakpoint {
            Breakpoint::Function(name) => Some(name.clone()),
            _ => None,
        };
        breakpoints.iter().filter_map(name).collect()
    }

    /// Returns what is said if the task that has its turn is about to call one of these functions.
    fn stands_before(&self, functions: &[String]) -> Option<String> {
        if functions.is_empty() {
            return None;
        }
        let machine = &self.rerun.machine;
        let task = machine.open_task()?;
        let call = machine.next_call(task)?;
        let is_it = |name: &String| name.eq_ignore_ascii_case(&call);
        let name = machine.task_name(task).unwrap_or_default();
        functions.iter().any(is_it).then(|| format!("{name} calls {call}"))
    }

    /// Returns a line that says where the replay stands.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn place(&mut self) -> Result<String, RerunError> {
        self.come_back()?;
        let Marks { ticks, turns, time, .. } = self.marks();
        let machine = &self.rerun.machine;
        let who = match machine.open_task() {
            None => "between two turns".into(),
            Some(task) => {
                let name = machine.task_name(task).unwrap_or_default();
                let frames = machine.frames_of(task, 50);
                let is_of_program =
                    |source: &str| !source.starts_with("stdlib/") && !source.starts_with(MODULE_SOURCES);
                let place = frames.iter().filter_map(|frame| frame.place.as_ref());
                let mut place = place;
                let place = place.find(|place| is_of_program(&place.source));
                let place = place.map_or(String::new(), |place| {
                    format!(", {}:{}:{}", place.source, place.line, place.column)
                });
                let call =
                    machine.next_call(task).map_or(String::new(), |call| format!(", about to call {call}"));
                format!("{name}{place}{call}")
            }
        };
        Ok(format!("tick {ticks}, turn {turns}, {:.6} s: {who}", time as f64 / 1e9))
    }

    /// Returns the names that are known at this place, in upper case.
    pub fn names(&self) -> Vec<String> {
        let mut names = self.rerun.machine.accessible_names();
        names.sort_unstable();
        names
    }

    /// Shows what the program has written up to here and was not shown before.
    pub fn show_output(&mut self) {
        lock(&self.shown).show(self.show);
    }

    /// Returns the tree of tasks.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn tasks(&mut self) -> Result<String, RerunError> {
        self.come_back()?;
        Ok(self.rerun.machine.task_report())
    }

    /// Returns the frames of a task, by its number or name; of the one whose turn it is without either.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn backtrace(&mut self, task: &str) -> Result<String, RerunError> {
        self.come_back()?;
        let machine = &self.rerun.machine;
        let found = if task.is_empty() {
            machine.open_task().or_else(|| machine.find_task("the main task"))
        } else {
            machine.find_task(task)
        };
        let Some(number) = found else {
            return Ok(format!("Unknown task `{task}`; `tasks` lists them.\n"));
        };
        let mut text = format!("{}\n", machine.task_name(number).unwrap_or_default());
        for frame in machine.frames_of(number, 100) {
            let place = frame
                .place
                .map_or(String::new(), |place| format!(", {}:{}:{}", place.source, place.line, place.column));
            text.push_str(&format!(
                "  in {}{place}\n{}",
                frame.function,
                FrameVariable::lines(&frame.variables)
            ));
        }
        Ok(text)
    }

    /// Returns what the evaluation of a text prints, its values included. It changes nothing: the machine is
    /// not used any more afterwards.
    ///
    /// # Errors
    /// As [`Debugger::go_to`].
    pub fn evaluate(&mut self, text: &str) -> Result<String, RerunError> {
        self.come_back()?;
        self.left_at = Some(self.ticks());
        let Rerun { machine, host, .. } = &mut self.rerun;
        host.detach();
        machine.stop_all_tasks();
        machine.flush();
        let captured = host.captured();
        let before = (captured.output().len(), captured.error().len());
        let task = machine
            .import(&Datum::string(text, Default::default()))
            .ok()
            .and_then(|text| machine.spawn_library("%REPL-EVALUATE", &[text]).ok());
        let Some(task) = task else { return Ok("Not enough memory for it.\n".into()) };
        // The schedule of a run does not cover the choices of the form.
        machine.end_following();
        let outcome = machine.run_until(Some(task), FORM_TICKS);
        machine.flush();
        let mut output = captured.output().split_off(before.0);
        output.push_str(&captured.error()[before.1..]);
        match (machine.result(task), outcome) {
            (TaskResult::Failed(_), _) => output.push_str(&machine.report(task).unwrap_or_default()),
            (TaskResult::Running, RunOutcome::TicksUsed) => {
                output.push_str(&format!("The form does not end within {FORM_TICKS} ticks.\n"));
            }
            (TaskResult::Running, _) => {
                output.push_str("The form waits for other tasks, which do not run in the copy.\n")
            }
            (TaskResult::Aborted, _) => output.push_str("Aborted\n"),
            (TaskResult::Succeeded(values), _) => {
                let value = values.first().and_then(|&value| machine.export(value).ok());
                if value.is_some_and(|value| value.as_symbol().is_some_and(|symbol| symbol.name() == "MORE"))
                {
                    output.push_str("The form is not whole: its end is missing.\n");
                }
            }
        }
        Ok(output)
    }
}

/// Begins the run in a new machine.
fn begin(
    recorded: &Recorded,
    happened: &Arc<Mutex<Happened>>,
    shown: &Arc<Mutex<Shown>>,
) -> Result<Rerun, RerunError> {
    let shown = shown.clone();
    let screen = move |output, bytes: &[u8]| {
        lock(&shown).take(output, bytes);
    };
    let mut rerun = Rerun::begin(recorded, screen)?;
    rerun.machine.add_observer(Box::new(Witness(happened.clone())));
    Ok(rerun)
}
