//! Entry points for arbitrary input, used by tests and fuzzing to look for panics, hangs and gaps in the
//! verifier.
//!
//! Runs have small limits of ticks and memory and a host without files, so every run ends soon.

use std::cell::RefCell;
use std::sync::{Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

use esl::Config;
use esl::host::{Rights, VirtualHost};
use esl::program;
use esl_bytecode::compile::{Compile, drive};
use esl_bytecode::module::Module;
use esl_bytecode::span::SourceId;
use esl_bytecode::symbol::USER_PACKAGE;
use esl_bytecode::{file, verify};
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_compiler::session::Compiler;
use esl_replay::{self as replay, Recorded, Rerun};
#[cfg(feature = "native")]
use esl_vm::vm::Tier;
use esl_vm::vm::Vm;

/// Limit of a run, in ticks.
const TICKS: u64 = 100_000;
/// Longest time for one step on an input. The limit of ticks ends a run long before that, unless the limit is
/// broken.
const PATIENCE: Duration = Duration::from_secs(20);

/// Number of inputs that one machine serves, one after the other, where speed matters.
const SERVED: usize = 64;

fn config() -> Config {
    Config { memory: 24 << 20, stack: Some(1 << 13), budget: Some(3 * TICKS), ..Config::default() }
}

fn machine() -> Vm {
    let host = VirtualHost::new().with_output_limit(1 << 20).with_rights(Rights::none());
    program::machine(config(), Box::new(host)).expect("there is room for the library")
}

thread_local! {
    /// The machine that serves inputs, and the number of those that it has served.
    static SERVING: RefCell<Option<(Vm, usize)>> = const { RefCell::new(None) };
}

/// The inputs that the machine of [`SERVING`] has been given: what it does with the last may depend on them.
static GIVEN: Mutex<Vec<String>> = Mutex::new(Vec::new());
static TELLS: Once = Once::new();

/// Compiles a text as a program and runs it. The machine has served other texts before: to make it takes a
/// hundred times as long as to compile and run a small text. If this panics, all of them are printed.
///
/// # Panics
/// If the verifier refuses the compiled module.
pub fn compile_and_run(text: &str) {
    TELLS.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let given = GIVEN.lock().unwrap_or_else(PoisonError::into_inner);
            #[allow(clippy::print_stderr, reason = "a fuzz target has no other way to tell")]
            for (number, text) in given.iter().enumerate() {
                eprintln!(";;; input {number} of this machine\n{text}");
            }
            drop(given);
            before(panic);
        }));
    });
    SERVING.with_borrow_mut(|serving| {
        // The lock is not held while a machine works: if that panics, the hook takes it.
        let is_fresh = serving.is_none();
        let (machine, served) = serving.get_or_insert_with(|| (machine(), 0));
        let mut given = GIVEN.lock().unwrap_or_else(PoisonError::into_inner);
        if is_fresh {
            given.clear();
        }
        given.push(text.to_string());
        drop(given);
        *served += 1;
        machine.begin_program(config());
        let mut is_full = machine.enter_package(USER_PACKAGE).is_err();
        if let Some(module) = compile_on(machine, text) {
            machine.begin_program(config());
            if !run_on(machine, &module) {
                is_full = true;
                assert!(run(&module), "a compiled module is loaded");
            }
        }
        // Tasks left behind by a text must not run among those of the next.
        if is_full || *served >= SERVED || !machine.task_figures().is_empty() {
            *serving = None;
        }
    });
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
    compile_on(&mut machine(), text)
}

fn compile_on(machine: &mut Vm, text: &str) -> Option<Module> {
    let source = SourceId::default();
    let mut compilation = Compiler::for_source(source).compile_text("anything.esl", text);
    let (module, diagnostics) = hasten("compiling", || drive(&mut *compilation, machine));
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
    verify::verify(module).is_ok() && run_on(&mut machine(), module)
}

fn run_on(machine: &mut Vm, module: &Module) -> bool {
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

/// The part of a run that does not depend on how functions run.
#[cfg(feature = "native")]
#[derive(Debug, PartialEq)]
struct TierCourse {
    output: String,
    errors: String,
    ticks: u64,
    canary: u64,
    has_ended_well: bool,
}

/// Verifies a module, and runs it by the interpreter and as machine code if it is accepted. Returns whether
/// it was.
///
/// # Panics
/// If the runs differ.
#[cfg(feature = "native")]
pub fn run_in_tiers(module: &Module, slice: u32) -> bool {
    let course = |tier: Tier| {
        let host = VirtualHost::new().with_output_limit(1 << 20).with_rights(Rights::none());
        let captured = host.captured();
        let config = Config { slice, ..config() };
        let mut machine = program::machine(config, Box::new(host)).expect("there is room for the library");
        machine.set_tier(tier);
        let functions = machine.load_module(module).ok()?;
        let result = machine.run_toplevel(functions, TICKS);
        Some(TierCourse {
            output: captured.output(),
            errors: captured.error(),
            ticks: machine.ticks(),
            canary: machine.canary(),
            has_ended_well: result.is_ok(),
        })
    };
    if verify::verify(module).is_err() {
        return false;
    }
    assert_eq!(course(Tier::Interpreter), course(Tier::Native));
    true
}

/// As [`run_in_tiers`], for a bytecode file.
#[cfg(feature = "native")]
pub fn run_file_in_tiers(bytes: &[u8]) -> bool {
    file::read(bytes).is_ok_and(|module| run_in_tiers(&module, 50))
}

/// Reads bytes as a recorded run, as they are and with corrected checksums, and replays the beginning of what
/// is one. Returns how often they were one.
pub fn read_recording(bytes: &[u8]) -> usize {
    let corrected = with_checksums_of_frames(bytes);
    let read = |bytes: &[u8]| match Recorded::read(bytes) {
        Ok(recorded) => {
            // Whether it is the recorded run is all the same.
            if let Ok(mut rerun) = Rerun::begin(&recorded, |_, _| ()) {
                _ = rerun.run(TICKS);
            }
            usize::from(recorded.last_check().is_none_or(|check| check.round < u64::MAX))
        }
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
    const HEADER: usize = TABLE + file::Section::ALL.len() * ENTRY + 4;
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
