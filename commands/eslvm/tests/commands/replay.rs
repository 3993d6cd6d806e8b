//! `eslvm run --record` and `eslvm replay`: the same run again, whatever reached it, forwards and backwards.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use esl::host::Recorder;
use esl_conformance::folder::Folder;
use esl_conformance::process;
use esl_replay::{FileRecorder, Recorded};

use crate::eslvm;
use crate::examples::{PATIENCE, example, start_simulator};

/// Records the run of a program. Returns the path of the recording, and what the run has written.
fn record(folder: &Folder, program: &str, options: &[&str], input: &str) -> (String, process::Finished) {
    let recording = folder.join("run.eslj");
    let source = folder.file("program.esl", program);
    let run = process::run(eslvm(&["run", "--record", &recording]).args(options).arg(&source), input);
    // Nothing of the world is needed any more.
    std::fs::remove_file(source).expect("it is there");
    (recording, run)
}

fn replay(arguments: &[&str], input: &str) -> process::Finished {
    process::run(eslvm(&["replay"]).args(arguments), input)
}

#[test]
fn a_replay_writes_and_ends_as_the_run_did() {
    let folder = Folder::new("replay-same");
    let text = r#"
(require "os")
(format t "~a ~a ~a~%" (now) (random 1000) (os:getenv "HOME"))
(with-open-file (stream "note.txt" :direction :output) (write-line "noted" stream))
(with-open-file (stream "note.txt") (print (read-line stream)))
(loop for line = (read-line *standard-input* nil) while line do (sleep 0.001) (print line))
(format *error-output* "over~%")
(fail :lost 'in 'space)
"#;
    let text = text.replace("note.txt", &folder.join("note.txt"));
    let (recording, run) = record(&folder, &text, &["--allow-all"], "one\ntwo\n");
    assert_eq!(run.status, Some(1), "{}{}", run.output, run.errors);
    assert!(run.output.contains("\"two\"") && run.errors.contains(":LOST"), "{}{}", run.output, run.errors);
    std::fs::remove_file(folder.join("note.txt")).expect("the run has made it");
    assert_eq!(replay(&[&recording], ""), run);
    assert!(!Path::new(&folder.join("note.txt")).exists(), "a replay writes no files");
    let check = replay(&["--check", &recording], "");
    assert_eq!((check.status, &*check.errors), (Some(0), ""));
    assert!(check.output.starts_with("equal: ") && check.output.ends_with("status 1\n"), "{}", check.output);
}

