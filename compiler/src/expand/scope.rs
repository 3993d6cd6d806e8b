//! The local names in scope at the point that the expander has reached.
//!
//! Jobs run in the order of the text, so one table with a log of replaced meanings is enough:
//! [`Scope::enter`] adds a meaning, [`Scope::leave`] takes the newest one back. Every look-up is one step,
//! however deep the nesting.
//!
//! A chunk within a chunk (the function of a `macrolet`) runs at compile time. It sees the macros and symbol
//! macros around it, but no variables, functions, blocks or tags. Every meaning knows the level of its chunk;
//! see [`Visible::OutOfReach`].

use std::sync::Arc;

use esl_bytecode::Integer;
use esl_bytecode::compile::{Arity, Environment};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::locals::{LocalMeaning, Locals};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use crate::core::{BlockId, TagbodyId, VarId};

/// Meaning of a name as a variable.
#[derive(Clone, Debug)]
pub(super) enum VariableMeaning {
    /// A lexical variable.
    Lexical(VarId),
    /// The special variable of the name.
    Special,
    /// A symbol macro, which stands for this form.
    SymbolMacro(Datum),
}

/// The arguments that a local function takes.
#[derive(Clone, Debug)]
pub(super) struct LocalSignature {
    /// Their number.
    pub(super) arity: Arity,
    /// Number of arguments before the keyword arguments, and the keywords; `None` if it takes any or none.
    pub(super) keys: Option<Arc<(usize, Vec<Symbol>)>>,
}

/// Meaning of a name as a function.
#[derive(Clone, Debug)]
pub(super) enum FunctionMeaning {
    /// A local function, kept in this variable.
    Local(VarId, LocalSignature),
    /// A local macro; `None` if its definition failed, which has been reported.
    Macro(Option<ObjectId>),
}

/// A tag of a `tagbody`. Tags are compared by `eql`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Tag {
    /// A symbol, `NIL` included.
    Symbol(Symbol),
    /// An integer.
    Integer(Integer),
}

impl Tag {
    /// Returns the tag that `datum` is, if it is one.
    pub(super) fn of(datum: &Datum) -> Option<Tag> {
        match datum.kind() {
            DatumKind::Nil => Some(Tag::Symbol(Symbol::cl("NIL"))),
            DatumKind::Symbol(symbol) => Some(Tag::Symbol(symbol.clone())),
            DatumKind::Integer(value) => Some(Tag::Integer(value.clone())),
            _ => None,
        }
    }
}

/// A name and its meaning, to be entered into the scope.
#[derive(Clone, Debug)]
pub(super) enum ScopeEntry {
    /// A variable; with a place, an unused lexical variable is reported there.
    Variable(Symbol, VariableMeaning, Option<Span>),
    /// A function; `(setf f)` is entered under the symbol that keeps it.
    Function(Symbol, FunctionMeaning),
    /// A block.
    Block(Symbol, BlockId),
    /// A tag, and its number in the tagbody.
    Tag(Tag, TagbodyId, u32),
    /// Whether compiler macros leave calls of a function as they are written.
    Written(Symbol, bool),
}

impl ScopeEntry {
    /// Returns whether this is a variable with the name of a global symbol macro.
    fn hides_symbol_macro(&self, environment: &dyn Environment) -> bool {
        match self {
            ScopeEntry::Variable(_, VariableMeaning::SymbolMacro(_), _) => false,
            ScopeEntry::Variable(name, ..) => global_symbol_macro(environment, name).is_some(),
            _ => false,
        }
    }
}

/// Returns the form that `symbol` stands for by `define-symbol-macro`.
pub(super) fn global_symbol_macro(environment: &dyn Environment, symbol: &Symbol) -> Option<Datum> {
    environment.property(symbol, &Symbol::esl("%SYMBOL-MACRO"))
}

/// A lexical variable that has gone out of scope, to be reported if it is unused.
#[derive(Debug)]
pub(super) struct Gone {
    pub(super) name: Symbol,
    pub(super) variable: VarId,
    /// Place of its binding.
    pub(super) span: Span,
}

/// Outcome of a look-up among the local names.
#[derive(Clone, Debug)]
pub(super) enum Visible<T> {
    /// The name has this local meaning.
    Is(T),
    /// The name has no local meaning.
    No,
    /// The name has a local meaning that exists only at run time, but the current code runs at compile time.
    OutOfReach,
}

#[derive(Clone, Debug)]
struct Held<T> {
    meaning: T,
    level: usize,
}

/// Meaning that an entry replaced.
#[derive(Debug)]
enum Undo {
    /// Also, whether macros may ask for the entry.
    Variable(Symbol, Option<Held<VariableMeaning>>, Option<Span>, bool),
    Function(Symbol, Option<Held<FunctionMeaning>>),
    Block(Symbol, Option<Held<BlockId>>),
    Tag(Tag, Option<Held<(TagbodyId, u32)>>),
    Written(Symbol, Option<bool>),
}

/// The local meanings of names.
#[derive(Debug, Default)]
pub(super) struct Scope {
    variables: FxHashMap<Symbol, Held<VariableMeaning>>,
    functions: FxHashMap<Symbol, Held<FunctionMeaning>>,
    blocks: FxHashMap<Symbol, Held<BlockId>>,
    tags: FxHashMap<Tag, Held<(TagbodyId, u32)>>,
    /// Functions that are declared `notinline` here, or `inline`.
    written: FxHashMap<Symbol, bool>,
    log: Vec<Undo>,
    /// The names that macros may look up: functions, macros, symbol macros, and variables that hide one of
    /// these.
    locals: Locals,
}

