//! Programs in C and C++ against the library: compiled by the system's compilers, and watched by valgrind if
//! it is there.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder with the library: that of the test, or the one above it.
fn library_folder() -> PathBuf {
    let test = std::env::current_exe().expect("the test is a file");
    let folders = test.ancestors().skip(1).take(2);
    let folder = folders.into_iter().find(|folder| folder.join("libesl_capi.so").is_file());
    folder.expect("cargo builds the library for its tests").to_owned()
}

/// Compiles a program, and runs it by a command in front of it.
fn run(source: &str, compiler: &[&str], before: &[&str]) -> Option<Output> {
    run_with(source, compiler, before, &[])
}

/// Compiles a program, and runs it with arguments by a command in front of it.
fn run_with(source: &str, compiler: &[&str], before: &[&str], arguments: &[&str]) -> Option<Output> {
    let folder = library_folder();
    let name = format!("capi-{}-{}", source.replace(['/', '.'], "-"), compiler.len() + before.len());
    let program = folder.join(name);
    let (name, flags) = compiler.split_first().expect("there is a compiler");
    let compiled = Command::new(name)
        .args(flags)
        .args(["-Wall", "-Wextra", "-Werror", "-g", "-pthread", "-I"])
        .arg(root().join("include"))
        .arg(root().join(source))
        .arg("-L")
        .arg(&folder)
        .args(["-lesl_capi", "-o"])
        .arg(&program)
        .arg(format!("-Wl,-rpath,{}", folder.display()))
        .output()
        .ok()?;
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let mut command = match before.split_first() {
        Some((name, arguments)) => {
            let mut command = Command::new(name);
            command.args(arguments).arg(&program);
            command
        }
        None => Command::new(&program),
    };
    // The library itself is not instrumented: its locks are not seen, so neither are its accesses.
    command.env("TSAN_OPTIONS", "ignore_noninstrumented_modules=1");
    command.args(arguments).output().ok()
}

/// Flags of C, and that builds with debug assertions refuse what was freed before.
const C: [&str; 4] = ["cc", "-std=c11", "-D_GNU_SOURCE", "-DESL_CHECKS_FREED"];

const CPP: [&str; 2] = ["c++", "-std=c++17"];

/// Has the compiler watch for uses of memory that have no meaning.
const SANITIZED: [&str; 4] = ["c++", "-std=c++17", "-fsanitize=address,undefined", "-fno-sanitize-recover"];

/// Has the compiler watch for races between threads in what is C++.
const RACES: [&str; 3] = ["c++", "-std=c++17", "-fsanitize=thread"];

#[expect(clippy::print_stderr, reason = "a test that is left out says so")]
fn say_left_out(reason: &str) {
    eprintln!("left out: {reason}");
}

/// Runs a program that ends with status 0, and returns its output; `None` without the tools for it.
fn output(source: &str, compiler: &[&str], before: &[&str]) -> Option<String> {
    let run = run(source, compiler, before)?;
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{text}\n{}", String::from_utf8_lossy(&run.stderr));
    Some(text)
}

#[test]
fn the_header_is_that_of_the_sources() {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).expect("it is a configuration");
    let bindings = cbindgen::Builder::new().with_crate(root()).with_config(config).generate();
    let mut made = Vec::new();
    bindings.expect("the sources can be read").write(&mut made);
    let made =
        String::from_utf8(made).expect("it is text").replace("# Safety\n", "The caller sees to it that\n");
    let file = root().join("include/esl.h");
    if std::env::var_os("ESL_BLESS").is_some() {
        std::fs::write(&file, &made).expect("it can be written");
    }
    let kept = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(kept == made, "include/esl.h is old: ESL_BLESS=1 cargo test -p esl-capi");
}

#[test]
fn the_example_ends_its_mission() {
    let text = output("examples/rover.c", &C, &[]).expect("there is a C compiler");
    let expected = "obstacle after 4 m, once more\ndrove 10 m\ndrove 20 m\ndrove 30 m\n\
                    the mission ended with :ALL-LEGS\n";
    assert_eq!(text, expected);
}

#[test]
fn a_process_that_is_killed_in_an_operation_is_followed_by_one_that_goes_on() {
    let folder = library_folder().join("capi-durable-state");
    let log = library_folder().join("capi-durable-log");
    // Those of an earlier run of the tests.
    drop((std::fs::remove_dir_all(&folder), std::fs::remove_file(&log)));
    let arguments = [&folder, &log].map(|path| path.to_str().expect("it is text"));
    let run = run_with("tests/durable.c", &C, &[], &arguments).expect("there is a C compiler");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert_eq!(String::from_utf8_lossy(&run.stdout), "5\n");
    // The state after the third step was not saved, and nobody knows what became of the shove.
    let steps = std::fs::read_to_string(&log).expect("it was written");
    let expected = ["1", "2", "3", "3", "4", "5", "shove", "\"INTERRUPTED-BY-RESTART\""];
    assert_eq!(steps.lines().collect::<Vec<_>>(), expected);
}

