//! Connections whose peers have not shown that they may be there: how many are open, and for how long.
//!
//! Guarantees: at most [`MOST`] at a time, and at most [`MOST_OF_ADDRESS`] from one address. A connection
//! that comes when there is no room takes the place of the oldest one: of its own address, if that has too
//! many. So silent connections never keep out a peer that says its secret at once, even from their own
//! address.
//!
//! Source: the way in which OpenSSH drops connections that do not authenticate (`MaxStartups`).

use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::Notify;

/// Most connections in a lobby at a time.
const MOST: usize = 64;
/// Most of them from one address.
const MOST_OF_ADDRESS: usize = 32;
/// Time without a byte after which the system asks whether the peer is still there.
const SILENCE: Duration = Duration::from_secs(60);
/// Time between two such questions; the system asks a few times.
const ASKING: Duration = Duration::from_secs(10);

/// The connections to one listener that are in no other bound.
#[derive(Clone, Default)]
pub(super) struct Lobby(Arc<Mutex<LobbyState>>);

#[derive(Default)]
struct LobbyState {
    /// Number of connections so far.
    count: u64,
    /// Number of connections that were settled and are still open.
    settled: usize,
    /// The connections, oldest first.
    guests: Vec<Guest>,
}

struct Guest {
    number: u64,
    address: IpAddr,
    end: Arc<Notify>,
}

impl Lobby {
    fn lock(&self) -> MutexGuard<'_, LobbyState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets a connection from an address in. If there is no room, another one ends.
    pub(super) fn enter(&self, address: IpAddr) -> LobbyVisit {
        let end = Arc::new(Notify::new());
        let mut state = self.lock();
        let of_address = state.guests.iter().filter(|guest| guest.address == address).count();
        let oldest = if of_address >= MOST_OF_ADDRESS {
            state.guests.iter().position(|guest| guest.address == address)
        } else {
            (state.guests.len() >= MOST).then_some(0)
        };
        if let Some(oldest) = oldest {
            state.guests.remove(oldest).end.notify_one();
        }
        state.count += 1;
        let number = state.count;
        state.guests.push(Guest { number, address, end: end.clone() });
        let is_settled = AtomicBool::new(false);
        LobbyVisit(Arc::new(VisitState { lobby: self.clone(), number, end, is_settled }))
    }

    /// Returns the number of connections that were settled and are still open.
    pub(super) fn settled(&self) -> usize {
        self.lock().settled
    }
}

/// The stay of a connection in a lobby, until it is settled or dropped.
#[derive(Clone)]
pub(super) struct LobbyVisit(Arc<VisitState>);

struct VisitState {
    lobby: Lobby,
    number: u64,
    end: Arc<Notify>,
    /// Whether it was settled; written under the lock of the lobby.
    is_settled: AtomicBool,
}

impl Drop for VisitState {
    fn drop(&mut self) {
        let mut state = self.lobby.lock();
        let guests = state.guests.len();
        state.guests.retain(|guest| guest.number != self.number);
        // One that was told to end is not a guest any more, and was not settled.
        state.settled -= usize::from(guests == state.guests.len() && self.is_settled.load(Ordering::Relaxed));
    }
}

impl LobbyVisit {
    /// Takes the connection out of the lobby, since its peer may be there: another bound holds for it now.
    pub(super) fn settle(&self) {
        let mut state = self.0.lobby.lock();
        let guests = state.guests.len();
        state.guests.retain(|guest| guest.number != self.0.number);
        if guests > state.guests.len() {
            state.settled += 1;
            self.0.is_settled.store(true, Ordering::Relaxed);
        }
    }

    /// Ends the connection.
    pub(super) fn hang_up(&self) {
        self.0.end.notify_one();
    }

    /// Returns when the connection is to end.
    pub(super) async fn ended(&self) {
        self.0.end.notified().await;
    }
}

/// Has the system find out when the machine of a peer has gone without a word, and end the connection then.
pub(super) fn notice_absence(stream: &tokio::net::TcpStream) {
    let keep_alive = socket2::TcpKeepalive::new().with_time(SILENCE).with_interval(ASKING);
    // Without it the connection is as good as any, but for those that are gone.
    drop(socket2::SockRef::from(stream).set_tcp_keepalive(&keep_alive));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns whether a connection has been told to end.
    fn is_over(visit: &LobbyVisit) -> bool {
        use std::task::{Context, Waker};
        let ended = std::pin::pin!(visit.ended());
        ended.poll(&mut Context::from_waker(Waker::noop())).is_ready()
    }

    fn guests(lobby: &Lobby) -> usize {
        lobby.lock().guests.len()
    }

    #[test]
    fn who_comes_takes_the_place_of_the_oldest() {
        let lobby = Lobby::default();
        let [here, there, elsewhere, beyond] =
            [[127, 0, 0, 1], [10, 0, 0, 1], [10, 0, 0, 2], [10, 0, 0, 3]].map(IpAddr::from);
        let first = lobby.enter(there);
        let silent: Vec<LobbyVisit> = (0..MOST_OF_ADDRESS).map(|_| lobby.enter(here)).collect();
        assert!(!is_over(&first) && !silent.iter().any(is_over));
        // An address that has too many makes room itself.
        let one_more = lobby.enter(here);
        assert_eq!(silent.iter().position(is_over), Some(0));
        // Settled and closed connections take no place.
        silent[1].settle();
        drop((one_more, lobby.enter(here)));
        assert!(!silent[1..].iter().any(is_over));
        let mut others: Vec<LobbyVisit> = (0..MOST_OF_ADDRESS).map(|_| lobby.enter(elsewhere)).collect();
        others.push(lobby.enter(beyond));
        assert!(!is_over(&first));
        others.push(lobby.enter(beyond));
        assert!(is_over(&first) && !others.iter().any(is_over));
        assert_eq!((guests(&lobby), lobby.settled()), (MOST, 1));
        drop((first, silent, others));
        assert_eq!((guests(&lobby), lobby.settled()), (0, 0));
    }
}
