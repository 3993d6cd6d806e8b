//! Forms that set places: `setf`, `psetf`, `incf`, `push` and their like, and `%modify`, of which others are
//! made.
//!
//! The order of evaluation is the standard's: subforms of the place from left to right, then further
//! arguments; then the old value is read, and the new one stored. Only `push` and `pushnew` evaluate their
//! item first.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, arguments, is_cl_form, is_constant};
use super::job::{Job, To};
use super::scope::{VariableMeaning, Visible};
use super::setf::{Change, PlaceUse, SetfExpansion};
use super::variable::value_missing;
use crate::core::NodeKind;
use crate::diagnostic::code;

impl Expander {
    /// Uses the newest places.
    pub(super) fn use_places(
        &mut self,
        environment: &mut dyn Environment,
        usage: PlaceUse,
        to: To,
    ) -> Checked {
        let make = Make(to.span);
        let form = match usage {
            PlaceUse::Values(count) => {
                self.values_place(environment, count, to);
                return Ok(());
            }
            PlaceUse::Parts => self.sound(1).map(|places| make.quote(places[0].parts())),
            PlaceUse::Getf(form) => {
                self.getf_place(environment, &form, to);
                return Ok(());
            }
            PlaceUse::Field(form) => {
                self.field_place(environment, &form, to);
                return Ok(());
            }
            PlaceUse::Setf(value) => self.sound(1).map(|places| places[0].set(value)),
            PlaceUse::Psetf(values) => {
                self.sound(values.len()).map(|places| store_all(&places, values, make))
            }
            PlaceUse::Rotatef(count) => self.sound(count).map(|places| rotate(&places, make)),
            PlaceUse::Shiftf(count, value) => {
                let old = make.fresh(environment, "OLD");
                self.sound(count).map(|places| shift(&places, value, old, make))
            }
            PlaceUse::Modify(change) => {
                self.sound(1).map(|places| self.modify(environment, &places[0], change, make))
            }
        };
        match form {
            Some(form) => self.schedule([Job::Expand(form, to)]),
            None => self.fill(to, NodeKind::Constant(make.nil())),
        }
        Ok(())
    }

    /// Takes the newest places; returns them if none is faulty.
    fn sound(&mut self, count: usize) -> Option<Vec<SetfExpansion>> {
        let places = self.take_places(count);
        (!places.iter().any(|place| place.is_broken)).then_some(places)
    }

    fn modify(
        &self,
        environment: &mut dyn Environment,
        place: &SetfExpansion,
        change: Change,
        make: Make,
    ) -> Datum {
        let mut bindings = Vec::new();
        // Binds a form, unless it may as well be evaluated later.
        let bind = |form: &Datum, bindings: &mut Vec<(Datum, Datum)>, environment: &mut dyn Environment| {
            if is_inert(form) || (place.is_variable() && self.is_plain_variable(form)) {
                return form.clone();
            }
            let name = make.fresh(environment, "ARGUMENT");
            bindings.push((name.clone(), form.clone()));
            name
        };
        match change {
            Change::Call(function, args) => {
                bindings.extend(place.temporaries.iter().cloned());
                let args: Vec<Datum> = args.iter().map(|arg| bind(arg, &mut bindings, environment)).collect();
                let new = make.call(&function, std::iter::once(place.reader.clone()).chain(args));
                make.let_in_order(bindings, vec![place.write(new)])
            }
            Change::Push(function, item, args) => {
                // If the place is a variable, the item is evaluated first in any case.
                let item = if place.is_variable() && args.iter().all(is_inert) {
                    item
                } else {
                    bind(&item, &mut bindings, environment)
                };
                bindings.extend(place.temporaries.iter().cloned());
                let args: Vec<Datum> = args.iter().map(|arg| bind(arg, &mut bindings, environment)).collect();
                let new = make.call(&function, [item, place.reader.clone()].into_iter().chain(args));
                make.let_in_order(bindings, vec![place.write(new)])
            }
            Change::Pop => {
                let old = make.fresh(environment, "OLD");
                bindings.extend(place.temporaries.iter().cloned());
                bindings.push((old.clone(), place.reader.clone()));
                let new = place.write(make.call_cl("CDR", [old.clone()]));
                make.let_in_order(bindings, vec![new, make.call_cl("CAR", [old])])
            }
            Change::Remf(indicator) => {
                bindings.extend(place.temporaries.iter().cloned());
                let indicator = bind(&indicator, &mut bindings, environment);
                let list = make.fresh(environment, "LIST");
                let found = make.fresh(environment, "FOUND");
                let names = make.list([list.clone(), found.clone()]);
                let removed = make.call_esl("%REMF", [place.reader.clone(), indicator]);
                let store = make.cl("MULTIPLE-VALUE-BIND", [names, removed, place.write(list), found]);
                make.let_in_order(bindings, vec![store])
            }
            Change::Bound { old, bindings: further, new, result } => {
                bindings.extend(place.temporaries.iter().cloned());
                bindings.extend(further);
                bindings.push((old, place.reader.clone()));
                let mut body = vec![place.write(new)];
                body.extend(result);
                make.let_in_order(bindings, body)
            }
        }
    }

