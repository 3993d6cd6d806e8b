//! Options by which faults are injected into tests.

use clap::Args;
use esl_testing::inject::{InjectFormat, InjectSettings};

use crate::testing::inject::InjectOptions;

/// Injection of faults into tests.
#[derive(Args)]
pub(crate) struct InjectArguments {
    /// Run each test, or a program without tests, with each fault of its operations, and print a table
    #[arg(long, conflicts_with_all = ["watch", "junit", "findings", "coverage"])]
    pub(crate) inject: bool,
    /// Inject only the fault of this name, such as `send#3:timeout`, and print the output of the run; implies
    /// --inject
    #[arg(long, value_name = "NAME", conflicts_with_all = ["watch", "junit", "findings", "coverage", "pairs"])]
    pub(crate) inject_only: Option<String>,
    /// Also inject two faults at once: at most N pairs, by default 500, of the first calls of operations
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "500")]
    #[arg(requires = "inject")]
    pub(crate) pairs: Option<usize>,
    /// Most calls of an operation that are disturbed: the first, the last, and others evenly between
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(requires = "inject")]
    pub(crate) calls: u32,
    /// Factor by which a disturbed run may take longer than the undisturbed one, in addition to an hour of
    /// virtual time; one that takes longer hangs. The undisturbed one may take a million ticks for each unit
    #[arg(long, value_name = "FACTOR", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) patience: u32,
    /// Form of the table
    #[arg(long, value_enum, default_value_t = InjectForm::Text)]
    pub(crate) format: InjectForm,
}

/// Form of a table of runs with faults.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum InjectForm {
    /// Text for people
    Text,
    /// One object of JSON, for `eslc failures --fmea --injected`
    Json,
    /// Comma-separated values
    Csv,
    /// A table of Markdown
    Md,
}

impl InjectArguments {
    /// Returns the settings, if faults are to be injected.
    pub(crate) fn options(&self) -> Option<InjectOptions> {
        let settings = InjectSettings {
            calls: self.calls as usize,
            patience: f64::from(self.patience),
            pairs: self.pairs.unwrap_or(0),
            only: self.inject_only.clone(),
            ..InjectSettings::default()
        };
        let format = match self.format {
            InjectForm::Text => InjectFormat::Text,
            InjectForm::Json => InjectFormat::Json,
            InjectForm::Csv => InjectFormat::Csv,
            InjectForm::Md => InjectFormat::Markdown,
        };
        (self.inject || self.inject_only.is_some()).then_some(InjectOptions { settings, format })
    }
}
