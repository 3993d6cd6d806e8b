//! Delivery of messages to the inputs of the subscriptions that they are for.

use esl_bytecode::Bytes;
use esl_host::{HostInput, IntoDatum};
use rumqttc::QoS;

use super::ClientState;
use super::text::matches;

/// A message of the broker's.
pub(super) struct Message {
    pub(super) topic: String,
    pub(super) payload: Bytes,
    /// Whether the broker has kept it for new subscribers.
    pub(super) is_kept: bool,
}

/// A subscription of the program's.
pub(super) struct Subscription {
    pub(super) number: u64,
    pub(super) filter: String,
    pub(super) level: QoS,
    pub(super) input: HostInput,
    /// Whether the input gets payloads as bytes; otherwise as texts.
    pub(super) as_bytes: bool,
}

/// Delivers the messages of a client in their order, without end. While an input has no room, the messages
/// behind wait.
pub(super) async fn deliver(shared: &ClientState) {
    loop {
        let next = shared.state().messages.pop_front();
        let Some(Message { topic, payload, is_kept }) = next else {
            shared.came.notified().await;
            continue;
        };
        let inputs: Vec<(HostInput, bool)> = {
            let state = shared.state();
            let wanted = state.subscriptions.iter().filter(|known| matches(&known.filter, &topic));
            wanted.map(|known| (known.input.clone(), known.as_bytes)).collect()
        };
        for (input, as_bytes) in inputs {
            let payload = if as_bytes {
                payload.clone().into_datum()
            } else {
                String::from_utf8_lossy(&payload).as_ref().into_datum()
            };
            // The program may have closed the input.
            _ = input.signal(vec![topic.as_str().into_datum(), payload, is_kept.into_datum()]).await;
        }
        shared.taken.notify_one();
    }
}
