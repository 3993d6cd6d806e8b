//! The state of a link: its peers, where systems are heard, the subscriptions, and what was wrong.
//!
//! Guarantees: a message is delivered only to subscriptions that it is for, and only while its system is
//! heard from one peer; memory is bounded, whatever arrives; each kind of fault is reported once for each
//! source.
//! Not here: sockets and lines (`transport`).

use std::collections::{HashMap, HashSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostInput, HostObject, IntoDatum, Keyword, Sender};
use tokio::sync::{mpsc, watch};

use super::definitions::MavlinkMessage;
use super::frame::{FrameOrigin, MavlinkFrame, StreamPart, first_frame, frame, scan};
use super::payload::{PayloadBytes, decode, padded};
use super::signing::Signing;
use crate::zenoh::delivery::InputDelivery;

/// Most pairs of system and component that are known at a time.
const MOST_ROUTES: usize = 256;
/// Most faults that are reported.
const MOST_REPORTS: usize = 100;
/// Time after which a silent system may be heard from another peer.
const HOLD: Duration = Duration::from_secs(5);

/// The other end of a part of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum LinkPeer {
    Datagrams(SocketAddr),
    Stream(u64),
}

/// Bytes that are to be sent, with the address if they are a datagram.
pub(super) type Packet = (Arc<[u8]>, Option<SocketAddr>);

/// A way out of the link.
struct LinkPort {
    number: u64,
    /// Whether it sends datagrams, and the address that all of them have.
    datagrams: Option<Option<SocketAddr>>,
    packets: mpsc::Sender<Packet>,
}

struct Route {
    peer: LinkPeer,
    heard: Instant,
}

/// Messages that a subscription is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MessageSource {
    Any,
    /// Those of the vehicle, of all its components or of its autopilot.
    Target {
        all_components: bool,
    },
    /// Those of a system, and of a component of it.
    System(u8, Option<u8>),
}

/// A subscription of the program's, which signals an input with messages.
pub(super) struct MavlinkSubscription {
    delivery: Arc<InputDelivery>,
    link: std::sync::Weak<LinkCore>,
}

impl HostObject for MavlinkSubscription {
    const KIND: &'static str = "MAVLINK-SUBSCRIPTION";
}

impl MavlinkSubscription {
    /// Ends it.
    pub(super) fn end(&self) {
        self.delivery.end();
        if let Some(link) = self.link.upgrade() {
            link.state().remove(&self.delivery);
        }
    }
}

impl Drop for MavlinkSubscription {
    fn drop(&mut self) {
        self.end();
    }
}

/// A subscription as the link has it.
struct SubscribedInput {
    source: MessageSource,
    delivery: Arc<InputDelivery>,
}

/// Numbers of what has happened.
#[derive(Clone, Copy, Debug, Default)]
struct LinkCounts {
    received: u64,
    lost: u64,
    malformed: u64,
    garbage: u64,
    unknown: u64,
    unsigned: u64,
    spoofed: u64,
    sent: u64,
    unsent: u64,
}

#[derive(Default)]
struct LinkState {
    ports: Vec<LinkPort>,
    made: u64,
    routes: HashMap<(u8, u8), Route>,
    entries: HashMap<u32, Vec<SubscribedInput>>,
    everything: Vec<SubscribedInput>,
    target: Option<(u8, u8)>,
    signing: Option<Signing>,
    sequence: u8,
    sequences: HashMap<(u8, u8), u8>,
    counts: LinkCounts,
    reported: HashSet<(&'static str, String)>,
    /// While it is there, a program that waits for messages is not deadlocked.
    sender: Option<Sender>,
    has_ended: bool,
}

/// A link, as its tasks have it.
pub(super) struct LinkCore {
    own: (u8, u8),
    is_first_version: bool,
    state: Mutex<LinkState>,
    reports: HostInput,
    closing: watch::Sender<bool>,
}

/// A link of the program's.
pub(super) struct MavlinkLink(pub(super) Arc<LinkCore>);

impl HostObject for MavlinkLink {
    const KIND: &'static str = "MAVLINK-LINK";
}

impl Drop for MavlinkLink {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl LinkState {
    fn remove(&mut self, delivery: &Arc<InputDelivery>) {
        let is_other = |entry: &SubscribedInput| !Arc::ptr_eq(&entry.delivery, delivery);
        self.everything.retain(is_other);
        self.entries.retain(|_, entries| {
            entries.retain(is_other);
            !entries.is_empty()
        });
    }

