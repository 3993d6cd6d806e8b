//! The facts of a run as a text beside its journal, by which another version of the machine goes on.
//!
//! A journal and a snapshot belong to one version of the machine. The text does not: it has the facts, and
//! the variables of `defdurable`, as plain data. It is written at each pause, and with snapshots unless there
//! are very many facts.
//!
//! ```text
//! facts.esl     the text
//! begin.esl     the same file while a run is begun anew from it: what was done so far is done again
//! earlier/      the files of the run before, with that text
//! ```
//!
//! Guarantees: each file is there whole or not at all. At each moment the folder has the run as it was, the
//! text from which it begins anew, or the new run, whose journal has the text in its first frame.

use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use esl_bytecode::package::Qualifier;
use esl_bytecode::symbol::{KEYWORD_PACKAGE, Symbol};
use esl_compiler::reader::print;
use esl_replay::RecordedError;
use esl_vm::KeptData;
use esl_vm::vm::Vm;

use super::generations::{self, FoundJournals};
use super::resume::wall_clock;
use super::{DurableError, DurableRun, folder};

/// First line of the text.
const HEADER: &str = ";;; esl-facts 1";
/// Last line of the text.
const END: &str = ";;; end";
/// The beginning of a line about a missing thing.
const LEFT_OUT: &str = ";;; left out: ";
/// Most facts that are written with a snapshot, for which the run stands still.
const WITH_SNAPSHOT: usize = 10_000;
/// Most things that are named.
const NAMED: usize = 5;

/// The facts from which a run begins anew.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptFacts {
    /// Number of the facts.
    pub facts: usize,
    /// Number of the variables.
    pub variables: usize,
    /// The variables and facts for which no text stands, with the reasons.
    pub left_out: Vec<String>,
    /// Seconds since they were written.
    pub seconds: f64,
    /// Whether that was at a pause; otherwise it was at a snapshot, and the run went on.
    pub is_pause: bool,
    /// Folder with the files of the run before.
    pub earlier: PathBuf,
    text: String,
}

fn text_file(folder: &Path) -> PathBuf {
    folder.join("facts.esl")
}

fn begun_file(folder: &Path) -> PathBuf {
    folder.join("begin.esl")
}

fn earlier(folder: &Path) -> PathBuf {
    folder.join("earlier")
}

/// Returns the text of the facts and variables.
fn text_of(kept: &KeptData, wall: i64, is_pause: bool) -> String {
    let mut packages: Vec<String> = Vec::new();
    let mut entries = String::new();
    let mut entry = |kind: &str, data: &[String]| {
        // A write to a text cannot fail.
        _ = writeln!(entries, "(:{kind} {})", data.join(" "));
    };
    let seen = std::cell::RefCell::new(std::collections::BTreeSet::new());
    let qualifier = |symbol: &Symbol| match symbol.package() {
        None => Qualifier::Uninterned,
        Some(package) if &**package == KEYWORD_PACKAGE => Qualifier::Keyword,
        Some(package) if &**package == "ESL-USER" => Qualifier::None,
        Some(package) => {
            seen.borrow_mut().insert(package.to_string());
            Qualifier::Internal(package.clone())
        }
    };
    for (name, value) in &kept.variables {
        let name = esl_bytecode::datum::Datum::symbol(name.clone(), Default::default());
        entry("variable", &[print(&name, &qualifier), print(value, &qualifier)]);
    }
    for fact in &kept.facts {
        entry("fact", &[print(fact, &qualifier)]);
    }
    packages.extend(seen.take().iter().map(|name| format!("{name:?}")));
    let when = if is_pause { "pause" } else { "snapshot" };
    let (facts, variables) = (kept.facts.len(), kept.variables.len());
    let mut text = format!("{HEADER}\n;;; {when} at {wall} facts {facts} variables {variables}\n");
    for what in &kept.left_out {
        _ = writeln!(text, "{LEFT_OUT}{}", what.replace(['\n', '\r'], " "));
    }
    _ = writeln!(text, "(:packages {})", packages.join(" "));
    text + &entries + END + "\n"
}

