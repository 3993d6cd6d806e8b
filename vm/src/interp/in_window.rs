//! The fast path of calls of functions with optional, rest and key parameters: the arguments are put in the
//! order of the parameters in the window of the call, where they are the first registers of the new frame.
//!
//! An unusual call (wrong numbers of arguments, unknown keys, many arguments, lack of room) is left to
//! [`super::arguments`], which also reports the fault; nothing has changed then.

use super::constants_of;
use crate::heap::layout::CodeObject;
use crate::shape::Shape;
use crate::value::Value;
use crate::vm::Vm;

/// Most arguments behind those of the required and optional parameters. So few are not charged.
const MOST: usize = 16;

/// Most names of keys for which [`MOST`] arguments are not charged.
const MOST_KEYS: usize = 23;

/// Puts the first `count` of `registers` in the order of the parameters of `code`. Returns the number of
/// parameters; `None` if the call has to take the slow path.
///
/// # Safety
/// `code` is the Code of a function with bytecode; `registers` lie behind the window of a call in the running
/// frame, which holds `count` arguments.
#[cold]
#[inline(never)]
pub(super) unsafe fn arrange(
    vm: &mut Vm,
    code: *mut CodeObject,
    registers: *mut Value,
    count: usize,
) -> Option<usize> {
    // SAFETY: `code` is a live Code by the contract. Parameters are among its registers, for which there is
    // room before `stack_end`. The last constants are the names of its keys (`shape`).
    unsafe {
        let shape = Shape::unpack((*code).spare[0]);
        let (required, keys) = (usize::from(shape.required), usize::from(shape.number));
        let positional = required + usize::from(shape.optional);
        let others = count.saturating_sub(positional);
        if count < required
            || others > MOST
            || (others > 0 && !shape.rest && !shape.takes_keys)
            // The registers may end behind the stack, where `add` has no meaning.
            || registers.wrapping_add((*code).nregs as usize) > vm.cpu.stack_end()
        {
            return None;
        }
        let first_key = positional + usize::from(shape.rest);
        let mut copies = [Value::NIL; MOST];
        let copies = &mut copies[..others];
        copies.copy_from_slice(std::slice::from_raw_parts(registers.add(positional), others));
        let mut places = [0; MOST / 2];
        if shape.takes_keys && others > 0 {
            if keys > MOST_KEYS || others % 2 != 0 {
                return None;
            }
            let names = constants_of(code).add((*code).nconsts as usize - keys);
            let names = std::slice::from_raw_parts(names, keys);
            for (place, pair) in places.iter_mut().zip(copies.chunks_exact(2)) {
                *place = first_key + names.iter().position(|&name| name == pair[0])?;
            }
        }
        if shape.rest {
            // Without room, the slow path finds that there is none.
            let list = vm.heap.list(copies).ok()?;
            *registers.add(positional) = list;
        }
        for missing in count..positional {
            *registers.add(missing) = Value::UNSUPPLIED;
        }
        if shape.takes_keys {
            for key in first_key..first_key + keys {
                *registers.add(key) = Value::UNSUPPLIED;
            }
            // Backwards, because of a repeated key the first counts.
            for (&place, pair) in places.iter().zip(copies.chunks_exact(2)).rev() {
                *registers.add(place) = pair[1];
            }
            return Some(first_key + keys);
        }
        Some(first_key)
    }
}
