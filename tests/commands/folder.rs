//! Files for one test.

use std::path::{Path, PathBuf};

/// A folder of its own for one test, empty at first.
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// Creates the folder of the test with this name, which no other test has.
    pub(crate) fn new(test: &str) -> Folder {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("commands").join(test);
        if path.exists() {
            std::fs::remove_dir_all(&path).expect("the folder of an earlier run can be removed");
        }
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Folder(path)
    }

    /// Creates the folder with these files in it: their names and texts.
    pub(crate) fn with(test: &str, files: &[(&str, &str)]) -> Folder {
        let folder = Folder::new(test);
        for (name, text) in files {
            folder.file(name, text);
        }
        folder
    }

    /// Returns the path of the folder.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    /// Returns the path of `name` in the folder, as an argument.
    pub(crate) fn join(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// Writes a file, in a subfolder if its name says so, and returns its path.
    pub(crate) fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.0.join(name);
        let folder = path.parent().expect("it lies in the folder");
        std::fs::create_dir_all(folder).expect("a folder can be made");
        std::fs::write(&path, content).expect("a file can be written");
        path.display().to_string()
    }
}
