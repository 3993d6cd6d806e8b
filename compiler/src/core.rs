//! The core language: what is left of a top-level form when macros are expanded and names are resolved.
//!
//! The expander builds a [`Core`], the lowering turns it into code. Nodes live in one arena and name each other by
//! number, so that building, walking and dropping them needs no native recursion. Lexical names are gone: a variable,
//! block, tag or local function is a number, and the lambda that owns it is recorded, so that captures can be found.
//!
//! Invariants: a node is referred to by exactly one other node or lambda; no [`NodeKind::Hole`] is left when the
//! expander has finished; parents have lower numbers than their children.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index into its table.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(/** A node of the tree. */ NodeId);
id!(/** A lexical variable, or a local function's variable. */ VarId);
id!(/** A function's text. */ LambdaId);
id!(/** A lexical block. */ BlockId);
id!(/** A tagbody. */ TagbodyId);

/// One top-level form.
#[derive(Clone, Debug, Default)]
pub struct Core {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The lexical variables.
    pub variables: Vec<Variable>,
    /// The functions; the first is the form itself, as a function of no parameters.
    pub lambdas: Vec<Lambda>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The tagbodies.
    pub tagbodies: Vec<Tagbody>,
}

/// A node: an expression and where it was written.
#[derive(Clone, Debug)]
pub struct Node {
    /// What it is.
    pub kind: NodeKind,
    /// Where it was written; for what a macro made, the macro call.
    pub span: Span,
}

/// A lexical variable.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name, for messages.
    pub name: Symbol,
    /// Where it is bound.
    pub span: Span,
    /// The lambda in which it is bound.
    pub owner: LambdaId,
    /// Whether some `setq` sets it after it is bound.
    pub is_assigned: bool,
    /// Whether a lambda inside its owner refers to it.
    pub is_captured: bool,
    /// Whether anything reads it, or uses the value of an assignment to it.
    pub is_read: bool,
    /// Whether it is a local function that can be seen never to return.
    pub never_returns: bool,
}

/// A function's text.
#[derive(Clone, Debug)]
pub struct Lambda {
    /// Its name: a symbol, or a list such as `(SETF X)`, `(FLET X)`.
    pub name: Option<Datum>,
    /// The lambda list as written.
    pub lambda_list: Option<Datum>,
    /// The documentation string.
    pub documentation: Option<Datum>,
    /// The lambda around it.
    pub parent: Option<LambdaId>,
    /// Where it was written.
    pub span: Span,
    /// The required parameters.
    pub required: Vec<Parameter>,
    /// The optional parameters.
    pub optional: Vec<OptionalParameter>,
    /// The rest parameter.
    pub rest: Option<Parameter>,
    /// The key parameters; `None` without `&key`.
    pub keys: Option<Vec<KeyParameter>>,
    /// Whether other keys are allowed.
    pub allow_other_keys: bool,
    /// The body.
    pub body: NodeId,
}

impl Lambda {
    /// Creates the text of a function of no parameters.
    pub(crate) fn without_parameters(parent: Option<LambdaId>, span: Span, body: NodeId) -> Lambda {
        Lambda {
            name: None,
            lambda_list: None,
            documentation: None,
            parent,
            span,
            required: Vec::new(),
            optional: Vec::new(),
            rest: None,
            keys: None,
            allow_other_keys: false,
            body,
        }
    }

    /// Whether it takes required parameters only.
    pub fn is_exact(&self) -> bool {
        self.optional.is_empty() && self.rest.is_none() && self.keys.is_none()
    }

    /// Whether it takes just `count` arguments.
    pub fn takes_exactly(&self, count: usize) -> bool {
        self.is_exact() && self.required.len() == count
    }

    /// Whether it is the global function `name`.
    pub fn is_named(&self, name: &Symbol) -> bool {
        self.name.as_ref().and_then(Datum::as_symbol) == Some(name)
    }
}

/// A parameter. Parameters become visible, and special ones bound, one after another from left to right.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// The variable that receives the argument.
    pub variable: VarId,
    /// Whether the argument is also bound to the special variable of the parameter's name. The lexical variable is
    /// then anonymous.
    pub is_special: bool,
}

/// A parameter with a default.
#[derive(Clone, Copy, Debug)]
pub struct OptionalParameter {
    /// The parameter.
    pub parameter: Parameter,
    /// The default's form.
    pub default: NodeId,
    /// The parameter that tells whether an argument was given.
    pub supplied: Option<Parameter>,
}

/// A key parameter.
#[derive(Clone, Debug)]
pub struct KeyParameter {
    /// The symbol that selects it in a call, usually a keyword.
    pub key: Symbol,
    /// Parameter, default and supplied-p.
    pub optional: OptionalParameter,
}

/// A block.
#[derive(Clone, Debug)]
pub struct Block {
    /// Its name, for messages.
    pub name: Option<Symbol>,
    /// The lambda that it is in.
    pub owner: LambdaId,
    /// Whether a lambda inside returns from it.
    pub is_captured: bool,
    /// Whether anything returns from it.
    pub is_used: bool,
}

/// A tagbody.
#[derive(Clone, Debug)]
pub struct Tagbody {
    /// The lambda that it is in.
    pub owner: LambdaId,
    /// Whether a lambda inside goes to one of its tags.
    pub is_captured: bool,
}

/// What a binding form binds.
#[derive(Clone, Debug)]
pub enum BoundVariable {
    /// A lexical variable.
    Lexical(VarId),
    /// A special variable, dynamically.
    Special(Symbol),
}

