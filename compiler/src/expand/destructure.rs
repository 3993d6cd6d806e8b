//! Taking lists apart by pattern: macro lambda lists and `destructuring-bind`.
//!
//! A pattern becomes a row of bindings of a `let*`, each variable bound to a piece of the list. Functions of
//! the library, all internal to the package `ESL`, check the number of elements first; `context` is the name
//! of the macro, or the pattern, for their messages:
//!
//! * `(%check-arguments list minimum maximum context)` returns `list`, or fails with a `program-error` if it
//!   is not a list of that many elements. Without a maximum (`NIL`) it looks at the first `minimum` conses
//!   only.
//! * `(%check-keys list keys allow-other-keys context)` returns `list`, or fails with a `program-error` if it
//!   is not a list of keys and values, or contains other keys than the list `keys` without allowing them.
//! * `(%key-tail list key)` returns the tail of a list of keys and values that begins with the value of
//!   `key`, or `NIL`.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, check_distinct};
use super::function::{Body, FunctionText};
use super::job::{Job, To};
use super::lambda_list::{LambdaList, LambdaListKind, OptionalSpec};

/// A variable or pattern, and the form whose value it receives.
type FormBinding = (Datum, Datum);

/// Bindings made from a pattern. Patterns among them are still to be taken apart.
struct Row<'e> {
    make: Make,
    environment: &'e mut dyn Environment,
    /// Quoted name of the macro, or quoted pattern.
    context: Datum,
    bindings: Vec<FormBinding>,
}

impl Row<'_> {
    /// Binds a fresh variable to the value of a form.
    fn bind(&mut self, name: &str, form: Datum) -> Datum {
        let variable = self.make.fresh(self.environment, name);
        self.bindings.push((variable.clone(), form));
        variable
    }

    /// Binds a variable, or the variables of a pattern, to the value of a form.
    fn receive(&mut self, variable: &Datum, form: Datum) {
        self.bindings.push((variable.clone(), form));
    }

    /// Takes all patterns apart, from left to right, each in its place; returns the bindings, now of
    /// variables only. Nesting takes no native stack.
    fn finish(mut self, form: &Form) -> Checked<Vec<FormBinding>> {
        let mut finished: Vec<FormBinding> = Vec::new();
        let mut waiting: Vec<FormBinding> = std::mem::take(&mut self.bindings);
        waiting.reverse();
        while let Some((variable, form)) = waiting.pop() {
            if variable.as_symbol().is_some() {
                finished.push((variable, form));
                continue;
            }
            let list = LambdaList::parse(&variable, LambdaListKind::Pattern, self.make.0)?;
            let whole = self.bind("LIST", form);
            self.pattern(&list, &whole, &whole);
            waiting.extend(self.bindings.drain(..).rev());
        }
        let names =
            finished.iter().filter_map(|(variable, _)| Some((variable.as_symbol()?, variable.span())));
        check_distinct(names, form)?;
        Ok(finished)
    }

    /// Binds the variables of `list`. `whole` is the value of `&whole`, `arguments` the form of the list to
    /// take apart.
    fn pattern(&mut self, list: &LambdaList, whole: &Datum, arguments: &Datum) {
        let make = self.make;
        if let Some(variable) = &list.whole {
            self.receive(variable, whole.clone());
        }
        let arity = list.arity();
        let number = |count: u32| Datum::integer(count, make.0);
        let maximum = arity.max.map_or_else(|| make.nil(), number);
        let check = [arguments.clone(), number(arity.min), maximum, self.context.clone()];
        let mut rest = self.bind("ARGUMENTS", make.call_esl("%CHECK-ARGUMENTS", check));

        let required = list.required.len();
        let is_over = list.optional.is_empty() && list.rest.is_none() && list.keys.is_none();
        for (index, pair) in list.required.chunks(2).enumerate() {
            self.receive(&pair[0], make.call_cl("CAR", [rest.clone()]));
            if let Some(second) = pair.get(1) {
                self.receive(second, make.call_cl("CADR", [rest.clone()]));
            }
            if !(is_over && 2 * (index + 1) >= required) {
                let step = if pair.len() == 2 { "CDDR" } else { "CDR" };
                rest = self.bind("ARGUMENTS", make.call_cl(step, [rest]));
            }
        }
        let has_more = list.rest.is_some() || list.keys.is_some();
        for (index, optional) in list.optional.iter().enumerate() {
            let is_given = make.call_cl("CONSP", [rest.clone()]);
            self.defaulted(optional, is_given, make.call_cl("CAR", [rest.clone()]));
            if index + 1 == list.optional.len() && !has_more {
                break;
            }
            let tail = make.call_cl("CDR", [rest.clone()]);
            // Before a rest parameter the list may be dotted.
            let tail = match list.rest {
                Some(_) => make.cl("IF", [make.call_cl("CONSP", [rest.clone()]), tail, rest]),
                None => tail,
            };
            rest = self.bind("ARGUMENTS", tail);
        }
        if let Some(variable) = &list.rest {
            self.receive(variable, rest.clone());
        }
        if let Some(keys) = &list.keys {
            let names = make.items(keys.iter().map(|key| make.symbol(&key.key)));
            let allow = if list.allow_other_keys { make.symbol(&Symbol::cl("T")) } else { make.nil() };
            let check = [rest, make.quote(names), allow, self.context.clone()];
            let keyed = self.bind("KEYS", make.call_esl("%CHECK-KEYS", check));
            for key in keys {
                let find = make.call_esl("%KEY-TAIL", [keyed.clone(), make.quote(make.symbol(&key.key))]);
                let tail = self.bind("KEY", find);
                self.defaulted(&key.optional, tail.clone(), make.call_cl("CAR", [tail]));
            }
        }
        for (variable, value) in &list.aux {
            self.receive(variable, value.clone());
        }
    }

    /// Binds an optional parameter to `value` if `is_given`, otherwise to its default.
    fn defaulted(&mut self, optional: &OptionalSpec, is_given: Datum, value: Datum) {
        let make = self.make;
        let chosen = make.cl("IF", [is_given.clone(), value, optional.default.clone()]);
        self.receive(&optional.variable, chosen);
        if let Some(supplied) = &optional.supplied {
            let flag = make.cl("IF", [is_given, make.symbol(&Symbol::cl("T")), make.nil()]);
            self.receive(supplied, flag);
        }
    }
}

