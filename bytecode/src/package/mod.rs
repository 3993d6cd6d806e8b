//! Packages: which symbol a name denotes, and how a symbol is written.
//!
//! A package maps names to symbols. Those that are *present* in it have an entry of its own; others it
//! *inherits*: the external symbols of the packages that it uses. A name is looked up in this order, and a
//! name that is not found becomes a new symbol with the package as its home. Two symbols are the same if home
//! and name are.
//!
//! Besides the rules of Common Lisp there is one shorthand: a package may *export again* all that another
//! exports, but for the names of which it has symbols of its own. So `ESL` stands for the whole language
//! without a thousand entries.
//!
//! Names that are the same in every program are kept as sorted lists (`names`), and get an entry when they
//! are first read: a machine starts without filling tables.
//!
//! Not here: which package is the current one, and what a symbol stands for (the virtual machine).

mod change;
mod entries;
mod packed;
mod standard;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::{Index, IndexMut};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::compile::InternError;
use crate::symbol::{Home, KEYWORD_PACKAGE, Symbol};

use entries::NameEntries;
pub use packed::{pack_symbol, unpack_symbol};
pub use standard::{CL_NAMES, TAKEN_OVER};

/// A package: its number in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PackageId(u32);

impl PackageId {
    /// Returns the number of the package in its table.
    pub const fn number(self) -> u32 {
        self.0
    }

    /// Returns the package with this number, of a table that has so many.
    pub const fn from_number(number: u32) -> PackageId {
        PackageId(number)
    }
}

/// In what way a package has a symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It is present and not exported.
    Internal,
    /// It is exported.
    External,
    /// A package that is used exports it.
    Inherited,
}

/// How a symbol is written, besides its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Qualifier {
    /// By its name.
    None,
    /// `:`, a keyword.
    Keyword,
    /// `#:`, a symbol that is at home nowhere.
    Uninterned,
    /// The package's name and `:`.
    External(Arc<str>),
    /// The package's name and `::`.
    Internal(Arc<str>),
}

/// Entry of a package for a name.
#[derive(Clone, Debug)]
struct NameEntry {
    home: PackageId,
    external: bool,
    /// Whether it hides what is inherited under the same name.
    shadowing: bool,
    /// The symbol, from the first request for it on.
    symbol: Option<Symbol>,
}

/// Record of one package.
#[derive(Clone, Debug)]
struct Package {
    name: Arc<str>,
    nicknames: Vec<Arc<str>>,
    uses: Vec<PackageId>,
    exports_again: Option<PackageId>,
    /// Names of external symbols that are at home here and may have no entry yet, sorted.
    names: &'static [&'static str],
    symbols: NameEntries,
}

/// All packages of a program.
#[derive(Clone, Debug)]
pub struct Packages {
    table: PackageTable,
    by_name: FxHashMap<Arc<str>, PackageId>,
    /// Bytes that packages and their entries take, about.
    bytes: usize,
}

/// Bytes of a package without entries, and of one of its names.
const PACKAGE_BYTES: usize = 2 * size_of::<Package>() + 64;

/// Bytes of an entry beside twice its name: the entry in a table that is half full, its name and its symbol.
const ENTRY_BYTES: usize = 2 * size_of::<(Cow<'static, str>, NameEntry)>() + 144;

/// Why packages are not changed as asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PackageError {
    /// There is another package of this name or nickname.
    NameTaken(String),
    /// The package belongs to the standard, and is as it is.
    Standard(Arc<str>),
    /// The symbol is not to be found in the package.
    NotAccessible(Symbol),
    /// Two symbols would go by this name in the package.
    Conflict {
        /// The name.
        name: String,
        /// The package.
        package: Arc<str>,
    },
}

/// The packages by number. An index that another table has given is a mistake of the caller.
#[derive(Clone, Debug, Default)]
struct PackageTable(Vec<Package>);

impl Index<PackageId> for PackageTable {
    type Output = Package;

    fn index(&self, PackageId(number): PackageId) -> &Package {
        &self.0[number as usize]
    }
}

impl IndexMut<PackageId> for PackageTable {
    fn index_mut(&mut self, PackageId(number): PackageId) -> &mut Package {
        &mut self.0[number as usize]
    }
}

