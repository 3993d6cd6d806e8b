//! Compares random programs and a checklist with SBCL. The programs and SBCL's answers are stored;
//! `ESL_BLESS=1` makes them again, for which SBCL must be installed. See `differential/README.md`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use esl::host::VirtualHost;
use esl::program::{self, Source};
use esl::{Config, Engine};
use esl_conformance::differential::{Grammar, answers};

/// Seed of the stored programs.
const SEED: u64 = 1997;

/// Names that the comparison leaves out, with the reason.
const EXCEPTIONS: &[(&str, &str)] = &[
    ("* ** *** + -", "*, + and - are used as functions; the REPL sets the variables"),
    ("apropos apropos-list describe", "their output is specific to the implementation"),
    ("clear-input sleep random", "they have no effect or a random one; used, not compared"),
    (
        "defpackage in-package make-package use-package import export shadow shadowing-import \
         list-all-packages",
        "programs share a package",
    ),
    ("package-nicknames package-use-list package-error-package", "packages of the two differ"),
    (
        "file-error-pathname load open probe-file delete-file with-open-file truename file-length file-position \
         read-byte write-byte directory rename-file file-write-date ensure-directories-exist",
        "programs have no files",
    ),
    (
        "*compile-file-pathname* *compile-file-truename* *load-pathname* *load-truename* make-load-form \
         make-load-form-saving-slots",
        "programs are compiled in different ways",
    ),
    (
        "*default-pathname-defaults* enough-namestring host-namestring pathname-device pathname-host \
         pathname-version stream-external-format",
        "hosts, versions, encodings and the current folder are specific to the implementation",
    ),
    ("require provide *modules*", "modules are files"),
    ("print-not-readable-object unbound-slot-instance", "nothing signals these errors"),
    ("trace untrace", "the formats of the two differ"),
    ("define-compiler-macro compiler-macro-function", "the other need not call compiler macros"),
    ("with-standard-io-syntax", "programs have packages of different names"),
    ("type-of", "it returns types specific to the implementation"),
    ("signal assert abort", "written with the prefix of their package"),
    ("t nil", "used everywhere"),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("differential")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).unwrap_or_default()
}

fn is_blessing() -> bool {
    std::env::var_os("ESL_BLESS").is_some()
}

fn generated(seed: u64) -> String {
    let mut grammar = Grammar::parse(&read("grammar.txt"), seed).expect("the grammar is sound");
    let mut text =
        format!(";;;; Made from `grammar.txt` with the seed {seed}: change the grammar, not this file.\n\n");
    text.push_str(&grammar.programs().join("\n"));
    text
}

/// Returns SBCL's output for a file of programs.
fn sbcl(programs: &str) -> String {
    let output = Command::new("timeout")
        .args(["60", "sbcl", "--script", "run-sbcl.lisp", "prelude.lisp", programs])
        .current_dir(folder())
        .output()
        .expect("SBCL is installed");
    assert!(
        output.status.success(),
        "SBCL failed, or took more than a minute:\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).expect("SBCL writes UTF-8")
}

/// Returns ESL's output for programs.
fn esl(programs: &str) -> String {
    let sources = [Source::new("prelude.lisp", read("prelude.lisp")), Source::new("programs.lisp", programs)];
    let compiled = program::compile(&sources);
    let errors: Vec<&str> = compiled
        .diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.severity == esl_bytecode::diagnostic::Severity::Error)
        .map(|diagnostic| diagnostic.message.as_str())
        .collect();
    assert!(errors.is_empty(), "the programs do not compile: {errors:#?}");
    let host = VirtualHost::new();
    let captured = host.captured();
    let program = compiled.program.expect("there are no errors");
    program::run(&program, Config::default(), Box::new(host)).expect("it can start");
    captured.output()
}

