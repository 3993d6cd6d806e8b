//! Names: symbols, packages, classes, and builtins as functions.
//!
//! The rules of packages (what a name read in a package means) are those of [`esl_bytecode`]; here are the
//! objects that names stand for in a running machine. A symbol object is made at its first use, and with it,
//! for the name of a builtin, the function object. So a machine starts with a few dozen symbols, however
//! large the language is.
//!
//! Guarantees: one symbol object for each symbol of a package, for as long as the machine lives. A program
//! never sees a symbol object for [`Value::NIL`] and [`Value::T`]; their names, functions and properties are
//! in two *companion* objects, which [`Names::object_of`] returns.
//!
//! Not here: whether a name may be redefined, which the builtins check; values of task-local bindings
//! (`task::binding`).

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::package::{PackageId, Packages};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol, UNINTERNED_NUMBERS};
use esl_host::machine::CopyOnWrite;
use indexmap::IndexMap;

use crate::heap::layout::SymbolObject;
use crate::heap::{AllocError, Heap, Holder, Kind};
use crate::shape::{CodeKind, Shape};
use crate::trust;
use crate::value::Value;
pub(crate) use builtin_index::find_builtin;
use called::CalledNames;
use load::Images;

mod builtin_index;
mod called;
pub(crate) mod class;
mod defined;
mod known;
pub mod load;
mod opaque;
mod package;
pub mod records;
mod stored;
pub(crate) mod stream;

pub(crate) use known::Known;
pub(crate) use opaque::Opaques;

/// Hasher of keys that are good hashes already: symbols, and addresses of objects.
#[derive(Default)]
pub(crate) struct GivenHash(u64);

impl Hasher for GivenHash {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = self.0.rotate_left(8) ^ u64::from(byte);
        }
    }

    fn write_u64(&mut self, word: u64) {
        // Addresses differ in the middle bits only; the table uses the lowest and the highest.
        self.0 = word.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(26);
    }
}

/// A map with keys that hash themselves well.
pub(crate) type GivenMap<K, V> = HashMap<K, V, BuildHasherDefault<GivenHash>>;
/// A map with keys that are addresses, in the order of insertion: that of addresses differs from run to run,
/// and a run meets its roots in the same order each time.
pub(crate) type RootMap<V> = IndexMap<u64, V, BuildHasherDefault<GivenHash>>;

/// The objects of symbols, in the order in which they were made: a run meets its roots in the same order in
/// each process.
pub(crate) type SymbolMap = IndexMap<Symbol, Value, BuildHasherDefault<GivenHash>>;

/// A set of keys that hash themselves well.
pub(crate) type GivenSet<K> = std::collections::HashSet<K, BuildHasherDefault<GivenHash>>;

/// Bytes of an entry of the table of symbols, with its hash and its place in the index.
const SYMBOL_BYTES: usize = size_of::<(u64, Symbol, Value)>() + size_of::<usize>() + 1;

/// Bytes of an entry of the table of names by address.
const NAME_BYTES: usize = size_of::<(u64, Symbol)>() + 1;

/// Bytes of an entry of a table of packages, with its share of the nodes.
const OBJECT_BYTES: usize = 2 * size_of::<(Arc<str>, PackageId, Value)>();

/// Bytes of an entry of the table of classes.
const CLASS_BYTES: usize = size_of::<(u64, Value)>() + 1;

