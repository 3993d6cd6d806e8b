//! Writes `docs/bytecode.md` and `docs/builtins.md` from the tables, and fails when they are stale.
//!
//! The text around the tables is in the Markdown files beside this one. A line `@opcodes FIRST LAST`
//! there stands for the rows from one mnemonic to the other, in the order of the table; every row must be
//! asked for once.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use esl_bytecode::builtin::{BUILTINS, BuiltinInfo, Visibility};
use esl_bytecode::opcode::{OPCODES, OpcodeInfo, TypeCode};

/// Compares a file of `docs` with what it should be; with `ESL_BLESS=1` in the environment, writes it.
fn check(name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name);
    if std::env::var_os("ESL_BLESS").is_some_and(|value| value == "1") {
        fs::write(&path, expected).expect("the folder `docs` can be written");
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "docs/{name} is stale: run `ESL_BLESS=1 cargo test -p esl-bytecode --test reference` and commit the result"
    );
}

#[test]
fn the_opcode_reference_is_up_to_date() {
    let mut left: BTreeSet<&str> = OPCODES.iter().map(|row| row.mnemonic).collect();
    let text = expand(include_str!("bytecode.md"), |arguments, text| match *arguments {
        ["@opcodes", first, last] => {
            let at = |name| OPCODES.iter().position(|row| row.mnemonic == name).expect("a mnemonic");
            let rows = &OPCODES[at(first)..=at(last)];
            for row in rows {
                assert!(left.remove(row.mnemonic), "{} is listed twice", row.mnemonic);
            }
            opcode_table(rows, text);
        }
        ["@types"] => type_table(text),
        _ => panic!("no such table: {arguments:?}"),
    });
    assert!(left.is_empty(), "bytecode/tests/reference/bytecode.md has no place for {left:?}");
    check("bytecode.md", &text);
}

#[test]
fn the_builtin_reference_is_up_to_date() {
    let text = expand(include_str!("builtins.md"), |arguments, text| {
        let visibility = match *arguments {
            ["@builtins", "cl"] => Visibility::Cl,
            ["@builtins", "esl"] => Visibility::Esl,
            ["@builtins", "internal"] => Visibility::Internal,
            _ => panic!("no such table: {arguments:?}"),
        };
        builtin_table(visibility, text);
    });
    check("builtins.md", &text);
}

/// The template with each line that begins with `@` replaced by the table that `table` writes.
fn expand(template: &str, mut table: impl FnMut(&[&str], &mut String)) -> String {
    let mut text = String::new();
    for line in template.lines() {
        if line.starts_with('@') {
            let arguments: Vec<&str> = line.split_whitespace().collect();
            table(&arguments, &mut text);
        } else {
            text.push_str(line);
            text.push('\n');
        }
    }
    text
}

fn row(text: &mut String, cells: &[&str]) {
    for cell in cells {
        write!(text, "| {} ", cell.replace('|', "\\|")).expect("writing to a string");
    }
    text.push_str("|\n");
}

fn opcode_table(rows: &[OpcodeInfo], text: &mut String) {
    row(text, &["number", "instruction", "operands", "failure", "effect"]);
    row(text, &["---"; 5]);
    for info in rows {
        let operands = info.operands.iter().filter(|(_, kind)| *kind != "Pad");
        let kinds: Vec<String> = operands.map(|(name, kind)| format!("{name}: {kind}")).collect();
        let kinds = if kinds.is_empty() { String::new() } else { format!("`{}`", kinds.join(", ")) };
        let number = format!("`0x{:02X}`", info.opcode as u8);
        let failure = info.substitute.word();
        row(text, &[&number, &format!("`{}`", info.mnemonic), &kinds, failure, &doc(info.doc)]);
    }
}

fn type_table(text: &mut String) {
    row(text, &["code", "type"]);
    row(text, &["---"; 2]);
    for &code in TypeCode::ALL {
        row(text, &[&(code as u8).to_string(), &format!("`{}`", code.type_name().to_lowercase())]);
    }
}

fn builtin_table(visibility: Visibility, text: &mut String) {
    let mut rows: Vec<&BuiltinInfo> = BUILTINS.iter().filter(|row| row.visibility == visibility).collect();
    rows.sort_by_key(|row| row.name);
    row(text, &["call", "effect"]);
    row(text, &["---"; 2]);
    for info in rows {
        let separator = if info.lambda_list.is_empty() { "" } else { " " };
        let call = format!("`({}{separator}{})`", info.name.to_lowercase(), info.lambda_list);
        let slowly = info.slowly.map(|name| format!(" Large arguments: `{}`.", name.to_lowercase()));
        row(text, &[&call, &(doc(info.doc) + &slowly.unwrap_or_default())]);
    }
}

/// A documentation comment as one line.
fn doc(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}