    /// Reports a fault of a source, unless that was done.
    fn report(&mut self, reports: &HostInput, kind: &'static str, source: &str, text: &str) {
        let key = (kind, source.to_owned());
        if self.reported.len() >= MOST_REPORTS || !self.reported.insert(key) {
            return;
        }
        let arguments = vec![Keyword(kind).into_datum(), format!("{source}: {text}").into_datum()];
        // Without room, the counts tell it.
        _ = reports.try_signal(arguments);
    }

    /// Notes that a system is heard from a peer. Returns whether it may be.
    fn note_route(&mut self, from: (u8, u8), peer: LinkPeer, now: Instant) -> bool {
        if let Some(route) = self.routes.get_mut(&from) {
            if route.peer != peer && now.duration_since(route.heard) < HOLD {
                return false;
            }
            *route = Route { peer, heard: now };
            return true;
        }
        if self.routes.len() >= MOST_ROUTES {
            self.routes.retain(|_, route| now.duration_since(route.heard) < HOLD);
            let routes = &self.routes;
            self.sequences.retain(|from, _| routes.contains_key(from));
        }
        let has_room = self.routes.len() < MOST_ROUTES;
        if has_room {
            self.routes.insert(from, Route { peer, heard: now });
        }
        has_room
    }

    fn note_sequence(&mut self, from: (u8, u8), sequence: u8) {
        let missing = self
            .sequences
            .insert(from, sequence)
            .map_or(0, |last| sequence.wrapping_sub(last).wrapping_sub(1));
        // A larger one is a frame that is repeated or late.
        if missing < 128 {
            self.counts.lost += u64::from(missing);
        }
    }

