//! Definitions of images, applied to symbol objects when these are made.
//!
//! Defining one symbol may make the objects of others, which are defined in turn: not by recursion, but from
//! a list. A symbol stays on the list until its definition is complete, so if there is no room halfway, the
//! next access to any symbol resumes.

use std::sync::Arc;

use esl_bytecode::file::ModuleImage;
use esl_bytecode::package::PackageId;
use esl_bytecode::symbol::Symbol;

use crate::heap::layout::SymbolObject;
use crate::heap::{AllocError, Heap, Kind};
use crate::names::load::{self, ImageClass, LoadError};
use crate::names::{Names, class};
use crate::value::Value;

impl Names {
    /// Adds an image. Returns a list of the functions that run its top-level forms, in order.
    ///
    /// # Errors
    /// [`LoadError`].
    pub(crate) fn open_image(
        &mut self,
        heap: &mut Heap,
        name: &'static str,
        image: Arc<ModuleImage>,
    ) -> Result<Value, LoadError> {
        let toplevel = load::open_image(heap, self, name, image)?;
        for name in self.images.exports() {
            self.packages_mut().register(PackageId::ESL, name, true);
        }
        self.packages_mut().share(PackageId::ESL);
        // Symbols with objects have missed the new definitions.
        self.undefined_yet.extend(self.symbols.keys().cloned());
        self.define_symbols(heap)?;
        Ok(toplevel)
    }

    /// Applies the images' definitions to the symbols on the list.
    pub(super) fn define_symbols(&mut self, heap: &mut Heap) -> Result<(), AllocError> {
        if self.is_defining {
            // The outer call will come to the symbols that were added.
            return Ok(());
        }
        self.is_defining = true;
        let mut result = Ok(());
        while result.is_ok()
            && let Some(last) = self.undefined_yet.len().checked_sub(1)
        {
            let symbol = self.undefined_yet[last].clone();
            result = self.define(heap, &symbol).map(|is_complete| {
                if is_complete {
                    // Others may have been added after it.
                    self.undefined_yet.remove(last);
                }
            });
        }
        self.is_defining = false;
        result
    }

    /// Applies the image's definition to a symbol. Returns whether that is complete; otherwise the symbols
    /// that it waits for are the last on the list.
    fn define(&mut self, heap: &mut Heap, symbol: &Symbol) -> Result<bool, AllocError> {
        let Some((image, definition)) = self.images.definition(symbol) else { return Ok(true) };
        let Some(object) = self.find(symbol).and_then(|v| self.object_of(heap, v)) else { return Ok(true) };
        if let Some(class) = definition.class
            && !self.define_image_class(heap, image, object, class)?
        {
            return Ok(false);
        }
        if let Some(number) = definition.function {
            let function = load::image_function(heap, self, image, number)?;
            heap.symbol_set_function(object, function);
        }
        if let Some(number) = definition.macro_function {
            let function = load::image_function(heap, self, image, number)?;
            heap.symbol_set_macro_function(object, function);
        }
        let cell = heap.symbol(object).copied();
        let (mut flags, old) = cell.map_or((0, Value::UNBOUND), |cell| (cell.header.flags, cell.value));
        if let Some(index) = definition.value.filter(|_| old == Value::UNBOUND) {
            let value = load::image_constant(heap, self, image, index)?;
            heap.symbol_set_value(object, value);
        }
        if let Some(&stream) = definition.stream.and_then(|number| self.streams.get(number))
            && old == Value::UNBOUND
        {
            heap.symbol_set_value(object, stream);
        }
        flags |= if definition.is_special { SymbolObject::SPECIAL } else { 0 };
        flags |= if definition.is_constant { SymbolObject::CONSTANT } else { 0 };
        heap.set_flags(object, Kind::Symbol, flags);
        let mut items = Vec::new();
        for (indicator, value) in definition.properties {
            items.push(load::image_constant(heap, self, image, indicator)?);
            items.push(load::image_constant(heap, self, image, value)?);
        }
        let plist = heap.symbol(object).map_or(Value::NIL, |cell| cell.plist);
        if !items.is_empty() && plist.is_nil() {
            let plist = heap.list(&items)?;
            heap.symbol_set_plist(object, plist);
        }
        Ok(true)
    }

    /// Defines the class called `name`, unless there is one. Returns false, and puts the names of the
    /// superclasses on the list, if one of these is not defined yet.
    fn define_image_class(
        &mut self,
        heap: &mut Heap,
        image: usize,
        name: Value,
        class: ImageClass,
    ) -> Result<bool, AllocError> {
        if self.find_class(name).is_some() {
            return Ok(true);
        }
        let names = load::image_constant(heap, self, image, class.supers)?;
        let names: Vec<Value> = class::list(heap, names).collect();
        let supers: Vec<Value> = names.iter().filter_map(|&name| self.find_class(name)).collect();
        if supers.len() < names.len() {
            let missing = names.into_iter().filter(|&name| self.find_class(name).is_none());
            let missing: Vec<Symbol> = missing.filter_map(|name| self.name_of(heap, name)).collect();
            self.undefined_yet.extend(missing);
            return Ok(false);
        }
        let slots = load::image_constant(heap, self, image, class.slots)?;
        let slots: Vec<Value> = class::list(heap, slots).collect();
        let data = load::image_constant(heap, self, image, class.data)?;
        self.define_class(heap, name, &supers, &slots, data)?;
        Ok(true)
    }
}
