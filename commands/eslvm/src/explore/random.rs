//! Random schedules, in place of all.

use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use esl::program::Schedule;
use esl_command::{FAILED, NOT_PROVED, StatusLine, say};
use esl_testing::explore::{RandomFound, RandomSettings, SeenOrders, Settings, explore_randomly, grains};
use serde_json::json;

use super::progress::ProgressFile;
use super::{CommandExploration, TellError, findings};

/// Pairs of places in one order that are told.
const TOLD_PAIRS: usize = 10;

impl CommandExploration<'_> {
    /// Tries random schedules, at the finest grain that would be explored. Returns the exit status.
    ///
    /// # Errors
    /// [`TellError`].
    pub(super) fn try_random(&self, random: RandomSettings) -> Result<u8, TellError> {
        let grain = grains(self.program, self.options.grain).last().copied().unwrap_or_default();
        let settings = Settings { grain, ..self.options.settings };
        let file = self.options.progress.as_deref();
        let progress = file.map(|file| {
            let identity = Schedule::new(self.program, &settings, Vec::new()).to_string();
            ProgressFile::new(file, &identity, random)
        });
        let progress = progress.as_ref();
        let file_error = |error| TellError::File(file.map(PathBuf::from).unwrap_or_default(), error);
        let begun = match progress {
            Some(progress) => progress
                .read()
                .map_err(|error| TellError::Progress(file.map(PathBuf::from).unwrap_or_default(), error))?,
            None => RandomFound::default(),
        };
        let before = begun.runs;
        // Points say where the uses of places are; a random schedule does not stop at them.
        let (program, covers) = match (progress, self.marked()) {
            (Some(_), Some(marked)) => (marked, true),
            _ => (self.program, false),
        };
        let random = RandomSettings { covers, ..random };
        let done = AtomicU64::new(0);
        let (started, time) = (self.started, self.options.time);
        let failed: Mutex<Option<io::Error>> = Mutex::default();
        let goes_on = |found: &RandomFound| {
            done.fetch_max(found.runs, Ordering::Relaxed);
            let written = progress.map_or(Ok(()), |progress| progress.write_now_and_then(found));
            let is_written = written.is_ok();
            if let (Err(error), Ok(mut failed)) = (written, failed.lock()) {
                *failed = Some(error);
            }
            is_written && started.elapsed() < time
        };
        let search = || explore_randomly(program, &settings, random, begun, self.prepare, &goes_on);
        let line = || match random.count {
            u64::MAX => format!("{} random schedules", done.load(Ordering::Relaxed)),
            count => format!("{} of {count} random schedules", done.load(Ordering::Relaxed)),
        };
        let found =
            StatusLine::new(self.options.is_quiet).during(line, search).map_err(TellError::Program)?;
        if let Some(error) = failed.into_inner().ok().flatten() {
            return Err(file_error(error));
        }
        if let Some(progress) = progress {
            progress.write(&found).map_err(file_error)?;
        }
        let findings = findings(&found.endings);
        for (finding, number) in findings.iter().zip(1..) {
            self.tell((self.program, &settings), finding, &format!("finding {number}"), number)?;
        }
        let RandomSettings { seed, depth, .. } = random;
        let next = seed.saturating_add(found.runs);
        let (least, runs) = (found.least_probability(depth), found.runs);
        let all = 1.0 - (1.0 - least).powf(runs as f64);
        let (tasks, steps) = (found.tasks, found.steps.max(found.assumed_steps));
        let (grain, timers) = (settings.grain.name(), settings.timers.name());
        let (pairs, covered) = found.orders.counts();
        if self.options.json {
            say!(
                "{}",
                json!({
                    "verdict": if findings.is_empty() { "bounded" } else { "violation" }, "grain": grain,
                    "timers": timers, "random": runs, "seed": seed, "next-seed": next, "depth": depth,
                    "tasks": tasks, "steps": steps, "probability": least, "findings": findings.len(),
                    "endless": found.endless, "before": before, "pairs": covers.then_some(pairs),
                    "covered": covers.then_some(covered), "seconds": self.started.elapsed().as_secs_f64(),
                })
            );
        } else {
            let scope = format!("grain {grain}, timers {timers}; {runs} random schedules");
            match findings.len() {
                0 => say!("bounded, not proved: no random schedule ends badly ({scope})"),
                count => say!("violation: findings: {count} ({scope})"),
            }
            say!(
                "a fault that needs {depth} steps in a certain order is found by one schedule with a probability of at \
                 least 1/({tasks} tasks * {steps} steps^{}) = {least:.2e}, by all of them of at least {all:.3}",
                depth.saturating_sub(1)
            );
            if found.endless > 0 {
                say!("not ended within very many steps: {}", found.endless);
            }
            if covers {
                say_orders(&found.orders);
            }
            match file {
                Some(file) => say!(
                    "of the schedules, earlier runs have tried {before}; to go on: --progress {}",
                    file.display()
                ),
                None => say!("to go on: --seed {next}"),
            }
        }
        Ok(if findings.is_empty() { NOT_PROVED } else { FAILED })
    }
}

/// Prints which places of the program came in both orders.
fn say_orders(orders: &SeenOrders) {
    let (pairs, covered) = orders.counts();
    say!("pairs of places of two tasks: {pairs}, in both orders: {covered}");
    for (first, second) in orders.one_way().take(TOLD_PAIRS) {
        say!("  always {first} before {second}");
    }
    let left = (pairs - covered).saturating_sub(TOLD_PAIRS);
    if left > 0 {
        say!("  … {left} more in one order only");
    }
}
