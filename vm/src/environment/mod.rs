//! The meaning of names, for a compiler that works on the program of this machine.
//!
//! Guarantees: no question is answered by running the program, and none makes an object, so questions are
//! cheap and allowed in the middle of a builtin.
//!
//! Not here: running macros for a compiler outside of the machine (`host`), compiling at run time
//! (`builtins::eval`).

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::compile::{
    Accessor, Arity, Environment, Global, GlobalFunction, GlobalVariable, InternError, NameUse, Signature,
    SlotAccess,
};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::module::Parameters;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{
    CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol, setf_cell, symbol_of_setf_cell,
};

pub(crate) use host::{macro_call, with_compiler};

use crate::heap::layout::SymbolObject;
use crate::heap::{Heap, Kind};
use crate::names::{Names, find_builtin};
use crate::shape::{CodeKind, Shape};
use crate::value::Value;
use crate::vm::Vm;

mod host;
mod package;
mod signature;
mod similar;

/// Items of `*features*` that are looked at: the list may be circular.
const MAX_FEATURES: usize = 1000;

impl Vm {
    /// Returns the value of `*features*`, or the item of it, that is not as it has to be: a list of symbols.
    pub(crate) fn wrong_feature(&self) -> Option<WrongFeature> {
        let features = self.symbol_value(self.names.known.features)?;
        let mut rest = features;
        for _ in 0..MAX_FEATURES {
            let Some(pair) = self.heap.as_cons(rest) else { break };
            let item = pair.car;
            if !(item.is_nil() || item == Value::T || self.heap.is(item, Kind::Symbol)) {
                return Some(WrongFeature::Item(item));
            }
            rest = pair.cdr;
        }
        (!rest.is_list()).then_some(WrongFeature::List(features))
    }
}

/// A wrong value of `*features*`.
pub(crate) enum WrongFeature {
    /// The value is not a proper list.
    List(Value),
    /// An item of the list is not a symbol.
    Item(Value),
}

impl Environment for Vm {
    fn global(&self, symbol: &Symbol) -> Global {
        let is_locked = symbol.package().is_some_and(|home| is_of_language(home)) && !self.names.is_open;
        let Some(object) = object_for(self, symbol) else {
            return Global {
                function: function_so_far(&self.names, symbol),
                variable: variable_so_far(&self.names, symbol),
                accessor: None,
                locked: is_locked,
                instead: instead_of(self, symbol),
            };
        };
        let function = function_info(self, object);
        let instead = match function {
            GlobalFunction::Undefined => instead_of(self, symbol),
            _ => None,
        };
        Global {
            function,
            variable: variable_info(self, object),
            accessor: accessor_info(self, object),
            locked: is_locked,
            instead,
        }
    }

    fn setf_function(&self, symbol: &Symbol) -> GlobalFunction {
        self.global(&setf_cell(symbol)).function
    }

    fn property(&self, symbol: &Symbol, indicator: &Symbol) -> Option<Datum> {
        let Some(object) = object_for(self, symbol) else {
            let (image, definition) = self.names.images.definition(symbol)?;
            let wanted = (&**indicator.package()?, indicator.name());
            let has_name = |index| self.names.images.symbol(image, index) == Some(wanted);
            let &(_, value) = definition.properties.iter().find(|&&(indicator, _)| has_name(indicator))?;
            return self.names.images.datum(image, value);
        };
        let value = property(&self.heap, object, value_for(self, indicator)?)?;
        let unit = &mut self.compiler.unit.borrow_mut();
        Some(unit.datum_or_object(&self.heap, &self.names, value, Span::default()))
    }

    fn intern(&mut self, package: Option<&str>, name: &str, internal: bool) -> Result<Symbol, InternError> {
        self.read_symbol(package, name, internal)
    }

    fn read_base(&self) -> u32 {
        let base = self.symbol_value(self.names.known.read_base).and_then(Value::as_fixnum);
        base.and_then(|base| u32::try_from(base).ok()).filter(|base| (2..=36).contains(base)).unwrap_or(10)
    }

    fn has_own_syntax(&self) -> bool {
        self.symbol_value(self.names.known.readtable).is_some_and(|readtable| !readtable.is_nil())
    }

    fn has_feature(&self, name: &str) -> Option<bool> {
        let mut rest = self.symbol_value(self.names.known.features)?;
        for _ in 0..MAX_FEATURES {
            let Some(pair) = self.heap.as_cons(rest) else { return Some(false) };
            let feature = self.heap.symbol(self.names.object_of(&self.heap, pair.car).unwrap_or(pair.car));
            if feature.is_some_and(|symbol| self.heap.string_text(symbol.name).as_deref() == Some(name)) {
                return Some(true);
            }
            rest = pair.cdr;
        }
        Some(false)
    }

    fn is_pair(&self, object: ObjectId) -> bool {
        self.compiler.unit.borrow().pinned(object).is_some_and(Value::is_cons)
    }

    fn fresh(&mut self) -> u32 {
        self.names.fresh()
    }

    fn is_type(&self, symbol: &Symbol) -> bool {
        similar::is_type(self, symbol)
    }

    fn similar(&self, symbol: &Symbol, wanted: NameUse) -> Vec<Symbol> {
        similar::similar(self, symbol, wanted)
    }

    fn signature(&self, cell: &Symbol) -> Option<Signature> {
        signature::signature(self, cell)
    }
}

fn is_of_language(home: &str) -> bool {
    matches!(home, CL_PACKAGE | ESL_PACKAGE | KEYWORD_PACKAGE)
}

