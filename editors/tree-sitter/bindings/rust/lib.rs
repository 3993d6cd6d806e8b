//! The grammar of ESL for tree-sitter, with its queries.
//!
//! ```ignore
//! let mut parser = tree_sitter::Parser::new();
//! parser.set_language(&tree_sitter_esl::LANGUAGE.into())?;
//! let tree = parser.parse("(drive 5)", None);
//! ```

use tree_sitter_language::LanguageFn;

// SAFETY: the generated parser defines a function of this name and type.
#[allow(unsafe_code)]
unsafe extern "C" {
    fn tree_sitter_esl() -> *const ();
}

/// The generated parser.
// SAFETY: the function returns a language of tree-sitter, which is what the generator writes.
#[allow(unsafe_code)]
pub const LANGUAGE: LanguageFn = unsafe { LanguageFn::from_raw(tree_sitter_esl) };

/// Colours.
pub const HIGHLIGHTS_QUERY: &str = include_str!("../../queries/highlights.scm");

/// Query for the parts that an editor can fold.
pub const FOLDS_QUERY: &str = include_str!("../../queries/folds.scm");
