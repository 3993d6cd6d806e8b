//! The interface between compiler and virtual machine. Neither depends on the other: the compiler looks names
//! up in an [`Environment`] and drives a [`CompileTimeHost`] that runs macros; the virtual machine receives a
//! [`Compile`] for `eval`, `load` and `read`.
//!
//! A compilation is a machine of steps: it never runs a macro itself but says that one is to be run, and is
//! told the outcome. So a running program can compile in a task that is preempted and aborted like any other.

use std::ops::Range;
use std::sync::Arc;

use crate::datum::{Datum, ObjectId};
use crate::diagnostic::Diagnostic;
use crate::locals::Locals;
use crate::module::Module;
pub use crate::signature::{NameUse, Signature};
use crate::span::{SourceId, Span};
use crate::symbol::Symbol;

/// How many arguments a function takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arity {
    /// At least so many.
    pub min: u32,
    /// At most so many; `None` without a limit.
    pub max: Option<u32>,
}

/// Global meaning of a symbol as a function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum GlobalFunction {
    /// Nothing yet.
    #[default]
    Undefined,
    /// A function; its arity if known.
    Function(Option<Arity>),
    /// A macro.
    Macro,
}

/// Global meaning of a symbol as a variable.
#[derive(Clone, Debug, Default)]
pub enum GlobalVariable {
    /// Nothing yet.
    #[default]
    Undefined,
    /// A special variable.
    Special,
    /// A constant with this value.
    Constant(Datum),
}

/// A function that reads a slot of a structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Accessor {
    /// Name of the class.
    pub class: Symbol,
    /// Number of the slot, from 0.
    pub slot: u16,
    /// How it may be set.
    pub access: SlotAccess,
}

/// How the slot of a structure may be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotAccess {
    /// To any object.
    Free,
    /// To objects of its type: by the macro `%set-checked-slot`.
    Checked,
    /// Not at all.
    ReadOnly,
}

/// All that is known of a symbol globally when a form is compiled.
#[derive(Clone, Debug, Default)]
pub struct Global {
    /// As a function.
    pub function: GlobalFunction,
    /// As a variable.
    pub variable: GlobalVariable,
    /// Whether it reads a slot of a structure.
    pub accessor: Option<Accessor>,
    /// Whether it belongs to the language: programs may not redefine it.
    pub locked: bool,
    /// For a function of the base language that was left out: what to use instead.
    pub instead: Option<String>,
}

/// Why a name could not be read as a symbol.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InternError {
    /// There is no package of this name.
    NoPackage(String),
    /// The package has no external symbol of this name; `exists` if it has an internal one.
    NotExternal {
        /// Whether there is an internal symbol of that name.
        exists: bool,
    },
}

/// Meanings of names while a form is read and compiled. No call of these runs the program.
pub trait Environment {
    /// Returns the global meaning of `symbol`.
    fn global(&self, symbol: &Symbol) -> Global;
    /// Returns the definition of the function `(setf symbol)`.
    fn setf_function(&self, symbol: &Symbol) -> GlobalFunction;
    /// Returns the data that the library recorded about `symbol` under `indicator`, such as the expander of a
    /// `defsetf`.
    fn property(&self, symbol: &Symbol, indicator: &Symbol) -> Option<Datum>;
    /// Returns the symbol that `name` denotes when read in the current package (`package` is `None`), or
    /// after `package:` or, if `internal`, `package::`.
    ///
    /// # Errors
    /// [`InternError`] if there is no such package or no such external symbol.
    fn intern(&mut self, package: Option<&str>, name: &str, internal: bool) -> Result<Symbol, InternError>;
    /// Returns the radix, from 2 to 36, in which integers and ratios are read that say nothing of theirs.
    fn read_base(&self) -> u32 {
        10
    }
    /// Returns whether `*readtable*` is not the standard one, so that the program itself reads its forms.
    fn has_own_syntax(&self) -> bool {
        false
    }
    /// Returns whether `*features*` has the feature `name`, in upper case; `None` if the program does not
    /// say.
    fn has_feature(&self, _name: &str) -> Option<bool> {
        None
    }
    /// Returns whether an object that data refer to is a pair, which is not a form.
    fn is_pair(&self, _object: ObjectId) -> bool {
        false
    }
    /// Returns a number for a fresh uninterned symbol of this compilation unit.
    fn fresh(&mut self) -> u32;
    /// Returns whether `symbol` names a type.
    fn is_type(&self, _symbol: &Symbol) -> bool {
        true
    }
    /// Names like `symbol` that are defined for such a use; the likeliest first.
    fn similar(&self, symbol: &Symbol, wanted: NameUse) -> Vec<Symbol>;
    /// Returns the parameters of the global function or macro in `cell`, if they are known; `cell` is its
    /// name, or [`setf_cell`](crate::symbol::setf_cell) of that.
    fn signature(&self, _cell: &Symbol) -> Option<Signature> {
        None
    }
}