    fn deliver(&self, frame: &MavlinkFrame<'_>) {
        let of_message = self.entries.get(&frame.message.number).into_iter().flatten();
        let mut made: Option<Datum> = None;
        for entry in of_message.chain(&self.everything) {
            let is_for = match entry.source {
                MessageSource::Any => true,
                MessageSource::Target { all_components } => self.target.is_some_and(|(system, component)| {
                    system == frame.system && (all_components || component == frame.component)
                }),
                MessageSource::System(system, component) => {
                    system == frame.system && component.is_none_or(|component| component == frame.component)
                }
            };
            if !is_for {
                continue;
            }
            entry.delivery.put(frame.payload.len(), || {
                let decoded = made.get_or_insert_with(|| decode(frame.message, &padded(frame.payload)));
                vec![
                    decoded.clone(),
                    frame.message.keyword.clone(),
                    byte(frame.system),
                    byte(frame.component),
                ]
            });
        }
    }
}

/// Returns the number of a system or a component, which each message has.
fn byte(number: u8) -> Datum {
    static BYTES: OnceLock<Vec<Datum>> = OnceLock::new();
    let bytes = BYTES.get_or_init(|| (0..=255_i64).map(IntoDatum::into_datum).collect());
    bytes[usize::from(number)].clone()
}

impl LinkCore {
    /// Returns a link without ports, whose faults signal an input.
    pub(super) fn new(own: (u8, u8), is_first_version: bool, reports: HostInput, sender: Sender) -> LinkCore {
        LinkCore {
            own,
            is_first_version,
            state: Mutex::new(LinkState { sender: Some(sender), ..LinkState::default() }),
            reports,
            closing: watch::Sender::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, LinkState> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns what is told when the link is closed.
    pub(super) fn closing(&self) -> watch::Receiver<bool> {
        self.closing.subscribe()
    }

    /// Closes the link: its tasks end, and nothing is delivered any more.
    pub(super) fn close(&self) {
        let mut state = self.state();
        state.has_ended = true;
        state.ports.clear();
        state.routes.clear();
        state.entries.clear();
        state.everything.clear();
        state.sender = None;
        drop(state);
        self.closing.send_replace(true);
    }

    /// Adds a way out; returns its number. `datagrams` is as in [`LinkPort`].
    pub(super) fn add_port(
        &self,
        datagrams: Option<Option<SocketAddr>>,
        packets: mpsc::Sender<Packet>,
    ) -> u64 {
        let mut state = self.state();
        state.made += 1;
        let number = state.made;
        if !state.has_ended {
            state.ports.push(LinkPort { number, datagrams, packets });
        }
        number
    }

    /// Removes a way out, with the routes through it.
    pub(super) fn remove_port(&self, number: u64) {
        let mut state = self.state();
        state.ports.retain(|port| port.number != number);
        state.routes.retain(|_, route| route.peer != LinkPeer::Stream(number));
    }

    /// Returns the number of ways out.
    pub(super) fn ports(&self) -> usize {
        self.state().ports.len()
    }

    /// Has frames signed with a key, and those of others checked.
    pub(super) fn sign(&self, signing: Signing) {
        self.state().signing = Some(signing);
    }

    /// Has this be the vehicle.
    pub(super) fn set_target(&self, target: (u8, u8)) {
        self.state().target = Some(target);
    }

    /// Takes bytes that came from a peer. Returns how many are done with, as [`scan`] does.
    pub(super) fn receive(&self, peer: LinkPeer, label: &dyn Fn() -> String, bytes: &[u8]) -> usize {
        let now = Instant::now();
        let mut state = self.state();
        let state = &mut *state;
        let whole = matches!(peer, LinkPeer::Datagrams(_));
        scan(bytes, whole, |found| match found {
            StreamPart::Frame(frame) => self.take_frame(state, &frame, (peer, label), now),
            StreamPart::Garbage(count) => state.counts.garbage += count as u64,
            StreamPart::Malformed => {
                state.counts.malformed += 1;
                let text = "frames with a wrong checksum are dropped";
                self.report(state, "MALFORMED-FRAME", label, text);
            }
            StreamPart::Unknown(number) => {
                state.counts.unknown += 1;
                let text = format!("messages of unknown numbers, such as {number}, are dropped");
                self.report(state, "UNKNOWN-MESSAGE", label, &text);
            }
        })
    }

    fn report(&self, state: &mut LinkState, kind: &'static str, label: &dyn Fn() -> String, text: &str) {
        if state.reported.len() < MOST_REPORTS {
            state.report(&self.reports, kind, &label(), text);
        }
    }

    fn take_frame(
        &self,
        state: &mut LinkState,
        frame: &MavlinkFrame<'_>,
        (peer, label): (LinkPeer, &dyn Fn() -> String),
        now: Instant,
    ) {
        if let Some(signing) = &mut state.signing
            && !signing.accepts(frame)
        {
            state.counts.unsigned += 1;
            let text = "messages without a valid signature are dropped";
            return self.report(state, "INVALID-SIGNATURE", label, text);
        }
        let from = (frame.system, frame.component);
        if from == self.own || !state.note_route(from, peer, now) {
            state.counts.spoofed += 1;
            let text = format!(
                "messages as component {} of system {}, which is heard elsewhere, are dropped",
                from.1, from.0
            );
            return self.report(state, "DUPLICATE-SYSTEM", label, &text);
        }
        state.counts.received += 1;
        state.note_sequence(from, frame.sequence);
        state.deliver(frame);
    }

    /// Sends a message: to the peer that has its target, if that is known, and otherwise to all. Returns
    /// whether there was one.
    pub(super) fn send(&self, message: &MavlinkMessage, payload: &PayloadBytes) -> Result<bool, HostFailure> {
        let mut state = self.state();
        let (system, component) = self.own;
        let origin = FrameOrigin { system, component, sequence: state.sequence };
        state.sequence = state.sequence.wrapping_add(1);
        let is_signed = state.signing.is_some();
        let bytes = match self.is_first_version {
            true => first_frame(message, payload, origin).ok_or_else(|| {
                let reason = format!("version 1 of MAVLink has no message {}", message.keyword);
                HostFailure::new("MAVLINK-ERROR", reason.to_ascii_lowercase())
            })?,
            false => {
                let mut bytes = frame(message, payload, origin, is_signed);
                if let Some(signing) = &mut state.signing {
                    signing.sign(&mut bytes);
                }
                bytes
            }
        };
        let at = |place: Option<usize>| place.map_or(0, |place| payload[place]);
        let target = (at(message.target.0), at(message.target.1));
        let route = state.routes.get(&target).or_else(|| {
            state.routes.iter().find(|(from, _)| target.0 != 0 && from.0 == target.0).map(|(_, route)| route)
        });
        let peers: Vec<LinkPeer> = match route {
            Some(route) => vec![route.peer],
            None => state.all_peers(),
        };
        let bytes: Arc<[u8]> = bytes.into();
        let (mut sent, mut unsent) = (0, 0);
        for peer in peers {
            let (port, address) = match peer {
                LinkPeer::Stream(number) => (state.ports.iter().find(|port| port.number == number), None),
                LinkPeer::Datagrams(address) => {
                    (state.ports.iter().find(|port| port.datagrams.is_some()), Some(address))
                }
            };
            // The link loses what the system does not take: the protocols send it again.
            match port.map(|port| port.packets.try_send((bytes.clone(), address))) {
                Some(Ok(())) => sent += 1,
                _ => unsent += 1,
            }
        }
        state.counts.sent += sent;
        state.counts.unsent += unsent;
        Ok(sent > 0)
    }

    /// Has an input signalled with messages: those of these numbers, or all.
    pub(super) fn subscribe(
        self: &Arc<Self>,
        input: HostInput,
        messages: Option<Vec<u32>>,
        source: MessageSource,
    ) -> Result<MavlinkSubscription, HostFailure> {
        let delivery = InputDelivery::begin(input)?;
        let mut state = self.state();
        let entry = || SubscribedInput { source, delivery: delivery.clone() };
        match messages {
            None => state.everything.push(entry()),
            Some(numbers) => {
                for number in numbers {
                    state.entries.entry(number).or_default().push(entry());
                }
            }
        }
        drop(state);
        Ok(MavlinkSubscription { delivery, link: Arc::downgrade(self) })
    }

    /// Returns the counts: a property list.
    pub(super) fn counts(&self) -> Vec<Datum> {
        let counts = self.state().counts;
        let pairs = [
            ("RECEIVED", counts.received),
            ("LOST", counts.lost),
            ("MALFORMED", counts.malformed),
            ("GARBAGE", counts.garbage),
            ("UNKNOWN", counts.unknown),
            ("UNSIGNED", counts.unsigned),
            ("SPOOFED", counts.spoofed),
            ("SENT", counts.sent),
            ("UNSENT", counts.unsent),
        ];
        let number = |count: u64| i64::try_from(count).unwrap_or(i64::MAX).into_datum();
        pairs.into_iter().flat_map(|(name, count)| [Keyword(name).into_datum(), number(count)]).collect()
    }
}

impl LinkState {
    fn all_peers(&self) -> Vec<LinkPeer> {
        let mut peers = Vec::new();
        for port in &self.ports {
            match port.datagrams {
                None => peers.push(LinkPeer::Stream(port.number)),
                Some(Some(address)) => peers.push(LinkPeer::Datagrams(address)),
                Some(None) => {
                    let heard = self.routes.values().map(|route| route.peer);
                    let mut heard: Vec<LinkPeer> = heard.collect();
                    heard.sort_by_key(|peer| format!("{peer:?}"));
                    heard.dedup();
                    peers.extend(heard);
                }
            }
        }
        peers
    }
}
