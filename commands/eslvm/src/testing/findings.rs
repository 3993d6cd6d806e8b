//! The schedules under which tests fail: as tables in reports, and as JSON for editors.

use std::path::Path;
use std::sync::PoisonError;

use esl::Error;
use esl::program::Program;
use esl_testing::explore::SourceForms;
use esl_testing::{FailingSchedule, Setup, Test};
use serde_json::{Value as Json, json};

use super::Run;
use crate::explore::tell;

/// A schedule under which a test fails, as it is shown.
pub(super) struct ShownSchedule {
    /// The table of its steps.
    pub(super) lines: Vec<String>,
    /// The lines of the table, as JSON.
    steps: Vec<Json>,
    repeated: usize,
}

impl ShownSchedule {
    /// Follows a schedule of a test of this program.
    ///
    /// # Errors
    /// As [`FailingSchedule::steps`].
    pub(super) fn of(
        schedule: &FailingSchedule,
        program: &Program,
        test: &Test,
        setup: &Setup,
    ) -> Result<ShownSchedule, Error> {
        let (steps, forms) = (schedule.steps(program, test, setup)?, &mut SourceForms::default());
        let mut lines = tell::lines(&steps, forms);
        lines.extend(tell::last_again(schedule.repeated).map(|again| format!("  {again}")));
        Ok(ShownSchedule { lines, steps: tell::json(&steps, forms), repeated: schedule.repeated })
    }
}

/// Writes the findings of tests to a file, also if there are none, in place of those of an earlier run.
///
/// # Errors
/// Those of writing the file.
pub(super) fn write(file: &Path, runs: &[Run<'_>]) -> std::io::Result<()> {
    let findings: Vec<Json> = runs.iter().filter_map(finding).collect();
    let text = json!({ "folder": std::env::current_dir()?, "findings": findings });
    std::fs::write(file, format!("{text}\n"))
}

/// Returns the finding of a test, if it fails under a schedule.
fn finding(run: &Run<'_>) -> Option<Json> {
    let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
    let (finished, (why, output)) = result.as_ref().and_then(|found| Some((found, found.failure()?)))?;
    let ShownSchedule { steps, repeated, .. } = finished.shown.as_ref()?;
    let name = &run.test.name;
    Some(json!({
        "finding": format!("{name}: {why}"), "test": name, "steps": steps, "repeated": repeated,
        "report": output, "again": run.again(finished),
    }))
}
