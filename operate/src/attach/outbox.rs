//! Packets on their way to the peers of sessions.
//!
//! Guarantees: what a session writes waits in the program until there is room for it here, so the packets
//! of a session take a bounded number of bytes however slowly its peer reads. Output to a session that has
//! ended is lost, and waits for nothing.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::form::WireForm;
use super::{UNDER_WAY, packet};

/// Bytes of packets on their way to a peer, but for one packet that is longer.
const ROOM: usize = 256 << 10;
/// Bytes of further packets that cannot wait, such as those of a debugger that a task enters.
const RESERVE: usize = 1 << 20;

/// A packet on its way, with the room that it takes.
pub(super) struct OutgoingPacket {
    pub(super) bytes: Vec<u8>,
    _room: Option<OwnedSemaphorePermit>,
}

/// The packets on their way to the peer of one session.
#[derive(Clone)]
pub(super) struct Outbox {
    packets: mpsc::UnboundedSender<OutgoingPacket>,
    /// Whether the peer wants to hear how the run ends.
    hears_end: Arc<AtomicBool>,
    /// Room for requests under way.
    requests: Arc<Semaphore>,
    room: Arc<Semaphore>,
    reserve: Arc<Semaphore>,
}

/// Returns room for a packet, as far as there is as much.
fn share(bytes: &[u8], most: usize) -> u32 {
    // A packet has at most a few megabytes.
    bytes.len().min(most) as u32
}

/// Returns the bytes of a packet; those of another one if there is no packet as large.
fn bytes_of(form: &WireForm) -> Vec<u8> {
    packet::packet(form).or_else(|| packet::packet(&super::too_large(form))).unwrap_or_default()
}

impl Outbox {
    /// Returns an outbox, and what takes its packets.
    pub(super) fn new() -> (Outbox, mpsc::UnboundedReceiver<OutgoingPacket>) {
        let (packets, taken) = mpsc::unbounded_channel();
        let [requests, room, reserve] = [UNDER_WAY, ROOM, RESERVE].map(|most| Arc::new(Semaphore::new(most)));
        (Outbox { packets, hears_end: Arc::default(), requests, room, reserve }, taken)
    }

    /// Takes room for a request that is under way, if there is any.
    pub(super) fn begin_request(&self) -> Option<OwnedSemaphorePermit> {
        self.requests.clone().try_acquire_owned().ok()
    }

    /// Returns whether the peer wants to hear how the run ends.
    pub(super) fn hears_end(&self) -> bool {
        self.hears_end.load(Ordering::Relaxed)
    }

    /// Notes that the peer wants to hear how the run ends.
    pub(super) fn note_hears_end(&self) {
        self.hears_end.store(true, Ordering::Relaxed);
    }

    /// Sends a packet when there is room for it. Returns whether the peer is still there.
    pub(super) async fn send(&self, form: &WireForm) -> bool {
        let bytes = bytes_of(form);
        // Nothing closes a semaphore, so there is an answer once there is room.
        let room = self.room.clone().acquire_many_owned(share(&bytes, ROOM)).await.ok();
        self.packets.send(OutgoingPacket { bytes, _room: room }).is_ok()
    }

    /// Sends a packet at once, if there is room for it.
    pub(super) fn send_at_once(&self, form: &WireForm) {
        let bytes = bytes_of(form);
        let share = share(&bytes, RESERVE);
        let room = self.room.clone().try_acquire_many_owned(share.min(ROOM as u32));
        if let Ok(room) = room.or_else(|_| self.reserve.clone().try_acquire_many_owned(share)) {
            // It is lost if the peer has gone.
            _ = self.packets.send(OutgoingPacket { bytes, _room: Some(room) });
        }
    }

    /// Returns when the peer takes no more packets.
    pub(super) async fn closed(&self) {
        self.packets.closed().await;
    }
}

/// The outboxes of sessions, by their numbers.
#[derive(Clone, Default)]
pub(super) struct Outboxes(Arc<Mutex<HashMap<u64, Outbox>>>);

impl Outboxes {
    fn table(&self) -> MutexGuard<'_, HashMap<u64, Outbox>> {
        // The table is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the outbox of a session, while that goes on.
    pub(super) fn of(&self, session: u64) -> Option<Outbox> {
        self.table().get(&session).cloned()
    }

    /// Enters the outbox of a session.
    pub(super) fn enter(&self, session: u64, outbox: Outbox) {
        self.table().insert(session, outbox);
    }

    /// Tells the peers that have asked for it how the run has ended.
    pub(super) fn tell_end(&self, packet: &WireForm) {
        let table = self.table();
        let told = table.values().filter(|outbox| outbox.hears_end());
        told.for_each(|outbox| outbox.send_at_once(packet));
    }

    /// Returns whether no requests are under way.
    pub(super) fn are_answered(&self) -> bool {
        self.table().values().all(|outbox| outbox.requests.available_permits() == UNDER_WAY)
    }

    /// Returns whether no packets are on their way.
    pub(super) fn are_empty(&self) -> bool {
        let is_empty = |outbox: &Outbox| {
            (outbox.room.available_permits(), outbox.reserve.available_permits()) == (ROOM, RESERVE)
        };
        self.table().values().all(is_empty)
    }

    /// Removes the outbox of a session that has ended.
    pub(super) fn remove(&self, session: u64) {
        self.table().remove(&session);
    }
}

#[cfg(test)]
mod tests {
    use std::task::{Context, Waker};

    use super::*;

    fn sends(outbox: &Outbox, form: &WireForm) -> bool {
        let sent = std::pin::pin!(outbox.send(form));
        sent.poll(&mut Context::from_waker(Waker::noop())).is_ready()
    }

    #[test]
    fn packets_wait_for_room() {
        let (outbox, mut taken) = Outbox::new();
        let block = WireForm::text("x".repeat(ROOM / 8));
        let sent = (0..100).take_while(|_| sends(&outbox, &block)).count();
        assert_eq!(sent, 7);
        // Packets that cannot wait have a room of their own, which is limited, too.
        (0..1000).for_each(|_| outbox.send_at_once(&block));
        assert_eq!(taken.len(), 7 + RESERVE / (ROOM / 8) - 1);
        drop(taken.try_recv());
        assert!(sends(&outbox, &block) && !sends(&outbox, &block));
        // One that is larger than the room goes alone.
        while taken.try_recv().is_ok() {}
        assert!(sends(&outbox, &WireForm::text("x".repeat(2 * ROOM))) && !sends(&outbox, &block));
        let outboxes = Outboxes::default();
        outboxes.enter(1, outbox.clone());
        assert!(outboxes.of(1).is_some() && outboxes.of(2).is_none());
        outboxes.remove(1);
        assert!(outboxes.of(1).is_none());
        drop(taken);
        assert!(sends(&outbox, &block), "nobody takes it, so it waits for nothing");
    }
}
