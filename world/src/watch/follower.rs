//! Following a path: the folders that have to be watched for its sake, and the changes that concern it.
//!
//! The system watches files and folders, whatever their names become. So the folder of the path is watched,
//! where the path may get another file; while that folder is missing, the nearest one above it is watched.
//! Folders between the current one and the path are watched too, since they may be replaced as a whole.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use notify::event::{ModifyKind, RenameMode};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};

/// A change of the path or of an entry of it, and its path.
pub(super) type PathChange = (&'static str, PathBuf);

/// The identity of the file that a path denotes at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Identity(u64, u64);

#[cfg(unix)]
fn identity(metadata: &Metadata) -> Identity {
    use std::os::unix::fs::MetadataExt;
    Identity(metadata.dev(), metadata.ino())
}

#[cfg(not(unix))]
fn identity(metadata: &Metadata) -> Identity {
    let made = metadata.created().ok().and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
    Identity(0, made.map_or(0, |time| time.as_nanos() as u64))
}

/// A path that is followed.
pub(super) struct Follower {
    watcher: RecommendedWatcher,
    target: PathBuf,
    /// The current folder, in which all folders on the way to the path are watched.
    base: Option<PathBuf>,
    watched: BTreeSet<PathBuf>,
    /// The identity of the path's file, as far as the program was told.
    known: Option<Identity>,
}

impl Follower {
    /// Begins to follow a path without links, whose changes `watcher` reports.
    ///
    /// # Errors
    /// Nothing is there, or the system does not watch it.
    pub(super) fn new(watcher: RecommendedWatcher, target: PathBuf) -> notify::Result<Follower> {
        let known = Some(identity(&std::fs::metadata(&target)?));
        let base = std::env::current_dir().and_then(|folder| folder.canonicalize()).ok();
        let mut follower = Follower { watcher, target, base, watched: BTreeSet::new(), known };
        for folder in follower.wanted() {
            follower.watcher.watch(&folder, RecursiveMode::NonRecursive)?;
            follower.watched.insert(folder);
        }
        Ok(follower)
    }

    /// Returns the folders that are to be watched.
    fn wanted(&self) -> BTreeSet<PathBuf> {
        let above = || self.target.ancestors().skip(1);
        let mut wanted = BTreeSet::new();
        wanted.extend(above().find(|folder| folder.is_dir()).map(Path::to_path_buf));
        if let Some(base) = self.base.as_ref().filter(|base| self.target.starts_with(base)) {
            let on_the_way = above().take_while(|folder| folder.starts_with(base));
            wanted.extend(on_the_way.filter(|folder| folder.is_dir()).map(Path::to_path_buf));
        }
        if self.target.is_dir() {
            wanted.insert(self.target.clone());
        }
        wanted
    }

    /// Returns whether an event is about the path itself, or a folder on the way to it, and may change what
    /// it stands for.
    pub(super) fn concerns(&self, event: &Event) -> bool {
        let is_structural = matches!(
            event.kind,
            EventKind::Create(_) | EventKind::Remove(_) | EventKind::Modify(ModifyKind::Name(_))
        );
        is_structural && event.paths.iter().any(|path| self.target.starts_with(path))
    }

    /// Returns the changes that an event reports, which does not change what the path stands for.
    pub(super) fn changes(&self, event: &Event) -> Vec<PathChange> {
        let Some(kind) = kind_of(event.kind) else { return Vec::new() };
        let is_ours = |path: &&PathBuf| **path == self.target || path.parent() == Some(&self.target);
        event.paths.iter().filter(is_ours).map(|path| (kind, path.clone())).collect()
    }

    /// Watches what is to be watched after an event that concerns the path. Returns the changes.
    pub(super) fn follow(&mut self, event: &Event) -> Vec<PathChange> {
        for path in &event.paths {
            let is_gone = !matches!(event.kind, EventKind::Create(_));
            if is_gone && self.watched.remove(path) {
                // It may be watched no more, since it is there no more.
                _ = self.watcher.unwatch(path);
            }
        }
        let is_itself = event.paths.contains(&self.target);
        let mut changes = Vec::new();
        if let Some(kind) = kind_of(event.kind).filter(|_| is_itself) {
            // Two watches may report one end.
            let is_end = kind != "CREATED";
            if !is_end || self.known.is_some() {
                changes.push((kind, self.target.clone()));
            }
            self.known = None;
        }
        // Files that are made while the watches are set up are seen in the next round.
        let mut now = self.rearrange();
        for _ in 0..MOST_ROUNDS {
            let next = self.rearrange();
            if next == now {
                break;
            }
            now = next;
        }
        match (self.known, now) {
            (Some(_), None) => changes.push(("DELETED", self.target.clone())),
            (before, Some(_)) if before != now => {
                if changes.last().is_none_or(|(kind, _)| *kind != "CREATED") {
                    changes.push(("CREATED", self.target.clone()));
                }
                // They may have come before the folder was watched.
                let entries = std::fs::read_dir(&self.target).into_iter().flatten().flatten();
                let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
                paths.sort();
                changes.extend(paths.into_iter().map(|path| ("CREATED", path)));
            }
            _ => {}
        }
        self.known = now;
        changes
    }

    /// Sets up the watches. Returns what the path stands for.
    fn rearrange(&mut self) -> Option<Identity> {
        let wanted = self.wanted();
        for folder in self.watched.difference(&wanted) {
            _ = self.watcher.unwatch(folder);
        }
        self.watched.retain(|folder| wanted.contains(folder));
        for folder in wanted {
            // One that is gone again is reported by the folder above it.
            if !self.watched.contains(&folder)
                && self.watcher.watch(&folder, RecursiveMode::NonRecursive).is_ok()
            {
                self.watched.insert(folder);
            }
        }
        std::fs::symlink_metadata(&self.target).ok().map(|metadata| identity(&metadata))
    }
}

/// Most times that the watches are set up for one event, since the path may change meanwhile.
const MOST_ROUNDS: usize = 8;

/// Returns the keyword for a change of a path, if it is one. A path that gets a file by renaming has it from
/// then on, as if it had been made there.
fn kind_of(kind: EventKind) -> Option<&'static str> {
    match kind {
        // It repeats what was reported of each of the two names.
        EventKind::Modify(ModifyKind::Name(RenameMode::Both)) => None,
        EventKind::Create(_) | EventKind::Modify(ModifyKind::Name(RenameMode::To)) => Some("CREATED"),
        EventKind::Modify(ModifyKind::Name(_)) => Some("RENAMED"),
        EventKind::Modify(_) => Some("MODIFIED"),
        EventKind::Remove(_) => Some("DELETED"),
        EventKind::Any | EventKind::Access(_) | EventKind::Other => None,
    }
}
