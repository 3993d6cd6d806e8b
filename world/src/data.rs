//! Arguments and values of operations, as data of the machine.
//!
//! Bytes pass as strings of the characters 0 to 255, since data have no vectors of bytes.

use std::collections::HashMap;
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::HostFailure;

/// Returns the text of a string.
pub(crate) fn text_of(datum: &Datum) -> Option<&str> {
    match datum.kind() {
        DatumKind::String(text) => Some(text),
        _ => None,
    }
}

/// Returns the string of a text.
pub(crate) fn text(text: &str) -> Datum {
    Datum::string(text, Span::default())
}

/// Returns bytes as a string of the characters 0 to 255.
pub(crate) fn text_of_bytes(bytes: &[u8]) -> Datum {
    text(&bytes.iter().map(|&byte| char::from(byte)).collect::<String>())
}

/// Returns the bytes of such a string. All bytes that a program hands to the system pass here.
///
/// # Errors
/// A `:type-error` about the first character that is not a byte, by its code.
pub(crate) fn bytes_of(text: &str) -> Result<Vec<u8>, HostFailure> {
    let byte_of = |character: char| {
        let code = u32::from(character);
        u8::try_from(code).map_err(|_| not_a_byte(code))
    };
    text.chars().map(byte_of).collect()
}

fn not_a_byte(code: u32) -> HostFailure {
    let name = Datum::symbol(Symbol::cl("UNSIGNED-BYTE"), Span::default());
    let expected = Datum::list([name, integer(8)], Span::default());
    HostFailure { cause: "TYPE-ERROR".into(), arguments: vec![integer(code), expected] }
}

/// Returns an integer as data.
pub(crate) fn integer(value: impl Into<i64>) -> Datum {
    Datum::integer(value.into(), Span::default())
}

/// Returns `T` or `NIL`.
pub(crate) fn boolean(value: bool) -> Datum {
    if value { Datum::symbol(Symbol::cl("T"), Span::default()) } else { nil() }
}

/// Returns `NIL`.
pub(crate) fn nil() -> Datum {
    Datum::nil(Span::default())
}

/// Returns the failure of a cause, a keyword's name, with a text.
pub(crate) fn failure(cause: &str, reason: impl ToString) -> HostFailure {
    HostFailure { cause: cause.into(), arguments: vec![text(&reason.to_string())] }
}

/// What a program holds of something that is open, beside its number: when the program cannot reach it any
/// more, it is closed.
struct Guard {
    number: i64,
    close: Box<dyn Fn(i64) + Send + Sync>,
}

impl Drop for Guard {
    fn drop(&mut self) {
        (self.close)(self.number);
    }
}

/// Returns the handle of something that is open, which is closed by `close` when the program has lost it.
pub(crate) fn handle(kind: &str, number: i64, close: impl Fn(i64) + Send + Sync + 'static) -> Datum {
    let guard = Guard { number, close: Box::new(close) };
    let opaque = OpaqueDatum::new(kind, &number.to_string(), Arc::new(guard));
    Datum::new(DatumKind::Opaque(opaque), Span::default())
}

/// Things that a program knows by numbers: the greatest number so far, and the things; `None` for one that is
/// still being opened.
pub(crate) type Numbered<T> = (i64, HashMap<i64, Option<T>>);

/// The arguments of a call, in the order of the lambda list.
pub(crate) struct CallArguments(pub(crate) Vec<Datum>);

impl CallArguments {
    fn get(&self, index: usize, expected: &str) -> Result<&Datum, HostFailure> {
        self.0.get(index).ok_or_else(|| wrong(&nil(), expected))
    }

    /// Returns an argument that is a string.
    pub(crate) fn text(&self, index: usize) -> Result<String, HostFailure> {
        let datum = self.get(index, "STRING")?;
        text_of(datum).map(str::to_owned).ok_or_else(|| wrong(datum, "STRING"))
    }

    /// Returns the bytes of an argument that is a string of the characters 0 to 255.
    pub(crate) fn bytes(&self, index: usize) -> Result<Vec<u8>, HostFailure> {
        let datum = self.get(index, "STRING")?;
        bytes_of(text_of(datum).ok_or_else(|| wrong(datum, "STRING"))?)
    }

