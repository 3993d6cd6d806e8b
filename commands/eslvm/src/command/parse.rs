//! Values of options, as they are typed.

use std::path::PathBuf;
use std::time::Duration;

/// End of the names of files with findings, by which editors find them.
const FINDINGS: &str = ".findings.json";

/// Parses the name of a file with findings.
pub(super) fn parse_findings(text: &str) -> Result<PathBuf, &'static str> {
    match text.ends_with(FINDINGS) {
        true => Ok(text.into()),
        false => Err("expected a name that ends in `.findings.json`: editors look for such files only"),
    }
}

/// Parses a time: a number of seconds, or a number with a unit.
pub(super) fn parse_time(text: &str) -> Result<Duration, humantime::DurationError> {
    match text.parse() {
        Ok(seconds) => Ok(Duration::from_secs(seconds)),
        Err(_) => humantime::parse_duration(text),
    }
}

/// Parses the speed of the program's clock.
pub(super) fn parse_speed(text: &str) -> Result<f64, &'static str> {
    match text.parse() {
        Ok(speed) if (1e-6..=1e6).contains(&speed) => Ok(speed),
        _ => Err("expected a number from 0.000001 to 1000000"),
    }
}
