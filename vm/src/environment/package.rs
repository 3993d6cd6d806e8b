//! The current package, and what names mean in it.

use esl_bytecode::compile::InternError;
use esl_bytecode::package::PackageId;
use esl_bytecode::symbol::Symbol;

use crate::heap::AllocError;
use crate::vm::Vm;

impl Vm {
    /// Returns the current package: the value of `*package*` in the running task. If that is not a package,
    /// it is `ESL-USER`.
    pub(crate) fn current_package(&self) -> PackageId {
        let value = self.symbol_value(self.names.known.package);
        value.and_then(|value| self.names.package_of(&self.heap, value)).unwrap_or(PackageId::USER)
    }

    /// Returns the names of all symbols that can be written in the current package without a prefix, sorted.
    pub fn accessible_names(&self) -> Vec<String> {
        let names = self.names.packages().accessible_names(self.current_package());
        names.into_iter().filter(|name| !name.starts_with('%')).map(String::from).collect()
    }

    /// Makes the package of this name the value of `*package*` outside of all bindings. Returns false if
    /// there is none.
    ///
    /// # Errors
    /// [`AllocError`] without room.
    pub fn enter_package(&mut self, name: &str) -> Result<bool, AllocError> {
        let Some(package) = self.names.packages().named(name) else { return Ok(false) };
        let object = self.names.package_object(&mut self.heap, package)?;
        self.heap.symbol_set_value(self.names.known.package, object);
        Ok(true)
    }

    /// Returns the symbol that a name denotes when it is read.
    pub(crate) fn read_symbol(
        &mut self,
        prefix: Option<&str>,
        name: &str,
        internal: bool,
    ) -> Result<Symbol, InternError> {
        let current = self.current_package();
        self.names.packages_mut().read(current, prefix, name, internal)
    }
}
