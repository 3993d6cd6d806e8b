//! `eslc rights`: the least rights that a program needs.

use std::path::PathBuf;

use clap::Args;
use esl::program;
use esl_analysis::needed_rights;
use esl_command as command;
use esl_command::{NOT_COMPILED, SUCCESS};

use crate::{SourceOptions, print, print_diagnostics, read};

/// Options of `eslc rights`.
#[derive(Args)]
pub(crate) struct NeededRightsOptions {
    /// Source files, which are looked at as one program; `-` is standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    compiling: SourceOptions,
}

/// Prints the rights that a program needs, as a file for `--rights`.
pub(crate) fn list_rights(options: &NeededRightsOptions) -> Result<u8, u8> {
    let sources = read(&options.files)?;
    let compiling = &options.compiling;
    compiling.warnings.check()?;
    let line = || "looking for rights".to_string();
    let mut compiled = command::StatusLine::new(compiling.style.quiet)
        .during(line, || program::compile_with_core(&sources, &compiling.path(&options.files)));
    compiling.warnings.apply(&mut compiled);
    if compiled.has_errors() {
        print_diagnostics(&compiled, &compiling.style);
        return Err(NOT_COMPILED);
    }
    print(&needed_rights(&compiled.core, &compiled.sources).text())?;
    Ok(SUCCESS)
}
