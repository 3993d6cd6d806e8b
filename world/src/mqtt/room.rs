//! When the next packet is read: while there is room for messages, and while the program waits for an answer,
//! which comes behind messages.

use std::time::Duration;

use rumqttc::{EventLoop, Packet};

use super::{ClientState, MOST_KEPT, State};

/// Most messages that are kept while the program waits for an answer.
const MOST_AHEAD: usize = 64 * MOST_KEPT;

impl State {
    /// Returns whether the program waits for an answer of the broker, or until a message is sent.
    fn is_asked(&self) -> bool {
        self.handing_over > 0
            || self.subscribing.iter().any(Option::is_some)
            || self.asked.values().any(Option::is_some)
    }

    /// Notes that a message is no longer being handed over.
    pub(super) fn hand_over_one(&mut self) {
        // A connection that was lost has taken some with it.
        self.handing_over = self.handing_over.saturating_sub(1);
    }

    fn has_room(&self) -> bool {
        self.messages.len() < if self.is_asked() { MOST_AHEAD } else { MOST_KEPT }
    }
}

/// A message that is being handed over: until it is sent, or acknowledged, the connection is served.
pub(super) struct HandingOver<'a>(Option<&'a ClientState>);

impl HandingOver<'_> {
    pub(super) fn begin(shared: &ClientState) -> HandingOver<'_> {
        shared.state().handing_over += 1;
        shared.taken.notify_one();
        HandingOver(Some(shared))
    }

    /// Leaves it to the connection to note that the message is sent.
    pub(super) fn goes_on(mut self) {
        self.0 = None;
    }
}

impl Drop for HandingOver<'_> {
    fn drop(&mut self) {
        if let Some(shared) = self.0 {
            shared.state().hand_over_one();
        }
    }
}

/// Waits until the next packet is to be read. Meanwhile the broker gets signs of life, so that it does not
/// take the client for lost.
pub(super) async fn await_room(shared: &ClientState, events: &mut EventLoop) {
    if shared.state().has_room() {
        return;
    }
    let between = Some(events.mqtt_options.keep_alive()).filter(|time| !time.is_zero());
    while !shared.state().has_room() {
        tokio::select! {
            () = shared.taken.notified() => {}
            () = tokio::time::sleep(between.unwrap_or(Duration::MAX) / 2) => {
                if let Some(network) = &mut events.network {
                    // A connection that is lost is found when it is read.
                    _ = network.write(Packet::PingReq).await;
                    _ = network.flush().await;
                }
            }
        }
    }
    // The answers come behind the messages that were not read.
    events.state.await_pingresp = false;
}
