//! The layouts of heap objects, fixed to the byte: the interpreter, and later compiled code, reach into them
//! directly.
//!
//! ```text
//! cons      | car | cdr |                                          no header
//! object    | kind u8 | flags u8 | aux u16 | len u32 | elements... |
//! ```
//!
//! Guarantees: an object is one of three sorts, told by its kind: all slots are values ([`Kind::is_record`]),
//! none is ([`Kind::is_raw`]), or it is [`Kind::Code`]. `len` counts the elements after the header in the
//! unit of the kind (values, limbs, characters, words, bytes), so kind and `len` alone give the size, and
//! neither ever changes, but for the kind of an unfinished vector or string, once: into that of a finished
//! one. A header carries nothing of the collector.
//!
//! Not here: making objects (`object`), checked access (`access`), tracing (`mark`).

use crate::value::Value;

/// Unit of allocation and of the collector's metadata, in bytes. Every object starts on a multiple of it.
pub const GRANULE: usize = 16;

/// Greatest number of elements of one object, whatever the unit: 2^31.
pub const MAX_LENGTH: usize = 1 << 31;

/// What an object is.
///
/// The numbers carry meaning: below 0x20 all slots are values, below 0x1F anyone may read them, from 0x40 no
/// slot is a value; the high half gives the size of an element. They may change with any version; nothing
/// stores them outside of a running heap.
#[repr(u8)]
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash)]
pub enum Kind {
    /// A symbol: [`Symbol`].
    Symbol = 0x01,
    /// A function with its captured variables: [`Function`].
    Function = 0x02,
    /// A variable that is captured and assigned: [`Boxed`].
    Box = 0x03,
    /// A one-dimensional array of any values without a fill pointer: [`Vector`].
    SimpleVector = 0x04,
    /// Any other array, over a simple vector or string: [`Array`].
    Array = 0x05,
    /// A ratio in lowest terms: numerator, denominator.
    Ratio = 0x06,
    /// An instance of a structure, condition types included: class, then the slots. [`Structure`].
    Structure = 0x08,
    /// The description of a structure or condition type.
    Class = 0x09,
    /// An identity that no program can forge, for blocks, tagbodies and the like; one value rides along.
    Tag = 0x0A,
    /// A package.
    Package = 0x0B,
    /// A stream.
    Stream = 0x0C,
    /// The state of a random number generator.
    RandomState = 0x0D,
    /// The collected part of a task.
    Task = 0x0E,
    /// An event.
    Event = 0x0F,
    /// One wait of a task.
    Wait = 0x10,
    /// A record of the VM itself that needs no kind of its own; `aux` tells which.
    Record = 0x11,
    /// A hash table: [`HashTable`]; `aux` is its test.
    HashTable = 0x1F,
    /// Compiled code with its constants: [`Code`].
    Code = 0x20,
    /// A double outside the window of [`Value::double`]: [`Float`].
    Float = 0x40,
    /// An integer outside the fixnums: limbs of 64 bits, least first, no leading zero; the sign is in
    /// `flags`.
    Bignum = 0x41,
    /// Words of 64 bits, for indexes.
    Words64 = 0x42,
    /// A large simple vector to be, not all of which has been filled: nobody reads it until then.
    UnfinishedVector = 0x43,
    /// A string: code points of 32 bits.
    String = 0x50,
    /// Words of 32 bits, for indexes.
    Words32 = 0x51,
    /// A large string to be, as [`Kind::UnfinishedVector`].
    UnfinishedString = 0x52,
    /// Bytes.
    Bytes = 0x60,
}

/// All kinds, for tests and tables.
pub const KINDS: [Kind; 26] = [
    Kind::Symbol,
    Kind::Function,
    Kind::Box,
    Kind::SimpleVector,
    Kind::Array,
    Kind::Ratio,
    Kind::HashTable,
    Kind::Structure,
    Kind::Class,
    Kind::Tag,
    Kind::Package,
    Kind::Stream,
    Kind::RandomState,
    Kind::Task,
    Kind::Event,
    Kind::Wait,
    Kind::Record,
    Kind::Code,
    Kind::Float,
    Kind::Bignum,
    Kind::Words64,
    Kind::UnfinishedVector,
    Kind::String,
    Kind::Words32,
    Kind::UnfinishedString,
    Kind::Bytes,
];

impl Kind {
    /// Whether all slots are values.
    #[inline(always)]
    pub const fn is_record(self) -> bool {
        (self as u8) < 0x20
    }

    /// Whether all slots are values that anyone may read. Those of a hash table are for its own functions,
    /// which rely on what the storage behind them holds.
    #[inline(always)]
    pub const fn is_open_record(self) -> bool {
        (self as u8) < Kind::HashTable as u8
    }

