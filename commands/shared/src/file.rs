//! Reading the files that a command is given.

use std::fs::File;
use std::io::{ErrorKind, IsTerminal, Read};
use std::path::Path;

use esl::program::{Program, Source};
use esl_bytecode::file::MAGIC;
use esl_compiler::diagnostic::{Format, Renderer, Sources};
use esl_compiler::reader::decode;

use super::{NOT_COMPILED, USAGE, complain};

/// Size in bytes beyond which a file is refused: such a file is not a source, or never ends.
const MAX_BYTES: u64 = 64 << 20;

/// Extensions of the names of sources.
const SOURCES: [&str; 2] = ["esl", "lisp"];

/// Content of a file that holds a program.
pub enum ProgramFile {
    /// Source text.
    Source(Source),
    /// Bytecode.
    Compiled(Program),
}

/// Reads a source file; `-` is standard input.
///
/// # Errors
/// The exit status, after a message.
pub fn read_source(path: &Path) -> Result<Source, u8> {
    let (name, bytes) = read_bytes(path)?;
    if bytes.starts_with(&MAGIC) {
        complain(format_args!("{name} is compiled already; name its source"));
        return Err(USAGE);
    }
    source(name, bytes)
}

/// Reads a source or a bytecode file, which its first bytes tell apart; `-` is standard input.
///
/// # Errors
/// The exit status, after a message.
pub fn read_program(path: &Path) -> Result<ProgramFile, u8> {
    let (name, bytes) = read_bytes(path)?;
    if !bytes.starts_with(&MAGIC) && path.extension().is_none_or(|extension| extension != "eslb") {
        return source(name, bytes).map(ProgramFile::Source);
    }
    Program::from_bytes(&bytes).map(ProgramFile::Compiled).map_err(|error| {
        complain(format_args!("{name} is not a valid program: {error}"));
        NOT_COMPILED
    })
}

/// Refuses to write to a file that is one of `inputs`, by whatever path, and to any other existing file with
/// the name of a source, so that an output never destroys a source.
///
/// # Errors
/// The exit status, after a message.
pub fn refuse_overwriting<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), u8> {
    let Ok(existing) = output.canonicalize() else { return Ok(()) };
    for input in inputs {
        if input.canonicalize().is_ok_and(|input| is_same_file(&input, &existing)) {
            complain(format_args!("{} is read and cannot be written as well", input.display()));
            return Err(USAGE);
        }
    }
    if [output, &existing].into_iter().any(is_named_as_source) {
        let name = output.display();
        complain(format_args!("{name} exists and has the name of a source: name another file"));
        return Err(USAGE);
    }
    Ok(())
}

/// Refuses to cover a file that is compiled. Returns the exit status, after a message.
pub fn refuse_compiled(file: &Path) -> u8 {
    complain(format_args!("{} is compiled: name its source to measure coverage", file.display()));
    USAGE
}

fn is_named_as_source(path: &Path) -> bool {
    path.extension().is_some_and(|extension| SOURCES.iter().any(|source| extension == *source))
}

/// Returns whether two paths, both without links, lead to one file: they may be two names of it.
fn is_same_file(one: &Path, other: &Path) -> bool {
    #[cfg(unix)]
    if let (Ok(one), Ok(other)) = (std::fs::metadata(one), std::fs::metadata(other)) {
        use std::os::unix::fs::MetadataExt;
        return (one.dev(), one.ino()) == (other.dev(), other.ino());
    }
    one == other
}

/// Writes a file: beside it first, so that an existing one is never left half written. An existing file keeps
/// its permissions.
///
/// # Errors
/// The first error.
pub fn replace_file(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // The target of a link is replaced, not the link.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.tmp", std::process::id()));
    let partial = path.with_file_name(name);
    let result = std::fs::write(&partial, bytes)
        .and_then(|()| match std::fs::metadata(path) {
            Ok(before) => std::fs::set_permissions(&partial, before.permissions()),
            Err(_) => Ok(()),
        })
        .and_then(|()| std::fs::rename(&partial, path));
    if result.is_err() {
        // The error that counts is the first one.
        _ = std::fs::remove_file(&partial);
    }
    result
}

fn read_bytes(path: &Path) -> Result<(String, Vec<u8>), u8> {
    let is_stdin = path.as_os_str() == "-";
    let name = if is_stdin { "<stdin>".into() } else { path.display().to_string() };
    let mut bytes = Vec::new();
    let result = if is_stdin {
        std::io::stdin().take(MAX_BYTES + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
    };
    match result {
        Ok(length) if length as u64 > MAX_BYTES => {
            complain(format_args!("{name} is too long: at most {} MiB are read", MAX_BYTES >> 20));
            Err(USAGE)
        }
        Ok(_) => Ok((name, bytes)),
        Err(error) => {
            let reason = match error.kind() {
                ErrorKind::NotFound => "the file does not exist".into(),
                ErrorKind::IsADirectory => "it is a directory; name a file in it".into(),
                ErrorKind::PermissionDenied => "permission denied".into(),
                _ => error.to_string(),
            };
            complain(format_args!("{name} cannot be read: {reason}"));
            Err(USAGE)
        }
    }
}

fn source(name: String, bytes: Vec<u8>) -> Result<Source, u8> {
    let mut sources = Sources::new();
    let id = sources.add(name.clone(), None);
    decode(id, bytes).map(|text| Source::new(name, text)).map_err(|diagnostic| {
        let renderer = Renderer { color: std::io::stderr().is_terminal(), format: Format::Human };
        say_error!("{}", renderer.render(&diagnostic, &sources));
        NOT_COMPILED
    })
}
