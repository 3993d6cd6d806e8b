//! Types, where they are certain: calls that cannot succeed in any run.
//!
//! For each function of the program, *success types* are inferred: a superset of the arguments with which a
//! call may return, and a superset of its results (Lindahl and Sagonas 2006). A call is warned of only if an
//! argument has no value in common with the need of the function. The types of the functions written in Rust
//! are those of the builtin table, those of the functions in ESL are inferred from the sources of the library
//! when a test compares them with their table.
//!
//! The core of a form is walked in the order of evaluation, with the known types of its variables: after
//! `(+ x 1)` has returned, `x` was a number. A predicate tells more in its branches. Summaries of functions
//! begin with "never returns" and grow until nothing changes; types are sets of few bits, so this ends. A
//! variable that is assigned has all values that it is ever given.
//!
//! Functions that a program may change at run time are not trusted: those that are defined twice, have
//! methods, are mocked, or are named in data. If a clause of a recovery form may put a value in the place of
//! that of a failed builtin, no conclusion is drawn from the calls of builtins.

mod calls;
mod declared;
mod finding;
mod handling;
mod library;
mod messages;
mod program;
mod refine;
mod set;
mod slots;
mod walk;

use esl_bytecode::diagnostic::Diagnostic;
use esl_compiler::diagnostic::Sources;

use crate::forms::CoreForms;
use messages::MessageTypes;
use program::{DefinedBy, ProgramDefinitions};
use walk::TypeWalk;

pub use library::{LibraryTypes, library_types, table_of_library};
pub use messages::{KnownField, MessageFields, compare_message_fields};

/// Walks of one form until all that is left to know of it counts as unknown.
const MOST_WALKS: u32 = 40;

/// Returns warnings about calls that cannot succeed, and about declared types that cannot hold.
pub(crate) fn findings(forms: &CoreForms, sources: &Sources) -> Vec<Diagnostic> {
    let definitions = ProgramDefinitions::new(forms, DefinedBy::Program);
    let mut walk = TypeWalk::new(forms, &definitions);
    infer(&mut walk);
    walk.messages = MessageTypes::new(forms);
    let mut found = walk.report(sources);
    found.extend(declared::findings(&walk, sources));
    found.sort_by_key(|found| (found.primary.span.source, found.primary.span.start, found.message.clone()));
    found.dedup_by(|one, other| one.primary.span == other.primary.span && one.message == other.message);
    found
}

/// Walks forms until nothing changes.
fn infer(walk: &mut TypeWalk<'_>) {
    let mut walks = vec![0; walk.forms.forms.len()];
    while let Some(form) = walk.take_pending() {
        walks[form] += 1;
        if walks[form] > MOST_WALKS {
            walk.give_up(form);
        } else {
            walk.form(form);
        }
    }
}
