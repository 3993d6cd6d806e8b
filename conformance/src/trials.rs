//! Trials of the types of functions: each is called with samples of all classes of values, and a call that
//! returns contradicts the types if an argument or the value is not of them.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

use esl::Config;
use esl::host::VirtualHost;
use esl::program::{self, Source};
use esl_bytecode::kind::ValueType;

/// A function, and its types.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Its name.
    pub name: String,
    /// Numbers of arguments, at most four.
    pub counts: RangeInclusive<u32>,
    /// The types of its parameters.
    pub needs: Vec<ValueType>,
    /// The type of its first value.
    pub gives: ValueType,
    /// The type for which it tests its argument.
    pub tests: Option<ValueType>,
}

/// The classes of values, in the order of the samples' numbers in [`CALLER`].
const CLASSES: &[ValueType] = &[
    ValueType::NIL,
    ValueType::OTHER_SYMBOL,
    ValueType::INTEGER,
    ValueType::RATIO,
    ValueType::FLOAT,
    ValueType::COMPLEX,
    ValueType::CHARACTER,
    ValueType::STRING,
    ValueType::PAIR,
    ValueType::OTHER_ARRAY,
    ValueType::TABLE,
    ValueType::FUNCTION,
    ValueType::INSTANCE,
    ValueType::STREAM,
    ValueType::OTHER,
];

/// Calls functions with all pairs of samples, and tells of calls that return against their types.
const CALLER: &str = r#"
(defstruct thing a)
(defun sample (number)
  (case number
    (0 nil) (1 'word) (2 7) (3 1/2) (4 7.5) (5 #c(1 2)) (6 #\x) (7 (copy-seq "text")) (8 (list 1 2))
    (9 (vector 1 2)) (10 (make-hash-table)) (11 #'list) (12 (make-thing)) (13 (make-string-output-stream))
    (14 (make-event)) (15 0) (16 1) (17 (make-array 2 :fill-pointer 0)) (18 (list (cons 1 2)))))
(defun class-number (value)
  (cond ((null value) 0) ((symbolp value) 1) ((integerp value) 2) ((rationalp value) 3)
        ((floatp value) 4) ((complexp value) 5) ((characterp value) 6) ((stringp value) 7)
        ((consp value) 8) ((arrayp value) 9) ((hash-table-p value) 10) ((functionp value) 11)
        ((typep value '(or structure-object condition standard-object)) 12) ((streamp value) 13) (t 14)))
(defun check (name arguments classes needs gives tests)
  (handler-case
      (let* ((value (apply name arguments)) (class (class-number value)))
        (unless (logbitp class gives)
          (format t "!!~a ~a gives ~a~%" name classes class))
        (when (and tests (not (eq (and value t) (logbitp (first classes) tests))))
          (format t "!!~a ~a tests~%" name classes))
        (loop for class in classes for need in needs
              unless (logbitp class need) do (format t "!!~a takes ~a~%" name classes)))
    (error () nil)
    (failure () nil)))
(defun try (name counts needs gives tests)
  (dolist (count counts)
    (dotimes (first (if (> count 0) 19 1))
      (dotimes (second (if (> count 1) 19 1))
        (let* ((numbers (subseq (list first second 16 2) 0 count))
               (arguments (mapcar #'sample numbers)))
          (check name arguments (mapcar #'class-number arguments) needs gives tests))))))
"#;

fn mask(types: ValueType) -> u32 {
    let bits = CLASSES.iter().enumerate().filter(|(_, class)| types.contains(**class));
    bits.map(|(index, _)| 1 << index).sum()
}

/// Returns the form of a trial.
fn form(trial: &Trial) -> String {
    let mut form = format!("(try '{} '(", trial.name);
    // A string takes what is written into it.
    trial.counts.clone().for_each(|count| _ = write!(form, "{count} "));
    form += ") '(";
    trial.needs.iter().for_each(|need| _ = write!(form, "{} ", mask(*need)));
    let tests = trial.tests.map_or("nil".to_string(), |tests| mask(tests).to_string());
    form + &format!(") {} {tests})\n", mask(trial.gives))
}

/// Makes all trials, and returns the calls that contradict the types, with the numbers of the arguments'
/// classes.
///
/// # Panics
/// If a call ends the run, so that nothing is known of those behind it.
pub fn contradictions(trials: &[Trial]) -> Vec<String> {
    let forms: String = trials.iter().map(form).collect();
    let text = format!("{CALLER}{forms}(format t \"~&!!all~%\")\n");
    let compiled = program::compile(&[Source::new("types.esl", text)]);
    let program = compiled.program.expect("the calls compile");
    let host = VirtualHost::new();
    let captured = host.captured();
    program::run(&program, Config::default(), Box::new(host)).expect("it runs");
    let output = captured.output();
    let mut told: Vec<String> = output.lines().filter(|line| line.contains("!!")).map(String::from).collect();
    assert_eq!(told.pop().as_deref(), Some("!!all"), "a call ends the run: {}", captured.error());
    told
}
