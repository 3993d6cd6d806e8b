//! `eslc`: compiles and checks ESL programs, and shows their expansion and bytecode.
#![forbid(unsafe_code)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use esl::command::{self, NOT_COMPILED, ProgramFile, SUCCESS, USAGE, complain};
use esl::format::{FormatOptions, format_files};
use esl::module_path::ModulePath;
use esl::program::{self, Compiled, Modules, Program, Source};
use esl_compiler::diagnostic::{Format, Renderer};

/// The compiler of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslc", version, propagate_version = true, max_term_width = 100)]
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
    Check {
        /// Source files; `-` is standard input
        #[arg(required = true, value_name = "FILE")]
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
    /// Format files as Lisp programmers expect
    ///
    /// Blanks, indentation, lone parentheses and blank lines are put right, and lines of more than 100
    /// columns are broken; other lines keep their breaks. Comments, strings and all that is read stay the same. What
    /// stands under what follows from the operators: library macros and those that the file and its modules
    /// define are indented by the `&body` of their lambda lists, or as `(declare (indent N))` says in them.
    #[command(visible_alias = "fmt")]
    Format {
        #[command(flatten)]
        options: FormatOptions,
        #[command(flatten)]
        modules: LibraryFolders,
    },
    /// Start the language server, which editors talk to over standard input and output
    Lsp {
        /// Taken for the sake of editors that name the way of talking
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

fn main() -> ExitCode {
    let status = match Eslc::parse().action {
        EslcAction::Compile { files, output: Some(output), compiling } => {
            compile(&files, &output, &compiling.path(&files), Modules::Inside, &compiling.style)
        }
        EslcAction::Compile { files, output: None, compiling } => compile_each(&files, &compiling),
        EslcAction::Check { files, compiling } => check(&files, &compiling.path(&files), &compiling.style),
        EslcAction::Disasm { file, compiling } => {
            disassemble(&file, &compiling.path(std::slice::from_ref(&file)), &compiling.style)
        }
        EslcAction::Format { options, modules } => Ok(format_files(&options, &modules.library)),
        EslcAction::New { name } => Ok(esl::new::new_project(&name)),
        EslcAction::Lsp { modules, .. } => Ok(esl::lsp::serve(modules.library)),
        EslcAction::Completions { shell } => Ok(command::print_completions(shell, Eslc::command())),
        EslcAction::Man { folder } => Ok(command::write_man_pages(Eslc::command(), folder.as_deref())),
        EslcAction::Expand { file, compiling } => {
            expand(&file, &compiling.path(std::slice::from_ref(&file)), &compiling.style)
        }
    };
    ExitCode::from(status.unwrap_or_else(|status| status))
}

/// Reads sources.
///
/// # Errors
/// The exit status, after a message; so for all functions here.
fn read(files: &[PathBuf]) -> Result<Vec<Source>, u8> {
    files.iter().map(|file| command::read_source(file)).collect()
}

/// Compiles sources and prints the diagnostics. Returns the program, if there was no error.
fn compiled(sources: &[Source], path: &ModulePath, modules: Modules, style: &Style) -> Result<Compiled, u8> {
    let names: Vec<&str> = sources.iter().map(|source| &*source.name).collect();
    let line = || format!("compiling {}", names.join(", "));
    let compiled =
        command::StatusLine::new(style.quiet).during(line, || program::compile_with(sources, path, modules));
    print_diagnostics(&compiled, style);
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

fn compile(
    files: &[PathBuf],
    output: &Path,
    path: &ModulePath,
    modules: Modules,
    style: &Style,
) -> Result<u8, u8> {
    let sources = read(files)?;
    command::refuse_overwriting(output, files.iter().map(PathBuf::as_path))?;
    let compiled = compiled(&sources, path, modules, style)?;
    // The modules that it requires are known now.
    command::refuse_overwriting(output, compiled.sources.names().map(Path::new))?;
    write(&compiled.program.ok_or(NOT_COMPILED)?, output)
}

fn compile_each(files: &[PathBuf], compiling: &SourceOptions) -> Result<u8, u8> {
    let mut status = SUCCESS;
    for file in files {
        if file.as_os_str() == "-" {
            complain("a program from standard input has no name: say with -o where it goes");
            return Err(USAGE);
        }
        let files = std::slice::from_ref(file);
        let path = compiling.path(files);
        let result = compile(files, &file.with_extension("eslb"), &path, Modules::Apart, &compiling.style);
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

fn check(files: &[PathBuf], path: &ModulePath, style: &Style) -> Result<u8, u8> {
    compiled(&read(files)?, path, Modules::Inside, style).map(|_| SUCCESS)
}

fn disassemble(file: &Path, path: &ModulePath, style: &Style) -> Result<u8, u8> {
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            compiled(&[source], path, Modules::Apart, style)?.program.ok_or(NOT_COMPILED)?
        }
    };
    print(&program.disassemble())
}

fn expand(file: &Path, path: &ModulePath, style: &Style) -> Result<u8, u8> {
    let source = command::read_source(file)?;
    let (text, compiled) = program::expand(&source, path);
    print_diagnostics(&compiled, style);
    print(&text)?;
    if compiled.has_errors() { Err(NOT_COMPILED) } else { Ok(SUCCESS) }
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
