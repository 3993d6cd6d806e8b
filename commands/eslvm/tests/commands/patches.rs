//! Patches of an operator: definitions that are changed in one step, and undone.

use esl_conformance::folder::Folder;

use crate::attach::session;
use crate::operate::Operated;

/// Structures, classes, conditions, fluents, resources and the like.
#[test]
fn a_patch_of_kinds_and_shared_things_is_made_and_undone_in_one_step() {
    let folder = Folder::new("attach_kinds");
    let program = "
        (defstruct wheel size)
        (defclass rover () ((speed :initform 1 :accessor rover-speed)))
        (define-condition stuck (error) ((where :initarg :where :reader stuck-where)))
        (define-resource antenna :capacity 1)
        (define-fluent battery 10)
        (defvar *wheel* (make-wheel :size 3))
        (defvar *rover* (make-instance 'rover))
        (setf (rover-speed *rover*) 7)
        (defun state () (list (wheel-size *wheel*) (wheel-size (make-wheel)) (rover-speed *rover*) battery))
        (read-line *standard-input* nil)
        (format t \"~s~%\" (state))";
    let patch = folder.file(
        "patch.esl",
        "(defstruct wheel (size 99))
         (defstruct hub (n 1))
         (defstruct (big-hub (:include hub)) m)
         (defclass rover () ((speed :initform 1 :accessor rover-speed) (fuel :initform 50 :accessor rover-fuel)))
         (define-condition stuck (error)
           ((where :initarg :where :reader stuck-where) (depth :initarg :depth :reader stuck-depth)))
         (define-resource antenna :capacity 2)
         (define-resource arm)
         (define-property place (what))
         (defconstant +limit+ 5)
         (define-input hints :capacity 3)
         (define-fluent power 3)
         (define-fluent (low) (< power 2))
         (define-fluent battery 77)
         (defun state ()
           (assert '(place rock here))
           (list (hub-n (make-big-hub :m 5)) (wheel-size (make-wheel)) (wheel-size *wheel*) (rover-fuel *rover*)
                 (handler-case (error 'stuck :where 1 :depth 2) (stuck (c) (stuck-depth c)))
                 (with-resource (antenna :amount 2 :if-denied :fail) (with-resource (arm) :held))
                 (place 'rock) +limit+ (input-dropped hints) power (low) battery))",
    );
    let narrower = folder.file("narrower.esl", "(defun state () nil) (defstruct wheel)");
    let constant = folder.file("constant.esl", "(defun state () nil) (defconstant +limit+ 6)");
    let unfit = folder.file("unfit.esl", "(defun state () nil) (define-rule (place ?x ?y) (near ?x))");
    let class = folder.file("class.esl", "(defclass rover () ((speed) (fuel))) (defparameter *no* (car 1))");
    let (run, socket) = Operated::listening(&folder, program, &[]);
    let (output, status) = session(
        &socket,
        &format!(
            "(state)\n:patch {patch}\n(state)\n:patch {narrower}\n:patch {constant}\n:patch {unfit}\n:patch {class}\n\
             (slot-value *rover* 'fuel)\n:undo-patch\n(state)\n\
             (list (slot-exists-p *rover* 'fuel) (fboundp 'stuck-depth) (fboundp 'make-hub) (fboundp 'low) \
             (boundp 'hints))\n"
        ),
    );
    let aborted = |cause: &str| format!("Failure {cause}, no recovery available.\nAborted\n");
    let (refused, wrong) = (aborted(":PROGRAM-ERROR"), aborted(":TYPE-ERROR"));
    let lines: Vec<&str> =
        output.lines().filter(|line| !line.is_empty() && !line.starts_with([' ', 'w'])).collect();
    let expected = format!(
        "(3 NIL 7 10)\n; 14 definitions are changed\n(1 99 3 50 2 :HELD HERE 5 0 3 NIL 10)\n\
         The structure WHEEL keeps its slots, (SIZE): a structure with others needs another name.\n{refused}\
         +LIMIT+ is a constant already, with the value 5.\n{refused}\
         Expected the head of a rule, which is not a property, found (PLACE ?X ?Y).\n{refused}The value 1 is not of type LIST.\n{wrong}50\n\
         ; 14 definitions are as before\n(3 NIL 7 10)\n(NIL NIL NIL NIL NIL)"
    );
    assert_eq!(lines.join("\n"), expected);
    assert_eq!(status, Some(0));
    assert_eq!(run.finish().output, "(3 NIL 7 10)\n");
}

/// New definitions of a patch have no name once it is undone, and can be made otherwise then.
#[test]
fn rules_are_patched_and_new_kinds_are_gone_after_an_undo() {
    let folder = Folder::new("attach_undo");
    let program = "
        (assert '(at rock 1)) (assert '(at ice 2))
        (define-rule (near ?x) (at ?x ?n) (:test (< #?n 2)))
        (define-input hints :capacity 2)
        (defvar *kept* nil)
        (defvar *woken* nil)
        (defun near () (db-query '(near ?x)))
        (defun known ()
          (list (mapcar (lambda (name) (if (find-class name nil) t nil)) '(hub stuck probe))
                (constantp '+limit+) (fboundp 'place) (db-query '(place rock ?x)) (esl::%special-p '*new*)))
        (read-line *standard-input* nil)
        (format t \"~s ~s~%\" (near) (known))";
    let patch = folder.file(
        "patch.esl",
        "(define-rule (near ?x) (at ?x ?n) (:test (< #?n 2)))
         (define-rule (near ?x) (far ?x ?y) (near ?y))
         (define-rule (seen ?x) (near ?x))
         (defstruct hub (n 1))
         (define-condition stuck (error) ((where :initarg :where :reader stuck-where)))
         (defclass probe () ((depth :initform 4 :accessor probe-depth)))
         (defconstant +limit+ 5)
         (defvar *new* 1)
         (define-property place (what))
         (define-input hints :capacity 9)
         (define-input others)
         (defun guarded (function)
           (handler-case (funcall function) (stuck (c) (stuck-where c)) (type-error () :other)))",
    );
    let wrong =
        folder.file("wrong.esl", "(define-rule (near ice)) (defstruct spoke) (defparameter *no* (car 1))");
    let again = folder.file(
        "again.esl",
        "(defstruct hub n m) (defconstant +limit+ 6) (defclass probe () (width))
         (define-rule (near ice))",
    );
    let (run, socket) = Operated::listening(&folder, program, &[]);
    let (output, status) = session(
        &socket,
        &format!(
            "(near)\n:patch {wrong}\n(list (near) (find-class 'spoke nil))\n:patch {patch}\n(assert '(far dune rock))\n\
             (list (near) (db-query '(seen ?x)))\n\
             (progn (assert '(place rock a)) (assert '(place rock b)) (known))\n\
             (setq *kept* (list (make-hub) (make-instance 'probe) #'guarded))\n\
             (list (guarded (lambda () (error 'stuck :where 7))) (hub-n (first *kept*)))\n\
             (multiple-value-list (esl::%input-rule hints))\n\
             :undo-patch\n(list (near) (db-query '(seen ?x)))\n(known)\n*kept*\n\
             (list (slot-value (second *kept*) 'depth) (type-of (first *kept*)))\n\
             (funcall (third *kept*) (lambda () (error 'type-error :datum 1 :expected-type 'list)))\n\
             (multiple-value-list (esl::%input-rule hints))\n:signal others 1\n(assert '(place rock c))\n\
             (db-query '(place rock ?x))\n\
             (progn (spawn (:daemon t) (wait-until (db-query '(near ice))) (setq *woken* t)) :waits)\n\
             :patch {again}\n(loop until *woken* do (sleep 0.01))\n(list (hub-m (make-hub :m 3)) +limit+ (near) (hub-p (first *kept*)))\n:undo-patch\n(near)\n"
        ),
    );
    let expected = "(((?X . ROCK)))
The value 1 is not of type LIST.
Failure :TYPE-ERROR, no recovery available.
Aborted
((((?X . ROCK))) NIL)
; 12 definitions are changed
T
((((?X . ROCK)) ((?X . DUNE))) (((?X . ROCK)) ((?X . DUNE))))
((T T T) T T (((?X . B))) T)
(#S(HUB :N 1) #<PROBE> #<FUNCTION GUARDED>)
(7 1)
(9 0)
; 12 definitions are as before
((((?X . ROCK))) NIL)
((NIL NIL NIL) NIL NIL (((?X . B))) NIL)
(#S(HUB :N 1) #<PROBE> #<FUNCTION GUARDED>)
(4 HUB)
:OTHER
(2 0)
The variable OTHERS holds neither an input nor an event.
Failure :PROGRAM-ERROR, no recovery available.
Aborted
T
(((?X . B)) ((?X . C)))
:WAITS
; 4 definitions are changed
NIL
(3 6 (((?X . ROCK)) ((?X . ICE))) NIL)
; 4 definitions are as before
(((?X . ROCK)))";
    assert_eq!((output.trim_end(), status), (expected, Some(0)));
    let ended = "(((?X . ROCK))) ((NIL NIL NIL) NIL NIL (((?X . B)) ((?X . C))) NIL)\n";
    assert_eq!(run.finish().output, ended);
}

#[test]
fn a_patch_of_other_definitions_is_undone_as_a_whole() {
    let folder = Folder::new("attach_patches");
    let program = "
        (defmacro twice (form) `(list ,form ,form))
        (defgeneric weight (thing))
        (defmethod weight ((thing integer)) thing)
        (defvar *done* nil)
        (to-achieve (donep what) (t (setq *done* (list what))))
        (defun donep (what) (equal *done* (list what)))
        (defun both (n) (twice n))
        (deftype small () '(integer 0 9))
        (read-line *standard-input* nil)";
    let patch = folder.file(
        "patch.esl",
        "(defun look-at (n) (seen-at n)) (defun seen-at (n) (twice n))
         (progn (defmacro twice (form) `(vector ,form)) (defmacro thrice (form) `(list 3 ,form)))
         (defun both (n) (list (twice n) (thrice n)))
         (defmethod weight ((thing integer)) (* 2 thing))
         (defmethod weight ((thing string)) (length thing))
         (defmethod size (thing) (list :size thing))
         (deftype small () '(integer 0 99))
         (define-cause :tired ())
         (to-achieve (donep what) (t (setq *done* (list what)) (print :patched)))",
    );
    let wrong = folder.file(
        "wrong.esl",
        "(defmacro twice (form) `(quote ,form)) (defmethod weight ((thing symbol)) 0) (defparameter *done* (car 1))",
    );
    let (run, socket) = Operated::listening(&folder, program, &[]);
    let look = "(list (both 1) (twice 2) (weight 4) (typep 50 'small) (fboundp 'size) (fboundp 'thrice))\n";
    let (output, status) = session(
        &socket,
        &format!(
            "{look}:patch {patch}\n{look}(list (weight \"abc\") (size 1) (look-at 1))\n(achieve (donep 1))\n:patch {wrong}\n{look}\
             (weight 'x)\n:undo-patch\n{look}(weight \"abc\")\n(achieve (donep 2))\n:undo-patch\n"
        ),
    );
    let before = "((1 1) (2 2) 4 NIL NIL NIL)\n";
    let after = "((#(1) (3 1)) #(2) 8 T T T)\n";
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!(status, Some(0), "{output}");
    assert!(
        output.starts_with(&format!("{before}; 11 definitions are changed\n{after}(3 (:SIZE 1) (1 1))\n")),
        "{output}"
    );
    assert!(output.contains("\n:PATCHED"), "{output}");
    // A patch that fails half-way has changed nothing.
    assert_eq!(output.matches(after).count(), 2, "{output}");
    assert_eq!(output.matches(before).count(), 2, "{output}");
    assert_eq!(lines.iter().filter(|line| line.contains(":NO-APPLICABLE-METHOD")).count(), 2, "{output}");
    assert!(output.ends_with("T\n; no patch can be undone\n"), "{output}");
    assert_eq!(run.end(), Some(0));
}
