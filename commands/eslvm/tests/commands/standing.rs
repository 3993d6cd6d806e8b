//! Commands of an attached operator on tasks: watching values, suspending, resuming and ending tasks.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin};
use std::sync::mpsc::{Receiver, channel};

use esl_conformance::folder::Folder;
use esl_conformance::process::{self, PATIENCE, start};

use crate::eslvm;
use crate::operate::Operated;

/// A program in which one task counts as fast as it is let, and another waits for news.
const PROGRAM: &str = "
(define-property mode ())
(define-input news :capacity 2)
(define-fluent level 10)
(defvar *n* 0)
(defun count-up (step) (loop (incf *n* step) (sleep 0.001)))
(assert '(mode calm))
(spawn (:name 'counter :daemon t) (count-up 1))
(spawn (:name 'waiter :daemon t) (loop (assert (list 'mode (wait-for-event news)))))
(read-line *standard-input* nil)
(format t \"~s~%\" (mode))";

/// A session that is typed to while it is read.
struct Operator {
    child: Child,
    to: ChildStdin,
    lines: Receiver<String>,
}

impl Operator {
    fn attach(place: &str) -> Operator {
        let mut child = start(&mut eslvm(&["attach", place]));
        let to = child.stdin.take().expect("it is a pipe");
        let from = BufReader::new(child.stdout.take().expect("it is a pipe"));
        let (tell, lines) = channel();
        std::thread::spawn(move || from.lines().map_while(Result::ok).try_for_each(|line| tell.send(line)));
        Operator { child, to, lines }
    }

    fn types(&mut self, line: &str) {
        writeln!(self.to, "{line}").expect("it reads");
    }

    fn hears(&mut self) -> String {
        self.lines.recv_timeout(PATIENCE).expect("the session says something")
    }

    fn hears_of(&mut self, what: &str) -> String {
        loop {
            let line = self.hears();
            if line.contains(what) {
                return line;
            }
        }
    }

    fn leaves(mut self) -> Option<i32> {
        drop(self.to);
        self.child.wait().expect("it ends").code()
    }
}

#[test]
fn a_watched_form_is_told_of_after_each_change() {
    let folder = Folder::new("standing_watch");
    let (run, socket) = Operated::listening(&folder, PROGRAM, &[]);
    let mut operator = Operator::attach(&socket);
    operator.types(":watch (list (mode) (< level 5))");
    assert_eq!(operator.hears(), "; (LIST (MODE) (< LEVEL 5)) is (CALM NIL)");
    // The same value is not told again; a session that has left does not keep others from changing it.
    let (said, status) = {
        let run = process::run(&mut eslvm(&["attach", &socket]), "(setf level 9)\n(setf level 2)\n");
        (run.output, run.status)
    };
    assert_eq!((&*said, status), ("9\n2\n", Some(0)));
    assert_eq!(operator.hears(), "; (LIST (MODE) (< LEVEL 5)) is (CALM T)");
    operator.types(":signal news 7");
    operator.hears_of("is (7 T)");
    assert_eq!(operator.leaves(), Some(0));
    assert_eq!(run.finish().output, "7\n");
}

#[test]
fn tasks_stand_still_go_on_and_end() {
    let folder = Folder::new("standing_tasks");
    let (run, socket) = Operated::listening(&folder, PROGRAM, &[]);
    let mut operator = Operator::attach(&socket);
    operator.types("(esl::%task-number (find 'counter (list-tasks) :key #'task-name))");
    let number = operator.hears();
    // It stands, with the variables of its functions to be seen, and others go on.
    operator.types(&format!(":suspend {number}"));
    operator.types("(progn (setq *n* 0) (sleep 0.05) *n*)");
    assert_eq!(operator.hears_of("0"), "0");
    operator.types(":tasks");
    let row = operator.hears_of("COUNTER");
    assert!(row.contains("suspended"), "{row}");
    operator.types(&format!(":bt {number}"));
    operator.hears_of("in COUNT-UP, ");
    assert_eq!(operator.hears().trim(), "STEP = 1");
    operator.types(&format!(":resume {number}"));
    operator.types("(progn (loop while (zerop *n*) do (sleep 0.001)) :counts)");
    operator.hears_of(":COUNTS");
    // All tasks of the program stand still, and so do evaluations; surveys are answered.
    operator.types(":pause");
    operator.types(":facts mode");
    operator.hears_of("(MODE CALM)");
    operator.types(":continue");
    operator.types(&format!(":abort {number}"));
    operator
        .types("(progn (loop while (find 'counter (list-tasks) :key #'task-name) do (sleep 0.001)) :ended)");
    operator.hears_of(":ENDED");
    operator.types(&format!(":bt {number}"));
    operator.hears_of(&format!("task {number} does not exist"));
    assert_eq!(operator.leaves(), Some(0));
    assert_eq!(run.finish().output, "CALM\n");
}

#[test]
fn many_facts_are_shown_by_pages() {
    let folder = Folder::new("standing_facts");
    let program =
        "(dotimes (i 1203) (assert (list 'seen i))) (assert '(mode calm)) (read-line *standard-input* nil)";
    let (run, socket) = Operated::listening(&folder, program, &[]);
    for (command, lines, last) in [
        (":facts seen", 501, "; 1 to 500 of 1203; `:facts NAME 500` shows those after these"),
        (":facts seen 1000", 203, "(SEEN 1202)"),
        (":facts seen 2000", 1, "There are none."),
        (":facts", 501, "; 1 to 500 of 1204; `:facts NAME 500` shows those after these"),
        (":facts mode", 1, "(MODE CALM)"),
        (":data", 2, "relation SEEN/1: 1203 facts"),
        // A mistake in a command is reported in the words of that command.
        (":bt two", 1, "; `:bt` needs the number of a task, which `:tasks` shows, or `full`, or nothing"),
        (":resume", 1, "; `:resume` needs the number of a task, which `:tasks` shows"),
        (":suspend 99", 1, "; task 99 does not exist"),
        (":watch", 1, "; `:watch` needs a form"),
        (":patch", 1, "; `:patch` needs the path of a file"),
    ] {
        let said = process::run(&mut eslvm(&["attach", &socket]), format!("{command}\n")).output;
        let said: Vec<&str> = said.lines().collect();
        assert_eq!((said.len(), said.last().copied()), (lines, Some(last)), "{command}");
    }
    assert_eq!(run.end(), Some(0));
}

/// A failure that a recovery procedure recovers from at once has arguments, too; one of the session is shown
/// with all calls of the library on request.
#[test]
fn failures_are_shown_with_their_arguments_and_calls() {
    let folder = Folder::new("standing_failures");
    let socket = folder.join("s");
    let program = "(defun probe (list) (mapcar (lambda (x) (fail :broken x \"deep\")) list))
(print (with-recovery-procedures ((:broken (abort 'recovered))) (probe '(1 2))))
(format *error-output* \"recovered~%\")
(read-line *standard-input* nil)";
    let mut run = Operated::start(&folder, program, &["--listen", &socket]);
    run.said("; operators attach with eslvm attach ");
    run.said("recovered");
    let typed = ":failures\n:bt full\n(probe (list 3))\n:bt full\n(car 5)\n:bt full\n";
    let said = process::run(&mut eslvm(&["attach", &socket]), typed).output;
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines[0].contains(" the main task :BROKEN 1, \"deep\", "), "{said}");
    assert_eq!(lines[1], "Nothing has failed here; `:failures` shows the failures of the run.");
    let report = lines.iter().position(|line| *line == "A failure of cause :BROKEN with 3, \"deep\".");
    let report = &lines[report.expect("it is shown")..];
    assert!(report[1].starts_with("  in (LAMBDA), "), "{said}");
    assert!(report[2].starts_with("  in MAPCAR, stdlib/lists.esl:"), "{said}");
    assert!(report.iter().any(|line| line.starts_with("  in ESL::%CALL-IN-SESSION, stdlib/")), "{said}");
    let last = lines.iter().rposition(|line| *line == "The value 5 is not of type LIST.");
    assert_eq!(lines[last.expect("it is shown") + 1], "  in top level", "{said}");
    assert_eq!(run.end(), Some(0));
}
