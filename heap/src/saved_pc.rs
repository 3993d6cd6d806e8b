//! Addresses at which tasks go on, saved while they do not run.

#![allow(unsafe_code)]

/// Address of an instruction in code or in a stub, or no address.
///
/// Safe code may store and compare saved addresses. Following one is unsafe, and left to the interpreter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SavedPc(*const u32);

// SAFETY: a saved address gives no access to the code there: following it is unsafe, and the unsafe block
// that does so shows that the code belongs to the machine in hand.
unsafe impl Send for SavedPc {}

impl crate::store::Stored for SavedPc {
    fn store(&self, out: &mut Vec<u8>) {
        self.0.addr().store(out);
    }

    fn load(from: &mut crate::store::StoredBytes<'_>) -> Option<SavedPc> {
        usize::load(from).map(|pc| SavedPc(std::ptr::with_exposed_provenance(pc)))
    }
}

impl SavedPc {
    /// No address.
    pub const NONE: SavedPc = SavedPc(std::ptr::null());

    /// Saves the address of an instruction.
    pub const fn new(pc: *const u32) -> SavedPc {
        SavedPc(pc)
    }

    /// Returns the address.
    pub const fn get(self) -> *const u32 {
        self.0
    }

    /// Returns whether there is no address.
    pub const fn is_none(self) -> bool {
        self.0.is_null()
    }
}
