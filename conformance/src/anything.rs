//! Entry points for arbitrary input, used by tests and fuzzing to look for panics, hangs and gaps in the
//! verifier.
//!
//! Runs have small limits of ticks and memory and a host without files, so every run ends soon.

use std::time::{Duration, Instant};

use esl::Config;
use esl::host::{Rights, VirtualHost};
use esl::program;
use esl::replay::{self, Recorded};
use esl_bytecode::compile::{Compile, drive};
use esl_bytecode::module::Module;
use esl_bytecode::span::SourceId;
use esl_bytecode::{file, verify};
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::session::Compiler;
use esl_vm::vm::Vm;

/// Limit of a run, in ticks.
const TICKS: u64 = 100_000;
/// Longest time for one step on an input. The limit of ticks ends a run long before that, unless the limit is
/// broken.
const PATIENCE: Duration = Duration::from_secs(20);

fn machine() -> Vm {
    let config =
        Config { memory: 24 << 20, stack: Some(1 << 13), budget: Some(3 * TICKS), ..Config::default() };
    let host = VirtualHost::new().with_output_limit(1 << 20).with_rights(Rights::none());
    program::machine(config, Box::new(host)).expect("there is room for the library")
}

/// Does `work`, and panics if it takes too long.
fn hasten<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    assert!(start.elapsed() < PATIENCE, "{what} took {:?}", start.elapsed());
    result
}

/// Reads bytes as data. Returns the numbers of data and of diagnostics.
pub fn read(bytes: &[u8]) -> (usize, usize) {
    hasten("reading", || esl_compiler::reader::read_anything(bytes))
}

/// Compiles a text, renders its diagnostics, and verifies the module if there is one.
///
/// # Panics
/// If the verifier refuses the compiled module.
pub fn compile(text: &str) -> Option<Module> {
    let mut machine = machine();
    let source = SourceId::default();
    let mut compilation = Compiler::for_source(source).compile_text("anything.esl", text);
    let (module, diagnostics) = hasten("compiling", || drive(&mut *compilation, &mut machine));
    let mut sources = Sources::new();
    sources.add("anything.esl", Some(text.into()));
    for diagnostic in diagnostics.iter().take(100) {
        Renderer::default().render(diagnostic, &sources);
    }
    if let Some(module) = &module {
        verify::verify(module).expect("the verifier accepts compiled modules");
    }
    module
}

/// Verifies a module and runs it if it is accepted. Returns whether it was accepted.
pub fn run(module: &Module) -> bool {
    if verify::verify(module).is_err() {
        return false;
    }
    let mut machine = machine();
    let Ok(functions) = machine.load_module(module) else { return false };
    // Any outcome is legal.
    drop(hasten("running", || machine.run_toplevel(functions, TICKS)));
    true
}

/// Reads bytes as a bytecode file, and runs the module if the verifier accepts it. Returns whether it did.
pub fn run_file(bytes: &[u8]) -> bool {
    match file::read(bytes) {
        Ok(module) => run(&module),
        Err(error) => {
            drop(error.to_string());
            false
        }
    }
}

/// Reads bytes as a recorded run, as they are and with corrected checksums. Returns how often they were one.
pub fn read_recording(bytes: &[u8]) -> usize {
    let corrected = with_checksums_of_frames(bytes);
    let read = |bytes: &[u8]| match Recorded::read(bytes) {
        Ok(recorded) => usize::from(recorded.last_check().is_none_or(|check| check.round < u64::MAX)),
        Err(error) => {
            drop(error.to_string());
            0
        }
    };
    hasten("reading", || read(bytes) + read(&corrected))
}

/// Returns the bytes as a recorded run with corrected checksums, as far as its frames can be found.
fn with_checksums_of_frames(bytes: &[u8]) -> Vec<u8> {
    const BEFORE: usize = 12;
    const FRAME: usize = 11;
    let mut file = bytes.to_vec();
    if file.len() < BEFORE {
        return file;
    }
    file[..8].copy_from_slice(&replay::MAGIC);
    file[8..BEFORE].copy_from_slice(&replay::FORMAT.to_le_bytes());
    let mut at = BEFORE;
    while file.len() >= at + FRAME {
        let length = u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]) as usize;
        // A length of its own would end the walk at the first frame.
        let length = length.min(file.len() - at - FRAME);
        file[at..at + 4].copy_from_slice(&(length as u32).to_le_bytes());
        let checksum = crc32fast::hash(&file[at + FRAME..at + FRAME + length]);
        file[at + 4..at + 8].copy_from_slice(&checksum.to_le_bytes());
        let checksum = crc32fast::hash(&file[at..at + 9]) as u16;
        file[at + 9..at + FRAME].copy_from_slice(&checksum.to_le_bytes());
        at += FRAME + length;
    }
    file
}

/// Returns the bytes as a file with corrected checksums, as far as its sections can be found: fuzzing looks
/// for damage that checksums do not reveal.
pub fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    const TABLE: usize = 32;
    const ENTRY: usize = 16;
    const HEADER: usize = TABLE + 6 * ENTRY + 4;
    let mut file = bytes.to_vec();
    if file.len() < HEADER {
        return file;
    }
    let word = |file: &[u8], at: usize| {
        file[at..at + 4].iter().rev().fold(0_usize, |word, &byte| word << 8 | usize::from(byte))
    };
    for entry in (TABLE..HEADER - 4).step_by(ENTRY) {
        let (start, length) = (word(&file, entry + 4), word(&file, entry + 8));
        if let Some(section) = start.checked_add(length).and_then(|end| file.get(start..end)) {
            let checksum = crc32fast::hash(section);
            file[entry + 12..entry + 16].copy_from_slice(&checksum.to_le_bytes());
        }
    }
    let checksum = crc32fast::hash(&file[..HEADER - 4]);
    file[HEADER - 4..HEADER].copy_from_slice(&checksum.to_le_bytes());
    file
}
