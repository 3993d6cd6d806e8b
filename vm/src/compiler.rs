//! The compiler of a machine, and the compilations that its programs run with it.
//!
//! A program refers by a handle to a compilation, or to a text that it compiles form by form. A job is out of
//! the table while a builtin works on it, since the compiler may ask about the program meanwhile.
//!
//! Not here: the steps of a compilation, which are builtins (`builtins::eval`).

use std::cell::RefCell;
use std::sync::Arc;

use esl_bytecode::compile::{Compilation, Compile, Part, Step};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::Module;
use slotmap::{Key, KeyData, SlotMap, new_key_type};

use crate::datum::{DatumWalk, Unit, UnitRemains};
use crate::names::load::ModuleLoad;
use crate::value::Value;

new_key_type! {
    /// Key of a job in the table.
    pub(crate) struct JobId;
}

/// About how many bytes a compilation takes beside what it says of itself: its tables, empty or nearly so.
const COMPILATION_BYTES: usize = 4 << 10;

/// Object that a handle names.
pub(crate) enum CompilerJob {
    /// A form that becomes a datum, which is then compiled.
    Form(Box<FormWalk>),
    /// A compilation in progress.
    Compilation(Box<ActiveCompilation>),
    /// A text that is compiled form by form.
    Text(FormText),
    /// Out of the table: a builtin works on it.
    Taken,
}

impl CompilerJob {
    /// Returns about how many bytes the job takes.
    fn bytes(&self) -> usize {
        match self {
            CompilerJob::Compilation(running) => {
                let expansion = running.expansion.as_ref().map_or(0, DatumWalk::bytes);
                let load = running.load.as_ref().map_or(0, |load| load.bytes());
                COMPILATION_BYTES + running.compilation.bytes() + running.unit.bytes() + expansion + load
            }
            CompilerJob::Form(form) => form.walk.bytes() + form.unit.bytes(),
            CompilerJob::Text(text) => text.text.len(),
            CompilerJob::Taken => 0,
        }
    }
}

/// A text, and the position of its next form.
pub(crate) struct FormText {
    /// The whole text.
    pub(crate) text: Arc<str>,
    /// Name of the source, if diagnostics are to name places in it.
    pub(crate) name: Option<String>,
    /// Offset of the next form, in bytes.
    pub(crate) position: usize,
    /// Line of that offset, from 0.
    pub(crate) line: u32,
    /// Characters before it on that line.
    pub(crate) column: u32,
}

impl FormText {
    /// Returns the text from the position to `end`, if the source has a name.
    pub(crate) fn part(&self, end: usize) -> Option<Part<'_>> {
        let name = self.name.as_deref()?;
        let range = self.position..end;
        Some(Part { name, text: &self.text, range, line: self.line, column: self.column })
    }

    /// Moves the position forward to `end`.
    pub(crate) fn pass(&mut self, end: usize) {
        let passed = &self.text[self.position..end];
        let last = passed.rfind('\n');
        self.line += passed.bytes().filter(|&byte| byte == b'\n').count() as u32;
        let after = last.map_or(passed, |at| &passed[at + 1..]).chars().count() as u32;
        self.column = if last.is_some() { after } else { self.column + after };
        self.position = end;
    }
}

/// A form that becomes a datum.
pub(crate) struct FormWalk {
    /// The walk.
    pub(crate) walk: DatumWalk,
    /// Objects and uninterned symbols of the data.
    pub(crate) unit: Unit,
}

/// A compilation in progress.
pub(crate) struct ActiveCompilation {
    /// The compiler's state.
    pub(crate) compilation: Box<dyn Compilation>,
    /// Objects and uninterned symbols of its data.
    pub(crate) unit: Unit,
    /// The walk that makes a datum of the expansion with which the program has answered.
    pub(crate) expansion: Option<DatumWalk>,
    /// A step that the program has not received yet, for lack of room or because its module is being loaded.
    pub(crate) step: Option<Step>,
    /// The loading of its module.
    pub(crate) load: Option<Box<ModuleLoad<Module>>>,
    /// Whether it waits for the value of a module that was to be loaded.
    pub(crate) keeps: bool,
    /// Whether its form comes from a text without a name, as the embedder's do.
    pub(crate) is_nameless: bool,
}

impl ActiveCompilation {
    /// Begins a compilation of data of this unit. `is_nameless` says whether its form comes from a text
    /// without a name.
    pub(crate) fn new(compilation: Box<dyn Compilation>, unit: Unit, is_nameless: bool) -> ActiveCompilation {
        let (expansion, step, load) = (None, None, None);
        ActiveCompilation { compilation, unit, expansion, step, load, keeps: false, is_nameless }
    }
}

