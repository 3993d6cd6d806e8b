//! Correct programs have no warning: the examples, the modules, the cookbook, the tutorial and the pages for
//! users of other languages.
//!
//! Some chapters show mistakes on purpose. `MEANT` lists what they show.

use std::path::{Path, PathBuf};

use esl::module_path::ModulePath;
use esl::program::{self, Modules, Source};
use esl_conformance::chapter::{Example, examples};

/// Findings that a text shows on purpose: the file, the code, and how many there are.
const MEANT: &[(&str, &str, usize)] = &[
    // Operations of the host, which `link.esl` or a world defines.
    ("examples/spacecraft/executive.esl", "undefined-function", 6),
    ("docs/tutorial/1-hello.md", "undefined-function", 1),
    // The tutorial makes these files on its way.
    ("docs/tutorial/2-rover.md", "unknown-module", 1),
    ("docs/tutorial/3-failure.md", "unknown-module", 1),
    ("docs/tutorial/4-goals.md", "unknown-module", 1),
    ("docs/tutorial/5-tasks.md", "unknown-module", 1),
    ("docs/tutorial/6-tests.md", "unknown-module", 1),
    ("docs/tutorial/7-schedules.md", "unknown-module", 2),
    ("docs/tutorial/9-possible-failures.md", "unknown-module", 1),
    ("docs/manual/modules.md", "unknown-module", 1),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The files below `folder` with this extension.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("the folder is there") {
            let path = entry.expect("the folder can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Compiles a text that stands in `path`; returns what is reported and not meant.
fn findings(path: &Path, text: String) -> Vec<String> {
    let name = path.strip_prefix(root()).unwrap_or(path).display().to_string();
    esl_world::add_modules(esl_robots::MODULES);
    esl_world::add_modules(esl_trees::MODULES);
    esl_world::add_modules(esl_plans::MODULES);
    let modules = ModulePath::new([path], &[]);
    let compiled = program::compile_with(&[Source::new(name.clone(), text)], &modules, Modules::Inside);
    let mut meant: Vec<(&str, usize)> =
        MEANT.iter().filter(|(file, ..)| *file == name).map(|&(_, code, count)| (code, count)).collect();
    let mut found = Vec::new();
    for diagnostic in &compiled.diagnostics {
        match meant.iter_mut().find(|(code, left)| *code == diagnostic.code && *left > 0) {
            Some((_, left)) => *left -= 1,
            None => {
                let line = compiled.sources.place(diagnostic.primary.span).map_or(0, |place| place.line);
                found.push(format!("{name}:{line}: {}: {}", diagnostic.code, diagnostic.message));
            }
        }
    }
    let missing = meant.into_iter().filter(|(_, left)| *left > 0);
    found.extend(missing.map(|(code, left)| format!("{name}: {left} of {code} are missing")));
    found
}

#[test]
fn examples_and_modules_have_no_warnings() {
    let folders = ["examples", "world/modules", "robots/modules", "trees/modules", "plans/modules"];
    let mut paths = folders.map(|folder| files(folder, "esl")).concat();
    // Parts of other modules, which are compiled with them: `ros-actions` of `ros`.
    let is_part = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        path.parent().is_some_and(|folder| folder.ends_with("modules")) && name.contains('-')
    };
    paths.retain(|path| !is_part(path));
    assert!(paths.len() > 25, "{} files", paths.len());
    let read = |path: &PathBuf| std::fs::read_to_string(path).expect("the file is text");
    let found: Vec<String> = paths.iter().flat_map(|path| findings(path, read(path))).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn documents_have_no_warnings_but_those_that_they_show() {
    let mut count = 0;
    let mut found = Vec::new();
    let folders = ["docs/cookbook", "docs/tutorial", "docs/coming-from", "docs/manual"];
    for path in folders.iter().flat_map(|folder| files(folder, "md")) {
        let text = std::fs::read_to_string(&path).expect("the file is text");
        let parts = examples(&text).unwrap_or_default();
        let programs = parts.into_iter().filter_map(|(line, example)| match example {
            Example::Program { text, .. } => Some((line, text)),
            Example::Session(_) => None,
        });
        // The lines keep their numbers.
        let mut program = String::new();
        for (line, text) in programs {
            let before = program.lines().count();
            program.extend(std::iter::repeat_n('\n', line.saturating_sub(before)));
            program.push_str(&text);
            count += 1;
        }
        found.extend(findings(&path, program));
    }
    assert!(count > 40, "{count} programs");
    assert!(found.is_empty(), "{}", found.join("\n"));
}
