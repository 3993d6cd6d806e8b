//! Figures of coverage, as lcov and as a table.

use std::collections::BTreeMap;
use std::fmt::Write;

/// Figures of several files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CoverageReport {
    files: BTreeMap<String, CoveredFile>,
}

/// Figures of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CoveredFile {
    /// How often each line that has code was run; of several forms on a line, the one that was run most.
    pub lines: BTreeMap<u32, u64>,
    /// How often each function was called, by the line and the name of its definition.
    pub functions: BTreeMap<(u32, String), u64>,
    /// The arms, by the line and column of the form, and their numbers in it.
    pub arms: BTreeMap<(u32, u32, u32), CoveredArm>,
}

/// Figures of an arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoveredArm {
    /// Line in which the arm begins.
    pub line: u32,
    /// The finding if it was never taken.
    pub what: String,
    /// How often it was taken.
    pub count: u64,
}

impl CoverageReport {
    /// Adds figures of a file.
    pub fn add(&mut self, name: &str, file: CoveredFile) {
        let known = self.files.entry(name.into()).or_default();
        file.lines.into_iter().for_each(|(line, count)| *known.lines.entry(line).or_default() += count);
        for (function, count) in file.functions {
            *known.functions.entry(function).or_default() += count;
        }
        for (place, arm) in file.arms {
            known.arms.entry(place).and_modify(|known| known.count += arm.count).or_insert(arm);
        }
    }

    /// Adds all figures of another report.
    pub fn merge(&mut self, other: CoverageReport) {
        other.files.into_iter().for_each(|(name, file)| self.add(&name, file));
    }

    /// Returns the figures of the files, by their names.
    pub fn files(&self) -> &BTreeMap<String, CoveredFile> {
        &self.files
    }

    /// Returns the report in the form of lcov, which `genhtml` and editors read.
    pub fn lcov(&self) -> String {
        let mut text = String::new();
        for (name, file) in &self.files {
            // Writing to a string does not fail.
            _ = file.write_lcov(name, &mut text);
        }
        text
    }

    /// Returns a table for people: figures of each file, and then what was not reached.
    pub fn table(&self) -> String {
        let mut text = format!("{:>16} {:>16} {:>16}  file\n", "lines", "arms", "functions");
        for (name, file) in &self.files {
            let [lines, arms, functions] = file.shares().map(|(reached, all)| share(reached, all));
            _ = writeln!(text, "{lines:>16} {arms:>16} {functions:>16}  {name}");
        }
        for (name, file) in &self.files {
            let mut unrun = file.unrun_lines();
            if !unrun.is_empty() {
                unrun.insert_str(0, if unrun.contains(['-', ',']) { "lines " } else { "line " });
                _ = writeln!(text, "{name}: {unrun}: never run");
            }
            for arm in file.arms.iter().filter(|&(place, arm)| arm.count == 0 && file.is_run(place.0)) {
                _ = writeln!(text, "{name}:{}: {}", arm.1.line, arm.1.what);
            }
        }
        text
    }
}

/// Returns two numbers as a part of a whole.
fn share(reached: usize, all: usize) -> String {
    match all {
        0 => "-".into(),
        // Rounded down, so that only the whole is 100 %.
        _ => format!("{reached}/{all} {:>3} %", reached * 100 / all),
    }
}

impl CoveredFile {
    /// Whether a line was run, or has no code.
    fn is_run(&self, line: u32) -> bool {
        self.lines.get(&line).is_none_or(|&count| count > 0)
    }

    /// Returns how many lines, arms and functions were reached, and how many there are.
    fn shares(&self) -> [(usize, usize); 3] {
        let reached = |counts: &mut dyn Iterator<Item = u64>| counts.filter(|&count| count > 0).count();
        [
            (reached(&mut self.lines.values().copied()), self.lines.len()),
            (reached(&mut self.arms.values().map(|arm| arm.count)), self.arms.len()),
            (reached(&mut self.functions.values().copied()), self.functions.len()),
        ]
    }

    /// Returns the lines that were not run, such as `3, 7-9`: from one to another if no line between them
    /// was.
    fn unrun_lines(&self) -> String {
        let mut rows: Vec<(u32, u32)> = Vec::new();
        let mut is_open = false;
        for (&line, &count) in &self.lines {
            match rows.last_mut() {
                Some((_, last)) if count == 0 && is_open => *last = line,
                _ if count == 0 => rows.push((line, line)),
                _ => {}
            }
            is_open = count == 0;
        }
        let row = |&(first, last): &(u32, u32)| {
            if first == last { first.to_string() } else { format!("{first}-{last}") }
        };
        rows.iter().map(row).collect::<Vec<_>>().join(", ")
    }

    fn write_lcov(&self, name: &str, text: &mut String) -> std::fmt::Result {
        writeln!(text, "TN:\nSF:{name}")?;
        for (line, function) in self.functions.keys() {
            writeln!(text, "FN:{line},{function}")?;
        }
        for ((_, function), count) in &self.functions {
            writeln!(text, "FNDA:{count},{function}")?;
        }
        let [lines, arms, functions] = self.shares();
        writeln!(text, "FNF:{}\nFNH:{}", functions.1, functions.0)?;
        let mut block = 0;
        let mut last = None;
        for (&(line, column, number), arm) in &self.arms {
            if last.is_some_and(|last| last != (line, column)) {
                block += 1;
            }
            last = Some((line, column));
            let form = self.arms.range((line, column, 0)..=(line, column, u32::MAX));
            // A form that was not evaluated at all has a mark of its own.
            let is_evaluated = form.map(|(_, arm)| arm.count).any(|count| count > 0);
            match is_evaluated {
                true => writeln!(text, "BRDA:{line},{block},{number},{}", arm.count)?,
                false => writeln!(text, "BRDA:{line},{block},{number},-")?,
            }
        }
        writeln!(text, "BRF:{}\nBRH:{}", arms.1, arms.0)?;
        for (line, count) in &self.lines {
            writeln!(text, "DA:{line},{count}")?;
        }
        writeln!(text, "LF:{}\nLH:{}\nend_of_record", lines.1, lines.0)
    }
}
