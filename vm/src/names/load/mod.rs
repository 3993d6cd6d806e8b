//! Loading: from compiled modules to functions in the heap.
//!
//! A module that is read or compiled while the machine runs is verified and loaded whole, before any of it
//! runs, but in parts between which others have their turns. Nothing of it stays outside of the heap, so code
//! that a program no longer reaches is collected. The image of the library is trusted and loaded piece by
//! piece (`image`): a function is a stub until its first call.
//!
//! Guarantees: one value for each entry of a module's pool, so that literal data keep their identity; a Code
//! is laid out as `shape` says.
//!
//! A constant that names a structure class is loaded as its symbol. The machine replaces it by the class when
//! an instruction first needs it, so code may be loaded before the class is defined, and uses the class as it
//! is then.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::fmt;

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::compile::Work;
use esl_bytecode::file::ReadError;
use esl_bytecode::module::{Constant, Module, ModuleFunction, PoolIdx, VariablePlace};
use esl_bytecode::package::PackageId;
use esl_bytecode::symbol::{Home, Symbol, symbol_of_setf_cell};
use esl_bytecode::verify::VerifyError;

use crate::fused::fuse;
use crate::heap::layout::CodeObject;
use crate::heap::{AllocError, CodeParts, Heap, Kind};
use crate::names::Names;
use crate::shape::{CodeKind, Shape, capture_word};
use crate::trust::LAZY_WORD;
use crate::trust::{self, Verification, Verified};
use crate::value::Value;

mod data;
mod debug;
mod definitions;
mod image;
mod literal;
mod origin;
mod prepare;

pub(crate) use debug::texts as debug_texts;
pub(crate) use definitions::ImageClass;
pub use esl_bytecode::compile::SourcePlace;
pub(crate) use image::{
    Images, constant as image_constant, function as image_function, open as open_image,
    origin as image_origin,
};
pub(crate) use literal::{array, character, integer, integer_of, integer_value, ratio};
pub(crate) use origin::is_of_library;
use origin::is_of_module;
pub use prepare::prepare;

/// Why a module was not loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// The verifier refuses the module.
    Refused(VerifyError),
    /// The image is damaged.
    Damaged(ReadError),
    /// The module refers to an object of another compilation.
    ForeignObject,
    /// There is no room.
    Alloc(AllocError),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadError::Refused(error) => write!(f, "the verifier refuses the module: {error}"),
            LoadError::Damaged(error) => error.fmt(f),
            LoadError::ForeignObject => f.write_str("the module refers to an object of another compilation"),
            LoadError::Alloc(_) => f.write_str("there is not enough memory for the module"),
        }
    }
}

impl std::error::Error for LoadError {}

impl From<AllocError> for LoadError {
    fn from(error: AllocError) -> LoadError {
        LoadError::Alloc(error)
    }
}

impl From<ReadError> for LoadError {
    fn from(error: ReadError) -> LoadError {
        LoadError::Damaged(error)
    }
}

/// Objects that the constants of a module may refer to but do not describe: those shared by the modules of
/// one compilation.
pub(crate) trait SharedObjects {
    /// Returns the symbol object for an uninterned symbol's number, if there is one.
    fn uninterned(&self, id: u32) -> Option<Value>;
    /// Records the symbol object made for a number.
    fn note_uninterned(&mut self, id: u32, object: Value);
    /// Returns an object of the program.
    fn object(&self, id: u32) -> Option<Value>;
}

/// The shared objects of a module that stands alone, such as one from a file.
#[derive(Default)]
pub(crate) struct Alone(BTreeMap<u32, Value>);

impl SharedObjects for Alone {
    fn uninterned(&self, id: u32) -> Option<Value> {
        self.0.get(&id).copied()
    }

    fn note_uninterned(&mut self, id: u32, object: Value) {
        self.0.insert(id, object);
    }

    fn object(&self, _id: u32) -> Option<Value> {
        None
    }
}

/// Loads a module. Returns a list of the functions that run its top-level forms, in order.
///
/// # Errors
/// [`LoadError`]; then nothing of the module is reachable.
pub(crate) fn load(
    heap: &mut Heap,
    names: &mut Names,
    module: &Module,
    shared: &mut dyn SharedObjects,
) -> Result<Value, LoadError> {
    let mut load = ModuleLoad::new(module);
    loop {
        if let Some(functions) = load.run(heap, names, shared, &mut Work::unbounded())? {
            return Ok(functions);
        }
    }
}

