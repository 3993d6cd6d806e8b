//! Operators attached to a run.

use std::io::{Read, Write};
use std::net::TcpStream;

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, PATIENCE};

use crate::eslvm;
use crate::operate::Operated;

/// A program that holds something, and waits for the end of its input.
const PROGRAM: &str = "
(define-property mode ())
(define-input news :capacity 2)
(defvar *speed* 3)
(defun drive (n) (* n *speed*))
(assert '(mode calm))
(spawn (:name 'waiter :daemon t) (wait-for-event news) (assert '(mode awake)) (loop (sleep 1000)))
(read-line *standard-input* nil)
(format t \"~s~%\" (list *speed* (mode) (fboundp 'fresh)))";

/// Runs a session at a socket, and returns what it writes, and the exit status.
pub(crate) fn session(place: &str, input: &str) -> (String, Option<i32>) {
    let finished = process::run(&mut eslvm(&["attach", place]), input);
    (finished.output + &finished.errors, finished.status)
}

#[test]
fn a_session_evaluates_and_patches_a_run_that_goes_on() {
    let folder = Folder::new("attach_session");
    let patch = folder
        .file("patch.esl", "(defun drive (n) (list :fast n)) (defparameter *speed* 7) (defun fresh () 1)");
    let wrong = folder.file("wrong.esl", "(defun drive (n) 1) (defparameter *speed* (error \"no speed\"))");
    let (incomplete, other) =
        (folder.file("incomplete.esl", "(defun f ("), folder.file("other.esl", "(print 1)"));
    let (run, socket) = Operated::listening(&folder, PROGRAM, &[]);
    let (output, status) = session(
        &socket,
        &format!(
            "(+ 1 2)\n(list *\n (drive 5))\n:facts\n(fail :oops 1)\n:bt\n:patch {patch}\n(list (drive 1) *speed* (fresh))\n\
             :undo-patch\n(list (drive 1) *speed* (fboundp 'fresh))\n:undo-patch\n:patch {wrong}\n:patch {incomplete}\n\
             :patch {other}\n(drive 1)\n(list * **)\n(progn (defun look (where) (list (car where))) (look \"crater\"))\n:bt\n:patch /no/such/file\n:abort 9999\n:abort\n(format t \"half\")\n"
        ),
    );
    let expected = format!(
        "3\n(3 15)\n(MODE CALM)\nFailure :OOPS, no recovery available.\nAborted\nA failure of cause :OOPS with 1.\n  \
         in top level\nFailure :OOPS, no recovery available.\nAborted\n; 3 definitions are changed\n((:FAST 1) 7 1)\n\
         ; 3 definitions are as before\n(3 3 NIL)\n; no patch can be undone\nno speed\n\
         Failure :SIMPLE-ERROR, no recovery available.\nAborted\nThe last form of {incomplete} is incomplete.\n\
         Failure :PROGRAM-ERROR, no recovery available.\nAborted\n\
         A patch consists of DEFUN, DEFMACRO, DEFMETHOD, DEFGENERIC, DEFVAR, DEFPARAMETER, SETQ, DEFTYPE, \
         DEFINE-CAUSE, DEFINE-MODIFY-MACRO, DEFINE-COMPILER-MACRO, DEFSTRUCT, DEFCLASS, DEFINE-CONDITION, \
         DEFCONSTANT, DEFINE-SYMBOL-MACRO, DEFINE-FLUENT, DEFINE-INPUT, DEFINE-PROPERTY, DEFINE-RESOURCE, \
         DEFINE-RULE and TO-ACHIEVE, not of (PRINT 1).\n\
         Failure :PROGRAM-ERROR, no recovery available.\nAborted\n3\n(3 (3 3 NIL))\n\
         The value \"crater\" is not of type LIST.\nFailure :TYPE-ERROR, no recovery available.\nAborted\n\
         The value \"crater\" is not of type LIST.\n  in LOOK\n      WHERE = \"crater\"\n  in top level\n\
         Failure :TYPE-ERROR, no recovery available.\nAborted\n\
         ; /no/such/file cannot be read: No such file or directory (os error 2)\n; task 9999 does not exist\n\
         ; `:abort` needs the number of a task, which `:tasks` shows\nhalf\nNIL\n"
    );
    assert_eq!((output, status), (expected, Some(0)));
    // Another session has a history of its own, and sees what the first has changed.
    let (output, _) = session(&socket, "*\n(setq *speed* 8)\n(setq + 1)\n:signal news 1 (2)\n:quit\n");
    assert_eq!(output, "NIL\n8\n1\n; NEWS is signalled with 1 (2)\n");
    // The run ends with all that was done to it, and takes its socket away.
    let finished = run.finish();
    assert_eq!(
        (finished.output.as_str(), finished.status),
        ("(8 AWAKE NIL)\n", Some(0)),
        "{}",
        finished.errors
    );
    assert!(!std::path::Path::new(&socket).exists());
    let (output, status) = session(&socket, "");
    assert!(output.starts_with(&format!("eslvm: cannot reach a run at {socket}")), "{output}");
    assert_eq!(status, Some(2));
}

/// A line with a colon is a command, and each command says what it has done.
#[test]
fn commands_say_what_they_do() {
    let folder = Folder::new("attach_commands");
    let program = "(spawn (:name 'driver :daemon t) (loop (sleep 1000))) (read-line *standard-input* nil)";
    let (run, socket) = Operated::listening(&folder, program, &[]);
    let (number, _) =
        session(&socket, "(princ (esl::%task-number (find 'driver (list-tasks) :key #'task-name)))\n");
    let number = number.lines().next().unwrap_or_default().to_string();
    let (output, status) = session(
        &socket,
        &format!(
            ":abrot {number}\n:foo\n':foo\n(list :foo)\n:pause\n:pause\n:continue\n:continue\n:resume {number}\n\
             :suspend {number}\n(loop until (eq (task-status (find 'driver (list-tasks) :key #'task-name)) :suspended) do (sleep 0.01))\n\
             :resume {number}\n:abort {number}\nexit\n"
        ),
    );
    let expected = format!(
        "; no command `:abrot`; did you mean `:abort`?\n\
         ; no command `:foo`; `:help` lists them, and `':foo` evaluates the keyword\n\
         :FOO\n(:FOO)\n\
         ; all tasks stand still; the clock runs on, and `:continue` ends the pause\n; the run is paused already\n\
         ; the tasks go on\n; the run is not paused\n; task DRIVER, number {number}, is not suspended\n\
         ; task DRIVER, number {number}, is suspended, with the tasks that it has made\nNIL\n\
         ; task DRIVER, number {number}, is resumed, with the tasks that it has made\n\
         ; task DRIVER, number {number}, is aborted now\n"
    );
    assert_eq!((output, status), (expected, Some(0)));
    assert_eq!(run.end(), Some(0));
}

#[test]
fn who_leaves_takes_what_it_evaluates_with_it() {
    let folder = Folder::new("attach_leaves");
    let program = "(defvar *ended* (make-event)) (defvar *begun* nil)
        (spawn (:daemon t) (loop (sleep 1000)))
        (wait-for-event *ended*) (princ 'ended)";
    let (run, socket) = Operated::listening(&folder, program, &[]);
    // Its task is aborted while it waits, and its cleanup ends the run.
    let mut stream = std::os::unix::net::UnixStream::connect(&socket).expect("the run listens");
    let form =
        "(unwind-protect (progn (format t \\\"waits\\\") (setq *begun* t) (sleep 1000)) (signal *ended*))";
    stream
        .write_all(&packet(&format!("(:emacs-rex (esl:evaluate \"{form}\") nil t 1)")))
        .expect("it is taken");
    let (output, _) = session(&socket, "(loop until *begun* do (sleep 0.01))\n':seen\n");
    assert_eq!(output, "NIL\n:SEEN\n");
    drop(stream);
    assert_eq!(run.finish().output, "ENDED");
}

pub(crate) fn packet(text: &str) -> Vec<u8> {
    format!("{:06x}{text}", text.len()).into_bytes()
}

/// Connects, says a secret, and sends packets; returns the texts of so many answers.
pub(crate) fn ask(address: &str, secret: &str, requests: &[String]) -> Vec<String> {
    let mut stream = TcpStream::connect(address).expect("the run listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
    let mut bytes = packet(&format!("\"{secret}\""));
    requests.iter().for_each(|request| bytes.extend(packet(request)));
    drop(stream.write_all(&bytes));
    let mut answers = Vec::new();
    while answers.len() < requests.len() {
        let mut head = [0; 6];
        if stream.read_exact(&mut head).is_err() {
            break;
        }
        let length = usize::from_str_radix(&String::from_utf8_lossy(&head), 16).expect("it is a packet");
        let mut body = vec![0; length];
        stream.read_exact(&mut body).expect("the packet is complete");
        answers.push(String::from_utf8(body).expect("it is text").trim_end().to_string());
    }
    answers
}

/// Starts the program with a listener at a port, and secrets for the three roles.
pub(crate) fn start_with_secrets(folder: &Folder) -> (Operated, String) {
    let secrets = folder
        .file("secrets", "observe observe-0123456789\ncommand command-0123456789\npatch patch-0123456789\n");
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&secrets, std::fs::Permissions::from_mode(0o600)).expect("it can be set");
    let mut run = Operated::start(folder, PROGRAM, &["--listen", "0", "--secrets", &secrets]);
    let address = run.said("; operators attach with eslvm attach ");
    (run, address)
}

#[test]
fn each_role_may_do_what_its_secret_says() {
    let folder = Folder::new("attach_roles");
    let (run, address) = start_with_secrets(&folder);
    let requests = [
        ("swank:connection-info", 0),
        ("esl:tasks", 0),
        ("esl:backtrace", 0),
        ("esl:facts", 0),
        ("esl:data", 0),
        ("esl:failures", 0),
        ("esl:abort", 1),
        ("esl:suspend", 1),
        ("esl:resume", 1),
        ("esl:pause", 1),
        ("esl:continue", 1),
        ("esl:signal", 1),
        ("esl:rights", 2),
        ("esl:evaluate", 2),
        ("esl:watch", 2),
        ("esl:complete", 2),
        ("esl:patch", 2),
        ("esl:undo-patch", 2),
        ("swank:swank-require", 0),
        ("swank:init-presentations", 0),
        ("swank:buffer-first-change", 0),
        ("swank:update-indentation-information", 0),
        ("swank-repl:redirect-trace-output", 0),
        ("swank:clear-repl-results", 0),
        ("swank:fuzzy-completion-selected", 0),
        ("swank:default-directory", 0),
        ("swank:xref", 0),
        ("swank:xrefs", 0),
        ("swank-repl:create-repl", 2),
        ("swank:set-package", 2),
        ("swank:list-all-package-names", 2),
        ("swank-repl:listener-eval", 2),
        ("swank-repl:clear-repl-variables", 2),
        ("swank:interactive-eval", 2),
        ("swank:interactive-eval-region", 2),
        ("swank:pprint-eval", 2),
        ("swank:eval-and-grab-output", 2),
        ("swank:re-evaluate-defvar", 2),
        ("swank:compile-string-for-emacs", 2),
        ("swank:compile-file-for-emacs", 2),
        ("swank:load-file", 2),
        ("swank:swank-macroexpand-1", 2),
        ("swank:swank-expand-1", 2),
        ("swank:swank-macroexpand", 2),
        ("swank:swank-expand", 2),
        ("swank:simple-completions", 2),
        ("swank:completions", 2),
        ("swank:fuzzy-completions", 2),
        ("swank:completions-for-keyword", 2),
        ("swank:completions-for-character", 2),
        ("swank:operator-arglist", 2),
        ("swank:autodoc", 2),
        ("swank:describe-symbol", 2),
        ("swank:describe-function", 2),
        ("swank:describe-definition-for-emacs", 2),
        ("swank:documentation-symbol", 2),
        ("swank:apropos-list-for-emacs", 2),
        ("swank:find-definitions-for-emacs", 2),
        ("swank:undefine-function", 2),
        ("swank:swank-toggle-trace", 2),
        ("swank:untrace-all", 2),
        ("swank:list-threads", 0),
        ("swank:quit-thread-browser", 0),
        ("swank:kill-nth-thread", 1),
        ("cl:mapc", 1),
        ("swank:debug-nth-thread", 2),
        ("swank:debugger-info-for-emacs", 2),
        ("swank:backtrace", 2),
        ("swank:frame-source-location", 2),
        ("swank:frame-locals-and-catch-tags", 2),
        ("swank:invoke-nth-restart-for-emacs", 2),
        ("swank:sldb-abort", 2),
        ("swank:throw-to-toplevel", 2),
        ("swank:sldb-continue", 2),
        ("swank:sldb-return-from-frame", 2),
        ("swank:eval-string-in-frame", 2),
        ("swank:pprint-eval-string-in-frame", 2),
        ("swank:init-inspector", 2),
        ("swank:inspect-nth-part", 2),
        ("swank:inspector-pop", 2),
        ("swank:inspector-next", 2),
        ("swank:inspector-reinspect", 2),
        ("swank:inspector-toggle-verbose", 2),
        ("swank:inspector-range", 2),
        ("swank:inspector-call-nth-action", 2),
        ("swank:inspector-eval", 2),
        ("swank:describe-inspectee", 2),
        ("swank:pprint-inspector-part", 2),
        ("swank:quit-inspector", 2),
        ("swank:inspect-current-condition", 2),
        ("swank:inspect-frame-var", 2),
        ("swank:inspect-in-frame", 2),
    ];
    for (role, name) in ["observe", "command", "patch"].into_iter().enumerate() {
        for (request, needed) in requests {
            let text = format!("(:emacs-rex ({request}) nil t 7)");
            let answers = ask(&address, &format!("{name}-0123456789"), &[text]);
            let is_refused = answers[0].contains("needs the role");
            assert_eq!(is_refused, role < needed, "{name} {request}: {answers:?}");
            assert!(answers[0].starts_with("(:return (:") && answers[0].ends_with(" 7)"), "{answers:?}");
        }
    }
    let facts = "(:emacs-rex (esl:facts \"mode\") nil t 1)".to_string();
    assert_eq!(ask(&address, "observe-0123456789", &[facts]), ["(:return (:ok \"(MODE CALM)\n\") 1)"]);
    for wrong in ["", "observe", "observe-01234567890", "OBSERVE-0123456789", "x\\\" (quit) \\\""] {
        let answers = ask(&address, wrong, &["(:emacs-rex (esl:tasks) nil t 1)".into()]);
        assert!(answers.is_empty(), "{wrong}: {answers:?}");
    }
    assert_eq!(run.finish().output, "(3 CALM NIL)\n");
}

/// Names that are sent are texts: only evaluated forms make symbols in the program.
#[test]
fn what_strangers_send_makes_no_symbols() {
    let folder = Folder::new("attach_symbols");
    let (run, address) = start_with_secrets(&folder);
    let requests = [
        "(swank:connection-info zorro :zorro \"zorro\")",
        "(zorro:zorro)",
        "(esl:facts \"zorro\")",
        "(esl:signal \"zorro\" \"zorro (:zorro) #:zorro |zorro| esl-user::zorro\")",
        "(esl:signal \"news\" \"zorro\")",
        "(esl:evaluate \"(quote zorro)\")",
        "(swank:swank-require '(zorro :zorro))",
        "(cl:mapc 'zorro '(zorro))",
    ];
    for (at, request) in requests.iter().enumerate() {
        // One at a time: so each is done before the next session looks.
        let text = format!("(:emacs-rex {request} zorro :zorro {at})");
        let answers = ask(&address, "command-0123456789", &[text]);
        assert!(answers.len() == 1 && answers[0].ends_with(&format!(" {at})")), "{request}: {answers:?}");
    }
    let form = "(list (find-symbol \\\"ZORRO\\\") (find-symbol \\\"ZORRO\\\" \\\"KEYWORD\\\") (find-symbol \\\"zorro\\\"))";
    let look = format!("(:emacs-rex (esl:evaluate \"{form}\") nil t 1)");
    let answers = ask(&address, "patch-0123456789", &[look]);
    assert!(answers[0].contains("(NIL NIL NIL)"), "{answers:?}");
    assert_eq!(run.finish().output, "(3 CALM NIL)\n");
}

/// Evaluations of a session are part of the run, and happen again in a replay; surveys are not.
#[test]
fn a_run_with_sessions_is_replayed_without_them() {
    let folder = Folder::new("attach_recorded");
    let patch = folder.file("patch.esl", "(defun drive (n) (list :fast n)) (define-rule (calm) (mode calm))");
    let (socket, recording) = (folder.join("s"), folder.join("run.eslj"));
    let options = ["--listen", &socket, "--metrics", "0", "--record", &recording];
    let mut run = Operated::start(&folder, PROGRAM, &options);
    let address = run.said("; metrics at http://");
    run.said("; operators attach with eslvm attach ");
    let input = format!(
        ":tasks\n:patch {patch}\n(list (drive 1) (db-query '(calm)))\n:data\n(fail :oops 1)\n:pause\n:facts\n:continue\n\
         :signal news 1 (2)\n(spawn (:name 'late :daemon t) (loop (sleep 1000)))\n:bt 1\n:undo-patch\n(drive 1)\n\
         (loop until (mode 'awake) do (sleep 0.01))\n(setq *speed* 9)\n"
    );
    let (output, status) = session(&socket, &input);
    assert!(output.contains("((:FAST 1) ") && output.ends_with("\n9\n") && status == Some(0), "{output}");
    let figures = crate::operate::request(address.trim_end_matches("/metrics"), "GET", "/metrics", "", "");
    assert!(figures.contains("esl_failures_total"), "{figures}");
    let finished = run.finish();
    assert_eq!((&*finished.output, finished.status), ("(9 AWAKE NIL)\n", Some(0)), "{}", finished.errors);
    let check = process::run(&mut eslvm(&["replay", "--check", &recording]), "");
    assert_eq!((check.status, &*check.errors), (Some(0), ""), "{}", check.output);
    assert!(check.output.starts_with("equal: "), "{}", check.output);
    let again = process::run(&mut eslvm(&["replay", &recording]), "");
    assert_eq!((again.status, &*again.output), (Some(0), "(9 AWAKE NIL)\n"), "{}", again.errors);
}

/// Random numbers that are the same in each run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }
}

/// Returns bytes that look like the packets of a session, more or less.
fn noise(dice: &mut Dice) -> Vec<u8> {
    let words = [
        "(",
        ")",
        "\"",
        "'",
        "\\",
        ":emacs-rex",
        "esl:tasks",
        "esl:facts",
        "esl:evaluate",
        "esl:abort",
        "nil",
        "t",
        "1",
        "-99999999999999999999",
        "99999",
        "\"x\"",
        "ü",
        " ",
        "\n",
        ".",
        "#.",
        "(:emacs-rex (esl:tasks) nil t 1)",
        "(:emacs-interrupt t)",
        "(:ping 1 2)",
        "\0",
        ":x",
        "(esl:evaluate \"(setq *speed* 0)\")",
    ];
    let mut bytes = Vec::new();
    for _ in 0..dice.below(6) {
        let text: String =
            (0..dice.below(12)).map(|_| words[dice.below(words.len())].to_string() + " ").collect();
        let mut one = packet(&text);
        for _ in 0..dice.below(3).saturating_sub(1) {
            let at = dice.below(one.len());
            one[at] = dice.below(256) as u8;
        }
        bytes.extend(one);
    }
    bytes.truncate(bytes.len() - dice.below(bytes.len() / 4 + 1));
    bytes
}

/// Number of connections with noise; `ESL_NOISE` sets another one, for longer runs by hand.
fn connections() -> usize {
    std::env::var("ESL_NOISE").ok().and_then(|count| count.parse().ok()).unwrap_or(300)
}

#[test]
fn noise_has_no_effect() {
    let folder = Folder::new("attach_noise");
    let (run, address) = start_with_secrets(&folder);
    let mut dice = Dice(15);
    for round in 0..connections() {
        let mut stream = TcpStream::connect(&address).expect("the run listens");
        // Some connections may survey the run; none may change it.
        let mut bytes = if dice.below(3) > 0 { packet("\"observe-0123456789\"") } else { Vec::new() };
        bytes.extend(noise(&mut dice));
        drop(stream.write_all(&bytes));
        if round % 16 == 0 {
            // Some wait for what is said to it.
            drop(stream.shutdown(std::net::Shutdown::Write));
            drop(stream.set_read_timeout(Some(PATIENCE)));
            drop(stream.read_to_end(&mut Vec::new()));
        }
    }
    let facts = "(:emacs-rex (esl:facts \"mode\") nil t 1)".to_string();
    assert_eq!(ask(&address, "observe-0123456789", &[facts]), ["(:return (:ok \"(MODE CALM)\n\") 1)"]);
    assert_eq!(run.finish().output, "(3 CALM NIL)\n");
}

#[test]
fn bad_options_are_refused() {
    let folder = Folder::new("attach_options");
    let open = folder.file("open", "observe observe-0123456789\n");
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&open, std::fs::Permissions::from_mode(0o644)).expect("it can be set");
    for (options, said) in [
        (&["--listen", "0.0.0.0:0"][..], "eslvm: others could read the traffic at 0.0.0.0:0"),
        (&["--listen", "0", "--secrets", &open], &format!("eslvm: {open}: other users may read or write it")),
        (&["--listen", "/no/such/folder/s"], "eslvm: cannot listen for operators at /no/such/folder/s"),
    ] {
        let mut run = Operated::start(&folder, "(print 1)", options);
        run.said(said);
        assert_eq!(run.end(), Some(2), "{options:?}");
    }
}
