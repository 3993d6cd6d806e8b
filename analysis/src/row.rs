//! The rows of the table of a program's failures: functions, tasks, clauses, forms, goals.

use std::collections::BTreeMap;

use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;

use crate::cause::shown_cause;
use crate::value::TaskKind;

/// A place of a program.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct CodePlace {
    /// Name of the source.
    pub source: String,
    /// Line, from 1; 0 if it is unknown.
    pub line: u32,
    /// Column, from 1.
    pub column: u32,
}

impl std::fmt::Display for CodePlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.source, self.line, self.column)
    }
}

/// A place where a failure begins, and the function there.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FailureOrigin {
    /// Place.
    pub place: CodePlace,
    /// Function, mock or task around it.
    pub function: String,
    /// Range of the form that fails: its source, start and end.
    pub(crate) range: (u32, u32, u32),
}

impl FailureOrigin {
    /// Returns the range of the form that fails.
    pub fn span(&self) -> Span {
        let (source, start, end) = self.range;
        Span::new(SourceId(source), start, end)
    }
}

/// A cause of failures, and where they begin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CauseRow {
    /// The cause in words, such as `:timeout`; `any` if it is not known, `unknown` for a function that is not
    /// known, each with a remark.
    pub cause: String,
    /// The cause, if it is known.
    pub name: Option<Symbol>,
    /// Places where the failures begin, in order.
    pub origins: Vec<FailureOrigin>,
    /// Clauses that have taken some of these failures before they went on outward.
    pub spent: Vec<CodePlace>,
    /// Whether it is a programming error.
    pub is_mistake: bool,
}

impl CauseRow {
    /// Returns the cause without a remark.
    pub fn short(&self) -> &str {
        let end = match &self.name {
            Some(name) => Some(shown_cause(name).len()),
            None => self.cause.find(' '),
        };
        end.and_then(|end| self.cause.get(..end)).unwrap_or(&self.cause)
    }
}

/// A function of the program.
#[derive(Clone, Debug)]
pub struct FunctionRow {
    /// Name in lower case.
    pub name: String,
    /// Place of the definition.
    pub place: CodePlace,
    /// Its last line.
    pub last_line: u32,
    /// Causes that may leave it.
    pub causes: Vec<CauseRow>,
    /// Whether it also fails as functions fail that it is given.
    pub fails_as_arguments: bool,
}

/// A task of the program.
#[derive(Clone, Debug)]
pub struct FailingTask {
    /// Name in lower case.
    pub name: String,
    /// Kind.
    pub kind: TaskKind,
    /// Place of the form that begins it; unknown for the main task.
    pub place: CodePlace,
    /// Causes that end it.
    pub causes: Vec<CauseRow>,
    /// Whether a form waits for it, and takes its failure.
    pub is_awaited: bool,
    /// Clauses in code that it runs, as indices of the rows of clauses.
    pub clauses: Vec<usize>,
}

/// A clause that takes failures.
#[derive(Clone, Debug)]
pub struct ClauseRow {
    /// Place of the clause, or of its form.
    pub place: CodePlace,
    /// Function around it.
    pub function: String,
    /// The cause or the type for which it is written.
    pub wanted: String,
    /// Its answer, in words.
    pub answer: String,
    /// Failures that it takes.
    pub causes: Vec<CauseRow>,
    /// Failures that may leave the clause itself.
    pub fails: Vec<CauseRow>,
    /// Range of its body.
    pub span: Span,
    /// Whether control cannot reach its end, as far as the program's functions show.
    pub never_ends: bool,
}

/// A form that handles failures of its body.
#[derive(Clone, Debug)]
pub struct HandlingForm {
    /// Place of the form.
    pub place: CodePlace,
    /// Range of the form, or of the call of the macro that it belongs to.
    pub span: Span,
    /// Failures of the body that a clause takes; a clause may take them in vain.
    pub taken: Vec<CauseRow>,
    /// Failures of the body that no clause takes.
    pub passing: Vec<CauseRow>,
}

/// A method of a goal.
#[derive(Clone, Debug)]
pub struct GoalMethod {
    /// Its test as the text has it; `always` or `otherwise` if that is true.
    pub test: String,
    /// Functions of the program that it calls.
    pub calls: Vec<String>,
}

/// A condition that `to-achieve` defines how to achieve.
#[derive(Clone, Debug)]
pub struct GoalRow {
    /// Name and parameters: `(attitude target)`.
    pub title: String,
    /// Place of the definition.
    pub place: CodePlace,
    /// Methods in the order of the text.
    pub methods: Vec<GoalMethod>,
    /// Functions that achieve or maintain it, in order.
    pub pursued_in: Vec<String>,
}

/// The failures of a program.
#[derive(Clone, Debug, Default)]
pub struct FailureTable {
    /// Functions, in the order of the text.
    pub functions: Vec<FunctionRow>,
    /// Tasks, the main one first.
    pub tasks: Vec<FailingTask>,
    /// Clauses, in the order of the text.
    pub clauses: Vec<ClauseRow>,
    /// Forms that handle failures, in the order of the text.
    pub forms: Vec<HandlingForm>,
    /// Goals, in the order of the text.
    pub goals: Vec<GoalRow>,
    /// Causes that may leave functions of modules which come with the system, by their names in lower case.
    pub of_modules: BTreeMap<String, Vec<Symbol>>,
    /// Causes that the program declares for functions, by their names in lower case.
    pub declared: BTreeMap<String, Vec<Symbol>>,
    /// Declarations that do not hold, clauses that never apply, and other warnings.
    pub findings: Vec<esl_bytecode::diagnostic::Diagnostic>,
    /// Places that call too many functions to be told apart, in order: the failures of all functions that are
    /// called at such places count at each.
    pub crowded: Vec<CodePlace>,
    /// Whether so many values flow in the program that the search for failures was given up: the table has
    /// none.
    pub is_incomplete: bool,
}
