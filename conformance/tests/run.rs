//! Runs every program of `programs/` and compares the result with the expectations in its comments.
//!
//! Each program is one test. It is compiled once, then runs from the compiled module and from the bytes of
//! the corresponding file: with the feature `thorough` under every setting that it does not exclude,
//! otherwise under the first of them. With a collection at every safepoint, which takes long, it runs from
//! the bytes only; that they are those of the module is compared.
#![allow(clippy::print_stderr, reason = "a test runner prints its results")]

use std::path::Path;
use std::process::ExitCode;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Compiled, Program, Source};
use esl::size::{parse_size, parse_stack};
use esl_bytecode::diagnostic::Severity;
use esl_conformance::{Expectations, Setting, programs};
use libtest_mimic::{Arguments, Failed, Trial};

#[cfg(feature = "native")]
#[path = "run/tier_calls.rs"]
mod tier_calls;
#[cfg(feature = "native")]
#[path = "run/tier_cases.rs"]
mod tier_cases;
#[cfg(feature = "native")]
#[path = "run/tiers.rs"]
mod tiers;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let folder = programs::folder();
    let names = programs::paths("").into_iter().map(|path| {
        let name = path.strip_prefix(&folder).unwrap_or(&path).display().to_string();
        (name, path)
    });
    let names: Vec<_> = names.collect();
    #[cfg(feature = "native")]
    let tiers = tiers::trials(&names).into_iter().chain(tier_cases::trials());
    #[cfg(not(feature = "native"))]
    let tiers = std::iter::empty();
    let programs =
        names.into_iter().map(|(name, path)| Trial::test(name.clone(), move || check_known(&name, &path)));
    let trials = programs.chain(tiers).collect();
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// Checks a program. A program with a known defect must fail, so that its note does not outlive the defect.
fn check_known(name: &str, path: &Path) -> Result<(), Failed> {
    let text = std::fs::read_to_string(path)?;
    let result = check(name, path);
    match (Expectations::parse(&text)?.known, result) {
        (None, result) => result,
        (Some(_), Err(_)) => Ok(()),
        (Some(reason), Ok(())) => {
            Err(format!("the program now passes; remove its line `known: {reason}`").into())
        }
    }
}

fn check(name: &str, path: &Path) -> Result<(), Failed> {
    let text = std::fs::read_to_string(path)?;
    let expected = Expectations::parse(&text)?;
    let compiled = program::compile(&[Source::new(name, text)]);
    check_diagnostics(&expected, &compiled)?;
    let Some(program) = compiled.program else { return Ok(()) };
    let bytes = program.to_bytes()?;
    let from_file = Program::from_bytes(&bytes)?;
    if from_file.to_bytes()? != bytes {
        return Err("the program that was read from bytes gives other bytes".into());
    }
    let count = if cfg!(feature = "thorough") { expected.settings.len() } else { 1 };
    for &setting in expected.settings.iter().take(count) {
        // A collection takes time in proportion to the live data, and these programs keep much data alive.
        if setting == Setting::GcStress && name.starts_with("limits") {
            continue;
        }
        let config = config(&expected.options, setting)?;
        let forms = [("from bytecode", &from_file), ("from source", &program)];
        let count = if setting == Setting::GcStress { 1 } else { forms.len() };
        for (form, program) in &forms[..count] {
            run(name, &expected, program, config.clone())
                .map_err(|text| Failed::from(format!("{form}, setting {}:\n{text}", setting.name())))?;
        }
    }
    Ok(())
}

fn check_diagnostics(expected: &Expectations, compiled: &Compiled) -> Result<(), Failed> {
    let found = |severity: Severity| {
        let mut rows: Vec<(usize, String)> = compiled
            .diagnostics
            .iter()
            .filter(|diagnostic| diagnostic.severity == severity)
            .map(|diagnostic| {
                let place = compiled.sources.place(diagnostic.primary.span);
                (place.map_or(0, |place| place.line as usize), diagnostic.code.to_string())
            })
            .collect();
        rows.sort();
        rows
    };
    let compare = |what: &str, expected: &[(usize, String)], found: Vec<(usize, String)>| {
        let mut expected = expected.to_vec();
        expected.sort();
        if expected == found {
            return Ok(());
        }
        let messages: Vec<String> =
            compiled.diagnostics.iter().map(|found| format!("{}: {}", found.code, found.message)).collect();
        Err(Failed::from(format!(
            "{what} differ\nexpected {expected:?}\nfound    {found:?}\n{}",
            messages.join("\n")
        )))
    };
    compare("errors", &expected.errors, found(Severity::Error))?;
    if expected.errors.is_empty() {
        compare("warnings", &expected.warnings, found(Severity::Warning))?;
    }
    Ok(())
}

/// Returns the configuration for a program's options and a setting.
fn config(options: &[String], setting: Setting) -> Result<Config, Failed> {
    let mut config = Config::default();
    for pair in options.chunks(2) {
        let [option, value] = pair else { return Err(format!("`{}` needs a value", pair[0]).into()) };
        match option.as_str() {
            "--memory" => config.memory = parse_size(value)?,
            "--stack" => config.stack = Some(parse_stack(value)? / size_of::<u64>()),
            "--budget" => config.budget = Some(value.parse()?),
            "--slice" => config.slice = value.parse()?,
            "--seed" => config.seed = value.parse()?,
            // The runner always uses virtual time.
            "--clock" if value == "virtual" => {}
            _ => return Err(format!("the runner does not know the option `{option}`").into()),
        }
    }
    match setting {
        Setting::Default => {}
        Setting::Slice1 => config.slice = 1,
        Setting::GcStress => config.collect_always = true,
    }
    Ok(config)
}

fn run(name: &str, expected: &Expectations, program: &Program, config: Config) -> Result<(), String> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let summary = program::run(program, config, Box::new(host)).map_err(|error| error.to_string())?;
    let (output, errors) = (captured.output(), captured.error());
    let lines: Vec<&str> = output.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    if lines != expected.output {
        let first = lines.iter().zip(&expected.output).position(|(found, expected)| found != expected);
        let first = first.unwrap_or(lines.len().min(expected.output.len()));
        return Err(format!(
            "output differs from line {} on\nexpected {:?}\nfound    {:?}\nstandard error:\n{errors}",
            first + 1,
            expected.output.get(first..).unwrap_or(&[]),
            &lines[first..],
        ));
    }
    let status = summary.ended.exit_status();
    if status != expected.expected_status() {
        return Err(format!(
            "ended with status {status} ({:?}), expected {}\nstandard error:\n{errors}",
            summary.ended,
            expected.expected_status()
        ));
    }
    if let Some((cause, line)) = &expected.failure {
        let first = format!("Failure {}, no recovery available.", cause.to_uppercase());
        if !errors.lines().any(|line| line == first) {
            return Err(format!("expected the failure {cause}\nstandard error:\n{errors}"));
        }
        // A tail call leaves no frame, and a long backtrace is truncated; the part that is shown must be
        // right.
        let shown = errors.lines().filter(|line| line.trim_start().starts_with("in ")).count();
        let mentions = errors.lines().any(|line| line.contains(&format!("{name}:")));
        if mentions && shown < 20 && !errors.contains(&format!("{name}:{line}:")) {
            return Err(format!("expected line {line} in the backtrace\nstandard error:\n{errors}"));
        }
    }
    Ok(())
}
