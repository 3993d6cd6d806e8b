//! Topics of ROS 2 in a run that is replayed, in which no message comes from the network: their names and
//! types are in the recorded calls of the module `ros`, and their messages in calls and arrivals.
//!
//! Guarantees: a call that is not one of the module, or whose type is unknown here, is passed over.

use std::collections::HashMap;
use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{Incoming, News};

use crate::message::{MessageType, Types, encode};

/// A topic: its name, and the type of its messages.
type KnownTopic = (String, Arc<MessageType>);

/// The topics of a run.
pub(super) struct ReplayedTopics {
    types: Types,
    /// Those of subscriptions, by the names of their inputs.
    inputs: HashMap<String, KnownTopic>,
    /// Those of publishers, by the identities of their handles.
    publishers: HashMap<usize, KnownTopic>,
    /// Those of publishers that are being declared, by the numbers of the operations.
    declared: HashMap<u64, KnownTopic>,
    /// Number of operations begun so far.
    begun: u64,
}

/// Returns the text that a datum is.
fn text(datum: &Datum) -> Option<&str> {
    match datum.kind() {
        DatumKind::String(text) => Some(text),
        _ => None,
    }
}

/// Returns the identity of a handle.
fn handle(datum: &Datum) -> Option<usize> {
    match datum.kind() {
        DatumKind::Opaque(opaque) => Some(opaque.identity()),
        _ => None,
    }
}

impl ReplayedTopics {
    /// Creates none.
    pub(super) fn new() -> ReplayedTopics {
        ReplayedTopics {
            types: Types::bundled(),
            inputs: HashMap::new(),
            publishers: HashMap::new(),
            declared: HashMap::new(),
            begun: 0,
        }
    }

    fn topic(&self, name: &Datum, of_type: &Datum) -> Option<KnownTopic> {
        Some((text(name)?.to_owned(), self.types.message(text(of_type)?).ok()?))
    }

    /// Notes a call that returns at once. Calls `tell` with the message of a graph in memory, if it has one.
    pub(super) fn note_call(
        &self,
        name: &str,
        arguments: &[Datum],
        tell: impl FnOnce(&str, &MessageType, &Bytes),
    ) {
        match (name, arguments) {
            ("%ROS-DEFINE", [of_type, definition]) => {
                if let (Some(of_type), Some(definition)) = (text(of_type), text(definition)) {
                    // The program has been told of a fault.
                    _ = self.types.define(of_type, definition);
                }
            }
            ("%ROS-NOTE", [topic, of_type, message]) => {
                if let Some((topic, of_type)) = self.topic(topic, of_type)
                    && let Ok(payload) = encode(&of_type, message)
                {
                    tell(&topic, &of_type, &payload);
                }
            }
            _ => {}
        }
    }

    /// Notes a call that begins an operation. Calls `tell` with the message that it publishes.
    pub(super) fn note_operation(
        &mut self,
        name: &str,
        arguments: &[Datum],
        tell: impl FnOnce(&str, &MessageType, &Bytes),
    ) {
        self.begun += 1;
        match (name, arguments) {
            ("%ROS-SUBSCRIBE", [_, input, topic, of_type, ..]) => {
                if let (Some(input), Some(known)) = (text(input), self.topic(topic, of_type)) {
                    self.inputs.insert(input.to_owned(), known);
                }
            }
            ("%ROS-ADVERTISE", [_, topic, of_type, ..]) => {
                if let Some(known) = self.topic(topic, of_type) {
                    self.declared.insert(self.begun, known);
                }
            }
            ("%ROS-PUBLISH", [publisher, message]) => {
                let known = handle(publisher).and_then(|publisher| self.publishers.get(&publisher));
                if let Some((topic, of_type)) = known
                    && let Ok(payload) = encode(of_type, message)
                {
                    tell(topic, of_type, &payload);
                }
            }
            _ => {}
        }
    }

    /// Notes something that has come from outside. Calls `tell` with the message that it is.
    pub(super) fn note_arrival(&mut self, arrival: &Incoming, tell: impl FnOnce(&str, &MessageType, &Bytes)) {
        match arrival {
            Incoming::Message { input, arguments } => {
                if let Some((topic, of_type)) = self.inputs.get(&**input)
                    && let Some(message) = arguments.first()
                    && let Ok(payload) = encode(of_type, message)
                {
                    tell(topic, of_type, &payload);
                }
            }
            Incoming::Operation { number, news: News::Completed(values) } => {
                if let Some(known) = self.declared.remove(number)
                    && let Some(publisher) = values.first().and_then(handle)
                {
                    self.publishers.insert(publisher, known);
                }
            }
            Incoming::Operation { number, news: News::Failed(_) } => _ = self.declared.remove(number),
            _ => {}
        }
    }
}
