//! Kinds of arguments: what the name of a parameter in the builtin table says of the constants that it
//! refuses.
//!
//! The names of parameters in [`crate::builtin`] are words for kinds: a parameter called `number` takes a
//! number. So the compiler can tell from the table that `(+ 1 "2")` fails. A kind refuses a constant only if
//! every builtin with such a parameter does; `conformance/tests/language/constants.rs` calls each of them
//! with each refused constant.

use crate::datum::DatumKind;

/// Kind of argument that a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArgumentKind {
    /// A number.
    Number,
    /// An integer.
    Integer,
    /// A character.
    Character,
    /// A string, or a symbol or character that stands for one.
    Text,
    /// A list.
    List,
    /// A list, vector or string.
    Sequence,
    /// An array, such as a vector or string.
    Array,
    /// A hash table, which no constant is.
    Table,
    /// A symbol.
    Symbol,
    /// A function, or the name of one.
    Function,
}

/// Class of a constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConstantClass {
    /// An integer.
    Integer,
    /// Another number.
    Number,
    /// A character.
    Character,
    /// A string.
    String,
    /// `NIL`.
    Nil,
    /// Another symbol.
    Symbol,
    /// A pair.
    Pair,
    /// A vector.
    Vector,
}

impl ArgumentKind {
    /// Returns the kind that a parameter of this name, in lower case, has in the builtin table.
    pub fn of_parameter(name: &str) -> Option<ArgumentKind> {
        Some(match name {
            "number" | "numbers" | "divisor" | "power" | "radians" | "seconds" => ArgumentKind::Number,
            "integer" | "integers" | "index" => ArgumentKind::Integer,
            "character" | "characters" => ArgumentKind::Character,
            "string" => ArgumentKind::Text,
            "list" => ArgumentKind::List,
            "sequence" => ArgumentKind::Sequence,
            "vector" | "array" => ArgumentKind::Array,
            "table" => ArgumentKind::Table,
            "symbol" => ArgumentKind::Symbol,
            "function" => ArgumentKind::Function,
            _ => return None,
        })
    }

    /// Returns whether a constant of this class may be of the kind.
    pub fn may_be(self, class: ConstantClass) -> bool {
        use ConstantClass::*;
        match self {
            ArgumentKind::Number => matches!(class, Integer | Number),
            ArgumentKind::Integer => class == Integer,
            ArgumentKind::Character => class == Character,
            ArgumentKind::Text => matches!(class, String | Nil | Symbol | Character),
            ArgumentKind::List => matches!(class, Nil | Pair),
            ArgumentKind::Sequence => matches!(class, Nil | Pair | String | Vector),
            ArgumentKind::Array => matches!(class, String | Vector),
            ArgumentKind::Table => false,
            ArgumentKind::Symbol => matches!(class, Nil | Symbol),
            ArgumentKind::Function => matches!(class, Nil | Symbol | Pair),
        }
    }

    /// Returns the kind as messages name it, with its article.
    pub fn noun(self) -> &'static str {
        match self {
            ArgumentKind::Number => "a number",
            ArgumentKind::Integer => "an integer",
            ArgumentKind::Character => "a character",
            ArgumentKind::Text => "a string",
            ArgumentKind::List => "a list",
            ArgumentKind::Sequence => "a sequence",
            ArgumentKind::Array => "an array",
            ArgumentKind::Table => "a hash table",
            ArgumentKind::Symbol => "a symbol",
            ArgumentKind::Function => "a function",
        }
    }
}

impl ConstantClass {
    /// Returns the class of a datum; `None` for data that are rarely constants.
    pub fn of(datum: &DatumKind) -> Option<ConstantClass> {
        Some(match datum {
            DatumKind::Nil => ConstantClass::Nil,
            DatumKind::Integer(_) => ConstantClass::Integer,
            DatumKind::Float(_) | DatumKind::Ratio(..) => ConstantClass::Number,
            DatumKind::Character(_) => ConstantClass::Character,
            DatumKind::String(_) => ConstantClass::String,
            DatumKind::Symbol(_) => ConstantClass::Symbol,
            DatumKind::Cons(..) => ConstantClass::Pair,
            DatumKind::Vector(_) | DatumKind::Packed(_) => ConstantClass::Vector,
            _ => return None,
        })
    }

    /// Returns the class as messages name it, with its article.
    pub fn noun(self) -> &'static str {
        match self {
            ConstantClass::Integer | ConstantClass::Number => "the number",
            ConstantClass::Character => "the character",
            ConstantClass::String => "the string",
            ConstantClass::Nil => "the empty list",
            ConstantClass::Symbol => "the symbol",
            ConstantClass::Pair => "the list",
            ConstantClass::Vector => "the vector",
        }
    }
}
