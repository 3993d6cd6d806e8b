//! The scripting language of trees: `A := 1; B = A > 3 ? 'far' : 'near'`.
//!
//! A script is a flat list of expressions, in which operands come before their operators, so no walk
//! recurses. Nesting is bounded while a script is read.

use std::fmt;

mod parser;
mod token;

pub(crate) use parser::parse;

/// An expression, by the indices of its operands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Expression {
    /// A number, as it is written in ESL.
    Number(String),
    Text(String),
    Boolean(bool),
    /// An entry of the blackboard, or an enumerator.
    Name(String),
    /// An operator of one operand: `-`, `~`, `!`.
    Unary(&'static str, usize),
    /// An operator of two operands.
    Binary(&'static str, usize, usize),
    /// A chain of comparisons: operators, and one operand more.
    Comparison(Vec<&'static str>, Vec<usize>),
    Conditional(usize, usize, usize),
    /// An assignment: operator, entry, value.
    Assignment(&'static str, String, usize),
}

/// Reason why a script cannot be read: the fault, and what was expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ScriptFault(pub(crate) String);

impl fmt::Display for ScriptFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<String> for ScriptFault {
    fn from(text: String) -> ScriptFault {
        ScriptFault(text)
    }
}

/// A script that was read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Script {
    /// Operands before their operators.
    pub(crate) expressions: Vec<Expression>,
    /// Indices of the statements.
    pub(crate) statements: Vec<usize>,
}

impl Script {
    /// Returns the entries that it reads.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.expressions.iter().filter_map(|expression| match expression {
            Expression::Name(name) => Some(&**name),
            _ => None,
        })
    }

    /// Returns the entries that it sets.
    pub(crate) fn assigned(&self) -> impl Iterator<Item = &str> {
        self.expressions.iter().filter_map(|expression| match expression {
            Expression::Assignment(_, name, _) => Some(&**name),
            _ => None,
        })
    }
}
