//! The packages that `packaging/build` makes, of the commands and libraries that the tests are built with:
//! each is installed in an empty folder, and runs the program of `README.md`.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::time::Duration;

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, Finished};

use crate::{ESLVM, say_left_out, venv};

/// The packages, and the Python of an environment with their tools.
struct Packages {
    folder: Folder,
    python: PathBuf,
}

/// Time to pack test builds, which are large, on a machine that is busy.
const PATIENCE: Duration = Duration::from_secs(600);

fn run(command: &mut Command) -> Finished {
    process::finish_within(process::start(command), PATIENCE)
}

/// Returns the output of a command that ends with status 0.
fn output(command: &mut Command) -> String {
    let finished = run(command);
    assert_eq!(finished.status, Some(0), "{command:?}\n{}\n{}", finished.output, finished.errors);
    finished.output
}

/// Returns the search path of programs with that of the environment in front.
fn path_with(python: &Path) -> std::ffi::OsString {
    let mut folders = vec![python.parent().expect("it is in a folder").to_path_buf()];
    folders.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()));
    std::env::join_paths(folders).expect("they come from such a path")
}

/// Makes the packages once; nothing without the tools for it.
static PACKAGES: LazyLock<Option<Packages>> = LazyLock::new(|| {
    let tools = ["maturin==1.16.0", "cmake==3.31.6", "pytest==8.4.2"];
    let python = venv::python("packaging", &tools, "import maturin, cmake, pytest")?;
    let built = Path::new(ESLVM).parent().expect("it is in a folder");
    let has_libraries = ["libesl_capi.so", "libesl_python.so"]
        .iter()
        .all(|name| built.join(name).is_file() || built.join("deps").join(name).is_file());
    if !has_libraries {
        say_left_out("the libraries for C and Python are built with `cargo test --workspace`");
        return None;
    }
    let folder = Folder::new("packages");
    let mut build = Command::new(esl_conformance::root().join("packaging/build"));
    build.arg("--binaries").arg(built).arg("--out").arg(folder.path()).env("PATH", path_with(&python));
    output(&mut build);
    Some(Packages { folder, python })
});

impl Packages {
    /// Returns the package whose name ends so.
    fn with_ending(&self, ending: &str) -> PathBuf {
        let files = std::fs::read_dir(self.folder.path()).expect("it can be read").flatten();
        let mut files = files.map(|entry| entry.path());
        files.find(|path| path.to_string_lossy().ends_with(ending)).expect("the package was made")
    }

    /// Returns an empty folder.
    fn empty(&self, name: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::create_dir(&path).expect("a folder can be made");
        path
    }

    /// Unpacks the archive, and returns its folder.
    fn unpacked(&self, name: &str) -> PathBuf {
        let place = self.empty(name);
        output(Command::new("tar").arg("-xzf").arg(self.with_ending(".tar.gz")).arg("-C").arg(&place));
        let entry = std::fs::read_dir(&place).expect("it can be read").next().expect("there is a folder");
        entry.expect("it can be read").path()
    }
}

/// Checks that commands in a folder run the program of `README.md`, and say how they were built.
fn check_commands(folder: &Path, program: &Path) {
    let eslvm = || {
        let mut command = Command::new(folder.join("eslvm"));
        command.env_clear();
        command
    };
    let readme = std::fs::read_to_string(esl_conformance::root().join("README.md")).expect("it can be read");
    let expected = readme.split("```\n").find(|block| block.starts_with("  20 s")).expect("it has an output");
    assert_eq!(output(eslvm().args(["run", "--clock", "virtual"]).arg(program)), expected);
    let version = output(eslvm().arg("--version"));
    let lines: Vec<&str> = version.lines().collect();
    assert_eq!(lines[0], concat!("eslvm ", env!("CARGO_PKG_VERSION")));
    let rest = [lines[1], &lines[2][..8], lines[3]];
    assert_eq!(rest, ["profile: dev", "target: ", "features: native, robots"]);
    assert_eq!(output(Command::new(folder.join("eslc")).arg("check").arg(program)), "");
}

