//! Destinations: where the value of a form is wanted.

use esl_bytecode::operand::{Reg, Want};

use super::graph::SegmentLabel;

/// Destination of the value or values of a form.
#[derive(Clone, Copy, Debug)]
pub(super) enum Dest {
    /// Nowhere.
    Effect,
    /// One value, to a register. No register from this one on is needed afterwards, so a call may lay its
    /// window over them. Variables of the form itself may be among them, so only its last instruction writes
    /// there, unless the register is the first free one.
    Fresh(Reg),
    /// One value, to the register of a variable: only the last instruction of the form writes there.
    Keep(Reg),
    /// This number of values, at least two, to consecutive registers; missing values are `NIL`. Otherwise as
    /// `Fresh`.
    Values(Reg, u8),
    /// All values, to the value list.
    All,
    /// All values, to the caller of the function. No dynamic extent of this frame is open.
    Tail,
    /// To one of two segments, depending on whether the value is true.
    Test {
        /// Segment for a true value.
        holds: SegmentLabel,
        /// Segment for `NIL`.
        fails: SegmentLabel,
    },
}

impl Dest {
    /// Whether control continues right behind the code of the form.
    pub(super) fn goes_on(self) -> bool {
        !matches!(self, Dest::Tail | Dest::Test { .. })
    }

    /// Returns the values that a catch with this destination wants.
    pub(super) fn want(self) -> Want {
        match self {
            Dest::All => Want::ALL,
            Dest::Values(_, count) => Want::exactly(count),
            _ => Want::ONE,
        }
    }

    /// Whether the destination takes one value at most.
    pub(super) fn is_single(self) -> bool {
        !matches!(self, Dest::All | Dest::Tail | Dest::Values(..))
    }
}
