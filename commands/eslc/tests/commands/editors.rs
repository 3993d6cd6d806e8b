//! The files for editors, in `editors/`: they can be loaded where the editor is installed.

use std::path::Path;
use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::process::run;

use crate::say_left_out;

fn editors() -> std::path::PathBuf {
    esl_conformance::root().join("editors")
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
fn neovim_starts_the_server() {
    if Command::new("nvim").arg("--version").output().is_err() {
        return say_left_out("Neovim is not installed");
    }
    let folder = Folder::with("neovim", &[("a.esl", "(defun drive (x) x)\n(drvie 5)\n")]);
    let (file, shown) = (folder.join("a.esl"), folder.join("shown"));
    let compiler = Path::new(crate::ESLC).parent().expect("it is in a folder");
    let path = std::env::var("PATH").unwrap_or_default();
    let mut neovim = Command::new("nvim");
    neovim.env("PATH", format!("{}:{path}", compiler.display())).env("HOME", folder.join(""));
    neovim.args(["--headless", "-u", "NONE", "-i", "NONE", "--cmd"]);
    neovim.arg(format!("set runtimepath^={}", editors().join("vim").display()));
    let wait = "vim.wait(60000, function() return #vim.diagnostic.get(0) > 0 end, 50)";
    let write = format!("vim.fn.writefile({{ vim.diagnostic.get(0)[1].message }}, [[{shown}]])");
    for command in ["filetype plugin on", &format!("edit {file}"), &format!("lua {wait} {write}"), "quitall!"]
    {
        neovim.args(["-c", command]);
    }
    let tried = run(&mut neovim, "");
    let shown = std::fs::read_to_string(shown).unwrap_or_default();
    assert!(shown.contains("`drvie`"), "{shown}{}{}", tried.output, tried.errors);
}

#[test]
fn emacs_and_eglot_work_with_the_server() {
    let is_there = Command::new("emacs").arg("--version").output().is_ok();
    if !is_there {
        return say_left_out("Emacs is not installed");
    }
    let folder = Folder::with("emacs", &[]);
    let library = editors().join("emacs");
    let mut emacs = Command::new("emacs");
    emacs.arg("--batch").arg("-L").arg(&library).arg("-l").arg(library.join("test.el"));
    emacs.arg(folder.join("")).env("ESLC", crate::ESLC).env("HOME", folder.join(""));
    let tried = run(&mut emacs, "");
    assert_eq!(tried.status, Some(0), "{}", tried.errors);
    if tried.errors.contains("without eglot") {
        say_left_out("Emacs has no Eglot");
    }
    assert!(tried.errors.ends_with("all is well\n"), "{}", tried.errors);
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
