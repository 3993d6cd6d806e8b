//! The builtin table: every function that is written in Rust, declared once, with its lambda list and what it does.
//!
//! The compiler takes names and arities from here, the virtual machine implements each row, `help` and the reference
//! print it. A row is: home package (`cl`, `esl`, or `internal` for the library's own use), name, lambda list, and for
//! a builtin that stops at a limit of work the ESL function that takes over from it.
//!
//! Builtins take required, optional and rest arguments only; functions with keyword arguments are written in ESL.

use crate::compile::Arity;
use crate::symbol::{CL_PACKAGE, ESL_PACKAGE};

/// Who a builtin's name is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// A name of the package `COMMON-LISP`.
    Cl,
    /// An external name of the package `ESL`.
    Esl,
    /// An internal name of the package `ESL`, for the library.
    Internal,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct BuiltinInfo {
    /// The builtin.
    pub builtin: Builtin,
    /// Who its name is for.
    pub visibility: Visibility,
    /// Its name.
    pub name: &'static str,
    /// Its lambda list as it is shown to people, without parentheses.
    pub lambda_list: &'static str,
    /// The arguments that it takes.
    pub arity: Arity,
    /// The ESL function, internal to the package `ESL`, that takes over when the work is above a builtin's limit.
    pub slowly: Option<&'static str>,
    /// What it does.
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

macro_rules! slowly {
    () => {
        None
    };
    ($name:literal) => {
        Some($name)
    };
}

macro_rules! define_builtins {
    ($( $(#[doc = $doc:literal])* $id:ident = $visibility:ident $name:literal ($lambda_list:literal) $(slowly $slowly:literal)? ; )*) => {
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
                slowly: slowly!($($slowly)?),
                doc: &[$( $doc ),*],
            }, )*
        ];
    };
}

impl Builtin {
    /// The builtin with this number, unless there is none.
    pub fn from_number(number: u32) -> Option<Builtin> {
        BUILTINS.get(number as usize).map(|info| info.builtin)
    }

    /// Its number.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// Its row.
    pub fn info(self) -> &'static BuiltinInfo {
        &BUILTINS[self as usize]
    }
}

