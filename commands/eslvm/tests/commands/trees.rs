//! Behaviour trees: the module `bt` beside py_trees, a library in Python that nobody here has written.
//!
//! The peer needs a package of the Python registry, which the test installs below `target/`. Where that is
//! not possible, the test is left out, and says so.
#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslvm, venv};

const PACKAGE: &str = "py_trees==2.6.0";

/// Trees that are generated, and the seed of their generator.
const TREES: usize = 400;
const SEED: usize = 20;

fn path_of(name: &str) -> PathBuf {
    esl_conformance::root().join("trees/tests").join(name)
}

/// Returns the Python that has the packages; nothing if they cannot be installed.
fn python() -> Option<PathBuf> {
    venv::python("trees", &[PACKAGE], "import py_trees")
}

#[test]
fn leaves_begin_end_and_are_halted_in_the_order_of_py_trees() {
    let Some(python) = python() else { return };
    let folder = Folder::new("trees-py-trees");
    let path = folder.path().to_string_lossy().into_owned();
    let peer = Command::new(python)
        .arg(path_of("peers/py_trees_peer.py"))
        .args([&*path, &TREES.to_string(), &SEED.to_string()])
        .output()
        .expect("the peer can be started");
    assert!(peer.status.success(), "{}", String::from_utf8_lossy(&peer.stderr));
    let expected = String::from_utf8(peer.stdout).expect("the peer writes text");
    let program = std::fs::read_to_string(path_of("programs/orders.esl")).expect("the program can be read");
    let mut command = eslvm(&["run", &format!("--allow-read={path}"), "--clock", "virtual", "-"]);
    let found = process::run(&mut command, format!("{program}(main \"{path}\" {TREES})"));
    let found = found.quiet_output().expect("the program runs");
    let mut number_of_events = 0;
    for (number, (expected, found)) in expected.lines().zip(found.lines()).enumerate() {
        let tree =
            || std::fs::read_to_string(folder.path().join(format!("{number}.xml"))).unwrap_or_default();
        assert_eq!(expected.trim(), found.trim(), "tree {number} of seed {SEED}: {}", tree());
        number_of_events += expected.split(' ').count() - 1;
    }
    assert_eq!(found.lines().count(), TREES);
    assert!(number_of_events > 10 * TREES, "{number_of_events} events");
}
