//! Structures of Rust as data, and back, by serde.
//!
//! A struct is a property list, whose keys are the names of the fields as keywords, with `-` for `_`. A map
//! is an association list. A variant of an enum is its keyword, or a list that begins with it. `None` and
//! `()` are `NIL`. From data a struct is read from a property list, an association list or a hash table,
//! with keys that are symbols, keywords or strings.

mod read;
#[cfg(test)]
mod tests;
mod write;

use std::fmt;

use serde::de::{self, DeserializeOwned};
use serde::{Serialize, ser};

use read::Reading;
use write::ToData;

use super::{Data, FromData};

/// A structure of Rust, as an argument or a value of functions of the embedder's.
///
/// ```
/// use esl::Engine;
/// use esl::data::Structure;
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Deserialize, Serialize)]
/// struct Pose {
///     x: f64,
///     frame_name: String,
///     covariance: Option<Vec<f64>>,
/// }
///
/// let mut engine = Engine::new()?;
/// engine.define("MIRROR", "(pose)", "The pose on the other side.", |call| {
///     let Structure(pose): Structure<Pose> = call.get("pose")?;
///     Ok(Structure(Pose { x: -pose.x, ..pose }))
/// })?;
/// let mirrored = engine.eval("(mirror '(:frame-name \"map\" :x 2.5))")?;
/// assert_eq!(mirrored.to_string(), "(:X -2.5 :FRAME-NAME \"map\" :COVARIANCE NIL)");
/// assert_eq!(mirrored.to_structure::<Pose>().expect("it is a pose").x, -2.5);
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Structure<T>(pub T);

impl<T: Serialize> From<Structure<T>> for Data {
    /// Returns the structure as data; `NIL` for one that says itself that it cannot be serialized.
    fn from(structure: Structure<T>) -> Data {
        Data::from_structure(&structure.0).unwrap_or(Data::Nil)
    }
}

impl<T: DeserializeOwned> FromData for Structure<T> {
    const TYPE: &'static str = "LIST";

    fn from_data(data: &Data) -> Option<Structure<T>> {
        data.to_structure().ok().map(Structure)
    }
}

/// Reason why data are not of a structure, or a structure has no data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructureError(String);

impl fmt::Display for StructureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for StructureError {}

impl ser::Error for StructureError {
    fn custom<T: fmt::Display>(message: T) -> StructureError {
        StructureError(message.to_string())
    }
}

impl de::Error for StructureError {
    fn custom<T: fmt::Display>(message: T) -> StructureError {
        StructureError(message.to_string())
    }
}

impl Data {
    /// Returns the data that a structure of Rust is.
    ///
    /// # Errors
    /// [`StructureError`], if the structure says that it cannot be serialized.
    pub fn from_structure<T: Serialize + ?Sized>(structure: &T) -> Result<Data, StructureError> {
        structure.serialize(ToData)
    }

    /// Returns the structure of Rust that the data are.
    ///
    /// # Errors
    /// [`StructureError`], which says what was expected and what was found.
    pub fn to_structure<T: DeserializeOwned>(&self) -> Result<T, StructureError> {
        T::deserialize(Reading(self))
    }
}

/// Returns the keyword for a name of Rust: `heading_deg` is `:HEADING-DEG`, `TurnTo` is `:TURN-TO`.
fn keyword(name: &str) -> Data {
    let mut words = String::new();
    let mut was_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && was_lower {
            words.push('-');
        }
        was_lower = c.is_lowercase() || c.is_ascii_digit();
        words.extend(if c == '_' { '-' } else { c }.to_uppercase());
    }
    Data::Keyword(words)
}

/// Returns whether data name a field or a variant: a keyword, another symbol, or the very string.
fn is_named(key: &Data, name: &str) -> bool {
    match key {
        Data::Keyword(key) | Data::Symbol(key) => keyword(name) == Data::Keyword(key.clone()),
        Data::String(key) => key == name,
        _ => false,
    }
}

/// Returns the name of Rust for a key.
fn field_name(key: &Data) -> Option<String> {
    match key {
        Data::Keyword(name) | Data::Symbol(name) => Some(name.to_lowercase().replace('-', "_")),
        Data::String(name) => Some(name.clone()),
        _ => None,
    }
}
