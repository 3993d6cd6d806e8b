//! `eslc`: compiles ESL programs, checks them, and shows what they become.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "commands print")]

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use esl::command::{self, NOT_COMPILED, SUCCESS, USAGE};
use esl::library::Library;
use esl::program::{self, Compiled, Modules, Program, Source};
use esl_compiler::diagnostic::{Format, Renderer};

/// The compiler of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslc", version, propagate_version = true, max_term_width = 100)]
struct Command {
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    style: Style,
    /// A folder in which required modules are found, after that of the file itself and before those of ESL_LIBRARY
    #[arg(long, value_name = "FOLDER", global = true)]
    library: Vec<PathBuf>,
}

#[derive(Args)]
struct Style {
    /// How diagnostics are written
    #[arg(long, value_enum, default_value_t = Messages::Human, global = true)]
    messages: Messages,
    /// When diagnostics are coloured
    #[arg(long, value_enum, default_value_t = Color::Auto, global = true)]
    color: Color,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Messages {
    /// For people: the source line, with what is meant underlined
    Human,
    /// For tools: a JSON object a line
    Json,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Color {
    /// If standard error is a terminal
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

#[derive(Subcommand)]
enum Action {
    /// Compile files to bytecode
    ///
    /// Without -o each FILE.esl becomes FILE.eslb, which finds the modules that it requires when it runs. With -o all files
    /// together, and the modules that they require, become one program that runs them in order.
    Compile {
        /// The source files; `-` is standard input
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// The file to write
        #[arg(short, value_name = "OUT")]
        output: Option<PathBuf>,
    },
    /// Report what is wrong with files, and write nothing
    Check {
        /// The source files; `-` is standard input
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
    },
    /// Show the instructions of a program
    Disasm {
        /// A source or bytecode file; `-` is a source from standard input
        file: PathBuf,
    },
    /// Show a program with its macros expanded
    Expand {
        /// A source file; `-` is standard input
        file: PathBuf,
    },
}

fn main() -> ExitCode {
    let command = Command::parse();
    let style = &command.style;
    let folders = &command.library;
    let library = |files: &[PathBuf]| Library::new(files.iter().map(PathBuf::as_path), folders);
    let status = match &command.action {
        Action::Compile { files, output: Some(output) } => {
            compile(files, output, &library(files), Modules::Inside, style)
        }
        Action::Compile { files, output: None } => compile_each(files, folders, style),
        Action::Check { files } => check(files, &library(files), style),
        Action::Disasm { file } => disassemble(file, &library(std::slice::from_ref(file)), style),
        Action::Expand { file } => expand(file, &library(std::slice::from_ref(file)), style),
    };
    ExitCode::from(status.unwrap_or_else(|status| status))
}

/// Reads sources, or says which could not be read.
fn read(files: &[PathBuf]) -> Result<Vec<Source>, u8> {
    files.iter().map(|file| command::read_source(file)).collect()
}

/// Compiles sources and prints what was found. The program, unless there was an error.
fn compiled(sources: &[Source], library: &Library, modules: Modules, style: &Style) -> Result<Program, u8> {
    let compiled = program::compile_with(sources, library, modules);
    print_diagnostics(&compiled, style);
    compiled.program.ok_or(NOT_COMPILED)
}

fn print_diagnostics(compiled: &Compiled, style: &Style) {
    let color = match style.color {
        Color::Auto => std::io::stderr().is_terminal(),
        Color::Always => true,
        Color::Never => false,
    };
    let format = match style.messages {
        Messages::Human => Format::Human,
        Messages::Json => Format::Json,
    };
    command::print_diagnostics(compiled, &Renderer { color, format });
}

fn compile(
    files: &[PathBuf],
    output: &Path,
    library: &Library,
    modules: Modules,
    style: &Style,
) -> Result<u8, u8> {
    let program = compiled(&read(files)?, library, modules, style)?;
    write(&program, output)
}

fn compile_each(files: &[PathBuf], folders: &[PathBuf], style: &Style) -> Result<u8, u8> {
    let mut status = SUCCESS;
    for file in files {
        if file.as_os_str() == "-" {
            eprintln!("eslc: say with -o where the program from standard input goes");
            return Err(USAGE);
        }
        let library = Library::new([file.as_path()], folders);
        let files = std::slice::from_ref(file);
        let result = compile(files, &file.with_extension("eslb"), &library, Modules::Apart, style);
        status = status.max(result.unwrap_or_else(|status| status));
    }
    Ok(status)
}

/// Writes a program beside its place first, so that a file that is there is never left half written.
fn write(program: &Program, output: &Path) -> Result<u8, u8> {
    let bytes = program.to_bytes().map_err(|text| {
        eprintln!("eslc: {text}");
        NOT_COMPILED
    })?;
    let mut name = output.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.tmp", std::process::id()));
    let partial = output.with_file_name(name);
    let result = std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, output));
    result.map(|()| SUCCESS).map_err(|error| {
        // The error that counts is the first one.
        _ = std::fs::remove_file(&partial);
        eprintln!("eslc: {} cannot be written: {error}", output.display());
        USAGE
    })
}

fn check(files: &[PathBuf], library: &Library, style: &Style) -> Result<u8, u8> {
    compiled(&read(files)?, library, Modules::Inside, style).map(|_| SUCCESS)
}

fn disassemble(file: &Path, library: &Library, style: &Style) -> Result<u8, u8> {
    let program = match command::read_program(file)? {
        command::Input::Program(program) => program,
        command::Input::Source(source) => compiled(&[source], library, Modules::Apart, style)?,
    };
    print(&program.disassemble())
}

fn expand(file: &Path, library: &Library, style: &Style) -> Result<u8, u8> {
    let source = command::read_source(file)?;
    let (text, compiled) = program::expand(&source, library);
    print_diagnostics(&compiled, style);
    print(&text)?;
    if compiled.has_errors() { Err(NOT_COMPILED) } else { Ok(SUCCESS) }
}

/// Prints to standard output. Nobody reading any more is no error.
fn print(text: &str) -> Result<u8, u8> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            eprintln!("eslc: standard output cannot be written: {error}");
            Err(USAGE)
        }
        _ => Ok(SUCCESS),
    }
}
