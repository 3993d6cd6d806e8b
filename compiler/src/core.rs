//! The core language: a top-level form after macros are expanded and names are resolved.
//!
//! The expander builds a [`Core`], the lowering turns it into code. Nodes live in one arena and refer to each
//! other by number, so that building, walking and dropping them needs no native recursion. Lexical names are
//! gone: a variable, block, tag or local function is a number, and the lambda that owns it is recorded, so
//! that captures can be found.
//!
//! Invariants: exactly one other node or lambda refers to a node; no [`NodeKind::Hole`] is left when the
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
            /// Returns the index into its table.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(/** A node of the tree. */ NodeId);
id!(/** A lexical variable, or a local function's variable. */ VarId);
id!(/** The text of a function. */ LambdaId);
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

/// Bytes of the list entries by which a node refers to others, on average.
const NODE_LINKS: usize = 16;

impl Core {
    /// Returns about how many bytes it takes.
    pub fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + self.nodes.len() * NODE_LINKS
            // Each has an entry among the local names, too.
            + self.variables.capacity() * 2 * size_of::<Variable>()
            + self.lambdas.capacity() * size_of::<Lambda>()
            + self.blocks.capacity() * size_of::<Block>()
            + self.tagbodies.capacity() * size_of::<Tagbody>()
    }
}

/// A node: an expression and its place in the source.
#[derive(Clone, Debug)]
pub struct Node {
    /// The expression.
    pub kind: NodeKind,
    /// Place in the source; of an expression that a macro made, that of the macro call.
    pub span: Span,
}

/// A lexical variable.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Name, for messages.
    pub name: Symbol,
    /// Place of the binding.
    pub span: Span,
    /// Lambda in which it is bound.
    pub owner: LambdaId,
    /// Whether a `setq` sets it after it is bound.
    pub is_assigned: bool,
    /// Whether a lambda inside its owner refers to it.
    pub is_captured: bool,
    /// Whether anything reads it, or uses the value of an assignment to it.
    pub is_read: bool,
    /// Whether it is a local function that evidently never returns.
    pub never_returns: bool,
}

/// The text of a function.
#[derive(Clone, Debug)]
pub struct Lambda {
    /// Name: a symbol, or a list such as `(SETF X)`, `(FLET X)`.
    pub name: Option<Datum>,
    /// Lambda list as written.
    pub lambda_list: Option<Datum>,
    /// Documentation string.
    pub documentation: Option<Datum>,
    /// Lambda around it.
    pub parent: Option<LambdaId>,
    /// Place in the source.
    pub span: Span,
    /// Required parameters.
    pub required: Vec<Parameter>,
    /// Optional parameters.
    pub optional: Vec<OptionalParameter>,
    /// Rest parameter.
    pub rest: Option<Parameter>,
    /// Key parameters; `None` without `&key`.
    pub keys: Option<Vec<KeyParameter>>,
    /// Whether other keys are allowed.
    pub allow_other_keys: bool,
    /// Body.
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

    /// Returns the number of its parameters; flags that say whether an argument was given are not counted.
    pub fn parameters(&self) -> usize {
        let keys = self.keys.as_ref().map_or(0, Vec::len);
        self.required.len() + self.optional.len() + usize::from(self.rest.is_some()) + keys
    }

    /// Whether it takes required parameters only.
    pub fn is_exact(&self) -> bool {
        self.optional.is_empty() && self.rest.is_none() && self.keys.is_none()
    }

    /// Whether it takes exactly `count` arguments.
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
    /// Variable that receives the argument.
    pub variable: VarId,
    /// Whether the argument is also bound to the special variable of the parameter's name. The lexical
    /// variable is then anonymous.
    pub is_special: bool,
}

/// A parameter with a default.
#[derive(Clone, Copy, Debug)]
pub struct OptionalParameter {
    /// The parameter.
    pub parameter: Parameter,
    /// Form of the default.
    pub default: NodeId,
    /// Parameter that says whether an argument was given.
    pub supplied: Option<Parameter>,
}

/// A key parameter.
#[derive(Clone, Debug)]
pub struct KeyParameter {
    /// Symbol that selects it in a call, usually a keyword.
    pub key: Symbol,
    /// Parameter, default and supplied-p.
    pub optional: OptionalParameter,
}

/// A block.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name, for messages.
    pub name: Option<Symbol>,
    /// Lambda around it.
    pub owner: LambdaId,
    /// Whether a lambda inside it returns from it.
    pub is_captured: bool,
    /// Whether anything returns from it.
    pub is_used: bool,
}

/// A tagbody.
#[derive(Clone, Debug)]
pub struct Tagbody {
    /// Lambda around it.
    pub owner: LambdaId,
    /// Whether a lambda inside it goes to one of its tags.
    pub is_captured: bool,
}

/// A variable that a form binds.
#[derive(Clone, Debug)]
pub enum BoundVariable {
    /// A lexical variable.
    Lexical(VarId),
    /// A special variable, dynamically.
    Special(Symbol),
}

