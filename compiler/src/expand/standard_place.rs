//! Places of the standard that are more than the call of an accessor, or stand for simpler ones.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{self, Checked, Form, Make, is_cl_form};
use super::job::{Job, To};
use super::place::{Update, arguments, no_place, reader, update_of};
use super::scope::Visible;
use super::setf::{PlaceUse, PlaceWriter, SetfExpansion};

impl Expander {
    /// Finds a place of the standard that needs more than an update function. Returns `None` for all others.
    pub(super) fn standard_place(
        &mut self,
        environment: &mut dyn Environment,
        form: &Form,
        to: To,
    ) -> Option<Checked> {
        let make = Make(to.span);
        if let Some(simpler) = simpler(form, make) {
            self.schedule([Job::Place(simpler, to)]);
            return Some(Ok(()));
        }
        let args = form.args.as_slice();
        match (form.operator.name(), args) {
            ("THE", [_, place]) => self.schedule([Job::Place(place.clone(), to)]),
            ("VALUES", places) => {
                let mut jobs: Vec<Job> = places.iter().map(|place| Job::Place(place.clone(), to)).collect();
                jobs.push(Job::Use(Box::new(PlaceUse::Values(places.len())), to));
                self.schedule(jobs);
            }
            ("GETF", [place, _] | [place, _, _]) => {
                let usage = PlaceUse::Getf(form.clone());
                self.schedule([Job::Place(place.clone(), to), Job::Use(Box::new(usage), to)]);
            }
            ("LDB" | "MASK-FIELD", [_, place]) => {
                let usage = PlaceUse::Field(form.clone());
                self.schedule([Job::Place(place.clone(), to), Job::Use(Box::new(usage), to)]);
            }
            ("GETHASH" | "GET", [_, _, _]) => match update_of(environment, &form.operator) {
                Some(Update::Function(update)) => {
                    let prefix = vec![make.symbol(&Symbol::esl("%CALL-GLOBAL")), make.symbol(&update)];
                    self.update_place(environment, prefix, form.clone(), 2, to);
                }
                Some(Update::Operator(update)) => {
                    self.update_place(environment, vec![make.symbol(&update)], form.clone(), 2, to);
                }
                _ => return None,
            },
            ("SUBSEQ", [_, _] | [_, _, _]) => {
                let (temporaries, args) = arguments(environment, args, make);
                let store = make.fresh(environment, "NEW");
                let keyword = |name| make.symbol(&Symbol::keyword(name));
                let mut replace = vec![args[0].clone(), store.clone(), keyword("START1"), args[1].clone()];
                if let Some(end) = args.get(2) {
                    replace.extend([keyword("END1"), end.clone()]);
                }
                let writer =
                    PlaceWriter::Form(make.progn(vec![make.call_cl("REPLACE", replace), store.clone()]));
                let place = SetfExpansion::new(make, vec![store], writer, reader(form, args, make));
                self.places.push(SetfExpansion { temporaries, ..place });
            }
            ("APPLY", [function, rest @ ..]) if !rest.is_empty() => {
                return Some(self.apply_place(environment, form, function, rest, to));
            }
            ("THE" | "GETF" | "LDB" | "MASK-FIELD" | "SUBSEQ" | "APPLY", _) => {
                return Some(Err(no_place(&form.datum, to.span)));
            }
            _ => return None,
        }
        Some(Ok(()))
    }

    /// Adds the place `(apply #'f argument… list)`.
    fn apply_place(
        &mut self,
        environment: &mut dyn Environment,
        form: &Form,
        function: &Datum,
        rest: &[Datum],
        to: To,
    ) -> Checked {
        let make = Make(to.span);
        let named = form::arguments(function).unwrap_or_default();
        let symbol = match named.as_slice() {
            [named] if is_cl_form(function, "FUNCTION") => named.as_symbol(),
            _ => None,
        };
        let Some(symbol) = symbol else {
            return Err(form.malformed_at(function.span(), "can be set only if it applies `#'name`"));
        };
        let (temporaries, mut args) = arguments(environment, rest, make);
        let store = make.fresh(environment, "NEW");
        let reader = make.cl("APPLY", std::iter::once(function.clone()).chain(args.iter().cloned()));
        let is_local = !matches!(self.scope.function(symbol, self.level()), Visible::No);
        let writer = match update_of(environment, symbol) {
            Some(Update::Function(update)) if !is_local => {
                let last = args.pop().expect("apply has a list");
                let list = make.call_cl("APPEND", [last, make.call_cl("LIST", [store.clone()])]);
                let call = std::iter::once(make.symbol(&update)).chain(args).chain([list]);
                PlaceWriter::Form(make.esl("%APPLY-GLOBAL", call))
            }
            _ => {
                let setter = make.cl("FUNCTION", [make.cl("SETF", [make.symbol(symbol)])]);
                PlaceWriter::Call(vec![make.symbol(&Symbol::cl("APPLY")), setter], args)
            }
        };
        let place = SetfExpansion::new(make, vec![store], writer, reader);
        self.places.push(SetfExpansion { temporaries, ..place });
        Ok(())
    }