    /// Whether `form` is a lexical variable.
    fn is_plain_variable(&self, form: &Datum) -> bool {
        let is_macro = |symbol| match self.scope.variable(symbol, self.level()) {
            Visible::Is(VariableMeaning::Lexical(_)) => false,
            Visible::Is(_) | Visible::No | Visible::OutOfReach => true,
        };
        form.as_symbol().is_some_and(|symbol| !is_macro(symbol))
    }
}

/// Whether a form may as well be evaluated at another time, or not at all.
fn is_inert(form: &Datum) -> bool {
    is_constant(form) || is_cl_form(form, "FUNCTION") || is_cl_form(form, "LAMBDA")
}

/// Stores bound to the values of a form, after other bindings.
struct StoreStep<'a> {
    before: Vec<(Datum, Datum)>,
    stores: &'a [Datum],
    value: Datum,
}

/// Returns a form that makes all bindings in order around a body.
fn bind_in_order(steps: Vec<StoreStep<'_>>, mut body: Vec<Datum>, make: Make) -> Datum {
    // From the last step to the first, so that a step with several values can enclose the steps after it. The
    // bindings around the body are gathered from the last to the first, too.
    let mut bindings: Vec<(Datum, Datum)> = Vec::new();
    for StoreStep { before, stores, value } in steps.into_iter().rev() {
        if let [store] = stores {
            bindings.push((store.clone(), value));
        } else {
            bindings.reverse();
            let inside = make.let_in_order(std::mem::take(&mut bindings), std::mem::take(&mut body));
            body = vec![make.cl("MULTIPLE-VALUE-BIND", [make.items(stores.iter().cloned()), value, inside])];
        }
        bindings.extend(before.into_iter().rev());
    }
    bindings.reverse();
    make.let_in_order(bindings, body)
}

/// Returns a form that evaluates all subforms and values in order, then stores the values.
fn store_all(places: &[SetfExpansion], values: Vec<Datum>, make: Make) -> Datum {
    let steps = places.iter().zip(values).map(|(place, value)| StoreStep {
        before: place.temporaries.clone(),
        stores: &place.stores,
        value,
    });
    let body = places.iter().map(SetfExpansion::write_stores).chain([make.nil()]);
    bind_in_order(steps.collect(), body.collect(), make)
}

/// Returns a form that evaluates all subforms, reads all values, and stores each in the place before its own.
fn rotate(places: &[SetfExpansion], make: Make) -> Datum {
    let takers = places.iter().cycle().skip(places.len() - 1);
    let steps = places.iter().zip(takers).map(|(place, taker)| StoreStep {
        before: Vec::new(),
        stores: &taker.stores,
        value: place.reader.clone(),
    });
    let mut steps: Vec<StoreStep<'_>> = steps.collect();
    steps[0].before = temporaries(places);
    let body = places.iter().map(SetfExpansion::write_stores).chain([make.nil()]);
    bind_in_order(steps, body.collect(), make)
}

