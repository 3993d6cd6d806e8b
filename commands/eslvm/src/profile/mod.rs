//! Profiles: where a run spends its ticks and its time, by task, calls and line.
//!
//! The run is divided into portions of a prime number of ticks, which changes nothing in it. The ticks of a
//! task since its last sample count for the calls in which it stands when a portion ends in its turn. So
//! totals, including per-task totals, are exact; other figures are estimates that improve with size. A task
//! that ends before a portion has ended in its turn has no calls.
//!
//! Time is that of the tasks' turns, by the host's stopwatch: waiting takes none.
//!
//! ```
//! use esl::Config;
//! use esl::host::VirtualHost;
//! use eslvm::profile::{INTERVAL, Profile};
//! use esl::program::{Source, compile, machine, run_in_portions};
//!
//! let text = "(defun busy (n) (loop for i below n sum (* i i))) (busy 100000)";
//! let program = compile(&[Source::new("busy.esl", text)]).program.expect("there are no errors");
//! let mut machine = machine(Config::default(), Box::new(VirtualHost::new()))?;
//! let mut profile = Profile::begin(&mut machine);
//! run_in_portions(&mut machine, &program, INTERVAL, &mut |machine| profile.sample(machine))?;
//! profile.end(&mut machine);
//! assert_eq!(profile.functions()[0].name, "BUSY");
//! assert_eq!(profile.sum().ticks, machine.ticks());
//! # Ok::<(), esl::Error>(())
//! ```

mod file;

use std::collections::{BTreeMap, HashMap, HashSet};

pub use esl_vm::observe::UsedResources;
use esl_vm::vm::Vm;

/// Ticks between two samples of a run.
pub const INTERVAL: u64 = 997;
/// Calls of a stack that a sample has, the innermost ones.
const DEPTH: usize = 200;
/// Tasks that are told apart of those that have no calls; the others count together.
const SHORT_TASKS: usize = 100;

/// The unit of a profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProfileUnit {
    /// Ticks, the same in each run
    #[default]
    Ticks,
    /// Time of the turns of tasks
    Time,
}

/// Where a run has spent its ticks and its time so far.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    frames: Vec<ProfiledFrame>,
    numbers: HashMap<ProfiledFrame, usize>,
    /// The consumption by stack, outermost frame first: the task, the functions, the line.
    stacks: HashMap<Vec<usize>, UsedResources>,
    /// Number of tasks without calls that have a name of their own here.
    short_tasks: usize,
}

/// A part of a stack.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ProfiledFrame {
    Task(String),
    Function(String),
    Line(String, u32),
}

/// The consumption of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfiledFunction {
    /// Name of the function.
    pub name: String,
    /// The consumption of the function itself.
    pub own: UsedResources,
    /// The consumption of the function and of all its callees.
    pub total: UsedResources,
}

impl Profile {
    /// Begins a profile of what a machine does from now on.
    pub fn begin(machine: &mut Vm) -> Profile {
        machine.measure_turns();
        Profile::default()
    }

    /// Samples the calls of a machine between two portions of its run.
    pub fn sample(&mut self, machine: &mut Vm) {
        for (task, used) in machine.take_used_by_ended() {
            self.add_without_calls(task, used);
        }
        let used = machine.take_used();
        if used == UsedResources::default() {
            return;
        }
        let Some(calls) = machine.open_calls(DEPTH) else { return };
        let mut stack = Vec::with_capacity(calls.functions.len() + 2);
        stack.push(self.number(ProfiledFrame::Task(calls.task)));
        for function in calls.functions.into_iter().rev() {
            stack.push(self.number(ProfiledFrame::Function(function)));
        }
        if let Some(place) = calls.place {
            stack.push(self.number(ProfiledFrame::Line(place.source, place.line)));
        }
        self.stacks.entry(stack).or_default().add(used);
    }

    /// Ends the profile, after the run and the cleanups at its end: takes in what was used since the last
    /// samples of the tasks.
    pub fn end(&mut self, machine: &mut Vm) {
        for (task, used) in machine.take_all_used() {
            self.add_without_calls(task, used);
        }
        // Of signals, and of what the host is asked to do for the run as a whole.
        let ticks = machine.ticks().saturating_sub(self.sum().ticks);
        if ticks > 0 {
            let between = self.number(ProfiledFrame::Task("between turns".into()));
            self.stacks.entry(vec![between]).or_default().add(UsedResources { ticks, nanoseconds: 0 });
        }
    }

    /// Adds what a task has used whose calls are not known.
    fn add_without_calls(&mut self, task: String, used: UsedResources) {
        if used == UsedResources::default() {
            return;
        }
        let mut frame = ProfiledFrame::Task(task);
        if !self.numbers.contains_key(&frame) {
            self.short_tasks += 1;
            if self.short_tasks > SHORT_TASKS {
                frame = ProfiledFrame::Task("further short tasks".into());
            }
        }
        let number = self.number(frame);
        self.stacks.entry(vec![number]).or_default().add(used);
    }

