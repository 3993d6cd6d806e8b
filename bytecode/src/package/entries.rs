//! The entries of a package, by name. Copies share most of them: a machine whose state is copied often
//! ([`super::Packages`] is part of it) gets few names in between.

use std::borrow::Cow;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::NameEntry;

type EntryTable = FxHashMap<Cow<'static, str>, NameEntry>;

/// Fewest entries of a copy's own that it shares with its own copies, and the part of all that these are: to
/// share them may be to copy all.
const FRESH: usize = 32;
const PART: usize = 8;

/// The entries of a package.
#[derive(Clone, Debug, Default)]
pub(super) struct NameEntries {
    /// Entries shared with copies.
    shared: Arc<EntryTable>,
    /// Entries made since, or in place of shared ones.
    fresh: EntryTable,
}

impl NameEntries {
    /// Returns the entry of a name.
    pub(super) fn get(&self, name: &str) -> Option<&NameEntry> {
        self.fresh.get(name).or_else(|| self.shared.get(name))
    }

    /// Returns the table of all entries, if no copy shares any.
    fn unshared(&mut self) -> Option<&mut EntryTable> {
        if self.fresh.is_empty() { Arc::get_mut(&mut self.shared) } else { None }
    }

    /// Returns the entry of a name, to be changed.
    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut NameEntry> {
        if self.unshared().is_some() {
            return self.unshared()?.get_mut(name);
        }
        if !self.fresh.contains_key(name) {
            let (name, entry) = self.shared.get_key_value(name)?;
            let (name, entry) = (name.clone(), entry.clone());
            self.share_many();
            self.fresh.insert(name, entry);
        }
        self.fresh.get_mut(name)
    }

    /// Returns whether there is an entry of a name.
    pub(super) fn contains_key(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    /// Enters a name, in place of an entry that it has. Returns the old entry.
    pub(super) fn insert(&mut self, name: Cow<'static, str>, entry: NameEntry) -> Option<NameEntry> {
        if let Some(entries) = self.unshared() {
            return entries.insert(name, entry);
        }
        self.share_many();
        let shared = self.shared.get(&name).cloned();
        self.fresh.insert(name, entry).or(shared)
    }

    /// Makes room for so many names more.
    pub(super) fn reserve(&mut self, names: usize) {
        Arc::make_mut(&mut self.shared).reserve(names);
    }

    /// Returns all names and entries.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&Cow<'static, str>, &NameEntry)> {
        let old = self.shared.iter().filter(|(name, _)| !self.fresh.contains_key(*name));
        old.chain(&self.fresh)
    }

    /// Returns all names.
    pub(super) fn keys(&self) -> impl Iterator<Item = &Cow<'static, str>> {
        self.iter().map(|(name, _)| name)
    }

    /// Shares the entries made since with copies that are made from now on.
    pub(super) fn share(&mut self) {
        Arc::make_mut(&mut self.shared).extend(self.fresh.drain());
    }

    fn share_many(&mut self) {
        if self.fresh.len() >= FRESH + self.shared.len() / PART {
            self.share();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::package::PackageId;

    fn entry(external: bool) -> NameEntry {
        NameEntry { home: PackageId::ESL, external, shadowing: false, symbol: None }
    }

    #[test]
    fn entries_are_those_of_one_table_however_they_are_shared() {
        let mut entries = NameEntries::default();
        let names: Vec<String> = (0..4 * FRESH).map(|number| format!("N{number}")).collect();
        for name in &names {
            assert!(entries.insert(name.clone().into(), entry(false)).is_none());
        }
        entries.share();
        let copy = entries.clone();
        for name in &names {
            let old = entries.insert(name.clone().into(), entry(true));
            assert!(old.is_some_and(|old| !old.external) && entries.contains_key(name));
        }
        for name in names.iter().skip(1) {
            entries.get_mut(name).expect("it is there").shadowing = true;
        }
        assert!(entries.get_mut("M").is_none() && entries.get("M").is_none());
        assert_eq!(entries.keys().count(), names.len());
        assert_eq!(
            entries.iter().filter(|(_, entry)| entry.external && entry.shadowing).count(),
            names.len() - 1
        );
        assert!(copy.iter().count() == names.len() && copy.iter().all(|(_, entry)| !entry.external));
    }
}
