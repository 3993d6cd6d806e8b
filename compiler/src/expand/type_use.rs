//! Names of types that a program writes as constants: in `(typep x 'point)`, `(the point x)`, the clauses of
//! `typecase`. A name that denotes no type at the end of the unit is probably misspelt.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::{CL_PACKAGE, Symbol};
use rustc_hash::FxHashSet;

use super::expander::Expander;
use super::form::{Form, constant_value, is_cl_form};
use super::global::GlobalUses;
use super::origin::{NameUsed, OriginId};

/// Heads of compound types whose arguments are types.
const OF_TYPES: &[&str] = &["AND", "COMPLEX", "CONS", "NOT", "OR", "VALUES"];
/// Heads of compound types whose first argument is a type.
const OF_ELEMENTS: &[&str] = &["ARRAY", "SIMPLE-ARRAY", "VECTOR"];
/// Heads of compound types that exist only with arguments.
const COMPOUND: &[&str] = &["AND", "EQL", "MEMBER", "MOD", "NOT", "OR", "SATISFIES", "VALUES"];

/// Notes the types that a form of the language names.
pub(super) fn types(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    if !expander.is_guarded(form.span) {
        handled_types(expander, form, origin);
    }
}

/// As [`types`], for a form that handles failures.
pub(super) fn handled_types(expander: &mut Expander, form: &Form, origin: Option<OriginId>) {
    for specifier in specifiers(form) {
        expander.note_types(&specifier, form, origin);
    }
}

/// Notes the name that a form defines as a type, or asks about: `(find-class 'name)`.
pub(super) fn definition(
    expander: &mut Expander,
    environment: &dyn Environment,
    form: &Form,
    origin: Option<OriginId>,
) {
    let Some(named) = form.args.first() else { return };
    let asked = if is_cl_form(named, "QUOTE") { constant_value(named) } else { None };
    let named = asked.as_ref().unwrap_or(named);
    let name = named.as_cons().map_or(named, |(name, _)| name);
    if let Some(name) = name.as_symbol() {
        expander.globals.defined_types.insert(name.clone());
    }
    types(expander, environment, form, origin);
}

/// Returns the type specifiers that stand as constants in a form.
fn specifiers(form: &Form) -> Vec<Datum> {
    let args = &form.args;
    let quoted =
        |index: usize| args.get(index).filter(|form| is_cl_form(form, "QUOTE")).and_then(constant_value);
    let heads = |clauses: &[Datum]| -> Vec<Datum> {
        clauses.iter().filter_map(|clause| Some(clause.as_cons()?.0.clone())).collect()
    };
    match form.operator.name() {
        "CHECK-TYPE" => args.get(1).cloned().into_iter().collect(),
        "COERCE" | "TYPEP" => quoted(1).into_iter().collect(),
        "CONCATENATE" | "ERROR" | "MAKE-CONDITION" | "MAKE-INSTANCE" | "MAKE-SEQUENCE" | "MAP" | "MERGE"
        | "SIGNAL" | "WARN" => quoted(0).into_iter().collect(),
        "SUBTYPEP" => quoted(0).into_iter().chain(quoted(1)).collect(),
        "MAKE-ARRAY" | "MAKE-STRING" => element_type(args).and_then(quoted).into_iter().collect(),
        "CTYPECASE" | "ETYPECASE" | "HANDLER-CASE" | "TYPECASE" => {
            let mut heads = heads(args.get(1..).unwrap_or_default());
            heads.retain(|head| !head.as_symbol().is_some_and(|symbol| symbol.is_cl("OTHERWISE")));
            heads
        }
        "HANDLER-BIND" => {
            args.first().map_or(Vec::new(), |list| heads(&list.elements().cloned().collect::<Vec<_>>()))
        }
        "DEFMETHOD" => specializers(args),
        "DEFSTRUCT" => args.iter().skip(1).filter_map(|slot| slot_type(slot, 2)).collect(),
        "DEFCLASS" => args
            .get(2)
            .map_or(Vec::new(), |slots| slots.elements().filter_map(|slot| slot_type(slot, 1)).collect()),
        _ => Vec::new(),
    }
}

