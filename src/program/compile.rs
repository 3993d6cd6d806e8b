//! Compiling sources to a program, and expanding their macros.

use esl_bytecode::compile::{Halt, NoModule, drive_with};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;
use esl_compiler::core::Core;
use esl_compiler::cover::CountedPlace;
use esl_compiler::diagnostic::{Sources, code};
use esl_compiler::session::{AllowedWarnings, Compiler, Texts};
use esl_host::{Host, Inbox, ProcessSignal, RealHost, Rights};
use esl_vm::vm::{Config, Vm};

use super::run::only_compile;
use super::{Ended, Program, Source, machine, set_module_path};
use crate::error::Error;
use crate::module_path::ModulePath;

/// Result of a compilation.
///
/// ```
/// use esl::program::{Source, compile};
///
/// let compiled = compile(&[Source::new("door.esl", "(print (undefined-door))\n(let 5)")]);
/// assert!(compiled.has_errors() && compiled.program.is_none());
/// let codes: Vec<&str> = compiled.diagnostics.iter().map(|diagnostic| diagnostic.code).collect();
/// assert!(codes.contains(&"malformed-binding"));
/// ```
#[derive(Debug)]
pub struct Compiled {
    /// Program, unless there was an error.
    pub program: Option<Program>,
    /// All that was found, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Sources that the diagnostics refer to.
    pub sources: Sources,
    /// Way in which the compilation ended before its end, if a limit or a signal has stopped it: as a run
    /// that does.
    pub stopped: Option<Ended>,
    /// Places whose passages a machine can count in the program, if it was compiled for that.
    pub places: Vec<CountedPlace>,
    /// How often control has passed each of them in the machine in which macros run.
    pub passages: Vec<u64>,
    /// Top-level forms of the program in the core language, if it was compiled for an analysis.
    pub core: Vec<Core>,
    /// Warnings that forms of the program allow.
    pub allowed: Vec<AllowedWarnings>,
}

impl Compiled {
    /// Drops warnings of an analysis that the program allows in their places.
    pub fn drop_allowed(&self, findings: &mut Vec<Diagnostic>) {
        findings.retain(|finding| {
            let is_allowed = |allowed: &AllowedWarnings| allowed.include(finding.code, finding.primary.span);
            finding.severity != Severity::Warning || !self.allowed.iter().any(is_allowed)
        });
    }

    /// Returns whether an error was found.
    pub fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
    }
}

/// Place of the modules that a program requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modules {
    /// Part of the program.
    Inside,
    /// Files of their own, which the program finds when it runs.
    Apart,
}

/// Compiles sources to one program that runs them in order. They are one unit: functions may be called
/// before the source that defines them, and macros used after it. Each begins in the package `ESL-USER`, or
/// in `COMMON-LISP-USER` if its name ends in `.lisp`.
///
/// Macros run in a machine of their own, whose definitions are gone when the compilation is over. The
/// sources cannot require modules.
pub fn compile(sources: &[Source]) -> Compiled {
    compile_with(sources, &ModulePath::none(), Modules::Inside)
}

/// Compiles sources as [`compile`] does, with the modules found in `path`.
pub fn compile_with(sources: &[Source], path: &ModulePath, modules: Modules) -> Compiled {
    compile_in(Compiler::default(), sources, path, modules, Config::DEFAULT, &mut |_| {})
}

/// Compiles sources and their modules to one program whose passages a machine can count.
pub fn compile_covered(sources: &[Source], path: &ModulePath) -> Compiled {
    compile_in(Compiler::default().covered(), sources, path, Modules::Inside, Config::DEFAULT, &mut |_| {})
}

/// Compiles sources and their modules to one program, and keeps its core language for an analysis.
pub fn compile_with_core(sources: &[Source], path: &ModulePath) -> Compiled {
    compile_in(Compiler::default().with_core(), sources, path, Modules::Inside, Config::DEFAULT, &mut |_| {})
}

/// Compiles sources and their modules to one program with points before the uses of places that tasks may
/// share, for strict explorations and for reports.
pub fn compile_with_points(sources: &[Source], path: &ModulePath) -> Compiled {
    compile_in(
        Compiler::default().with_points(),
        sources,
        path,
        Modules::Inside,
        Config::DEFAULT,
        &mut |_| {},
    )
}

fn compile_in(
    mut compiler: Compiler,
    sources: &[Source],
    path: &ModulePath,
    modules: Modules,
    config: Config,
    watch: &mut dyn FnMut(Inbox),
) -> Compiled {
    if modules == Modules::Apart {
        compiler = compiler.apart();
    }
    let texts: Vec<(&str, &str)> = sources.iter().map(|source| (&*source.name, &*source.text)).collect();
    compile_texts(&mut compiler.compile_texts(&texts), path, compile_time_machine(path, config), watch)
}

/// Compiles sources as [`compile`] does, where macros run on the embedder's host and within the limits of
/// `config`: for embedders without a system around them.
pub fn compile_on(sources: &[Source], config: Config, host: Box<dyn Host + Send>) -> Compiled {
    let texts: Vec<(&str, &str)> = sources.iter().map(|source| (&*source.name, &*source.text)).collect();
    let compiler = Compiler::default();
    compile_texts(
        &mut compiler.compile_texts(&texts),
        &ModulePath::none(),
        machine(config, host),
        &mut |_| {},
    )
}

/// Least limit of memory for a compilation, in bytes: the compiler and the library take that much.
const LEAST_MEMORY: usize = 32 << 20;
/// Least budget of a compilation: a fraction of a second.
const LEAST_BUDGET: u64 = 20_000_000;

