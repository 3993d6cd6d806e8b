//! Files of MCAP: written and read by programs and by the libraries of others, played in worlds of scripts,
//! and made of runs.
//!
//! The libraries are packages of the Python registry, which the tests install below `target/`. Where that is
//! not possible, the tests that need them are left out, and say so.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslvm, venv};

/// Packages of the peers.
const PACKAGES: [&str; 4] =
    ["mcap==1.6.0", "mcap-ros2-support==0.6.0", "rosbags==0.11.9", "websockets==17.4"];

/// Returns the Python that has the packages; nothing if they cannot be installed.
fn python() -> Option<PathBuf> {
    venv::python("mcap", &PACKAGES, "import mcap, mcap_ros2, rosbags, websockets")
}

/// Has the peer do something with a path in a folder; returns the lines that it prints.
fn peer(python: &Path, folder: &Folder, command: &str, path: &str) -> Vec<String> {
    let script = esl_conformance::root().join("robots/tests/peers/mcap_files.py");
    let done = Command::new(python).arg(script).args([command, path]).current_dir(folder.path()).output();
    let done = done.expect("python can be started");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).lines().map(str::to_owned).collect()
}

/// Runs a command in a folder.
pub(crate) fn run(folder: &Folder, arguments: &[&str]) -> process::Finished {
    process::run(eslvm(arguments).current_dir(folder.path()), "")
}

