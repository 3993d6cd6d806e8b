//! Values of programs as values of Python, and back.

use esl::Data;
use esl::data::{FromData, HostType, Opaque, PackedVector};
use esl_bytecode::BigInt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};

/// Levels of lists within lists that a value may have, as Python limits its own calls.
const MAX_DEPTH: u32 = 1000;

/// An object of Python that a program holds.
struct Held(Py<PyAny>);

impl HostType for Held {
    const NAME: &'static str = "PYTHON-OBJECT";

    fn label(&self) -> String {
        Python::attach(|py| {
            self.0.bind(py).get_type().name().map(|name| name.to_string()).unwrap_or_default()
        })
    }
}

/// Returns the value that stands for an object of Python, without looking into it.
pub(crate) fn hold(object: Py<PyAny>) -> Data {
    Opaque::new(Held(object)).into()
}

/// Returns the object of Python that a value stands for, if it does.
pub(crate) fn held(py: Python<'_>, data: &Data) -> Option<Py<PyAny>> {
    Opaque::<Held>::from_data(data)?.with(|held| held.0.clone_ref(py)).ok()
}

/// Something that a program holds and Python does not look into: an object of a module of the library, which
/// the program gets back as itself, or an object of the program, such as a task or a structure, which does
/// not return.
#[pyclass(frozen, module = "esl", name = "ProgramObject")]
pub(crate) struct ProgramObject(Data);

#[pymethods]
impl ProgramObject {
    fn __repr__(&self) -> String {
        format!("<{} of an ESL program>", self.0.to_string().trim_start_matches("#<").trim_end_matches('>'))
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

/// Returns the data of an object, for a program to have it back.
fn returned(object: &ProgramObject) -> PyResult<Data> {
    match &object.0 {
        Data::Opaque(opaque) if opaque.is_of_program() => Err(PyTypeError::new_err(format!(
            "{} belongs to a program and cannot be passed to one: keep it in a variable of the program, and pass \
             the name",
            object.0
        ))),
        data => Ok(data.clone()),
    }
}

/// The classes of `esl.values`, and those of the standard library that values become.
struct Classes {
    keyword: Py<PyAny>,
    symbol: Py<PyAny>,
    exact_keyword: Py<PyAny>,
    exact_symbol: Py<PyAny>,
    character: Py<PyAny>,
    dotted: Py<PyAny>,
    object: Py<PyAny>,
    table: Py<PyAny>,
    fraction: Py<PyAny>,
    array: Py<PyAny>,
}

fn classes(py: Python<'_>) -> PyResult<&Classes> {
    static CLASSES: PyOnceLock<Classes> = PyOnceLock::new();
    CLASSES.get_or_try_init(py, || {
        let values = py.import("esl.values")?;
        let class = |name: &str| Ok::<_, PyErr>(values.getattr(name)?.unbind());
        Ok(Classes {
            keyword: class("Keyword")?,
            symbol: class("Symbol")?,
            exact_keyword: values.getattr("Keyword")?.getattr("exact")?.unbind(),
            exact_symbol: values.getattr("Symbol")?.getattr("exact")?.unbind(),
            character: class("Character")?,
            dotted: class("Dotted")?,
            object: class("Object")?,
            table: class("Table")?,
            fraction: py.import("fractions")?.getattr("Fraction")?.unbind(),
            array: py.import("array")?.getattr("array")?.unbind(),
        })
    })
}

fn no_key(key: &Bound<'_, PyAny>) -> PyErr {
    PyValueError::new_err(format!(
        "{key} is a key of a table, which Python cannot hash: have the program return a list of keys and values"
    ))
}

fn too_deep() -> PyErr {
    PyValueError::new_err(format!("lists are nested more than {MAX_DEPTH} levels deep"))
}

/// Returns the value of Python that a value of a program becomes.
pub(crate) fn to_python<'py>(py: Python<'py>, data: &Data) -> PyResult<Bound<'py, PyAny>> {
    convert(py, data, MAX_DEPTH)
}

