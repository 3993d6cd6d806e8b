//! Arrays: their elements, dimensions and fill pointers.
//!
//! The storage decides the kind of the elements: any values, characters, integers below 256, or bits.
//! [`esl_heap::array`] reads them.

pub(crate) use esl_heap::array::{ArrayElements, all_elements, storage, vector_elements, vector_length};
use esl_heap::array::{MAX_DISPLACEMENTS, dimensions, matrix_element, total_size};

use crate::builtins::list::list_items;
use crate::builtins::sequence::copy_elements;
use crate::heap::layout::Array;
use crate::heap::{Heap, Kind};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::COPY_LIMIT;
use super::expect::{exactly, optional};

/// Elements of a long vector that is being made that are filled at once.
const FILLED_AT_ONCE: usize = 1 << 13;
/// The greatest number of dimensions.
const MAX_RANK: usize = 64;

/// Fails unless `value` may be an element of an array over `data`.
pub(crate) fn check_element(vm: &mut Vm, data: Value, value: Value) -> Result<(), Exit> {
    match vm.heap.kind(data) {
        Some(Kind::String) if !value.is_character() => vm.exchange.type_error(value, "CHARACTER"),
        Some(Kind::Bytes) if vm.heap.is_bits(data) => match value.as_index() {
            Some(0 | 1) => Ok(()),
            _ => vm.exchange.type_error(value, "BIT"),
        },
        Some(Kind::Bytes) if value.as_index().is_none_or(|byte| byte > 255) => {
            vm.exchange.not_written(value, "(UNSIGNED-BYTE 8)")
        }
        _ => Ok(()),
    }
}

/// Stores an element of what keeps the elements of an array. `value` has been checked, and `index` is in
/// range.
pub(crate) fn store_element(heap: &mut Heap, data: Value, index: usize, value: Value) {
    if heap.vector_set(data, index, value).is_some() {
        return;
    }
    if let Some(code) = value.as_character()
        && let Some(slot) = heap.string_mut(data).and_then(|characters| characters.get_mut(index))
    {
        *slot = code;
    } else if let Some(byte) = value.as_index()
        && let Some(slot) = heap.bytes_mut(data).and_then(|bytes| bytes.get_mut(index))
    {
        *slot = byte as u8;
    }
}

/// Where the subscripts point, in row-major order.
fn row_major_index(vm: &mut Vm, array: Value, subscripts: &[Value]) -> Result<usize, Exit> {
    let Some(dimensions) = dimensions(&vm.heap, array) else {
        return vm.exchange.type_error(array, "ARRAY");
    };
    if dimensions.len() != subscripts.len() {
        return vm.exchange.raise(Raised::Simple(format!(
            "wrong number of subscripts, {}, for an array of rank {}",
            subscripts.len(),
            dimensions.len()
        )));
    }
    let mut index = 0;
    for (&subscript, &dimension) in subscripts.iter().zip(&dimensions) {
        index = index * dimension + vm.exchange.index_below(subscript, dimension)?;
    }
    Ok(index)
}

fn element(vm: &mut Vm, array: Value, index: usize) -> Outcome {
    match all_elements(&vm.heap, array).and_then(|elements| elements.get(index)) {
        Some(value) => Ok(value),
        None => vm.exchange.index_error(Value::index(index), total_size(&vm.heap, array).unwrap_or(0)),
    }
}

/// Makes `value` element `index` of an array.
pub(crate) fn set_element(vm: &mut Vm, array: Value, index: usize, value: Value) -> Outcome {
    let Some(elements) = all_elements(&vm.heap, array) else {
        return vm.exchange.type_error(array, "ARRAY");
    };
    let size = elements.len();
    // A displaced array may have lost elements that its dimensions promise.
    let index = vm.exchange.index_below(Value::index(index), size)?;
    let (data, offset) = storage(&vm.heap, array).unwrap_or((array, 0));
    check_element(vm, data, value)?;
    store_element(&mut vm.heap, data, offset + index, value);
    Ok(value)
}

