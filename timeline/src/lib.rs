//! Timelines of runs: when each task ran, waited and signalled; failures, recoveries and collections.
//!
//! A file whose name ends in `.svg` becomes one drawing, for short runs. Every other file becomes a trace in
//! the Trace Event Format, which the Perfetto UI and `chrome://tracing` open; it is written during the run,
//! so that its length takes no memory.
//!
//! ```
//! use esl::host::VirtualHost;
//! use esl::program::{Source, compile, machine, run_in};
//! use esl_timeline::Timeline;
//!
//! let program = compile(&[Source::new("wait.esl", "(sleep 1)")]).program.expect("it compiles");
//! let mut machine = machine(esl::Config::default(), Box::new(VirtualHost::new()))?;
//! let file = std::env::temp_dir().join(format!("esl-timeline-{}.svg", std::process::id()));
//! let timeline = Timeline::begin(&file, &mut machine)?;
//! run_in(&mut machine, &program)?;
//! timeline.end(&mut machine)?;
//! assert!(std::fs::read_to_string(&file)?.contains("the main task"));
//! # std::fs::remove_file(file)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod covered;
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

/// A file that a run is pictured in.
pub struct Timeline(Arc<Mutex<Picture>>);

/// Form of the file.
enum Picture {
    Trace(Trace<BufWriter<File>>),
    Drawing(Drawing, File),
}

/// Observer of the run, which shares the file with its [`Timeline`].
struct PictureObserver(Arc<Mutex<Picture>>);

fn lock(picture: &Mutex<Picture>) -> MutexGuard<'_, Picture> {
    // A panic elsewhere leaves the picture as it was.
    picture.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Timeline {
    /// Creates the file, and pictures the machine's run in it from now on.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin(path: &Path, machine: &mut Vm) -> io::Result<Timeline> {
        let file = File::create(path)?;
        let is_drawing = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
        let picture = if is_drawing {
            Picture::Drawing(Drawing::new(), file)
        } else {
            Picture::Trace(Trace::new(BufWriter::new(file)))
        };
        let shared = Arc::new(Mutex::new(picture));
        machine.add_observer(Box::new(PictureObserver(shared.clone())));
        Ok(Timeline(shared))
    }

    /// Completes the file when the run is over.
    ///
    /// # Errors
    /// If a part of the file could not be written.
    pub fn end(self, machine: &mut Vm) -> io::Result<()> {
        drop(machine.take_observers());
        self.complete()
    }

    /// Completes the file of a machine that is gone.
    ///
    /// # Errors
    /// If a part of the file could not be written.
    pub fn complete(self) -> io::Result<()> {
        match &mut *lock(&self.0) {
            Picture::Trace(trace) => trace.end(),
            Picture::Drawing(drawing, file) => io::Write::write_all(file, drawing.draw().as_bytes()),
        }
    }
}

impl Observer for PictureObserver {
    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        match &mut *lock(&self.0) {
            Picture::Trace(trace) => trace.see(time, task, seen),
            Picture::Drawing(drawing, _) => drawing.see(time, task, seen),
        }
    }
}
