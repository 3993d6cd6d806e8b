//! The work of a query, as it is charged.
//!
//! Guarantees: work that grows with its input takes from the effort in proportion, whatever the input is:
//! rows, answers, arguments, parts of terms. Where an amount is known only when it has been done, the
//! effort may go below zero; the excess is charged all the same.

/// Units for a goal, a row or an answer. The machine charges 64 units as a tick.
pub(super) const ITEM: usize = 8;
/// Cells of a row, a call or an answer that are part of its [`ITEM`].
const FREE_CELLS: usize = 8;

/// The units that a step may still take.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    given: i64,
    left: i64,
}

impl Effort {
    /// Returns the effort of so many units.
    pub fn of(units: usize) -> Effort {
        let given = i64::try_from(units).unwrap_or(i64::MAX);
        Effort { given, left: given }
    }

    /// Returns the effort that does not end.
    pub(super) fn unbounded() -> Effort {
        Effort::of(usize::MAX)
    }

    /// Sees to it that at least so many units are left.
    pub(super) fn allow(&mut self, units: usize) {
        let missing = (units as i64 - self.left).max(0);
        self.left += missing;
        self.given += missing;
    }

    /// Takes the units of an item. Returns false if none are left.
    #[inline]
    pub(super) fn take_item(&mut self) -> bool {
        if self.left <= 0 {
            return false;
        }
        self.left -= ITEM as i64;
        true
    }

    /// Takes units for work that is done in any case.
    #[inline]
    pub(super) fn spend(&mut self, units: usize) {
        self.left = self.left.saturating_sub_unsigned(units as u64);
    }

    /// Takes the units of a row, call or answer of so many cells, apart from those of its item.
    #[inline]
    pub(super) fn spend_cells(&mut self, cells: usize) {
        if cells > FREE_CELLS {
            self.spend(cells - FREE_CELLS);
        }
    }

    /// Returns the units taken so far.
    pub fn spent(&self) -> usize {
        usize::try_from(self.given.saturating_sub(self.left)).unwrap_or(0)
    }
}
