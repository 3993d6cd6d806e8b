//! Programs: compiling source files, keeping the result in a file, running it to its end.

use std::sync::Arc;

use esl_bytecode::compile::drive_with;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::module::Module;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_bytecode::verify::verify;
use esl_bytecode::{disasm, file};
use esl_compiler::diagnostic::{Sources, code};
use esl_compiler::session::Compiler;
use esl_vm::host::{FileAccess, Host, RealHost};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::vm::{Config, Vm};

use crate::library::Library;

/// A source text and what it is called in diagnostics and backtraces.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its name: a path, or `<stdin>`.
    pub name: String,
    /// The text.
    pub text: Arc<str>,
}

impl Source {
    /// A source.
    pub fn new(name: impl Into<String>, text: impl Into<Arc<str>>) -> Source {
        Source { name: name.into(), text: text.into() }
    }
}

/// A compiled program.
#[derive(Clone, Debug)]
pub struct Program {
    module: Module,
}

/// What became of a compilation.
#[derive(Debug)]
pub struct Compiled {
    /// The program, unless there was an error.
    pub program: Option<Program>,
    /// Everything that was found, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// The sources that the diagnostics speak of.
    pub sources: Sources,
}

impl Compiled {
    /// Whether an error was found.
    pub fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
    }
}

/// The ticks that a macro, or another part of the program that runs at compile time, may take.
const COMPILE_TIME_CONFIG: Config = Config::DEFAULT;

/// Compiles sources to one program that runs them in order. They are one unit: functions may be called before the source
/// that defines them, and macros used after it. Each begins in the package `ESL-USER`.
///
/// Macros run in a machine of their own, and what they define is gone when the compilation is over. The sources cannot require
/// modules.
pub fn compile(sources: &[Source]) -> Compiled {
    compile_with(sources, &Library::none(), Modules::Inside)
}

/// What becomes of the modules that a program requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modules {
    /// They are part of it.
    Inside,
    /// It finds them when it runs.
    Apart,
}

/// As [`compile`], with the modules of a library.
pub fn compile_with(sources: &[Source], library: &Library, modules: Modules) -> Compiled {
    let mut compiler = Compiler::default();
    if modules == Modules::Apart {
        compiler = compiler.apart();
    }
    let texts: Vec<(&str, &str)> = sources.iter().map(|source| (&*source.name, &*source.text)).collect();
    let mut compilation = compiler.compile_texts(&texts);
    let mut machine = match compile_time_machine(library) {
        Ok(machine) => machine,
        Err(text) => {
            let diagnostic = code::COMPILE_TIME_FAILURE.at(Span::default(), text);
            return Compiled {
                program: None,
                diagnostics: vec![diagnostic],
                sources: compilation.sources().clone(),
            };
        }
    };
    let (module, diagnostics) = drive_with(&mut compilation, &mut machine, &mut |name| library.find(name));
    let program = module.map(|module| Program { module });
    Compiled { program, diagnostics, sources: compilation.sources().clone() }
}

/// The machine in which macros run: it may read the modules of the library.
fn compile_time_machine(library: &Library) -> Result<Vm, String> {
    let files = FileAccess::Under(library.folders().to_vec());
    let mut machine = machine(COMPILE_TIME_CONFIG, Box::new(RealHost::new(Vec::new()).with_files(files)))?;
    set_library(&mut machine, library)?;
    Ok(machine)
}

impl Program {
    /// Reads a program from the bytes of an `.eslb` file, and verifies it.
    ///
    /// # Errors
    /// A text that says what is wrong and what to do.
    pub fn from_bytes(bytes: &[u8]) -> Result<Program, String> {
        let module = file::read(bytes).map_err(|error| error.to_string())?;
        verify(&module).map_err(|error| error.to_string())?;
        Ok(Program { module })
    }

    /// The bytes of an `.eslb` file.
    ///
    /// # Errors
    /// A text, if the program contains what cannot be written to a file.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        file::write(&self.module).map_err(|error| error.to_string())
    }

    /// The program as text, instruction by instruction.
    pub fn disassemble(&self) -> String {
        disasm::module(&self.module)
    }
}

