//! The ESL library, written in ESL, as a compiled image.
//!
//! The build step compiles the files of this package to one module, which is embedded in every executable. A
//! machine maps it, and decodes a function at its first call.
#![forbid(unsafe_code)]

use std::fmt;

use esl_bytecode::file::{ImageBytes, ModuleImage};
use esl_bytecode::symbol::{ESL_PACKAGE, USER_PACKAGE};
use esl_vm::load::LoadError;
use esl_vm::run::CallError;
use esl_vm::vm::Vm;

/// The image: the bytes of an `.eslb` file.
pub static IMAGE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/image.eslb"));

/// The texts of the library, in the order in which they are loaded: the names of the files, as backtraces and
/// diagnostics have them, and what is in them.
pub static SOURCES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/sources.rs"));

/// Reason why a machine does not get the library. With an intact image, that is want of memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StdlibError {
    /// The image was not loaded.
    Image(LoadError),
    /// A top-level form of the library did not return.
    Toplevel(CallError),
}

impl fmt::Display for StdlibError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StdlibError::Image(error) => write!(f, "the library cannot be loaded: {error}"),
            StdlibError::Toplevel(error) => write!(f, "the library cannot be started: {error}"),
        }
    }
}

impl std::error::Error for StdlibError {}

/// Loads the library into a machine that has none.
///
/// # Errors
/// [`StdlibError`], if the machine's limit of memory leaves no room for the library.
pub fn load(machine: &mut Vm) -> Result<(), StdlibError> {
    let image = ModuleImage::open_trusted(ImageBytes::Static(IMAGE));
    let image = image.map_err(|error| StdlibError::Image(error.into()))?;
    let no_room = |error| StdlibError::Image(LoadError::Alloc(error));
    machine.enter_package(ESL_PACKAGE).map_err(no_room)?;
    let functions = machine.open_image(image).map_err(StdlibError::Image)?;
    machine.run_toplevel(functions, u64::MAX).map_err(StdlibError::Toplevel)?;
    machine.enter_package(USER_PACKAGE).map_err(no_room)?;
    machine.seal();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::builtin::BUILTINS;

    #[test]
    fn few_forms_run_when_a_machine_is_made() {
        let image = ModuleImage::open_trusted(ImageBytes::Static(IMAGE)).expect("the image is sound");
        let count = image.toplevel().expect("the image is sound").len();
        assert!(
            count <= 9,
            "{count} forms of the library run at each start; `esl_vm::load::prepare` notes plain definitions"
        );
    }

    #[test]
    fn each_name_is_defined_once() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut places = std::collections::BTreeMap::<String, Vec<String>>::new();
        for file in std::fs::read_dir(folder).expect("the folder can be read") {
            let path = file.expect("the folder can be read").path();
            if path.extension().is_none_or(|extension| extension != "esl") {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("the file can be read");
            let names = text.lines().filter_map(|line| {
                let rest = line.strip_prefix("(defun ").or_else(|| line.strip_prefix("(defmacro "))?;
                rest.split([' ', ')']).next().filter(|name| !name.starts_with('('))
            });
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            names.for_each(|name| places.entry(name.to_owned()).or_default().push(file.clone()));
        }
        let defined: std::collections::BTreeSet<String> = places.keys().cloned().collect();
        let twice: Vec<_> = places.into_iter().filter(|(_, files)| files.len() > 1).collect();
        assert!(twice.is_empty(), "the later definition replaces the earlier one: {twice:?}");
        let builtins = BUILTINS.iter().map(|builtin| builtin.name.to_lowercase());
        let hidden: Vec<_> = builtins.filter(|name| defined.contains(name)).collect();
        assert!(hidden.is_empty(), "a builtin takes the place of the definition: {hidden:?}");
    }
}
