//! Layouts of heap objects, fixed to the byte: the interpreter, and later compiled code, reach into them
//! directly.
//!
//! ```text
//! cons      | car | cdr |                                          no header
//! object    | kind u8 | flags u8 | aux u16 | len u32 | elements... |
//! ```
//!
//! Guarantees: there are three sorts of objects, told by the kind: all slots are values
//! ([`Kind::is_record`]), none is ([`Kind::is_raw`]), or it is [`Kind::Code`]. `len` counts the elements
//! after the header in the unit of the kind (values, limbs, characters, words, bytes), so kind and `len`
//! alone give the size. Neither ever changes, with one exception: the kind of an unfinished vector or string
//! becomes that of a finished one. A header carries nothing of the collector.
//!
//! Not here: creating objects (`object`), checked access (`access`), tracing (`mark`).

use crate::value::Value;

/// Unit of allocation and of the collector's metadata, in bytes. Every object starts on a multiple of it.
pub const GRANULE: usize = 16;

/// Greatest number of elements of one object, whatever the unit: 2^31.
pub const MAX_LENGTH: usize = 1 << 31;

/// Kind of an object.
///
/// The numbers have a meaning: below 0x20 all slots are values, below 0x1F all code may read them, from 0x40
/// on no slot is a value; the high half gives the size of an element. They may change with any version;
/// nothing stores them outside of a running heap.
#[repr(u8)]
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash)]
pub enum Kind {
    /// A symbol: [`SymbolObject`].
    Symbol = 0x01,
    /// A function with its captured variables: [`FunctionObject`].
    Function = 0x02,
    /// A variable that is captured and assigned: [`Boxed`].
    Box = 0x03,
    /// A one-dimensional array of any values without a fill pointer: [`Vector`].
    SimpleVector = 0x04,
    /// Any other array, over a simple vector, a string or bytes, or over a part of another array: [`Array`].
    Array = 0x05,
    /// A ratio in lowest terms: numerator, denominator.
    Ratio = 0x06,
    /// A complex number: real part, imaginary part; two rationals or two floats.
    Complex = 0x07,
    /// An instance of a structure or condition type: class, then the slots. [`StructureObject`].
    Structure = 0x08,
    /// The description of a structure or condition type.
    Class = 0x09,
    /// An identity that no program can forge, for blocks, tagbodies and the like. It carries one value.
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
    /// Compiled code with its constants: [`CodeObject`].
    Code = 0x20,
    /// A double outside the window of [`Value::double`]: [`Float`].
    Float = 0x40,
    /// An integer outside the fixnums: limbs of 64 bits, least first, no leading zero; the sign is in
    /// `flags`.
    Bignum = 0x41,
    /// Words of 64 bits, for indexes.
    Words64 = 0x42,
    /// A large simple vector under construction. Its elements are not read before all are filled.
    UnfinishedVector = 0x43,
    /// A string: code points of 32 bits.
    String = 0x50,
    /// Words of 32 bits, for indexes.
    Words32 = 0x51,
    /// A large string under construction, like [`Kind::UnfinishedVector`].
    UnfinishedString = 0x52,
    /// Bytes, or bits with one byte for each: [`Bytes`].
    Bytes = 0x60,
}

/// All kinds, for tests and tables.
pub const KINDS: [Kind; 27] = [
    Kind::Symbol,
    Kind::Function,
    Kind::Box,
    Kind::SimpleVector,
    Kind::Array,
    Kind::Ratio,
    Kind::Complex,
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
    /// Returns whether all slots are values.
    #[inline(always)]
    pub const fn is_record(self) -> bool {
        (self as u8) < 0x20
    }

    /// Returns whether all slots are values that all code may read. Those of a hash table are for its own
    /// functions, which rely on the content of the storage behind them.
    #[inline(always)]
    pub const fn is_open_record(self) -> bool {
        (self as u8) < Kind::HashTable as u8
    }

    /// Returns whether these objects are numbers, which are `eql` by their values.
    #[inline(always)]
    pub const fn is_boxed_number(self) -> bool {
        matches!(self, Kind::Ratio | Kind::Complex | Kind::Float | Kind::Bignum)
    }

    /// Returns whether no slot is a value, so that the collector need not look inside.
    #[inline(always)]
    pub const fn is_raw(self) -> bool {
        self as u8 & 0x40 != 0
    }

    /// Returns the binary logarithm of the size of an element in bytes.
    #[inline(always)]
    pub const fn element_shift(self) -> u32 {
        const SHIFTS: [u8; 8] = [3, 3, 3, 3, 3, 2, 0, 0];
        SHIFTS[(self as u8 >> 4) as usize & 7] as u32
    }

    /// Returns the bytes of an object with `len` elements, header included, rounded up to granules.
    #[inline(always)]
    pub const fn size(self, len: usize) -> usize {
        (size_of::<Header>() + (len << self.element_shift()) + GRANULE - 1) & !(GRANULE - 1)
    }
}

