//! The command that shows the form at a position with its macros expanded.

use lsp_types::{ExecuteCommandParams, TextDocumentPositionParams};

use super::project::Project;
use crate::program::{Source, expand};
use crate::syntax::SyntaxTree;

/// Name of the command. Its argument is a text and a position,
/// as those of requests; its result the expansion.
pub(super) const COMMAND: &str = "esl.expand";

/// Stands before the form whose expansion is wanted.
const MARK: &str = "(quote %esl-lsp-form)";

/// Carries out a command.
///
/// # Errors
/// Why there is no result.
pub(super) fn execute(project: &Project, parameters: &ExecuteCommandParams) -> Result<String, String> {
    if parameters.command != COMMAND {
        return Err(format!("there is no command `{}`", parameters.command));
    }
    let argument = parameters.arguments.first().cloned().unwrap_or_default();
    let at: TextDocumentPositionParams = serde_json::from_value(argument)
        .map_err(|error| format!("expected a text and a position: {error}"))?;
    let text = project.text(&at.text_document.uri).ok_or("the text is not open")?;
    let offset = text.offset(at.position);
    let tree = &text.tree;
    let forms: Vec<_> = tree.data(SyntaxTree::ROOT).map(|form| tree.range(form)).collect();
    let form = forms.iter().find(|place| place.contains(&offset) || place.end == offset);
    let form = form.ok_or("there is no form here")?;
    let before = &tree.source()[..form.start];
    let program = format!("{before}{MARK}\n{}", &tree.source()[form.clone()]);
    let path = project.module_path(&text.path());
    let (expansion, compiled) = expand(&Source::new(text.path().display().to_string(), program), &path);
    let marks = ["(QUOTE %ESL-LSP-FORM)", "'%ESL-LSP-FORM", "'%esl-lsp-form", "(quote %esl-lsp-form)"];
    let shown = marks.iter().find_map(|mark| expansion.split_once(mark)).map(|(_, shown)| shown.trim());
    match (shown.filter(|shown| !shown.is_empty()), compiled.diagnostics.first()) {
        (Some(shown), _) => Ok(format!("{shown}\n")),
        (None, Some(diagnostic)) => Err(diagnostic.message.clone()),
        (None, None) => Err("the form defines something only while the program is compiled".into()),
    }
}