#[track_caller]
fn compare(programs: &str, stored: &str) {
    let (expected, found) = (answers(stored), answers(&esl(programs)));
    let mut wrong = Vec::new();
    for (number, answer) in &expected {
        let own = found.get(number).map_or("no answer\n", String::as_str);
        if own != answer {
            let begin = format!(";;; {number}\n");
            let program = programs.split_once(&begin).map_or("", |(_, rest)| rest);
            let program = program.split("\n;;").next().unwrap_or_default();
            wrong.push(format!("{number}: {program}\nSBCL: {answer}ESL:  {own}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {} answers differ\n{}", wrong.len(), expected.len(), wrong.join("\n"));
    assert_eq!(found.len(), expected.len(), "a program has no stored answer: regenerate the answers");
}

#[test]
fn generated_programs_answer_as_under_sbcl() {
    let programs = generated(SEED);
    if is_blessing() {
        std::fs::write(folder().join("generated.lisp"), &programs).expect("the programs can be written");
        std::fs::write(folder().join("generated.answers"), sbcl("generated.lisp"))
            .expect("the answers can be written");
    }
    assert!(
        programs == read("generated.lisp"),
        "the grammar has changed: run `ESL_BLESS=1 cargo test -p esl-conformance --test language --features thorough -- differential`"
    );
    compare(&programs, &read("generated.answers"));
}

/// Needs SBCL: `ESL_SEEDS=1-12 cargo test -p esl-conformance --test language --features thorough --
/// differential --ignored`.
#[test]
#[ignore = "searches for new differences; needs SBCL"]
fn programs_of_other_seeds_answer_as_under_sbcl() {
    let seeds = std::env::var("ESL_SEEDS").unwrap_or_else(|_| "1-4".to_string());
    let (first, last) = seeds.split_once('-').unwrap_or((&seeds, &seeds));
    let number = |text: &str| text.parse::<u64>().expect("ESL_SEEDS is a number or FIRST-LAST");
    let file = std::env::temp_dir().join(format!("esl-programs-{}.lisp", std::process::id()));
    let mut failures = Vec::new();
    for seed in number(first)..=number(last) {
        let programs = generated(seed);
        std::fs::write(&file, &programs).expect("the programs can be written");
        let stored = sbcl(&file.to_string_lossy());
        let compared = std::panic::catch_unwind(|| compare(&programs, &stored));
        if compared.is_err() {
            failures.push(seed);
        }
    }
    std::fs::remove_file(&file).expect("the programs can be removed");
    assert!(failures.is_empty(), "these seeds reveal differences: {failures:?}");
}

#[test]
fn the_checklist_answers_as_under_sbcl() {
    if is_blessing() {
        std::fs::write(folder().join("checklist.answers"), sbcl("checklist.lisp"))
            .expect("the answers can be written");
    }
    compare(&read("checklist.lisp"), &read("checklist.answers"));
}

#[test]
fn every_operator_is_reached() {
    let text = (generated(SEED) + &read("checklist.lisp")).to_uppercase();
    let used: BTreeSet<&str> = text
        .split(|c: char| c.is_whitespace() || "()'`,@#\"".contains(c))
        .map(|word| word.trim_start_matches("CL:"))
        .collect();
    let mut engine =
        Engine::with(Config::default(), Box::new(VirtualHost::new())).expect("there is room for the library");
    let names = "(let ((names nil))
       (dolist (s (apropos-list \"\" \"COMMON-LISP\") (format nil \"~{~a~^ ~}\" names))
         (when (or (special-operator-p s) (macro-function s) (fboundp s) (boundp s))
           (push (symbol-name s) names))))";
    let names = engine.eval(names).expect("the names can be listed").to_string();
    let excepted: BTreeSet<String> =
        EXCEPTIONS.iter().flat_map(|(names, _)| names.split(' ')).map(str::to_uppercase).collect();
    let missing: Vec<&str> = names
        .trim_matches('"')
        .split(' ')
        .filter(|name| !used.contains(name) && !excepted.contains(*name))
        .collect();
    assert!(names.len() > 500, "the names are listed");
    assert!(
        missing.is_empty(),
        "no program uses {} names: {}",
        missing.len(),
        missing.join(" ").to_lowercase()
    );
}
