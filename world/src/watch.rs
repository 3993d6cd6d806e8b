//! Watching paths: what is made, changed and removed there.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::embed::{HostFunction, Need};
use esl_vm::host::{HostFailure, Right};
use esl_vm::vm::Vm;
use notify::event::ModifyKind;
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use tokio::sync::Notify;

use crate::data::{CallArguments, Numbered, failure, integer, nil, text};
use crate::operation::define;

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

    fn add(&self, event: notify::Result<Event>) {
        let mut kept = self.kept();
        let lost = |kept: &mut VecDeque<_>| {
            kept.clear();
            kept.push_back(("LOST", String::new()));
        };
        match event {
            Ok(event) if event.need_rescan() => lost(&mut kept),
            Ok(event) => {
                let Some(kind) = kind_of(event.kind) else { return };
                for path in event.paths {
                    kept.push_back((kind, path.to_string_lossy().into_owned()));
                }
                if kept.len() > MOST_KEPT {
                    lost(&mut kept);
                }
            }
            Err(_) => lost(&mut kept),
        }
        drop(kept);
        self.came.notify_waiters();
    }
}

/// Returns the keyword for what has happened to a path, if anything has.
fn kind_of(kind: EventKind) -> Option<&'static str> {
    match kind {
        EventKind::Create(_) => Some("CREATED"),
        EventKind::Modify(ModifyKind::Name(_)) => Some("RENAMED"),
        EventKind::Modify(_) => Some("MODIFIED"),
        EventKind::Remove(_) => Some("DELETED"),
        EventKind::Any | EventKind::Access(_) | EventKind::Other => None,
    }
}

/// A path that is watched, until this is dropped.
struct Watched {
    changes: Arc<Changes>,
    _watcher: RecommendedWatcher,
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
            let begin = move || {
                let changes = Arc::<Changes>::default();
                let heard = changes.clone();
                let mut watcher = notify::recommended_watcher(move |event| heard.add(event))?;
                watcher.watch(path.as_ref(), RecursiveMode::NonRecursive)?;
                Ok::<_, notify::Error>(Watched { changes, _watcher: watcher })
            };
            let begun =
                tokio::task::spawn_blocking(begin).await.map_err(|error| failure("SIMPLE-ERROR", error))?;
            match begun {
                Ok(watched) => {
                    if let Some(place) = known.lock().1.get_mut(&number) {
                        *place = Some(watched);
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
