//! The definitions of a program: functions that are as their text says, structures and their order, and
//! whether values may stand in for those of failed calls.

use esl_bytecode::datum::DatumKind;
use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{Callee, Core, LambdaId, NodeId, NodeKind};
use esl_compiler::lambda_nodes;
use rustc_hash::{FxHashMap, FxHashSet};

use super::declared::type_of;
use super::set::TypeSet;
use super::slots::{self, SlotKey};
use crate::cause::may_be_mistake;
use crate::clause::can_end;
use crate::forms::{CoreForm, CoreForms, ScopeKind, function_name, symbols_inside};

/// Deepest nesting of a form that is walked.
const DEEPEST: u32 = 200;
/// Structures that have a bit of their own.
const CLASSES: usize = 63;

/// A function, by its form and the lambda there.
pub(super) type FunctionKey = (u32, LambdaId);

/// The definitions of a program.
pub(super) struct ProgramDefinitions {
    /// Functions that are as their only definition says.
    pub(super) functions: FxHashMap<Symbol, FunctionKey>,
    /// For each structure the bits of itself and of those that include it.
    below: FxHashMap<Symbol, u64>,
    /// For each structure its own bit.
    bits: FxHashMap<Symbol, u64>,
    /// Whether a recovery procedure may put a value in the place of that of a failed builtin.
    pub(super) substitutes: bool,
    /// Forms that are too deep.
    pub(super) opaque: Vec<bool>,
    /// Functions that may be others at run time than those of their names.
    pub(super) changed: FxHashSet<Symbol>,
    /// The declared types of the slots of structures, by structure and number.
    slots: FxHashMap<SlotKey, TypeSet>,
}

/// Internal functions that only note something under a name.
const NOTING: &[&str] =
    &["%PUT", "%DEFINE-CAUSE", "%PROCLAIM-SPECIAL", "%PROCLAIM-NOTINLINE", "%SPAWN", "%SPAWN-NET"];

/// The text whose definitions these are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum DefinedBy {
    Program,
    /// The library, whose functions no program can define anew: names in its data change nothing.
    Library,
}

impl ProgramDefinitions {
    pub(super) fn new(forms: &CoreForms, by: DefinedBy) -> ProgramDefinitions {
        let opaque = forms.forms.iter().map(|form| is_too_deep(&form.core)).collect();
        let mut found: FxHashMap<Symbol, Vec<FunctionKey>> = FxHashMap::default();
        let mut changed: FxHashSet<Symbol> = forms.generic.iter().cloned().collect();
        changed.extend(forms.scripted.iter().cloned());
        let mut is_open = false;
        let mut made: FxHashMap<Symbol, u32> = FxHashMap::default();
        for (index, form) in forms.forms.iter().enumerate() {
            for node in &form.core.nodes {
                if by == DefinedBy::Program
                    && let NodeKind::Constant(datum) = &node.kind
                    && matches!(datum.kind(), DatumKind::Cons(..) | DatumKind::Vector(_))
                {
                    changed.extend(symbols_inside(datum));
                }
                if let NodeKind::FunctionRef(symbol) = &node.kind {
                    is_open |= makes_code(symbol);
                } else if let NodeKind::BuiltinRef(builtin) = &node.kind {
                    is_open |= makes_code(&builtin.symbol());
                }
                let (NodeKind::Call(callee, arguments) | NodeKind::Apply(callee, arguments)) = &node.kind
                else {
                    continue;
                };
                let called = match callee {
                    Callee::Global(symbol) => symbol.clone(),
                    Callee::Builtin(builtin) => builtin.symbol(),
                    _ => continue,
                };
                let constant = |argument: Option<&NodeId>| match form.kind(*argument?) {
                    NodeKind::Constant(datum) => function_name(datum),
                    _ => None,
                };
                match called.name() {
                    "%SET-FUNCTION" | "%SET-FUNCTION-NAMED" => {
                        let lambda = arguments.get(1).map(|node| form.kind(*node));
                        match (constant(arguments.first()), lambda) {
                            (Some(name), Some(NodeKind::Lambda(lambda))) => {
                                found.entry(name).or_default().push((index as u32, *lambda));
                            }
                            (Some(name), _) => _ = changed.insert(name),
                            (None, _) => is_open = true,
                        }
                    }
                    "(SETF FDEFINITION)" | "(SETF SYMBOL-FUNCTION)" | "FMAKUNBOUND" => {
                        let names: Vec<Symbol> =
                            arguments.iter().filter_map(|node| constant(Some(node))).collect();
                        is_open |= names.is_empty();
                        changed.extend(names);
                    }
                    // Code that comes when the program runs may define anything anew.
                    "LOAD" => is_open = true,
                    "EVAL" | "COMPILE" if called.is_in("COMMON-LISP") => {
                        is_open |= !is_constant_code(form, arguments);
                        changed.extend(arguments.iter().filter_map(|node| constant(Some(node))));
                    }
                    "%MAKE-CLASS" => {
                        if let Some(name) = constant(arguments.first()) {
                            *made.entry(name).or_default() += 1;
                        }
                    }
                    name if by == DefinedBy::Program && name.starts_with('%') && !NOTING.contains(&name) => {
                        changed.extend(arguments.iter().filter_map(|node| constant(Some(node))));
                    }
                    _ => {}
                }
            }
        }
        is_open &= by == DefinedBy::Program;
        let functions = found
            .into_iter()
            .filter(|(name, keys)| keys.len() == 1 && !is_open && !changed.contains(name))
            .map(|(name, keys)| (name, keys[0]))
            .collect();
        let mut definitions = ProgramDefinitions {
            functions,
            below: FxHashMap::default(),
            bits: FxHashMap::default(),
            substitutes: substitutes(forms),
            opaque,
            changed,
            slots: FxHashMap::default(),
        };
        definitions.note_classes(forms, made);
        // Structures may be defined anew, with other types, by code that comes when the program runs.
        let declared = if is_open { FxHashMap::default() } else { slots::declared(forms) };
        definitions.slots =
            declared.into_iter().map(|(slot, declared)| (slot, type_of(&declared, &definitions))).collect();
        definitions
    }

