//! Calls of functions of the host, and the effect of making a call twice.

use std::fmt;

use esl_bytecode::datum::{Datum, DatumKind};

/// The effect of a call on the outside. By it, a durable run decides whether to repeat a call that the end of
/// its process has interrupted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CallEffect {
    /// It reaches nothing outside of the process.
    Local,
    /// It closes its objects, which end with the process anyway.
    Closes,
    /// It lets go of a part of its objects, which ends with the process anyway.
    Releases,
    /// It may be made twice: it only reads, or the second time changes nothing.
    Idempotent,
    /// It may not be made twice.
    #[default]
    Once,
    /// Its effect lasts until one of its objects is closed, as that of a server or a subscription does: the
    /// next process of a durable run makes it again.
    Lasts,
}

impl CallEffect {
    /// Returns whether an interrupted call is made again.
    pub fn may_be_repeated(self) -> bool {
        self != CallEffect::Once
    }

    /// Returns whether nothing is left to do for a call whose objects are gone with an earlier process.
    pub fn is_done_by_restart(self) -> bool {
        matches!(self, CallEffect::Closes | CallEffect::Releases)
    }
}

/// The identity of one call: unique in the world, and the same when the call is made again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ActionId(pub u128);

impl fmt::Display for ActionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// A call of a function of the embedder's.
#[derive(Clone, Copy, Debug)]
pub struct HostCall<'a> {
    /// Name of the function, in upper case.
    pub name: &'a str,
    /// The arguments.
    pub arguments: &'a [Datum],
    /// The declared effect of the function.
    pub effect: CallEffect,
    /// Number of the operation that the call begins, if it begins one.
    pub operation: Option<u64>,
}

/// A call that an earlier process has made, and that is made again in this one.
#[derive(Clone, Debug)]
pub struct RepeatedCall {
    /// Number of the operation, if the function begins one: greater than those of the machine.
    pub number: u64,
    /// Name of the function.
    pub name: String,
    /// Arguments.
    pub arguments: Vec<Datum>,
}

/// The value of an object of the host that an earlier process held, and that is gone with it.
#[derive(Clone, Copy, Debug)]
pub struct GoneObject;

/// Returns whether data contain an object of the host that is gone with an earlier process.
pub fn has_gone_object(data: &[Datum]) -> bool {
    let mut open: Vec<&Datum> = data.iter().collect();
    while let Some(datum) = open.pop() {
        match datum.kind() {
            DatumKind::Opaque(opaque) if opaque.value().is::<GoneObject>() => return true,
            DatumKind::Cons(car, cdr) => open.extend([car, cdr]),
            DatumKind::Vector(items) | DatumKind::Array(_, items) | DatumKind::Table(items) => {
                open.extend(items.iter())
            }
            _ => {}
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use esl_bytecode::datum::OpaqueDatum;
    use esl_bytecode::span::Span;

    use super::*;

    #[test]
    fn objects_that_are_gone_are_found_inside_of_lists() {
        let opaque = |value| Datum::new(DatumKind::Opaque(value), Span::default());
        let gone = opaque(OpaqueDatum::new("SOCKET", "1", Arc::new(GoneObject)));
        let there = opaque(OpaqueDatum::new("SOCKET", "2", Arc::new(7_u8)));
        let list = |items: Vec<Datum>| Datum::list(items, Span::default());
        assert!(has_gone_object(&[there.clone(), list(vec![list(vec![gone])])]));
        assert!(!has_gone_object(&[list(vec![there, Datum::integer(1, Span::default())])]));
    }

    #[test]
    fn an_action_id_has_all_its_digits() {
        assert_eq!(ActionId(0xab).to_string(), format!("{}ab", "0".repeat(30)));
    }
}
