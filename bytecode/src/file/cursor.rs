//! Reading and writing numbers and texts one after the other.

use super::{Problem, ReadError, Section};

/// A place in a section, for reading.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'a> {
    /// Bytes left.
    rest: &'a [u8],
    /// Offset of `rest` in the file, for messages.
    offset: usize,
    section: Option<Section>,
}

impl<'a> Cursor<'a> {
    /// Returns the bytes of `section`, which begins at `offset` of the file. `None` is the header.
    pub(super) fn new(bytes: &'a [u8], offset: usize, section: Option<Section>) -> Cursor<'a> {
        Cursor { rest: bytes, offset, section }
    }

    /// Returns the error that there is `problem` at this place.
    pub(super) fn damaged(&self, problem: Problem) -> ReadError {
        ReadError::Damaged { section: self.section, offset: self.offset, problem }
    }

    /// Bytes left to be read.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Returns a cursor over `bytes` only, which are found at this place.
    pub(super) fn narrowed(&self, bytes: &'a [u8]) -> Cursor<'a> {
        Cursor { rest: bytes, ..*self }
    }

    pub(super) fn bytes(&mut self, length: usize) -> Result<&'a [u8], ReadError> {
        let Some((bytes, rest)) = self.rest.split_at_checked(length) else {
            let problem = Problem::Short { expected: length as u64, found: self.rest.len() as u64 };
            return Err(self.damaged(problem));
        };
        self.rest = rest;
        self.offset += length;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let bytes = self.bytes(N)?;
        Ok(bytes.try_into().expect("`bytes` gives as many as asked for"))
    }

    pub(super) fn u8(&mut self) -> Result<u8, ReadError> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u32(&mut self) -> Result<u32, ReadError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, ReadError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// Returns a number of things that take at least `size` bytes each; there are bytes enough for all of
    /// them.
    pub(super) fn count(&mut self, size: usize) -> Result<usize, ReadError> {
        let count = self.u32()?;
        let expected = u64::from(count) * size as u64;
        if expected > self.rest.len() as u64 {
            return Err(self.damaged(Problem::Short { expected, found: self.rest.len() as u64 }));
        }
        Ok(count as usize)
    }

    /// `count` numbers.
    pub(super) fn words(
        &mut self,
        count: usize,
    ) -> Result<impl ExactSizeIterator<Item = u32> + 'a, ReadError> {
        let length = count.saturating_mul(4);
        Ok(self.bytes(length)?.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)))
    }

    /// Returns a length and as many bytes of UTF-8.
    pub(super) fn text(&mut self) -> Result<&'a str, ReadError> {
        let length = self.count(1)?;
        let here = self.clone();
        let bytes = self.bytes(length)?;
        std::str::from_utf8(bytes).map_err(|_| here.damaged(Problem::Utf8))
    }

    /// Returns a number below `count`, the index of one `of` these.
    pub(super) fn index(&mut self, of: &'static str, count: usize) -> Result<u32, ReadError> {
        let here = self.clone();
        let found = self.u32()?;
        if found as usize >= count {
            return Err(here.damaged(Problem::Index { of, found, count: count as u32 }));
        }
        Ok(found)
    }

    /// Returns a number in LEB128, seven bits a byte, the low ones first.
    pub(super) fn leb(&mut self) -> Result<u32, ReadError> {
        let here = self.clone();
        let mut value: u64 = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.u8()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return u32::try_from(value).map_err(|_| here.damaged(Problem::Number));
            }
        }
        Err(here.damaged(Problem::Number))
    }

    /// Returns a signed number in LEB128, the sign in the lowest bit.
    pub(super) fn signed_leb(&mut self) -> Result<i32, ReadError> {
        let bits = self.leb()?;
        Ok((bits >> 1) as i32 ^ -((bits & 1) as i32))
    }

    /// Nothing may be left.
    pub(super) fn end(&self) -> Result<(), ReadError> {
        if self.rest.is_empty() { Ok(()) } else { Err(self.damaged(Problem::Trailing)) }
    }
}

/// Bytes under construction.
#[derive(Debug, Default)]
pub(super) struct ByteOutput(pub(super) Vec<u8>);

impl ByteOutput {
    pub(super) fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn leb(&mut self, mut value: u32) {
        while value >= 0x80 {
            self.u8(value as u8 | 0x80);
            value >>= 7;
        }
        self.u8(value as u8);
    }

    pub(super) fn signed_leb(&mut self, value: i32) {
        self.leb(((value << 1) ^ (value >> 31)) as u32);
    }
}
