//! What names mean at the point that the expander has reached.
//!
//! Jobs run in the order of the text, so one table with a log of what it replaced is enough: [`Scope::enter`] adds a
//! meaning, [`Scope::leave`] takes the newest ones back. Every look-up is one step, however deep the nesting.
//!
//! A chunk within a chunk (the function of a `macrolet`) runs at compile time: it sees macros and symbol macros around
//! it, but no variables, functions, blocks or tags. Entries know the chunk that they belong to; see
//! [`Visible::OutOfReach`].

use std::sync::Arc;

use esl_bytecode::BigInt;
use esl_bytecode::compile::{Arity, LocalDefinition};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use crate::core::{BlockId, TagbodyId, VarId};

/// What a name means as a variable.
#[derive(Clone, Debug)]
pub(super) enum Variable {
    /// A lexical variable.
    Lexical(VarId),
    /// The special variable of the name.
    Special,
    /// This form.
    SymbolMacro(Datum),
}

/// What a name means as a function.
#[derive(Clone, Debug)]
pub(super) enum Function {
    /// A local function, kept in this variable.
    Local(VarId, Arity),
    /// A local macro; `None` if its definition has failed, which has been reported.
    Macro(Option<ObjectId>),
}

/// A tag of a `tagbody`. Tags are compared by `eql`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Tag {
    /// A symbol; `NIL` is one.
    Symbol(Symbol),
    /// An integer.
    Integer(BigInt),
}

impl Tag {
    /// The tag that `datum` is, if it is one.
    pub(super) fn of(datum: &Datum) -> Option<Tag> {
        match datum.kind() {
            DatumKind::Nil => Some(Tag::Symbol(Symbol::cl("NIL"))),
            DatumKind::Symbol(symbol) => Some(Tag::Symbol(symbol.clone())),
            DatumKind::Integer(value) => Some(Tag::Integer(value.clone())),
            _ => None,
        }
    }
}

/// A name and its meaning, to be entered.
#[derive(Clone, Debug)]
pub(super) enum Entry {
    /// A variable. If a place is given, it is one where an unused lexical variable is to be reported.
    Variable(Symbol, Variable, Option<Span>),
    /// A function; `(setf f)` goes by the symbol that keeps it.
    Function(Symbol, Function),
    /// A block.
    Block(Symbol, BlockId),
    /// A tag: its number in the tagbody.
    Tag(Tag, TagbodyId, u32),
}

/// A lexical variable that has gone out of scope and is to be reported if it is unused.
#[derive(Debug)]
pub(super) struct Gone {
    /// Its name.
    pub(super) name: Symbol,
    /// The variable.
    pub(super) variable: VarId,
    /// Where it was bound.
    pub(super) span: Span,
}

/// Outcome of a look-up among local names.
#[derive(Clone, Debug)]
pub(super) enum Visible<T> {
    /// This.
    Is(T),
    /// No local meaning.
    No,
    /// A local meaning, which exists only at run time while the code being expanded runs at compile time.
    OutOfReach,
}

#[derive(Clone, Debug)]
struct Held<T> {
    meaning: T,
    level: usize,
}

/// What an entry replaced.
#[derive(Debug)]
enum Undo {
    Variable(Symbol, Option<Held<Variable>>, Option<Span>),
    Function(Symbol, Option<Held<Function>>, Option<Arc<[LocalDefinition]>>),
    Block(Symbol, Option<Held<BlockId>>),
    Tag(Tag, Option<Held<(TagbodyId, u32)>>),
}

/// The local meanings of names.
#[derive(Debug, Default)]
pub(super) struct Scope {
    variables: FxHashMap<Symbol, Held<Variable>>,
    functions: FxHashMap<Symbol, Held<Function>>,
    blocks: FxHashMap<Symbol, Held<BlockId>>,
    tags: FxHashMap<Tag, Held<(TagbodyId, u32)>>,
    log: Vec<Undo>,
    /// The functions and macros in scope, innermost last.
    definitions: Vec<LocalDefinition>,
    /// `definitions` the other way round, once somebody has asked for it.
    locals: Option<Arc<[LocalDefinition]>>,
}

