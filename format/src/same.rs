//! The guarantee of the formatter: what the reader reads of a text stays the same, and so do its comments.

use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::package::Qualifier;
use esl_compiler::reader::{BareEnvironment, Reader, print};
use esl_syntax::{SyntaxKind, SyntaxTree};

use super::FormatError;

/// Checks that two texts have the same tokens and comments in the same lists, and that the reader reads the
/// same data of both.
///
/// # Errors
/// [`FormatError`]: `Unreadable` if the reader refuses the first text where they differ.
pub(super) fn check_same(before: &SyntaxTree, after: &SyntaxTree) -> Result<(), FormatError> {
    let is_same = before.nodes() == after.nodes()
        && before.nodes().all(|node| essence(before, node) == essence(after, node));
    if is_same { check_same_data(before.source(), after.source()) } else { Err(FormatError::Changed) }
}

/// Returns what must stay of a node: its kind, what contains it, and the text of a token or comment.
fn essence(tree: &SyntaxTree, node: u32) -> (SyntaxKind, Option<u32>, &str) {
    let text = match tree.kind(node) {
        SyntaxKind::List | SyntaxKind::Mark(_) => {
            &tree.source()[tree.range(node).start..tree.opening_end(node)]
        }
        _ => tree.text(node),
    };
    (tree.kind(node), tree.parent(node), text)
}

fn check_same_data(before: &str, after: &str) -> Result<(), FormatError> {
    let mut environments = (BareEnvironment::new(), BareEnvironment::new());
    let mut readers = (Reader::new(Default::default(), before), Reader::new(Default::default(), after));
    // The reader tells the notations of other languages, such as `f(x)`, by blanks and lines. How it reads
    // the rest of such a text depends on them too.
    let is_foreign = |fault: &Diagnostic| fault.code.starts_with("foreign-");
    let mut fault_of_difference = FormatError::Changed;
    loop {
        let read = (readers.0.next(&mut environments.0), readers.1.next(&mut environments.1));
        if let (Some(Err(fault)), _) | (_, Some(Err(fault))) = &read
            && is_foreign(fault)
        {
            fault_of_difference = FormatError::Unreadable;
        }
        match read {
            (None, None) => return Ok(()),
            (Some(Ok(one)), Some(Ok(other))) => {
                let [one, other] = [one, other].map(|datum| print(&datum, &|_| Qualifier::None));
                if one != other {
                    return Err(fault_of_difference);
                }
            }
            // The reader refuses the same in both, such as the name of a package that does not exist.
            (Some(Err(one)), Some(Err(other))) if one.code == other.code => {}
            (Some(Err(_)), _) => return Err(FormatError::Unreadable),
            _ => return Err(fault_of_difference),
        }
    }
}
