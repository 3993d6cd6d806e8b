//! The core language as text, for `eslc expand` and for tests.
//!
//! The text is Lisp with the meaning of the core tree, as far as that can be written: a second variable of
//! the same name gets a number, tags are numbered, and operators of the library appear under their internal
//! names.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::form::{Make, on_one_line};
use crate::core::{
    BlockId, BoundVariable, Callee, Core, Lambda, LambdaId, NodeId, NodeKind, OptionalParameter, Parameter,
    TagbodyId, TagbodyItem, VarId,
};

const MAKE: Make = Make(Span { source: SourceId(0), start: 0, end: 0 });

/// Characters of the longest line, where lines can be broken.
const WIDTH: usize = 100;
/// Nesting depth from which on forms are not broken into lines.
const BROKEN_DEPTH: usize = 60;

/// Returns the text of a top-level form.
pub fn print(core: &Core) -> String {
    let printer = Printer { core, names: variable_names(core), blocks: block_names(core) };
    let mut text = String::new();
    lay_out(&printer.form(), 0, 0, &mut text);
    text
}

struct Printer<'a> {
    core: &'a Core,
    names: Vec<Datum>,
    blocks: Vec<Datum>,
}

/// Numbers the names that occur more than once.
struct NameCounts(FxHashMap<String, u32>);

impl NameCounts {
    fn name(&mut self, name: &Symbol) -> Datum {
        let text = name.name().to_string();
        let count = self.0.entry(text.clone()).or_insert(0);
        *count += 1;
        match *count {
            1 => MAKE.symbol(name),
            count if name.package().is_none() => {
                MAKE.symbol(&Symbol::uninterned(0, &format!("{text}.{count}")))
            }
            count => MAKE.symbol(&Symbol::esl(&format!("{text}.{count}"))),
        }
    }
}

fn variable_names(core: &Core) -> Vec<Datum> {
    let mut names = NameCounts(FxHashMap::default());
    core.variables.iter().map(|variable| names.name(&variable.name)).collect()
}

fn block_names(core: &Core) -> Vec<Datum> {
    let mut names = NameCounts(FxHashMap::default());
    core.blocks
        .iter()
        .map(|block| names.name(block.name.as_ref().unwrap_or(&Symbol::esl("%BLOCK"))))
        .collect()
}