define_builtins! {
    // ---- definitions
    /// Makes `function` the global function named by `symbol`, and returns `symbol`.
    SetFunction = internal "%SET-FUNCTION" ("symbol function");
    /// Makes `function` the macro function of `symbol`, and returns `symbol`.
    SetMacro = internal "%SET-MACRO" ("symbol function");
    /// Makes `symbol` a special variable, and returns it.
    ProclaimSpecial = internal "%PROCLAIM-SPECIAL" ("symbol");
    /// Makes `symbol` a constant with `value`, and returns it. Fails if it is a constant with another value.
    DefineConstant = internal "%DEFINE-CONSTANT" ("symbol value");

    // ---- functions and values
    /// Calls `function`, or the function that a symbol names, with `arguments`.
    Funcall = cl "FUNCALL" ("function &rest arguments");
    /// Calls `function` with `arguments`, the last of which is a list of further arguments.
    Apply = cl "APPLY" ("function argument &rest arguments");
    /// Its arguments, as multiple values.
    Values = cl "VALUES" ("&rest values");
    /// The items of `list`, as multiple values.
    ValuesList = cl "VALUES-LIST" ("list");
    /// Its argument.
    Identity = cl "IDENTITY" ("object");

    // ---- identity and types
    /// Whether both are the same object.
    Eq = cl "EQ" ("left right");
    /// Whether both are the same object, or equal numbers of one type, or equal characters.
    Eql = cl "EQL" ("left right");
    /// Whether `object` is `NIL`.
    Not = cl "NOT" ("object");
    /// Whether `object` is `NIL`.
    Null = cl "NULL" ("object");
    /// Whether `object` is a pair.
    Consp = cl "CONSP" ("object");
    /// Whether `object` is anything but a pair.
    Atom = cl "ATOM" ("object");
    /// Whether `object` is a pair or `NIL`.
    Listp = cl "LISTP" ("object");
    /// Whether `object` is a symbol.
    Symbolp = cl "SYMBOLP" ("object");
    /// Whether `object` is a keyword.
    Keywordp = cl "KEYWORDP" ("object");
    /// Whether `object` is a number.
    Numberp = cl "NUMBERP" ("object");
    /// Whether `object` is an integer, a ratio or a float.
    Realp = cl "REALP" ("object");
    /// Whether `object` is an integer or a ratio.
    Rationalp = cl "RATIONALP" ("object");
    /// Whether `object` is an integer.
    Integerp = cl "INTEGERP" ("object");
    /// Whether `object` is a float.
    Floatp = cl "FLOATP" ("object");
    /// Whether `object` is a character.
    Characterp = cl "CHARACTERP" ("object");
    /// Whether `object` is a string.
    Stringp = cl "STRINGP" ("object");
    /// Whether `object` is an array of rank 1.
    Vectorp = cl "VECTORP" ("object");
    /// Whether `object` is a simple general vector.
    SimpleVectorp = cl "SIMPLE-VECTOR-P" ("object");
    /// Whether `object` is an array.
    Arrayp = cl "ARRAYP" ("object");
    /// Whether `object` is a function.
    Functionp = cl "FUNCTIONP" ("object");
    /// Whether `object` is a hash table.
    HashTablep = cl "HASH-TABLE-P" ("object");

    // ---- numbers
    /// The sum; 0 of no numbers.
    Add = cl "+" ("&rest numbers") slowly "%SLOW-+";
    /// The first number less the others; the negative of a single one.
    Subtract = cl "-" ("number &rest numbers") slowly "%SLOW--";
    /// The product; 1 of no numbers.
    Multiply = cl "*" ("&rest numbers") slowly "%SLOW-*";
    /// The first number divided by the others; the reciprocal of a single one. Exact for integers and ratios.
    Divide = cl "/" ("number &rest numbers") slowly "%SLOW-/";
    /// `number` plus one.
    Increment = cl "1+" ("number");
    /// `number` less one.
    Decrement = cl "1-" ("number");
    /// Quotient rounded towards minus infinity, and remainder.
    Floor = cl "FLOOR" ("number &optional divisor") slowly "%SLOW-FLOOR";
    /// Quotient rounded towards plus infinity, and remainder.
    Ceiling = cl "CEILING" ("number &optional divisor") slowly "%SLOW-CEILING";
    /// Quotient rounded towards zero, and remainder.
    Truncate = cl "TRUNCATE" ("number &optional divisor") slowly "%SLOW-TRUNCATE";
    /// Quotient rounded to the nearest integer, halves to the even one, and remainder.
    Round = cl "ROUND" ("number &optional divisor") slowly "%SLOW-ROUND";
    /// The remainder of `floor`.
    Mod = cl "MOD" ("number divisor") slowly "%SLOW-MOD";
    /// The remainder of `truncate`.
    Rem = cl "REM" ("number divisor") slowly "%SLOW-REM";
    /// The numbers' bitwise and; -1 of none.
    LogAnd = cl "LOGAND" ("&rest integers") slowly "%SLOW-LOGAND";
    /// The numbers' bitwise or; 0 of none.
    LogIor = cl "LOGIOR" ("&rest integers") slowly "%SLOW-LOGIOR";
    /// The numbers' bitwise exclusive or; 0 of none.
    LogXor = cl "LOGXOR" ("&rest integers") slowly "%SLOW-LOGXOR";
    /// `integer` shifted left by `count` bits, right if that is negative.
    Ash = cl "ASH" ("integer count");
    /// Whether all numbers are equal.
    NumEqual = cl "=" ("number &rest numbers");
    /// Whether no two numbers are equal.
    NumNotEqual = cl "/=" ("number &rest numbers") slowly "%SLOW-/=";
    /// Whether the numbers increase.
    Less = cl "<" ("number &rest numbers");
    /// Whether the numbers never decrease.
    LessEqual = cl "<=" ("number &rest numbers");
    /// Whether the numbers decrease.
    Greater = cl ">" ("number &rest numbers");
    /// Whether the numbers never increase.
    GreaterEqual = cl ">=" ("number &rest numbers");
    /// Whether `number` is zero.
    Zerop = cl "ZEROP" ("number");
    /// Whether `number` is above zero.
    Plusp = cl "PLUSP" ("number");
    /// Whether `number` is below zero.
    Minusp = cl "MINUSP" ("number");

    // ---- lists
    /// A fresh pair.
    Cons = cl "CONS" ("car cdr");
    /// The car of a pair, `NIL` of `NIL`.
    Car = cl "CAR" ("list");
    /// The cdr of a pair, `NIL` of `NIL`.
    Cdr = cl "CDR" ("list");
    /// The car of the cdr.
    Cadr = cl "CADR" ("list");
    /// The cdr of the cdr.
    Cddr = cl "CDDR" ("list");
    /// The first item of a list, `NIL` if there is none.
    First = cl "FIRST" ("list");
    /// The list without its first item.
    Rest = cl "REST" ("list");
    /// The second item of a list, `NIL` if there is none.
    Second = cl "SECOND" ("list");
    /// Makes `object` the car of `pair`, and returns `pair`.
    Rplaca = cl "RPLACA" ("pair object");
    /// Makes `object` the cdr of `pair`, and returns `pair`.
    Rplacd = cl "RPLACD" ("pair object");
    /// Makes `value` the car of `pair`, and returns `value`.
    SetCar = internal "%SET-CAR" ("pair value");
    /// Makes `value` the cdr of `pair`, and returns `value`.
    SetCdr = internal "%SET-CDR" ("pair value");
    /// A fresh list of `objects`.
    List = cl "LIST" ("&rest objects");
    /// A list of the objects that ends in the last of them.
    ListStar = cl "LIST*" ("object &rest objects");
    /// The lists joined: all but the last are copied.
    Append = cl "APPEND" ("&rest lists") slowly "%SLOW-APPEND";

    // ---- arrays
    /// A fresh simple vector of `objects`.
    Vector = cl "VECTOR" ("&rest objects");
    /// Element `index` of a simple general vector.
    Svref = cl "SVREF" ("vector index");
    /// Makes `value` element `index` of a simple general vector, and returns `value`.
    SetSvref = internal "%SET-SVREF" ("vector index value");
    /// The element of `array` that the subscripts select.
    Aref = cl "AREF" ("array &rest subscripts");
    /// Sets the element of `array` that the subscripts select to the last argument, and returns that.
    SetAref = internal "%SET-AREF" ("array &rest subscripts-and-value");

    // ---- structures
    /// Slot `index` of `instance`, which must be an instance of the class named `class` or a subclass.
    SlotOf = internal "%SLOT" ("class index instance");
    /// Makes `value` slot `index` of `instance`, and returns `value`.
    SetSlotOf = internal "%SET-SLOT" ("class index instance value");
    /// Whether `object` is an instance of the structure class named `class` or a subclass.
    IsInstance = internal "%INSTANCE-P" ("class object");

    // ---- failures and the control stack
    /// How many entries the control stack has.
    ControlHeight = internal "%CONTROL-HEIGHT" ("");
    /// The innermost handlers below `height` that no mask hides: index of the entry, whether it is one of cases, and its
    /// types, or its list of `(type . function)`. `NIL` if there are none.
    NextHandler = internal "%NEXT-HANDLER" ("height");
    /// Unwinds to the entry with this index, of the cases of a `handler-case`, and has one of them take the condition.
    TakeCase = internal "%TAKE-CASE" ("index case condition");
    /// Ends the running task as failed, with this condition.
    EndTask = internal "%END-TASK" ("condition");
    /// Ends the run with this status, from 0 to 255. The remaining tasks are aborted.
    Exit = internal "%EXIT" ("status");
    /// The innermost `limit` frames, each a list of the function's name, and source, line and column if known.
    Backtrace = internal "%BACKTRACE" ("limit");
    /// Calls the embedder's function with this number.
    CallHost = internal "%CALL-HOST" ("number &rest arguments");
}
