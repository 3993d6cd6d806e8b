//! Reading and compiling at run time.
//!
//! `eval`, `load` and `macroexpand` are written in ESL. A compilation is a machine of steps that never runs a
//! macro itself: `%compilation-step` tells the program what to call, and is told the outcome. So a task that
//! compiles is preempted and aborted like any other, in the middle of a macro too.
//!
//! Step by step (`kind` and `outcome` are `:start nil` at first):
//!
//! ```text
//! (%compilation-step handle kind outcome)
//!   => :expand function form environment    call it, then answer :expansion value, or :failed text
//!   => :load functions keep                 call them in order, then answer :loaded value, or :failed text
//!   => :require name                        have the module, then answer :loaded nil, or :failed text
//!   => :more                                a part of the work is done: answer :more nil
//!   => :done functions diagnostics          over; NIL for functions if one of the diagnostics is an error
//! ```
//!
//! In place of `text`, `(text . usage)` also says how the macro that failed is written.
//!
//! Diagnostics are a list of `(severity code text)`. The caller that begins a compilation ends it with
//! `%end-compilation`.
//!
//! Guarantees: a step does a bounded part of the work, for which the task is charged. The data of
//! compilations count against the limit of the memory: beyond it, the next step fails for want of room.

use esl_bytecode::compile::{Compilation, CompileTimeFailure, Step, StepOutcome, Work};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::file;
use esl_bytecode::span::Span;
use esl_bytecode::verify::verify;
use esl_host::Host;

use crate::builtins::array::{ArrayElements, vector_elements};
use crate::builtins::expect::optional;
use crate::builtins::rights::demand;
use crate::builtins::stream::{file_error, right_to};
use crate::builtins::symbol::{designated_text, text_of};
use crate::compiler::{ActiveCompilation, CompilerJob, FormText, FormWalk, JobId};
use crate::datum::{DatumError, DatumWalk, Unit};
use crate::environment;
use crate::heap::Holder;
use crate::names::load::{Alone, ModuleLoad, load};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;
use super::reading::{ReadOutcome, read_datum};

/// Units that [`Exchange::charge`](crate::exchange::Exchange::charge) takes for a unit of a compilation's
/// work, which is worth more than a cell of a list.
const WORK_UNITS: usize = 256;

/// Steps of the walk in which a form becomes a datum that are taken at once: a slice's worth.
const FORM_STEP: usize = 2048;

/// As [`WORK_UNITS`], for each of these: most look into large hash tables.
const FORM_UNITS: usize = 64;

/// Data of a compilation that has ended that are freed in one step.
const FREED_STEP: usize = 4096;

/// As [`WORK_UNITS`], for each of these.
const FREED_UNITS: usize = 16;

/// Begins a compilation and returns its handle. `is_nameless` says whether its form comes from a text
/// without a name.
fn begin(vm: &mut Vm, compilation: Box<dyn Compilation>, unit: Unit, is_nameless: bool) -> Value {
    let running = ActiveCompilation::new(compilation, unit, is_nameless);
    let handle = vm.compiler.add(CompilerJob::Compilation(Box::new(running)));
    recount(vm);
    handle
}

/// Counts the memory that compilations hold. If it is too much, the next step fails.
fn recount(vm: &mut Vm) {
    _ = vm.heap.set_external(Holder::Compiler, vm.compiler.bytes());
}

/// Takes the job that `handle` names out of the table, until `Compilations::put_back`.
fn take_job(vm: &mut Vm, handle: Value) -> Result<(JobId, CompilerJob), Exit> {
    match vm.compiler.take(handle) {
        Some(taken) => Ok(taken),
        None => vm.exchange.program_error("this compilation is over"),
    }
}

