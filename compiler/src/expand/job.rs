//! Jobs: the steps in which the expander works, and the answers that it waits for.
//!
//! A job expands one form into one node, or does what has to happen between two forms. These types hold no
//! behaviour: every file of the expander may use them, and they use none of the files that carry them out.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::form::{Form, is_known};
use super::function::{Body, FunctionText};
use super::origin::OriginId;
use super::scope::ScopeEntry;
use super::setf::PlaceUse;
use crate::core::{BlockId, BoundVariable, LambdaId, NodeId, VarId};

/// Destination of an expansion.
#[derive(Clone, Copy, Debug)]
pub(super) struct To {
    /// Node to be filled.
    pub(super) node: NodeId,
    /// Lambda around the node.
    pub(super) lambda: LambdaId,
    /// Nesting depth of the node.
    pub(super) depth: u32,
    /// Macro call that made the form.
    pub(super) origin: Option<OriginId>,
    /// Place of the form in the source, or of the form around it.
    pub(super) span: Span,
    /// Whether the value is unused.
    pub(super) is_dropped: bool,
}

impl To {
    /// Whether this is the place of the whole form of a chunk.
    pub(super) fn is_whole_chunk(self) -> bool {
        self.node == NodeId(0)
    }

    /// Returns the same destination at the place of `form`, if that is known.
    pub(super) fn at(self, form: &Datum) -> To {
        if is_known(form.span()) { To { span: form.span(), ..self } } else { self }
    }
}

/// How top-level forms are processed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// For a file.
    File {
        /// Whether every form is evaluated at compile time, too.
        now_too: bool,
    },
    /// For `eval`, or within an `eval-when` that applies at compile time only.
    Evaluate,
}

/// Circumstances of a top-level form.
#[derive(Clone, Copy, Debug)]
pub(super) struct Top {
    /// How the form is processed.
    pub(super) mode: Mode,
    /// Whether its value is the value of the whole.
    pub(super) is_last: bool,
    /// Macro call that made the form.
    pub(super) origin: Option<OriginId>,
    /// Place of the form in the source.
    pub(super) span: Span,
}

impl Top {
    /// Returns the circumstances of a form of a file.
    pub(super) fn file() -> Top {
        Top { mode: Mode::File { now_too: false }, is_last: false, origin: None, span: Span::default() }
    }

    /// Returns the circumstances of a form given to `eval`.
    pub(super) fn evaluate() -> Top {
        Top { mode: Mode::Evaluate, is_last: true, origin: None, span: Span::default() }
    }

    /// Returns the same circumstances at the place of `form`, if that is known.
    pub(super) fn at(self, form: &Datum) -> Top {
        if is_known(form.span()) { Top { span: form.span(), ..self } } else { self }
    }
}

/// Parts of a long form (bindings, clauses, definitions) that are looked at in one step.
pub(super) const PARTS_AT_ONCE: usize = 1000;

/// A binding of a `let`: the name as written, its symbol, and the form of the value.
#[derive(Debug)]
pub(super) struct VariableBinding {
    pub(super) datum: Datum,
    pub(super) symbol: Symbol,
    pub(super) value: Datum,
}

/// A `let` some of whose bindings are known to be in order.
#[derive(Debug)]
pub(super) struct UncheckedLet {
    /// The whole form.
    pub(super) form: Form,
    pub(super) to: To,
    /// Whether variables are bound one after another.
    pub(super) sequential: bool,
    /// Bindings that are to be looked at, as written.
    pub(super) items: std::vec::IntoIter<Datum>,
    /// Bindings that are in order.
    pub(super) found: Vec<VariableBinding>,
    /// Places of the names, which must differ unless variables are bound one after another.
    pub(super) seen: FxHashMap<Symbol, Span>,
}

