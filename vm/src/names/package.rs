//! Packages as objects of the program.
//!
//! The rules are those of [`Packages`]; a package object is a record of its name, and each package has one.

use std::sync::Arc;

use esl_bytecode::package::{PackageId, Packages};

use crate::heap::{AllocError, Heap, Kind};
use crate::names::Names;
use crate::value::Value;

impl Names {
    /// Returns the number and the object of the package of this name. An undefined name becomes a package
    /// without symbols, so that code can be loaded before its `defpackage` has run.
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
            // Without nicknames and used packages, a free name cannot conflict.
            None => self.packages_mut().make_package(name, &[], &[]).unwrap_or(PackageId::USER),
        };
        let object = self.package_object(heap, package)?;
        self.homes.insert(name.clone(), (package, object));
        Ok((package, object))
    }

    /// Returns the object of a package.
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

    /// Returns the package of a package object.
    pub(crate) fn package_of(&self, heap: &Heap, object: Value) -> Option<PackageId> {
        self.packages.named(&self.package_name(heap, object)?)
    }

    /// Returns the name of a package object.
    pub(crate) fn package_name(&self, heap: &Heap, object: Value) -> Option<String> {
        heap.string_text(*heap.record(object, Kind::Package)?.first()?)
    }

    /// Returns the packages and their rules.
    pub(crate) fn packages(&self) -> &Packages {
        &self.packages
    }

    /// Returns the packages and their rules, for changes.
    pub(crate) fn packages_mut(&mut self) -> &mut Packages {
        self.called.forget();
        &mut self.packages
    }
}
