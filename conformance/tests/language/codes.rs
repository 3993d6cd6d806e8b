//! The programs of the table of diagnostic codes, compiled with the library: those with a fault have it,
//! and the repaired ones do not.

use esl::program::{self, Source};
use esl_compiler::diagnostic::{Stage, code};

fn codes(text: &str) -> Vec<&'static str> {
    let compiled = program::compile(&[Source::new("program.esl", text)]);
    compiled.diagnostics.iter().map(|found| found.code).collect()
}

#[test]
fn the_programs_of_each_code_have_it_and_the_repaired_ones_do_not() {
    let mut faults = Vec::new();
    for code in code::ALL.iter().filter(|code| code.stage == Stage::Expander && !code.failing.is_empty()) {
        let (failing, repaired) = (codes(code.failing), codes(code.repaired));
        if !failing.contains(&code.name) || repaired.contains(&code.name) {
            faults.push(format!("{}: {failing:?}, repaired {repaired:?}", code.name));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
