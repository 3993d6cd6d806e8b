//! The modules over the operating system, in the real world.

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, Finished};

use crate::eslvm;

fn run(test: &str, text: &str, arguments: &[&str]) -> Finished {
    let folder = Folder::with(test, &[("main.esl", text)]);
    let mut command = eslvm(&[&["run"], arguments, &["main.esl"]].concat());
    process::run(command.current_dir(folder.path()), "")
}

/// Checks the lines that a program prints.
#[track_caller]
pub(crate) fn check(test: &str, text: &str, arguments: &[&str], expected: &[&str]) {
    let output = run(test, text, arguments).quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, expected);
}

#[cfg(unix)]
#[test]
fn programs_are_run_and_their_output_taken() {
    let text = "(require :process)
(defun run (command &rest options) (print (multiple-value-list (apply #'process:run-program command options))))
(defmacro cause (form) `(print (handler-case ,form (failure (f) (list (failure-cause f) (car (failure-arguments f)))))))
(run '(\"sh\" \"-c\" \"echo out; echo err >&2; exit 3\") :output :string :error-output :lines)
(run '(\"cat\") :input (format nil \"ä~%b~%\") :output :lines)
(run '(\"cat\") :input (make-string-input-stream \"from a stream\") :output :string)
(run '(\"sh\" \"-c\" \"echo $A; pwd -P | sed 's,.*/,,'\") :output :lines :environment '((\"A\" . \"5\")) :directory \"..\")
(run '(\"sh\" \"-c\" \"kill -9 $$\"))
(run '(\"true\"))
(cause (process:run-program '(\"no-such-program\")))
(cause (process:run-program '(\"ls\")))
(with-open-stream (s (process:run-program '(\"echo\" \"x y\") :output :stream)) (print (read-line s)))
(print (handler-case (process:run-program \"ls\") (error () 'no-list)))";
    check(
        "process-run",
        text,
        &["--allow-run=sh,cat,true,echo,no-such-program"],
        &[
            "(\"out",
            "\" (\"err\") 3)",
            "((\"ä\" \"b\") NIL 0)",
            "(\"from a stream\" NIL 0)",
            "((\"5\" \"commands\") NIL 0)",
            "(NIL NIL 137)",
            "(NIL NIL 0)",
            "(:PROCESS-ERROR \"there is no program `no-such-program`\")",
            "(:PERMISSION-DENIED :RUN)",
            "\"x y\"",
            "NO-LIST",
        ],
    );
}

#[cfg(unix)]
#[test]
fn a_program_whose_call_is_left_is_ended_and_others_go_on() {
    // The first program ends when it is told to, the second one only when it is forced.
    let text = "(require :process)
(defun run (script) (process:run-program (list \"sh\" \"-c\" script)))
(spawn (:name 'other :daemon t) (loop (sleep 0.001)))
(dolist (script '(\"trap 'echo stopped > ended; exit' TERM; echo > begun; while :; do sleep 0.01; done\"
                  \"trap '' TERM; echo > begun; while :; do sleep 0.01; done\"))
  (let ((task (spawn (run script))))
    (loop until (probe-file \"begun\") do (sleep 0.01))
    (delete-file \"begun\")
    (abort-task task)
    (print (wait-for-task task))))
(print (or-parallel (a (run \"exec sleep 1000\")) (b 'first)))
(with-open-file (s \"ended\") (print (read-line s)))
(let ((p (process:launch-program '(\"sh\" \"-c\" \"exit 7\"))))
  (print (list (process:wait-process p) (process:process-alive-p p))))
(let ((p (process:launch-program '(\"sleep\" \"1000\"))))
  (print (list (process:process-alive-p p) (process:end-process p) (process:process-alive-p p))))
(let ((p (process:launch-program '(\"sh\" \"-c\" \"trap '' TERM; echo > begun; exec sleep 20\"))))
  (loop until (probe-file \"begun\") do (sleep 0.01))
  (print (process:end-process p)))";
    let expected = [":ABORTED", ":ABORTED", "FIRST", "\"stopped\"", "(7 NIL)", "(T 143 NIL)", "137"];
    check("process-left", text, &["--allow-run=sh,sleep"], &expected);
}

#[cfg(unix)]
#[test]
fn a_program_ends_with_those_that_it_has_started() {
    // The first two start a program in the background that outlives its parent unless it is ended too; the
    // second one ignores SIGTERM. The third one is left when its output has an end, and the last one is
    // launched.
    let text = "(require :process)
(defun lives (file)
  (with-open-file (s file)
    (zerop (nth-value 2 (process:run-program (list \"sh\" \"-c\" (format nil \"case $(sed 's/.*) //;s/ .*//' /proc/~a/stat 2> nothing) in ''|Z) exit 1;; esac\" (read-line s))))))))
(defun await (file)
  (loop until (probe-file file) do (sleep 0.01)))
(defun script (trap file rest)
  (format nil \"sh -c '~a echo $$ > ~a.tmp; mv ~:*~a.tmp ~:*~a; while :; do sleep 0.02; done' & ~a\" trap file rest))
(dolist (trap '(\"\" \"trap : TERM;\"))
  (let* ((file (if (equal trap \"\") \"plain\" \"stubborn\"))
         (task (spawn (process:run-program (list \"sh\" \"-c\" (script trap file \"wait\"))))))
    (await file)
    (let ((before (lives file)))
      (abort-task task)
      (print (list before (wait-for-task task) (lives file))))))
(print (or-parallel (a (process:run-program (list \"sh\" \"-c\" (script \"\" \"orphan\" \"exit\")) :output :string))
                    (b (await \"orphan\") 'first)))
(print (lives \"orphan\"))
(let ((p (process:launch-program (list \"sh\" \"-c\" (script \"\" \"launched\" \"wait\")))))
  (await \"launched\")
  (print (list (lives \"launched\") (process:end-process p) (lives \"launched\"))))";
    let expected = ["(T :ABORTED NIL)", "(T :ABORTED NIL)", "FIRST", "NIL", "(T 143 NIL)"];
    check("process-group", text, &["--allow-run=sh"], &expected);
}

#[cfg(unix)]
#[test]
fn programs_have_the_environment_that_there_is_and_what_is_added() {
    let text = "(require :process)
(defvar *command* '(\"sh\" \"-c\" \"echo $ESL_GIVEN $ESL_ADDED; pwd -P | sed 's,.*/,,'\"))
(defvar *options* '(:environment ((\"ESL_ADDED\" . \"added\")) :directory \"folder\"))
(ensure-directories-exist \"folder/\")
(print (apply #'process:run-program *command* :output :lines *options*))
(with-open-stream (s (process:process-output
                       (apply #'process:launch-program *command* :output :stream *options*)))
  (print (list (read-line s) (read-line s))))";
    let folder = Folder::with("process-environment", &[("main.esl", text)]);
    let mut command = eslvm(&["run", "--allow-run=sh", "main.esl"]);
    let done = process::run(command.current_dir(folder.path()).env("ESL_GIVEN", "given"), "");
    let output = done.quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines, ["(\"given added\" \"folder\")"; 2]);
}

#[test]
fn the_environment_needs_a_right() {
    let text = "(require :os)
(defmacro cause (form) `(print (handler-case ,form (failure (f) (failure-arguments f)))))
(cause (stringp (os:getenv \"PATH\")))
(cause (os:getenv \"ESL_NO_SUCH_VARIABLE\"))
(cause (os:getenv \"HOME\"))
(print (and (plusp (length (os:hostname))) (plusp (os:process-id))))";
    let expected = ["T", "NIL", "(:ENV \"HOME\" \"--allow-env=HOME\")", "T"];
    check("os-environment", text, &["--allow-env=PATH,ESL_NO_SUCH_VARIABLE"], &expected);
}

#[test]
fn faults_of_the_outside_have_causes() {
    let text = "(require :sockets) (require :process) (require :json)
(defmacro cause (form)
  `(print (handler-case ,form (failure (f) (failure-cause f)) (error (e) (type-of e)))))
(cause (sockets:connect \"no-such-host.invalid\" 80))
(cause (sockets:listen \"no-such-host.invalid\" 80))
(cause (sockets:listen \"192.0.2.1\" 0))
(cause (sockets:connect-unix \"no-such-socket\"))
(cause (process:run-program '(\"no-such-program\")))
(cause (with-open-file (s \"/dev/full\" :direction :output :if-exists :append)
         (loop repeat 10000 do (write-line \"more\" s))))
(cause (json:parse (make-string 1000000 :initial-element #\\[)))
(cause (json:parse (map 'string #'code-char '(34 65533 1 34))))";
    let expected = [
        ":HOST-NOT-FOUND",
        ":HOST-NOT-FOUND",
        ":SOCKET-ERROR",
        ":SOCKET-ERROR",
        ":PROCESS-ERROR",
        "STREAM-ERROR",
        "JSON:JSON-ERROR",
        "JSON:JSON-ERROR",
    ];
    check("outside-faults", text, &["--allow-all"], &expected);
}

#[cfg(unix)]
#[test]
fn a_launched_program_is_talked_to_through_streams() {
    let text = "(require :process)
(let* ((p (process:launch-program '(\"sh\" \"-c\" \"while read x; do echo got $x; echo bad $x >&2; done; exit 3\")
                                  :input :stream :output :stream :error-output :stream))
       (in (process:process-input p)) (out (process:process-output p)) (errors (process:process-error-output p)))
  (print (list (input-stream-p in) (output-stream-p in) (input-stream-p out) (output-stream-p out)))
  (dolist (x '(1 2))
    (format in \"~d~%\" x)
    (finish-output in)
    (print (list (read-line out) (read-line errors))))
  (print (handler-case (with-timeout 0.01 (read-line out)) (failure (f) (failure-cause f))))
  (close in)
  (print (list (read-line out nil :end) (read-line errors nil :end) (process:wait-process p)))
  (close out)
  (close errors))
(let ((p (process:launch-program '(\"sh\" \"-c\" \"exit 4\"))))
  (print (list (process:process-input p) (process:process-output p) (process:wait-process p))))
(print (handler-case (process:launch-program '(\"no-such-program\") :output :stream) (failure (f) (failure-cause f))))";
    let expected = [
        "(NIL T T NIL)",
        "(\"got 1\" \"bad 1\")",
        "(\"got 2\" \"bad 2\")",
        ":TIMEOUT",
        "(:END :END 3)",
        "(NIL NIL 4)",
        ":PROCESS-ERROR",
    ];
    check("process-streams", text, &["--allow-run=sh,no-such-program"], &expected);
}

#[test]
fn messages_go_to_files_that_are_kept_for_a_while() {
    let text = "(require :log)
(defun lines (path) (with-open-file (s path) (loop for line = (read-line s nil nil) while line collect line)))
(defun ends (path) (mapcar (lambda (line) (subseq line (- (length line) 2))) (lines path)))
(log:to-file \"log\" :max-size 120 :keep 2)
(let ((tasks (loop for i below 2 collect (let ((i i)) (spawn (dotimes (j 4) (log:info \"message ö ~d~d\" i j)))))))
  (mapc #'wait-for-task tasks))
(print (list (length (ends \"log\")) (length (ends \"log.1\")) (length (ends \"log.2\")) (probe-file \"log.3\")))
(log:to-file nil)
(log:to-file \"log\" :max-size 1000000)
(dotimes (j 3) (log:info \"message ö 9~d\" j))
(print (last (ends \"log\") 3))
(log:to-file nil)
;; Sizes are in bytes: two lines of wide characters do not fit where one byte is missing.
(defun two-lines-fit (path size)
  (log:to-file path :max-size size)
  (dotimes (j 2) (log:info \"öööööööööö\"))
  (log:to-file nil)
  (not (probe-file (format nil \"~a.1\" path))))
(log:to-file \"one\")
(log:info \"öööööööööö\")
(log:to-file nil)
(let ((both (* 2 (with-open-file (s \"one\") (file-length s)))))
  (print (list (two-lines-fit \"all\" both) (two-lines-fit \"less\" (- both 1)))))
(setq log:*stream* *standard-output*)
(terpri)
(log:warn \"done\")";
    let output = run("log-rotation", text, &[]).quiet_output().expect("nothing is wrong");
    let lines: Vec<&str> = output.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(lines[..3], ["(2 2 2 NIL)", "(\"90\" \"91\" \"92\")", "(T NIL)"]);
    assert!(lines[3].ends_with("warn  done"), "{}", lines[3]);
}

#[test]
fn a_path_is_watched() {
    let text = "(defun change (path text mode)
  (with-open-file (s path :direction :output :if-exists mode) (write-string text s)))
(ensure-directories-exist \"folder/\")
(defun name (path) (subseq path (+ 1 (position #\\/ path :from-end t))))
(defun await (input kind name)
  (loop
    (multiple-value-bind (found path) (wait-for-event input)
      (when (and (eq found kind) (equal (name path) name))
        (return (list kind name))))))
(with-watched-path (input \"folder\")
  (change \"folder/a\" \"one\" :supersede)
  (print (await input :created \"a\"))
  (change \"folder/a\" \"two\" :append)
  (print (await input :modified \"a\"))
  (delete-file \"folder/a\")
  (print (await input :deleted \"a\")))
(let ((input (watch-path \"folder\")))
  (print (list (unwatch-path input) (unwatch-path input))))
(print (handler-case (watch-path \"no-such-folder\") (file-error () 'refused)))
(print (handler-case (watch-path \"/etc\") (failure (f) (failure-arguments f))))";
    let expected = [
        "(:CREATED \"a\")",
        "(:MODIFIED \"a\")",
        "(:DELETED \"a\")",
        "(T NIL)",
        "REFUSED",
        "(:READ \"/etc\" \"--allow-read=/etc\")",
    ];
    check("watch-path", text, &[], &expected);
}

/// The row of a function of the host is all that ESL knows of it: its parameters, its docstring, and the
/// types of its arguments.
#[test]
fn functions_of_the_host_are_defined_by_their_rows() {
    let text = "(require :sockets)
(print (documentation 'sockets::%socket-send 'function))
(print (documentation 'sockets::%socket-await 'function))
(defmacro fault (form)
  `(print (handler-case ,form
            (type-error (e) (list (type-error-datum e) (type-error-expected-type e)))
            (failure (f) (failure-cause f)))))
(fault (sockets::%socket-port 7))
(fault (sockets::%socket-take-bytes (sockets::%socket-new) -1))
(fault (sockets::%socket-send (sockets::%socket-new) 'text))
(fault (sockets::%socket-await (sockets::%socket-new)))
(print (sockets::%socket-new))
(let ((socket (sockets::%socket-new)))
  (sockets::%socket-close socket)
  (fault (sockets::%socket-port socket)))";
    let expected = [
        "\"Writes CONTENTS, a text or bytes, as far as the system takes them without delay. Returns NIL if that was \
         all; otherwise T if the rest is kept, and 0 if another task writes.\"",
        "\"Waits for data.\"",
        "(7 SOCKET)",
        "(-1 (INTEGER 0 18446744073709551615))",
        "(TEXT VECTOR)",
        ":SOCKET-ERROR",
        "#<SOCKET 4>",
        ":SOCKET-CLOSED",
    ];
    check("world-rows", text, &[], &expected);
}
