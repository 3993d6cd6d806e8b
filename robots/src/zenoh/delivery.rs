//! InputDelivery of what arrives to an input of the program.
//!
//! A callback of Zenoh signals the input at once, if that has room. Otherwise the arrival is kept, and a task
//! of the event loop signals when there is room: the threads of Zenoh never wait for a program. At most
//! [`MOST_KEPT`] arrivals and [`MOST_BYTES`] bytes are kept; then the oldest ones are dropped, and counted.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostInput, SendError};
use tokio::sync::Notify;

use super::zenoh_failure;

/// Most arrivals that are kept for an input without room.
const MOST_KEPT: usize = 1000;
/// Most bytes of their payloads.
const MOST_BYTES: usize = 64 << 20;

/// Delivery of arrivals to one input.
pub(crate) struct InputDelivery {
    input: HostInput,
    kept: Mutex<KeptArrivals>,
    /// Notified when something is kept, and at the end.
    came: Notify,
    lost: AtomicU64,
}

#[derive(Default)]
struct KeptArrivals {
    arrivals: VecDeque<(Vec<Datum>, usize)>,
    bytes: usize,
    /// Whether the task is signalling an arrival that it has taken.
    is_signalling: bool,
    has_ended: bool,
}

impl InputDelivery {
    /// Begins to deliver to an input.
    pub(crate) fn begin(input: HostInput) -> Result<Arc<InputDelivery>, HostFailure> {
        let delivery = Arc::new(InputDelivery {
            input,
            kept: Mutex::default(),
            came: Notify::new(),
            lost: AtomicU64::new(0),
        });
        let delivering = delivery.clone();
        esl_world::spawn(async move { delivering.run().await }).map_err(zenoh_failure)?;
        Ok(delivery)
    }

    fn kept(&self) -> std::sync::MutexGuard<'_, KeptArrivals> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Delivers an arrival whose payload has so many bytes, which `make` makes the arguments of the signal
    /// of.
    pub(crate) fn put(&self, bytes: usize, make: impl FnOnce() -> Vec<Datum>) {
        // Held meanwhile, so that arrivals stay in order.
        let mut kept = self.kept();
        if kept.has_ended {
            return;
        }
        let mut make = Some(make);
        if kept.arrivals.is_empty() && !kept.is_signalling {
            let result = self.input.try_signal_by(bytes, || make.take().map_or_else(Vec::new, |make| make()));
            match result {
                Err(SendError::Full(_)) => {}
                _ => return,
            }
        }
        while kept.arrivals.len() >= MOST_KEPT
            || (kept.bytes + bytes > MOST_BYTES && !kept.arrivals.is_empty())
        {
            if let Some((_, bytes)) = kept.arrivals.pop_front() {
                kept.bytes -= bytes;
            }
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        let Some(make) = make else { return };
        kept.arrivals.push_back((make(), bytes));
        kept.bytes += bytes;
        drop(kept);
        self.came.notify_one();
    }

    /// Returns how many arrivals were dropped because too many were kept.
    pub(crate) fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Ends it, and drops the arrivals that it keeps.
    pub(crate) fn end(&self) {
        let mut kept = self.kept();
        kept.has_ended = true;
        kept.arrivals.clear();
        drop(kept);
        self.came.notify_one();
    }

    async fn run(&self) {
        loop {
            let next = {
                let mut kept = self.kept();
                if kept.has_ended {
                    return;
                }
                let next = kept.arrivals.pop_front();
                kept.is_signalling = next.is_some();
                if let Some((_, bytes)) = &next {
                    kept.bytes -= bytes;
                }
                next
            };
            match next {
                None => self.came.notified().await,
                Some((arguments, bytes)) => {
                    if self.input.signal_sized(bytes, arguments).await.is_err() {
                        // The program has closed the input, or has ended.
                        return self.end();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_host::{Inbox, IntoDatum};

    fn wait_for(mut is_true: impl FnMut() -> bool) {
        let begun = std::time::Instant::now();
        while !is_true() {
            assert!(begun.elapsed().as_secs() < 60, "it does not come");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    #[test]
    fn arrivals_without_room_are_kept_in_order_and_the_oldest_dropped() {
        let inbox = Inbox::new();
        inbox.open_input("A", Some(1));
        let delivery = InputDelivery::begin(HostInput::new(&inbox, "A")).expect("there is an event loop");
        let put = |n: i64| delivery.put(1, || vec![n.into_datum()]);
        put(0);
        put(1);
        // The task has taken it and waits for room.
        wait_for(|| delivery.kept().is_signalling);
        (2..=MOST_KEPT as i64 + 3).for_each(put);
        assert_eq!(delivery.lost(), 2);
        let mut seen = Vec::new();
        wait_for(|| {
            for message in inbox.take() {
                seen.push(format!("{message:?}"));
                inbox.note_arrival("A");
            }
            seen.len() == MOST_KEPT + 2
        });
        let position = |n: i64| seen.iter().position(|text| text.contains(&format!("[{n}]")));
        assert_eq!((position(0), position(1), position(2), position(3)), (Some(0), Some(1), None, None));
        assert_eq!(position(MOST_KEPT as i64 + 3), Some(MOST_KEPT + 1));
    }

    #[test]
    fn large_arrivals_are_bounded_by_their_bytes() {
        let inbox = Inbox::new();
        inbox.open_input("A", Some(1));
        let delivery = InputDelivery::begin(HostInput::new(&inbox, "A")).expect("there is an event loop");
        for n in 0..10_i64 {
            delivery.put(MOST_BYTES / 2, || vec![n.into_datum()]);
        }
        let kept = delivery.kept();
        assert!(kept.arrivals.len() <= 2 && kept.bytes <= MOST_BYTES, "{}", kept.arrivals.len());
    }
}
