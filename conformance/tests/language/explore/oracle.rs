//! Generated programs of two and three tasks end at the default grain as they do with switches at all ticks.
//! A reduction of the exploration that loses an ending fails here.
//!
//! A program uses one to three kinds of shared places. Where its default grain is `ticks`, there is nothing
//! to compare; the kinds that grain `variables` does not see are there to show that the choice of the grain
//! knows them. `ESL_ORACLE=10000` tries so many programs, from the number `ESL_ORACLE_FROM` on; by default
//! there are few.

use std::collections::BTreeSet;

use esl::program::Ended;
use esl_testing::explore::{Behaviour, ExploredEnding, Grain, Settings, explore, grains};

use super::compile;

/// Programs that are tried unless the variable says how many.
const PROGRAMS: u64 = 25;

/// The beginning of all programs.
const SETUP: &str = "
    (defvar *seen-1* '())
    (defvar *seen-2* '())
    (defvar *seen-3* '())
    (defun one-more (n) (+ n 1))";

/// A kind of places that tasks share.
struct SharedKind {
    /// The places.
    setup: &'static str,
    /// Actions of a task, with its number in place of `#`.
    actions: &'static [&'static str],
    /// A form for their contents at the end.
    contents: &'static str,
}

/// The kinds that grain `variables` sees.
const SEEN: &[SharedKind] = &[
    SharedKind {
        setup: "(defvar *n* 0) (defvar *m* 0) (defun add-n () (setq *n* (one-more *n*)))",
        actions: &[
            "(add-n)",
            "(setq *n* #)",
            "(push *n* *seen-#*)",
            "(setq *m* *n*)",
            "(without-interrupts (add-n))",
            "(when (= *n* *m*) (push 'same *seen-#*))",
            "(let ((*n* 7)) (add-n))",
            "(set '*n* (one-more (symbol-value '*n*)))",
            "(rotatef *n* *m*)",
            "(incf *n*)",
            "(progv '(*n*) '(3) (add-n))",
            "(let ((old *n*)) (one-more 0) (setq *n* (+ old 1)))",
        ],
        contents: "(list *n* *m*)",
    },
    SharedKind {
        setup: "(defun is-known () (db-query '(known 1)))",
        actions: &[
            "(unless (is-known) (assert '(known 1)) (push 'first *seen-#*))",
            "(retract '(known 1))",
            "(assert '(mark #))",
            "(push (length (multiple-value-list (db-query '(mark ?what)))) *seen-#*)",
            "(without-interrupts (unless (is-known) (assert '(known 1)) (push 'first *seen-#*)))",
        ],
        contents: "(list (is-known) (multiple-value-list (db-query '(mark ?what))))",
    },
    SharedKind {
        setup: "(defvar *event* (make-event 'event))",
        actions: &[
            "(signal *event*)",
            "(signal *event* #)",
            "(push (event-count *event*) *seen-#*)",
            "(wait-for-event *event* :unless-count 0)",
            "(push (multiple-value-list (wait-for-event *event* :timeout 1)) *seen-#*)",
        ],
        contents: "(event-count *event*)",
    },
    SharedKind {
        setup: "(define-property door (name)) (assert '(door a 0))",
        actions: &[
            "(assert '(door a #))",
            "(assert (list 'door 'a (one-more (door 'a))))",
            "(push (door 'a) *seen-#*)",
            "(when (eql (door 'a) 0) (assert '(door a #)) (push 'opened *seen-#*))",
        ],
        contents: "(door 'a)",
    },
    SharedKind {
        setup: "(define-fluent lamp 0)",
        actions: &[
            "(setf lamp #)",
            "(setf lamp (one-more lamp))",
            "(push lamp *seen-#*)",
            "(wait-until (eql lamp 0))",
            "(wait-until (not (eql lamp 0)))",
        ],
        contents: "lamp",
    },
    SharedKind {
        setup: "(setq *random-state* (make-random-state))",
        actions: &[
            "(push (random 1000) *seen-#*)",
            "(progn (random 9) (push (random 1000) *seen-#*))",
            "(push (symbol-name (gensym)) *seen-#*)",
        ],
        contents: "(random 1000)",
    },
    SharedKind {
        setup: "(defvar *helper* nil) (defvar *helped* 0)",
        actions: &[
            "(setq *helper* (spawn (setq *helped* (one-more *helped*))))",
            "(when *helper* (abort-task *helper*))",
            "(when *helper* (push (task-status *helper*) *seen-#*))",
            "(unwind-protect (one-more 1) (setq *helped* #))",
            "(push *helped* *seen-#*)",
        ],
        contents: "*helped*",
    },
    SharedKind {
        setup: "(defvar *late* 0)",
        actions: &[
            "(sleep 0)",
            "(sleep #)",
            "(push (with-timeout 1 (sleep #) 'slept) *seen-#*)",
            "(setq *late* (one-more *late*))",
        ],
        contents: "*late*",
    },
];

/// The kinds that only grain `ticks` sees.
const UNSEEN: &[SharedKind] = &[
    SharedKind {
        setup: "(defvar *counter* (let ((count 0)) (lambda () (setq count (one-more count)))))",
        actions: &["(funcall *counter*)", "(push (funcall *counter*) *seen-#*)"],
        contents: "(funcall *counter*)",
    },
    SharedKind {
        setup: "(defstruct thing (slot 0)) (defvar *thing* (make-thing))
            (defun add-slot () (setf (thing-slot *thing*) (one-more (thing-slot *thing*))))",
        actions: &[
            "(add-slot)",
            "(push (thing-slot *thing*) *seen-#*)",
            "(funcall #'(setf thing-slot) # *thing*)",
            "(incf (thing-slot *thing*))",
        ],
        contents: "*thing*",
    },
    SharedKind {
        setup: "(defclass tank () ((level :initform 0 :accessor level))) (defvar *tank* (make-instance 'tank))",
        actions: &[
            "(setf (level *tank*) (one-more (level *tank*)))",
            "(setf (slot-value *tank* 'level) #)",
            "(push (level *tank*) *seen-#*)",
        ],
        contents: "(level *tank*)",
    },
    SharedKind {
        setup: "(defvar *list* (list 3 1 2))",
        actions: &[
            "(setf (car *list*) (one-more (car *list*)))",
            "(push (copy-list *list*) *seen-#*)",
            "(setf (nth 1 *list*) #)",
            "(nconc *list* (list #))",
            "(setq *list* (sort *list* #'<))",
            "(setq *list* (nreverse *list*))",
            "(setf (getf (cdr *list*) 'a) #)",
            "(push (pop (cdr *list*)) *seen-#*)",
        ],
        contents: "*list*",
    },
    SharedKind {
        setup: "(defvar *array* (make-array 2 :initial-element 0)) (defvar *text* (copy-seq \"ab\"))
            (defvar *grid* (make-array '(1 2) :initial-element 0))
            (defvar *grown* (make-array 0 :adjustable t :fill-pointer t))",
        actions: &[
            "(setf (aref *array* 0) (one-more (aref *array* 0)))",
            "(setf (aref *grid* 0 1) (one-more (aref *grid* 0 1)))",
            "(vector-push-extend # *grown*)",
            "(setf (char *text* 0) #\\#)",
            "(fill *array* #)",
            "(replace *array* (list # #))",
            "(push (coerce *array* 'list) *seen-#*)",
            "(push (length *grown*) *seen-#*)",
        ],
        contents: "(list *array* *grid* *grown* *text*)",
    },
    SharedKind {
        setup: "(defvar *table* (make-hash-table))",
        actions: &[
            "(setf (gethash 'key *table*) (one-more (gethash 'key *table* 0)))",
            "(incf (gethash 'key *table* 0))",
            "(remhash 'key *table*)",
            "(push (hash-table-count *table*) *seen-#*)",
            "(maphash (lambda (key value) (push value *seen-#*)) *table*)",
        ],
        contents: "(gethash 'key *table*)",
    },
    SharedKind {
        setup: "(setf (get 'it 'level) 0)",
        actions: &[
            "(setf (get 'it 'level) (one-more (get 'it 'level 0)))",
            "(remprop 'it 'level)",
            "(push (symbol-plist 'it) *seen-#*)",
        ],
        contents: "(get 'it 'level)",
    },
    SharedKind {
        setup: "(defvar *out* (make-string-output-stream)) (defvar *in* (make-string-input-stream \"abcdef\"))",
        actions: &[
            "(princ # *out*)",
            "(write-string \"x\" *out*)",
            "(push (read-char *in* nil) *seen-#*)",
            "(push (get-output-stream-string *out*) *seen-#*)",
        ],
        contents: "(list (get-output-stream-string *out*) (read-char *in* nil))",
    },
];

/// Actions that shared places have nothing to do with.
const OTHER: &[&str] = &["(one-more 1)", "(sleep 0)", "(push # *seen-#*)"];

/// A source of numbers that are spread evenly (Steele, Lea and Flood 2014, `splitmix64`).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % end as u64) as usize
    }

    fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

/// Returns the program of this number, and whether it uses places that grain `variables` does not see.
pub(super) fn program(number: u64) -> (String, bool) {
    let mut numbers = Numbers(number);
    let tasks = 2 + numbers.below(4) / 3;
    let has_unseen = numbers.below(5) == 0;
    let mut kinds = vec![if has_unseen { numbers.pick(UNSEEN) } else { numbers.pick(SEEN) }];
    for _ in 0..numbers.below(3) {
        let kind = numbers.pick(SEEN);
        if !kinds.iter().any(|known| known.setup == kind.setup) {
            kinds.push(kind);
        }
    }
    let mut bodies = String::new();
    let mut is_used = false;
    for task in 1..=tasks {
        bodies += &format!("\n      (task-{task}");
        for _ in 0..1 + numbers.below(if tasks == 2 { 3 } else { 2 }) {
            let at = numbers.below(kinds.len());
            let action =
                if numbers.below(8) == 0 { *numbers.pick(OTHER) } else { *numbers.pick(kinds[at].actions) };
            is_used |= at == 0;
            let action =
                action.replace("#'", "\u{0}").replace("#\\#", "\u{1}").replace('#', &task.to_string());
            bodies += &format!(" {}", action.replace('\u{0}', "#'").replace('\u{1}', &format!("#\\{task}")));
        }
        bodies += ")";
    }
    let setups: Vec<&str> = kinds.iter().map(|kind| kind.setup).collect();
    let contents: Vec<&str> = kinds.iter().map(|kind| kind.contents).collect();
    let text = format!(
        "{SETUP}\n    {}\n  (task-net{bodies})\n  (princ (list *seen-1* *seen-2* *seen-3* {}))",
        setups.join("\n    "),
        contents.join(" "),
    );
    (text, has_unseen && is_used)
}

/// Returns the ways in which a program ends.
pub(super) fn ends(endings: &[ExploredEnding<Behaviour>]) -> BTreeSet<(String, String)> {
    let ends = endings.iter().map(|ending| {
        let Behaviour { ended, output, .. } = &ending.what;
        (format!("{ended:?}"), output.split_whitespace().collect::<Vec<_>>().join(" "))
    });
    ends.collect()
}

pub(super) fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |count| count.parse().expect("a number"))
}

#[test]
fn programs_end_at_the_default_grain_as_with_switches_at_all_ticks() {
    let (from, count) = (variable("ESL_ORACLE_FROM", 0), variable("ESL_ORACLE", PROGRAMS));
    let (mut states, mut of_ticks, mut compared, mut too_large) = (0, 0, 0, 0);
    for number in from..from + count {
        let (text, has_unseen) = program(number);
        let compiled = compile(&text);
        let grain = *grains(&compiled, None).last().expect("there is a grain");
        if grain == Grain::Ticks {
            continue;
        }
        let most = Settings { states: 60_000, ..Settings::default() };
        let explored = |grain| explore(&compiled, &Settings { grain, ..most }).expect("it can start");
        let all = explored(Grain::Ticks);
        if all.limit.is_some() {
            too_large += 1;
            continue;
        }
        let found = explored(grain);
        assert_eq!(found.limit, None, "program {number}:\n{text}");
        assert_eq!(
            (&found.endless.is_some(), ends(&found.endings)),
            (&all.endless.is_some(), ends(&all.endings)),
            "program {number}, unseen {has_unseen}:\n{text}"
        );
        let ends_well =
            |ended: &Ended| matches!(ended, Ended::Normally(0) | Ended::Deadlocked | Ended::Failed);
        assert!(
            found.endings.iter().all(|ending| ends_well(&ending.what.ended)),
            "program {number}:\n{text}"
        );
        states += found.states;
        of_ticks += all.states;
        compared += 1;
    }
    tell(&format!("{compared} of {count} programs, {too_large} too large; {states} states of {of_ticks}"));
    assert!(states < of_ticks, "{states} states of {of_ticks}");
}

#[allow(clippy::print_stdout, reason = "a run by hand prints its figures")]
fn tell(line: &str) {
    println!("{line}");
}
