//! The expander: forms to the core language. It expands macro calls, checks special forms, and resolves
//! names.
//!
//! [`Expander`] works in steps. It never runs a macro itself but stops with [`Stop::Macro`], and continues
//! when it gets the expansion. It takes no native stack in proportion to the program; see `expander.rs`.
//!
//! # Operators for the library
//!
//! Besides the operators of the standard, which `operator.rs` lists, the library's macros may expand into
//! these. They are internal to the package `ESL`.
//!
//! * `(%named-lambda name lambda-list . body)`: a function that is shown as `name`; a function's name is also
//!   the name of the block around the body.
//! * `(%macro-lambda shown name lambda-list . body)`: the function of a macro, which takes a form and an
//!   environment and takes the form apart; `destructure.rs` describes the library functions that it calls.
//! * `(%call-global name argument*)`: calls the global function `name`, or `(setf name)`, even where a local
//!   function has its name.
//! * `(%apply-global name argument* list)`: likewise; the last argument is a list of arguments.
//! * `(%modify (old (name form)*) place new [result])`: replaces the value of a place by that of `new`, where
//!   `old` is the old value; evaluates the subforms of the place first, then the forms in order.
//! * `(%handler-case form (type ([variable]) . body)*)`: unwinds to here and runs a body when a condition of
//!   the type is signalled.
//! * `(%with-handlers list . body)`: runs the body with the list of `(type . function)` as handlers.
//! * `(%with-mask height . body)`: runs the body with control entries from that height on masked.
//! * `(%with-recovery table (%named-lambda …) . body)`: runs the body with recovery procedures; `core.rs`
//!   describes the table and the function.
//! * `(%with-failure-cleanup form . body)`: runs the body; evaluates the form if a failure, an abort or an
//!   expired limit leaves it.
//! * `(%clause where . body)`: the body of a recovery clause; warns at the datum `where` if control can fall
//!   off its end.
//! * `(%cause cause where . body)`: the body, which names a cause of failures at the datum `where`; warns if
//!   others are declared and this one is not.
//! * `(%compiler-warning code message where . body)`: the body; warns, under a code of the table in
//!   `diagnostic/code.rs`, at the place of the datum `where`, which is not evaluated.
//! * `(%backquote template)`, `(%unquote form)`, `(%unquote-splicing form)`: the reader's representation of
//!   `` ` ``, `,` and `,@`.
//!
//! Calls of the functions `(%slot 'class index instance)`, `(%set-slot 'class index instance value)` and
//! `(%instance-p 'class object)` are opened up if class and index are literal.
//!
//! # Records of the library
//!
//! The property `%setf` of a symbol `f` says how `(f argument…)` is set:
//!
//! * a symbol `u` (short `defsetf`): by `(u argument… value)`, where `u` is a function or macro that returns
//!   the value;
//! * a list `(m n)` (long `defsetf`): by the form `(m (store…) argument…)` with `n` stores, where `m` is a
//!   macro, the arguments are constants or variables, and each store is a variable that holds a new value;
//! * a list `(:expander m)` (`define-setf-expander`): the macro `m`, called with the place as its form,
//!   returns the list of five parts: variables, forms, stores, writer, reader.
//!
//! The property `%compiler-macro` of a function's name is the name of a macro that is given calls of the
//! function, and returns a better form or the call itself.
//!
//! The property `%cause` of a symbol says that it is a cause of failures. Its value is a list of the cause's
//! parents (`define-cause`), or the name of the condition type of which the symbol is the cause. The property
//! `%used` of `define-cause` says that the program declares causes.
//!
//! The property `%symbol-macro` of a symbol is the form that it stands for as a variable
//! (`define-symbol-macro`).
//!
//! # Functions that the expander calls
//!
//! The library functions that `destructure.rs` describes; for places, `(%putf list indicator value)`, which
//! returns the property list with that value, and `(%remf list indicator)`, which returns the property list
//! without it and whether it was there; and the standard's `dpb`, `deposit-field`, `adjoin`, `replace`,
//! `nthcdr` and `c…r`.
//!
//! # Layers
//!
//! Data and tables come first (`form`, `scope`, `lambda_list`, `function`, `setf`, `origin`, `job`, `chunk`,
//! `failure`, `trap`, `global`, `argument`, `directive`, `warning`, `unit`), then the [`Expander`], its
//! findings (`finding`) and its checks of forms as they are written (`check`, `twice`), then one file for
//! each family of forms, whose methods are methods of the `Expander`, and last the table of operators. A
//! file uses only files before it; `tests/layers.rs` holds that.

mod allowed;
mod argument;
mod backquote;
mod binding;
mod body;
mod build;
mod call;
mod check;
mod chunk;
mod control;
mod define;
mod destructure;
mod directive;
mod ending;
mod expander;
mod failure;
mod finding;
mod form;
mod function;
mod global;
mod handler;
mod job;
mod lambda;
mod lambda_list;
mod local;
mod modify;
mod operation;
mod operation_check;
pub mod operator;
mod origin;
mod place;
pub mod print;
mod recovery;
mod scope;
mod setf;
mod standard_place;
mod toplevel;
mod trap;
mod twice;
mod type_use;
mod unit;
mod values;
mod variable;
mod warning;

pub use chunk::{Chunk, Purpose};
pub use expander::{Expander, Stop};
pub use failure::{FailurePlace, MacroFailure};
pub use unit::UnitFindings;
pub use warning::AllowedWarnings;
