//! Random schedules, in place of all.

use std::sync::atomic::{AtomicU64, Ordering};

use esl_command::{FAILED, NOT_PROVED, StatusLine, say};
use esl_testing::explore::{RandomSettings, Settings, explore_randomly, grains};
use serde_json::json;

use super::{CommandExploration, TellError, findings};

impl CommandExploration<'_> {
    /// Tries random schedules, at the finest grain that would be explored. Returns the exit status.
    ///
    /// # Errors
    /// [`TellError`].
    pub(super) fn try_random(&self, random: RandomSettings) -> Result<u8, TellError> {
        let grain = grains(self.program, self.options.grain).last().copied().unwrap_or_default();
        let settings = Settings { grain, ..self.options.settings };
        let done = AtomicU64::new(0);
        let (started, time) = (self.started, self.options.time);
        let search = || {
            explore_randomly(self.program, &settings, random, self.prepare, &|number| {
                done.fetch_max(number, Ordering::Relaxed);
                started.elapsed() < time
            })
        };
        let line = || format!("{} of {} random schedules", done.load(Ordering::Relaxed), random.count);
        let found =
            StatusLine::new(self.options.is_quiet).during(line, search).map_err(TellError::Program)?;
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
        if self.options.json {
            say!(
                "{}",
                json!({
                    "verdict": if findings.is_empty() { "bounded" } else { "violation" }, "grain": grain,
                    "timers": timers, "random": runs, "seed": seed, "next-seed": next, "depth": depth,
                    "tasks": tasks, "steps": steps, "probability": least, "findings": findings.len(),
                    "endless": found.endless, "seconds": self.started.elapsed().as_secs_f64(),
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
            say!("to go on: --seed {next}");
        }
        Ok(if findings.is_empty() { NOT_PROVED } else { FAILED })
    }
}
