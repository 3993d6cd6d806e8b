//! How functions run: by the interpreter alone, or those that are hot as machine code (`interp::native`).
//!
//! No program can see the difference, in no value, tick or turn. So nothing here is state of a run.

#[cfg(feature = "native")]
use std::collections::{HashMap, HashSet};

#[cfg(feature = "native")]
use esl_native::abi::EntryStub;
#[cfg(feature = "native")]
use esl_native::{Known, MachineCode, MachineCodeHelper, MachineCodeMaker};

#[cfg(feature = "native")]
use crate::value::Value;

/// How the functions of a machine run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tier {
    /// All by the interpreter.
    #[default]
    Interpreter,
    /// All as machine code, from their second call on. For tests: to make it takes longer than to run most
    /// functions once.
    Native,
    /// Hot functions as machine code: they have taken many ticks for their size.
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
    /// The requested tier.
    pub(crate) tier: Tier,
    /// Figures.
    pub(crate) report: TierReport,
    /// Makes machine code at once: for [`Tier::Native`].
    #[cfg(feature = "native")]
    pub(crate) maker: Option<MachineCodeMaker>,
    /// Makes machine code on a thread of its own: for [`Tier::Auto`].
    #[cfg(feature = "native")]
    pub(crate) helper: Option<MachineCodeHelper>,
    /// The open orders, by number.
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
    /// Counters of hot codes.
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

/// Counters of hot codes. A code that has not run for long may be evicted for another, so the table takes
/// little memory, and finding a code in it little time.
#[cfg(feature = "native")]
#[derive(Default)]
pub(crate) struct Heat {
    /// At the places that the words of the codes give.
    codes: Vec<WarmCode>,
}

#[cfg(feature = "native")]
impl Heat {
    /// Number of places: a power of two.
    const PLACES: usize = 1024;

    /// Returns what was met of a code, given by its value's word.
    pub(crate) fn of(&mut self, code: u64) -> &mut WarmCode {
        if self.codes.is_empty() {
            self.codes.resize_with(Heat::PLACES, WarmCode::default);
        }
        let hash = code.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (u64::BITS - Heat::PLACES.ilog2());
        let warm = &mut self.codes[hash as usize];
        if warm.code != code {
            *warm = WarmCode { code, ..WarmCode::default() };
        }
        warm
    }

    /// Forgets a code.
    pub(crate) fn forget(&mut self, code: u64) {
        self.forget_all(|known| known == code);
    }

    /// Forgets the codes that `is_forgotten` says.
    pub(crate) fn forget_all(&mut self, is_forgotten: impl Fn(u64) -> bool) {
        let known = self.codes.iter_mut().filter(|warm| warm.code != 0);
        known.filter(|warm| is_forgotten(warm.code)).for_each(|warm| *warm = WarmCode::default());
    }
}

/// How many ticks a code has taken, as far as was met, and what its registers held.
#[cfg(feature = "native")]
#[derive(Default)]
pub(crate) struct WarmCode {
    /// The word of the code; 0 for none.
    code: u64,
    ticks: u32,
    registers: Vec<SeenRegister>,
}

#[cfg(feature = "native")]
impl WarmCode {
    /// Adds ticks; returns whether they reach `hot` by these.
    pub(crate) fn add(&mut self, ticks: u32, hot: u32) -> bool {
        let before = self.ticks;
        self.ticks = before.saturating_add(ticks);
        before < hot && self.ticks >= hot
    }

    /// Notes what the first registers hold.
    pub(crate) fn see(&mut self, registers: &[Value]) {
        if self.registers.len() < registers.len() {
            self.registers.resize(registers.len(), SeenRegister::default());
        }
        for (seen, &value) in self.registers.iter_mut().zip(registers) {
            let times = match Known::of(value) {
                Known::Double => &mut seen.doubles,
                Known::Fixnum => &mut seen.fixnums,
                _ if value.is_nil() => &mut seen.nils,
                _ => &mut seen.others,
            };
            *times = times.saturating_add(1);
        }
    }

    /// Returns what the registers are guessed to hold, and of one more: some guess, even if it is of nothing,
    /// lets doubles be told from other values.
    pub(crate) fn guesses(&self) -> Vec<Known> {
        self.registers.iter().chain([&SeenRegister::default()]).map(SeenRegister::guess).collect()
    }
}

/// How often a register was seen to hold a value of a kind.
#[cfg(feature = "native")]
#[derive(Clone, Copy, Default)]
struct SeenRegister {
    doubles: u16,
    fixnums: u16,
    nils: u16,
    others: u16,
}

#[cfg(feature = "native")]
impl SeenRegister {
    /// Returns what it held mostly. A register that has not been written yet holds `nil`, which does not tell
    /// against a double.
    fn guess(&self) -> Known {
        let [doubles, fixnums, nils, others] =
            [self.doubles, self.fixnums, self.nils, self.others].map(u32::from);
        if doubles > fixnums + others {
            Known::Double
        } else if fixnums > doubles + nils + others {
            Known::Fixnum
        } else {
            Known::Nothing
        }
    }
}

/// Machine code that calls may enter.
#[cfg(feature = "native")]
pub(crate) struct InstalledCode {
    /// The target of the code's entry word, which does not move.
    pub(crate) stub: Box<EntryStub>,
    /// The machine code.
    pub(crate) made: MachineCode,
    /// The order that it was made for.
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

#[cfg(not(feature = "native"))]
impl CompiledFunctions {
    /// Lets calls of all installed code lead to its first instruction, or to the machine code again.
    pub(crate) fn lead_to_interpreter(&mut self, _leads: bool) {}
}

#[cfg(all(test, feature = "native"))]
mod tests {
    use super::*;

    fn guesses(frames: &[[Value; 4]]) -> Vec<Known> {
        let mut warm = WarmCode::default();
        frames.iter().for_each(|registers| warm.see(registers));
        warm.guesses()
    }

    #[test]
    fn a_code_is_hot_once() {
        let mut heat = Heat::default();
        let reached: Vec<bool> = [40, 50, 30, 500].map(|ticks| heat.of(8).add(ticks, 100)).to_vec();
        assert_eq!(reached, [false, false, true, false]);
        assert!(!heat.of(16).add(99, 100));
        heat.forget_all(|code| code == 8);
        assert!(heat.of(8).add(100, 100), "it was forgotten");
        assert!(heat.of(16).add(1, 100), "it was not forgotten");
    }

    #[test]
    fn a_register_is_guessed_to_hold_what_it_held_mostly() {
        let double = Value::double(0.5).unwrap();
        let (nil, one) = (Value::NIL, Value::small(1));
        let seen = guesses(&[[nil, one, double, nil], [double, one, one, one], [nil, nil, nil, nil]]);
        assert_eq!(
            seen,
            [Known::Double, Known::Fixnum, Known::Nothing, Known::Nothing, Known::Nothing],
            "a register without a value tells against a fixnum, and not against a double"
        );
        assert_eq!(guesses(&[]), [Known::Nothing]);
    }
}
