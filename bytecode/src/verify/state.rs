//! All that is known at one place of a function's code: registers, bindings, and the control entries that
//! stand.

use super::error::Fault;
use super::registers::{Class, Registers};

/// The kind of a control entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VerifiedEntry {
    /// Of `push-catch`.
    Catch,
    /// Of `push-cleanup`, before it runs.
    Cleanup,
    /// Of `push-cleanup`, while it runs.
    RunningCleanup,
    /// Of `push-recovery`.
    Recovery,
    /// Of `push-failure-cleanup`, before it runs.
    FailureCleanup,
    /// Of `push-handler-case`.
    HandlerCase,
    /// Of `push-handlers`.
    Handlers,
    /// Of `push-mask`.
    Mask,
    /// Of `push-scope`.
    Scope,
}

/// Where control goes when an unwinding ends at an entry, or passes a cleanup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LandingState {
    /// Word of the code.
    pub(super) to: u32,
    /// How many registers from the entry's window on are filled.
    pub(super) results: u8,
    /// Whether the value list is set.
    pub(super) value_list: bool,
}

/// A control entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct KnownEntry {
    pub(super) kind: VerifiedEntry,
    pub(super) window: u8,
    /// Bindings made before it was pushed, since the entry below it.
    pub(super) bindings_below: u32,
    pub(super) landing: Option<LandingState>,
    /// For a running cleanup: what is known when it came about by `enter-cleanup`, or by a failure that it is
    /// for. `None` if it never does.
    pub(super) entered: Option<Box<Registers>>,
}

/// Facts that hold at one place.
#[derive(Clone, Debug)]
pub(super) struct PlaceState {
    pub(super) registers: Registers,
    /// Bindings made since the innermost entry.
    pub(super) bindings: u32,
    /// The entries, the innermost last. Their windows do not decrease.
    pub(super) entries: Vec<KnownEntry>,
    /// Whether something about a register below an entry's window was known a moment ago and is not now. Code
    /// that such an entry lands at must then be told.
    pub(super) lost: bool,
}

impl PlaceState {
    /// Returns a frame of which nothing is known but `registers`.
    pub(super) fn new(registers: Registers) -> PlaceState {
        PlaceState { registers, bindings: 0, entries: Vec::new(), lost: false }
    }

    /// Registers below this one are to be kept for landings.
    pub(super) fn floor(&self) -> u8 {
        self.entries.last().map_or(0, |entry| entry.window)
    }

    /// Returns all views of the registers: as they are, and as they are if running cleanups came about by
    /// `enter-cleanup`.
    fn views(&mut self) -> impl Iterator<Item = &mut Registers> {
        let entered = self.entries.iter_mut().filter_map(|entry| entry.entered.as_deref_mut());
        std::iter::once(&mut self.registers).chain(entered)
    }

    /// `register` now holds something of `class`, or nothing that is known.
    pub(super) fn set(&mut self, register: u8, class: Option<Class>) {
        let floor = self.floor();
        let mut lost = false;
        for view in self.views() {
            lost |= view.set(register, class);
        }
        self.lost |= lost && register < floor;
    }

    /// `register` holds a closure of `function`, made by this frame.
    pub(super) fn set_closure(&mut self, register: u8, function: u32) {
        self.set(register, Some(Class::Value));
        self.views().for_each(|view| view.note_closure(register, function));
    }

    /// Nothing is known of registers from `end` on.
    pub(super) fn keep_below(&mut self, end: u8) {
        self.views().for_each(|view| view.keep_below(end));
    }

    /// Returns the state in which an unwinding leaves the frame that ends at entry `at`, which has a landing.
    pub(super) fn landed(&self, at: usize, landing: LandingState) -> PlaceState {
        let entry = &self.entries[at];
        let mut state = PlaceState {
            registers: self.registers.clone(),
            bindings: entry.bindings_below,
            entries: self.entries[..at].to_vec(),
            lost: false,
        };
        state.keep_below(entry.window);
        for register in entry.window..entry.window + landing.results {
            state.set(register, Some(Class::Value));
        }
        state.registers.value_list = landing.value_list;
        if matches!(entry.kind, VerifiedEntry::Cleanup | VerifiedEntry::FailureCleanup) {
            // A cleanup for a failure goes on behind its end, with the failure in the value list.
            let entered = (entry.kind == VerifiedEntry::FailureCleanup).then(|| {
                let mut registers = state.registers.clone();
                registers.value_list = true;
                Box::new(registers)
            });
            state.bindings = 0;
            state.entries.push(KnownEntry {
                kind: VerifiedEntry::RunningCleanup,
                landing: None,
                entered,
                ..entry.clone()
            });
        }
        state
    }

    /// Only what holds in `other` too is known; says whether anything is not any more.
    pub(super) fn meet(&mut self, other: &PlaceState) -> Result<bool, Fault> {
        if self.entries.len() != other.entries.len() || self.bindings != other.bindings {
            return Err(Fault::PathsDisagree);
        }
        let mut changed = self.registers.meet(&other.registers);
        for (entry, other) in self.entries.iter_mut().zip(&other.entries) {
            let same = entry.kind == other.kind
                && entry.window == other.window
                && entry.bindings_below == other.bindings_below
                && entry.landing == other.landing;
            if !same {
                return Err(Fault::PathsDisagree);
            }
            match (&mut entry.entered, &other.entered) {
                (_, None) => {}
                (Some(entered), Some(other)) => changed |= entered.meet(other),
                (entered @ None, Some(other)) => {
                    *entered = Some(other.clone());
                    changed = true;
                }
            }
        }
        Ok(changed)
    }

    /// Returns how much memory and time it takes to copy this, as a multiple of a small state.
    pub(super) fn weight(&self) -> usize {
        let of_entry =
            |entry: &KnownEntry| 1 + entry.entered.as_ref().map_or(0, |registers| 4 + registers.weight());
        1 + self.registers.weight() + self.entries.iter().map(of_entry).sum::<usize>()
    }
}
