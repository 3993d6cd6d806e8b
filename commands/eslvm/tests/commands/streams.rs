//! Files and standard streams that the system delays: only the task that waits for them does.
#![cfg(unix)]

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use esl_conformance::folder::Folder;

use crate::eslvm;

/// A program under way, in a folder of its own.
struct Running {
    child: Child,
    folder: Folder,
}

impl Running {
    fn start(test: &str, text: &str) -> Running {
        let folder = Folder::with(test, &[("main.esl", text)]);
        for name in ["in", "out"] {
            let made = Command::new("mkfifo").arg(folder.path().join(name)).status();
            assert!(made.expect("there is a mkfifo").success());
        }
        let mut command = eslvm(&["run", "main.esl"]);
        command.current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Running { child: command.spawn().expect("the command is there"), folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Waits until the program has made a file.
    #[track_caller]
    fn await_file(&mut self, name: &str) {
        let begun = Instant::now();
        while !self.path(name).exists() {
            assert!(begun.elapsed() < Duration::from_secs(120), "there is no `{name}`");
            assert!(self.child.try_wait().expect("it is our child").is_none(), "the program has ended");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Returns what the program has written, if nothing was wrong with it.
    #[track_caller]
    fn output(self) -> String {
        let done = self.child.wait_with_output().expect("it is our child");
        assert_eq!((done.status.code(), String::from_utf8_lossy(&done.stderr).as_ref()), (Some(0), ""));
        String::from_utf8_lossy(&done.stdout).into_owned()
    }
}

const MARK: &str = "(defun mark (name) (with-open-file (s name :direction :output) (write-line name s)))\n";

#[test]
fn a_slow_reader_of_standard_output_delays_only_who_prints() {
    // The output is much more than a pipe holds, and is not read before the other task has gone on for a
    // while.
    let text = "(defvar *printed* 0)
(spawn (:name 'other :daemon t)
  (loop until (plusp *printed*) do (sleep 0.001))
  (dotimes (i 50) (sleep 0.001))
  (mark \"ticked\"))
(dotimes (i 50000)
  (format t \"line ~d of them~%\" i)
  (setq *printed* i))
(princ \"the end\")";
    let mut running = Running::start("slow-reader", &format!("{MARK}{text}"));
    running.await_file("ticked");
    let output = running.output();
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!((lines.len(), lines[50_000]), (50_001, "the end"));
    let is_right = |(number, line): (usize, &&str)| *line == format!("line {number} of them");
    assert!(lines[..50_000].iter().enumerate().all(is_right), "all is there, in order");
}

#[test]
fn a_slow_reader_of_the_error_output_delays_only_who_prints() {
    let text = "(spawn (:name 'other :daemon t) (dotimes (i 50) (sleep 0.001)) (mark \"ticked\"))
(dotimes (i 20000) (format *error-output* \"line ~d~%\" i))
(princ \"done\")";
    let mut running = Running::start("slow-errors", &format!("{MARK}{text}"));
    running.await_file("ticked");
    let done = running.child.wait_with_output().expect("it is our child");
    assert_eq!(String::from_utf8_lossy(&done.stdout), "done");
    let expected: String = (0..20_000).map(|number| format!("line {number}\n")).collect();
    assert!(String::from_utf8_lossy(&done.stderr) == expected, "all is there, in order");
}

#[test]
fn a_task_that_waits_for_room_can_be_aborted() {
    let text = "(let ((printer (spawn (:name 'printer) (loop (format t \"line~%\")))))
  (loop until (eq (task-status printer) :waiting) do (sleep 0.001))
  (abort-task printer)
  (wait-for-task printer)
  (mark \"aborted\"))
(princ \"the end\")";
    let mut running = Running::start("aborted-printer", &format!("{MARK}{text}"));
    running.await_file("aborted");
    let output = running.output();
    assert!(output.starts_with("line\nline\n") && output.ends_with("the end"), "{}", output.len());
}

#[test]
fn a_fifo_whose_writer_comes_late_delays_only_its_reader() {
    let text = "(spawn (:name 'other :daemon t) (dotimes (i 50) (sleep 0.001)) (mark \"ticked\") (loop (sleep 0.001)))
(with-open-file (s \"in\")
  (print (list (read-line s) (read-char s) (listen s)))
  (mark \"read\")
  (loop for line = (read-line s nil nil) while line do (print line)))";
    let mut running = Running::start("late-writer", &format!("{MARK}{text}"));
    running.await_file("ticked");
    let mut fifo = std::fs::File::options().write(true).open(running.path("in")).expect("it is there");
    fifo.write_all("onë\nx".as_bytes()).expect("it is read");
    running.await_file("read");
    fifo.write_all(b"y\nlast").expect("it is read");
    drop(fifo);
    let output = running.output();
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, ["(\"onë\" #\\x NIL)", "\"y\"", "\"last\""]);
}

#[test]
fn data_are_read_from_files_and_fifos() {
    // Data longer than one read of a file, in many data and in one, are read in parts.
    let text = "(with-open-file (s \"long\" :direction :output)
  (format s \"(~{(item ~d \\\"text\\\")~}) \" (loop for i below 40000 collect i))
  (dotimes (i 40000) (format s \"(item ~d) \" i))
  (write-string \"the-end\" s))
(with-open-file (s \"long\")
  (print (list (length (read s))
               (loop for datum = (read s) while (consp datum) sum (second datum))
               (read s nil :end))))
(with-open-file (s \"data\" :direction :output) (format s \"(a b)~%c #(1)\"))
(with-open-file (s \"data\")
  (loop for datum = (read s nil :end) do (print datum) until (eq datum :end)))
(mark \"begun\")
(with-open-file (s \"in\")
  (print (read s))
  (mark \"read\")
  (print (list (read s) (read s nil :end) (read s nil :end))))";
    let mut running = Running::start("data", &format!("{MARK}{text}"));
    running.await_file("begun");
    let mut fifo = std::fs::File::options().write(true).open(running.path("in")).expect("it is there");
    fifo.write_all(b"(x\n y) ha").expect("it is read");
    running.await_file("read");
    fifo.write_all(b"lf").expect("it is read");
    drop(fifo);
    let output = running.output();
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, ["(40000 799980000 :END)", "(A B)", "C", "#(1)", ":END", "(X Y)", "(HALF :END :END)"]);
}

#[test]
fn programs_that_are_loaded_from_slow_files_delay_only_their_task() {
    // A loaded program, and then a module, come from FIFOs whose writers come late; a load can be left.
    let text = "(spawn (:name 'other :daemon t) (dotimes (i 50) (sleep 0.001)) (mark \"ticked\") (loop (sleep 0.001)))
(load \"in\")
(mark \"loaded\")
(require :part \"out\")
(print *modules*)
(let ((task (spawn (load \"in\"))))
  (sleep 0.05)
  (abort-task task)
  (print (wait-for-task task)))
(dolist (path '(\"none.esl\" \"none.eslb\"))
  (print (handler-case (load path) (file-error (e) (file-error-pathname e)))))";
    let mut running = Running::start("late-program", &format!("{MARK}{text}"));
    running.await_file("ticked");
    std::fs::write(running.path("in"), "(print \"loäded\")").expect("it is read");
    running.await_file("loaded");
    std::fs::write(running.path("out"), "(defun part () 1) (print (part))").expect("it is read");
    let output = running.output();
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected = ["\"loäded\"", "1", "(\"part\")", ":ABORTED", "\"none.esl\"", "\"none.eslb\""];
    assert_eq!(lines, expected);
}

#[test]
fn a_fifo_that_nobody_reads_yet_delays_only_its_writer() {
    let text = "(spawn (:name 'other :daemon t) (dotimes (i 50) (sleep 0.001)) (mark \"ticked\") (loop (sleep 0.001)))
(with-open-file (s \"out\" :direction :output)
  (dotimes (i 20000) (format s \"line ~d~%\" i)))
(princ 'done)";
    let mut running = Running::start("late-reader", &format!("{MARK}{text}"));
    running.await_file("ticked");
    let mut fifo = std::fs::File::open(running.path("out")).expect("it is there");
    let mut text = String::new();
    fifo.read_to_string(&mut text).expect("it is written");
    let expected: String = (0..20_000).map(|number| format!("line {number}\n")).collect();
    assert!(text == expected, "all is there, in order");
    assert_eq!(running.output(), "DONE");
}

#[test]
#[cfg(target_os = "linux")]
fn no_ending_leaves_a_descriptor() {
    let text = "(defun descriptors () (length (directory \"/proc/self/fd/*\")))
(defmacro cause (form) `(handler-case ,form (failure (f) (failure-cause f))))
(with-open-file (s \"file\" :direction :output) (dotimes (i 20000) (format s \"line ~d~%\" i)))
(with-open-file (s \"file\") (read-line s))
(let ((before (descriptors)))
  (dotimes (i 3000) (with-open-file (s \"file\") (read-line s)))
  (dotimes (i 300) (handler-case (with-open-file (s \"file\") (error \"left\")) (error () nil)))
  (dotimes (i 300) (with-open-file (s \"file\" :element-type '(unsigned-byte 8)) (read-byte s)))
  (dotimes (i 100) (cause (with-timeout 0.001 (with-open-file (s \"in\") (read-line s)))))
  (dotimes (i 100) (cause (with-timeout 0.001 (open \"out\" :direction :output))))
  (dotimes (i 300)
    (let ((task (spawn (with-open-file (s \"file\") (loop while (read-line s nil nil))))))
      (dotimes (j (mod i 7)) (sleep 0))
      (abort-task task)
      (wait-for-task task)))
  ;; Those that are never closed have been read to their ends.
  (dotimes (i 2000) (let ((s (open \"main.esl\"))) (loop while (read-line s nil nil))))
  ;; Those that are lost before their ends are closed when the collector has found that.
  (dotimes (i 50)
    (open \"file\" :element-type '(unsigned-byte 8))
    (read-line (open \"file\"))
    (open \"in\"))
  (let ((waiting (open \"in\")))
    (spawn (:name 'closer) (sleep 0.01) (close waiting))
    (print (handler-case (read-line waiting) (file-error () 'closed))))
  ;; A thread of the system's may be about to close one.
  (loop until (<= (descriptors) before) do (make-array 100000) (sleep 0.001))
  (print 'all-closed))";
    let folder = Folder::with("descriptors", &[("main.esl", text)]);
    for name in ["in", "out"] {
        let made = Command::new("mkfifo").arg(folder.path().join(name)).status();
        assert!(made.expect("there is a mkfifo").success());
    }
    let mut command = eslvm(&["run", "--allow-read", "main.esl"]);
    let done = esl_conformance::process::run(command.current_dir(folder.path()), "");
    assert_eq!(done.quiet_output().expect("nothing is wrong").trim(), "CLOSED \nALL-CLOSED");
}

#[test]
fn files_are_read_and_written_in_parts() {
    let text = "(with-open-file (s \"big\" :direction :output)
  (dotimes (i 30000) (format s \"(zeile ~d \\\"größe\\\")~%\" i)))
(with-open-file (s \"big\")
  (print (list (input-stream-p s) (output-stream-p s) (typep s 'file-stream) (file-position s)))
  (print (list (read-line s) (file-position s) (file-length s) (read s) (peek-char t s)))
  (print (loop for line = (read-line s nil nil) while line count t))
  (print (read-char s nil :end)))
(with-open-file (s \"big\" :direction :output :if-exists :append) (write-string \"end\" s))
(with-open-file (s \"big\" :element-type '(unsigned-byte 8))
  (let ((size (file-length s)) (part (make-array 50000 :element-type '(unsigned-byte 8))))
    (print (list (read-byte s) (read-sequence part s) (file-position s)))
    (file-position s (- size 3))
    (print (list (code-char (read-byte s)) (file-position s :start) (read-byte s) (file-position s)))
    (file-position s :end)
    (print (read-byte s nil :end))))
(with-open-file (s \"bytes\" :direction :output :element-type '(unsigned-byte 8))
  (dotimes (i 100000) (write-byte (mod i 256) s))
  (print (file-length s)))
(with-open-file (s \"bytes\" :element-type '(unsigned-byte 8))
  (print (loop for i from 0 for byte = (read-byte s nil nil) while byte always (= byte (mod i 256)))))
(print (handler-case (open \"none\") (file-error (e) (princ-to-string e))))
(print (handler-case (open \".\") (file-error (e) (princ-to-string e))))
(print (open \"none\" :if-does-not-exist nil))
(with-open-file (s \"/dev/null\" :direction :output) (print 1 s))
(print (with-open-file (s \"/dev/null\") (read-line s nil :end)))
(print (handler-case (open \"/etc/passwd\") (failure (f) (failure-arguments f))))
(let ((s (open \"big\"))) (print s) (close s) (print (handler-case (read-line s) (error (e) (princ-to-string e)))))";
    let folder = Folder::with("parts", &[("main.esl", text)]);
    let flags = ["run", "--allow-read=/dev/null", "--allow-write=/dev/null", "main.esl"];
    let done = esl_conformance::process::run(eslvm(&flags).current_dir(folder.path()), "");
    let output = done.quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let expected = [
        "(T NIL T 0)",
        "(\"(zeile 0 \\\"größe\\\")\" 20 708890 (ZEILE 1 \"größe\") #\\()",
        "29998",
        ":END",
        "(40 50000 50001)",
        "(#\\e T 40 1)",
        ":END",
        "100000",
        "T",
        "\"The file \\\"none\\\": it cannot be read: the file does not exist.\"",
        "\"The file \\\".\\\": it cannot be read: it is a directory.\"",
        "NIL",
        ":END",
        "(:READ \"/etc/passwd\" \"--allow-read=/etc/passwd\")",
        "#<FILE-STREAM \"big\">",
        "\"It is closed.\"",
    ];
    assert_eq!(lines, expected);
}

#[test]
fn a_limit_that_ends_reading_leaves_what_has_come_to_the_next_call() {
    // READ-SEQUENCE has put into the sequence what had come; READ-LINE has taken nothing.
    let text = "(defmacro limited (form)
  `(print (handler-case (with-timeout 0.3 ,form) (failure (failure) (failure-cause failure)))))
(with-open-file (s \"in\")
  (let ((buffer (make-array 6 :initial-element '-)))
    (limited (read-sequence buffer s))
    (print buffer)
    (mark \"sequence\")
    (print (read-line s)))
  (limited (read-line s))
  (mark \"line\")
  (print (read-line s)))";
    let mut running = Running::start("limited-reader", &format!("{MARK}{text}"));
    let mut fifo = std::fs::File::options().write(true).open(running.path("in")).expect("it is there");
    for (part, mark) in [("abc", "sequence"), ("def\nhalf", "line")] {
        fifo.write_all(part.as_bytes()).expect("it is read");
        running.await_file(mark);
    }
    fifo.write_all(b" a line\n").expect("it is read");
    drop(fifo);
    let expected = [":TIMEOUT", "#(#\\a #\\b #\\c - - -)", "\"def\"", ":TIMEOUT", "\"half a line\""];
    assert_eq!(lines_of(&running.output()), expected);
}

#[test]
fn a_limit_that_ends_reading_a_datum_of_standard_input_leaves_it_there() {
    let text = "(print (handler-case (with-timeout 0.3 (read)) (failure (failure) (failure-cause failure))))
(mark \"datum\")
(print (list (read) (read-line)))";
    let folder = Folder::with("limited-input", &[("main.esl", &format!("{MARK}{text}"))]);
    let mut command = eslvm(&["run", "main.esl"]);
    command.current_dir(folder.path()).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = Running { child: command.spawn().expect("the command is there"), folder };
    let mut input = running.child.stdin.take().expect("it is piped");
    input.write_all(b"(1 2 ").expect("it is read");
    running.await_file("datum");
    input.write_all(b"3) rest\n").expect("it is read");
    drop(input);
    assert_eq!(lines_of(&running.output()), [":TIMEOUT", "((1 2 3) \"rest\")"]);
}

#[test]
fn a_line_of_standard_input_is_long_but_not_endless() {
    let text = "(print (length (read-line)))
(print (read-line))
(print (handler-case (read-line) (failure (failure) (failure-cause failure))))";
    let folder = Folder::with("long-input", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "main.esl"]);
    command.current_dir(folder.path()).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = Running { child: command.spawn().expect("the command is there"), folder };
    let mut input = running.child.stdin.take().expect("it is piped");
    let endless = "y".repeat((1 << 24) + 1);
    input.write_all(format!("{}\nshort\n{endless}", "x".repeat(3_000_000)).as_bytes()).expect("it is read");
    drop(input);
    assert_eq!(lines_of(&running.output()), ["3000000", "\"short\"", ":LINE-TOO-LONG"]);
}

/// Returns the lines of an output that are not empty, without blanks around them.
fn lines_of(output: &str) -> Vec<&str> {
    output.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}
