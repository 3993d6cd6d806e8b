//! Faults in what the tests of this folder read: programs with expectations, chapters, grammars.

use std::fmt;

/// A line that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrongLine {
    /// The line, from 1.
    pub line: usize,
    /// The fault in it.
    pub fault: LineFault,
}

/// Fault of a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// The block that begins here is not closed.
    UnclosedBlock,
    /// A block with an output does not follow a program.
    OutputWithoutProgram,
    /// The line has no type and template.
    NoTemplate,
    /// A template has a place for a type that has no templates.
    NoTemplateOf(String),
    /// A line of settings names none.
    NoSetting,
    /// An expectation has no colon.
    NoColon,
    /// The program fails in another place already.
    SecondFailure,
    /// An exit status is not a number from 0 to 255.
    NoStatus,
    /// There is no expectation of this name.
    UnknownExpectation(String),
}

impl LineFault {
    /// Returns the fault with the line that has it, from 1.
    pub fn on(self, line: usize) -> WrongLine {
        WrongLine { line, fault: self }
    }
}

impl fmt::Display for WrongLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.fault)
    }
}

impl fmt::Display for LineFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LineFault::UnclosedBlock => f.write_str("unclosed block"),
            LineFault::OutputWithoutProgram => f.write_str("output without a program"),
            LineFault::NoTemplate => f.write_str("expected `type| template`"),
            LineFault::NoTemplateOf(kind) => write!(f, "there are no templates of the type `{kind}`"),
            LineFault::NoSetting => f.write_str("no setting is named"),
            LineFault::NoColon => f.write_str("expected a colon after `expect`"),
            LineFault::SecondFailure => f.write_str("a second failure"),
            LineFault::NoStatus => f.write_str("expected a number from 0 to 255"),
            LineFault::UnknownExpectation(name) => write!(f, "`expect {name}` is not known"),
        }
    }
}

impl std::error::Error for WrongLine {}
