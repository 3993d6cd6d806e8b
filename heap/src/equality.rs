//! Equality of objects: `eq`, `eql`, `equal`, `equalp`, and hashes that agree with them.
//!
//! Guarantees: the native stack does not grow with the depth of objects. A comparison stops when it has used
//! up the work it was given, and says so; a hash looks at a bounded part of an object. Equal objects have
//! equal hashes, and the hashes of a run are the same in every run of the same program.
//! Not here: tests that are functions of the program, which ESL calls; `equalp` of two hash tables, which ESL
//! compares.

use smallvec::{SmallVec, smallvec};

use crate::array::{ArrayElements, all_elements, vector_elements};
use crate::character;
use crate::heap::{Heap, Kind};
use crate::number;
use crate::value::Value;

/// A test that the machine knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyTest {
    /// The same object.
    Eq,
    /// The same object, or numbers of one type and value.
    Eql,
    /// The same structure of pairs and strings.
    Equal,
    /// The same structure; neither the case of letters nor the type of numbers matters.
    Equalp,
}

/// Returns whether `a` and `b` are equal by `test`, and takes the work done from `work`. `None` if there is
/// more work than that, or only ESL can tell.
#[inline]
pub fn same(heap: &Heap, test: KeyTest, a: Value, b: Value, work: &mut usize) -> Option<bool> {
    if a == b {
        return Some(true);
    }
    match test {
        KeyTest::Eq => Some(false),
        KeyTest::Eql => Some(number::eql(heap, a, b)),
        // A value without an address has no inside.
        KeyTest::Equal if !(a.is_address() && b.is_address()) => Some(false),
        _ => walk(heap, test == KeyTest::Equalp, a, b, work),
    }
}

/// Compares with an explicit stack.
fn walk(heap: &Heap, loosely: bool, a: Value, b: Value, work: &mut usize) -> Option<bool> {
    let mut open: SmallVec<[(Value, Value); 16]> = smallvec![(a, b)];
    while let Some((a, b)) = open.pop() {
        *work = work.checked_sub(number_work(heap, a))?;
        if number::eql(heap, a, b) {
            continue;
        }
        *work = work.checked_sub(1)?;
        if let (Some(left), Some(right)) = (heap.as_cons(a), heap.as_cons(b)) {
            open.push((left.cdr, right.cdr));
            open.push((left.car, right.car));
            continue;
        }
        let is_same = if loosely {
            loosely_same(heap, a, b, &mut open, work)?
        } else if let (Some(left), Some(right)) = (heap.value_slots(a), heap.value_slots(b)) {
            *work = work.checked_sub(left.len())?;
            open.extend(left.iter().copied().zip(right.iter().copied()));
            heap.structure_class(a) == heap.structure_class(b)
        } else {
            same_rows(heap, a, b, work)?
        };
        if !is_same {
            return Some(false);
        }
    }
    Some(true)
}

/// Returns the characters of a string, up to its fill pointer.
pub fn characters_of(heap: &Heap, v: Value) -> Option<&[u32]> {
    if let Some(characters) = heap.string(v) {
        return Some(characters);
    }
    match vector_elements(heap, v)? {
        ArrayElements::Characters(characters) => Some(characters),
        _ => None,
    }
}

/// Compares two strings, or two bit vectors; other objects differ.
fn same_rows(heap: &Heap, a: Value, b: Value, work: &mut usize) -> Option<bool> {
    if let (Some(a), Some(b)) = (characters_of(heap, a), characters_of(heap, b)) {
        if a.len() != b.len() {
            return Some(false);
        }
        *work = work.checked_sub(a.len() / 64)?;
        return Some(a == b);
    }
    let (Some(a), Some(b)) = (bits_of(heap, a), bits_of(heap, b)) else { return Some(false) };
    if a.len() != b.len() {
        return Some(false);
    }
    *work = work.checked_sub(a.len() / 256)?;
    Some(a == b)
}

