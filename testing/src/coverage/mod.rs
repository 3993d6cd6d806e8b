//! Coverage: which lines, functions and arms of a program its runs have reached.
//!
//! The compiler counts passages at places of the source ([`esl_compiler::cover`]); here they become figures
//! of lines, of functions, and of the arms of the forms that choose: `if`, `cond`, `case` and their like,
//! and the clauses of recovery forms. The figures are exact. A program that is compiled otherwise has none
//! of this.
//!
//! ```
//! use esl_testing::coverage::Coverage;
//! use esl::host::VirtualHost;
//! use esl::module_path::ModulePath;
//! use esl::program::{Source, compile_covered, machine, run_in};
//!
//! let text = "(defun sign (n)\n  (if (plusp n)\n      '+\n      '-))\n(sign 5)\n(sign 7)\n";
//! let compiled = compile_covered(&[Source::new("<sign>", text)], &ModulePath::none());
//! let mut coverage = Coverage::new(&compiled);
//! let program = compiled.program.expect("it compiles");
//! let mut machine = machine(esl::Config::DEFAULT, Box::new(VirtualHost::new()))?;
//! machine.count_passages();
//! run_in(&mut machine, &program)?;
//! coverage.add(&machine.take_passages());
//! let report = coverage.report();
//! assert!(report.lcov().contains("DA:3,2\nDA:4,0\n"));
//! assert!(report.table().contains("<sign>:4: `if`: - is never taken"));
//! # Ok::<(), esl::Error>(())
//! ```

mod arms;
mod report;

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::Path;

use esl_bytecode::span::SourceId;
use esl_compiler::cover::{CountedPlace, PassageKind};
use esl_compiler::diagnostic::Sources;

use esl::program::Compiled;
use esl_syntax::{LineStarts, SyntaxTree};

pub use report::{CoverageReport, CoveredArm, CoveredFile};

/// How often the places of a program were passed so far.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    sources: Sources,
    places: Vec<CountedPlace>,
    counts: Vec<u64>,
}

impl Coverage {
    /// Creates the coverage of a program that was compiled to be counted. Passages of its macros count.
    pub fn new(compiled: &Compiled) -> Coverage {
        let counts = vec![0; compiled.places.len()];
        let (sources, places) = (compiled.sources.clone(), compiled.places.clone());
        let mut coverage = Coverage { sources, places, counts };
        coverage.add(&compiled.passages);
        coverage
    }

    /// Adds the passages of a run of the program.
    pub fn add(&mut self, passages: &[u64]) {
        for (count, passed) in self.counts.iter_mut().zip(passages) {
            *count = count.saturating_add(*passed);
        }
    }

    /// Returns the figures, file by file. Modules that come with the machine are left out.
    pub fn report(&self) -> CoverageReport {
        let mut places: BTreeMap<SourceId, PassedPlaces> = BTreeMap::new();
        for (number, (place, &count)) in self.places.iter().zip(&self.counts).enumerate() {
            let of_source = places.entry(place.span.source).or_default();
            of_source.add(number, place, count);
        }
        let mut report = CoverageReport::default();
        for (source, places) in places {
            let (Some(name), Some(text)) = (self.sources.name(source), self.sources.text(source)) else {
                continue;
            };
            if name.starts_with('<') || Path::new(name).exists() {
                report.add(name, places.file(&SyntaxTree::new(&**text)));
            }
        }
        report
    }
}

/// The places of a source.
#[derive(Debug, Default)]
struct PassedPlaces {
    /// How often the forms were evaluated that begin at these offsets, and the numbers of the first places
    /// there.
    forms: BTreeMap<u32, (u64, usize)>,
    /// How often the conditionals that begin at these offsets have chosen no arm; nothing if that is not
    /// known.
    no_arms: HashMap<u32, Option<u64>>,
    /// How often the functions were called whose definitions begin at these offsets.
    calls: HashMap<u32, u64>,
}

impl PassedPlaces {
    fn add(&mut self, number: usize, place: &CountedPlace, count: u64) {
        let at = place.span.start;
        match place.kind {
            PassageKind::Form => self.forms.entry(at).or_insert((0, number)).0 += count,
            PassageKind::Call => *self.calls.entry(at).or_default() += count,
            PassageKind::NoArm => {
                // Several of them are steps of one choice, which do not add up.
                let known = self.no_arms.contains_key(&at);
                self.no_arms.insert(at, (!known).then_some(count));
            }
        }
    }

    /// Returns how often the form at this place of the text was evaluated, if that is counted.
    fn evaluations(&self, place: Range<usize>) -> Option<u64> {
        let (start, end) = (place.start as u32, place.end as u32);
        // A form such as `(incf x)` has the place of a part of it. Forms have lower numbers than their
        // parts.
        let inside = || self.forms.range(start..end).map(|(_, form)| form).min_by_key(|(_, number)| *number);
        self.forms.get(&start).or_else(inside).map(|(count, _)| *count)
    }

    /// Returns the figures of the source with this tree.
    fn file(&self, tree: &SyntaxTree) -> CoveredFile {
        let lines = LineStarts::new(tree.source());
        let line_of = |offset: usize| lines.line_of(offset) as u32 + 1;
        let mut file = CoveredFile::default();
        let mut defined = HashMap::new();
        for (list, name) in arms::definitions(tree) {
            let at = tree.range(list).start;
            if let Some(&count) = self.calls.get(&(at as u32)) {
                defined.insert(at as u32, count);
                *file.functions.entry((line_of(at), name)).or_default() += count;
            }
        }
        for (&at, &(count, _)) in &self.forms {
            // The line of a definition counts the calls.
            let count = defined.get(&at).copied().unwrap_or(count);
            let line = file.lines.entry(line_of(at as usize)).or_default();
            *line = count.max(*line);
        }
        for (&at, &count) in &defined {
            let line = file.lines.entry(line_of(at as usize)).or_default();
            *line = count.max(*line);
        }
        for form in arms::conditionals(tree) {
            let at = tree.range(form.list).start;
            let line = line_of(at);
            let column = (at - lines.range(line as usize - 1).start) as u32;
            let mut add = |number: usize, line, what: String, count: Option<u64>| {
                if let Some(count) = count {
                    file.arms.insert((line_of(at), column, number as u32), CoveredArm { line, what, count });
                }
            };
            for (number, arm) in form.arms.iter().enumerate() {
                let count = self.evaluations(tree.range(arm.body));
                let what = format!("`{}`: {} is never taken", form.operator, arm.name);
                add(number, line_of(tree.range(arm.clause).start), what, count);
            }
            if form.always_chooses {
                continue;
            }
            let none = self.no_arms.get(&(at as u32)).copied().flatten();
            let what = match &form.arms[..] {
                [_] => format!("`{}`: its test is always {}", form.operator, form.sense()),
                _ => format!("`{}`: there is always an arm that is taken", form.operator),
            };
            add(form.arms.len(), line, what, none);
        }
        file
    }
}
