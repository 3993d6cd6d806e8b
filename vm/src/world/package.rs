//! Packages as objects of the program.
//!
//! The rules are those of [`Packages`]; a package object is a record of its name, and there is one for each package.

use std::sync::Arc;

use esl_bytecode::package::{PackageId, Packages};

use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;
use crate::world::World;

impl World {
    /// The object of the package of this name, and its number. A name that nobody has defined becomes a package without
    /// symbols: so code can be loaded before the `defpackage` in it has run.
    pub(super) fn home(
        &mut self,
        heap: &mut Heap,
        name: &Arc<str>,
    ) -> Result<(PackageId, Value), AllocError> {
        if let Some(&known) = self.homes.get(name) {
            return Ok(known);
        }
        let package = match self.packages.named(name) {
            Some(package) => package,
            // Without nicknames and used packages, there is nothing to be in the way of a name that is free.
            None => self.packages.make_package(name, &[], &[]).unwrap_or(PackageId::USER),
        };
        let object = self.package_object(heap, package)?;
        self.homes.insert(name.clone(), (package, object));
        Ok((package, object))
    }

    /// The object of a package.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn package_object(
        &mut self,
        heap: &mut Heap,
        package: PackageId,
    ) -> Result<Value, AllocError> {
        if let Some(&object) = self.package_objects.get(&package) {
            return Ok(object);
        }
        let name = heap.alloc_str(self.packages.name(package))?;
        let object = heap.alloc_record(Kind::Package, 0, 0, &[name])?;
        self.package_objects.insert(package, object);
        Ok(object)
    }

    /// The package of a package object.
    pub(crate) fn package_of(&self, heap: &Heap, object: Value) -> Option<PackageId> {
        self.packages.named(&self.package_name(heap, object)?)
    }

    /// The name of a package object.
    pub(crate) fn package_name(&self, heap: &Heap, object: Value) -> Option<String> {
        heap.string_text(*heap.record(object, Kind::Package)?.first()?)
    }

    /// The packages and their rules.
    pub(crate) fn packages(&self) -> &Packages {
        &self.packages
    }

    /// The packages and their rules, to be changed.
    pub(crate) fn packages_mut(&mut self) -> &mut Packages {
        &mut self.packages
    }
}
