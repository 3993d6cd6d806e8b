//! Property lists that cross the border from the host to a program without a datum for each part: messages of
//! robots, which have the same keys each time.
//!
//! Guarantees: the list is made only if it is asked for, and then once, so that its parts have an identity.

use std::sync::{Arc, OnceLock};

use crate::datum::{Datum, DatumKind};
use crate::span::Span;

/// A value of a [`PropertyList`].
#[derive(Clone, Debug)]
pub enum PropertyValue {
    /// An integer.
    Integer(i64),
    /// A double float.
    Float(f64),
    /// Any other value.
    Datum(Datum),
}

impl PropertyValue {
    /// Returns the value as a datum.
    pub fn to_datum(&self) -> Datum {
        match self {
            PropertyValue::Integer(value) => Datum::integer(*value, Span::default()),
            PropertyValue::Float(value) => Datum::new(DatumKind::Float(*value), Span::default()),
            PropertyValue::Datum(datum) => datum.clone(),
        }
    }
}

impl From<Datum> for PropertyValue {
    fn from(datum: Datum) -> PropertyValue {
        PropertyValue::Datum(datum)
    }
}

/// A property list: `keys` and `values` in turns.
#[derive(Debug)]
pub struct PropertyList {
    keys: Arc<[Datum]>,
    values: Vec<PropertyValue>,
    /// The same as a list.
    list: OnceLock<Datum>,
}

impl PropertyList {
    /// Creates a property list of as many keys, which are symbols, as values.
    pub(crate) fn new(keys: Arc<[Datum]>, values: Vec<PropertyValue>) -> PropertyList {
        debug_assert_eq!(keys.len(), values.len(), "each key has a value");
        PropertyList { keys, values, list: OnceLock::new() }
    }

    /// Returns the keys.
    pub fn keys(&self) -> &[Datum] {
        &self.keys
    }

    /// Returns the values, in the order of their keys.
    pub fn values(&self) -> &[PropertyValue] {
        &self.values
    }

    /// Returns the values that are data.
    pub fn data(&self) -> impl DoubleEndedIterator<Item = &Datum> {
        self.values.iter().filter_map(|value| match value {
            PropertyValue::Datum(datum) => Some(datum),
            _ => None,
        })
    }

    /// Returns whether the list was made.
    pub(crate) fn has_list(&self) -> bool {
        self.list.get().is_some()
    }

    /// Returns the list.
    pub(crate) fn list(&self) -> &Datum {
        self.list.get_or_init(|| {
            let pairs = self.keys.iter().zip(&self.values);
            let span = Span::default();
            pairs.rev().fold(Datum::nil(span), |rest, (key, value)| {
                Datum::cons(key.clone(), Datum::cons(value.to_datum(), rest, span), span)
            })
        })
    }

    /// Takes out all data, to be dropped elsewhere.
    pub(crate) fn take_data(&mut self) -> impl Iterator<Item = Datum> {
        let values = std::mem::take(&mut self.values).into_iter();
        let data = values.filter_map(|value| match value {
            PropertyValue::Datum(datum) => Some(datum),
            _ => None,
        });
        data.chain(self.list.take())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::symbol::Symbol;

    fn keys(names: &[&str]) -> Arc<[Datum]> {
        names.iter().map(|name| Datum::symbol(Symbol::keyword(name), Span::default())).collect()
    }

    #[test]
    fn a_property_list_is_a_list_to_those_who_ask() {
        let inner = Datum::properties(keys(&["C"]), vec![PropertyValue::Integer(1)]);
        let values = vec![PropertyValue::Float(0.5), inner.into()];
        let datum = Datum::properties(keys(&["A", "B"]), values);
        assert!(datum.is_compound() && !datum.is_nil() && datum.as_symbol().is_none());
        // None of these has made the list.
        assert!(datum.as_properties().is_some());
        assert_eq!(datum.to_string(), "(:A 0.5 :B (:C 1))");
        assert!(datum.as_properties().is_none());
        let rest = |datum: &Datum| datum.as_cons().map(|(_, rest)| rest.clone());
        let (first, second) = (rest(&datum).expect("a pair"), rest(&datum).expect("a pair"));
        assert!(first.is_same(&second), "the parts have an identity");
    }

    #[test]
    fn without_keys_it_is_the_empty_list() {
        assert!(Datum::properties(keys(&[]), Vec::new()).is_nil());
    }

    #[test]
    fn a_deep_property_list_is_dropped_without_native_recursion() {
        let keys = keys(&["A"]);
        let mut deep = Datum::nil(Span::default());
        for _ in 0..200_000 {
            deep = Datum::properties(keys.clone(), vec![deep.into()]);
        }
        drop(deep);
    }
}
