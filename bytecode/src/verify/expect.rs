//! Preconditions of an instruction on the state at its place, and its effect on that state.

use super::error::Fault;
use super::registers::Class;
use super::state::{KnownEntry, PlaceState, VerifiedEntry};
use crate::opcode::CallOperands;
use crate::operand::{Count, Want, Window};

/// Returns the contents of `register`, if it may be read at all.
pub(super) fn readable(state: &PlaceState, register: u8) -> Result<Class, Fault> {
    match state.registers.class(register) {
        Some(Class::MaybeUnsupplied) => Err(Fault::MaybeUnsupplied(register)),
        Some(class) => Ok(class),
        None => Err(Fault::Unassigned(register)),
    }
}

/// Checks that `register` holds an object of the program.
pub(super) fn read(state: &PlaceState, register: u8) -> Result<(), Fault> {
    match readable(state, register)? {
        Class::Box => Err(Fault::Box(register)),
        _ => Ok(()),
    }
}

/// Checks that `register` holds a box.
pub(super) fn read_box(state: &PlaceState, register: u8) -> Result<(), Fault> {
    match readable(state, register)? {
        Class::Box => Ok(()),
        _ => Err(Fault::NotBox(register)),
    }
}

pub(super) fn read_all(state: &PlaceState, first: u8, count: Count) -> Result<(), Fault> {
    (0..count.0).try_for_each(|i| read(state, first + i))
}

pub(super) fn assign(state: &mut PlaceState, first: u8, count: u8) {
    for i in 0..count {
        state.set(first + i, Some(Class::Value));
    }
}

/// Checks a call with the arguments of a window, which clobbers the registers above it. Returns whether
/// control continues with the next instruction.
pub(super) fn call(
    state: &mut PlaceState,
    CallOperands { callee, window, count, want }: CallOperands,
) -> Result<bool, Fault> {
    if callee.is_in_window() {
        read(state, window.0)?;
    }
    read_all(state, window.0 + 2, count)?;
    let Some(want) = want else { return leave(state) };
    expect_window(state, window)?;
    state.keep_below(window.0);
    assign(state, window.0, want.registers());
    state.registers.value_list = want == Want::ALL;
    Ok(true)
}

pub(super) fn pop(state: &mut PlaceState, Count(count): Count) -> Result<(), Fault> {
    for _ in 0..count {
        match state.entries.pop() {
            None => return Err(Fault::PopCount(count)),
            Some(KnownEntry {
                kind: found @ (VerifiedEntry::Cleanup | VerifiedEntry::RunningCleanup),
                ..
            }) => {
                let expected = "an entry that may be popped";
                return Err(Fault::Entry { expected, found: Some(found) });
            }
            Some(entry) => state.bindings = entry.bindings_below,
        }
    }
    Ok(())
}

/// Control leaves the function: it does not go on with the next instruction.
pub(super) fn leave(state: &PlaceState) -> Result<bool, Fault> {
    match state.entries.last() {
        Some(entry) => Err(Fault::StandingEntry(entry.kind)),
        None => expect_no_bindings(state).map(|()| false),
    }
}

pub(super) fn expect_no_bindings(state: &PlaceState) -> Result<(), Fault> {
    if state.bindings == 0 { Ok(()) } else { Err(Fault::StandingBindings(state.bindings)) }
}

pub(super) fn expect_value_list(set: bool) -> Result<(), Fault> {
    if set { Ok(()) } else { Err(Fault::ValueList) }
}

pub(super) fn expect_entry(
    state: &PlaceState,
    kind: VerifiedEntry,
    expected: &'static str,
) -> Result<(), Fault> {
    let found = state.entries.last().map(|entry| entry.kind);
    if found == Some(kind) { Ok(()) } else { Err(Fault::Entry { expected, found }) }
}

pub(super) fn expect_window(state: &PlaceState, Window(window): Window) -> Result<(), Fault> {
    let entry = state.floor();
    if window < entry { Err(Fault::WindowBelowEntry { window, entry }) } else { Ok(()) }
}