/// As [`rotate`], except that the last place takes the value of a form, and the first one's old value is
/// returned.
fn shift(places: &[SetfExpansion], value: Datum, old: Datum, make: Make) -> Datum {
    let [first, others @ ..] = places else { return value };
    let is_single = first.stores.len() == 1;
    let reader = first.reader.clone();
    let (kept, result) = if is_single {
        (reader, old.clone())
    } else {
        (make.cl("MULTIPLE-VALUE-LIST", [reader]), make.call_cl("VALUES-LIST", [old.clone()]))
    };
    let olds = [old];
    let mut steps = vec![StoreStep { before: temporaries(places), stores: &olds, value: kept }];
    let values = others.iter().map(|place| place.reader.clone()).chain([value]);
    steps.extend(places.iter().zip(values).map(|(taker, value)| StoreStep {
        before: Vec::new(),
        stores: &taker.stores,
        value,
    }));
    let body = places.iter().map(SetfExpansion::write_stores).chain([result]);
    bind_in_order(steps, body.collect(), make)
}

fn temporaries(places: &[SetfExpansion]) -> Vec<(Datum, Datum)> {
    places.iter().flat_map(|place| place.temporaries.iter().cloned()).collect()
}

/// `(setf {place form}*)`
pub(super) fn setf(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let make = Make(to.span);
    match form.args.as_slice() {
        [place, value] => {
            let usage = PlaceUse::Setf(value.clone());
            expander.schedule([Job::Place(place.clone(), to), Job::Use(Box::new(usage), to)]);
        }
        args if args.len() % 2 == 1 => return Err(value_missing(&form)),
        args => {
            let pairs: Vec<Datum> =
                args.chunks(2).map(|pair| make.cl("SETF", pair.iter().cloned())).collect();
            let jobs = expander.body(pairs, to);
            expander.schedule(jobs);
        }
    }
    Ok(())
}

/// `(%place-parts place)`: the values of `get-setf-expansion` for a place, as a list.
pub(super) fn place_parts(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes one place")?;
    expander.schedule([Job::Place(form.args[0].clone(), to), Job::Use(Box::new(PlaceUse::Parts), to)]);
    Ok(())
}

/// `(psetf {place form}*)`
pub(super) fn psetf(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() % 2 == 1 {
        return Err(value_missing(&form));
    }
    let mut jobs: Vec<Job> = form.args.iter().step_by(2).map(|place| Job::Place(place.clone(), to)).collect();
    let values = form.args.iter().skip(1).step_by(2).cloned().collect();
    jobs.push(Job::Use(Box::new(PlaceUse::Psetf(values)), to));
    expander.schedule(jobs);
    Ok(())
}

/// `(rotatef place*)`
pub(super) fn rotatef(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.is_empty() {
        expander.fill(to, NodeKind::Constant(Datum::nil(to.span)));
        return Ok(());
    }
    let count = form.args.len();
    let mut jobs: Vec<Job> = form.args.into_iter().map(|place| Job::Place(place, to)).collect();
    jobs.push(Job::Use(Box::new(PlaceUse::Rotatef(count)), to));
    expander.schedule(jobs);
    Ok(())
}

/// `(shiftf place+ form)`
pub(super) fn shiftf(expander: &mut Expander, _: &mut dyn Environment, mut form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "needs at least one place and a form")?;
    let value = form.args.pop().expect("the number of arguments was checked");
    let count = form.args.len();
    let mut jobs: Vec<Job> = form.args.into_iter().map(|place| Job::Place(place, to)).collect();
    jobs.push(Job::Use(Box::new(PlaceUse::Shiftf(count, value)), to));
    expander.schedule(jobs);
    Ok(())
}