/// Returns the bits of a bit vector, up to its fill pointer.
pub fn bits_of(heap: &Heap, v: Value) -> Option<&[u8]> {
    match vector_elements(heap, v)? {
        ArrayElements::Bits(bits) => Some(bits),
        _ => None,
    }
}

/// Compares one pair of objects by `equalp`; the pairs of their parts go to `open`.
fn loosely_same(
    heap: &Heap,
    a: Value,
    b: Value,
    open: &mut SmallVec<[(Value, Value); 16]>,
    work: &mut usize,
) -> Option<bool> {
    if let (Some(a), Some(b)) = (a.as_character(), b.as_character()) {
        return Some(character::fold(a) == character::fold(b));
    }
    if number::is_number(heap, a) || number::is_number(heap, b) {
        return Some(number::same_value(heap, a, b));
    }
    match (heap.kind(a), heap.kind(b)) {
        (Some(Kind::Structure), Some(Kind::Structure)) if heap.value_slots(a).is_some() => {
            // Case matters in names of files.
            walk(heap, false, a, b, work)
        }
        (Some(Kind::Structure), Some(Kind::Structure)) => {
            // Instances of DEFCLASS are the same only if they are one object.
            let class = |v| heap.structure_class(heap.structure_whole(v));
            if class(a) != class(b) || heap.is_instance(a) {
                return Some(false);
            }
            let (left, right) = (heap.structure_slots(a)?, heap.structure_slots(b)?);
            *work = work.checked_sub(left.len())?;
            open.extend(left.iter().copied().zip(right.iter().copied()));
            Some(true)
        }
        (Some(Kind::HashTable), Some(Kind::HashTable)) => None,
        _ => same_arrays(heap, a, b, open, work),
    }
}

fn same_arrays(
    heap: &Heap,
    a: Value,
    b: Value,
    open: &mut SmallVec<[(Value, Value); 16]>,
    work: &mut usize,
) -> Option<bool> {
    let vectors = vector_elements(heap, a).zip(vector_elements(heap, b));
    let pair = vectors.or_else(|| {
        let same_shape = heap.array_dimensions(a)? == heap.array_dimensions(b)?;
        if same_shape { all_elements(heap, a).zip(all_elements(heap, b)) } else { None }
    });
    let Some((left, right)) = pair else { return Some(false) };
    if left.len() != right.len() {
        return Some(false);
    }
    if let (ArrayElements::Characters(left), ArrayElements::Characters(right)) = (left, right) {
        *work = work.checked_sub(left.len() / 16)?;
        return Some(
            left.iter().zip(right).all(|(&a, &b)| a == b || character::fold(a) == character::fold(b)),
        );
    }
    *work = work.checked_sub(left.len())?;
    open.extend((0..left.len()).rev().filter_map(|index| left.get(index).zip(right.get(index))));
    Some(true)
}

/// Number of parts of an object that its hash looks at.
const HASHED_PARTS: usize = 64;
/// Number of characters of a string that its hash looks at.
const HASHED_CHARACTERS: usize = 4096;

/// The factor by which words are mixed into a hash.
pub const HASH_FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;

/// Mixes a word into a hash.
#[inline]
fn mix(hash: u64, word: u64) -> u64 {
    (hash.rotate_left(5) ^ word).wrapping_mul(HASH_FACTOR)
}

/// Folds the upper half of a product, which depends on all bits of its factors, into the lower half.
#[inline]
fn finish(hash: u64) -> u32 {
    ((hash >> 32) ^ hash) as u32
}

/// Returns a hash of a fixnum that keeps sixteen neighbours together: programs often count their keys up, and
/// a table then finds them in one place of memory. The order of the sixteen is mixed too, so that hashes do
/// not share their low bits, whatever the step between keys.
#[inline]
pub fn fixnum_hash(n: i64) -> u32 {
    let group = finish(mix(0, (n >> 4) as u64));
    group << 4 | (n as u32 ^ group >> 28) & 15
}

/// Limbs of a number, and pairs of characters of a string, that are hashed or compared for a unit of work.
const WORDS_TO_A_UNIT: usize = 64;

