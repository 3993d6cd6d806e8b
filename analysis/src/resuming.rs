//! Clauses whose ends control can reach, so that the failed call gets their value.
//!
//! A function of the program that never returns, as its text shows, ends a clause as `fail` does. Clauses and
//! functions are found together: a failure comes back only if a clause for it can end.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{Callee, LambdaId, NodeId, NodeKind};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::clause_causes;
use crate::clause::can_end;
use crate::effect::FailureKind;
use crate::forms::{CoreForm, CoreForms, ScopeKind};
use crate::value::Numbering;

/// Returns the cause with which a node fails for sure, or an empty text if it fails with some condition.
fn failing_call(form: &CoreForm, node: NodeId) -> Option<String> {
    let (NodeKind::Call(callee, arguments) | NodeKind::Apply(callee, arguments)) = form.kind(node) else {
        return None;
    };
    let name = match callee {
        Callee::Global(symbol) => symbol.name(),
        Callee::Builtin(Builtin::Exit) => return Some("".into()),
        Callee::Builtin(builtin) => builtin.info().name,
        _ => return None,
    };
    match name {
        "%FAIL-FOR" | "FAIL" => Some(
            arguments
                .first()
                .and_then(|node| form.symbol(*node))
                .map_or(String::new(), |one| one.name().into()),
        ),
        "ERROR" | "%FAIL-WITH" | "%FAIL-BECAUSE-OF" | "%FAIL-AS" | "%FAIL-ALL" | "%NO-CASE" => {
            Some(String::new())
        }
        _ => None,
    }
}

/// Functions of the program, each with its form and its lambda, and whether control can reach its end.
type CalledFunctions = FxHashMap<Symbol, (usize, LambdaId, bool)>;

/// Returns the functions of the program that clauses call, directly and by others. Their texts are known:
/// they are defined once, and neither scripts nor methods take their places.
fn functions_of_clauses(forms: &CoreForms) -> CalledFunctions {
    let mut found = CalledFunctions::default();
    let mut pending: Vec<(usize, NodeId)> = Vec::new();
    for (number, form) in forms.forms.iter().enumerate() {
        for scope in &form.scopes {
            if let ScopeKind::Recovery { clauses, .. } = &scope.kind {
                pending.extend(clauses.iter().map(|clause| (number, clause.body)));
            }
        }
    }
    while let Some((number, node)) = pending.pop() {
        let kind = forms.forms[number].kind(node);
        children(kind, &mut |child| pending.push((number, child)));
        if let NodeKind::Lambda(lambda) = kind {
            pending.push((number, forms.forms[number].core.lambdas[lambda.index()].body));
        }
        let (NodeKind::Call(Callee::Global(name), _) | NodeKind::Apply(Callee::Global(name), _)) = kind
        else {
            continue;
        };
        let is_fixed = !forms.redefined.contains(name)
            && !forms.generic.contains(name)
            && !forms.scripted.contains(name);
        let Some((form, definition)) = forms.defined.get(name).filter(|_| is_fixed) else { continue };
        if found.contains_key(name) {
            continue;
        }
        let text = &forms.forms[*form];
        if let NodeKind::Call(_, arguments) = text.kind(*definition)
            && let Some(NodeKind::Lambda(lambda)) = arguments.get(1).map(|node| text.kind(*node))
        {
            found.insert(name.clone(), (*form, *lambda, false));
            pending.push((*form, text.core.lambdas[lambda.index()].body));
        }
    }
    found
}

/// Returns the clauses whose ends control can reach, by form, node of the recovery form, and position.
pub(crate) fn resuming_clauses(forms: &CoreForms) -> FxHashSet<(u32, NodeId, usize)> {
    let mut found: FxHashSet<(u32, NodeId, usize)> = FxHashSet::default();
    let mut causes: FxHashSet<Symbol> = FxHashSet::default();
    let general = Symbol::keyword("GENERAL-FAILURE");
    let mut functions = functions_of_clauses(forms);
    loop {
        let comes_back = |cause: &str| {
            if cause.is_empty() || causes.contains(&general) {
                return !causes.is_empty();
            }
            let mut names = Numbering::default();
            let kind = FailureKind::Cause(crate::value::NameId(names.number(&Symbol::keyword(cause)).0));
            let wanted = clause_causes(forms, &names, kind);
            wanted.is_none_or(|wanted| wanted.iter().any(|known| causes.contains(known)))
        };
        let leaves = |form: &CoreForm, node: NodeId| {
            if let NodeKind::Call(Callee::Global(name), _) | NodeKind::Apply(Callee::Global(name), _) =
                form.kind(node)
                && let Some((_, _, ends)) = functions.get(name)
            {
                return !ends;
            }
            failing_call(form, node).is_some_and(|cause| !comes_back(&cause))
        };
        let mut ending: Vec<Symbol> = Vec::new();
        for (name, (number, lambda, ends)) in &functions {
            let form = &forms.forms[*number];
            let body = form.core.lambdas[lambda.index()].body;
            if !ends && can_end(&form.core, body, &|node| leaves(form, node)) {
                ending.push(name.clone());
            }
        }
        let mut more = Vec::new();
        for (number, form) in forms.forms.iter().enumerate() {
            for scope in &form.scopes {
                let ScopeKind::Recovery { node, clauses, .. } = &scope.kind else { continue };
                for (position, clause) in clauses.iter().enumerate() {
                    let key = (number as u32, *node, position);
                    let ends =
                        !found.contains(&key) && can_end(&form.core, clause.body, &|node| leaves(form, node));
                    if ends {
                        found.insert(key);
                        more.push(clause.cause.clone());
                    }
                }
            }
        }
        if ending.is_empty() && more.is_empty() {
            return found;
        }
        causes.extend(more);
        for name in ending {
            if let Some((_, _, ends)) = functions.get_mut(&name) {
                *ends = true;
            }
        }
    }
}