/// The compiler of a machine, and the jobs of its programs.
#[derive(Default)]
pub(crate) struct Compilations {
    /// The compiler, unless a builtin works with it.
    pub(crate) compiler: Option<Box<dyn Compile>>,
    /// Jobs of programs.
    pub(crate) jobs: SlotMap<JobId, CompilerJob>,
    /// About how many bytes those in the table take: a job changes only while it is out of the table.
    pub(crate) held: usize,
    /// Objects and uninterned symbols of the compilation under way.
    pub(crate) unit: RefCell<Unit>,
    /// Errors of the form of a nameless text that was refused last, for the embedder.
    pub(crate) refused: Vec<Diagnostic>,
    /// Units of ended jobs that are still to be freed.
    pub(crate) remains: Vec<UnitRemains>,
    /// Number of jobs so far.
    pub(crate) begun: u64,
}

impl Compilations {
    /// Calls `visit` with every object that compilations keep alive.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        self.unit.borrow().roots(visit);
        for job in self.jobs.values() {
            match job {
                CompilerJob::Compilation(running) => {
                    running.unit.roots(visit);
                    if let Some(walk) = &running.expansion {
                        walk.roots(visit);
                    }
                    if let Some(load) = &running.load {
                        load.roots(visit);
                    }
                }
                CompilerJob::Form(form) => {
                    form.walk.roots(visit);
                    form.unit.roots(visit);
                }
                CompilerJob::Text(_) | CompilerJob::Taken => {}
            }
        }
    }

    /// Adds a job and returns its handle.
    pub(crate) fn add(&mut self, job: CompilerJob) -> Value {
        self.begun += 1;
        self.held += job.bytes();
        let id = self.jobs.insert(job).data().as_ffi();
        // A key's version stays far below the limit: it grows by two for each reuse of a slot.
        Value::handle(id as u32, (id >> 32) as u32 % Value::GENERATION_LIMIT).unwrap_or(Value::NIL)
    }

    /// Returns about how many bytes the jobs take.
    pub(crate) fn bytes(&self) -> usize {
        self.held + self.remains.iter().map(UnitRemains::bytes).sum::<usize>()
    }

    fn find(&self, handle: Value) -> Option<JobId> {
        let (index, generation) = handle.as_handle()?;
        let id = JobId::from(KeyData::from_ffi(u64::from(generation) << 32 | u64::from(index)));
        self.jobs.contains_key(id).then_some(id)
    }

    /// Takes the job that `handle` names out of the table, until [`Compilations::put_back`]. `None` if it has
    /// ended.
    pub(crate) fn take(&mut self, handle: Value) -> Option<(JobId, CompilerJob)> {
        let id = self.find(handle)?;
        let job = std::mem::replace(self.jobs.get_mut(id)?, CompilerJob::Taken);
        self.held = self.held.saturating_sub(job.bytes());
        Some((id, job))
    }

    /// Puts a job back, unless it was ended meanwhile.
    pub(crate) fn put_back(&mut self, id: JobId, job: CompilerJob) {
        if let Some(slot) = self.jobs.get_mut(id) {
            self.held += job.bytes();
            *slot = job;
        }
    }

    /// Ends the job that `handle` names, if there is one. Its data are freed by [`Compilations::free`].
    pub(crate) fn end(&mut self, handle: Value) {
        let job = self.find(handle).and_then(|id| self.jobs.remove(id));
        self.held = self.held.saturating_sub(job.as_ref().map_or(0, CompilerJob::bytes));
        match job {
            Some(CompilerJob::Compilation(running)) => self.remains.push(UnitRemains::new(running.unit)),
            Some(CompilerJob::Form(form)) => self.remains.push(UnitRemains::new(form.unit)),
            Some(CompilerJob::Text(_) | CompilerJob::Taken) | None => {}
        }
    }

    /// Frees at most `allowed` data of jobs that have ended. Returns how many it has freed, and whether there
    /// are more.
    pub(crate) fn free(&mut self, allowed: usize) -> (usize, bool) {
        let mut left = allowed;
        while left > 0
            && let Some(remains) = self.remains.last_mut()
        {
            left = remains.free(left);
            if left > 0 {
                self.remains.pop();
            }
        }
        (allowed - left, !self.remains.is_empty())
    }
}