/// Returns the array with a fill pointer that `v` is, and its fill pointer.
fn with_fill_pointer(vm: &mut Vm, v: Value) -> Result<(Array, usize), Exit> {
    match vm.heap.array(v) {
        Some(&array) if let Some(fill) = array.fill.as_index() => Ok((array, fill)),
        _ => vm.exchange.not_written(v, "(AND VECTOR (SATISFIES ARRAY-HAS-FILL-POINTER-P))"),
    }
}

pub(super) fn vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.exchange.charge_elements(arguments.len());
    Ok(vm.heap.alloc_vector(arguments)?)
}

pub(super) fn svref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, index] = exactly(arguments);
    let Some(elements) = vm.heap.vector(vector) else {
        return vm.exchange.type_error(vector, "SIMPLE-VECTOR");
    };
    match index.as_index().and_then(|index| elements.get(index)) {
        Some(&value) => Ok(value),
        None => {
            let length = elements.len();
            vm.exchange.index_error(index, length)
        }
    }
}

pub(super) fn set_svref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, index, value] = exactly(arguments);
    let Some(length) = vm.heap.vector(vector).map(<[Value]>::len) else {
        return vm.exchange.type_error(vector, "SIMPLE-VECTOR");
    };
    let index = vm.exchange.index_below(index, length)?;
    vm.heap.vector_set(vector, index, value);
    Ok(value)
}

pub(super) fn aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let of_simple = |array, index: Value| ArrayElements::of_data(&vm.heap, array)?.get(index.as_index()?);
    let found = match *arguments {
        [array, index] => of_simple(array, index),
        [array, row, column] => matrix_element(&vm.heap, array, row, column),
        _ => None,
    };
    if let Some(value) = found {
        return Ok(value);
    }
    let index = row_major_index(vm, arguments[0], &arguments[1..])?;
    element(vm, arguments[0], index)
}

pub(super) fn set_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, subscripts @ .., value] = arguments else {
        return vm.exchange.program_error("expected a value and subscripts");
    };
    let index = row_major_index(vm, *array, subscripts)?;
    set_element(vm, *array, index, *value)
}

pub(super) fn row_major_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, index] = exactly(arguments);
    let size = array_size(vm, array)?;
    let index = vm.exchange.index_below(index, size)?;
    element(vm, array, index)
}

pub(super) fn set_row_major_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, index, value] = exactly(arguments);
    let size = array_size(vm, array)?;
    let index = vm.exchange.index_below(index, size)?;
    set_element(vm, array, index, value)
}

pub(super) fn array_row_major_index(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    row_major_index(vm, arguments[0], &arguments[1..]).map(Value::index)
}

pub(super) fn array_in_bounds_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(dimensions) = dimensions(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "ARRAY");
    };
    let subscripts = &arguments[1..];
    if dimensions.len() != subscripts.len() {
        return row_major_index(vm, arguments[0], subscripts).map(|_| Value::NIL);
    }
    for &subscript in subscripts {
        vm.integer(subscript)?;
    }
    let is_below = |(v, &dimension): (&Value, &usize)| v.as_index().is_some_and(|index| index < dimension);
    Ok(subscripts.iter().zip(&dimensions).all(is_below).into())
}

fn array_size(vm: &mut Vm, array: Value) -> Result<usize, Exit> {
    match total_size(&vm.heap, array) {
        Some(size) => Ok(size),
        None => vm.exchange.type_error(array, "ARRAY"),
    }
}

pub(super) fn array_total_size(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    array_size(vm, arguments[0]).map(Value::index)
}

pub(super) fn array_rank(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match dimensions(&vm.heap, arguments[0]) {
        Some(dimensions) => Ok(Value::index(dimensions.len())),
        None => vm.exchange.type_error(arguments[0], "ARRAY"),
    }
}

pub(super) fn array_dimensions(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match dimensions(&vm.heap, arguments[0]) {
        Some(dimensions) => {
            let dimensions: Vec<Value> = dimensions.into_iter().map(Value::index).collect();
            Ok(vm.heap.list(&dimensions)?)
        }
        None => vm.exchange.type_error(arguments[0], "ARRAY"),
    }
}

