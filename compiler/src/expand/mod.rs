//! The expander: forms to the core language. It runs macros' calls, checks special forms, and resolves names.
//!
//! [`Expander`] is a machine of steps: it never runs a macro itself but stops with [`Event::Macro`], and goes on when
//! it is told the expansion. It takes no native stack in proportion to the program, see `machine.rs`.
//!
//! # Operators for the library
//!
//! Besides the operators of the standard that `operator.rs` lists, these, internal to the package `ESL`, are there for
//! the library's macros to expand into:
//!
//! | operator | what it does |
//! |---|---|
//! | `(%named-lambda name lambda-list . body)` | a function that is shown as `name`; if that is a function's name, it is also the block around the body |
//! | `(%macro-lambda shown name lambda-list . body)` | the function of a macro: takes a form and an environment, takes the form apart; see `destructure.rs` for the library functions that it calls |
//! | `(%call-global name argument*)` | calls the global function `name`, or `(setf name)`, whatever local function has its name |
//! | `(%apply-global name argument* list)` | likewise, the last argument a list of arguments |
//! | `(%modify (old (name form)*) place new [result])` | replaces the value of a place by that of `new`, where `old` is the value it had; the subforms of the place are evaluated first, then the forms in order |
//! | `(%handler-case form (type ([variable]) . body)*)` | unwinds to here and runs a body when a condition of the type is signalled |
//! | `(%with-handlers list . body)` | runs the body with the list of `(type . function)` as handlers |
//! | `(%with-mask height . body)` | runs the body with control entries from that height on masked |
//! | `(%with-recovery table (%named-lambda …) . body)` | runs the body with recovery procedures: see `core.rs` for the table and the function |
//! | `(%with-failure-cleanup form . body)` | runs the body; evaluates the form if a failure, an abort or an expired limit leaves it |
//! | `(%clause where . body)` | the body, as that of a recovery clause: warns at the datum `where` if control can fall off its end |
//! | `(%cause cause where . body)` | the body, which names a cause of failures at the datum `where`: warns if others are declared and this is not |
//! | `(%compiler-warning code message where . body)` | the body; warns, under a code of the table in `diagnostic/code.rs`, at the place of the datum `where` (not evaluated) |
//! | `(%backquote template)`, `(%unquote form)`, `(%unquote-splicing form)` | what the reader makes of `` ` ``, `,` and `,@` |
//!
//! Calls of the functions `(%slot 'class index instance)`, `(%set-slot 'class index instance value)` and
//! `(%instance-p 'class object)` are opened up if class and index are literal.
//!
//! # What the library records
//!
//! The property `%setf` of a symbol `f` says how `(f argument…)` is set:
//!
//! * a symbol `u` (short `defsetf`): by `(u argument… value)`, where `u` is a function or macro that returns the value;
//! * a list `(m n)` (long `defsetf`): by the form `(m (store…) argument…)` with `n` stores, where `m` is a macro, the
//!   arguments are constants or variables, and each store is a variable that holds a new value;
//! * a list `(:expander m)` (`define-setf-expander`): the macro `m`, called with the place as its form, returns the list
//!   of five parts: variables, forms, stores, writer, reader.
//!
//! The property `%compiler-macro` of a function's name is the name of a macro that is given calls of the function, and
//! returns a better form or the call itself.
//!
//! The property `%cause` of a symbol says that it is a cause of failures: a list of its parents (`define-cause`), or the name of
//! the type of conditions that it is the cause of. The property `%used` of `define-cause` says that causes are declared.
//!
//! The property `%symbol-macro` of a symbol is the form that it stands for as a variable (`define-symbol-macro`).
//!
//! # What the expander calls
//!
//! The library functions that `destructure.rs` describes, and for places `(%putf list indicator value)`, the property list with that
//! value; `(%remf list indicator)`, the property list without it and whether it was there; and the standard's `dpb`,
//! `deposit-field`, `adjoin`, `replace`, `nthcdr` and `c…r`.

mod backquote;
mod binding;
mod body;
mod call;
mod chunk;
mod control;
mod define;
mod destructure;
mod form;
mod handler;
mod lambda;
mod lambda_list;
mod local;
mod machine;
mod modify;
pub mod operator;
mod origin;
mod place;
pub mod print;
mod recovery;
mod scope;
mod standard_place;
mod toplevel;
mod unit;
mod variable;

use esl_bytecode::compile::{Answer, Environment};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;

pub use chunk::{Chunk, Purpose};
pub use machine::Event;

use machine::Machine;
use toplevel::Top;

/// Expands the forms of one compilation unit, one after another.
#[derive(Debug)]
pub struct Expander {
    machine: Machine,
}

impl Default for Expander {
    fn default() -> Expander {
        Expander::new()
    }
}

impl Expander {
    /// An expander that has seen nothing yet.
    pub fn new() -> Expander {
        Expander { machine: Machine::new() }
    }

    /// Begins a form of a file. The one before must be [`Event::Done`].
    pub fn begin_file_form(&mut self, form: Datum) {
        self.machine.begin(form, Top::file());
    }

    /// Begins a form for `eval`: the last chunk that is to be emitted gives its value.
    pub fn begin_evaluation(&mut self, form: Datum) {
        self.machine.begin(form, Top::evaluate());
    }

    /// Works until something is needed from outside. `charge` is called with the number of jobs done.
    pub fn run(&mut self, environment: &mut dyn Environment, charge: &mut dyn FnMut(u64)) -> Event {
        self.machine.run(environment, charge)
    }

    /// Takes the answer to the last event.
    pub fn answer(&mut self, answer: Answer) {
        self.machine.answer(answer);
    }

    /// Takes what was found so far.
    pub fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        self.machine.take_diagnostics()
    }

    /// What is found at the end of the unit: names that nobody has defined, calls that do not fit.
    pub fn finish(&mut self, environment: &dyn Environment) -> Vec<Diagnostic> {
        let mut findings = self.machine.take_diagnostics();
        findings.extend(self.machine.unit.finish(environment));
        findings
    }

    /// Whether an error has been found.
    pub fn has_failed(&self) -> bool {
        self.machine.errors() > 0
    }
}
