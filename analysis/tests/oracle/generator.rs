//! Random programs that fail: small ones, of the forms of the language that have to do with failures.
//!
//! Handling forms and their clauses begin lines of their own, with a mark by which rows of a table are found.
//! `(seen ID form)` stands around the bodies of functions and of handling forms, `(took ID form…)` and
//! `(caught ID form…)` around those of clauses: macros that do nothing, or note the failures that come by.
//!
//! Guarantees: a number yields the same program on every machine.

use std::fmt::Write;

/// Depth to which forms are nested.
const DEPTH: u32 = 3;

/// A program under construction.
pub(super) struct Generator {
    state: u64,
    /// Number of the next mark, name or task.
    next: u32,
    /// Number of functions that may be called: those that are defined before.
    callable: u32,
    /// Mocks that may be called.
    mocks: u32,
    /// Blocks and tags of `catch` around the place.
    blocks: Vec<String>,
    tags: Vec<String>,
    /// Local functions.
    locals: Vec<String>,
    /// Tasks of the nets around the place.
    tasks: Vec<String>,
    /// Whether the place is in a clause of recovery.
    in_clause: bool,
    /// Restarts around the place.
    restarts: Vec<String>,
}

/// Names of the causes that programs define.
const CAUSES: [&str; 6] = [":c0", ":c1", ":c2", ":c3", ":c4", ":c5"];

/// Causes of clauses, beside those.
const OTHER_CAUSES: [&str; 12] = [
    ":general-failure",
    ":general-failure",
    ":error",
    ":k0",
    ":k1",
    ":type-error",
    ":division-by-zero",
    ":timeout",
    ":all-failed",
    ":budget-exhausted",
    ":condition-not-achieved",
    ":simple-error",
];

/// Types of conditions.
const TYPES: [&str; 12] = [
    "failure",
    "failure",
    "error",
    "serious-condition",
    "k0",
    "k1",
    "type-error",
    "arithmetic-error",
    "(or k0 failure)",
    "condition",
    "program-error",
    "(and error (not k0))",
];

/// Forms without failures.
const HARMLESS: [&str; 8] =
    ["1", "nil", "'a", "(random 3)", "(sleep 0.5)", "(sleep 1)", "*level*", "(incf *level*)"];

/// Programming errors.
const MISTAKES: [&str; 14] = [
    "(car (random 3))",
    "(/ 1 (random 1))",
    "(funcall (nth (random 1) '(undefined-function-1)))",
    "(symbol-value (nth (random 1) '(no-variable)))",
    "(aref (vector 1 2) (+ 3 (random 2)))",
    "(throw (list 1) 2)",
    "(funcall (lambda (x) x))",
    "(parse-integer \"x\")",
    "(read-from-string \"(\")",
    "(check-type *level* string)",
    "(ecase *level* (100 2))",
    "(part-act (random 3))",
    "(+ 1 (elt '(a b) (random 2)))",
    "(nth-value 0 (make-part :level))",
];

impl Generator {
    fn new(number: u64) -> Generator {
        Generator {
            state: number.wrapping_mul(0x2545_F491_4F6C_DD1D),
            next: 0,
            callable: 0,
            mocks: 0,
            blocks: Vec::new(),
            tags: Vec::new(),
            locals: Vec::new(),
            tasks: Vec::new(),
            in_clause: false,
            restarts: Vec::new(),
        }
    }