/// Returns the index of the form after `:element-type`.
fn element_type(args: &[Datum]) -> Option<usize> {
    let is_key =
        |form: &Datum| form.as_symbol().is_some_and(|key| key.is_keyword() && key.name() == "ELEMENT-TYPE");
    args.iter().position(is_key).map(|index| index + 1)
}

/// Returns the classes of the lambda list of a method.
fn specializers(args: &[Datum]) -> Vec<Datum> {
    let Some(lambda_list) = args.iter().skip(1).find(|part| part.is_nil() || part.as_cons().is_some()) else {
        return Vec::new();
    };
    let is_required = |item: &&Datum| item.as_symbol().is_none_or(|symbol| !symbol.name().starts_with('&'));
    let parameters = lambda_list.elements().take_while(is_required);
    parameters.filter_map(|item| item.as_cons()?.1.elements().next().cloned()).collect()
}

/// Returns the type of a slot, which is among its options after `before` parts.
fn slot_type(slot: &Datum, before: usize) -> Option<Datum> {
    let options: Vec<&Datum> = slot.elements().skip(before).collect();
    let is_type =
        |option: &Datum| option.as_symbol().is_some_and(|key| key.is_keyword() && key.name() == "TYPE");
    options.chunks_exact(2).find(|pair| is_type(pair[0])).map(|pair| pair[1].clone())
}

impl Expander {
    /// Notes the names of types in a declaration, unless a macro of the library made it.
    pub(super) fn note_declared(&mut self, specifier: &Datum, form: &Form, origin: Option<OriginId>) {
        if !self.origins.is_of_library(form.span, origin) {
            self.note_types(specifier, form, origin);
        }
    }

    /// Notes the names of types in a specifier, which is a part of a form.
    pub(super) fn note_types(&mut self, specifier: &Datum, form: &Form, origin: Option<OriginId>) {
        let mut pending = vec![specifier.clone()];
        while let Some(specifier) = pending.pop() {
            let head = specifier.as_cons().map(|(head, _)| head);
            let Some(symbol) = head.unwrap_or(&specifier).as_symbol().cloned() else { continue };
            let (is_compound, is_standard) = (head.is_some(), symbol.is_in(CL_PACKAGE));
            let arguments = specifier.elements().skip(1).cloned();
            if is_compound && is_standard && OF_TYPES.contains(&symbol.name()) {
                pending.extend(arguments);
            } else if is_compound && is_standard && OF_ELEMENTS.contains(&symbol.name()) {
                pending.extend(arguments.take(1));
            }
            let is_known = is_compound && is_standard && COMPOUND.contains(&symbol.name());
            if is_known || symbol.is_keyword() || symbol.name() == "*" || symbol.name().starts_with('&') {
                continue;
            }
            let span = form.at(head.unwrap_or(&specifier).span());
            let place = self.place_of_use(span, origin);
            self.globals.types.push((symbol, place));
        }
    }
}

impl GlobalUses {
    /// Takes the names that the unit uses as types and that denote none, in the order of their first use.
    pub(super) fn take_unknown_types(
        &mut self,
        environment: &dyn Environment,
    ) -> Vec<(Symbol, Vec<NameUsed>)> {
        let mut unknown: Vec<(Symbol, Vec<NameUsed>)> = Vec::new();
        let mut known = FxHashSet::default();
        for (symbol, place) in std::mem::take(&mut self.types) {
            if known.contains(&symbol) || self.defined_types.contains(&symbol) {
                continue;
            }
            if let Some((_, places)) = unknown.iter_mut().find(|(other, _)| *other == symbol) {
                places.push(place);
            } else if environment.is_type(&symbol) {
                known.insert(symbol);
            } else {
                unknown.push((symbol, vec![place]));
            }
        }
        unknown
    }
}
