//! The table of diagnostic codes: each with its severity, its meaning, a failing program and the same program
//! repaired.
//!
//! Each row defines a constant. Every diagnostic is made by [`DiagnosticCode::at`] of such a constant, so no
//! code is reported that the table lacks; a test in `tests/diagnostics/table.rs` looks through the sources
//! for other ways. `docs/diagnostics.md` is generated from the table. To add a code, add a row, run
//! `ESL_BLESS=1 cargo test -p esl-compiler --test diagnostics`, and look at the difference.
//!
//! The programs are complete files. They are empty if no short program shows the fault.

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;

/// A kind of diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnosticCode {
    /// The code itself, such as `unclosed-list`. Programs and tools look for codes, so they are not renamed.
    pub name: &'static str,
    /// Error or warning.
    pub severity: Severity,
    /// Part of the compiler that reports it.
    pub stage: Stage,
    /// Meaning, in one line.
    pub summary: &'static str,
    /// A program that has the fault; empty if no short one does.
    pub failing: &'static str,
    /// The same program without the fault.
    pub repaired: &'static str,
}

impl DiagnosticCode {
    /// Returns a diagnostic of this code at `span`.
    pub fn at(&self, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(self.name, self.severity, message, span)
    }
}

/// A part of the compiler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Text to data.
    Reader,
    /// Data to the core language: macros, special forms, names.
    Expander,
    /// The core language to code.
    Lowering,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Stage; 3] = [Stage::Reader, Stage::Expander, Stage::Lowering];

    /// Returns the heading for diagnostics of the stage.
    pub fn title(self) -> &'static str {
        match self {
            Stage::Reader => "Reading the text",
            Stage::Expander => "Checking forms and names",
            Stage::Lowering => "Making code",
        }
    }
}

/// Codes of the warnings of analyses, which the compiler only lets forms allow.
pub const OF_ANALYSES: [&str; 5] =
    ["clause-never-applies", "declared-never", "endless-retry", "resource-order", "wrong-type"];

/// Returns the code called `name`.
pub fn find(name: &str) -> Option<&'static DiagnosticCode> {
    ALL.iter().copied().find(|code| code.name == name)
}

