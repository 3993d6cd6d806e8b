//! Puts a defect back into the library of a machine, by recompiling some of its functions from a changed
//! text.

use std::path::Path;
use std::sync::Arc;

use esl::host::VirtualHost;
use esl::{Config, Error, program};
use esl_bytecode::compile::{Compile, drive};
use esl_bytecode::diagnostic::Severity;
use esl_bytecode::module::Module;
use esl_bytecode::symbol::{ESL_PACKAGE, USER_PACKAGE};
use esl_compiler::diagnostic::Sources;
use esl_compiler::session::Compiler;
use esl_vm::vm::Vm;

/// A textual change of the library: file, old text, which must occur exactly once, and new text.
pub(crate) type TextChange = (&'static str, &'static str, &'static str);

/// Changed functions for the library of a machine.
pub(crate) struct Defect {
    module: Module,
}

/// Returns the functions of the library that `changes` affect, changed and compiled.
pub(crate) fn changed_functions(changes: &[TextChange]) -> Defect {
    let mut texts: Vec<(&str, String)> = Vec::new();
    for &(file, from, to) in changes {
        let index = texts.iter().position(|(name, _)| *name == file).unwrap_or_else(|| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../stdlib").join(file);
            texts.push((file, std::fs::read_to_string(path).expect("the library has such a file")));
            texts.len() - 1
        });
        let text = &mut texts[index].1;
        assert_eq!(text.matches(from).count(), 1, "{file} must contain this once: {from}");
        *text = text.replace(from, &format!("{MARK}{to}"));
    }
    let functions: String =
        texts.iter().flat_map(|(_, text)| forms(text)).filter(|form| form.contains(MARK)).collect();
    Defect { module: compile(&functions.replace(MARK, "")) }
}

/// Marks a changed place in a text.
const MARK: char = '\u{1}';

/// Returns the top-level forms of a file, each of which starts at the beginning of a line.
fn forms(text: &str) -> impl Iterator<Item = String> {
    text.split("\n(").skip(1).map(|form| format!("\n({form}"))
}

fn compile(text: &str) -> Module {
    let mut machine =
        program::machine(Config::default(), Box::new(VirtualHost::new())).expect("there is room");
    let mut module = None;
    opened(&mut machine, |machine| {
        machine.begin_unit();
        let source = Sources::new().add("defect.esl", Some(Arc::from(text)));
        let mut compilation = Compiler::for_source(source).compile_text("defect.esl", text);
        let (compiled, diagnostics) = drive(&mut *compilation, machine);
        let errors: Vec<_> =
            diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Error).collect();
        assert!(errors.is_empty(), "{errors:?}\n{text}");
        module = compiled;
        Ok(())
    })
    .expect("the package of the library is there");
    module.expect("the functions compile")
}

/// Does `work` in a machine whose language packages are unlocked for the duration.
fn opened(machine: &mut Vm, work: impl FnOnce(&mut Vm) -> Result<(), Error>) -> Result<(), Error> {
    machine.unseal();
    machine.enter_package(ESL_PACKAGE).map_err(|_| Error::NoMemory("a package"))?;
    work(machine)?;
    machine.enter_package(USER_PACKAGE).map_err(|_| Error::NoMemory("a package"))?;
    machine.seal();
    Ok(())
}

impl Defect {
    /// Replaces the functions in a machine's library.
    pub(crate) fn put_into(&self, machine: &mut Vm) -> Result<(), Error> {
        opened(machine, |machine| {
            let functions = machine.load_module(&self.module)?;
            machine.run_toplevel(functions, u64::MAX)?;
            Ok(())
        })
    }
}