fn convert<'py>(py: Python<'py>, data: &Data, depth: u32) -> PyResult<Bound<'py, PyAny>> {
    let depth = depth.checked_sub(1).ok_or_else(too_deep)?;
    let all =
        |items: &[Data]| items.iter().map(|item| convert(py, item, depth)).collect::<PyResult<Vec<_>>>();
    let array = |code: &str, bytes: Vec<u8>| {
        let array = classes(py)?.array.bind(py).call1((code,))?;
        array.call_method1("frombytes", (PyBytes::new(py, &bytes),))?;
        Ok::<_, PyErr>(array)
    };
    Ok(match data {
        Data::Nil => py.None().into_bound(py),
        Data::True => PyBool::new(py, true).to_owned().into_any(),
        Data::Integer(value) => value.into_pyobject(py)?.into_any(),
        Data::BigInteger(value) => value.into_pyobject(py)?.into_any(),
        Data::Ratio(numerator, denominator) => {
            classes(py)?.fraction.bind(py).call1((numerator, denominator))?
        }
        Data::Float(value) => PyFloat::new(py, *value).into_any(),
        Data::Character(value) => classes(py)?.character.bind(py).call1((value.to_string(),))?,
        Data::String(value) => PyString::new(py, value).into_any(),
        Data::Keyword(name) => classes(py)?.exact_keyword.bind(py).call1((name,))?,
        Data::Symbol(name) => classes(py)?.exact_symbol.bind(py).call1((name,))?,
        Data::List(items) => PyList::new(py, all(items)?)?.into_any(),
        Data::DottedList(items, tail) => {
            let items = PyList::new(py, all(items)?)?;
            classes(py)?.dotted.bind(py).call1((items, convert(py, tail, depth)?))?
        }
        Data::Vector(items) => PyTuple::new(py, all(items)?)?.into_any(),
        Data::Table(entries) => {
            let table = classes(py)?.table.bind(py).call0()?;
            for (key, value) in entries {
                let (key, value) = (convert(py, key, depth)?, convert(py, value, depth)?);
                if table.contains(&key).map_err(|_| no_key(&key))? {
                    return Err(PyValueError::new_err(format!("two keys of a table are {key} in Python")));
                }
                table.set_item(key, value)?;
            }
            table
        }
        Data::Packed(PackedVector::Bytes(bytes)) => PyBytes::new(py, bytes).into_any(),
        Data::Packed(PackedVector::Integers(integers)) => {
            array("q", integers.iter().flat_map(|n| n.to_ne_bytes()).collect())?
        }
        Data::Packed(PackedVector::Floats(floats)) => {
            array("d", floats.iter().flat_map(|x| x.to_ne_bytes()).collect())?
        }
        Data::Opaque(_) => match held(py, data) {
            Some(object) => object.into_bound(py),
            None => Bound::new(py, ProgramObject(data.clone()))?.into_any(),
        },
    })
}

/// Returns the value of a program that a value of Python becomes.
pub(crate) fn to_data(object: &Bound<'_, PyAny>) -> PyResult<Data> {
    read(object, MAX_DEPTH)
}

fn read(object: &Bound<'_, PyAny>, depth: u32) -> PyResult<Data> {
    let depth = depth.checked_sub(1).ok_or_else(too_deep)?;
    let py = object.py();
    let all = |items: Vec<Bound<'_, PyAny>>| {
        items.iter().map(|item| read(item, depth)).collect::<PyResult<Vec<Data>>>()
    };
    if object.is_none() {
        return Ok(Data::Nil);
    }
    if let Ok(value) = object.cast::<PyBool>() {
        return Ok(Data::boolean(value.is_true()));
    }
    if object.is_instance_of::<PyInt>() {
        return Ok(match object.extract::<i64>() {
            Ok(value) => Data::Integer(value),
            Err(_) => of_integer(object.extract::<BigInt>()?),
        });
    }
    if let Ok(value) = object.cast::<PyFloat>() {
        return Ok(Data::Float(value.value()));
    }
    if let Ok(value) = object.cast::<PyString>() {
        return Ok(Data::String(value.to_cow()?.into_owned()));
    }
    if let Ok(value) = object.cast::<PyList>() {
        return Ok(Data::list(all(value.iter().collect())?));
    }
    if let Ok(value) = object.cast::<PyTuple>() {
        return Ok(Data::Vector(all(value.iter().collect())?));
    }
    if let Ok(value) = object.cast::<PyDict>() {
        if !object.is_exact_instance_of::<PyDict>() && object.is_instance(classes(py)?.table.bind(py))? {
            let entries = value.iter().map(|(key, value)| Ok((read(&key, depth)?, read(&value, depth)?)));
            return entries.collect::<PyResult<_>>().map(Data::Table);
        }
        return properties(value, depth);
    }
    if let Ok(value) = object.cast::<PyBytes>() {
        return Ok(Data::bytes(value.as_bytes().to_vec()));
    }
    if let Ok(value) = object.cast::<ProgramObject>() {
        return returned(value.get());
    }
    let classes = classes(py)?;
    let is = |class: &Py<PyAny>| object.is_instance(class.bind(py));
    let name = |attribute: &str| object.getattr(attribute)?.extract::<String>();
    if is(&classes.keyword)? {
        return Ok(Data::Keyword(name("name")?));
    }
    if is(&classes.symbol)? {
        return Ok(Data::Symbol(name("name")?));
    }
    if is(&classes.character)? {
        let text = name("text")?;
        return Ok(Data::Character(text.chars().next().unwrap_or('\0')));
    }
    if is(&classes.fraction)? {
        let part = |name: &str| object.getattr(name)?.extract::<BigInt>();
        return Ok(ratio(part("numerator")?, part("denominator")?));
    }
    if is(&classes.dotted)? {
        let items = all(object.getattr("items")?.try_iter()?.collect::<PyResult<_>>()?)?;
        return Ok(Data::DottedList(items, Box::new(read(&object.getattr("tail")?, depth)?)));
    }
    if is(&classes.object)? {
        return Ok(hold(object.getattr("value")?.unbind()));
    }
    vector(object, depth)
}