macro_rules! codes {
    ($($stage:ident { $($constant:ident = $name:literal $severity:ident
        #[doc = $summary:literal] fails: $failing:literal repaired: $repaired:literal)* })*) => {
        $($(
            #[doc = $summary]
            pub const $constant: &DiagnosticCode = &DiagnosticCode {
                name: $name,
                severity: Severity::$severity,
                stage: Stage::$stage,
                summary: $summary.trim_ascii(),
                failing: $failing,
                repaired: $repaired,
            };
        )*)*

        /// All codes, in the order of the table.
        pub const ALL: &[&DiagnosticCode] = &[$($($constant),*),*];
    };
}

codes! {
Reader {

INVALID_UTF_8 = "invalid-utf-8" Error
    /// The file is not text in UTF-8.
    fails: ""
    repaired: ""

SOURCE_TOO_LARGE = "source-too-large" Error
    /// The file is 4 GiB or larger.
    fails: ""
    repaired: ""

TOO_MANY_ERRORS = "too-many-errors" Error
    /// So many errors were found in one file that the rest of it was not read.
    fails: ""
    repaired: ""

UNCLOSED_LIST = "unclosed-list" Error
    /// The text ends within a list, vector or array.
    fails: "(defun area (width height)\n  (* width height)\n\n(print (area 3 4))\n"
    repaired: "(defun area (width height)\n  (* width height))\n\n(print (area 3 4))\n"

UNEXPECTED_CLOSE = "unexpected-close" Error
    /// A `)` closes nothing.
    fails: "(print (+ 1 2)))\n"
    repaired: "(print (+ 1 2))\n"

UNCLOSED_STRING = "unclosed-string" Error
    /// The text ends within a string.
    fails: "(print \"hello)\n"
    repaired: "(print \"hello\")\n"

UNCLOSED_COMMENT = "unclosed-comment" Error
    /// The text ends within a comment that began with `#|`. Such comments nest: each `#|` needs its own `|#`.
    fails: "#| first #| second |#\n(print 1)\n"
    repaired: "#| first #| second |# |#\n(print 1)\n"

UNCLOSED_BAR = "unclosed-bar" Error
    /// The text ends within a name that is written between bars.
    fails: "(print '|hello)\n"
    repaired: "(print '|hello|)\n"

UNFINISHED_DATUM = "unfinished-datum" Error
    /// The text ends after a mark such as `'`, which needs something to stand before.
    fails: "(print 1)\n'\n"
    repaired: "(print 1)\n'a\n"

UNFINISHED_ESCAPE = "unfinished-escape" Error
    /// The text ends after `\` or `#\`, which take the next character.
    fails: "(print 1)\n#\\"
    repaired: "(print 1)\n#\\a"

INVALID_TOKEN = "invalid-token" Error
    /// Characters that form neither a number nor a name nor anything else that can be read.
    fails: "(print #b102)\n"
    repaired: "(print #b101)\n"

INVALID_CHARACTER = "invalid-character" Error
    /// A control character, an unusual blank or an invisible mark outside of strings, comments and bars.
    fails: "(print\u{a0}1)\n"
    repaired: "(print 1)\n"

INVALID_CHARACTER_NAME = "invalid-character-name" Error
    /// `#\` before an unknown name of a character.
    fails: "(print #\\Blank)\n"
    repaired: "(print #\\Space)\n"

TOKEN_TOO_LONG = "token-too-long" Error
    /// A name of more than 65,536 bytes, or a number with too many digits.
    fails: ""
    repaired: ""

FLOAT_OUT_OF_RANGE = "float-out-of-range" Error
    /// A float that is too large for a double.
    fails: "(print 1e400)\n"
    repaired: "(print 1e300)\n"

DOTTED_LIST = "dotted-list" Error
    /// A dot that does not stand before the last element of a list.
    fails: "(print '(1 . 2 3))\n"
    repaired: "(print '(1 2 . 3))\n"

MISSING_DATUM = "missing-datum" Error
    /// A `)` comes right after a mark such as `'`, which needs something to stand before.
    fails: "(print (list 1 '))\n"
    repaired: "(print (list 1 'a))\n"

COMMA_OUTSIDE_BACKQUOTE = "comma-outside-backquote" Error
    /// A comma without a backquote around it to which it belongs.
    fails: "(print '(1 ,(+ 1 1)))\n"
    repaired: "(print `(1 ,(+ 1 1)))\n"

MISPLACED_SPLICE = "misplaced-splice" Error
    /// `,@` outside of a list into which it could insert elements.
    fails: "(print `,@(list 1 2))\n"
    repaired: "(print `(,@(list 1 2)))\n"

NESTED_TOO_DEEPLY = "nested-too-deeply" Error
    /// Lists within lists, more than 2,000 deep.
    fails: ""
    repaired: ""

MALFORMED_LITERAL = "malformed-literal" Error
    /// A vector or array whose elements do not fit its size.
    fails: "(print #2A((1 2) (3)))\n"
    repaired: "(print #2A((1 2) (3 4)))\n"

UNKNOWN_LABEL = "unknown-label" Error
    /// `#n#` with no `#n=` before it, or `#n=` twice with the same number.
    fails: "(print '(#1=a #2#))\n"
    repaired: "(print '(#1=a #1#))\n"

CIRCULAR_LITERAL = "circular-literal" Error
    /// A label whose datum is a reference to it.
    fails: "(print '#1=#1#)\n"
    repaired: "(print '#1=(a . #1#))\n"

LITERAL_TOO_LARGE = "literal-too-large" Error
    /// A literal whose `#n#` or `#n(` stand for millions of elements.
    fails: "(print #99999999(a))\n"
    repaired: "(print (make-array 99999999 :initial-element 'a))\n"

FOREIGN_NOTATION = "foreign-notation" Error
    /// Statements, comments, texts or commas as other languages write them.
    fails: "(print 'hello')\n"
    repaired: "(print \"hello\")\n"

UNKNOWN_PACKAGE = "unknown-package" Error
    /// A prefix before `:` that is not the name of a package.
    fails: "(print (lisp:list 1 2))\n"
    repaired: "(print (cl:list 1 2))\n"

NOT_EXTERNAL = "not-external" Error
    /// `package:name` with a name that the package does not export.
    fails: "(print (cl:lst 1 2))\n"
    repaired: "(print (cl:list 1 2))\n"

}
Expander {

MALFORMED_FORM = "malformed-form" Error
    /// A special form or standard macro with unsuitable parts, where no other code tells more.
    fails: "(eval-when (:compile-time)\n  (print 1))\n"
    repaired: "(eval-when (:compile-toplevel)\n  (print 1))\n"

MISSING_PART = "missing-part" Error
    /// A special form or standard macro that ends before a part that it needs.
    fails: "(defun area)\n"
    repaired: "(defun area (width height)\n  (* width height))\n"

EXTRA_PART = "extra-part" Error
    /// A special form or standard macro with more parts than it takes.
    fails: "(defun sign (x)\n  (if (< x 0)\n      -1\n      0\n      1))\n"
    repaired: "(defun sign (x)\n  (cond ((< x 0) -1)\n        ((= x 0) 0)\n        (t 1)))\n"

NOT_A_NAME = "not-a-name" Error
    /// Something else where the name of a variable, function, block or the like is needed.
    fails: "(defun \"area\" (width height)\n  (* width height))\n"
    repaired: "(defun area (width height)\n  (* width height))\n"

NOT_AN_OPERATOR = "not-an-operator" Error
    /// A form that begins with something other than the name of an operator or a `lambda` expression.
    fails: "(defun call-first (functions)\n  ((car functions) 1))\n"
    repaired: "(defun call-first (functions)\n  (funcall (car functions) 1))\n"

DOTTED_FORM = "dotted-form" Error
    /// A form to be evaluated that ends in a dot and something.
    fails: "(print (list 1 . 2))\n"
    repaired: "(print (list 1 2))\n"

NOT_A_PLACE = "not-a-place" Error
    /// Something that cannot be set where a place is needed.
    fails: "(defun reset (counter)\n  (setf 0 counter))\n"
    repaired: "(defun reset (counter)\n  (setf counter 0))\n"

READ_ONLY_SLOT = "read-only-slot" Error
    /// An assignment to a slot that its structure declares read-only.
    fails: "(defstruct point (x 0 :read-only t))\n(setf (point-x (make-point)) 1)\n"
    repaired: "(defstruct point (x 0))\n(setf (point-x (make-point)) 1)\n"

MALFORMED_BINDING = "malformed-binding" Error
    /// A form that binds variables, whose bindings are not lists of a name and a value.
    fails: "(let (x 1)\n  (print x))\n"
    repaired: "(let ((x 1))\n  (print x))\n"

MALFORMED_CLAUSE = "malformed-clause" Error
    /// A clause that does not have the shape which its form needs.
    fails: "(defun sign (x)\n  (cond (minusp x) -1))\n"
    repaired: "(defun sign (x)\n  (cond ((minusp x) -1)))\n"

MALFORMED_DEFINITION = "malformed-definition" Error
    /// A local definition that is not a list of a name, a lambda list and forms.
    fails: "(flet (square (x) (* x x))\n  (print (square 3)))\n"
    repaired: "(flet ((square (x) (* x x)))\n  (print (square 3)))\n"

MALFORMED_DECLARATION = "malformed-declaration" Error
    /// A declaration that is not a list of specifiers, each a list.
    fails: "(defun area (side)\n  (declare fixnum)\n  (* side side))\n"
    repaired: "(defun area (side)\n  (declare (fixnum side))\n  (* side side))\n"

MISPLACED_DECLARATION = "misplaced-declaration" Error
    /// `declare` in a place other than the beginning of a body.
    fails: "(defun area (side)\n  (print side)\n  (declare (fixnum side)))\n"
    repaired: "(defun area (side)\n  (declare (fixnum side))\n  (print side))\n"

MACRO_AS_FUNCTION = "macro-as-function" Error
    /// `#'` before the name of a macro or special form.
    fails: "(print (apply #'and '(t nil)))\n"
    repaired: "(print (every #'identity '(t nil)))\n"

RUN_TIME_ONLY = "run-time-only" Error
    /// Code of a local macro that refers to a variable, function or block which exists only at run time.
    fails: "(let ((x 1))\n  (macrolet ((value () x))\n    (print (value))))\n"
    repaired: "(let ((x 1))\n  (macrolet ((value () 'x))\n    (print (value))))\n"

DUPLICATE_TAG = "duplicate-tag" Error
    /// A tag that occurs twice in one `tagbody`.
    fails: "(tagbody\n  (go end)\n end\n end)\n"
    repaired: "(tagbody\n  (go end)\n end)\n"

MALFORMED_LAMBDA_LIST = "malformed-lambda-list" Error
    /// A lambda list that is not one.
    fails: "(defun area (width 4)\n  (* width 4))\n"
    repaired: "(defun area (width &optional (height 4))\n  (* width height))\n"

DUPLICATE_PARAMETER = "duplicate-parameter" Error
    /// Two parameters, or two variables of one `let`, with the same name.
    fails: "(defun area (side side)\n  (* side side))\n"
    repaired: "(defun area (width height)\n  (* width height))\n"

UNKNOWN_BLOCK = "unknown-block" Error
    /// `return` or `return-from` with no block of that name around it.
    fails: "(defun first-even (numbers)\n  (dolist (n numbers)\n    \
              (when (evenp n) (return-from first-evn n))))\n"
    repaired: "(defun first-even (numbers)\n  (dolist (n numbers)\n    \
              (when (evenp n) (return-from first-even n))))\n"

UNKNOWN_TAG = "unknown-tag" Error
    /// `go` to a tag that no `tagbody` around it has.
    fails: "(tagbody\n  (go done)\n end)\n"
    repaired: "(tagbody\n  (go end)\n end)\n"

FOREIGN_FORM = "foreign-form" Error
    /// An operator between its operands, or a name before the parentheses of a call.
    fails: "(print (1 + 2))\n"
    repaired: "(print (+ 1 2))\n"

FOREIGN_WORD = "foreign-word" Warning
    /// A name that other languages have and ESL has not. The program may define it before it is used.
    fails: "(defun first-of (list)\n  (if list (first list) None))\n"
    repaired: "(defun first-of (list)\n  (if list (first list) nil))\n"

UNDEFINED_FUNCTION = "undefined-function" Warning
    /// A call of a function that the program does not define. It may be defined by the time the call is made.
    fails: "(print (squar 3))\n"
    repaired: "(defun square (x)\n  (* x x))\n(print (square 3))\n"

NAME_NOT_IN_SUBSET = "name-not-in-subset" Warning
    /// A function, macro or variable of Common Lisp that ESL leaves out.
    fails: "(defun point (x y)\n  (find-method x y))\n(print (point 3 4))\n"
    repaired: "(defun point (x y)\n  (list x y))\n(print (point 3 4))\n"

UNDEFINED_VARIABLE = "undefined-variable" Warning
    /// A variable that the program neither binds nor defines.
    fails: "(defun area (width)\n  (* width heigth))\n"
    repaired: "(defun area (width height)\n  (* width height))\n"

UNKNOWN_TYPE = "unknown-type" Warning
    /// A name that is used as a type and denotes none.
    fails: "(defun next (n)\n  (check-type n intger)\n  (+ n 1))\n"
    repaired: "(defun next (n)\n  (check-type n integer)\n  (+ n 1))\n"

WRONG_ARGUMENT_COUNT = "wrong-argument-count" Warning
    /// A call with more or fewer arguments than the function takes.
    fails: "(defun area (width height)\n  (* width height))\n(print (area 3))\n"
    repaired: "(defun area (width height)\n  (* width height))\n(print (area 3 4))\n"

UNKNOWN_KEYWORD = "unknown-keyword" Warning
    /// A call with a keyword argument that the function does not take.
    fails: "(defun drive (distance &key (speed 1))\n  (* distance speed))\n(print (drive 3 :sped 5))\n"
    repaired: "(defun drive (distance &key (speed 1))\n  (* distance speed))\n(print (drive 3 :speed 5))\n"

WRONG_ARGUMENT = "wrong-argument" Warning
    /// A constant argument that the function refuses, or that its format directives do not fit.
    fails: "(defun next (n)\n  (format t \"~a and ~a~%\" n)\n  (+ n \"1\"))\n"
    repaired: "(defun next (n)\n  (format t \"~a~%\" n)\n  (+ n 1))\n"

MISSING_BODY = "missing-body" Warning
    /// A form of the language whose name begins with `with-`, without forms to run.
    fails: "(with-timeout (sleep 3))\n"
    repaired: "(with-timeout 5\n  (sleep 3))\n"

UNUSED_VARIABLE = "unused-variable" Warning
    /// A variable that is bound but never read.
    fails: "(defun area (width height)\n  (* width width))\n"
    repaired: "(defun area (width height)\n  (* width height))\n"

UNREACHABLE_CODE = "unreachable-code" Warning
    /// Code that control cannot reach, since the form before it always leaves.
    fails: "(defun sign (x)\n  (return-from sign (signum x))\n  (print x))\n"
    repaired: "(defun sign (x)\n  (print x)\n  (signum x))\n"

ASSIGNMENT_TO_CONSTANT = "assignment-to-constant" Error
    /// An assignment to a constant, or a binding of one.
    fails: "(setq pi 3)\n"
    repaired: "(defvar *pi* 3)\n"

EXPANSION_TOO_LARGE = "expansion-too-large" Error
    /// A form that expands into more code than the compiler takes, since macros double it again and again.
    fails: "(defmacro twice (n) (if (> n 0) `(list (twice ,(1- n)) (twice ,(1- n))) 1))\n(print (twice 30))\n"
    repaired: "(defmacro twice (n) (if (> n 0) `(list (twice ,(1- n)) (twice ,(1- n))) 1))\n(print (twice 3))\n"

MACRO_FAILED = "macro-failed" Error
    /// A macro failed while its call was expanded.
    fails: "(defmacro twice (form)\n  (list 'progn form (car 'form)))\n(twice (print 1))\n"
    repaired: "(defmacro twice (form)\n  (list 'progn form form))\n(twice (print 1))\n"

COMPILE_TIME_FAILURE = "compile-time-failure" Error
    /// A form that is evaluated while the file is compiled failed then.
    fails: "(eval-when (:compile-toplevel :load-toplevel :execute)\n  (car 'table))\n"
    repaired: "(eval-when (:compile-toplevel :load-toplevel :execute)\n  (car '(table)))\n"

READ_TIME_FAILURE = "read-time-failure" Error
    /// A `#.form` or another literal that is made by a call, which failed when the form was read.
    fails: "(print '#.(car 'table))\n"
    repaired: "(print '#.(car '(table)))\n"

LITERAL_OBJECT = "literal-object" Error
    /// An expansion that contains an object which cannot be written to a file, such as a table.
    fails: "(defmacro table ()\n  (make-hash-table))\n(print (hash-table-count (table)))\n"
    repaired: "(defmacro table ()\n  '(make-hash-table))\n(print (hash-table-count (table)))\n"

UNKNOWN_DECLARATION = "unknown-declaration" Warning
    /// A declaration of an unknown kind.
    fails: "(defun area (side)\n  (declare (ignorabel side))\n  0)\n"
    repaired: "(defun area (side)\n  (declare (ignorable side))\n  0)\n"

CLAUSE_FALLS_OFF = "clause-falls-off" Warning
    /// A recovery clause that can end without saying how the program goes on.
    fails: "(with-recovery-procedures\n    ((:broken (print 'repairing)))\n  (fail :broken))\n"
    repaired: "(with-recovery-procedures\n    ((:broken (print 'repairing) (retry)))\n  (fail :broken))\n"

UNREACHABLE_CLAUSE = "unreachable-clause" Warning
    /// A clause of a recovery form, or a method of a goal, that never applies.
    fails: "(with-recovery-procedures\n    ((:general-failure :retries :infinite (retry))\n     \
              (:broken (abort)))\n  (print 1))\n"
    repaired: "(with-recovery-procedures\n    ((:broken (abort))\n     \
              (:general-failure :retries :infinite (retry)))\n  (print 1))\n"

NOTHING_TO_WAIT_FOR = "nothing-to-wait-for" Warning
    /// A form to be waited for that reads nothing whose changes can be seen, such as a fluent or a fact.
    fails: "(defvar *level* 0)\n(spawn (:daemon t)\n  (whenever (> *level* 5)\n    (print 'high)))\n"
    repaired: "(define-fluent level 0)\n(spawn (:daemon t)\n  (whenever (> level 5)\n    (print 'high)))\n"

AMOUNT_ABOVE_CAPACITY = "amount-above-capacity" Warning
    /// A request for more of a resource than there is.
    fails: "(define-resource battery :capacity 10)\n(defun charge ()\n  \
            (with-resource (battery :amount 12)\n    (sleep 1)))\n"
    repaired: "(define-resource battery :capacity 12)\n(defun charge ()\n  \
               (with-resource (battery :amount 12)\n    (sleep 1)))\n"

CONCURRENT_OPERATION = "concurrent-operation" Warning
    /// A recovery procedure that calls an operation above the interrupted call of the same operation.
    fails: "(define-mock drive (place)\n  (sleep 5)\n  place)\n(defvar *battery* 0)\n\
            (with-recovery-procedures\n    ((:battery-low (drive 'dock) (abort 'charged)))\n  \
            (with-guardian (loop until (< *battery* 1) do (sleep 1))\n      (fail :battery-low)\n    \
            (drive 'lab)))\n"
    repaired: "(define-mock drive (place)\n  (sleep 5)\n  place)\n(defvar *battery* 0)\n\
               (when (eq (with-recovery-procedures\n              ((:battery-low (abort 'stopped)))\n            \
               (with-guardian (loop until (< *battery* 1) do (sleep 1))\n                (fail :battery-low)\n              \
               (drive 'lab)))\n          'stopped)\n  (drive 'dock))\n"

NOT_AN_OPERATION = "not-an-operation" Warning
    /// A function that is not an operation where one is needed, or a parameter that an operation lacks.
    fails: "(defun camera ()\n  'picture)\n(define-exclusive camera)\n"
    repaired: "(define-mock camera ()\n  'picture)\n(define-exclusive camera)\n"

DUPLICATE_DEFINITION = "duplicate-definition" Warning
    /// A cause, goal, rule or property that a file defines twice.
    fails: "(define-cause :stuck ())\n(define-cause :stuck (:general-failure))\n\
            (with-recovery-procedures ((:stuck (abort)))\n  (fail :stuck))\n"
    repaired: "(define-cause :stuck ())\n(with-recovery-procedures ((:stuck (abort)))\n  (fail :stuck))\n"

UNDECLARED_CAUSE = "undeclared-cause" Warning
    /// A cause that is not declared, in a program that declares causes.
    fails: "(define-cause :broken ())\n(with-recovery-procedures\n    ((:brocken (abort)))\n  \
              (fail :broken))\n"
    repaired: "(define-cause :broken ())\n(with-recovery-procedures\n    ((:broken (abort)))\n  \
              (fail :broken))\n"

OUTSIDE_CLAUSE = "outside-clause" Error
    /// `retry` or `abort` outside of a recovery clause.
    fails: "(defun again ()\n  (retry))\n"
    repaired: "(defun again (step)\n  (with-recovery-procedures\n      ((:broken (retry)))\n    \
              (funcall step)))\n"

UNKNOWN_MODULE = "unknown-module" Error
    /// A `require` of a module that has no file in the folders of the library.
    fails: "(require \"colours\")\n(print (paint 3))\n"
    repaired: "(defun paint (n)\n  (nth n '(red green blue)))\n(print (paint 3))\n"

CIRCULAR_MODULE = "circular-module" Error
    /// A module that requires itself, perhaps by way of others.
    fails: ""
    repaired: ""

LOCKED_NAME = "locked-name" Error
    /// A definition of a name that belongs to the language.
    fails: "(defun car (x)\n  x)\n"
    repaired: "(defun my-car (x)\n  x)\n"

LOCKED_NAME_INSIDE = "locked-name-inside" Warning
    /// A definition of a name that belongs to the language, inside of another form: it fails if it is run.
    fails: "(unless (fboundp 'car)\n  (defun car (x)\n    x))\n"
    repaired: "(unless (fboundp 'my-car)\n  (defun my-car (x)\n    x))\n"

}
Lowering {

FUNCTION_TOO_LARGE = "function-too-large" Error
    /// A function whose code exceeds the limits of the virtual machine.
    fails: ""
    repaired: ""

}
}
