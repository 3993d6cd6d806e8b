//! The task of a client on the event loop, which keeps its connection up.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use rumqttc::{AsyncClient, Event, EventLoop, Outgoing, Packet, QoS, SubscribeReasonCode};
use tokio::sync::watch;

use super::delivery::Message;
use super::room::await_room;
use super::{ClientState, GOODBYE, PAUSES};

/// Keeps the connection of a client up.
pub(super) struct Driver {
    pub(super) client: AsyncClient,
    pub(super) events: EventLoop,
    pub(super) shared: Arc<ClientState>,
    pub(super) close: watch::Receiver<bool>,
    /// Numbers of the messages of level 2 that were delivered and that the broker has not released.
    pub(super) delivered: HashSet<u16>,
}

impl Driver {
    pub(super) async fn run(mut self) {
        let mut pause = PAUSES.0;
        loop {
            let next = async {
                await_room(&self.shared, &mut self.events).await;
                self.events.poll().await
            };
            let event = tokio::select! {
                biased;
                _ = self.close.wait_for(|&is_closing| is_closing) => None,
                event = next => Some(event),
            };
            let Some(event) = event else { return self.say_goodbye().await };
            match event {
                Ok(event) => {
                    if matches!(event, Event::Incoming(_)) {
                        pause = PAUSES.0;
                    }
                    self.note(event);
                }
                Err(error) => {
                    // These belong to the connection that is lost, as the numbers in them do.
                    for event in std::mem::take(&mut self.events.state.events) {
                        self.note(event);
                    }
                    {
                        let mut state = self.shared.state();
                        state.problem = Some(error.to_string());
                        // Operations that wait for an answer learn that none will come.
                        state.subscribing.clear();
                        state.asked.clear();
                        state.publishing.clear();
                        state.sent.clear();
                        state.handing_over = 0;
                    }
                    tokio::select! {
                        _ = self.close.wait_for(|&is_closing| is_closing) => return,
                        () = tokio::time::sleep(pause) => {}
                    }
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            Event::Incoming(packet) => self.take_in(packet),
            Event::Outgoing(Outgoing::Publish(0)) => self.shared.state().hand_over_one(),
            Event::Outgoing(Outgoing::Publish(number)) => {
                let mut state = self.shared.state();
                if !state.sent.contains_key(&number)
                    && let Some((_, waiting)) = state.publishing.pop_front()
                {
                    state.sent.insert(number, waiting);
                }
            }
            Event::Outgoing(Outgoing::Subscribe(number)) => {
                let mut state = self.shared.state();
                if let Some(waiting) = state.subscribing.pop_front() {
                    state.asked.insert(number, waiting);
                }
            }
            Event::Outgoing(_) => {}
        }
    }

    fn take_in(&mut self, packet: Packet) {
        let mut state = self.shared.state();
        match packet {
            Packet::ConnAck(_) => {
                // The broker knows nothing of an earlier session, since each begins anew.
                self.delivered.clear();
                state.problem = None;
                // Of two subscriptions to one filter the later one holds.
                let filters: BTreeMap<String, QoS> =
                    state.subscriptions.iter().map(|known| (known.filter.clone(), known.level)).collect();
                for (filter, level) in filters {
                    // There is room for all but a great many, which the broker would have to know still.
                    if self.client.try_subscribe(filter, level).is_ok() {
                        state.subscribing.push_back(None);
                    }
                }
            }
            Packet::SubAck(answer) => {
                let is_granted = !answer.return_codes.contains(&SubscribeReasonCode::Failure);
                if let Some(Some(waiting)) = state.asked.remove(&answer.pkid) {
                    // The call may have been left.
                    _ = waiting.send(is_granted);
                }
            }
            Packet::PubAck(rumqttc::PubAck { pkid }) | Packet::PubComp(rumqttc::PubComp { pkid }) => {
                if let Some(waiting) = state.sent.remove(&pkid) {
                    // The call may have been left.
                    _ = waiting.send(());
                }
            }
            Packet::PubRel(release) => _ = self.delivered.remove(&release.pkid),
            Packet::Publish(message) => {
                if message.qos == QoS::ExactlyOnce && !self.delivered.insert(message.pkid) {
                    return;
                }
                let (topic, is_kept) = (message.topic, message.retain);
                state.messages.push_back(Message { topic, payload: message.payload, is_kept });
                self.shared.came.notify_one();
            }
            _ => {}
        }
    }

    /// Sends what is to be sent, and ends the connection.
    async fn say_goodbye(mut self) {
        if self.shared.state().problem.is_some() || self.client.try_disconnect().is_err() {
            return;
        }
        let send_rest = async {
            while !matches!(self.events.poll().await, Ok(Event::Outgoing(Outgoing::Disconnect)) | Err(_)) {}
        };
        // A broker that does not take it is left.
        drop(tokio::time::timeout(GOODBYE, send_rest).await);
    }
}
