//! `eslc`: compiles and checks ESL programs, and shows their expansion and bytecode.
//!
//! A program of its own, and a part of `eslvm` where that is built with the feature `eslc`, as packages are.
#![forbid(unsafe_code)]

mod failures;
mod format;
mod import;
#[cfg(feature = "robots")]
mod messages;
mod new;
mod rights;
mod warnings;

use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use esl::module_path::ModulePath;
use esl::program::{self, Compiled, Modules, Program, Source};
use esl_analysis::AnalysisOptions;
use esl_command as command;
use esl_command::{FAILED, NOT_COMPILED, ProgramFile, SUCCESS, USAGE, complain};
use esl_compiler::diagnostic::{Format, Renderer};
use esl_language_server::ClientExit;

use failures::{FailureOptions, GraphOptions, draw_graph, list_failures};
use format::{FormatOptions, format_files};
use import::{ImportOptions, import_tree};
use rights::{NeededRightsOptions, list_rights};
use warnings::WarningOptions;

/// The answer to `--version`.
static BUILD: LazyLock<String> = LazyLock::new(|| {
    command::version_of_build(env!("CARGO_PKG_VERSION"), &[("robots", cfg!(feature = "robots"))])
});

/// The compiler of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslc", version, long_version = BUILD.as_str(), propagate_version = true, max_term_width = 100)]
struct Eslc {
    #[command(subcommand)]
    action: EslcAction,
}

/// Where required modules are.
#[derive(Args)]
struct LibraryFolders {
    /// Folder to search for required modules, after the folder of the file and before those of ESL_LIBRARY
    #[arg(long, value_name = "FOLDER")]
    library: Vec<PathBuf>,
}

/// Options of the commands that compile files.
#[derive(Args)]
struct SourceOptions {
    #[command(flatten)]
    style: Style,
    #[command(flatten)]
    warnings: WarningOptions,
    #[command(flatten)]
    modules: LibraryFolders,
}

impl SourceOptions {
    /// Returns where the modules of files are searched for.
    fn path(&self, files: &[PathBuf]) -> ModulePath {
        ModulePath::new(files.iter().map(PathBuf::as_path), &self.modules.library)
    }
}