#[test]
fn the_programs_of_the_manual_run() {
    let chapter = std::fs::read_to_string(root().join("../docs/manual/c.md")).expect("it can be read");
    let c = [&C[..], &["-Wno-unused-parameter"]].concat();
    for (language, compiler, expected) in
        [("c", &c[..], "(3 4 5)\n"), ("cpp", &CPP, "(3 4 5)\n:OBSTACLE after 7 m\n")]
    {
        let program =
            chapter.split(&format!("```{language}\n")).nth(1).and_then(|rest| rest.split("```").next());
        let file = library_folder().join(format!("capi-manual.{language}"));
        std::fs::write(&file, program.expect("the chapter has a program")).expect("it can be written");
        let file = file.to_str().expect("it is text");
        match output(file, compiler, &[]) {
            Some(text) => assert_eq!(text, expected),
            None => say_left_out(&format!("a compiler for {language} is not installed")),
        }
    }
}

/// Number of the tasks that the chapter on embedding has in several languages.
const TASKS: usize = 10;

#[test]
fn the_tasks_of_the_chapter_on_embedding_run() {
    let chapter =
        std::fs::read_to_string(root().join("../docs/manual/embedding.md")).expect("it can be read");
    let (_, tasks) = chapter.split_once("\n## Tasks in four languages\n").expect("it has the section");
    let tasks: Vec<&str> = tasks.split("\n### ").skip(1).collect();
    let block = |task: &str, kind: &str| {
        let block = task.split(&format!("```{kind}\n")).nth(1).and_then(|rest| rest.split("```").next());
        block.unwrap_or_else(|| panic!("the task has no block {kind}: {task}")).to_owned()
    };
    let c = [&C[..], &["-Wno-unused-parameter", "-Wno-unused-result"]].concat();
    let of_c = [
        "#include \"esl.h\"\n#include <pthread.h>\n#include <stdatomic.h>\n#include <stdio.h>\n\
         #include <stdlib.h>\n#include <unistd.h>\n",
        "esl_engine *engine = NULL; esl_engine_new(NULL, &engine, NULL); example(engine); esl_engine_free(engine);",
        "setvbuf(stdout, NULL, _IONBF, 0);",
        "puts(\"\\n@\");",
    ];
    let of_cpp = [
        "#include \"esl.hpp\"\n#include <algorithm>\n#include <future>\n#include <iostream>\n#include <thread>\n",
        "esl::engine engine; example(engine);",
        "std::cout << std::unitbuf;",
        "std::cout << \"\\n@\\n\";",
    ];
    for (language, compiler, [head, call, prepare, mark]) in [("c", &c[..], of_c), ("cpp", &CPP, of_cpp)] {
        // In one program, since the compiler takes its time for each.
        let (mut text, mut main) = (head.to_owned(), prepare.to_owned());
        for (number, task) in tasks.iter().enumerate() {
            let code = block(task, language);
            text += &format!("#define example example_{number}\n{code}\n#undef example\n");
            main += &format!("\n{{ {} }} {mark}", call.replace("example", &format!("example_{number}")));
        }
        text += &format!("int main() {{\n{main}\n}}\n");
        let file = library_folder().join(format!("capi-tasks.{language}"));
        std::fs::write(&file, text).expect("it can be written");
        let Some(text) = output(file.to_str().expect("it is text"), compiler, &[]) else {
            say_left_out(&format!("a compiler for {language} is not installed"));
            continue;
        };
        let printed: Vec<&str> = text.split("\n@\n").map(str::trim).collect();
        let mut expected: Vec<String> =
            tasks.iter().map(|task| block(task, "text").trim().to_owned()).collect();
        expected.push(String::new());
        assert_eq!(printed, expected, "{language}");
    }
    assert_eq!(tasks.len(), TASKS);
}

#[test]
fn c_gets_what_the_header_promises() {
    assert_eq!(output("tests/api.c", &C, &[]).as_deref(), Some("0 faults\n"));
}

/// Calls in the time that a test has; more are made by hand, as the head of the program says.
const RANDOM_CALLS: &str = "5000";

#[test]
fn calls_in_any_order_get_statuses() {
    for seed in ["1", "2"] {
        let ran = run_with("tests/fuzz.c", &C, &[], &[RANDOM_CALLS, seed]).expect("there is a C compiler");
        let (text, errors) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
        assert!(
            ran.status.success() && text.ends_with("0 faults\n"),
            "seed {seed}: {:?}\n{text}\n{errors}",
            ran.status
        );
    }
}

#[test]
fn cpp_gets_what_the_header_promises() {
    for compiler in [&CPP[..], &SANITIZED, &RACES] {
        match output("tests/api.cpp", compiler, &[]) {
            Some(text) => assert_eq!(text, "0 faults\n"),
            None => say_left_out("a compiler for C++ is not installed"),
        }
    }
}

#[test]
fn nothing_is_read_after_its_end_or_lost() {
    let valgrind = [
        "valgrind",
        "-q",
        "--leak-check=full",
        "--show-leak-kinds=definite",
        "--errors-for-leak-kinds=definite",
        "--error-exitcode=9",
    ];
    for (source, compiler) in [("tests/api.c", &C[..]), ("tests/api.cpp", &CPP)] {
        if output(source, compiler, &valgrind).is_none() {
            say_left_out("valgrind is not installed");
        }
    }
}
