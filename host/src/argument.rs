//! Arguments of functions of the host, by their types in Rust.

use std::any::Any;
use std::slice::Iter;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::function::Handler;
use super::{ActionId, HostFailure, HostOperation, Inbox, OperationState, Sender};

/// The arguments of one call, which are read from left to right.
pub struct ArgumentReader<'a> {
    data: Iter<'a, Datum>,
    inbox: &'a Inbox,
    operation: Option<&'a HostOperation>,
}

impl<'a> ArgumentReader<'a> {
    pub(crate) fn new(
        data: &'a [Datum],
        inbox: &'a Inbox,
        operation: Option<&'a HostOperation>,
    ) -> ArgumentReader<'a> {
        ArgumentReader { data: data.iter(), inbox, operation }
    }

    /// Returns the next argument; `None` if there are no more.
    pub fn next_datum(&mut self) -> Option<&'a Datum> {
        self.data.next()
    }

    /// Returns the inbox of the machine.
    pub fn inbox(&self) -> &'a Inbox {
        self.inbox
    }

    /// Returns the operation that the call is, if it is one.
    pub fn operation(&self) -> Option<&'a HostOperation> {
        self.operation
    }
}

/// A type that one argument of the program can have.
pub trait FromArgument: Sized {
    /// Name of the type, in upper case, for failures.
    const TYPE: &'static str;

    /// Returns the value that a datum stands for.
    ///
    /// # Errors
    /// A `:type-error`, or another failure about the argument.
    fn from_argument(datum: &Datum) -> Result<Self, HostFailure>;
}

/// A type of a parameter of Rust code: of an argument of the program, or of something else about the call.
pub trait FromCall: Sized {
    /// Number of arguments of the program that it takes.
    const COUNT: usize;

    /// Returns its value for a call.
    ///
    /// # Errors
    /// A failure about an argument.
    fn from_call(call: &mut ArgumentReader<'_>) -> Result<Self, HostFailure>;
}

impl<T: FromArgument> FromCall for T {
    const COUNT: usize = 1;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<T, HostFailure> {
        match call.next_datum() {
            Some(datum) => T::from_argument(datum),
            None => T::from_argument(&Datum::nil(Span::default())),
        }
    }
}

/// A sender to the inputs of the machine. It counts as one until it is dropped.
impl FromCall for Sender {
    const COUNT: usize = 0;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<Sender, HostFailure> {
        Ok(Sender::new(call.inbox()))
    }
}

/// The identity of the call, if the run keeps account of those: see [`HostOperation::action`].
#[derive(Clone, Copy, Debug)]
pub struct CallAction(pub Option<ActionId>);

impl FromCall for CallAction {
    const COUNT: usize = 0;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<CallAction, HostFailure> {
        Ok(CallAction(call.operation().and_then(HostOperation::action)))
    }
}

/// The state of the operation that the call is. A function that returns at once has none: it keeps nothing.
impl FromCall for OperationState {
    const COUNT: usize = 0;

    fn from_call(call: &mut ArgumentReader<'_>) -> Result<OperationState, HostFailure> {
        let none = || OperationState::new(0, call.inbox());
        Ok(call.operation().map_or_else(none, HostOperation::state))
    }
}

/// The types of all parameters of Rust code.
pub trait ArgumentList: Sized {
    /// Number of arguments of the program.
    const COUNT: usize;

    /// Returns the values for a call.
    ///
    /// # Errors
    /// The failure about the first argument that is wrong.
    fn read(call: &mut ArgumentReader<'_>) -> Result<Self, HostFailure>;
}

/// Defines lists of arguments of these types, and code that takes them.
macro_rules! define_arguments {
    ($( ($($name:ident)*) )*) => {
        $(
            impl<$($name: FromCall),*> ArgumentList for ($($name,)*) {
                const COUNT: usize = 0 $(+ $name::COUNT)*;

                #[allow(unused_variables, reason = "there may be no arguments")]
                fn read(call: &mut ArgumentReader<'_>) -> Result<Self, HostFailure> {
                    Ok(($($name::from_call(call)?,)*))
                }
            }

            impl<Code, Output, $($name),*> Handler<($($name,)*), Output> for Code
            where
                Code: FnMut($($name),*) -> Output + Send + 'static,
            {
                #[allow(non_snake_case, reason = "a value is named as its type")]
                fn handle(&mut self, ($($name,)*): ($($name,)*)) -> Output {
                    self($($name),*)
                }
            }
        )*
    };
}

define_arguments! {
    ()
    (A)
    (A B)
    (A B C)
    (A B C D)
    (A B C D E)
    (A B C D E F)
    (A B C D E F G)
    (A B C D E F G H)
    (A B C D E F G H I)
    (A B C D E F G H I J)
    (A B C D E F G H I J K)
    (A B C D E F G H I J K L)
    (A B C D E F G H I J K L M)
}

impl FromArgument for Datum {
    const TYPE: &'static str = "T";

