//! The image of the library: a module that is loaded piece by piece.
//!
//! A function of the image is a stub with its number until its first call; then its code is decoded, and with
//! it the constants that it names, unless they exist already. The objects made are kept in simple vectors of
//! the heap, by number, so that each is made once.
//!
//! The image may come with *definitions*: a row in a table, consulted when a symbol object is made, instead
//! of a top-level form that runs when the machine starts. So functions that a program does not use cost no
//! time at the start. [`super::prepare`] makes the rows when the library is built.

use std::sync::Arc;

use esl_bytecode::compile::SourcePlace;
use esl_bytecode::datum::Datum;
use esl_bytecode::file::{ConstantRecord, ModuleImage, SymbolHome};
use esl_bytecode::module::{FunctionNumber, ModuleFunction, PoolIdx, VariablePlace};
use esl_bytecode::symbol::{Symbol, symbol_of_setf_cell};
use esl_heap::state::{StateSink, Stated};
use esl_heap::store::{Stored, StoredBytes};

use super::definitions::{Definitions, ImageDefinition, name_of};
use super::{LoadError, LoadedFunction, character, data, debug, integer, make_code, own_constants, ratio};
use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::shape::{CodeKind, Shape};
use crate::trust::LAZY_WORD;
use crate::trust::{self, Verified};
use crate::value::Value;

/// The images that a machine runs from.
#[derive(Clone, Default)]
pub(crate) struct Images(Vec<Image>);

/// An image, and the objects made of it.
#[derive(Clone)]
struct Image {
    name: &'static str,
    module: Arc<ModuleImage>,
    packages: Vec<Arc<str>>,
    definitions: Definitions,
    /// Symbol objects by number in the image; [`Value::UNSUPPLIED`] where there is none yet.
    symbols: Value,
    /// Values of the pool, likewise.
    pool: Value,
    /// Functions by number, likewise: the Function of one without captures, the Code of one with captures.
    functions: Value,
    /// Code of functions before their first call. Its owner is the number of the image; capture 0 of the
    /// function is its number in the image.
    lazy: Value,
}

impl Stated for Images {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.roots(&mut |root| sink.value(root));
    }
}

impl Images {
    /// Returns the names of the images.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'static str> {
        self.0.iter().map(|image| image.name)
    }

    /// Adds the objects made of the images to `out`, with the names of these.
    pub(crate) fn store(&self, out: &mut Vec<u8>) {
        let rows = self
            .0
            .iter()
            .map(|image| (image.name.to_owned(), [image.symbols, image.pool, image.functions, image.lazy]));
        rows.collect::<Vec<(String, [Value; 4])>>().store(out);
    }

    /// Takes the objects made of the same images over; `None` if they are others, or the bytes end before.
    pub(crate) fn load(&mut self, from: &mut StoredBytes<'_>) -> Option<()> {
        let rows: Vec<(String, [Value; 4])> = Stored::load(from)?;
        if rows.len() != self.0.len() {
            return None;
        }
        for (image, (name, objects)) in self.0.iter_mut().zip(rows) {
            if image.name != name {
                return None;
            }
            [image.symbols, image.pool, image.functions, image.lazy] = objects;
        }
        Some(())
    }

    /// Calls `visit` with every object made of the images.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        for image in &self.0 {
            [image.symbols, image.pool, image.functions, image.lazy].into_iter().for_each(&mut *visit);
        }
    }

    /// Returns the definition of `symbol`, and the number of the image that has it.
    pub(crate) fn definition(&self, symbol: &Symbol) -> Option<(usize, ImageDefinition)> {
        let find = |(number, image): (usize, &Image)| {
            Some((number, image.definitions.find(&image.module, &image.packages, symbol)?))
        };
        self.0.iter().enumerate().find_map(find)
    }

    /// Returns the first text among the properties that an image gives a symbol: its documentation. `None` if
    /// there is none, or the symbol has no object yet.
    pub(crate) fn text_of(&self, heap: &Heap, symbol: &Symbol) -> Option<Value> {
        let (image, definition) = self.definition(symbol)?;
        let pool = heap.vector(self.0.get(image)?.pool)?;
        let values = definition.properties.iter().filter_map(|(_, value)| pool.get(value.0 as usize));
        values.copied().find(|&value| heap.string(value).is_some())
    }

    /// Returns the names that the newest image exports from `ESL`.
    pub(crate) fn exports(&self) -> Vec<String> {
        let names = self.0.last().map(|image| image.definitions.exports(&image.module, &image.packages));
        names.unwrap_or_default().into_iter().map(str::to_owned).collect()
    }

    /// Returns the datum that a constant of an image describes, if there is one.
    pub(crate) fn datum(&self, image: usize, index: PoolIdx) -> Option<Datum> {
        let image = self.0.get(image)?;
        data::datum(&image.module, &image.packages, index)
    }

    /// Returns package and name of a constant of an image that is a symbol.
    pub(crate) fn symbol(&self, image: usize, index: PoolIdx) -> Option<(&str, &str)> {
        let image = self.0.get(image)?;
        name_of(&image.module, &image.packages, index)
    }

    /// Calls `visit` with every symbol that the images define.
    pub(crate) fn each_definition(&self, visit: &mut dyn FnMut(&Symbol)) {
        for image in &self.0 {
            image.definitions.each(&image.module, &image.packages, visit);
        }
    }

    /// Decodes a function.
    pub(crate) fn decode(&self, image: usize, function: u32) -> Option<ModuleFunction> {
        self.0.get(image)?.module.function(FunctionNumber(function)).ok()
    }

    /// Returns the name of a source of an image.
    fn source(&self, image: usize, source: u32) -> Option<String> {
        self.0.get(image)?.module.source(source).ok()?.map(str::to_owned)
    }
}

