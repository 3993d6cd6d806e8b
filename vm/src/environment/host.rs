//! Running the compile-time parts of a program for a compiler outside of the machine.
//!
//! Units are compiled one at a time: [`Vm::begin_unit`] forgets the objects of the last one. Between calls
//! the unit keeps everything alive that its data refer to.

use std::sync::Arc;

use esl_bytecode::compile::{Compile, CompileTimeFailure, CompileTimeHost, Halt, MacroCall, MacroRef};
use esl_bytecode::datum::{Datum, ObjectId};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::file::ModuleImage;
use esl_bytecode::module::{Constant, FunctionNumber, Module, ModuleFunction, Parameters, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;

use crate::datum::{DatumError, Unit};
use crate::heap::{AllocError, Holder};
use crate::names::load::{Alone, LoadError, load};
use crate::raise::Exit;
use crate::run::{CallError, take_in};
use crate::value::Value;
use crate::vm::Vm;

/// Greatest number of ticks of a macro call; a longer one counts as endless.
const MACRO_TICKS: u64 = 50_000_000;
/// Greatest number of ticks of the compile-time part of one form.
const LOAD_TICKS: u64 = 1_000_000_000;
/// Ticks of a unit of the compiler's work.
const WORK_TICKS: u64 = 4;
/// Objects that the failure of a macro mentions, at most.
const MAX_CULPRITS: usize = 50;

impl Vm {
    /// Sets the compiler of the machine, for `eval`, `load` and `read`.
    pub fn set_compiler(&mut self, compiler: Box<dyn Compile>) {
        self.compiler.compiler = Some(compiler);
    }

    /// Takes the errors of a form that was refused, if `message`, which a call has failed with, is about that
    /// form. The form is one of a text without a name; spans are those in the text.
    pub fn take_refused(&mut self, message: &str) -> Option<Vec<Diagnostic>> {
        let refused = std::mem::take(&mut self.compiler.refused);
        // A report begins with a capital.
        let mut text = refused.last()?.message.chars();
        text.next();
        message.contains(text.as_str()).then_some(refused)
    }

    /// Begins to compile another unit. Forgets the objects and uninterned symbols of the last one.
    pub fn begin_unit(&mut self) {
        self.compiler.unit.replace(Unit::default());
    }

    /// Loads a module that stands alone, such as one from a file. Returns the functions that run its
    /// top-level forms, in order, as a list.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load_module(&mut self, module: &Module) -> Result<Value, LoadError> {
        with_room(self, |vm| load(&mut vm.heap, &mut vm.names, module, &mut Alone::default()))
    }

    /// Adds an image, such as that of the library, under a name. Returns the functions that run its top-level
    /// forms, in order, as a list. The image counts as verified.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn open_image(&mut self, name: &'static str, image: ModuleImage) -> Result<Value, LoadError> {
        let image = Arc::new(image);
        with_room(self, |vm| vm.names.open_image(&mut vm.heap, name, image.clone()))
    }

    /// Returns the names of the images, in the order in which they were added.
    pub fn image_names(&self) -> impl Iterator<Item = &'static str> {
        self.names.images.names()
    }

    /// Seals the language: from here on, its names cannot be defined again.
    pub fn seal(&mut self) {
        self.names.is_open = false;
    }

    /// Unseals the language, until [`Vm::seal`]: for tests that put a defect into the library.
    pub fn unseal(&mut self) {
        self.names.is_open = true;
    }

    /// Runs the functions of a loaded module one after the other, in one task. Returns the value of the last.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn run_toplevel(&mut self, functions: Value, ticks: u64) -> Result<Value, CallError> {
        self.embedder.pin(&mut self.heap, functions);
        let call = |vm: &mut Vm, runner| vm.call_until_signal(runner, &[functions], ticks);
        let values = runner(self).and_then(|runner| call(self, runner).map_err(|(error, _)| error));
        self.embedder.unpin(functions);
        Ok(values?.first().copied().unwrap_or(Value::NIL))
    }
}

/// Applies `work` to the compiler, which may ask about the program meanwhile.
///
/// # Errors
/// A failure if the machine has no compiler.
pub(crate) fn with_compiler<T>(
    vm: &mut Vm,
    work: impl FnOnce(&mut Vm, &dyn Compile) -> T,
) -> Result<T, Exit> {
    let Some(compiler) = vm.compiler.compiler.take() else {
        return vm.exchange.program_error("this machine has no compiler");
    };
    let result = work(vm, &*compiler);
    vm.compiler.compiler = Some(compiler);
    Ok(result)
}

