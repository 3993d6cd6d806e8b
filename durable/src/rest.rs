//! A note beside the journal of a run that rests: when it goes on, without reading the journal.
//!
//! Guarantees: a note that does not fit the journal has no effect. It names the last journal and its length,
//! and each process that goes on with the run makes that longer first. So the note needs no sync, and no
//! removal.

use std::fs;
use std::path::{Path, PathBuf};

use super::DurableRun;
use super::generations::journal_file;

/// A run that no process has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunRest {
    /// It sleeps until this time of day, in nanoseconds since 1970, or until a message comes.
    Asleep(Option<i64>),
    /// It has ended with this status.
    Ended(u8),
}

fn note_file(folder: &Path) -> PathBuf {
    folder.join("rest")
}

impl RunRest {
    /// Reads the note in the folder of a run; `None` if there is none that fits the journal.
    pub fn read(folder: &Path) -> Option<RunRest> {
        let text = fs::read_to_string(note_file(folder)).ok()?;
        let words: Vec<&str> = text.strip_suffix(" .\n")?.split(' ').collect();
        let [number, length, rest @ ..] = words.as_slice() else { return None };
        let journal = fs::metadata(journal_file(folder, number.parse().ok()?)).ok()?;
        if journal.len() != length.parse::<u64>().ok()? {
            return None;
        }
        match rest {
            ["asleep"] => Some(RunRest::Asleep(None)),
            ["asleep", time] => time.parse().ok().map(|time| RunRest::Asleep(Some(time))),
            ["ended", status] => status.parse().ok().map(RunRest::Ended),
            _ => None,
        }
    }

    /// Writes the note for a journal of this number and length.
    fn write(self, folder: &Path, number: u64, length: u64) {
        let rest = match self {
            RunRest::Asleep(None) => "asleep".into(),
            RunRest::Asleep(Some(time)) => format!("asleep {time}"),
            RunRest::Ended(status) => format!("ended {status}"),
        };
        // Without the note the journal is read.
        drop(fs::write(note_file(folder), format!("{number} {length} {rest} .\n")));
    }
}

impl DurableRun {
    /// Notes how the run rests from here on.
    pub(super) fn note_rest(&self, rest: RunRest) {
        if let Some(folder) = &self.folder {
            let (number, length) = self.log.place();
            rest.write(folder.path(), number, length);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_has_an_effect_only_with_its_journal() {
        let folder = std::env::temp_dir().join(format!("esl-rest-{}", std::process::id()));
        fs::create_dir(&folder).expect("it is new");
        let journal = |number, text: &str| {
            fs::write(journal_file(&folder, number), text).expect("there is room");
        };
        journal(0, "12345");
        assert_eq!(RunRest::read(&folder), None);
        for rest in [RunRest::Asleep(None), RunRest::Asleep(Some(-7)), RunRest::Ended(3)] {
            rest.write(&folder, 0, 5);
            assert_eq!(RunRest::read(&folder), Some(rest));
        }
        journal(0, "123456");
        assert_eq!(RunRest::read(&folder), None);
        RunRest::Ended(0).write(&folder, 1, 2);
        assert_eq!(RunRest::read(&folder), None);
        journal(1, "12");
        assert_eq!(RunRest::read(&folder), Some(RunRest::Ended(0)));
        for torn in ["", "1 2 ended 0", "1 2 ended .\n", "1 2 asleep x .\n", "1 .\n", "x 2 asleep .\n"] {
            fs::write(note_file(&folder), torn).expect("there is room");
            assert_eq!(RunRest::read(&folder), None, "{torn}");
        }
        fs::remove_dir_all(&folder).expect("it can be removed");
    }
}