    fn from_argument(datum: &Datum) -> Result<Datum, HostFailure> {
        Ok(datum.clone())
    }
}

impl FromArgument for String {
    const TYPE: &'static str = "STRING";

    fn from_argument(datum: &Datum) -> Result<String, HostFailure> {
        match datum.kind() {
            DatumKind::String(text) => Ok(text.to_string()),
            _ => Err(HostFailure::of_type(datum, Self::TYPE)),
        }
    }
}

impl FromArgument for i64 {
    const TYPE: &'static str = "INTEGER";

    fn from_argument(datum: &Datum) -> Result<i64, HostFailure> {
        match datum.kind() {
            DatumKind::Integer(value) => {
                i64::try_from(value).map_err(|_| HostFailure::of_type(datum, "FIXNUM"))
            }
            _ => Err(HostFailure::of_type(datum, Self::TYPE)),
        }
    }
}

/// Defines arguments that are integers of a smaller type.
macro_rules! small_integers {
    ($($ty:ty),*) => {
        $(
            impl FromArgument for $ty {
                const TYPE: &'static str = "INTEGER";

                fn from_argument(datum: &Datum) -> Result<$ty, HostFailure> {
                    let value = i64::from_argument(datum)?;
                    value.try_into().map_err(|_| {
                        let least = Datum::integer(<$ty>::MIN, Span::default());
                        let greatest = Datum::integer(<$ty>::MAX, Span::default());
                        HostFailure::of_written_type(datum, "INTEGER", [least, greatest])
                    })
                }
            }
        )*
    };
}

small_integers!(u8, u16, u32, u64, usize, i32);

impl FromArgument for f64 {
    const TYPE: &'static str = "REAL";

    fn from_argument(datum: &Datum) -> Result<f64, HostFailure> {
        match datum.kind() {
            DatumKind::Float(value) => Ok(*value),
            _ => i64::from_argument(datum)
                .map(|value| value as f64)
                .map_err(|_| HostFailure::of_type(datum, Self::TYPE)),
        }
    }
}

/// Whether the argument is anything but `NIL`.
impl FromArgument for bool {
    const TYPE: &'static str = "T";

    fn from_argument(datum: &Datum) -> Result<bool, HostFailure> {
        Ok(!datum.is_nil())
    }
}

/// `NIL` is `None`.
impl<T: FromArgument> FromArgument for Option<T> {
    const TYPE: &'static str = T::TYPE;

    fn from_argument(datum: &Datum) -> Result<Option<T>, HostFailure> {
        if datum.is_nil() { Ok(None) } else { T::from_argument(datum).map(Some) }
    }
}

/// A list.
impl<T: FromArgument> FromArgument for Vec<T> {
    const TYPE: &'static str = "LIST";

    fn from_argument(datum: &Datum) -> Result<Vec<T>, HostFailure> {
        let items = datum.as_list().ok_or_else(|| HostFailure::of_type(datum, Self::TYPE))?;
        items.into_iter().map(T::from_argument).collect()
    }
}

/// A pair.
impl<A: FromArgument, B: FromArgument> FromArgument for (A, B) {
    const TYPE: &'static str = "CONS";

    fn from_argument(datum: &Datum) -> Result<(A, B), HostFailure> {
        let (car, cdr) = datum.as_cons().ok_or_else(|| HostFailure::of_type(datum, Self::TYPE))?;
        Ok((A::from_argument(car)?, B::from_argument(cdr)?))
    }
}

/// A vector of bytes. Those of a vector with that element type are shared.
impl FromArgument for Bytes {
    const TYPE: &'static str = "VECTOR";

    fn from_argument(datum: &Datum) -> Result<Bytes, HostFailure> {
        let not_a_byte = |element: &Datum| {
            let bits = Datum::integer(8, Span::default());
            HostFailure::of_written_type(element, "UNSIGNED-BYTE", [bits])
        };
        let byte = |item: &Datum| match item.kind() {
            DatumKind::Integer(value) => u8::try_from(value).map_err(|_| not_a_byte(item)),
            _ => Err(not_a_byte(item)),
        };
        match datum.kind() {
            DatumKind::Packed(PackedVector::Bytes(bytes)) => Ok(bytes.clone()),
            DatumKind::Packed(PackedVector::Floats(floats)) if !floats.is_empty() => {
                Err(not_a_byte(&Datum::new(DatumKind::Float(floats[0]), Span::default())))
            }
            DatumKind::Vector(items) => items.iter().map(byte).collect(),
            _ => Err(HostFailure::of_type(datum, Self::TYPE)),
        }
    }
}

/// Contents of a message, a file or a body: a text, in UTF-8, or a vector of bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Payload(pub Bytes);

impl FromArgument for Payload {
    const TYPE: &'static str = "VECTOR";

