//! `ARCHITECTURE.md` maps the code completely, correctly and on few pages: its tables list exactly the
//! modules that exist, and each type in the glossary exists. So does each file that it, the other documents
//! at the root and the READMEs of the crates name. Those list the public modules of their crates.
//! The name of a type means one thing in the whole workspace. Errors have types, files are as long as one
//! thing takes, and comments are as narrow as code.

mod dependencies;
mod prose;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Sections of the code map, and the folders whose modules their tables list.
const SECTIONS: [(&str, &str); 12] = [
    ("### `bytecode/`", "bytecode/src"),
    ("### `compiler/`", "compiler/src"),
    ("### `heap/`", "heap/src"),
    ("### `host/`", "host/src"),
    ("### `database/`", "database/src"),
    ("### `number/`", "number/src"),
    ("### `native/`", "native/src"),
    ("### `vm/`", "vm/src"),
    ("### `world/`", "world/src"),
    ("### `robots/`", "robots/src"),
    ("### `src/`", "src"),
    ("### The other folders", "conformance/src"),
];

/// Folders of the packages that the table of tools lists as a whole.
const TOOLS: [&str; 15] = [
    "agents",
    "analysis",
    "commands/eslc",
    "commands/eslvm",
    "commands/shared",
    "durable",
    "format",
    "language-server",
    "operate",
    "plans",
    "replay",
    "syntax",
    "testing",
    "timeline",
    "trees",
];

/// Returns the folders of the sources of all packages in the code map.
fn packages() -> impl Iterator<Item = PathBuf> {
    let tools = TOOLS.iter().map(|tool| root().join(tool).join("src"));
    SECTIONS.iter().map(|(_, folder)| root().join(folder)).chain(tools)
}

/// Packages for other languages, whose types have the names that they have there.
const BINDINGS: [&str; 2] = ["capi", "python"];

/// Returns the folders of the sources of all packages in the code map, and of those for other languages.
fn all_packages() -> impl Iterator<Item = PathBuf> {
    packages().chain(BINDINGS.iter().map(|name| root().join(name).join("src")))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    fs::read_to_string(root().join(name)).expect("the document can be read")
}

/// Returns the part of a text from `heading` to the next heading.
fn section<'a>(text: &'a str, heading: &str) -> &'a str {
    let (_, rest) = text.split_once(heading).unwrap_or_else(|| panic!("no section {heading}"));
    rest.split("\n#").next().unwrap_or(rest)
}

/// Returns the names in backticks in the first column of all tables of a text.
fn names_of_rows(text: &str) -> BTreeSet<String> {
    let rows = text.lines().filter_map(|line| line.strip_prefix("| "));
    let cells = rows.filter_map(|row| row.split(" | ").next());
    cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).map(String::from).collect()
}

