//! Values of the two little interpreters that the random tests compare.

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

/// A car and a cdr.
pub(super) type Pair<F> = Rc<(RefCell<Value<F>>, RefCell<Value<F>>)>;

/// A value; `F` is what functions are made of.
pub(super) enum Value<F> {
    Nil,
    True,
    Int(i64),
    Symbol(Symbol),
    Cons(Pair<F>),
    Function(Rc<F>),
    /// Something that is equal only to itself.
    Unique(u64),
}

impl<F> Clone for Value<F> {
    fn clone(&self) -> Value<F> {
        match self {
            Value::Nil => Value::Nil,
            Value::True => Value::True,
            Value::Int(value) => Value::Int(*value),
            Value::Symbol(symbol) => Value::Symbol(symbol.clone()),
            Value::Cons(pair) => Value::Cons(pair.clone()),
            Value::Function(function) => Value::Function(function.clone()),
            Value::Unique(id) => Value::Unique(*id),
        }
    }
}

impl<F> Value<F> {
    pub(super) fn of_bool(truth: bool) -> Value<F> {
        if truth { Value::True } else { Value::Nil }
    }

    pub(super) fn of_datum(datum: &Datum) -> Value<F> {
        match datum.kind() {
            DatumKind::Nil => Value::Nil,
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Value::True,
            DatumKind::Symbol(symbol) => Value::Symbol(symbol.clone()),
            DatumKind::Integer(value) => Value::Int(i64::try_from(value).expect("a small integer")),
            DatumKind::Cons(car, cdr) => Value::cons(Value::of_datum(car), Value::of_datum(cdr)),
            other => panic!("no such constants here: {other:?}"),
        }
    }

    pub(super) fn cons(car: Value<F>, cdr: Value<F>) -> Value<F> {
        Value::Cons(Rc::new((RefCell::new(car), RefCell::new(cdr))))
    }

    pub(super) fn list(items: Vec<Value<F>>) -> Value<F> {
        items.into_iter().rev().fold(Value::Nil, |rest, item| Value::cons(item, rest))
    }

    /// The items of a list; `None` for anything else.
    pub(super) fn items(&self) -> Option<Vec<Value<F>>> {
        let mut items = Vec::new();
        let mut rest = self.clone();
        while let Value::Cons(pair) = &rest.clone() {
            items.push(pair.0.borrow().clone());
            rest = pair.1.borrow().clone();
        }
        matches!(rest, Value::Nil).then_some(items)
    }

    pub(super) fn is_true(&self) -> bool {
        !matches!(self, Value::Nil)
    }

    pub(super) fn is(&self, other: &Value<F>) -> bool {
        match (self, other) {
            (Value::Nil, Value::Nil) | (Value::True, Value::True) => true,
            (Value::Int(a), Value::Int(b)) => a == b,
            (Value::Symbol(a), Value::Symbol(b)) => a == b,
            (Value::Cons(a), Value::Cons(b)) => Rc::ptr_eq(a, b),
            (Value::Function(a), Value::Function(b)) => Rc::ptr_eq(a, b),
            (Value::Unique(a), Value::Unique(b)) => a == b,
            _ => false,
        }
    }

