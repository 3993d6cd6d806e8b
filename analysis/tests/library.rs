//! The tables of the library name each cause with which its sources fail.

use std::collections::BTreeSet;
use std::path::Path;

use esl::host::VirtualHost;
use esl_bytecode::compile::drive;
use esl_bytecode::symbol::ESL_PACKAGE;
use esl_compiler::core::Core;
use esl_compiler::session::Compiler;
use esl_conformance::trials::{Trial, contradictions};
use esl_vm::vm::{Config, Vm};

#[test]
fn each_cause_of_the_library_is_known() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    let known: BTreeSet<String> =
        esl_analysis::causes_of_the_library().map(|cause| cause.to_lowercase()).collect();
    let mut found = BTreeSet::new();
    for entry in root.join("stdlib").read_dir().expect("the library can be listed") {
        let path = entry.expect("the library can be listed").path();
        if path.extension().is_none_or(|extension| extension != "esl") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source can be read");
        let code: String = text.lines().filter(|line| !line.starts_with(';')).collect::<Vec<_>>().join("\n");
        for call in ["(fail :", "(%fail-for :"] {
            for rest in code.split(call).skip(1) {
                let end = rest.find(|c: char| !c.is_alphanumeric() && c != '-').unwrap_or(rest.len());
                found.insert(rest[..end].to_string());
            }
        }
    }
    assert!(found.len() > 15, "{found:?}");
    let missing: Vec<&String> = found.difference(&known).collect();
    assert!(missing.is_empty(), "the tables of the library lack {missing:?}");
}

/// Compiles the library as its build does, and returns its forms.
fn library_forms() -> Vec<Core> {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("it is in the workspace").join("stdlib");
    let mut machine = Vm::new(Config::default(), Box::new(VirtualHost::new())).expect("there is memory");
    machine.set_compiler(Box::new(Compiler::default()));
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a source can be read");
    let mut forms = Vec::new();
    for name in read("load-order").lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let text = read(&format!("{name}.esl"));
        machine.enter_package(ESL_PACKAGE).expect("there is memory");
        machine.begin_unit();
        let mut compilation = Compiler::default().with_core().compile_texts(&[(name, &text)]);
        let (module, _) = drive(&mut compilation, &mut machine);
        forms.extend(compilation.take_core());
        let functions = machine.load_module(&module.expect(name)).expect(name);
        machine.run_toplevel(functions, u64::MAX).expect(name);
    }
    forms
}

#[test]
fn the_types_of_the_library_are_those_of_its_sources() {
    let table = esl_analysis::table_of_library(library_forms());
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/types/library.txt");
    if std::env::var_os("ESL_BLESS").is_some() {
        std::fs::write(&file, &table).expect("the table can be written");
    }
    let written = std::fs::read_to_string(file).expect("the table can be read");
    assert_eq!(written, table, "ESL_BLESS=1 writes the table anew");
}

/// Functions that wait for what does not come.
const WAITING: &[&str] = &["CHECKPOINT-WAIT", "SUSPEND-TASK"];

#[test]
fn calls_of_the_library_return_only_as_the_table_says() {
    let is_tried = |name: &&String| !name.starts_with('(') && !WAITING.contains(&name.as_str());
    let mut names: Vec<&String> = esl_analysis::library_types().keys().filter(is_tried).collect();
    names.sort_unstable();
    let trial = |name: &String| {
        let types = &esl_analysis::library_types()[name];
        let needs = types.positional.clone();
        Trial {
            name: name.clone(),
            counts: 0..=needs.len().min(4) as u32,
            needs,
            gives: types.result,
            tests: None,
        }
    };
    let trials: Vec<Trial> = names.into_iter().map(trial).collect();
    assert!(trials.len() > 100, "{} trials", trials.len());
    let wrong = contradictions(&trials);
    assert!(wrong.is_empty(), "{wrong:#?}");
}
