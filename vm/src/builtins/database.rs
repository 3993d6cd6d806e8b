//! The logical database: changes of facts, and queries in steps. Code that calls functions of the program is
//! ESL, in `stdlib/database.esl`.

use esl_database::{Database, Effort, FormulaError, Progress, QueryError};

use crate::heap::{AllocError, Heap};
use crate::raise::{Exit, Outcome, Raised};
use crate::report;
use crate::table::Table;
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Units of work of one step of a query: for a fact looked at, a goal, an answer 8 of them, and one for each
/// further argument.
const STEP: usize = 8 * 1024;

/// Makes what the database needs of the heap, when it is used first.
fn prepare(vm: &mut Vm) -> Result<(), Exit> {
    if let Some(objects) = vm.database.prepare(&mut vm.heap)? {
        vm.embedder.pin(&mut vm.heap, objects);
    }
    Ok(())
}

/// Turns a fault of a formula into a failure of the program.
fn checked<T>(vm: &mut Vm, outcome: Result<T, FormulaError>) -> Result<T, Exit> {
    match outcome {
        Ok(value) => Ok(value),
        Err(FormulaError::Room(error)) => Err(error.into()),
        Err(FormulaError::Variable(fact)) => {
            checked(vm, Err(FormulaError::Malformed(fact, "a fact, which has no variables")))
        }
        Err(FormulaError::Malformed(v, expected)) => {
            let found = vm.describe(v);
            vm.exchange.program_error(format!("expected {expected}, found {found}"))
        }
    }
}

/// Returns whether the table `locks` has entries: then a change has to be made where they are told of it.
fn has_locks(vm: &Vm, locks: Value) -> bool {
    Table::of(&vm.heap, locks).is_some_and(|table| table.count(&vm.heap) > 0)
}

/// The fact that a change was about, and how it went.
type FactChange<T> = (Value, Result<T, FormulaError>);

/// Changes the facts by the first argument. Returns `None` and does nothing if the second one has locks.
#[inline]
fn change_unlocked<T>(
    vm: &mut Vm,
    arguments: &[Value],
    change: impl FnOnce(&mut Database, &mut Heap, Value, &mut usize) -> Result<T, FormulaError>,
) -> Result<Option<FactChange<T>>, Exit> {
    let [fact, locks] = exactly(arguments);
    vm.scheduler.point()?;
    if has_locks(vm, locks) {
        return Ok(None);
    }
    prepare(vm)?;
    let mut work = 0;
    let outcome = change(&mut vm.database, &mut vm.heap, fact, &mut work);
    vm.exchange.charge(4 * work);
    Ok(Some((fact, outcome)))
}

pub(super) fn assert_fact(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some((fact, outcome)) = change_unlocked(vm, arguments, Database::assert)? else {
        return Ok(vm.names.known.locked);
    };
    let changed = checked(vm, outcome)?;
    if vm.watch.is_followed && changed.is_true() {
        report::tell_of_change(vm, fact, true);
    }
    Ok(changed)
}

/// Returns the name and the width of a property that is about to be made or dropped.
fn property(vm: &mut Vm, arguments: &[Value]) -> Result<(Value, usize), Exit> {
    let [name, width] = exactly(arguments);
    vm.scheduler.point()?;
    prepare(vm)?;
    if !vm.names.is_symbol(&vm.heap, name) {
        return vm.exchange.type_error(name, "SYMBOL");
    }
    Ok((name, vm.exchange.count(width)?))
}

pub(super) fn make_property(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (name, width) = property(vm, arguments)?;
    let mut work = 0;
    let made = vm.database.define_property(&mut vm.heap, name, width, &mut work)?;
    vm.exchange.charge(4 * work);
    Ok(made.into())
}

pub(super) fn drop_property(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (name, width) = property(vm, arguments)?;
    vm.database.drop_property(&mut vm.heap, name, width)?;
    Ok(name)
}

pub(super) fn property_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    prepare(vm)?;
    let mut work = 0;
    let outcome = vm.database.property_value(&mut vm.heap, arguments[0], &mut work);
    vm.exchange.charge(4 * work);
    let value = checked(vm, outcome)?;
    if value == Value::UNBOUND {
        vm.give_values(&[Value::NIL, Value::NIL])
    } else {
        vm.give_values(&[value, Value::T])
    }
}

pub(super) fn retract_fact(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some((fact, outcome)) = change_unlocked(vm, arguments, Database::retract)? else {
        return Ok(vm.names.known.locked);
    };
    match outcome {
        Err(FormulaError::Variable(_)) => Ok(Value::small(0)),
        outcome => {
            let changed: Value = checked(vm, outcome)?.into();
            if vm.watch.is_followed && changed != Value::small(0) {
                report::tell_of_change(vm, fact, false);
            }
            Ok(changed)
        }
    }
}

pub(super) fn define_rule(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    prepare(vm)?;
    let [head, body, source] = exactly(arguments);
    let mut work = 0;
    let outcome = vm.database.define_rule(&mut vm.heap, [head, body, source], &mut work);
    vm.exchange.charge(4 * work);
    checked(vm, outcome)?;
    Ok(Value::T)
}

pub(super) fn remove_rule(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    prepare(vm)?;
    let mut work = 0;
    let outcome = vm.database.remove_rule(&mut vm.heap, arguments[0], &mut work);
    vm.exchange.charge(4 * work);
    Ok(checked(vm, outcome)?.into())
}

