//! Changes of a package: symbols are exported, imported and shadowed, and packages used. Each change is made
//! completely or not at all.

use std::borrow::Cow;

use super::{FoundName, NameEntry, PackageError, PackageId, Packages, Status, name_of};
use crate::symbol::Symbol;

impl Packages {
    /// Makes `symbol`, which `package` has in some way, external in it.
    ///
    /// # Errors
    /// [`PackageError::NotAccessible`] if the package does not have it; [`PackageError::Conflict`] if a
    /// package that uses this one has another symbol of that name; [`PackageError::Standard`] for
    /// `COMMON-LISP`.
    pub fn export(&mut self, package: PackageId, symbol: &Symbol) -> Result<(), PackageError> {
        let name = symbol.name();
        let (found, status) = self
            .look_up(package, name)
            .filter(|(found, _)| self.is_at(symbol, found.home))
            .ok_or_else(|| PackageError::NotAccessible(symbol.clone()))?;
        if status == Status::External {
            return Ok(());
        }
        self.check_open(package)?;
        for user in self.all().filter(|&user| self.table[user].uses.contains(&package)) {
            let entry = self.table[user].symbols.get(name);
            if entry.is_some_and(|entry| entry.shadowing) {
                continue;
            }
            if self.look_up(user, name).is_some_and(|(other, _)| other.home != found.home) {
                return Err(self.conflict(user, name));
            }
        }
        if let Some(entry) = self.table[package].symbols.get_mut(name) {
            entry.external = true;
            return Ok(());
        }
        let entry =
            NameEntry { home: found.home, external: true, shadowing: false, symbol: Some(symbol.clone()) };
        self.enter(package, Cow::Owned(name_of(symbol)), entry);
        Ok(())
    }

    /// Makes `symbol` present in `package`.
    ///
    /// # Errors
    /// [`PackageError::Conflict`] if it has another symbol of that name; [`PackageError::NotAccessible`] for
    /// a symbol without a home; [`PackageError::Standard`] for `COMMON-LISP`.
    pub fn import(&mut self, package: PackageId, symbol: &Symbol) -> Result<(), PackageError> {
        let home = symbol.package().and_then(|home| self.named(home));
        let home = home.ok_or_else(|| PackageError::NotAccessible(symbol.clone()))?;
        let name = symbol.name();
        if self.look_up(package, name).is_some_and(|(found, _)| found.home != home) {
            return Err(self.conflict(package, name));
        }
        self.check_open(package)?;
        let entry = NameEntry { home, external: false, shadowing: false, symbol: Some(symbol.clone()) };
        if !self.table[package].symbols.contains_key(name) {
            self.enter(package, Cow::Owned(name_of(symbol)), entry);
        }
        Ok(())
    }

    /// Makes `symbol` present in `package`, in place of any other of its name, that it has or inherits.
    ///
    /// # Errors
    /// [`PackageError::NotAccessible`] for a symbol without a home; [`PackageError::Standard`] for
    /// `COMMON-LISP`.
    pub fn shadowing_import(&mut self, package: PackageId, symbol: &Symbol) -> Result<(), PackageError> {
        self.check_open(package)?;
        let home = symbol.package().and_then(|home| self.named(home));
        let home = home.ok_or_else(|| PackageError::NotAccessible(symbol.clone()))?;
        let entry = NameEntry { home, external: false, shadowing: true, symbol: Some(symbol.clone()) };
        let old = self.enter(package, Cow::Owned(name_of(symbol)), entry);
        if let Some(old) = old.filter(|old| old.home == home)
            && let Some(entry) = self.table[package].symbols.get_mut(symbol.name())
        {
            entry.external = old.external;
        }
        Ok(())
    }

    /// Creates a symbol `name` at home in `package`, which hides any inherited one.
    ///
    /// # Errors
    /// [`PackageError::Standard`] for `COMMON-LISP`.
    pub fn shadow(&mut self, package: PackageId, name: &str) -> Result<(), PackageError> {
        self.check_open(package)?;
        if !self.table[package].symbols.contains_key(name) {
            self.register(package, name.to_owned(), false);
        }
        if let Some(entry) = self.table[package].symbols.get_mut(name) {
            entry.shadowing = true;
        }
        Ok(())
    }

    /// Lets `package` inherit what `used` exports.
    ///
    /// # Errors
    /// [`PackageError::Conflict`] if it has another symbol by one of the names, that does not shadow;
    /// [`PackageError::Standard`] for `COMMON-LISP`.
    pub fn use_package(&mut self, package: PackageId, used: PackageId) -> Result<(), PackageError> {
        if package == used || self.table[package].uses.contains(&used) {
            return Ok(());
        }
        self.check_open(package)?;
        if self.is_offered_again(used, &self.table[package].uses) {
            return Ok(());
        }
        let this = &self.table[package];
        for (name, entry) in this.symbols.iter().filter(|(_, entry)| !entry.shadowing) {
            if self.external(used, name).is_some_and(|found| found.home != entry.home) {
                return Err(self.conflict(package, name));
            }
        }
        let mut uses = this.uses.clone();
        uses.retain(|&other| self.table[used].exports_again != Some(other));
        let name = this.name.clone();
        self.check_inherited(&name, used, &uses)?;
        uses.push(used);
        self.table[package].uses = uses;
        Ok(())
    }

    /// Returns whether one of `others` exports again what `used` does: then that one stands for both, and
    /// `used` need not be used.
    pub(super) fn is_offered_again(&self, used: PackageId, others: &[PackageId]) -> bool {
        others.iter().any(|&other| self.table[other].exports_again == Some(used))
    }

    /// Checks that no two of the packages that `user` uses or is about to use export different symbols by one
    /// name, unless it has a symbol of its own by that name.
    pub(super) fn check_inherited(
        &self,
        user: &str,
        used: PackageId,
        others: &[PackageId],
    ) -> Result<(), PackageError> {
        let own = self.named(user).map(|id| &self.table[id].symbols);
        for &other in others {
            for name in self.external_names(used) {
                let has_own = own.is_some_and(|symbols| symbols.contains_key(name));
                let clash = |found: FoundName| {
                    self.external(used, name).is_some_and(|new| new.home != found.home) && !has_own
                };
                if self.external(other, name).is_some_and(clash) {
                    return Err(PackageError::Conflict { name: name.to_owned(), package: user.into() });
                }
            }
        }
        Ok(())
    }

    fn check_open(&self, package: PackageId) -> Result<(), PackageError> {
        if package == PackageId::CL {
            return Err(PackageError::Standard(self.table[package].name.clone()));
        }
        Ok(())
    }

    fn conflict(&self, package: PackageId, name: &str) -> PackageError {
        PackageError::Conflict { name: name.to_owned(), package: self.table[package].name.clone() }
    }
}
