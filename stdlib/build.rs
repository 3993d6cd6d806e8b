//! Compiles the library to its image: every file of `load-order`, in that order, in one machine, so that each may use what
//! the ones before it define.

use std::path::Path;

use esl_bytecode::compile::{Compile, drive};
use esl_bytecode::diagnostic::Severity;
use esl_bytecode::span::SourceId;
use esl_bytecode::{file, link};
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::session::Compiler;
use esl_vm::host::VirtualHost;
use esl_vm::vm::{Config, Vm};

fn main() {
    let folder = std::env::var("CARGO_MANIFEST_DIR").expect("cargo names the folder of the package");
    let output = std::env::var("OUT_DIR").expect("cargo names the folder for what is built");
    let folder = Path::new(&folder);
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=load-order");
    let order = std::fs::read_to_string(folder.join("load-order")).expect("`load-order` can be read");
    let mut machine = Vm::new(Config::default(), Box::new(VirtualHost::new())).expect("there is memory for a machine");
    let mut sources = Sources::new();
    let mut modules = Vec::new();
    for name in order.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let name = format!("{name}.esl");
        println!("cargo::rerun-if-changed={name}");
        let text = std::fs::read_to_string(folder.join(&name));
        let text = text.unwrap_or_else(|error| panic!("{name}, named in `load-order`, cannot be read: {error}"));
        let id: SourceId = sources.add(format!("stdlib/{name}"), Some(text.as_str().into()));
        machine.begin_unit();
        let compiler = Compiler::for_source(id);
        let (module, diagnostics) =
            drive(&mut *compiler.compile_text(&format!("stdlib/{name}"), &text), &mut machine);
        let mut is_sound = true;
        for diagnostic in &diagnostics {
            let rendered = Renderer::default().render(diagnostic, &sources);
            if diagnostic.severity == Severity::Error {
                is_sound = false;
                eprintln!("{rendered}\n");
            } else {
                println!("cargo::warning={}", rendered.replace('\n', "\ncargo::warning="));
            }
        }
        let Some(module) = module.filter(|_| is_sound) else { panic!("{name} does not compile") };
        // The files after this one are compiled with what this one defines.
        let functions = machine.load_module(&module);
        let functions = functions.unwrap_or_else(|error| panic!("{name} cannot be loaded: {error}"));
        if let Err(failure) = machine.run_toplevel(functions, u64::MAX) {
            panic!("{name} fails: {failure}");
        }
        modules.push(module);
    }
    let image = file::write(&link::link(modules)).expect("the library holds nothing but data");
    std::fs::write(Path::new(&output).join("image.eslb"), image).expect("the image can be written");
}