impl Printer<'_> {
    fn form(&self) -> Datum {
        // Children have higher numbers than their parents: going backward, all parts of a node are printed
        // before it.
        let mut forms: Vec<Datum> = vec![MAKE.nil(); self.core.nodes.len()];
        for index in (0..forms.len()).rev() {
            forms[index] = self.node(&self.core.nodes[index].kind, &forms);
        }
        forms.first().cloned().unwrap_or_else(|| MAKE.nil())
    }

    fn node(&self, kind: &NodeKind, forms: &[Datum]) -> Datum {
        let at = |id: &NodeId| forms[id.index()].clone();
        let all = |ids: &[NodeId]| ids.iter().map(at).collect::<Vec<_>>();
        match kind {
            NodeKind::Hole => MAKE.symbol(&Symbol::esl("%HOLE")),
            NodeKind::Constant(datum) => match datum.kind() {
                DatumKind::Cons(..) => MAKE.quote(datum.clone()),
                DatumKind::Symbol(symbol) if !symbol.is_keyword() && !symbol.is_cl("T") => {
                    MAKE.quote(datum.clone())
                }
                _ => datum.clone(),
            },
            NodeKind::Local(variable) => self.variable(*variable),
            NodeKind::SetLocal(variable, value) => MAKE.cl("SETQ", [self.variable(*variable), at(value)]),
            NodeKind::Special(symbol) => MAKE.symbol(symbol),
            NodeKind::SetSpecial(symbol, value) => MAKE.cl("SETQ", [MAKE.symbol(symbol), at(value)]),
            NodeKind::FunctionRef(symbol) => MAKE.cl("FUNCTION", [MAKE.symbol(symbol)]),
            NodeKind::BuiltinRef(builtin) => MAKE.cl("FUNCTION", [MAKE.symbol(&builtin.symbol())]),
            NodeKind::Lambda(lambda) => self.lambda(*lambda, forms),
            NodeKind::If(test, then, otherwise) => MAKE.cl("IF", [at(test), at(then), at(otherwise)]),
            NodeKind::Progn(ids) => MAKE.cl("PROGN", all(ids)),
            NodeKind::And(ids) => MAKE.cl("AND", all(ids)),
            NodeKind::Or(ids) => MAKE.cl("OR", all(ids)),
            NodeKind::Let { sequential, bindings, body } => {
                let bindings =
                    bindings.iter().map(|(variable, value)| MAKE.list([self.bound(variable), at(value)]));
                MAKE.cl(if *sequential { "LET*" } else { "LET" }, [MAKE.items(bindings), at(body)])
            }
            NodeKind::Functions { definitions, body } => {
                let definitions = definitions.iter().map(|(variable, lambda)| {
                    let [list, body] = self.text(self.lambda_at(*lambda), forms);
                    MAKE.list([self.variable(*variable), list, body])
                });
                MAKE.cl("LABELS", [MAKE.items(definitions), at(body)])
            }
            NodeKind::Block(block, body) => MAKE.cl("BLOCK", [self.block(*block), at(body)]),
            NodeKind::ReturnFrom(block, value) => MAKE.cl("RETURN-FROM", [self.block(*block), at(value)]),
            NodeKind::Tagbody(tagbody, items) => {
                let mut number = 0;
                let items = items.iter().map(|item| match item {
                    TagbodyItem::Tag => {
                        number += 1;
                        tag(*tagbody, number - 1)
                    }
                    TagbodyItem::Form(id) => at(id),
                });
                MAKE.cl("TAGBODY", items.collect::<Vec<_>>())
            }
            NodeKind::Pass(place) => MAKE.esl("%PASS", [Datum::integer(*place, MAKE.0)]),
            NodeKind::Go(tagbody, number) => MAKE.cl("GO", [tag(*tagbody, *number)]),
            NodeKind::Catch(tag, body) => MAKE.cl("CATCH", [at(tag), at(body)]),
            NodeKind::Throw(tag, value) => MAKE.cl("THROW", [at(tag), at(value)]),
            NodeKind::UnwindProtect(form, cleanup) => MAKE.cl("UNWIND-PROTECT", [at(form), at(cleanup)]),
            NodeKind::Progv(symbols, values, body) => MAKE.cl("PROGV", [at(symbols), at(values), at(body)]),
            NodeKind::Call(callee, args) => match callee {
                Callee::Value(function) => MAKE.cl("FUNCALL", std::iter::once(at(function)).chain(all(args))),
                _ => MAKE.items(std::iter::once(self.callee(callee)).chain(all(args))),
            },
            NodeKind::Apply(callee, args) => {
                let function = match callee {
                    Callee::Value(function) => at(function),
                    _ => MAKE.cl("FUNCTION", [self.callee(callee)]),
                };
                MAKE.cl("APPLY", std::iter::once(function).chain(all(args)))
            }
            NodeKind::Values(ids) => MAKE.cl("VALUES", all(ids)),
            NodeKind::BindValues(variables, form, body) => {
                let variables = MAKE.items(variables.iter().map(|variable| self.bound(variable)));
                MAKE.cl("MULTIPLE-VALUE-BIND", [variables, at(form), at(body)])
            }
            NodeKind::CallValues(function, ids) => {
                MAKE.cl("MULTIPLE-VALUE-CALL", std::iter::once(at(function)).chain(all(ids)))
            }
            NodeKind::FirstValues(first, second) => MAKE.cl("MULTIPLE-VALUE-PROG1", [at(first), at(second)]),
            NodeKind::HandlerCase(form, clauses) => {
                let clauses = clauses.iter().map(|clause| {
                    let variable = MAKE.list([self.variable(clause.variable)]);
                    MAKE.list([clause.condition_type.clone(), variable, at(&clause.body)])
                });
                MAKE.esl("%HANDLER-CASE", std::iter::once(at(form)).chain(clauses))
            }
            NodeKind::Recovery { table, procedures, body } => {
                MAKE.esl("%WITH-RECOVERY", [at(table), at(procedures), at(body)])
            }
            NodeKind::FailureCleanup(body, cleanup) => {
                MAKE.esl("%WITH-FAILURE-CLEANUP", [at(cleanup), at(body)])
            }
            NodeKind::Handlers(list, body) => MAKE.esl("%WITH-HANDLERS", [at(list), at(body)]),
            NodeKind::Mask(height, body) => MAKE.esl("%WITH-MASK", [at(height), at(body)]),
            NodeKind::Slot(class, index, instance) => MAKE
                .esl("%SLOT", [MAKE.quote(MAKE.symbol(class)), Datum::integer(*index, MAKE.0), at(instance)]),
            NodeKind::SetSlot(class, index, instance, value) => {
                let class = MAKE.quote(MAKE.symbol(class));
                MAKE.esl("%SET-SLOT", [class, Datum::integer(*index, MAKE.0), at(instance), at(value)])
            }
            NodeKind::IsInstance(class, form) => {
                MAKE.esl("%INSTANCE-P", [MAKE.quote(MAKE.symbol(class)), at(form)])
            }
        }
    }

    fn variable(&self, VarId(index): VarId) -> Datum {
        self.names[index as usize].clone()
    }

    fn block(&self, BlockId(index): BlockId) -> Datum {
        self.blocks[index as usize].clone()
    }

    fn bound(&self, variable: &BoundVariable) -> Datum {
        match variable {
            BoundVariable::Lexical(variable) => self.variable(*variable),
            BoundVariable::Special(symbol) => MAKE.symbol(symbol),
        }
    }

    fn callee(&self, callee: &Callee) -> Datum {
        match callee {
            Callee::Global(symbol) => MAKE.symbol(symbol),
            Callee::Builtin(builtin) => MAKE.symbol(&builtin.symbol()),
            Callee::Local(variable) => self.variable(*variable),
            Callee::Value(_) => MAKE.symbol(&Symbol::cl("FUNCALL")),
        }
    }

    fn lambda_at(&self, LambdaId(index): LambdaId) -> &Lambda {
        &self.core.lambdas[index as usize]
    }

    fn lambda(&self, id: LambdaId, forms: &[Datum]) -> Datum {
        let lambda = self.lambda_at(id);
        let text = self.text(lambda, forms);
        match &lambda.name {
            Some(name) => MAKE.esl("%NAMED-LAMBDA", std::iter::once(name.clone()).chain(text)),
            None => MAKE.cl("LAMBDA", text),
        }
    }

    /// Returns the lambda list and the body.
    fn text(&self, lambda: &Lambda, forms: &[Datum]) -> [Datum; 2] {
        let keyword = |name| MAKE.symbol(&Symbol::cl(name));
        let mut list: Vec<Datum> =
            lambda.required.iter().map(|parameter| self.parameter(parameter)).collect();
        if !lambda.optional.is_empty() {
            list.push(keyword("&OPTIONAL"));
            list.extend(lambda.optional.iter().map(|item| {
                MAKE.items(std::iter::once(self.parameter(&item.parameter)).chain(self.default(item, forms)))
            }));
        }
        if let Some(rest) = &lambda.rest {
            list.extend([keyword("&REST"), self.parameter(rest)]);
        }
        if let Some(keys) = &lambda.keys {
            list.push(keyword("&KEY"));
            list.extend(keys.iter().map(|key| {
                let head = MAKE.list([MAKE.symbol(&key.key), self.parameter(&key.optional.parameter)]);
                MAKE.items(std::iter::once(head).chain(self.default(&key.optional, forms)))
            }));
            if lambda.allow_other_keys {
                list.push(keyword("&ALLOW-OTHER-KEYS"));
            }
        }
        [MAKE.items(list), forms[lambda.body.index()].clone()]
    }

    /// Returns a parameter; a special one as `(special name)`.
    fn parameter(&self, parameter: &Parameter) -> Datum {
        let name = self.variable(parameter.variable);
        if parameter.is_special { MAKE.cl("SPECIAL", [name]) } else { name }
    }

    fn default(&self, item: &OptionalParameter, forms: &[Datum]) -> Vec<Datum> {
        let supplied = item.supplied.as_ref().map(|parameter| self.parameter(parameter));
        std::iter::once(forms[item.default.index()].clone()).chain(supplied).collect()
    }
}

