//! The table of codes as a page of the manual, `docs/diagnostics.md`.

use std::fmt::Write;

use esl_bytecode::diagnostic::Severity;

use super::code::{ALL, Stage};

/// Returns the text of `docs/diagnostics.md`.
pub fn markdown() -> String {
    let mut page = String::from(
        "# Diagnostics\n\n\
         The compiler's findings about a program, by code. An *error* means that the program does not\n\
         compile, a *warning* that it compiles, but probably contains a mistake.\n\n\
         This page is generated from `compiler/src/diagnostic/code.rs`.\n",
    );
    for stage in Stage::ALL {
        section(&mut page, stage);
    }
    page
}

fn section(page: &mut String, stage: Stage) {
    // Writing to a string cannot fail.
    let _ = writeln!(page, "\n## {}", stage.title());
    for code in ALL.iter().filter(|code| code.stage == stage) {
        let severity = match code.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let _ = writeln!(page, "\n### {}\n\n*{severity}* — {}", code.name, code.summary);
        if !code.failing.is_empty() {
            let _ = write!(page, "\nReported for:\n\n```lisp\n{}\n```\n", visible(code.failing));
            let _ = write!(page, "\nRepaired:\n\n```lisp\n{}\n```\n", visible(code.repaired));
        }
    }
}

/// Returns a program with invisible characters replaced by their numbers, for people.
fn visible(program: &str) -> String {
    program.trim_end().replace('\u{a0}', "⟨U+00A0⟩")
}
