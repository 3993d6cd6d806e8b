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
//!   => :done functions diagnostics          over; NIL for functions if one of the diagnostics is an error
//! ```
//!
//! Diagnostics are a list of `(severity code text)`. Whoever begins a compilation ends it with
//! `%end-compilation`.

use esl_bytecode::compile::{Answer, Compilation, Step};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::file;
use esl_bytecode::span::Span;
use esl_bytecode::verify::verify;

use crate::builtins::expect::optional;
use crate::builtins::stream::Source;
use crate::compiler::{ActiveCompilation, CompilerJob, FormText, JobId};
use crate::datum::Unit;
use crate::environment;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;
use crate::world::load::{Alone, load};

use super::expect::exactly;

/// Whether a diagnostic with this code says that a text ends in the middle of a datum.
fn is_unfinished(code: &str) -> bool {
    code.starts_with("unclosed-") || code.starts_with("unfinished-")
}

impl Vm {
    /// Begins a compilation and returns its handle. `is_nameless` says whether its form comes from a text
    /// without a name.
    fn begin(&mut self, compilation: Box<dyn Compilation>, unit: Unit, is_nameless: bool) -> Value {
        let running = ActiveCompilation { compilation, unit, step: None, keeps: false, is_nameless };
        self.compiler.add(CompilerJob::Compilation(Box::new(running)))
    }

    /// Takes the job that `handle` names out of the table, until `Compiler::put_back`.
    fn take_job(&mut self, handle: Value) -> Result<(JobId, CompilerJob), Exit> {
        match self.compiler.take(handle) {
            Some(taken) => Ok(taken),
            None => self.exchange.program_error("this compilation is over"),
        }
    }

    /// `value` as data of a compilation.
    fn as_form(&mut self, unit: &mut Unit, value: Value, span: Span) -> Result<Datum, Exit> {
        let datum = unit.datum_of(&self.heap, &self.world, value, span);
        self.exchange.charge(unit.take_work() as usize);
        match datum {
            Ok(datum) => Ok(datum),
            Err(error) => self.exchange.program_error(error.to_string()),
        }
    }

    /// The outcome of the last step, as the program tells it.
    fn answer(
        &mut self,
        running: &mut ActiveCompilation,
        kind: Value,
        outcome: Value,
    ) -> Result<Answer, Exit> {
        let kind = self.designated_text(kind)?;
        let unit = &mut running.unit;
        Ok(match &*kind {
            "START" => Answer::Start,
            "EXPANSION" => match unit.datum_of(&self.heap, &self.world, outcome, Span::default()) {
                Ok(expansion) => Answer::Expansion(expansion),
                Err(error) => Answer::Failed(error.to_string().into()),
            },
            "LOADED" if running.keeps => Answer::Object(unit.pin(outcome)),
            "LOADED" => Answer::Loaded,
            "FAILED" => Answer::Failed(self.designated_text(outcome)?.into()),
            _ => return self.exchange.program_error(format!("{kind} is no outcome of a step")),
        })
    }

    /// Tells the program what a compilation wants.
    fn tell(&mut self, compilation: &dyn Compilation, step: &Step) -> Outcome {
        let mut results = [Value::NIL; 4];
        let kind = match step {
            Step::Expand(call) => {
                let prepared = environment::macro_call(self, call);
                match self.exchange.loaded(prepared)? {
                    Some(call) => results[1..].copy_from_slice(&call),
                    None => return self.exchange.program_error("the macro is not defined any more"),
                }
                "EXPAND"
            }
            Step::Load { module, keep } => {
                let functions = environment::load_in_unit(self, module);
                results[1] = self.exchange.loaded(functions)?;
                results[2] = Value::boolean(*keep);
                "LOAD"
            }
            Step::Require(name) => {
                results[1] = self.heap.alloc_str(name)?;
                "REQUIRE"
            }
            Step::Done(module, diagnostics) => {
                if let Some(module) = module {
                    let functions = environment::load_in_unit(self, module);
                    results[1] = self.exchange.loaded(functions)?;
                }
                results[2] = self.diagnostics(compilation, diagnostics)?;
                "DONE"
            }
        };
        results[0] = self.world.keyword(&mut self.heap, kind)?;
        self.give_values(&results)
    }

