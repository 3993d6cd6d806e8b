//! Watching paths: what is made, changed and removed there.
//!
//! A path is watched, not the file that it stands for at the beginning: see `follower`.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use notify::Event;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::sync::{Notify, oneshot};

use crate::data::{CallArguments, Numbered, failure, integer, nil, text};
use crate::event_loop;
use crate::operation::define;

mod follower;

use follower::{Follower, PathChange};

/// Most changes that are kept for the program.
const MOST_KEPT: usize = 10_000;

/// Changes that the program has not taken: what has happened, and to which path.
#[derive(Default)]
struct Changes {
    kept: Mutex<VecDeque<(&'static str, String)>>,
    came: Notify,
}

impl Changes {
    fn kept(&self) -> MutexGuard<'_, VecDeque<(&'static str, String)>> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, changes: Vec<PathChange>) {
        if changes.is_empty() {
            return;
        }
        let mut kept = self.kept();
        kept.extend(changes.into_iter().map(|(kind, path)| (kind, path.to_string_lossy().into_owned())));
        let is_full = kept.len() > MOST_KEPT;
        drop(kept);
        if is_full {
            return self.lose();
        }
        self.came.notify_waiters();
    }

    /// Notes that changes were lost.
    fn lose(&self) {
        let mut kept = self.kept();
        kept.clear();
        kept.push_back(("LOST", String::new()));
        drop(kept);
        self.came.notify_waiters();
    }
}

/// A path that is watched, until this is dropped.
struct Watched {
    changes: Arc<Changes>,
    _ending: oneshot::Sender<()>,
}

/// Begins to watch a path. Returns its changes, the events of the system, and what follows the path.
fn begin(path: String) -> notify::Result<(Arc<Changes>, Follower, UnboundedReceiver<Event>)> {
    let changes = Arc::<Changes>::default();
    let heard = changes.clone();
    let (sender, events) = unbounded_channel();
    let watcher = notify::recommended_watcher(move |event: notify::Result<Event>| match event {
        // Nobody listens after the end.
        Ok(event) if !event.need_rescan() => _ = sender.send(event),
        _ => heard.lose(),
    })?;
    let follower = Follower::new(watcher, path.into())?;
    Ok((changes, follower, events))
}

/// Follows a path until the other end of `ending` is dropped.
async fn follow(
    changes: Arc<Changes>,
    mut follower: Follower,
    mut events: UnboundedReceiver<Event>,
    mut ending: oneshot::Receiver<()>,
) {
    loop {
        let event = tokio::select! {
            _ = &mut ending => return,
            event = events.recv() => event,
        };
        let Some(event) = event else { return };
        if !follower.concerns(&event) {
            changes.add(follower.changes(&event));
            continue;
        }
        // The watcher has to be asked from another thread than its own, and the system may take its time.
        let followed = tokio::task::spawn_blocking(move || {
            let found = follower.follow(&event);
            (follower, found)
        });
        match followed.await {
            Ok((next, found)) => {
                follower = next;
                changes.add(found);
            }
            Err(_) => return changes.lose(),
        }
    }
}

/// The watched paths of a machine, by number, and the greatest number so far.
#[derive(Clone, Default)]
struct Watches(Arc<Mutex<Numbered<Watched>>>);

impl Watches {
    fn lock(&self) -> MutexGuard<'_, Numbered<Watched>> {
        // As above.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, number: i64) -> Result<Arc<Changes>, HostFailure> {
        let watches = self.lock();
        let watched = watches.1.get(&number).and_then(Option::as_ref);
        watched.map(|watched| watched.changes.clone()).ok_or_else(|| failure("CANCELLED", ""))
    }
}

/// Gives a machine the operations of `watch-path`.
pub(crate) fn install(machine: &mut Vm) {
    let watches = Watches::default();
    let mut define_immediate =
        |name: &str, function: fn(CallArguments, &Watches) -> Result<Datum, HostFailure>| {
            let watches = watches.clone();
            let function = move |arguments: &[Datum]| function(CallArguments(arguments.to_vec()), &watches);
            machine.add_host_function(name, HostFunction::AtOnce(Box::new(function)));
        };
    define_immediate("%WATCH-NEW", |_, watches| {
        let mut watches = watches.lock();
        watches.0 += 1;
        let number = watches.0;
        watches.1.insert(number, None);
        Ok(integer(number))
    });
    define_immediate("%WATCH-TAKE", |arguments, watches| {
        let next = watches.get(arguments.integer(0)?)?.kept().pop_front();
        Ok(next.map_or_else(nil, |(kind, path)| Datum::list([text(kind), text(&path)], Span::default())))
    });
    define_immediate("%WATCH-CLOSE", |arguments, watches| {
        let watched = watches.lock().1.remove(&arguments.integer(0)?);
        drop(watched);
        Ok(nil())
    });
    let known = watches.clone();
    let read = [Need { right: Right::Read, argument: 1 }];
    define(machine, "%WATCH-OPEN", &read, move |arguments| {
        let known = known.clone();
        async move {
            let (number, path) = (arguments.integer(0)?, arguments.text(1)?);
            let begun = tokio::task::spawn_blocking(move || begin(path)).await;
            match begun.map_err(|error| failure("SIMPLE-ERROR", error))? {
                Ok((changes, follower, events)) => {
                    let (ending, end) = oneshot::channel();
                    let following = follow(changes.clone(), follower, events, end);
                    event_loop::spawn(following).map_err(|error| failure("SIMPLE-ERROR", error))?;
                    if let Some(place) = known.lock().1.get_mut(&number) {
                        *place = Some(Watched { changes, _ending: ending });
                    }
                    Ok(vec![integer(number)])
                }
                Err(error) => Ok(vec![nil(), text(&error.to_string())]),
            }
        }
    });
    define(machine, "%WATCH-AWAIT", &[], move |arguments| {
        let changes = arguments.integer(0).and_then(|number| watches.get(number));
        async move {
            let changes = changes?;
            loop {
                let came = changes.came.notified();
                if !changes.kept().is_empty() {
                    return Ok(Vec::new());
                }
                came.await;
            }
        }
    });
}
