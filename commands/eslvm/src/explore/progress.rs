//! The file of progress of random schedules: an object of JSON with the schedules that were tried, and what
//! they have shown. It is written every few seconds and at the end, so that a killed run goes on from there.

use std::fmt;
use std::fs;
use std::io;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl::program::Ended;
use esl_testing::explore::{Behaviour, ExploredEnding, RandomFound, RandomSettings, SeenOrders};
use serde_json::{Value as Json, json};

/// Time between two writes.
const PAUSE: Duration = Duration::from_secs(5);

/// Reason why a file of progress is not gone on from.
#[derive(Debug)]
pub(super) enum ProgressError {
    /// It cannot be read.
    Read(io::Error),
    /// It is not a file of progress.
    Invalid,
    /// It is of another program, another version, or other options.
    Other,
}

impl fmt::Display for ProgressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ProgressError::Read(error) => write!(f, "cannot be read: {error}"),
            ProgressError::Invalid => f.write_str("is not a file of the progress of random schedules"),
            ProgressError::Other => f.write_str(
                "is the progress of another program, version, seed, depth or other options: name another file",
            ),
        }
    }
}

/// A file of progress.
pub(super) struct ProgressFile<'a> {
    file: &'a Path,
    /// The program and the options, which are the same for a run that goes on.
    series: Json,
    written: Mutex<Instant>,
}

impl<'a> ProgressFile<'a> {
    /// Creates the file's description. `schedule` is a text that tells programs and settings apart.
    pub(super) fn new(file: &'a Path, schedule: &str, random: RandomSettings) -> ProgressFile<'a> {
        let series = json!({ "schedule": schedule, "seed": random.seed, "depth": random.depth });
        ProgressFile { file, series, written: Mutex::new(Instant::now()) }
    }

    /// Returns the schedules that were tried before; none if there is no file. Of the endings there are the
    /// seeds only.
    ///
    /// # Errors
    /// [`ProgressError`].
    pub(super) fn read(&self) -> Result<RandomFound, ProgressError> {
        let text = match fs::read_to_string(self.file) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(RandomFound::default()),
            Err(error) => return Err(ProgressError::Read(error)),
        };
        let json: Json = serde_json::from_str(&text).map_err(|_| ProgressError::Invalid)?;
        let series = json.get("series").ok_or(ProgressError::Invalid)?;
        if *series != self.series {
            return Err(ProgressError::Other);
        }
        found_of(&json).ok_or(ProgressError::Invalid)
    }

    /// Writes the file, if it is time.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn write_now_and_then(&self, found: &RandomFound) -> io::Result<()> {
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        if written.elapsed() < PAUSE {
            return Ok(());
        }
        self.write(found)?;
        *written = Instant::now();
        Ok(())
    }

    /// Writes the file in one step, so that a kill leaves the old one or the new one.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn write(&self, found: &RandomFound) -> io::Result<()> {
        let endings = found.endings.iter().zip(&found.seeds);
        let endings: Vec<Json> =
            endings.map(|(ending, seed)| json!({ "seed": seed, "runs": ending.runs })).collect();
        let orders: Vec<(&str, &str)> = found.orders.iter().collect();
        let json = json!({
            "series": self.series, "runs": found.runs, "endless": found.endless, "tasks": found.tasks,
            "steps": found.steps, "endings": endings, "orders": orders,
        });
        let mut name = self.file.as_os_str().to_owned();
        name.push(".new");
        fs::write(&name, format!("{json}\n"))?;
        fs::rename(&name, self.file)
    }
}

/// Returns the schedules of a file of progress, if it is one.
fn found_of(json: &Json) -> Option<RandomFound> {
    let number = |name: &str| json.get(name)?.as_u64();
    let mut found = RandomFound {
        runs: number("runs")?,
        endless: number("endless")?,
        tasks: usize::try_from(number("tasks")?).ok()?,
        steps: number("steps")?,
        ..RandomFound::default()
    };
    for ending in json.get("endings")?.as_array()? {
        let runs = usize::try_from(ending.get("runs")?.as_u64()?).ok()?;
        let unknown = Behaviour { ended: Ended::Normally(0), output: String::new(), errors: String::new() };
        found.endings.push(ExploredEnding { what: unknown, choices: Vec::new(), runs });
        found.seeds.push(ending.get("seed")?.as_u64()?);
    }
    let mut orders = SeenOrders::default();
    for pair in json.get("orders")?.as_array()? {
        orders.add(pair.get(0)?.as_str()?, pair.get(1)?.as_str()?);
    }
    found.orders = orders;
    Some(found)
}
