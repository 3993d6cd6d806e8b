//! The styles of a text: those of the library, of the modules that it requires, and its own.

use std::sync::{Arc, OnceLock};

use esl_syntax::SyntaxTree;

use super::Styles;

/// Returns the styles for a text: those of the library, of the modules that it requires, and its own. `find`
/// returns the source of the module of a name, if there is one.
pub fn styles_of(tree: &SyntaxTree, find: impl FnMut(&str) -> Option<Arc<str>>) -> Styles {
    let mut styles = library().clone();
    add_modules(tree, find, &mut styles);
    styles.add_macros(tree, true);
    styles
}

/// Returns the styles of the library.
fn library() -> &'static Styles {
    static STYLES: OnceLock<Styles> = OnceLock::new();
    STYLES.get_or_init(|| {
        let mut styles = Styles::standard();
        for (_, text) in esl_stdlib::SOURCES {
            styles.add_macros(&SyntaxTree::new(*text), false);
        }
        styles
    })
}

/// Adds the macros of the modules that a text requires, and of those that they require.
fn add_modules(tree: &SyntaxTree, mut find: impl FnMut(&str) -> Option<Arc<str>>, styles: &mut Styles) {
    let mut known = Vec::new();
    let mut waiting: Vec<String> = required(tree);
    while let Some(name) = waiting.pop() {
        if known.contains(&name) {
            continue;
        }
        if let Some(text) = find(&name) {
            let module = SyntaxTree::new(&*text);
            waiting.extend(required(&module));
            styles.add_macros(&module, true);
        }
        known.push(name);
    }
}

/// Returns the names of the modules that a text requires.
pub fn required(tree: &SyntaxTree) -> Vec<String> {
    let calls = tree.data(SyntaxTree::ROOT).filter(|&form| tree.operator(form).as_deref() == Some("require"));
    let argument = |form| tree.data(form).nth(1).map(|argument| tree.text(argument));
    calls.filter_map(argument).filter_map(module_name).collect()
}

/// Returns the name of the module that the argument of `require` denotes: a string, or a symbol.
pub fn module_name(argument: &str) -> Option<String> {
    if let Some(text) = argument.strip_prefix('"') {
        return text.strip_suffix('"').map(str::to_owned);
    }
    let name = argument.strip_prefix(':').or_else(|| argument.strip_prefix('\''))?;
    Some(name.trim_start_matches("#:").to_lowercase())
}