pub(super) fn array_dimension(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, axis] = exactly(arguments);
    match dimensions(&vm.heap, array) {
        Some(dimensions) => {
            let axis = vm.exchange.index_below(axis, dimensions.len())?;
            Ok(Value::index(dimensions[axis]))
        }
        None => vm.exchange.type_error(array, "ARRAY"),
    }
}

pub(super) fn array_has_fill_pointer_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    array_size(vm, arguments[0])?;
    Ok(vm.heap.array(arguments[0]).is_some_and(|array| array.fill.is_fixnum()).into())
}

pub(super) fn adjustable_array_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    array_size(vm, arguments[0])?;
    let flags = vm.heap.flags(arguments[0], Kind::Array).unwrap_or(0);
    Ok((flags & Array::ADJUSTABLE != 0).into())
}

pub(super) fn array_data(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match storage(&vm.heap, arguments[0]) {
        Some((data, _)) => Ok(data),
        None => vm.exchange.type_error(arguments[0], "ARRAY"),
    }
}

pub(super) fn displacement(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    array_size(vm, arguments[0])?;
    match vm.heap.array(arguments[0]).copied() {
        Some(array) if array.offset.is_fixnum() => vm.give_values(&[array.data, array.offset]),
        _ => vm.give_values(&[Value::NIL, Value::small(0)]),
    }
}

pub(super) fn element_sort(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    array_size(vm, arguments[0])?;
    Ok(Value::small(match all_elements(&vm.heap, arguments[0]) {
        Some(ArrayElements::Characters(_)) => 1,
        Some(ArrayElements::Bytes(_)) => 2,
        Some(ArrayElements::Bits(_)) => 3,
        _ => 0,
    }))
}

pub(super) fn make_bytes(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, byte, bits] = exactly(arguments);
    let size = vm.exchange.count(size)?;
    let limit = if bits.is_true() { 1 } else { 255 };
    let byte = match byte.as_index() {
        Some(value) if value <= limit => value as u8,
        _ if bits.is_true() => return vm.exchange.type_error(byte, "BIT"),
        _ => return vm.exchange.not_written(byte, "(UNSIGNED-BYTE 8)"),
    };
    vm.exchange.charge_elements(size / 8);
    Ok(match bits.is_true() {
        true => vm.heap.alloc_bits_filled(size, byte == 1)?,
        false => vm.heap.alloc_bytes_filled(size, byte)?,
    })
}

pub(super) fn bit_operation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [operation, left, right, target, start] = exactly(arguments);
    let operation = vm.exchange.index_below(operation, 16)?;
    let start = vm.exchange.count(start)?;
    let [Some(a), Some(b)] = [left, right].map(|array| bits_of(&vm.heap, array)) else {
        return vm.exchange.not_written(left, "(ARRAY BIT)");
    };
    let end = a.len().min(b.len()).min(start.saturating_add(COPY_LIMIT));
    let start = start.min(end);
    // Bit 2a + b of the operation is its result for the bits a and b.
    let result = a[start..end].iter().zip(&b[start..end]);
    let result: Vec<u8> = result.map(|(a, b)| (operation >> (2 * a + b)) as u8 & 1).collect();
    if bits_of(&vm.heap, target).is_none_or(|bits| bits.len() < end) {
        return vm.exchange.not_written(target, "(ARRAY BIT)");
    }
    vm.exchange.charge_elements(result.len());
    let (data, offset) = storage(&vm.heap, target).unwrap_or((target, 0));
    if let Some(bits) = vm.heap.bytes_mut(data) {
        bits[offset + start..offset + end].copy_from_slice(&result);
    }
    Ok(Value::index(end))
}

/// Returns the bits of an array of bits.
fn bits_of(heap: &Heap, array: Value) -> Option<&[u8]> {
    match all_elements(heap, array)? {
        ArrayElements::Bits(bits) => Some(bits),
        _ => None,
    }
}