/// Goes on making a datum of a form. Returns its compilation when that is over.
fn go_on_with_form(vm: &mut Vm, form: &mut FormWalk) -> Result<Option<ActiveCompilation>, Exit> {
    vm.heap.check_room(0)?;
    let mut left = FORM_STEP;
    let datum = form.walk.run(&mut form.unit, &vm.heap, &vm.names, &mut left);
    // The work of this walk is charged here, not as that of macro calls.
    _ = form.unit.take_work();
    vm.exchange.charge((FORM_STEP - left) * FORM_UNITS);
    let datum = match datum {
        Ok(Some(datum)) => datum,
        Ok(None) => return Ok(None),
        Err(DatumError::NoRoom(bytes)) => {
            vm.heap.check_room(bytes)?;
            return Err(Exit::Collect);
        }
        Err(error) => return vm.exchange.program_error(error.to_string()),
    };
    let compilation = environment::with_compiler(vm, |_, compiler| compiler.compile_form(datum, None))?;
    let unit = std::mem::take(&mut form.unit);
    Ok(Some(ActiveCompilation::new(compilation, unit, false)))
}

/// Returns the outcome of the last step, as the program tells it; `None` if a part of the work that makes a
/// datum of it is done.
fn answer(
    vm: &mut Vm,
    running: &mut ActiveCompilation,
    kind: Value,
    outcome: Value,
) -> Result<Option<StepOutcome>, Exit> {
    let kind = designated_text(vm, kind)?;
    let unit = &mut running.unit;
    if &*kind == "EXPANSION" && running.expansion.is_none() {
        running.expansion = Some(DatumWalk::new(outcome, Span::default()));
    }
    if let Some(walk) = &mut running.expansion {
        let mut left = FORM_STEP;
        let walked = walk.run(unit, &vm.heap, &vm.names, &mut left);
        vm.exchange.charge((FORM_STEP - left) * FORM_UNITS);
        let outcome = match walked {
            Ok(Some(expansion)) => StepOutcome::Expansion(expansion),
            Ok(None) => return Ok(None),
            Err(DatumError::NoRoom(bytes)) => {
                vm.heap.check_room(bytes)?;
                return Err(Exit::Collect);
            }
            Err(error) => StepOutcome::Failed(error.to_string().into()),
        };
        running.expansion = None;
        return Ok(Some(outcome));
    }
    Ok(Some(match &*kind {
        "START" => StepOutcome::Start,
        "MORE" => StepOutcome::More,
        "LOADED" if running.keeps => StepOutcome::Object(unit.pin(outcome)),
        "LOADED" => StepOutcome::Loaded,
        // The report, and how the macro that failed is written.
        "FAILED" => {
            let told = vm.heap.as_cons(outcome);
            let [report, usage] = told.map_or([outcome, Value::NIL], |told| [told.car, told.cdr]);
            let report = designated_text(vm, report)?;
            let usage = text_of(&vm.heap, usage);
            StepOutcome::Failed(CompileTimeFailure { report, usage, ..CompileTimeFailure::default() })
        }
        _ => return vm.exchange.program_error(format!("unknown outcome of a step: {kind}")),
    }))
}

/// Tells the program what a compilation wants. `functions` run the module of the step, if it has one.
fn tell(vm: &mut Vm, compilation: &dyn Compilation, step: &Step, functions: Value) -> Outcome {
    let mut results = [Value::NIL; 4];
    let kind = match step {
        Step::Expand(call) => {
            let prepared = environment::macro_call(vm, call);
            match vm.exchange.loaded(prepared)? {
                Some(call) => results[1..].copy_from_slice(&call),
                None => return vm.exchange.program_error("the macro is not defined any more"),
            }
            "EXPAND"
        }
        Step::Load { keep, .. } => {
            results[1] = functions;
            results[2] = Value::boolean(*keep);
            "LOAD"
        }
        Step::More => "MORE",
        Step::Require(name) => {
            results[1] = vm.heap.alloc_str(name)?;
            "REQUIRE"
        }
        Step::Done(_, diagnostics) => {
            results[1] = functions;
            results[2] = list_of_diagnostics(vm, compilation, diagnostics)?;
            "DONE"
        }
    };
    results[0] = vm.names.keyword(&mut vm.heap, kind)?;
    vm.give_values(&results)
}

/// Tells the program to go on.
fn tell_more(vm: &mut Vm) -> Outcome {
    let more = vm.names.keyword(&mut vm.heap, "MORE")?;
    vm.give_values(&[more, Value::NIL, Value::NIL, Value::NIL])
}

