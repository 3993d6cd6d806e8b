//! The folders in which `require` looks for modules.
//!
//! ```
//! use std::path::Path;
//!
//! use esl::module_path::{ModuleError, ModulePath};
//!
//! let path = ModulePath::new([Path::new("plant/main.esl")], &["shared".into()]);
//! assert_eq!(path.folders()[..2], [Path::new("plant"), Path::new("shared")]);
//! let missing = path.find("no-such-module").expect_err("the file does not exist");
//! assert!(matches!(missing, ModuleError::NotFound { .. }));
//! ```

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(feature = "world")]
use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::compile::Required;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::file;
use esl_bytecode::span::SourceId;
use esl_bytecode::verify::verify;
use esl_compiler::reader::decode;
use esl_compiler::similar::is_like;
use esl_host::Rights;
use esl_vm::load::LoadError;

#[cfg(feature = "world")]
pub use esl_world::add_modules;

/// The environment variable that names further folders, separated as in `PATH`.
pub const VARIABLE: &str = "ESL_LIBRARY";

/// Folders, in the order in which they are searched.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModulePath {
    folders: Vec<PathBuf>,
    /// The file of the program, if it is one.
    program: Option<PathBuf>,
}

/// Reason why a module is not found, or cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum ModuleError {
    /// The name is not one that a file in the folders can have.
    InvalidName,
    /// No folder has such a file.
    NotFound {
        /// Name of the module.
        name: String,
        /// Folders that were searched.
        folders: Vec<PathBuf>,
        /// Name of a module that may be meant.
        similar: Option<String>,
    },
    /// The module belongs to a feature of the commands, which this program is built without.
    NotBuilt {
        /// Name of the module.
        name: String,
        /// Name of the feature.
        feature: &'static str,
    },
    /// The file cannot be read.
    Unreadable(PathBuf, std::io::Error),
    /// The file is not text in UTF-8.
    NotText(PathBuf, Box<Diagnostic>),
    /// The compiled file is damaged, was made by another version, or breaks a rule of the verifier.
    Refused(PathBuf, LoadError),
}

impl fmt::Display for ModuleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ModuleError::InvalidName => f.write_str("expected the name of a file, without its type"),
            ModuleError::NotFound { folders, .. } if folders.is_empty() => {
                f.write_str("no folders to search: name some with `--library`")
            }
            ModuleError::NotFound { name, folders, similar } => {
                let folders: Vec<String> =
                    folders.iter().map(|folder| format!("`{}`", folder.display())).collect();
                write!(f, "`{name}.esl` is not in {}", folders.join(", "))?;
                similar.as_ref().map_or(Ok(()), |similar| write!(f, "; did you mean `{similar}`?"))
            }
            ModuleError::NotBuilt { name, feature } => write!(
                f,
                "`{name}` is a module of the feature `{feature}`, which this program is built without: \
                 type `cargo build --release --features {feature}`"
            ),
            ModuleError::Unreadable(path, error) => {
                write!(f, "`{}` cannot be read: {error}", path.display())
            }
            ModuleError::NotText(path, diagnostic) => {
                write!(f, "`{}`: {}", path.display(), diagnostic.message)
            }
            ModuleError::Refused(path, error) => {
                write!(f, "`{}` is not a valid program: {error}", path.display())
            }
        }
    }
}

impl std::error::Error for ModuleError {}

impl ModulePath {
    /// Returns a path without folders.
    pub fn none() -> ModulePath {
        ModulePath::default()
    }

