//! The table of operators that the compiler itself expands: special forms, the standard macros that are
//! written in Rust, and the library's internal operators.
//!
//! A row is a name and the function that expands a form of it. This table is the only list of operators.

use std::sync::LazyLock;

use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::expander::{Expander, Operator};
use super::{
    allowed, backquote, binding, call, control, define, destructure, handler, lambda, local, modify,
    recovery, values, variable,
};

/// The operators of the package `COMMON-LISP`.
const STANDARD: &[(&str, Operator)] = &[
    ("AND", control::and),
    ("APPLY", call::apply),
    ("BLOCK", control::block),
    ("CATCH", control::catch),
    ("COND", control::cond),
    ("DECF", modify::decf),
    ("DECLAIM", define::declaim),
    ("DECLARE", control::misplaced_declare),
    ("DEFMACRO", define::defmacro),
    ("DEFUN", define::defun),
    ("DESTRUCTURING-BIND", destructure::destructuring_bind),
    ("EVAL-WHEN", control::eval_when),
    ("FLET", local::flet),
    ("FUNCALL", call::funcall),
    ("FUNCTION", lambda::function),
    ("GO", control::go),
    ("IF", control::if_),
    ("IN-PACKAGE", define::in_package),
    ("INCF", modify::incf),
    ("LABELS", local::labels),
    ("LAMBDA", lambda::lambda),
    ("LET", binding::let_in_parallel),
    ("LET*", binding::let_in_order),
    ("LOAD-TIME-VALUE", define::load_time_value),
    ("LOCALLY", binding::locally),
    ("MACROLET", local::macrolet),
    ("MULTIPLE-VALUE-BIND", binding::multiple_value_bind),
    ("MULTIPLE-VALUE-CALL", values::multiple_value_call),
    ("MULTIPLE-VALUE-LIST", values::multiple_value_list),
    ("MULTIPLE-VALUE-PROG1", control::multiple_value_prog1),
    ("MULTIPLE-VALUE-SETQ", values::multiple_value_setq),
    ("OR", control::or),
    ("POP", modify::pop),
    ("PROGN", control::progn),
    ("PROGV", binding::progv),
    ("PSETF", modify::psetf),
    ("PSETQ", variable::psetq),
    ("PUSH", modify::push),
    ("PUSHNEW", modify::pushnew),
    ("QUOTE", control::quote),
    ("REMF", modify::remf),
    ("RETURN", control::return_),
    ("RETURN-FROM", control::return_from),
    ("ROTATEF", modify::rotatef),
    ("SETF", modify::setf),
    ("SETQ", variable::setq),
    ("SHIFTF", modify::shiftf),
    ("SYMBOL-MACROLET", binding::symbol_macrolet),
    ("TAGBODY", control::tagbody),
    ("THE", control::the),
    ("THROW", control::throw),
    ("UNWIND-PROTECT", control::unwind_protect),
    ("VALUES", values::values),
];

/// The operators of the package `ESL`. A name that begins with `%` is internal to it.
const OWN: &[(&str, Operator)] = &[
    ("%APPLY-GLOBAL", call::apply_global),
    ("%BACKQUOTE", backquote::backquote),
    ("%CALL-GLOBAL", call::call_global),
    ("%CAUSE", recovery::cause),
    ("%CLAUSE", recovery::clause),
    ("%COMPILER-WARNING", define::compiler_warning),
    ("%HANDLER-CASE", handler::handler_case),
    ("%MACRO-LAMBDA", destructure::macro_lambda),
    ("%MODIFY", modify::modify),
    ("%NAMED-LAMBDA", lambda::named_lambda),
    ("%PLACE-PARTS", modify::place_parts),
    ("%QUOTE-OBJECT", control::quote_object),
    ("%UNQUOTE", backquote::misplaced_unquote),
    ("%UNQUOTE-SPLICING", backquote::misplaced_unquote),
    ("%WITH-ALLOWED-WARNINGS", allowed::with_allowed_warnings),
    ("%WITH-FAILURE-CLEANUP", recovery::with_failure_cleanup),
    ("%WITH-HANDLERS", control::with_handlers),
    ("%WITH-MASK", control::with_mask),
    ("%WITH-RECOVERY", recovery::with_recovery),
    ("ABORT", recovery::abort),
    ("RETRY", recovery::retry),
];

static TABLE: LazyLock<FxHashMap<Symbol, Operator>> = LazyLock::new(|| {
    let standard = STANDARD.iter().map(|&(name, operator)| (Symbol::cl(name), operator));
    let internal = OWN.iter().map(|&(name, operator)| (Symbol::esl(name), operator));
    standard.chain(internal).collect()
});

/// Returns the operator called `symbol`.
fn find(symbol: &Symbol) -> Option<Operator> {
    TABLE.get(symbol).copied()
}

/// Returns the names of all operators that the compiler itself expands. Of these, `funcall`, `apply` and
/// `values` are functions too.
pub fn names() -> impl Iterator<Item = Symbol> {
    TABLE.keys().cloned()
}

impl Expander {
    /// Creates an expander that has not seen any form.
    pub fn new() -> Expander {
        Expander::with_operators(find)
    }
}

impl Default for Expander {
    fn default() -> Expander {
        Expander::new()
    }
}