/// Header of every object but a cons.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Header {
    /// Kind of the object.
    pub kind: Kind,
    /// Flags, whose meaning depends on the kind.
    pub flags: u8,
    /// Small number, whose meaning depends on the kind.
    pub aux: u16,
    /// Number of elements, in the unit of the kind. Never changes.
    pub len: u32,
}

const _: () = assert!(size_of::<Header>() == 8);

impl Header {
    /// Returns the bytes of the object, rounded up to granules.
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

/// A symbol. The heap guarantees that `name` is a String and `function` a Function.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct SymbolObject {
    /// Kind, length 6, and the flags below.
    pub header: Header,
    /// Name, a String.
    pub name: Value,
    /// Home package, or `nil`.
    pub package: Value,
    /// Value outside of all bindings, or [`Value::UNBOUND`].
    pub value: Value,
    /// Function. A symbol without one has a stub that fails, so that calling needs no test.
    pub function: Value,
    /// Macro function, or `nil`.
    pub macro_function: Value,
    /// Property list.
    pub plist: Value,
}

impl SymbolObject {
    /// Number of slots.
    pub const LEN: usize = 6;
    /// Flag: proclaimed special.
    pub const SPECIAL: u8 = 1;
    /// Flag: a constant, not to be set or bound.
    pub const CONSTANT: u8 = 2;
    /// Flag: some task has bound it dynamically. While the flag is clear, every task sees `value`.
    pub const EVER_BOUND: u8 = 4;
    /// Flag: belongs to the system and may not be redefined.
    pub const LOCKED: u8 = 8;
    /// Flag: a keyword.
    pub const KEYWORD: u8 = 16;
}

const _: () = assert!(size_of::<SymbolObject>() == 8 + 8 * SymbolObject::LEN);

/// A function: code and captured variables. The heap guarantees that `code` is a Code.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct FunctionObject {
    /// Kind; length 1 + number of captures.
    pub header: Header,
    /// Code, a Code object.
    pub code: Value,
    /// Captured values or boxes, `header.len - 1` of them.
    pub captures: [Value; 0],
}

const _: () = assert!(size_of::<FunctionObject>() == 16);

/// Compiled code.
///
/// Only `name`, `debug`, `owner` and the constants are traced. The words may be rewritten in place
/// (quickening, inline caches): they must not hold addresses of objects.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct CodeObject {
    /// Kind; length in units of 8 bytes of all that follows the header.
    pub header: Header,
    /// Name in a backtrace.
    pub name: Value,
    /// Debug information: a value, or `nil`.
    pub debug: Value,
    /// Owner, such as the module that the code belongs to: a value, or `nil`.
    pub owner: Value,
    /// Address at which execution begins; normally that of the first word.
    pub entry: *const u32,
    /// Exact number of arguments, or [`CodeObject::ANY_ARITY`] if a call has to take the slow path.
    pub arity: u32,
    /// Number of registers of a frame.
    pub nregs: u32,
    /// Number of constants.
    pub nconsts: u32,
    /// Number of instruction words.
    pub nwords: u32,
    /// For the owner's use: the loader keeps the packed shape and the number of captures here.
    pub spare: [u64; 2],
    /// Constants, `nconsts` of them, at a fixed offset; the words follow.
    pub constants: [Value; 0],
}

impl CodeObject {
    /// Value of `arity` for code that takes optional, rest or keyword arguments.
    pub const ANY_ARITY: u32 = u32::MAX;
    /// Offset of the first constant from the start of the object, in bytes.
    pub const CONSTANTS_OFFSET: usize = std::mem::offset_of!(CodeObject, constants);

    /// Returns `header.len` for this many constants and words.
    pub(crate) const fn len(nconsts: usize, nwords: usize) -> usize {
        (Self::CONSTANTS_OFFSET - size_of::<Header>()) / 8 + nconsts + nwords.div_ceil(2)
    }

    /// Returns the offset of the first word from the start of the object, in bytes.
    #[inline(always)]
    pub const fn words_offset(&self) -> usize {
        Self::CONSTANTS_OFFSET + 8 * self.nconsts as usize
    }
}

const _: () = assert!(size_of::<CodeObject>() == 72 && CodeObject::CONSTANTS_OFFSET == 72);

/// A variable that is captured and assigned.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Boxed {
    /// Kind, length 1.
    pub header: Header,
    /// Value of the variable.
    pub value: Value,
}

const _: () = assert!(size_of::<Boxed>() == GRANULE);

/// A simple vector, and the view of any record as its slots.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Vector {
    /// Kind and number of elements.
    pub header: Header,
    /// Elements, `header.len` of them.
    pub elements: [Value; 0],
}

