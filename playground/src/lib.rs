//! ESL in a browser: the compiler, the machine and the library as one module of WebAssembly, with an
//! interface of numbers and bytes (`abi`), so that nothing but the Rust compiler is needed to build it. A
//! page runs a program in slices, and shows its output, its failures and its timeline.
//!
//! Guarantees: nothing here takes longer than its number of ticks, but compiling, whose macros have a budget,
//! and the end of a run, whose cleanups have an allowance. Time is virtual. Not here: the page, which is in
//! `docs/site/`.

#![deny(unsafe_code)]

#[cfg(target_arch = "wasm32")]
pub mod abi;

use std::sync::{Arc, Mutex, PoisonError};

use esl::Config;
use esl::host::{Captured, Incoming, Output, ProcessSignal, VirtualHost};
use esl::program::{self, Compiled, Ended, Program, Source, Summary};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_format::{self as format, Styles};
use esl_syntax::SyntaxTree;
use esl_timeline::Drawing;
use esl_vm::observe::{Observer, Seen};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskNumber};
use esl_vm::vm::Vm;
use serde_json::{Value, json};

/// Bytes of memory for a program.
const MEMORY: usize = 256 << 20;
/// Bytes that a program may write: a page cannot show more.
const OUTPUT: usize = 1 << 20;
/// Ticks of the macros of a program.
const MACRO_TICKS: u64 = 50_000_000;
/// Name of the program, in messages.
const NAME: &str = "program.esl";

/// Programs to begin with: their titles and texts.
pub const EXAMPLES: [(&str, &str); 10] = [
    ("Hello", include_str!("../examples/hello.esl")),
    ("Failure and recovery", include_str!("../examples/valve.esl")),
    ("A race of two tasks", include_str!("../examples/race.esl")),
    ("A task net", include_str!("../examples/net.esl")),
    ("A deadlock", include_str!("../examples/deadlock.esl")),
    ("Supervision", include_str!("../examples/supervise.esl")),
    ("A widget plant", include_str!("../../examples/plant.esl")),
    ("A power bus", include_str!("../../examples/power.esl")),
    ("A rover", include_str!("../../examples/rover.esl")),
    ("Without an end", include_str!("../examples/endless.esl")),
];

/// Requests of a page: compiling a program, running it step by step, drawing its picture.
#[derive(Default)]
pub struct Playground {
    run: Option<ShownRun>,
}

/// A program that runs or has run.
struct ShownRun {
    machine: Vm,
    main: TaskId,
    captured: Captured,
    /// Bytes of output that the page has.
    told: usize,
    picture: SharedPicture,
    ended: Option<Summary>,
    is_stopped: bool,
}

/// Draws the run for the machine and the page.
#[derive(Clone, Default)]
struct SharedPicture(Arc<Mutex<Drawing>>);

impl Observer for SharedPicture {
    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        // A drawing is complete after each event, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner).see(time, task, seen);
    }
}

impl Playground {
    /// Compiles a text. Returns the diagnostics, each with its place in units of UTF-16, in which a page
    /// counts, and what macros have printed.
    pub fn check(&self, text: &str) -> Value {
        let (compiled, printed) = compile(text);
        json!({ "diagnostics": diagnostics(&compiled, text), "printed": printed })
    }

    /// Compiles a text and begins to run it, if it compiles. Returns as [`Playground::check`], and whether it
    /// runs. `seed` chooses one of the possible schedules; `traces` are of `failures`, `goals` and `tasks`.
    pub fn begin(&mut self, text: &str, seed: u64, traces: &[String]) -> Value {
        self.run = None;
        let (compiled, printed) = compile(text);
        let diagnostics = diagnostics(&compiled, text);
        let begun = match &compiled.program {
            Some(program) => ShownRun::begin(program, seed, traces).map_err(|error| error.to_string()),
            None => Err(String::new()),
        };
        let error = begun.map(|run| self.run = Some(run)).err();
        json!({ "diagnostics": diagnostics, "printed": printed, "runs": error.is_none(), "error": error })
    }

    /// Returns the text as it is formatted; one that cannot be read with its lines indented.
    pub fn format(&self, text: &str) -> String {
        let tree = SyntaxTree::new(text);
        let styles = Styles::standard();
        let edits = format::format_edits(&tree, &styles, None)
            .unwrap_or_else(|_| format::indent_edits(&tree, &styles, None));
        format::Edit::apply(text, &edits)
    }

    /// Runs so many ticks. Returns what was printed, the time of the program, and how it has ended if it has.
    pub fn step(&mut self, ticks: u64) -> Value {
        match &mut self.run {
            Some(run) => run.step(ticks),
            None => json!({ "pieces": [], "ended": "Nothing runs." }),
        }
    }

    /// Has the run end as a signal of the system would: all tasks are aborted, and their cleanups run.
    pub fn stop(&mut self) {
        if let Some(run) = &mut self.run {
            run.is_stopped = true;
            run.machine.inbox().put(Incoming::Signal(ProcessSignal::Terminate));
        }
    }

