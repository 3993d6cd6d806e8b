//! Arrays: their elements, dimensions and fill pointers.
//!
//! What keeps the elements decides what they may be: any value, characters, or integers below 256.
//! [`esl_heap::array`] reads them.

pub(crate) use esl_heap::array::{Elements, all_elements, data_of, vector_elements, vector_length};
use esl_heap::array::{dimensions, total_size};

use crate::heap::Kind;
use crate::heap::layout::Array;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

use super::COPY_LIMIT;

/// Elements of a long vector that is being made that are filled at once.
const FILLED_AT_ONCE: usize = 1 << 13;
/// The greatest number of dimensions.
const MAX_RANK: usize = 64;

impl Vm {
    /// What may be put in an array over `data`: the code or byte of `value` where it is not any value.
    pub(crate) fn check_element(&mut self, data: Value, value: Value) -> Result<(), Exit> {
        match self.heap.kind(data) {
            Some(Kind::String) if !value.is_character() => self.exchange.type_error(value, "CHARACTER"),
            Some(Kind::Bytes) if value.as_index().is_none_or(|byte| byte > 255) => {
                self.specifier_error(value, "(UNSIGNED-BYTE 8)")
            }
            _ => Ok(()),
        }
    }

    /// Stores an element of what keeps the elements of an array. `value` has been checked, and `index` is in
    /// range.
    pub(crate) fn store_element(&mut self, data: Value, index: usize, value: Value) {
        if self.heap.vector_set(data, index, value).is_some() {
            return;
        }
        if let Some(code) = value.as_character()
            && let Some(slot) = self.heap.string_mut(data).and_then(|characters| characters.get_mut(index))
        {
            *slot = code;
        } else if let Some(byte) = value.as_index()
            && let Some(slot) = self.heap.bytes_mut(data).and_then(|bytes| bytes.get_mut(index))
        {
            *slot = byte as u8;
        }
    }

    /// Where the subscripts point, in row-major order.
    fn row_major_index(&mut self, array: Value, subscripts: &[Value]) -> Result<usize, Exit> {
        let Some(dimensions) = dimensions(&self.heap, array) else {
            return self.exchange.type_error(array, "ARRAY");
        };
        if dimensions.len() != subscripts.len() {
            return self.exchange.raise(Raised::Simple(format!(
                "wrong number of subscripts, {}, for an array of rank {}",
                subscripts.len(),
                dimensions.len()
            )));
        }
        let mut index = 0;
        for (&subscript, &dimension) in subscripts.iter().zip(&dimensions) {
            index = index * dimension + self.index_below(subscript, dimension)?;
        }
        Ok(index)
    }

    fn element(&mut self, array: Value, index: usize) -> Outcome {
        match all_elements(&self.heap, array).and_then(|elements| elements.get(index)) {
            Some(value) => Ok(value),
            None => {
                self.exchange.index_error(Value::index(index), total_size(&self.heap, array).unwrap_or(0))
            }
        }
    }

    fn set_element(&mut self, array: Value, index: usize, value: Value) -> Outcome {
        let Some(data) = data_of(&self.heap, array) else { return self.exchange.type_error(array, "ARRAY") };
        self.check_element(data, value)?;
        self.store_element(data, index, value);
        Ok(value)
    }

    /// The array with a fill pointer that `v` is, and its fill pointer.
    fn with_fill_pointer(&mut self, v: Value) -> Result<(Array, usize), Exit> {
        match self.heap.array(v) {
            Some(&array) if let Some(fill) = array.fill.as_index() => Ok((array, fill)),
            _ => self.specifier_error(v, "(AND VECTOR (SATISFIES ARRAY-HAS-FILL-POINTER-P))"),
        }
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
    let index = vm.index_below(index, length)?;
    vm.heap.vector_set(vector, index, value);
    Ok(value)
}

pub(super) fn aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if let [array, index] = *arguments
        && let Some(index) = index.as_index()
        && let Some(elements) = Elements::of_data(&vm.heap, array)
        && let Some(value) = elements.get(index)
    {
        return Ok(value);
    }
    let index = vm.row_major_index(arguments[0], &arguments[1..])?;
    vm.element(arguments[0], index)
}

pub(super) fn set_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, subscripts @ .., value] = arguments else {
        return vm.exchange.program_error("a value and subscripts are expected");
    };
    let index = vm.row_major_index(*array, subscripts)?;
    vm.set_element(*array, index, *value)
}

pub(super) fn row_major_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, index] = exactly(arguments);
    let size = array_size(vm, array)?;
    let index = vm.index_below(index, size)?;
    vm.element(array, index)
}

pub(super) fn set_row_major_aref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, index, value] = exactly(arguments);
    let size = array_size(vm, array)?;
    let index = vm.index_below(index, size)?;
    vm.set_element(array, index, value)
}

pub(super) fn array_row_major_index(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.row_major_index(arguments[0], &arguments[1..]).map(Value::index)
}

pub(super) fn array_in_bounds_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(dimensions) = dimensions(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "ARRAY");
    };
    let subscripts = &arguments[1..];
    if dimensions.len() != subscripts.len() {
        return vm.row_major_index(arguments[0], subscripts).map(|_| Value::NIL);
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
            let axis = vm.index_below(axis, dimensions.len())?;
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
    match data_of(&vm.heap, arguments[0]) {
        Some(data) => Ok(data),
        None => vm.exchange.type_error(arguments[0], "ARRAY"),
    }
}

pub(super) fn fill_pointer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_fill_pointer(arguments[0]).map(|(_, fill)| Value::index(fill))
}