    /// Returns the bytes of an argument that is a text, in UTF-8; as [`CallArguments::bytes`] if the argument
    /// at `are_bytes` is true.
    pub(crate) fn bytes_or_text(&self, index: usize, are_bytes: usize) -> Result<Vec<u8>, HostFailure> {
        if self.is_true(are_bytes) { self.bytes(index) } else { Ok(self.text(index)?.into_bytes()) }
    }

    /// Returns an argument that is a string or `NIL`.
    pub(crate) fn text_if_any(&self, index: usize) -> Result<Option<String>, HostFailure> {
        if self.is_true(index) { self.text(index).map(Some) } else { Ok(None) }
    }

    /// Returns the number that an argument stands for, which is a handle.
    pub(crate) fn number(&self, index: usize) -> Result<i64, HostFailure> {
        let datum = self.get(index, "INTEGER")?;
        match datum.kind() {
            DatumKind::Opaque(opaque) => opaque.value().downcast_ref::<Guard>().map(|guard| guard.number),
            _ => None,
        }
        .map_or_else(|| self.integer(index), Ok)
    }

    /// Returns an argument that is an integer.
    pub(crate) fn integer(&self, index: usize) -> Result<i64, HostFailure> {
        let datum = self.get(index, "INTEGER")?;
        match datum.kind() {
            DatumKind::Integer(value) => i64::try_from(value).map_err(|_| wrong(datum, "FIXNUM")),
            _ => Err(wrong(datum, "INTEGER")),
        }
    }

    /// Returns an argument that is a list of strings.
    pub(crate) fn texts(&self, index: usize) -> Result<Vec<String>, HostFailure> {
        let datum = self.get(index, "LIST")?;
        let items = datum.as_list().ok_or_else(|| wrong(datum, "LIST"))?;
        items
            .into_iter()
            .map(|item| text_of(item).map(str::to_owned).ok_or_else(|| wrong(item, "STRING")))
            .collect()
    }

    /// Returns an argument that is an association list of strings.
    pub(crate) fn pairs(&self, index: usize) -> Result<Vec<(String, String)>, HostFailure> {
        let datum = self.get(index, "LIST")?;
        let items = datum.as_list().ok_or_else(|| wrong(datum, "LIST"))?;
        items
            .into_iter()
            .map(|item| {
                let (name, value) = item.as_cons().ok_or_else(|| wrong(item, "CONS"))?;
                match (text_of(name), text_of(value)) {
                    (Some(name), Some(value)) => Ok((name.to_owned(), value.to_owned())),
                    _ => Err(wrong(item, "CONS")),
                }
            })
            .collect()
    }

    /// Returns whether an argument is anything but `NIL`.
    pub(crate) fn is_true(&self, index: usize) -> bool {
        self.0.get(index).is_some_and(|datum| !datum.is_nil())
    }
}

fn wrong(datum: &Datum, expected: &str) -> HostFailure {
    HostFailure { cause: "TYPE-ERROR".into(), arguments: vec![datum.clone(), text(expected)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_characters_below_256_are_bytes() {
        assert_eq!(bytes_of("\0a\u{ff}").ok(), Some(vec![0, 97, 255]));
        for (text, code) in [("a\u{100}", 256), ("\u{12c}\u{100}", 300), ("\u{10ffff}", 0x10_ffff)] {
            let failure = bytes_of(text).expect_err("it is refused");
            assert_eq!(failure.cause, "TYPE-ERROR");
            let [datum, expected] = &failure.arguments[..] else { panic!("there are two") };
            assert_eq!(
                (datum.to_string(), expected.to_string()),
                (code.to_string(), "(UNSIGNED-BYTE 8)".into())
            );
        }
    }

    #[test]
    fn a_text_is_given_in_utf_8_or_as_bytes() {
        let arguments = CallArguments(vec![text("\u{e9}"), nil(), boolean(true), integer(5)]);
        assert_eq!(arguments.bytes_or_text(0, 1).ok(), Some(vec![0xc3, 0xa9]));
        assert_eq!(arguments.bytes_or_text(0, 2).ok(), Some(vec![0xe9]));
        assert!(arguments.bytes(3).is_err() && arguments.bytes(9).is_err());
    }
}
