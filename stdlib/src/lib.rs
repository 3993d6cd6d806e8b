//! The ESL library, written in ESL, as a compiled image.
//!
//! The build step compiles the files of this package to one module, which is embedded in every executable. A
//! machine maps it, and decodes a function at its first call.
#![forbid(unsafe_code)]

use esl_bytecode::file::{ImageBytes, ModuleImage};
use esl_bytecode::symbol::{ESL_PACKAGE, USER_PACKAGE};
use esl_vm::vm::Vm;

/// The image: the bytes of an `.eslb` file.
pub static IMAGE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/image.eslb"));

/// Loads the library into a machine that has none.
///
/// # Errors
/// Returns a text if the machine's memory limit leaves no room for the library.
pub fn load(machine: &mut Vm) -> Result<(), String> {
    let image = ModuleImage::open_trusted(ImageBytes::Static(IMAGE)).map_err(|error| error.to_string())?;
    let no_room = "there is no memory for the library";
    machine.enter_package(ESL_PACKAGE).map_err(|_| no_room)?;
    let functions = machine.open_image(image).map_err(|error| error.to_string())?;
    machine.run_toplevel(functions, u64::MAX).map_err(|error| error.to_string())?;
    machine.enter_package(USER_PACKAGE).map_err(|_| no_room)?;
    machine.seal();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_forms_run_when_a_machine_is_made() {
        let image = ModuleImage::open_trusted(ImageBytes::Static(IMAGE)).expect("the image is sound");
        let count = image.toplevel().expect("the image is sound").len();
        assert!(
            count <= 16,
            "{count} forms of the library run at each start; `esl_vm::load::prepare` notes plain definitions"
        );
    }
}
