//! Compiles the generated parser and the scanner of block comments.

#![allow(clippy::print_stdout, reason = "a build step talks to cargo")]

fn main() {
    let mut build = cc::Build::new();
    build.std("c11").include("src").warnings(false);
    for file in ["src/parser.c", "src/scanner.c"] {
        build.file(file);
        println!("cargo:rerun-if-changed={file}");
    }
    build.compile("tree-sitter-esl");
}
