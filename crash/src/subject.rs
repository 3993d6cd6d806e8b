//! The program under test: its processes, and their ends.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::check::{Counts, EndedRun};
use super::device;

/// Most seconds of one process.
const PATIENCE: Duration = Duration::from_secs(60);

/// The device in a process of its own.
pub(crate) struct DeviceProcess {
    child: Child,
    pub(crate) port: u16,
}

impl DeviceProcess {
    /// Begins it.
    pub(crate) fn begin() -> std::io::Result<DeviceProcess> {
        let own = std::env::current_exe()?;
        let mut child = Command::new(own).arg("device").stdout(Stdio::piped()).spawn()?;
        let mut line = String::new();
        if let Some(output) = child.stdout.take() {
            BufReader::new(output).read_line(&mut line)?;
        }
        let port = line.trim().parse().map_err(|_| std::io::Error::other("the device does not serve"))?;
        Ok(DeviceProcess { child, port })
    }

    /// Returns its report, and resets it.
    pub(crate) fn report(&self) -> std::io::Result<String> {
        device::ask(self.port, "report")
    }
}

impl Drop for DeviceProcess {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// How a process of a run ends.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KillMode {
    /// By itself.
    None,
    /// It is killed after this time.
    After(Duration),
    /// It is killed at this place among those before and behind the calls of its journal.
    AtPlace(u64),
}

/// A program under test, in a folder of its own.
pub(crate) struct Subject {
    eslvm: PathBuf,
    folder: PathBuf,
    is_power: bool,
    snapshot_every: String,
}

impl Subject {
    /// Writes the program.
    pub(crate) fn new(
        eslvm: &Path,
        text: &str,
        is_power: bool,
        snapshot_every: &str,
    ) -> std::io::Result<Subject> {
        let folder = std::env::temp_dir().join(format!("esl-crash-{}", std::process::id()));
        drop(fs::remove_dir_all(&folder));
        fs::create_dir_all(&folder)?;
        fs::write(folder.join("program.esl"), text)?;
        Ok(Subject { eslvm: eslvm.canonicalize()?, folder, is_power, snapshot_every: snapshot_every.into() })
    }

    /// Keeps the program and the files of its last run.
    pub(crate) fn keep(&self) -> std::io::Result<PathBuf> {
        let kept = self
            .folder
            .with_extension(format!("{:?}", Instant::now()).replace(|c: char| !c.is_ascii_digit(), ""));
        fs::create_dir_all(&kept)?;
        for name in ["program.esl", "output", "errors"] {
            drop(fs::copy(self.folder.join(name), kept.join(name)));
        }
        fs::create_dir_all(kept.join("state"))?;
        for entry in fs::read_dir(self.folder.join("state"))? {
            let entry = entry?;
            drop(fs::copy(entry.path(), kept.join("state").join(entry.file_name())));
        }
        Ok(kept)
    }

    fn clear(&self) {
        drop(fs::remove_dir_all(self.folder.join("state")));
        drop(fs::remove_file(self.folder.join("output")));
        drop(fs::remove_file(self.folder.join("errors")));
    }

    fn appended(&self, name: &str) -> std::io::Result<File> {
        OpenOptions::new().append(true).create(true).open(self.folder.join(name))
    }

    fn begin(&self, mode: KillMode) -> std::io::Result<Child> {
        let mut command = Command::new(&self.eslvm);
        command.args([
            "run",
            "--quiet",
            "--allow-net=127.0.0.1",
            "--tier",
            "interpreter",
            "--state",
            "state",
        ]);
        command.args(["--snapshot-every", &self.snapshot_every]);
        if self.is_power {
            command.args(["--durability", "power"]);
        }
        if let KillMode::AtPlace(place) = mode {
            command.env("ESL_DURABLE_KILL_AT", place.to_string());
        }
        command.arg("program.esl").current_dir(&self.folder).stdin(Stdio::null());
        command.stdout(self.appended("output")?).stderr(self.appended("errors")?).spawn()
    }

    /// Waits for a process, and kills it if it is time. Returns its status; `None` if it was killed.
    fn wait(&self, mut child: Child, mode: KillMode) -> std::io::Result<Option<i32>> {
        let limit = match mode {
            KillMode::After(time) => time,
            _ => PATIENCE,
        };
        let started = Instant::now();
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status.code());
            }
            if started.elapsed() >= limit {
                child.kill()?;
                let status = child.wait()?;
                if limit == PATIENCE {
                    return Err(std::io::Error::other("a process does not end"));
                }
                return Ok(status.code());
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Runs the program in one process. Returns how that has ended, and how long it took.
    pub(crate) fn run_alone(&self, device: &DeviceProcess) -> std::io::Result<(EndedRun, Duration)> {
        self.clear();
        device.report()?;
        let started = Instant::now();
        let status = self.wait(self.begin(KillMode::None)?, KillMode::None)?;
        Ok((self.ended(status, 0, device)?, started.elapsed()))
    }

    /// Runs the program in processes that are killed, until one comes to its end.
    pub(crate) fn run_killed(
        &self,
        device: &DeviceProcess,
        mut mode: impl FnMut() -> KillMode,
        counts: &mut Counts,
    ) -> std::io::Result<EndedRun> {
        self.clear();
        device.report()?;
        let mut kills = 0;
        counts.runs += 1;
        loop {
            let mode = mode();
            match self.wait(self.begin(mode)?, mode)? {
                Some(status) => return self.ended(Some(status), kills, device),
                None => {
                    kills += 1;
                    counts.note_kill(mode);
                }
            }
        }
    }

    fn ended(&self, status: Option<i32>, kills: u64, device: &DeviceProcess) -> std::io::Result<EndedRun> {
        let read =
            |name: &str| fs::read(self.folder.join(name)).map(|b| String::from_utf8_lossy(&b).into_owned());
        Ok(EndedRun {
            status,
            kills,
            output: read("output")?,
            errors: read("errors")?,
            report: device.report()?,
        })
    }
}

impl Drop for Subject {
    fn drop(&mut self) {
        drop(fs::remove_dir_all(&self.folder));
    }
}
