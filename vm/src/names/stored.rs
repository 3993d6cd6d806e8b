//! Names as bytes: see [`crate::stored`].

use std::collections::BTreeMap;
use std::sync::Arc;

use esl_bytecode::package::{PackageId, Packages, pack_symbol, unpack_symbol};
use esl_bytecode::symbol::Symbol;
use esl_heap::store::{Stored, StoredBytes};
use esl_host::machine::CopyOnWrite;

use super::opaque::Opaques;
use super::{GivenMap, Names, RootMap, SymbolMap};
use crate::value::Value;

fn store_symbols<'a>(symbols: impl ExactSizeIterator<Item = &'a Symbol>, out: &mut Vec<u8>) {
    symbols.len().store(out);
    let mut packed = Vec::new();
    symbols.for_each(|symbol| pack_symbol(&mut packed, symbol));
    packed.len().store(out);
    out.append(&mut packed);
}

fn load_symbols(from: &mut StoredBytes<'_>) -> Option<Vec<Symbol>> {
    let (count, length) = (usize::load(from)?, usize::load(from)?);
    let (mut bytes, mut last) = (from.take(length)?, None);
    let mut symbols = Vec::new();
    for _ in 0..count {
        let (symbol, rest) = unpack_symbol(bytes, &mut last)?;
        symbols.push(symbol);
        bytes = rest;
    }
    Some(symbols)
}

impl Names {
    /// Adds all names to `out`.
    pub(crate) fn store(&self, out: &mut Vec<u8>) {
        // Without `..`: a new field does not compile until it is handled here.
        let Names {
            known,
            is_open,
            symbols,
            symbol_of,
            fresh,
            packages,
            called: _,
            package_objects,
            homes,
            runner,
            streams,
            nil,
            t,
            rights,
            undefined,
            undefined_yet,
            is_defining,
            images,
            opaques,
            classes,
        } = self;
        known.store(out);
        (*is_open, *is_defining).store(out);
        symbols.capacity().store(out);
        store_symbols(symbols.keys(), out);
        symbols.values().for_each(|value| value.store(out));
        let symbol_of = symbol_of.borrow();
        symbol_of.capacity().store(out);
        let mut by_address: Vec<(&u64, &Symbol)> = symbol_of.iter().collect();
        by_address.sort_unstable_by_key(|&(&address, _)| address);
        store_symbols(by_address.iter().map(|&(_, symbol)| symbol), out);
        by_address.iter().for_each(|&(address, _)| address.store(out));
        fresh.get().store(out);
        let packed = packages.to_bytes();
        packed.len().store(out);
        out.extend_from_slice(&packed);
        let objects = package_objects.iter().map(|(&package, &object)| (package.number(), object));
        objects.collect::<Vec<(u32, Value)>>().store(out);
        let homes = homes.iter().map(|(name, &(package, object))| (name.clone(), package.number(), object));
        homes.collect::<Vec<(Arc<str>, u32, Value)>>().store(out);
        [*runner, *nil, *t, *rights, *undefined].store(out);
        streams.store(out);
        store_symbols(undefined_yet.iter(), out);
        images.store(out);
        opaques.store(out);
        classes.capacity().store(out);
        classes.iter().map(|(&name, &class)| (name, class)).collect::<Vec<(u64, Value)>>().store(out);
    }

    /// Makes the names those that were stored. `None` if the bytes do not fit the machine.
    pub(crate) fn load(&mut self, from: &mut StoredBytes<'_>) -> Option<()> {
        self.known = Stored::load(from)?;
        (self.is_open, self.is_defining) = Stored::load(from)?;
        let room = usize::load(from)?;
        let keys = load_symbols(from)?;
        let mut symbols = SymbolMap::default();
        symbols.reserve(room.min(2 * keys.len() + 64));
        for key in keys {
            symbols.insert(key, Stored::load(from)?);
        }
        self.symbols = CopyOnWrite::new(symbols);
        let room = usize::load(from)?;
        let names = load_symbols(from)?;
        let mut symbol_of = GivenMap::default();
        symbol_of.reserve(room.min(2 * names.len() + 64));
        for name in names {
            symbol_of.insert(Stored::load(from)?, name);
        }
        *self.symbol_of.get_mut() = CopyOnWrite::new(symbol_of);
        self.fresh.set(Stored::load(from)?);
        let length = usize::load(from)?;
        self.packages = CopyOnWrite::new(Packages::from_bytes(from.take(length)?)?);
        self.called.forget();
        let objects: Vec<(u32, Value)> = Stored::load(from)?;
        let objects = objects.into_iter().map(|(package, object)| (PackageId::from_number(package), object));
        self.package_objects = CopyOnWrite::new(objects.collect());
        let homes: Vec<(Arc<str>, u32, Value)> = Stored::load(from)?;
        let homes = homes
            .into_iter()
            .map(|(name, package, object)| (name, (PackageId::from_number(package), object)));
        self.homes = CopyOnWrite::new(homes.collect::<BTreeMap<Arc<str>, (PackageId, Value)>>());
        [self.runner, self.nil, self.t, self.rights, self.undefined] = Stored::load(from)?;
        self.streams = Stored::load(from)?;
        self.undefined_yet = load_symbols(from)?;
        self.images.load(from)?;
        self.opaques = CopyOnWrite::new(Opaques::load(from)?);
        let room = usize::load(from)?;
        let rows: Vec<(u64, Value)> = Stored::load(from)?;
        let mut classes = RootMap::default();
        classes.reserve(room.min(2 * rows.len() + 64));
        classes.extend(rows);
        self.classes = CopyOnWrite::new(classes);
        Some(())
    }
}
