//! The examples come to their end, in virtual time and under several schedules.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

use esl_conformance::chapter::{Example, examples};
use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslc, eslvm};

/// Longest time that a flight may take on a machine that is busy with others.
pub(crate) const PATIENCE: Duration = Duration::from_secs(600);

pub(crate) fn example(name: &str) -> PathBuf {
    esl_conformance::root().join("examples").join(name)
}

#[test]
fn examples_come_to_their_end() {
    let folder = esl_conformance::root().join("examples");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.extension().is_none_or(|extension| extension != "esl") {
            continue;
        }
        count += 1;
        for (seed, slice) in [("0", "2000"), ("1", "1"), ("2", "7"), ("3", "100")] {
            let options = ["run", "--clock", "virtual", "--seed", seed, "--slice", slice];
            let run = process::run(eslvm(&options).arg(&path), "");
            assert_eq!(run.status, Some(0), "{path:?}, seed {seed}, slice {slice}: {}", run.errors);
        }
    }
    assert!(count >= 3, "only {count} examples");
}

/// The README shows a program of `examples/`, the command that runs it, its output and its timeline.
#[test]
fn the_readme_shows_a_run_of_an_example() {
    let root = esl_conformance::root();
    let readme = std::fs::read_to_string(root.join("README.md")).expect("it is there");
    let commands: Vec<&str> = readme.lines().filter(|line| line.starts_with("eslvm ")).collect();
    let [command] = commands[..] else { panic!("the README has one command, not {commands:?}") };
    let shown = examples(&readme).expect("its blocks are closed");
    let [(_, Example::Program { text, output: Some(output) })] = &shown[..] else { panic!("{shown:?}") };
    let arguments: Vec<&str> = command.split_whitespace().skip(1).collect();
    let Some(source) = arguments.last() else { panic!("{command}") };
    let program = std::fs::read_to_string(root.join(source)).expect("the command names an example");
    assert_eq!(*text, program, "the README and {source}");

    let folder = Folder::with("readme", &[(source, text)]);
    let run = process::run(eslvm(&arguments).current_dir(folder.path()), "");
    assert_eq!(run.status, Some(0), "{}", run.errors);
    assert_eq!(run.output, *output, "the output of {source}");
    // The picture lies beside the program.
    let picture = root.join(source).with_extension("svg");
    let name = picture.file_name().expect("it is a file").to_string_lossy();
    let drawn = std::fs::read_to_string(folder.join(&name)).expect("the timeline is drawn");
    let shown = std::fs::read_to_string(&picture).expect("the picture is there");
    assert!(
        drawn == shown,
        "{} is not that of the run: copy it from {}",
        picture.display(),
        folder.join(&name)
    );
}

/// Compiles the spacecraft of the examples against its script. Returns the path of the program.
fn scripted_spacecraft(folder: &Folder) -> String {
    let source = esl_conformance::root().join("examples/spacecraft/scripted.esl");
    let program = folder.join("scripted.eslb");
    let compiled = process::run(eslc(&["compile", "-o", &program]).arg(source), "");
    assert_eq!(compiled.status, Some(0), "{}", compiled.errors);
    program
}

