//! The folders in which modules are found.

use std::path::{Path, PathBuf};

use esl_bytecode::compile::Required;
use esl_bytecode::file;
use esl_bytecode::span::SourceId;
use esl_bytecode::verify::verify;
use esl_compiler::reader::decode;

/// The variable of the environment that names further folders, separated as in `PATH`.
pub const VARIABLE: &str = "ESL_LIBRARY";

/// Folders, in the order in which they are looked through.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Library {
    folders: Vec<PathBuf>,
}

impl Library {
    /// No folders.
    pub fn none() -> Library {
        Library::default()
    }

    /// The folders of these files, which see what lies beside them; then the given folders; then those of the environment.
    pub fn new<'a>(files: impl IntoIterator<Item = &'a Path>, folders: &[PathBuf]) -> Library {
        let mut library = Library::none();
        for file in files {
            let folder = file.parent().filter(|_| file.as_os_str() != "-").unwrap_or(Path::new(""));
            library.add(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        }
        for folder in folders {
            library.add(folder);
        }
        for folder in std::env::split_paths(&std::env::var_os(VARIABLE).unwrap_or_default()) {
            if !folder.as_os_str().is_empty() {
                library.add(&folder);
            }
        }
        library
    }

    fn add(&mut self, folder: &Path) {
        if !self.folders.iter().any(|known| known == folder) {
            self.folders.push(folder.to_path_buf());
        }
    }

    /// The folders.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// The module of this name, for a compilation: its source, or else the compiled file, in the first folder that has one of
    /// them.
    ///
    /// # Errors
    /// A text that says why there is none.
    pub fn find(&self, name: &str) -> Result<Required, String> {
        if name.is_empty() || name.starts_with('/') || name.contains("..") {
            return Err("expected the name of a file, without its type".into());
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
        let folders: Vec<String> =
            self.folders.iter().map(|folder| format!("`{}`", folder.display())).collect();
        match folders.is_empty() {
            true => Err("there are no folders to look into".into()),
            false => Err(format!("there is no `{name}.esl` in {}", folders.join(", "))),
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("`{}` cannot be read: {error}", path.display()))
}

fn read_source(path: &Path) -> Result<Required, String> {
    let text = decode(SourceId(0), read(path)?)
        .map_err(|diagnostic| format!("`{}`: {}", path.display(), diagnostic.message))?;
    let name = path.strip_prefix(".").unwrap_or(path).display().to_string();
    Ok(Required::Source { name, text: text.into() })
}

fn read_compiled(path: &Path) -> Result<Required, String> {
    let refused = |reason: String| format!("`{}` is no sound program: {reason}", path.display());
    let module = file::read(&read(path)?).map_err(|error| refused(error.to_string()))?;
    verify(&module).map_err(|error| refused(error.to_string()))?;
    Ok(Required::Compiled(Box::new(module)))
}