/// The loading of a module, which goes on in parts. Between two of them its values are roots of the
/// collector. Steps without enough room are repeated when it goes on.
pub(crate) struct ModuleLoad<M> {
    module: M,
    verification: Verification,
    verified: Option<Verified>,
    /// The placeholder for functions whose code is not there yet.
    stub: Value,
    /// Functions by number: the Function of one without captures, the Code of one with captures.
    functions: Vec<Value>,
    /// Values of the pool.
    pool: Vec<Value>,
    debug_names: debug::ModuleNames,
    /// Codes by the numbers of functions.
    codes: Vec<Value>,
    /// Number of functions whose Codes refer to those with captures.
    filled: usize,
    /// The list of the functions for the top-level forms, when all is done.
    toplevel: Option<Value>,
}

/// Constants or functions that count as a unit of work where nothing more is done than to make an object.
const OBJECTS_PER_UNIT: usize = 8;
/// Words of code that count as a unit of work.
const WORDS_PER_UNIT: usize = 4;

impl<M: Borrow<Module>> ModuleLoad<M> {
    /// Begins to load a module.
    pub(crate) fn new(module: M) -> ModuleLoad<M> {
        ModuleLoad {
            module,
            verification: Verification::default(),
            verified: None,
            stub: Value::NIL,
            functions: Vec::new(),
            pool: Vec::new(),
            debug_names: debug::ModuleNames::default(),
            codes: Vec::new(),
            filled: 0,
            toplevel: None,
        }
    }

    /// Calls `visit` with every object that it keeps alive.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        let lists = [&self.functions, &self.pool, &self.codes];
        lists.into_iter().flatten().chain(&self.toplevel).for_each(|&value| visit(value));
        visit(self.stub);
        self.debug_names.roots(visit);
    }

    /// Returns about how many bytes it takes.
    pub(crate) fn bytes(&self) -> usize {
        let values = self.functions.len() + self.pool.len() + self.codes.len();
        self.module.borrow().bytes() + values * size_of::<Value>()
    }

    /// Goes on. Returns a list of the functions that run the module's top-level forms, in order; `None` if
    /// the work that is allowed is done before.
    ///
    /// # Errors
    /// [`LoadError`]
    pub(crate) fn run(
        &mut self,
        heap: &mut Heap,
        names: &mut Names,
        shared: &mut dyn SharedObjects,
        work: &mut Work,
    ) -> Result<Option<Value>, LoadError> {
        let ModuleLoad { module, verification, verified, stub, functions, pool, debug_names, codes, .. } =
            self;
        let module = (*module).borrow();
        let verified = match verified {
            Some(verified) => verified,
            None => match verification.run(module, work).map_err(LoadError::Refused)? {
                Some(proof) => verified.insert(proof),
                None => return Ok(None),
            },
        };
        // Data may contain functions, and functions each other, so functions are made before their code.
        if stub.is_nil() {
            let shape = Shape::other(CodeKind::Lazy, 0);
            *stub = trust::alloc_stub(heap, Value::NIL, Value::NIL, shape, 0, LAZY_WORD)?;
        }
        while let Some(function) = module.functions.get(functions.len()) {
            if functions.len().is_multiple_of(OBJECTS_PER_UNIT) {
                if work.is_done() {
                    return Ok(None);
                }
                work.add(1);
            }
            let has_captures = !function.captures.is_empty();
            let object = if has_captures { Value::NIL } else { trust::alloc_function(heap, *stub, &[])? };
            functions.push(object);
        }
        let mut constants = Constants { heap, names, shared, functions: &*functions };
        while let Some(constant) = module.constants.get(pool.len()) {
            if pool.len().is_multiple_of(OBJECTS_PER_UNIT) {
                if work.is_done() {
                    return Ok(None);
                }
                work.add(1);
            }
            let value = constants.make(constant, pool)?;
            pool.push(value);
        }
        if !debug_names.run(heap, module, work)? {
            return Ok(None);
        }
        while let Some(function) = module.functions.get(codes.len()) {
            if work.is_done() {
                return Ok(None);
            }
            work.add(1 + (function.code.len() / WORDS_PER_UNIT) as u64);
            let constants = own_constants(function, |PoolIdx(index)| pool[index as usize]);
            let debug = debug::describe(heap, function, pool, debug_names)?;
            let parts =
                LoadedFunction { function, constants: &constants, name: name_of(function, pool), debug };
            let owner = Value::boolean(is_of_module(module, function));
            let code = make_code(heap, verified, &parts, owner)?;
            let object = &mut functions[codes.len()];
            if object.is_nil() {
                *object = code;
            } else {
                trust::replace_stub(heap, *object, code);
            }
            codes.push(code);
        }
        while self.filled < self.codes.len() {
            if work.is_done() {
                return Ok(None);
            }
            work.add(1);
            let end = self.codes.len().min(self.filled + OBJECTS_PER_UNIT);
            (self.filled..end).for_each(|number| self.fill_in(heap, number));
            self.filled = end;
        }
        if self.toplevel.is_none() {
            let toplevel = &self.module.borrow().toplevel;
            let toplevel: Vec<Value> =
                toplevel.iter().map(|number| self.functions[number.0 as usize]).collect();
            for &function in &toplevel {
                heap.set_aux(function, Kind::Function, TOP_LEVEL);
            }
            self.toplevel = Some(heap.list(&toplevel)?);
        }
        Ok(self.toplevel)
    }

    /// Stores the Codes of functions with captures, known only now, into the constants of a function that
    /// refer to them.
    fn fill_in(&self, heap: &mut Heap, number: usize) {
        let module = self.module.borrow();
        for (index, &PoolIdx(constant)) in module.functions[number].constants.iter().enumerate() {
            if let Constant::Function(function) = module.constants[constant as usize] {
                trust::set_constant(heap, self.codes[number], index, self.functions[function.0 as usize]);
            }
        }
    }
}

