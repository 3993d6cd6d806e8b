//! Type descriptions, and their hashes RIHS01, by `hiroz-schema`.
//!
//! Guarantees: the hashes equal those of ROS 2; a test compares those of all bundled types.

use std::collections::BTreeMap;

use hiroz_schema::{
    FieldDescription, FieldTypeDescription, TypeDescription, TypeDescriptionMsg, TypeId, calculate_hash,
};

use super::definition::FieldExtent;
use super::message_type::{Element, MessageField, MessageType};

/// Returns the description of a type, without those of its parts.
pub(super) fn individual(name: &str, fields: &[MessageField]) -> TypeDescription {
    let mut described: Vec<FieldDescription> = fields.iter().map(field).collect();
    if described.is_empty() {
        // A structure of IDL has a member, and a message without fields one of this name.
        let field_type = FieldTypeDescription::primitive(TypeId::UINT8);
        described.push(named("structure_needs_at_least_one_member", field_type));
    }
    TypeDescription { type_name: name.to_owned(), fields: described }
}

fn field(field: &MessageField) -> FieldDescription {
    let (type_id, string_capacity, nested) = match &field.element {
        Element::Scalar(scalar) => (scalar.type_id(), 0, String::new()),
        Element::Text { is_wide, most } => {
            let type_id = match (is_wide, most) {
                (false, None) => TypeId::STRING,
                (false, Some(_)) => TypeId::BOUNDED_STRING,
                (true, None) => TypeId::WSTRING,
                (true, Some(_)) => TypeId::BOUNDED_WSTRING,
            };
            (type_id, most.unwrap_or(0), String::new())
        }
        Element::Message(message) => (TypeId::NESTED_TYPE, 0, message.name().to_owned()),
    };
    let (offset, capacity) = match field.extent {
        FieldExtent::One => (0, 0),
        FieldExtent::Fixed(count) => (TypeId::ARRAY_OFFSET, count),
        FieldExtent::Sequence(Some(most)) => (TypeId::BOUNDED_SEQUENCE_OFFSET, most),
        FieldExtent::Sequence(None) => (TypeId::UNBOUNDED_SEQUENCE_OFFSET, 0),
    };
    let field_type = FieldTypeDescription {
        type_id: type_id + offset,
        capacity: capacity as u64,
        string_capacity: string_capacity as u64,
        nested_type_name: nested,
    };
    named(&field.name, field_type)
}

fn named(name: &str, field_type: FieldTypeDescription) -> FieldDescription {
    FieldDescription { name: name.to_owned(), field_type, default_value: String::new() }
}

/// Returns the hash of a type.
pub(super) fn hash(own: &TypeDescription, referenced: &BTreeMap<String, TypeDescription>) -> String {
    let description = TypeDescriptionMsg {
        type_description: own.clone(),
        referenced_type_descriptions: referenced.values().cloned().collect(),
    };
    calculate_hash(&description).to_rihs_string()
}

/// Returns the hash of a service: of a structure of its request, its response, and the event that
/// introspection publishes.
pub(super) fn service_hash(
    name: &str,
    request: &MessageType,
    response: &MessageType,
    info: &MessageType,
) -> String {
    let nested =
        |field: &str, name: &str| named(field, FieldTypeDescription::nested(TypeId::NESTED_TYPE, name));
    let at_most_one = |field: &str, name: &str| {
        let type_id = TypeId::NESTED_TYPE_BOUNDED_SEQUENCE;
        named(field, FieldTypeDescription::nested_array(type_id, 1, name))
    };
    let event_name = format!("{name}_Event");
    let event = TypeDescription {
        type_name: event_name.clone(),
        fields: vec![
            nested("info", info.name()),
            at_most_one("request", request.name()),
            at_most_one("response", response.name()),
        ],
    };
    let own = TypeDescription {
        type_name: name.to_owned(),
        fields: vec![
            nested("request_message", request.name()),
            nested("response_message", response.name()),
            nested("event_message", &event_name),
        ],
    };
    let mut referenced = info.descriptions();
    referenced.extend(request.descriptions());
    referenced.extend(response.descriptions());
    referenced.insert(event_name, event);
    hash(&own, &referenced)
}
