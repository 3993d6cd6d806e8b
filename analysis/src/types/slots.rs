//! Types of slots, as structures declare them.
//!
//! The constructors and the assignments of a structure test values against them, so a slot that is read has a
//! value of its type. The procedures of `define-upgrade` see instances from before, with slots of any type: a
//! program that has some declares nothing here.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::{ESL_PACKAGE, Symbol};
use esl_compiler::core::{Callee, NodeId, NodeKind};
use rustc_hash::FxHashMap;

use super::calls::ArgumentNeed;
use super::declared::type_of;
use super::finding::REFUSED;
use super::set::KnownFacts;
use super::walk::TypeWalk;
use crate::forms::{CoreForms, is_esl};

/// Function of the library that fails because of a value that a slot cannot have: of the value and the type.
const REFUSING: &str = "%WRONG-SLOT-VALUE";

/// A slot, by its structure and its number.
pub(super) type SlotKey = (Symbol, u16);

/// Returns the declared types of slots. Structures that are defined twice are left out.
pub(super) fn declared(forms: &CoreForms) -> FxHashMap<SlotKey, Datum> {
    let mut found: FxHashMap<SlotKey, Option<Datum>> = FxHashMap::default();
    for form in &forms.forms {
        for node in &form.core.nodes {
            let NodeKind::Call(callee, arguments) = &node.kind else { continue };
            let constant = |index: usize| match form.kind(*arguments.get(index)?) {
                NodeKind::Constant(datum) => Some(datum),
                _ => None,
            };
            match callee {
                Callee::Builtin(Builtin::Put) if constant(1).is_some_and(|key| is_esl(key, "%UPGRADE")) => {
                    return FxHashMap::default();
                }
                Callee::Builtin(Builtin::DefineAccessor) => {
                    let class = arguments.get(1).and_then(|class| form.symbol(*class));
                    let number = constant(2).and_then(|number| match number.kind() {
                        DatumKind::Integer(number) => {
                            number.as_small().and_then(|number| number.try_into().ok())
                        }
                        _ => None,
                    });
                    if let (Some(class), Some(number)) = (class, number) {
                        let declared = constant(3).and_then(|access| access.as_cons());
                        let declared = declared.map(|(declared, _)| declared.clone());
                        let is_second = found.contains_key(&(class.clone(), number));
                        found.insert((class.clone(), number), declared.filter(|_| !is_second));
                    }
                }
                _ => {}
            }
        }
    }
    found.into_iter().filter_map(|(slot, declared)| Some((slot, declared?))).collect()
}

/// Returns whether a function of the library never returns, since it refuses the value of a slot.
pub(super) fn is_refusal(function: &Symbol) -> bool {
    function.is_in(ESL_PACKAGE) && function.name() == REFUSING
}

impl TypeWalk<'_> {
    /// Warns of a value that the slot which it is for cannot have: a test of it in front of a refusal, `no`,
    /// of which it is known that it does not hold.
    pub(super) fn check_refusal(&mut self, yes: &KnownFacts, no: NodeId, otherwise: &KnownFacts) {
        if yes.is_reached || !otherwise.is_reached {
            return;
        }
        let form = self.core_form();
        if let NodeKind::Call(Callee::Global(symbol), arguments) = form.kind(no)
            && is_refusal(symbol)
            && let [value, declared] = arguments.as_slice()
            && let (NodeKind::Local(variable), NodeKind::Constant(declared)) =
                (form.kind(*value), form.kind(*declared))
        {
            let given = self.variable(*variable, otherwise).types;
            let need = ArgumentNeed::of_types(type_of(declared, self.definitions));
            // A slot without values is refused whenever an instance is made: the definition alone is right.
            if !need.types.is_empty() {
                self.warn(no, REFUSED, *value, given, &need);
            }
        }
    }
}
