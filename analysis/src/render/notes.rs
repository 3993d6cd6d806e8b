//! Severities and notes of an earlier table of failure modes and effects, which a person has written into it.

use std::collections::BTreeMap;
use std::fmt;

/// Text in the column of notes of a line whose failure the program no longer has.
const STALE: &str = "stale: no longer in the program";

/// Columns that a file with notes has, in any order, among others.
const COLUMNS: [&str; 4] = ["item", "failure mode", "severity", "notes"];

/// Characters between the cells of a line, as spreadsheets write them.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// Severities and notes of an earlier table, by items and failure modes.
///
/// ```
/// use esl_analysis::render::EarlierNotes;
///
/// assert!(EarlierNotes::read("Item;Failure Mode;Severity;Notes\r\nslew;:stuck;2;oil it\r\n").is_ok());
/// assert!(EarlierNotes::read("item,notes\r\nslew,oil it\r\n").is_err());
/// ```
#[derive(Clone, Debug, Default)]
pub struct EarlierNotes(BTreeMap<(String, String), NoteCells>);

/// The cells of a line that a person writes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct NoteCells {
    pub(super) severity: String,
    pub(super) notes: String,
}

/// A text without the columns of an earlier table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotesError;

impl fmt::Display for NotesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = COLUMNS.map(|column| format!("`{column}`")).join(", ");
        write!(f, "its first line does not have the columns {columns}")
    }
}

impl std::error::Error for NotesError {}

impl EarlierNotes {
    /// Reads a table in CSV, as a spreadsheet may have saved it: with commas, semicolons or tabulators
    /// between cells. The notes of two lines for the same failure are joined.
    ///
    /// # Errors
    /// [`NotesError`].
    pub fn read(csv: &str) -> Result<EarlierNotes, NotesError> {
        let csv = csv.trim_start_matches('\u{feff}');
        let (columns, lines) = SEPARATORS
            .into_iter()
            .find_map(|separator| {
                let mut lines = cells(csv, separator).into_iter();
                Some((columns(&lines.next()?)?, lines))
            })
            .ok_or(NotesError)?;
        let mut all = EarlierNotes::default();
        for line in lines {
            let [item, mode, severity, notes] =
                columns.map(|column| line.get(column).cloned().unwrap_or_default());
            let known = all.0.entry((item, mode)).or_default();
            add(&mut known.severity, &severity);
            add(&mut known.notes, without_mark(&notes));
        }
        Ok(all)
    }

    /// Takes the cells of a failure.
    pub(super) fn take(&mut self, item: &str, mode: &str) -> NoteCells {
        self.0.remove(&(item.to_string(), mode.to_string())).unwrap_or_default()
    }

    /// Returns the cells that were not taken, marked as stale, with their items and failure modes.
    pub(super) fn stale(self) -> impl Iterator<Item = (String, String, NoteCells)> {
        let is_written = |cells: &NoteCells| !cells.severity.is_empty() || !cells.notes.is_empty();
        self.0.into_iter().filter(move |(_, cells)| is_written(cells)).map(|((item, mode), cells)| {
            let mut notes = STALE.to_string();
            add(&mut notes, &cells.notes);
            (item, mode, NoteCells { notes, ..cells })
        })
    }
}

/// Returns the places of the columns among headings.
fn columns(headings: &[String]) -> Option<[usize; 4]> {
    let mut places = [0; 4];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = headings.iter().position(|heading| heading.trim().eq_ignore_ascii_case(name))?;
    }
    Some(places)
}

/// Joins the texts of two lines.
fn add(known: &mut String, more: &str) {
    match known.is_empty() {
        _ if more.is_empty() || known == more => {}
        true => *known = more.to_string(),
        false => *known = format!("{known}; {more}"),
    }
}

/// Returns notes without the mark of stale ones.
fn without_mark(notes: &str) -> &str {
    match notes.strip_prefix(STALE) {
        Some(rest) => rest.trim_start_matches(';').trim(),
        None => notes,
    }
}

