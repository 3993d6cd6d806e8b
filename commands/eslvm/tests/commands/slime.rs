//! Sessions of SLIME, of a scripted client and of Emacs itself.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, PATIENCE};

use crate::operate::Operated;

/// A program with something to look at, and a task that fails when it is told to go.
const PROGRAM: &str = "(defvar *speed* 3)
(defun drive (n)
  \"Drives N.\"
  (* n *speed*))
(defmacro twice (form) `(list ,form ,form))
(defun stumble (n)
  (+ 1 (fail :stuck n)))
(define-input *go* :capacity 4)
(defvar *got* nil)
(defstruct wheel size)
(spawn (:name 'worker :daemon t)
  (loop (wait-for-event *go*) (setq *got* (stumble 5))))
(define-property mode (device))
(to-achieve (mode device value) (t (assert (list 'mode device value))))
(spawn (:name 'idler :daemon t) (with-maintained-property (mode 'camera :idle) (loop (sleep 1000))))
(read-line *standard-input* nil)
(format t \"~s~%\" (drive 2))";

const SECRET: &str = "patch-0123456789";

/// Starts the program with a listener at a port. Returns the address, too.
fn start(folder: &Folder) -> (Operated, String) {
    let secrets = folder.file("secrets", format!("command command-0123456789\npatch {SECRET}\n"));
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&secrets, std::fs::Permissions::from_mode(0o600)).expect("it can be set");
    let mut run = Operated::start(folder, PROGRAM, &["--listen", "0", "--secrets", &secrets]);
    let address = run.said("; operators attach with eslvm attach ");
    (run, address)
}

/// A client that knows the protocol, and nothing else.
struct SlimeClient {
    stream: TcpStream,
    asked: usize,
    /// Messages received and not awaited yet.
    heard: Vec<String>,
}

impl SlimeClient {
    fn connect(address: &str) -> SlimeClient {
        let stream = TcpStream::connect(address).expect("the run listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        let mut client = SlimeClient { stream, asked: 0, heard: Vec::new() };
        client.send(&format!("\"{SECRET}\""));
        client
    }

    fn send(&mut self, text: &str) {
        self.stream.write_all(format!("{:06x}{text}", text.len()).as_bytes()).expect("it is taken");
    }

    fn read(&mut self) -> String {
        let mut head = [0; 6];
        self.stream.read_exact(&mut head).expect("something is said");
        let length = usize::from_str_radix(&String::from_utf8_lossy(&head), 16).expect("it is a packet");
        let mut body = vec![0; length];
        self.stream.read_exact(&mut body).expect("the packet is complete");
        String::from_utf8(body).expect("it is text").trim_end().to_string()
    }

    /// Waits for a packet that begins so, and returns the rest of it.
    fn wait(&mut self, beginning: &str) -> String {
        loop {
            if let Some(at) = self.heard.iter().position(|packet| packet.starts_with(beginning)) {
                return self.heard.remove(at)[beginning.len()..].to_string();
            }
            let packet = self.read();
            self.heard.push(packet);
        }
    }

    /// Asks something about a task, without waiting for the answer.
    fn begin(&mut self, form: &str, thread: &str) -> usize {
        self.asked += 1;
        self.send(&format!("(:emacs-rex {form} \"ESL-USER\" {thread} {})", self.asked));
        self.asked
    }

    fn answer(&mut self, asked: usize) -> String {
        let end = format!(" {asked})");
        loop {
            let is_it = |packet: &String| packet.starts_with("(:return ") && packet.ends_with(&end);
            if let Some(at) = self.heard.iter().position(is_it) {
                let packet = self.heard.remove(at);
                return packet["(:return ".len()..packet.len() - end.len()].to_string();
            }
            let packet = self.read();
            self.heard.push(packet);
        }
    }

    fn ask(&mut self, form: &str) -> String {
        self.ask_about(form, "t")
    }

    /// Waits until there is no task of a name any more.
    fn wait_for_end_of(&mut self, name: &str) {
        let form = format!("(loop while (find '{name} (list-tasks) :key #'task-name) do (sleep 0.01))");
        self.ask(&format!("(swank:interactive-eval \"{form}\")"));
    }

    fn ask_about(&mut self, form: &str, thread: &str) -> String {
        let asked = self.begin(form, thread);
        self.answer(asked)
    }
}

#[test]
fn a_client_evaluates_looks_up_and_compiles() {
    let folder = Folder::new("slime_client");
    let (run, address) = start(&folder);
    let mut client = SlimeClient::connect(&address);
    let info = client.ask("(swank:connection-info)");
    assert!(info.starts_with("(:ok (:pid ") && info.contains(":version \"2.27\""), "{info}");
    for (form, answer) in [
        ("(swank:swank-require '(swank-repl :swank-arglists))", "(:ok (\"SWANK-REPL\" \"SWANK-ARGLISTS\"))"),
        ("(swank-repl:create-repl nil :coding-system \"utf-8-unix\")", "(:ok (\"ESL-USER\" \"ESL-USER\"))"),
        ("(swank:interactive-eval \"(drive 2)\")", "(:ok \"=> 6\")"),
        ("(swank:interactive-eval \"(values)\")", "(:ok \"; No value\")"),
        ("(swank:eval-and-grab-output \"(princ 1) 2\")", "(:ok (\"1\" \"2\"))"),
        ("(swank:pprint-eval \"(values 1 :two)\")", "(:ok \"1\n:TWO\n\")"),
        ("(swank:simple-completions \"dri\" \"ESL-USER\")", "(:ok ((\"drive\") \"drive\"))"),
        (
            "(swank:completions \"esl:with-rec\" \"ESL-USER\")",
            "(:ok ((\"esl:with-recovery-procedures\") \"esl:with-recovery-procedures\"))",
        ),
        (
            "(swank:fuzzy-completions \"twi\" \"ESL-USER\" :limit 300)",
            "(:ok (((\"twice\" \"100.0\" ((0 \"twi\")) \"--------\")) nil))",
        ),
        ("(swank:completions-for-keyword \"x\" \":t\" '(1))", "(:ok nil)"),
        ("(swank:operator-arglist \"drive\" \"ESL-USER\")", "(:ok \"(drive n)\")"),
        ("(swank:operator-arglist \"no-such\" \"ESL-USER\")", "(:ok nil)"),
        (
            "(swank:autodoc '(\"list\" (\"drive\" \"\" swank::%cursor-marker%)) :print-right-margin 80)",
            "(:ok (\"(drive n)\" t))",
        ),
        ("(swank:autodoc '(\"no-such\" swank::%cursor-marker%))", "(:ok (:not-available t))"),
        ("(swank:swank-macroexpand-1 \"(twice 1)\")", "(:ok \"(list 1 1)\")"),
        ("(swank:swank-expand \"(twice 1)\")", "(:ok \"(list 1 1)\")"),
        ("(swank:describe-symbol \"drive\")", "(:ok \"drive is a function: (drive n)\n  Drives N.\n\")"),
        ("(swank:documentation-symbol \"no-such\")", "(:ok \"no-such is unknown.\")"),
        ("(swank:set-package \"esl-user\")", "(:ok (\"ESL-USER\" \"ESL-USER\"))"),
        ("(swank:buffer-first-change \"x\")", "(:ok nil)"),
        ("(swank:interactive-eval \"(+ 1\")", "(:abort \"The last form is incomplete.\")"),
        ("(swank:quit-lisp)", "(:abort \"`swank:quit-lisp` is not a request of a session\")"),
        ("(swank:operator-arglist)", "(:abort \""),
    ] {
        let said = client.ask(form);
        assert!(said.starts_with(answer), "{form}: {said}");
    }
    let apropos = client.ask("(swank:apropos-list-for-emacs \"DRIVE\" nil nil \"ESL-USER\")");
    assert!(apropos.contains("(:designator \"ESL-USER::DRIVE\" :function \"Drives N.\")"), "{apropos}");
    assert_eq!(client.ask("(swank-repl:listener-eval \"(princ 'x) (list 1)\n\")"), "(:ok nil)");
    assert_eq!(client.wait("(:write-string "), "\"X\")");
    assert_eq!(client.wait("(:write-string "), "\"X\n\" :repl-result)");
    assert_eq!(client.wait("(:write-string "), "\"(1)\n\" :repl-result)");
    assert_eq!(client.ask("(swank-repl:listener-eval \"(car *)\n\")"), "(:ok nil)");
    assert_eq!(client.wait("(:write-string "), "\"1\n\" :repl-result)");
    let place = client.ask("(swank:find-definitions-for-emacs \"drive\")");
    let file = folder.join("program.esl");
    assert!(
        place.contains(&format!("(:location (:file \"{file}\") (:function-name \"drive\") nil)")),
        "{place}"
    );
    // Redefines a function of the running program.
    let source = "(defun drive (n) (list :fast n))";
    let compiled = client.ask(&format!(
        "(swank:compile-string-for-emacs \"{source}\" \"program.esl\" '((:position 20) (:line 40 2)) \"{file}\" nil)"
    ));
    assert!(compiled.starts_with("(:ok (:compilation-result nil t "), "{compiled}");
    let compiled = client.ask(&format!(
        "(swank:compile-string-for-emacs \"(defun drive (n) (if))\" \"b\" '((:line 7 0)) \"{file}\" nil)"
    ));
    assert!(compiled.starts_with("(:ok (:compilation-result ((:message \""), "{compiled}");
    assert!(compiled.contains(":severity :error :location (:location (:file \""), "{compiled}");
    assert!(compiled.contains("(:line 7 18) nil))) nil "), "{compiled}");
    // The inspector.
    let shown = client.ask("(swank:init-inspector \"(list 'drive (make-wheel :size 4))\")");
    assert!(shown.starts_with("(:ok (:title \"(DRIVE #S(WHEEL :SIZE 4))\" :id 0 :content (("), "{shown}");
    assert!(client.ask("(swank:inspect-nth-part 2)").contains("\"size: \" (:value \"4\" 1)"));
    assert!(client.ask("(swank:inspector-pop)").contains(":title \"(DRIVE "));
    assert_eq!(client.ask("(swank:inspector-pop)"), "(:ok nil)");
    assert!(client.ask("(swank:inspector-next)").contains(":title \"#S(WHEEL "));
    assert_eq!(client.ask("(swank:inspector-eval \"(wheel-size *)\")"), "(:ok \"=> 4\")");
    assert_eq!(client.ask("(swank:quit-inspector)"), "(:ok nil)");
    // Tasks.
    let tasks = client.ask("(swank:list-threads)");
    assert!(tasks.starts_with("(:ok ((:id :name :status :holds) ("), "{tasks}");
    assert!(tasks.contains("\"(MODE CAMERA :IDLE)\")"), "{tasks}");
    let row = tasks.split("\") (").position(|row| row.contains("IDLER")).expect("it is there");
    assert_eq!(client.ask(&format!("(cl:mapc 'swank:kill-nth-thread '({row}))")), "(:ok t)");
    assert!(client.ask("(cl:mapc 'print '(1))").starts_with("(:abort \"`cl:mapc` is a request only "));
    assert!(client.ask("(swank:kill-nth-thread 99)").starts_with("(:abort \"row 99 of "));
    client.wait_for_end_of("idler");
    assert!(!client.ask("(swank:list-threads)").contains("IDLER"));
    // A hanging call is aborted.
    client.ask("(swank:interactive-eval \"(defvar *begun* nil)\")");
    let hangs =
        client.begin("(swank:interactive-eval \"(progn (setq *begun* t) (loop (sleep 1000)))\")", "t");
    client.ask("(swank:interactive-eval \"(loop until *begun* do (sleep 0.01))\")");
    client.send("(:emacs-interrupt t)");
    assert_eq!(client.answer(hangs), "(:abort \"aborted\")");
    drop(client);
    assert_eq!(run.finish().output, "(:FAST 2)\n");
}

#[test]
fn a_failure_waits_for_who_debugs_it() {
    let folder = Folder::new("slime_debugger");
    let (run, address) = start(&folder);
    let mut client = SlimeClient::connect(&address);
    client.ask("(swank-repl:create-repl nil)");
    // A task of the program fails: it stands there, with nothing unwound, until there is an answer.
    client.ask("(swank:interactive-eval \"(signal *go*)\")");
    let debug = client.wait("(:debug ");
    let thread = debug.split(' ').next().expect("it has a task").to_string();
    let file = folder.join("program.esl");
    let start = format!(
        "{thread} 1 (\"A failure of cause :STUCK with 5.\" \"   [cause :STUCK]\" nil) \
         ((\"USE-VALUE\" \"Return a value in place of the failed operation.\") \
         (\"ABORT\" \"End the task with its failure.\")) ((0 \"STUMBLE at {file}:7:8\") (1 "
    );
    assert!(debug.starts_with(&start), "{debug}\n{start}");
    assert_eq!(client.wait("(:debug-activate "), format!("{thread} 1 nil)"));
    let place = client.ask_about("(swank:frame-source-location 0)", &thread);
    assert_eq!(place, format!("(:ok (:location (:file \"{file}\") (:line 7 7) nil))"));
    assert!(client.ask_about("(swank:backtrace 0 1)", &thread).starts_with("(:ok ((0 \"STUMBLE at "));
    assert_eq!(
        client.ask_about("(swank:frame-locals-and-catch-tags 0)", &thread),
        "(:ok (((:name \"n\" :id 0 :value \"5\")) nil))"
    );
    assert_eq!(
        client.ask_about("(swank:eval-string-in-frame \"(* n *speed*)\" 0 \"ESL-USER\")", &thread),
        "(:ok \"=> 15\")"
    );
    assert_eq!(
        client.ask_about("(swank:eval-string-in-frame \"*speed*\" 0 \"ESL-USER\")", &thread),
        "(:ok \"=> 3\")"
    );
    assert!(client.ask_about("(swank:inspect-current-condition)", &thread).contains("STUCK"));
    assert!(
        client
            .ask_about("(swank:invoke-nth-restart-for-emacs 1 9)", &thread)
            .contains("Restart 9 does not exist")
    );
    // A value in the place of what has failed: the task goes on with it.
    let left = client.ask_about("(swank:invoke-nth-restart-for-emacs 1 0)", &thread);
    assert_eq!(left, "(:abort \"the task has left the debugger\")");
    assert_eq!(client.wait("(:debug-return "), format!("{thread} 1 nil)"));
    assert_eq!(client.wait("(:read-from-minibuffer "), format!("{thread} 1 \"Value: \" nil)"));
    client.send(&format!("(:emacs-return {thread} 1 \"(* 2 *speed*)\")"));
    client.ask("(swank:interactive-eval \"(loop until *got* do (sleep 0.01))\")");
    assert_eq!(client.ask("(swank:interactive-eval \"*got*\")"), "(:ok \"=> 7\")");
    // A failure of what is evaluated, with a restart of its own.
    let fails = client.begin(
        "(swank-repl:listener-eval \"(restart-case (error \\\"no ~a\\\" 1) (skip () :report \\\"Skip it.\\\" 42))\")",
        ":repl-thread",
    );
    let debug = client.wait("(:debug ");
    let thread = debug.split(' ').next().expect("it has a task").to_string();
    assert!(debug.contains("((\"SKIP\" \"Skip it.\") (\"USE-VALUE\" "), "{debug}");
    assert!(debug.contains("(\"ABORT\" \"Return to SLIME.\")"), "{debug}");
    client.begin("(swank:invoke-nth-restart-for-emacs 1 0)", &thread);
    assert_eq!(client.wait("(:write-string "), "\"42\n\" :repl-result)");
    assert_eq!(client.answer(fails), "(:ok nil)");
    let fails = client.begin("(swank:interactive-eval \"(car 1)\")", "t");
    let debug = client.wait("(:debug ");
    let thread = debug.split(' ').next().expect("it has a task").to_string();
    client.begin("(swank:throw-to-toplevel)", &thread);
    let answer = client.answer(fails);
    assert!(answer.starts_with("(:abort \"") && answer.contains("LIST"), "{answer}");
    // Questions that are not evaluations are not debugged.
    assert_eq!(client.ask("(swank:inspect-nth-part 99)"), "(:abort \"Part 99 does not exist.\")");
    // When the session ends, what it debugs ends with its failure.
    client.ask("(swank:interactive-eval \"(signal *go*)\")");
    client.wait("(:debug ");
    drop(client);
    let mut other = SlimeClient::connect(&address);
    other.wait_for_end_of("worker");
    drop(other);
    let finished = run.finish();
    assert!(finished.errors.contains("A failure of cause :STUCK with 5."), "{}", finished.errors);
    assert_eq!(finished.output, "6\n");
}

/// A task that stands for the debugger is aborted, and ends by its limits, as any other. A task that may not
/// wait does not stand.
#[test]
fn who_stands_for_the_debugger_is_aborted_and_limited_like_others() {
    let folder = Folder::new("slime_limits");
    let (run, address) = start(&folder);
    let mut client = SlimeClient::connect(&address);
    client.ask("(swank-repl:create-repl nil)");
    let form = "(without-interrupts (fail :stuck 1))";
    let answer = client.ask(&format!("(swank:interactive-eval \"{form}\")"));
    assert!(answer.starts_with("(:abort \"A failure of cause :STUCK"), "{answer}");
    assert!(!client.heard.iter().any(|packet| packet.starts_with("(:debug")), "{:?}", client.heard);
    // Time passes while it stands, and its cleanups run when that is over.
    client.ask("(swank:interactive-eval \"(defvar *cleaned* nil)\")");
    let form = "(with-recovery-procedures ((:timeout (abort :late)))
                  (with-timeout 0.05 (unwind-protect (stumble 1) (push :limit *cleaned*))))";
    let asked = client.begin(&format!("(swank:interactive-eval \"{form}\")"), "t");
    let debug = client.wait("(:debug ");
    let thread = debug.split(' ').next().expect("it has a task").to_string();
    assert_eq!(client.wait("(:debug-return "), format!("{thread} 1 nil)"));
    assert_eq!(client.answer(asked), "(:ok \"=> :LATE\")");
    let form = "(spawn (:name 'other :daemon t) (unwind-protect (stumble 2) (push :abort *cleaned*)))";
    client.ask(&format!("(swank:interactive-eval \"{form}\")"));
    let debug = client.wait("(:debug ");
    let thread = debug.split(' ').next().expect("it has a task").to_string();
    client.ask("(swank:interactive-eval \"(abort-task (find 'other (list-tasks) :key #'task-name))\")");
    assert_eq!(client.wait("(:debug-return "), format!("{thread} 1 nil)"));
    client.wait_for_end_of("other");
    assert_eq!(client.ask("(swank:interactive-eval \"*cleaned*\")"), "(:ok \"=> (:ABORT :LIMIT)\")");
    drop(client);
    assert_eq!(run.finish().output, "6\n");
}

/// Whether Emacs with SLIME is there.
fn has_emacs() -> bool {
    let mut emacs = Command::new("emacs");
    emacs.args([
        "--batch",
        "--eval",
        "(progn (require 'slime) (kill-emacs (if (locate-library \"slime-repl\") 0 1)))",
    ]);
    emacs.output().is_ok_and(|output| output.status.success())
}

#[test]
fn emacs_drives_a_session() {
    if !has_emacs() {
        return;
    }
    let folder = Folder::new("slime_emacs");
    folder.file(".slime-secret", format!("{SECRET}\n"));
    let (run, address) = start(&folder);
    let port = address.rsplit(':').next().unwrap_or_default();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/commands/slime.el");
    let mut emacs = Command::new("emacs");
    emacs.args(["--batch", "-l", script]).env("HOME", folder.join("")).env("ESL_PORT", port);
    // It waits for many things, each of which may take its time.
    let finished = process::finish_within(process::start(&mut emacs), 5 * PATIENCE);
    assert_eq!(finished.status, Some(0), "{}{}", finished.output, finished.errors);
    assert!(finished.output.ends_with("done\n"), "{}{}", finished.output, finished.errors);
    assert_eq!(run.finish().output, "(:FROM-EMACS 2)\n");
}
