//! Watching paths: what is made, changed and removed there.
//!
//! A path is watched, not the file that it stands for at the beginning: see `follower`.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use esl_host::{
    HostFailure, HostHandle, HostInput, HostObject, HostRows, Inbox, IntoDatum, Keyword, Right, Sender,
    Values,
};
use notify::Event;
use tokio::sync::mpsc::{Receiver, channel};
use tokio::sync::oneshot;

use crate::event_loop;
use crate::operation::spawned;

mod follower;

use follower::{Follower, PathChange};

/// Most events of the system that wait until there is room in the input for the changes before them. When
/// there are more, changes are lost, and the input is signalled with that.
const MOST_KEPT: usize = 10_000;

/// A path that is watched, until this is closed or dropped.
#[derive(Default)]
struct WatchSlot(Mutex<Option<oneshot::Sender<()>>>);

impl HostObject for WatchSlot {
    const KIND: &'static str = "WATCH";
}

impl WatchSlot {
    fn set(&self, ending: Option<oneshot::Sender<()>>) {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = ending;
    }
}

/// A path that is being followed, and the events of the system about it.
struct Following {
    /// `None` only while a thread has it.
    follower: Option<Follower>,
    events: Receiver<Event>,
    /// Whether events were lost.
    has_lost: Arc<AtomicBool>,
    input: HostInput,
}

impl Following {
    /// Begins to watch a path.
    fn begin(path: String, input: HostInput) -> notify::Result<Following> {
        let has_lost = Arc::<AtomicBool>::default();
        let loses = has_lost.clone();
        let (sender, events) = channel(MOST_KEPT);
        let watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            // The receiver is gone after the end.
            if !event.is_ok_and(|event| !event.need_rescan() && sender.try_send(event).is_ok()) {
                loses.store(true, Ordering::Relaxed);
            }
        })?;
        let follower = Some(Follower::new(watcher, path.into())?);
        Ok(Following { follower, events, has_lost, input })
    }

    /// Signals the input with the changes of the path, until the system tells no more of it.
    async fn run(mut self) {
        while let Some(event) = self.events.recv().await {
            let changes = self.changes(event).await;
            if self.has_lost.swap(false, Ordering::Relaxed) {
                // Those behind are old as well.
                while let Ok(event) = self.events.try_recv() {
                    self.changes(event).await;
                }
                self.signal("LOST", "").await;
                continue;
            }
            for (kind, path) in changes {
                self.signal(kind, &path.to_string_lossy()).await;
            }
        }
    }

    async fn signal(&self, kind: &'static str, path: &str) {
        // The program may have closed the input.
        _ = self.input.signal(vec![Keyword(kind).into_datum(), path.into_datum()]).await;
    }

    /// Returns the changes that an event reports.
    async fn changes(&mut self, event: Event) -> Vec<PathChange> {
        let Some(mut follower) = self.follower.take() else { return Vec::new() };
        if !follower.concerns(&event) {
            let changes = follower.changes(&event);
            self.follower = Some(follower);
            return changes;
        }
        // The watcher has to be asked from another thread than its own, and the system may take its time.
        let followed = tokio::task::spawn_blocking(move || {
            let found = follower.follow(&event);
            (follower, found)
        });
        match followed.await {
            Ok((follower, found)) => {
                self.follower = Some(follower);
                found
            }
            Err(_) => {
                self.events.close();
                self.has_lost.store(true, Ordering::Relaxed);
                Vec::new()
            }
        }
    }
}

/// Returns the functions of `watch-path`, which the library calls by their names.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.constructor::<WatchSlot>("%WATCH-NEW", "Returns a watch of no path.").lasts();
    rows.at_once("%WATCH-CLOSE", ["watch"], "Ends WATCH.", |watch: HostHandle<WatchSlot>| {
        watch.set(None);
        Ok(())
    })
    .closes();
    rows.operation(
        spawned,
        "%WATCH-OPEN",
        ["watch", "input", "path"],
        "Signals the input with the name INPUT with the changes of PATH: a keyword and a path. Returns NIL and \
         the reason if the system does not watch it.",
        |sender: Sender, watch: HostHandle<WatchSlot>, input: HostInput, path: String| async move {
            let failed = |reason: &dyn ToString| HostFailure::new("SIMPLE-ERROR", reason.to_string());
            let begun = tokio::task::spawn_blocking(move || Following::begin(path, input)).await;
            match begun.map_err(|error| failed(&error))? {
                Ok(following) => {
                    let (ending, mut end) = oneshot::channel();
                    let follow = async move {
                        tokio::select! {
                            _ = &mut end => {}
                            () = following.run() => {}
                        }
                        drop(sender);
                    };
                    event_loop::spawn(follow).map_err(|error| failed(&error))?;
                    watch.set(Some(ending));
                    Ok(Values(vec![true.into_datum()]))
                }
                Err(error) => Ok(Values(vec![().into_datum(), error.to_string().into_datum()])),
            }
        },
    )
    .needs(Right::Read, "path")
    .lasts();
    rows
}
