//! The forms of sources that places lie in, as far as the sources can still be read.

use std::collections::HashMap;

use esl_syntax::{LineStarts, NodeId, SyntaxTree};

/// Sources by name; `None` for one that cannot be read.
#[derive(Default)]
pub struct SourceForms(HashMap<String, Option<(SyntaxTree, LineStarts)>>);

impl SourceForms {
    /// Returns the outermost form that begins at a place, and the tree that it is in.
    fn form(&mut self, source: &str, line: usize, column: usize) -> Option<(&SyntaxTree, NodeId)> {
        let known = self.0.entry(source.into()).or_insert_with(|| {
            let text = std::fs::read_to_string(source).ok()?;
            let lines = LineStarts::new(&text);
            Some((SyntaxTree::new(text), lines))
        });
        let (tree, lines) = known.as_ref()?;
        let range = lines.range(line.checked_sub(1)?);
        let text = &tree.source()[range.clone()];
        let (at, _) = text.char_indices().nth(column.checked_sub(1)?)?;
        let node = tree.first_at(range.start + at);
        (tree.nodes().contains(&node) && tree.range(node).start == range.start + at).then_some((tree, node))
    }

    /// Returns whether the form at a place is a call of this operator.
    pub fn is_of(&mut self, operator: &str, source: &str, line: usize, column: usize) -> bool {
        let form = self.form(source, line, column);
        form.and_then(|(tree, node)| tree.operator(node)).is_some_and(|found| found == operator)
    }
}

impl SourceForms {
    /// Characters of a form that are shown.
    const SHOWN: usize = 60;

    /// Returns a place, as `file:line:column`, with the form that begins there, in one line.
    pub fn describe(&mut self, place: &str) -> String {
        match self.text(place) {
            Some(text) => format!("{place}: {text}"),
            None => place.into(),
        }
    }

    /// Returns the form that begins at a place, given as `file:line:column`, in one line.
    pub fn text(&mut self, place: &str) -> Option<String> {
        let mut parts = place.rsplitn(3, ':');
        let column = parts.next()?.parse().ok()?;
        let line = parts.next()?.parse().ok()?;
        let (tree, node) = self.form(parts.next()?, line, column)?;
        let words: Vec<&str> = tree.text(node).split_whitespace().collect();
        let text = words.join(" ");
        Some(match text.char_indices().nth(Self::SHOWN) {
            Some((end, _)) => format!("{}…", text[..end].trim_end()),
            None => text,
        })
    }
}