/// Names, and the objects that they stand for.
#[derive(Clone)]
pub(crate) struct Names {
    /// Symbols that the machine uses.
    pub(crate) known: Known,
    /// Whether names of the language may be defined: only while the library is being loaded.
    pub(crate) is_open: bool,
    /// Objects of symbols with a package.
    pub(crate) symbols: CopyOnWrite<SymbolMap>,
    /// Names of symbol objects by address, filled on demand.
    pub(crate) symbol_of: RefCell<CopyOnWrite<GivenMap<u64, Symbol>>>,
    /// Number of the compiler's next uninterned symbol.
    pub(crate) fresh: Cell<u32>,
    /// The rules of packages. They are changed by way of [`Names::packages_mut`].
    pub(crate) packages: CopyOnWrite<Packages>,
    /// The symbols that these give to the names by which the outside has called functions last.
    pub(crate) called: CalledNames,
    /// The objects of packages.
    pub(crate) package_objects: CopyOnWrite<BTreeMap<PackageId, Value>>,
    /// Home packages of symbols, by name.
    pub(crate) homes: CopyOnWrite<BTreeMap<Arc<str>, (PackageId, Value)>>,
    /// Function that runs the top-level functions of a module; `NIL` until it is first needed.
    pub(crate) runner: Value,
    /// Standard input, output and error.
    pub(crate) streams: [Value; 3],
    /// The companion of `NIL`.
    pub(crate) nil: Value,
    /// The companion of `T`.
    pub(crate) t: Value,
    /// Symbol that no program can name: bound to the rights that forms have narrowed, see `builtins::rights`.
    pub(crate) rights: Value,
    /// Code of every symbol without a function.
    pub(crate) undefined: Value,
    /// Symbols with an object to which the images' definitions have not been applied.
    pub(crate) undefined_yet: Vec<Symbol>,
    /// Whether symbols are being defined.
    pub(crate) is_defining: bool,
    /// Modules that are loaded piece by piece.
    pub(crate) images: CopyOnWrite<Images>,
    /// Things of the embedder's that the program holds.
    pub(crate) opaques: CopyOnWrite<Opaques>,
    /// Classes of structures and conditions, by the address of their names.
    pub(crate) classes: CopyOnWrite<RootMap<Value>>,
}

impl Names {
    /// Makes the language's names, with the builtins as its only definitions.
    ///
    /// # Errors
    /// [`AllocError`] if the heap is too small for it.
    pub(crate) fn new(heap: &mut Heap) -> Result<Names, AllocError> {
        let shape = Shape::other(CodeKind::Undefined, 0);
        let undefined = trust::alloc_stub(heap, Value::NIL, Value::NIL, shape, 1, trust::UNDEFINED_WORD)?;
        let mut names = Names {
            known: Known::NONE,
            is_open: true,
            symbols: CopyOnWrite::default(),
            symbol_of: RefCell::default(),
            fresh: Cell::new(0),
            packages: CopyOnWrite::new(Packages::standard()),
            called: CalledNames::default(),
            package_objects: CopyOnWrite::default(),
            homes: CopyOnWrite::default(),
            runner: Value::NIL,
            streams: [Value::NIL; 3],
            nil: Value::NIL,
            t: Value::NIL,
            rights: Value::NIL,
            undefined,
            undefined_yet: Vec::new(),
            is_defining: false,
            images: CopyOnWrite::default(),
            opaques: CopyOnWrite::default(),
            classes: CopyOnWrite::default(),
        };
        names.nil = names.make_constant(heap, &Symbol::cl("NIL"), Value::NIL)?;
        names.t = names.make_constant(heap, &Symbol::cl("T"), Value::T)?;
        names.known = Known::intern(&mut names, heap)?;
        names.streams = stream::standard_streams(heap)?;
        let name = heap.alloc_str("RIGHTS")?;
        names.rights = names.make_symbol(heap, name, Value::NIL, 0)?;
        let [input, output, error] = names.streams;
        let package = names.package_object(heap, PackageId::USER)?;
        for (variable, value) in [
            (names.known.package, package),
            (names.known.gensym_counter, Value::small(1)),
            (names.known.standard_input, input),
            (names.known.standard_output, output),
            (names.known.error_output, error),
        ] {
            heap.symbol_set_value(variable, value);
            heap.set_flags(variable, Kind::Symbol, SymbolObject::LOCKED | SymbolObject::SPECIAL);
        }
        Ok(names)
    }

    /// Makes the companion of a symbol that is an immediate.
    fn make_constant(&mut self, heap: &mut Heap, symbol: &Symbol, value: Value) -> Result<Value, AllocError> {
        let object = self.make_object(heap, symbol)?;
        heap.symbol_set_value(object, value);
        let flags = SymbolObject::CONSTANT | SymbolObject::LOCKED;
        heap.set_flags(object, Kind::Symbol, flags);
        self.symbols.insert(symbol.clone(), value);
        Ok(object)
    }

