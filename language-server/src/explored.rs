//! Findings of explorations, as marks in the texts: `eslvm explore --findings FILE` or `eslvm test --findings
//! FILE` has written them.
//!
//! Guarantees: a finding is shown only in a text that is as it was when the program was explored: as it is
//! stored, and stored no later than the findings. Not here: when to look ([`super::check`]).

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use lsp_types::{
    Diagnostic as ShownDiagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location,
    NumberOrString, Uri,
};
use serde_json::Value as Json;

use super::document::{ColumnUnit, OpenText, path_of, uri_of};

/// End of the names of files with findings.
pub(super) const FINDINGS: &str = ".findings.json";
/// Largest size of such a file that is read, in bytes.
const MOST_BYTES: u64 = 8 << 20;
/// Most findings that are shown in a text.
const MOST_FINDINGS: usize = 50;
/// Most steps of a finding that are shown: the last ones.
const MOST_STEPS: usize = 1000;

/// Returns the marks of findings in a text. Their files are in its folder, or in those of the workspace.
pub(super) fn marks(uri: &Uri, text: &str, unit: ColumnUnit, roots: &[PathBuf]) -> Vec<ShownDiagnostic> {
    let path = path_of(uri);
    let Some((stored, changed)) = stored(&path) else { return Vec::new() };
    if stored != text {
        return Vec::new();
    }
    let mut folders: Vec<&Path> =
        path.parent().into_iter().chain(roots.iter().map(PathBuf::as_path)).collect();
    folders.dedup();
    let mut files: Vec<PathBuf> = folders.into_iter().flat_map(|folder| files_in(folder, changed)).collect();
    files.sort();
    files.dedup();
    let mut marker = FindingMarker { path: &path, unit, texts: HashMap::new(), marks: Vec::new() };
    let mut count = 0;
    for file in files {
        let Some(json) = read(&file).and_then(|text| serde_json::from_str::<Json>(&text).ok()) else {
            continue;
        };
        let folder = PathBuf::from(json["folder"].as_str().unwrap_or_default());
        let program = json["program"].as_str().unwrap_or_default();
        for finding in json["findings"].as_array().into_iter().flatten() {
            if count < MOST_FINDINGS {
                count += 1;
                marker.mark(finding, &folder, program);
            }
        }
    }
    marker.marks
}

/// Returns the text of a file, and when it was changed.
fn stored(path: &Path) -> Option<(String, SystemTime)> {
    let changed = fs::metadata(path).ok()?.modified().ok()?;
    Some((read(path)?, changed))
}

/// Returns the text of a file that is not too large. To read a pipe or a device might never end.
fn read(path: &Path) -> Option<String> {
    let found = fs::metadata(path).ok()?;
    if found.is_file() && found.len() <= MOST_BYTES { fs::read_to_string(path).ok() } else { None }
}

/// Returns the files with findings in a folder that were written at a time or later.
fn files_in(folder: &Path, since: SystemTime) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let entries = entries.flatten().filter(|entry| entry.file_name().to_string_lossy().ends_with(FINDINGS));
    let is_wanted = |entry: &fs::DirEntry| {
        fs::metadata(entry.path()).is_ok_and(|found| found.modified().is_ok_and(|written| written >= since))
    };
    entries.filter(is_wanted).map(|entry| entry.path()).collect()
}

/// A step of a finding.
struct MarkedStep {
    /// The task and what it does.
    text: String,
    /// Whether the task had to stop there, or was asked to end.
    is_switch: bool,
    /// The file and the place in it.
    at: (PathBuf, Location),
}

/// Makes the marks in one text.
struct FindingMarker<'a> {
    path: &'a Path,
    unit: ColumnUnit,
    /// The texts of the steps, `None` for those that cannot be read.
    texts: HashMap<PathBuf, Option<OpenText>>,
    marks: Vec<ShownDiagnostic>,
}