pub(super) fn fill_pointer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    with_fill_pointer(vm, arguments[0]).map(|(_, fill)| Value::index(fill))
}

pub(super) fn set_fill_pointer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, index] = exactly(arguments);
    with_fill_pointer(vm, vector)?;
    let size = array_size(vm, vector)?;
    let fill = vm.exchange.index_below(index, size + 1)?;
    vm.heap.array_set_fill(vector, Value::index(fill));
    Ok(index)
}

pub(super) fn vector_push(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [value, vector] = exactly(arguments);
    let (_, fill) = with_fill_pointer(vm, vector)?;
    if fill >= array_size(vm, vector)? {
        return Ok(Value::NIL);
    }
    set_element(vm, vector, fill, value)?;
    vm.heap.array_set_fill(vector, Value::index(fill + 1));
    Ok(Value::index(fill))
}

pub(super) fn vector_push_extend(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (value, vector) = (arguments[0], arguments[1]);
    let (_, fill) = with_fill_pointer(vm, vector)?;
    let size = array_size(vm, vector)?;
    if fill < size {
        return vector_push(vm, &arguments[..2]);
    }
    let (old, _) = storage(&vm.heap, vector).unwrap_or((vector, 0));
    check_element(vm, old, value)?;
    // As SBCL: twice the size, unless the caller says by how much at least.
    let extension = match arguments.get(2) {
        Some(&extension) => match extension.as_index() {
            Some(extension) if extension > 0 => extension,
            _ => return vm.exchange.not_written(extension, "(INTEGER 1)"),
        },
        None => size.max(1),
    };
    let data = extended(vm, vector, size.saturating_add(extension))?;
    vm.heap.array_set_data(vector, data);
    vm.heap.array_set_dimension(vector, 0, Value::index(size + extension));
    store_element(&mut vm.heap, data, fill, value);
    vm.heap.array_set_fill(vector, Value::index(fill + 1));
    Ok(Value::index(fill))
}

/// Returns new data with the elements of `array` and room for `size` elements, the new ones zero, `NUL` or
/// `0`.
fn extended(vm: &mut Vm, array: Value, size: usize) -> Outcome {
    let length = all_elements(&vm.heap, array).map_or(0, ArrayElements::len);
    let (old, offset) = storage(&vm.heap, array).unwrap_or((array, 0));
    if size > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let new = match vm.heap.kind(old) {
        Some(Kind::String) => vm.heap.alloc_string_filled(size, 0)?,
        Some(Kind::Bytes) if vm.heap.is_bits(old) => vm.heap.alloc_bits_filled(size, false)?,
        Some(Kind::Bytes) => vm.heap.alloc_bytes_filled(size, 0)?,
        _ => vm.heap.alloc_vector_filled(size, Value::small(0))?,
    };
    vm.exchange.charge_elements(size);
    copy_elements(vm, old, offset, new, 0, length)?;
    Ok(new)
}

pub(super) fn vector_pop(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (_, fill) = with_fill_pointer(vm, arguments[0])?;
    let Some(last) = fill.checked_sub(1) else {
        return vm.exchange.raise(Raised::Simple("the vector is empty, so nothing can be popped".into()));
    };
    let value = element(vm, arguments[0], last)?;
    vm.heap.array_set_fill(arguments[0], Value::index(last));
    Ok(value)
}

pub(super) fn make_vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, object] = exactly(arguments);
    let size = vm.exchange.count(size)?;
    if size > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let vector = vm.heap.alloc_vector_filled(size, object)?;
    vm.exchange.charge_elements(size);
    Ok(vector)
}

pub(super) fn begin_vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, string_p] = exactly(arguments);
    let size = vm.exchange.count(size)?;
    Ok(vm.heap.begin_vector(size, string_p.is_true())?)
}

pub(super) fn fill_more(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, object] = exactly(arguments);
    vm.exchange.charge_elements(FILLED_AT_ONCE);
    match vm.heap.fill_more(vector, object, FILLED_AT_ONCE) {
        Some(is_finished) => Ok(Value::boolean(is_finished)),
        None => vm.exchange.type_error(vector, "VECTOR"),
    }
}