    fn from_argument(datum: &Datum) -> Result<Payload, HostFailure> {
        match datum.kind() {
            DatumKind::String(text) => Ok(Payload(Bytes::copy_from_slice(text.as_bytes()))),
            _ => Bytes::from_argument(datum).map(Payload),
        }
    }
}

impl HostFailure {
    /// Creates the failure of a cause, a keyword's name, with a text.
    pub fn new(cause: &str, reason: impl ToString) -> HostFailure {
        let reason = Datum::string(&reason.to_string(), Span::default());
        HostFailure { cause: cause.into(), arguments: vec![reason] }
    }

    /// Creates the failure of code of the host that has panicked.
    pub fn of_panic(panic: &(dyn Any + Send)) -> HostFailure {
        let text = panic.downcast_ref::<&str>().map(ToString::to_string);
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        let arguments = text.map(|text| Datum::string(&text, Span::default())).into_iter().collect();
        HostFailure { cause: "HOST-PANIC".into(), arguments }
    }

    /// Creates the failure of an argument that is not of the expected type, a name in `COMMON-LISP`.
    pub fn of_type(datum: &Datum, expected: &str) -> HostFailure {
        let expected = Datum::string(expected, Span::default());
        HostFailure { cause: "TYPE-ERROR".into(), arguments: vec![datum.clone(), expected] }
    }

    /// Creates the failure of an argument that is not of the expected type, a list of a name in `COMMON-LISP`
    /// and its arguments.
    pub fn of_written_type<const N: usize>(datum: &Datum, name: &str, rest: [Datum; N]) -> HostFailure {
        let name = Datum::symbol(Symbol::cl(name), Span::default());
        let expected = Datum::list(std::iter::once(name).chain(rest).collect::<Vec<_>>(), Span::default());
        HostFailure { cause: "TYPE-ERROR".into(), arguments: vec![datum.clone(), expected] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IntoDatum;

    fn fault<T: FromArgument>(datum: &Datum) -> String {
        match T::from_argument(datum) {
            Ok(_) => "none".into(),
            Err(failure) => format!("{} {:?}", failure.cause, failure.arguments),
        }
    }

    fn vector(items: &[i64]) -> Datum {
        let items = items.iter().map(|&n| n.into_datum()).collect();
        Datum::new(DatumKind::Vector(items), Span::default())
    }

    #[test]
    fn contents_are_a_text_or_bytes() {
        let contents = |datum: &Datum| Payload::from_argument(datum).ok().map(|contents| contents.0.to_vec());
        assert_eq!(contents(&"\u{e9}".into_datum()), Some(vec![0xc3, 0xa9]));
        assert_eq!(contents(&Bytes::from(vec![0xe9]).into_datum()), Some(vec![0xe9]));
        assert_eq!(contents(&vector(&[0, 255])), Some(vec![0, 255]));
        assert_eq!(fault::<Payload>(&vector(&[0, 256, 300])), "TYPE-ERROR [256, (UNSIGNED-BYTE 8)]");
        assert_eq!(fault::<Payload>(&vector(&[-1])), "TYPE-ERROR [-1, (UNSIGNED-BYTE 8)]");
        let floats = Datum::new(DatumKind::Packed(PackedVector::Floats([1.5].into())), Span::default());
        assert_eq!(fault::<Payload>(&floats), "TYPE-ERROR [1.5, (UNSIGNED-BYTE 8)]");
        assert_eq!(fault::<Payload>(&7_i64.into_datum()), "TYPE-ERROR [7, \"VECTOR\"]");
    }

    #[test]
    fn wrong_arguments_are_named_with_the_expected_type() {
        assert_eq!(fault::<u16>(&70_000_i64.into_datum()), "TYPE-ERROR [70000, (INTEGER 0 65535)]");
        assert_eq!(fault::<Vec<String>>(&vec![1_i64].into_datum()), "TYPE-ERROR [1, \"STRING\"]");
        let pairs = vec![("a".to_owned(), "b".to_owned())].into_datum();
        assert_eq!(fault::<Vec<(String, String)>>(&pairs), "none");
        assert_eq!(fault::<(String, String)>(&"a".into_datum()), "TYPE-ERROR [\"a\", \"CONS\"]");
        assert_eq!(Option::<String>::from_argument(&false.into_datum()).ok(), Some(None));
    }
}
