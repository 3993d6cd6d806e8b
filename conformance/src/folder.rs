//! Files for one test.

use std::path::{Path, PathBuf};

/// Returns the folder in which tests make files: that of cargo for tests of packages.
///
/// # Panics
/// Never, as long as cargo runs the test: its program is in `target/PROFILE/deps`.
pub fn temporary() -> PathBuf {
    let program = std::env::current_exe().expect("the program of a test has a path");
    program.ancestors().nth(3).expect("it is in `target/PROFILE/deps`").join("tmp")
}

/// A folder of its own for one test, empty at first.
pub struct Folder(PathBuf);

impl Folder {
    /// Creates the folder of the test with this name, which no other test has.
    ///
    /// # Panics
    /// As all functions here, if the system refuses it.
    pub fn new(test: &str) -> Folder {
        let path = temporary().join("commands").join(test);
        if path.exists() {
            std::fs::remove_dir_all(&path).expect("the folder of an earlier run can be removed");
        }
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Folder(path)
    }

    /// Creates the folder with these files in it: their names and texts.
    pub fn with(test: &str, files: &[(&str, &str)]) -> Folder {
        let folder = Folder::new(test);
        for (name, text) in files {
            folder.file(name, text);
        }
        folder
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Returns the path of `name` in the folder, as an argument.
    pub fn join(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// Writes a file, in a subfolder if its name says so, and returns its path.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.0.join(name);
        let folder = path.parent().expect("it lies in the folder");
        std::fs::create_dir_all(folder).expect("a folder can be made");
        std::fs::write(&path, content).expect("a file can be written");
        path.display().to_string()
    }
}
