//! Profiles: where a run spends its ticks, by task, calls and line.
//!
//! The run is divided into portions of a prime number of ticks, which changes nothing in it. The ticks of a
//! portion count for the calls in which the task stands that runs at its end. So the sum is exact, and a part
//! of it the more so the larger it is.
//!
//! ```
//! use esl::Config;
//! use esl::host::VirtualHost;
//! use esl::profile::{INTERVAL, Profile};
//! use esl::program::{Source, compile, machine, run_in_portions};
//!
//! let text = "(defun busy (n) (loop for i below n sum (* i i))) (busy 100000)";
//! let program = compile(&[Source::new("busy.esl", text)]).program.expect("there are no errors");
//! let mut machine = machine(Config::default(), Box::new(VirtualHost::new()))?;
//! let mut profile = Profile::new();
//! run_in_portions(&mut machine, &program, INTERVAL, &mut |machine| profile.look(machine))?;
//! assert_eq!(profile.functions()[0].name, "BUSY");
//! # Ok::<(), esl::Error>(())
//! ```

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io;
use std::path::Path;

use esl_vm::vm::Vm;
use inferno::flamegraph;
use serde_json::json;

/// Ticks between two looks at a run.
pub const INTERVAL: u64 = 997;
/// Calls of a stack that are looked at, the innermost ones.
const DEPTH: usize = 200;

/// Where a run has spent its ticks so far.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    frames: Vec<ProfiledFrame>,
    numbers: HashMap<ProfiledFrame, usize>,
    /// Ticks by stack, outermost frame first: the task, the functions, the line.
    stacks: HashMap<Vec<usize>, u64>,
    /// Ticks of the run up to the last look.
    ticks: u64,
}

/// A part of a stack.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ProfiledFrame {
    Task(String),
    Function(String),
    Line(String, u32),
}

/// Ticks of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfiledFunction {
    /// Name of the function.
    pub name: String,
    /// Ticks of the function itself.
    pub own: u64,
    /// Ticks of the function and of all that it calls.
    pub total: u64,
}

impl Profile {
    /// Creates an empty profile.
    pub fn new() -> Profile {
        Profile::default()
    }

    /// Looks at a machine between two portions of its run.
    pub fn look(&mut self, machine: &Vm) {
        let ticks = machine.ticks();
        let used = ticks.saturating_sub(self.ticks);
        self.ticks = ticks;
        if used == 0 {
            return;
        }
        let Some(mut calls) = machine.open_calls(DEPTH) else {
            let ended = self.number(ProfiledFrame::Task("tasks that have ended since".into()));
            *self.stacks.entry(vec![ended]).or_default() += used;
            return;
        };
        let mut stack = Vec::with_capacity(calls.len() + 1);
        if let Some((task, _)) = calls.pop() {
            stack.push(self.number(ProfiledFrame::Task(task)));
        }
        let place = calls.first().and_then(|(_, place)| place.clone());
        for (function, _) in calls.into_iter().rev() {
            stack.push(self.number(ProfiledFrame::Function(function)));
        }
        if let Some(place) = place {
            stack.push(self.number(ProfiledFrame::Line(place.source, place.line)));
        }
        *self.stacks.entry(stack).or_default() += used;
    }

    fn number(&mut self, frame: ProfiledFrame) -> usize {
        if let Some(&number) = self.numbers.get(&frame) {
            return number;
        }
        self.frames.push(frame.clone());
        self.numbers.insert(frame, self.frames.len() - 1);
        self.frames.len() - 1
    }

    /// Returns the functions, those that have used most themselves first.
    pub fn functions(&self) -> Vec<ProfiledFunction> {
        let mut ticks: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
        for (stack, used) in &self.stacks {
            let names = stack.iter().filter_map(|&number| match &self.frames[number] {
                ProfiledFrame::Function(name) => Some(name.as_str()),
                _ => None,
            });
            let names: Vec<&str> = names.collect();
            if let Some(innermost) = names.last() {
                ticks.entry(innermost).or_default().0 += used;
            }
            for name in names.into_iter().collect::<HashSet<_>>() {
                ticks.entry(name).or_default().1 += used;
            }
        }
        let function =
            |(name, (own, total)): (&str, (u64, u64))| ProfiledFunction { name: name.into(), own, total };
        let mut functions: Vec<ProfiledFunction> = ticks.into_iter().map(function).collect();
        functions.sort_by_key(|function| std::cmp::Reverse((function.own, function.total)));
        functions
    }

    /// Writes the profile to a file: a flame graph if its name ends in `.svg`, for speedscope if it ends in
    /// `.json`, else one line for each stack, with its ticks.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => std::fs::write(path, self.flame_graph()?),
            Some("json") => std::fs::write(path, self.speedscope()),
            _ => std::fs::write(path, self.lines().concat()),
        }
    }

    /// Returns one line for each stack: its frames, and its ticks.
    fn lines(&self) -> Vec<String> {
        // What separates frames and stacks cannot be part of a name.
        let plain = |text: String| text.replace([';', '\n', '\r'], " ");
        let name = |&number: &usize| plain(self.frames[number].name());
        let line = |(stack, ticks): (&Vec<usize>, &u64)| {
            format!("{} {ticks}\n", stack.iter().map(name).collect::<Vec<_>>().join(";"))
        };
        let mut lines: Vec<String> = self.stacks.iter().map(line).collect();
        lines.sort_unstable();
        lines
    }

    fn flame_graph(&self) -> io::Result<Vec<u8>> {
        let mut options = flamegraph::Options::default();
        options.title = "Ticks of the run".into();
        options.count_name = "ticks".into();
        let lines = self.lines();
        let mut drawing = Vec::new();
        if lines.is_empty() {
            // The drawing of nothing is an error there.
            return Ok(b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"1\"/>\n".to_vec());
        }
        flamegraph::from_lines(&mut options, lines.iter().map(String::as_str), &mut drawing)?;
        Ok(drawing)
    }

    fn speedscope(&self) -> String {
        let frame = |frame: &ProfiledFrame| match frame {
            ProfiledFrame::Line(file, line) => json!({ "name": frame.name(), "file": file, "line": line }),
            _ => json!({ "name": frame.name() }),
        };
        let mut stacks: Vec<(&Vec<usize>, &u64)> = self.stacks.iter().collect();
        stacks.sort_unstable();
        let samples: Vec<&Vec<usize>> = stacks.iter().map(|(stack, _)| *stack).collect();
        let weights: Vec<u64> = stacks.iter().map(|(_, ticks)| **ticks).collect();
        let total: u64 = weights.iter().sum();
        let profile = json!({
            "type": "sampled", "name": "ticks", "unit": "none", "startValue": 0, "endValue": total,
            "samples": samples, "weights": weights,
        });
        let file = json!({
            "$schema": "https://www.speedscope.app/file-format-schema.json",
            "shared": { "frames": self.frames.iter().map(frame).collect::<Vec<_>>() },
            "profiles": [profile],
            "exporter": "eslvm",
        });
        file.to_string() + "\n"
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