    /// Returns the drawing of the run, as SVG.
    pub fn timeline(&self) -> String {
        let draw = |run: &ShownRun| run.picture.0.lock().unwrap_or_else(PoisonError::into_inner).draw();
        self.run.as_ref().map(draw).unwrap_or_default()
    }
}

impl ShownRun {
    fn begin(program: &Program, seed: u64, traces: &[String]) -> Result<ShownRun, esl::Error> {
        let host = VirtualHost::new().with_seed(seed).with_output_limit(OUTPUT);
        let captured = host.captured();
        let config = Config { memory: MEMORY, seed, ..Config::DEFAULT };
        let mut machine = program::machine(config, Box::new(host))?;
        let picture = SharedPicture::default();
        program::set_traces(&mut machine, traces)?;
        machine.add_observer(Box::new(picture.clone()));
        let main = program::begin(&mut machine, program)?;
        Ok(ShownRun { machine, main, captured, told: 0, picture, ended: None, is_stopped: false })
    }

    fn step(&mut self, ticks: u64) -> Value {
        if self.ended.is_none() {
            let outcome = self.machine.run(ticks);
            self.machine.flush();
            if outcome != RunOutcome::TicksUsed {
                self.ended = Some(program::finish(&mut self.machine, self.main, outcome));
            }
        }
        let pieces = self.captured.pieces_after(self.told);
        self.told += pieces.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
        let pieces: Vec<Value> = pieces
            .iter()
            .map(|(output, bytes)| {
                json!({ "error": *output == Output::Error, "text": String::from_utf8_lossy(bytes) })
            })
            .collect();
        json!({
            "pieces": pieces,
            "ticks": self.machine.ticks(),
            "ended": self.ended.as_ref().map(|summary| self.ending(summary)),
        })
    }

    /// How the run has ended, for a reader.
    fn ending(&self, summary: &Summary) -> String {
        let how = match summary.ended {
            _ if self.is_stopped => "Stopped.".into(),
            _ if self.captured.output().len() >= OUTPUT => {
                format!("More than {} KiB were printed: the run was ended.", OUTPUT >> 10)
            }
            Ended::Normally(0) => "Ended.".into(),
            Ended::Normally(status) => format!("Ended with the exit status {status}."),
            Ended::Failed => "Failed.".into(),
            Ended::HeapExhausted => format!("Failed: {} MiB of memory are used up.", MEMORY >> 20),
            Ended::BudgetSpent => "The budget is spent.".into(),
            Ended::Deadlocked => "Deadlocked: every task waits.".into(),
            Ended::Signalled(_) => "Stopped.".into(),
        };
        let tasks = if summary.tasks == 1 { "1 task".into() } else { format!("{} tasks", summary.tasks) };
        format!("{how} {tasks}, {} ticks.", grouped(summary.ticks))
    }
}

/// Returns a number with commas between its thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let is_start = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    digits
        .chars()
        .enumerate()
        .flat_map(|(at, c)| is_start(at).then_some(',').into_iter().chain([c]))
        .collect()
}

/// Compiles a text. Returns the result, and what its macros have printed.
fn compile(text: &str) -> (Compiled, String) {
    let host = VirtualHost::new();
    let captured = host.captured();
    let config = Config { memory: MEMORY, budget: Some(MACRO_TICKS), ..Config::DEFAULT };
    let compiled = program::compile_on(&[Source::new(NAME, text)], config, Box::new(host));
    (compiled, captured.output())
}

fn diagnostics(compiled: &Compiled, text: &str) -> Vec<Value> {
    let mut found: Vec<Value> =
        compiled.diagnostics.iter().map(|diagnostic| of_diagnostic(diagnostic, text)).collect();
    if let Some(ended) = compiled.stopped {
        let message = match ended {
            Ended::HeapExhausted => "the macros of the program need too much memory",
            _ => "the macros of the program do not come to an end",
        };
        found.push(
            json!({ "severity": "error", "message": message, "start": 0, "end": 0, "line": 1, "column": 1 }),
        );
    }
    found
}

fn of_diagnostic(diagnostic: &Diagnostic, text: &str) -> Value {
    let span = diagnostic.primary.span;
    let units = |bytes: u32| text.get(..bytes as usize).unwrap_or(text).encode_utf16().count();
    let before = text.get(..span.start as usize).unwrap_or_default();
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    json!({
        "severity": match diagnostic.severity { Severity::Error => "error", Severity::Warning => "warning" },
        "code": diagnostic.code,
        "message": diagnostic.message,
        "label": diagnostic.primary.text,
        "help": diagnostic.help,
        "start": units(span.start),
        "end": units(span.end),
        "line": before.matches('\n').count() + 1,
        "column": before[line_start..].chars().count() + 1,
    })
}
