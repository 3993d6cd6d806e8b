//! The record of one function.
//!
//! ```text
//! name, lambda list, documentation   u32 each: constant, or NONE
//! required, optional, registers      u8 each
//! flags                              u8: 1 rest, 2 keys, 4 allow other keys
//! keys (if flagged), captures, constants, code   each: count u32, then
//!     key, constant                  u32: constant of the pool
//!     capture                        u8: 0 register, 1 capture, 2 later; + 0x80 if boxed; u8: its number
//!     code                           u32
//! lines                              count u32, then for each: pc, source, line, column, as
//!                                    LEB128 differences to the entry before
//! variables                          count, then for each, in LEB128: begin of the range, as the difference
//!                                    to the one before; its length; twice the number of the register or
//!                                    capture, + 1 for a capture; number of the name
//! ```

use std::sync::Arc;

use super::cursor::{ByteOutput, Cursor};
use super::write::NameTable;
use super::{NONE, Problem, ReadError};
use crate::module::{
    Capture, CaptureSource, LineEntry, ModuleFunction, Parameters, PoolIdx, VariablePlace, VariableRange,
};

const FLAG_REST: u8 = 1;
const FLAG_KEYS: u8 = 2;
const FLAG_ALLOW_OTHER_KEYS: u8 = 4;

const CAPTURE_REGISTER: u8 = 0;
const CAPTURE_CAPTURE: u8 = 1;
const CAPTURE_LATER: u8 = 2;
const CAPTURE_BOXED: u8 = 0x80;

/// Appends the record of `function`.
pub(super) fn write(function: &ModuleFunction, names: &mut NameTable, out: &mut ByteOutput) {
    for place in [function.name, function.lambda_list, function.documentation] {
        out.u32(place.map_or(NONE, |PoolIdx(index)| index));
    }
    let Parameters { required, optional, rest, keys, allow_other_keys } = &function.parameters;
    let mut flags = 0;
    flags |= if *rest { FLAG_REST } else { 0 };
    flags |= if keys.is_some() { FLAG_KEYS } else { 0 };
    flags |= if *allow_other_keys { FLAG_ALLOW_OTHER_KEYS } else { 0 };
    for byte in [*required, *optional, function.registers, flags] {
        out.u8(byte);
    }
    if let Some(keys) = keys {
        write_pool_indexes(keys, out);
    }
    out.u32(function.captures.len() as u32);
    for capture in &function.captures {
        let (kind, number) = match capture.source {
            CaptureSource::Register(number) => (CAPTURE_REGISTER, number),
            CaptureSource::Capture(number) => (CAPTURE_CAPTURE, number),
            CaptureSource::Later => (CAPTURE_LATER, 0),
        };
        out.u8(if capture.boxed { kind | CAPTURE_BOXED } else { kind });
        out.u8(number);
    }
    write_pool_indexes(&function.constants, out);
    out.u32(function.code.len() as u32);
    for &word in &function.code {
        out.u32(word);
    }
    out.u32(function.lines.len() as u32);
    let mut last = LineEntry { pc: 0, source: 0, line: 0, column: 0 };
    for entry in &function.lines {
        out.leb(entry.pc.wrapping_sub(last.pc));
        out.signed_leb(entry.source.wrapping_sub(last.source) as i32);
        out.signed_leb(entry.line.wrapping_sub(last.line) as i32);
        out.signed_leb(entry.column.wrapping_sub(last.column) as i32);
        last = *entry;
    }
    out.leb(function.variables.len() as u32);
    let mut last = 0;
    for VariableRange { name, place, from, to } in &function.variables {
        out.leb(from.wrapping_sub(last));
        out.leb(to.wrapping_sub(*from));
        out.leb(match place {
            VariablePlace::Register(register) => u32::from(*register) << 1,
            VariablePlace::Capture(capture) => u32::from(*capture) << 1 | 1,
        });
        out.leb(names.number(name));
        last = *from;
    }
}

fn write_pool_indexes(indexes: &[PoolIdx], out: &mut ByteOutput) {
    out.u32(indexes.len() as u32);
    for &PoolIdx(index) in indexes {
        out.u32(index);
    }
}