#[derive(Args)]
struct Style {
    /// Form of diagnostics
    #[arg(long, value_enum, default_value_t = Messages::Human)]
    messages: Messages,
    /// Use of colour in diagnostics
    #[arg(long, value_enum, default_value_t = Color::Auto)]
    color: Color,
    /// Show no progress line at a terminal
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Messages {
    /// For people: the source line with the fault underlined
    Human,
    /// For tools: one JSON object per line
    Json,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Color {
    /// Coloured if standard error is a terminal and `NO_COLOR` is not set
    Auto,
    /// Always coloured
    Always,
    /// Never coloured
    Never,
}

#[derive(Subcommand)]
enum EslcAction {
    /// Make a project: a plan, stand-ins for the outside, tests, editor settings
    New {
        /// Folder to be made
        name: PathBuf,
    },
    /// Compile files to bytecode
    ///
    /// Without -o each FILE.esl becomes a FILE.eslb of its own, which finds the modules that it requires when
    /// it runs. With -o all files, and the modules that they require, become one program that runs the files
    /// in order.
    Compile {
        /// Source files; `-` is standard input
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// File to write
        #[arg(short, value_name = "OUT")]
        output: Option<PathBuf>,
        #[command(flatten)]
        compiling: SourceOptions,
    },
    /// Report errors and warnings, and write nothing
    ///
    /// Files that are named are checked together, as parts of one program; each source in a folder by itself.
    /// Exit status: 0 no errors; 2 wrong usage, or a file that cannot be read; 3 there are errors, or
    /// warnings that are denied.
    Check {
        /// Source files, or folders, whose `.esl` files are meant; `-` is standard input; by default this
        /// folder
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        compiling: SourceOptions,
    },
    /// Show the instructions of a program
    Disasm {
        /// Source or bytecode file; `-` is a source from standard input
        file: PathBuf,
        #[command(flatten)]
        compiling: SourceOptions,
    },
    /// Show a program with its macros expanded
    Expand {
        /// Source file; `-` is standard input
        file: PathBuf,
        #[command(flatten)]
        compiling: SourceOptions,
    },
    /// List the least rights that a program needs
    ///
    /// Prints a flag of `eslvm run` a line, which is a file for its option `--rights`: the objects that calls
    /// name by constants. Comments tell of calls whose objects are computed. Each call in the text counts,
    /// whether or not it is ever made.
    Rights {
        #[command(flatten)]
        options: NeededRightsOptions,
    },
    /// Draw the failures of a program as a picture
    ///
    /// Prints a drawing in SVG: on the left the functions in which failures begin, in the middle the clauses
    /// that take them, on the right the tasks, and an arrow for each failure that a clause takes, or that
    /// ends a task. Modules that come with the system are left out.
    Graph {
        #[command(flatten)]
        options: GraphOptions,
    },
    /// List possible failures, the clauses that take them, and those that reach the top
    ///
    /// For each task and function: the causes of the failures that can leave it, where these begin,
    /// which clauses take them and how the clauses answer. The modules that the files require are
    /// looked at too. `(declaim (fails NAME CAUSE…))` declares the causes of a function: others are
    /// errors, and declared ones that never come are warnings. Exit status: 0 the table is printed;
    /// 2 wrong usage, or a file that cannot be read; 3 there are errors.
    Failures {
        #[command(flatten)]
        options: FailureOptions,
    },
    /// Format files as Lisp programmers expect
    ///
    /// Blanks, indentation, lone parentheses and blank lines are put right, and lines of more than 100
    /// columns are broken; other lines keep their breaks. Comments, strings and all that is read stay the
    /// same. The indentation follows from the operators: library macros and those that the file and its
    /// modules define are indented by the `&body` of their lambda lists, or as `(declare (indent N))` says in
    /// them.
    #[command(visible_alias = "fmt")]
    Format {
        #[command(flatten)]
        options: FormatOptions,
        #[command(flatten)]
        modules: LibraryFolders,
    },
    /// Write a program for a behaviour tree
    ///
    /// Reads the XML of BehaviorTree.CPP, formats 3 and 4, and the files that it includes. Exit status: 0 the
    /// program is written; 2 wrong usage, or a file that cannot be read; 3 there are faults in the tree.
    Import {
        #[command(flatten)]
        options: ImportOptions,
    },
    /// Start the language server, which editors talk to over standard input and output
    Lsp {
        /// Ignored; some editors pass it to name the transport
        #[arg(long, hide = true)]
        stdio: bool,
        #[command(flatten)]
        modules: LibraryFolders,
    },
    /// Print the completions for a shell
    ///
    /// For bash: eslc completions bash > ~/.local/share/bash-completion/completions/eslc
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages
    Man {
        /// Folder to write them to, one page for each subcommand; without it, the first page is printed
        folder: Option<PathBuf>,
    },
}

/// Words in place of a subcommand, and what to type.
const HABITS: command::Habits = &[
    ("indent", "eslc format"),
    ("lint", "eslc check"),
    ("convert", "eslc import"),
    ("clippy", "eslc check"),
    ("build", "eslc compile"),
    ("init", "eslc new"),
    ("create", "eslc new"),
    ("macroexpand", "eslc expand"),
    ("disassemble", "eslc disasm"),
    ("run", "eslvm run"),
    ("test", "eslvm test"),
    ("explore", "eslvm explore"),
    ("replay", "eslvm replay"),
    ("attach", "eslvm attach"),
    ("repl", "eslvm repl"),
];

/// Runs the command line of the process, and returns its exit status.
pub fn main() -> u8 {
    command::add_modules();
    #[cfg(feature = "robots")]
    esl_analysis::compare_message_fields(messages::fields);
    let status = match command::parse::<Eslc>("eslc check", HABITS).action {
        EslcAction::Compile { files, output: Some(output), compiling } => {
            compile(&files, &output, Modules::Inside, &compiling)
        }
        EslcAction::Compile { files, output: None, compiling } => compile_each(&files, &compiling),
        EslcAction::Check { files, compiling } => check(&files, &compiling),
        EslcAction::Disasm { file, compiling } => disassemble(&file, &compiling),
        EslcAction::Format { options, modules } => Ok(format_files(&options, &modules.library)),
        EslcAction::Rights { options } => list_rights(&options),
        EslcAction::Graph { options } => draw_graph(&options),
        EslcAction::Failures { options } => list_failures(&options),
        EslcAction::Import { options } => Ok(import_tree(&options)),
        EslcAction::New { name } => Ok(new::new_project(&name)),
        EslcAction::Lsp { modules, .. } => serve_editor(modules.library),
        EslcAction::Completions { shell } => Ok(command::print_completions(shell, Eslc::command())),
        EslcAction::Man { folder } => Ok(command::write_man_pages(Eslc::command(), folder.as_deref())),
        EslcAction::Expand { file, compiling } => expand(&file, &compiling),
    };
    status.unwrap_or_else(|status| status)
}

/// Reads sources.
///
/// # Errors
/// The exit status, after a message; so for all functions here.
fn read(files: &[PathBuf]) -> Result<Vec<Source>, u8> {
    files.iter().map(|file| command::read_source(file)).collect()
}

/// Compiles sources, without the warnings that are allowed, and with those that are denied as errors.
fn compile_sources(
    sources: &[Source],
    options: &SourceOptions,
    compile: impl FnOnce() -> Compiled,
) -> Result<Compiled, u8> {
    options.warnings.check()?;
    let names: Vec<&str> = sources.iter().map(|source| &*source.name).collect();
    let line = || format!("compiling {}", names.join(", "));
    let mut compiled = command::StatusLine::new(options.style.quiet).during(line, compile);
    options.warnings.apply(&mut compiled);
    Ok(compiled)
}

/// Compiles sources and prints the diagnostics. Returns the program, if there was no error.
fn compiled(
    sources: &[Source],
    path: &ModulePath,
    modules: Modules,
    options: &SourceOptions,
) -> Result<Compiled, u8> {
    let compiled = compile_sources(sources, options, || program::compile_with(sources, path, modules))?;
    print_diagnostics(&compiled, &options.style);
    if compiled.has_errors() { Err(NOT_COMPILED) } else { Ok(compiled) }
}

fn print_diagnostics(compiled: &Compiled, style: &Style) {
    let color = match style.color {
        Color::Auto => command::wants_color(),
        Color::Always => true,
        Color::Never => false,
    };
    let format = match style.messages {
        Messages::Human => Format::Human,
        Messages::Json => Format::Json,
    };
    command::print_diagnostics(compiled, &Renderer { color, format });
}

fn compile(files: &[PathBuf], output: &Path, modules: Modules, options: &SourceOptions) -> Result<u8, u8> {
    let sources = read(files)?;
    command::refuse_overwriting(output, files.iter().map(PathBuf::as_path))?;
    let compiled = compiled(&sources, &options.path(files), modules, options)?;
    // The modules that it requires are known now.
    command::refuse_overwriting(output, compiled.sources.names().map(Path::new))?;
    write(&compiled.program.ok_or(NOT_COMPILED)?, output)
}

fn compile_each(files: &[PathBuf], options: &SourceOptions) -> Result<u8, u8> {
    let mut status = SUCCESS;
    for file in files {
        if file.as_os_str() == "-" {
            complain("a program from standard input has no name: name the output with -o");
            return Err(USAGE);
        }
        let result =
            compile(std::slice::from_ref(file), &file.with_extension("eslb"), Modules::Apart, options);
        status = status.max(result.unwrap_or_else(|status| status));
    }
    Ok(status)
}

/// Writes a program to a file.
fn write(program: &Program, output: &Path) -> Result<u8, u8> {
    let bytes = program.to_bytes().map_err(|error| {
        complain(error);
        NOT_COMPILED
    })?;
    command::replace_file(output, &bytes).map(|()| SUCCESS).map_err(|error| {
        complain(format_args!("{} cannot be written: {error}", output.display()));
        USAGE
    })
}

fn check(paths: &[PathBuf], options: &SourceOptions) -> Result<u8, u8> {
    let here = [PathBuf::from(".")];
    let (folders, files): (Vec<PathBuf>, Vec<PathBuf>) =
        if paths.is_empty() { &here[..] } else { paths }.iter().cloned().partition(|path| path.is_dir());
    let mut status = SUCCESS;
    let mut told = HashSet::new();
    if !files.is_empty() {
        status = check_program(&files, options, &mut told)?;
    }
    for folder in &folders {
        let sources = command::sources_in(folder)?;
        if sources.is_empty() {
            complain(format_args!("no source (*.esl) is in {}", folder.display()));
            return Err(USAGE);
        }
        for file in &sources {
            status = status.max(check_program(std::slice::from_ref(file), options, &mut told)?);
        }
    }
    Ok(status)
}

/// Checks files as one program. Diagnostics that were reported before, of a module that several files
/// require, are left out.
fn check_program(
    files: &[PathBuf],
    options: &SourceOptions,
    told: &mut HashSet<(String, u32, String)>,
) -> Result<u8, u8> {
    let sources = read(files)?;
    let mut compiled = compile_sources(&sources, options, || {
        let mut compiled = program::compile_with_core(&sources, &options.path(files));
        let cores = std::mem::take(&mut compiled.core);
        if !compiled.has_errors() {
            let (table, _) = esl_analysis::analyze(cores, &compiled.sources, &AnalysisOptions::default());
            esl_analysis::sharpen(&mut compiled.diagnostics, &table);
            let mut found = table.findings;
            compiled.drop_allowed(&mut found);
            compiled.diagnostics.extend(found);
        }
        compiled
    })?;
    let has_errors = compiled.has_errors();
    let Compiled { diagnostics, sources, .. } = &mut compiled;
    diagnostics.retain(|diagnostic| {
        let place = diagnostic.primary.span;
        let source = sources.name(place.source).unwrap_or_default();
        told.insert((source.to_string(), place.start, diagnostic.message.clone()))
    });
    print_diagnostics(&compiled, &options.style);
    Ok(if has_errors { NOT_COMPILED } else { SUCCESS })
}

fn disassemble(file: &Path, options: &SourceOptions) -> Result<u8, u8> {
    let path = options.path(&[file.to_path_buf()]);
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            compiled(&[source], &path, Modules::Apart, options)?.program.ok_or(NOT_COMPILED)?
        }
    };
    print(&program.disassemble())
}

fn expand(file: &Path, options: &SourceOptions) -> Result<u8, u8> {
    let source = command::read_source(file)?;
    options.warnings.check()?;
    let (text, mut compiled) = program::expand(&source, &options.path(&[file.to_path_buf()]));
    options.warnings.apply(&mut compiled);
    print_diagnostics(&compiled, &options.style);
    print(&text)?;
    if compiled.has_errors() { Err(NOT_COMPILED) } else { Ok(SUCCESS) }
}

/// Serves an editor. Returns the exit status: 0 if it has asked for the end before it left, 1 if it has not.
fn serve_editor(folders: Vec<PathBuf>) -> Result<u8, u8> {
    match esl_language_server::serve(folders) {
        Ok(ClientExit::AfterShutdown) => Ok(SUCCESS),
        Ok(ClientExit::WithoutShutdown) => Ok(FAILED),
        Err(error) => {
            complain(error);
            Err(USAGE)
        }
    }
}

/// Prints to standard output. A reader that has gone away is not an error.
fn print(text: &str) -> Result<u8, u8> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            complain(format_args!("standard output cannot be written: {error}"));
            Err(USAGE)
        }
        _ => Ok(SUCCESS),
    }
}
