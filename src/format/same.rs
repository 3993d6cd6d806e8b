//! The guarantee of the formatter: what the reader reads of a text stays the same, and so do its comments.

use esl_bytecode::package::Qualifier;
use esl_compiler::reader::{BareEnvironment, Reader, print};

use crate::syntax::{SyntaxKind, SyntaxTree};

/// Returns whether two texts have the same tokens and comments in the same lists, and the reader reads the
/// same data of both.
pub(super) fn is_same(before: &SyntaxTree, after: &SyntaxTree) -> bool {
    before.nodes() == after.nodes()
        && before.nodes().all(|node| essence(before, node) == essence(after, node))
        && is_same_data(before.source(), after.source())
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

fn is_same_data(before: &str, after: &str) -> bool {
    let mut environments = (BareEnvironment::new(), BareEnvironment::new());
    let mut readers = (Reader::new(Default::default(), before), Reader::new(Default::default(), after));
    loop {
        let read = (readers.0.next(&mut environments.0), readers.1.next(&mut environments.1));
        match read {
            (None, None) => return true,
            (Some(Ok(one)), Some(Ok(other))) => {
                let [one, other] = [one, other].map(|datum| print(&datum, &|_| Qualifier::None));
                if one != other {
                    return false;
                }
            }
            // What the reader refuses of both, such as the name of a package that is not there.
            (Some(Err(one)), Some(Err(other))) if one.code == other.code => {}
            _ => return false,
        }
    }
}
