//! Generated programs of two and three tasks end at the default grain as they do with switches at all ticks.
//! A reduction of the exploration that loses an ending fails here.
//!
//! `ESL_ORACLE=10000` tries so many programs; by default there are few.

use esl_testing::explore::{Grain, Settings, explore, grains};

use super::{compile, outputs};

/// Programs that are tried unless the variable says how many.
const PROGRAMS: u64 = 25;

/// The places that tasks share.
const SETUP: &str = "
    (defvar *n* 0)
    (defvar *m* 0)
    (defvar *seen-1* '())
    (defvar *seen-2* '())
    (defvar *seen-3* '())
    (defvar *event* (make-event 'event))
    (defun one-more (n) (+ n 1))
    (defun add-n () (setq *n* (one-more *n*)))
    (defun is-known () (db-query '(known 1)))";

/// Of programs that change places that grain `variables` does not see: their default grain is `ticks`.
const UNSEEN_SETUP: &str = "
    (defstruct thing (slot 0))
    (defvar *thing* (make-thing))
    (defvar *table* (make-hash-table))
    (defvar *array* (vector 0 0))
    (defvar *list* (list 0))
    (defun add-slot () (setf (thing-slot *thing*) (one-more (thing-slot *thing*))))
    (defun add-element () (setf (aref *array* 0) (one-more (aref *array* 0))))
    (defun add-entry () (setf (gethash 'key *table*) (one-more (gethash 'key *table* 0))))
    (defun add-pair () (setf (car *list*) (one-more (car *list*))))";

/// Actions of a task, with its number in place of `#`.
const ACTIONS: &[&str] = &[
    "(add-n)",
    "(setq *n* #)",
    "(push *n* *seen-#*)",
    "(setq *m* *n*)",
    "(without-interrupts (add-n))",
    "(unless (is-known) (assert '(known 1)) (add-n))",
    "(retract '(known 1))",
    "(assert '(mark #))",
    "(push (length (multiple-value-list (db-query '(mark ?what)))) *seen-#*)",
    "(signal *event*)",
    "(when (= *n* *m*) (push 'same *seen-#*))",
    "(sleep 0)",
    "(let ((*n* 7)) (add-n))",
    "(push (event-count *event*) *seen-#*)",
    "(one-more 1)",
];

/// Actions that grain `variables` does not see.
const UNSEEN: &[&str] =
    &["(add-slot)", "(add-element)", "(add-entry)", "(add-pair)", "(setq shared (one-more shared))"];

/// A source of numbers that are spread evenly (Steele, Lea and Flood 2014, `splitmix64`).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % end as u64) as usize
    }
}

/// Returns the program of this number.
fn program(number: u64) -> String {
    let mut numbers = Numbers(number);
    let tasks = 2 + numbers.below(4) / 3;
    let has_unseen = numbers.below(4) == 0;
    let mut bodies = String::new();
    for task in 1..=tasks {
        bodies += &format!("\n      (task-{task}");
        for _ in 0..1 + numbers.below(if tasks == 2 { 3 } else { 2 }) {
            let action = match has_unseen && numbers.below(2) == 0 {
                true => UNSEEN[numbers.below(UNSEEN.len())],
                false => ACTIONS[numbers.below(ACTIONS.len())],
            };
            bodies += &format!(" {}", action.replace('#', &task.to_string()));
        }
        bodies += ")";
    }
    let unseen = if has_unseen { UNSEEN_SETUP } else { "" };
    let net = match has_unseen {
        true => format!(
            "(let ((shared 0))\n    (task-net{bodies})\n    (princ (list shared *thing* (gethash 'key *table*) *array* *list*)))"
        ),
        false => format!("(task-net{bodies})"),
    };
    format!(
        "{SETUP}{unseen}
  {net}
  (princ (list *seen-1* *seen-2* *seen-3* *n* *m* (multiple-value-list (db-query '(mark ?what))) (is-known)
               (event-count *event*)))"
    )
}

#[test]
fn programs_end_at_the_default_grain_as_with_switches_at_all_ticks() {
    let count = std::env::var("ESL_ORACLE").map_or(PROGRAMS, |count| count.parse().expect("a number"));
    let (mut states, mut of_ticks) = (0, 0);
    for number in 0..count {
        let text = program(number);
        let compiled = compile(&text);
        let grain = *grains(&compiled, None).last().expect("there is a grain");
        let explored =
            |grain| explore(&compiled, &Settings { grain, ..Settings::default() }).expect("it can start");
        let (found, all) = (explored(grain), explored(Grain::Ticks));
        assert_eq!((found.limit, all.limit), (None, None), "program {number}:\n{text}");
        assert_eq!(outputs(&found), outputs(&all), "program {number} at grain {}:\n{text}", grain.name());
        states += found.states;
        of_ticks += all.states;
    }
    assert!(states < of_ticks, "{states} states of {of_ticks}");
}