/// Adds an image. Returns a list of the functions that run its top-level forms, in order.
///
/// # Errors
/// [`LoadError`].
pub(crate) fn open(
    heap: &mut Heap,
    names: &mut Names,
    name: &'static str,
    module: Arc<ModuleImage>,
) -> Result<Value, LoadError> {
    let number = names.images.0.len();
    let packages = module.packages()?.into_iter().map(Arc::from).collect();
    let shape = Shape::other(CodeKind::Lazy, 0);
    let image = Image {
        name,
        packages,
        definitions: Definitions::of(&module)?,
        symbols: trust::alloc_image_table(heap, module.symbol_count())?,
        pool: trust::alloc_image_table(heap, module.constant_count())?,
        functions: trust::alloc_image_table(heap, module.function_count())?,
        lazy: trust::alloc_stub(heap, Value::NIL, Value::index(number), shape, 1, LAZY_WORD)?,
        module: module.clone(),
    };
    names.images.0.push(image);
    let mut loader = ImageLoader { heap, names, image: number };
    let mut toplevel = Vec::new();
    for function in module.toplevel()? {
        toplevel.push(loader.function(function)?);
    }
    Ok(heap.list(&toplevel)?)
}

/// Returns the function of an image with this number, which has no captures.
///
/// # Errors
/// As for every allocation.
pub(crate) fn function(
    heap: &mut Heap,
    names: &mut Names,
    image: usize,
    number: u32,
) -> Result<Value, AllocError> {
    ImageLoader { heap, names, image }.function(FunctionNumber(number))
}

/// Returns the value of a constant of an image, which is data or a function without captures.
///
/// # Errors
/// As for every allocation. A damaged constant is `NIL`: the image is part of this program.
pub(crate) fn constant(
    heap: &mut Heap,
    names: &mut Names,
    image: usize,
    index: PoolIdx,
) -> Result<Value, AllocError> {
    match (ImageLoader { heap, names, image }).constant(index) {
        Err(LoadError::Alloc(error)) => Err(error),
        value => Ok(value.unwrap_or(Value::NIL)),
    }
}

/// A loader at work on one image.
struct ImageLoader<'a> {
    heap: &'a mut Heap,
    names: &'a mut Names,
    image: usize,
}