    /// Returns a random number below `limit`, by the generator SplitMix64.
    fn random(&mut self, limit: usize) -> usize {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % limit.max(1) as u64) as usize
    }

    fn choose<'a>(&mut self, all: &[&'a str]) -> &'a str {
        all[self.random(all.len())]
    }

    fn mark(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    fn cause(&mut self) -> &'static str {
        self.choose(&CAUSES)
    }

    /// Returns a form that may fail and has no forms inside.
    fn failing(&mut self) -> String {
        let cause = self.cause();
        match self.random(21) {
            0..=6 => format!("(when (zerop (random 2)) (fail {cause}))"),
            7 => format!("(fail {cause} 1 'two)"),
            8 => format!("(fail (if (zerop (random 2)) {cause} {}))", self.cause()),
            9 => format!("(let ((cause {cause})) (fail cause))"),
            10 => format!("(apply #'fail {cause} '(1))"),
            11 => format!("(funcall 'fail {cause})"),
            12 => "(error 'k0)".into(),
            13 => "(error 'k1 :level 2)".into(),
            14 => "(when (zerop (random 2)) (error \"wrong ~a\" 1))".into(),
            15 => "(error (make-condition 'k0))".into(),
            16 => "(fail (make-condition 'k1 :level 1))".into(),
            17 => format!("(fail (nth (random 2) '({cause} {})))", self.cause()),
            18 => format!("(mapc (lambda (cause) (when (zerop (random 2)) (fail cause))) '({cause}))"),
            _ => self.choose(&MISTAKES).into(),
        }
    }

    /// Returns a form without failures.
    fn harmless(&mut self) -> String {
        self.choose(&HARMLESS).into()
    }

    /// Returns the name of a function that may be called.
    fn function(&mut self) -> String {
        match self.callable {
            0 => "harmless".into(),
            count => format!("f{}", self.random(count as usize)),
        }
    }

    /// Returns a form that leaves for an outer place, if there is one.
    fn leaving(&mut self) -> Option<String> {
        let mut all = Vec::new();
        all.extend(self.blocks.iter().map(|name| format!("(return-from {name} 3)")));
        all.extend(self.tags.iter().map(|name| format!("(throw '{name} 4)")));
        all.extend(self.restarts.iter().map(|name| format!("(invoke-restart '{name})")));
        if self.in_clause {
            all.extend(["(retry)".into(), "(abort 5)".into()]);
        }
        let place = self.random(all.len());
        all.into_iter().nth(place)
    }

    /// Returns a form that calls a function in one of the ways in which one can.
    fn call(&mut self, depth: u32) -> String {
        let name = self.function();
        let number = self.random(3);
        match self.random(26) {
            0..=4 => format!("({name})"),
            5 => format!("(funcall #'{name})"),
            6 => format!("(funcall '{name})"),
            7 => format!("(apply '{name} nil)"),
            8 => format!("(call-it #'{name})"),
            9 => format!("(call-it (lambda () {}))", self.form(depth)),
            10 => format!("(funcall *h{number}*)"),
            11 => format!("(let ((*h{number}* #'{name})) (call-h{number}))"),
            12 => format!("(call-h{number})"),
            13 => format!("(progn (setq *h{number}* (lambda () {})) (call-h{number}))", self.free(depth)),
            14 => format!("(funcall (part-act (make-part :act #'{name})))"),
            15 => format!("(progn (setf (gethash 1 *table*) #'{name}) (funcall (gethash 1 *table*)))"),
            16 => format!("(act {})", self.choose(&["1", "\"x\"", "'s", "2.5"])),
            17 => format!("(dolist (one (list #'{name} #'{})) (funcall one))", self.function()),
            18 => format!("(mapcar (lambda (x) (if (oddp x) {} x)) '(1 2))", self.form(depth)),
            19 => format!("(funcall (first (list #'{name} #'{})))", self.function()),
            20 => format!("(some #'funcall (list #'harmless #'{name}))"),
            21 => format!("(funcall (maker #'{name}))"),
            22 => format!("(reduce (lambda (a b) {} (+ a b)) '(1 2 3))", self.form(depth)),
            23 => format!("(progn (push #'{name} *all*) (call-all))"),
            24 => format!("(sort (list 2 1) (lambda (a b) {} (< a b)))", self.form(depth)),
            _ => match self.locals.last() {
                Some(local) => format!("({local})"),
                None => format!("(apply #'call-it (list #'{name}))"),
            },
        }
    }

    /// Returns a form of code that runs elsewhere: it cannot leave for places around it.
    fn free(&mut self, depth: u32) -> String {
        let blocks = std::mem::take(&mut self.blocks);
        let tags = std::mem::take(&mut self.tags);
        let restarts = std::mem::take(&mut self.restarts);
        let in_clause = std::mem::take(&mut self.in_clause);
        let form = self.form(depth);
        (self.blocks, self.tags, self.restarts, self.in_clause) = (blocks, tags, restarts, in_clause);
        form
    }

    /// Returns a random form.
    fn form(&mut self, depth: u32) -> String {
        if depth == 0 {
            return match self.random(8) {
                0..=3 => self.failing(),
                4 | 5 => self.harmless(),
                6 => self.leaving().unwrap_or_else(|| format!("({})", self.function())),
                _ => format!("({})", self.function()),
            };
        }
        let depth = depth - 1;
        match self.random(64) {
            0..=4 => self.failing(),
            5..=11 => self.call(depth),
            12 => self.leaving().unwrap_or_else(|| self.failing()),
            13 | 14 => format!("(if (zerop (random 2)) {} {})", self.form(depth), self.form(depth)),
            15 | 16 => format!("(progn {} {})", self.form(depth), self.form(depth)),
            17 => format!("(list {} {})", self.form(depth), self.form(depth)),
            18 => format!("(dotimes (i 2) {})", self.form(depth)),
            19..=27 => self.recovery(depth),
            28..=30 => self.cases(depth),
            31 | 32 => self.handlers(depth),
            33 | 34 => {
                let mark = self.mark();
                format!("\n#|{mark}|#(ignore-errors (seen {mark} {}))", self.form(depth))
            }
            35 => format!("(unwind-protect {} {})", self.form(depth), self.form(depth)),
            36 | 37 => format!("(with-cleanup-procedure {} {})", self.form(depth), self.form(depth)),
            38 => self.block(depth),
            39 => self.catch(depth),
            40 => self.restart(depth),
            41 => self.local(depth),
            42 => format!("(achieve (g{}-p))", self.random(3)),
            43..=50 => self.tasks(depth),
            51 => {
                let guard = self.free(depth.min(1));
                let alarm = self.choose(&["(fail :alarm)", "nil", "(if (zerop (random 2)) (fail :alarm) 1)"]);
                format!(
                    "(with-guardian (progn {guard} (sleep {})) {alarm} {})",
                    self.random(2),
                    self.form(depth)
                )
            }
            52 => format!("(with-timeout {} {})", self.random(3), self.form(depth)),
            53 => format!("(with-budget {} {})", 200 + self.random(3000), self.form(depth)),
            54 => format!("(with-quota (:tasks {}) {})", self.random(4), self.form(depth)),
            55 => "(wait-for-event *event* :timeout 1)".into(),
            56 => format!("(progn (wait-until (> *fluent* 3) :timeout 1) {})", self.form(depth)),
            57 => format!("(with-resource (arm :if-denied :fail) {})", self.form(depth)),
            58 => format!("(with-resource (arm :timeout 1) {})", self.form(depth)),
            59 => format!("(with-maintained-property (power 'arm :on) {})", self.form(depth)),
            60 => format!("(with-query-bindings '(known ?x) {} (next-bindings))", self.form(depth)),
            61 if self.mocks > 0 => {
                let mock = self.random(self.mocks as usize);
                let forms = [
                    format!("(m{mock} 1)"),
                    format!("(operation-result (start (m{mock} 2)))"),
                    format!("(let ((handle (start (m{mock} 2)))) (cancel handle) (operation-result handle))"),
                ];
                forms[self.random(3)].clone()
            }
            62 => format!("(without-interrupts {})", self.form(depth.min(1))),
            _ => self.harmless(),
        }
    }

    fn recovery(&mut self, depth: u32) -> String {
        let mark = self.mark();
        let mut text = format!("\n#|{mark}|#(with-recovery-procedures (");
        for _ in 0..=self.random(2) {
            let clause = self.mark();
            let cause = if self.random(3) == 0 { self.choose(&OTHER_CAUSES) } else { self.cause() };
            let head = match self.random(3) {
                0 => format!("({cause} &rest arguments)"),
                1 => format!("({cause} &optional one)"),
                _ => cause.to_string(),
            };
            let limit = self.choose(&["", "", "", ":retries 2", ":retries (random 3)", ":retries :infinite"]);
            let outer = std::mem::replace(&mut self.in_clause, true);
            let ending = match self.random(if limit.contains("inf") { 4 } else { 9 }) {
                0 => "(abort 6)".into(),
                1 => "(if (zerop (random 2)) (abort 7) (retry))".into(),
                2 => "(values 8)".into(),
                3 => format!("(abort {})", self.form(depth.min(1))),
                4 | 5 => "(retry)".into(),
                6 => format!("(fail {})", self.cause()),
                _ => self.form(depth.min(1)),
            };
            let before = if self.random(4) == 0 { self.form(depth.min(1)) } else { String::new() };
            self.in_clause = outer;
            _ = write!(text, "\n#|{clause}|#({head} {limit} (took {clause} {before} {ending}))");
        }
        let outer = std::mem::take(&mut self.in_clause);
        let body = self.form(depth);
        self.in_clause = outer;
        _ = write!(text, ")\n (seen {mark} {body}))");
        text
    }

    fn cases(&mut self, depth: u32) -> String {
        let mark = self.mark();
        let mut text = format!("\n#|{mark}|#(handler-case (seen {mark} {})", self.form(depth));
        for _ in 0..=self.random(2) {
            let clause = self.mark();
            let wanted = self.choose(&TYPES);
            let body = match self.random(7) {
                0 | 1 => "9".into(),
                2 => "(error c)".into(),
                3 => "(fail (failure-cause c))".into(),
                4 => "(fail c)".into(),
                _ => self.form(depth.min(1)),
            };
            _ = write!(text, "\n#|{clause}|#({wanted} (c) (caught {clause} {body}))");
        }
        text.push(')');
        text
    }

    fn handlers(&mut self, depth: u32) -> String {
        let (mark, block) = (self.mark(), self.mark());
        let wanted = self.choose(&TYPES);
        let name = format!("b{block}");
        self.blocks.push(name.clone());
        let body = match self.random(6) {
            0 => "c".into(),
            1 => format!("(return-from {name} 1)"),
            2 => "(fail (failure-cause c))".into(),
            3 => "(error c)".into(),
            _ => self.leaving().unwrap_or_else(|| self.form(depth.min(1))),
        };
        let inside = self.form(depth);
        self.blocks.pop();
        format!(
            "(block {name} \n#|{mark}|#(handler-bind (({wanted} (lambda (c) {body}))) (seen {mark} {inside})))"
        )
    }

    fn block(&mut self, depth: u32) -> String {
        let name = format!("b{}", self.mark());
        self.blocks.push(name.clone());
        let form = self.form(depth);
        self.blocks.pop();
        format!("(block {name} {form})")
    }

    fn catch(&mut self, depth: u32) -> String {
        let name = format!("t{}", self.mark());
        self.tags.push(name.clone());
        let form = self.form(depth);
        self.tags.pop();
        format!("(catch '{name} {form})")
    }

    fn restart(&mut self, depth: u32) -> String {
        let name = format!("r{}", self.mark());
        self.restarts.push(name.clone());
        let form = self.form(depth);
        self.restarts.pop();
        format!("(restart-case {form} ({name} () {}))", self.form(depth.min(1)))
    }

    fn local(&mut self, depth: u32) -> String {
        let name = format!("l{}", self.mark());
        let function = self.form(depth);
        self.locals.push(name.clone());
        let body = self.form(depth);
        self.locals.pop();
        format!("(flet (({name} () {function})) {body} ({name}))")
    }

    /// Returns a form with tasks.
    fn tasks(&mut self, depth: u32) -> String {
        let names: Vec<String> = (0..=self.random(2)).map(|_| format!("part-{}", self.mark())).collect();
        let form = self.random(10);
        self.tasks.extend(names.clone());
        let mut bodies = String::new();
        for name in &names {
            let other = if self.tasks.len() > 1 && self.random(8) == 0 && form < 6 {
                format!("(abort-task {})", names[0])
            } else {
                String::new()
            };
            _ = write!(bodies, "\n({name} {other} (seen {name} {}))", self.free(depth));
        }
        self.tasks.truncate(self.tasks.len() - names.len());
        match form {
            0 | 1 => format!("(task-net {bodies})"),
            2 => format!("(task-net :allow-failures {bodies})"),
            3 => format!("(or-parallel {bodies})"),
            4 => format!("(try-in-order {bodies})"),
            5 => format!("(pursue {bodies})"),
            6 => format!("(partial-order ({bodies}))"),
            7 => format!("(supervise (:restarts {} :within 60) {bodies})", self.random(2)),
            _ => {
                let name = format!("task-{}", self.mark());
                let spawn = format!("(spawn (:name \"{name}\") (seen {name} {}))", self.free(depth));
                if form == 8 { format!("(wait-for-task {spawn})") } else { spawn }
            }
        }
    }

    fn program(&mut self) -> String {
        let mut text = String::from(
            "(define-cause :c0 ()) (define-cause :c1 (:c0)) (define-cause :c2 ()) (define-cause :c3 (:c2 :c0))
(define-cause :c4 (:c3)) (define-cause :c5 ()) (define-cause :alarm ())
(define-condition k0 (error) ()) (define-condition k1 (k0) ((level :initarg :level)))
(defstruct part act level)
(defvar *table* (make-hash-table)) (defvar *all* nil) (defvar *level* 0) (defvar *event* (make-event 'event))
(define-fluent *fluent* 1) (define-resource arm) (assert '(known 1)) (define-property power (device))
(defun harmless () 0)
(defun call-it (function) (funcall function))
(defun maker (function) (lambda () (funcall function)))
(defun call-all () (dolist (one *all*) (funcall one)))
(defvar *h0* #'harmless) (defvar *h1* #'harmless) (defvar *h2* #'harmless)
(defun call-h0 () (funcall *h0*)) (defun call-h1 () (funcall *h1*)) (defun call-h2 () (funcall *h2*))
(defgeneric act (x))
",
        );
        let depth = DEPTH;
        for goal in 0..3 {
            _ = writeln!(text, "(defvar *g{goal}* nil) (defun g{goal}-p () *g{goal}*)");
            let done = self.choose(&["(setq *g9* t)", "", "(setq *g9* (zerop (random 2)))"]);
            let done = done.replace("*g9*", &format!("*g{goal}*"));
            let test = self.choose(&["t", "(zerop (random 2))", "(> *level* 1)"]);
            let body = self.form(1);
            _ = writeln!(text, "(to-achieve (g{goal}-p) ({test} {body} {done}) (*level* {}))", self.form(0));
        }
        _ = writeln!(
            text,
            "(to-achieve (power device state)\n({} {}",
            self.choose(&["t", "*level*"]),
            self.form(1)
        );
        text.push_str("(assert (list 'power device state))))\n");
        for class in ["integer", "string", "symbol"] {
            _ = writeln!(text, "(defmethod act ((x {class})) {})", self.form(1));
        }
        for mock in 0..2 {
            _ = writeln!(text, "(define-mock m{mock} (x) {})", self.form(1));
            self.mocks += 1;
        }
        for function in 0..4 + self.random(3) {
            self.callable = function as u32;
            let form = self.form(depth);
            _ = writeln!(text, "(defun f{function} ()\n (seen f{function} {form}))");
        }
        self.callable += 1;
        let count = self.callable;
        for function in 0..count {
            // All functions are tried; most in tasks of their own.
            match self.random(3) {
                0 => _ = writeln!(text, "(handler-case (f{function}) (serious-condition () 1))"),
                _ => {
                    let name = format!("top-{function}");
                    let body = format!("(seen {name} (f{function}))");
                    _ = writeln!(text, "(wait-for-task (spawn (:name \"{name}\") {body}))");
                }
            }
        }
        for _ in 0..2 {
            let name = format!("last-{}", self.mark());
            let form = self.form(depth);
            _ = writeln!(text, "(wait-for-task (spawn (:name \"{name}\") (seen {name} {form})))");
        }
        _ = writeln!(text, "(seen main {})", self.form(depth));
        text
    }
}

/// Returns the program with a number.
pub(super) fn program(number: u64) -> String {
    Generator::new(number).program()
}
