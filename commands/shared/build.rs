//! Notes the profile and the target of the build, which the commands report.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "cargo reads it")]

use std::path::Path;

fn main() {
    // The folder of a profile is that of its packages' builds: PROFILE/build/PACKAGE/out.
    let out = std::env::var("OUT_DIR").unwrap_or_default();
    let folder = Path::new(&out).ancestors().nth(3).and_then(Path::file_name);
    let profile = folder.map_or("unknown".into(), |name| name.to_string_lossy());
    let profile = if profile == "debug" { "dev" } else { &*profile };
    println!("cargo::rustc-env=ESL_PROFILE={profile}");
    println!("cargo::rustc-env=ESL_TARGET={}", std::env::var("TARGET").unwrap_or_default());
    println!("cargo::rerun-if-changed=build.rs");
}
