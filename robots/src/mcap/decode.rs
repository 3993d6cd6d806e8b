//! The payload of a message as data, by the schema in its file.

use std::sync::Arc;

use esl_bytecode::datum::Datum;
use esl_host::IntoDatum;

use super::index::{McapChannel, McapSchema};
use crate::message::{MessageType, TypeFault, Types, decode};

/// The form in which a program gets the payloads of a channel.
#[derive(Clone, Debug)]
pub enum MessageForm {
    /// Messages of ROS 2, in CDR.
    Ros(Arc<MessageType>),
    /// JSON, which the program parses.
    Json,
    /// Anything else: bytes.
    Bytes,
    /// The schema is wrong, for this reason.
    Invalid(String),
}

/// A payload as data, with the name of its form: `:MESSAGE`, `:JSON`, `:BYTES`, or `:FAULT` and the reason.
pub(super) struct DecodedPayload {
    pub(super) form: &'static str,
    pub(super) data: Datum,
}

impl MessageForm {
    /// Returns the form of a channel's payloads.
    pub fn of(channel: &McapChannel) -> MessageForm {
        match (channel.encoding.as_str(), &channel.schema) {
            ("cdr", Some(schema)) if schema.encoding == "ros2msg" => match message_type(schema) {
                Ok(found) => MessageForm::Ros(found),
                Err(reason) => MessageForm::Invalid(format!("the schema of {}: {reason}", channel.topic)),
            },
            ("json", _) => MessageForm::Json,
            _ => MessageForm::Bytes,
        }
    }

    /// Returns the hash of the type of a channel's messages, if they are of ROS 2: that which its writer
    /// states if the type is a part of an action or a service, whose hash its text does not tell.
    pub(super) fn hash(&self, channel: &McapChannel) -> Option<String> {
        let MessageForm::Ros(of_type) = self else { return None };
        let is_part = channel.schema.as_ref().is_some_and(|schema| schema.name != of_type.name());
        let stated = channel.metadata.get("topic_type_hash").filter(|_| is_part);
        Some(stated.map_or(of_type.hash(), String::as_str).to_owned())
    }

    /// Returns a payload as data.
    pub(super) fn decode(&self, topic: &str, payload: &esl_bytecode::Bytes) -> DecodedPayload {
        let fault = |reason: String| DecodedPayload { form: "FAULT", data: reason.into_datum() };
        match self {
            MessageForm::Bytes => {
                // A part would keep the whole chunk.
                let data = esl_bytecode::Bytes::copy_from_slice(payload).into_datum();
                DecodedPayload { form: "BYTES", data }
            }
            MessageForm::Json => match std::str::from_utf8(payload) {
                Ok(text) => DecodedPayload { form: "JSON", data: text.into_datum() },
                Err(_) => fault(format!("{topic}: the message is not text")),
            },
            MessageForm::Ros(of_type) => match decode(of_type, payload) {
                Ok(data) => DecodedPayload { form: "MESSAGE", data },
                Err(reason) => fault(format!("{topic}: {reason}")),
            },
            MessageForm::Invalid(reason) => fault(reason.clone()),
        }
    }
}

/// Returns the type that a schema of ROS 2 describes: by its own text, whose types come before those that
/// come with ESL.
fn message_type(schema: &McapSchema) -> Result<Arc<MessageType>, TypeFault> {
    // Parts of actions and services are messages in a text.
    let name = schema.name.replacen("/action/", "/msg/", 1).replacen("/srv/", "/msg/", 1);
    let types = Types::bundled();
    types.define(&name, &String::from_utf8_lossy(&schema.data))?;
    types.message(&name)
}