    /// Returns the folders of these files, so that modules beside them are found; then `folders`; then those
    /// of [`VARIABLE`].
    pub fn new<'a>(files: impl IntoIterator<Item = &'a Path>, folders: &[PathBuf]) -> ModulePath {
        let mut path = ModulePath::none();
        let files: Vec<&Path> = files.into_iter().collect();
        if let [file] = files[..] {
            path.program = Some(file.to_path_buf()).filter(|file| file.as_os_str() != "-");
        }
        for file in files {
            let folder = file.parent().filter(|_| file.as_os_str() != "-").unwrap_or(Path::new(""));
            path.add(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        }
        for folder in folders {
            path.add(folder);
        }
        for folder in std::env::split_paths(&std::env::var_os(VARIABLE).unwrap_or_default()) {
            if !folder.as_os_str().is_empty() {
                path.add(&folder);
            }
        }
        path
    }

    fn add(&mut self, folder: &Path) {
        if !self.folders.iter().any(|known| known == folder) {
            self.folders.push(folder.to_path_buf());
        }
    }

    /// Returns the name of the file of the program as it was given, and its name from the root on after all
    /// links; nothing if the program is not one file.
    pub fn program_file(&self) -> Vec<String> {
        let Some(file) = &self.program else { return Vec::new() };
        let found = file.canonicalize().unwrap_or_else(|_| file.clone());
        [file, &found].map(|path| path.to_string_lossy().into_owned()).to_vec()
    }

    /// Returns the folders.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Returns `rights`, with the right to read the modules in these folders.
    #[must_use]
    pub fn with_rights(&self, rights: Rights) -> Rights {
        self.folders.iter().fold(rights, |rights, folder| rights.with_modules(folder.to_string_lossy()))
    }

    /// Reads the module of this name for a compilation: its source, or else the compiled file, from the first
    /// folder that has either; otherwise one that comes with the machine.
    ///
    /// # Errors
    /// [`ModuleError`].
    pub fn find(&self, name: &str) -> Result<Required, ModuleError> {
        if name.is_empty() || name.starts_with('/') || name.contains("..") {
            return Err(ModuleError::InvalidName);
        }
        for folder in &self.folders {
            let source = folder.join(format!("{name}.esl"));
            if source.is_file() {
                return read_source(&source);
            }
            let compiled = folder.join(format!("{name}.eslb"));
            if compiled.is_file() {
                return read_compiled(&compiled);
            }
        }
        #[cfg(feature = "world")]
        if let Some(text) = esl_world::module(name) {
            let name = format!("{MODULE_SOURCES}{}.esl", name.to_lowercase());
            return Ok(Required::Source { name, text: text.into() });
        }
        #[cfg(feature = "world")]
        if let Some(feature) = esl_world::feature_of_module(name) {
            return Err(ModuleError::NotBuilt { name: name.to_lowercase(), feature });
        }
        let similar = self.names().into_iter().find(|known| is_like(known, &name.to_lowercase()));
        Err(ModuleError::NotFound { name: name.into(), folders: self.folders.clone(), similar })
    }

    /// Returns the text of the module of this name, if [`find`](Self::find) finds its source.
    pub fn source_of(&self, name: &str) -> Option<Arc<str>> {
        match self.find(name) {
            Ok(Required::Source { text, .. }) => Some(text),
            _ => None,
        }
    }

    /// Returns the names of the modules that are there, sorted: of those in the folders themselves, and of
    /// those that come with the machine.
    pub fn names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for entry in self.folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten() {
            let path = entry.map(|entry| entry.path()).unwrap_or_default();
            let is_module =
                path.extension().is_some_and(|extension| extension == "esl" || extension == "eslb");
            if let Some(name) = path.file_stem().and_then(|name| name.to_str()).filter(|_| is_module) {
                names.push(name.to_owned());
            }
        }
        #[cfg(feature = "world")]
        names.extend(esl_world::module_names().map(str::to_owned));
        names.sort_unstable();
        names.dedup();
        names
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ModuleError> {
    std::fs::read(path).map_err(|error| ModuleError::Unreadable(path.into(), error))
}

fn read_source(path: &Path) -> Result<Required, ModuleError> {
    let text = decode(SourceId(0), read(path)?)
        .map_err(|diagnostic| ModuleError::NotText(path.into(), diagnostic))?;
    let name = path.strip_prefix(".").unwrap_or(path).display().to_string();
    Ok(Required::Source { name, text: text.into() })
}

fn read_compiled(path: &Path) -> Result<Required, ModuleError> {
    let refused = |error| ModuleError::Refused(path.into(), error);
    let module = file::read(&read(path)?).map_err(|error| refused(error.into()))?;
    verify(&module).map_err(|error| refused(LoadError::Refused(error)))?;
    Ok(Required::Compiled(Box::new(module)))
}

#[cfg(all(test, feature = "world"))]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_is_answered_with_the_one_that_may_be_meant() {
        let said =
            |name: &str| ModulePath::none().find(name).expect_err("there is no such module").to_string();
        let path = ModulePath::new([Path::new("robot.esl")], &[]);
        let error = path.find("jsno").expect_err("there is no such module").to_string();
        assert!(error.ends_with("; did you mean `json`?"), "{error}");
        assert!(!said("no-such-module").contains("did you mean"));
    }

    #[test]
    fn a_module_of_a_feature_that_is_off_says_how_to_have_it() {
        let error = ModulePath::none().find("ros").expect_err("no crate has added it").to_string();
        assert!(error.contains("`robots`") && error.ends_with("--features robots`"), "{error}");
    }
}
