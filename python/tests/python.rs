//! The tests of the Python package, which are in Python: run by pytest, with the extension module that cargo
//! has built.
//!
//! pytest comes from the Python registry, and is installed below `target/`. Where that is not possible, the
//! tests are left out, and say so.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The package that the tests need.
const PYTEST: &str = "pytest==8.4.2";
/// Packages without which some tests are left out: arrays, checkers of types, notebooks.
const FURTHER_PACKAGES: [&str; 6] =
    ["numpy", "mypy==2.4.1", "pyright[nodejs]==1.1.414", "ipython", "ipykernel", "nbclient"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-venv");
    let python = folder.join("bin/python");
    let imports = |modules: &str| {
        let import = format!("import {modules}");
        Command::new(&python).args(["-c", &import]).output().is_ok_and(|done| done.status.success())
    };
    let install = |packages: &[&str]| {
        let mut pip = Command::new(&python);
        drop(pip.args(["-m", "pip", "install", "--quiet", "--timeout", "20"]).args(packages).output());
    };
    if !imports("pytest") {
        let venv = Command::new("python3").args(["-m", "venv"]).arg(&folder).output();
        if venv.is_ok_and(|done| done.status.success()) {
            install(&[PYTEST]);
        }
    }
    if imports("pytest") && !imports("numpy, mypy, pyright, IPython, ipykernel, nbclient") {
        install(&FURTHER_PACKAGES);
    }
    imports("pytest").then_some(python)
}

/// Returns a folder with the package, as a wheel would install it.
fn package() -> PathBuf {
    let test = std::env::current_exe().expect("the test is a file");
    let library = test.ancestors().skip(1).take(2).map(|folder| folder.join("libesl_python.so"));
    let library =
        library.into_iter().find(|file| file.is_file()).expect("cargo builds the module for its tests");
    let site = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-site");
    let package = site.join("esl");
    std::fs::create_dir_all(&package).expect("it can be made");
    for entry in std::fs::read_dir(root().join("esl")).expect("it can be read").flatten() {
        if entry.path().is_file() {
            std::fs::copy(entry.path(), package.join(entry.file_name())).expect("it can be copied");
        }
    }
    std::fs::copy(library, package.join("_esl.abi3.so")).expect("it can be copied");
    site
}

#[expect(clippy::print_stderr, reason = "a test that is left out says so")]
fn say_left_out(reason: &str) {
    eprintln!("left out: {reason}");
}

#[test]
fn python_gets_what_the_package_promises() {
    let Some(python) = python() else {
        say_left_out(&format!("{PYTEST} cannot be installed by python3"));
        return;
    };
    let run = Command::new(python)
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .arg(root().join("tests"))
        .current_dir(package())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .expect("it is installed");
    assert!(
        run.status.success(),
        "{}\n{}",
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr)
    );
}
