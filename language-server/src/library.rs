//! Names of the language itself, for hover, completion and go-to-definition: the library, the modules over
//! the operating system as they are required, the builtins and the compiler's own operators.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::OnceLock;

use esl_bytecode::builtin::{BUILTINS, Visibility};
use esl_compiler::reader::lexer::Token;
use esl_syntax::{SyntaxKind, SyntaxTree, bare_name};

use super::definition::{DefinedAs, NameDefinition, definitions, string};
use super::reference::{self, ReferenceEntry};

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
    /// The uses of each name, that as an operator first.
    by_name: HashMap<String, Vec<usize>>,
}

/// Returns the names of the language, which are found once.
pub(super) fn language() -> &'static LanguageNames {
    static NAMES: OnceLock<LanguageNames> = OnceLock::new();
    NAMES.get_or_init(LanguageNames::collect)
}

impl LanguageNames {
    fn collect() -> LanguageNames {
        let written = LanguageNames::written();
        let mut all = LanguageNames::default();
        // The reference is authoritative for descriptions, the sources for places.
        for ReferenceEntry { name, kind, lambda_list, text } in reference::entries() {
            let places = written.find_all(&name);
            let same = places.iter().find(|place| namespace_of(place.definition.kind) == namespace_of(kind));
            let mut told = written_in_rust(name, kind, lambda_list, text, true);
            if let Some(place) = same.or(places.first()) {
                told.source = place.source;
                told.definition.name_place = place.definition.name_place.clone();
                told.definition.place = place.definition.place.clone();
                // The table of conditions tells more of them.
                if kind == DefinedAs::Type && same.is_some() && !place.definition.text.is_empty() {
                    told.definition.text = place.definition.text.clone();
                }
                if place.definition.kind == DefinedAs::Constant {
                    told.definition.kind = DefinedAs::Constant;
                }
            }
            all.add(told);
        }
        for name in written.names {
            if all.find(&name.definition.name).is_none() {
                all.add(name);
            }
        }
        all
    }

    /// Returns the names as the sources define them.
    fn written() -> LanguageNames {
        let mut all = LanguageNames::default();
        for (index, (_, text)) in esl_stdlib::SOURCES.iter().enumerate() {
            let tree = SyntaxTree::new(*text);
            for definition in conditions(&tree) {
                all.add(LanguageName { definition, source: Some(index), is_public: true });
            }
            for definition in definitions(&tree) {
                // Names outside the reference are internal.
                all.add(LanguageName { definition, source: Some(index), is_public: false });
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
        self.by_name.entry(name.definition.name.clone()).or_default().push(self.names.len());
        self.names.push(name);
    }

    /// Returns what is known of a name without its package, in lower case: of its use as an operator, if it
    /// has several.
    pub(super) fn find(&self, name: &str) -> Option<&LanguageName> {
        self.by_name.get(name).and_then(|uses| uses.first()).map(|&index| &self.names[index])
    }

    /// Returns what is known of all uses of a name.
    pub(super) fn find_all(&self, name: &str) -> Vec<&LanguageName> {
        let uses = self.by_name.get(name).map_or(&[][..], Vec::as_slice);
        uses.iter().map(|&index| &self.names[index]).collect()
    }

    /// Returns the names that programs can use, each once.
    pub(super) fn public(&self) -> impl Iterator<Item = &LanguageName> {
        let is_first = |name: &&LanguageName| {
            self.find(&name.definition.name).is_some_and(|first| std::ptr::eq(first, *name))
        };
        self.names.iter().filter(|name| name.is_public).filter(is_first)
    }
}

/// Returns a number for the namespace of a definition: names in different namespaces do not conflict.
fn namespace_of(kind: DefinedAs) -> u8 {
    match kind {
        DefinedAs::Function | DefinedAs::Macro | DefinedAs::Operator | DefinedAs::Slot => 0,
        DefinedAs::Variable | DefinedAs::Constant => 1,
        DefinedAs::Type => 2,
        DefinedAs::Cause => 3,
        DefinedAs::Package | DefinedAs::Test | DefinedAs::Other => 4,
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

/// Returns the conditions of the library's tables, each as a type and as the cause of its failures, and the
/// causes without a condition.
fn conditions(tree: &SyntaxTree) -> Vec<NameDefinition> {
    let mut found = Vec::new();
    for form in tree.data(SyntaxTree::ROOT) {
        match tree.operator(form).as_deref() {
            Some("%define-conditions") => {
                tree.data(form).skip(1).for_each(|row| add_condition(tree, row, &mut found));
            }
            Some("%put") => {
                let data: Vec<u32> = tree.data(form).collect();
                let &[_, name, property, ..] = &*data else { continue };
                let cause = tree.text(name);
                if cause.starts_with(':') && tree.text(property) == "'%cause" {
                    let text = String::from("A cause of failures of the language itself.");
                    found.push(named(tree, (form, name), cause.to_lowercase(), DefinedAs::Cause, text));
                }
            }
            _ => {}
        }
    }
    found
}

/// Adds a row `(name (parent…) (slot…) report… documentation)`.
fn add_condition(tree: &SyntaxTree, row: u32, found: &mut Vec<NameDefinition>) {
    let data: Vec<u32> = tree.data(row).collect();
    let &[name, parents, ..] = &*data else { return };
    let Some(bare) = tree.name(name).map(bare_name).filter(|bare| !bare.starts_with('%')) else { return };
    let parents: Vec<String> =
        tree.data(parents).filter_map(|parent| tree.name(parent)).map(bare_name).collect();
    let is_text = |&&part: &&u32| tree.kind(part) == SyntaxKind::Leaf(Token::String);
    let told =
        data.iter().skip(3).find(is_text).map(|&part| string(tree.text(part)) + " ").unwrap_or_default();
    let list = |mark: &str| {
        let names: Vec<String> = parents.iter().map(|parent| format!("`{mark}{parent}`")).collect();
        if names.is_empty() { String::new() } else { format!(" It is a kind of {}.", names.join(" and ")) }
    };
    let type_text = format!("{told}A condition, whose failures have the cause `:{bare}`.{}", list(""));
    let cause_text = format!("{told}The cause of failures by the condition `{bare}`.{}", list(":"));
    found.push(named(tree, (row, name), format!(":{bare}"), DefinedAs::Cause, cause_text));
    found.push(named(tree, (row, name), bare, DefinedAs::Type, type_text));
}

/// Returns a definition by a form, in which `name` is the name's node.
fn named(
    tree: &SyntaxTree,
    (form, name): (u32, u32),
    written: String,
    kind: DefinedAs,
    text: String,
) -> NameDefinition {
    NameDefinition {
        name: written,
        package: String::new(),
        kind,
        name_place: tree.range(name),
        place: tree.range(form),
        lambda_list: None,
        text,
    }
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
    // Beside it first: an editor may read it now.
    let partial = path.with_extension(format!("{}.tmp", std::process::id()));
    let written = std::fs::write(&partial, text).and_then(|()| std::fs::rename(&partial, &path));
    if written.is_err() {
        _ = std::fs::remove_file(&partial);
    }
    written.ok()?;
    Some(path)
}
