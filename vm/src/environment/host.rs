//! Running the compile-time parts of a program for a compiler outside of the machine.
//!
//! A unit is compiled at a time: [`Vm::begin_unit`] forgets what was remembered of the last one. Between calls the unit
//! keeps everything alive that its data refer to.

use std::sync::Arc;

use esl_bytecode::compile::{CompileTimeHost, LocalDefinition, MacroCall, MacroRef};
use esl_bytecode::datum::{Datum, ObjectId};
use esl_bytecode::file::ModuleImage;
use esl_bytecode::module::Module;

use crate::datum::Unit;
use crate::heap::AllocError;
use crate::load::{Alone, LoadError, load};
use crate::value::Value;
use crate::vm::Vm;

/// Ticks that one macro call may take before it counts as one that never ends.
const MACRO_TICKS: u64 = 50_000_000;
/// Ticks that the compile-time part of one form may take.
const LOAD_TICKS: u64 = 1_000_000_000;

impl Vm {
    /// Begins to compile another unit: objects and uninterned symbols of the last one are forgotten.
    pub fn begin_unit(&mut self) {
        self.world.unit.replace(Unit::default());
    }

    /// Loads a module that stands alone, such as one from a file, and gives the functions that run its top-level forms, in
    /// order, as a list.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn load_module(&mut self, module: &Module) -> Result<Value, LoadError> {
        self.with_room(|vm| load(&mut vm.heap, &mut vm.world, module, &mut Alone::default()))
    }

    /// Loads a module of the unit that is being compiled.
    ///
    /// # Errors
    /// [`LoadError`].
    pub(crate) fn load_in_unit(&mut self, module: &Module) -> Result<Value, LoadError> {
        let mut unit = self.world.unit.take();
        let functions = load(&mut self.heap, &mut self.world, module, &mut unit);
        self.world.unit.replace(unit);
        functions
    }

    /// Takes in an image, such as that of the library, and gives the functions that run its top-level forms, in order,
    /// as a list. The image counts as verified.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn open_image(&mut self, image: ModuleImage) -> Result<Value, LoadError> {
        let image = Arc::new(image);
        self.with_room(|vm| vm.world.open_image(&mut vm.heap, image.clone()))
    }

    /// Closes the language: from here on, its names cannot be defined again.
    pub fn seal(&mut self) {
        self.world.is_open = false;
    }

    /// Does something outside of all tasks that may find no room: then once more, after a collection.
    fn with_room<T>(
        &mut self,
        mut work: impl FnMut(&mut Vm) -> Result<T, LoadError>,
    ) -> Result<T, LoadError> {
        match work(self) {
            Err(LoadError::Alloc(AllocError::NeedCollection)) => {
                self.collect_fully();
                work(self)
            }
            result => result,
        }
    }

    /// The function, form and environment of a macro call, as the program sees them.
    pub(crate) fn macro_call(&mut self, call: &MacroCall) -> Result<Option<[Value; 3]>, LoadError> {
        let mut unit = self.world.unit.take();
        let prepared = self.prepare(call, &mut unit);
        self.world.unit.replace(unit);
        prepared
    }

    fn prepare(&mut self, call: &MacroCall, unit: &mut Unit) -> Result<Option<[Value; 3]>, LoadError> {
        let function = match &call.function {
            MacroRef::Local(id) => unit.pinned(*id),
            MacroRef::Global(symbol) => {
                let symbol = unit.symbol_object(&mut self.heap, &mut self.world, symbol)?;
                self.world.macro_function_of(&self.heap, symbol)
            }
        };
        let Some(function) = function else { return Ok(None) };
        let form = unit.value_of(&mut self.heap, &mut self.world, &call.form)?;
        let mut environment = Value::NIL;
        for LocalDefinition { name, expander } in call.locals.iter().rev() {
            let name = unit.symbol_object(&mut self.heap, &mut self.world, name)?;
            let expander = expander.and_then(|id| unit.pinned(id)).unwrap_or(Value::NIL);
            let entry = self.heap.cons(name, expander)?;
            environment = self.heap.cons(entry, environment)?;
        }
        Ok(Some([function, form, environment]))
    }

    /// Runs the functions of a loaded module one after the other: the value of the last.
    ///
    /// # Errors
    /// The text of the failure that ended one.
    pub fn run_toplevel(&mut self, functions: Value, ticks: u64) -> Result<Value, String> {
        self.pin(functions);
        let mut value = Value::NIL;
        let mut rest = functions;
        let mut result = Ok(());
        while let Some(pair) = self.heap.as_cons(rest) {
            match self.call(pair.car, &[], ticks) {
                Ok(values) => value = values.first().copied().unwrap_or(Value::NIL),
                Err(failure) => {
                    result = Err(failure);
                    break;
                }
            }
            rest = pair.cdr;
        }
        self.unpin(functions);
        result.map(|()| value)
    }
}

impl CompileTimeHost for Vm {
    fn expand(&mut self, call: &MacroCall) -> Result<Datum, String> {
        let prepared = self.with_room(|vm| vm.macro_call(call)).map_err(|error| error.to_string())?;
        let Some([function, form, environment]) = prepared else {
            return Err("the macro is not defined any more".into());
        };
        let values = self.call(function, &[form, environment], MACRO_TICKS)?;
        let expansion = values.first().copied().unwrap_or(Value::NIL);
        let mut unit = self.world.unit.borrow_mut();
        let datum = unit.datum_of(&self.heap, &self.world, expansion, call.form.span());
        datum.map_err(|error| error.to_string())
    }

    fn load(&mut self, module: Module, keep: bool) -> Result<Option<ObjectId>, String> {
        let functions = self.with_room(|vm| vm.load_in_unit(&module)).map_err(|error| error.to_string())?;
        let value = self.run_toplevel(functions, LOAD_TICKS)?;
        Ok(keep.then(|| self.world.unit.borrow_mut().pin(value)))
    }
}
