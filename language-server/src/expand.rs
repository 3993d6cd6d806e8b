//! The command that shows the form at a position with its macros expanded.

use std::fmt;

use esl::program::{Source, expand};
use esl_bytecode::diagnostic::Diagnostic;
use esl_syntax::SyntaxTree;
use lsp_types::{ExecuteCommandParams, TextDocumentPositionParams};

use super::project::Project;

/// Name of the command. Its argument is a text and a position,
/// as those of requests; its result the expansion.
pub(super) const COMMAND: &str = "esl.expand";

/// Stands before the form whose expansion is wanted.
const MARK: &str = "(quote %esl-lsp-form)";

/// Reason why there is no expansion.
#[derive(Debug)]
pub(super) enum NoExpansion {
    /// There is no command of this name.
    UnknownCommand(String),
    /// The argument does not consist of a text and a position.
    Argument(serde_json::Error),
    /// The text is not open.
    NotOpen,
    /// There is no form at the position.
    NoForm,
    /// The program does not compile.
    DoesNotCompile(Box<Diagnostic>),
    /// The form does nothing when the program runs.
    CompileTimeOnly,
}

impl fmt::Display for NoExpansion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoExpansion::UnknownCommand(name) => write!(f, "unknown command `{name}`"),
            NoExpansion::Argument(error) => write!(f, "expected a text and a position: {error}"),
            NoExpansion::NotOpen => f.write_str("the text is not open"),
            NoExpansion::NoForm => f.write_str("expected a form here"),
            NoExpansion::DoesNotCompile(diagnostic) => f.write_str(&diagnostic.message),
            NoExpansion::CompileTimeOnly => {
                f.write_str("the form defines something only while the program is compiled")
            }
        }
    }
}

/// Carries out a command.
///
/// # Errors
/// [`NoExpansion`].
pub(super) fn execute(project: &Project, parameters: &ExecuteCommandParams) -> Result<String, NoExpansion> {
    if parameters.command != COMMAND {
        return Err(NoExpansion::UnknownCommand(parameters.command.clone()));
    }
    let argument = parameters.arguments.first().cloned().unwrap_or_default();
    let at: TextDocumentPositionParams = serde_json::from_value(argument).map_err(NoExpansion::Argument)?;
    let text = project.text(&at.text_document.uri).ok_or(NoExpansion::NotOpen)?;
    let offset = text.offset(at.position);
    let tree = &text.tree;
    let forms: Vec<_> = tree.data(SyntaxTree::ROOT).map(|form| tree.range(form)).collect();
    let form = forms.iter().find(|place| place.contains(&offset) || place.end == offset);
    let form = form.ok_or(NoExpansion::NoForm)?;
    let before = &tree.source()[..form.start];
    let program = format!("{before}{MARK}\n{}", &tree.source()[form.clone()]);
    let path = project.module_path(&text.path());
    let (expansion, compiled) = expand(&Source::new(text.path().display().to_string(), program), &path);
    let marks = ["(QUOTE %ESL-LSP-FORM)", "'%ESL-LSP-FORM", "'%esl-lsp-form", "(quote %esl-lsp-form)"];
    let shown = marks.iter().find_map(|mark| expansion.split_once(mark)).map(|(_, shown)| shown.trim());
    match (shown.filter(|shown| !shown.is_empty()), compiled.diagnostics.first()) {
        (Some(shown), _) => Ok(format!("{shown}\n")),
        (None, Some(diagnostic)) => Err(NoExpansion::DoesNotCompile(Box::new(diagnostic.clone()))),
        (None, None) => Err(NoExpansion::CompileTimeOnly),
    }
}
