//! Compiles the library to its images, file by file in the order of `load-order`: that of every machine, and
//! that of the part for operators, which is in the folder `operators/`.
//!
//! One machine runs the macros and loads each file after its compilation, so that files can use the
//! definitions of earlier ones. An error in the library is an error of the build. A warning is a warning of
//! the build, unless it is about a name that a later file defines.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a build step talks to cargo")]

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use esl_bytecode::compile::{Compile, Environment, GlobalFunction, GlobalVariable, drive};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::file::WriteError;
use esl_bytecode::module::Module;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::ESL_PACKAGE;
use esl_bytecode::{file, link};
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::session::Compiler;
use esl_host::VirtualHost;
use esl_vm::load::LoadError;
use esl_vm::raise::CONDITIONS;
use esl_vm::records::RECORDS;
use esl_vm::run::CallError;
use esl_vm::vm::{Config, Vm};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    PARTS.iter().for_each(|part| println!("cargo::rerun-if-changed={}load-order", part.folder));
    let folder =
        PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo names the folder of the package"));
    let output = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo names the folder for built files"));
    std::fs::write(output.join("sources.rs"), sources(&folder)).expect("the list of sources can be written");
    match build(&folder) {
        Ok(images) => {
            for (part, image) in PARTS.iter().zip(images) {
                std::fs::write(output.join(part.image), image).expect("the image can be written");
            }
        }
        Err(text) => {
            eprintln!("{text}");
            std::process::exit(1);
        }
    }
}

/// A part of the library, which is compiled to an image.
struct Part {
    /// Its folder, with a slash at its end unless it is that of the package.
    folder: &'static str,
    /// The file of its image.
    image: &'static str,
}

/// All parts, in the order in which they are compiled: a part knows those before it.
const PARTS: [Part; 2] =
    [Part { folder: "", image: "library.eslb" }, Part { folder: "operators/", image: "operators.eslb" }];

/// Reason why there is no image.
enum BuildError {
    /// A file cannot be read.
    Unreadable(PathBuf, std::io::Error),
    /// The machine has no memory.
    NoMemory,
    /// A file does not compile. Holds the errors as they are shown.
    DoesNotCompile(String),
    /// A file gives no module.
    NoModule(String),
    /// A file cannot be loaded.
    NotLoaded(String, LoadError),
    /// The top level of a file fails.
    Fails(String, Box<CallError>),
    /// The library contains an object that no file can hold.
    NotWritten(WriteError),
    /// A record, or a condition, has other fields than the machine takes it to have: its name, the fields that
    /// it has, and those that the machine expects.
    OtherFields(String, Vec<String>, Vec<String>),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BuildError::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            BuildError::NoMemory => f.write_str("not enough memory for a machine"),
            BuildError::DoesNotCompile(errors) => f.write_str(errors),
            BuildError::NoModule(name) => write!(f, "{name} gives no module"),
            BuildError::NotLoaded(name, error) => write!(f, "{name} cannot be loaded: {error}"),
            BuildError::Fails(name, failure) => write!(f, "{name} fails: {failure}"),
            BuildError::NotWritten(error) => error.fmt(f),
            BuildError::OtherFields(name, found, expected) => write!(
                f,
                "`{name}` has the fields {}, where the machine expects {}: change the row of \
                 `vm/src/names/records.rs` or `vm/src/raise.rs` with the definition",
                found.join(" "),
                expected.join(" ")
            ),
        }
    }
}

/// Returns the names of the files of a part, in the order in which they are loaded.
fn load_order(folder: &Path, part: &Part) -> Result<Vec<String>, BuildError> {
    let order = read(&folder.join(format!("{}load-order", part.folder)))?;
    let names = order.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    Ok(names.map(|name| format!("{}{name}", part.folder)).collect())
}

/// Returns the list of sources, as Rust.
fn sources(folder: &Path) -> String {
    let names = PARTS.iter().flat_map(|part| load_order(folder, part).unwrap_or_default());
    let row = |name: String| {
        let file = format!("concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/{name}.esl\")");
        format!("(\"stdlib/{name}.esl\", include_str!({file})),\n")
    };
    format!("&[\n{}]", names.map(row).collect::<String>())
}

