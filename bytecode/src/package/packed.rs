//! Packages as bytes, for a file that the same build of the machine reads.
//!
//! The names that are the same in every program are written as the number of their package among the standard
//! ones. Entries are written in the order of their names, so that equal packages have equal bytes.

use std::borrow::Cow;
use std::sync::Arc;

use super::entries::NameEntries;
use super::{NameEntry, Package, PackageId, Packages};
use crate::symbol::{Home, Symbol};

/// Bytes that are read back.
struct PackedBytes<'a>(&'a [u8]);

impl<'a> PackedBytes<'a> {
    fn number(&mut self) -> Option<u32> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*bytes))
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = self.number()? as usize;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        std::str::from_utf8(text).ok()
    }

    fn list<T>(&mut self, mut read: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = self.number()? as usize;
        (0..count).map(|_| read(self)).collect()
    }
}

fn number(out: &mut Vec<u8>, number: usize) {
    out.extend_from_slice(&(number as u32).to_le_bytes());
}

fn text(out: &mut Vec<u8>, text: &str) {
    number(out, text.len());
    out.extend_from_slice(text.as_bytes());
}

/// Writes a symbol.
pub fn pack_symbol(out: &mut Vec<u8>, symbol: &Symbol) {
    match symbol.home() {
        Home::Package(package) => {
            number(out, 0);
            text(out, package);
        }
        Home::Uninterned(id) => {
            number(out, 1);
            number(out, *id as usize);
        }
    }
    text(out, symbol.name());
}

/// Reads a symbol from the beginning of bytes, and returns the rest of them; `None` if there is none. Symbols
/// that are read one after the other share the names of their packages.
pub fn unpack_symbol<'a>(bytes: &'a [u8], last: &mut Option<Arc<str>>) -> Option<(Symbol, &'a [u8])> {
    let mut from = PackedBytes(bytes);
    let symbol = match from.number()? {
        0 => {
            let home = from.text()?;
            let home = match last {
                Some(last) if **last == *home => last.clone(),
                last => last.insert(home.into()).clone(),
            };
            Symbol::new(&home, from.text()?)
        }
        1 => {
            let id = from.number()?;
            Symbol::uninterned(id, from.text()?)
        }
        _ => return None,
    };
    Some((symbol, from.0))
}

impl Packages {
    /// Returns all of it as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Without `..`: a new field does not compile until it is handled here.
        let Packages { table, by_name, bytes } = self;
        let mut out = Vec::new();
        number(&mut out, table.0.len());
        for package in &table.0 {
            let Package { name, nicknames, uses, exports_again, names, symbols } = package;
            text(&mut out, name);
            number(&mut out, nicknames.len());
            nicknames.iter().for_each(|nickname| text(&mut out, nickname));
            number(&mut out, uses.len());
            uses.iter().for_each(|used| number(&mut out, used.0 as usize));
            number(&mut out, exports_again.map_or(usize::MAX, |package| package.0 as usize));
            number(&mut out, names.len());
            let mut entries: Vec<(&Cow<'static, str>, &NameEntry)> = symbols.iter().collect();
            entries.sort_unstable_by_key(|&(name, _)| name);
            number(&mut out, entries.len());
            for (name, entry) in entries {
                let NameEntry { home, external, shadowing, symbol } = entry;
                text(&mut out, name);
                number(&mut out, home.0 as usize);
                out.extend([u8::from(*external), u8::from(*shadowing), u8::from(symbol.is_some())]);
                if let Some(symbol) = symbol {
                    pack_symbol(&mut out, symbol);
                }
            }
        }
        let mut known: Vec<(&Arc<str>, &PackageId)> = by_name.iter().collect();
        known.sort_unstable();
        number(&mut out, known.len());
        for (name, package) in known {
            text(&mut out, name);
            number(&mut out, package.0 as usize);
        }
        out.extend_from_slice(&(*bytes as u64).to_le_bytes());
        out
    }

    /// Reads packages; `None` if the bytes are not those of packages of this build.
    pub fn from_bytes(bytes: &[u8]) -> Option<Packages> {
        let standard = Packages::standard();
        let mut from = PackedBytes(bytes);
        let mut packages = Packages::empty();
        let mut last = None;
        for number in 0..from.number()? as usize {
            let name = from.text()?.into();
            let nicknames = from.list(|from| from.text().map(Arc::from))?;
            let uses = from.list(|from| from.number().map(PackageId))?;
            let exports_again = Some(from.number()?).filter(|&number| number != u32::MAX).map(PackageId);
            let names = standard.table.0.get(number).map_or(&[][..], |package| package.names);
            if from.number()? as usize != names.len() {
                return None;
            }
            let mut symbols = NameEntries::default();
            let count = from.number()? as usize;
            symbols.reserve(count.min(from.0.len()));
            for _ in 0..count {
                let name = from.text()?.to_owned();
                let home = PackageId(from.number()?);
                let ([external, shadowing, has_symbol], rest) =
                    from.0.split_first_chunk().map(|(a, b)| (*a, b))?;
                from.0 = rest;
                let symbol = if has_symbol == 1 {
                    let (symbol, rest) = unpack_symbol(from.0, &mut last)?;
                    from.0 = rest;
                    Some(symbol)
                } else {
                    None
                };
                let entry = NameEntry { home, external: external == 1, shadowing: shadowing == 1, symbol };
                symbols.insert(name.into(), entry);
            }
            packages.table.0.push(Package { name, nicknames, uses, exports_again, names, symbols });
        }
        for _ in 0..from.number()? {
            let name = from.text()?.into();
            packages.by_name.insert(name, PackageId(from.number()?));
        }
        packages.bytes = u64::from_le_bytes(*from.0.first_chunk()?) as usize;
        let all = packages.table.0.len() as u32;
        let is_known = |id: &PackageId| id.0 < all;
        let is_whole = packages.by_name.values().all(is_known)
            && packages.table.0.iter().all(|package| {
                package.uses.iter().chain(&package.exports_again).all(is_known)
                    && package.symbols.iter().all(|(_, entry)| is_known(&entry.home))
            });
        is_whole.then_some(packages)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_are_read_back_as_they_were() {
        let mut packages = Packages::standard();
        let own = packages.make_package("OWN", &["O"], &[PackageId::ESL]).expect("the name is free");
        packages.intern(own, "THING");
        packages.intern(PackageId::USER, "CAR");
        let bytes = packages.to_bytes();
        let again = Packages::from_bytes(&bytes).expect("the bytes are whole");
        assert_eq!(again.to_bytes(), bytes);
        assert_eq!(again.named("O"), Some(own));
        assert_eq!(again.find(own, "THING"), packages.find(own, "THING"));
        assert_eq!(again.find(PackageId::USER, "CAR"), packages.find(PackageId::USER, "CAR"));
        assert_eq!(again.bytes(), packages.bytes());
        assert!((0..bytes.len()).all(|length| Packages::from_bytes(&bytes[..length]).is_none()));
    }

    #[test]
    fn symbols_are_read_back_one_after_the_other() {
        let symbols =
            [Symbol::cl("CAR"), Symbol::cl("CDR"), Symbol::uninterned(7, "G"), Symbol::keyword("A")];
        let mut bytes = Vec::new();
        symbols.iter().for_each(|symbol| pack_symbol(&mut bytes, symbol));
        let (mut rest, mut last) = (&bytes[..], None);
        for symbol in symbols {
            let (again, behind) = unpack_symbol(rest, &mut last).expect("the bytes are whole");
            assert_eq!(again, symbol);
            rest = behind;
        }
        assert!(rest.is_empty());
    }
}