pub(super) fn set_fill_pointer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, index] = exactly(arguments);
    vm.with_fill_pointer(vector)?;
    let size = array_size(vm, vector)?;
    let fill = vm.index_below(index, size + 1)?;
    vm.heap.array_set_fill(vector, Value::index(fill));
    Ok(index)
}

pub(super) fn vector_push(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [value, vector] = exactly(arguments);
    let (array, fill) = vm.with_fill_pointer(vector)?;
    if fill >= array_size(vm, vector)? {
        return Ok(Value::NIL);
    }
    vm.check_element(array.data, value)?;
    vm.store_element(array.data, fill, value);
    vm.heap.array_set_fill(vector, Value::index(fill + 1));
    Ok(Value::index(fill))
}

pub(super) fn vector_push_extend(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (value, vector) = (arguments[0], arguments[1]);
    let (array, fill) = vm.with_fill_pointer(vector)?;
    let size = array_size(vm, vector)?;
    if fill < size {
        return vector_push(vm, &arguments[..2]);
    }
    vm.check_element(array.data, value)?;
    // As SBCL: twice the size, unless the caller says by how much at least.
    let extension = match arguments.get(2) {
        Some(&extension) => match extension.as_index() {
            Some(extension) if extension > 0 => extension,
            _ => return vm.specifier_error(extension, "(INTEGER 1)"),
        },
        None => size.max(1),
    };
    let data = extended(vm, array.data, size.saturating_add(extension))?;
    vm.heap.array_set_data(vector, data);
    vm.heap.array_set_dimension(vector, 0, Value::index(size + extension));
    vm.store_element(data, fill, value);
    vm.heap.array_set_fill(vector, Value::index(fill + 1));
    Ok(Value::index(fill))
}

/// A copy of `data` with room for `size` elements, the new ones zero, `NUL` or `0`.
fn extended(vm: &mut Vm, data: Value, size: usize) -> Outcome {
    let length = Elements::of_data(&vm.heap, data).map_or(0, Elements::len);
    if size > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let new = match vm.heap.kind(data) {
        Some(Kind::String) => vm.heap.alloc_string_filled(size, 0)?,
        Some(Kind::Bytes) => vm.heap.alloc_bytes_filled(size, 0)?,
        _ => vm.heap.alloc_vector_filled(size, Value::small(0))?,
    };
    vm.exchange.charge_elements(size);
    vm.copy_elements(data, 0, new, 0, length)?;
    Ok(new)
}

pub(super) fn vector_pop(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (_, fill) = vm.with_fill_pointer(arguments[0])?;
    let Some(last) = fill.checked_sub(1) else {
        return vm.exchange.raise(Raised::Simple("there is nothing left to pop".into()));
    };
    let value = vm.element(arguments[0], last)?;
    vm.heap.array_set_fill(arguments[0], Value::index(last));
    Ok(value)
}

pub(super) fn make_vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, object] = exactly(arguments);
    let size = vm.count(size)?;
    if size > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let vector = vm.heap.alloc_vector_filled(size, object)?;
    vm.exchange.charge_elements(size);
    Ok(vector)
}

pub(super) fn begin_vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, string_p] = exactly(arguments);
    let size = vm.count(size)?;
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

/// `%make-array`: an array over data that is there.
pub(super) fn make_array(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [dimensions, data, fill, adjustable] = exactly(arguments);
    let (sizes, fill) = shape(vm, dimensions, data, fill)?;
    let mut flags = if fill.is_nil() { 0 } else { Array::HAS_FILL_POINTER };
    if adjustable.is_true() {
        flags |= Array::ADJUSTABLE;
    }
    Ok(vm.heap.alloc_array(flags, data, fill, &sizes)?)
}

/// `%adjust-array`: other dimensions, data and fill pointer for an array that has as many dimensions.
pub(super) fn adjust_array(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [array, dimensions, data, fill] = exactly(arguments);
    let Some(rank) = vm.heap.array_dimensions(array).map(<[Value]>::len) else {
        return vm.exchange.type_error(array, "ARRAY");
    };
    let (sizes, fill) = shape(vm, dimensions, data, fill)?;
    if sizes.len() != rank {
        return vm
            .exchange
            .raise(Raised::Simple(format!("the array has {rank} dimensions, not {}", sizes.len())));
    }
    vm.heap.array_set_data(array, data);
    for (axis, &size) in sizes.iter().enumerate() {
        vm.heap.array_set_dimension(array, axis, size);
    }
    vm.heap.array_set_fill(array, fill);
    Ok(array)
}

/// Dimensions and fill pointer that suit the data.
fn shape(vm: &mut Vm, dimensions: Value, data: Value, fill: Value) -> Result<(Vec<Value>, Value), Exit> {
    let Some(room) = Elements::of_data(&vm.heap, data).map(Elements::len) else {
        return vm.exchange.type_error(data, "VECTOR");
    };
    let sizes = match vm.list_items(dimensions, MAX_RANK) {
        Err(Exit::Slowly) => {
            return vm.exchange.raise(Raised::Simple(format!("an array has at most {MAX_RANK} dimensions")));
        }
        sizes => sizes?,
    };
    let mut total = Some(1usize);
    for &size in &sizes {
        total = total.zip(Some(vm.count(size)?)).and_then(|(total, size)| total.checked_mul(size));
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
    let fill = if fill == Value::T { size } else { vm.index_below(fill, size + 1)? };
    Ok((sizes, Value::index(fill)))
}
