//! `eslc new`: a project to begin with, which runs and whose tests pass.
//!
//! The files are in `template/`, as they are written but for the name of the project.

use std::io::ErrorKind;
use std::path::Path;

use esl_command::{SUCCESS, USAGE, complain};

/// The files: names and texts. `NAME` in a text that is not a program stands for the name of the project.
const FILES: [(&str, &str); 8] = [
    ("main.esl", include_str!("template/main.esl")),
    ("plan.esl", include_str!("template/plan.esl")),
    ("outside.esl", include_str!("template/outside.esl")),
    ("test.esl", include_str!("template/test.esl")),
    ("README.md", include_str!("template/README.md")),
    (".gitignore", "*.eslb\n*.eslj\n*.schedule\n"),
    (".dir-locals.el", "((lisp-mode . ((indent-tabs-mode . nil) (eval . (eglot-ensure)))))\n"),
    (
        ".vscode/settings.json",
        "{\n  \"[esl]\": { \"editor.formatOnSave\": true, \"editor.tabSize\": 2 }\n}\n",
    ),
];

/// Makes a project in a new folder, or in one that is empty. Returns the exit status.
pub(crate) fn new_project(folder: &Path) -> u8 {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if name.is_empty() {
        complain("expected the name of a folder to be made");
        return USAGE;
    }
    match std::fs::read_dir(folder).map(|mut entries| entries.next().is_some()) {
        Ok(true) => {
            complain(format_args!("{} exists and is not empty", folder.display()));
            return USAGE;
        }
        Err(error) if error.kind() != ErrorKind::NotFound => {
            complain(format_args!("{} cannot be read: {error}", folder.display()));
            return USAGE;
        }
        _ => {}
    }
    for (file, text) in FILES {
        let path = folder.join(file);
        let text = if file.ends_with(".md") { text.replacen("NAME", &name, 1) } else { text.to_owned() };
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        if let Err(error) = made.and_then(|()| std::fs::write(&path, text)) {
            complain(format_args!("{} cannot be written: {error}", path.display()));
            return USAGE;
        }
    }
    let shown = folder.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    // A name that begins like an option names a folder of the current one.
    let path = if shown.starts_with('-') { format!("./{shown}") } else { shown.clone() };
    let quoted = || format!("'{}'", path.replace('\'', "'\\''"));
    let word = if path.chars().all(is_plain) { path.clone() } else { quoted() };
    complain(format_args!(
        "made {shown}; go on with `cd {word} && eslvm run main.esl && eslvm test test.esl`"
    ));
    SUCCESS
}
