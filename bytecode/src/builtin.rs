//! The builtin table: every function that is written in Rust, declared once.
//!
//! A row is: the path of the implementation below `builtins` of the virtual machine, the home package (`cl`,
//! `esl`, or `internal` for the library's own use), the name, and the lambda list; what a call shares with
//! other tasks ([`Shares`]); `-> one` if the compiler counts on exactly one value; `gives` and the type of
//! the first value; `tests` and the type that a predicate tests for; and for a builtin with a limit of work,
//! the ESL function that takes over from it. The compiler takes names and arities from here, analyses the
//! types of values, the virtual machine its table of implementations, `help` and the reference their text.
//! The types of arguments follow from the names of parameters: see [`crate::kind`].
//!
//! Builtins take required, optional and rest arguments only; functions with keyword arguments are written in
//! ESL.
//!
//! Not here: the implementations. A path is only a name until the virtual machine's use of
//! [`for_each_builtin`] expands it.
//!
//! [`for_each_builtin`]: crate::for_each_builtin

use std::sync::LazyLock;

use rustc_hash::FxHashMap;

use crate::compile::Arity;
use crate::kind::ValueType;
use crate::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};

/// Package and visibility of a builtin's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// A name of the package `COMMON-LISP`.
    Cl,
    /// An external name of the package `ESL`.
    Esl,
    /// An internal name of the package `ESL`, for the library.
    Internal,
}

/// The relation of a builtin's calls to other tasks, for explorations of schedules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shares {
    /// Nothing: it changes no object that was there before the call.
    Nothing,
    /// Its reads and changes are at a point, before which other tasks may go first.
    Points,
    /// It changes a pair that others may hold.
    Pairs,
    /// It changes an element of an array or a string that others may hold, or its size.
    Elements,
    /// It changes a slot of a structure or an instance that others may hold.
    Slots,
    /// It changes a hash table that others may hold.
    Tables,
    /// It changes the properties of a symbol.
    Properties,
    /// It changes the value of a special variable.
    Variables,
    /// It changes a variable that a closure shares with its surroundings. An instruction does so, no builtin.
    Captured,
    /// It makes a stream, which other tasks may come to hold.
    Streams,
    /// It changes a function, a class or a package.
    Definitions,
    /// It reads the clock, so that the further course depends on the time.
    Clock,
    /// It changes something that explorations leave out: a file, the state of a stream that was made
    /// elsewhere, or of the running task.
    Own,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct BuiltinInfo {
    /// The builtin.
    pub builtin: Builtin,
    /// Package and visibility of its name.
    pub visibility: Visibility,
    /// Name of the function.
    pub name: &'static str,
    /// Lambda list as shown to people, without parentheses.
    pub lambda_list: &'static str,
    /// The arguments that it takes.
    pub arity: Arity,
    /// The relation of its calls to other tasks.
    pub shares: Shares,
    /// Whether the compiler may take a call of it for a form with exactly one value.
    pub returns_one: bool,
    /// The type of its first value, if the row says that: no call ever has a value of another type.
    pub gives: Option<ValueType>,
    /// The type that it tests its only argument for: it is true of the values of this type, and of no others.
    pub tests: Option<ValueType>,
    /// The ESL function, internal to the package `ESL`, that takes over when the work is above a builtin's
    /// limit.
    pub slowly: Option<&'static str>,
    /// Documentation: one sentence or more.
    pub doc: &'static [&'static str],
}

impl BuiltinInfo {
    /// Name of the home package.
    pub fn package(&self) -> &'static str {
        match self.visibility {
            Visibility::Cl => CL_PACKAGE,
            Visibility::Esl | Visibility::Internal => ESL_PACKAGE,
        }
    }
}

/// Counts the parameters of a lambda list at compile time.
const fn arity_of(lambda_list: &str) -> Arity {
    let bytes = lambda_list.as_bytes();
    let mut at = 0;
    let mut min = 0;
    let mut optional = 0;
    // 0: required, 1: after &optional, 2: after &rest.
    let mut state = 0;
    while at < bytes.len() {
        let start = at;
        while at < bytes.len() && bytes[at] != b' ' {
            at += 1;
        }
        if at > start {
            if bytes[start] == b'&' {
                state = if bytes[start + 1] == b'o' { 1 } else { 2 };
            } else if state == 0 {
                min += 1;
            } else if state == 1 {
                optional += 1;
            }
        }
        at += 1;
    }
    Arity { min, max: if state == 2 { None } else { Some(min + optional) } }
}

macro_rules! visibility {
    (cl) => {
        Visibility::Cl
    };
    (esl) => {
        Visibility::Esl
    };
    (internal) => {
        Visibility::Internal
    };
}

macro_rules! shares {
    (nothing) => {
        Shares::Nothing
    };
    (points) => {
        Shares::Points
    };
    (pairs) => {
        Shares::Pairs
    };
    (elements) => {
        Shares::Elements
    };
    (slots) => {
        Shares::Slots
    };
    (tables) => {
        Shares::Tables
    };
    (properties) => {
        Shares::Properties
    };
    (variables) => {
        Shares::Variables
    };
    (streams) => {
        Shares::Streams
    };
    (definitions) => {
        Shares::Definitions
    };
    (clock) => {
        Shares::Clock
    };
    (own) => {
        Shares::Own
    };
}

macro_rules! slowly {
    () => {
        None
    };
    ($name:literal) => {
        Some($name)
    };
}

macro_rules! returns_one {
    () => {
        false
    };
    (one) => {
        true
    };
}

/// The type that a word of the table stands for; of two words, either.
macro_rules! value_type {
    () => {
        None
    };
    ($word:ident) => {
        Some(value_type!(@ $word))
    };
    ($word:ident $or:ident) => {
        Some(value_type!(@ $word).or(value_type!(@ $or)))
    };
    (@ nil) => {
        ValueType::NIL
    };
    (@ boolean) => {
        ValueType::SYMBOL
    };
    (@ symbol) => {
        ValueType::SYMBOL
    };
    (@ integer) => {
        ValueType::INTEGER
    };
    (@ rational) => {
        ValueType::RATIONAL
    };
    (@ float) => {
        ValueType::FLOAT
    };
    (@ real) => {
        ValueType::REAL
    };
    (@ complex) => {
        ValueType::COMPLEX
    };
    (@ number) => {
        ValueType::NUMBER
    };
    (@ character) => {
        ValueType::CHARACTER
    };
    (@ string) => {
        ValueType::STRING
    };
    (@ pair) => {
        ValueType::PAIR
    };
    (@ atom) => {
        ValueType::ANY.without(ValueType::PAIR)
    };
    (@ list) => {
        ValueType::LIST
    };
    (@ vector) => {
        ValueType::OTHER_ARRAY
    };
    (@ array) => {
        ValueType::ARRAY
    };
    (@ sequence) => {
        ValueType::SEQUENCE
    };
    (@ table) => {
        ValueType::TABLE
    };
    (@ stream) => {
        ValueType::STREAM
    };
}