/// Returns the work of comparing or hashing a number.
#[inline]
fn number_work(heap: &Heap, v: Value) -> usize {
    match heap.bignum(v) {
        Some(n) => n.limbs.len() / WORDS_TO_A_UNIT,
        None => 0,
    }
}

/// Returns a hash of `v` that agrees with `test`, and the work of finding it: nothing for small objects.
#[inline]
pub fn hash_with_work(heap: &Heap, test: KeyTest, v: Value) -> (u32, usize) {
    match v.as_fixnum() {
        Some(n) if test != KeyTest::Equalp => (fixnum_hash(n), 0),
        _ => other_hash(heap, test, v),
    }
}

/// Returns a hash of `v` that agrees with `test`.
#[inline(always)]
pub fn hash(heap: &Heap, test: KeyTest, v: Value) -> u32 {
    match v.as_fixnum() {
        Some(n) if test != KeyTest::Equalp => fixnum_hash(n),
        _ => other_hash(heap, test, v).0,
    }
}

/// Returns a hash of a value that is not a fixnum, or is compared by `equalp`, and the work of finding it.
fn other_hash(heap: &Heap, test: KeyTest, v: Value) -> (u32, usize) {
    if test == KeyTest::Equal
        && let Some(characters) = heap.string(v)
    {
        return (finish(mix(0, characters_hash(characters, false))), characters_work(characters));
    }
    if !v.is_address() && test != KeyTest::Equalp {
        return (finish(mix(0, v.bits())), 0);
    }
    let word = match test {
        KeyTest::Eq => heap.identity(v),
        KeyTest::Eql => number_hash(heap, v).unwrap_or_else(|| heap.identity(v)),
        KeyTest::Equal | KeyTest::Equalp => {
            let mut work = 0;
            let word = parts_hash(heap, v, test == KeyTest::Equalp, &mut work);
            return (finish(word), work);
        }
    };
    (finish(mix(0, word)), number_work(heap, v))
}

/// Returns the value of `sxhash`: the hash of `equal`, but for a symbol one that depends on its name alone,
/// so that it is the same in every run; and the work of finding it.
pub fn sxhash(heap: &Heap, v: Value) -> (u32, usize) {
    match heap.symbol(v).and_then(|symbol| heap.string(symbol.name)) {
        Some(name) => (finish(characters_hash(name, false)), characters_work(name)),
        None => hash_with_work(heap, KeyTest::Equal, v),
    }
}

/// Returns the work of hashing characters.
fn characters_work(characters: &[u32]) -> usize {
    (characters.len() / 2).min(2 * HASHED_CHARACTERS) / WORDS_TO_A_UNIT
}

/// Returns a hash word that equal numbers of one type share; `None` if `v` is not a boxed number.
fn number_hash(heap: &Heap, v: Value) -> Option<u64> {
    let limbs = |v: Value, hash: u64| match heap.bignum(v) {
        Some(n) => n.limbs.iter().fold(mix(hash, u64::from(n.negative)), |hash, &limb| mix(hash, limb)),
        None => mix(hash, v.bits()),
    };
    match heap.kind(v)? {
        Kind::Bignum => Some(limbs(v, 1)),
        Kind::Float => heap.as_double(v).map(f64::to_bits),
        Kind::Complex => heap.complex(v).map(|(real, imaginary)| {
            let part = |v: Value| number_hash(heap, v).unwrap_or(v.bits());
            mix(part(real), part(imaginary))
        }),
        Kind::Ratio => heap.ratio(v).map(|(numerator, denominator)| limbs(denominator, limbs(numerator, 2))),
        _ => None,
    }
}

/// Returns a hash word that numbers of equal value share, whatever their type.
fn value_hash(heap: &Heap, v: Value) -> u64 {
    if let Some((real, imaginary)) = heap.complex(v) {
        let hash = value_hash(heap, real);
        return if number::is_zero(heap, imaginary) { hash } else { mix(hash, value_hash(heap, imaginary)) };
    }
    match number::exact_double(heap, v) {
        // Minus zero is zero.
        Some(x) => (x + 0.0).to_bits(),
        None => number_hash(heap, v).unwrap_or_else(|| mix(1, v.bits())),
    }
}

