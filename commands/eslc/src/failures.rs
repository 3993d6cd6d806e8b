//! `eslc failures`: the possible failures of a program, the clauses that take them, the ones that reach the
//! top.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use esl::program;
use esl_analysis::render::{EarlierNotes, InjectedOutcomes, TableFormat, render, render_fmea, render_graph};
use esl_analysis::{AnalysisOptions, FailureTable, analyze};
use esl_command as command;
use esl_command::{FAILED, NOT_COMPILED, SUCCESS, USAGE};

use crate::{SourceOptions, print, print_diagnostics, read};

/// Options of `eslc failures`.
#[derive(Args)]
pub(crate) struct FailureOptions {
    /// Source files, which are looked at as one program; `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Form of the table
    #[arg(long, value_enum, default_value_t = TableForm::Text, conflicts_with = "explain")]
    format: TableForm,
    /// Show the ways of one cause, such as `:timeout`, and of those below it, instead of the table; `any` for
    /// those that are not known
    #[arg(long, value_name = "CAUSE")]
    explain: Option<String>,
    /// Print the failure modes and effects, one line for each cause and function in which it begins
    #[arg(long, conflicts_with = "explain")]
    fmea: bool,
    /// File with an earlier table of `--fmea --format csv`, whose severities and notes are carried over
    #[arg(long, value_name = "FILE", requires = "fmea")]
    notes: Option<PathBuf>,
    /// File that `eslvm test --inject --format json` has written: the end effects are those that were seen
    #[arg(long, value_name = "FILE", requires = "fmea")]
    injected: Vec<PathBuf>,
    /// List programming errors too, such as values of a wrong type
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    compiling: SourceOptions,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TableForm {
    /// Text for people
    Text,
    /// One object of JSON
    Json,
    /// Comma-separated values
    Csv,
    /// Tables of Markdown
    Md,
    /// A page of HTML
    Html,
}

/// Analyses files and prints the table. Declarations that do not hold are errors.
pub(crate) fn list_failures(options: &FailureOptions) -> Result<u8, u8> {
    let compiling = &options.compiling;
    let wanted = AnalysisOptions { all: options.all, explained: options.explain.clone() };
    let AnalysedProgram { mut compiled, table, explanation } = analysed(&options.files, compiling, &wanted)?;
    // Warnings of the compiler are those of `eslc check`.
    let mut findings = table.findings.clone();
    compiled.drop_allowed(&mut findings);
    compiled.diagnostics = findings;
    compiling.warnings.apply(&mut compiled);
    let has_failed = compiled.has_errors();
    print_diagnostics(&compiled, &compiling.style);
    let format = match options.format {
        TableForm::Text => TableFormat::Text,
        TableForm::Json => TableFormat::Json,
        TableForm::Csv => TableFormat::Csv,
        TableForm::Md => TableFormat::Markdown,
        TableForm::Html => TableFormat::Html,
    };
    let earlier = match &options.notes {
        Some(file) => EarlierNotes::read(&read_text(file)?).map_err(|error| {
            command::complain(format_args!("--notes {}: {error}", file.display()));
            USAGE
        })?,
        None => EarlierNotes::default(),
    };
    let mut injected = Vec::new();
    for file in &options.injected {
        injected.push(read_text(file)?);
    }
    let seen = InjectedOutcomes::read(injected.iter().map(String::as_str)).map_err(|error| {
        command::complain(format_args!("--injected: {error}"));
        USAGE
    })?;
    let text = match (&options.explain, options.fmea) {
        (Some(_), _) => explanation,
        (None, true) => render_fmea(&table, format, earlier, seen),
        (None, false) => render(&table, format),
    };
    print(&text)?;
    Ok(if has_failed { NOT_COMPILED } else { SUCCESS })
}

/// Options of `eslc graph`.
#[derive(Args)]
pub(crate) struct GraphOptions {
    /// Source files, which are looked at as one program; `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    compiling: SourceOptions,
}

/// Analyses files and prints the picture of their failures.
pub(crate) fn draw_graph(options: &GraphOptions) -> Result<u8, u8> {
    let compiled = analysed(&options.files, &options.compiling, &AnalysisOptions::default())?;
    let names: Vec<String> = options.files.iter().map(|file| file.display().to_string()).collect();
    print(&render_graph(&compiled.table, &names.join(", ")))?;
    Ok(SUCCESS)
}

/// An analysed program.
struct AnalysedProgram {
    compiled: program::Compiled,
    table: FailureTable,
    explanation: String,
}

/// Compiles and analyses files.
///
/// # Errors
/// The exit status, after the messages of the compiler.
fn analysed(
    files: &[PathBuf],
    compiling: &SourceOptions,
    wanted: &AnalysisOptions,
) -> Result<AnalysedProgram, u8> {
    let sources = read(files)?;
    compiling.warnings.check()?;
    let line = || "looking for failures".to_string();
    let mut compiled = command::StatusLine::new(compiling.style.quiet)
        .during(line, || program::compile_with_core(&sources, &compiling.path(files)));
    compiling.warnings.apply(&mut compiled);
    let cores = std::mem::take(&mut compiled.core);
    if compiled.has_errors() {
        print_diagnostics(&compiled, &compiling.style);
        return Err(NOT_COMPILED);
    }
    let (table, explanation) = analyze(cores, &compiled.sources, wanted);
    if table.is_incomplete {
        command::complain(format_args!(
            "the failures of this program cannot be listed: too many functions flow through it as values; try parts of it"
        ));
        return Err(FAILED);
    }
    Ok(AnalysedProgram { compiled, table, explanation })
}

/// Reads a file.
///
/// # Errors
/// The exit status, after a message.
fn read_text(file: &Path) -> Result<String, u8> {
    std::fs::read_to_string(file).map_err(|error| {
        command::complain(format_args!("{} cannot be read: {error}", file.display()));
        USAGE
    })
}