macro_rules! define_builtins {
    ($( $(#[doc = $doc:literal])* $id:ident = $native:path, $visibility:ident $name:literal
        ($lambda_list:literal) shares $shares:ident $(-> $results:ident)?
        $(gives $gives:ident $(or $or:ident)?)? $(tests $tests:ident)? $(slowly $slowly:literal)?; )*) => {
        /// A function that is written in Rust.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum Builtin {
            $( $(#[doc = $doc])* $id, )*
        }

        /// The table as data; a builtin's number is its position.
        pub const BUILTINS: &[BuiltinInfo] = &[
            $( BuiltinInfo {
                builtin: Builtin::$id,
                visibility: visibility!($visibility),
                name: $name,
                lambda_list: $lambda_list,
                arity: arity_of($lambda_list),
                shares: shares!($shares),
                returns_one: returns_one!($($results)?),
                gives: value_type!($($gives $($or)?)?),
                tests: value_type!($($tests)?),
                slowly: slowly!($($slowly)?),
                doc: &[$( $doc ),*],
            }, )*
        ];
    };
}

impl Builtin {
    /// Returns the builtin with this number, unless there is none.
    pub fn from_number(number: u32) -> Option<Builtin> {
        BUILTINS.get(number as usize).map(|info| info.builtin)
    }

    /// Its number.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// Its row.
    pub const fn info(self) -> &'static BuiltinInfo {
        &BUILTINS[self as usize]
    }

    /// Returns the symbol that names the builtin.
    pub fn symbol(self) -> Symbol {
        let info = self.info();
        Symbol::new(&info.package().into(), info.name)
    }

    /// Returns the builtin that `symbol` names.
    pub fn named(symbol: &Symbol) -> Option<Builtin> {
        static BY_NAME: LazyLock<FxHashMap<Symbol, Builtin>> =
            LazyLock::new(|| BUILTINS.iter().map(|info| (info.builtin.symbol(), info.builtin)).collect());
        BY_NAME.get(symbol).copied()
    }
}

/// Calls `$with!` with every row of the table.
#[macro_export]
macro_rules! for_each_builtin {
    ($with:ident) => {
        $with! {
            // ---- definitions
            /// Makes `function` the global function named by `symbol`, and returns `symbol`.
            SetFunction = define::set_function, internal "%SET-FUNCTION" ("symbol function")
                shares definitions;
            /// Makes `function` the macro function of `symbol`, and returns `symbol`.
            SetMacro = define::set_macro, internal "%SET-MACRO" ("symbol function") shares definitions;
            /// Makes `symbol` a special variable, and returns it.
            ProclaimSpecial = define::proclaim_special, internal "%PROCLAIM-SPECIAL" ("symbol")
                shares definitions;
            /// Makes `symbol`, which does not belong to the language, neither a special variable nor a
            /// constant any more, and returns it.
            ForgetVariable = define::forget_variable, internal "%FORGET-VARIABLE" ("symbol")
                shares definitions;
            /// Makes `symbol` a constant with `value`, and returns it. Fails if it is a constant with another
            /// value.
            DefineConstant = define::define_constant, internal "%DEFINE-CONSTANT" ("symbol value")
                shares definitions;

            // ---- functions and values
            /// Calls `function`, or the function that a symbol names, with `arguments`.
            Funcall = call::funcall, cl "FUNCALL" ("function &rest arguments") shares nothing;
            /// Calls `function` with `arguments`, the last of which is a list of further arguments.
            Apply = call::apply, cl "APPLY" ("function argument &rest arguments") shares nothing;
            /// The arguments, as multiple values.
            Values = call::values, cl "VALUES" ("&rest values") shares nothing;
            /// The items of `list`, as multiple values.
            ValuesList = call::values_list, cl "VALUES-LIST" ("list") shares nothing;
            /// The argument.
            Identity = call::identity, cl "IDENTITY" ("object") shares nothing -> one;

            // ---- identity and types
            /// Whether both are the same object.
            Eq = equality::eq, cl "EQ" ("left right") shares nothing -> one gives boolean;
            /// Whether both are the same object, or equal numbers of one type, or equal characters.
            Eql = equality::eql, cl "EQL" ("left right") shares nothing -> one gives boolean;
            /// Whether `object` is `NIL`.
            Not = types::null, cl "NOT" ("object") shares nothing -> one gives boolean tests nil;
            /// Whether `object` is `NIL`.
            Null = types::null, cl "NULL" ("object") shares nothing -> one gives boolean tests nil;
            /// Whether `object` is a pair.
            Consp = types::consp, cl "CONSP" ("object") shares nothing -> one gives boolean tests pair;
            /// Whether `object` is anything but a pair.
            Atom = types::atom, cl "ATOM" ("object") shares nothing -> one gives boolean tests atom;
            /// Whether `object` is a pair or `NIL`.
            Listp = types::listp, cl "LISTP" ("object") shares nothing -> one gives boolean tests list;
            /// Whether `object` is a symbol.
            Symbolp = types::symbolp, cl "SYMBOLP" ("object")
                shares nothing -> one gives boolean tests symbol;
            /// Whether `object` is a keyword.
            Keywordp = types::keywordp, cl "KEYWORDP" ("object") shares nothing -> one gives boolean;
            /// Whether `object` is a number.
            Numberp = types::numberp, cl "NUMBERP" ("object")
                shares nothing -> one gives boolean tests number;
            /// Whether `object` is an integer, a ratio or a float.
            Realp = types::realp, cl "REALP" ("object") shares nothing -> one gives boolean tests real;
            /// Whether `object` is a complex number.
            Complexp = number::complexp, cl "COMPLEXP" ("object") shares nothing gives boolean tests complex;
            /// Whether `object` is an integer or a ratio.
            Rationalp = types::rationalp, cl "RATIONALP" ("object")
                shares nothing -> one gives boolean tests rational;
            /// Whether `object` is an integer.
            Integerp = types::integerp, cl "INTEGERP" ("object")
                shares nothing -> one gives boolean tests integer;
            /// Whether `object` is a float.
            Floatp = types::floatp, cl "FLOATP" ("object") shares nothing -> one gives boolean tests float;
            /// Whether `object` is a character.
            Characterp = types::characterp, cl "CHARACTERP" ("object")
                shares nothing -> one gives boolean tests character;
            /// Whether `object` is a string.
            Stringp = types::stringp, cl "STRINGP" ("object")
                shares nothing -> one gives boolean tests string;
            /// Whether `object` is an array of rank 1.
            Vectorp = types::vectorp, cl "VECTORP" ("object") shares nothing -> one gives boolean;
            /// Whether `object` is a simple general vector.
            SimpleVectorp = types::simple_vector_p, cl "SIMPLE-VECTOR-P" ("object")
                shares nothing -> one gives boolean;
            /// Whether `object` is an array.
            Arrayp = types::arrayp, cl "ARRAYP" ("object") shares nothing -> one gives boolean tests array;
            /// Whether `object` is a function.
            Functionp = types::functionp, cl "FUNCTIONP" ("object") shares nothing -> one gives boolean;
            /// Whether `object` is a hash table.
            HashTablep = types::hash_table_p, cl "HASH-TABLE-P" ("object")
                shares nothing -> one gives boolean tests table;
            /// Whether both are equal numbers or characters, strings of the same characters, or pairs of
            /// equal parts.
            Equal = equality::equal, cl "EQUAL" ("left right")
                shares nothing gives boolean slowly "%SLOW-EQUAL";
            /// Whether both look alike: as `equal`, but case and the type of numbers do not matter, and
            /// arrays, structures and hash tables are compared by their parts.
            Equalp = equality::equalp, cl "EQUALP" ("left right")
                shares nothing gives boolean slowly "%SLOW-EQUALP";
            /// A number that `equal` objects share.
            Sxhash = equality::sxhash, cl "SXHASH" ("object") shares nothing gives integer;
            /// Whether `object` is a string without a fill pointer.
            SimpleStringp = types::simple_string_p, cl "SIMPLE-STRING-P" ("object")
                shares nothing gives boolean;

            // ---- numbers
            /// The sum; 0 of no numbers.
            Add = number::add, cl "+" ("&rest numbers") shares nothing -> one gives number slowly "%SLOW-+";
            /// The first number less the others; the negative of a single one.
            Subtract = number::subtract, cl "-" ("number &rest numbers")
                shares nothing -> one gives number slowly "%SLOW--";
            /// The product; 1 of no numbers.
            Multiply = number::multiply, cl "*" ("&rest numbers")
                shares nothing -> one gives number slowly "%SLOW-*";
            /// The first number divided by the others; the reciprocal of a single one. Exact for integers and
            /// ratios. Fails with `:division-by-zero`.
            Divide = number::divide, cl "/" ("number &rest numbers")
                shares nothing -> one gives number slowly "%SLOW-/";
            /// `number` plus one.
            Increment = number::increment, cl "1+" ("number")
                shares nothing -> one gives number slowly "%SLOW-1+";
            /// `number` less one.
            Decrement = number::decrement, cl "1-" ("number")
                shares nothing -> one gives number slowly "%SLOW-1-";
            /// Quotient rounded towards minus infinity, and remainder. Fails with `:division-by-zero`.
            Floor = number::floor, cl "FLOOR" ("number &optional divisor")
                shares nothing gives integer slowly "%SLOW-FLOOR";
            /// Quotient rounded towards plus infinity, and remainder. Fails with `:division-by-zero`.
            Ceiling = number::ceiling, cl "CEILING" ("number &optional divisor")
                shares nothing gives integer slowly "%SLOW-CEILING";
            /// Quotient rounded towards zero, and remainder. Fails with `:division-by-zero`.
            Truncate = number::truncate, cl "TRUNCATE" ("number &optional divisor")
                shares nothing gives integer slowly "%SLOW-TRUNCATE";
            /// Quotient rounded to the nearest integer, halves to the even one, and remainder. Fails with
            /// `:division-by-zero`.
            Round = number::round, cl "ROUND" ("number &optional divisor")
                shares nothing gives integer slowly "%SLOW-ROUND";
            /// The remainder of `floor`.
            Mod = number::modulo, cl "MOD" ("number divisor")
                shares nothing -> one gives number slowly "%SLOW-MOD";
            /// The remainder of `truncate`.
            Rem = number::remainder, cl "REM" ("number divisor")
                shares nothing -> one gives number slowly "%SLOW-REM";
            /// Bitwise "and" of the integers; -1 of none.
            LogAnd = integer::logand, cl "LOGAND" ("&rest integers")
                shares nothing -> one gives integer slowly "%SLOW-LOGAND";
            /// Bitwise "or" of the integers; 0 of none.
            LogIor = integer::logior, cl "LOGIOR" ("&rest integers")
                shares nothing -> one gives integer slowly "%SLOW-LOGIOR";
            /// Bitwise "exclusive or" of the integers; 0 of none.
            LogXor = integer::logxor, cl "LOGXOR" ("&rest integers")
                shares nothing -> one gives integer slowly "%SLOW-LOGXOR";
            /// `integer` shifted left by `count` bits, right if that is negative.
            Ash = integer::ash, cl "ASH" ("integer count") shares nothing -> one gives integer;
            /// Whether all numbers are equal.
            NumEqual = number::num_equal, cl "=" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW-=";
            /// Whether no two numbers are equal.
            NumNotEqual = number::num_not_equal, cl "/=" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW-/=";
            /// Whether the numbers increase.
            Less = number::less, cl "<" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW-<";
            /// Whether the numbers never decrease.
            LessEqual = number::less_equal, cl "<=" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW-<=";
            /// Whether the numbers decrease.
            Greater = number::greater, cl ">" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW->";
            /// Whether the numbers never increase.
            GreaterEqual = number::greater_equal, cl ">=" ("number &rest numbers")
                shares nothing -> one gives boolean slowly "%SLOW->=";
            /// Whether `number` is zero.
            Zerop = number::zerop, cl "ZEROP" ("number") shares nothing -> one gives boolean;
            /// Whether `number` is above zero.
            Plusp = number::plusp, cl "PLUSP" ("number") shares nothing -> one gives boolean;
            /// Whether `number` is below zero.
            Minusp = number::minusp, cl "MINUSP" ("number") shares nothing -> one gives boolean;
            /// The greatest of the numbers.
            Max = number::max, cl "MAX" ("number &rest numbers")
                shares nothing gives number slowly "%SLOW-MAX";
            /// The least of the numbers.
            Min = number::min, cl "MIN" ("number &rest numbers")
                shares nothing gives number slowly "%SLOW-MIN";
            /// The number without its sign.
            Abs = number::abs, cl "ABS" ("number") shares nothing gives number slowly "%SLOW-ABS";
            /// -1, 0 or 1, as `number` is below, at or above zero, as a number of its type.
            Signum = number::signum, cl "SIGNUM" ("number") shares nothing gives number slowly "%SLOW-SIGNUM";
            /// The complex number with these parts, which are two rationals or two floats.
            MakeComplex = number::make_complex, internal "%MAKE-COMPLEX" ("real-part imaginary-part")
                shares nothing;
            /// The real part of a number.
            Realpart = number::real_part, cl "REALPART" ("number") shares nothing gives number;
            /// The imaginary part of a number.
            Imagpart = number::imaginary_part, cl "IMAGPART" ("number") shares nothing gives number;
            /// As `floor`, with the quotient as a float.
            FFloor = number::ffloor, cl "FFLOOR" ("number &optional divisor")
                shares nothing gives number slowly "%SLOW-FFLOOR";
            /// As `ceiling`, with the quotient as a float.
            FCeiling = number::fceiling, cl "FCEILING" ("number &optional divisor")
                shares nothing gives number slowly "%SLOW-FCEILING";
            /// As `truncate`, with the quotient as a float.
            FTruncate = number::ftruncate, cl "FTRUNCATE" ("number &optional divisor")
                shares nothing gives number slowly "%SLOW-FTRUNCATE";
            /// As `round`, with the quotient as a float.
            FRound = number::fround, cl "FROUND" ("number &optional divisor")
                shares nothing gives number slowly "%SLOW-FROUND";
            /// `base` to the power of `power`: exact for rationals and integer powers.
            Expt = float::expt, cl "EXPT" ("base power") shares nothing gives number slowly "%SLOW-EXPT";
            /// The square root, a float; that of a negative number is complex.
            Sqrt = float::sqrt, cl "SQRT" ("number") shares nothing gives number slowly "%SLOW-SQRT";
            /// e to the power of `number`.
            Exp = float::exp, cl "EXP" ("number") shares nothing gives number slowly "%SLOW-EXP";
            /// The logarithm, natural unless a base is given; that of a negative number is complex.
            Log = float::log, cl "LOG" ("number &optional base")
                shares nothing gives number slowly "%SLOW-LOG";
            /// The sine.
            Sin = float::sin, cl "SIN" ("radians") shares nothing gives number slowly "%SLOW-SIN";
            /// The cosine.
            Cos = float::cos, cl "COS" ("radians") shares nothing gives number slowly "%SLOW-COS";
            /// The tangent.
            Tan = float::tan, cl "TAN" ("radians") shares nothing gives number slowly "%SLOW-TAN";
            /// The angle with this sine.
            Asin = float::asin, cl "ASIN" ("number") shares nothing gives number slowly "%SLOW-ASIN";
            /// The angle with this cosine.
            Acos = float::acos, cl "ACOS" ("number") shares nothing gives number slowly "%SLOW-ACOS";
            /// The angle with this tangent; of two arguments, the angle of the point with `number` above and
            /// `divisor` to the right.
            Atan = float::atan, cl "ATAN" ("number &optional divisor")
                shares nothing gives number slowly "%SLOW-ATAN";
            /// The hyperbolic sine.
            Sinh = float::sinh, cl "SINH" ("number") shares nothing gives number slowly "%SLOW-SINH";
            /// The hyperbolic cosine.
            Cosh = float::cosh, cl "COSH" ("number") shares nothing gives number slowly "%SLOW-COSH";
            /// The hyperbolic tangent.
            Tanh = float::tanh, cl "TANH" ("number") shares nothing gives number slowly "%SLOW-TANH";
            /// The number with this hyperbolic sine.
            Asinh = float::asinh, cl "ASINH" ("number") shares nothing gives number slowly "%SLOW-ASINH";
            /// The number with this hyperbolic cosine.
            Acosh = float::acosh, cl "ACOSH" ("number") shares nothing gives number slowly "%SLOW-ACOSH";
            /// The number with this hyperbolic tangent.
            Atanh = float::atanh, cl "ATANH" ("number") shares nothing gives number slowly "%SLOW-ATANH";
            /// The numerator, in lowest terms.
            Numerator = float::numerator, cl "NUMERATOR" ("rational") shares nothing gives integer;
            /// The denominator, in lowest terms; 1 for an integer.
            Denominator = float::denominator, cl "DENOMINATOR" ("rational") shares nothing gives integer;
            /// The ratio of two integers that have no divisor in common; the second is above 1.
            MakeRatio = float::make_ratio, internal "%MAKE-RATIO" ("numerator denominator") shares nothing;
            /// The rational of exactly this value.
            Rational = float::rational, cl "RATIONAL" ("number") shares nothing gives rational;
            /// The simplest rational that reads as this float.
            Rationalize = float::rationalize, cl "RATIONALIZE" ("number") shares nothing gives rational;
            /// The nearest float.
            Float = float::to_float, cl "FLOAT" ("number &optional prototype") shares nothing gives float;
            /// Fraction from 0.5 to below 1, exponent, and sign as a float.
            DecodeFloat = float::decode_float, cl "DECODE-FLOAT" ("float") shares nothing gives float;
            /// Mantissa, exponent and sign as integers.
            IntegerDecodeFloat = float::integer_decode_float, cl "INTEGER-DECODE-FLOAT" ("float")
                shares nothing gives integer;
            /// `float` times two to the power of `exponent`.
            ScaleFloat = float::scale_float, cl "SCALE-FLOAT" ("float exponent") shares nothing gives float;
            /// `magnitude`, which is 1.0 unless given, with the sign of `float`.
            FloatSign = float::float_sign, cl "FLOAT-SIGN" ("float &optional magnitude")
                shares nothing gives float;
            /// Number of binary digits of the type of `float`.
            FloatDigits = float::float_digits, cl "FLOAT-DIGITS" ("float") shares nothing gives integer;
            /// Base of the representation of floats.
            FloatRadix = float::float_radix, cl "FLOAT-RADIX" ("float") shares nothing gives integer;
            /// Number of significant binary digits of `float`.
            FloatPrecision = float::float_precision, cl "FLOAT-PRECISION" ("float")
                shares nothing gives integer;
            /// The float as `prin1` writes it.
            FloatString = float::float_string, internal "%FLOAT-STRING" ("float") shares nothing;
            /// Where the point goes and the decimal digits of a float without its sign: the value is 0.digits
            /// times ten to the first value. Without `position` the shortest digits that read back; else
            /// those down to ten to the power of `position`.
            DecimalDigits = float::decimal_digits, internal "%FLOAT-DIGITS" ("float &optional position")
                shares nothing;
            /// A random state: from the seed of the run for `NIL`, from an integer as the seed, or a copy.
            MakeRandomState = float::make_random_state, internal "%MAKE-RANDOM-STATE" ("source")
                shares nothing;
            /// A number from 0 to below `limit`, of its type; moves `state` on.
            Random = float::random, internal "%RANDOM" ("limit state") shares variables;
            /// Whether `object` is a random state.
            RandomStatep = types::random_state_p, cl "RANDOM-STATE-P" ("object") shares nothing gives boolean;

            // ---- integers
            /// Whether `integer` is even.
            Evenp = integer::evenp, cl "EVENP" ("integer") shares nothing gives boolean;
            /// Whether `integer` is odd.
            Oddp = integer::oddp, cl "ODDP" ("integer") shares nothing gives boolean;
            /// The greatest common divisor; 0 of none.
            Gcd = integer::gcd, cl "GCD" ("&rest integers") shares nothing gives integer slowly "%SLOW-GCD";
            /// Two smaller integers with the same greatest common divisor as `left` and `right`; the second
            /// is 0 when the first is the divisor.
            GcdStep = integer::gcd_step, internal "%GCD-STEP" ("left right")
                shares nothing slowly "%SLOW-GCD-STEP";
            /// The least common multiple; 1 of none.
            Lcm = integer::lcm, cl "LCM" ("&rest integers") shares nothing gives integer slowly "%SLOW-LCM";
            /// The greatest integer whose square is not above `integer`.
            Isqrt = integer::isqrt, cl "ISQRT" ("integer") shares nothing gives integer slowly "%SLOW-ISQRT";
            /// Bitwise equivalence of the integers; -1 of none.
            LogEqv = integer::logeqv, cl "LOGEQV" ("&rest integers")
                shares nothing gives integer slowly "%SLOW-LOGEQV";
            /// The integer with all bits inverted.
            LogNot = integer::lognot, cl "LOGNOT" ("integer") shares nothing gives integer;
            /// Bits of `right` that are not in `left`.
            LogAndC1 = integer::logandc1, cl "LOGANDC1" ("left right") shares nothing gives integer;
            /// Bits of `left` that are not in `right`.
            LogAndC2 = integer::logandc2, cl "LOGANDC2" ("left right") shares nothing gives integer;
            /// Bits that are not in both.
            LogNand = integer::lognand, cl "LOGNAND" ("left right") shares nothing gives integer;
            /// Bits that are in neither.
            LogNor = integer::lognor, cl "LOGNOR" ("left right") shares nothing gives integer;
            /// Bits of `right` and those that are not in `left`.
            LogOrC1 = integer::logorc1, cl "LOGORC1" ("left right") shares nothing gives integer;
            /// Bits of `left` and those that are not in `right`.
            LogOrC2 = integer::logorc2, cl "LOGORC2" ("left right") shares nothing gives integer;
            /// Whether the numbers have a bit in common.
            LogTest = integer::logtest, cl "LOGTEST" ("left right") shares nothing gives boolean;
            /// Whether bit `index` is set.
            LogBitp = integer::logbitp, cl "LOGBITP" ("index integer") shares nothing gives boolean;
            /// Number of ones; of zeros in a negative integer.
            LogCount = integer::logcount, cl "LOGCOUNT" ("integer") shares nothing gives integer;
            /// Bits that the integer takes in two's complement, the sign not counted.
            IntegerLength = integer::integer_length, cl "INTEGER-LENGTH" ("integer")
                shares nothing gives integer;
            /// The field of `size` bits from `position` up.
            LoadByte = integer::load_byte, internal "%LDB" ("size position integer") shares nothing;
            /// `integer` with the field of `size` bits from `position` up taken from `new`.
            DepositByte = integer::deposit_byte, internal "%DPB" ("new size position integer") shares nothing;
            /// The digits of `integer` in `radix`, with its sign.
            IntegerString = integer::integer_string, internal "%INTEGER-STRING" ("integer radix")
                shares nothing
                slowly "%SLOW-INTEGER-STRING";
            /// The integer that part of a string is, and where reading stopped.
            ParseInteger = integer::parse_integer, internal "%PARSE-INTEGER"
                ("string start end radix junk-allowed") shares nothing slowly "%SLOW-PARSE-INTEGER";

            // ---- characters
            /// The code of a character.
            CharCode = character::char_code, cl "CHAR-CODE" ("character") shares nothing gives integer;
            /// The code of a character.
            CharInt = character::char_code, cl "CHAR-INT" ("character") shares nothing gives integer;
            /// The character with this code; `NIL` for a surrogate, which is none.
            CodeChar = character::code_char, cl "CODE-CHAR" ("code") shares nothing gives character or nil;
            /// The character that a character, or a string or symbol of one, stands for.
            ToCharacter = character::to_character, cl "CHARACTER" ("designator")
                shares nothing gives character;
            /// The upper case of a letter; other characters as they are.
            CharUpcase = character::char_upcase, cl "CHAR-UPCASE" ("character")
                shares nothing gives character;
            /// The lower case of a letter; other characters as they are.
            CharDowncase = character::char_downcase, cl "CHAR-DOWNCASE" ("character")
                shares nothing gives character;
            /// Whether `character` is a letter in upper case.
            UpperCasep = character::upper_case_p, cl "UPPER-CASE-P" ("character")
                shares nothing gives boolean;
            /// Whether `character` is a letter in lower case.
            LowerCasep = character::lower_case_p, cl "LOWER-CASE-P" ("character")
                shares nothing gives boolean;
            /// Whether `character` is a letter with upper and lower case.
            BothCasep = character::both_case_p, cl "BOTH-CASE-P" ("character") shares nothing gives boolean;
            /// Whether `character` is a letter.
            AlphaCharp = character::alpha_char_p, cl "ALPHA-CHAR-P" ("character")
                shares nothing gives boolean;
            /// Whether `character` is a letter or a digit.
            Alphanumericp = character::alphanumericp, cl "ALPHANUMERICP" ("character")
                shares nothing gives boolean;
            /// Whether `character` prints as itself.
            GraphicCharp = character::graphic_char_p, cl "GRAPHIC-CHAR-P" ("character")
                shares nothing gives boolean;
            /// Whether `character` is one that every Common Lisp has.
            StandardCharp = character::standard_char_p, cl "STANDARD-CHAR-P" ("character")
                shares nothing gives boolean;
            /// The weight of a digit, `NIL` for any other character.
            DigitCharp = character::digit_char_p, cl "DIGIT-CHAR-P" ("character &optional radix")
                shares nothing gives integer or nil;
            /// The digit of this weight, `NIL` if there is none.
            DigitChar = character::digit_char, cl "DIGIT-CHAR" ("weight &optional radix")
                shares nothing gives character or nil;
            /// The name of a character, `NIL` if it has none.
            CharName = character::char_name, cl "CHAR-NAME" ("character") shares nothing gives string or nil;
            /// The character of this name, `NIL` if there is none.
            NameChar = character::name_char, cl "NAME-CHAR" ("name") shares nothing gives character or nil;
            /// Whether all characters are the same.
            CharEqualExactly = character::char_equal_exactly, cl "CHAR=" ("character &rest characters")
                shares nothing -> one gives boolean;
            /// Whether no two characters are the same.
            CharNotEqualExactly = character::char_not_equal_exactly,
                cl "CHAR/=" ("character &rest characters")
                shares nothing gives boolean;
            /// Whether the codes increase.
            CharLess = character::char_less, cl "CHAR<" ("character &rest characters")
                shares nothing gives boolean;
            /// Whether the codes decrease.
            CharGreater = character::char_greater, cl "CHAR>" ("character &rest characters")
                shares nothing gives boolean;
            /// Whether the codes never decrease.
            CharLessEqual = character::char_less_equal, cl "CHAR<=" ("character &rest characters")
                shares nothing gives boolean;
            /// Whether the codes never increase.
            CharGreaterEqual = character::char_greater_equal, cl "CHAR>=" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char=`, ignoring case.
            CharEqual = character::char_equal, cl "CHAR-EQUAL" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char/=`, ignoring case.
            CharNotEqual = character::char_not_equal, cl "CHAR-NOT-EQUAL" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char<`, ignoring case.
            CharLessp = character::char_lessp, cl "CHAR-LESSP" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char>`, ignoring case.
            CharGreaterp = character::char_greaterp, cl "CHAR-GREATERP" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char<=`, ignoring case.
            CharNotGreaterp = character::char_not_greaterp,
                cl "CHAR-NOT-GREATERP" ("character &rest characters")
                shares nothing gives boolean;
            /// As `char>=`, ignoring case.
            CharNotLessp = character::char_not_lessp, cl "CHAR-NOT-LESSP" ("character &rest characters")
                shares nothing gives boolean;

            // ---- strings
            /// The string that a string, symbol or character stands for.
            String = string::string, cl "STRING" ("designator") shares nothing gives string;
            /// Character `index` of a string.
            Char = string::char, cl "CHAR" ("string index") shares nothing -> one gives character;
            /// Character `index` of a string.
            Schar = string::char, cl "SCHAR" ("string index") shares nothing -> one gives character;
            /// Makes `character` character `index` of a string, and returns it.
            SetChar = string::set_char, internal "%SET-CHAR" ("string index character") shares elements;
            /// A fresh string of `size` times `character`.
            MakeString = string::make_string, internal "%MAKE-STRING" ("size character")
                shares nothing gives string slowly "%SLOW-MAKE-STRING";
            /// Whether two parts of strings are the same.
            StringEqualExactly = string::string_equal_exactly, internal "%STRING="
                ("left right &optional start1 end1 start2 end2") shares nothing slowly "%SLOW-STRING=";
            /// Whether two parts of strings are the same, ignoring case.
            StringEqualLoosely = string::string_equal_loosely, internal "%STRING-EQUAL"
                ("left right &optional start1 end1 start2 end2") shares nothing slowly "%SLOW-STRING-EQUAL";
            /// -1, 0 or 1, as the first of two parts of strings is before, the same as, or behind the other,
            /// and the index in the first where they begin to differ; with `fold`, ignoring case.
            StringCompare = string::string_compare, internal "%STRING-COMPARE"
                ("left right start1 end1 start2 end2 fold") shares nothing slowly "%SLOW-STRING-COMPARE";
            /// A fresh string, the part in upper case.
            StringUpcase = string::upcase, internal "%STRING-UPCASE" ("string start end") shares nothing
                slowly "%SLOW-STRING-UPCASE";
            /// A fresh string, the part in lower case.
            StringDowncase = string::downcase, internal "%STRING-DOWNCASE" ("string start end") shares nothing
                slowly "%SLOW-STRING-DOWNCASE";
            /// A fresh string, the words of the part capitalized.
            StringCapitalize = string::capitalize, internal "%STRING-CAPITALIZE" ("string start end")
                shares nothing
                slowly "%SLOW-STRING-CAPITALIZE";
            /// The string, the part changed to upper case.
            NStringUpcase = string::upcase_in_place, internal "%NSTRING-UPCASE" ("string start end")
                shares elements
                slowly "%SLOW-NSTRING-UPCASE";
            /// The string, the part changed to lower case.
            NStringDowncase = string::downcase_in_place, internal "%NSTRING-DOWNCASE" ("string start end")
                shares elements
                slowly "%SLOW-NSTRING-DOWNCASE";
            /// The string, the words of the part capitalized.
            NStringCapitalize = string::capitalize_in_place, internal "%NSTRING-CAPITALIZE"
                ("string start end") shares elements slowly "%SLOW-NSTRING-CAPITALIZE";
            /// The string without the characters of `bag` at both ends.
            StringTrim = string::trim, cl "STRING-TRIM" ("bag string")
                shares nothing gives string slowly "%SLOW-STRING-TRIM";
            /// The string without the characters of `bag` at its beginning.
            StringLeftTrim = string::left_trim, cl "STRING-LEFT-TRIM" ("bag string")
                shares nothing gives string slowly "%SLOW-STRING-LEFT-TRIM";
            /// The string without the characters of `bag` at its end.
            StringRightTrim = string::right_trim, cl "STRING-RIGHT-TRIM" ("bag string")
                shares nothing gives string slowly "%SLOW-STRING-RIGHT-TRIM";
            /// The strings joined.
            StringConcat = string::concat, internal "%STRING-CONCAT" ("&rest strings")
                shares nothing gives string slowly "%SLOW-STRING-CONCAT";
            /// Where the pattern first is in a part of a string, or last with `from-end`; `NIL` if nowhere.
            SearchString = string::search, internal "%SEARCH-STRING" ("pattern string start end from-end")
                shares nothing
                slowly "%SLOW-SEARCH-STRING";
            /// The string as `prin1` writes it.
            StringEscaped = print::string_escaped, internal "%STRING-ESCAPED" ("string") shares nothing
                slowly "%SLOW-STRING-ESCAPED";
            /// The character as `prin1` writes it.
            CharacterEscaped = print::character_escaped, internal "%CHARACTER-ESCAPED" ("character")
                shares nothing;
            /// The name of a symbol as it is written, without package: in upper case (`case` 0), lower case
            /// (1) or capitalized (2), between bars if `escape` and it would not read back.
            SymbolNameString = print::symbol_name_string, internal "%SYMBOL-NAME-STRING" ("name case escape")
                shares nothing
                slowly "%SLOW-SYMBOL-NAME-STRING";

            // ---- lists
            /// A fresh pair.
            Cons = list::cons, cl "CONS" ("car cdr") shares nothing -> one gives pair;
            /// The car of a pair, `NIL` of `NIL`.
            Car = list::car, cl "CAR" ("list") shares nothing -> one;
            /// The cdr of a pair, `NIL` of `NIL`.
            Cdr = list::cdr, cl "CDR" ("list") shares nothing -> one;
            /// The car of the cdr.
            Cadr = list::cadr, cl "CADR" ("list") shares nothing -> one;
            /// The cdr of the cdr.
            Cddr = list::cddr, cl "CDDR" ("list") shares nothing -> one;
            /// The first item of a list, `NIL` if there is none.
            First = list::car, cl "FIRST" ("list") shares nothing -> one;
            /// The list without its first item.
            Rest = list::cdr, cl "REST" ("list") shares nothing -> one;
            /// The second item of a list, `NIL` if there is none.
            Second = list::cadr, cl "SECOND" ("list") shares nothing -> one;
            /// Makes `object` the car of `pair`, and returns `pair`.
            Rplaca = list::rplaca, cl "RPLACA" ("pair object") shares pairs -> one gives pair;
            /// Makes `object` the cdr of `pair`, and returns `pair`.
            Rplacd = list::rplacd, cl "RPLACD" ("pair object") shares pairs -> one gives pair;
            /// Makes `value` the car of `pair`, and returns `value`.
            SetCar = list::set_car, internal "%SET-CAR" ("pair value") shares pairs -> one;
            /// Makes `value` the cdr of `pair`, and returns `value`.
            SetCdr = list::set_cdr, internal "%SET-CDR" ("pair value") shares pairs -> one;
            /// A fresh list of `objects`.
            List = list::list, cl "LIST" ("&rest objects") shares nothing -> one gives list;
            /// A list of the objects that ends in the last of them.
            ListStar = list::list_star, cl "LIST*" ("object &rest objects") shares nothing -> one;
            /// The lists joined: all but the last are copied.
            Append = list::append, cl "APPEND" ("&rest lists") shares nothing -> one slowly "%SLOW-APPEND";
            /// The car of the car.
            Caar = list::caar, cl "CAAR" ("list") shares nothing;
            /// The cdr of the car.
            Cdar = list::cdar, cl "CDAR" ("list") shares nothing;
            /// The car of the car of the car.
            Caaar = list::caaar, cl "CAAAR" ("list") shares nothing;
            /// The car of the car of the cdr.
            Caadr = list::caadr, cl "CAADR" ("list") shares nothing;
            /// The car of the cdr of the car.
            Cadar = list::cadar, cl "CADAR" ("list") shares nothing;
            /// The car of the cdr of the cdr.
            Caddr = list::caddr, cl "CADDR" ("list") shares nothing;
            /// The cdr of the car of the car.
            Cdaar = list::cdaar, cl "CDAAR" ("list") shares nothing;
            /// The cdr of the car of the cdr.
            Cdadr = list::cdadr, cl "CDADR" ("list") shares nothing;
            /// The cdr of the cdr of the car.
            Cddar = list::cddar, cl "CDDAR" ("list") shares nothing;
            /// The cdr of the cdr of the cdr.
            Cdddr = list::cdddr, cl "CDDDR" ("list") shares nothing;
            /// The car of the car of the car of the car.
            Caaaar = list::caaaar, cl "CAAAAR" ("list") shares nothing;
            /// The car of the car of the car of the cdr.
            Caaadr = list::caaadr, cl "CAAADR" ("list") shares nothing;
            /// The car of the car of the cdr of the car.
            Caadar = list::caadar, cl "CAADAR" ("list") shares nothing;
            /// The car of the car of the cdr of the cdr.
            Caaddr = list::caaddr, cl "CAADDR" ("list") shares nothing;
            /// The car of the cdr of the car of the car.
            Cadaar = list::cadaar, cl "CADAAR" ("list") shares nothing;
            /// The car of the cdr of the car of the cdr.
            Cadadr = list::cadadr, cl "CADADR" ("list") shares nothing;
            /// The car of the cdr of the cdr of the car.
            Caddar = list::caddar, cl "CADDAR" ("list") shares nothing;
            /// The car of the cdr of the cdr of the cdr.
            Cadddr = list::cadddr, cl "CADDDR" ("list") shares nothing;
            /// The cdr of the car of the car of the car.
            Cdaaar = list::cdaaar, cl "CDAAAR" ("list") shares nothing;
            /// The cdr of the car of the car of the cdr.
            Cdaadr = list::cdaadr, cl "CDAADR" ("list") shares nothing;
            /// The cdr of the car of the cdr of the car.
            Cdadar = list::cdadar, cl "CDADAR" ("list") shares nothing;
            /// The cdr of the car of the cdr of the cdr.
            Cdaddr = list::cdaddr, cl "CDADDR" ("list") shares nothing;
            /// The cdr of the cdr of the car of the car.
            Cddaar = list::cddaar, cl "CDDAAR" ("list") shares nothing;
            /// The cdr of the cdr of the car of the cdr.
            Cddadr = list::cddadr, cl "CDDADR" ("list") shares nothing;
            /// The cdr of the cdr of the cdr of the car.
            Cdddar = list::cdddar, cl "CDDDAR" ("list") shares nothing;
            /// The cdr of the cdr of the cdr of the cdr.
            Cddddr = list::cddddr, cl "CDDDDR" ("list") shares nothing;
            /// The third item of a list, `NIL` if there is none.
            Third = list::caddr, cl "THIRD" ("list") shares nothing;
            /// The fourth item of a list, `NIL` if there is none.
            Fourth = list::cadddr, cl "FOURTH" ("list") shares nothing;
            /// The fifth item of a list, `NIL` if there is none.
            Fifth = list::fifth, cl "FIFTH" ("list") shares nothing;
            /// The sixth item of a list, `NIL` if there is none.
            Sixth = list::sixth, cl "SIXTH" ("list") shares nothing;
            /// The seventh item of a list, `NIL` if there is none.
            Seventh = list::seventh, cl "SEVENTH" ("list") shares nothing;
            /// The eighth item of a list, `NIL` if there is none.
            Eighth = list::eighth, cl "EIGHTH" ("list") shares nothing;
            /// The ninth item of a list, `NIL` if there is none.
            Ninth = list::ninth, cl "NINTH" ("list") shares nothing;
            /// The tenth item of a list, `NIL` if there is none.
            Tenth = list::tenth, cl "TENTH" ("list") shares nothing;
            /// Whether a list is empty; for anything but a list it fails.
            Endp = list::endp, cl "ENDP" ("list") shares nothing gives boolean tests nil;
            /// Item `index` of a list, `NIL` if there is none.
            Nth = list::nth, cl "NTH" ("index list") shares nothing slowly "%SLOW-NTH";
            /// The list `tail` without its first `count` items; of 0 items `tail` itself, of any type.
            Nthcdr = list::nthcdr, cl "NTHCDR" ("count tail") shares nothing slowly "%SLOW-NTHCDR";
            /// The last `count` pairs of a list, one unless said otherwise.
            Last = list::last, cl "LAST" ("list &optional count") shares nothing slowly "%SLOW-LAST";
            /// A copy of the list without its last `count` pairs, one unless said otherwise.
            Butlast = list::butlast, cl "BUTLAST" ("list &optional count")
                shares nothing gives list slowly "%SLOW-BUTLAST";
            /// The list, its last `count` pairs cut off.
            NButlast = list::nbutlast, cl "NBUTLAST" ("list &optional count")
                shares pairs gives list slowly "%SLOW-NBUTLAST";
            /// Number of items of a list, `NIL` if it is circular.
            ListLength = list::list_length, cl "LIST-LENGTH" ("list")
                shares nothing gives integer or nil slowly "%SLOW-LIST-LENGTH";
            /// A fresh list of `size` times `item`.
            MakeList = list::make_list, internal "%MAKE-LIST" ("size item")
                shares nothing slowly "%SLOW-MAKE-LIST";
            /// `alist` with a pair of `key` and `value` in front.
            Acons = list::acons, cl "ACONS" ("key value alist") shares nothing gives pair;
            /// The lists joined: the end of each is changed to the next.
            NConc = list::nconc, cl "NCONC" ("&rest lists") shares pairs slowly "%SLOW-NCONC";
            /// The items of `list` in reverse order, in front of `tail`.
            RevAppend = list::revappend, cl "REVAPPEND" ("list tail") shares nothing slowly "%SLOW-REVAPPEND";
            /// As `revappend`, from the pairs of `list`.
            NReconc = list::nreconc, cl "NRECONC" ("list tail") shares pairs slowly "%SLOW-NRECONC";
            /// A fresh list of the same items.
            CopyList = list::copy_list, cl "COPY-LIST" ("list")
                shares nothing gives list slowly "%SLOW-COPY-LIST";
            /// A fresh list with fresh pairs for those that are its items.
            CopyAlist = list::copy_alist, cl "COPY-ALIST" ("alist")
                shares nothing gives list slowly "%SLOW-COPY-ALIST";
            /// A fresh tree of pairs with the same leaves.
            CopyTree = list::copy_tree, cl "COPY-TREE" ("tree") shares nothing slowly "%SLOW-COPY-TREE";
            /// A fresh list of the items in front of the tail that is `object`.
            Ldiff = list::ldiff, cl "LDIFF" ("list object") shares nothing gives list slowly "%SLOW-LDIFF";
            /// Whether `object` is a tail of `list`.
            Tailp = list::tailp, cl "TAILP" ("object list") shares nothing gives boolean slowly "%SLOW-TAILP";
            /// `alist` with a pair for each key and datum in front.
            Pairlis = list::pairlis, cl "PAIRLIS" ("keys data &optional alist")
                shares nothing slowly "%SLOW-PAIRLIS";
            /// The tail of `list` that begins with an item `eq` to `item`, or `NIL`.
            MemberEq = lookup::member_eq, internal "%MEMBER-EQ" ("item list")
                shares nothing slowly "%SLOW-MEMBER-EQ";
            /// The tail of `list` that begins with an item `eql` to `item`, or `NIL`.
            MemberEql = lookup::member_eql, internal "%MEMBER-EQL" ("item list")
                shares nothing slowly "%SLOW-MEMBER-EQL";
            /// The tail of `list` that begins with an item `equal` to `item`, or `NIL`.
            MemberEqual = lookup::member_equal, internal "%MEMBER-EQUAL" ("item list") shares nothing
                slowly "%SLOW-MEMBER-EQUAL";
            /// The first pair of `alist` whose key is `eq` to `item`, or `NIL`.
            AssocEq = lookup::assoc_eq, internal "%ASSOC-EQ" ("item alist")
                shares nothing slowly "%SLOW-ASSOC-EQ";
            /// The first pair of `alist` whose key is `eql` to `item`, or `NIL`.
            AssocEql = lookup::assoc_eql, internal "%ASSOC-EQL" ("item alist")
                shares nothing slowly "%SLOW-ASSOC-EQL";
            /// The first pair of `alist` whose key is `equal` to `item`, or `NIL`.
            AssocEqual = lookup::assoc_equal, internal "%ASSOC-EQUAL" ("item alist") shares nothing
                slowly "%SLOW-ASSOC-EQUAL";
            /// The first pair of `alist` whose value is `eq` to `item`, or `NIL`.
            RassocEq = lookup::rassoc_eq, internal "%RASSOC-EQ" ("item alist")
                shares nothing slowly "%SLOW-RASSOC-EQ";
            /// The first pair of `alist` whose value is `eql` to `item`, or `NIL`.
            RassocEql = lookup::rassoc_eql, internal "%RASSOC-EQL" ("item alist")
                shares nothing slowly "%SLOW-RASSOC-EQL";
            /// The first pair of `alist` whose value is `equal` to `item`, or `NIL`.
            RassocEqual = lookup::rassoc_equal, internal "%RASSOC-EQUAL" ("item alist") shares nothing
                slowly "%SLOW-RASSOC-EQUAL";
            /// `list` with `item` in front, unless it has it.
            AdjoinEql = lookup::adjoin_eql, internal "%ADJOIN-EQL" ("item list")
                shares nothing slowly "%SLOW-ADJOIN-EQL";
            /// The value of a property of a property list, `default` if there is none.
            Getf = lookup::getf, cl "GETF" ("plist indicator &optional default")
                shares nothing slowly "%SLOW-GETF";
            /// The property list with this property: changed if it is there, else with it in front.
            Putf = lookup::putf, internal "%PUTF" ("plist indicator value")
                shares pairs slowly "%SLOW-PUTF";
            /// The property list without this property, and whether it was there.
            Remf = lookup::remf, internal "%REMF" ("plist indicator") shares pairs slowly "%SLOW-REMF";
            /// Indicator and value of the first property that is among `indicators`, and the tail that begins
            /// there; three times `NIL` if there is none.
            GetProperties = lookup::get_properties, cl "GET-PROPERTIES" ("plist indicators") shares nothing
                slowly "%SLOW-GET-PROPERTIES";

            // ---- sequences
            /// Number of elements.
            Length = sequence::length, cl "LENGTH" ("sequence")
                shares nothing gives integer slowly "%SLOW-LENGTH";
            /// Element `index` of a list or vector. Fails with `:type-error` if there is none.
            Elt = sequence::elt, cl "ELT" ("sequence index") shares nothing slowly "%SLOW-ELT";
            /// Makes `value` element `index` of a list or vector, and returns `value`.
            SetElt = sequence::set_elt, internal "%SET-ELT" ("sequence index value")
                shares elements slowly "%SLOW-SET-ELT";
            /// A fresh sequence of the elements from `start` to before `end`.
            Subseq = sequence::subseq, cl "SUBSEQ" ("sequence start &optional end")
                shares nothing gives sequence slowly "%SLOW-SUBSEQ";
            /// A fresh sequence of the same elements.
            CopySeq = sequence::copy_seq, cl "COPY-SEQ" ("sequence")
                shares nothing gives sequence slowly "%SLOW-COPY-SEQ";
            /// A fresh sequence of the elements in reverse order.
            Reverse = sequence::reverse, cl "REVERSE" ("sequence")
                shares nothing gives sequence slowly "%SLOW-REVERSE";
            /// The sequence, reversed in place.
            NReverse = sequence::nreverse, cl "NREVERSE" ("sequence")
                shares pairs gives sequence slowly "%SLOW-NREVERSE";
            /// Makes `item` every element of a part of a vector, and returns the vector.
            Fill = sequence::fill, internal "%FILL" ("vector item start end")
                shares elements slowly "%SLOW-FILL";
            /// Copies a part of the vector `source` over a part of the vector `target`, and returns that.
            Replace = sequence::replace, internal "%REPLACE" ("target source start1 end1 start2 end2")
                shares elements
                slowly "%SLOW-REPLACE";
            /// A fresh simple vector of the items of a list.
            ListVector = sequence::list_vector, internal "%LIST-VECTOR" ("list")
                shares nothing gives vector slowly "%SLOW-LIST-VECTOR";
            /// A fresh string of the characters in a list.
            ListString = sequence::list_string, internal "%LIST-STRING" ("list")
                shares nothing gives string slowly "%SLOW-LIST-STRING";
            /// A fresh list of the elements of a part of a vector.
            VectorList = sequence::vector_list, internal "%VECTOR-LIST" ("vector start end") shares nothing
                slowly "%SLOW-VECTOR-LIST";
            /// Index of the first element, or the last with `from-end`, that is `eql` to `item`; `NIL` if
            /// there is none.
            PositionEql = search::position_eql, internal "%POSITION-EQL" ("item sequence start end from-end")
                shares nothing
                slowly "%SLOW-POSITION-EQL";
            /// Index of the first element, or the last with `from-end`, that is `equal` to `item`; `NIL` if
            /// there is none.
            PositionEqual = search::position_equal, internal "%POSITION-EQUAL"
                ("item sequence start end from-end") shares nothing slowly "%SLOW-POSITION-EQUAL";
            /// Number of elements that are `eql` to `item`.
            CountEql = search::count_eql, internal "%COUNT-EQL" ("item sequence start end") shares nothing
                slowly "%SLOW-COUNT-EQL";
            /// The list without the items that are `eql` to `item`.
            RemoveEql = search::remove_eql, internal "%REMOVE-EQL" ("item list")
                shares nothing slowly "%SLOW-REMOVE-EQL";

            // ---- arrays
            /// A fresh simple vector of `objects`.
            Vector = array::vector, cl "VECTOR" ("&rest objects") shares nothing -> one gives vector;
            /// Element `index` of a simple general vector.
            Svref = array::svref, cl "SVREF" ("vector index") shares nothing -> one;
            /// Makes `value` element `index` of a simple general vector, and returns `value`.
            SetSvref = array::set_svref, internal "%SET-SVREF" ("vector index value") shares elements -> one;
            /// The element of `array` that the subscripts select.
            Aref = array::aref, cl "AREF" ("array &rest subscripts") shares nothing -> one;
            /// Sets the element of `array` that the subscripts select to the last argument, and returns that.
            SetAref = array::set_aref, internal "%SET-AREF" ("array &rest subscripts-and-value")
                shares elements -> one;
            /// Element `index` of an array, counted row by row.
            RowMajorAref = array::row_major_aref, cl "ROW-MAJOR-AREF" ("array index") shares nothing;
            /// Makes `value` element `index` of an array, counted row by row, and returns `value`.
            SetRowMajorAref = array::set_row_major_aref, internal "%SET-ROW-MAJOR-AREF" ("array index value")
                shares elements;
            /// The index, counted row by row, of the element that the subscripts select.
            ArrayRowMajorIndex = array::array_row_major_index,
                cl "ARRAY-ROW-MAJOR-INDEX" ("array &rest subscripts")
                shares nothing gives integer;
            /// Whether the subscripts select an element.
            ArrayInBoundsp = array::array_in_bounds_p, cl "ARRAY-IN-BOUNDS-P" ("array &rest subscripts")
                shares nothing gives boolean;
            /// Number of elements, those behind a fill pointer too.
            ArrayTotalSize = array::array_total_size, cl "ARRAY-TOTAL-SIZE" ("array")
                shares nothing gives integer;
            /// Number of dimensions.
            ArrayRank = array::array_rank, cl "ARRAY-RANK" ("array") shares nothing gives integer;
            /// List of the dimensions.
            ArrayDimensions = array::array_dimensions, cl "ARRAY-DIMENSIONS" ("array")
                shares nothing gives list;
            /// Dimension number `axis`.
            ArrayDimension = array::array_dimension, cl "ARRAY-DIMENSION" ("array axis")
                shares nothing gives integer;
            /// Whether the array has a fill pointer.
            ArrayHasFillPointerp = array::array_has_fill_pointer_p, cl "ARRAY-HAS-FILL-POINTER-P" ("array")
                shares nothing gives boolean;
            /// Whether the array was made to be adjustable.
            AdjustableArrayp = array::adjustable_array_p, cl "ADJUSTABLE-ARRAY-P" ("array")
                shares nothing gives boolean;
            /// The array to which `array` is displaced, and the index of its first element there; `NIL` and 0
            /// if there is none.
            Displacement = array::displacement, cl "ARRAY-DISPLACEMENT" ("array") shares nothing;
            /// The kind of the elements: 0 any objects, 1 characters, 2 integers below 256, 3 bits.
            ElementSort = array::element_sort, internal "%ELEMENT-SORT" ("array") shares nothing -> one;
            /// A vector of `size` times `byte`, of bits if `bits-p`.
            MakeBytes = array::make_bytes, internal "%MAKE-BYTES" ("size byte bits-p") shares nothing -> one;
            /// Stores the bits of an operation on those of two arrays, from row-major index `start` on, in
            /// `target`; the index up to which it has got. Bit 2a+b of `operation` is the result for bits a
            /// and b.
            BitOperation = array::bit_operation, internal "%BIT-OPERATION"
                ("operation left right target start") shares elements -> one;
            /// The storage of the elements: a simple vector or string, the array itself if it is one.
            ArrayData = array::array_data, internal "%ARRAY-DATA" ("array") shares nothing;
            /// The fill pointer of a vector.
            FillPointer = array::fill_pointer, cl "FILL-POINTER" ("vector") shares nothing gives integer;
            /// Makes `index` the fill pointer of a vector, and returns it.
            SetFillPointer = array::set_fill_pointer, internal "%SET-FILL-POINTER" ("vector index")
                shares elements;
            /// Puts `object` where the fill pointer is and moves that on; the index, or `NIL` if the vector
            /// is full.
            VectorPush = array::vector_push, cl "VECTOR-PUSH" ("object vector")
                shares elements gives integer or nil;
            /// As `vector-push`; a full vector grows.
            VectorPushExtend = array::vector_push_extend, cl "VECTOR-PUSH-EXTEND"
                ("object vector &optional extension")
                shares elements gives integer
                slowly "%SLOW-VECTOR-PUSH-EXTEND";
            /// The element in front of the fill pointer, which moves back to it.
            VectorPop = array::vector_pop, cl "VECTOR-POP" ("vector") shares elements;
            /// A fresh simple vector of `size` times `object`.
            MakeVector = array::make_vector, internal "%MAKE-VECTOR" ("size object")
                shares nothing gives vector slowly "%SLOW-MAKE-VECTOR";
            /// Memory for a simple vector or string of `size` elements, which is one when all have been
            /// filled.
            BeginVector = array::begin_vector, internal "%BEGIN-VECTOR" ("size string-p") shares nothing;
            /// Fills more elements of such a vector with `object`, or with 0 if that has an address; whether
            /// all are filled now.
            FillMore = array::fill_more, internal "%FILL-MORE" ("vector object") shares elements;
            /// An array that is not simple, over `data`, a simple vector or string, or bytes; with an offset,
            /// displaced to the array `data`. `fill-pointer` is `NIL`, `T` or an index.
            MakeArray = array::make_array, internal "%MAKE-ARRAY"
                ("dimensions data fill-pointer adjustable &optional offset") shares nothing;
            /// Gives an array that is not simple other dimensions, data and fill pointer, and returns it.
            AdjustArray = array::adjust_array, internal "%ADJUST-ARRAY"
                ("array dimensions data fill-pointer &optional offset") shares elements;

            // ---- hash tables
            /// A hash table: `test` is 0 for `eq`, 1 for `eql`, 2 for `equal`, 3 for `equalp`, 4 for the
            /// functions of a program.
            MakeHashTable = table::make_hash_table,
                internal "%MAKE-HASH-TABLE" ("test size test-function hash-function")
                shares nothing gives table;
            /// The value of `key`, or `default`, and whether the table has it.
            Gethash = table::gethash, cl "GETHASH" ("key table &optional default")
                shares nothing slowly "%SLOW-GETHASH";
            /// Makes `value` the value of `key`, and returns it.
            Puthash = table::puthash, internal "%PUTHASH" ("key table value")
                shares tables slowly "%SLOW-PUTHASH";
            /// Adds `delta` to the value of `key`, or to `default` if it has none, and returns the sum.
            AddToValue = table::add_to_value, internal "%ADD-TO-VALUE" ("key table default delta")
                shares tables gives number slowly "%SLOW-ADD-TO-VALUE";
            /// Removes `key` from the table. Returns whether it was there.
            Remhash = table::remhash, cl "REMHASH" ("key table")
                shares tables gives boolean slowly "%SLOW-REMHASH";
            /// Removes all entries of the table, and returns it.
            Clrhash = table::clrhash, cl "CLRHASH" ("table") shares tables gives table;
            /// Number of keys.
            HashTableCount = table::hash_table_count, cl "HASH-TABLE-COUNT" ("table")
                shares nothing gives integer;
            /// Number of keys for which the table has room at present.
            HashTableSize = table::hash_table_size, cl "HASH-TABLE-SIZE" ("table")
                shares nothing gives integer;
            /// The number of the test, as for `%make-hash-table`, and the functions of a program.
            HashTableTest = table::hash_table_test, internal "%HASH-TABLE-TEST" ("table") shares nothing;
            /// The position behind the next entry from `position` on, its key and its value; `NIL` at the
            /// end. The first position is 0.
            TableNext = table::table_next, internal "%TABLE-NEXT" ("table position") shares nothing
                slowly "%SLOW-TABLE-NEXT";
            /// A later position with the same next entry, some free entries on.
            TableSkip = table::table_skip, internal "%TABLE-SKIP" ("table position") shares nothing;
            /// The hash of a key.
            TableHash = table::table_hash, internal "%TABLE-HASH" ("table key") shares nothing;
            /// A fresh list of `(entry . key)` for the keys that have this hash.
            TableCandidates = table::table_candidates, internal "%TABLE-CANDIDATES" ("table hash")
                shares nothing;
            /// A number that changes whenever a key comes or goes.
            TableSerial = table::table_serial, internal "%TABLE-SERIAL" ("table") shares nothing;
            /// The value of an entry, and whether it still has this very key.
            TableValue = table::table_value, internal "%TABLE-VALUE" ("table entry key") shares nothing;
            /// Gives an entry another value; whether that was done, as it still has this very key.
            SetTableValue = table::set_table_value, internal "%SET-TABLE-VALUE" ("table entry key value")
                shares tables;
            /// Adds a key that the table does not have; whether that was done, as no key came or went since
            /// `serial`.
            TableAdd = table::table_add, internal "%TABLE-ADD" ("table hash key value serial") shares tables;
            /// Takes an entry, whose key has this hash, out of the table; whether that was done, as it still
            /// has this very key.
            TableDelete = table::table_delete, internal "%TABLE-DELETE" ("table entry key hash")
                shares tables;

            // ---- structures
            /// Slot `index` of `instance`, which must be an instance of the class named `class` or a
            /// subclass.
            SlotOf = structure::slot, internal "%SLOT" ("class index instance") shares nothing;
            /// Makes `value` slot `index` of `instance`, and returns `value`.
            SetSlotOf = structure::set_slot, internal "%SET-SLOT" ("class index instance value") shares slots;
            /// Whether `object` is an instance of the structure class named `class` or a subclass.
            IsInstance = structure::is_instance, internal "%INSTANCE-P" ("class object")
                shares nothing gives boolean;

            // ---- failures and the control stack
            /// The innermost handlers below `height`, or of all if that is `NIL`, that no mask hides: index
            /// of the entry, its kind, and its data: `:functions` and a list of `(type . function)`, `:cases`
            /// and their types; for a `failure`, its condition or cause, also `:recovery` and the table or
            /// state of recovery procedures, or `:cleanup`. `NIL` if there are none. A search through all
            /// entries notifies the observers of the failure.
            NextHandler = failure::next_handler, internal "%NEXT-HANDLER"
                ("height failure &optional arguments") shares own;
            /// Unwinds to the entry with this index, of the cases of a `handler-case`, and has one of them
            /// take the condition.
            TakeCase = failure::take_case, internal "%TAKE-CASE" ("index case condition") shares own;
            /// The state of the recovery procedures of the entry with this index: `table` if it is one,
            /// otherwise a copy of it, made here, with their function first. Notifies the observers of the
            /// recovery from `failure`.
            BeginRecovery = failure::begin_recovery, internal "%BEGIN-RECOVERY" ("index table failure")
                shares own;
            /// Has `values`, a list, stand for the values of the operation for whose failure this function of
            /// the library was called, and that the recovery procedures of the entry `index` have handled: if
            /// that is inside of functions of the library, for those of the outermost.
            StandIn = failure::stand_in, internal "%STAND-IN" ("index values") shares own;
            /// Whether the function that asks was called by one of the library.
            IsCalledByLibrary = failure::is_called_by_library, internal "%IS-CALLED-BY-LIBRARY" ("")
                shares nothing;
            /// Unwinds to the cleanup for failures with this index, which has `failure` when it has run.
            UnwindToCleanup = failure::unwind_to_cleanup, internal "%UNWIND-TO-CLEANUP" ("index failure")
                shares own;
            /// The failure that `%UNWIND-TO-CLEANUP` has passed to the innermost running cleanup, or `NIL`.
            CleaningUp = failure::cleaning_up, internal "%CLEANING-UP" ("") shares own;
            /// Returns true if it is reported when the running task fails: unless it belongs to a form, which
            /// learns of its end, or it fails in a cleanup while it ends.
            IsReported = failure::is_reported, internal "%IS-REPORTED" ("") shares own;
            /// Lends the memory that is kept for cleanups to the running task, which ends with a report.
            LendReportMemory = failure::lend_report_memory, internal "%LEND-REPORT-MEMORY" ("") shares own;
            /// Ends the running task as failed, with this condition: its text in a few words, the report for
            /// users, and its line about the missing recovery. In a cleanup of a task that ends already, or
            /// that leaves an expired limit, ends the cleanup, and the report goes with that of the task.
            EndTask = failure::end_task, internal "%END-TASK" ("condition text story ending history full")
                shares own;
            /// Ends the run with this status, from 0 to 255. The remaining tasks are aborted.
            Exit = failure::exit, internal "%EXIT" ("status") shares own;
            /// The innermost `limit` frames, each a list of the function's name, and source, line and column
            /// if known. A function that has no name is `(lambda)`, a form at top level `NIL`. With
            /// `variables` a fifth item lists the names and values of the variables that are in scope there.
            /// A sixth item is true for functions of the library.
            Backtrace = failure::backtrace, internal "%BACKTRACE" ("limit &optional variables")
                shares nothing;
            /// Notes the innermost `limit` frames of this task, for `%NOTED-FRAMES`.
            NoteFrames = failure::note_frames, internal "%NOTE-FRAMES" ("limit") shares own;
            /// The frames of a note, as `%BACKTRACE` gives them; and where the body of the task begins, a
            /// list of source, line and column if that is known.
            NotedFrames = failure::noted_frames, internal "%NOTED-FRAMES" ("note") shares nothing;
            /// Takes away, until the scope around it ends, all rights but these: a list of lists of a keyword
            /// and objects, strings; without objects for all of them. Nothing gives them back. A flag of a
            /// command gives more if `by-flag`: refusals name it.
            NarrowRights = rights::narrow_rights, internal "%NARROW-RIGHTS" ("rights &optional by-flag")
                shares own;
            /// Has the procedures of the form with the control entry `index`, whose datum is `data`, run with
            /// the rights in force where that form stands, until the mask is popped that is on top of the
            /// control stack. Returns the function of recovery procedures.
            LendRights = rights::lend_rights, internal "%LEND-RIGHTS" ("index data") shares own;
            /// Fails unless the program has a right, a keyword, to an object. Returns the object to use in
            /// its place: for a path the one to which its links lead.
            DemandRight = rights::demand_right, internal "%DEMAND-RIGHT" ("right object") shares own;
            /// Calls the embedder's function of this name, a symbol, with a list of arguments.
            CallHost = outside::call_host, internal "%CALL-HOST" ("name arguments") shares own;
            /// Begins the embedder's operation of this name, a symbol, with a list of arguments; its handle.
            /// A call that is left does not wait until a detached one has stopped.
            BeginOperation = operation::begin_operation, internal "%BEGIN-OPERATION"
                ("name arguments detached") shares points;
            /// Tells the outside that this task, whose operations are under way there, stands still, or goes
            /// on.
            TellOfSuspension = operation::tell_of_suspension, internal "%TELL-OF-SUSPENSION" ("stands")
                shares own;
            /// Whether the embedder has an operation of this name, a symbol, and the task may wait for it.
            MayAwait = operation::may_await, internal "%MAY-AWAIT" ("name") shares own;
            /// Tells the outside to stop an operation, once.
            CancelOperation = operation::cancel_operation, internal "%CANCEL-OPERATION" ("handle")
                shares points;
            /// The state of an operation: a keyword, and the list of its values or of the cause and the
            /// arguments of its failure.
            OperationState = operation::operation_state, internal "%OPERATION-STATE" ("handle") shares points;
            /// The values of the latest report of an operation on its progress, a list.
            OperationProgress = operation::operation_progress, internal "%OPERATION-PROGRESS" ("handle")
                shares points;
            /// Notes a report, a list of values, on the progress of an operation that a task performs, and
            /// signals the handle, if the operation is under way.
            NoteOperationProgress = operation::note_operation_progress, internal "%NOTE-OPERATION-PROGRESS"
                ("handle values") shares points;
            /// The number of an operation.
            OperationNumber = operation::operation_number, internal "%OPERATION-NUMBER" ("handle")
                shares nothing;
            /// The handle of an operation that a task performs in place of the outside.
            MakeOperation = operation::make_operation, internal "%MAKE-OPERATION" ("name") shares nothing;
            /// Ends such an operation, if it is under way: a keyword, and the list that goes with it.
            EndOperation = operation::end_operation, internal "%END-OPERATION" ("handle state result")
                shares points;
            /// The task that performs an operation, or `NIL` if the outside does.
            OperationPerformer = operation::operation_performer, internal "%OPERATION-PERFORMER" ("handle")
                shares nothing;
            /// Sets the task that performs an operation.
            SetOperationPerformer = operation::set_operation_performer, internal "%SET-OPERATION-PERFORMER"
                ("handle task") shares own;
            /// Whether an object is the handle of an operation.
            Operationp = operation::operationp, internal "%OPERATIONP" ("object") shares nothing;

            // ---- symbols
            /// The name of a symbol, a string that is not to be changed.
            SymbolName = symbol::symbol_name, cl "SYMBOL-NAME" ("symbol") shares nothing gives string;
            /// The home package of a symbol, or `NIL`.
            SymbolPackage = symbol::symbol_package, cl "SYMBOL-PACKAGE" ("symbol") shares nothing;
            /// The property list of a symbol.
            SymbolPlist = symbol::symbol_plist, cl "SYMBOL-PLIST" ("symbol") shares nothing gives list;
            /// Makes `plist` the property list of `symbol`, and returns it.
            SetSymbolPlist = symbol::set_symbol_plist, internal "%SET-SYMBOL-PLIST" ("symbol plist")
                shares properties;
            /// The property `indicator` of `symbol`, or `default`.
            Get = symbol::get, cl "GET" ("symbol indicator &optional default")
                shares nothing slowly "%SLOW-GET";
            /// Makes `value` the property `indicator` of `symbol`, and returns it.
            Put = symbol::put, internal "%PUT" ("symbol indicator value")
                shares properties slowly "%SLOW-PUT";
            /// Removes the property `indicator` of `symbol`; whether it had one.
            Remprop = symbol::remprop, cl "REMPROP" ("symbol indicator")
                shares properties gives boolean slowly "%SLOW-REMPROP";
            /// The value of the special variable `symbol`. Fails with `:unbound-variable` if it has none.
            SymbolValue = symbol::symbol_value, cl "SYMBOL-VALUE" ("symbol") shares nothing;
            /// Sets the special variable `symbol`, and returns `value`.
            Set = symbol::set, cl "SET" ("symbol value") shares variables;
            /// Whether the special variable `symbol` has a value.
            Boundp = symbol::boundp, cl "BOUNDP" ("symbol") shares nothing gives boolean;
            /// Removes the value of the special variable `symbol`, and returns `symbol`.
            Makunbound = symbol::makunbound, cl "MAKUNBOUND" ("symbol") shares variables gives symbol;
            /// Whether `name`, a symbol or `(setf symbol)`, names a global function or macro.
            Fboundp = symbol::fboundp, cl "FBOUNDP" ("name") shares nothing;
            /// The global function, or macro function, named by `symbol`. Fails with `:undefined-function` if
            /// there is none.
            SymbolFunction = symbol::fdefinition, cl "SYMBOL-FUNCTION" ("symbol") shares nothing;
            /// The global function, or macro function, named by `name`, a symbol or `(setf symbol)`. Fails
            /// with `:undefined-function` if there is none.
            Fdefinition = symbol::fdefinition, cl "FDEFINITION" ("name") shares nothing;
            /// Removes the function or macro named by `name`, and returns `name`.
            Fmakunbound = symbol::fmakunbound, cl "FMAKUNBOUND" ("name") shares definitions;
            /// The symbol that keeps the function called `name`: itself, or for `(setf symbol)` one of the
            /// same package.
            FunctionCell = symbol::function_cell, internal "%FUNCTION-CELL" ("name") shares nothing;
            /// The macro function of `symbol`, global or in `environment`, or `NIL`.
            MacroFunction = symbol::macro_function, cl "MACRO-FUNCTION" ("symbol &optional environment")
                shares nothing;
            /// Whether `symbol` is proclaimed special.
            SpecialVariableP = symbol::special_p, internal "%SPECIAL-P" ("symbol") shares nothing;
            /// Whether `symbol` is a constant.
            ConstantSymbolP = symbol::constant_p, internal "%CONSTANT-P" ("symbol") shares nothing;
            /// Whether `symbol` belongs to the language and may not be redefined.
            LockedP = symbol::locked_p, internal "%LOCKED-P" ("symbol") shares nothing;
            /// A fresh symbol without a package.
            MakeSymbol = symbol::make_symbol, cl "MAKE-SYMBOL" ("name") shares nothing gives symbol;
            /// A fresh symbol without a package, named by `prefix` and a number: `*gensym-counter*`, or
            /// `prefix` itself.
            Gensym = symbol::gensym, cl "GENSYM" ("&optional prefix") shares variables gives symbol;
            /// The name of a function, as its definition gives it, or `NIL`.
            FunctionName = symbol::function_name, internal "%FUNCTION-NAME" ("function") shares nothing;
            /// The lambda list of a function as it was written.
            FunctionLambdaList = symbol::function_lambda_list, internal "%FUNCTION-LAMBDA-LIST" ("function")
                shares nothing;
            /// The documentation string of a function, or `NIL`.
            FunctionDocumentation = symbol::function_documentation, internal "%FUNCTION-DOCUMENTATION"
                ("function") shares nothing;
            /// Where a function stands: a list of source, line and column; `NIL` if that is unknown.
            FunctionPlace = symbol::function_place, internal "%FUNCTION-PLACE" ("function") shares nothing;
            /// The least and the greatest number of arguments of a function; `NIL` in place of the second
            /// without a limit.
            FunctionArity = symbol::function_arity, internal "%FUNCTION-ARITY" ("function") shares nothing;

            // ---- packages
            /// The package of this name or nickname, or `NIL`.
            FindPackage = package::find_package, cl "FIND-PACKAGE" ("name") shares nothing;
            /// Whether `object` is a package.
            Packagep = package::packagep, cl "PACKAGEP" ("object") shares nothing gives boolean;
            /// The name of a package.
            PackageName = package::package_name, cl "PACKAGE-NAME" ("package") shares nothing gives string;
            /// The other names of a package.
            PackageNicknames = package::package_nicknames, cl "PACKAGE-NICKNAMES" ("package")
                shares nothing gives list;
            /// The packages whose external symbols `package` inherits.
            PackageUseList = package::package_use_list, cl "PACKAGE-USE-LIST" ("package")
                shares nothing gives list;
            /// All packages.
            ListAllPackages = package::list_all_packages, cl "LIST-ALL-PACKAGES" ("")
                shares nothing gives list;
            /// The package of this name, made if there is none, with these nicknames, and using these
            /// packages.
            MakePackage = package::make_package, internal "%MAKE-PACKAGE" ("name nicknames uses")
                shares definitions;
            /// Takes its names from a package that could not be made whole.
            ForgetPackage = package::forget_package, internal "%FORGET-PACKAGE" ("package")
                shares definitions;
            /// Lets `package` inherit the external symbols of `packages`, a package or a list of packages.
            UsePackage = package::use_package, cl "USE-PACKAGE" ("packages &optional package")
                shares definitions;
            /// Makes `symbols`, a symbol or a list of symbols, external in `package`.
            Export = package::export, cl "EXPORT" ("symbols &optional package") shares definitions;
            /// Makes `symbols`, a symbol or a list of symbols, present in `package`.
            Import = package::import, cl "IMPORT" ("symbols &optional package") shares definitions;
            /// Makes `symbols`, a symbol or a list of symbols, present in `package`, in place of others of
            /// their names.
            ShadowingImport = package::shadowing_import, cl "SHADOWING-IMPORT" ("symbols &optional package")
                shares definitions;
            /// Gives `package` symbols of its own by these names. Returns `T`.
            Shadow = package::shadow, cl "SHADOW" ("names &optional package") shares definitions;
            /// The symbol that `name` denotes in `package`, made if there is none; and how the package has
            /// it, `NIL` for new.
            Intern = package::intern, cl "INTERN" ("name &optional package") shares definitions gives symbol;
            /// The symbol that `name` denotes in `package`, and how the package has it; `NIL` twice if there
            /// is none.
            FindSymbol = package::find_symbol, cl "FIND-SYMBOL" ("name &optional package")
                shares nothing gives symbol;
            /// All external symbols of a package, by name.
            ExternalSymbols = package::external_symbols, internal "%EXTERNAL-SYMBOLS" ("package")
                shares nothing;
            /// All symbols that are accessible in a package, by name.
            AccessibleSymbols = package::accessible_symbols, internal "%ACCESSIBLE-SYMBOLS" ("package")
                shares nothing;
            /// The qualifier before the name of a symbol in the current package: a string such as `:`, or
            /// `NIL`.
            SymbolQualifier = package::symbol_qualifier, internal "%SYMBOL-QUALIFIER" ("symbol")
                shares nothing;

            // ---- structures and their classes
            /// The class of this name, kept if it has these superclasses (classes or their names) and slots
            /// (symbols), else made.
            MakeClass = class::make_class, internal "%MAKE-CLASS" ("name supers slots data") shares nothing;
            /// Makes `class` the class of this name, which does not belong to the language; with `NIL`, there
            /// is none of this name any more. Instances keep their class.
            SetClass = class::set_class, internal "%SET-CLASS" ("name class") shares definitions;
            /// The class of this name, or `NIL`.
            FindClass = class::find_class, internal "%FIND-CLASS" ("name") shares nothing;
            /// The class of a structure or condition, `NIL` for everything else.
            ClassOf = class::class_of, internal "%CLASS-OF" ("object") shares nothing;
            /// Whether `object` is a class.
            Classp = class::classp, internal "%CLASSP" ("object") shares nothing;
            /// The name of a class.
            ClassName = class::class_name, internal "%CLASS-NAME" ("class") shares nothing;
            /// The direct superclasses of a class.
            ClassSupers = class::class_supers, internal "%CLASS-SUPERS" ("class") shares nothing;
            /// The names of the slots of a class, inherited ones first.
            ClassSlots = class::class_slots, internal "%CLASS-SLOTS" ("class") shares nothing;
            /// The library's data about a class.
            ClassData = class::class_data, internal "%CLASS-DATA" ("class") shares nothing;
            /// Makes `data` the library's data about a class, and returns it.
            SetClassData = class::set_class_data, internal "%SET-CLASS-DATA" ("class data")
                shares definitions;
            /// Whether `class` is `ancestor` or inherits from it.
            SubclassP = class::subclass_p, internal "%SUBCLASS-P" ("class ancestor") shares nothing;
            /// A fresh instance of a class, or of the class of that name. Slots without a value are `NIL`.
            MakeStructure = class::make_structure, internal "%MAKE-STRUCTURE" ("class &rest values")
                shares nothing;
            /// As `%MAKE-STRUCTURE`, an instance that `EQUAL` compares by its slots.
            MakeValueStructure = class::make_value_structure, internal "%MAKE-VALUE-STRUCTURE"
                ("class &rest values") shares nothing;
            /// A copy of a structure.
            CopyStructure = class::copy_structure, cl "COPY-STRUCTURE" ("structure") shares nothing;
            /// Whether `object` is an instance of some class.
            Structurep = class::structurep, internal "%STRUCTUREP" ("object") shares nothing;
            /// The index of a slot of `instance`: the first one in `rows`, pairs of the names of a class and
            /// a slot, whose class it is of. `NIL` if it is of none.
            SlotPlace = class::slot_place, internal "%SLOT-PLACE" ("instance rows") shares nothing;
            /// Slot `index` of a structure of any class.
            StructureRef = class::structure_ref, internal "%STRUCTURE-REF" ("instance index") shares nothing;
            /// Makes `value` slot `index` of a structure of any class, and returns `value`.
            SetStructureRef = class::set_structure_ref, internal "%SET-STRUCTURE-REF" ("instance index value")
                shares slots
               ;
            /// Records that the function `name` reads slot `slot` of the class named `class`. Comes after the
            /// function.
            DefineAccessor = class::define_accessor, internal "%DEFINE-ACCESSOR"
                ("name class slot access") shares definitions;

            // ---- instances of the classes of DEFCLASS
            /// A fresh instance of a class, with a layout and a simple vector of the values of its slots.
            NewInstance = instance::new_instance, internal "%NEW-INSTANCE" ("class layout slots")
                shares nothing;
            /// Makes `instance` one of `class`, with another layout and other slots, and returns it.
            ChangeInstance = instance::change_instance, internal "%CHANGE-INSTANCE"
                ("instance class layout slots") shares slots;
            /// A list of the structures that are instances of just this class. A whole collection finds them.
            InstancesOf = instance::instances_of, internal "%INSTANCES-OF" ("class") shares nothing;
            /// Gives each structure of the list `olds` the slots of that of the list `news`, and `class` as
            /// its class. Each stays the object that it is. Returns their number.
            MoveStructures = instance::move_structures, internal "%MOVE-STRUCTURES" ("olds news class")
                shares slots;
            /// Whether `object` is an instance of a class that `DEFCLASS` has defined.
            Instancep = instance::instancep, internal "%INSTANCEP" ("object") shares nothing;
            /// The content of a slot without a value.
            UnboundMarker = instance::unbound_marker, internal "%UNBOUND-MARKER" ("") shares nothing;
            /// The slot `name` of `instance`. `cache` is a simple vector of the layout of the last access,
            /// and the slot's index there.
            CachedSlotValue = instance::slot_value, internal "%SLOT-VALUE" ("instance name cache")
                shares nothing
                slowly "%SLOW-SLOT-VALUE";
            /// Makes `value` the slot `name` of `instance`, and returns `value`.
            SetCachedSlotValue = instance::set_slot_value, internal "%SET-SLOT-VALUE"
                ("instance name cache value") shares slots slowly "%SLOW-SET-SLOT-VALUE";
            /// Gives a class other direct superclasses. Its subclasses have to be updated in turn.
            UpdateClass = instance::update_class, internal "%UPDATE-CLASS" ("class supers")
                shares definitions;
            /// The item after the class of `object` in `cache`, a simple vector of classes and items in turn;
            /// `NIL` if the class is not in it.
            CachedMethods = instance::cached_methods, internal "%CACHED-METHODS" ("cache object")
                shares nothing;

            // ---- reading and compiling at run time
            /// A handle of the compilation of `form`.
            BeginCompilation = eval::begin_compilation, internal "%BEGIN-COMPILATION" ("form") shares own;
            /// A handle of the compilation of a whole text, called `name` in messages about it.
            BeginFile = eval::begin_file, internal "%BEGIN-FILE" ("name text") shares own;
            /// The functions that run the top-level forms of a compiled file, in order. With a vector of its
            /// bytes, the file is not read.
            CompiledFile = eval::compiled_file, internal "%COMPILED-FILE" ("path &optional is-module bytes")
                shares nothing;
            /// A handle of a text that is compiled form by form. Functions of a text with a name know where
            /// they stand in it.
            OpenText = eval::open_text, internal "%OPEN-TEXT" ("text &optional name") shares own;
            /// The remaining text of a compilation form by form, which ends with this.
            TextRest = eval::text_rest, internal "%TEXT-REST" ("handle") shares nothing;
            /// A handle of the compilation of the next form of a text, `NIL` at its end.
            NextForm = eval::next_form, internal "%NEXT-FORM" ("handle") shares own;
            /// Passes the outcome of its last step to a compilation, and returns the next one: `:expand`
            /// function form environment, `:load` functions keep, or `:done` functions diagnostics.
            CompilationStep = eval::compilation_step, internal "%COMPILATION-STEP" ("handle kind outcome")
                shares own;
            /// Ends a compilation, or lets go of a text; whether there are data left for further calls to
            /// free.
            EndCompilation = eval::end_compilation, internal "%END-COMPILATION" ("handle") shares own;
            /// Reads a datum: whether there was one, or `:unfinished`; the datum; and the index after it. A
            /// failure names the place in the string, unless that is a token of another text.
            ReadDatum = reading::read_from_string, internal "%READ-FROM-STRING"
                ("string &optional start end is-token") shares own;
            /// Reads a datum from a stream: whether there was one, or `:unfinished`; and the datum.
            ReadStream = reading::read, internal "%READ" ("&optional stream") shares own slowly "%SLOW-READ";

            // ---- JSON
            /// Reads the JSON value of a string that begins at `start`: the value, the index after it, and
            /// `NIL`. If there is none, `NIL`, the index of the fault, and a text; if the value is long or
            /// deep, `NIL`, the index at which it begins, and `T`. Objects are association lists, or hash
            /// tables; the last two arguments stand for `false` and `null`.
            JsonValue = json::value, internal "%JSON-VALUE"
                ("string start are-tables is-table-if-empty false null") shares nothing;
            /// Reads a part of a JSON string that has begun: its characters, the index after them, and `NIL`,
            /// `T` if the string has ended, or a text about the fault at the index.
            JsonStringPart = json::string_part, internal "%JSON-STRING-PART" ("string start") shares nothing;
            /// Writes a part of a string to a string stream as JSON does, without the quotes.
            JsonWritePart = json::write_part, internal "%JSON-WRITE-PART" ("string stream start end")
                shares nothing;

            // ---- streams
            /// Standard input, output or error: 0, 1 or 2.
            StandardStream = stream::standard_stream, internal "%STANDARD-STREAM" ("number") shares nothing;
            /// A stream that reads the characters of `string` from `start` to before `end`.
            MakeStringInput = stream::make_string_input, internal "%MAKE-STRING-INPUT" ("string start end")
                shares streams
                slowly "%SLOW-MAKE-STRING-INPUT";
            /// A stream that reads from `string`, which it owns from now on.
            ReadFromCopy = stream::read_from_copy, internal "%READ-FROM-COPY" ("string") shares streams;
            /// How many characters such a stream has read; if `as_rest`, how many bytes in UTF-8 are left of
            /// those that it has.
            StringInputPosition = stream::string_input_position,
                internal "%STRING-INPUT-POSITION" ("stream &optional as-rest") shares nothing;
            /// Has such a stream, if it is open and of a string, go on after so many of its characters, or at
            /// the end with `NIL`. Whether it does.
            SetStringInputPosition = stream::set_string_input_position,
                internal "%SET-STRING-INPUT-POSITION" ("stream position") shares own;
            /// A stream that gathers its output in a string.
            MakeStringOutput = stream::make_string_output, internal "%MAKE-STRING-OUTPUT" ("") shares streams;
            /// The characters that a string stream has gathered since the last call.
            GetOutputStreamString = stream::get_output_stream_string, cl "GET-OUTPUT-STREAM-STRING" ("stream")
                shares own gives string slowly "%SLOW-GET-OUTPUT-STREAM-STRING";
            /// How many characters a string stream has gathered since it was last asked for them.
            GatheredLength = stream::gathered_length, internal "%GATHERED-LENGTH" ("stream") shares nothing;
            /// The strings in which a string stream has gathered them, the last first; it begins afresh.
            /// `NIL` if they are not `length` characters any more. The last string may be longer than the
            /// characters in it.
            TakeGathered = stream::take_gathered, internal "%TAKE-GATHERED" ("stream length") shares own;
            /// Closes a stream; the buffered output of a channel is dropped. Whether it was open.
            CloseStream = stream::close, internal "%CLOSE" ("stream") shares own;
            /// The text of a file.
            FileText = stream::file_text, internal "%FILE-TEXT" ("path &optional is-module") shares own;
            /// Whether there is a file of this name. Checks the right to read it; with `T`, as a module; with
            /// anything else, the right to write it.
            FileExistsP = stream::file_exists_p, internal "%FILE-EXISTS-P" ("path &optional use")
                shares nothing;
            /// The names of the entries of a folder; those of folders end in `/`.
            ListFolder = file::list_folder, internal "%LIST-FOLDER" ("path") shares nothing;
            /// Gives a file another name.
            RenameFile = file::rename_file, internal "%RENAME-FILE" ("path new-path") shares own;
            /// The universal time at which a file was written last.
            FileWriteDate = file::file_write_date, internal "%FILE-WRITE-DATE" ("path") shares nothing;
            /// Makes a folder, and those around it; whether it was not there.
            MakeFolders = file::make_folders, internal "%MAKE-FOLDERS" ("path") shares own;
            /// The name of a file or folder after all links, from the root on, with a slash after that of a
            /// folder; `NIL` if there is none.
            TrueName = file::true_name, internal "%TRUE-NAME" ("path") shares nothing;
            /// Removes a file.
            DeleteFile = stream::delete_file, internal "%DELETE-FILE" ("path") shares own;
            /// The bytes of a file.
            FileBytes = stream::file_bytes, internal "%FILE-BYTES" ("path") shares own;
            /// Writes a vector of bytes to a file: 0 replaces it, 1 appends to it, 2 fails if there is one.
            WriteBytes = stream::write_bytes, internal "%WRITE-BYTES" ("path vector mode") shares own;
            /// A stream whose operations are written in ESL, over `data`.
            MakeCustomStream = stream::make_custom_stream, internal "%MAKE-CUSTOM-STREAM" ("data")
                shares streams;
            /// The data of such a stream; `NIL` for any other object.
            CustomStreamData = stream::custom_stream_data, internal "%CUSTOM-STREAM-DATA" ("stream")
                shares nothing;
            /// A stream whose characters come from and go to the functions of `handler`: for reading if
            /// `direction` is 1, for writing if it is 2, otherwise for both. `file` is the name of the file,
            /// or `NIL`.
            MakeChannel = stream::make_channel, internal "%MAKE-CHANNEL" ("handler file direction")
                shares streams;
            /// The handler of a channel; `NIL` for any other object.
            ChannelHandler = stream::channel_handler, internal "%CHANNEL-HANDLER" ("object") shares nothing;
            /// The string stream that buffers the output to a channel.
            ChannelOutput = stream::channel_output, internal "%CHANNEL-OUTPUT" ("channel") shares nothing;
            /// How many characters a channel has to be read, whether there is a whole line among the first of
            /// them, and whether no more will come.
            ChannelState = stream::channel_state, internal "%CHANNEL-STATE" ("channel") shares nothing;
            /// Adds characters to those that a channel has to be read; with `NIL`, no more will come until
            /// some are added.
            SupplyChannel = stream::supply_channel, internal "%SUPPLY-CHANNEL" ("channel text") shares own;
            /// Reads characters up to the end of a line, a string: those that have arrived, and not too
            /// many. Returns also whether the line has ended with them, and whether the stream has ended
            /// before them. Waits for standard input, not for a channel.
            LinePiece = stream::line_piece, internal "%LINE-PIECE" ("stream") shares own;
            /// The bytes that the characters 0 to 255 of a string stand for; those of the string in UTF-8 if
            /// `as_text`.
            BytesOfString = stream::bytes_of_string, internal "%BYTES-OF-STRING" ("string &optional as-text")
                shares nothing;
            /// The string of the characters that stand for the bytes of a vector; that of which they are the
            /// UTF-8 if `as_text`.
            StringOfBytes = stream::string_of_bytes, internal "%STRING-OF-BYTES" ("vector &optional as-text")
                shares nothing;
            /// Whether `object` is a stream.
            Streamp = stream::streamp, cl "STREAMP" ("object") shares nothing gives boolean tests stream;
            /// Whether a stream can be read from.
            InputStreamP = stream::input_stream_p, cl "INPUT-STREAM-P" ("stream")
                shares nothing slowly "%SLOW-INPUT-STREAM-P";
            /// Whether a stream can be written to.
            OutputStreamP = stream::output_stream_p, cl "OUTPUT-STREAM-P" ("stream")
                shares nothing slowly "%SLOW-OUTPUT-STREAM-P";
            /// Whether a stream is open.
            OpenStreamP = stream::open_stream_p, cl "OPEN-STREAM-P" ("stream") shares nothing;
            /// `:standard`, `:string` or `:file`, and the name of the file.
            StreamSort = stream::stream_sort, internal "%STREAM-SORT" ("stream") shares nothing;
            /// Characters since the last line end that was written to a stream.
            StreamColumn = stream::stream_column, internal "%STREAM-COLUMN" ("stream")
                shares nothing slowly "%SLOW-STREAM-COLUMN";
            /// The next character of a stream. Waits for input. At the end fails with `:end-of-file`, or
            /// returns `eof-value` if `eof-error-p` is `NIL`.
            ReadChar = stream::read_char, cl "READ-CHAR"
                ("&optional stream eof-error-p eof-value recursive-p") shares own slowly "%SLOW-READ-CHAR";
            /// The next character of a stream, or `NIL` if it would have to wait.
            ReadCharNoHang = stream::read_char_no_hang, cl "READ-CHAR-NO-HANG"
                ("&optional stream eof-error-p eof-value recursive-p")
                shares own slowly "%SLOW-READ-CHAR-NO-HANG";
            /// Whether a character of a stream is there to be read.
            Listen = stream::listen, cl "LISTEN" ("&optional stream")
                shares own gives boolean slowly "%SLOW-LISTEN";
            /// The next character of a stream, which stays there; with `T`, after white space; with a
            /// character, up to that.
            PeekChar = stream::peek_char, cl "PEEK-CHAR"
                ("&optional peek-type stream eof-error-p eof-value recursive-p")
                shares own slowly "%SLOW-PEEK-CHAR";
            /// Puts the character that was read last back into a stream.
            UnreadChar = stream::unread_char, cl "UNREAD-CHAR" ("character &optional stream")
                shares own slowly "%SLOW-UNREAD-CHAR";
            /// The next line of a stream, and whether it has no line end. Waits for input. At the end fails
            /// with `:end-of-file`, or returns `eof-value` if `eof-error-p` is `NIL`.
            ReadLine = stream::read_line, cl "READ-LINE"
                ("&optional stream eof-error-p eof-value recursive-p") shares own slowly "%SLOW-READ-LINE";
            /// Writes a character to a stream, and returns it.
            WriteChar = stream::write_char, cl "WRITE-CHAR" ("character &optional stream")
                shares own gives character slowly "%SLOW-WRITE-CHAR";
            /// Writes a part of a string to a stream, and returns the string.
            WriteStringPart = stream::write_string, internal "%WRITE-STRING" ("string stream start end")
                shares own
                slowly "%SLOW-WRITE-STRING";
            /// Ends the line that is being written to a stream.
            Terpri = stream::terpri, cl "TERPRI" ("&optional stream")
                shares own gives nil slowly "%SLOW-TERPRI";
            /// Ends the line that is being written to a stream, unless it is empty; whether it did.
            FreshLine = stream::fresh_line, cl "FRESH-LINE" ("&optional stream")
                shares own gives boolean slowly "%SLOW-FRESH-LINE";
            /// Writes the buffered output of a stream.
            FinishOutput = stream::finish_output, cl "FINISH-OUTPUT" ("&optional stream")
                shares own gives nil slowly "%SLOW-FINISH-OUTPUT";
            /// Writes the buffered output of a stream.
            ForceOutput = stream::finish_output, cl "FORCE-OUTPUT" ("&optional stream")
                shares own gives nil slowly "%SLOW-FORCE-OUTPUT";

            // ---- the logical database
            /// Adds a fact to the database: `T` if it was new, or the fact that it replaces as the value of a
            /// property. Does nothing and gives `:locked` if the table `locks` has entries.
            AssertFact = database::assert_fact, internal "%ASSERT" ("fact locks") shares points;
            /// Removes a fact from the database; whether it was there, or 0 for a pattern with variables.
            /// Does nothing and gives `:locked` if the table `locks` has entries.
            RetractFact = database::retract_fact, internal "%RETRACT" ("fact locks") shares points;
            /// From now on the last of `width` arguments of facts of this name is unique for given others;
            /// `NIL` if there are rules for such facts.
            MakeProperty = database::make_property, internal "%MAKE-PROPERTY" ("name width") shares points;
            /// From now on there may be several last arguments for given others again.
            DropProperty = database::drop_property, internal "%DROP-PROPERTY" ("name width") shares points;
            /// The last argument of the fact that begins with the terms of a list, and whether there is one.
            /// For properties.
            PropertyValue = database::property_value, internal "%PROPERTY-VALUE" ("property") shares points;
            /// Adds a rule, unless one with an equal source is there, which it replaces.
            DefineRule = database::define_rule, internal "%DEFINE-RULE" ("head body source") shares points;
            /// Removes the rule whose source is equal to a list; whether there was one.
            RemoveRule = database::remove_rule, internal "%REMOVE-RULE" ("source") shares points;
            /// Begins a query in which variables have the values of an association list, and does its first
            /// step: the first answers; the number of the query, or `NIL` if these were all; and whether all
            /// answers are found.
            BeginQuery = database::begin_query, internal "%BEGIN-QUERY" ("query bindings") shares points;
            /// Begins a query in which variables have the values of an association list; the number that
            /// names it. With `facts`, its answers are the facts that match a pattern.
            OpenQuery = database::open_query, internal "%OPEN-QUERY" ("query bindings facts") shares points;
            /// Works on a query: `T` when all answers are found, `NIL` when there is more to do; or `:test`,
            /// a function whose value the query needs, and the bindings under which to call it.
            QueryStep = database::query_step, internal "%QUERY-STEP" ("query") shares own;
            /// Passes the outcome of the requested test to a query.
            QueryTell = database::query_tell, internal "%QUERY-TELL" ("query holds") shares own;
            /// The next answers of a query, a list of binding lists; empty when all were given.
            QueryAnswers = database::query_answers, internal "%QUERY-ANSWERS" ("query") shares own;
            /// Removes the next fact that a query has found and that is still there, and gives it; `NIL` when
            /// all were seen to, `T` to be asked again. Does nothing and gives `:locked` if the table `locks`
            /// has entries.
            RetractNext = database::retract_next, internal "%RETRACT-NEXT" ("query locks") shares points;
            /// Ends a query.
            CloseQuery = database::close_query, internal "%CLOSE-QUERY" ("query") shares own;

            // ---- the host
            /// The arguments of the program, a list of strings.
            CommandLineArguments = outside::command_line_arguments, esl "COMMAND-LINE-ARGUMENTS" ("")
                shares nothing gives list;
            /// Seconds on the machine's clock, which never goes back.
            Now = outside::now, esl "NOW" ("") shares clock gives number;
            /// Microseconds on the machine's clock, which never goes back.
            InternalRealTime = outside::internal_real_time, cl "GET-INTERNAL-REAL-TIME" ("")
                shares clock gives integer;
            /// Microseconds for which processors have worked for the process; under a virtual clock, in which
            /// tasks ran.
            InternalRunTime = outside::internal_run_time, cl "GET-INTERNAL-RUN-TIME" ("")
                shares clock gives integer;
            /// Seconds since the beginning of 1900, UTC.
            UniversalTime = outside::universal_time, cl "GET-UNIVERSAL-TIME" ("") shares clock gives integer;

            // ---- events
            /// A new event. The name is for reports.
            MakeEvent = event::make_event, esl "MAKE-EVENT" ("&optional name") shares nothing;
            /// Signals an event: all tasks that wait for it go on, in the order in which they began to wait,
            /// and get the arguments. Returns `NIL`.
            Signal = event::signal, esl "SIGNAL" ("event &rest arguments") shares points;
            /// The same as `signal`.
            SignalEvent = event::signal, esl "SIGNAL-EVENT" ("event &rest arguments") shares points;
            /// How often an event was signalled.
            EventCount = event::event_count, esl "EVENT-COUNT" ("event") shares points gives integer;
            /// The mark of an event, which its next signal takes away, or the list of those of a list of
            /// events. A wait that is given it does not begin if there was a signal since.
            MarkEvents = event::mark_events, internal "%MARK-EVENTS" ("events") shares points;
            /// The name of an event or task, or `NIL`.
            EventName = event::event_name, internal "%EVENT-NAME" ("event") shares nothing;
            /// Whether `object` is an event; tasks are.
            Eventp = event::eventp, internal "%EVENTP" ("object") shares nothing;
            /// The event that every signal of any event signals too, without arguments.
            AnyEvent = event::any_event, internal "%ANY-EVENT" ("") shares nothing;
            /// Waits until one of `events`, an event or a list of events, is signalled, and returns the
            /// arguments of the signal as values. The options are `[test] &key timeout unless-count`: with
            /// `test`, waits until a signal whose arguments answer true to it; it runs in this task, and no
            /// signal is lost meanwhile. Fails with `:timeout` after `timeout` seconds. Does not wait, and
            /// returns `NIL`, if the sum of the counts of `events` is no longer `unless-count`.
            WaitForEvents = event::wait_for_events, esl "WAIT-FOR-EVENTS" ("events &rest options")
                shares points
                slowly "%SLOW-WAIT-FOR-EVENTS";
            /// The same as `wait-for-events`.
            WaitForEvent = event::wait_for_events, esl "WAIT-FOR-EVENT" ("events &rest options") shares points
                slowly "%SLOW-WAIT-FOR-EVENT";
            /// Waits for the next signal of one of `events` and returns its arguments; returns at once if
            /// `count` is not `NIL` and no longer the sum of their counts. `label` is for reports.
            Wait = event::wait, internal "%WAIT" ("events count label") shares points;
            /// Signals `event` and begins to wait for its next signal, in one step; returns at once if
            /// `count` is no longer its count. `label` is for reports.
            SignalAndWait = event::signal_and_wait, internal "%SIGNAL-AND-WAIT" ("event count label")
                shares points;
            /// A wait that keeps all signals of `events` until it is closed, and lasts for `seconds` if they
            /// are not `NIL`; `NIL` if `count` is not `NIL` and no longer the sum of their counts.
            OpenWait = event::open_wait, internal "%OPEN-WAIT" ("events seconds count label") shares points;
            /// Waits for a signal that a wait has kept: the list of its arguments, or `:timeout`; at the
            /// latest until a time in nanoseconds, if one is given.
            TakeSignal = event::take_signal, internal "%TAKE-SIGNAL" ("wait &optional deadline") shares own;
            /// Ends a wait.
            CloseWait = event::close_wait, internal "%CLOSE-WAIT" ("wait") shares own;
            /// The input that the outside knows by a name, a symbol or string: a new one, or one that is
            /// there already, with this capacity and the rule of this number.
            AddInput = input::add_input, internal "%ADD-INPUT" ("name capacity rule") shares own;
            /// The capacity of an input, and the number of its rule.
            InputRule = input::input_rule, internal "%INPUT-RULE" ("input") shares nothing;
            /// Has the outside know no input of this name any more.
            RemoveInput = input::remove_input, internal "%REMOVE-INPUT" ("name") shares own;
            /// How many signals of an input were dropped.
            InputDropped = input::input_dropped, internal "%INPUT-DROPPED" ("input") shares points;
            /// Whether an object is an input.
            Inputp = input::inputp, internal "%INPUTP" ("object") shares nothing;
            /// The time in so many seconds, in nanoseconds; fewer than 0 count as 0, or fail if `strict`.
            Deadline = event::deadline, internal "%DEADLINE" ("seconds &optional strict") shares own;
            /// Waits until a time in nanoseconds, as far as the clock was read last.
            SleepUntil = event::sleep_until, internal "%SLEEP-UNTIL" ("deadline") shares own;
            /// Has a function called, in a task of its own, for each signal of the process of this number.
            OnSignal = event::on_signal, internal "%ON-SIGNAL" ("number function") shares own;
            /// A number below `count`, picked by the seed of the run, or by the explorer of its schedules. A
            /// `way` of 1 or 2 asks whether a restart interrupts a call, before its effect or behind it.
            Choose = event::choose, internal "%CHOOSE" ("count &optional way") shares own;
            /// Lets other tasks have their turns.
            PassTurn = event::pass_turn, internal "%PASS-TURN" ("") shares own;

            // ---- fluents and resources
            /// Sets the value of a fluent, and signals its event unless the value is `EQUAL` to the one
            /// before.
            SetFluent = coordination::set_fluent, internal "%SET-FLUENT" ("fluent value") shares points
                slowly "%SLOW-SET-FLUENT";
            /// A new record of the sources that this task reads, for a watch if one is given.
            NewReads = coordination::new_reads, internal "%NEW-READS" ("&optional watch") shares points;
            /// Notes that a source is read, with the mark of its event; whether it was not noted yet.
            NoteSource = coordination::note_read, internal "%NOTE-SOURCE" ("source reads") shares points;
            /// Whether a source is noted as read.
            NotedP = coordination::noted_p, internal "%NOTED-P" ("source reads") shares nothing;
            /// The value of a fluent; it is noted as read if the reads are those of this task.
            NotedValue = coordination::noted_value, internal "%NOTED-VALUE" ("fluent reads") shares points
                slowly "%SLOW-NOTED-VALUE";
            /// Waits for the next signal of the sources that a form has read, or of any event if there are
            /// none or too many; does not wait if there was one since the form read them. `label` is for
            /// reports. A new record of the sources that this task reads.
            WaitForReads = coordination::wait_for_reads, internal "%WAIT-FOR-READS" ("reads label")
                shares points;
            /// A request of this task, made in a form with the request `outer`, which holds so much of the
            /// resource called `name`; `NIL` if others wait for that, or if there is not enough.
            RequestAtOnce = coordination::request_at_once, internal "%REQUEST-AT-ONCE"
                ("name amount priority outer") shares points;
            /// Takes the holdings from a request that is not `NIL`: a claim of one resource alone, if no
            /// request waits for that. Whether the request holds nothing now.
            GiveBackAtOnce = coordination::give_back_at_once, internal "%GIVE-BACK-AT-ONCE" ("request")
                shares points;

            // ---- tasks
            /// A new task that calls a function. `daemon` may be `:internal` for one that is not listed, or
            /// `:service` for one of these that has no bindings of this task and charges no account of its.
            /// `notify` is a guard that its end signals.
            Spawn = task::spawn, internal "%SPAWN" ("function &optional name priority budget daemon notify")
                shares own;
            /// New tasks, one for each function and name, that begin together: a net, and the tasks. They
            /// have the priority of this task. `label` is for reports.
            SpawnNet = net::spawn_net, internal "%SPAWN-NET" ("label names &rest functions") shares own;
            /// Waits until a task of a net has ended with one of `statuses`, and returns the first that has;
            /// or until all have ended, and returns `NIL`.
            AwaitNet = net::await_net, internal "%AWAIT-NET" ("net statuses") shares own;
            /// Ends the tasks of a net that are left, and waits for that. The net may be `NIL`.
            EndNet = net::end_net, internal "%END-NET" ("net") shares points slowly "%SLOW-END-NET";
            /// The task that runs.
            CurrentTask = task::current_task, esl "CURRENT-TASK" ("") shares nothing;
            /// Whether `object` is a task.
            Taskp = task::taskp, internal "%TASKP" ("object") shares nothing;
            /// `:running`, `:waiting`, `:succeeded`, `:failed` or `:aborted`.
            TaskStatus = task::task_status, esl "TASK-STATUS" ("task") shares points gives symbol;
            /// The number of a task, and that of the task that it belongs to: the one that made it, or, where
            /// that has ended, the one that that belonged to. `NIL` when it has ended.
            TaskNumber = task::task_number, internal "%TASK-NUMBER" ("task") shares nothing;
            /// The ticks that a task has used; `NIL` when it has ended.
            TaskTicks = task::task_ticks, internal "%TASK-TICKS" ("task") shares nothing;
            /// The status of a task that has ended, then its values, or the condition; `NIL` before.
            TaskEnd = task::task_end, internal "%TASK-END" ("task") shares points;
            /// The condition with which a task has failed, and the history of the failure; `NIL` of another.
            TaskFailure = task::task_failure, internal "%TASK-FAILURE" ("task") shares nothing;
            /// The first value of a task that has returned; `NIL` of another.
            TaskValue = task::task_value, internal "%TASK-VALUE" ("task") shares nothing;
            /// The tasks that have not ended, oldest first; with those that are not listed if `hidden`.
            AllTasks = task::all_tasks, internal "%ALL-TASKS" ("hidden")
                shares nothing slowly "%SLOW-ALL-TASKS";
            /// Some of these tasks, in no order, from a number on; and the number for the next ones, `NIL` if
            /// there are no more.
            TasksFrom = task::tasks_from, internal "%TASKS-FROM" ("place hidden") shares nothing;
            /// Waits for the end of a task, then as `%task-end`. With `child`, the time of a cleanup does not
            /// count.
            Join = task::join, internal "%JOIN" ("task child") shares points;
            /// Asks for the end of a task.
            RequestAbort = task::request_abort, internal "%REQUEST-ABORT" ("task") shares points;
            /// Aborts a task at its present place, and returns when its cleanups are over.
            AbortTask = task::abort_task, esl "ABORT-TASK" ("task") shares points;
            /// Notes a checkpoint of the running task, and signals it.
            AddCheckpoint = task::add_checkpoint, internal "%ADD-CHECKPOINT" ("id") shares points;
            /// The checkpoints that a task has passed, newest first.
            Checkpoints = task::checkpoints, internal "%CHECKPOINTS" ("task") shares points;
            /// The holdings of the running task: the list that `%SET-HELD` has noted last.
            Held = task::held, internal "%HELD" ("") shares nothing;
            /// Notes the list of the holdings of the running task. At its end, before others learn of that,
            /// the task calls `%RELEASE-HELD` as long as the list is not empty.
            SetHeld = task::set_held, internal "%SET-HELD" ("list") shares own;
            /// A guard by which the end of another task interrupts this one with a call of `function`.
            MakeGuard = task::make_guard, internal "%MAKE-GUARD" ("function") shares own;
            /// Interrupts a task, as soon as none of its cleanups runs, with a call of `function`.
            InterruptTask = task::interrupt_task, internal "%INTERRUPT-TASK" ("task function") shares points;
            /// Suspends this task: from now on, an abort is the only pending request that is delivered, and
            /// its clock is stopped if that was requested. Without `stands`, ends that.
            StandStill = task::stand_still, internal "%STAND-STILL" ("stands stops-clock") shares own;
            /// The number of tasks made so far, and one above all places of those that there are.
            TasksMade = suspension::tasks_made, internal "%TASKS-MADE" ("") shares nothing;
            /// Adds to the lists in `generations`, by depth, the tasks of a part of the tree of `root`, those
            /// whose numbers are above `above` and not above `below`, from the places below `end`. Returns
            /// the `end` of the next part, `NIL` if the root has ended, and the largest depth. `depths` is a
            /// vector of the known depths.
            TreePart = suspension::tree_part, internal "%TREE-PART"
                ("root above below end depths generations") shares own;
            /// Has those of the first of `tasks` stand still that can do so where they wait, with the clock
            /// stopped if it is to. Returns a list of the others, and the tasks that are left.
            BeginRest = suspension::begin_rest, internal "%BEGIN-REST" ("tasks stops-clock") shares points;
            /// Resumes the first of `tasks`, up to the cell `end`, that stand still by `%BEGIN-REST`. Returns
            /// the tasks that are left, and a list of those that do not.
            ResumeFromRest = suspension::resume_from_rest, internal "%RESUME-FROM-REST" ("tasks end")
                shares points;
            /// Has a task stand still by `%BEGIN-REST` no more. Returns how often it did.
            EndRest = suspension::end_rest, internal "%END-REST" ("task") shares points;
            /// Has a guard interrupt its task, again if it has done so before.
            InterruptBy = task::interrupt_by, internal "%INTERRUPT-BY" ("guard") shares points;
            /// Lets a guard interrupt no more.
            CloseGuard = task::close_guard, internal "%CLOSE-GUARD" ("guard") shares points;
            /// Makes the innermost catch, for `tag`, a limit of time, of ticks, or of a quota's units of the
            /// measure with this number: when it expires, its form is ended and gives the cause.
            OpenLimit = task::open_limit, internal "%OPEN-LIMIT" ("tag seconds units &optional measure")
                shares own;
            /// Returns true if a task has to end because it charges a quota that is spent.
            IsOverQuota = task::is_over_quota, internal "%IS-OVER-QUOTA" ("task") shares nothing;
            /// Makes the limit for `tag` of `task` expire with `cause`, a keyword, unless it is closed.
            ExpireLimit = task::expire_limit, internal "%EXPIRE-LIMIT" ("task tag cause") shares points;
            /// Begins a critical section: no other task runs.
            BeginCritical = task::begin_critical, internal "%BEGIN-CRITICAL" ("") shares points;
            /// Whether a critical section is open in the running task.
            InCriticalSection = task::in_critical_section, internal "%IN-CRITICAL-SECTION" ("")
                shares nothing -> one;
            /// Ends a critical section.
            EndCritical = task::end_critical, internal "%END-CRITICAL" ("") shares own;
        }
    };
}

for_each_builtin!(define_builtins);