#[cfg(unix)]
#[test]
fn only_its_owner_can_read_a_recording() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new("replay-mode");
    let (recording, _) = record(&folder, "(print 1)", &[], "");
    let mode = std::fs::metadata(recording).expect("it is there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}

/// A run that a signal ends, and one that is killed: the first is recorded with its cleanups, the second up
/// to a place from which on nothing is known.
#[cfg(unix)]
#[test]
fn signals_are_recorded_and_a_killed_run_is_replayed_as_far_as_it_is_known() {
    let folder = Folder::new("replay-signals");
    let source = folder.file(
        "program.esl",
        "(unwind-protect (dotimes (i 1000000) (format t \"~a~%\" i) (sleep 0.002)) (print 'cleaned))",
    );
    for (signal, status) in [("-TERM", Some(143)), ("-INT", Some(130)), ("-KILL", None)] {
        let recording = folder.join(&format!("{signal}.eslj"));
        let mut command = eslvm(&["run", "--record", &recording, &source]);
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let mut output = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let mut lines = String::new();
        for _ in 0..5 {
            output.read_line(&mut lines).expect("it is text");
        }
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(sent.expect("there is a kill").success());
        std::io::Read::read_to_string(&mut output, &mut lines).expect("it is text");
        let done = child.wait_with_output().expect("it ends");
        assert_eq!(done.status.code(), status, "{signal}");
        let again = replay(&[&recording], "");
        match status {
            Some(_) => {
                assert!(lines.ends_with("CLEANED "), "{lines}");
                assert_eq!((again.status, again.output), (status, lines));
                assert_eq!(again.errors, "", "what the command says of the signal is not the program's");
            }
            None => {
                assert_eq!(again.status, Some(0), "{}", again.errors);
                assert!(again.errors.contains("the recording ends here"), "{}", again.errors);
                let count = again.output.lines().count();
                assert!(count >= 4 && again.output.lines().eq(lines.lines().take(count)), "{lines}");
            }
        }
    }
}

/// Numbers of runs whose input comes in chunks; `ESL_SEEDS` sets another count, for longer runs by hand.
fn seeds() -> std::ops::Range<u64> {
    0..std::env::var("ESL_SEEDS").ok().and_then(|count| count.parse().ok()).unwrap_or(4)
}

/// Input that comes in chunks of any length at any time, while tasks work and timers end.
#[test]
fn input_in_chunks_is_replayed_as_it_came() {
    let folder = Folder::new("replay-chunks");
    let source = folder.file(
        "program.esl",
        "(defvar *n* 0)
         (dotimes (i 3) (let ((i i)) (spawn (:daemon t) (loop (sleep (* 0.0007 (1+ i))) (incf *n*) (dotimes (j 90) (list j))))))
         (let ((reader (spawn (loop for line = (read-line *standard-input* nil) while line
                                    do (format t \"~a ~a ~a~%\" (length line) *n* (random 100))))))
           (loop while (member (task-status reader) '(:running :waiting)) do (dotimes (j 300) (incf *n*)) (sleep 0.0005)))",
    );
    for seed in seeds() {
        let recording = folder.join(&format!("{seed}.eslj"));
        let mut child = process::start(&mut eslvm(&["run", "--record", &recording, &source]));
        let mut input = child.stdin.take().expect("it is a pipe");
        let mut state = seed.wrapping_mul(2).wrapping_add(1);
        let mut below = move |count: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % count
        };
        let writer = std::thread::spawn(move || {
            for _ in 0..60 {
                let text: String = (0..below(40)).map(|_| if below(6) == 0 { '\n' } else { 'ü' }).collect();
                // Also in the middle of a character.
                let cut = text.len() / 2 + below(2) as usize;
                for part in [&text.as_bytes()[..cut.min(text.len())], &text.as_bytes()[cut.min(text.len())..]]
                {
                    std::io::Write::write_all(&mut input, part).expect("it reads");
                    std::thread::sleep(std::time::Duration::from_micros(below(900)));
                }
            }
        });
        let run = process::finish(child);
        writer.join().expect("all is read");
        assert_eq!((run.status, &*run.errors), (Some(0), ""), "{}", run.output);
        assert!(run.output.lines().count() > 50, "{}", run.output);
        assert_eq!(replay(&[&recording], ""), run, "seed {seed}");
    }
}

/// A connection, its telemetry, and a clock that is faster.
#[test]
fn a_flight_is_replayed_without_the_spacecraft() {
    let mut command = eslvm(&["run", "--allow-net=127.0.0.1", "--speed", "10"]);
    command.arg(example("spacecraft/stand-in.esl")).arg("0");
    let (mut simulator, _output, port) = start_simulator(&mut command);
    let folder = Folder::new("replay-flight");
    let (recording, timeline) = (folder.join("flight.eslj"), folder.join("flight.svg"));
    let options = ["run", "--allow-net=127.0.0.1", "--speed", "10", "--record", &recording];
    let mut command = eslvm(&options);
    command.arg(example("spacecraft/simulated.esl")).args([&*port, "crater"]);
    let run = process::finish_within(process::start(&mut command), PATIENCE);
    simulator.kill().expect("it runs");
    simulator.wait().expect("it ends");
    assert_eq!(run.status, Some(0), "{}{}", run.output, run.errors);
    assert_eq!(replay(&["--timeline", &timeline, &recording], ""), run);
    let drawing = std::fs::read_to_string(timeline).expect("it was drawn");
    assert!(drawing.contains("the main task"));
}

#[test]
fn a_replay_that_diverges_says_where_and_has_a_status_of_its_own() {
    let folder = Folder::new("replay-divergence");
    let (one, _) = record(&folder, "(sleep 0.01) (print 'one)", &[], "");
    let read = |path: &str| Recorded::read(&std::fs::read(path).expect("it is there")).expect("it is one");
    let first = read(&one);
    let (other, _) = record(&folder, "(sleep 0.01) (print 'other)", &[], "");
    let mixed = folder.join("mixed.eslj");
    let recorder = FileRecorder::create(Path::new(&mixed)).expect("it can be made");
    recorder.begin(&read(&other).beginning);
    first.records.iter().for_each(|noted| recorder.note(noted.clone()));
    recorder.flush();
    for options in [&[][..], &["--check"], &["--break", "failure"]] {
        let again = replay(&[options, &[&mixed]].concat(), "");
        assert_eq!(again.status, Some(6), "{}{}", again.output, again.errors);
        let expected =
            "the program asks to write \"\\nOTHER \" to standard output; recorded is a write to a stream";
        assert!(again.errors.contains(expected), "{}", again.errors);
        assert!(again.errors.contains("at record ") && again.errors.contains("the last equal check"));
    }
    let mut bytes = std::fs::read(&one).expect("it is there");
    bytes[40] ^= 1;
    let damaged = folder.file("damaged.eslj", &bytes);
    bytes[8] = 1;
    let older = folder.file("older.eslj", bytes);
    for (path, status, message) in [
        (&*damaged, 3, "damaged.eslj cannot be replayed: it is damaged at byte 12"),
        (&*older, 6, "older.eslj cannot be replayed: it has version 1 of the format; this machine reads"),
        (&*folder.file("text", "(print 1)"), 3, "it is not a recording of a run"),
        ("no-such-file", 2, "no-such-file cannot be read"),
    ] {
        let again = replay(&[path], "");
        assert_eq!(again.status, Some(status), "{}", again.errors);
        assert!(again.errors.contains(message), "{}", again.errors);
    }
}

#[test]
fn a_recording_does_not_take_the_place_of_its_program() {
    let folder = Folder::new("replay-overwriting");
    let source = folder.file("program.esl", "(print 1)");
    let run = process::run(&mut eslvm(&["run", "--record", &source, &source]), "");
    assert_eq!((run.status, &*run.output), (Some(2), ""));
    assert_eq!(std::fs::read_to_string(source).expect("it is there"), "(print 1)");
}

/// The sessions of the manual. A line that begins with `$` is a command, one that begins with `(replay)` is
/// typed; the others are what is written, where `…` stands for anything.
#[test]
fn the_sessions_of_the_manual_are_as_they_are_shown() {
    let folder = Folder::new("replay-manual");
    let root = esl_conformance::root();
    let chapter = std::fs::read_to_string(root.join("docs/manual/replay.md")).expect("it is there");
    let mut count = 0;
    for block in chapter.split("```console\n").skip(1) {
        let block = block.split("```").next().unwrap_or_default();
        for session in block.split("$ eslvm ").skip(1) {
            let (command, rest) = session.split_once('\n').expect("a command has an end");
            let (typed, shown): (Vec<&str>, Vec<&str>) =
                rest.lines().partition(|line| line.starts_with("(replay) "));
            let input: String =
                typed.iter().map(|line| format!("{}\n", &line["(replay) ".len()..])).collect();
            let arguments = command.split_whitespace().map(|word| match word {
                "flight.eslj" | "flight.svg" => folder.join(word),
                word if word.starts_with("examples/") => root.join(word).display().to_string(),
                word => word.trim_matches('\'').to_string(),
            });
            let run = process::run(eslvm(&[]).args(arguments), &input);
            let written = format!("{}{}", run.output, run.errors);
            assert!(is_like(&shown, &written.lines().collect::<Vec<_>>()), "{command}:\n{written}");
            count += 1;
        }
    }
    assert!(count >= 4, "only {count} sessions");
}

/// Returns whether the lines are as shown; a line `…` stands for any number of them.
fn is_like(shown: &[&str], found: &[&str]) -> bool {
    match (shown, found) {
        ([], found) => found.is_empty(),
        (["…", rest @ ..], _) => (0..=found.len()).any(|skipped| is_like(rest, &found[skipped..])),
        ([line, rest @ ..], [first, others @ ..]) => line_is_like(line, first) && is_like(rest, others),
        _ => false,
    }
}

fn line_is_like(shown: &str, found: &str) -> bool {
    let parts: Vec<&str> = shown.split('…').collect();
    let mut rest = found;
    for (index, part) in parts.iter().enumerate() {
        let is_last = index + 1 == parts.len();
        let at = match index {
            0 => rest.starts_with(part).then_some(0),
            _ if is_last => rest.ends_with(part).then(|| rest.len() - part.len()),
            _ => rest.find(part),
        };
        let Some(at) = at else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.is_empty()
}

/// Forms at a stop are evaluated in a copy.
#[test]
fn a_replay_goes_on_as_if_nothing_had_been_printed() {
    let folder = Folder::new("replay-print");
    let program = "(defvar *n* 0)\n(defun more () (incf *n* 2))\n(dotimes (i 100) (more))\n(print *n*)\n";
    let (recording, run) = record(&folder, program, &[], "");
    assert_eq!(run.output, "\n200 ");
    let input = "print (setq *n* -1000)\nprint (progn (defun more () (error \"no more\")) (assert '(x)) (more))\n\
                 print (spawn (setq *n* 7))\nprint *n*\nback 3\nprint (setq *n* 5)\ncontinue\n";
    let again = replay(&["--until", "tick:60", &recording], input);
    assert_eq!(again.status, Some(0), "{}", again.errors);
    assert!(again.output.contains("-1000") && again.output.contains("no more"), "{}", again.output);
    assert!(again.output.contains("\n200 "), "{}", again.output);
}

/// A mistyped command is answered, and changes nothing.
#[test]
fn mistakes_in_commands_are_answered() {
    let folder = Folder::new("replay-mistakes");
    let program = "(defvar *n* 0)\n(dotimes (i 100) (incf *n* 2))\n(print *n*)\n";
    let (recording, _) = record(&folder, program, &[], "");
    let input = "fly\nstep much\nback\nbt nobody\nprint\nprint (car 5)\nprint (car\nprint (loop)\nprint (wait-for-event (make-event))\n\
                 facts\nbreak\nbreak things\nbreak function:print\nbreak\nuntil dawn\nprint *n*\nback 10\nprint *n*\nq\n";
    let run = replay(&["--until", "tick:50", &recording], input);
    assert_eq!((run.status, &*run.errors), (Some(0), ""), "{}", run.output);
    for expected in [
        "Unknown command `fly`",
        "Expected a number of ticks",
        "Unknown task `nobody`",
        "Expected a form",
        "The value 5 is not of type LIST",
        "The form is not whole",
        "The form does not end",
        "The form waits",
        "Expected a query",
        "expected failure, failure:CAUSE, task:NAME, fact:PATTERN or function:NAME",
        "function:PRINT\n",
        "expected tick:N, turn:N, time:SECONDS, record:N or failure",
    ] {
        assert!(run.output.contains(expected), "{expected}: {}", run.output);
    }
    for arguments in [&["--until", "noon"][..], &["--break", "task:"], &["--check", "--break", "failure"]] {
        let wrong = replay(&[arguments, &[&recording]].concat(), "");
        assert_eq!((wrong.status, &*wrong.output), (Some(2), ""));
    }
}

/// A replay may have the memory that the run was refused, so the recording ends before that shows.
#[cfg(target_os = "linux")]
#[test]
fn a_recording_ends_where_the_system_refuses_memory() {
    let folder = Folder::new("refused-memory");
    let program = "(sleep 0.01)
(princ 'begun)
(finish-output)
(let ((all nil))
  (princ (handler-case (loop (push (make-array 10000000 :element-type '(unsigned-byte 8)) all))
           (storage-condition () 'no-room))))
(sleep 0.01)
(princ 'on)";
    let (source, recording) = (folder.file("program.esl", program), folder.join("run.eslj"));
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 400000; exec \"$0\" run --memory 600M --record \"$1\" \"$2\""]);
    let run = process::run(shell.args([env!("CARGO_BIN_EXE_eslvm"), &recording, &source]), "");
    assert_eq!((run.status, run.output.trim()), (Some(0), "BEGUNNO-ROOMON"), "{}", run.errors);
    assert!(run.errors.contains("is not whole: the system has refused memory"), "{}", run.errors);
    let replay = replay(&[&recording], "");
    assert_eq!((replay.status, replay.output.trim()), (Some(0), "BEGUN"), "{}", replay.errors);
    assert!(replay.errors.contains("or the system has refused it memory"), "{}", replay.errors);
}