#[test]
fn a_wheel_has_the_commands_and_the_module() {
    let Some(packages) = &*PACKAGES else { return };
    let python = || Command::new(&packages.python);
    let install = ["-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"];
    output(python().args(install).arg(packages.with_ending(".whl")));
    let program = esl_conformance::root().join("examples/drill.esl");
    check_commands(packages.python.parent().expect("it is in a folder"), &program);
    let text = "import esl; print(esl.Engine().eval('(loop for n to 3 collect (* n n))'))";
    // From a folder without the sources of the module.
    let elsewhere = packages.empty("elsewhere");
    let ran = output(python().args(["-c", text]).current_dir(&elsewhere));
    assert_eq!(ran, "[0, 1, 4, 9]\n");
    // pytest finds the plugin by itself, and once if it is named, too.
    std::fs::write(elsewhere.join("sum_test.esl"), "(deftest adding (is (= (+ 1 1) 2)))")
        .expect("it can be written");
    let pytest = ["-m", "pytest", "-q", "-p", "no:cacheprovider"];
    for named in [&[][..], &["-p", "esl.pytest_plugin"]] {
        let ran = output(python().args(pytest).args(named).current_dir(&elsewhere));
        assert!(ran.contains("1 passed"), "{ran}");
    }
}

#[test]
fn an_archive_has_the_commands_and_the_libraries() {
    let Some(packages) = &*PACKAGES else { return };
    let place = packages.unpacked("archive");
    check_commands(&place.join("bin"), &place.join("share/doc/esl/examples/drill.esl"));
    let listed: Vec<&str> = [
        "include/esl.h",
        "include/esl.hpp",
        "lib/libesl.so",
        "lib/systemd/system/eslvm@.service",
        "lib/systemd/system/eslvm-durable@.service",
        "share/bash-completion/completions/eslvm",
        "share/doc/esl/LICENSE-MIT",
        "share/doc/esl/LICENSES-of-dependencies",
        "share/fish/vendor_completions.d/eslc.fish",
        "share/man/man1/eslvm-run.1.gz",
        "share/man/man1/eslc.1.gz",
        "share/zsh/site-functions/_eslvm",
    ]
    .into();
    let missing: Vec<&&str> = listed.iter().filter(|name| !place.join(name).is_file()).collect();
    assert!(missing.is_empty(), "the archive does not have {missing:?}");
    let licences = std::fs::read_to_string(place.join("share/doc/esl/LICENSES-of-dependencies"));
    let licences = licences.expect("it can be read");
    assert!(licences.contains("\ncranelift-codegen ") && licences.contains("\nzenoh "), "{}", licences.len());
}

/// Output of the example in C.
const MISSION: &str = "obstacle after 4 m, once more\ndrove 10 m\ndrove 20 m\ndrove 30 m\n\
                       the mission ended with :ALL-LEGS\n";

#[test]
fn pkg_config_and_cmake_find_the_library() {
    let Some(packages) = &*PACKAGES else { return };
    let place = packages.unpacked("for-c");
    let example = place.join("share/doc/esl/examples/c");
    let mut pkg_config = Command::new("pkg-config");
    pkg_config.args(["--cflags", "--libs", "esl"]).env("PKG_CONFIG_PATH", place.join("lib/pkgconfig"));
    if Command::new("pkg-config").arg("--version").output().is_err() {
        say_left_out("pkg-config is not installed");
    } else {
        let flags = output(&mut pkg_config);
        let mut compile = Command::new("cc");
        compile.arg("-D_GNU_SOURCE").arg(example.join("rover.c")).args(flags.split_whitespace());
        output(compile.args(["-pthread", "-o"]).arg(place.join("rover")));
        let ran = output(Command::new(place.join("rover")).env("LD_LIBRARY_PATH", place.join("lib")));
        assert_eq!(ran, MISSION);
    }
    let cmake = packages.python.with_file_name("cmake");
    let build = place.join("build");
    let prefix = format!("-DCMAKE_PREFIX_PATH={}", place.display());
    output(
        Command::new(&cmake)
            .arg("-S")
            .arg(&example)
            .arg("-B")
            .arg(&build)
            .args(["-DCMAKE_C_FLAGS=-D_GNU_SOURCE", &prefix]),
    );
    output(Command::new(&cmake).arg("--build").arg(&build));
    assert_eq!(output(&mut Command::new(build.join("rover"))), MISSION);
}

#[test]
fn a_package_of_debian_has_the_commands() {
    let Some(packages) = &*PACKAGES else { return };
    if Command::new("dpkg-deb").arg("--version").output().is_err() {
        return say_left_out("dpkg-deb is not installed");
    }
    let place = packages.empty("debian");
    let package = packages.with_ending(".deb");
    output(Command::new("dpkg-deb").arg("-x").arg(&package).arg(&place));
    check_commands(&place.join("usr/bin"), &place.join("usr/share/doc/esl/examples/drill.esl"));
    let depends = output(Command::new("dpkg-deb").arg("-f").arg(&package).arg("Depends"));
    assert!(depends.starts_with("libc6 (>= 2."), "{depends}");
    assert!(place.join("usr/share/doc/esl/copyright").is_file());
}