/// Loads a module of the unit being compiled.
///
/// # Errors
/// [`LoadError`].
fn load_in_unit(vm: &mut Vm, module: &Module) -> Result<Value, LoadError> {
    let mut unit = vm.compiler.unit.take();
    let functions = load(&mut vm.heap, &mut vm.names, module, &mut unit);
    vm.compiler.unit.replace(unit);
    functions
}

/// Runs `work` outside of all tasks; if there is no room, once more after a collection.
fn with_room<T>(vm: &mut Vm, mut work: impl FnMut(&mut Vm) -> Result<T, LoadError>) -> Result<T, LoadError> {
    match work(vm) {
        Err(LoadError::Alloc(AllocError::NeedCollection)) => {
            vm.collect_fully();
            work(vm)
        }
        result => result,
    }
}

/// Returns the function, form and environment of a macro call, as the program sees them.
pub(crate) fn macro_call(vm: &mut Vm, call: &MacroCall) -> Result<Option<[Value; 3]>, LoadError> {
    let mut unit = vm.compiler.unit.take();
    let prepared = prepare(vm, call, &mut unit);
    vm.compiler.unit.replace(unit);
    prepared
}

fn prepare(vm: &mut Vm, call: &MacroCall, unit: &mut Unit) -> Result<Option<[Value; 3]>, LoadError> {
    let function = match &call.function {
        MacroRef::Local(id) => unit.pinned(*id),
        MacroRef::Global(symbol) => {
            let symbol = unit.symbol_object(&mut vm.heap, &mut vm.names, symbol)?;
            vm.names.macro_function_of(&vm.heap, symbol)
        }
    };
    let Some(function) = function else { return Ok(None) };
    let form = unit.value_of(&mut vm.heap, &mut vm.names, &call.form)?;
    let environment = unit.environment(&mut vm.heap, &mut vm.names, &call.locals)?;
    Ok(Some([function, form, environment]))
}

/// Returns the function that calls the functions of a list.
fn runner(vm: &mut Vm) -> Result<Value, CallError> {
    if vm.names.runner.is_nil() {
        // The module is the machine's own, so all it can lack is room.
        let toplevel = vm.load_module(&runner_module()).map_err(|_| CallError::NoMemory)?;
        let toplevel = vm.heap.car(toplevel).unwrap_or(Value::NIL);
        let runner = vm.call(toplevel, &[], LOAD_TICKS)?;
        vm.names.runner = runner.first().copied().unwrap_or(Value::NIL);
    }
    Ok(vm.names.runner)
}

/// Returns a module whose form returns a function that calls the functions of a list, and returns the value
/// of the last.
fn runner_module() -> Module {
    let function = |registers, constants: &[u32], code: &[Instr]| ModuleFunction {
        registers,
        constants: constants.iter().map(|&index| PoolIdx(index)).collect(),
        code: code
            .iter()
            .flat_map(|instruction| {
                let (word, aux) = instruction.encode();
                [word].into_iter().chain(aux)
            })
            .collect(),
        ..ModuleFunction::default()
    };
    let give = function(
        1,
        &[0],
        &[Instr::LoadConst { dst: Dst(0), constant: ConstIdx(0) }, Instr::Return { src: Reg(0) }],
    );
    let mut run = function(
        4,
        &[],
        &[
            Instr::LoadNil { first: Room(1), count: Count(1) },
            Instr::JumpIfNotCons { test: Reg(0), to: Jump16(6) },
            Instr::Car { dst: Dst(2), list: Reg(0) },
            Instr::Cdr { dst: Dst(0), list: Reg(0) },
            Instr::Call { window: Window(2), count: Count(0), want: Want::ONE, pad: Pad(0) },
            Instr::Move { dst: Dst(1), src: Reg(2) },
            Instr::LoopIfCons { test: Reg(0), to: Back16(-6) },
            Instr::Return { src: Reg(1) },
        ],
    );
    run.parameters = Parameters::exactly(1);
    Module {
        constants: vec![Constant::Function(FunctionNumber(1))],
        functions: vec![give, run],
        toplevel: vec![FunctionNumber(0)],
        ..Module::default()
    }
}

impl CompileTimeHost for Vm {
    fn take_passed(&mut self) -> u64 {
        self.compiler.unit.borrow_mut().take_work()
    }