fn list_of_diagnostics(vm: &mut Vm, compilation: &dyn Compilation, diagnostics: &[Diagnostic]) -> Outcome {
    let mut list = Value::NIL;
    for diagnostic in diagnostics.iter().rev() {
        let text = compilation.render(diagnostic);
        vm.exchange.charge(text.len());
        let severity = match diagnostic.severity {
            Severity::Warning => "WARNING",
            Severity::Error => "ERROR",
        };
        let severity = vm.names.keyword(&mut vm.heap, severity)?;
        let code = vm.names.keyword(&mut vm.heap, &diagnostic.code.to_uppercase())?;
        let text = vm.heap.alloc_str(&text)?;
        let entry = vm.heap.list(&[severity, code, text])?;
        list = vm.heap.cons(entry, list)?;
    }
    Ok(list)
}

/// The form becomes a datum in the steps of the compilation.
pub(super) fn begin_compilation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let walk = DatumWalk::new(arguments[0], Span::default()).keeping_literals();
    Ok(vm.compiler.add(CompilerJob::Form(Box::new(FormWalk { walk, unit: Unit::default() }))))
}

pub(super) fn begin_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, text] = exactly(arguments);
    let name = designated_text(vm, name)?;
    let Some(text) = text_of(&vm.heap, text) else { return vm.exchange.type_error(text, "STRING") };
    vm.exchange.charge(text.len());
    let compilation = environment::with_compiler(vm, |_, compiler| compiler.compile_text(&name, &text))?;
    Ok(begin(vm, compilation, Unit::default(), false))
}

pub(super) fn compiled_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let bytes = match vector_elements(&vm.heap, optional(arguments, 2)) {
        Some(ArrayElements::Bytes(bytes)) => bytes.to_vec(),
        _ => {
            let permitted = demand(vm, right_to(arguments), &path)?;
            match vm.outside.host.read_file(&permitted) {
                Ok(bytes) => bytes,
                Err(error) => return file_error(&mut vm.exchange, "read", &path, &error),
            }
        }
    };
    vm.exchange.charge(bytes.len() * 4);
    let sound = file::read(&bytes).map_err(|error| error.to_string());
    let sound = sound.and_then(|module| verify(&module).map(|()| module).map_err(|error| error.to_string()));
    match sound {
        Ok(module) => {
            let functions = load(&mut vm.heap, &mut vm.names, &module, &mut Alone::default());
            vm.exchange.loaded(functions)
        }
        Err(reason) => vm.exchange.raise(Raised::File(path, format!("it is not a valid program: {reason}"))),
    }
}

pub(super) fn open_text(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(text) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    vm.exchange.charge(text.len());
    let name = match optional(arguments, 1) {
        name if name.is_nil() => None,
        name => Some(designated_text(vm, name)?),
    };
    let text = FormText { text: text.into(), name, position: 0, line: 0, column: 0 };
    let handle = vm.compiler.add(CompilerJob::Text(text));
    recount(vm);
    Ok(handle)
}

pub(super) fn next_form(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (id, mut job) = take_job(vm, arguments[0])?;
    let next = match &mut job {
        CompilerJob::Text(text) => begin_form(vm, text),
        _ => vm.exchange.program_error("expected the handle of a text, found that of a compilation"),
    };
    vm.compiler.put_back(id, job);
    next
}

pub(super) fn text_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (id, mut job) = take_job(vm, arguments[0])?;
    let rest = match &mut job {
        CompilerJob::Text(text) => {
            vm.exchange.charge(text.text.len() - text.position);
            let rest = vm.heap.alloc_str(&text.text[text.position..]);
            if rest.is_ok() {
                text.position = text.text.len();
            }
            rest.map_err(Exit::from)
        }
        _ => vm.exchange.program_error("expected the handle of a text, found that of a compilation"),
    };
    vm.compiler.put_back(id, job);
    rest
}

fn begin_form(vm: &mut Vm, text: &mut FormText) -> Outcome {
    match read_datum(vm, &text.text, text.position, text.name.as_deref())? {
        ReadOutcome::End => Ok(Value::NIL),
        ReadOutcome::Fault(fault) => {
            if text.name.is_none() {
                vm.compiler.refused = vec![*fault.diagnostic];
            }
            vm.exchange.raise(Raised::Reader(fault.text))
        }
        ReadOutcome::Datum(datum, end) => {
            let part = text.part(end);
            let is_nameless = part.is_none();
            let compilation =
                environment::with_compiler(vm, |_, compiler| compiler.compile_form(datum, part))?;
            text.pass(end);
            Ok(begin(vm, compilation, Unit::default(), is_nameless))
        }
    }
}