    /// Returns the symbol as a program sees it: `NIL` and `T` are immediates. For an uninterned symbol,
    /// returns a new object each time; a caller that wants one object for one number keeps a table.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn intern(&mut self, heap: &mut Heap, symbol: &Symbol) -> Result<Value, AllocError> {
        let object = match self.symbols.get(symbol) {
            Some(&object) if self.undefined_yet.is_empty() => return Ok(object),
            Some(&object) => object,
            None => {
                let object = self.make_object(heap, symbol)?;
                if symbol.package().is_some() {
                    self.symbols.insert(symbol.clone(), object);
                    self.undefined_yet.push(symbol.clone());
                }
                object
            }
        };
        self.define_symbols(heap)?;
        Ok(object)
    }

    /// Returns the symbol that the package of this one inherits under its name. `None` if the symbol has an
    /// object of its own, or the package inherits none.
    pub(crate) fn inherited(&self, symbol: &Symbol) -> Option<Symbol> {
        if self.symbols.contains_key(symbol) {
            return None;
        }
        let packages = self.packages();
        let package = packages.named(symbol.package()?)?;
        packages.find(package, symbol.name()).map(|(found, _)| found)
    }

    /// Returns the symbol of this name in `COMMON-LISP`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn intern_cl(&mut self, heap: &mut Heap, name: &str) -> Result<Value, AllocError> {
        self.intern(heap, &Symbol::cl(name))
    }

    /// Returns the symbol of this name in `ESL`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn intern_esl(&mut self, heap: &mut Heap, name: &str) -> Result<Value, AllocError> {
        self.intern(heap, &Symbol::esl(name))
    }

    /// Returns the keyword of this name.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn keyword(&mut self, heap: &mut Heap, name: &str) -> Result<Value, AllocError> {
        self.intern(heap, &Symbol::keyword(name))
    }

    /// Returns the symbol, if it has an object already.
    pub(crate) fn find(&self, symbol: &Symbol) -> Option<Value> {
        self.symbols.get(symbol).copied()
    }

    /// Calls `visit` with every symbol that has an object, and with the object as a program sees it.
    pub(crate) fn each_symbol(&self, visit: &mut dyn FnMut(&Symbol, Value)) {
        self.symbols.iter().for_each(|(symbol, &value)| visit(symbol, value));
    }

    /// Returns the number of symbols that have an object.
    pub(crate) fn symbol_count(&self) -> usize {
        self.symbols.len()
    }

    /// Checks that there is room for the names that there are.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn check_room(&self, heap: &mut Heap) -> Result<(), AllocError> {
        let symbols =
            self.symbols.capacity() * SYMBOL_BYTES + self.symbol_of.borrow().capacity() * NAME_BYTES;
        let objects = self.package_objects.len() + self.homes.len();
        let tables = symbols + objects * OBJECT_BYTES + self.classes.capacity() * CLASS_BYTES;
        heap.set_external(Holder::Names, self.packages.bytes() + tables)
    }

    /// Makes an object for `symbol`, with its builtin function if it names one.
    fn make_object(&mut self, heap: &mut Heap, symbol: &Symbol) -> Result<Value, AllocError> {
        self.check_room(heap)?;
        let name = heap.alloc_str(symbol.name())?;
        let (package, flags) = match symbol.package() {
            None => (Value::NIL, 0),
            Some(name) => {
                let (home, object) = self.home(heap, name)?;
                if !self.packages.has(home, symbol.name()) {
                    let is_external = home == PackageId::KEYWORD;
                    self.packages_mut().register(home, symbol.name().to_owned(), is_external);
                }
                (object, home_flags(name))
            }
        };
        let object = self.make_symbol(heap, name, package, flags)?;
        if flags & SymbolObject::KEYWORD != 0 {
            heap.symbol_set_value(object, object);
        } else if let Some(builtin) = find_builtin(symbol) {
            let function = self.make_builtin(heap, builtin, object)?;
            heap.symbol_set_function(object, function);
        }
        Ok(object)
    }

    /// Makes a symbol object in no table, with this name (a String) and package.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn make_symbol(
        &mut self,
        heap: &mut Heap,
        name: Value,
        package: Value,
        flags: u8,
    ) -> Result<Value, AllocError> {
        let function = trust::alloc_function(heap, self.undefined, &[Value::NIL])?;
        let object = heap.alloc_symbol(flags, name, package, function)?;
        trust::set_stub_capture(heap, function, 0, object);
        Ok(object)
    }

    /// Returns the symbol that keeps the function `(setf symbol)` of an uninterned symbol object, if it has
    /// been made.
    pub(crate) fn find_setf_cell(&self, heap: &Heap, object: Value) -> Option<Value> {
        let mut plist = heap.symbol(object)?.plist;
        while let Some(entry) = heap.as_cons(plist) {
            let rest = heap.as_cons(entry.cdr)?;
            if entry.car == self.known.setf_cell {
                return Some(rest.car);
            }
            plist = rest.cdr;
        }
        None
    }

    /// Returns the symbol that keeps the function `(setf symbol)` of an uninterned symbol object: the same
    /// one each time, in the property list of that.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn setf_cell_object(&mut self, heap: &mut Heap, object: Value) -> Result<Value, AllocError> {
        if let Some(cell) = self.find_setf_cell(heap, object) {
            return Ok(cell);
        }
        let symbol = heap.symbol(object).copied();
        let name = symbol.and_then(|symbol| heap.string_text(symbol.name)).unwrap_or_default();
        let name = heap.alloc_str(&format!("(SETF {name})"))?;
        let cell = self.make_symbol(heap, name, Value::NIL, 0)?;
        let rest = heap.cons(cell, symbol.map_or(Value::NIL, |symbol| symbol.plist))?;
        let plist = heap.cons(self.known.setf_cell, rest)?;
        heap.symbol_set_plist(object, plist);
        Ok(cell)
    }

    fn make_builtin(&mut self, heap: &mut Heap, builtin: Builtin, name: Value) -> Result<Value, AllocError> {
        let number = builtin.number();
        let shape = Shape::other(CodeKind::Native, number as u16);
        let code = trust::alloc_stub(heap, name, Value::NIL, shape, 0, trust::native_word(builtin))?;
        trust::alloc_function(heap, code, &[])
    }

    /// Returns the symbol object of a symbol: the companion for `NIL` and `T`, the symbol itself otherwise.
    /// `None` unless `v` is a symbol.
    #[inline]
    pub(crate) fn object_of(&self, heap: &Heap, v: Value) -> Option<Value> {
        match v {
            Value::NIL => Some(self.nil),
            Value::T => Some(self.t),
            _ if heap.is(v, Kind::Symbol) => Some(v),
            _ => None,
        }
    }

    /// Returns whether `v` is a symbol, including `NIL` and `T`.
    #[inline]
    pub(crate) fn is_symbol(&self, heap: &Heap, v: Value) -> bool {
        v.is_nil() || v == Value::T || heap.is(v, Kind::Symbol)
    }

    /// Returns the name of a symbol as the compiler knows it. `None` unless `v` is a symbol with a package.
    pub(crate) fn name_of(&self, heap: &Heap, v: Value) -> Option<Symbol> {
        let object = self.object_of(heap, v)?;
        if let Some(symbol) = self.symbol_of.borrow().get(&object.bits()) {
            return Some(symbol.clone());
        }
        let symbol = heap.symbol(object)?;
        let home: Arc<str> = self.package_name(heap, symbol.package)?.into();
        let symbol = Symbol::new(&home, &heap.string_text(symbol.name)?);
        // Only interned symbols live as long as the table.
        if self.symbols.contains_key(&symbol) {
            self.symbol_of.borrow_mut().insert(object.bits(), symbol.clone());
        }
        Some(symbol)
    }

    /// Returns a number for a fresh uninterned symbol of the compiler.
    pub(crate) fn fresh(&self) -> u32 {
        let number = self.fresh.get();
        self.fresh.set(number.wrapping_add(1) & UNINTERNED_NUMBERS);
        number
    }

    /// Returns the function of a symbol. `None` if it has none, or `v` is not a symbol.
    #[inline]
    pub(crate) fn function_of(&self, heap: &Heap, v: Value) -> Option<Value> {
        let function = heap.symbol(self.object_of(heap, v)?)?.function;
        if self.is_undefined(heap, function) { None } else { Some(function) }
    }

    /// Returns whether a symbol has a global function.
    pub(crate) fn is_defined(&self, heap: &Heap, symbol: Value) -> bool {
        self.function_of(heap, symbol).is_some()
    }

    /// Returns whether `function` is the placeholder of a symbol without a function.
    #[inline]
    pub(crate) fn is_undefined(&self, heap: &Heap, function: Value) -> bool {
        heap.function_code(function) == Some(self.undefined)
    }

    /// Removes the function of a symbol. `None` unless `v` is a symbol.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn remove_function(&mut self, heap: &mut Heap, v: Value) -> Result<Option<()>, AllocError> {
        let Some(object) = self.object_of(heap, v) else { return Ok(None) };
        let function = trust::alloc_function(heap, self.undefined, &[v])?;
        Ok(heap.symbol_set_function(object, function))
    }

    /// Returns the macro function of a symbol.
    pub(crate) fn macro_function_of(&self, heap: &Heap, v: Value) -> Option<Value> {
        let function = heap.symbol(self.object_of(heap, v)?)?.macro_function;
        if function.is_nil() { None } else { Some(function) }
    }

    /// Returns whether the symbol belongs to the language, so that it cannot get another function, macro or
    /// constant.
    pub(crate) fn is_locked(&self, heap: &Heap, v: Value) -> bool {
        let flags = self.object_of(heap, v).and_then(|object| heap.flags(object, Kind::Symbol));
        !self.is_open && flags.is_some_and(|flags| flags & SymbolObject::LOCKED != 0)
    }

    /// Calls `visit` with every object that the names keep alive.
    pub(crate) fn roots(&self, visit: &mut dyn FnMut(Value)) {
        self.known.visit(visit);
        [self.nil, self.t, self.rights, self.undefined, self.runner].into_iter().for_each(&mut *visit);
        self.streams.into_iter().for_each(&mut *visit);
        self.symbols.values().copied().for_each(&mut *visit);
        self.package_objects.values().copied().for_each(&mut *visit);
        self.images.roots(visit);
        self.classes.values().copied().for_each(&mut *visit);
    }
}