/// Returns the bytes of the images.
fn build(folder: &Path) -> Result<Vec<Vec<u8>>, BuildError> {
    let machine = Vm::new(Config::default(), Box::new(VirtualHost::new()));
    let machine = machine.map_err(|_| BuildError::NoMemory)?;
    let mut library =
        LibraryBuild { machine, sources: Sources::new(), modules: Vec::new(), doubts: Vec::new() };
    library.machine.set_compiler(Box::new(Compiler::default()));
    let mut images = Vec::new();
    for part in &PARTS {
        for name in load_order(folder, part)? {
            let path = folder.join(format!("{name}.esl"));
            println!("cargo::rerun-if-changed={}", path.display());
            library.add(&format!("stdlib/{name}.esl"), read(&path)?.into())?;
        }
        library.report_doubts();
        let module = esl_vm::load::prepare(link::link(std::mem::take(&mut library.modules)));
        images.push(file::write(&module).map_err(BuildError::NotWritten)?);
    }
    library.check_fields()?;
    Ok(images)
}

fn read(path: &Path) -> Result<String, BuildError> {
    std::fs::read_to_string(path).map_err(|error| BuildError::Unreadable(path.into(), error))
}

/// State of the compilation.
struct LibraryBuild {
    machine: Vm,
    sources: Sources,
    /// The modules of the part that is compiled.
    modules: Vec<Module>,
    /// Warnings about names that were not defined when they were used.
    doubts: Vec<Diagnostic>,
}

impl LibraryBuild {
    /// Compiles a file and runs it in the machine.
    fn add(&mut self, name: &str, text: Arc<str>) -> Result<(), BuildError> {
        self.machine.enter_package(ESL_PACKAGE).map_err(|_| BuildError::NoMemory)?;
        self.machine.begin_unit();
        let source = self.sources.add(name, Some(text.clone()));
        let mut compilation = Compiler::for_source(source).compile_text(name, &text);
        let (module, diagnostics) = drive(&mut *compilation, &mut self.machine);
        let (errors, warnings): (Vec<_>, Vec<_>) =
            diagnostics.into_iter().partition(|diagnostic| diagnostic.severity == Severity::Error);
        if !errors.is_empty() {
            let errors = errors.iter().map(|error| self.render(error) + "\n").collect();
            return Err(BuildError::DoesNotCompile(errors));
        }
        for warning in warnings {
            if matches!(warning.code, "undefined-function" | "undefined-variable") {
                self.doubts.push(warning);
            } else {
                warn(&self.render(&warning));
            }
        }
        let module = module.ok_or_else(|| BuildError::NoModule(name.into()))?;
        let loaded = self.machine.load_module(&module);
        let functions = loaded.map_err(|error| BuildError::NotLoaded(name.into(), error))?;
        let ran = self.machine.run_toplevel(functions, u64::MAX);
        ran.map_err(|failure| BuildError::Fails(name.into(), Box::new(failure)))?;
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

    /// Checks that the machine finds the fields of records, and the slots of conditions, where they are.
    fn check_fields(&mut self) -> Result<(), BuildError> {
        for &(name, fields) in RECORDS {
            let as_in_library = |name: &str| name.to_uppercase().replace('_', "-");
            let (name, fields) =
                (format!("%{}", as_in_library(name)), fields.iter().copied().map(as_in_library));
            let found = self.names_of("GET", &name, Some("%FIELDS"));
            expect_fields(name, found, fields.collect())?;
        }
        for &(class, slots) in CONDITIONS {
            let found = self.names_of("%CLASS-SLOTS", class, None);
            expect_fields(class.into(), found, slots.iter().map(|&slot| slot.into()).collect())?;
        }
        Ok(())
    }

    /// Returns the list of names that a function returns for a name and another one.
    fn names_of(&mut self, function: &str, name: &str, other: Option<&str>) -> Vec<String> {
        let names = [Some(function), Some(name), other].into_iter().flatten();
        let symbols = names.map(|name| self.machine.intern(None, name, false).map(DatumKind::Symbol));
        let Ok(symbols) = symbols.collect::<Result<Vec<_>, _>>() else { return Vec::new() };
        let data = symbols.into_iter().map(|symbol| Datum::new(symbol, Span::default()));
        let Ok(values) = data.map(|datum| self.machine.import(&datum)).collect::<Result<Vec<_>, _>>() else {
            return Vec::new();
        };
        let Ok(found) = self.machine.call(values[0], &values[1..], u64::MAX) else { return Vec::new() };
        let found = found.first().and_then(|&list| self.machine.export(list).ok());
        let names = found.iter().flat_map(Datum::elements).filter_map(Datum::as_symbol);
        names.map(|symbol| symbol.name().to_owned()).collect()
    }

    fn render(&self, diagnostic: &Diagnostic) -> String {
        Renderer::default().render(diagnostic, &self.sources)
    }
}

fn expect_fields(name: String, found: Vec<String>, expected: Vec<String>) -> Result<(), BuildError> {
    if found == expected { Ok(()) } else { Err(BuildError::OtherFields(name, found, expected)) }
}

fn warn(text: &str) {
    println!("cargo::warning={}", text.replace('\n', "\ncargo::warning="));
}