pub(super) fn open_query(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    prepare(vm)?;
    let [query, bindings, facts] = exactly(arguments);
    let mut work = 0;
    let outcome = vm.database.open(&mut vm.heap, query, bindings, facts.is_true(), &mut work);
    vm.exchange.charge(4 * work);
    Ok(Value::index(checked(vm, outcome)? as usize))
}

/// Returns the query that a number names.
fn query(vm: &mut Vm, v: Value) -> Result<u64, Exit> {
    Ok(vm.exchange.count(v)? as u64)
}

/// Returns the query that was found, or fails because it is no longer open.
fn open<T>(vm: &mut Vm, found: Option<T>) -> Result<T, Exit> {
    match found {
        Some(value) => Ok(value),
        None => vm.exchange.raise(Raised::Control("the query is no longer open".into())),
    }
}

pub(super) fn query_step(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let key = query(vm, arguments[0])?;
    let mut effort = Effort::of(STEP);
    let progress = vm.database.step(key, &mut effort);
    vm.exchange.charge(effort.spent());
    // If there is no room, the step is done again and goes on from here.
    vm.database.check_room(&mut vm.heap)?;
    match open(vm, progress)? {
        Ok(Progress::More) => Ok(Value::NIL),
        Ok(Progress::Done) => Ok(Value::T),
        Ok(Progress::Test(function, bindings)) => {
            let mut work = 0;
            let function = vm.database.value(&mut vm.heap, function, &mut work)?;
            let bindings = bindings.into_iter().rev().try_fold(Value::NIL, |list, (name, value)| {
                let name = vm.database.value(&mut vm.heap, name, &mut work)?;
                let value = vm.database.value(&mut vm.heap, value, &mut work)?;
                let binding = vm.heap.cons(name, value)?;
                vm.heap.cons(binding, list)
            });
            vm.exchange.charge(4 * work);
            let test = vm.names.known.test;
            let bindings: Result<Value, AllocError> = bindings;
            vm.give_values(&[test, function, bindings?])
        }
        Err(error) => raise_query_error(vm, error),
    }
}

/// Notes why a query cannot be answered.
fn raise_query_error(vm: &mut Vm, error: QueryError) -> Outcome {
    match error {
        QueryError::Circular(functor) => {
            let functor = vm.database.value(&mut vm.heap, functor, &mut 0)?;
            vm.exchange.raise(Raised::Cause("UNSTRATIFIED-RULES", functor))
        }
        QueryError::Unbound(functor) => {
            let functor = vm.database.value(&mut vm.heap, functor, &mut 0)?;
            vm.exchange.raise(Raised::Cause("UNBOUND-LOGICAL-VARIABLE", functor))
        }
        QueryError::TooLarge => vm.exchange.program_error("a rule builds too large a term"),
    }
}

pub(super) fn begin_query(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    prepare(vm)?;
    let [query, bindings] = exactly(arguments);
    let mut work = 0;
    let opened = vm.database.open(&mut vm.heap, query, bindings, false, &mut work);
    let key = checked(vm, opened)?;
    let mut effort = Effort::of(STEP);
    let progress = vm.database.step(key, &mut effort);
    vm.exchange.charge(4 * work + effort.spent());
    match progress {
        Some(Ok(Progress::Done)) => {
            let mut work = 0;
            let answers = vm.database.answers(&mut vm.heap, key, &mut work);
            vm.exchange.charge(4 * work);
            if let Some(Ok(list)) = answers
                && !vm.database.has_all_given(key)
            {
                // The rest is asked for with these answers to begin with.
                return vm.give_values(&[list, Value::index(key as usize), Value::T]);
            }
            vm.database.close(&mut vm.heap, key);
            match answers {
                Some(answers) => {
                    let answers = answers?;
                    vm.give_values(&[answers, Value::NIL, Value::T])
                }
                None => Ok(Value::NIL),
            }
        }
        Some(Err(error)) => {
            let raised = raise_query_error(vm, error);
            vm.database.close(&mut vm.heap, key);
            raised
        }
        _ => vm.give_values(&[Value::NIL, Value::index(key as usize), Value::NIL]),
    }
}

pub(super) fn query_tell(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handle, holds] = exactly(arguments);
    let key = query(vm, handle)?;
    vm.database.tell(key, holds.is_true());
    Ok(Value::NIL)
}

pub(super) fn query_answers(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let key = query(vm, arguments[0])?;
    let mut work = 0;
    let answers = vm.database.answers(&mut vm.heap, key, &mut work);
    vm.exchange.charge(4 * work);
    Ok(open(vm, answers)??)
}

pub(super) fn retract_next(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handle, locks] = exactly(arguments);
    vm.scheduler.point()?;
    if has_locks(vm, locks) {
        return Ok(vm.names.known.locked);
    }
    let key = query(vm, handle)?;
    let mut work = 0;
    let fact = vm.database.retract_next(&mut vm.heap, key, &mut work);
    vm.exchange.charge(4 * work);
    let fact = open(vm, fact)??;
    if vm.watch.is_followed && fact.is_true() {
        report::tell_of_change(vm, fact, false);
    }
    Ok(fact)
}

pub(super) fn close_query(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let key = query(vm, arguments[0])?;
    vm.database.close(&mut vm.heap, key);
    Ok(Value::NIL)
}