/// `(destructuring-bind pattern form . body)`
pub(super) fn destructuring_bind(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=usize::MAX, "needs a pattern and a form")?;
    // The bindings keep their place in the source, so that unused variables are reported.
    let make = Make(form.datum.span());
    let context = make.quote(form.args[0].clone());
    // `(destructuring-bind x …)` is a dotted pattern of no elements.
    let bindings = vec![(form.args[0].clone(), form.args[1].clone())];
    let bindings = Row { make, environment, context, bindings }.finish(&form)?;
    let whole = make.let_in_order(bindings, form.args[2..].to_vec());
    expander.schedule([Job::Expand(whole, to)]);
    Ok(())
}

/// Takes the parameters of a function from one list of arguments if they are too many for registers: the
/// function `shown` has a rest parameter only, and its body binds the variables.
pub(super) fn gather_parameters(
    environment: &mut dyn Environment,
    text: FunctionText,
    form: &Form,
) -> Checked<FunctionText> {
    let FunctionText { name, shown, list, mut body, block, form: span } = text;
    let make = Make(span);
    let arguments = make.fresh(environment, "ARGUMENTS");
    let context = make.quote(name.clone().unwrap_or_else(|| make.symbol(&Symbol::cl("LAMBDA"))));
    let mut row = Row { make, environment, context, bindings: Vec::new() };
    row.pattern(&list, &arguments, &arguments);
    let bindings = row.finish(form)?;
    let forms = match &block {
        Some(block) => {
            vec![make.cl("BLOCK", std::iter::once(make.symbol(block)).chain(std::mem::take(&mut body.forms)))]
        }
        None => std::mem::take(&mut body.forms),
    };
    let inner = std::mem::take(&mut body.declarations).into_iter().chain(forms).collect();
    let documentation = body.documentation;
    let forms = vec![make.let_in_order(bindings, inner)];
    let body = Body { documentation, forms, ..Body::default() };
    let list = LambdaList { rest: Some(arguments), ..LambdaList::default() };
    Ok(FunctionText { name, shown, list, body, block: None, form: span })
}

/// `(%macro-lambda shown name lambda-list . body)`: the function of the macro `name`, which takes a form and
/// an environment and is shown to people as `shown`.
pub(super) fn macro_lambda(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(3..=usize::MAX, "needs two names and a lambda list")?;
    let symbol = form.symbol(1, "needs the name of a macro")?;
    let make = Make(form.datum.span());
    let list = LambdaList::parse(&form.args[2], LambdaListKind::Macro, form.at(form.args[2].span()))?;
    let mut body = expander.take_body(&form.args[3..], true, &form, to.origin)?;

    let call = make.fresh(environment, "FORM");
    let around = make.fresh(environment, "ENVIRONMENT");
    let context = make.quote(form.args[1].clone());
    let mut row = Row { make, environment, context, bindings: Vec::new() };
    if let Some(variable) = &list.environment {
        row.receive(variable, around.clone());
    }
    row.pattern(&list, &call, &make.call_cl("CDR", [call.clone()]));
    let bindings = row.finish(&form)?;

    let block = std::iter::once(make.symbol(&symbol)).chain(std::mem::take(&mut body.forms));
    let block = make.cl("BLOCK", block);
    let inner = std::mem::take(&mut body.declarations).into_iter().chain([block]).collect();
    let function = FunctionText {
        name: Some(form.args[0].clone()),
        shown: form.args[2].clone(),
        list: LambdaList { required: vec![call, around], ..LambdaList::default() },
        body: Body {
            documentation: body.documentation,
            forms: vec![make.let_in_order(bindings, inner)],
            ..Body::default()
        },
        block: None,
        form: form.datum.span(),
    };
    expander.closure(function, to);
    Ok(())
}
