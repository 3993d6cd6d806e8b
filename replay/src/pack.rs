//! Numbers, texts and data as bytes, one after the other.
//!
//! Numbers are written seven bits at a time, the lowest first; the high bit says that more follow. A datum is
//! a list of nodes, each of which refers to earlier ones by number, the last one being the datum itself: so
//! what is shared stays shared, and neither side needs native stack in proportion to the depth.
//!
//! Guarantees: no bytes make [`ByteReader`] panic, or allocate more than a small multiple of their number.

use std::collections::HashMap;
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Home, Symbol};
use esl_host::GoneObject;
use num_bigint::BigInt;

/// Most bytes of an integer of data.
const MAX_INTEGER: usize = 1 << 24;

/// Bytes that are being written.
#[derive(Debug, Default)]
pub(super) struct ByteWriter(pub(super) Vec<u8>);

/// Bytes that are being read. Each function returns `None` if they are not what it reads.
#[derive(Clone, Debug)]
pub(super) struct ByteReader<'a>(pub(super) &'a [u8]);

impl ByteWriter {
    pub(super) fn byte(&mut self, byte: u8) {
        self.0.push(byte);
    }

    pub(super) fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    /// A number that may be negative, near zero most often.
    pub(super) fn signed(&mut self, number: i64) {
        self.number(((number << 1) ^ (number >> 63)) as u64);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
    }

    pub(super) fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    pub(super) fn list<T>(&mut self, items: &[T], mut write: impl FnMut(&mut ByteWriter, &T)) {
        self.number(items.len() as u64);
        items.iter().for_each(|item| write(self, item));
    }

    /// Writes a datum. Objects of a program are written as a text: they leave no machine.
    pub(super) fn datum(&mut self, datum: &Datum) {
        let mut numbers: HashMap<usize, u64> = HashMap::new();
        let mut nodes = ByteWriter::default();
        // A node is opened, then its parts are written, then the node itself.
        let mut open = vec![(datum, false)];
        while let Some((datum, has_parts)) = open.pop() {
            if numbers.contains_key(&datum.identity()) {
                continue;
            }
            if !has_parts {
                open.push((datum, true));
                match datum.kind() {
                    DatumKind::Cons(car, cdr) => open.extend([(car, false), (cdr, false)]),
                    DatumKind::Vector(items) | DatumKind::Array(_, items) | DatumKind::Table(items) => {
                        open.extend(items.iter().map(|item| (item, false)));
                    }
                    _ => {}
                }
                continue;
            }
            let number = |part: &Datum| numbers.get(&part.identity()).copied().unwrap_or(0);
            node(&mut nodes, datum.kind(), &number);
            numbers.insert(datum.identity(), numbers.len() as u64);
        }
        self.number(numbers.len() as u64);
        self.0.extend_from_slice(&nodes.0);
    }
}

/// Tags of nodes.
mod tag {
    pub(super) const NIL: u8 = 0;
    pub(super) const SYMBOL: u8 = 1;
    pub(super) const UNINTERNED: u8 = 2;
    pub(super) const INTEGER: u8 = 3;
    pub(super) const RATIO: u8 = 4;
    pub(super) const FLOAT: u8 = 5;
    pub(super) const CHARACTER: u8 = 6;
    pub(super) const STRING: u8 = 7;
    pub(super) const CONS: u8 = 8;
    pub(super) const VECTOR: u8 = 9;
    pub(super) const ARRAY: u8 = 10;
    pub(super) const OPAQUE: u8 = 11;
    pub(super) const BYTES: u8 = 12;
    pub(super) const INTEGERS: u8 = 13;
    pub(super) const FLOATS: u8 = 14;
    pub(super) const TABLE: u8 = 15;
}

/// Writes a node whose parts have these numbers.
fn node(out: &mut ByteWriter, kind: &DatumKind, number: &dyn Fn(&Datum) -> u64) {
    match kind {
        DatumKind::Nil => out.byte(tag::NIL),
        DatumKind::Symbol(symbol) => match symbol.home() {
            Home::Package(package) => {
                out.byte(tag::SYMBOL);
                out.text(package);
                out.text(symbol.name());
            }
            Home::Uninterned(id) => {
                out.byte(tag::UNINTERNED);
                out.number(u64::from(*id));
                out.text(symbol.name());
            }
        },
        DatumKind::Integer(integer) => {
            out.byte(tag::INTEGER);
            out.bytes(&integer.to_signed_bytes_le());
        }
        DatumKind::Ratio(over, under) => {
            out.byte(tag::RATIO);
            out.bytes(&over.to_signed_bytes_le());
            out.bytes(&under.to_signed_bytes_le());
        }
        DatumKind::Float(float) => {
            out.byte(tag::FLOAT);
            out.0.extend_from_slice(&float.to_le_bytes());
        }
        DatumKind::Character(character) => {
            out.byte(tag::CHARACTER);
            out.number(u64::from(u32::from(*character)));
        }
        DatumKind::String(text) => {
            out.byte(tag::STRING);
            out.text(text);
        }
        DatumKind::Cons(car, cdr) => {
            out.byte(tag::CONS);
            out.number(number(car));
            out.number(number(cdr));
        }
        DatumKind::Vector(items) => {
            out.byte(tag::VECTOR);
            out.list(items, |out, item| out.number(number(item)));
        }
        DatumKind::Array(dimensions, items) => {
            out.byte(tag::ARRAY);
            out.list(dimensions, |out, &dimension| out.number(u64::from(dimension)));
            out.list(items, |out, item| out.number(number(item)));
        }
        DatumKind::Table(items) => {
            out.byte(tag::TABLE);
            out.list(items, |out, item| out.number(number(item)));
        }
        DatumKind::Packed(vector) => {
            out.byte(match vector {
                PackedVector::Bytes(_) => tag::BYTES,
                PackedVector::Integers(_) => tag::INTEGERS,
                PackedVector::Floats(_) => tag::FLOATS,
            });
            out.bytes(&vector.to_le_bytes());
        }
        DatumKind::Opaque(opaque) => {
            out.byte(tag::OPAQUE);
            out.text(opaque.kind());
            out.text(opaque.text());
        }
        DatumKind::Object(_) | DatumKind::Call(_) => {
            out.byte(tag::STRING);
            out.text("an object");
        }
    }
}