/// Reads a text; `None` if it is not a whole one of this version.
fn read(folder: &Path, text: String, wall: i64) -> Option<KeptFacts> {
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) || text.lines().next_back() != Some(END) {
        return None;
    }
    let words: Vec<&str> = lines.next()?.split(' ').collect();
    let [";;;", when, "at", written, "facts", facts, "variables", variables] = words[..] else { return None };
    let (facts, variables) = (facts.parse().ok()?, variables.parse().ok()?);
    let written: i64 = written.parse().ok()?;
    let seconds = wall.saturating_sub(written).max(0) as f64 / 1e9;
    let left_out = lines.map_while(|line| line.strip_prefix(LEFT_OUT)).map(str::to_owned).collect();
    let (is_pause, earlier) = (when == "pause", earlier(folder));
    Some(KeptFacts { facts, variables, left_out, seconds, is_pause, earlier, text })
}

impl KeptFacts {
    /// Returns the text in the first frame of the run: the time since the text was written, and the text.
    pub(crate) fn for_beginning(&self) -> String {
        format!("{}\n{}", (self.seconds * 1000.0) as u64, self.text)
    }
}

/// Writes a file as a whole, for its owner only.
fn write(file: &Path, text: &str, is_synced: bool) -> io::Result<()> {
    let fresh = file.with_extension("new");
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut written = options.open(&fresh)?;
    written.write_all(text.as_bytes())?;
    if is_synced {
        written.sync_all()?;
    }
    fs::rename(&fresh, file)
}

/// Writes the facts of a run. Returns the things that are missing in the text.
///
/// # Errors
/// If it cannot be written; then the text before stays.
pub(crate) fn keep(folder: &Path, machine: &Vm, is_pause: bool, is_synced: bool) -> io::Result<Vec<String>> {
    if !is_pause && machine.fact_count() > WITH_SNAPSHOT {
        return Ok(Vec::new());
    }
    let kept = machine.kept_data();
    write(&text_file(folder), &text_of(&kept, wall_clock(), is_pause), is_synced)?;
    Ok(kept.left_out)
}

/// Returns whether a journal cannot be gone on with because another version of the machine has written it.
fn is_of_another_machine(found: &Result<Option<FoundJournals>, DurableError>) -> bool {
    match found {
        Err(DurableError::Journal(RecordedError::OtherMachine | RecordedError::Format(_))) => true,
        Ok(Some(found)) => !found.journal.recorded.beginning.is_of_this_machine(),
        _ => false,
    }
}

/// The files by which a run goes on, or the facts from which it begins anew.
pub(crate) type FoundOrKept = (Option<FoundJournals>, Option<KeptFacts>);

/// Reads the journals in a folder. If another version of the machine has written them and `is_wanted`, moves
/// them away and returns the facts from which the run begins anew.
///
/// # Errors
/// [`DurableError`].
pub(crate) fn find(path: &Path, is_wanted: bool) -> Result<FoundOrKept, DurableError> {
    let (text, begun) = (text_file(path), begun_file(path));
    let found = generations::find(path);
    if !begun.exists() {
        if !is_wanted || !is_of_another_machine(&found) {
            return Ok((found?, None));
        }
        if !text.exists() {
            return Err(DurableError::NoFacts);
        }
    }
    let in_folder = |error| DurableError::Folder(path.into(), error);
    let source = if begun.exists() { &begun } else { &text };
    folder::check_private(source)?;
    let read_text = fs::read_to_string(source).map_err(in_folder)?;
    let kept = read(path, read_text, wall_clock()).ok_or(DurableError::NoFacts)?;
    if !begun.exists() {
        drop(fs::remove_dir_all(earlier(path)));
        fs::rename(&text, &begun).map_err(in_folder)?;
        sync_folder(path).map_err(in_folder)?;
    } else if let Ok(Some(run)) = &found
        && !is_of_another_machine(&found)
        && run.journal.recorded.beginning.kept.as_ref().is_some_and(|of_run| of_run.ends_with(&kept.text))
    {
        // Only this step was missing.
        fs::rename(&begun, text_file(&earlier(path))).map_err(in_folder)?;
        return Ok((found?, None));
    }
    move_away(path).map_err(in_folder)?;
    Ok((None, Some(kept)))
}

