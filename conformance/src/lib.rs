//! The expectations that a conformance program states in its comments. `README.md` describes the format.
#![forbid(unsafe_code)]

pub mod anything;
pub mod chapter;
pub mod differential;
pub mod fault;
pub mod folder;
pub mod process;
pub mod programs;
pub mod transcript;
pub mod trials;

use std::path::Path;

use fault::{LineFault, WrongLine};

/// Returns the root of the workspace.
///
/// # Panics
/// Never: this package is a folder of the workspace.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is a folder of the workspace")
}

/// A setting under which a program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// The defaults of `eslvm`.
    Default,
    /// With slices of one tick.
    Slice1,
    /// With a collection at every safepoint.
    GcStress,
}

impl Setting {
    /// All settings.
    pub const ALL: [Setting; 3] = [Setting::Default, Setting::Slice1, Setting::GcStress];

    /// Returns the name that headers use.
    pub fn name(self) -> &'static str {
        match self {
            Setting::Default => "default",
            Setting::Slice1 => "slice1",
            Setting::GcStress => "gc-stress",
        }
    }
}

/// The expectations of a program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Expectations {
    /// Non-empty lines of standard output.
    pub output: Vec<String>,
    /// Cause and line of the failure that ends the main task.
    pub failure: Option<(String, usize)>,
    /// Line and code of compile errors.
    pub errors: Vec<(usize, String)>,
    /// Line and code of warnings.
    pub warnings: Vec<(usize, String)>,
    /// Exit status, if it differs from the one that the other expectations imply.
    pub status: Option<u8>,
    /// Known defect: the program must fail until the defect is fixed.
    pub known: Option<String>,
    /// Further options of `eslvm`.
    pub options: Vec<String>,
    /// Settings under which the program runs.
    pub settings: Vec<Setting>,
}

impl Expectations {
    /// Reads the comments of a program.
    ///
    /// # Errors
    /// The line and its fault.
    pub fn parse(text: &str) -> Result<Expectations, WrongLine> {
        let mut found = Expectations { settings: Setting::ALL.to_vec(), ..Expectations::default() };
        let mut in_header = true;
        for (index, line) in text.lines().enumerate() {
            let number = index + 1;
            in_header &= line.starts_with(';');
            if in_header {
                found.header(line.trim_start_matches(';').trim()).map_err(|fault| fault.on(number))?;
            }
            let Some((_, comment)) = line.split_once("; expect") else { continue };
            found.expectation(comment, number).map_err(|fault| fault.on(number))?;
        }
        Ok(found)
    }

    fn header(&mut self, line: &str) -> Result<(), LineFault> {
        if let Some(reason) = line.strip_prefix("known:") {
            self.known = Some(reason.trim().to_string());
        } else if let Some(options) = line.strip_prefix("options:") {
            self.options.extend(options.split_whitespace().map(String::from));
        } else if let Some(settings) = line.strip_prefix("settings:") {
            // Names come first, separated by commas; the reason follows.
            let is_named = |setting: &&Setting| {
                settings.split([',', ' ']).filter(|word| !word.is_empty()).any(|word| word == setting.name())
            };
            self.settings = Setting::ALL.iter().filter(is_named).copied().collect();
            if self.settings.is_empty() {
                return Err(LineFault::NoSetting);
            }
        }
        Ok(())
    }

    fn expectation(&mut self, comment: &str, line: usize) -> Result<(), LineFault> {
        let (kind, value) = comment.split_once(':').ok_or(LineFault::NoColon)?;
        match kind.trim() {
            "" => self.output.push(value.strip_prefix(' ').unwrap_or(value).trim_end().to_string()),
            "failure" if self.failure.is_none() => self.failure = Some((value.trim().to_string(), line)),
            "failure" => return Err(LineFault::SecondFailure),
            "error" => self.errors.push((line, value.trim().to_string())),
            "warning" => self.warnings.push((line, value.trim().to_string())),
            "status" => {
                self.status = Some(value.trim().parse().map_err(|_| LineFault::NoStatus)?);
            }
            other => return Err(LineFault::UnknownExpectation(other.into())),
        }
        Ok(())
    }

    /// Returns the expected exit status.
    pub fn expected_status(&self) -> u8 {
        self.status.unwrap_or(match (&self.errors[..], &self.failure) {
            ([], None) => 0,
            ([], Some(_)) => 1,
            _ => 3,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_read() {
        let text = "; A title.\n; options: --memory 64M\n; settings: default, slice1 too slow else\n\
                    (print 1) ; expect: 1\n(foo)   ; expect warning: undefined-function\n\
                    ; expect: two  \n(car 1) ; expect failure: :type-error\n";
        let found = Expectations::parse(text).unwrap();
        assert_eq!(found.output, ["1", "two"]);
        assert_eq!(found.failure, Some((":type-error".into(), 7)));
        assert_eq!(found.warnings, [(5, "undefined-function".into())]);
        assert_eq!(found.options, ["--memory", "64M"]);
        assert_eq!(found.settings, [Setting::Default, Setting::Slice1]);
        assert_eq!(found.expected_status(), 1);
        assert!(Expectations::parse("(x) ; expect sorrow: 1").is_err());
    }
}
