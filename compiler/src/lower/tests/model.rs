//! The meaning of core trees, as plainly as possible: an interpreter that walks the tree.

use std::cell::RefCell;
use std::rc::Rc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::value::Value as AnyValue;
use crate::core::*;

pub(super) enum ModelFunction {
    Lambda(LambdaId, Environment),
    Builtin(Builtin),
    Global(Symbol),
}

type Value = AnyValue<ModelFunction>;

/// Lexical things by their numbers, innermost first.
#[derive(Clone, Default)]
pub(super) struct Environment(Option<Rc<(Lexical, Environment)>>);

#[derive(Clone)]
enum Lexical {
    Variable(VarId, Rc<RefCell<Value>>),
    Block(BlockId, u64),
    Tagbody(TagbodyId, u64),
}

impl Environment {
    fn with(&self, lexical: Lexical) -> Environment {
        Environment(Some(Rc::new((lexical, self.clone()))))
    }

    fn find<T>(&self, mut select: impl FnMut(&Lexical) -> Option<T>) -> T {
        let mut rest = &self.0;
        while let Some(link) = rest {
            if let Some(found) = select(&link.0) {
                return found;
            }
            rest = &link.1.0;
        }
        panic!("a lexical thing is bound")
    }

    fn cell(&self, variable: VarId) -> Rc<RefCell<Value>> {
        self.find(|lexical| match lexical {
            Lexical::Variable(id, cell) if *id == variable => Some(cell.clone()),
            _ => None,
        })
    }

    fn bound(&self, variable: VarId, value: Value) -> Environment {
        self.with(Lexical::Variable(variable, Rc::new(RefCell::new(value))))
    }
}

/// An exit other than returning values.
enum Exit {
    Unwind { target: u64, values: Vec<Value> },
    Fail(Symbol),
    OutOfSteps,
}

type Outcome = Result<Vec<Value>, Exit>;

/// Runs `core`, and returns its log and its end; `None` if it takes more than `steps`.
pub(super) fn run(core: &Core, steps: u32) -> Option<(Vec<String>, String)> {
    let mut model =
        Model { core, steps, log: Vec::new(), globals: FxHashMap::default(), catches: Vec::new(), next: 0 };
    let outcome = model.eval(core.lambdas[0].body, &Environment::default());
    let end = match outcome {
        Ok(values) => values.iter().map(|value| format!("{value};")).collect(),
        Err(Exit::Fail(condition)) => format!("failed with {condition}"),
        Err(Exit::Unwind { .. }) => unreachable!("throws find their targets"),
        Err(Exit::OutOfSteps) => return None,
    };
    Some((model.log, end))
}

struct Model<'a> {
    core: &'a Core,
    steps: u32,
    log: Vec<String>,
    globals: FxHashMap<Symbol, Value>,
    /// Tags that can be thrown to: the value, and the number of the catch.
    catches: Vec<(Value, u64)>,
    next: u64,
}