impl Packages {
    fn empty() -> Packages {
        Packages { table: PackageTable::default(), by_name: FxHashMap::default(), bytes: 0 }
    }

    fn add(&mut self, name: Arc<str>, nicknames: Vec<Arc<str>>) -> PackageId {
        let id = PackageId(self.table.0.len() as u32);
        self.bytes += PACKAGE_BYTES * (1 + nicknames.len()) + name.len();
        for name in nicknames.iter().chain([&name]) {
            self.by_name.insert(name.clone(), id);
        }
        self.table.0.push(Package {
            name,
            nicknames,
            uses: Vec::new(),
            exports_again: None,
            names: &[],
            symbols: NameEntries::default(),
        });
        id
    }

    /// Returns all packages, the oldest first.
    pub fn all(&self) -> impl Iterator<Item = PackageId> {
        let all = (0..self.table.0.len() as u32).map(PackageId);
        all.filter(|&package| self.named(self.name(package)) == Some(package))
    }

    /// Takes its names from a package, and what it uses. No package is found by them any more.
    pub fn forget(&mut self, package: PackageId) {
        self.by_name.retain(|_, known| *known != package);
        self.table[package].uses.clear();
    }

    /// Returns the package of this name or nickname.
    pub fn named(&self, name: &str) -> Option<PackageId> {
        self.by_name.get(name).copied()
    }

    /// Returns the name of a package.
    pub fn name(&self, package: PackageId) -> &Arc<str> {
        &self.table[package].name
    }

    /// Nicknames.
    pub fn nicknames(&self, package: PackageId) -> &[Arc<str>] {
        &self.table[package].nicknames
    }

    /// Returns the packages whose external symbols it inherits.
    pub fn uses(&self, package: PackageId) -> &[PackageId] {
        &self.table[package].uses
    }

    /// Returns a new package without symbols. `COMMON-LISP` beside `ESL`, which exports all of it again but
    /// for what it takes over, adds nothing.
    ///
    /// # Errors
    /// [`PackageError::NameTaken`] for a name that is in use; [`PackageError::Conflict`] as for
    /// [`Packages::use_package`].
    pub fn make_package(
        &mut self,
        name: &str,
        nicknames: &[&str],
        uses: &[PackageId],
    ) -> Result<PackageId, PackageError> {
        for name in nicknames.iter().chain([&name]) {
            if self.by_name.contains_key(*name) {
                return Err(PackageError::NameTaken((*name).to_owned()));
            }
        }
        let uses: Vec<PackageId> =
            uses.iter().copied().filter(|&used| !self.is_offered_again(used, uses)).collect();
        for (i, &used) in uses.iter().enumerate() {
            self.check_inherited(name, used, &uses[..i])?;
        }
        let id = self.add(name.into(), nicknames.iter().map(|&name| name.into()).collect());
        for used in uses {
            if !self.table[id].uses.contains(&used) {
                self.table[id].uses.push(used);
                self.bytes += size_of::<PackageId>() * 2;
            }
        }
        Ok(id)
    }

    /// Adds nicknames to a package. Those that it has already are ignored.
    ///
    /// # Errors
    /// [`PackageError::NameTaken`] for a name of another package; then none is given.
    pub fn add_nicknames(&mut self, package: PackageId, nicknames: &[&str]) -> Result<(), PackageError> {
        let is_taken = |name: &&&str| self.by_name.get(**name).is_some_and(|&other| other != package);
        if let Some(name) = nicknames.iter().find(is_taken) {
            return Err(PackageError::NameTaken((*name).to_owned()));
        }
        for &name in nicknames {
            if self.by_name.insert(name.into(), package).is_none() {
                self.bytes += PACKAGE_BYTES + name.len();
                self.table[package].nicknames.push(name.into());
            }
        }
        Ok(())
    }

    /// Makes known that the symbol `name` is at home in `package`. For the tables of an image: nothing is
    /// checked.
    pub fn register(&mut self, package: PackageId, name: impl Into<Cow<'static, str>>, external: bool) {
        let entry = NameEntry { home: package, external, shadowing: false, symbol: None };
        self.enter(package, name.into(), entry);
    }