fn home_flags(home: &str) -> u8 {
    match home {
        CL_PACKAGE | ESL_PACKAGE => SymbolObject::LOCKED,
        KEYWORD_PACKAGE => SymbolObject::KEYWORD | SymbolObject::CONSTANT | SymbolObject::LOCKED,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_symbol_has_one_object_and_a_builtin_its_function() {
        let mut heap = crate::trust::heap_for_tests();
        let mut names = Names::new(&mut heap).unwrap();
        let car = names.intern_cl(&mut heap, "CAR").unwrap();
        assert_eq!(names.intern(&mut heap, &Symbol::cl("CAR")), Ok(car));
        assert!(names.function_of(&heap, car).is_some());
        assert_eq!(names.name_of(&heap, car), Some(Symbol::cl("CAR")));
        let foo = names.intern_esl(&mut heap, "FOO").unwrap();
        assert_eq!(names.function_of(&heap, foo), None);
        let keyword = names.keyword(&mut heap, "K").unwrap();
        assert_eq!(heap.symbol(keyword).unwrap().value, keyword);
    }

    #[test]
    fn nil_and_t_are_immediates_with_companions() {
        let mut heap = crate::trust::heap_for_tests();
        let mut names = Names::new(&mut heap).unwrap();
        assert_eq!(names.intern_cl(&mut heap, "NIL"), Ok(Value::NIL));
        assert_eq!(names.intern_cl(&mut heap, "T"), Ok(Value::T));
        assert_eq!(names.name_of(&heap, Value::T), Some(Symbol::cl("T")));
        assert!(names.is_symbol(&heap, Value::NIL));
    }
}