impl ImageLoader<'_> {
    fn image(&self) -> &Image {
        &self.names.images.0[self.image]
    }

    fn module(&self) -> Arc<ModuleImage> {
        self.image().module.clone()
    }

    fn made(&self, table: Value, index: u32) -> Option<Value> {
        let made = *self.heap.vector(table)?.get(index as usize)?;
        if made == Value::UNSUPPLIED { None } else { Some(made) }
    }

    /// Returns a function without captures; makes a stub for it at the first request.
    fn function(&mut self, number: FunctionNumber) -> Result<Value, AllocError> {
        let table = self.image().functions;
        if let Some(function) = self.made(table, number.0) {
            return Ok(function);
        }
        let function =
            trust::alloc_function(self.heap, self.image().lazy, &[Value::index(number.0 as usize)])?;
        self.heap.own_vector_set(table, number.0 as usize, function);
        Ok(function)
    }

    fn symbol(&mut self, number: u32) -> Result<Value, LoadError> {
        let table = self.image().symbols;
        if let Some(object) = self.made(table, number) {
            return Ok(object);
        }
        let module = self.module();
        let record = module.symbol(number)?;
        let symbol = match record.home {
            SymbolHome::Package(package) => {
                Symbol::new(&self.image().packages[package as usize], record.name)
            }
            SymbolHome::Uninterned(id) => Symbol::uninterned(id, record.name),
        };
        let object = match self.number_of_named(&symbol) {
            Some(named) => {
                let named = self.symbol(named)?;
                self.names.setf_cell_object(self.heap, named)?
            }
            None => self.names.intern(self.heap, &symbol)?,
        };
        self.heap.own_vector_set(table, number as usize, object);
        Ok(object)
    }

    /// Returns the number of the uninterned symbol whose function `(setf symbol)` a symbol keeps. `None` for
    /// all other symbols, and if the module does not contain that one.
    fn number_of_named(&self, cell: &Symbol) -> Option<u32> {
        let named = symbol_of_setf_cell(cell)?;
        let module = self.module();
        let at = module.symbols().position(|record| {
            record.is_ok_and(|record| match record.home {
                SymbolHome::Uninterned(id) => Symbol::uninterned(id, record.name) == named,
                SymbolHome::Package(_) => false,
            })
        });
        at.map(|at| at as u32)
    }

    /// Returns the value of a constant other than a function with captures. Data refer to earlier entries
    /// only, so the stack of values under construction is finite.
    fn constant(&mut self, index: PoolIdx) -> Result<Value, LoadError> {
        let table = self.image().pool;
        if let Some(value) = self.made(table, index.0) {
            return Ok(value);
        }
        let module = self.module();
        let mut under_way = vec![index];
        while let Some(&next) = under_way.last() {
            if self.made(table, next.0).is_some() {
                // It was required more than once.
                under_way.pop();
                continue;
            }
            let height = under_way.len();
            let record = module.constant(next)?;
            match &record {
                ConstantRecord::Cons(car, cdr) => self.require(table, [*car, *cdr], &mut under_way),
                ConstantRecord::Vector(items) | ConstantRecord::Array(_, items) => {
                    self.require(table, items.iter(), &mut under_way);
                }
                _ => {}
            }
            if under_way.len() > height {
                continue;
            }
            let value = self.make(record, table)?;
            self.heap.own_vector_set(table, next.0 as usize, value);
            under_way.pop();
        }
        Ok(self.made(table, index.0).unwrap_or(Value::NIL))
    }

    /// Pushes those of `parts` that do not exist yet onto `under_way`.
    fn require(&self, table: Value, parts: impl IntoIterator<Item = PoolIdx>, under_way: &mut Vec<PoolIdx>) {
        under_way.extend(parts.into_iter().filter(|part| self.made(table, part.0).is_none()));
    }

    /// Makes the value of a record whose parts exist.
    fn make(&mut self, record: ConstantRecord<'_>, table: Value) -> Result<Value, LoadError> {
        let pool = |heap: &Heap, PoolIdx(index): PoolIdx| {
            heap.vector(table).and_then(|pool| pool.get(index as usize)).copied().unwrap_or(Value::NIL)
        };
        Ok(match record {
            ConstantRecord::Nil => Value::NIL,
            ConstantRecord::True => Value::T,
            ConstantRecord::Symbol(number) | ConstantRecord::Class(number) => self.symbol(number)?,
            ConstantRecord::Fixnum(value) => match Value::fixnum(value) {
                Some(fixnum) => fixnum,
                None => integer(self.heap, &value.into())?,
            },
            ConstantRecord::Integer(value) => integer(self.heap, &value)?,
            ConstantRecord::Ratio(numerator, denominator) => ratio(self.heap, &numerator, &denominator)?,
            ConstantRecord::Float(value) => self.heap.float(value)?,
            ConstantRecord::Character(c) => character(c),
            ConstantRecord::String(text) => self.heap.alloc_str(text)?,
            ConstantRecord::Cons(car, cdr) => {
                let (car, cdr) = (pool(self.heap, car), pool(self.heap, cdr));
                self.heap.cons(car, cdr)?
            }
            ConstantRecord::Vector(items) => {
                let items: Vec<Value> = items.iter().map(|item| pool(self.heap, item)).collect();
                self.heap.alloc_vector(&items)?
            }
            ConstantRecord::Array(dimensions, items) => {
                let items: Vec<Value> = items.iter().map(|item| pool(self.heap, item)).collect();
                super::array(self.heap, &dimensions, &items)?
            }
            ConstantRecord::Function(number) => self.function(number)?,
        })
    }

    /// Returns the Code of a function, ready to run. Functions with captures, of which it makes closures, are
    /// made ready with it, and those inside them.
    fn code(&mut self, number: FunctionNumber) -> Result<Value, LoadError> {
        let module = self.module();
        let (first, constants) = self.start(&module, number)?;
        let mut to_fill = vec![(first, constants)];
        while let Some((code, constants)) = to_fill.pop() {
            for (index, constant) in constants.into_iter().enumerate() {
                let ConstantRecord::Function(inner) = module.constant(constant)? else { continue };
                if module.capture_count(inner)? == 0 {
                    continue;
                }
                let table = self.image().functions;
                let inner_code = match self.made(table, inner.0) {
                    Some(code) => code,
                    None => {
                        let (code, constants) = self.start(&module, inner)?;
                        self.heap.own_vector_set(table, inner.0 as usize, code);
                        to_fill.push((code, constants));
                        code
                    }
                };
                trust::set_constant(self.heap, code, index, inner_code);
            }
        }
        Ok(first)
    }

    /// Makes a Code whose constants still lack functions with captures. Returns it and its constants.
    fn start(
        &mut self,
        module: &ModuleImage,
        number: FunctionNumber,
    ) -> Result<(Value, Vec<PoolIdx>), LoadError> {
        let function = module.function(number)?;
        let mut missing = None;
        let constants = own_constants(&function, |index| {
            let value = match module.constant(index) {
                Ok(ConstantRecord::Function(inner)) => match module.capture_count(inner) {
                    Ok(0) => self.function(inner).map_err(LoadError::from),
                    Ok(_) => Ok(Value::NIL),
                    Err(error) => Err(error.into()),
                },
                _ => self.constant(index),
            };
            value.unwrap_or_else(|error| {
                missing = Some(error);
                Value::NIL
            })
        });
        if let Some(error) = missing {
            return Err(error);
        }
        let name = match function.name {
            Some(index) => self.constant(index)?,
            None => Value::NIL,
        };
        let debug = Value::index(number.0 as usize);
        let parts = LoadedFunction { function: &function, constants: &constants, name, debug };
        let code = make_code(self.heap, &Verified::image(), &parts, Value::index(self.image))?;
        Ok((code, function.constants))
    }
}