/// Which macro is called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MacroRef {
    /// The global macro of this name.
    Global(Symbol),
    /// The function of a `macrolet`, as a step of [`Step::Load`] with `keep` returned it.
    Local(ObjectId),
}

/// A macro call to be run.
#[derive(Clone, Debug)]
pub struct MacroCall {
    /// The macro.
    pub function: MacroRef,
    /// The whole form.
    pub form: Datum,
    /// The local definitions around it.
    pub locals: Locals,
}

/// Next need of a compilation.
#[derive(Debug)]
pub enum Step {
    /// Run this macro and answer with [`StepOutcome::Expansion`] or [`StepOutcome::Failed`].
    Expand(MacroCall),
    /// Load this module and run its top level, at compile time. Answer with [`StepOutcome::Loaded`], or
    /// [`StepOutcome::Failed`]; if `keep`, with [`StepOutcome::Object`], the value of its last top-level
    /// form.
    Load {
        /// The module.
        module: Module,
        /// Whether the value is wanted.
        keep: bool,
    },
    /// A part of the work is done, and the compilation wants to go on. Answer with [`StepOutcome::More`].
    More,
    /// Find the module that the text being compiled requires by this name. Answer with
    /// [`StepOutcome::Module`]; with [`StepOutcome::Loaded`] if it is defined already where macros run, and
    /// the program is to find it when it runs; or with [`StepOutcome::Failed`].
    Require(String),
    /// The compilation is over. There is no module when one of the diagnostics is an error.
    Done(Option<Module>, Vec<Diagnostic>),
}

/// A module that a text requires.
#[derive(Clone, Debug)]
pub enum Required {
    /// Its text, and what that is called in diagnostics: it becomes part of what is compiled.
    Source {
        /// The name of the text.
        name: String,
        /// The text.
        text: Arc<str>,
    },
    /// Compiled already, and verified.
    Compiled(Box<Module>),
}

/// Beginning of the names of the sources of modules that come with the machine.
pub const MODULE_SOURCES: &str = "<esl>/";

/// A place in a source, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourcePlace {
    /// Name of the source.
    pub source: String,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
}

/// A failure of a part of the program that runs at compile time, such as a macro.
#[derive(Clone, Debug, Default)]
pub struct CompileTimeFailure {
    /// Report of the failure.
    pub report: String,
    /// Innermost place in the program, not in the library, at which it failed; `None` if there is none.
    pub place: Option<SourcePlace>,
    /// Objects that the failure is about, the likeliest culprit last. Parts of a form keep their places.
    pub culprits: Vec<Datum>,
    /// How a call of the macro that failed is written, such as `(when test &body body)`, if that is known.
    pub usage: Option<String>,
}

impl From<String> for CompileTimeFailure {
    fn from(report: String) -> CompileTimeFailure {
        CompileTimeFailure { report, ..CompileTimeFailure::default() }
    }
}

/// Outcome of a step.
#[derive(Debug)]
pub enum StepOutcome {
    /// First step: there is nothing to answer.
    Start,
    /// Go on.
    More,
    /// The macro's expansion.
    Expansion(Datum),
    /// The module has run.
    Loaded,
    /// The value that was to be kept.
    Object(ObjectId),
    /// The module that was asked for.
    Module(Required),
    /// The macro or module failed.
    Failed(CompileTimeFailure),
}

/// Work of a step: how much it may do, and how much it has done. The unit is a node of the program that is
/// made, or a part of a datum or of code that is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    allowed: u64,
    done: u64,
    passed: u64,
}