pub(super) fn compilation_step(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handle, kind, outcome] = exactly(arguments);
    let (id, mut job) = take_job(vm, handle)?;
    let told = match &mut job {
        CompilerJob::Compilation(running) => step(vm, running, kind, outcome),
        CompilerJob::Form(form) => match go_on_with_form(vm, form) {
            Ok(None) => tell_more(vm),
            Ok(Some(compilation)) => {
                let mut running = Box::new(compilation);
                let told = step(vm, &mut running, kind, outcome);
                job = CompilerJob::Compilation(running);
                told
            }
            Err(exit) => Err(exit),
        },
        _ => vm.exchange.program_error("expected the handle of a compilation, found that of a text"),
    };
    vm.compiler.put_back(id, job);
    recount(vm);
    told
}

fn step(vm: &mut Vm, running: &mut ActiveCompilation, kind: Value, outcome: Value) -> Outcome {
    let step = match running.step.take() {
        Some(step) => step,
        None => {
            vm.heap.check_room(0)?;
            let Some(answer) = answer(vm, running, kind, outcome)? else { return tell_more(vm) };
            let passed = running.unit.take_work();
            vm.exchange.charge(passed as usize);
            let outer = vm.compiler.unit.replace(std::mem::take(&mut running.unit));
            let mut work = Work::up_to(Work::STEP).after_passing(passed);
            let mut step = running.compilation.step(vm, answer, &mut work);
            running.unit = vm.compiler.unit.replace(outer);
            vm.exchange.charge(work.done() as usize * WORK_UNITS);
            if let (Step::Done(None, diagnostics), true) = (&step, running.is_nameless) {
                let is_error = |diagnostic: &&Diagnostic| diagnostic.severity == Severity::Error;
                vm.compiler.refused = diagnostics.iter().filter(is_error).cloned().collect();
            }
            if let Step::Load { module, .. } | Step::Done(Some(module), _) = &mut step {
                running.load = Some(Box::new(ModuleLoad::new(std::mem::take(module))));
            }
            step
        }
    };
    let functions = match go_on_loading(vm, running) {
        Ok(Some(functions)) => functions,
        Ok(None) => {
            running.step = Some(step);
            return tell_more(vm);
        }
        Err(exit) => {
            match exit {
                Exit::Collect => running.step = Some(step),
                _ => running.load = None,
            }
            return Err(exit);
        }
    };
    let outer = vm.compiler.unit.replace(std::mem::take(&mut running.unit));
    let told = tell(vm, &*running.compilation, &step, functions);
    running.unit = vm.compiler.unit.replace(outer);
    let work = running.unit.take_work();
    vm.exchange.charge(work as usize);
    running.keeps = matches!(step, Step::Load { keep: true, .. });
    if told == Err(Exit::Collect) {
        running.step = Some(step);
    } else {
        running.load = None;
    }
    told
}

/// Goes on loading the module of a step. Returns the list of its functions, `NIL` if there is no module, and
/// nothing if a part of the work is done.
fn go_on_loading(vm: &mut Vm, running: &mut ActiveCompilation) -> Result<Option<Value>, Exit> {
    let Some(load) = &mut running.load else { return Ok(Some(Value::NIL)) };
    let mut work = Work::up_to(Work::STEP);
    let functions = load.run(&mut vm.heap, &mut vm.names, &mut running.unit, &mut work);
    vm.exchange.charge(work.done() as usize * WORK_UNITS);
    vm.exchange.loaded(functions)
}

/// Returns whether there are data left to be freed by further calls.
pub(super) fn end_compilation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.compiler.end(arguments[0]);
    let (freed, are_left) = vm.compiler.free(FREED_STEP);
    vm.exchange.charge(freed * FREED_UNITS);
    recount(vm);
    Ok(Value::boolean(are_left))
}