    fn diagnostics(&mut self, compilation: &dyn Compilation, diagnostics: &[Diagnostic]) -> Outcome {
        let mut list = Value::NIL;
        for diagnostic in diagnostics.iter().rev() {
            let text = compilation.render(diagnostic);
            self.exchange.charge(text.len());
            let severity = match diagnostic.severity {
                Severity::Warning => "WARNING",
                Severity::Error => "ERROR",
            };
            let severity = self.world.keyword(&mut self.heap, severity)?;
            let code = self.world.keyword(&mut self.heap, &diagnostic.code.to_uppercase())?;
            let text = self.heap.alloc_str(&text)?;
            let entry = self.heap.list(&[severity, code, text])?;
            list = self.heap.cons(entry, list)?;
        }
        Ok(list)
    }

    /// Reads a datum of `text`, which may have a name, from byte `start` on.
    fn read_datum(&mut self, text: &str, start: usize, name: Option<&str>) -> Result<Read, Exit> {
        let read = environment::with_compiler(self, |vm, compiler| {
            let read = compiler.read(vm, text, start);
            read.map_err(|diagnostic| ReadFault {
                text: compiler.render(&diagnostic, name, text),
                diagnostic,
            })
        })?;
        let end = read.as_ref().map_or(text.len(), |&(_, end)| end);
        self.exchange.charge(end.saturating_sub(start));
        match read {
            Ok((Some(datum), end)) => Ok(Read::Datum(datum, end)),
            Ok((None, _)) => Ok(Read::End),
            Err(fault) => Ok(Read::Fault(fault)),
        }
    }

    /// A datum that was read, as an object.
    fn read_object(&mut self, datum: &Datum) -> Outcome {
        let mut unit = Unit::default();
        let value = unit.value_of(&mut self.heap, &mut self.world, datum);
        self.exchange.charge(unit.take_work() as usize);
        Ok(value?)
    }
}

/// Result of reading.
enum Read {
    /// A datum, and the offset of the byte after it.
    Datum(Datum, usize),
    /// Nothing but white space.
    End,
    /// No datum.
    Fault(ReadFault),
}

/// Fault in a text that is read.
struct ReadFault {
    diagnostic: Box<Diagnostic>,
    /// The diagnostic, drawn for people.
    text: String,
}

impl ReadFault {
    /// Returns whether the text ends in the middle of a datum.
    fn is_unfinished(&self) -> bool {
        is_unfinished(self.diagnostic.code)
    }
}

pub(super) fn begin_compilation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let mut unit = Unit::default();
    let form = vm.as_form(&mut unit, arguments[0], Span::default())?;
    let compilation = environment::with_compiler(vm, |_, compiler| compiler.compile_form(form, None))?;
    Ok(vm.begin(compilation, unit, false))
}

pub(super) fn begin_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, text] = exactly(arguments);
    let name = vm.designated_text(name)?;
    let Some(text) = vm.text_of(text) else { return vm.exchange.type_error(text, "STRING") };
    vm.exchange.charge(text.len());
    let compilation = environment::with_compiler(vm, |_, compiler| compiler.compile_text(&name, &text))?;
    Ok(vm.begin(compilation, Unit::default(), false))
}

pub(super) fn compiled_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    let bytes = match vm.outside.host.read_file(&path) {
        Ok(bytes) => bytes,
        Err(error) => return vm.file_error("read", &path, &error),
    };
    vm.exchange.charge(bytes.len() * 4);
    let sound = file::read(&bytes).map_err(|error| error.to_string());
    let sound = sound.and_then(|module| verify(&module).map(|()| module).map_err(|error| error.to_string()));
    match sound {
        Ok(module) => {
            let functions = load(&mut vm.heap, &mut vm.world, &module, &mut Alone::default());
            vm.exchange.loaded(functions)
        }
        Err(reason) => vm.exchange.raise(Raised::File(path, format!("it is not a valid program: {reason}"))),
    }
}

pub(super) fn open_text(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(text) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    vm.exchange.charge(text.len());
    let name = match optional(arguments, 1) {
        name if name.is_nil() => None,
        name => Some(vm.designated_text(name)?),
    };
    let text = FormText { text: text.into(), name, position: 0, line: 0, column: 0 };
    Ok(vm.compiler.add(CompilerJob::Text(text)))
}

pub(super) fn next_form(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (id, mut job) = vm.take_job(arguments[0])?;
    let next = match &mut job {
        CompilerJob::Text(text) => begin_form(vm, text),
        _ => vm.exchange.program_error("there are no forms in a compilation"),
    };
    vm.compiler.put_back(id, job);
    next
}