fn change(expander: &mut Expander, place: &Datum, change: Change, to: To) -> Checked {
    expander.schedule([Job::Place(place.clone(), to), Job::Use(Box::new(PlaceUse::Modify(change)), to)]);
    Ok(())
}

/// `(incf place [delta])`
pub(super) fn incf(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    add(expander, &form, "+", to)
}

/// `(decf place [delta])`
pub(super) fn decf(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    add(expander, &form, "-", to)
}

fn add(expander: &mut Expander, form: &Form, function: &str, to: To) -> Checked {
    form.takes(1..=2, "takes a place and at most one form")?;
    let delta = form.args.get(1).cloned().unwrap_or_else(|| Datum::integer(1, to.span));
    if let Some(counter) = counter(expander, &form.args[0], function, &delta, to) {
        expander.schedule([Job::Expand(counter, to)]);
        return Ok(());
    }
    change(expander, &form.args[0], Change::Call(Symbol::cl(function), vec![delta]), to)
}

/// Returns the call that adds to the value of a key in a hash table with one search. Counting in tables is so
/// common that it has a builtin of its own.
fn counter(expander: &Expander, place: &Datum, function: &str, delta: &Datum, to: To) -> Option<Datum> {
    let gethash = Symbol::cl("GETHASH");
    let is_global = matches!(expander.scope.function(&gethash, expander.level()), Visible::No);
    if function != "+" || !is_global || !is_cl_form(place, "GETHASH") {
        return None;
    }
    let make = Make(to.span);
    let (key, table, default) = match &*arguments(place)? {
        [key, table] => (key.clone(), table.clone(), Datum::nil(to.span)),
        [key, table, default] => (key.clone(), table.clone(), default.clone()),
        _ => return None,
    };
    Some(make.call_esl("%ADD-TO-VALUE", [key, table, default, delta.clone()]))
}

/// `(push item place)`
pub(super) fn push(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes an item and a place")?;
    change(expander, &form.args[1], Change::Push(Symbol::cl("CONS"), form.args[0].clone(), Vec::new()), to)
}

/// `(pushnew item place . keys)`
pub(super) fn pushnew(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "takes an item, a place and keyword arguments")?;
    let keys = form.args[2..].to_vec();
    change(expander, &form.args[1], Change::Push(Symbol::cl("ADJOIN"), form.args[0].clone(), keys), to)
}

/// `(pop place)`
pub(super) fn pop(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=1, "takes a place")?;
    change(expander, &form.args[0], Change::Pop, to)
}

/// `(remf place indicator)`
pub(super) fn remf(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=2, "takes a place and an indicator")?;
    change(expander, &form.args[0], Change::Remf(form.args[1].clone()), to)
}

/// `(%modify (old (name form)*) place new [result])`: evaluates the subforms of the place, then binds the
/// names to the forms one after another, then `old` to the old value, and stores the value of `new`. Returns
/// that value, or the values of `result`, which is evaluated last.
pub(super) fn modify(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(3..=4, "takes names, a place, the new value and at most one result")?;
    let names = form.args[0].as_list().unwrap_or_default();
    let Some((old, further)) =
        names.split_first().filter(|(old, _)| matches!(old.kind(), DatumKind::Symbol(_)))
    else {
        return Err(form.not_a_name(&form.args[0], "needs a list that begins with a name for the old value"));
    };
    let mut bindings = Vec::new();
    for binding in further {
        match binding.as_list().as_deref() {
            Some([name, value]) if name.as_symbol().is_some() => {
                bindings.push(((*name).clone(), (*value).clone()))
            }
            _ => {
                let what = "needs one name and one form in each binding";
                return Err(form.fault(code::MALFORMED_BINDING, binding.span(), what));
            }
        }
    }
    let result = form.args.get(3).cloned();
    let bound = Change::Bound { old: (*old).clone(), bindings, new: form.args[2].clone(), result };
    change(expander, &form.args[1], bound, to)
}