/// Decodes a record, of a module with `pool` constants and these names; without its variables if there are no
/// names.
pub(super) fn read(
    mut from: Cursor<'_>,
    pool: usize,
    names: Option<&[Arc<str>]>,
) -> Result<ModuleFunction, ReadError> {
    let name = optional_constant(&mut from, pool)?;
    let lambda_list = optional_constant(&mut from, pool)?;
    let documentation = optional_constant(&mut from, pool)?;
    let required = from.u8()?;
    let optional = from.u8()?;
    let registers = from.u8()?;
    let here = from.clone();
    let flags = from.u8()?;
    if flags > (FLAG_REST | FLAG_KEYS | FLAG_ALLOW_OTHER_KEYS) {
        return Err(
            here.damaged(Problem::Unknown { expected: "flags of parameters", found: u32::from(flags) })
        );
    }
    let keys = if flags & FLAG_KEYS != 0 { Some(read_pool_indexes(&mut from, pool)?) } else { None };
    let parameters = Parameters {
        required,
        optional,
        rest: flags & FLAG_REST != 0,
        keys,
        allow_other_keys: flags & FLAG_ALLOW_OTHER_KEYS != 0,
    };
    let mut captures = Vec::with_capacity(from.count(2)?);
    for _ in 0..captures.capacity() {
        captures.push(read_capture(&mut from)?);
    }
    let constants = read_pool_indexes(&mut from, pool)?;
    let count = from.count(4)?;
    let code = from.words(count)?.collect();
    let lines = read_lines(&mut from)?;
    let mut variables = Vec::new();
    if let Some(names) = names {
        variables = read_variables(&mut from, names)?;
        from.end()?;
    }
    Ok(ModuleFunction {
        name,
        lambda_list,
        documentation,
        parameters,
        registers,
        captures,
        constants,
        code,
        lines,
        variables,
    })
}

/// Returns the number of captures in a record.
pub(super) fn capture_count(mut from: Cursor<'_>) -> Result<usize, ReadError> {
    // Name, lambda list, documentation; required, optional, registers.
    from.bytes(3 * 4 + 3)?;
    if from.u8()? & FLAG_KEYS != 0 {
        let keys = from.count(4)?;
        from.bytes(keys * 4)?;
    }
    from.count(2)
}

fn optional_constant(from: &mut Cursor<'_>, pool: usize) -> Result<Option<PoolIdx>, ReadError> {
    let mut ahead = from.clone();
    if ahead.u32()? == NONE {
        *from = ahead;
        return Ok(None);
    }
    Ok(Some(PoolIdx(from.index("constants", pool)?)))
}

fn read_pool_indexes(from: &mut Cursor<'_>, pool: usize) -> Result<Vec<PoolIdx>, ReadError> {
    let count = from.count(4)?;
    let mut indexes = Vec::with_capacity(count);
    for _ in 0..count {
        indexes.push(PoolIdx(from.index("constants", pool)?));
    }
    Ok(indexes)
}

fn read_capture(from: &mut Cursor<'_>) -> Result<Capture, ReadError> {
    let here = from.clone();
    let kind = from.u8()?;
    let number = from.u8()?;
    let source = match kind & !CAPTURE_BOXED {
        CAPTURE_REGISTER => CaptureSource::Register(number),
        CAPTURE_CAPTURE => CaptureSource::Capture(number),
        CAPTURE_LATER => CaptureSource::Later,
        _ => {
            let problem = Problem::Unknown { expected: "the kind of a capture", found: u32::from(kind) };
            return Err(here.damaged(problem));
        }
    };
    Ok(Capture { source, boxed: kind & CAPTURE_BOXED != 0 })
}

fn read_lines(from: &mut Cursor<'_>) -> Result<Vec<LineEntry>, ReadError> {
    let count = from.count(4)?;
    let mut lines = Vec::with_capacity(count);
    let mut last = LineEntry { pc: 0, source: 0, line: 0, column: 0 };
    for _ in 0..count {
        last.pc = last.pc.wrapping_add(from.leb()?);
        last.source = last.source.wrapping_add_signed(from.signed_leb()?);
        last.line = last.line.wrapping_add_signed(from.signed_leb()?);
        last.column = last.column.wrapping_add_signed(from.signed_leb()?);
        lines.push(last);
    }
    Ok(lines)
}

fn read_variables(from: &mut Cursor<'_>, names: &[Arc<str>]) -> Result<Vec<VariableRange>, ReadError> {
    let here = from.clone();
    let count = from.leb()? as usize;
    // Each takes at least as many bytes as it has numbers.
    let (expected, found) = (count as u64 * 4, from.rest().len() as u64);
    if expected > found {
        return Err(here.damaged(Problem::Short { expected, found }));
    }
    let mut variables = Vec::with_capacity(count);
    let mut begin: u32 = 0;
    for _ in 0..count {
        begin = begin.wrapping_add(from.leb()?);
        let to = begin.wrapping_add(from.leb()?);
        let here = from.clone();
        let found = from.leb()?;
        let Ok(number) = u8::try_from(found >> 1) else {
            let expected = "the place of a variable";
            return Err(here.damaged(Problem::Unknown { expected, found }));
        };
        let is_capture = found & 1 != 0;
        let place = if is_capture { VariablePlace::Capture(number) } else { VariablePlace::Register(number) };
        let here = from.clone();
        let found = from.leb()?;
        let Some(name) = names.get(found as usize) else {
            let count = names.len() as u32;
            return Err(here.damaged(Problem::Index { of: "names", found, count }));
        };
        variables.push(VariableRange { name: name.clone(), place, from: begin, to });
    }
    Ok(variables)
}
