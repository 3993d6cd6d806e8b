//! Names of symbols as compiler, module format and reader see them.
//!
//! A [`Symbol`] is a home package and a name; two with the same package and name are equal. A symbol without
//! a package (`#:g`, `gensym`) is known by a number that is unique within one compilation unit. The symbol
//! *objects* of a running program (with value, function and properties) belong to the virtual machine.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// The package of the standard Common Lisp names.
pub const CL_PACKAGE: &str = "COMMON-LISP";
/// The package of ESL's own names, and of the three CL names that ESL takes over.
pub const ESL_PACKAGE: &str = "ESL";
/// The package in which programs start.
pub const USER_PACKAGE: &str = "ESL-USER";
/// The package in which Common Lisp programs start.
pub const CL_USER_PACKAGE: &str = "COMMON-LISP-USER";
/// The package of keywords.
pub const KEYWORD_PACKAGE: &str = "KEYWORD";

/// Where a symbol is at home.
#[derive(Clone, Debug)]
pub enum Home {
    /// The package of this name.
    Package(Arc<str>),
    /// No package: identity is this number, unique within one compilation unit.
    Uninterned(u32),
}

#[derive(Debug)]
struct SymbolData {
    home: Home,
    name: Arc<str>,
    hash: u64,
}

/// The name of a symbol. Cloning is cheap; equality is by home and name.
#[derive(Clone)]
pub struct Symbol(Arc<SymbolData>);

impl Symbol {
    /// Returns the symbol `name` at home in `package`. Names keep their case.
    pub fn new(package: &Arc<str>, name: &str) -> Symbol {
        let hash = fnv(fnv(0xcbf2_9ce4_8422_2325, package.as_bytes()), name.as_bytes());
        Symbol(Arc::new(SymbolData { home: Home::Package(package.clone()), name: name.into(), hash }))
    }

    /// Returns a symbol of the package `COMMON-LISP`.
    pub fn cl(name: &str) -> Symbol {
        Symbol::new(&CL_PACKAGE.into(), name)
    }

    /// Returns a symbol of the package `ESL`.
    pub fn esl(name: &str) -> Symbol {
        Symbol::new(&ESL_PACKAGE.into(), name)
    }

    /// Returns a keyword.
    pub fn keyword(name: &str) -> Symbol {
        Symbol::new(&KEYWORD_PACKAGE.into(), name)
    }

    /// Returns the symbol without a package that is number `id` of its compilation unit.
    pub fn uninterned(id: u32, name: &str) -> Symbol {
        let hash = fnv(u64::from(id) ^ 0x9e37_79b9_7f4a_7c15, name.as_bytes());
        Symbol(Arc::new(SymbolData { home: Home::Uninterned(id), name: name.into(), hash }))
    }

    /// Returns the name, without package.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Returns the home package's name, or the number of a symbol that has none.
    pub fn home(&self) -> &Home {
        &self.0.home
    }

    /// Returns the home package's name; `None` for an uninterned symbol.
    pub fn package(&self) -> Option<&Arc<str>> {
        match &self.0.home {
            Home::Package(package) => Some(package),
            Home::Uninterned(_) => None,
        }
    }

    /// Returns whether this is a keyword.
    pub fn is_keyword(&self) -> bool {
        self.is_in(KEYWORD_PACKAGE)
    }

    /// Returns whether the symbol's home is the package named `package`.
    pub fn is_in(&self, package: &str) -> bool {
        self.package().is_some_and(|home| &**home == package)
    }

    /// Returns whether this is the symbol `name` of the package `COMMON-LISP`.
    pub fn is_cl(&self, name: &str) -> bool {
        self.name() == name && self.is_in(CL_PACKAGE)
    }
}

/// Bit in the number of an uninterned symbol that keeps the function `(setf symbol)` of the one that has the
/// rest of the number.
const SETF_CELL: u32 = 1 << 31;

/// Numbers of uninterned symbols that are not such cells.
pub const UNINTERNED_NUMBERS: u32 = SETF_CELL - 1;

/// Returns the symbol that keeps the global function `(setf symbol)`: one of the same package, or uninterned
/// too, named as it is written.
pub fn setf_cell(symbol: &Symbol) -> Symbol {
    let name = format!("(SETF {})", symbol.name());
    match symbol.home() {
        Home::Package(package) => Symbol::new(package, &name),
        Home::Uninterned(id) => Symbol::uninterned(*id | SETF_CELL, &name),
    }
}

/// Returns the uninterned symbol whose function `(setf symbol)` this one keeps. `None` for all others.
pub fn symbol_of_setf_cell(cell: &Symbol) -> Option<Symbol> {
    let Home::Uninterned(id) = *cell.home() else { return None };
    let name = cell.name().strip_prefix("(SETF ")?.strip_suffix(')')?;
    (id & SETF_CELL != 0).then(|| Symbol::uninterned(id & UNINTERNED_NUMBERS, name))
}

/// FNV-1a: symbols are hashed once, when they are made.
fn fnv(mut hash: u64, bytes: &[u8]) -> u64 {
    for &byte in bytes {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    hash
}

impl PartialEq for Symbol {
    fn eq(&self, other: &Symbol) -> bool {
        if Arc::ptr_eq(&self.0, &other.0) {
            return true;
        }
        if self.0.hash != other.0.hash || self.0.name != other.0.name {
            return false;
        }
        match (&self.0.home, &other.0.home) {
            (Home::Package(a), Home::Package(b)) => a == b,
            (Home::Uninterned(a), Home::Uninterned(b)) => a == b,
            _ => false,
        }
    }
}

impl Eq for Symbol {}

impl Hash for Symbol {
    fn hash<H: Hasher>(&self, state: &mut H) {
        state.write_u64(self.0.hash);
    }
}

impl fmt::Display for Symbol {
    /// Returns the name, with `:` before a keyword and `#:` before an uninterned symbol; other packages are
    /// not shown.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0.home {
            Home::Package(package) if &**package == KEYWORD_PACKAGE => write!(f, ":{}", self.name()),
            Home::Package(_) => f.write_str(self.name()),
            Home::Uninterned(_) => write!(f, "#:{}", self.name()),
        }
    }
}

impl fmt::Debug for Symbol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0.home {
            Home::Package(package) => write!(f, "{package}::{}", self.name()),
            Home::Uninterned(id) => write!(f, "#:{}@{id}", self.name()),
        }
    }
}
