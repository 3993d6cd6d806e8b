//! The server's data: the open texts, the modules that they require, and the search for names in them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl_bytecode::compile::Required;
use esl_format::required;
use lsp_types::{Location, Uri};

use super::definition::{NameDefinition, definitions};
use super::document::{ColumnUnit, OpenText, path_of, uri_of};
use super::inferred::InferredTexts;
use super::library::{LanguageName, language, shown_source};

/// Sources of a workspace that are looked at for its symbols, at most.
const MAX_FILES: usize = 2000;

/// The texts that the server knows.
#[derive(Debug)]
pub(super) struct Project {
    texts: HashMap<String, OpenText>,
    pub(super) unit: ColumnUnit,
    /// Folders of modules, as `--library` names them.
    pub(super) folders: Vec<PathBuf>,
    /// Folders of the workspace.
    pub(super) roots: Vec<PathBuf>,
    /// The possible failures of the open texts.
    pub(super) inferred: InferredTexts,
}

impl Project {
    pub(super) fn new(folders: Vec<PathBuf>, roots: Vec<PathBuf>, unit: ColumnUnit) -> Project {
        Project { texts: HashMap::new(), unit, folders, roots, inferred: InferredTexts::default() }
    }

    pub(super) fn open(&mut self, uri: Uri, version: i32, text: String) {
        let key = uri.as_str().to_owned();
        self.texts.insert(key, OpenText::new(uri, version, text, self.unit));
    }

    pub(super) fn close(&mut self, uri: &Uri) {
        self.texts.remove(uri.as_str());
    }

    /// Returns the URIs of the open texts.
    pub(super) fn open_uris(&self) -> Vec<Uri> {
        self.texts.values().map(|text| text.uri.clone()).collect()
    }

    pub(super) fn text(&self, uri: &Uri) -> Option<&OpenText> {
        self.texts.get(uri.as_str())
    }

    pub(super) fn text_mut(&mut self, uri: &Uri) -> Option<&mut OpenText> {
        self.texts.get_mut(uri.as_str())
    }

    /// Returns the folders in which a file finds modules.
    pub(super) fn module_path(&self, file: &Path) -> ModulePath {
        ModulePath::new([file], &self.folders)
    }

    /// Returns the text of a file: as the editor has it, or else as it is stored.
    fn load(&self, path: &Path) -> Option<OpenText> {
        let uri = uri_of(path)?;
        let open = self.texts.values().find(|text| text.uri == uri || text.path() == path_of(&uri));
        if let Some(text) = open {
            return Some(text.clone());
        }
        let text = std::fs::read_to_string(path).ok()?;
        Some(OpenText::new(uri, 0, text, self.unit))
    }

    /// Returns the modules that a text requires, and those that they require.
    pub(super) fn modules(&self, text: &OpenText) -> Vec<OpenText> {
        let path = self.module_path(&text.path());
        let mut waiting = required(&text.tree);
        let mut known: Vec<String> = Vec::new();
        let mut modules = Vec::new();
        while let Some(name) = waiting.pop() {
            if known.contains(&name) {
                continue;
            }
            if let Ok(Required::Source { name: file, text }) = path.find(&name) {
                let module = self.load(Path::new(&file)).or_else(|| {
                    // One that comes with the machine is shown from a copy.
                    let shown = shown_source(&format!("modules/{file}"), &text)?;
                    Some(OpenText::new(uri_of(&shown)?, 0, text.to_string(), self.unit))
                });
                if let Some(module) = module {
                    waiting.extend(required(&module.tree));
                    modules.push(module);
                }
            }
            known.push(name);
        }
        modules
    }

    /// Returns the names of the modules that a text can require.
    pub(super) fn module_names(&self, text: &OpenText) -> Vec<String> {
        self.module_path(&text.path()).names()
    }

    /// Returns the texts of the workspace: the open ones, and the sources in its folders.
    pub(super) fn workspace(&self) -> Vec<OpenText> {
        let mut folders = self.roots.clone();
        let mut paths = Vec::new();
        while let Some(folder) = folders.pop() {
            let Ok(entries) = std::fs::read_dir(folder) else { continue };
            for path in entries.flatten().map(|entry| entry.path()) {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                if path.is_dir() && !path.is_symlink() && !name.starts_with('.') && name != "target" {
                    folders.push(path);
                } else if name.ends_with(".esl") && paths.len() < MAX_FILES {
                    paths.push(path);
                }
            }
        }
        paths.sort();
        let mut texts: Vec<OpenText> = paths.iter().filter_map(|path| self.load(path)).collect();
        let others = self.texts.values().filter(|text| !paths.contains(&text.path()));
        texts.extend(others.cloned());
        texts
    }

    /// Returns the definitions of a global name as `text` sees it, with their places: its own, those of its
    /// modules, or that of the library. The library's builtins have no place.
    pub(super) fn find(&self, text: &OpenText, name: &str) -> Vec<(NameDefinition, Option<Location>)> {
        let named = |text: &OpenText| -> Vec<(NameDefinition, Option<Location>)> {
            let all = definitions(&text.tree).into_iter().filter(|definition| definition.name == name);
            all.map(|found| (found.clone(), Some(text.location(found.name_place)))).collect()
        };
        let own = named(text);
        if !own.is_empty() {
            return own;
        }
        let of_modules: Vec<_> = self.modules(text).iter().flat_map(named).collect();
        if !of_modules.is_empty() {
            return of_modules;
        }
        let located = |found: &LanguageName| {
            let location = found.source.and_then(|source| {
                let (name, text) = esl_stdlib::SOURCES[source];
                let uri = uri_of(&shown_source(name, text)?)?;
                let text = OpenText::new(uri, 0, text.to_owned(), self.unit);
                Some(text.location(found.definition.name_place.clone()))
            });
            (found.definition.clone(), location)
        };
        language().find_all(name).into_iter().map(located).collect()
    }
}