    /// Enters a symbol into a package, in place of an entry of that name. Returns the old entry.
    fn enter(&mut self, package: PackageId, name: Cow<'static, str>, entry: NameEntry) -> Option<NameEntry> {
        let bytes = ENTRY_BYTES + 2 * name.len();
        let old = self.table[package].symbols.insert(name, entry);
        self.bytes += if old.is_none() { bytes } else { 0 };
        old
    }

    /// Returns the bytes that packages and their entries take, about. Entries that are the same in every
    /// program take none until they are read.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Makes room for as many symbols more.
    pub fn reserve(&mut self, package: PackageId, symbols: usize) {
        self.table[package].symbols.reserve(symbols);
    }

    /// Has copies that are made from now on share the symbols of a package, after many were added.
    pub fn share(&mut self, package: PackageId) {
        self.table[package].symbols.share();
    }

    /// Returns the home of the external symbol `name` of `package`, and the package of which it is an
    /// external entry.
    fn external(&self, package: PackageId, name: &str) -> Option<FoundName> {
        let mut at = package;
        loop {
            if let Some(entry) = self.table[at].symbols.get(name) {
                return entry.external.then_some(FoundName { home: entry.home, entry_of: at });
            }
            if self.table[at].names.binary_search(&name).is_ok() {
                return Some(FoundName { home: at, entry_of: at });
            }
            // A package exports again only what an older one exports.
            at = self.table[at].exports_again?;
        }
    }

    /// Where the symbol that `name` denotes in `package` comes from.
    fn look_up(&self, package: PackageId, name: &str) -> Option<(FoundName, Status)> {
        let this = &self.table[package];
        if let Some(entry) = this.symbols.get(name) {
            let status = if entry.external { Status::External } else { Status::Internal };
            return Some((FoundName { home: entry.home, entry_of: package }, status));
        }
        if let Some(found) = self.external(package, name) {
            return Some((found, Status::External));
        }
        let inherited = this.uses.iter().find_map(|&used| self.external(used, name));
        inherited.map(|found| (found, Status::Inherited))
    }

    /// Returns the symbol that `name` denotes in `package`, if there is one.
    pub fn find(&self, package: PackageId, name: &str) -> Option<(Symbol, Status)> {
        let (found, status) = self.look_up(package, name)?;
        let known = self.table[found.entry_of].symbols.get(name).and_then(|entry| entry.symbol.clone());
        Some((known.unwrap_or_else(|| Symbol::new(&self.table[found.home].name, name)), status))
    }

    /// Returns whether `name` denotes a symbol in `package`.
    pub fn has(&self, package: PackageId, name: &str) -> bool {
        self.look_up(package, name).is_some()
    }

    /// Returns the symbol that `name` denotes in `package`; a new one, at home there, if there was none (then
    /// there is no status). In `KEYWORD` new symbols are external.
    pub fn intern(&mut self, package: PackageId, name: &str) -> (Symbol, Option<Status>) {
        match self.look_up(package, name) {
            Some((found, status)) => (self.symbol(found, name), Some(status)),
            None => {
                self.register(package, name.to_owned(), package == PackageId::KEYWORD);
                (self.symbol(FoundName { home: package, entry_of: package }, name), None)
            }
        }
    }

    /// Returns the symbol that was found, kept for the next time.
    fn symbol(&mut self, FoundName { home, entry_of }: FoundName, name: &str) -> Symbol {
        if let Some(NameEntry { symbol: Some(symbol), .. }) = self.table[entry_of].symbols.get(name) {
            return symbol.clone();
        }
        let symbol = Symbol::new(&self.table[home].name, name);
        match self.table[entry_of].symbols.get_mut(name) {
            Some(entry) => entry.symbol = Some(symbol.clone()),
            // It is one of the names that have no entry until they are read.
            None => {
                let entry =
                    NameEntry { home, external: true, shadowing: false, symbol: Some(symbol.clone()) };
                self.enter(entry_of, name.to_owned().into(), entry);
            }
        }
        symbol
    }