/// Function of a call.
#[derive(Clone, Debug)]
pub enum Callee {
    /// The global function kept in this symbol. A function `(setf x)` has a symbol of its own for that.
    Global(Symbol),
    /// A function written in Rust. The number of arguments has been checked.
    Builtin(Builtin),
    /// A local function.
    Local(VarId),
    /// The value of the node: a function or a symbol that names one.
    Value(NodeId),
}

/// A clause of [`NodeKind::HandlerCase`].
#[derive(Clone, Debug)]
pub struct HandlerClause {
    /// Type of the conditions that it takes.
    pub condition_type: Datum,
    /// Variable that receives the condition.
    pub variable: VarId,
    /// Body, which runs after unwinding.
    pub body: NodeId,
}

/// Kind of a node. Unless said otherwise, the values of a node are those of the form in its last position.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// A node that the expander has not filled yet.
    Hole,
    /// A constant.
    Constant(Datum),
    /// Reads a lexical variable.
    Local(VarId),
    /// Sets a lexical variable; the value of the node is the new value.
    SetLocal(VarId, NodeId),
    /// Reads a special variable.
    Special(Symbol),
    /// Sets a special variable; the value of the node is the new value.
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
    /// Binds variables around a body: either one after another, or in parallel, every value before the first
    /// binding.
    Let {
        /// Whether variables are bound one after another.
        sequential: bool,
        /// Variables and their values.
        bindings: Vec<(BoundVariable, NodeId)>,
        /// The body.
        body: NodeId,
    },
    /// Binds local functions around a body. Scope is resolved already, so the same node serves `flet` and
    /// `labels`.
    Functions {
        /// Functions. Their variables are never assigned.
        definitions: Vec<(VarId, LambdaId)>,
        /// The body.
        body: NodeId,
    },
    /// A block.
    Block(BlockId, NodeId),
    /// Leaves a block with the values of the form.
    ReturnFrom(BlockId, NodeId),
    /// A tagbody: tags and forms. Its value is `NIL`.
    Tagbody(TagbodyId, Vec<TagbodyItem>),
    /// Goes to a tag, given by its number in the tagbody.
    Go(TagbodyId, u32),
    /// A catch: tag, body.
    Catch(NodeId, NodeId),
    /// A throw: tag, values.
    Throw(NodeId, NodeId),
    /// Protected form, cleanup. The values are those of the protected form.
    UnwindProtect(NodeId, NodeId),
    /// Symbols, values, body.
    Progv(NodeId, NodeId, NodeId),
    /// A call. Arguments are evaluated from left to right, after the callee if that is a node.
    Call(Callee, Vec<NodeId>),
    /// A call whose last argument is a list of arguments.
    Apply(Callee, Vec<NodeId>),
    /// Multiple values.
    Values(Vec<NodeId>),
    /// Binds variables to the values of a form around a body: variables, form, body.
    BindValues(Vec<BoundVariable>, NodeId, NodeId),
    /// Calls a function with all values of the forms.
    CallValues(NodeId, Vec<NodeId>),
    /// All values of the first form, after the second has been evaluated.
    FirstValues(NodeId, NodeId),
    /// Runs a body. A condition of a clause's type that is signalled in it unwinds to here and runs the
    /// clause.
    HandlerCase(NodeId, Vec<HandlerClause>),
    /// Runs a body with recovery procedures.
    Recovery {
        /// A form whose value is a simple vector: `NIL`, then for each clause its cause and how often it may
        /// run, then `NIL`. The machine does not change it; a literal costs nothing.
        table: NodeId,
        /// The function that runs the clauses, always a lambda. It takes the form's state, the position of
        /// the clause in the state, and the list of the failure's arguments. To run the body again it throws
        /// the state and any value to the state; to leave the form, `NIL` and a result.
        procedures: NodeId,
        /// The body.
        body: NodeId,
    },
    /// Runs a body. If a failure, an abort or an expired limit leaves it, the second form is evaluated; a
    /// failure then continues from there.
    FailureCleanup(NodeId, NodeId),
    /// Runs a body (second) with handlers: the first form returns a list of `(type . function)`.
    Handlers(NodeId, NodeId),
    /// Runs a body (second) within which entries of the control stack are masked, from the height that the
    /// first form returns.
    Mask(NodeId, NodeId),
    /// Reads a slot of a structure: class, number of the slot, instance.
    Slot(Symbol, u16, NodeId),
    /// Sets a slot of a structure: class, number of the slot, instance, value. The value of the node is the
    /// new value.
    SetSlot(Symbol, u16, NodeId, NodeId),
    /// Tests whether a form's value is an instance of a structure class.
    IsInstance(Symbol, NodeId),
    /// Counts that control passes the place with this number; the value is `NIL`. Made by `cover` only.
    Pass(u32),
}

/// An item of a tagbody.
#[derive(Clone, Debug)]
pub enum TagbodyItem {
    /// A tag. Tags are numbered in order.
    Tag,
    /// A form, evaluated for effect.
    Form(NodeId),
}