/// Instructions that a program is compiled with beside its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instrumentation {
    /// None.
    #[default]
    None,
    /// Those by which a machine counts the passages of places.
    Passages,
    /// Points before the uses of places that tasks may share.
    Points,
    /// None; the core language is kept for an analysis.
    Core,
}

/// Compiles sources and their modules to one program, for a run with the settings `config`: the compilation
/// has the same memory and the same budget, or 32 MiB and 20 million ticks if these are more. `watch`
/// receives the inbox into which a signal is put that is to stop it.
pub fn compile_for_run(
    sources: &[Source],
    path: &ModulePath,
    instrumentation: Instrumentation,
    config: &Config,
    watch: &mut dyn FnMut(Inbox),
) -> Compiled {
    let config = Config {
        memory: config.memory.max(LEAST_MEMORY),
        budget: config.budget.map(|budget| budget.max(LEAST_BUDGET)),
        ..Config::DEFAULT
    };
    let compiler = match instrumentation {
        Instrumentation::None => Compiler::default(),
        Instrumentation::Passages => Compiler::default().covered(),
        Instrumentation::Points => Compiler::default().with_points(),
        Instrumentation::Core => Compiler::default().with_core(),
    };
    compile_in(compiler, sources, path, Modules::Inside, config, watch)
}

/// Expands the macros of a source. Returns its text after that, and the diagnostics. Modules that it
/// requires are left out.
pub fn expand(source: &Source, path: &ModulePath) -> (String, Compiled) {
    let mut expansion = Compiler::default().apart().expand_text(&source.name, &source.text);
    let machine = compile_time_machine(path, Config::DEFAULT);
    let compiled = compile_texts(&mut expansion, path, machine, &mut |_| {});
    (expansion.expansion().to_string(), Compiled { program: None, ..compiled })
}

fn compile_texts(
    texts: &mut Texts,
    path: &ModulePath,
    machine: Result<Vm, Error>,
    watch: &mut dyn FnMut(Inbox),
) -> Compiled {
    let mut find = |name: &str| path.find(name).map_err(|error| NoModule(error.to_string()));
    let (mut stopped, mut passages) = (None, Vec::new());
    let (module, diagnostics) = match machine {
        Ok(mut machine) => {
            watch(machine.inbox());
            machine.count_passages();
            let driven = drive_with(texts, &mut machine, &mut find);
            passages = machine.take_passages();
            driven.unwrap_or_else(|halt| {
                // The output of the cleanups of macros.
                machine.flush();
                let signal = machine.asked_to_end().unwrap_or(ProcessSignal::Terminate);
                stopped = Some(match halt {
                    Halt::Memory => Ended::HeapExhausted,
                    Halt::Budget => Ended::BudgetSpent,
                    Halt::Signal => Ended::Signalled(signal),
                });
                Default::default()
            })
        }
        Err(error) => (None, vec![code::COMPILE_TIME_FAILURE.at(Span::default(), error.to_string())]),
    };
    let program = module.map(|module| Program { module, file: None });
    let (sources, places) = (texts.sources().clone(), texts.places().to_vec());
    let (core, allowed) = (texts.take_core(), texts.allowed().to_vec());
    Compiled { program, diagnostics, sources, stopped, places, passages, core, allowed }
}

/// Returns the machine in which macros run. It may read the modules of `path`, and nothing else.
fn compile_time_machine(path: &ModulePath, config: Config) -> Result<Vm, Error> {
    let host = RealHost::new(Vec::new()).with_rights(path.with_rights(Rights::none()));
    let mut machine = machine(config, Box::new(host))?;
    set_module_path(&mut machine, path)?;
    only_compile(&mut machine)?;
    Ok(machine)
}

#[cfg(test)]
mod tests {
    use esl_host::VirtualHost;

    use super::*;
    use crate::program::run;

    /// Compiles texts together. Returns the messages of diagnostics, and the output of the program.
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
            Program::from_bytes(&program.to_bytes().expect("it can be written")).expect("it is valid");
        let host = VirtualHost::new();
        let captured = host.captured();
        run(&program, Config::DEFAULT, Box::new(host)).expect("it runs");
        (messages, captured.output())
    }

    #[test]
    fn a_failure_in_a_macro_is_located_in_the_call_and_in_the_macro() {
        let text = "(defmacro twice (form)\n  (list 'progn form\n        (car (identity 'form))))\n\
                    (twice (print 1))\n(dotimes\n    (5 3)\n  (print 1))\n\
                    (eval-when (:compile-toplevel)\n  (car (identity 'table)))";
        let compiled = compile(&[Source::new("a.esl", text)]);
        let part = |span: Span| &text[span.start as usize..span.end as usize];
        let places: Vec<Vec<&str>> = compiled
            .diagnostics
            .iter()
            .map(|found| {
                let labels = std::iter::once(&found.primary).chain(&found.secondary);
                labels.map(|label| part(label.span)).collect()
            })
            .collect();
        assert_eq!(
            places,
            [vec!["twice", "(car (identity 'form))"], vec!["5"], vec!["(car (identity 'table))"]]
        );
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
    fn each_source_begins_in_the_package_of_the_user() {
        let first = "(defpackage :inner (:use :esl)) (in-package :inner) (princ (package-name *package*))";
        let second = "(princ (list (package-name *package*) (symbol-package 'x)))";
        let (messages, output) = run_together(&[first, second]);
        assert!(messages.is_empty(), "{messages:?}");
        assert_eq!(output, "INNER(ESL-USER #<PACKAGE \"ESL-USER\">)");
    }
}
