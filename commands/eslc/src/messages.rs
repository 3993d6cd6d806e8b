//! The types of messages of ROS 2, for analyses: those that come with ESL, and those of the folders that
//! `AMENT_PREFIX_PATH` names.

use std::path::PathBuf;
use std::sync::LazyLock;

use esl_analysis::KnownField;
use esl_bytecode::kind::ValueType;
use esl_robots::message::{Element, FieldExtent, MessageField, Scalar, Types};

/// Returns the fields of a type; `None` if it has no definition.
pub(crate) fn fields(name: &str) -> Option<Vec<KnownField>> {
    static TYPES: LazyLock<Types> = LazyLock::new(|| {
        let path = std::env::var_os("AMENT_PREFIX_PATH").unwrap_or_default();
        let folders: Vec<PathBuf> = std::env::split_paths(&path).filter(|folder| folder.is_dir()).collect();
        Types::with_folders(folders)
    });
    let message = TYPES.message(name).ok()?;
    let field = |field: &MessageField| KnownField {
        keyword: field.keyword.as_symbol().map(|keyword| keyword.name().to_owned()).unwrap_or_default(),
        part: match &field.element {
            Element::Message(part) => Some(part.name().to_owned()),
            Element::Scalar(_) | Element::Text { .. } => None,
        },
        is_array: !matches!(field.extent, FieldExtent::One),
        values: values(field),
    };
    Some(message.fields().iter().map(field).collect())
}

/// Returns the values that a program may give for a field. Symbols name constants of the type.
fn values(field: &MessageField) -> ValueType {
    if field.extent != FieldExtent::One {
        return ValueType::LIST.or(ValueType::OTHER_ARRAY);
    }
    match &field.element {
        Element::Message(message) if message.is_time() => ValueType::LIST.or(ValueType::REAL),
        Element::Message(_) => ValueType::LIST,
        Element::Scalar(Scalar::Bool) => ValueType::SYMBOL,
        Element::Scalar(scalar) if scalar.is_float() => ValueType::REAL.or(ValueType::OTHER_SYMBOL),
        Element::Scalar(_) => ValueType::INTEGER.or(ValueType::OTHER_SYMBOL),
        Element::Text { .. } => ValueType::STRING.or(ValueType::OTHER_SYMBOL),
    }
}
