//! The table of foreign words: names that other languages have and ESL has not, each with its languages and
//! the form to write instead.
//!
//! The compiler looks a name up when the program does not define it, so a program may define any of these. A
//! test in `conformance/tests/language/habits.rs` checks that no row is a name of ESL. To add a word, add a
//! row.

use std::sync::LazyLock;

use rustc_hash::FxHashMap;

/// Where other languages write a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordRole {
    /// Where ESL has a variable.
    Value,
    /// At the beginning of a form or of a line.
    Call,
    /// At the beginning of a line, outside of parentheses. The word has another meaning within them.
    Line,
}

/// A foreign word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignWord {
    /// The word, as its language writes it.
    pub word: &'static str,
    /// Where it stands.
    pub role: WordRole,
    /// The languages, as messages name them.
    pub languages: &'static str,
    /// The name or form to write instead.
    pub instead: &'static str,
}

impl ForeignWord {
    /// Returns the message about a use of the word.
    pub fn message(&self) -> String {
        format!("`{}` is a word of {}, not of ESL", self.word, self.languages)
    }

    /// Returns the advice on a use of the word.
    pub fn help(&self) -> String {
        // Advice of several parts has its own marks.
        if self.instead.contains('`') {
            format!("write {}", self.instead)
        } else {
            format!("write `{}`", self.instead)
        }
    }
}

/// Returns the word that stands for a value and is read as a symbol of this name.
pub fn value(name: &str) -> Option<&'static ForeignWord> {
    find(name, |role| role == WordRole::Value)
}

/// Returns the word that begins a form and is read as a symbol of this name.
pub fn call(name: &str) -> Option<&'static ForeignWord> {
    find(name, |role| role == WordRole::Call)
}

/// Returns the word that begins a statement. Upper and lower case do not differ.
pub(super) fn statement(word: &str) -> Option<&'static ForeignWord> {
    find(&word.to_uppercase(), |role| role != WordRole::Value)
}

fn find(name: &str, has_role: impl Fn(WordRole) -> bool) -> Option<&'static ForeignWord> {
    static BY_NAME: LazyLock<FxHashMap<String, Vec<&'static ForeignWord>>> = LazyLock::new(|| {
        let mut words: FxHashMap<String, Vec<_>> = FxHashMap::default();
        for word in WORDS {
            // `||` is read as the symbol without a name.
            let name = if word.word == "||" { String::new() } else { word.word.to_uppercase() };
            words.entry(name).or_default().push(word);
        }
        words
    });
    BY_NAME.get(name)?.iter().copied().find(|word| has_role(word.role))
}

macro_rules! words {
    ($($languages:literal { $($role:ident $word:literal => $instead:literal;)* })*) => {
        /// The table.
        pub const WORDS: &[ForeignWord] = &[$($(
            ForeignWord { word: $word, role: WordRole::$role, languages: $languages, instead: $instead },
        )*)*];
    };
}

