//! Formatting: the layout that Lisp programmers expect.
//!
//! Lines keep the breaks that their author gave them, and get more where they are longer than 100 columns.
//! Each line that does not begin inside a string or a block comment is indented by the list around its first
//! token: arguments under the first one, bodies two columns in, distinguished arguments four. One blank
//! divides the data of a list, parentheses stand beside what they enclose, and blank lines do not pile up.
//! Text between the comments `; format: off` and `; format: on` keeps its layout. The rules of indentation
//! are those of Emacs (`lisp-indent-function`, `common-lisp-indent-function`), with the lambda lists of
//! macros in place of most of its table.
//!
//! Guarantees: the reader reads the same data of both texts, and the comments are the same, in the same
//! lists; [`format`](fn@format) compares both texts, as ruff does. Formatting again changes nothing. It takes
//! time in proportion to the text, without native recursion.
//!
//! ```
//! use esl_format::{Styles, format};
//! use esl_syntax::SyntaxTree;
//!
//! let tree = SyntaxTree::new("(when ready\n(go-on\n 'home  )\n)");
//! let formatted = format(&tree, &Styles::standard(), None);
//! assert_eq!(formatted.as_deref(), Ok("(when ready\n  (go-on\n   'home))\n"));
//! ```
#![forbid(unsafe_code)]

mod breaks;
mod comments;
mod edit;
mod indent;
mod layout;
mod modules;
mod pieces;
mod same;
mod style;

use std::fmt;
use std::ops::RangeInclusive;

use esl_compiler::reader::structure_faults;

use esl_syntax::SyntaxTree;

pub use edit::Edit;
pub use modules::{module_name, required, styles_of};
pub use style::Styles;

use layout::{LayoutExtent, lay_out};

/// Reason why a text is not formatted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FormatError {
    /// The text cannot be read: a list, a string or a comment has no end, say, or it is of another language.
    Unreadable,
    /// The formatted text would be read differently, which is a fault of the formatter.
    Changed,
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FormatError::Unreadable => "the text cannot be read",
            FormatError::Changed => {
                "the formatted text would be read differently, which is a fault of the formatter; \
                 put `; format: off` before the form"
            }
        })
    }
}

impl std::error::Error for FormatError {}

/// Returns the text of a tree as it is formatted: all of its lines, or those with these numbers, counted from
/// 0. All but these stay as they are.
///
/// # Errors
/// [`FormatError`]
pub fn format(
    tree: &SyntaxTree,
    styles: &Styles,
    lines: Option<RangeInclusive<usize>>,
) -> Result<String, FormatError> {
    Ok(Edit::apply(tree.source(), &format_edits(tree, styles, lines)?))
}

/// As [`format`](fn@format); returns what changes, in order.
///
/// # Errors
/// [`FormatError`]
pub fn format_edits(
    tree: &SyntaxTree,
    styles: &Styles,
    lines: Option<RangeInclusive<usize>>,
) -> Result<Vec<Edit>, FormatError> {
    if !structure_faults(Default::default(), tree.source()).is_empty() {
        return Err(FormatError::Unreadable);
    }
    let edits = lay_out(tree, styles, lines, LayoutExtent::All);
    same::check_same(tree, &SyntaxTree::new(Edit::apply(tree.source(), &edits)))?;
    Ok(edits)
}

/// Returns what changes when the lines of a text are indented: all of them, or those with these numbers,
/// counted from 0. Nothing but the blanks at the beginnings and ends of lines does, and the text may be
/// unfinished.
pub fn indent_edits(tree: &SyntaxTree, styles: &Styles, lines: Option<RangeInclusive<usize>>) -> Vec<Edit> {
    lay_out(tree, styles, lines, LayoutExtent::Indentation)
}

#[cfg(test)]
mod tests;
