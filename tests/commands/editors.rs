//! The files for editors, in `editors/`: they can be loaded where the editor is installed.

use std::path::Path;
use std::process::Command;

use esl_conformance::process::run;

use crate::folder::Folder;
use crate::say_left_out;

fn editors() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("editors")
}

#[test]
fn vim_knows_the_language_of_a_file() {
    if Command::new("vim").arg("--version").output().is_err() {
        return say_left_out("vim is not installed");
    }
    let folder = Folder::with("vim", &[("a.esl", "(defun f (x) (fail :stuck x))\n")]);
    let (file, shown) = (folder.join("a.esl"), folder.join("shown"));
    let path = format!("set runtimepath^={}", editors().join("vim").display());
    let name = |column: usize| format!("synIDattr(synID(1, {column}, 1), 'name')");
    let echo = format!("echo &filetype {} {} {}", name(2), name(8), name(15));
    let commands = [
        "filetype plugin on",
        "syntax on",
        &format!("edit {file}"),
        &format!("redir! > {shown}"),
        &echo,
        "redir END",
    ];
    let mut vim = Command::new("vim");
    vim.args(["-es", "-u", "NONE", "-i", "NONE", "--cmd", &path]);
    for command in commands {
        vim.args(["-c", command]);
    }
    run(vim.args(["-c", "quitall!"]), "");
    let shown = std::fs::read_to_string(shown).expect("vim has answered");
    assert_eq!(shown.trim(), "esl eslDefine eslName eslFailure");
}

#[test]
fn the_extension_of_visual_studio_code_is_complete() {
    let folder = editors().join("vscode");
    let read = |name: &str| -> serde_json::Value {
        let text = std::fs::read_to_string(folder.join(name)).expect("the file is there");
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    let package = read("package.json");
    read("language-configuration.json");
    assert_eq!(read("esl.tmLanguage.json")["scopeName"], package["contributes"]["grammars"][0]["scopeName"]);
    assert!(folder.join(package["main"].as_str().expect("it names a file")).exists());
}