/// A source with its macros expanded, as text, and what was found on the way. Modules that it requires are left out.
pub fn expand(source: &Source, library: &Library) -> (String, Compiled) {
    let mut expansion = Compiler::default().apart().expand_text(&source.name, &source.text);
    match compile_time_machine(library) {
        Ok(mut machine) => {
            let (_, diagnostics) = drive_with(&mut expansion, &mut machine, &mut |name| library.find(name));
            let sources = expansion.sources().clone();
            (expansion.expansion().to_string(), Compiled { program: None, diagnostics, sources })
        }
        Err(text) => {
            let diagnostic = code::COMPILE_TIME_FAILURE.at(Span::default(), text);
            let sources = expansion.sources().clone();
            (String::new(), Compiled { program: None, diagnostics: vec![diagnostic], sources })
        }
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The program has come to its end, or has asked to end with this status.
    Normally(u8),
    /// A failure left the main task.
    Failed,
    /// A failure for want of memory left the main task.
    HeapExhausted,
    /// The budget of the run is spent.
    BudgetSpent,
    /// Everything waits for something that cannot come.
    Deadlocked,
    /// It was interrupted from outside.
    Interrupted,
}

impl Ended {
    /// The exit status of the command that ran it.
    pub fn status(self) -> u8 {
        match self {
            Ended::Normally(status) => status,
            Ended::Failed => 1,
            Ended::Deadlocked => 4,
            Ended::BudgetSpent | Ended::HeapExhausted => 5,
            Ended::Interrupted => crate::command::INTERRUPTED,
        }
    }
}

/// What a run has done, beside its effects.
#[derive(Clone, Debug)]
pub struct Report {
    /// How it ended.
    pub ended: Ended,
    /// Ticks that it took.
    pub ticks: u64,
    /// Tasks that it made, the main one included.
    pub tasks: u64,
    /// Turns that they had.
    pub turns: u64,
    /// How many of these came after one of another task.
    pub switches: u64,
    /// Figures of its heap.
    pub heap: esl_vm::heap::HeapStats,
}

/// A machine with the library, and with a compiler for `eval` and `load`.
///
/// # Errors
/// A text, if the limit of memory leaves no room for the library.
pub fn machine(config: Config, host: Box<dyn Host + Send>) -> Result<Vm, String> {
    let no_room = |_| "the memory limit leaves no room for the library".to_string();
    // The library is taken in at full speed; what is asked for counts from the program on.
    let unhurried =
        Config { slice: COMPILE_TIME_CONFIG.slice, budget: None, collect_always: false, ..config.clone() };
    let mut machine = Vm::new(unhurried, host).map_err(no_room)?;
    machine.set_compiler(Box::new(Compiler::default()));
    esl_stdlib::load(&mut machine)?;
    machine.begin_program(config);
    Ok(machine)
}

/// Has a machine write what happens to `failures`, `goals` or `tasks` to its error output. Nothing changes if `traces` is empty.
///
/// # Errors
/// A text, if there is no room for that.
pub fn set_traces(machine: &mut Vm, traces: &[String]) -> Result<(), String> {
    if traces.is_empty() {
        return Ok(());
    }
    let keywords =
        traces.iter().map(|name| Datum::symbol(Symbol::keyword(&name.to_uppercase()), Span::default()));
    let list = Datum::list(keywords.collect::<Vec<_>>(), Span::default());
    let list = machine.import(&list).map_err(|_| "there is no room for the names of traces".to_string())?;
    let function = machine.library_function("%SET-TRACES").map_err(|error| error.to_string())?;
    machine.call(function, &[list], u64::MAX).map_err(|error| error.to_string())?;
    machine.trace_tasks(traces.iter().any(|name| name == "tasks"));
    Ok(())
}

/// Has `require` look into the folders of a library.
///
/// # Errors
/// A text, if there is no room for their names.
pub fn set_library(machine: &mut Vm, library: &Library) -> Result<(), String> {
    let nowhere = Span::default();
    let folders = library.folders().iter().map(|folder| folder.to_string_lossy());
    let list =
        Datum::list(folders.map(|folder| Datum::string(&folder, nowhere)).collect::<Vec<_>>(), nowhere);
    let list = machine.import(&list).map_err(|_| "there is no room for the names of folders".to_string())?;
    let function = machine.library_function("%SET-MODULE-PATH").map_err(|error| error.to_string())?;
    machine.call(function, &[list], u64::MAX).map_err(|error| error.to_string())?;
    Ok(())
}

/// Runs a program to its end.
///
/// # Errors
/// A text, if the program could not be begun: no room for it, or damaged.
pub fn run(program: &Program, config: Config, host: Box<dyn Host + Send>) -> Result<Report, String> {
    let mut machine = machine(config, host)?;
    run_in(&mut machine, program)
}

/// Loads a program into a machine that has the library, and makes its main task. Running the machine runs it.
///
/// # Errors
/// As [`run`].
pub fn begin(machine: &mut Vm, program: &Program) -> Result<TaskId, String> {
    let functions = machine.load_module(&program.module).map_err(|error| error.to_string())?;
    let main = machine.spawn_library("%RUN-TOPLEVEL", &[functions]).map_err(|error| error.to_string())?;
    machine.set_interruptible(Some(main));
    machine.set_main(main);
    Ok(main)
}

/// Runs a program in a machine that has the library.
///
/// # Errors
/// As [`run`].
pub fn run_in(machine: &mut Vm, program: &Program) -> Result<Report, String> {
    let main = begin(machine, program)?;
    let outcome = machine.run(u64::MAX);
    let ended = end(machine, main, outcome);
    let (tasks, turns, switches) = machine.tasks_turns_and_switches();
    Ok(Report { ended, ticks: machine.ticks(), tasks, turns, switches, heap: machine.heap_stats() })
}

/// How a program with this main task has ended; reports what there is to report.
pub(crate) fn end(machine: &mut Vm, main: TaskId, outcome: RunOutcome) -> Ended {
    machine.flush();
    if let Some(report) = machine.report(main) {
        machine.complain(&report);
    }
    match (outcome, machine.result(main)) {
        (RunOutcome::BudgetSpent, _) => Ended::BudgetSpent,
        (RunOutcome::Waiting, _) => {
            let report = machine.deadlock_report();
            machine.complain(&report);
            Ended::Deadlocked
        }
        (_, TaskResult::Failed(condition)) if machine.is_heap_exhausted(condition) => Ended::HeapExhausted,
        (_, TaskResult::Failed(_)) => Ended::Failed,
        (_, TaskResult::Aborted) if machine.exit_status().is_none() => {
            if machine.was_interrupted() {
                Ended::Interrupted
            } else {
                Ended::Failed
            }
        }
        _ => Ended::Normally(machine.exit_status().unwrap_or(0)),
    }
}

#[cfg(test)]
mod tests {
    use esl_vm::host::VirtualHost;

    use super::*;

    /// The messages about sources that are compiled together, and what the program prints.
    fn run_together(texts: &[&str]) -> (Vec<String>, String) {
        let sources: Vec<Source> = texts
            .iter()
            .enumerate()
            .map(|(index, text)| Source::new(format!("{index}.esl"), *text))
            .collect();
        let compiled = compile(&sources);
        let place = |diagnostic: &Diagnostic| {
            let span = diagnostic.primary.span;
            let name = compiled.sources.name(span.source).unwrap_or_default();
            format!("{name}: {}", diagnostic.message)
        };
        let messages = compiled.diagnostics.iter().map(place).collect();
        let Some(program) = compiled.program else { return (messages, String::new()) };
        let program =
            Program::from_bytes(&program.to_bytes().expect("it can be written")).expect("it is sound");
        let host = VirtualHost::new();
        let captured = host.captured();
        run(&program, COMPILE_TIME_CONFIG, Box::new(host)).expect("it runs");
        (messages, captured.output())
    }

    #[test]
    fn sources_see_what_others_define() {
        let first = "(defmacro twice (x) `(list ,x ,x)) (defun first-one () (second-one)) (defvar *v* 5)";
        let second = "(defun second-one () (twice *v*)) (princ (first-one)) (third-one)";
        let (messages, output) = run_together(&[first, second]);
        assert_eq!(messages, ["1.esl: no function is called `third-one`"]);
        assert_eq!(output, "(5 5)");
    }

    #[test]
    fn what_cleanups_may_take_can_be_set() {
        let text =
            "(let ((task (spawn (unwind-protect (loop) (dotimes (i 5000)) (princ 'a) (sleep 5) (princ 'b)))))
                      (sleep 0)
                      (abort-task task)
                      (princ 'over))";
        let output = |config: Config| {
            let program = compile(&[Source::new("cleanup.esl", text)]).program.expect("it compiles");
            let host = VirtualHost::new();
            let captured = host.captured();
            run(&program, config, Box::new(host)).expect("it runs");
            captured.output()
        };
        assert_eq!(output(COMPILE_TIME_CONFIG), "ABOVER");
        assert_eq!(output(Config { cleanup_ticks: 1000, ..COMPILE_TIME_CONFIG }), "OVER");
        assert_eq!(output(Config { cleanup_time: 1_000_000_000, ..COMPILE_TIME_CONFIG }), "AOVER");
    }

    #[test]
    fn each_source_begins_in_the_package_of_the_user() {
        let first = "(defpackage :inner (:use :esl)) (in-package :inner) (princ (package-name *package*))";
        let second = "(princ (list (package-name *package*) (symbol-package 'x)))";
        let (messages, output) = run_together(&[first, second]);
        assert!(messages.is_empty(), "{messages:?}");
        assert_eq!(output, "INNER(ESL-USER #<PACKAGE \"ESL-USER\">)");
    }
}
