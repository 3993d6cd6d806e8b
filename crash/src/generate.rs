//! Small durable programs, whose last facts and lines do not depend on when their processes are killed.

use std::fmt::Write;

/// A generator of numbers: Steele, Lea and Flood's SplitMix64.
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number below `limit`.
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

/// The functions that all programs have: an action that is performed once by asking the device, an action whose
/// outcome may stay unknown, and a reading.
const PRELUDE: &str = r#"(require :http)
(define-input *resumed*)
(defvar *device* "http://127.0.0.1:PORT/")
(defvar *baton* (make-event 'baton))
(defun url (kind name) (format nil "~a~a/~a" *device* kind name))
;; A line is written in one piece, so that tasks do not mix theirs.
(defun say (control &rest arguments) (princ (format nil "~?~%" control arguments)))
(defun ask (name)
  (with-recovery-procedures (((:interrupted-by-restart) :retries :infinite (retry)))
    (http:get (url "asked" name))))
(defun act (name)
  (with-recovery-procedures
      ((:interrupted-by-restart :retries :infinite
         (say "unknown ~a" name)
         (if (string= (ask name) "yes") (abort "performed") (retry))))
    (http:post (url "act" name))))
(defun act-or-note (name)
  (with-recovery-procedures
      ((:interrupted-by-restart :retries :infinite
         (say "unknown ~a" name)
         (abort :unknown)))
    (http:post (url "act" name))))
(defun reading (name)
  (with-recovery-procedures (((:interrupted-by-restart) :retries :infinite (retry)))
    (http:get (url "read" name))))
(spawn (:name 'watcher :daemon t)
  (loop (multiple-value-bind (downtime lives) (wait-for-event *resumed*)
          (say "resumed ~a ~a" lives (>= downtime 0)))))
"#;

/// Returns a program, for a device at this port.
pub(crate) fn generate(seed: u64, port: u16) -> String {
    let mut chance = Chance(seed);
    let mut text = PRELUDE.replace("PORT", &port.to_string());
    let tasks = 1 + chance.below(3);
    let mut body = String::new();
    for task in 0..tasks {
        let steps = 2 + chance.below(4);
        // A write to a text cannot fail.
        _ = writeln!(body, "  (task-{task}");
        for step in 0..steps {
            let name = format!("{task}-{step}");
            let form = match chance.below(8) {
                0 => format!("(assert (list 'read '{name} (reading \"{name}\")))"),
                1 => {
                    format!("(progn (sleep {}) (assert '(slept {name} t)))", chance.below(20) as f64 / 1000.0)
                }
                2 => format!(
                    "(let ((tries 0)) (with-recovery-procedures ((:flaky :retries 3 (retry))) \
                     (incf tries) (when (< tries 3) (fail :flaky)) (assert (list 'tried '{name} tries))))"
                ),
                3 => format!(
                    "(progn (dotimes (i {}) (signal *baton*)) (assert '(signalled {name} t)))",
                    chance.below(3000)
                ),
                4 => format!(
                    "(assert (list 'noted '{name} (if (eq (act-or-note \"{name}\") :unknown) 'unknown 'done)))"
                ),
                _ => format!("(assert (list 'acted '{name} (act \"{name}\")))"),
            };
            _ = writeln!(body, "    {form}\n    (say \"step {name}\")");
        }
        body.push_str("    )\n");
    }
    _ = writeln!(text, "(task-net\n{body})");
    text.push_str(
        "(dolist (kind '(read slept tried signalled noted acted))
  (dolist (line (sort (mapcar #'princ-to-string
                              (db-query (list kind '?name '?value)))
                      #'string<))
    (say \"fact ~a\" line)))
(say \"over\")
",
    );
    text
}