fn begin_form(vm: &mut Vm, text: &mut FormText) -> Outcome {
    match vm.read_datum(&text.text, text.position, text.name.as_deref())? {
        Read::End => Ok(Value::NIL),
        Read::Fault(fault) => {
            if text.name.is_none() {
                vm.compiler.refused = vec![*fault.diagnostic];
            }
            vm.exchange.raise(Raised::Reader(fault.text))
        }
        Read::Datum(datum, end) => {
            let part = text.part(end);
            let is_nameless = part.is_none();
            let compilation =
                environment::with_compiler(vm, |_, compiler| compiler.compile_form(datum, part))?;
            text.pass(end);
            Ok(vm.begin(compilation, Unit::default(), is_nameless))
        }
    }
}

pub(super) fn compilation_step(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handle, kind, outcome] = exactly(arguments);
    let (id, mut job) = vm.take_job(handle)?;
    let told = match &mut job {
        CompilerJob::Compilation(running) => step(vm, running, kind, outcome),
        _ => vm.exchange.program_error("a text is no compilation"),
    };
    vm.compiler.put_back(id, job);
    told
}

fn step(vm: &mut Vm, running: &mut ActiveCompilation, kind: Value, outcome: Value) -> Outcome {
    let step = match running.step.take() {
        Some(step) => step,
        None => {
            let answer = vm.answer(running, kind, outcome)?;
            let outer = vm.compiler.unit.replace(std::mem::take(&mut running.unit));
            let mut nodes = 0;
            let step = running.compilation.step(vm, answer, &mut |more| nodes += more);
            running.unit = vm.compiler.unit.replace(outer);
            // A node is worth more than a cell of a list.
            vm.exchange.charge(nodes as usize * 16);
            if let (Step::Done(None, diagnostics), true) = (&step, running.is_nameless) {
                let is_error = |diagnostic: &&Diagnostic| diagnostic.severity == Severity::Error;
                vm.compiler.refused = diagnostics.iter().filter(is_error).cloned().collect();
            }
            step
        }
    };
    let outer = vm.compiler.unit.replace(std::mem::take(&mut running.unit));
    let told = vm.tell(&*running.compilation, &step);
    running.unit = vm.compiler.unit.replace(outer);
    let work = running.unit.take_work();
    vm.exchange.charge(work as usize);
    running.keeps = matches!(step, Step::Load { keep: true, .. });
    if told == Err(Exit::Collect) {
        running.step = Some(step);
    }
    told
}

pub(super) fn end_compilation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.compiler.end(arguments[0]);
    Ok(Value::NIL)
}

/// The first value is `NIL` at the end of the string, and `:unfinished` if the datum goes on behind it.
pub(super) fn read_from_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let characters = vm.characters(arguments[0], optional(arguments, 1), optional(arguments, 2))?;
    let first = optional(arguments, 1).as_index().unwrap_or(0);
    let text: String =
        characters.iter().map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    match vm.read_datum(&text, 0, None)? {
        Read::Datum(datum, end) => {
            let object = vm.read_object(&datum)?;
            let end = first + text[..end].chars().count();
            vm.give_values(&[Value::T, object, Value::index(end)])
        }
        Read::End => vm.give_values(&[Value::NIL, Value::NIL, Value::index(first + characters.len())]),
        Read::Fault(fault) if fault.is_unfinished() => {
            let unfinished = vm.world.known.unfinished;
            vm.give_values(&[unfinished, Value::NIL, Value::index(first + characters.len())])
        }
        Read::Fault(fault) => vm.exchange.raise(Raised::Reader(fault.text)),
    }
}

/// What was read is taken from the stream.
pub(super) fn read(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = optional(arguments, 0);
    loop {
        let source = vm.source(stream)?;
        let (text, may_grow) = match &source {
            Source::Text(text) => (text.clone(), false),
            Source::Console { text, is_at_end } => (text.clone(), !is_at_end),
        };
        let (status, object, end) = match vm.read_datum(&text, 0, None)? {
            // What ends where the input does may go on in what is still to come.
            Read::Datum(_, end) if may_grow && end == text.len() && !text.ends_with([')', '"']) => {
                vm.more_input()?;
                continue;
            }
            Read::Datum(datum, end) => (Value::T, vm.read_object(&datum)?, end),
            Read::Fault(fault) if !fault.is_unfinished() => {
                return vm.exchange.raise(Raised::Reader(fault.text));
            }
            Read::End | Read::Fault(_) if may_grow => {
                vm.more_input()?;
                continue;
            }
            Read::End => (Value::NIL, Value::NIL, text.len()),
            Read::Fault(_) => (vm.world.known.unfinished, Value::NIL, text.len()),
        };
        vm.skip_source(stream, &source, text[..end].chars().count());
        return vm.give_values(&[status, object]);
    }
}
