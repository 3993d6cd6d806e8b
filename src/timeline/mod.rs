//! Pictures of a run in time: who ran, waited and signalled when, failures and recoveries, collections.
//!
//! A file that ends in `.svg` gets one drawing, for short runs. Every other file gets a trace in the Trace Event Format, that the
//! Perfetto UI and `chrome://tracing` open; it is written as the run goes on, so its length takes no memory.

mod svg;
mod trace;

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;
use esl_vm::vm::Vm;

pub use svg::Drawing;
pub use trace::Trace;

/// A file that the picture of a run goes to.
pub struct Timeline(Arc<Mutex<Kind>>);

enum Kind {
    Trace(Trace<BufWriter<File>>),
    Drawing(Drawing, File),
}

/// What of a timeline watches the run.
struct Watch(Arc<Mutex<Kind>>);

fn lock(kind: &Mutex<Kind>) -> MutexGuard<'_, Kind> {
    // A panic elsewhere does not spoil what was noted.
    kind.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Timeline {
    /// Makes the file, and has the machine's run noted in it from now on.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin(path: &Path, machine: &mut Vm) -> io::Result<Timeline> {
        let file = File::create(path)?;
        let is_drawing = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
        let kind = if is_drawing {
            Kind::Drawing(Drawing::new(), file)
        } else {
            Kind::Trace(Trace::new(BufWriter::new(file)))
        };
        let shared = Arc::new(Mutex::new(kind));
        machine.add_observer(Box::new(Watch(shared.clone())));
        Ok(Timeline(shared))
    }

    /// Ends the file, when the run is over.
    ///
    /// # Errors
    /// If something could not be written.
    pub fn end(self, machine: &mut Vm) -> io::Result<()> {
        drop(machine.take_observers());
        match &mut *lock(&self.0) {
            Kind::Trace(trace) => trace.end(),
            Kind::Drawing(drawing, file) => io::Write::write_all(file, drawing.draw().as_bytes()),
        }
    }
}

impl Observer for Watch {
    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        match &mut *lock(&self.0) {
            Kind::Trace(trace) => trace.see(time, task, seen),
            Kind::Drawing(drawing, _) => drawing.see(time, task, seen),
        }
    }
}
