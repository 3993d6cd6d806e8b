//! How functions run: by the interpreter alone, or those that are hot as machine code (`interp::native`).
//!
//! No program can see the difference, in no value, tick or turn. So nothing here is state of a run.

#[cfg(feature = "native")]
use std::collections::{HashMap, HashSet};

#[cfg(feature = "native")]
use esl_native::abi::EntryStub;
#[cfg(feature = "native")]
use esl_native::{MachineCode, MachineCodeHelper, MachineCodeMaker};

/// How the functions of a machine run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tier {
    /// All by the interpreter.
    #[default]
    Interpreter,
    /// All as machine code, from their second call on. For tests: to make it takes longer than to run most
    /// functions once.
    Native,
    /// Those that are found running at the ends of slices again and again as machine code.
    Auto,
}

/// Figures of machine code.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TierReport {
    /// Functions of which machine code was made.
    pub functions: usize,
    /// Bytes of machine code.
    pub bytes: usize,
    /// Nanoseconds that it took to make it.
    pub nanoseconds: u64,
    /// Why no machine code is made, if it is wanted.
    pub refused: Option<String>,
}

/// The machine code of a machine's functions.
#[derive(Default)]
pub(crate) struct CompiledFunctions {
    /// What was asked for.
    pub(crate) tier: Tier,
    /// Figures.
    pub(crate) report: TierReport,
    /// Makes machine code at once: for [`Tier::Native`].
    #[cfg(feature = "native")]
    pub(crate) maker: Option<MachineCodeMaker>,
    /// Makes machine code on a thread of its own: for [`Tier::Auto`].
    #[cfg(feature = "native")]
    pub(crate) helper: Option<MachineCodeHelper>,
    /// What machine code was asked for, by the number of the order.
    #[cfg(feature = "native")]
    pub(crate) asked: HashMap<u64, CodeOrder>,
    /// Number of the last order.
    #[cfg(feature = "native")]
    pub(crate) orders: u64,
    /// By number; `None` where it was given back.
    #[cfg(feature = "native")]
    pub(crate) installed: Vec<Option<InstalledCode>>,
    /// The numbers that were given back.
    #[cfg(feature = "native")]
    pub(crate) free: Vec<u32>,
    /// How often codes were found running.
    #[cfg(feature = "native")]
    pub(crate) heat: Heat,
    /// The symbols, by their words, whose functions were inlined and then redefined: these are not inlined
    /// again.
    #[cfg(feature = "native")]
    pub(crate) redefined: HashSet<u64>,
}

/// An order of machine code.
#[cfg(feature = "native")]
pub(crate) struct CodeOrder {
    /// The code, by its value's word.
    pub(crate) code: u64,
    /// Whether guesses are made of what registers hold.
    pub(crate) has_guesses: bool,
    /// The functions that may be inlined in it, by their words.
    pub(crate) inlined: Box<[u64]>,
}

/// How often codes were found running, by their addresses. A code that was not met for long may be forgotten
/// for another one, so this takes little memory, and a count little time.
#[cfg(feature = "native")]
#[derive(Default)]
pub(crate) struct Heat {
    /// The address and the count of a code, at the place that the address gives.
    places: Vec<(u64, u32)>,
}

#[cfg(feature = "native")]
impl Heat {
    /// Number of places: a power of two.
    const PLACES: usize = 1024;

    /// Counts a code, and returns its count.
    pub(crate) fn count(&mut self, code: u64) -> u32 {
        if self.places.is_empty() {
            self.places.resize(Heat::PLACES, (0, 0));
        }
        let hash = code.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (u64::BITS - Heat::PLACES.ilog2());
        let place = &mut self.places[hash as usize];
        if place.0 != code {
            *place = (code, 0);
        }
        place.1 = place.1.saturating_add(1);
        place.1
    }

    /// Forgets the count of a code.
    pub(crate) fn forget(&mut self, code: u64) {
        self.places.iter_mut().filter(|place| place.0 == code).for_each(|place| *place = (0, 0));
    }

    /// Forgets all counts.
    pub(crate) fn clear(&mut self) {
        self.places.clear();
    }
}

/// Machine code that calls may enter.
#[cfg(feature = "native")]
pub(crate) struct InstalledCode {
    /// What the entry word of the code points to. It stays where it is.
    pub(crate) stub: Box<EntryStub>,
    /// The machine code.
    pub(crate) made: MachineCode,
    /// What was asked for.
    pub(crate) order: CodeOrder,
    /// How often guesses were wrong.
    pub(crate) wrong: u32,
    /// How its loop instructions are used, in the order of [`MachineCode::loops`].
    pub(crate) loops: Box<[LoopUse]>,
}

/// How often machine code is entered at a loop instruction, and whether that is worth it.
#[cfg(feature = "native")]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LoopUse {
    /// Entries since their use was looked at.
    pub(crate) entries: u32,
    /// Ticks taken in these.
    pub(crate) ticks: u32,
    /// Whether the instruction does not lead to machine code for now.
    pub(crate) is_calm: bool,
}
