//! Links the command at a fixed address.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "cargo reads it")]

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let is = |name: &str, value: &str| std::env::var(name).is_ok_and(|found| found == value);
    // A command that may lie at any address begins by writing its own into tens of thousands of places, which
    // takes longer than the rest of a short run: see `docs/design/0020-a-command-has-a-fixed-address.md`.
    if is("CARGO_CFG_TARGET_OS", "linux") && is("CARGO_CFG_TARGET_ENV", "gnu") {
        println!("cargo::rustc-link-arg-bins=-no-pie");
    }
}
