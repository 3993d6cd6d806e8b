//! Habits from other languages: the ESL that the author of a text in Python, JavaScript, C or Scheme meant.
//!
//! [`word`] is the table of foreign words; [`statement`] recognizes lines that are not Lisp; [`operator`]
//! knows operators between their operands, and names before parentheses. The reader and the expander ask
//! where they would report a fault in any case, or where a top-level datum does not begin with `(`, so
//! correct programs do not pay for it.
//!
//! Not here: the reports themselves, which the reader and the expander make; taking away the reports that
//! follow from a foreign form (`session::cascade`).

pub mod operator;
pub mod statement;
pub mod word;