    fn account(&mut self, units: u64, bytes: usize) -> Result<(), Halt> {
        self.scheduler.spent += units * WORK_TICKS;
        if self.scheduler.is_budget_spent(&self.config) {
            return Err(Halt::Budget);
        }
        if self.outside.inbox.is_rung() {
            take_in(self);
        }
        if self.asked_to_end().is_some() {
            return Err(Halt::Signal);
        }
        let held = bytes + self.compiler.unit.borrow().bytes();
        if self.heap.set_external(Holder::Compiler, held).is_err() {
            self.collect_fully();
            return self.heap.check_room(0).map_err(|_| Halt::Memory);
        }
        Ok(())
    }

    fn expand(&mut self, call: &MacroCall) -> Result<Datum, CompileTimeFailure> {
        let prepared = with_room(self, |vm| macro_call(vm, call)).map_err(|error| error.to_string())?;
        let Some([function, form, environment]) = prepared else {
            return Err("the macro is not defined any more".to_string().into());
        };
        self.embedder.last_place = None;
        let values = match self.call_until_signal(function, &[form, environment], MACRO_TICKS) {
            Ok(values) => values,
            Err((error, condition)) => {
                let culprits = self.culprits(condition);
                let place = self.embedder.last_place.take();
                let report = self.expander_text(condition).unwrap_or_else(|| error.to_string());
                let usage = self.usage_of(&call.function);
                return Err(CompileTimeFailure { report, place, culprits, usage });
            }
        };
        let expansion = values.first().copied().unwrap_or(Value::NIL);
        let datum_of = |vm: &Vm| {
            let mut unit = vm.compiler.unit.borrow_mut();
            unit.datum_of(&vm.heap, &vm.names, expansion, call.form.span())
        };
        let mut datum = datum_of(self);
        if let Err(DatumError::NoRoom(_)) = datum {
            self.embedder.pin(&mut self.heap, expansion);
            self.collect_fully();
            self.embedder.unpin(expansion);
            datum = datum_of(self);
        }
        datum.map_err(|error| error.to_string().into())
    }

    fn load(&mut self, module: Module, keep: bool) -> Result<Option<ObjectId>, CompileTimeFailure> {
        let functions = with_room(self, |vm| load_in_unit(vm, &module)).map_err(|error| error.to_string())?;
        self.embedder.last_place = None;
        match self.run_toplevel(functions, LOAD_TICKS) {
            Ok(value) => Ok(keep.then(|| self.compiler.unit.borrow_mut().pin(value))),
            Err(error) => {
                let place = self.embedder.last_place.take();
                Err(CompileTimeFailure { place, ..error.to_string().into() })
            }
        }
    }
}

impl Vm {
    /// Returns the library's text about the condition with which a macro has failed. There is none if it did
    /// not fail but was stopped, and none while the library is being built.
    fn expander_text(&mut self, condition: Value) -> Option<String> {
        let writer = self.names.known.expander_text;
        if condition.is_nil() || !self.names.is_defined(&self.heap, writer) {
            return None;
        }
        self.embedder.pin(&mut self.heap, condition);
        let text = self.call(writer, &[condition], MACRO_TICKS);
        self.embedder.unpin(condition);
        self.heap.string_text(*text.ok()?.first()?)
    }

    /// Returns how a call of a global macro is written, by the library. It is not known while the library is
    /// being built.
    fn usage_of(&mut self, function: &MacroRef) -> Option<String> {
        let writer = self.names.known.macro_usage;
        let MacroRef::Global(symbol) = function else { return None };
        if !self.names.is_defined(&self.heap, writer) {
            return None;
        }
        let mut unit = self.compiler.unit.take();
        let name = unit.symbol_object(&mut self.heap, &mut self.names, symbol);
        self.compiler.unit.replace(unit);
        let name = name.ok()?;
        let usage = self.call(writer, &[name], MACRO_TICKS);
        self.heap.string_text(*usage.ok()?.first()?)
    }

    /// Returns the objects that a condition is about, as data of the unit: the values of its slots, and the
    /// items of those that are lists.
    fn culprits(&self, condition: Value) -> Vec<Datum> {
        let mut objects = Vec::new();
        for &slot in self.heap.structure_slots(condition).unwrap_or_default() {
            objects.push(slot);
            let mut rest = slot;
            while let (Some(pair), true) = (self.heap.as_cons(rest), objects.len() < MAX_CULPRITS) {
                objects.push(pair.car);
                rest = pair.cdr;
            }
        }
        let mut unit = self.compiler.unit.borrow_mut();
        objects.into_iter().filter_map(|object| unit.origin_of(&self.heap, &self.names, object)).collect()
    }
}
