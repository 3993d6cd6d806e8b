//! Compiles the library to its image, file by file in the order of `load-order`.
//!
//! One machine runs the macros and loads each file after its compilation, so that files can use the
//! definitions of earlier ones. An error in the library is an error of the build. A warning is a warning of
//! the build, unless it is about a name that a later file defines.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a build step talks to cargo")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use esl_bytecode::compile::{Compile, Environment, GlobalFunction, GlobalVariable, drive};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::module::Module;
use esl_bytecode::symbol::ESL_PACKAGE;
use esl_bytecode::{file, link};
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::session::Compiler;
use esl_vm::host::VirtualHost;
use esl_vm::vm::{Config, Vm};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=load-order");
    let folder =
        PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo names the folder of the package"));
    let output =
        PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo names the folder for what is built"));
    std::fs::write(output.join("sources.rs"), sources(&folder)).expect("the list of sources can be written");
    match build(&folder) {
        Ok(image) => std::fs::write(output.join("image.eslb"), image).expect("the image can be written"),
        Err(text) => {
            eprintln!("{text}");
            std::process::exit(1);
        }
    }
}

/// Returns the names of the files of the library, in the order in which they are loaded.
fn load_order(folder: &Path) -> Result<Vec<String>, String> {
    let order = read(&folder.join("load-order"))?;
    let names = order.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    Ok(names.map(str::to_owned).collect())
}

/// Returns the list of sources, as Rust.
fn sources(folder: &Path) -> String {
    let names = load_order(folder).unwrap_or_default();
    let row = |name: &String| {
        let file = format!("concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/{name}.esl\")");
        format!("(\"stdlib/{name}.esl\", include_str!({file})),\n")
    };
    format!("&[\n{}]", names.iter().map(row).collect::<String>())
}

/// Returns the bytes of the image.
fn build(folder: &Path) -> Result<Vec<u8>, String> {
    let machine =
        Vm::new(Config::default(), Box::new(VirtualHost::new())).map_err(|error| format!("{error:?}"))?;
    let mut library =
        LibraryBuild { machine, sources: Sources::new(), modules: Vec::new(), doubts: Vec::new() };
    library.machine.set_compiler(Box::new(Compiler::default()));
    for name in load_order(folder)? {
        let path = folder.join(format!("{name}.esl"));
        println!("cargo::rerun-if-changed={}", path.display());
        library.add(&format!("stdlib/{name}.esl"), read(&path)?.into())?;
    }
    library.report_doubts();
    let module = esl_vm::load::prepare(link::link(library.modules));
    file::write(&module).map_err(|error| error.to_string())
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| format!("{} cannot be read: {error}", path.display()))
}

/// State of the compilation.
struct LibraryBuild {
    machine: Vm,
    sources: Sources,
    modules: Vec<Module>,
    /// Warnings about names that were not defined when they were used.
    doubts: Vec<Diagnostic>,
}

impl LibraryBuild {
    /// Compiles a file and runs it in the machine.
    fn add(&mut self, name: &str, text: Arc<str>) -> Result<(), String> {
        self.machine.enter_package(ESL_PACKAGE).map_err(|error| format!("{error:?}"))?;
        self.machine.begin_unit();
        let source = self.sources.add(name, Some(text.clone()));
        let mut compilation = Compiler::for_source(source).compile_text(name, &text);
        let (module, diagnostics) = drive(&mut *compilation, &mut self.machine);
        let (errors, warnings): (Vec<_>, Vec<_>) =
            diagnostics.into_iter().partition(|diagnostic| diagnostic.severity == Severity::Error);
        if !errors.is_empty() {
            return Err(errors.iter().map(|error| self.render(error) + "\n").collect());
        }
        for warning in warnings {
            if matches!(warning.code, "undefined-function" | "undefined-variable") {
                self.doubts.push(warning);
            } else {
                warn(&self.render(&warning));
            }
        }
        let module = module.ok_or_else(|| format!("{name} gives no module"))?;
        let functions =
            self.machine.load_module(&module).map_err(|error| format!("{name} cannot be loaded: {error}"))?;
        self.machine
            .run_toplevel(functions, u64::MAX)
            .map_err(|failure| format!("{name} fails: {failure}"))?;
        self.modules.push(module);
        Ok(())
    }

    /// Reports uses of names that no file defines.
    fn report_doubts(&mut self) {
        for doubt in std::mem::take(&mut self.doubts) {
            // The message quotes the name.
            let quoted = doubt.message.split('`').nth(1).unwrap_or("").to_uppercase();
            let setf = quoted.strip_prefix("(SETF ").and_then(|rest| rest.strip_suffix(')'));
            let (package, name) = match setf.unwrap_or(&quoted).split_once(':') {
                Some((package, name)) => (Some(package), name),
                None => (None, setf.unwrap_or(&quoted)),
            };
            let is_defined = self.machine.intern(package, name, false).is_ok_and(|symbol| match doubt.code {
                "undefined-function" if setf.is_some() => {
                    !matches!(self.machine.setf_function(&symbol), GlobalFunction::Undefined)
                }
                "undefined-function" => {
                    !matches!(self.machine.global(&symbol).function, GlobalFunction::Undefined)
                }
                _ => !matches!(self.machine.global(&symbol).variable, GlobalVariable::Undefined),
            });
            if !is_defined {
                warn(&self.render(&doubt));
            }
        }
    }

    fn render(&self, diagnostic: &Diagnostic) -> String {
        Renderer::default().render(diagnostic, &self.sources)
    }
}

fn warn(text: &str) {
    println!("cargo::warning={}", text.replace('\n', "\ncargo::warning="));
}
