//! Generated programs of two and three tasks that use one to three kinds of shared places.

/// The beginning of all programs.
const SETUP: &str = "
    (defvar *seen-1* '())
    (defvar *seen-2* '())
    (defvar *seen-3* '())
    (defun one-more (n) (+ n 1))
    (defun staged ()
      (let ((stage 0))
        (unwind-protect
            (progn (one-more 0) (setq stage 1) (one-more 0) (setq stage 2) (one-more 0) (setq *seen-1* '(1))
                   (one-more 0) (setq stage 3))
          (setq *seen-3* (list stage)))))
    (defun staged-twice ()
      (let ((stage 0))
        (unwind-protect
            (progn (unwind-protect (progn (one-more 0) (setq stage 1) (one-more 0)) (setq stage (+ stage 10)))
                   (one-more 0))
          (push stage *seen-3*))))";

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
            "(progn (spawn (push 'child# *seen-#*)) (one-more 0) (setq *helped* (one-more *helped*)))",
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
            "(progn (sleep 1) (setq *late* (one-more *late*)))",
            "(progn (sleep 1) (push *late* *seen-#*))",
        ],
        contents: "*late*",
    },
    SharedKind {
        setup: "(defvar *victim* nil) (defvar *stages* '())",
        actions: &[
            "(setq *victim* (spawn (staged)))",
            "(when *victim* (abort-task *victim*))",
            "(setq *victim* (spawn (staged-twice)))",
            "(when *victim* (push (task-status *victim*) *seen-#*))",
            "(push *stages* *seen-#*)",
            "(when *victim* (suspend-task *victim*) (resume-task *victim*))",
        ],
        contents: "*stages*",
    },
    SharedKind {
        setup: "(defvar *limited* '())",
        actions: &[
            "(push (with-timeout 1 (sleep #) (setq *limited* '(#)) (one-more 0) 'slept) *seen-#*)",
            "(push (with-timeout 1 (one-more 0) (setq *limited* '(#)) (one-more 0) 'in-time) *seen-#*)",
            "(push *limited* *seen-#*)",
        ],
        contents: "*limited*",
    },
    SharedKind {
        setup: "(defvar *won* '())",
        actions: &[
            "(pursue (left (one-more 0) (push '(left #) *won*)) (right (push '(right #) *won*)))",
            "(push (or-parallel (left (one-more 0) 'left) (right 'right)) *seen-#*)",
            "(push *won* *seen-#*)",
        ],
        contents: "*won*",
    },
    SharedKind {
        setup: "(define-resource arm) (defvar *held* 0)",
        actions: &[
            "(with-resource (arm) (setq *held* (one-more *held*)))",
            "(setq *held* (one-more *held*))",
            "(push (length (resource-holders 'arm)) *seen-#*)",
        ],
        contents: "*held*",
    },
    SharedKind {
        setup: "(defvar *chosen* 0)",
        actions: &[
            "(setq *chosen* (choose 1 2))",
            "(push (handler-case (progn (one-more 0) (if (= *chosen* 1) (fail :lost) *chosen*))
                     (failure () 'lost)) *seen-#*)",
            "(when (choose t nil) (setq *chosen* #))",
            "(push *chosen* *seen-#*)",
        ],
        contents: "*chosen*",
    },
    SharedKind {
        setup: "(defvar *low* 0) (defvar *high* 9) (always apart (< *low* *high*))",
        actions: &[
            "(setq *low* (one-more *low*))",
            "(setq *high* (- *high* #))",
            "(progn (setq *low* (+ *low* 7)) (one-more 0) (setq *low* (- *low* 7)))",
            "(push *low* *seen-#*)",
        ],
        contents: "(list *low* *high*)",
    },
];

/// The kinds that only grain `ticks` sees.
const UNSEEN: &[SharedKind] = &[
    SharedKind {
        setup: "(defvar *limited* '())
            (defun limited ()
              (let ((stage 0))
                (with-timeout 1
                  (one-more 0) (setq stage 1) (one-more 0) (setq stage 2) (sleep 1) (setq stage 3))
                stage))",
        actions: &["(push (limited) *limited*)", "(push *limited* *seen-#*)"],
        contents: "*limited*",
    },
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
        setup: "(defmacro define-hidden (place)
              `(progn (defvar ,place 0)
                      (defun hidden () ,place)
                      (defun set-hidden (n) (setq ,place n))))
            (macrolet ((define () (list 'define-hidden (gensym)))) (define))",
        actions: &[
            "(set-hidden (one-more (hidden)))",
            "(push (hidden) *seen-#*)",
            "(when (eql (hidden) 0) (set-hidden #))",
        ],
        contents: "(hidden)",
    },
    SharedKind {
        setup: "(defun kept () (load-time-value (list 0 0)))",
        actions: &[
            "(setf (car (kept)) (one-more (car (kept))))",
            "(let ((old (first (kept)))) (one-more 0) (setf (second (kept)) (+ old #)))",
            "(push (copy-list (kept)) *seen-#*)",
        ],
        contents: "(kept)",
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

/// A generated program.
pub(super) struct GeneratedProgram {
    setups: Vec<&'static str>,
    contents: Vec<&'static str>,
    /// The actions of each task.
    tasks: Vec<Vec<String>>,
    /// Whether timers may end at any point.
    pub(super) has_timers: bool,
}

/// Returns the program of this number.
pub(super) fn program(number: u64) -> GeneratedProgram {
    let mut numbers = Numbers(number);
    let mut lengths = Numbers(!number);
    let tasks = 2 + numbers.below(4) / 3;
    let has_unseen = numbers.below(5) == 0;
    let mut kinds = vec![if has_unseen { numbers.pick(UNSEEN) } else { numbers.pick(SEEN) }];
    for _ in 0..numbers.below(3) {
        let kind = numbers.pick(SEEN);
        if !kinds.iter().any(|known| known.setup == kind.setup) {
            kinds.push(kind);
        }
    }
    let mut action = |task: usize| {
        let at = numbers.below(kinds.len());
        let action =
            if numbers.below(8) == 0 { *numbers.pick(OTHER) } else { *numbers.pick(kinds[at].actions) };
        // `#` that is the task's number, apart from those of the syntax.
        let action = action.replace("#'", "\u{0}").replace("#\\#", "\u{1}").replace('#', &task.to_string());
        action.replace('\u{0}', "#'").replace('\u{1}', &format!("#\\{task}"))
    };
    let mut actions = Vec::new();
    for task in 1..=tasks {
        let count = 1 + lengths.below(if tasks == 2 { 3 } else { 2 });
        actions.push((0..count).map(|_| action(task)).collect());
    }
    GeneratedProgram {
        setups: kinds.iter().map(|kind| kind.setup).collect(),
        contents: kinds.iter().map(|kind| kind.contents).collect(),
        tasks: actions,
        has_timers: lengths.below(4) == 0,
    }
}

impl GeneratedProgram {
    /// Returns the number of actions.
    pub(super) fn actions(&self) -> usize {
        self.tasks.iter().map(Vec::len).sum()
    }

    /// Returns the text.
    pub(super) fn text(&self) -> String {
        let bodies: Vec<String> = (1..)
            .zip(&self.tasks)
            .map(|(task, actions)| format!("\n      (task-{task} {})", actions.join(" ")))
            .collect();
        format!(
            "{SETUP}\n    {}\n  (task-net{})\n  (princ (list *seen-1* *seen-2* *seen-3* {}))",
            self.setups.join("\n    "),
            bodies.concat(),
            self.contents.join(" "),
        )
    }

    /// Returns the text of a program of so many tasks, all of which do what the first one does.
    pub(super) fn text_of_like_tasks(&self, count: usize) -> String {
        format!(
            "{SETUP}\n    {}\n  (dotimes (i {count}) (spawn {}))\n  (sleep 9)\n  (princ (list *seen-1* {}))",
            self.setups.join("\n    "),
            self.tasks[0].join(" "),
            self.contents.join(" "),
        )
    }

    /// Takes the last action of the longest task away. Returns whether one was taken.
    pub(super) fn shorten(&mut self) -> bool {
        let Some(longest) = self.tasks.iter_mut().rev().max_by_key(|actions| actions.len()) else {
            return false;
        };
        if longest.len() > 1 {
            longest.pop();
            return true;
        }
        if self.tasks.len() > 2 {
            self.tasks.pop();
            return true;
        }
        // One task with an action, beside one that shares nothing.
        let Some(last) = self.tasks.last_mut() else { return false };
        let is_other = last[0] == OTHER[0];
        last[0] = OTHER[0].into();
        !is_other
    }
}
