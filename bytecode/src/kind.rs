//! Types of values, and kinds of arguments, which refuse constants.
//!
//! The names of parameters in [`crate::builtin`] are words for kinds: a parameter called `number` takes a
//! number. So the compiler can tell from the table that `(+ 1 "2")` fails. A kind refuses a constant only if
//! every builtin with such a parameter does; `conformance/tests/language/constants.rs` calls each of them
//! with each refused constant.

use std::sync::LazyLock;

use crate::builtin::{BUILTINS, Builtin, BuiltinInfo, Visibility};
use crate::datum::DatumKind;

/// A set of values: a union of disjoint classes of values, one a bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ValueType(u32);

impl ValueType {
    /// No value.
    pub const NONE: ValueType = ValueType(0);
    /// The empty list.
    pub const NIL: ValueType = ValueType(1);
    /// Symbols other than `NIL`.
    pub const OTHER_SYMBOL: ValueType = ValueType(1 << 1);
    /// Integers.
    pub const INTEGER: ValueType = ValueType(1 << 2);
    /// Ratios that are not integers.
    pub const RATIO: ValueType = ValueType(1 << 3);
    /// Floats.
    pub const FLOAT: ValueType = ValueType(1 << 4);
    /// Complex numbers.
    pub const COMPLEX: ValueType = ValueType(1 << 5);
    /// Characters.
    pub const CHARACTER: ValueType = ValueType(1 << 6);
    /// Strings.
    pub const STRING: ValueType = ValueType(1 << 7);
    /// Pairs.
    pub const PAIR: ValueType = ValueType(1 << 8);
    /// Arrays that are not strings.
    pub const OTHER_ARRAY: ValueType = ValueType(1 << 9);
    /// Hash tables.
    pub const TABLE: ValueType = ValueType(1 << 10);
    /// Functions.
    pub const FUNCTION: ValueType = ValueType(1 << 11);
    /// Instances of structures, conditions and classes.
    pub const INSTANCE: ValueType = ValueType(1 << 12);
    /// Streams.
    pub const STREAM: ValueType = ValueType(1 << 13);
    /// All other objects, such as tasks, events and packages.
    pub const OTHER: ValueType = ValueType(1 << 14);
    /// Any value.
    pub const ANY: ValueType = ValueType((1 << 15) - 1);
    /// Symbols.
    pub const SYMBOL: ValueType = ValueType::NIL.or(ValueType::OTHER_SYMBOL);
    /// Integers and ratios.
    pub const RATIONAL: ValueType = ValueType::INTEGER.or(ValueType::RATIO);
    /// Rationals and floats.
    pub const REAL: ValueType = ValueType::RATIONAL.or(ValueType::FLOAT);
    /// Numbers.
    pub const NUMBER: ValueType = ValueType::REAL.or(ValueType::COMPLEX);
    /// Lists.
    pub const LIST: ValueType = ValueType::NIL.or(ValueType::PAIR);
    /// Arrays.
    pub const ARRAY: ValueType = ValueType::STRING.or(ValueType::OTHER_ARRAY);
    /// Lists, vectors and strings.
    pub const SEQUENCE: ValueType = ValueType::LIST.or(ValueType::ARRAY);

    /// Returns the values of either set.
    pub const fn or(self, other: ValueType) -> ValueType {
        ValueType(self.0 | other.0)
    }

    /// Returns the values of both sets.
    pub const fn and(self, other: ValueType) -> ValueType {
        ValueType(self.0 & other.0)
    }

    /// Returns the values of this set that are not in another.
    pub const fn without(self, other: ValueType) -> ValueType {
        ValueType(self.0 & !other.0)
    }

    /// Whether no value is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether all values of another set are in this one.
    pub const fn contains(self, other: ValueType) -> bool {
        other.0 & !self.0 == 0
    }

    /// Returns the type of a constant.
    pub fn of_datum(datum: &DatumKind) -> ValueType {
        match datum {
            DatumKind::Nil => ValueType::NIL,
            DatumKind::Integer(_) => ValueType::INTEGER,
            DatumKind::Ratio(..) => ValueType::RATIO,
            DatumKind::Float(_) => ValueType::FLOAT,
            DatumKind::Character(_) => ValueType::CHARACTER,
            DatumKind::String(_) => ValueType::STRING,
            DatumKind::Symbol(symbol) if symbol.is_cl("NIL") => ValueType::NIL,
            DatumKind::Symbol(_) => ValueType::OTHER_SYMBOL,
            DatumKind::Cons(..) => ValueType::PAIR,
            DatumKind::Vector(_) | DatumKind::Packed(_) => ValueType::OTHER_ARRAY,
            _ => ValueType::ANY,
        }
    }