/// Under fifty seeds of faults the executive breaks no rule (its wheels are commanded by one activity at a
/// time, its battery is never empty) and the spacecraft points at the sun in the end.
#[test]
fn the_spacecraft_survives_its_faults() {
    let folder = Folder::new("spacecraft");
    let program = scripted_spacecraft(&folder);
    let (mut safe_modes, mut violations) = (0, 0);
    for seed in 1..=50 {
        let seed = seed.to_string();
        let options = ["run", "--clock", "virtual", "--seed", &seed, "--trace", "failures", &program];
        let run = process::run(&mut eslvm(&options), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        assert!(run.output.ends_with("pointing at SUN, no rule broken\n"), "seed {seed}: {}", run.output);
        safe_modes += usize::from(run.output.contains("SAFE MODE"));
        violations += usize::from(run.errors.contains(":MAINTAINED-PROPERTY-VIOLATION"));
    }
    assert!(safe_modes > 5 && violations > 5, "{safe_modes} safe modes, {violations} violations");
}

/// Wherever a flight is cut off, the spacecraft points at the sun in the end.
#[test]
fn the_spacecraft_is_left_in_order_wherever_its_budget_ends() {
    let folder = Folder::new("spacecraft-budget");
    let program = scripted_spacecraft(&folder);
    for budget in (1000..11_000).step_by(487) {
        let (seed, budget) = ((budget % 7).to_string(), budget.to_string());
        let options = ["run", "--clock", "virtual", "--seed", &seed, "--budget", &budget, &program];
        let run = process::run(&mut eslvm(&options), "");
        assert_eq!(run.status, Some(5), "seed {seed}, budget {budget}: {}{}", run.output, run.errors);
        let is_in_order = run.output.ends_with("pointing at SUN, no rule broken\n");
        assert!(is_in_order, "seed {seed}, budget {budget}: {}", run.output);
    }
}

/// A flight goes on beside a task that uses up all memory, whenever that is.
#[test]
fn the_spacecraft_survives_one_who_uses_up_the_memory() {
    let flight = example("spacecraft/scripted.esl");
    let library = flight.parent().expect("it is in a folder").to_owned();
    let flight = std::fs::read_to_string(&flight).expect("it is there");
    let folder = Folder::new("spacecraft-memory");
    for seed in 1..=6 {
        let greedy = format!(
            "(spawn (:name 'greedy :daemon t)
               (sleep {})
               (let ((all nil)) (loop (push (make-array 100) all))))",
            seed * 50
        );
        let program = folder.file("flight.esl", format!("{greedy}\n{flight}"));
        let mut command =
            eslvm(&["run", "--clock", "virtual", "--memory", "8M", "--seed", &seed.to_string()]);
        let run = process::run(command.arg("--library").arg(&library).arg(program), "");
        assert_eq!(run.status, Some(0), "seed {seed}: {}{}", run.output, run.errors);
        assert!(run.output.ends_with("pointing at SUN, no rule broken\n"), "seed {seed}: {}", run.output);
        let (_, report) = run.errors.split_once("In task GREEDY, begun at ").expect("it is reported");
        assert!(report.contains(":\nThe memory is exhausted."), "{}", run.errors);
    }
}

/// A flight whose memory is used up, and never given back, ends early; the spacecraft points at the sun then,
/// too.
#[test]
fn the_spacecraft_is_left_in_order_when_the_memory_stays_used_up() {
    let flight = example("spacecraft/scripted.esl");
    let library = flight.parent().expect("it is in a folder").to_owned();
    let flight = std::fs::read_to_string(&flight).expect("it is there");
    let folder = Folder::new("spacecraft-memory-kept");
    for seed in 1..=6 {
        // Some stop at the first refusal, some go on asking.
        let again = match seed % 2 {
            0 => "(loop (handler-case (hold-more) (storage-condition () (sleep 1))))",
            _ => "(hold-more)",
        };
        let greedy = format!(
            "(defvar *held* nil)
             (defun hold-more () (loop (push (make-array 100) *held*)))
             (spawn (:name 'greedy :daemon t) (sleep {}) {again})",
            seed * 40
        );
        let program = folder.file("flight.esl", format!("{greedy}\n{flight}"));
        // The task that plays the battery may have ended, and the flight waits for it for ever.
        let options = ["run", "--clock", "virtual", "--memory", "8M", "--budget", "500000", "--seed"];
        let mut command = eslvm(&options);
        command.arg(seed.to_string()).arg("--library").arg(&library).arg(program);
        let run = process::run(&mut command, "");
        // Others may be done before, or wait for each other for ever; the flight may fail for want of memory.
        assert!(matches!(run.status, Some(0 | 1 | 4 | 5)), "seed {seed}: {}{}", run.output, run.errors);
        assert!(run.output.ends_with("pointing at SUN, no rule broken\n"), "seed {seed}: {}", run.output);
    }
}

/// Starts a simulator, which prints its port, and returns it with its output and the port.
pub(crate) fn start_simulator(
    command: &mut Command,
) -> (Child, BufReader<std::process::ChildStdout>, String) {
    let mut child = process::start(command);
    let mut output = BufReader::new(child.stdout.take().expect("it is a pipe"));
    let mut line = String::new();
    output.read_line(&mut line).expect("the port is printed");
    let port = line.trim().rsplit(' ').next().expect("the port is printed").to_owned();
    (child, output, port)
}

/// Flies a spacecraft that is simulated elsewhere, by this program of its folder.
fn fly(program: &str, port: &str, speed: &str, targets: &[&str]) -> process::Finished {
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "--speed", speed]);
    command.arg(example("spacecraft").join(program)).arg(port).args(targets);
    process::finish_within(process::start(&mut command), PATIENCE)
}

/// Flies the stand-in by this program. Returns how the flight has ended, after a check that no rule is
/// broken.
fn fly_stand_in(program: &str, speed: &str, targets: &[&str]) -> process::Finished {
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "--speed", speed]);
    command.arg(example("spacecraft/stand-in.esl")).arg("0");
    let (mut simulator, mut output, port) = start_simulator(&mut command);
    let flight = fly(program, &port, speed, targets);
    simulator.kill().expect("it runs");
    simulator.wait().expect("it ends");
    let mut said = String::new();
    output.read_to_string(&mut said).expect("output is text");
    assert_eq!(flight.status, Some(0), "{}{}", flight.output, flight.errors);
    assert_eq!(said, "", "no rule is broken");
    flight
}