/// A string.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Str {
    /// Kind and number of characters.
    pub header: Header,
    /// Code points, `header.len` of them.
    pub characters: [u32; 0],
}

/// An array that has a fill pointer, or is adjustable, or is not of one dimension. `aux` is its rank.
///
/// The heap guarantees that `data` is a SimpleVector, a String, Bytes or an Array.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Array {
    /// Kind, flags below, rank; length 3 + rank.
    pub header: Header,
    /// Object with the elements, in row-major order; for a displaced array, another array.
    pub data: Value,
    /// Fill pointer, a fixnum, or `nil`.
    pub fill: Value,
    /// For a displaced array, the index of its first element in the other array, a fixnum; otherwise `nil`.
    pub offset: Value,
    /// Dimensions, fixnums, `header.aux` of them.
    pub dimensions: [Value; 0],
}

impl Array {
    /// Flag: has a fill pointer.
    pub const HAS_FILL_POINTER: u8 = 1;
    /// Flag: created as adjustable.
    pub const ADJUSTABLE: u8 = 2;
}

const _: () = assert!(size_of::<Array>() == 32);

/// A row of bytes, or of bits.
#[derive(Copy, Clone, Debug)]
pub struct Bytes;

impl Bytes {
    /// Flag: every byte is 0 or 1.
    pub const BITS: u8 = 1;
}

/// A boxed double.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Float {
    /// Kind, length 1.
    pub header: Header,
    /// Value of the number.
    pub value: f64,
}

const _: () = assert!(size_of::<Float>() == GRANULE);

/// A big integer.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct Bignum {
    /// Kind, sign in the flags, and number of limbs.
    pub header: Header,
    /// Magnitude, least limb first, `header.len` of them.
    pub limbs: [u64; 0],
}

impl Bignum {
    /// Flag: below zero.
    pub const NEGATIVE: u8 = 1;
}

/// A hash table. The heap guarantees that `used` and `room` are counts, `entries` and `heads` directories of
/// segments (`table`).
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct HashTable {
    /// Kind, length 9, and the number of the test in `aux`.
    pub header: Header,
    /// Number of keys.
    pub count: Value,
    /// Number of entries that were ever in use.
    pub used: Value,
    /// Number of the entry freed last, plus one; 0 if none is free.
    pub free: Value,
    /// Number of entries for which there is room.
    pub room: Value,
    /// Directory of the segments of entries.
    pub entries: Value,
    /// Directory of the segments of heads.
    pub heads: Value,
    /// Test, a function of the program, or `nil`.
    pub test: Value,
    /// Hash function of the program, or `nil`.
    pub hash: Value,
    /// Number that changes whenever a key comes or goes.
    pub serial: Value,
}

const _: () = assert!(size_of::<HashTable>() == 80);

impl HashTable {
    /// Binary logarithm of the number of entries of a segment.
    pub const SEGMENT_SHIFT: u32 = if cfg!(miri) { 4 } else { 12 };
    /// Number of values of an entry in its segment: key, value, link.
    pub const ENTRY: usize = 3;
    /// Number of chains for each entry. With one, a search for a missing key would meet one entry on the
    /// average; with two it meets half of one.
    pub const PER_ENTRY: usize = 2;
    /// Greatest number of entries of a table; such a table takes 10 GB.
    pub const MOST: usize = (1 << 28) - (1 << HashTable::SEGMENT_SHIFT);
    /// Number of bits of a link for the number of an entry. Above them a link has the hash of the key, below
    /// them one bit.
    pub const NUMBER_BITS: u32 = HashTable::MOST.ilog2() + 1;
    /// Greatest number of a test by which an integer is the same as itself alone: `eq`, `eql`, `equal`.
    pub const BY_VALUE: u16 = 2;
}

/// An instance of a structure.
#[repr(C)]
#[derive(Copy, Clone, Debug)]
pub struct StructureObject {
    /// Kind; length 1 + number of slots.
    pub header: Header,
    /// Class, a Class object. The heap guarantees that; it changes for instances and moved structures only.
    pub class: Value,
    /// Slots, `header.len - 1` of them.
    pub slots: [Value; 0],
}

impl StructureObject {
    /// Flag of an instance of a class of `defclass`, which may get another class.
    pub const INSTANCE: u8 = 1;
    /// Flag of a structure that `equal` compares by its slots, as a pathname.
    pub const VALUE: u8 = 2;
    /// Flag of a structure whose slots are in the one that its first slot refers to; no code has its class.
    pub const MOVED: u8 = 4;
}

const _: () = assert!(size_of::<StructureObject>() == 16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_from_kind_and_length() {
        let table = [
            (Kind::Box, 1, 16),
            (Kind::Float, 1, 16),
            (Kind::Symbol, SymbolObject::LEN, 64),
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
            (Kind::Code, CodeObject::len(0, 0), 80),
            (Kind::Code, CodeObject::len(2, 3), 112),
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
