//! The ESL library, written in ESL, as a compiled image.
//!
//! The build step compiles the files of this package to a module, which is embedded in every executable. A
//! machine maps it, and decodes a function at its first call. The functions that serve operators are a second
//! module, which the machine gets only if its run is served.
#![forbid(unsafe_code)]

use std::fmt;

use esl_bytecode::file::{self, ImageBytes, ModuleImage, ReadError};
use esl_bytecode::module::Module;
use esl_bytecode::symbol::{ESL_PACKAGE, USER_PACKAGE};
use esl_vm::load::LoadError;
use esl_vm::run::CallError;
use esl_vm::vm::Vm;

/// The image of the library: the bytes of an `.eslb` file.
static LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/library.eslb"));

/// The image of the part for operators, which a machine has only if its run is served to operators.
static OPERATORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/operators.eslb"));

/// Names of the images in a machine.
const LIBRARY_NAME: &str = "library";
const OPERATORS_NAME: &str = "operators";

/// The texts of the library, in the order in which they are loaded: the names of the files, as backtraces and
/// diagnostics have them, and what is in them. Those of the part for operators are the last.
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
    open(machine, LIBRARY_NAME, LIBRARY)
}

/// Loads the functions that serve operators into a machine that has the library, unless it has them.
///
/// # Errors
/// [`StdlibError`], if the machine's limit of memory leaves no room for them.
pub fn load_operators(machine: &mut Vm) -> Result<(), StdlibError> {
    if has_operators(machine) { Ok(()) } else { open(machine, OPERATORS_NAME, OPERATORS) }
}

/// Returns whether a machine has the functions that serve operators.
pub fn has_operators(machine: &Vm) -> bool {
    machine.image_names().any(|name| name == OPERATORS_NAME)
}

/// Returns a checksum of all images.
pub fn checksum() -> u32 {
    let of = |image| file::checksum(image).unwrap_or(0);
    of(LIBRARY) ^ of(OPERATORS).rotate_left(16)
}

/// Returns the library that every machine has, as a whole.
///
/// # Errors
/// [`ReadError`], if the image is damaged.
pub fn module() -> Result<Module, ReadError> {
    ModuleImage::open_trusted(ImageBytes::Static(LIBRARY))?.to_module()
}

fn open(machine: &mut Vm, name: &'static str, bytes: &'static [u8]) -> Result<(), StdlibError> {
    let image = ModuleImage::open_trusted(ImageBytes::Static(bytes));
    let image = image.map_err(|error| StdlibError::Image(error.into()))?;
    let no_room = |error| StdlibError::Image(LoadError::Alloc(error));
    machine.enter_package(ESL_PACKAGE).map_err(no_room)?;
    let functions = machine.open_image(name, image).map_err(StdlibError::Image)?;
    if !functions.is_nil() {
        machine.run_toplevel(functions, u64::MAX).map_err(StdlibError::Toplevel)?;
    }
    machine.enter_package(USER_PACKAGE).map_err(no_room)?;
    machine.seal();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::builtin::BUILTINS;

    fn forms_at_start(image: &'static [u8]) -> usize {
        let image = ModuleImage::open_trusted(ImageBytes::Static(image)).expect("the image is sound");
        image.toplevel().expect("the image is sound").len()
    }

    #[test]
    fn few_forms_run_when_a_machine_is_made() {
        let count = forms_at_start(LIBRARY);
        assert!(
            count <= 9,
            "{count} forms of the library run at each start; `esl_vm::load::prepare` notes plain definitions"
        );
    }

    /// A form would make a task, and the numbers of a program's tasks would differ between runs with and
    /// without operators.
    #[test]
    fn no_form_runs_when_the_part_for_operators_is_loaded() {
        assert_eq!(forms_at_start(OPERATORS), 0);
    }

    #[test]
    fn each_name_is_defined_once() {
        let mut places = std::collections::BTreeMap::<String, Vec<&str>>::new();
        for (file, text) in SOURCES {
            let names = text.lines().filter_map(|line| {
                let rest = line.strip_prefix("(defun ").or_else(|| line.strip_prefix("(defmacro "))?;
                rest.split([' ', ')']).next().filter(|name| !name.starts_with('('))
            });
            names.for_each(|name| places.entry(name.to_owned()).or_default().push(*file));
        }
        let defined: std::collections::BTreeSet<String> = places.keys().cloned().collect();
        let twice: Vec<_> = places.into_iter().filter(|(_, files)| files.len() > 1).collect();
        assert!(twice.is_empty(), "the later definition replaces the earlier one: {twice:?}");
        let builtins = BUILTINS.iter().map(|builtin| builtin.name.to_lowercase());
        let hidden: Vec<_> = builtins.filter(|name| defined.contains(name)).collect();
        assert!(hidden.is_empty(), "a builtin takes the place of the definition: {hidden:?}");
    }
}