words! {
"Python" {
    Value "None" => "nil";
    Value "True" => "t";
    Value "False" => "nil";
    Value "self" => "the name of a parameter, such as `robot`";
    Call "def" => "(defun name (parameters) …)";
    Call "elif" => "(cond (test …) (test …) (t …))";
    Call "except" => "(handler-case form (error (e) …))";
    Call "raise" => "(fail :cause)";
    Call "pass" => "nil";
    Call "del" => "(remhash key table)";
    Call "len" => "(length sequence)";
    Call "str" => "(format nil \"~a\" value)";
    Call "range" => "(loop for i from 0 below n …)";
    Call "isinstance" => "(typep value 'type)";
    Call "enumerate" => "(loop for item in list for i from 0 …)";
    Call "yield" => "(signal event value)";
    Call "await" => "(wait-for event)";
    Call "async" => "(spawn () …)";
    Line "global" => "(defvar *name* value)";
    Line "from" => "(require \"module\")";
    Line "with" => "(unwind-protect form cleanup …)";
}
"JavaScript" {
    Line "let" => "(let ((name value)) …)";
    Line "catch" => "(handler-case form (error (e) …))";
    Line "throw" => "(fail :cause)";
    Value "undefined" => "nil";
    Value "this" => "the name of a parameter, such as `robot`";
    Call "var" => "(let ((name value)) …)";
    Call "const" => "(let ((name value)) …)";
    Call "console.log" => "(print value)";
    Call "typeof" => "(type-of value)";
    Call "new" => "(make-name :slot value)";
    Call "foreach" => "(dolist (item list) …)";
    Call "===" => "(equal a b)";
    Call "!==" => "(not (equal a b))";
    Call "??" => "(or a b)";
    Line "export" => "(defpackage :name (:export …))";
    Line "function" => "(defun name (parameters) …)";
}
"Python and JavaScript" {
    Line "import" => "(require \"module\")";
    Line "finally" => "(unwind-protect form cleanup …)";
}
"C and JavaScript" {
    Line "do" => "(loop do … while test)";
    Line "case" => "(case value (key …) (t …))";
    Value "null" => "nil";
    Call "&&" => "(and a b)";
    Call "||" => "(or a b)";
    Call "!" => "(not value)";
    Call "++" => "(incf place)";
    Call "--" => "(decf place)";
    Call "switch" => "(case value (key …) (t …))";
    Call "enum" => "(deftype name () '(member …))";
}
"C, JavaScript and Python" {
    Call "while" => "(loop while test do …)";
    Call "for" => "(loop for item in list do …)";
    Call "else" => "(if test then else)";
    Call "try" => "(handler-case form (error (e) …))";
    Call "class" => "(defstruct name slot …)";
    Call "!=" => "(/= a b)";
    Call "==" => "(= a b)";
    Call "+=" => "(incf place amount)";
    Call "-=" => "(decf place amount)";
    Call "*=" => "(setf place (* place factor))";
    Call "%" => "(mod a b)";
    Call "^" => "`(expt base power)` or `(logxor a b)`";
    Call "<<" => "(ash n bits)";
    Call ">>" => "(ash n (- bits))";
    Line "if" => "(if test then else)";
    Line "return" => "the value as the last form of the function, or `(return-from name value)`";
    Line "break" => "(return)";
}
"C" {
    Value "nullptr" => "nil";
    Call "int" => "(let ((name value)) …)";
    Call "double" => "(let ((name value)) …)";
    Line "char" => "(let ((name value)) …)";
    Call "bool" => "(let ((name value)) …)";
    Call "void" => "(defun name (parameters) …)";
    Call "auto" => "(let ((name value)) …)";
    Call "static" => "(defvar *name* value)";
    Call "struct" => "(defstruct name slot …)";
    Call "typedef" => "(deftype name () type)";
    Call "printf" => "(format t \"text ~a~%\" value)";
    Call "sprintf" => "(format nil \"text ~a\" value)";
    Call "puts" => "(write-line \"text\")";
    Call "strlen" => "(length string)";
    Call "strcmp" => "(string= a b)";
    Call "atoi" => "(parse-integer string)";
    Call "usleep" => "(sleep seconds)";
    Line "float" => "(let ((name value)) …)";
    Line "using" => "(require \"module\")";
}
"Scheme" {
    Value "else" => "t";
    Value "#t" => "t";
    Value "#f" => "nil";
    Call "define" => "`(defun name (parameters) …)` or `(defvar *name* value)`";
    Call "set!" => "(setf place value)";
    Call "begin" => "(progn …)";
    Call "letrec" => "(labels ((name (parameters) …)) …)";
    Call "call/cc" => "(block name … (return-from name value))";
    Call "display" => "(princ value)";
    Call "newline" => "(terpri)";
    Call "define-record-type" => "(defstruct name slot …)";
    Call "define-syntax" => "(defmacro name (parameters) …)";
    Call "null?" => "(null list)";
    Call "pair?" => "(consp value)";
    Call "list?" => "(listp value)";
    Call "zero?" => "(zerop number)";
    Call "even?" => "(evenp number)";
    Call "odd?" => "(oddp number)";
    Call "number?" => "(numberp value)";
    Call "string?" => "(stringp value)";
    Call "symbol?" => "(symbolp value)";
    Call "procedure?" => "(functionp value)";
    Call "eq?" => "(eq a b)";
    Call "eqv?" => "(eql a b)";
    Call "equal?" => "(equal a b)";
    Call "string-append" => "(concatenate 'string a b)";
    Call "number->string" => "(format nil \"~a\" number)";
    Call "string->number" => "(parse-integer string)";
    Call "symbol->string" => "(symbol-name symbol)";
    Call "string->symbol" => "(intern string)";
    Call "vector-ref" => "(aref vector index)";
    Call "vector-set!" => "(setf (aref vector index) value)";
    Call "list-ref" => "(nth index list)";
    Call "hash-ref" => "(gethash key table)";
    Call "hash-set!" => "(setf (gethash key table) value)";
    Call "for-each" => "(mapc #'function list)";
    Call "filter" => "(remove-if-not #'test list)";
    Call "fold-left" => "(reduce #'function list :initial-value value)";
    Call "foldl" => "(reduce #'function list :initial-value value)";
    Call "make-vector" => "(make-array size)";
    Call "dynamic-wind" => "(unwind-protect form cleanup …)";
    Call "let-values" => "(multiple-value-bind (names) form …)";
}
"Clojure" {
    Call "defn" => "(defun name (parameters) …)";
    Call "fn" => "(lambda (parameters) …)";
    Call "println" => "(print value)";
    Call "swap!" => "(setf place (function place))";
    Call "conj" => "(cons item list)";
}
"Emacs Lisp" {
    Call "message" => "(format t \"text ~a~%\" value)";
    Call "concat" => "(concatenate 'string a b)";
    Call "save-excursion" => "(unwind-protect form cleanup …)";
}
"Go and Rust" {
    Call "func" => "(defun name (parameters) …)";
    Call "println!" => "(format t \"text ~a~%\" value)";
}
}