    /// Whether no slot is a value, so that the collector need not look inside.
    #[inline(always)]
    pub const fn is_raw(self) -> bool {
        self as u8 & 0x40 != 0
    }

    /// Binary logarithm of the size of an element in bytes.
    #[inline(always)]
    pub const fn element_shift(self) -> u32 {
        const SHIFTS: [u8; 8] = [3, 3, 3, 3, 3, 2, 0, 0];
        SHIFTS[(self as u8 >> 4) as usize & 7] as u32
    }

    /// Bytes of an object with `len` elements, header included, rounded up to granules.
    #[inline(always)]
    pub const fn size(self, len: usize) -> usize {
        (size_of::<Header>() + (len << self.element_shift()) + GRANULE - 1) & !(GRANULE - 1)
    }
}

/// What every object but a cons starts with.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Header {
    /// What the object is.
    pub kind: Kind,
    /// Bits that the kind gives a meaning to.
    pub flags: u8,
    /// A small number that the kind gives a meaning to.
    pub aux: u16,
    /// Number of elements, in the unit of the kind. Never changes.
    pub len: u32,
}

const _: () = assert!(size_of::<Header>() == 8);

impl Header {
    /// Bytes of the object, rounded up to granules.
    #[inline(always)]
    pub const fn size(&self) -> usize {
        self.kind.size(self.len as usize)
    }
}

/// A pair.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Cons {
    /// First half.
    pub car: Value,
    /// Second half.
    pub cdr: Value,
}

const _: () = assert!(size_of::<Cons>() == GRANULE);

/// A symbol. `name` is always a String and `function` always a Function; the heap sees to both.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Symbol {
    /// Kind, length 6, and the flags below.
    pub header: Header,
    /// Its name, a String.
    pub name: Value,
    /// Its home package, or `nil`.
    pub package: Value,
    /// Its value outside of all bindings, or [`Value::UNBOUND`].
    pub value: Value,
    /// Its function; a stub that fails when it has none, so that calling needs no test.
    pub function: Value,
    /// Its macro function, or `nil`.
    pub macro_function: Value,
    /// Its property list.
    pub plist: Value,
}

impl Symbol {
    /// Number of slots.
    pub const LEN: usize = 6;
    /// Flag: proclaimed special.
    pub const SPECIAL: u8 = 1;
    /// Flag: a constant, not to be set or bound.
    pub const CONSTANT: u8 = 2;
    /// Flag: some task has bound it dynamically; while clear, its value is the value in every task.
    pub const EVER_BOUND: u8 = 4;
    /// Flag: belongs to the system and may not be redefined.
    pub const LOCKED: u8 = 8;
    /// Flag: a keyword.
    pub const KEYWORD: u8 = 16;
}

const _: () = assert!(size_of::<Symbol>() == 8 + 8 * Symbol::LEN);

/// A function: code and the variables it has captured. `code` is always a Code object; the heap sees to it.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Function {
    /// Kind; length 1 + number of captures.
    pub header: Header,
    /// Its code, a Code object.
    pub code: Value,
    /// The captured values or boxes, `header.len - 1` of them.
    pub captures: [Value; 0],
}

const _: () = assert!(size_of::<Function>() == 16);

/// Compiled code.
///
/// Only `name`, `debug`, `owner` and the constants are traced. The words may be rewritten in place
/// (quickening, inline caches): they must not hold addresses of objects.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Code {
    /// Kind; length in units of 8 bytes of all that follows the header.
    pub header: Header,
    /// What names it in a backtrace.
    pub name: Value,
    /// Debug information: a value, or `nil`.
    pub debug: Value,
    /// What it belongs to: a value, or `nil`.
    pub owner: Value,
    /// Where execution begins; normally the first of the words.
    pub entry: *const u32,
    /// The exact number of arguments, or [`Code::ANY_ARITY`] when a call has to go the slow way.
    pub arity: u32,
    /// Number of registers of a frame.
    pub nregs: u32,
    /// Number of constants.
    pub nconsts: u32,
    /// Number of instruction words.
    pub nwords: u32,
    /// For counters and compiled code.
    pub spare: [u64; 2],
    /// The constants, `nconsts` of them, at a fixed offset; the words follow.
    pub constants: [Value; 0],
}

impl Code {
    /// `arity` of code that takes optional, rest or keyword arguments.
    pub const ANY_ARITY: u32 = u32::MAX;
    /// Offset of the first constant from the start of the object, in bytes.
    pub const CONSTANTS_OFFSET: usize = std::mem::offset_of!(Code, constants);

    /// `header.len` for this many constants and words.
    pub(crate) const fn len(nconsts: usize, nwords: usize) -> usize {
        (Self::CONSTANTS_OFFSET - size_of::<Header>()) / 8 + nconsts + nwords.div_ceil(2)
    }