/// Reads CSV (RFC 4180).
fn cells(csv: &str, separator: char) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    let (mut line, mut cell, mut is_quoted) = (Vec::new(), String::new(), false);
    let mut characters = csv.chars().peekable();
    while let Some(c) = characters.next() {
        match c {
            '"' if is_quoted && characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            // A quote within a cell that is not quoted is one of its characters.
            '"' if is_quoted || cell.is_empty() => is_quoted = !is_quoted,
            c if c == separator && !is_quoted => line.push(std::mem::take(&mut cell)),
            '\r' if !is_quoted => {}
            '\n' if !is_quoted => {
                line.push(std::mem::take(&mut cell));
                lines.push(std::mem::take(&mut line));
            }
            other => cell.push(other),
        }
    }
    if !cell.is_empty() || !line.is_empty() {
        line.push(cell);
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::flat::{self, CellLines};
    use super::*;

    /// Reads a table, and returns the cells of `:stuck` in `slew`.
    fn of_slew(csv: &str) -> NoteCells {
        EarlierNotes::read(csv).expect("it has the columns").take("slew", ":stuck")
    }

    fn both(severity: &str, notes: &str) -> NoteCells {
        NoteCells { severity: severity.into(), notes: notes.into() }
    }

    #[test]
    fn cells_are_read_as_they_are_written() {
        let lines: CellLines = vec![
            vec!["a".into(), "b, \"c\"".into()],
            vec![String::new(), "two\nlines".into()],
            vec!["\rd".into(), "e\"f".into()],
        ];
        assert_eq!(cells(&flat::csv(&lines), ','), lines);
    }

    #[test]
    fn files_of_spreadsheets_are_read() {
        let expected = both("2", "oil it; soon");
        for csv in [
            "item,failure mode,severity,notes\r\nslew,:stuck,2,oil it; soon\r\n",
            "\u{feff}item,failure mode,severity,notes\nslew,:stuck,2,oil it; soon",
            "Item;Failure Mode;Severity;Notes\nslew;:stuck;2;\"oil it; soon\"\n",
            "NOTES\tITEM\tFAILURE MODE\tSEVERITY\noil it; soon\tslew\t:stuck\t2\n",
        ] {
            assert_eq!(of_slew(csv), expected, "{csv}");
        }
    }

    #[test]
    fn a_file_without_the_columns_is_refused() {
        for csv in ["", "item,failure mode,notes\n", "slew,:stuck,2,oil it\n"] {
            assert_eq!(EarlierNotes::read(csv).err(), Some(NotesError), "{csv}");
        }
        assert_eq!(
            NotesError.to_string(),
            "its first line does not have the columns `item`, `failure mode`, `severity`, `notes`"
        );
    }

    #[test]
    fn notes_of_two_lines_for_one_failure_are_joined() {
        let csv =
            "item,failure mode,severity,notes\nslew,:stuck,2,oil it\nslew,:stuck,2,again\nslew,:stuck,,\n";
        assert_eq!(of_slew(csv), both("2", "oil it; again"));
    }

    #[test]
    fn stale_notes_are_marked_as_long_as_they_are_stale() {
        let csv = "item,failure mode,severity,notes\nslew,:stuck,2,oil it\nslew,:lost,1,\nslew,:late,,\n";
        let stale: Vec<_> = EarlierNotes::read(csv).expect("it has the columns").stale().collect();
        let row = |mode: &str, cells| ("slew".to_string(), mode.to_string(), cells);
        let marked = both("2", "stale: no longer in the program; oil it");
        assert_eq!(stale, [row(":lost", both("1", STALE)), row(":stuck", marked.clone())]);
        // In the next table it is marked once; when the failure is back, it is not.
        let csv = format!("item,failure mode,severity,notes\nslew,:stuck,2,{}\n", marked.notes);
        let again = EarlierNotes::read(&csv).expect("it has the columns").stale().next();
        assert_eq!(again, Some(row(":stuck", marked)));
        assert_eq!(of_slew(&csv), both("2", "oil it"));
    }
}