impl Work {
    /// Units of a step, for a program with tasks that wait for their turns: less than a millisecond.
    pub const STEP: u64 = 1000;

    /// Creates the work of a step that goes on to the next need, however far that is.
    pub fn unbounded() -> Work {
        Work::up_to(u64::MAX)
    }

    /// Creates the work of a step that returns [`Step::More`] soon after it has done `allowed` units.
    pub fn up_to(allowed: u64) -> Work {
        Work { allowed, done: 0, passed: 0 }
    }

    /// Notes that the forms given to macros, and their expansions, had `parts` since the last step.
    #[must_use]
    pub fn after_passing(self, parts: u64) -> Work {
        Work { passed: parts, ..self }
    }

    /// Notes that `units` were done.
    #[inline]
    pub fn add(&mut self, units: u64) {
        self.done = self.done.saturating_add(units);
    }

    /// Returns the units done.
    pub fn done(&self) -> u64 {
        self.done
    }

    /// Returns whether the step has done what it may.
    #[inline]
    pub fn is_done(&self) -> bool {
        self.done >= self.allowed
    }

    /// Takes the number of parts that passed through macros before the step.
    pub fn take_passed(&mut self) -> u64 {
        std::mem::take(&mut self.passed)
    }
}

/// A compilation under way.
pub trait Compilation: Send {
    /// Takes the outcome of the last step and works up to the next one, which is [`Step::More`] soon after
    /// the work that is allowed is done.
    fn step(&mut self, environment: &mut dyn Environment, answer: StepOutcome, work: &mut Work) -> Step;
    /// Returns about how many bytes of memory it holds.
    fn bytes(&self) -> usize;
    /// Draws one of its diagnostics as it is shown to people, with the source line when it is known.
    fn render(&self, diagnostic: &Diagnostic) -> String;
}

/// A part of a text from which one form was read. Spans in the form are those of the whole text.
#[derive(Clone, Debug)]
pub struct Part<'a> {
    /// Name of the source.
    pub name: &'a str,
    /// The whole text.
    pub text: &'a Arc<str>,
    /// The bytes of the part.
    pub range: Range<usize>,
    /// Line at which it begins, from 0.
    pub line: u32,
    /// Characters before it on that line.
    pub column: u32,
}

/// A compiler, for a virtual machine that evaluates at run time.
pub trait Compile: Send {
    /// Begins to compile one form, which is from nowhere or from a part of a text. Its value is what the last
    /// top-level function of the module returns.
    fn compile_form(&self, form: Datum, part: Option<Part<'_>>) -> Box<dyn Compilation>;
    /// Begins to compile a whole text, called `name` in diagnostics.
    fn compile_text(&self, name: &str, text: &str) -> Box<dyn Compilation>;
    /// Reads one datum of `text` from byte `start` on: the datum, `None` at the end of the text, and the
    /// offset after it.
    ///
    /// # Errors
    /// A diagnostic, for a text that is not a datum; [`Diagnostic::code`] tells an unfinished one from a
    /// wrong one.
    fn read(
        &self,
        environment: &mut dyn Environment,
        text: &str,
        start: usize,
    ) -> Result<(Option<Datum>, usize), Box<Diagnostic>>;
    /// Draws a diagnostic of a text that was read as it is shown to people; with the source line, if a name
    /// is given.
    fn render(&self, diagnostic: &Diagnostic, name: Option<&str>, text: &str) -> String;
}

/// Runs the compile-time parts of a program. Implemented over a virtual machine.
pub trait CompileTimeHost: Environment {
    /// Returns the number of parts of data that went through macros since the last call.
    fn take_passed(&mut self) -> u64 {
        0
    }
    /// Notes that a compilation has done `units` of work since the last call, and holds so many bytes.
    ///
    /// # Errors
    /// Why the compilation must not go on.
    fn account(&mut self, units: u64, bytes: usize) -> Result<(), Halt> {
        _ = (units, bytes);
        Ok(())
    }
    /// Runs a macro to its end, within a limit of ticks.
    ///
    /// # Errors
    /// The failure that ended it.
    fn expand(&mut self, call: &MacroCall) -> Result<Datum, CompileTimeFailure>;
    /// Loads a module and runs its top level.
    ///
    /// # Errors
    /// The failure that ended it.
    fn load(&mut self, module: Module, keep: bool) -> Result<Option<ObjectId>, CompileTimeFailure>;
}

/// Why a module is missing and what to do about it, in the words of the finder of modules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoModule(pub String);

/// Finds the module of a name.
///
/// # Errors
/// [`NoModule`].
pub type Library<'a> = &'a mut dyn FnMut(&str) -> Result<Required, NoModule>;

/// Why a compilation was stopped from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Halt {
    /// It takes more memory than it may.
    Memory,
    /// It has spent the budget.
    Budget,
    /// The process is asked to end.
    Signal,
}