    /// Returns the symbol that a text denotes when it is read: `name` in the `current` package; or
    /// `prefix:name`, or, if `internal`, `prefix::name`. An empty prefix is that of keywords.
    ///
    /// # Errors
    /// [`InternError::NoPackage`] if there is none called `prefix`; [`InternError::NotExternal`] if it does
    /// not export such a symbol, also for `prefix::name` if it belongs to the standard and has no such name.
    pub fn read(
        &mut self,
        current: PackageId,
        prefix: Option<&str>,
        name: &str,
        internal: bool,
    ) -> Result<Symbol, InternError> {
        let package = match prefix {
            None => current,
            Some("") => PackageId::KEYWORD,
            Some(prefix) => self.named(prefix).ok_or_else(|| InternError::NoPackage(prefix.to_owned()))?,
        };
        let adds_symbols = package != PackageId::CL;
        let may_intern = prefix.is_none() || internal || package == PackageId::KEYWORD;
        match self.look_up(package, name) {
            Some((found, Status::External)) => Ok(self.symbol(found, name)),
            Some((found, _)) if may_intern => Ok(self.symbol(found, name)),
            Some(_) => Err(InternError::NotExternal { exists: true }),
            None if may_intern && adds_symbols => Ok(self.intern(package, name).0),
            None => Err(InternError::NotExternal { exists: false }),
        }
    }

    /// How `symbol` is written while `current` is the current package.
    pub fn qualifier(&self, symbol: &Symbol, current: PackageId) -> Qualifier {
        let home = match symbol.home() {
            Home::Uninterned(_) => return Qualifier::Uninterned,
            Home::Package(home) if **home == *KEYWORD_PACKAGE => return Qualifier::Keyword,
            Home::Package(home) => home,
        };
        let home_id = self.named(home);
        let is_same = |found: FoundName| Some(found.home) == home_id;
        if self.look_up(current, symbol.name()).is_some_and(|(found, _)| is_same(found)) {
            return Qualifier::None;
        }
        let external = home_id.and_then(|home| self.external(home, symbol.name())).is_some_and(is_same);
        if external { Qualifier::External(home.clone()) } else { Qualifier::Internal(home.clone()) }
    }

    /// Names of all external symbols of a package, sorted.
    pub fn external_names(&self, package: PackageId) -> BTreeSet<&str> {
        let mut names = BTreeSet::new();
        let mut at = Some(package);
        while let Some(here) = at {
            names.extend(self.table[here].names);
            names.extend(self.table[here].symbols.keys().map(|name| &**name));
            at = self.table[here].exports_again;
        }
        names.retain(|name| self.external(package, name).is_some());
        names
    }

    /// Names of all symbols that can be written in a package without a prefix, sorted.
    pub fn accessible_names(&self, package: PackageId) -> BTreeSet<&str> {
        let mut names = self.external_names(package);
        names.extend(self.table[package].symbols.keys().map(|name| &**name));
        for &used in &self.table[package].uses {
            names.extend(self.external_names(used));
        }
        names
    }

    fn is_at(&self, symbol: &Symbol, home: PackageId) -> bool {
        symbol.is_in(&self.table[home].name)
    }
}

/// Where a symbol is at home, and of which package's entry it comes.
#[derive(Clone, Copy, Debug)]
struct FoundName {
    home: PackageId,
    entry_of: PackageId,
}

fn name_of(symbol: &Symbol) -> String {
    symbol.name().to_owned()
}

impl fmt::Display for Qualifier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Qualifier::None => Ok(()),
            Qualifier::Keyword => f.write_str(":"),
            Qualifier::Uninterned => f.write_str("#:"),
            Qualifier::External(package) => write!(f, "{package}:"),
            Qualifier::Internal(package) => write!(f, "{package}::"),
        }
    }
}

impl fmt::Display for PackageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PackageError::NameTaken(name) => write!(f, "there is a package `{name}` already"),
            PackageError::Standard(name) => write!(f, "the package `{name}` cannot be changed"),
            PackageError::NotAccessible(symbol) => {
                write!(f, "the symbol `{symbol}` is not in the package: import it first")
            }
            PackageError::Conflict { name, package } => {
                write!(
                    f,
                    "two symbols would go by the name `{name}` in the package `{package}`: shadow it first"
                )
            }
        }
    }
}

impl std::error::Error for PackageError {}

#[cfg(test)]
mod tests;