/// The sources of the values of constants.
struct Constants<'a> {
    heap: &'a mut Heap,
    names: &'a mut Names,
    shared: &'a mut dyn SharedObjects,
    functions: &'a [Value],
}

impl Constants<'_> {
    fn symbol(&mut self, symbol: &Symbol) -> Result<Value, AllocError> {
        let Home::Uninterned(id) = *symbol.home() else { return self.names.intern(self.heap, symbol) };
        if let Some(object) = self.shared.uninterned(id) {
            return Ok(object);
        }
        let object = match symbol_of_setf_cell(symbol) {
            Some(named) => {
                let named = self.symbol(&named)?;
                self.names.setf_cell_object(self.heap, named)?
            }
            None => self.names.intern(self.heap, symbol)?,
        };
        self.shared.note_uninterned(id, object);
        Ok(object)
    }

    /// Returns the value of a constant; the values of earlier ones are in the pool.
    fn make(&mut self, constant: &Constant, pool: &[Value]) -> Result<Value, LoadError> {
        let pool = |&PoolIdx(index): &PoolIdx| pool[index as usize];
        Ok(match constant {
            Constant::Nil => Value::NIL,
            Constant::True => Value::T,
            Constant::Symbol(symbol) | Constant::Class(symbol) => self.symbol(symbol)?,
            Constant::Integer(value) => integer(self.heap, value)?,
            Constant::Ratio(numerator, denominator) => ratio(self.heap, numerator, denominator)?,
            Constant::Float(value) => self.heap.float(*value)?,
            Constant::Character(c) => character(*c),
            Constant::String(text) => self.heap.alloc_str(text)?,
            Constant::Cons(car, cdr) => self.heap.cons(pool(car), pool(cdr))?,
            Constant::Vector(items) => {
                let items: Vec<Value> = items.iter().map(pool).collect();
                self.heap.alloc_vector(&items)?
            }
            Constant::Array(dimensions, items) => {
                let items: Vec<Value> = items.iter().map(pool).collect();
                array(self.heap, dimensions, &items)?
            }
            Constant::Function(number) => self.functions[number.0 as usize],
            Constant::Object(id) => self.shared.object(id.0).ok_or(LoadError::ForeignObject)?,
        })
    }
}