/// Returns the names of the files and folders in `folder`, without `lib.rs` and unit tests.
fn modules(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the sources can be listed");
    let paths = entries.map(|entry| entry.expect("the sources can be listed").path());
    let names = paths.map(|path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
    names.filter(|name| name != "lib" && name != "tests").collect()
}

#[test]
fn the_map_lists_every_module() {
    let document = read("ARCHITECTURE.md");
    for (heading, folder) in SECTIONS {
        assert_eq!(names_of_rows(section(&document, heading)), modules(&root().join(folder)), "{heading}");
    }
    let tools: BTreeSet<String> = TOOLS.iter().map(|tool| format!("{tool}/")).collect();
    assert_eq!(names_of_rows(section(&document, "### The tools")), tools);
    for member in dependencies::members() {
        assert!(document.contains(&format!("`{member}/`")), "`{member}/` is not in the map");
    }
}

/// Most lines of the map, which a newcomer reads in one sitting.
const MAP_LINES: usize = 250;

#[test]
fn the_map_is_short() {
    let lines = read("ARCHITECTURE.md").lines().count();
    assert!(
        lines <= MAP_LINES,
        "{lines} lines; a row may list several modules, `docs/mechanisms.md` has details"
    );
}

/// Crates whose README has a table of their modules.
const CRATES_WITH_TABLES: [&str; 8] =
    ["bytecode", "compiler", "database", "heap", "host", "native", "number", "vm"];

#[test]
fn the_readme_of_a_crate_lists_its_public_modules() {
    for name in CRATES_WITH_TABLES {
        let listed = names_of_rows(&read(&format!("{name}/README.md")));
        let there = modules(&root().join(name).join("src"));
        let missing: Vec<&String> = listed.difference(&there).collect();
        assert!(missing.is_empty(), "{name}/README.md lists {missing:?}");
        let text = read(&format!("{name}/src/lib.rs"));
        let public = text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
        let unlisted: Vec<&str> = public.filter(|module| !listed.contains(*module)).collect();
        assert!(!listed.is_empty() && unlisted.is_empty(), "{name}/README.md does not list {unlisted:?}");
    }
}

#[test]
fn the_readmes_of_the_libraries_list_their_files() {
    let text = read("stdlib/README.md");
    for (folder, heading) in
        [("", "| files | contents |"), ("operators/", "| files of `operators/` | contents |")]
    {
        let order = read(&format!("stdlib/{folder}load-order"));
        let loaded: BTreeSet<String> =
            order.lines().filter(|line| !line.starts_with('#')).map(String::from).collect();
        let files = names_of_rows(section(&text, heading));
        assert_eq!(files, loaded, "stdlib/README.md and stdlib/{folder}load-order");
    }
    for name in ["world", "robots", "trees", "plans"] {
        let there = modules(&root().join(name).join("modules"));
        let names: BTreeSet<String> = there.iter().map(|name| format!(":{name}")).collect();
        assert_eq!(
            names_of_rows(&read(&format!("{name}/README.md"))),
            names,
            "{name}/README.md and its modules"
        );
    }
}

/// Returns the names of all types that the Rust files below `folder` declare.
fn declared_types(folder: PathBuf) -> BTreeSet<String> {
    let mut types = BTreeSet::new();
    for path in sources(folder) {
        let text = fs::read_to_string(path).expect("a source can be read");
        for keyword in ["struct ", "enum ", "trait ", "type "] {
            let names = text.split(keyword).skip(1).map(|rest| {
                rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
            });
            types.extend(names.map(String::from));
        }
        // A macro declares the types of operands, each in a row with its role.
        let rows = text.lines().filter(|line| line.contains(", Role::"));
        types.extend(rows.filter_map(|line| Some(line.trim().split_once('(')?.0.to_string())));
    }
    types
}

/// Returns the files of Rust below a folder.
fn sources(folder: PathBuf) -> Vec<PathBuf> {
    let mut files = files_below(folder);
    files.retain(|path| path.extension().is_some_and(|extension| extension == "rs"));
    files
}

/// Returns the files below a folder, without those of builds and of git.
fn files_below(folder: PathBuf) -> Vec<PathBuf> {
    let (mut folders, mut files) = (vec![folder], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the sources can be listed") {
            let path = entry.expect("the sources can be listed").path();
            if !path.is_dir() {
                files.push(path);
            } else if !path.ends_with("target") && !path.ends_with(".git") {
                folders.push(path);
            }
        }
    }
    files
}

