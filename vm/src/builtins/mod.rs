//! The functions that are written in Rust, one file for each domain.
//!
//! Rules for a builtin:
//! - It never calls back into the language. It may ask for a call in its place ([`Exit::Call`]).
//! - Its work is bounded: up to [`LIMIT`] units, for which it charges; above, it gives [`Exit::Slowly`] before it has had
//!   any effect, or fails.
//! - It allocates before it has any effect, since [`Exit::Collect`] means that it is done again from the start.
//! - No collection happens while it runs, so values need no rooting.
//!
//! [`Exit::Call`]: crate::raise::Exit::Call
//! [`Exit::Slowly`]: crate::raise::Exit::Slowly
//! [`Exit::Collect`]: crate::raise::Exit::Collect

use esl_bytecode::builtin::{BUILTINS, Builtin};

use crate::raise::Outcome;
use crate::value::Value;
use crate::vm::Vm;

/// Units of work (list cells, elements, nodes) that one call of a builtin may do.
pub const LIMIT: usize = 4096;

/// Elements that one call of a builtin may copy where that is little more than copying memory.
pub(crate) const COPY_LIMIT: usize = 1 << 17;

/// A function that is written in Rust. The number of arguments has been checked against the table.
pub type Native = fn(&mut Vm, &[Value]) -> Outcome;

/// The implementations, by the numbers of their rows.
pub(crate) static NATIVES: [Native; BUILTINS.len()] = {
    let mut table: [Native; BUILTINS.len()] = [define::set_function; BUILTINS.len()];
    let mut number = 0;
    while number < BUILTINS.len() {
        table[number] = native(BUILTINS[number].builtin);
        number += 1;
    }
    table
};

/// The implementation of each row of the table. A row without an arm here does not compile.
pub const fn native(builtin: Builtin) -> Native {
    match builtin {
        Builtin::SetFunction => define::set_function,
        Builtin::SetMacro => define::set_macro,
        Builtin::ProclaimSpecial => define::proclaim_special,
        Builtin::DefineConstant => define::define_constant,
        Builtin::Funcall => control::funcall,
        Builtin::Apply => control::apply,
        Builtin::Values => control::values,
        Builtin::ValuesList => control::values_list,
        Builtin::Identity => types::identity,
        Builtin::Eq => types::eq,
        Builtin::Eql => types::eql,
        Builtin::Not => types::null,
        Builtin::Null => types::null,
        Builtin::Consp => types::consp,
        Builtin::Atom => types::atom,
        Builtin::Listp => types::listp,
        Builtin::Symbolp => types::symbolp,
        Builtin::Keywordp => types::keywordp,
        Builtin::Numberp => types::numberp,
        Builtin::Realp => types::realp,
        Builtin::Rationalp => types::rationalp,
        Builtin::Integerp => types::integerp,
        Builtin::Floatp => types::floatp,
        Builtin::Characterp => types::characterp,
        Builtin::Stringp => types::stringp,
        Builtin::Vectorp => types::vectorp,
        Builtin::SimpleVectorp => types::simple_vector_p,
        Builtin::Arrayp => types::arrayp,
        Builtin::Functionp => types::functionp,
        Builtin::HashTablep => types::hash_table_p,
        Builtin::Add => number::add,
        Builtin::Subtract => number::subtract,
        Builtin::Multiply => number::multiply,
        Builtin::Divide => number::divide,
        Builtin::Increment => number::increment,
        Builtin::Decrement => number::decrement,
        Builtin::Floor => number::floor,
        Builtin::Ceiling => number::ceiling,
        Builtin::Truncate => number::truncate,
        Builtin::Round => number::round,
        Builtin::Mod => number::modulo,
        Builtin::Rem => number::remainder,
        Builtin::LogAnd => integer::logand,
        Builtin::LogIor => integer::logior,
        Builtin::LogXor => integer::logxor,
        Builtin::Ash => integer::ash,
        Builtin::NumEqual => number::num_equal,
        Builtin::NumNotEqual => number::num_not_equal,
        Builtin::Less => number::less,
        Builtin::LessEqual => number::less_equal,
        Builtin::Greater => number::greater,
        Builtin::GreaterEqual => number::greater_equal,
        Builtin::Zerop => number::zerop,
        Builtin::Plusp => number::plusp,
        Builtin::Minusp => number::minusp,

        Builtin::Cons => list::cons,
        Builtin::Car => list::car,
        Builtin::Cdr => list::cdr,
        Builtin::Cadr => list::cadr,
        Builtin::Cddr => list::cddr,
        Builtin::First => list::car,
        Builtin::Rest => list::cdr,
        Builtin::Second => list::cadr,
        Builtin::Rplaca => list::rplaca,
        Builtin::Rplacd => list::rplacd,
        Builtin::SetCar => list::set_car,
        Builtin::SetCdr => list::set_cdr,
        Builtin::List => list::list,
        Builtin::ListStar => list::list_star,
        Builtin::Append => list::append,

        Builtin::Vector => array::vector,
        Builtin::Svref => array::svref,
        Builtin::SetSvref => array::set_svref,
        Builtin::Aref => array::aref,
        Builtin::SetAref => array::set_aref,

        Builtin::SlotOf => structure::slot,
        Builtin::SetSlotOf => structure::set_slot,
        Builtin::IsInstance => structure::is_instance,
        Builtin::ControlHeight => control::control_height,
        Builtin::NextHandler => control::next_handler,
        Builtin::TakeCase => control::take_case,
        Builtin::EndTask => control::end_task,
        Builtin::Exit => control::exit,
        Builtin::Backtrace => control::backtrace,
        Builtin::CallHost => crate::embed::call_host,
    }
}

pub(crate) mod array;
mod control;
mod define;
mod expect;
mod float;
mod integer;
mod list;
mod lookup;
mod number;
mod sequence;
mod stream;
mod structure;
pub(crate) mod types;