    /// Returns the set as messages name it, with its article: `a number or a string`.
    pub fn noun(self) -> String {
        const NAMED: &[(ValueType, &str)] = &[
            (ValueType::SEQUENCE, "a sequence"),
            (ValueType::NUMBER, "a number"),
            (ValueType::REAL, "a real number"),
            (ValueType::RATIONAL, "a rational number"),
            (ValueType::INTEGER, "an integer"),
            (ValueType::RATIO, "a ratio"),
            (ValueType::FLOAT, "a float"),
            (ValueType::COMPLEX, "a complex number"),
            (ValueType::ARRAY, "an array"),
            (ValueType::STRING, "a string"),
            (ValueType::OTHER_ARRAY, "an array"),
            (ValueType::LIST, "a list"),
            (ValueType::PAIR, "a pair"),
            (ValueType::SYMBOL, "a symbol"),
            (ValueType::OTHER_SYMBOL, "a symbol"),
            (ValueType::NIL, "`nil`"),
            (ValueType::CHARACTER, "a character"),
            (ValueType::TABLE, "a hash table"),
            (ValueType::FUNCTION, "a function"),
            (ValueType::INSTANCE, "an instance"),
            (ValueType::STREAM, "a stream"),
            (ValueType::OTHER, "another object"),
        ];
        let mut left = self;
        let mut words: Vec<&str> = Vec::new();
        for (part, word) in NAMED {
            if left.contains(*part) && !left.is_empty() {
                words.push(word);
                left = left.without(*part);
            }
        }
        match words.as_slice() {
            [] => "nothing".into(),
            [one] => (*one).into(),
            [first @ .., last] => format!("{} or {last}", first.join(", ")),
        }
    }
}

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

/// Kinds of the parameters of a builtin; none for those of internal ones, to which the library may pass `NIL`
/// for an argument that it leaves out.
#[derive(Debug, Default)]
pub struct ParameterKinds {
    positional: Vec<Option<ArgumentKind>>,
    /// Kind of the arguments after these.
    rest: Option<ArgumentKind>,
}

impl ParameterKinds {
    /// Returns the kinds of the parameters of a builtin.
    pub fn of(builtin: Builtin) -> &'static ParameterKinds {
        static KINDS: LazyLock<Vec<ParameterKinds>> =
            LazyLock::new(|| BUILTINS.iter().map(ParameterKinds::of_row).collect());
        &KINDS[builtin.number() as usize]
    }

    fn of_row(info: &BuiltinInfo) -> ParameterKinds {
        let mut kinds = ParameterKinds::default();
        if info.visibility == Visibility::Internal {
            return kinds;
        }
        let mut is_rest = false;
        for word in info.lambda_list.split_whitespace() {
            match word {
                "&rest" => is_rest = true,
                "&optional" => {}
                name if is_rest => kinds.rest = ArgumentKind::of_parameter(name),
                name => kinds.positional.push(ArgumentKind::of_parameter(name)),
            }
        }
        kinds
    }

    /// Returns the kind of the argument at this place.
    pub fn at(&self, place: usize) -> Option<ArgumentKind> {
        *self.positional.get(place).unwrap_or(&self.rest)
    }

    /// Whether no parameter has a kind.
    pub fn are_unknown(&self) -> bool {
        self.rest.is_none() && self.positional.iter().all(Option::is_none)
    }
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

    /// Returns the type of the values that are of the kind.
    pub fn values(self) -> ValueType {
        match self {
            ArgumentKind::Number => ValueType::NUMBER,
            ArgumentKind::Integer => ValueType::INTEGER,
            ArgumentKind::Character => ValueType::CHARACTER,
            ArgumentKind::Text => ValueType::STRING.or(ValueType::SYMBOL).or(ValueType::CHARACTER),
            ArgumentKind::List => ValueType::LIST,
            ArgumentKind::Sequence => ValueType::SEQUENCE,
            ArgumentKind::Array => ValueType::ARRAY,
            ArgumentKind::Table => ValueType::TABLE,
            ArgumentKind::Symbol => ValueType::SYMBOL,
            // Instances of classes may be called.
            ArgumentKind::Function => {
                ValueType::FUNCTION.or(ValueType::SYMBOL).or(ValueType::PAIR).or(ValueType::INSTANCE)
            }
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