/// The executive that flies in the world of scripts flies behind a connection, which drops on the way.
#[test]
fn the_executive_flies_by_lines_of_json() {
    let flight = fly_stand_in("simulated.esl", "10", &["crater", "ridge"]);
    assert!(flight.output.ends_with("pointing at SUN\n"), "{}", flight.output);
    assert!(flight.output.contains("the link is down\n"), "{}", flight.output);
}

/// A day as a plan is repaired behind a connection, too.
#[test]
fn the_day_is_repaired_behind_a_connection() {
    let flight = fly_stand_in("simulated-day.esl", "80", &[]);
    let broken = "burn has broken the plan: (:failed :thruster-failed \"main\")\n";
    for line in [broken, "burn by the spare pair\n", "course corrected, sent crater"] {
        assert!(flight.output.contains(line), "{line}: {}", flight.output);
    }
}

#[test]
fn the_executive_flies_what_basilisk_simulates() {
    let has_basilisk = Command::new("python3").args(["-c", "import Basilisk"]).output();
    if !has_basilisk.is_ok_and(|done| done.status.success()) {
        crate::say_left_out("it needs `python3` with Basilisk, by `pip install bsk`");
        return;
    }
    let mut command = Command::new("python3");
    command.arg("-B").arg(example("spacecraft/simulator.py")).args(["--port", "0", "--speed", "10"]);
    let (simulator, mut output, port) = start_simulator(&mut command);
    let flight = fly("simulated.esl", &port, "10", &["crater"]);
    let done = process::finish_within(simulator, PATIENCE);
    let mut said = String::new();
    output.read_to_string(&mut said).expect("output is text");
    assert_eq!(flight.status, Some(0), "{}{}{}", flight.output, flight.errors, done.errors);
    assert!(flight.output.ends_with("pointing at SUN\n"), "{}", flight.output);
    assert!(said.contains("no rule broken"), "{said}");
}

/// Returns a free port outside the range from which the system chooses ports; each test gets another one.
pub(crate) fn free_port() -> u16 {
    static ASKED: AtomicU16 = AtomicU16::new(0);
    let asked = 100 * u32::from(ASKED.fetch_add(1, Ordering::Relaxed));
    let first = 20_000 + u16::try_from((std::process::id() + asked) % 12_000).expect("it is small");
    let mut ports = (first..32_000).chain(20_000..first);
    let is_free = |port: &u16| TcpListener::bind(("127.0.0.1", *port)).is_ok();
    ports.find(is_free).expect("one is free")
}

/// The watchdog starts a service again that has died, and ends it when it ends itself.
#[cfg(unix)]
#[test]
fn the_watchdog_restarts_a_service_that_dies() {
    let port = free_port();
    let mut command = eslvm(&["run", "--allow-net", "--allow-run"]);
    command.arg(example("watchdog/watchdog.esl")).arg(format!("http://127.0.0.1:{port}/health"));
    command.args([crate::ESLVM, "run", "--allow-net"]).arg(example("watchdog/service.esl"));
    let mut watchdog = process::start(command.arg(port.to_string()));
    let mut log = BufReader::new(watchdog.stderr.take().expect("it is a pipe"));
    let mut next = |message: &str| {
        let mut seen = String::new();
        loop {
            let mut line = String::new();
            assert_ne!(log.read_line(&mut line).expect("it is text"), 0, "expected {message} after {seen}");
            assert!(line.starts_with("{\"time\":\"20"), "{line}");
            if line.contains(&format!("\"message\":\"{message}\"")) {
                return line;
            }
            seen += &line;
        }
    };
    next("started");
    next("healthy");
    let mut connection = TcpStream::connect(("127.0.0.1", port)).expect("the service listens");
    connection
        .write_all(b"POST /die HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n")
        .expect("it can be sent");
    next("unhealthy");
    // The watchdog may ask while the service is ending.
    next("ended");
    next("started");
    next("healthy");
    let ended = Command::new("kill").arg(watchdog.id().to_string()).status();
    assert!(ended.expect("there is a kill").success());
    assert!(next("ended").contains("\"by\":\"watchdog\",\"status\":143}"));
    assert_eq!(process::finish(watchdog).status, Some(143));
    assert!(TcpStream::connect(("127.0.0.1", port)).is_err(), "the service has ended");
}