impl Scope {
    /// Gives a name a meaning, in code of chunk level `level`.
    pub(super) fn enter(&mut self, entry: Entry, level: usize) {
        let undo = match entry {
            Entry::Variable(name, meaning, report) => {
                let old = self.variables.insert(name.clone(), Held { meaning, level });
                Undo::Variable(name, old, report)
            }
            Entry::Function(name, meaning) => {
                let expander = match &meaning {
                    Function::Macro(expander) => *expander,
                    Function::Local(..) => None,
                };
                self.definitions.push(LocalDefinition { name: name.clone(), expander });
                let old = self.functions.insert(name.clone(), Held { meaning, level });
                Undo::Function(name, old, self.locals.take())
            }
            Entry::Block(name, block) => {
                let old = self.blocks.insert(name.clone(), Held { meaning: block, level });
                Undo::Block(name, old)
            }
            Entry::Tag(tag, tagbody, number) => {
                let old = self.tags.insert(tag.clone(), Held { meaning: (tagbody, number), level });
                Undo::Tag(tag, old)
            }
        };
        self.log.push(undo);
    }

    /// Takes the newest meaning back.
    pub(super) fn leave(&mut self) -> Option<Gone> {
        match self.log.pop()? {
            Undo::Variable(name, old, report) => {
                let gone = restore(&mut self.variables, &name, old);
                match (gone.map(|held| held.meaning), report) {
                    (Some(Variable::Lexical(variable)), Some(span)) => Some(Gone { name, variable, span }),
                    _ => None,
                }
            }
            Undo::Function(name, old, locals) => {
                restore(&mut self.functions, &name, old);
                self.definitions.pop();
                self.locals = locals;
                None
            }
            Undo::Block(name, old) => {
                restore(&mut self.blocks, &name, old);
                None
            }
            Undo::Tag(tag, old) => {
                restore(&mut self.tags, &tag, old);
                None
            }
        }
    }

    /// What `name` means as a variable to code of chunk level `level`.
    pub(super) fn variable(&self, name: &Symbol, level: usize) -> Visible<Variable> {
        match self.variables.get(name) {
            None => Visible::No,
            Some(Held { meaning: Variable::Lexical(_), level: bound }) if *bound != level => {
                Visible::OutOfReach
            }
            Some(held) => Visible::Is(held.meaning.clone()),
        }
    }

    /// What `name` means as a function to code of chunk level `level`.
    pub(super) fn function(&self, name: &Symbol, level: usize) -> Visible<Function> {
        match self.functions.get(name) {
            None => Visible::No,
            Some(Held { meaning: Function::Local(..), level: bound }) if *bound != level => {
                Visible::OutOfReach
            }
            Some(held) => Visible::Is(held.meaning.clone()),
        }
    }

    /// The block called `name`.
    pub(super) fn block(&self, name: &Symbol, level: usize) -> Visible<BlockId> {
        reach(self.blocks.get(name), level)
    }

    /// The tagbody of `tag`, and its number there.
    pub(super) fn tag(&self, tag: &Tag, level: usize) -> Visible<(TagbodyId, u32)> {
        reach(self.tags.get(tag), level)
    }

    /// The names of the blocks in scope.
    pub(super) fn block_names(&self) -> impl Iterator<Item = &Symbol> {
        self.blocks.keys()
    }

    /// The local functions and macros, innermost first.
    pub(super) fn locals(&mut self) -> Arc<[LocalDefinition]> {
        let definitions = &self.definitions;
        self.locals.get_or_insert_with(|| definitions.iter().rev().cloned().collect()).clone()
    }
}

fn restore<K: Clone + Eq + std::hash::Hash, T>(
    table: &mut FxHashMap<K, Held<T>>,
    key: &K,
    old: Option<Held<T>>,
) -> Option<Held<T>> {
    match old {
        Some(old) => table.insert(key.clone(), old),
        None => table.remove(key),
    }
}

fn reach<T: Clone>(held: Option<&Held<T>>, level: usize) -> Visible<T> {
    match held {
        None => Visible::No,
        Some(held) if held.level != level => Visible::OutOfReach,
        Some(held) => Visible::Is(held.meaning.clone()),
    }
}