/// `%make-array`: an array over data that is there, or over a part of another array.
pub(super) fn make_array(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [dimensions, data, fill, adjustable] = exactly(&arguments[..4]);
    let offset = optional(arguments, 4);
    let (sizes, fill) = shape(vm, dimensions, data, fill, offset)?;
    let mut flags = if fill.is_nil() { 0 } else { Array::HAS_FILL_POINTER };
    if adjustable.is_true() {
        flags |= Array::ADJUSTABLE;
    }
    Ok(vm.heap.alloc_displaced_array(flags, data, fill, offset, &sizes)?)
}

/// `%adjust-array`: other dimensions, data, fill pointer and offset for an array that has as many dimensions.
pub(super) fn adjust_array(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, dimensions, data, fill] = exactly(&arguments[..4]);
    let offset = optional(arguments, 4);
    let Some(rank) = vm.heap.array_dimensions(array).map(<[Value]>::len) else {
        return vm.exchange.type_error(array, "ARRAY");
    };
    let (sizes, fill) = shape(vm, dimensions, data, fill, offset)?;
    if sizes.len() != rank {
        return vm
            .exchange
            .raise(Raised::Simple(format!("the array has {rank} dimensions, not {}", sizes.len())));
    }
    let mut at = data;
    while let Some(inner) = vm.heap.array(at) {
        if at == array {
            return vm.exchange.raise(Raised::Simple("an array cannot be displaced to itself".into()));
        }
        at = inner.data;
    }
    vm.heap.array_displace(array, data, offset);
    for (axis, &size) in sizes.iter().enumerate() {
        vm.heap.array_set_dimension(array, axis, size);
    }
    vm.heap.array_set_fill(array, fill);
    Ok(array)
}

/// Dimensions and fill pointer that suit the data, from the offset on if that is not `NIL`.
fn shape(
    vm: &mut Vm,
    dimensions: Value,
    data: Value,
    fill: Value,
    offset: Value,
) -> Result<(Vec<Value>, Value), Exit> {
    let room = match (offset.is_nil(), storage(&vm.heap, data)) {
        (true, _) => ArrayElements::of_data(&vm.heap, data).map(ArrayElements::len),
        (false, Some(_)) => all_elements(&vm.heap, data).map(ArrayElements::len),
        (false, None) if vm.heap.array(data).is_some() => {
            let text = format!("an array is displaced by way of at most {MAX_DISPLACEMENTS} others");
            return vm.exchange.raise(Raised::Simple(text));
        }
        (false, None) => None,
    };
    let Some(room) = room else {
        return vm.exchange.type_error(data, if offset.is_nil() { "VECTOR" } else { "ARRAY" });
    };
    let start = if offset.is_nil() { 0 } else { vm.exchange.index_below(offset, room + 1)? };
    let room = room - start;
    let sizes = match list_items(vm, dimensions, MAX_RANK) {
        Err(Exit::Slowly) => {
            return vm.exchange.raise(Raised::Simple(format!("an array has at most {MAX_RANK} dimensions")));
        }
        sizes => sizes?,
    };
    let mut total = Some(1usize);
    for &size in &sizes {
        total = total.zip(Some(vm.exchange.count(size)?)).and_then(|(total, size)| total.checked_mul(size));
    }
    if total.is_none_or(|total| total > room) {
        return vm.exchange.raise(Raised::Simple("the dimensions do not suit the number of elements".into()));
    }
    if fill.is_nil() {
        return Ok((sizes, fill));
    }
    if sizes.len() != 1 {
        return vm.exchange.raise(Raised::Simple("only vectors can have fill pointers".into()));
    }
    let size = sizes[0].as_index().unwrap_or(0);
    let fill = if fill == Value::T { size } else { vm.exchange.index_below(fill, size + 1)? };
    Ok((sizes, Value::index(fill)))
}
