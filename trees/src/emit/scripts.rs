//! Scripts as forms of ESL.

use crate::emit::Emitter;
use crate::emit::form::FormId;
use crate::script::{Expression, Script};

impl Emitter<'_> {
    /// Returns the statements of a script.
    pub(super) fn script_statements(&mut self, script: &Script) -> Vec<FormId> {
        let values = self.expressions(script);
        script.statements.iter().map(|&statement| values[statement]).collect()
    }

    /// Returns the last value of a script, as a condition.
    pub(super) fn script_test(&mut self, script: &Script) -> FormId {
        let values = self.expressions(script);
        let Some((&last, before)) = script.statements.split_last() else { return self.forms.atom("t") };
        let mut forms: Vec<FormId> = before.iter().map(|&statement| values[statement]).collect();
        forms.push(self.truth(script, &values, last));
        self.progn(forms)
    }

    /// Returns an expression as a condition. Numbers other than zero are true.
    fn truth(&mut self, script: &Script, values: &[FormId], index: usize) -> FormId {
        match &script.expressions[index] {
            Expression::Boolean(_) | Expression::Comparison(..) | Expression::Unary("!", _) => values[index],
            Expression::Binary("&&" | "||", ..) => values[index],
            Expression::Name(name) if self.booleans.contains(name) => values[index],
            _ => {
                self.needs_bt = true;
                self.forms.call("bt:true-p", 2, [values[index]])
            }
        }
    }

    fn expressions(&mut self, script: &Script) -> Vec<FormId> {
        let mut values: Vec<FormId> = Vec::with_capacity(script.expressions.len());
        for expression in &script.expressions {
            let value = self.expression(script, &values, expression);
            values.push(value);
        }
        values
    }

    fn expression(&mut self, script: &Script, values: &[FormId], expression: &Expression) -> FormId {
        match expression {
            Expression::Number(text) => self.forms.atom(text.clone()),
            Expression::Text(text) => self.forms.atom(quoted(text)),
            Expression::Boolean(value) => self.forms.atom(if *value { "t" } else { "nil" }),
            Expression::Name(name) if self.enumerators.contains(name) => self.forms.atom(quoted(name)),
            Expression::Name(name) => {
                let variable = self.variable(name);
                self.forms.atom(variable)
            }
            Expression::Unary("!", operand) => {
                let operand = self.truth(script, values, *operand);
                self.not(operand)
            }
            Expression::Unary("~", operand) => self.forms.call("lognot", 2, [values[*operand]]),
            Expression::Unary(_, operand) => match self.forms.text_of(values[*operand]) {
                Some(text) if text.starts_with(|c: char| c.is_ascii_digit()) => {
                    let text = format!("-{text}");
                    self.forms.atom(text)
                }
                _ => self.forms.call("-", 2, [values[*operand]]),
            },
            Expression::Binary(operator, left, right) => self.binary(script, values, operator, *left, *right),
            Expression::Comparison(operators, operands) => {
                let pairs = operators.iter().zip(operands.windows(2));
                let parts: Vec<FormId> = pairs
                    .map(|(operator, pair)| self.compare(script, values, operator, pair[0], pair[1]))
                    .collect();
                match *parts {
                    [part] => part,
                    _ => self.forms.call("and", 2, parts),
                }
            }
            Expression::Conditional(condition, then, other) => {
                let condition = self.truth(script, values, *condition);
                self.forms.call("if", 2, [condition, values[*then], values[*other]])
            }
            Expression::Assignment(operator, name, value) => {
                let variable = self.variable(name);
                let place = self.forms.atom(variable);
                let value = values[*value];
                match *operator {
                    "+=" => self.forms.call("incf", 3, [place, value]),
                    "-=" => self.forms.call("decf", 3, [place, value]),
                    "*=" | "/=" => {
                        let operator = operator.trim_end_matches('=');
                        let result = self.forms.call(operator, 3, [place, value]);
                        self.forms.call("setf", 3, [place, result])
                    }
                    _ => self.forms.call("setf", 3, [place, value]),
                }
            }
        }
    }

    fn binary(
        &mut self,
        script: &Script,
        values: &[FormId],
        operator: &str,
        left: usize,
        right: usize,
    ) -> FormId {
        let is_text = |index: usize| matches!(script.expressions[index], Expression::Text(_));
        match operator {
            "&&" | "||" => {
                let parts = [left, right].map(|index| self.truth(script, values, index));
                self.forms.call(if operator == "&&" { "and" } else { "or" }, 2, parts)
            }
            "&" => self.forms.call("logand", 3, [values[left], values[right]]),
            "|" => self.forms.call("logior", 3, [values[left], values[right]]),
            "^" => self.forms.call("logxor", 3, [values[left], values[right]]),
            ".." | "+" if operator == ".." || is_text(left) || is_text(right) => {
                let parts =
                    [self.forms.atom("nil"), self.forms.atom("\"~a~a\""), values[left], values[right]];
                self.forms.call("format", 4, parts)
            }
            // The quotient of whole numbers is a real number there.
            "/" => {
                let divisor = self.forms.call("float", 2, [values[right]]);
                self.forms.call("/", 3, [values[left], divisor])
            }
            operator => self.forms.call(operator, 3, [values[left], values[right]]),
        }
    }

    fn compare(
        &mut self,
        script: &Script,
        values: &[FormId],
        operator: &str,
        left: usize,
        right: usize,
    ) -> FormId {
        let expression = |index: usize| &script.expressions[index];
        let is_equality = matches!(operator, "==" | "!=");
        if is_equality {
            for (constant, other) in [(left, right), (right, left)] {
                if let Expression::Boolean(value) = expression(constant) {
                    let is_true = *value == (operator == "==");
                    let truth = self.truth(script, values, other);
                    return if is_true { truth } else { self.not(truth) };
                }
            }
        }
        let is_number = |index| {
            matches!(
                expression(index),
                Expression::Number(_) | Expression::Unary("-", _) | Expression::Binary("-" | "*" | "/", ..)
            )
        };
        let is_text = |this: &Self, index| match expression(index) {
            Expression::Text(_) => true,
            Expression::Name(name) => this.enumerators.contains(name),
            _ => false,
        };
        let test = match operator {
            "==" | "!=" if is_number(left) || is_number(right) => "=",
            "==" | "!=" if is_text(self, left) || is_text(self, right) => "equal",
            "==" | "!=" => "equalp",
            operator => operator,
        };
        let form = self.forms.call(test, 3, [values[left], values[right]]);
        if operator == "!=" { self.not(form) } else { form }
    }
}

/// Returns a text as a literal of ESL.
pub(crate) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
