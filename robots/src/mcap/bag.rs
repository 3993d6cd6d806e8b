//! Files that are read together: one file, or the folder of a bag of rosbag2.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::damage::Damage;
use super::file::{McapFault, McapFile};
use super::info::FileInfo;
use super::order::{McapMessage, McapSelection, OrderedMessages};

/// Greatest number of bytes of a `metadata.yaml`.
const MAX_METADATA: u64 = 1 << 24;

/// Files of MCAP whose messages are one sequence.
pub struct McapBag {
    pub(super) files: Vec<McapFile<BufReader<File>>>,
    paths: Vec<PathBuf>,
}

impl McapBag {
    /// Opens a file, or the folder of a bag of rosbag2.
    ///
    /// # Errors
    /// A file cannot be read at all; the text names it. Damaged parts are not an error: [`McapBag::damage`]
    /// returns them.
    pub fn open(path: &Path) -> Result<McapBag, McapFault> {
        let paths = if path.is_dir() { files_of_folder(path)? } else { vec![path.to_owned()] };
        let mut files = Vec::new();
        for path in &paths {
            let named = |fault: McapFault| McapFault::Other(format!("{}: {fault}", path.display()));
            files.push(McapFile::open(path).map_err(named)?);
        }
        Ok(McapBag { files, paths })
    }

    /// Returns the paths of the files, in their order.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Returns what is known of each file.
    pub fn info(&self) -> Vec<FileInfo<'_>> {
        self.files.iter().map(|file| FileInfo(&file.index)).collect()
    }

    /// Returns the damage that was found so far, with the index of its file.
    pub fn damage(&self) -> Vec<(usize, Damage)> {
        let of_file = |(number, file): (usize, &McapFile<_>)| {
            file.index.damage.iter().map(|damage| (number, damage.clone())).collect::<Vec<_>>()
        };
        self.files.iter().enumerate().flat_map(of_file).collect()
    }

    /// Returns the earliest and the latest time of a message, in nanoseconds since 1970.
    pub fn times(&self) -> Option<(u64, u64)> {
        let times = || self.files.iter().filter_map(|file| file.index.times);
        Some((times().map(|(first, _)| first).min()?, times().map(|(_, last)| last).max()?))
    }

    /// Returns the messages of a selection, in the order of their times.
    pub fn messages(&mut self, selection: McapSelection) -> BagMessages<'_> {
        let order = self.ordered(selection);
        BagMessages { bag: self, order }
    }

    pub(super) fn ordered(&self, selection: McapSelection) -> OrderedMessages {
        OrderedMessages::new(&self.files, selection)
    }
}

/// The messages of a bag, in the order of their times.
pub struct BagMessages<'a> {
    bag: &'a mut McapBag,
    order: OrderedMessages,
}

impl Iterator for BagMessages<'_> {
    type Item = Result<McapMessage, McapFault>;

    fn next(&mut self) -> Option<Self::Item> {
        self.order.next(&mut self.bag.files).transpose()
    }
}

/// Returns the files of a bag of rosbag2, as its `metadata.yaml` lists them; without one, all in the folder.
fn files_of_folder(folder: &Path) -> Result<Vec<PathBuf>, McapFault> {
    let list = folder.join("metadata.yaml");
    let names = match fs::metadata(&list) {
        Ok(found) if found.len() > MAX_METADATA => {
            let text = format!("{}: it has more than {MAX_METADATA} bytes", list.display());
            return Err(McapFault::Other(text));
        }
        Ok(_) => listed(&fs::read_to_string(&list)?)
            .map_err(|fault| McapFault::Other(format!("{}: {fault}", list.display())))?,
        Err(_) => in_folder(folder)?,
    };
    if names.is_empty() {
        return Err(McapFault::Other(format!("{}: the folder has no file `.mcap`", folder.display())));
    }
    let whole = folder.canonicalize()?;
    let mut paths = Vec::new();
    for name in names {
        // Old bags list their files with the folder.
        let name = Path::new(&name).file_name().map_or(name.clone(), |base| base.to_string_lossy().into());
        let path = folder.join(&name);
        // A right to the folder is none to what its links lead to.
        let is_inside = path.canonicalize().is_ok_and(|found| found.starts_with(&whole));
        if !is_inside {
            let text = format!("{}: the bag has no file `{name}`, which it lists", folder.display());
            return Err(McapFault::Other(text));
        }
        paths.push(path);
    }
    Ok(paths)
}

fn in_folder(folder: &Path) -> Result<Vec<String>, McapFault> {
    let mut names: Vec<String> =
        fs::read_dir(folder)?.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.retain(|name| Path::new(name).extension().is_some_and(|extension| extension == "mcap"));
    names.sort();
    Ok(names)
}

/// Returns the names under `relative_file_paths` in a `metadata.yaml`.
fn listed(text: &str) -> Result<Vec<String>, McapFault> {
    let value = |line: &str, key: &str| {
        let value = line.trim().strip_prefix(key)?.trim();
        Some(value.trim_matches(['"', '\'']).to_owned())
    };
    let storage = text.lines().find_map(|line| value(line, "storage_identifier:"));
    if let Some(storage) = storage.filter(|storage| storage != "mcap") {
        let text = format!("the bag is stored as `{storage}`: `ros2 bag convert` makes MCAP of it");
        return Err(McapFault::Other(text));
    }
    let mut lines = text.lines().skip_while(|line| line.trim() != "relative_file_paths:");
    if lines.next().is_none() {
        return Err(McapFault::Other("expected `relative_file_paths:`".into()));
    }
    let names = lines.map_while(|line| value(line, "- "));
    Ok(names.filter(|name| !name.is_empty()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_bag_are_those_of_its_list() {
        let text = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  \
                    relative_file_paths:\n    - a_0.mcap\n    - \"a_1.mcap\"\n  compression_format: \"\"\n";
        assert_eq!(listed(text).ok(), Some(vec!["a_0.mcap".into(), "a_1.mcap".into()]));
        let other = text.replace("mcap\n  relative", "sqlite3\n  relative");
        assert!(listed(&other).is_err_and(|fault| fault.to_string().contains("`sqlite3`")));
        assert!(listed("version: 9").is_err());
    }
}