fn tag(TagbodyId(tagbody): TagbodyId, number: u32) -> Datum {
    MAKE.symbol(&Symbol::esl(&format!("TAG-{tagbody}-{number}")))
}

/// Writes a form from column `column` on, on one line if it fits.
fn lay_out(form: &Datum, column: usize, depth: usize, text: &mut String) {
    let room = WIDTH.saturating_sub(column);
    let line = on_one_line(form, room);
    if line.chars().count() <= room {
        text.push_str(&line);
        return;
    }
    let items = form.as_list().filter(|items| items.len() > 1 && depth < BROKEN_DEPTH);
    let Some(items) = items else {
        text.push_str(&on_one_line(form, usize::MAX / 4));
        return;
    };
    // Number of arguments on the line of the operator; the others go below it.
    let beside = match items[0].as_symbol().map(Symbol::name) {
        Some("LET" | "LET*" | "LABELS" | "LAMBDA" | "BLOCK" | "RETURN-FROM" | "SETQ" | "IF" | "CATCH") => 1,
        Some("%NAMED-LAMBDA" | "MULTIPLE-VALUE-BIND") => 2,
        Some(_) => 0,
        None => 0,
    };
    text.push('(');
    let mut at = column + 1;
    for (index, item) in items.iter().enumerate() {
        if index > 0 && index <= beside {
            text.push(' ');
            at += 1;
        } else if index > 0 {
            at = column + if items[0].as_symbol().is_some() { 2 } else { 1 };
            text.push('\n');
            text.extend(std::iter::repeat_n(' ', at));
        }
        let start = text.len();
        lay_out(item, at, depth + 1, text);
        at += text[start..].chars().count();
    }
    text.push(')');
}
