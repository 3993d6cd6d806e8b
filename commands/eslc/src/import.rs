//! `eslc import`: writes a program for a behaviour tree.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use clap::Args;
use esl::Engine;
use esl::data::FromData;
use esl::module_path::ModulePath;
use esl_command::{NOT_COMPILED, SUCCESS, USAGE, complain, read_source, refuse_overwriting, replace_file};
use esl_format::{format, styles_of};
use esl_syntax::SyntaxTree;
use esl_trees::{TreeFault, TreeSource, import, includes};

/// Names of the language that a function of a program cannot have.
const RESERVED: &str = "(loop for name being the external-symbols of :esl \
    when (or (fboundp name) (special-operator-p name)) collect (string-downcase (symbol-name name)))";

/// Arguments of `eslc import`.
#[derive(Args, Debug)]
pub(crate) struct ImportOptions {
    /// File of the tree, in the XML of BehaviorTree.CPP; `-` is standard input
    file: PathBuf,
    /// File to write; without it, the program is printed
    #[arg(short, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Tree that the program runs, in place of the file's `main_tree_to_execute`
    #[arg(long, value_name = "ID")]
    tree: Option<String>,
}

/// Imports a tree. Returns the exit status.
pub(crate) fn import_tree(options: &ImportOptions) -> u8 {
    imported(options).unwrap_or_else(|status| status)
}

fn imported(options: &ImportOptions) -> Result<u8, u8> {
    let sources = read_all(&options.file)?;
    let reserved = reserved_names();
    let is_reserved = |name: &str| reserved.contains(name);
    let text = import(&sources, options.tree.as_deref(), &is_reserved).map_err(|faults| tell(&faults))?;
    let text = formatted(text);
    match &options.output {
        None => crate::print(&text),
        Some(output) => {
            refuse_overwriting(output, sources.iter().map(|source| Path::new(&*source.name)))?;
            replace_file(output, text.as_bytes()).map_err(|error| {
                complain(format_args!("{} cannot be written: {error}", output.display()));
                USAGE
            })?;
            Ok(SUCCESS)
        }
    }
}

/// Prints faults. Returns the exit status.
fn tell(faults: &[TreeFault]) -> u8 {
    for fault in faults {
        complain(fault);
    }
    NOT_COMPILED
}

/// Reads a file and all that it includes, each once.
fn read_all(file: &Path) -> Result<Vec<TreeSource>, u8> {
    let mut known = HashSet::new();
    let mut sources: Vec<TreeSource> = Vec::new();
    // Files to be read, and the places that include them.
    let mut waiting: Vec<(PathBuf, Option<TreeFault>)> = vec![(file.to_path_buf(), None)];
    while let Some((path, place)) = waiting.pop() {
        if !known.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
            continue;
        }
        let source = match (read_source(&path), place) {
            (Ok(source), _) => TreeSource { name: source.name.into(), text: source.text },
            (Err(status), place) => {
                place.iter().for_each(complain);
                return Err(status);
            }
        };
        let included = includes(&source).map_err(|fault| tell(&[fault]))?;
        for include in included.into_iter().rev() {
            let target = path_of(&path, &include.path, include.ros_package.as_deref());
            let place = TreeFault {
                file: source.name.clone(),
                place: include.place,
                message: format!("`{}` is included here", include.path),
            };
            match target {
                Some(target) => waiting.push((target, Some(place))),
                None => {
                    let package = include.ros_package.unwrap_or_default();
                    let message = format!(
                        "`{}` of the package `{package}` is not found: expected the package in a folder of \
                         AMENT_PREFIX_PATH; source the setup file of its workspace",
                        include.path
                    );
                    return Err(tell(&[TreeFault { message, ..place }]));
                }
            }
        }
        sources.push(source);
    }
    Ok(sources)
}

/// Returns the path of an included file.
fn path_of(file: &Path, path: &str, package: Option<&str>) -> Option<PathBuf> {
    let path = Path::new(path);
    match package.filter(|_| path.is_relative()) {
        None => Some(file.parent().unwrap_or(Path::new("")).join(path)),
        Some(package) => {
            let prefixes = std::env::var_os("AMENT_PREFIX_PATH").unwrap_or_default();
            let folders = std::env::split_paths(&prefixes).map(|prefix| prefix.join("share").join(package));
            folders.map(|folder| folder.join(path)).find(|path| path.is_file())
        }
    }
}

fn reserved_names() -> HashSet<String> {
    let names = Engine::new().and_then(|mut engine| engine.eval(RESERVED)).ok();
    names.and_then(|names| Vec::<String>::from_data(&names)).unwrap_or_default().into_iter().collect()
}

/// Returns the text as `eslc format` lays it out.
fn formatted(text: String) -> String {
    let tree = SyntaxTree::new(&*text);
    let path = ModulePath::new([Path::new("import.esl")], &[]);
    let styles = styles_of(&tree, |name| path.source_of(name));
    format(&tree, &styles, None).unwrap_or(text)
}
