//! Formatting: of a text, of some of its lines, and of a line that was just begun.

use esl_format::{Edit, format_edits, indent_edits, styles_of};
use esl_syntax::SyntaxTree;
use lsp_types::{
    DocumentFormattingParams, DocumentOnTypeFormattingParams, DocumentRangeFormattingParams, TextEdit,
};

use super::document::OpenText;
use super::project::Project;

/// Answers what changes when a text is formatted. Of one that cannot be read, the lines are indented.
pub(super) fn whole(project: &Project, parameters: &DocumentFormattingParams) -> Option<Vec<TextEdit>> {
    formatted(project, project.text(&parameters.text_document.uri)?, None)
}

/// Answers what changes when some lines of a text are formatted.
pub(super) fn range(project: &Project, parameters: &DocumentRangeFormattingParams) -> Option<Vec<TextEdit>> {
    let (start, end) = (parameters.range.start, parameters.range.end);
    let last = end.line - u32::from(end.character == 0 && end.line > start.line);
    formatted(project, project.text(&parameters.text_document.uri)?, Some((start.line, last)))
}

fn formatted(project: &Project, text: &OpenText, lines: Option<(u32, u32)>) -> Option<Vec<TextEdit>> {
    let path = project.module_path(&text.path());
    let styles = styles_of(&text.tree, |name| path.source_of(name));
    let lines = lines.map(|(first, last)| first as usize..=last as usize);
    let edits = format_edits(&text.tree, &styles, lines.clone())
        .unwrap_or_else(|_| indent_edits(&text.tree, &styles, lines));
    Some(edits.into_iter().map(|edit| TextEdit::new(text.range(edit.place), edit.new)).collect())
}

/// Answers how a line is indented that begins at a position, after a newline was typed.
pub(super) fn typed(project: &Project, parameters: &DocumentOnTypeFormattingParams) -> Option<Vec<TextEdit>> {
    let at = &parameters.text_document_position;
    let text = project.text(&at.text_document.uri)?;
    let path = project.module_path(&text.path());
    let styles = styles_of(&text.tree, |name| path.source_of(name));
    let line = at.position.line as usize;
    let place = text.lines.range(line);
    let content = text.tree.source()[place.clone()].trim_end_matches(['\n', '\r']);
    let blanks = content.len() - content.trim_start_matches([' ', '\t']).len();
    let indented = |edits: Vec<Edit>, end: usize| {
        let edit = edits.into_iter().find(|edit| edit.place.end == end);
        edit.map(|edit| edit.new.rsplit('\n').next().unwrap_or_default().to_owned())
    };
    if blanks < content.len() {
        let edits = indent_edits(&text.tree, &styles, Some(line..=line));
        let new = indented(edits, place.start + blanks);
        return Some(new.map(|new| edit(text, place.start, blanks, new)).into_iter().collect());
    }
    // Something has to stand there to be indented.
    let mut source = text.tree.source().to_owned();
    source.insert_str(place.start + blanks, "x ");
    let tree = SyntaxTree::new(source);
    let is_code = tree.range(tree.first_at(place.start + blanks).min(tree.nodes().end - 1)).start
        == place.start + blanks;
    let new = indented(indent_edits(&tree, &styles, Some(line..=line)), place.start + blanks);
    Some(new.filter(|_| is_code).map(|new| edit(text, place.start, blanks, new)).into_iter().collect())
}

fn edit(text: &OpenText, start: usize, blanks: usize, new: String) -> TextEdit {
    TextEdit::new(text.range(start..start + blanks), new)
}