impl Model<'_> {
    fn one(&mut self, node: NodeId, at: &Environment) -> Result<Value, Exit> {
        Ok(self.eval(node, at)?.into_iter().next().unwrap_or(Value::Nil))
    }

    fn all(&mut self, nodes: &[NodeId], at: &Environment) -> Outcome {
        nodes.iter().map(|&node| self.one(node, at)).collect()
    }

    /// Runs `inside` with a fresh target of exits.
    fn target<T>(&mut self, inside: impl FnOnce(&mut Self, u64) -> T) -> (u64, T) {
        self.next += 1;
        let target = self.next;
        self.catches.push((Value::Unique(target), target));
        let result = inside(self, target);
        self.catches.pop();
        (target, result)
    }

    fn unwind(&self, tag: &Value, values: Vec<Value>) -> Outcome {
        match self.catches.iter().rev().find(|(known, _)| known.is(tag)) {
            Some(&(_, target)) => Err(Exit::Unwind { target, values }),
            None => Err(Exit::Fail(Symbol::cl("CONTROL-ERROR"))),
        }
    }

    fn special(
        &mut self,
        symbol: &Symbol,
        value: Value,
        inside: impl FnOnce(&mut Self) -> Outcome,
    ) -> Outcome {
        let old = self.globals.insert(symbol.clone(), value);
        let outcome = inside(self);
        match old {
            Some(old) => self.globals.insert(symbol.clone(), old),
            None => self.globals.remove(symbol),
        };
        outcome
    }

    fn bind_targets(
        &mut self,
        targets: &[(BoundVariable, Value)],
        at: &Environment,
        inside: &mut dyn FnMut(&mut Self, &Environment) -> Outcome,
    ) -> Outcome {
        match targets.split_first() {
            None => inside(self, at),
            Some(((BoundVariable::Lexical(variable), value), rest)) => {
                self.bind_targets(rest, &at.bound(*variable, value.clone()), inside)
            }
            Some(((BoundVariable::Special(symbol), value), rest)) => {
                self.special(symbol, value.clone(), |model| model.bind_targets(rest, at, inside))
            }
        }
    }

    fn eval(&mut self, node: NodeId, at: &Environment) -> Outcome {
        self.steps = self.steps.checked_sub(1).ok_or(Exit::OutOfSteps)?;
        let core = self.core;
        let value = match &core.nodes[node.index()].kind {
            NodeKind::Constant(datum) => Value::of_datum(datum),
            NodeKind::Local(variable) => at.cell(*variable).borrow().clone(),
            NodeKind::SetLocal(variable, value) => {
                let value = self.one(*value, at)?;
                *at.cell(*variable).borrow_mut() = value.clone();
                value
            }
            NodeKind::Special(symbol) => match self.globals.get(symbol) {
                Some(value) => value.clone(),
                None => return Err(Exit::Fail(Symbol::cl("UNBOUND-VARIABLE"))),
            },
            NodeKind::SetSpecial(symbol, value) => {
                let value = self.one(*value, at)?;
                self.globals.insert(symbol.clone(), value.clone());
                value
            }
            NodeKind::FunctionRef(symbol) => Value::Function(Rc::new(ModelFunction::Global(symbol.clone()))),
            NodeKind::BuiltinRef(builtin) => Value::Function(Rc::new(ModelFunction::Builtin(*builtin))),
            NodeKind::Lambda(lambda) => Value::Function(Rc::new(ModelFunction::Lambda(*lambda, at.clone()))),
            NodeKind::If(test, consequent, alternative) => {
                let way = if self.one(*test, at)?.is_true() { consequent } else { alternative };
                return self.eval(*way, at);
            }
            NodeKind::Progn(forms) => {
                let Some((last, others)) = forms.split_last() else { return Ok(vec![Value::Nil]) };
                self.all(others, at)?;
                return self.eval(*last, at);
            }
            NodeKind::And(forms) => {
                let Some((last, others)) = forms.split_last() else { return Ok(vec![Value::True]) };
                for &form in others {
                    if !self.one(form, at)?.is_true() {
                        return Ok(vec![Value::Nil]);
                    }
                }
                return self.eval(*last, at);
            }
            NodeKind::Or(forms) => {
                let Some((last, others)) = forms.split_last() else { return Ok(vec![Value::Nil]) };
                for &form in others {
                    let value = self.one(form, at)?;
                    if value.is_true() {
                        return Ok(vec![value]);
                    }
                }
                return self.eval(*last, at);
            }
            NodeKind::Let { sequential, bindings, body } => {
                return self.let_form(*sequential, bindings, *body, at, &mut Vec::new());
            }
            NodeKind::Functions { definitions, body } => {
                let mut inner = at.clone();
                for (variable, _) in definitions {
                    inner = inner.bound(*variable, Value::Nil);
                }
                for (variable, lambda) in definitions {
                    let closure = Value::Function(Rc::new(ModelFunction::Lambda(*lambda, inner.clone())));
                    *inner.cell(*variable).borrow_mut() = closure;
                }
                return self.eval(*body, &inner);
            }
            NodeKind::Block(block, body) => {
                let (this, outcome) =
                    self.target(|model, target| model.eval(*body, &at.with(Lexical::Block(*block, target))));
                return match outcome {
                    Err(Exit::Unwind { target, values }) if target == this => Ok(values),
                    other => other,
                };
            }
            NodeKind::ReturnFrom(block, value) => {
                let values = self.eval(*value, at)?;
                let target = at.find(|lexical| match lexical {
                    Lexical::Block(id, target) if id == block => Some(*target),
                    _ => None,
                });
                return self.unwind(&Value::Unique(target), values);
            }
            NodeKind::Tagbody(tagbody, items) => return self.tagbody(*tagbody, items, at),
            NodeKind::Go(tagbody, tag) => {
                let target = at.find(|lexical| match lexical {
                    Lexical::Tagbody(id, target) if id == tagbody => Some(*target),
                    _ => None,
                });
                return self.unwind(&Value::Unique(target), vec![Value::Int(i64::from(*tag))]);
            }
            NodeKind::Catch(tag, body) => {
                let tag = self.one(*tag, at)?;
                self.next += 1;
                let this = self.next;
                self.catches.push((tag, this));
                let outcome = self.eval(*body, at);
                self.catches.pop();
                return match outcome {
                    Err(Exit::Unwind { target, values }) if target == this => Ok(values),
                    other => other,
                };
            }
            NodeKind::Throw(tag, values) => {
                let tag = self.one(*tag, at)?;
                let values = self.eval(*values, at)?;
                return self.unwind(&tag, values);
            }
            NodeKind::UnwindProtect(protected, cleanup) => {
                let outcome = self.eval(*protected, at);
                if let Err(Exit::OutOfSteps) = outcome {
                    return outcome;
                }
                self.eval(*cleanup, at)?;
                return outcome;
            }
            NodeKind::Call(callee, arguments) => {
                if let Callee::Builtin(builtin) = callee {
                    return self.builtin(*builtin, arguments, at);
                }
                let function = self.callee(callee, at)?;
                let arguments = self.all(arguments, at)?;
                return self.call(&function, arguments);
            }
            NodeKind::Apply(callee, arguments) => {
                let function = self.callee(callee, at)?;
                let mut arguments = self.all(arguments, at)?;
                let last = arguments.pop().expect("a list");
                let Some(items) = last.items() else { return Err(Exit::Fail(Symbol::cl("TYPE-ERROR"))) };
                arguments.extend(items);
                return self.call(&function, arguments);
            }
            NodeKind::Values(forms) => return self.all(forms, at),
            NodeKind::BindValues(targets, form, body) => {
                let mut values = self.eval(*form, at)?.into_iter();
                let targets: Vec<(BoundVariable, Value)> = targets
                    .iter()
                    .map(|target| (target.clone(), values.next().unwrap_or(Value::Nil)))
                    .collect();
                return self.bind_targets(&targets, at, &mut |model, at| model.eval(*body, at));
            }
            NodeKind::CallValues(function, forms) => {
                let function = self.one(*function, at)?;
                let mut arguments = Vec::new();
                for &form in forms {
                    arguments.extend(self.eval(form, at)?);
                }
                return self.call(&function, arguments);
            }
            NodeKind::FirstValues(first, second) => {
                let values = self.eval(*first, at)?;
                self.eval(*second, at)?;
                return Ok(values);
            }
            NodeKind::HandlerCase(body, clauses) => {
                return match self.eval(*body, at) {
                    Err(Exit::Fail(condition)) => {
                        let takes = |clause: &&HandlerClause| {
                            let of = clause.condition_type.as_symbol();
                            of.is_some_and(|of| of.is_cl("ERROR") || *of == condition)
                        };
                        match clauses.iter().find(takes) {
                            Some(clause) => {
                                let at = at.bound(clause.variable, Value::Symbol(condition));
                                self.eval(clause.body, &at)
                            }
                            None => Err(Exit::Fail(condition)),
                        }
                    }
                    other => other,
                };
            }
            NodeKind::Progv(symbols, values, body) => {
                let symbols = self.one(*symbols, at)?.items();
                let values = self.one(*values, at)?.items();
                let (Some(symbols), Some(values)) = (symbols, values) else {
                    return Err(Exit::Fail(Symbol::cl("TYPE-ERROR")));
                };
                let mut targets = Vec::new();
                for (symbol, value) in symbols.into_iter().zip(values) {
                    let Value::Symbol(symbol) = symbol else {
                        return Err(Exit::Fail(Symbol::cl("TYPE-ERROR")));
                    };
                    targets.push((BoundVariable::Special(symbol), value));
                }
                return self.bind_targets(&targets, at, &mut |model, at| model.eval(*body, at));
            }
            other => panic!("not in random programs: {other:?}"),
        };
        Ok(vec![value])
    }

    fn let_form(
        &mut self,
        sequential: bool,
        bindings: &[(BoundVariable, NodeId)],
        body: NodeId,
        at: &Environment,
        done: &mut Vec<(BoundVariable, Value)>,
    ) -> Outcome {
        let Some(((target, value), rest)) = bindings.split_first() else {
            let done = std::mem::take(done);
            return self.bind_targets(&done, at, &mut |model, at| model.eval(body, at));
        };
        let value = self.one(*value, at)?;
        if sequential {
            let this = [(target.clone(), value)];
            return self.bind_targets(&this, at, &mut |model, at| {
                model.let_form(true, rest, body, at, &mut Vec::new())
            });
        }
        done.push((target.clone(), value));
        self.let_form(false, rest, body, at, done)
    }

    fn tagbody(&mut self, tagbody: TagbodyId, items: &[TagbodyItem], at: &Environment) -> Outcome {
        let (_, outcome) = self.target(|model, this| {
            let at = at.with(Lexical::Tagbody(tagbody, this));
            let mut next = 0;
            while let Some(item) = items.get(next) {
                next += 1;
                let TagbodyItem::Form(form) = item else { continue };
                match model.eval(*form, &at) {
                    Ok(_) => {}
                    Err(Exit::Unwind { target, values }) if target == this => {
                        let Value::Int(tag) = values[0] else { panic!("a tag's number") };
                        let mut tags =
                            items.iter().enumerate().filter(|(_, item)| matches!(item, TagbodyItem::Tag));
                        next = tags.nth(tag as usize).expect("the tag").0;
                    }
                    Err(other) => return Err(other),
                }
            }
            Ok(vec![Value::Nil])
        });
        outcome
    }

    fn callee(&mut self, callee: &Callee, at: &Environment) -> Result<Value, Exit> {
        match callee {
            Callee::Global(symbol) => Ok(Value::Function(Rc::new(ModelFunction::Global(symbol.clone())))),
            Callee::Builtin(builtin) => Ok(Value::Function(Rc::new(ModelFunction::Builtin(*builtin)))),
            Callee::Local(variable) => Ok(at.cell(*variable).borrow().clone()),
            Callee::Value(node) => self.one(*node, at),
        }
    }

    /// Sums of more than two are opened up: a number is added before the next one is computed.
    fn builtin(&mut self, builtin: Builtin, arguments: &[NodeId], at: &Environment) -> Outcome {
        if matches!(builtin, Builtin::Add | Builtin::Subtract | Builtin::Multiply) && arguments.len() > 2 {
            let mut sum = self.one(arguments[0], at)?;
            for &argument in &arguments[1..] {
                let argument = self.one(argument, at)?;
                sum = self.call_builtin(builtin, vec![sum, argument])?.remove(0);
            }
            return Ok(vec![sum]);
        }
        let arguments = self.all(arguments, at)?;
        self.call_builtin(builtin, arguments)
    }

    fn call_builtin(&mut self, builtin: Builtin, arguments: Vec<Value>) -> Outcome {
        match builtin {
            Builtin::ValuesList => match arguments[0].items() {
                Some(items) => Ok(items),
                None => Err(Exit::Fail(Symbol::cl("TYPE-ERROR"))),
            },
            Builtin::Floor => {
                let [Value::Int(number), Value::Int(divisor)] = arguments[..] else {
                    return Err(Exit::Fail(Symbol::cl("TYPE-ERROR")));
                };
                if divisor <= 0 {
                    return Err(Exit::Fail(Symbol::cl("DIVISION-BY-ZERO")));
                }
                Ok(vec![Value::Int(number.div_euclid(divisor)), Value::Int(number.rem_euclid(divisor))])
            }
            _ => match Value::apply_builtin(builtin, &arguments) {
                Some(Ok(value)) => Ok(vec![value]),
                Some(Err(condition)) => Err(Exit::Fail(Symbol::cl(condition))),
                None => panic!("not in random programs: {builtin:?}"),
            },
        }
    }

    fn call(&mut self, function: &Value, arguments: Vec<Value>) -> Outcome {
        let Value::Function(function) = function else { return Err(Exit::Fail(Symbol::cl("TYPE-ERROR"))) };
        match &**function {
            ModelFunction::Builtin(builtin) => self.call_builtin(*builtin, arguments),
            ModelFunction::Global(symbol) => self.call_global(symbol, arguments),
            ModelFunction::Lambda(lambda, at) => self.call_lambda(*lambda, at, arguments),
        }
    }

    /// The global functions of random programs: `NOTE` writes its arguments to the log, `TWO` gives two
    /// values, `FAIL` fails.
    fn call_global(&mut self, symbol: &Symbol, arguments: Vec<Value>) -> Outcome {
        let arguments_text: String = arguments.iter().map(|argument| format!(" {argument}")).collect();
        self.log.push(format!("{symbol}{arguments_text}"));
        match symbol.name() {
            "FAIL" => Err(Exit::Fail(Symbol::cl("FAILURE"))),
            "TWO" => Ok(vec![Value::Int(arguments.len() as i64), Value::True]),
            _ => Ok(vec![arguments.into_iter().next().unwrap_or(Value::Nil)]),
        }
    }

    fn call_lambda(&mut self, lambda: LambdaId, at: &Environment, arguments: Vec<Value>) -> Outcome {
        let core = self.core;
        let text = &core.lambdas[lambda.index()];
        let required = text.required.len();
        let most = required + text.optional.len();
        if arguments.len() < required || (arguments.len() > most && text.rest.is_none()) {
            return Err(Exit::Fail(Symbol::cl("PROGRAM-ERROR")));
        }
        self.parameters(text, 0, arguments, at)
    }

    /// Binds the parameters from `index` on, and runs the body.
    fn parameters(
        &mut self,
        text: &Lambda,
        index: usize,
        arguments: Vec<Value>,
        at: &Environment,
    ) -> Outcome {
        let required = text.required.len();
        let most = required + text.optional.len();
        let (parameter, value, supplied) = if index < required {
            (text.required[index], arguments[index].clone(), None)
        } else if index < most {
            let optional = &text.optional[index - required];
            let given = arguments.get(index).cloned();
            let flag = Value::of_bool(given.is_some());
            let value = match given {
                Some(value) => value,
                None => self.one(optional.default, at)?,
            };
            (optional.parameter, value, optional.supplied.map(|supplied| (supplied, flag)))
        } else if let (true, Some(rest)) = (index == most, text.rest) {
            let list = Value::list(arguments[most.min(arguments.len())..].to_vec());
            (rest, list, None)
        } else {
            return self.eval(text.body, at);
        };
        let mut bound = vec![(self.parameter_target(parameter), value)];
        bound.extend(supplied.map(|(supplied, flag)| (self.parameter_target(supplied), flag)));
        self.bind_targets(&bound, at, &mut |model, at| {
            model.parameters(text, index + 1, arguments.clone(), at)
        })
    }

    fn parameter_target(&self, parameter: Parameter) -> BoundVariable {
        if parameter.is_special {
            BoundVariable::Special(self.core.variables[parameter.variable.index()].name.clone())
        } else {
            BoundVariable::Lexical(parameter.variable)
        }
    }
}
