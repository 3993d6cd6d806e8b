//! From the names of modules to their files, and from tests to their runs.

use esl_bytecode::compile::{MODULE_SOURCES, Required};
use esl_format::module_name;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree};
use lsp_types::{
    CodeLens, CodeLensParams, Command, DocumentLink, DocumentLinkParams, Location,
    TextDocumentPositionParams, Uri,
};

use super::definition::{DefinedAs, definitions};
use super::document::{OpenText, uri_of};
use super::failures;
use super::library::shown_source;
use super::project::Project;

/// The command of the client that runs a test. Its arguments are the URI of the text and the test's name.
const RUN_TEST: &str = "esl.runTest";

/// Returns the name of the module of a form `(require …)`, and the node that names it.
fn required_module(tree: &SyntaxTree, form: NodeId) -> Option<(String, NodeId)> {
    let is_require = tree.kind(form) == SyntaxKind::List && tree.operator(form).as_deref() == Some("require");
    let argument = tree.data(form).nth(1).filter(|_| is_require)?;
    Some((module_name(tree.text(argument))?, argument))
}

/// Returns the file of a module, as `text` finds it. One that comes with the machine is shown from a copy.
fn file_of(project: &Project, text: &OpenText, name: &str) -> Option<Uri> {
    match project.module_path(&text.path()).find(name).ok()? {
        Required::Source { name: file, text } => {
            let path = match file.strip_prefix(MODULE_SOURCES) {
                Some(name) => shown_source(&format!("modules/{name}"), &text)?,
                None => file.as_str().into(),
            };
            uri_of(&path)
        }
        _ => None,
    }
}

/// Answers which parts of a text lead to other files.
pub(super) fn links(project: &Project, parameters: &DocumentLinkParams) -> Option<Vec<DocumentLink>> {
    let text = project.text(&parameters.text_document.uri)?;
    let tree = &text.tree;
    let modules = tree.nodes().filter_map(|form| required_module(tree, form));
    let link = |(name, argument): (String, NodeId)| {
        let target = file_of(project, text, &name)?;
        let tooltip = Some(format!("Open the module `{name}`"));
        Some(DocumentLink {
            range: text.range(tree.range(argument)),
            target: Some(target),
            tooltip,
            data: None,
        })
    };
    Some(modules.filter_map(link).collect())
}

/// Returns the beginning of the module that is named at a position.
pub(super) fn module_at(project: &Project, at: &TextDocumentPositionParams) -> Option<Location> {
    let text = project.text(&at.text_document.uri)?;
    let tree = &text.tree;
    let node = tree.node_at(text.offset(at.position));
    let list = tree.list_around(node)?;
    let (name, argument) = required_module(tree, list)?;
    let is_there = tree.range(argument).start <= tree.range(node).start && node >= argument;
    is_there.then(|| Some(Location::new(file_of(project, text, &name)?, Default::default())))?
}

/// Answers the commands that are offered beside forms: a test can be run.
pub(super) fn lenses(project: &Project, parameters: &CodeLensParams) -> Option<Vec<CodeLens>> {
    let text = project.text(&parameters.text_document.uri)?;
    let tests = definitions(&text.tree).into_iter().filter(|found| found.kind == DefinedAs::Test);
    let lens = |test: super::definition::NameDefinition| {
        let arguments = vec![text.uri.as_str().into(), text.tree.source()[test.name_place.clone()].into()];
        let command = Command::new("Run test".into(), RUN_TEST.into(), Some(arguments));
        CodeLens { range: text.range(test.name_place), command: Some(command), data: None }
    };
    Some(tests.map(lens).chain(failures::lenses(project, text)).collect())
}
