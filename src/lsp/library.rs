//! What the language itself defines, for hover, completion and the way to its source: the library, the
//! modules over the operating system as they are required, the builtins and the compiler's own operators.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::OnceLock;

use esl_bytecode::builtin::{BUILTINS, Visibility};
use esl_compiler::reader::lexer::Token;

use super::definition::{DefinedAs, NameDefinition, definitions, string};
use crate::syntax::{SyntaxKind, SyntaxTree, bare_name};

/// A name of the language.
#[derive(Clone, Debug)]
pub(super) struct LanguageName {
    pub(super) definition: NameDefinition,
    /// The library's file, by its place in [`esl_stdlib::SOURCES`]; `None` for what is written in Rust.
    pub(super) source: Option<usize>,
    /// Whether programs can use it without `esl::`.
    pub(super) is_public: bool,
}

/// All names of the language.
#[derive(Debug, Default)]
pub(super) struct LanguageNames {
    names: Vec<LanguageName>,
    by_name: HashMap<String, usize>,
}

/// Returns the names of the language, which are found once.
pub(super) fn language() -> &'static LanguageNames {
    static NAMES: OnceLock<LanguageNames> = OnceLock::new();
    NAMES.get_or_init(LanguageNames::collect)
}

impl LanguageNames {
    fn collect() -> LanguageNames {
        let mut all = LanguageNames::default();
        for (index, (_, text)) in esl_stdlib::SOURCES.iter().enumerate() {
            let tree = SyntaxTree::new(*text);
            for definition in definitions(&tree) {
                let is_public = !definition.name.starts_with('%') && !definition.name.starts_with("*%");
                all.add(LanguageName { definition, source: Some(index), is_public });
            }
            for (name, text) in operator_texts(&tree) {
                all.add(written_in_rust(name, DefinedAs::Operator, None, text, true));
            }
        }
        for builtin in BUILTINS {
            let is_public = builtin.visibility != Visibility::Internal;
            let lambda_list = Some(format!("({})", builtin.lambda_list));
            let text: Vec<&str> = builtin.doc.iter().map(|line| line.trim()).collect();
            let name = builtin.name.to_lowercase();
            all.add(written_in_rust(name, DefinedAs::Function, lambda_list, text.join(" "), is_public));
        }
        all
    }

    fn add(&mut self, name: LanguageName) {
        // The first definition counts: later ones are methods and the like.
        self.by_name.entry(name.definition.name.clone()).or_insert(self.names.len());
        self.names.push(name);
    }

    /// Returns what is known of a name without its package, in lower case.
    pub(super) fn find(&self, name: &str) -> Option<&LanguageName> {
        self.by_name.get(name).map(|&index| &self.names[index])
    }

    /// Returns the names that programs can use.
    pub(super) fn public(&self) -> impl Iterator<Item = &LanguageName> {
        let is_first = |name: &&LanguageName| {
            self.by_name
                .get(&name.definition.name)
                .is_some_and(|&first| std::ptr::eq(&self.names[first], *name))
        };
        self.names.iter().filter(|name| name.is_public).filter(is_first)
    }
}

fn written_in_rust(
    name: String,
    kind: DefinedAs,
    lambda_list: Option<String>,
    text: String,
    is_public: bool,
) -> LanguageName {
    let package = String::new();
    let definition = NameDefinition { name, package, kind, name_place: 0..0, place: 0..0, lambda_list, text };
    LanguageName { definition, source: None, is_public }
}

/// Returns the texts of the compiler's own operators, which the
/// library has for `help`: pairs `(name . "text")`.
fn operator_texts(tree: &SyntaxTree) -> Vec<(String, String)> {
    let is_table = |&form: &u32| {
        let name = tree.data(form).nth(1).and_then(|name| tree.name(name));
        name.is_some_and(|name| name == "%operator-text")
    };
    let Some(table) = tree.data(SyntaxTree::ROOT).find(is_table) else { return Vec::new() };
    let place = tree.range(table);
    let (first, last) = (tree.first_at(place.start), tree.first_at(place.end));
    let pairs = (first..last).filter_map(|node| {
        let data: Vec<u32> = tree.data(node).take(4).collect();
        let &[name, dot, text] = &*data else { return None };
        let is_pair = tree.text(dot) == "." && tree.kind(text) == SyntaxKind::Leaf(Token::String);
        is_pair.then(|| Some((bare_name(tree.name(name)?), string(tree.text(text)))))?
    });
    pairs.collect()
}

/// Returns the folder for texts of the language that editors can open. Another version has another one.
pub(super) fn cache_folder() -> PathBuf {
    let variable = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let cache = variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|home| home.join(".cache")));
    cache.unwrap_or_else(std::env::temp_dir).join("esl").join(env!("CARGO_PKG_VERSION"))
}

/// Writes a text of the language to a file that an editor can open, and returns its path.
pub(super) fn shown_source(name: &str, text: &str) -> Option<PathBuf> {
    let path = cache_folder().join(name);
    if std::fs::read(&path).is_ok_and(|known| known == text.as_bytes()) {
        return Some(path);
    }
    std::fs::create_dir_all(path.parent()?).ok()?;
    crate::command::replace_file(&path, text.as_bytes()).ok()?;
    Some(path)
}
