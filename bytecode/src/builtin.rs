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
}