    /// Calls a simple builtin: its value, or the name of the condition with which it fails. `None` for other
    /// builtins.
    pub(super) fn apply_builtin(
        builtin: esl_bytecode::builtin::Builtin,
        arguments: &[Value<F>],
    ) -> Option<Result<Value<F>, &'static str>> {
        use esl_bytecode::builtin::Builtin as B;
        // Lenient, so that random programs get somewhere.
        let int = |index: usize| match &arguments[index] {
            Value::Int(value) => Ok(*value),
            Value::Nil => Ok(0),
            Value::True => Ok(1),
            Value::Cons(_) => Ok(2),
            _ => Err("TYPE-ERROR"),
        };
        let pair = |index: usize| match &arguments[index] {
            Value::Cons(pair) => Ok(Some(pair.clone())),
            Value::Nil | Value::Int(_) => Ok(None),
            _ => Err("TYPE-ERROR"),
        };
        let both = |op: fn(i64, i64) -> i64| Ok(Value::Int(op(int(0)?, int(1)?)));
        let compare = |op: fn(i64, i64) -> bool| Ok(Value::of_bool(op(int(0)?, int(1)?)));
        let part = |index: usize, second: bool| {
            let part = pair(index)?
                .map(|pair| if second { pair.1.borrow().clone() } else { pair.0.borrow().clone() });
            Ok(part.unwrap_or(Value::Nil))
        };
        let store = |second: bool, gives: usize| {
            let pair = pair(0)?.ok_or("TYPE-ERROR")?;
            *(if second { &pair.1 } else { &pair.0 }).borrow_mut() = arguments[1].clone();
            Ok(arguments[gives].clone())
        };
        Some(match (builtin, arguments.len()) {
            (B::Add, 2) => both(i64::wrapping_add),
            (B::Subtract, 2) => both(i64::wrapping_sub),
            (B::Multiply, 2) => both(i64::wrapping_mul),
            (B::Mod, 2) => int(0).and_then(|a| Ok((a, int(1)?))).and_then(|(a, b)| match b {
                0 => Err("DIVISION-BY-ZERO"),
                _ => Ok(Value::Int(a.wrapping_rem_euclid(b))),
            }),
            (B::Increment, 1) => int(0).map(|value| Value::Int(value.wrapping_add(1))),
            (B::Decrement, 1) => int(0).map(|value| Value::Int(value.wrapping_sub(1))),
            (B::Subtract, 1) => int(0).map(|value| Value::Int(value.wrapping_neg())),
            (B::NumEqual, 2) => compare(|a, b| a == b),
            (B::Less, 2) => compare(|a, b| a < b),
            (B::LessEqual, 2) => compare(|a, b| a <= b),
            (B::Greater, 2) => compare(|a, b| a > b),
            (B::GreaterEqual, 2) => compare(|a, b| a >= b),
            (B::Zerop, 1) => int(0).map(|value| Value::of_bool(value == 0)),
            (B::Not | B::Null, 1) => Ok(Value::of_bool(!arguments[0].is_true())),
            (B::Eq | B::Eql, 2) => Ok(Value::of_bool(arguments[0].is(&arguments[1]))),
            (B::Consp, 1) => Ok(Value::of_bool(matches!(arguments[0], Value::Cons(_)))),
            (B::Atom, 1) => Ok(Value::of_bool(!matches!(arguments[0], Value::Cons(_)))),
            (B::Integerp, 1) => Ok(Value::of_bool(matches!(arguments[0], Value::Int(_)))),
            (B::Cons, 2) => Ok(Value::cons(arguments[0].clone(), arguments[1].clone())),
            (B::Car, 1) => part(0, false),
            (B::Cdr, 1) => part(0, true),
            (B::Rplaca, 2) => store(false, 0),
            (B::SetCdr, 2) => store(true, 1),
            (B::List, _) => Ok(Value::list(arguments.to_vec())),
            (B::ListStar, 1..) => {
                let (last, items) = arguments.split_last().expect("an argument");
                let list =
                    items.iter().rev().fold(last.clone(), |rest, item| Value::cons(item.clone(), rest));
                Ok(list)
            }
            (B::Append, _) => {
                let mut items = Vec::new();
                for list in arguments {
                    match list.items() {
                        Some(more) => items.extend(more),
                        None => return Some(Err("TYPE-ERROR")),
                    }
                }
                Ok(Value::list(items))
            }
            (B::MakeVector, 2) => int(0).map(|size| Value::list(vec![arguments[1].clone(); size as usize])),
            (B::Svref, 2) => element(&arguments[0], &arguments[1]).map(|pair| pair.0.borrow().clone()),
            (B::SetSvref, 3) => element(&arguments[0], &arguments[1]).map(|pair| {
                *pair.0.borrow_mut() = arguments[2].clone();
                arguments[2].clone()
            }),
            (B::Identity, 1) => Ok(arguments[0].clone()),
            _ => return None,
        })
    }
}

/// Returns the pair of an element of a vector, which is a list here.
fn element<F>(vector: &Value<F>, index: &Value<F>) -> Result<Pair<F>, &'static str> {
    let Value::Int(index) = index else { return Err("TYPE-ERROR") };
    let mut rest = vector.clone();
    for _ in 0..*index {
        let Value::Cons(pair) = rest else { return Err("INDEX-ERROR") };
        rest = pair.1.borrow().clone();
    }
    let Value::Cons(pair) = rest else { return Err("INDEX-ERROR") };
    Ok(pair)
}

impl<F> fmt::Display for Value<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        show(self, f, 0)
    }
}

fn show<F>(value: &Value<F>, f: &mut fmt::Formatter<'_>, depth: u32) -> fmt::Result {
    match value {
        Value::Nil => f.write_str("NIL"),
        Value::True => f.write_str("T"),
        Value::Int(value) => write!(f, "{value}"),
        Value::Symbol(symbol) => write!(f, "{symbol}"),
        Value::Function(_) => f.write_str("#<function>"),
        Value::Unique(_) => f.write_str("#<unique>"),
        Value::Cons(_) if depth > 20 => f.write_str("#"),
        Value::Cons(pair) => {
            f.write_str("(")?;
            show(&pair.0.borrow(), f, depth + 1)?;
            f.write_str(" . ")?;
            show(&pair.1.borrow(), f, depth + 1)?;
            f.write_str(")")
        }
    }
}
