//! `eslc format`: reads the files, formats them, and writes, checks or shows the result.

use std::io::IsTerminal;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::Args;
use esl::module_path::ModulePath;
use esl::program::Source;
use esl_command::{
    FAILED, NOT_COMPILED, SUCCESS, USAGE, complain, read_source, replace_file, say, say_error, say_part,
};
use esl_compiler::diagnostic::{Format, Renderer, Sources};
use esl_compiler::reader::structure_faults;
use esl_format::{format, styles_of};
use esl_syntax::SyntaxTree;
use similar::TextDiff;

/// Deepest nesting of folders that are searched for files.
const MAX_DEPTH: usize = 64;

/// Arguments of `eslc format`.
#[derive(Args, Debug)]
pub(crate) struct FormatOptions {
    /// Source files, or folders, whose `.esl` files are meant; `-` formats standard input to standard output
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Write nothing; name the files that would change, with status 1 if there are any
    #[arg(long)]
    pub(crate) check: bool,
    /// Write nothing; show what would change, with status 1 if anything would
    #[arg(long)]
    pub(crate) diff: bool,
    /// Format only these lines, counted from 1, the last included
    #[arg(long, value_name = "A:B", value_parser = parse_lines)]
    pub(crate) lines: Option<(usize, usize)>,
}

fn parse_lines(text: &str) -> Result<(usize, usize), &'static str> {
    let numbers = text.split_once(':').and_then(|(first, last)| {
        Some((first.parse::<usize>().ok()?, if last.is_empty() { usize::MAX } else { last.parse().ok()? }))
    });
    match numbers {
        Some((first, last)) if first > 0 && first <= last => Ok((first, last)),
        _ => Err("expected the numbers of the first and the last line, such as `10:25`"),
    }
}

/// Formats files. Returns the exit status.
pub(crate) fn format_files(options: &FormatOptions, folders: &[PathBuf]) -> u8 {
    let mut files = Vec::new();
    for path in &options.files {
        if path.as_os_str() != "-" && path.is_dir() {
            let before = files.len();
            add_folder(path, 0, &mut files);
            if files.len() == before {
                complain(format_args!("{} holds no file `*.esl`", path.display()));
                return USAGE;
            }
        } else {
            files.push(path.clone());
        }
    }
    if options.lines.is_some() && files.len() != 1 {
        complain("lines are those of one file: name it alone");
        return USAGE;
    }
    files.iter().map(|file| format_file(file, options, folders)).max().unwrap_or(SUCCESS)
}

/// Adds the sources in a folder, in the order of their names; hidden ones and those of builds left aside.
fn add_folder(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        // It is reported as a file that cannot be read.
        return files.push(folder.into());
    };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !path.is_symlink() {
            let is_left_out = name.starts_with('.') || name == "target" || depth == MAX_DEPTH;
            if !is_left_out {
                add_folder(&path, depth + 1, files);
            }
        } else if name.ends_with(".esl") && path.is_file() {
            files.push(path);
        }
    }
}

fn format_file(file: &Path, options: &FormatOptions, folders: &[PathBuf]) -> u8 {
    let source = match read_source(file) {
        Ok(source) => source,
        Err(status) => return status,
    };
    if !can_be_read(&source) {
        return NOT_COMPILED;
    }
    let tree = SyntaxTree::new(&*source.text);
    let path = ModulePath::new([file], folders);
    let styles = styles_of(&tree, |name| path.source_of(name));
    let lines: Option<RangeInclusive<usize>> = options.lines.map(|(first, last)| first - 1..=last - 1);
    let formatted = match format(&tree, &styles, lines) {
        Ok(formatted) => formatted,
        Err(error) => {
            complain(format_args!("{} is left as it is: {error}", source.name));
            return NOT_COMPILED;
        }
    };
    let is_changed = *source.text != *formatted;
    if options.check || options.diff {
        return show(&source, &formatted, options, is_changed);
    }
    if file.as_os_str() == "-" {
        say_part!("{formatted}");
    } else if is_changed && let Err(error) = replace_file(file, formatted.as_bytes()) {
        complain(format_args!("{} cannot be written: {error}", file.display()));
        return USAGE;
    }
    SUCCESS
}

/// Whether the lists, strings and comments of a text have ends; otherwise says what is wrong.
fn can_be_read(source: &Source) -> bool {
    let mut sources = Sources::new();
    let id = sources.add(&*source.name, Some(source.text.clone()));
    let faults = structure_faults(id, &source.text);
    let renderer = Renderer { color: std::io::stderr().is_terminal(), format: Format::Human };
    for fault in &faults {
        say_error!("{}\n", renderer.render(fault, &sources));
    }
    if !faults.is_empty() {
        complain(format_args!("{} is left as it is: repair it first", source.name));
    }
    faults.is_empty()
}

fn show(source: &Source, formatted: &str, options: &FormatOptions, is_changed: bool) -> u8 {
    if is_changed && options.diff {
        let diff = TextDiff::from_lines(&*source.text, formatted);
        let after = format!("{} (formatted)", source.name);
        say_part!("{}", diff.unified_diff().context_radius(3).header(&source.name, &after));
    } else if is_changed {
        say!("{}", source.name);
    }
    if is_changed { FAILED } else { SUCCESS }
}
