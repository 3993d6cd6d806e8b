//! Packages of the Python registry for the peers of tests, installed below `target/`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// Returns the Python of the environment with this name, in which `import` imports what `packages` have: the
/// first call installs them. Without a way to install them returns nothing, and says so.
pub(crate) fn python(name: &str, packages: &[&str], import: &str) -> Option<PathBuf> {
    static INSTALLED: Mutex<BTreeMap<String, bool>> = Mutex::new(BTreeMap::new());
    let python = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-venv")).join("bin/python");
    // Whether an environment is complete is stored last, so a panic elsewhere does not corrupt the table.
    let mut installed = INSTALLED.lock().unwrap_or_else(PoisonError::into_inner);
    let is_installed = *installed
        .entry(name.to_owned())
        .or_insert_with(|| has(&python, import) || install(&python, packages, import));
    if !is_installed {
        crate::say_left_out(&format!("{} cannot be installed by python3", packages.join(", ")));
    }
    is_installed.then_some(python)
}

fn has(python: &Path, import: &str) -> bool {
    Command::new(python).args(["-c", import]).output().is_ok_and(|done| done.status.success())
}

fn install(python: &Path, packages: &[&str], import: &str) -> bool {
    let folder = python.ancestors().nth(2).expect("it is in a folder of an environment");
    let venv = Command::new("python3").args(["-m", "venv"]).arg(folder).output();
    if venv.is_ok_and(|done| done.status.success()) {
        let mut pip = Command::new(python);
        drop(pip.args(["-m", "pip", "install", "--quiet", "--timeout", "20"]).args(packages).output());
    }
    has(python, import)
}