/// Returns the function that a symbol without an object names: a builtin, or one of the library.
fn function_so_far(names: &Names, symbol: &Symbol) -> GlobalFunction {
    if let Some((image, definition)) = names.images.definition(symbol) {
        if definition.macro_function.is_some() {
            return GlobalFunction::Macro;
        }
        if let Some(number) = definition.function {
            let arity = names.images.decode(image, number).map(|function| arity_of(&function.parameters));
            return GlobalFunction::Function(arity);
        }
    }
    match find_builtin(symbol) {
        Some(builtin) => GlobalFunction::Function(Some(builtin.info().arity)),
        None => GlobalFunction::Undefined,
    }
}

/// Returns the variable that such a symbol names.
fn variable_so_far(names: &Names, symbol: &Symbol) -> GlobalVariable {
    if symbol.is_keyword() {
        return GlobalVariable::Constant(Datum::symbol(symbol.clone(), Span::default()));
    }
    match names.images.definition(symbol) {
        Some((image, definition)) if definition.is_constant => {
            match definition.value.and_then(|value| names.images.datum(image, value)) {
                Some(value) => GlobalVariable::Constant(value),
                None => GlobalVariable::Special,
            }
        }
        Some((_, definition)) if definition.is_special => GlobalVariable::Special,
        _ => GlobalVariable::Undefined,
    }
}

fn arity_of(parameters: &Parameters) -> Arity {
    let min = u32::from(parameters.required);
    let has_more = parameters.rest || parameters.keys.is_some();
    Arity { min, max: if has_more { None } else { Some(min + u32::from(parameters.optional)) } }
}

/// Returns the value of `indicator` in the property list of a symbol object.
pub(crate) fn property(heap: &Heap, object: Value, indicator: Value) -> Option<Value> {
    let mut plist = heap.symbol(object)?.plist;
    while let Some(entry) = heap.as_cons(plist) {
        let rest = heap.as_cons(entry.cdr)?;
        if entry.car == indicator {
            return Some(rest.car);
        }
        plist = rest.cdr;
    }
    None
}

/// Returns the symbol as the program sees it, if it has an object already.
fn value_for(vm: &Vm, symbol: &Symbol) -> Option<Value> {
    match symbol.package() {
        Some(_) => vm.names.find(symbol),
        None => {
            let unit = vm.compiler.unit.borrow();
            unit.find_uninterned(symbol).or_else(|| {
                let named = unit.find_uninterned(&symbol_of_setf_cell(symbol)?)?;
                vm.names.find_setf_cell(&vm.heap, named)
            })
        }
    }
}

/// Returns the object of a symbol, if there is one already.
fn object_for(vm: &Vm, symbol: &Symbol) -> Option<Value> {
    vm.names.object_of(&vm.heap, value_for(vm, symbol)?)
}

fn function_info(vm: &Vm, object: Value) -> GlobalFunction {
    if vm.names.macro_function_of(&vm.heap, object).is_some() {
        return GlobalFunction::Macro;
    }
    match vm.names.function_of(&vm.heap, object) {
        Some(function) => GlobalFunction::Function(arity(vm, function)),
        None => GlobalFunction::Undefined,
    }
}

/// Returns the number of arguments that a function takes; `None` if its code is damaged.
pub(crate) fn arity(vm: &Vm, function: Value) -> Option<Arity> {
    let code = vm.heap.code(vm.heap.function_code(function)?)?;
    let shape = Shape::unpack(code.spare[0]);
    match shape.kind {
        CodeKind::Native => BUILTINS.get(usize::from(shape.number)).map(|info| info.arity),
        CodeKind::Undefined => None,
        CodeKind::Lazy => {
            let (image, number) = crate::names::load::image_origin(&vm.heap, function)?;
            Some(arity_of(&vm.names.images.decode(image, number)?.parameters))
        }
        CodeKind::Bytecode => {
            let min = u32::from(shape.required);
            let has_more = shape.rest || shape.takes_keys;
            Some(Arity { min, max: if has_more { None } else { Some(min + u32::from(shape.optional)) } })
        }
    }
}

fn variable_info(vm: &Vm, object: Value) -> GlobalVariable {
    let Some(cell) = vm.heap.symbol(object) else { return GlobalVariable::Undefined };
    if cell.header.flags & SymbolObject::CONSTANT != 0 {
        let unit = &mut vm.compiler.unit.borrow_mut();
        let value = unit.datum_or_object(&vm.heap, &vm.names, cell.value, Span::default());
        return GlobalVariable::Constant(value);
    }
    if cell.header.flags & SymbolObject::SPECIAL != 0 {
        GlobalVariable::Special
    } else {
        GlobalVariable::Undefined
    }
}

/// Returns the record of `%define-accessor`.
fn accessor_info(vm: &Vm, object: Value) -> Option<Accessor> {
    let record = property(&vm.heap, object, vm.names.known.accessor)?;
    let class = vm.heap.as_cons(record)?;
    let slot = vm.heap.as_cons(class.cdr)?;
    Some(Accessor {
        class: vm.names.name_of(&vm.heap, class.car)?,
        slot: u16::try_from(slot.car.as_index()?).ok()?,
        access: match slot.cdr {
            Value::NIL => SlotAccess::Free,
            // The type of its values, and whether it is read-only.
            access => match vm.heap.as_cons(access).and_then(|typed| vm.heap.as_cons(typed.cdr)) {
                Some(is_read_only) if is_read_only.car == Value::NIL => SlotAccess::Checked,
                _ => SlotAccess::ReadOnly,
            },
        },
    })
}

/// Returns the library's advice on a name of Common Lisp that it omits.
fn instead_of(vm: &Vm, symbol: &Symbol) -> Option<String> {
    if !symbol.is_in(CL_PACKAGE) {
        return None;
    }
    match vm.property(symbol, &Symbol::esl("%INSTEAD"))?.kind() {
        DatumKind::String(text) => Some(text.to_string()),
        _ => None,
    }
}
#[cfg(test)]
mod tests;
