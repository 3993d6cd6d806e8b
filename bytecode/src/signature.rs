//! Answers to the compiler about a name: similar names for a use of it, and the parameters of a function.

use crate::datum::Datum;
use crate::symbol::Symbol;

/// Use of a name, for which similar ones are searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NameUse {
    /// As a function or macro.
    Function,
    /// As a variable.
    Variable,
    /// As a cause of failures.
    Cause,
    /// As a type.
    Type,
}

/// Parameters of a function or macro, to check calls of it.
#[derive(Clone, Debug)]
pub struct Signature {
    /// The lambda list.
    pub lambda_list: Datum,
    /// Greatest number of arguments before the keyword arguments.
    pub positional: u32,
    /// The names that select keyword arguments; `None` if it takes none, or any.
    pub keys: Option<Vec<Symbol>>,
}