/// Returns lambda list and documentation of a function of an image.
pub(super) fn texts(
    heap: &mut Heap,
    names: &mut Names,
    image: usize,
    number: u32,
) -> Result<(Value, Value), LoadError> {
    let mut loader = ImageLoader { heap, names, image };
    let function = loader.module().function(FunctionNumber(number))?;
    let mut constant = |index: Option<PoolIdx>| index.map_or(Ok(Value::NIL), |index| loader.constant(index));
    Ok((constant(function.lambda_list)?, constant(function.documentation)?))
}

/// Returns the numbers of image and function behind the stub or the code of a function of an image.
pub(crate) fn origin(heap: &Heap, function: Value) -> Option<(usize, u32)> {
    let code = heap.code(heap.function_code(function)?)?;
    let image = code.owner.as_index()?;
    let number = match Shape::unpack(code.spare[0]).kind {
        CodeKind::Lazy => heap.function_captures(function)?.first()?.as_index()?,
        _ => code.debug.as_index()?,
    };
    Some((image, number as u32))
}

impl Names {
    /// Replaces the stub of a function of an image by its code. Returns the number of words that were
    /// decoded, 0 if the function was ready.
    ///
    /// # Errors
    /// [`LoadError`] if the image is damaged, or there is no room.
    pub(crate) fn make_ready(&mut self, heap: &mut Heap, function: Value) -> Result<usize, LoadError> {
        let is_lazy = heap
            .function_code(function)
            .and_then(|code| heap.code(code))
            .is_some_and(|code| Shape::unpack(code.spare[0]).kind == CodeKind::Lazy);
        let Some((image, number)) = origin(heap, function).filter(|_| is_lazy) else { return Ok(0) };
        let code = ImageLoader { heap, names: self, image }.code(FunctionNumber(number))?;
        trust::replace_stub(heap, function, code);
        Ok(heap.code_words(code).map_or(0, <[u32]>::len))
    }
}

/// Returns the source place of word `pc` of a code of an image.
pub(super) fn place_of(heap: &Heap, names: &Names, code: Value, pc: u32) -> Option<SourcePlace> {
    let parts = heap.code(code)?;
    let (image, number) = (parts.owner.as_index()?, parts.debug.as_index()?);
    let function = names.images.decode(image, number as u32)?;
    let entry = debug::entry_at(function.lines.into_iter(), pc)?;
    let source = names.images.source(image, entry.source)?;
    Some(SourcePlace { source, line: entry.line, column: entry.column })
}

/// Returns the variables that can be looked at at word `pc` of a code of an image, and where they are.
pub(super) fn variables_at(heap: &Heap, names: &Names, code: Value, pc: u32) -> Vec<(String, VariablePlace)> {
    let number = heap.code(code).and_then(|parts| Some((parts.owner.as_index()?, parts.debug.as_index()?)));
    let Some((image, number)) = number else { return Vec::new() };
    let Some(image) = names.images.0.get(image) else { return Vec::new() };
    let variables = image.module.variables(FunctionNumber(number as u32)).unwrap_or_default();
    let here = variables.into_iter().filter(|variable| (variable.from..variable.to).contains(&pc));
    here.map(|variable| (variable.name.to_string(), variable.place)).collect()
}