    fn note_classes(&mut self, forms: &CoreForms, made: FxHashMap<Symbol, u32>) {
        let mut once: Vec<Symbol> =
            made.into_iter().filter(|(_, count)| *count == 1).map(|(name, _)| name).collect();
        once.sort_unstable_by_key(|name| name.to_string());
        once.truncate(CLASSES);
        self.bits = once.into_iter().enumerate().map(|(index, name)| (name, 1 << index)).collect();
        for (name, bit) in &self.bits {
            let mut class = name;
            for _ in 0..CLASSES {
                *self.below.entry(class.clone()).or_default() |= bit;
                match forms.included.get(class) {
                    Some(parent) => class = parent,
                    None => break,
                }
            }
        }
    }

    /// Returns the classes that instances of a structure may be of, those that include it too.
    pub(super) fn classes_below(&self, class: &Symbol) -> u64 {
        match self.bits.contains_key(class) {
            true => self.below.get(class).copied().unwrap_or_default() | 1 << CLASSES,
            false => u64::MAX,
        }
    }

    /// Returns the names of classes; none if there are others.
    pub(super) fn names(&self, classes: u64) -> Vec<String> {
        if classes == u64::MAX {
            return Vec::new();
        }
        let is_in = |bit: u64| classes & bit != 0;
        let mut names: Vec<String> = self
            .bits
            .iter()
            .filter(|(_, bit)| is_in(**bit))
            .map(|(name, _)| name.name().to_lowercase())
            .collect();
        names.sort_unstable();
        names.into_iter().map(|name| format!("`{name}`")).collect()
    }

    /// Returns whether a name is that of a structure with a bit of its own, which no type is called as well.
    pub(super) fn is_structure(&self, name: &Symbol) -> bool {
        self.bits.contains_key(name)
    }

    /// Returns the type of the values of a slot.
    pub(super) fn slot(&self, class: &Symbol, number: u16) -> TypeSet {
        self.slots.get(&(class.clone(), number)).copied().unwrap_or(TypeSet::ANY)
    }

    /// Returns the classes that a new instance of a structure may be of.
    pub(super) fn class(&self, class: &Symbol) -> u64 {
        self.bits.get(class).copied().unwrap_or(u64::MAX)
    }
}

/// Whether a function of this name runs code that is not in the program's text, or may do so.
fn makes_code(name: &Symbol) -> bool {
    ["LOAD", "EVAL", "COMPILE"].into_iter().any(|known| name.is_cl(known))
}

/// Whether all code that a call of `eval` or `compile` gets is constant, and defines functions at most: their
/// names are among the quoted ones.
fn is_constant_code(form: &CoreForm, arguments: &[NodeId]) -> bool {
    let opens = |symbol: &Symbol| makes_code(symbol) || symbol.name() == "DEFSTRUCT";
    arguments.iter().all(|argument| match form.kind(*argument) {
        NodeKind::Constant(datum) => !symbols_inside(datum).iter().any(opens),
        _ => false,
    })
}

/// Whether a form is nested too deeply for a walk by recursion.
fn is_too_deep(core: &Core) -> bool {
    let mut pending: Vec<(NodeId, u32)> = Vec::new();
    if let Some(whole) = core.lambdas.first() {
        pending.push((whole.body, 1));
    }
    while let Some((node, depth)) = pending.pop() {
        if depth > DEEPEST {
            return true;
        }
        let kind = &core.nodes[node.index()].kind;
        children(kind, &mut |child| pending.push((child, depth + 1)));
        let mut enter = |lambda: LambdaId| {
            lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push((node, depth + 1)));
        };
        match kind {
            NodeKind::Lambda(lambda) => enter(*lambda),
            NodeKind::Functions { definitions, .. } => {
                definitions.iter().for_each(|(_, lambda)| enter(*lambda));
            }
            _ => {}
        }
    }
    false
}

/// Whether a clause of the program may take a programming error, and control may reach its end.
fn substitutes(forms: &CoreForms) -> bool {
    forms.forms.iter().any(|form| {
        form.scopes.iter().any(|scope| match &scope.kind {
            ScopeKind::Recovery { clauses, .. } => clauses.iter().any(|clause| {
                may_be_mistake(forms, &clause.cause) && can_end(&form.core, clause.body, &|_| false)
            }),
            _ => false,
        })
    })
}