    /// Offset of the first word from the start of the object, in bytes.
    #[inline(always)]
    pub const fn words_offset(&self) -> usize {
        Self::CONSTANTS_OFFSET + 8 * self.nconsts as usize
    }
}

const _: () = assert!(size_of::<Code>() == 72 && Code::CONSTANTS_OFFSET == 72);

/// A variable that is captured and assigned.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Boxed {
    /// Kind, length 1.
    pub header: Header,
    /// The variable.
    pub value: Value,
}

const _: () = assert!(size_of::<Boxed>() == GRANULE);

/// A simple vector, and the view of any record as its slots.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Vector {
    /// Kind and number of elements.
    pub header: Header,
    /// The elements, `header.len` of them.
    pub elements: [Value; 0],
}

/// A string.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Str {
    /// Kind and number of characters.
    pub header: Header,
    /// The code points, `header.len` of them.
    pub characters: [u32; 0],
}

/// An array with a fill pointer, or adjustable, or not of one dimension. `aux` is its rank.
///
/// `data` is always a SimpleVector, a String or Bytes; the heap sees to it.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Array {
    /// Kind, flags below, rank; length 2 + rank.
    pub header: Header,
    /// The elements in row-major order.
    pub data: Value,
    /// The fill pointer, a fixnum, or `nil`.
    pub fill: Value,
    /// The dimensions, fixnums, `header.aux` of them.
    pub dimensions: [Value; 0],
}

impl Array {
    /// Flag: has a fill pointer.
    pub const HAS_FILL_POINTER: u8 = 1;
    /// Flag: made to be adjustable.
    pub const ADJUSTABLE: u8 = 2;
}

const _: () = assert!(size_of::<Array>() == 24);

/// A boxed double.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Float {
    /// Kind, length 1.
    pub header: Header,
    /// The number.
    pub value: f64,
}

const _: () = assert!(size_of::<Float>() == GRANULE);

/// A big integer.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Bignum {
    /// Kind, sign in the flags, and number of limbs.
    pub header: Header,
    /// The magnitude, least limb first, `header.len` of them.
    pub limbs: [u64; 0],
}

impl Bignum {
    /// Flag: below zero.
    pub const NEGATIVE: u8 = 1;
}

/// A hash table. `used` and `room` are counts, `entries` and `heads` directories of segments; the heap sees
/// to that (`table`).
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct HashTable {
    /// Kind, length 9, and which test in `aux`.
    pub header: Header,
    /// Number of keys.
    pub count: Value,
    /// Number of entries that were ever in use.
    pub used: Value,
    /// The entry freed last, one too high.
    pub free: Value,
    /// Entries for which there is room.
    pub room: Value,
    /// Directory of the segments of entries.
    pub entries: Value,
    /// Directory of the segments of heads.
    pub heads: Value,
    /// The test, a function of the program, or `nil`.
    pub test: Value,
    /// The hash function of the program, or `nil`.
    pub hash: Value,
    /// Changes whenever a key comes or goes.
    pub serial: Value,
}

const _: () = assert!(size_of::<HashTable>() == 80);

/// An instance of a structure.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Structure {
    /// Kind; length 1 + number of slots.
    pub header: Header,
    /// Its class, a Class object; the heap sees to it, and that it never changes.
    pub class: Value,
    /// The slots, `header.len - 1` of them.
    pub slots: [Value; 0],
}

impl Structure {
    /// Flag of an instance of a class of `defclass`, which may get another class.
    pub const INSTANCE: u8 = 1;
}

const _: () = assert!(size_of::<Structure>() == 16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_from_kind_and_length() {
        let table = [
            (Kind::Box, 1, 16),
            (Kind::Float, 1, 16),
            (Kind::Symbol, Symbol::LEN, 64),
            (Kind::SimpleVector, 0, 16),
            (Kind::SimpleVector, 1, 16),
            (Kind::SimpleVector, 2, 32),
            (Kind::String, 2, 16),
            (Kind::String, 3, 32),
            (Kind::Bytes, 8, 16),
            (Kind::Bytes, 9, 32),
            (Kind::Bignum, 2, 32),
            (Kind::Words32, 2, 16),
            (Kind::Words64, 2, 32),
            (Kind::HashTable, 9, 80),
            (Kind::Code, Code::len(0, 0), 80),
            (Kind::Code, Code::len(2, 3), 112),
        ];
        for (kind, len, size) in table {
            assert_eq!(kind.size(len), size, "{kind:?} of {len}");
        }
    }

    #[test]
    fn every_kind_is_of_one_sort() {
        for kind in KINDS {
            let sorts = [kind.is_record(), kind.is_raw(), kind == Kind::Code];
            assert_eq!(sorts.iter().filter(|&&is| is).count(), 1, "{kind:?}");
            assert!(!kind.is_record() || kind.element_shift() == 3);
        }
    }
}