/// Returns the path of a file below the root, as documents write it.
fn path_in_tree(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// Returns the files of Rust below a folder that are not tests.
fn product_sources(folder: PathBuf) -> Vec<PathBuf> {
    let mut files = sources(folder.clone());
    files.retain(|file| {
        let inner = file.strip_prefix(&folder).expect("it is below the folder");
        inner.iter().all(|part| Path::new(part).file_stem().is_none_or(|stem| stem != "tests"))
    });
    files
}

/// Returns the name of the type that a line declares outside of every block.
fn declared_type(line: &str) -> Option<&str> {
    let line = line.strip_prefix("pub").map_or(line, |rest| match rest.strip_prefix('(') {
        Some(scope) => scope.split_once(") ").map_or(rest, |(_, rest)| rest),
        None => rest.trim_start(),
    });
    let name =
        ["struct ", "enum ", "trait ", "type "].iter().find_map(|keyword| line.strip_prefix(keyword))?;
    name.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// Most columns of a comment; the formatter keeps code within as many.
const COLUMNS: usize = 110;

#[test]
fn comments_are_as_narrow_as_code() {
    let mut wide = Vec::new();
    for folder in all_packages() {
        let parts = [folder.clone(), folder.with_file_name("tests")];
        for path in parts.into_iter().filter(|part| part.is_dir()).flat_map(sources) {
            let text = fs::read_to_string(&path).expect("a source can be read");
            for (number, line) in text.lines().enumerate() {
                let words = line.trim_start().trim_start_matches(['/', '!']);
                let is_comment = line.trim_start().starts_with("//");
                // Tables and drawings are as wide as they need.
                let is_drawn = words.starts_with("  ") || words.starts_with(" |");
                if is_comment && !is_drawn && line.chars().count() > COLUMNS {
                    wide.push(format!("{}:{}", path.display(), number + 1));
                }
            }
        }
    }
    assert!(wide.is_empty(), "comments wider than {COLUMNS} columns: {wide:#?}");
}

/// Returns whether a line of a program in ESL or a script is a comment in words, not one that states an
/// output.
fn is_wide_comment(line: &str, mark: char) -> bool {
    let words = line.trim_start();
    words.starts_with(mark) && !words.contains("expect") && line.chars().count() > COLUMNS
}

#[test]
fn comments_of_programs_and_scripts_are_as_narrow() {
    let mut wide = Vec::new();
    for path in files_below(root().to_path_buf()) {
        let mark = match path.extension().and_then(|extension| extension.to_str()) {
            Some("esl") => ';',
            Some("sh") => '#',
            None if fs::read(&path).is_ok_and(|bytes| bytes.starts_with(b"#!")) => '#',
            _ => continue,
        };
        let text = fs::read_to_string(&path).expect("a program can be read");
        let lines = text.lines().zip(1..).filter(|(line, _)| is_wide_comment(line, mark));
        wide.extend(lines.map(|(_, number)| format!("{}:{number}", path_in_tree(&path))));
    }
    assert!(wide.is_empty(), "comments wider than {COLUMNS} columns: {wide:#?}");
}

/// Lines that a file may have.
const LINES: usize = 500;

/// Files that have more, and why one file is right for them.
const LONG_FILES: &[(&str, &str)] = &[
    ("bytecode/src/builtin.rs", "a table: a row for each builtin"),
    ("bytecode/src/opcode.rs", "a table: a row for each opcode, and what is derived of the columns"),
    ("bytecode/tests/soundness.rs", "a model of the machine: an arm for each opcode, over one state"),
    ("compiler/src/diagnostic/code.rs", "a table: a row for each diagnostic"),
    ("compiler/src/lower/tests/model.rs", "a model of the core language: an arm for each kind of node"),
    ("compiler/src/lower/tests/notation.rs", "a reader of the core language: an arm for each kind of node"),
    ("vm/src/explore/fingerprint.rs", "one walk over all objects, a part for each kind"),
    ("vm/src/interp/mod.rs", "the loop: an arm for each opcode"),
    ("vm/src/interp/tests/arms.rs", "a table: a program for each opcode"),
];

#[test]
fn a_file_is_as_long_as_one_thing_takes() {
    let mut long = BTreeSet::new();
    for path in sources(root().to_path_buf()) {
        let text = fs::read_to_string(&path).expect("a source can be read");
        if text.lines().count() > LINES {
            long.insert(path_in_tree(&path));
        }
    }
    let listed: BTreeSet<String> = LONG_FILES.iter().map(|(path, _)| (*path).into()).collect();
    let unlisted: Vec<&String> = long.difference(&listed).collect();
    assert!(unlisted.is_empty(), "more than {LINES} lines without a reason: {unlisted:#?}");
    let short: Vec<&String> = listed.difference(&long).collect();
    assert!(short.is_empty(), "a reason for what has {LINES} lines or fewer: {short:#?}");
}

#[test]
fn modules_with_children_are_folders() {
    // A test of a package is a file beside the folder of its modules.
    let is_test = |path: &Path| path.parent().is_some_and(|folder| folder.ends_with("tests"));
    let mut two = sources(root().to_path_buf());
    two.retain(|path| path.with_extension("").is_dir() && !is_test(path));
    assert!(two.is_empty(), "these belong into their folders, as `mod.rs`: {two:#?}");
}

/// Results whose error is a text, and why there is nothing to say but the text.
const ERRORS_AS_TEXTS: &[(&str, &str)] = &[];

/// Returns the second argument of each `Result<…>` in a text that has two.
fn error_types(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("Result<") {
        let inside = &text[at + "Result<".len()..];
        let (mut depth, mut start, mut before) = (0, 0, ' ');
        for (at, c) in inside.char_indices() {
            match c {
                '<' | '(' | '[' => depth += 1,
                // The head of an arrow closes nothing.
                '>' if before == '-' => {}
                '>' if depth == 0 && start == 0 => break,
                '>' if depth == 0 => {
                    found.push(inside[start..at].trim().trim_end_matches(','));
                    break;
                }
                '>' | ')' | ']' => depth -= 1,
                ',' if depth == 0 && !inside[at + 1..].trim_start().starts_with('>') => start = at + 1,
                _ => {}
            }
            before = c;
        }
    }
    found
}

#[test]
fn errors_have_types() {
    let others = ["stdlib", "playground", "benches", "fuzz"].map(|folder| root().join(folder));
    let folders = all_packages().chain(others);
    let mut found = BTreeSet::new();
    for path in folders.flat_map(product_sources) {
        let text = fs::read_to_string(&path).expect("a source can be read");
        let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let types = error_types(product);
        if types.contains(&"String") || product.contains("type Err = String;") {
            found.insert(path_in_tree(&path));
        }
    }
    let listed: BTreeSet<String> = ERRORS_AS_TEXTS.iter().map(|(path, _)| (*path).into()).collect();
    assert_eq!(found, listed, "files with `Result<_, String>` and those that have a reason for it");
    assert_eq!(
        error_types(
            "fn a(f: fn(&str) -> Result<Vec<(A, B)>,\n    String,\n>) -> Result<(), E> { io::Result<String> }"
        ),
        ["String", "E"]
    );
}

#[test]
fn each_type_name_means_one_thing() {
    let mut declared: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for folder in packages() {
        for path in product_sources(folder) {
            let text = fs::read_to_string(&path).expect("a source can be read");
            let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            let names: BTreeSet<&str> = product.lines().filter_map(declared_type).collect();
            for name in names {
                declared.entry(name.to_string()).or_default().push(path.clone());
            }
        }
    }
    // Each crate has one, for the examples of its README.
    declared.remove("Readme");
    declared.retain(|_, paths| paths.len() > 1);
    assert!(declared.is_empty(), "these names are declared in several files: {declared:#?}");
}

#[test]
fn the_compiler_and_the_machine_ask_a_host_for_all_that_a_browser_lacks() {
    let lacking = ["thread", "fs", "net", "process", "env", "time", "os"].map(|name| format!("std::{name}"));
    for folder in ["bytecode/src", "compiler/src", "database/src", "heap/src", "number/src", "vm/src"] {
        for path in product_sources(root().join(folder)) {
            let text = fs::read_to_string(&path).expect("a source can be read");
            let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            let used: Vec<&String> = lacking.iter().filter(|name| product.contains(*name)).collect();
            assert!(used.is_empty(), "{} uses {used:?}", path.display());
        }
    }
}

#[test]
fn each_type_in_the_glossary_exists() {
    let glossary = read("docs/glossary.md");
    let types: BTreeSet<String> = packages().flat_map(declared_types).collect();
    let named = names_of_rows(&glossary);
    let is_type = |name: &str| name.starts_with(|c: char| c.is_ascii_uppercase());
    let named: Vec<&str> = named.iter().filter_map(|name| name.split("::").last()).collect();
    let missing: Vec<&&str> = named.iter().filter(|name| is_type(name) && !types.contains(**name)).collect();
    assert!(named.len() > 40, "the glossary names {} types", named.len());
    assert!(missing.is_empty(), "no type is called {missing:?}");
}

/// Returns the inline code of a Markdown text that looks like the path of a file or a folder.
fn paths_in_code(text: &str) -> Vec<&str> {
    let is_path = |code: &str| {
        let is_file = [".rs", ".esl", ".md", ".toml"].iter().any(|extension| code.ends_with(extension));
        let characters = |c: char| c.is_alphanumeric() || "_-./".contains(c);
        (is_file || code.contains('/')) && code.chars().all(characters)
    };
    // Fenced blocks are every second part.
    let prose = text.split("\n```").step_by(2);
    prose.flat_map(|part| part.split('`').skip(1).step_by(2)).filter(|code| is_path(code)).collect()
}

#[test]
fn each_file_that_a_document_names_exists() {
    // Paths in `docs/mechanisms.md` are relative to the machine or the library.
    let bases = ["", "vm/src", "stdlib"];
    let crates = CRATES_WITH_TABLES.iter().chain(&["stdlib", "world", "robots", "trees", "plans"]);
    let readmes = crates.map(|name| format!("{name}/README.md"));
    let documents =
        ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md", "docs/glossary.md", "docs/mechanisms.md"];
    for name in readmes.chain(documents.map(String::from)) {
        let text = read(&name);
        let own = name.trim_end_matches(|c| c != '/');
        let exists =
            |path: &&str| bases.iter().chain([&own]).any(|base| root().join(base).join(path).exists());
        let missing: Vec<&str> = paths_in_code(&text).into_iter().filter(|path| !exists(path)).collect();
        assert!(missing.is_empty(), "{name} names {missing:?}");
    }
}