    fn number(&mut self, frame: ProfiledFrame) -> usize {
        if let Some(&number) = self.numbers.get(&frame) {
            return number;
        }
        self.frames.push(frame.clone());
        self.numbers.insert(frame, self.frames.len() - 1);
        self.frames.len() - 1
    }

    /// Returns what was used in all.
    pub fn sum(&self) -> UsedResources {
        self.stacks.values().fold(UsedResources::default(), |mut sum, used| {
            sum.add(*used);
            sum
        })
    }

    /// Returns the functions, those that have used most ticks themselves first.
    pub fn functions(&self) -> Vec<ProfiledFunction> {
        let mut functions: BTreeMap<&str, (UsedResources, UsedResources)> = BTreeMap::new();
        for (stack, used) in &self.stacks {
            let names = stack.iter().filter_map(|&number| match &self.frames[number] {
                ProfiledFrame::Function(name) => Some(name.as_str()),
                _ => None,
            });
            let names: Vec<&str> = names.collect();
            if let Some(innermost) = names.last() {
                functions.entry(innermost).or_default().0.add(*used);
            }
            for name in names.into_iter().collect::<HashSet<_>>() {
                functions.entry(name).or_default().1.add(*used);
            }
        }
        let function = |(name, (own, total)): (&str, _)| ProfiledFunction { name: name.into(), own, total };
        let mut functions: Vec<ProfiledFunction> = functions.into_iter().map(function).collect();
        functions.sort_by_key(|function| std::cmp::Reverse((function.own.ticks, function.total.ticks)));
        functions
    }
}

impl ProfiledFrame {
    fn name(&self) -> String {
        match self {
            ProfiledFrame::Task(name) | ProfiledFrame::Function(name) => name.clone(),
            ProfiledFrame::Line(file, line) => format!("{file}:{line}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use esl_host::{RealHost, VirtualHost};
    use esl_vm::vm::Config;

    use super::*;
    use esl::program::{Source, compile, machine, run_in, run_in_portions};

    const TEXT: &str = "(defun spin (n) (let ((sum 0)) (dotimes (i n sum) (incf sum i))))
        (defvar *worker* (spawn (:name 'worker) (unwind-protect (loop (sleep 0.001) (spin 50)) (spin 3000))))
        (dotimes (i 40) (sleep 0.001))
        (dotimes (i 300) (wait-for-task (spawn (spin 3))))
        (spin 20000)
        (abort-task *worker*)
        (random 1000)";

    #[test]
    fn a_profile_changes_nothing_and_has_every_tick() {
        let program = compile(&[Source::new("spin.esl", TEXT)]).program.expect("it compiles");
        let host = || Box::new(VirtualHost::new());
        let mut alone = machine(Config::DEFAULT, host()).expect("there is room");
        let summary = run_in(&mut alone, &program).expect("it runs");
        let mut watched = machine(Config::DEFAULT, host()).expect("there is room");
        let mut profile = Profile::begin(&mut watched);
        let sample = &mut |machine: &mut Vm| profile.sample(machine);
        let same = run_in_portions(&mut watched, &program, INTERVAL, sample).expect("it runs");
        profile.end(&mut watched);
        assert_eq!((summary.ended, summary.ticks, summary.turns), (same.ended, same.ticks, same.turns));
        assert_eq!(alone.canary(), watched.canary());
        assert_eq!(profile.sum().ticks, watched.ticks());
        let tasks: HashSet<String> =
            profile.stacks.keys().map(|stack| profile.frames[stack[0]].name()).collect();
        assert!(tasks.contains("task WORKER") && tasks.contains("further short tasks"), "{tasks:?}");
        assert!(tasks.len() < SHORT_TASKS + 20, "{tasks:?}");
    }

    #[test]
    fn waiting_takes_no_time() {
        let program = compile(&[Source::new("spin.esl", TEXT)]).program.expect("it compiles");
        let mut machine =
            machine(Config::DEFAULT, Box::new(RealHost::new(Vec::new()))).expect("there is room");
        let mut profile = Profile::begin(&mut machine);
        let started = Instant::now();
        let sample = &mut |machine: &mut Vm| profile.sample(machine);
        run_in_portions(&mut machine, &program, INTERVAL, sample).expect("it runs");
        profile.end(&mut machine);
        let taken = started.elapsed().as_nanos() as u64;
        let spin = profile.functions().into_iter().find(|function| function.name == "SPIN");
        let spin = spin.expect("it has run").own.nanoseconds;
        // However slow the machine is, it has waited for 40 ms.
        assert!(spin > 0 && profile.sum().nanoseconds + 40_000_000 <= taken, "{profile:?}");
    }
}