/// Value of `aux` of a Function that runs one or several top-level forms.
pub(crate) const TOP_LEVEL: u16 = 1;

/// The parts from which a Code is made.
struct LoadedFunction<'a> {
    function: &'a ModuleFunction,
    /// Constants of the function, then the names of its keys.
    constants: &'a [Value],
    name: Value,
    debug: Value,
}

fn make_code(
    heap: &mut Heap,
    verified: &Verified,
    parts: &LoadedFunction<'_>,
    owner: Value,
) -> Result<Value, AllocError> {
    let function = parts.function;
    let mut words = function.code.clone();
    fuse(&mut words);
    words.extend(function.captures.iter().copied().map(capture_word));
    let parameters = &function.parameters;
    let arity = if parameters.is_exact() { u32::from(parameters.required) } else { CodeObject::ANY_ARITY };
    let parts = CodeParts {
        name: parts.name,
        debug: parts.debug,
        owner,
        arity,
        nregs: u32::from(function.registers),
        spare: [Shape::bytecode(parameters).pack(), function.captures.len() as u64],
        constants: parts.constants,
        words: &words,
    };
    trust::alloc_code(heap, parts, verified)
}

/// Returns the constants of a function's Code: its own, then the names of its keys.
fn own_constants(function: &ModuleFunction, value: impl FnMut(PoolIdx) -> Value) -> Vec<Value> {
    let keys = function.parameters.keys.iter().flatten();
    function.constants.iter().chain(keys).copied().map(value).collect()
}

fn name_of(function: &ModuleFunction, pool: &[Value]) -> Value {
    function.name.map_or(Value::NIL, |PoolIdx(index)| pool[index as usize])
}

impl Names {
    /// Returns the place in the source where word `pc` of a code was written.
    pub(crate) fn source_place(&self, heap: &Heap, code: Value, pc: u32) -> Option<SourcePlace> {
        let parts = heap.code(code)?;
        if parts.owner.is_fixnum() {
            return image::place_of(heap, self, code, pc);
        }
        debug::place_of(heap, parts.debug, pc)
    }

    /// Returns the names of the variables that can be looked at at word `pc` of a code, and where they are;
    /// those of inner scopes last.
    pub(crate) fn variables_at(&self, heap: &Heap, code: Value, pc: u32) -> Vec<(String, VariablePlace)> {
        let Some(parts) = heap.code(code) else { return Vec::new() };
        if parts.owner.is_fixnum() {
            return image::variables_at(heap, self, code, pc);
        }
        debug::variables_at(heap, parts.debug, pc)
    }

    /// Returns lambda list and documentation of a function; `NIL` for either that it lacks. `None` unless
    /// `function` is a function.
    ///
    /// # Errors
    /// [`LoadError`] if an image is damaged, or there is no room.
    pub(crate) fn texts_of_function(
        &mut self,
        heap: &mut Heap,
        function: Value,
    ) -> Result<Option<(Value, Value)>, LoadError> {
        if let Some((image, number)) = image_origin(heap, function) {
            return image::texts(heap, self, image, number).map(Some);
        }
        let code = heap.function_code(function).and_then(|code| heap.code(code)).copied();
        let Some(code) = code else { return Ok(None) };
        let shape = Shape::unpack(code.spare[0]);
        if shape.kind == CodeKind::Native
            && let Some(info) = BUILTINS.get(usize::from(shape.number))
        {
            let documentation: Vec<&str> = info.doc.iter().map(|line| line.trim()).collect();
            let documentation = heap.alloc_str(&documentation.join(" "))?;
            let mut parameters = Vec::new();
            for word in info.lambda_list.split_whitespace() {
                let word = word.to_uppercase();
                let known = self.packages().find(PackageId::ESL, &word);
                let symbol = known.map_or_else(|| Symbol::esl(&word), |(symbol, _)| symbol);
                parameters.push(self.intern(heap, &symbol)?);
            }
            return Ok(Some((heap.list(&parameters)?, documentation)));
        }
        Ok(Some(debug::texts(heap, code.debug).unwrap_or((Value::NIL, Value::NIL))))
    }
}

#[cfg(test)]
mod tests;