/// Returns the numbers that bytes hold, eight bytes each; `None` if they do not.
fn words<T>(bytes: &[u8], number: fn([u8; 8]) -> T) -> Option<Arc<[T]>> {
    let (words, rest) = bytes.as_chunks();
    rest.is_empty().then(|| words.iter().map(|&word| number(word)).collect())
}

impl<'a> ByteReader<'a> {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        let (&byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(byte)
    }

    pub(super) fn flag(&mut self) -> Option<bool> {
        match self.byte()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*bytes)
    }

    pub(super) fn number(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let part = u64::from(byte & 0x7F);
            if shift == 63 && part > 1 {
                return None;
            }
            number |= part << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    pub(super) fn small(&mut self) -> Option<u32> {
        self.number()?.try_into().ok()
    }

    pub(super) fn signed(&mut self) -> Option<i64> {
        let number = self.number()?;
        Some((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    pub(super) fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.number()?).ok()?;
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.bytes()?).ok()
    }

    /// A list, each item of which takes a byte at least.
    pub(super) fn list<T>(&mut self, mut read: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = usize::try_from(self.number()?).ok().filter(|&count| count <= self.0.len())?;
        (0..count).map(|_| read(self)).collect()
    }

    pub(super) fn datum(&mut self) -> Option<Datum> {
        let count = usize::try_from(self.number()?).ok().filter(|&count| count <= self.0.len())?;
        let mut nodes: Vec<Datum> = Vec::new();
        for _ in 0..count {
            let kind = self.node(&nodes)?;
            nodes.push(Datum::new(kind, Span::default()));
        }
        nodes.pop()
    }

    fn node(&mut self, nodes: &[Datum]) -> Option<DatumKind> {
        let part = |number: u64| nodes.get(usize::try_from(number).ok()?).cloned();
        Some(match self.byte()? {
            tag::NIL => DatumKind::Nil,
            tag::SYMBOL => {
                let package: Arc<str> = self.text()?.into();
                let symbol = Symbol::new(&package, self.text()?);
                if symbol.is_cl("NIL") { DatumKind::Nil } else { DatumKind::Symbol(symbol) }
            }
            tag::UNINTERNED => {
                let id = self.small()?;
                DatumKind::Symbol(Symbol::uninterned(id, self.text()?))
            }
            tag::INTEGER => DatumKind::Integer(self.integer()?.into()),
            tag::RATIO => {
                let (over, under) = (self.integer()?, self.integer()?);
                (under > 1.into()).then_some(DatumKind::Ratio(over, under))?
            }
            tag::FLOAT => DatumKind::Float(f64::from_le_bytes(self.array()?)),
            tag::CHARACTER => DatumKind::Character(char::from_u32(self.small()?)?),
            tag::STRING => DatumKind::String(self.text()?.into()),
            tag::CONS => DatumKind::Cons(part(self.number()?)?, part(self.number()?)?),
            tag::VECTOR => DatumKind::Vector(self.list(|from| part(from.number()?))?.into()),
            tag::ARRAY => {
                let dimensions = self.list(ByteReader::small)?;
                let items = self.list(|from| part(from.number()?))?;
                let size = dimensions.iter().try_fold(1_usize, |size, &n| size.checked_mul(n as usize));
                let fits = size == Some(items.len()) && dimensions.len() != 1 && dimensions.len() < 8;
                fits.then_some(DatumKind::Array(dimensions.into(), items.into()))?
            }
            tag::TABLE => {
                let items = self.list(|from| part(from.number()?))?;
                items.len().is_multiple_of(2).then_some(DatumKind::Table(items.into()))?
            }
            tag::BYTES => DatumKind::Packed(PackedVector::Bytes(self.bytes()?.to_vec().into())),
            tag::INTEGERS => {
                DatumKind::Packed(PackedVector::Integers(words(self.bytes()?, i64::from_le_bytes)?))
            }
            tag::FLOATS => DatumKind::Packed(PackedVector::Floats(words(self.bytes()?, f64::from_le_bytes)?)),
            // The original is gone with its process; a new object stands for it.
            tag::OPAQUE => {
                DatumKind::Opaque(OpaqueDatum::new(self.text()?, self.text()?, Arc::new(GoneObject)))
            }
            _ => return None,
        })
    }

    fn integer(&mut self) -> Option<BigInt> {
        let bytes = self.bytes().filter(|bytes| bytes.len() <= MAX_INTEGER)?;
        Some(BigInt::from_signed_bytes_le(bytes))
    }
}