/// A `let` some of whose variables are bound.
#[derive(Debug)]
pub(super) struct LetBindings {
    /// The whole form.
    pub(super) form: Form,
    pub(super) to: To,
    /// Whether variables are bound one after another.
    pub(super) sequential: bool,
    /// Bindings that are to be looked at.
    pub(super) found: std::vec::IntoIter<VariableBinding>,
    pub(super) body: Body,
    /// Jobs to run once all variables are bound, in the order found.
    pub(super) jobs: Vec<Job>,
    /// Names that enter the scope of the body.
    pub(super) entries: Vec<ScopeEntry>,
    /// The variables, and the nodes of their values.
    pub(super) variables: Vec<(BoundVariable, NodeId)>,
    /// Names of the variables.
    pub(super) bound: Vec<Symbol>,
}

/// A long `cond` some of whose clauses are part of the block that they leave.
#[derive(Debug)]
pub(super) struct LongCond {
    /// The whole form, whose arguments are the clauses.
    pub(super) form: Form,
    pub(super) to: To,
    pub(super) block: BlockId,
    /// Destination of the row of clauses.
    pub(super) row: To,
    /// Clauses that are to be looked at.
    pub(super) items: std::vec::IntoIter<Datum>,
    /// Nodes of the others.
    pub(super) nodes: Vec<NodeId>,
    /// Jobs that fill these nodes.
    pub(super) jobs: Vec<Job>,
}

/// A `flet` or `labels` some of whose functions are known to be in order.
#[derive(Debug)]
pub(super) struct LocalFunctions {
    /// The whole form.
    pub(super) form: Form,
    pub(super) to: To,
    /// Whether the functions see each other.
    pub(super) recursive: bool,
    /// Definitions that are to be looked at, as written.
    pub(super) items: std::vec::IntoIter<Datum>,
    /// Places of the names, which must differ.
    pub(super) seen: FxHashMap<Symbol, Span>,
    /// The functions.
    pub(super) functions: Vec<(VarId, LambdaId)>,
    /// Their names, as they enter a scope.
    pub(super) entries: Vec<ScopeEntry>,
    /// Jobs that expand their lambda expressions.
    pub(super) lambdas: Vec<Job>,
}

/// A step of the expander.
#[derive(Debug)]
pub(super) enum Job {
    /// Expands a form.
    Expand(Datum, To),
    /// Enters names into the scope.
    Enter(Vec<ScopeEntry>),
    /// Takes the newest entries out of the scope.
    Leave(usize),
    /// Expands the text of a function.
    Lambda(Box<FunctionText>, LambdaId, To),
    /// Looks at more bindings of a `let`.
    CheckLet(Box<UncheckedLet>),
    /// Binds more variables of a `let`.
    Let(Box<LetBindings>),
    /// Looks at more clauses of a long `cond`.
    Cond(Box<LongCond>),
    /// Looks at more definitions of local functions.
    LocalFunctions(Box<LocalFunctions>),
    /// Compiles the function of a local macro, given as a form.
    Macro(Datum, To),
    /// Enters local macros; their functions are the newest of the kept objects.
    EnterMacros(Vec<Symbol>),
    /// Checks the expanded body of a recovery clause; the flag says whether the body is empty.
    CheckClause(To, bool),
    /// Checks which local functions, whose texts are expanded, can return.
    CheckReturns(Vec<(VarId, LambdaId)>),
    /// Processes a top-level form.
    TopLevel(Datum, Top),
    /// Finishes the innermost chunk.
    FinishChunk,
    /// Finds the five parts of a place.
    Place(Datum, To),
    /// Uses the newest places.
    Use(Box<PlaceUse>, To),
}

/// The request that the next answer belongs to.
#[derive(Debug)]
pub(super) enum AwaitedOutcome {
    /// Nothing was asked.
    Nothing,
    /// The expansion of a form.
    Form(To),
    /// The replacement that a compiler macro gives for a call.
    Call(Form, To),
    /// The expansion of a place.
    Place(To),
    /// The five values of a `define-setf-expander`.
    SetfExpansion(Datum, To),
    /// The expansion of a top-level form.
    TopLevel(Top),
    /// The function of a local macro.
    Object(Span),
    /// Whether a chunk could be loaded.
    Load(Span),
}