fn characters_hash(characters: &[u32], loosely: bool) -> u64 {
    let start = mix(4, characters.len() as u64);
    if loosely {
        let step = characters.len() / HASHED_CHARACTERS + 1;
        let sampled = characters.iter().step_by(step);
        return sampled.fold(start, |hash, &code| mix(hash, u64::from(character::fold(code))));
    }
    // Two characters make a word.
    let (pairs, rest) = characters.as_chunks::<2>();
    let start = rest.iter().fold(start, |hash, &code| mix(hash, u64::from(code)));
    let mix_pair = |hash, &[a, b]: &[u32; 2]| mix(hash, u64::from(b) << 32 | u64::from(a));
    match pairs.len() / HASHED_CHARACTERS {
        0 => pairs.iter().fold(start, mix_pair),
        more => pairs.iter().step_by(more + 1).fold(start, mix_pair),
    }
}

/// Returns the hash word of a pair or string, or if `loosely` of an array or structure, from its first parts
/// in reading order. Adds the work to `work`.
fn parts_hash(heap: &Heap, v: Value, loosely: bool, work: &mut usize) -> u64 {
    let mut open: SmallVec<[Value; 16]> = smallvec![v];
    let mut hash = 0;
    let mut visited = 0;
    while let Some(v) = open.pop() {
        visited += 1;
        if visited > HASHED_PARTS {
            break;
        }
        if loosely {
            *work += number_work(heap, v);
        }
        if let Some(pair) = heap.as_cons(v) {
            hash = mix(hash, 5);
            open.push(pair.cdr);
            open.push(pair.car);
        } else if loosely {
            hash = loose_hash(heap, v, hash, &mut open);
        } else if let Some(characters) = characters_of(heap, v) {
            *work += characters_work(characters);
            hash = mix(hash, characters_hash(characters, false));
        } else if let Some(bits) = bits_of(heap, v) {
            let shown = bits.iter().take(HASHED_CHARACTERS);
            *work += shown.len() / WORDS_TO_A_UNIT;
            hash = shown.fold(mix(hash, bits.len() as u64), |hash, &bit| mix(hash, u64::from(bit)));
        } else if let Some(slots) = heap.value_slots(v) {
            open.extend(slots.iter().take(HASHED_PARTS).rev().copied());
        } else {
            *work += number_work(heap, v);
            hash = mix(hash, number_hash(heap, v).unwrap_or_else(|| heap.identity(v)));
        }
    }
    hash
}

fn loose_hash(heap: &Heap, v: Value, hash: u64, open: &mut SmallVec<[Value; 16]>) -> u64 {
    if let Some(code) = v.as_character() {
        return mix(hash, u64::from(character::fold(code)));
    }
    if number::is_number(heap, v) {
        return mix(hash, value_hash(heap, v));
    }
    if let Some(elements) = vector_elements(heap, v).or_else(|| all_elements(heap, v)) {
        // A string equals a vector of the same characters, so elements are hashed one by one.
        let shown = elements.len().min(HASHED_PARTS);
        open.extend((0..shown).rev().filter_map(|index| elements.get(index)));
        return mix(hash, elements.len() as u64);
    }
    match heap.kind(v) {
        Some(Kind::Structure) if !heap.is_instance(v) => {
            let slots = heap.structure_slots(v).unwrap_or_default();
            open.extend(slots.iter().take(HASHED_PARTS).rev().copied());
            let class = heap.structure_class(heap.structure_whole(v));
            mix(hash, heap.identity(class.unwrap_or(Value::NIL)))
        }
        Some(Kind::HashTable) => mix(hash, 7),
        _ => mix(hash, heap.identity(v)),
    }
}

/// Returns the hash for an integer that a hash function of the program has returned; `low` is the lowest limb
/// of its magnitude.
pub fn given_hash(low: u64) -> u32 {
    finish(mix(0, low))
}