fn ratio(numerator: BigInt, denominator: BigInt) -> Data {
    if denominator == BigInt::from(1) { of_integer(numerator) } else { Data::Ratio(numerator, denominator) }
}

/// Returns the property list of a dictionary, whose keys become keywords: `max_speed` is `:MAX-SPEED`.
fn properties(dictionary: &Bound<'_, PyDict>, depth: u32) -> PyResult<Data> {
    let mut items = Vec::new();
    for (key, value) in dictionary.iter() {
        let Ok(name) = key.extract::<String>() else {
            let name = key.get_type().name()?.to_string();
            return Err(PyTypeError::new_err(format!("a key of a dictionary is a text, not of type {name}")));
        };
        items.push(Data::Keyword(name.replace('_', "-").to_uppercase()));
        items.push(read(&value, depth)?);
    }
    Ok(Data::list(items))
}

/// Returns the vector of numbers of an object with a buffer, such as an array of numpy; the number of one
/// without dimensions.
fn vector(object: &Bound<'_, PyAny>, depth: u32) -> PyResult<Data> {
    let py = object.py();
    let Ok(view) = py.import("builtins")?.getattr("memoryview")?.call1((object,)) else {
        let name = object.get_type().name()?.to_string();
        let text = format!("a value of type {name} has no counterpart in ESL: wrap it as esl.Object(value)");
        return Err(PyTypeError::new_err(text));
    };
    match view.getattr("ndim")?.extract::<usize>()? {
        0 => return read(&object.call_method0("item")?, depth),
        1 => {}
        dimensions => {
            let text = format!(
                "an array of {dimensions} dimensions has no counterpart in ESL: pass its shape and \
                 `array.ravel()`, or `array.tolist()`"
            );
            return Err(PyTypeError::new_err(text));
        }
    }
    let format: String = view.getattr("format")?.extract()?;
    let bytes = view.call_method0("tobytes")?;
    let bytes = bytes.cast::<PyBytes>()?.as_bytes();
    macro_rules! numbers {
        ($ty:ty => $target:ty) => {
            bytes
                .chunks_exact(size_of::<$ty>())
                .map(|chunk| <$ty>::from_ne_bytes(chunk.try_into().unwrap_or_default()) as $target)
                .collect::<Vec<$target>>()
        };
    }
    let no_counterpart = |format: &str| {
        PyTypeError::new_err(format!(
            "a buffer of elements `{format}` has no counterpart in ESL: convert it, as by \
             `array.astype(\"float64\")` or `array.tolist()`"
        ))
    };
    let size = view.getattr("itemsize")?.extract::<usize>()?;
    let native = if cfg!(target_endian = "little") { ['@', '=', '<'] } else { ['@', '=', '>'] };
    Ok(match (format.trim_start_matches(native), size) {
        ("B" | "c", 1) => Data::bytes(bytes.to_vec()),
        ("d", 8) => Data::floats(numbers!(f64 => f64)),
        ("f", 4) => Data::floats(numbers!(f32 => f64)),
        ("b", 1) => Data::integers(numbers!(i8 => i64)),
        ("h", 2) => Data::integers(numbers!(i16 => i64)),
        ("H", 2) => Data::integers(numbers!(u16 => i64)),
        ("i" | "l", 4) => Data::integers(numbers!(i32 => i64)),
        ("I" | "L", 4) => Data::integers(numbers!(u32 => i64)),
        ("q" | "l", 8) => Data::integers(numbers!(i64 => i64)),
        ("Q" | "L", 8) => {
            let numbers = numbers!(u64 => u64);
            let fitting: Result<Vec<i64>, _> = numbers.iter().map(|&n| i64::try_from(n)).collect();
            match fitting {
                Ok(integers) => Data::integers(integers),
                Err(_) => Data::Vector(numbers.into_iter().map(|n| of_integer(n.into())).collect()),
            }
        }
        _ => return Err(no_counterpart(&format)),
    })
}

/// Returns an integer of any size as data.
fn of_integer(value: BigInt) -> Data {
    i64::try_from(&value).map_or(Data::BigInteger(value), Data::Integer)
}
