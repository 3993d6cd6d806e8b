//! Source of an agent's program, which a host with another version of the machine reads again.

use std::fs;
use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl::program::{self, Modules, Program, Source};
use esl_replay::RunSetup;
use esl_vm::vm::Config;
use serde_json::{Value, json};

use super::error::AgentError;

/// The file of an agent's program, and the settings with which it begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AgentOrigin {
    /// Source or bytecode file, whose path does not depend on the folder of the process.
    pub file: PathBuf,
    /// Folders of modules, beside that of the file.
    pub library: Vec<PathBuf>,
    /// Most memory for objects.
    pub memory: usize,
    /// Seed of the choices that the language leaves open.
    pub seed: u64,
}

fn origin_file(agent: &Path) -> PathBuf {
    agent.join("origin")
}

impl AgentOrigin {
    /// Returns the path on which the modules of the program are.
    pub fn path(&self) -> ModulePath {
        ModulePath::new([self.file.as_path()], &self.library)
    }

    /// Returns the settings of a run that begins.
    pub fn setup(&self) -> RunSetup {
        let path = self.path();
        let config = Config { memory: self.memory, seed: self.seed, ..Config::default() };
        let folders = path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
        RunSetup { config, folders, program_file: path.program_file(), ..RunSetup::default() }
    }

    /// Reads the program as it is now.
    ///
    /// # Errors
    /// [`AgentError::Program`].
    pub(crate) fn program(&self) -> Result<Program, AgentError> {
        let refused = |reason: String| AgentError::Program(self.file.clone(), reason);
        let bytes = fs::read(&self.file).map_err(|error| refused(error.to_string()))?;
        if bytes.starts_with(&esl_bytecode::file::MAGIC) {
            return Program::from_bytes(&bytes).map_err(|error| refused(error.to_string()));
        }
        let text = String::from_utf8(bytes).map_err(|error| refused(error.to_string()))?;
        let source = Source::new(self.file.to_string_lossy(), text);
        let compiled = program::compile_with(&[source], &self.path(), Modules::Inside);
        compiled.program.ok_or_else(|| {
            let first = compiled.diagnostics.first().map(|diagnostic| diagnostic.message.clone());
            refused(first.unwrap_or_else(|| "it has errors".into()))
        })
    }

    /// Notes it in the folder of an agent.
    pub(crate) fn note(&self, agent: &Path) -> std::io::Result<()> {
        let library: Vec<_> = self.library.iter().map(|folder| folder.to_string_lossy()).collect();
        let file = self.file.to_string_lossy();
        let noted = json!({ "file": file, "library": library, "memory": self.memory, "seed": self.seed });
        fs::write(origin_file(agent), noted.to_string())
    }

    /// Returns that of an agent, if it was noted.
    pub(crate) fn of(agent: &Path) -> Option<AgentOrigin> {
        let noted: Value = serde_json::from_str(&fs::read_to_string(origin_file(agent)).ok()?).ok()?;
        let folder = |folder: &Value| folder.as_str().map(PathBuf::from);
        Some(AgentOrigin {
            file: folder(&noted["file"])?,
            library: noted["library"].as_array()?.iter().map(folder).collect::<Option<_>>()?,
            memory: usize::try_from(noted["memory"].as_u64()?).ok()?,
            seed: noted["seed"].as_u64()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_read_as_it_was_noted() {
        let folder = std::env::temp_dir().join(format!("esl-origin-{}", std::process::id()));
        fs::create_dir(&folder).expect("it is new");
        let (file, library) = (folder.join("käfer \"1\".esl"), vec!["/lib".into(), "/a b".into()]);
        let origin = AgentOrigin { file, library, memory: 64 << 20, seed: u64::MAX };
        assert_eq!(AgentOrigin::of(&folder), None);
        origin.note(&folder).expect("there is room");
        assert_eq!(AgentOrigin::of(&folder).as_ref(), Some(&origin));
        assert!(matches!(origin.program(), Err(AgentError::Program(..))));
        for text in ["(print", "ESLB\r\n\u{1a}\n", "(print 1)"] {
            fs::write(&origin.file, text).expect("there is room");
            assert_eq!(origin.program().is_ok(), text == "(print 1)", "{text}");
        }
        fs::write(origin_file(&folder), "{\"file\": 3}").expect("there is room");
        assert_eq!(AgentOrigin::of(&folder), None);
        fs::remove_dir_all(&folder).expect("it can be removed");
    }
}