/// Moves the files of a run into a folder of their own.
fn move_away(path: &Path) -> io::Result<()> {
    let earlier = earlier(path);
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(&earlier)?;
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        let text = name.to_str().unwrap_or_default();
        let is_of_run = text.ends_with(".eslj") || text.ends_with(".esls") || text == "rest";
        if is_of_run {
            fs::rename(path.join(&name), earlier.join(&name))?;
        }
    }
    sync_folder(path)
}

fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(path)?.sync_all() } else { Ok(()) }
}

impl DurableRun {
    /// Returns the facts from which the run begins anew, if its folder had that of another version of the
    /// machine.
    pub fn kept_facts(&self) -> Option<&KeptFacts> {
        self.kept.as_ref()
    }

    /// Takes note of the facts from which the run has begun in a machine that has its functions and settings.
    ///
    /// # Errors
    /// [`DurableError::Facts`], if they cannot be read.
    pub fn prepare(&self, machine: &mut Vm) -> Result<(), DurableError> {
        let of_run = self.found.as_ref().and_then(|found| found.recorded.beginning.kept.as_deref());
        let kept = match (&self.kept, of_run) {
            (Some(kept), _) => kept.for_beginning(),
            (None, Some(kept)) => kept.to_owned(),
            (None, None) => return Ok(()),
        };
        esl_replay::set_kept(machine, &kept).map_err(|error| DurableError::Facts(Box::new(error)))
    }

    /// Notes that the run has begun with the facts, so that it goes on by its journal.
    pub(crate) fn end_beginning(&self) -> Result<(), DurableError> {
        let (Some(folder), Some(_)) = (&self.folder, &self.kept) else { return Ok(()) };
        // With the files of the run before, so that one can begin again from there.
        let moved = fs::rename(begun_file(folder.path()), text_file(&earlier(folder.path())));
        moved.map_err(|error| DurableError::Folder(folder.path().into(), error))
    }

    /// Writes the facts of the run at a pause, and warns of missing things.
    pub(crate) fn keep_facts(&self, machine: &Vm) {
        let Some(folder) = &self.folder else { return };
        match keep(folder.path(), machine, true, true) {
            Ok(left_out) => {
                for what in left_out.iter().take(NAMED) {
                    self.control.warn(&format!("not kept for another version of the machine: {what}"));
                }
                if left_out.len() > NAMED {
                    let more = left_out.len() - NAMED;
                    self.control.warn(&format!("not kept for another version of the machine: {more} more"));
                }
            }
            Err(error) => self.control.warn(&format!("the facts cannot be written as a text: {error}")),
        }
    }

    /// Writes the facts of a run that sleeps. Missing things are reported at a pause.
    pub(crate) fn keep_facts_asleep(&self, machine: &Vm) {
        let Some(folder) = &self.folder else { return };
        if let Err(error) = keep(folder.path(), machine, true, self.log.survives_loss_of_power()) {
            self.control.warn(&format!("the facts cannot be written as a text: {error}"));
        }
    }

    /// Removes the facts of a run that has ended: nothing begins from there.
    pub(crate) fn forget_facts(&self) {
        if let Some(folder) = &self.folder {
            drop(fs::remove_file(text_file(folder.path())));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_is_cut_off_is_none() {
        let kept = KeptData { left_out: vec!["variable X: it has\na task".into()], ..KeptData::default() };
        let text = text_of(&kept, 5_000_000_000, true);
        let folder = Path::new("f");
        let read_back = read(folder, text.clone(), 7_000_000_000).expect("it is whole");
        assert_eq!((read_back.facts, read_back.seconds, read_back.is_pause), (0, 2.0, true));
        assert_eq!(read_back.left_out, ["variable X: it has a task"]);
        for end in 0..text.len() - 1 {
            assert_eq!(read(folder, text[..end].into(), 0), None, "{}", &text[..end]);
        }
    }
}