    /// Makes the place `(values place…)` of the newest places.
    pub(super) fn values_place(&mut self, environment: &mut dyn Environment, count: usize, to: To) {
        let make = Make(to.span);
        let mut temporaries = Vec::new();
        let (mut stores, mut writers, mut readers) = (Vec::new(), Vec::new(), Vec::new());
        let mut is_broken = false;
        for place in self.take_places(count) {
            is_broken |= place.is_broken;
            let store = make.fresh(environment, "NEW");
            // One value goes to each place; a place that takes several gets `NIL` for the others.
            writers.push(place.write(match place.stores.len() {
                1 => store.clone(),
                _ => make.cl("VALUES", [store.clone()]),
            }));
            stores.push(store);
            readers.push(place.reader);
            temporaries.extend(place.temporaries);
        }
        let writer = PlaceWriter::Form(make.cl("VALUES", writers));
        let place = SetfExpansion::new(make, stores, writer, make.cl("VALUES", readers));
        self.places.push(SetfExpansion { temporaries, is_broken, ..place });
    }

    /// Makes the place `(getf inner indicator [default])` of the newest place.
    pub(super) fn getf_place(&mut self, environment: &mut dyn Environment, form: &Form, to: To) {
        let make = Make(to.span);
        let inner = self.take_place();
        let (temporaries, args) = arguments(environment, &form.args[1..], make);
        let store = make.fresh(environment, "NEW");
        let put = make.call_esl("%PUTF", [inner.reader.clone(), args[0].clone(), store.clone()]);
        let get = make.call_cl("GETF", std::iter::once(inner.reader.clone()).chain(args));
        self.inner_place(
            inner,
            store,
            put,
            get,
            |inner| inner.into_iter().chain(temporaries).collect(),
            make,
        );
    }

    /// Makes the place `(ldb bytes inner)` or `(mask-field bytes inner)` of the newest place.
    pub(super) fn field_place(&mut self, environment: &mut dyn Environment, form: &Form, to: To) {
        let make = Make(to.span);
        let inner = self.take_place();
        let (temporaries, args) = arguments(environment, &form.args[..1], make);
        let store = make.fresh(environment, "NEW");
        let deposit = if form.operator.is_cl("LDB") { "DPB" } else { "DEPOSIT-FIELD" };
        let put = make.call_cl(deposit, [store.clone(), args[0].clone(), inner.reader.clone()]);
        let get = make.call(&form.operator, [args[0].clone(), inner.reader.clone()]);
        self.inner_place(
            inner,
            store,
            put,
            get,
            |inner| temporaries.into_iter().chain(inner).collect(),
            make,
        );
    }

    /// Adds a place within a place: storing `store` in it stores `put` in the inner one.
    fn inner_place(
        &mut self,
        inner: SetfExpansion,
        store: Datum,
        put: Datum,
        get: Datum,
        order: impl FnOnce(Vec<(Datum, Datum)>) -> Vec<(Datum, Datum)>,
        make: Make,
    ) {
        let writer = PlaceWriter::Form(make.progn(vec![inner.write(put), store.clone()]));
        let place = SetfExpansion::new(make, vec![store], writer, get);
        let is_broken = inner.is_broken;
        self.places.push(SetfExpansion { temporaries: order(inner.temporaries), is_broken, ..place });
    }
}

/// Returns the place `(car …)` or `(cdr …)` that a place abbreviates.
fn simpler(form: &Form, make: Make) -> Option<Datum> {
    const ORDINALS: [&str; 10] =
        ["FIRST", "SECOND", "THIRD", "FOURTH", "FIFTH", "SIXTH", "SEVENTH", "EIGHTH", "NINTH", "TENTH"];
    let args = form.args.as_slice();
    let operator = form.operator.name();
    if let ("NTH", [index, list]) = (operator, args) {
        return Some(make.cl("CAR", [make.call_cl("NTHCDR", [index.clone(), list.clone()])]));
    }
    let [list] = args else { return None };
    let list = list.clone();
    if operator == "REST" {
        return Some(make.cl("CDR", [list]));
    }
    if let Some(index) = ORDINALS.iter().position(|ordinal| *ordinal == operator) {
        let tail = match index {
            0 => list,
            1 => make.call_cl("CDR", [list]),
            2 => make.call_cl("CDDR", [list]),
            _ => make.call_cl("NTHCDR", [Datum::integer(index, make.0), list]),
        };
        return Some(make.cl("CAR", [tail]));
    }
    let path = operator.strip_prefix('C')?.strip_suffix('R')?;
    if !(2..=4).contains(&path.len()) || path.bytes().any(|step| !matches!(step, b'A' | b'D')) {
        return None;
    }
    let (last, before) = path.split_at(1);
    let inner = make.call_cl(&format!("C{before}R"), [list]);
    Some(make.cl(&format!("C{last}R"), [inner]))
}