/// What is called.
#[derive(Clone, Debug)]
pub enum Callee {
    /// The global function kept in this symbol; for `(setf x)`, in the symbol that [`crate::expand`] assigns to it.
    Global(Symbol),
    /// A function that is written in Rust; the number of arguments has been checked.
    Builtin(Builtin),
    /// A local function.
    Local(VarId),
    /// What the node evaluates to: a function or a symbol that names one.
    Value(NodeId),
}

/// A clause of [`NodeKind::HandlerCase`].
#[derive(Clone, Debug)]
pub struct HandlerClause {
    /// The type of conditions that it takes.
    pub condition_type: Datum,
    /// The variable that receives the condition.
    pub variable: VarId,
    /// What it does, after unwinding.
    pub body: NodeId,
}

/// What a node is. Unless said otherwise a node passes on all values of the form in its last position.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// A place that the expander has yet to fill.
    Hole,
    /// A constant.
    Constant(Datum),
    /// Reads a lexical variable.
    Local(VarId),
    /// Sets a lexical variable; its value is that value.
    SetLocal(VarId, NodeId),
    /// Reads a special variable.
    Special(Symbol),
    /// Sets a special variable; its value is that value.
    SetSpecial(Symbol, NodeId),
    /// The global function kept in this symbol.
    FunctionRef(Symbol),
    /// The builtin as a function object.
    BuiltinRef(Builtin),
    /// A closure.
    Lambda(LambdaId),
    /// Test, consequent, alternative.
    If(NodeId, NodeId, NodeId),
    /// The value of the last, after the others; `NIL` if there is none.
    Progn(Vec<NodeId>),
    /// The first that is `NIL`, or the values of the last; `T` if there is none. Not used for one form.
    And(Vec<NodeId>),
    /// The first that is not `NIL` (one value), or the values of the last; `NIL` if there is none.
    Or(Vec<NodeId>),
    /// Binds variables around a body. In parallel: every value is computed before the first binding; otherwise one
    /// after another.
    Let {
        /// Whether one after another.
        sequential: bool,
        /// What is bound to what.
        bindings: Vec<(BoundVariable, NodeId)>,
        /// The body.
        body: NodeId,
    },
    /// Binds local functions around a body. Scope is resolved already: the same node serves `flet` and `labels`.
    Functions {
        /// The functions. Their variables are never assigned.
        definitions: Vec<(VarId, LambdaId)>,
        /// The body.
        body: NodeId,
    },
    /// A block.
    Block(BlockId, NodeId),
    /// Leaves a block with the values of the form.
    ReturnFrom(BlockId, NodeId),
    /// A tagbody: forms, among which the tags stand. Its value is `NIL`.
    Tagbody(TagbodyId, Vec<TagbodyItem>),
    /// Goes to a tag: its number among the tags of the tagbody.
    Go(TagbodyId, u32),
    /// A catch: tag, body.
    Catch(NodeId, NodeId),
    /// A throw: tag, values.
    Throw(NodeId, NodeId),
    /// Protected form, cleanup. Gives the values of the protected form.
    UnwindProtect(NodeId, NodeId),
    /// Symbols, values, body.
    Progv(NodeId, NodeId, NodeId),
    /// A call. Arguments are evaluated from left to right, after the callee if that is a node.
    Call(Callee, Vec<NodeId>),
    /// A call whose last argument is a list of arguments.
    Apply(Callee, Vec<NodeId>),
    /// Multiple values.
    Values(Vec<NodeId>),
    /// Binds variables to the values of a form around a body: targets, form, body.
    BindValues(Vec<BoundVariable>, NodeId, NodeId),
    /// Calls a function with all values of the forms.
    CallValues(NodeId, Vec<NodeId>),
    /// All values of the first form, after which the second has been evaluated.
    FirstValues(NodeId, NodeId),
    /// Runs a body; a condition of a clause's type that is signalled in it unwinds to here and runs the clause.
    HandlerCase(NodeId, Vec<HandlerClause>),
    /// Runs a body with recovery procedures.
    Recovery {
        /// A vector: `NIL`, then for each clause its cause and how often it may run, then `NIL`.
        table: Datum,
        /// The function that runs the clauses, always a lambda: of the form's state, the place of the clause in it, and the
        /// list of the failure's arguments. Throws to the state: it with `NIL` to run the body again, `T` with a result
        /// to leave the form.
        procedures: NodeId,
        /// The body.
        body: NodeId,
    },
    /// Runs a body; if a failure, an abort or an expired limit leaves it, the second form is evaluated, and a failure then
    /// goes on from there.
    FailureCleanup(NodeId, NodeId),
    /// Runs a body (second) with the list of `(type . function)` that the first form gives as handlers.
    Handlers(NodeId, NodeId),
    /// Runs a body (second) in which entries of the control stack from the height that the first form gives are masked.
    Mask(NodeId, NodeId),
    /// Reads a slot of a structure: class, number of the slot, instance.
    Slot(Symbol, u16, NodeId),
    /// Sets a slot of a structure: class, number of the slot, instance, value. Its value is that value.
    SetSlot(Symbol, u16, NodeId, NodeId),
    /// Whether a form's value is an instance of a structure class.
    IsInstance(Symbol, NodeId),
}

/// An item of a tagbody.
#[derive(Clone, Debug)]
pub enum TagbodyItem {
    /// A tag. Tags are numbered in order.
    Tag,
    /// A form, evaluated for effect.
    Form(NodeId),
}