impl FindingMarker<'_> {
    /// Returns a place, as `file:line:column`, of a program that was explored in this folder.
    fn at(&mut self, place: &str, folder: &Path) -> Option<(PathBuf, Location)> {
        let mut parts = place.rsplitn(3, ':');
        let column: usize = parts.next()?.parse().ok()?;
        let line: usize = parts.next()?.parse().ok()?;
        let path = fs::canonicalize(folder.join(parts.next()?)).ok()?;
        let unit = self.unit;
        let load = |path: &Path| {
            let text = read(path)?;
            Some(OpenText::new(uri_of(path)?, 0, text, unit))
        };
        let text = self.texts.entry(path.clone()).or_insert_with(|| load(&path)).as_ref()?;
        let range = text.lines.range(line.checked_sub(1)?);
        let in_line = text.tree.source().get(range.clone())?;
        let start = range.start + in_line.char_indices().nth(column.checked_sub(1)?)?.0;
        let node = text.tree.first_at(start);
        let form = text.tree.nodes().contains(&node).then(|| text.tree.range(node));
        let end = form.filter(|form| form.start == start).map_or(start, |form| form.end);
        Some((path, text.location(start..end)))
    }

    /// Returns the number of the first steps of a finding that are left out, and those of the others that
    /// have a place.
    fn steps(&mut self, finding: &Json, folder: &Path) -> (usize, Vec<MarkedStep>) {
        let mut steps = Vec::new();
        let all = finding["steps"].as_array().map_or(&[][..], Vec::as_slice);
        let left_out = all.len().saturating_sub(MOST_STEPS);
        for step in &all[left_out..] {
            let standing = ["stops", "ends", "chooses"].iter().find_map(|key| step.get(key)).unwrap_or(step);
            let (Some(task), Some(place), Some(text)) =
                (standing["task"].as_str(), standing["place"].as_str(), step["text"].as_str())
            else {
                continue;
            };
            let is_switch = step.get("stops").is_some() || step.get("ends").is_some();
            let text = format!("{}: {text}", task.strip_prefix("task ").unwrap_or(task));
            if let Some(at) = self.at(place, folder) {
                steps.push(MarkedStep { text, is_switch, at });
            }
        }
        (left_out, steps)
    }

    fn mark(&mut self, finding: &Json, folder: &Path, program: &str) {
        let kind = if finding.get("fragile").is_some() { "fragile" } else { "finding" };
        let Some(what) = finding[kind].as_str() else { return };
        let command = if finding.get("test").is_some() { "eslvm test" } else { "eslvm explore" };
        let (left_out, steps) = self.steps(finding, folder);
        let Some(main) = steps.iter().rposition(|step| step.is_switch).or(steps.len().checked_sub(1)) else {
            return;
        };
        let own = fs::canonicalize(self.path).unwrap_or_else(|_| self.path.to_owned());
        let related = steps.iter().map(|step| DiagnosticRelatedInformation {
            location: step.at.1.clone(),
            message: step.text.clone(),
        });
        let related: Vec<DiagnosticRelatedInformation> = related.collect();
        let shown = |severity, at: &Location, message| ShownDiagnostic {
            range: at.range,
            severity: Some(severity),
            code: Some(NumberOrString::String(kind.into())),
            source: Some(command.into()),
            message,
            ..ShownDiagnostic::default()
        };
        for (number, step) in steps.iter().enumerate().filter(|(_, step)| step.at.0 == own) {
            if number == main {
                let report = finding["report"].as_str().unwrap_or_default();
                let schedule = finding["schedule"].as_str().unwrap_or_default();
                let again = match finding["again"].as_str() {
                    Some(command) => format!("again: {command}"),
                    None => format!("again: eslvm run --schedule {schedule} {program}"),
                };
                let lines = [what, &step.text, report.trim_end(), &again];
                let lines: Vec<&str> = lines.into_iter().filter(|line| !line.is_empty()).collect();
                let mark = shown(DiagnosticSeverity::WARNING, &step.at.1, lines.join("\n"));
                let related_information = Some(related.clone());
                self.marks.push(ShownDiagnostic { related_information, ..mark });
            } else {
                let (number, count) = (left_out + number + 1, left_out + steps.len());
                let message = format!("step {number} of {count}, {what}: {}", step.text);
                self.marks.push(shown(DiagnosticSeverity::INFORMATION, &step.at.1, message));
            }
        }
    }
}