impl Scope {
    /// Enters names, in code of chunk level `level`.
    pub(super) fn enter_all(
        &mut self,
        entries: Vec<ScopeEntry>,
        level: usize,
        environment: &dyn Environment,
    ) {
        for entry in entries {
            let hides = entry.hides_symbol_macro(environment);
            self.enter(entry, level, hides);
        }
    }

    /// Enters a name, in code of chunk level `level`. `hides` is what [`ScopeEntry::hides_symbol_macro`]
    /// says.
    pub(super) fn enter(&mut self, entry: ScopeEntry, level: usize, hides: bool) {
        let undo = match entry {
            ScopeEntry::Variable(name, meaning, report) => {
                let told = match &meaning {
                    VariableMeaning::SymbolMacro(form) => Some(LocalMeaning::SymbolMacro(form.clone())),
                    _ => (hides || self.is_symbol_macro(&name)).then_some(LocalMeaning::Variable),
                };
                let is_told = told.is_some();
                if let Some(told) = told {
                    self.locals = self.locals.with(name.clone(), told);
                }
                let old = self.variables.insert(name.clone(), Held { meaning, level });
                Undo::Variable(name, old, report, is_told)
            }
            ScopeEntry::Function(name, meaning) => {
                let told = match &meaning {
                    FunctionMeaning::Macro(Some(function)) => LocalMeaning::Macro(*function),
                    FunctionMeaning::Macro(None) | FunctionMeaning::Local(..) => LocalMeaning::Function,
                };
                self.locals = self.locals.with(name.clone(), told);
                let old = self.functions.insert(name.clone(), Held { meaning, level });
                Undo::Function(name, old)
            }
            ScopeEntry::Block(name, block) => {
                let old = self.blocks.insert(name.clone(), Held { meaning: block, level });
                Undo::Block(name, old)
            }
            ScopeEntry::Tag(tag, tagbody, number) => {
                let old = self.tags.insert(tag.clone(), Held { meaning: (tagbody, number), level });
                Undo::Tag(tag, old)
            }
            ScopeEntry::Written(name, is_written) => {
                let old = self.written.insert(name.clone(), is_written);
                Undo::Written(name, old)
            }
        };
        self.log.push(undo);
    }

    /// Takes the newest entry out of the scope.
    pub(super) fn leave(&mut self) -> Option<Gone> {
        match self.log.pop()? {
            Undo::Variable(name, old, report, is_told) => {
                let gone = restore(&mut self.variables, &name, old);
                if is_told {
                    self.leave_local();
                }
                match (gone.map(|held| held.meaning), report) {
                    (Some(VariableMeaning::Lexical(variable)), Some(span)) => {
                        Some(Gone { name, variable, span })
                    }
                    _ => None,
                }
            }
            Undo::Function(name, old) => {
                restore(&mut self.functions, &name, old);
                self.leave_local();
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
            Undo::Written(name, old) => {
                match old {
                    Some(old) => self.written.insert(name, old),
                    None => self.written.remove(&name),
                };
                None
            }
        }
    }

    /// Returns the meaning of `name` as a variable, for code of chunk level `level`.
    pub(super) fn variable(&self, name: &Symbol, level: usize) -> Visible<VariableMeaning> {
        match self.variables.get(name) {
            None => Visible::No,
            Some(Held { meaning: VariableMeaning::Lexical(_), level: bound }) if *bound != level => {
                Visible::OutOfReach
            }
            Some(held) => Visible::Is(held.meaning.clone()),
        }
    }

    /// Returns the meaning of `name` as a function, for code of chunk level `level`.
    pub(super) fn function(&self, name: &Symbol, level: usize) -> Visible<FunctionMeaning> {
        match self.functions.get(name) {
            None => Visible::No,
            Some(Held { meaning: FunctionMeaning::Local(..), level: bound }) if *bound != level => {
                Visible::OutOfReach
            }
            Some(held) => Visible::Is(held.meaning.clone()),
        }
    }

    /// Returns whether calls of the function `name` stay as they are written; `None` if nothing is declared.
    pub(super) fn is_written(&self, name: &Symbol) -> Option<bool> {
        self.written.get(name).copied()
    }

    /// Returns the block called `name`.
    pub(super) fn block(&self, name: &Symbol, level: usize) -> Visible<BlockId> {
        reach(self.blocks.get(name), level)
    }

    /// Returns the tagbody of `tag`, and the number of the tag there.
    pub(super) fn tag(&self, tag: &Tag, level: usize) -> Visible<(TagbodyId, u32)> {
        reach(self.tags.get(tag), level)
    }

    /// Returns the names of the blocks in scope.
    pub(super) fn block_names(&self) -> impl Iterator<Item = &Symbol> {
        self.blocks.keys()
    }

    /// Returns the symbols that are tags in scope.
    pub(super) fn tag_names(&self) -> impl Iterator<Item = &Symbol> {
        self.tags.keys().filter_map(|tag| match tag {
            Tag::Symbol(symbol) => Some(symbol),
            Tag::Integer(_) => None,
        })
    }

    /// Returns what macros may ask for.
    pub(super) fn locals(&self) -> &Locals {
        &self.locals
    }

    fn is_symbol_macro(&self, name: &Symbol) -> bool {
        matches!(self.variables.get(name), Some(Held { meaning: VariableMeaning::SymbolMacro(_), .. }))
    }

    fn leave_local(&mut self) {
        if let Some(innermost) = self.locals.innermost() {
            self.locals = innermost.outer.clone();
        }
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
