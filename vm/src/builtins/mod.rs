//! The functions that are written in Rust, one file for each domain.
//!
//! Rules for a builtin:
//! - It never calls back into the language. It may ask for a call in its place ([`Exit::Call`]).
//! - Its work is bounded: up to [`LIMIT`] units, for which it charges; above, it gives [`Exit::Slowly`]
//!   before it has had any effect, or fails.
//! - It allocates before it has any effect, since [`Exit::Collect`] means that it is done again from the
//!   start.
//! - No collection happens while it runs, so values need no rooting.
//!
//! The ESL twins are the functions in the `slowly` column of the table, `%SLOW-` and the builtin's name, with
//! the same arguments. A twin does what the builtin does, failures included, in steps that can be
//! interrupted; it may call the builtin on parts, and may not be given the whole again:
//! - Lists: plain loops. `%slow-list-length` walks at two speeds and gives `NIL` for a circle; all others may
//!   go round for ever.
//! - Vectors and strings: parts of at most 16 384 elements, by the `start` and `end` of the builtin, or by
//!   `%replace` into a fresh `%make-vector` or `%make-string`.
//! - `%slow-+`, `%slow--`, `%slow-*`, `%slow-/` and their like of more than two numbers: pair by pair. Of two
//!   large integers, the product by halves of the longer one (`ash`, `%ldb`); quotients by long division, a
//!   few limbs of the dividend at a time, from the top; `gcd` by `%gcd-step` until the second value is 0,
//!   after a `rem` where lengths differ much. Ratios by their numerators and denominators. `expt` by repeated
//!   squares, `isqrt` by Newton's steps, digits by halves (`truncate` by a power of the radix).
//! - Hash tables: the hash by `%table-hash` or the hash function of the program (second and third value of
//!   `%hash-table-test`), then the test on the keys in `%table-candidates`. A key found is read, set or
//!   deleted with `%table-value`, `%set-table-value`, `%table-delete`; one not found is added with
//!   `%table-add` and the `%table-serial` from before. Where one of these says that the table has changed
//!   meanwhile, all over again.
//! - `%slow-table-next`: the builtin from `%table-skip` on.
//! - `%slow-wait-for-events`: all that has options.
//!
//! [`Exit::Call`]: crate::raise::Exit::Call
//! [`Exit::Slowly`]: crate::raise::Exit::Slowly
//! [`Exit::Collect`]: crate::raise::Exit::Collect

use esl_bytecode::for_each_builtin;

use crate::vm::Natives;

/// Units of work (list cells, elements, nodes) that one call of a builtin may do.
pub const LIMIT: usize = 4096;

/// Elements that one call of a builtin may copy where that is little more than copying memory.
pub(crate) const COPY_LIMIT: usize = 1 << 15;

macro_rules! define_natives {
    ($( $(#[doc = $doc:literal])* $id:ident = $native:path, $visibility:ident $name:literal
        ($lambda_list:literal) shares $shares:ident $(-> $results:ident)?
        $(gives $gives:ident $(or $or:ident)?)? $(tests $tests:ident)? $(slowly $slowly:literal)?; )*) => {
        /// The implementations, by the numbers of their rows. A row whose path names no function does not
        /// compile.
        pub(crate) static NATIVES: Natives = [$( $native ),*];
    };
}

for_each_builtin!(define_natives);

pub(crate) mod array;
mod call;
mod character;
mod class;
mod coordination;
mod database;
mod define;
mod equality;
pub(crate) mod eval;
pub(crate) mod event;
mod expect;
mod failure;
mod file;
mod float;
mod input;
mod instance;
mod integer;
mod json;
mod list;
mod lookup;
mod net;
mod number;
mod operation;
mod outside;
mod package;
mod print;
mod reading;
mod rights;
mod search;
mod sequence;
pub(crate) mod stream;
mod string;
mod structure;
mod suspension;
mod symbol;
mod table;
mod task;
pub(crate) mod types;

#[cfg(test)]
mod tests;
