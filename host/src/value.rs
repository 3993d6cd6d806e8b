//! Values of functions of the host, from their types in Rust, and things of the host that programs hold.

use std::any::Any;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::HostFailure;
use super::argument::FromArgument;

/// A type that a value for a program can have.
pub trait IntoDatum {
    /// Returns the value as data.
    fn into_datum(self) -> Datum;
}

/// A type that the values of an operation can have: `()` for none, a pair or a triple for two or three.
pub trait IntoValues {
    /// Returns the values.
    fn into_values(self) -> Vec<Datum>;
}

/// Defines data of some types.
macro_rules! define_data {
    ($( $ty:ty, |$value:ident| $datum:expr ; )*) => {
        $(
            impl IntoDatum for $ty {
                fn into_datum(self) -> Datum {
                    let $value = self;
                    $datum
                }
            }

            impl IntoValues for $ty {
                fn into_values(self) -> Vec<Datum> {
                    vec![self.into_datum()]
                }
            }
        )*
    };
}

define_data! {
    Datum, |datum| datum;
    bool, |value| if value { Datum::symbol(Symbol::cl("T"), Span::default()) } else { nil() };
    i64, |value| Datum::integer(value, Span::default());
    i32, |value| Datum::integer(value, Span::default());
    u32, |value| Datum::integer(value, Span::default());
    u16, |value| Datum::integer(value, Span::default());
    f64, |value| Datum::new(DatumKind::Float(value), Span::default());
    &str, |text| Datum::string(text, Span::default());
    String, |text| Datum::string(&text, Span::default());
    Bytes, |bytes| Datum::bytes(bytes, Span::default());
    Arc<[f64]>, |floats| Datum::new(DatumKind::Packed(PackedVector::Floats(floats)), Span::default());
    Keyword, |keyword| Datum::symbol(Symbol::keyword(keyword.0), Span::default());
}

fn nil() -> Datum {
    Datum::nil(Span::default())
}

/// A keyword, by its name in upper case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Keyword(pub &'static str);

impl IntoDatum for () {
    fn into_datum(self) -> Datum {
        nil()
    }
}

impl IntoValues for () {
    fn into_values(self) -> Vec<Datum> {
        Vec::new()
    }
}

/// `None` is `NIL`.
impl<T: IntoDatum> IntoDatum for Option<T> {
    fn into_datum(self) -> Datum {
        self.map_or_else(nil, T::into_datum)
    }
}

impl<T: IntoDatum> IntoValues for Option<T> {
    fn into_values(self) -> Vec<Datum> {
        vec![self.into_datum()]
    }
}

/// A list.
impl<T: IntoDatum> IntoDatum for Vec<T> {
    fn into_datum(self) -> Datum {
        Datum::list(self.into_iter().map(T::into_datum), Span::default())
    }
}

impl<T: IntoDatum> IntoValues for Vec<T> {
    fn into_values(self) -> Vec<Datum> {
        vec![self.into_datum()]
    }
}

/// A pair.
impl<A: IntoDatum, B: IntoDatum> IntoDatum for (A, B) {
    fn into_datum(self) -> Datum {
        Datum::cons(self.0.into_datum(), self.1.into_datum(), Span::default())
    }
}

impl<A: IntoDatum, B: IntoDatum> IntoValues for (A, B) {
    fn into_values(self) -> Vec<Datum> {
        vec![self.0.into_datum(), self.1.into_datum()]
    }
}

impl<A: IntoDatum, B: IntoDatum, C: IntoDatum> IntoValues for (A, B, C) {
    fn into_values(self) -> Vec<Datum> {
        vec![self.0.into_datum(), self.1.into_datum(), self.2.into_datum()]
    }
}

/// Values that are data already, in their order.
pub struct Values(pub Vec<Datum>);

impl IntoValues for Values {
    fn into_values(self) -> Vec<Datum> {
        self.0
    }
}

/// A type of things of the host that programs hold.
pub trait HostObject: Any + Send + Sync {
    /// Name of the type, in upper case.
    const KIND: &'static str;
}

/// A thing of the host that a program holds. It is dropped when neither the program nor the host has it any
/// more.
pub struct HostHandle<T> {
    object: Arc<T>,
    datum: OpaqueDatum,
}

impl<T: HostObject> HostHandle<T> {
    /// Creates a handle, which `number` tells from others of its kind when it is printed: it has to be the
    /// same in every run of a program.
    pub fn new(number: i64, object: T) -> HostHandle<T> {
        let object = Arc::new(object);
        let datum = OpaqueDatum::new(T::KIND, &number.to_string(), object.clone());
        HostHandle { object, datum }
    }

    /// Returns the thing itself.
    pub fn object(&self) -> &Arc<T> {
        &self.object
    }
}

impl<T> Clone for HostHandle<T> {
    fn clone(&self) -> HostHandle<T> {
        HostHandle { object: self.object.clone(), datum: self.datum.clone() }
    }
}

impl<T> fmt::Debug for HostHandle<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.datum.fmt(f)
    }
}

impl<T> Deref for HostHandle<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.object
    }
}

impl<T: HostObject> FromArgument for HostHandle<T> {
    const TYPE: &'static str = T::KIND;

    fn from_argument(datum: &Datum) -> Result<HostHandle<T>, HostFailure> {
        let wrong = || HostFailure::of_type(datum, T::KIND);
        let DatumKind::Opaque(opaque) = datum.kind() else { return Err(wrong()) };
        let object = opaque.value().clone().downcast().map_err(|_| wrong())?;
        Ok(HostHandle { object, datum: opaque.clone() })
    }
}

impl<T> IntoDatum for HostHandle<T> {
    fn into_datum(self) -> Datum {
        Datum::new(DatumKind::Opaque(self.datum), Span::default())
    }
}

impl<T> IntoValues for HostHandle<T> {
    fn into_values(self) -> Vec<Datum> {
        vec![self.into_datum()]
    }
}