/// Units of work between two calls of [`CompileTimeHost::account`].
const ACCOUNTED: u64 = 16 * Work::STEP;

/// Works a compilation through to its end with the help of `host`. A text that requires modules cannot be
/// compiled so. One that is stopped by the host has no module.
pub fn drive(
    compilation: &mut dyn Compilation,
    host: &mut dyn CompileTimeHost,
) -> (Option<Module>, Vec<Diagnostic>) {
    let driven =
        drive_with(compilation, host, &mut |_| Err(NoModule("modules are not available here".into())));
    driven.unwrap_or_default()
}

/// As [`drive`]; `library` finds the modules that the text requires.
///
/// # Errors
/// The errors of [`CompileTimeHost::account`].
pub fn drive_with(
    compilation: &mut dyn Compilation,
    host: &mut dyn CompileTimeHost,
    library: Library<'_>,
) -> Result<(Option<Module>, Vec<Diagnostic>), Halt> {
    let mut answer = StepOutcome::Start;
    loop {
        // A trait object is not upcast through a method call: say which of its two faces is meant.
        let mut work = Work::up_to(ACCOUNTED).after_passing(host.take_passed());
        let environment: &mut dyn Environment = host;
        let step = compilation.step(environment, answer, &mut work);
        host.account(work.done(), compilation.bytes())?;
        answer = match step {
            Step::Done(module, diagnostics) => return Ok((module, diagnostics)),
            Step::More => StepOutcome::More,
            Step::Expand(call) => match host.expand(&call) {
                Ok(expansion) => StepOutcome::Expansion(expansion),
                Err(failure) => StepOutcome::Failed(failure),
            },
            Step::Load { module, keep } => match host.load(module, keep) {
                Ok(Some(object)) => StepOutcome::Object(object),
                Ok(None) => StepOutcome::Loaded,
                Err(failure) => StepOutcome::Failed(failure),
            },
            Step::Require(name) => match library(&name) {
                Ok(module) => StepOutcome::Module(module),
                Err(NoModule(reason)) => StepOutcome::Failed(reason.into()),
            },
        };
    }
}

/// The place of a span, for people: the source's name, line and column from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The source.
    pub source: SourceId,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
}

/// The offsets at which the lines of a text begin, to turn spans into places.
#[derive(Clone, Debug)]
pub struct LineIndex {
    /// Number of the first line, from 0.
    first: u32,
    starts: Vec<u32>,
}

impl LineIndex {
    /// Finds the lines of `text`.
    pub fn new(text: &str) -> LineIndex {
        LineIndex::of_part(text, 0..text.len(), 0)
    }

    /// Finds the lines of a part of `text`, which begins in line `first`, from 0.
    pub fn of_part(text: &str, part: Range<usize>, first: u32) -> LineIndex {
        let start = text[..part.start].rfind('\n').map_or(0, |at| at + 1);
        let breaks = text.as_bytes()[part.clone()].iter().enumerate().filter(|&(_, &byte)| byte == b'\n');
        let starts = breaks.map(|(at, _)| (part.start + at) as u32 + 1);
        LineIndex { first, starts: std::iter::once(start as u32).chain(starts).collect() }
    }

    /// Line and column of the start of `span`, which lies in the part of `text` whose lines these are.
    pub fn place(&self, text: &str, span: Span) -> Place {
        let line = self.starts.partition_point(|&start| start <= span.start).max(1) - 1;
        let start = self.starts[line] as usize;
        let end = (span.start as usize).min(text.len());
        let column = text.get(start..end).map_or(0, |prefix| prefix.chars().count());
        Place { source: span.source, line: self.first + line as u32 + 1, column: column as u32 + 1 }
    }
}
