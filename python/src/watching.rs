//! Watching a run from Python: events of tasks, changes of facts, drawings.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl::engine::FactWatch;
use esl_timeline::Drawing;
use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;
use pyo3::prelude::*;

use crate::handle::bindings;
use crate::process::stay_at_exit;
use crate::value::to_python;

/// Returns the kind of an event and its detail.
fn event_of<'a>(seen: &Seen<'a>) -> (&'static str, Option<&'a str>) {
    match *seen {
        Seen::Begins { name, .. } => ("begins", Some(name)),
        Seen::IsNamed(name) => ("named", Some(name)),
        Seen::Runs => ("runs", None),
        Seen::IsReady => ("ready", None),
        Seen::Waits(what) => ("waits", Some(what)),
        Seen::IsSuspended(by) => ("suspended", Some(by)),
        Seen::IsToEnd => ("to-end", None),
        Seen::Ends(how) => ("ends", Some(how)),
        Seen::Signals(event) => ("signals", Some(event)),
        Seen::IsWokenBy { event, .. } => ("woken", Some(event)),
        Seen::Fails(cause) => ("fails", Some(cause)),
        Seen::Recovers(cause) => ("recovers", Some(cause)),
        Seen::Changes { fact, is_there: true } => ("asserts", Some(fact)),
        Seen::Changes { fact, is_there: false } => ("retracts", Some(fact)),
        Seen::CollectionBegins => ("collection-begins", None),
        Seen::PauseBegins => ("pause-begins", None),
        Seen::PauseEnds => ("pause-ends", None),
        Seen::CollectionEnds => ("collection-ends", None),
    }
}

/// Returns whether an event is of the life of its task, not something that it does. Tasks of the library,
/// such as those that evaluate texts, are seen by their actions alone.
fn is_of_life(seen: &Seen<'_>) -> bool {
    match seen {
        Seen::Begins { .. }
        | Seen::IsNamed(_)
        | Seen::Runs
        | Seen::IsReady
        | Seen::Waits(_)
        | Seen::IsSuspended(_)
        | Seen::IsToEnd
        | Seen::Ends(_)
        | Seen::IsWokenBy { .. } => true,
        Seen::Signals(_)
        | Seen::Fails(_)
        | Seen::Recovers(_)
        | Seen::Changes { .. }
        | Seen::CollectionBegins
        | Seen::PauseBegins
        | Seen::PauseEnds
        | Seen::CollectionEnds => false,
    }
}

/// An observer that calls a function of Python.
pub(crate) struct Caller {
    function: Arc<Py<PyAny>>,
    /// The kinds of events to be told; all if it is empty.
    kinds: HashSet<String>,
    /// Tasks of the library.
    hidden: HashSet<TaskNumber>,
    is_stopped: Arc<AtomicBool>,
}

impl Caller {
    /// Creates an observer, and what stops it.
    pub(crate) fn new(function: Arc<Py<PyAny>>, kinds: HashSet<String>) -> (Caller, Observation) {
        let is_stopped = Arc::<AtomicBool>::default();
        let caller = Caller { function, kinds, hidden: HashSet::new(), is_stopped: is_stopped.clone() };
        (caller, Observation { is_stopped })
    }
}

impl Observer for Caller {
    fn is_over(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        if self.is_over() {
            return;
        }
        if matches!(seen, Seen::Begins { is_hidden: true, .. }) {
            self.hidden.insert(task);
        }
        if is_of_life(&seen) && self.hidden.contains(&task) {
            if matches!(seen, Seen::Ends(_)) {
                self.hidden.remove(&task);
            }
            return;
        }
        let (kind, detail) = event_of(&seen);
        if !self.kinds.is_empty() && !self.kinds.contains(kind) {
            return;
        }
        stay_at_exit();
        Python::attach(|py| {
            if let Err(error) = self.function.call1(py, (time as f64 / 1e9, task.0, kind, detail)) {
                error.write_unraisable(py, Some(self.function.bind(py)));
            }
        });
    }
}

/// A switch that ends an observation.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Observation {
    is_stopped: Arc<AtomicBool>,
}

#[pymethods]
impl Observation {
    /// Has the function called no more.
    fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }
}

/// A watch over facts.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Watch(Mutex<Option<FactWatch>>);

impl Watch {
    /// Begins a watch, which calls a function of Python.
    pub(crate) fn begin(
        engine: &mut esl::Engine,
        pattern: esl::Data,
        function: Arc<Py<PyAny>>,
    ) -> Result<Watch, esl::Error> {
        let watch = engine.watch_facts(pattern, move |change| {
            stay_at_exit();
            Python::attach(|py| {
                let called = to_python(py, &change.fact).and_then(|fact| {
                    let bindings = bindings(py, &change.bindings)?;
                    function.bind(py).call1((change.is_there, fact, bindings))
                });
                if let Err(error) = called {
                    error.write_unraisable(py, Some(function.bind(py)));
                }
            });
        })?;
        Ok(Watch(Mutex::new(Some(watch))))
    }
}

#[pymethods]
impl Watch {
    /// Has the function called no more, and dropped.
    fn stop(&self) {
        drop(self.0.lock().unwrap_or_else(PoisonError::into_inner).take());
    }
}

/// A drawing of a run, which grows until it is stopped.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Timeline {
    drawing: Arc<Mutex<Drawing>>,
    is_stopped: Arc<AtomicBool>,
}

/// The observer that draws.
pub(crate) struct Drawer {
    drawing: Arc<Mutex<Drawing>>,
    is_stopped: Arc<AtomicBool>,
}

fn lock(drawing: &Mutex<Drawing>) -> MutexGuard<'_, Drawing> {
    // A panic elsewhere leaves the drawing as it was.
    drawing.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Timeline {
    /// Creates a drawing and its observer.
    pub(crate) fn begin() -> (Drawer, Timeline) {
        let (drawing, is_stopped) = (Arc::new(Mutex::new(Drawing::new())), Arc::<AtomicBool>::default());
        let drawer = Drawer { drawing: drawing.clone(), is_stopped: is_stopped.clone() };
        (drawer, Timeline { drawing, is_stopped })
    }
}

impl Observer for Drawer {
    fn is_over(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        if !self.is_over() {
            lock(&self.drawing).see(time, task, seen);
        }
    }
}

#[pymethods]
impl Timeline {
    /// Ends the drawing: what happens from now on is not in it.
    fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }

    /// Ends the drawing, and returns it as the text of an SVG file.
    fn svg(&self) -> String {
        self.stop();
        lock(&self.drawing).draw()
    }
}
