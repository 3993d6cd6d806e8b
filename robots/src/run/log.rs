//! Lines that a run prints, as messages of `foxglove.Log`.
//!
//! The level of a line that the module `log` has written is that of the message, in either of its forms.

use serde_json::{Value, json};

/// The schema of `foxglove.Log`.
pub(super) const SCHEMA: &str = include_str!("log.json");

/// Levels of messages in `foxglove.Log`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LogLevel {
    Debug = 1,
    Info = 2,
    Warning = 3,
    Error = 4,
}

impl LogLevel {
    fn of_name(name: &str) -> Option<LogLevel> {
        match name {
            "debug" => Some(LogLevel::Debug),
            "info" => Some(LogLevel::Info),
            "warn" => Some(LogLevel::Warning),
            "error" => Some(LogLevel::Error),
            _ => None,
        }
    }
}

/// Returns a message of `foxglove.Log`.
pub(super) fn message(time: u64, level: LogLevel, text: &str, name: &str) -> Value {
    json!({
        "timestamp": { "sec": time / 1_000_000_000, "nsec": time % 1_000_000_000 },
        "level": level as u8,
        "message": text,
        "name": name,
        "file": "",
        "line": 0,
    })
}

/// Returns level and text of a line of the error output.
pub(super) fn level_of(line: &str) -> (LogLevel, String) {
    if line.starts_with('{')
        && let Ok(Value::Object(fields)) = serde_json::from_str::<Value>(line)
        && let Some(level) = fields.get("level").and_then(Value::as_str).and_then(LogLevel::of_name)
        && let Some(text) = fields.get("message").and_then(Value::as_str)
    {
        return (level, text.to_owned());
    }
    // `2026-11-28T10:00:00.000Z info  [task] text`
    if let Some((time, rest)) = line.split_once(' ')
        && time.len() >= 20
        && time.as_bytes()[4] == b'-'
        && time.ends_with('Z')
        && let Some((level, text)) = rest.split_once(' ')
        && let Some(level) = LogLevel::of_name(level)
    {
        return (level, text.trim_start().to_owned());
    }
    (LogLevel::Warning, line.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_module_log_have_their_levels() {
        let text = "2000-01-01T00:00:01.500Z error [drill] stuck depth=20";
        assert_eq!(level_of(text), (LogLevel::Error, "[drill] stuck depth=20".into()));
        assert_eq!(level_of("2000-01-01T00:00:01.500Z info  ok"), (LogLevel::Info, "ok".into()));
        let json = r#"{"time":"2000","level":"warn","message":"low","volts":11}"#;
        assert_eq!(level_of(json), (LogLevel::Warning, "low".into()));
        assert_eq!(level_of("anything else"), (LogLevel::Warning, "anything else".into()));
    }
}