/// Returns the lines of a text that have more than blanks.
pub(crate) fn lines(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

/// Writes a file of messages of ROS 2, in JSON and of bytes, with all that a file may have beside them.
const WRITER: &str = "(require :mcap)
(defun write-to (path &rest options)
  (apply #'mcap::call-with-file
   (lambda (file)
     (let ((battery (mcap:channel file \"/battery\" :type \"sensor_msgs/msg/BatteryState\"))
           (state (mcap:channel file \"/state\" :json \"State\"))
           (raw (mcap:channel file \"/raw\" :encoding \"text\")))
       (dotimes (i 300)
         (mcap:write battery (list :header '(:frame-id \"base\") :voltage (- 13 (/ i 100))) :time (+ 100 i))
         (mcap:write state (list i \"é\") :time (+ 100 i 1/2) :publish-time 7 :sequence i)
         (mcap:write raw \"hello\" :time (+ 100 i 3/4))))
     (mcap:write-metadata file \"robot\" '((\"name\" . \"r2\")))
     (mcap:attach file \"a.txt\" \"abc\" :media-type \"text/plain\" :time 50))
   path :direction :output :profile \"ros2\" options))
(write-to \"zstd.mcap\" :compression :zstd :chunk-size 5000)
(write-to \"lz4.mcap\" :compression :lz4 :chunk-size 5000)
(write-to \"none.mcap\" :compression nil)
(write-to \"loose.mcap\" :compression nil :chunk-size nil)";

#[test]
fn files_of_a_program_are_read_by_the_library_of_others() {
    let Some(python) = python() else { return };
    // By operations, and in virtual time, by the streams of the language.
    for clock in ["real", "virtual"] {
        let folder = Folder::with(&format!("mcap-written-{clock}"), &[("main.esl", WRITER)]);
        let done = run(&folder, &["run", "--clock", clock, "main.esl"]);
        assert_eq!((done.status, &*done.errors), (Some(0), ""), "{}", done.output);
        for name in ["zstd", "lz4", "none", "loose"] {
            let read = peer(&python, &folder, "read", &format!("{name}.mcap"));
            assert_eq!(read[0], "header ros2 esl");
            assert_eq!(
                read[1],
                format!("count 900 chunks {}", if name == "loose" { "False" } else { "True" })
            );
            assert_eq!(read.len(), 2 + 900 + 2, "{name}");
            let battery = "/battery sensor_msgs/msg/BatteryState 100000000000 100000000000 1 \
                           {header={stamp={sec=0 nanosec=0} frame_id=base} voltage=13 ";
            assert!(read[2].starts_with(battery), "{}", read[2]);
            assert_eq!(read[3], "/state State 100500000000 7000000000 0 [0,\"é\"]");
            assert_eq!(read[901], "/raw - 399750000000 399750000000 300 hello");
            assert_eq!(read[902..], ["attachment a.txt text/plain abc", "metadata robot {\"name\": \"r2\"}"]);
        }
    }
}

/// Prints what is in a file.
const READER: &str = "(require :mcap)
(mcap:with-file (file (first (command-line-arguments)))
  (let ((count 0) (last nil))
    (mcap:do-messages ((message topic time) file)
      (incf count)
      (setf last (list topic time (typecase message (hash-table (gethash \"n\" message)) (t message)))))
    (format t \"~s~%\" (list :count count :last last)))
  (mcap:do-messages ((message topic) file :topics '(\"/state\" \"/text\") :start 3 :end 4)
    (format t \"~s~%\" (list topic (if (hash-table-p message) (gethash \"ok\" message) message))))
  (format t \"~s~%\" (list (mcap:attachments file) (mcap:metadata file) (mcap:damage file))))";

#[test]
fn files_of_others_are_read_in_every_form() {
    let Some(python) = python() else { return };
    let folder = Folder::with("mcap-read", &[("main.esl", READER)]);
    peer(&python, &folder, "write", ".");
    for clock in ["real", "virtual"] {
        for name in ["zstd", "lz4", "none", "loose", "bare", "nosums"] {
            let file = format!("{name}.mcap");
            let done = run(&folder, &["run", "--clock", clock, "main.esl", &file]);
            let expected = [
                "(:COUNT 100 :LAST (\"/raw\" 149.000000005 #(49 0 255)))",
                "(\"/state\" NIL)",
                "(\"/state\" T)",
                "(((:NAME \"a.txt\" :MEDIA-TYPE \"text/plain\" :TIME 1.0 :SIZE 8)) \
                 ((\"robot\" (\"name\" . \"r2\"))) NIL)",
            ];
            assert_eq!(lines(&done.output), expected, "{name}: {}", done.errors);
        }
    }
    // A part of an action is a message of its own in the file.
    let text = "(require :mcap)
(mcap:with-file (file \"part.mcap\" :direction :output)
  (mcap:write (mcap:channel file \"/part\" :type \"example_interfaces/action/Fibonacci_FeedbackMessage\")
              '(:feedback (:sequence (0 1 1)))))";
    folder.file("write.esl", text);
    assert_eq!(run(&folder, &["run", "write.esl"]).status, Some(0));
    let done = run(&folder, &["run", "main.esl", "part.mcap"]);
    assert!(lines(&done.output)[0].ends_with(":FEEDBACK (:SEQUENCE #(0 1 1)))))"), "{}", done.output);
    // The types are in the file alone.
    let done = run(&folder, &["run", "main.esl", "ros.mcap"]);
    let last = "(:COUNT 40 :LAST (\"/range\" 19.000000001 \
                (:HEADER (:STAMP (:SEC 19 :NANOSEC 5) :FRAME-ID \"laser\") :RADIATION 4.75 :RANGES #(0.5 19.0))))";
    assert_eq!(lines(&done.output)[0], last, "{}", done.errors);
    assert_eq!(lines(&done.output)[1], "(\"/text\" (:DATA \"text 3\"))");
}

/// Writes messages in one step, and says what is refused.
const BATCHES: &str = "(require :mcap)
(mcap:with-file (file \"all.mcap\" :direction :output :profile \"ros2\")
  (let ((battery (mcap:channel file \"/battery\" :type \"sensor_msgs/msg/BatteryState\"))
        (state (mcap:channel file \"/state\" :json \"State\"))
        (raw (mcap:channel file \"/raw\" :encoding \"text\")))
    (flet ((refused (&rest arguments)
             (format t \"~a~%\" (handler-case (apply #'mcap:write-all arguments)
                                 (failure (f) (list (failure-cause f) (failure-arguments f)))
                                 (error (e) (substitute #\\space #\\newline (princ-to-string e)))))))
      (mcap:write raw \"before\" :time 1 :sequence 6)
      (mcap:write-all raw (list \"a\" (coerce '(98 99) '(vector (unsigned-byte 8)))) #(2.5 3.25))
      (mcap:write-all state (vector '(1 \"é\") 7) '(7/2 4))
      (mcap:write-all battery '((:voltage 12) (:voltage 11)) (vector 5 5.5))
      (mcap:write-all raw nil #())
      (refused raw '(\"x\") '(9 9))
      (refused raw '(\"x\" 7) '(9 9))
      (refused raw \"xy\" '(9 9))
      (refused battery '((:voltage 1) (:volts 2)) '(9 9))
      (refused raw '(\"x\") '(1e300))
      (refused raw '(\"x\") '(:now))
      (mcap:write raw \"behind\" :time 6))))";

#[test]
fn messages_are_written_in_one_step_or_not_at_all() {
    let Some(python) = python() else { return };
    for clock in ["real", "virtual"] {
        let folder = Folder::with(&format!("mcap-batches-{clock}"), &[("main.esl", BATCHES)]);
        let done = run(&folder, &["run", "--clock", clock, "main.esl"]);
        let said = lines(&done.output);
        let expected = [
            "(MCAP-ERROR (expected as many times as messages, found 2 and 1))",
            "The value 7 is not of type VECTOR",
            "The value \"xy\" is not of type SEQUENCE",
            "(INVALID-MESSAGE ",
            "(MCAP-ERROR (1e300 is not a time in seconds since 1970 that a file can hold))",
            "The value :NOW is not of type REAL",
        ];
        assert_eq!((said.len(), done.status), (expected.len(), Some(0)), "{}{}", done.output, done.errors);
        for (said, expected) in said.iter().zip(expected) {
            assert!(said.starts_with(expected), "{said}");
        }
        let read = peer(&python, &folder, "read", "all.mcap");
        let battery = |seconds: &str, number: u32, voltage: u32| {
            format!(
                "/battery sensor_msgs/msg/BatteryState {seconds} {seconds} {number} \
                 {{header={{stamp={{sec=0 nanosec=0}} frame_id=}} voltage={voltage} "
            )
        };
        let messages = &read[2..];
        assert_eq!(
            messages[..5],
            [
                "/raw - 1000000000 1000000000 6 before",
                "/raw - 2500000000 2500000000 7 a",
                "/raw - 3250000000 3250000000 8 bc",
                "/state State 3500000000 3500000000 1 [1,\"é\"]",
                "/state State 4000000000 4000000000 2 7",
            ]
        );
        assert!(messages[5].starts_with(&battery("5000000000", 1, 12)), "{}", messages[5]);
        assert!(messages[6].starts_with(&battery("5500000000", 2, 11)), "{}", messages[6]);
        assert_eq!(messages[7..], ["/raw - 6000000000 6000000000 9 behind"]);
    }
}

/// Tests against the bag that the peer writes.
const BAG_TESTS: &str = "(require :ros)
(defun voltages (node count)
  (let ((battery (ros:subscribe node \"/battery\" \"sensor_msgs/msg/BatteryState\")) (seen nil))
    (dotimes (i count (reverse seen))
      (let ((message (wait-for-event battery :timeout 60)))
        (push (list (now) (ros:field message :voltage)) seen)))))
(deftest at-the-times-of-the-recording
  :seeds 5
  (with-world ((:bag \"bag\" :topics (\"/battery\") :after 1 :start 2 :end 5))
    (ros:with-node (node \"n\")
      (is (equal (voltages node 4) '((1.0 11.0) (2.0 10.0) (3.0 9.0) (4.0 8.0)))))))
(deftest at-four-times-the-speed
  (with-world ((:bag \"bag\" :after 0.5 :speed 4))
    (ros:with-node (node \"n\")
      (is (equal (first (last (voltages node 10))) '(2.75 4.0))))))
(deftest a-property-follows-the-recording
  (with-world ((:bag \"bag\" :after 1))
    (ros:with-node (node \"n\")
      (ros:with-properties ((volts node \"/battery\" \"sensor_msgs/msg/BatteryState\" :field :voltage
                                   :initial 100))
        (wait-until (< volts 7.5) :timeout 60)
        (is (= (now) 7))))))
(deftest another-type-is-told-with-both-names
  (with-world ((:bag \"bag\" :after 1))
    (ros:with-node (node \"n\")
      (ros:subscribe node \"/battery\" \"std_msgs/msg/String\")
      (multiple-value-bind (kind text topic) (wait-for-event (ros:node-events node) :timeout 60)
        (is (eq kind :type-mismatch))
        (is (equal topic \"/battery\"))
        (is (search \"sensor_msgs/msg/BatteryState\" text))
        (is (search \"std_msgs/msg/String\" text))))))
(deftest another-version-of-the-type-is-told-too
  (ros:define-message \"sensor_msgs/msg/BatteryState\" \"float32 voltage\")
  (with-world ((:bag \"bag\" :after 1))
    (ros:with-node (node \"n\" :parameters nil :log nil)
      (ros:subscribe node \"/battery\" \"sensor_msgs/msg/BatteryState\")
      (multiple-value-bind (kind text) (wait-for-event (ros:node-events node) :timeout 60)
        (is (eq kind :type-mismatch))
        (is (search \"RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741\" text))))))
(deftest a-topic-that-is-not-there-fails
  (is (search \"has no topic /scan, but /battery\"
              (first (fails :mcap-error (with-world ((:bag \"bag\" :topics (\"/scan\"))) nil))))))
(deftest under-all-schedules
  :explore (:grain changes)
  (with-world ((:bag \"bag\" :after 1 :end 1))
    (ros:with-node (node \"n\" :parameters nil :log nil)
      (is (equal (mapcar #'second (voltages node 2)) '(13.0 12.0))))))";

#[test]
fn a_recorded_robot_is_a_test() {
    let Some(python) = python() else { return };
    let folder = Folder::with("mcap-bag", &[("tests/bag_test.esl", BAG_TESTS)]);
    peer(&python, &folder, "bag", "tests/bag");
    // From another folder than that of the file.
    let done = run(&folder, &["test", "tests/bag_test.esl"]);
    assert_eq!(done.status, Some(0), "{}\n{}", done.output, done.errors);
    assert!(done.output.contains("7 passed, 0 failed"), "{}", done.output);
}

#[test]
fn files_need_rights_and_have_to_be_of_mcap() {
    let text = "(require :mcap)
(defmacro refused (form) `(print (handler-case ,form (serious-condition (c) (princ-to-string c)))))
(refused (mcap:with-file (f \"/etc/a.mcap\") f))
(refused (mcap:with-file (f \"/etc/b.mcap\" :direction :output) f))
(refused (mcap:with-file (f \"none.mcap\") f))
(refused (mcap:with-file (f \"a.txt\") f))
(refused (mcap:with-file (f \"folder\") f))
(refused (mcap:with-file (f \"none/a.mcap\" :direction :output) f))
(refused (mcap:with-file (f \"b.mcap\" :direction :output)
           (mcap:write (mcap:channel f \"/a\" :type \"std_msgs/msg/String\") '(:dat \"x\"))))
(refused (mcap:with-file (f \"b.mcap\" :direction :output) (mcap:channel f \"/a\" :type \"a/msg/B\")))
(mcap:with-file (f \"c.mcap\" :direction :output)
  (mcap:write (mcap:channel f \"/j\" :encoding \"json\") \"{1\"))
(print (handler-case (mcap:with-file (f \"c.mcap\") (mcap:next (mcap:read f)))
         (failure (f) (cons (failure-cause f) (failure-arguments f)))))";
    let folder = Folder::with("mcap-rights", &[("main.esl", text), ("a.txt", "text"), ("folder/x", "")]);
    let done = run(&folder, &["run", "main.esl"]);
    for text in [
        "--allow-read=/etc/a.mcap.",
        "--allow-write=/etc/b.mcap.",
        "none.mcap: No such file",
        "a.txt: not an MCAP file: it begins with",
        "folder: the folder has no file `.mcap`",
        "none/a.mcap: No such file",
        ":dat",
        "a/msg/B",
        "(:MALFORMED-MESSAGE \"Line 1, column 2",
    ] {
        assert!(done.output.contains(text), "{text}: {}\n{}", done.output, done.errors);
    }
}

#[test]
fn info_prints_figures_and_what_is_damaged() {
    let folder = Folder::with("mcap-info", &[("main.esl", WRITER)]);
    assert_eq!(run(&folder, &["run", "main.esl"]).status, Some(0));
    let done = run(&folder, &["mcap", "info", "zstd.mcap"]);
    assert_eq!((done.status, &*done.errors), (Some(0), ""));
    for line in [
        "profile:     ros2",
        "messages:    900",
        "duration:    299.750000000s",
        "start:       100.000000000",
        "(0) /battery  300 msgs (1.00Hz)    : sensor_msgs/msg/BatteryState [ros2msg]",
        "attachments: 1",
    ] {
        assert!(lines(&done.output).contains(&line), "{line}: {}", done.output);
    }
    let whole = std::fs::read(folder.path().join("zstd.mcap")).expect("it is there");
    let mut broken = whole.clone();
    broken[2000] ^= 0x55;
    std::fs::write(folder.path().join("broken.mcap"), &broken).expect("it can be written");
    std::fs::write(folder.path().join("cut.mcap"), &whole[..whole.len() / 2]).expect("it can be written");
    let done = run(&folder, &["mcap", "info", "broken.mcap"]);
    assert_eq!(done.status, Some(1), "{}", done.output);
    assert!(done.output.contains("damaged:     chunk at byte ") && done.output.contains(" messages lost"));
    let done = run(&folder, &["mcap", "info", "cut.mcap"]);
    assert_eq!(done.status, Some(1), "{}", done.output);
    assert!(done.output.contains("the file ends within the chunk, of whose "), "{}", done.output);
    assert!(!done.output.contains("messages:    0\n"), "{}", done.output);
    let done = run(&folder, &["mcap", "info", "main.esl"]);
    assert_eq!(done.status, Some(2));
    assert!(
        done.errors.contains("main.esl: not an MCAP file: it begins with \"(require\""),
        "{}",
        done.errors
    );
}

/// A run with tasks, failures, facts, a mock, an input, output and a log.
const DRILL: &str = "(require :log)
(define-input *commands*)
(define-property battery ())
(define-mock drill (depth)
  (sleep 1)
  (when (= depth 2)
    (fail :stuck depth))
  depth)
(task-net
  (driller
    (dotimes (i 4)
      (with-recovery-procedures (((:stuck &rest arguments) (values nil)))
        (drill i))
      (assert (list 'battery (- 100 (* 10 i))))
      (log:warn \"drilled\" :depth i)))
  (camera
    (dotimes (i 3)
      (sleep 1.5)
      (format t \"picture ~d~%\" i))))";

#[test]
fn a_run_is_a_file_that_others_read() {
    let Some(python) = python() else { return };
    let folder = Folder::with("mcap-run", &[("main.esl", DRILL)]);
    let arguments = ["run", "--clock", "virtual", "--mcap", "run.mcap", "--record", "run.eslj", "main.esl"];
    let done = run(&folder, &arguments);
    assert_eq!(done.status, Some(0), "{}", done.errors);
    let read = peer(&python, &folder, "read", "run.mcap");
    let has = |topic: &str, parts: &[&str]| {
        let is_it =
            |line: &&String| line.starts_with(&format!("{topic} ")) && parts.iter().all(|p| line.contains(p));
        assert!(read.iter().any(|line| is_it(&line)), "{topic} {parts:?}: {read:#?}");
    };
    // Two seconds after the beginning of virtual time.
    has("/esl/tasks", &["esl.Task", "\"state\":\"waits\"", "\"task\":\"task DRILLER\""]);
    has("/esl/tasks", &["\"state\":\"succeeded\"", "\"task\":\"task CAMERA\""]);
    has("/esl/facts/battery", &["esl.Fact 946684802", "\"value\":90", "\"present\":true"]);
    has("/esl/failures", &["esl.Failure 946684803", "\"cause\":\":STUCK\"", "\"event\":\"fails\""]);
    has("/esl/failures", &["\"cause\":\":STUCK\"", "\"event\":\"recovers\""]);
    has("/esl/log", &["foxglove.Log", "\"level\":3", "[driller] drilled depth=1"]);
    has("/esl/log", &["\"level\":1", "picture 2"]);
    // Recording changes nothing in the run.
    let done = run(&folder, &["replay", "run.eslj", "--check"]);
    assert!(done.output.starts_with("equal: ") && done.status == Some(0), "{}{}", done.output, done.errors);
}

#[test]
fn asking_for_the_time_is_not_a_failure_of_the_run() {
    let text = "(require :time) (dotimes (i 3) (sleep 1) (format t \"~d~%\" (round (time:unix))))";
    let folder = Folder::with("mcap-time", &[("main.esl", text)]);
    let done = run(&folder, &["run", "--clock", "virtual", "--mcap", "run.mcap", "main.esl"]);
    assert_eq!(done.output, "946684801\n946684802\n946684803\n", "{}", done.errors);
    let info = run(&folder, &["mcap", "info", "run.mcap"]);
    assert!(info.output.contains("/esl/tasks") && !info.output.contains("/esl/failures"), "{}", info.output);
}

#[test]
fn the_file_of_a_killed_run_is_readable() {
    let text = "(do-every 0.01 (assert '(alive)) (retract '(alive)))";
    let folder = Folder::with("mcap-killed", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--mcap", "run.mcap", "main.esl"]);
    let mut child = command.current_dir(folder.path()).spawn().expect("it can be started");
    let file = folder.path().join("run.mcap");
    let begun = Instant::now();
    // Two chunks are there.
    while std::fs::metadata(&file).map_or(0, |found| found.len()) < 1500 {
        assert!(begun.elapsed() < Duration::from_secs(120), "nothing is written");
        std::thread::sleep(Duration::from_millis(50));
    }
    drop(child.kill());
    drop(child.wait());
    let done = run(&folder, &["mcap", "info", "run.mcap"]);
    assert_eq!(done.status, Some(1), "{}", done.output);
    assert!(done.output.contains("its writer did not close it"), "{}", done.output);
    let facts = lines(&done.output).into_iter().find(|line| line.contains("/esl/facts/alive"));
    let count = facts.and_then(|line| line.split_whitespace().nth(2)?.parse::<u64>().ok());
    assert!(count.is_some_and(|count| count > 20), "{}", done.output);
}

#[test]
fn a_client_of_foxglove_sees_the_run_while_it_goes_on() {
    let Some(python) = python() else { return };
    let text = "(define-property battery ())
(dotimes (i 1200) (assert (list 'battery i)) (sleep 0.05))";
    let folder = Folder::with("foxglove", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--foxglove=0", "--mcap", "run.mcap", "main.esl"]);
    let mut run =
        command.current_dir(folder.path()).stderr(Stdio::piped()).spawn().expect("it can be started");
    let mut errors = BufReader::new(run.stderr.take().expect("it is a pipe")).lines();
    let line = errors.next().and_then(Result::ok).unwrap_or_default();
    let port =
        line.strip_prefix("; Foxglove at ws://127.0.0.1:").unwrap_or_else(|| panic!("{line}")).to_owned();
    let script = esl_conformance::root().join("robots/tests/peers/foxglove_client.py");
    let mut client = Command::new(python);
    let client = client.arg(script).args([&port, "/esl/facts/battery"]).stdout(Stdio::piped()).spawn();
    let mut client = client.expect("python can be started");
    let mut told = BufReader::new(client.stdout.take().expect("it is a pipe")).lines().map_while(Result::ok);
    let mut next = || told.next().unwrap_or_default();
    assert_eq!((next(), next()), ("protocol foxglove.sdk.v1".into(), "server main.esl".into()));
    assert_eq!(next(), "channel /esl/facts/battery json esl.Fact");
    for _ in 0..3 {
        let message = next();
        assert!(message.starts_with("message /esl/facts/battery "), "{message}");
        assert!(message.contains("\"fact\":\"(BATTERY "), "{message}");
    }
    // However the run ends, the client hears of the end.
    let pid = run.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().is_ok_and(|status| status.success()));
    while !matches!(next().as_str(), "closed" | "") {}
    drop((client.wait(), run.wait()));
    // The file has the same.
    let done = self::run(&folder, &["mcap", "info", "run.mcap"]);
    assert!(done.status == Some(0) && done.output.contains("/esl/facts/battery"), "{}", done.output);
}

#[test]
fn a_run_is_shown_to_this_machine_only() {
    let folder = Folder::with("foxglove-exposed", &[("main.esl", "(print 1)")]);
    let done = run(&folder, &["run", "--foxglove=0.0.0.0:0", "main.esl"]);
    assert_eq!((done.status, &*done.output), (Some(2), ""));
    assert!(done.errors.contains("others could read the traffic at 0.0.0.0:0"), "{}", done.errors);
}
