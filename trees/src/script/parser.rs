//! Reading scripts, by binding powers.

use super::token::{ScriptToken, tokens};
use super::{Expression, Script, ScriptFault};

/// Deepest nesting of parentheses and prefixes.
const MAX_DEPTH: usize = 100;

/// Binding power of a prefix.
const PREFIX: u8 = 20;

/// Returns the script that a text holds.
///
/// # Errors
/// The fault, and what was expected.
pub(crate) fn parse(text: &str) -> Result<Script, ScriptFault> {
    let mut parser = ScriptParser { tokens: tokens(text)?, at: 0, script: Script::default() };
    while parser.at < parser.tokens.len() {
        let statement = parser.expression(0, 0)?;
        parser.script.statements.push(statement);
        while parser.takes(";") {}
    }
    Ok(parser.script)
}

fn shown(token: &ScriptToken) -> String {
    match token {
        ScriptToken::Number(text) | ScriptToken::Name(text) => format!("`{text}`"),
        ScriptToken::Text(text) => format!("`'{text}'`"),
        ScriptToken::Boolean(value) => format!("`{value}`"),
        ScriptToken::Operator(text) => format!("`{text}`"),
    }
}

/// Returns how strongly an operator binds its left operand.
fn power(operator: &str) -> Option<u8> {
    Some(match operator {
        ":=" | "=" | "+=" | "-=" | "*=" | "/=" => 2,
        "?" => 4,
        "||" => 6,
        "&&" => 8,
        "==" | "!=" | "<" | ">" | "<=" | ">=" => 10,
        "|" | "^" => 12,
        "&" => 14,
        "+" | "-" | ".." => 16,
        "*" | "/" => 18,
        _ => return None,
    })
}

struct ScriptParser {
    tokens: Vec<ScriptToken>,
    at: usize,
    script: Script,
}

impl ScriptParser {
    fn peek(&self) -> Option<&ScriptToken> {
        self.tokens.get(self.at)
    }

    fn operator(&self) -> Option<&'static str> {
        match self.peek() {
            Some(ScriptToken::Operator(operator)) => Some(operator),
            _ => None,
        }
    }

    fn takes(&mut self, operator: &str) -> bool {
        let is_there = self.operator() == Some(operator);
        self.at += usize::from(is_there);
        is_there
    }

    fn expect(&mut self, operator: &str) -> Result<(), ScriptFault> {
        if self.takes(operator) {
            return Ok(());
        }
        let found = self.peek().map_or("the end of the script".into(), shown);
        Err(format!("expected `{operator}`, found {found}").into())
    }

    fn push(&mut self, expression: Expression) -> usize {
        self.script.expressions.push(expression);
        self.script.expressions.len() - 1
    }

    fn expression(&mut self, least: u8, depth: usize) -> Result<usize, ScriptFault> {
        if depth > MAX_DEPTH {
            return Err(format!(
                "the script is nested more than {MAX_DEPTH} deep: divide it into statements"
            )
            .into());
        }
        let mut left = self.prefix(depth)?;
        while let Some(operator) = self.operator() {
            let Some(power) = power(operator).filter(|&power| power >= least) else { break };
            self.at += 1;
            left = match power {
                2 => return self.assignment(operator, left, depth),
                4 => return self.conditional(left, depth),
                10 => self.comparison(operator, left, depth)?,
                _ => {
                    let right = self.expression(power + 1, depth + 1)?;
                    self.push(Expression::Binary(operator, left, right))
                }
            };
        }
        Ok(left)
    }

    fn prefix(&mut self, depth: usize) -> Result<usize, ScriptFault> {
        let Some(token) = self.peek().cloned() else {
            return Err("expected a value, found the end of the script".to_owned().into());
        };
        self.at += 1;
        Ok(match token {
            ScriptToken::Number(text) => self.push(Expression::Number(text)),
            ScriptToken::Text(text) => self.push(Expression::Text(text)),
            ScriptToken::Boolean(value) => self.push(Expression::Boolean(value)),
            ScriptToken::Name(name) => self.push(Expression::Name(name)),
            ScriptToken::Operator("(") => {
                let inner = self.expression(0, depth + 1)?;
                self.expect(")")?;
                inner
            }
            ScriptToken::Operator(operator @ ("-" | "~" | "!")) => {
                let operand = self.expression(PREFIX, depth + 1)?;
                self.push(Expression::Unary(operator, operand))
            }
            token @ ScriptToken::Operator(_) => {
                return Err(format!("expected a value, found {}", shown(&token)).into());
            }
        })
    }

    fn assignment(
        &mut self,
        operator: &'static str,
        left: usize,
        depth: usize,
    ) -> Result<usize, ScriptFault> {
        let Some(Expression::Name(name)) = self.script.expressions.get(left).cloned() else {
            return Err(
                format!("`{operator}` sets an entry of the blackboard: expected its name before it").into()
            );
        };
        // The name is set, not read.
        if left + 1 == self.script.expressions.len() {
            self.script.expressions.pop();
        }
        let value = self.expression(0, depth + 1)?;
        Ok(self.push(Expression::Assignment(operator, name, value)))
    }

    fn conditional(&mut self, condition: usize, depth: usize) -> Result<usize, ScriptFault> {
        let then = self.expression(0, depth + 1)?;
        self.expect(":")?;
        let other = self.expression(4, depth + 1)?;
        Ok(self.push(Expression::Conditional(condition, then, other)))
    }

    fn comparison(&mut self, first: &'static str, left: usize, depth: usize) -> Result<usize, ScriptFault> {
        let mut operators = vec![first];
        let mut operands = vec![left, self.expression(11, depth + 1)?];
        while let Some(operator) = self.operator().filter(|operator| power(operator) == Some(10)) {
            self.at += 1;
            operators.push(operator);
            operands.push(self.expression(11, depth + 1)?);
        }
        Ok(self.push(Expression::Comparison(operators, operands)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a script with all its parentheses.
    fn shape(text: &str) -> String {
        let script = match parse(text) {
            Ok(script) => script,
            Err(fault) => return fault.to_string(),
        };
        let mut texts: Vec<String> = Vec::new();
        for expression in &script.expressions {
            let text = match expression {
                Expression::Number(text) | Expression::Name(text) => text.clone(),
                Expression::Text(text) => format!("'{text}'"),
                Expression::Boolean(value) => value.to_string(),
                Expression::Unary(operator, operand) => format!("({operator}{})", texts[*operand]),
                Expression::Binary(operator, left, right) => {
                    format!("({}{operator}{})", texts[*left], texts[*right])
                }
                Expression::Comparison(operators, operands) => {
                    let rest = operators.iter().zip(&operands[1..]);
                    let rest: String =
                        rest.map(|(operator, operand)| format!("{operator}{}", texts[*operand])).collect();
                    format!("({}{rest})", texts[operands[0]])
                }
                Expression::Conditional(a, b, c) => format!("({}?{}:{})", texts[*a], texts[*b], texts[*c]),
                Expression::Assignment(operator, name, value) => {
                    format!("({name}{operator}{})", texts[*value])
                }
            };
            texts.push(text);
        }
        script.statements.iter().map(|&statement| &*texts[statement]).collect::<Vec<_>>().join(";")
    }

    #[test]
    fn operators_bind_as_in_the_original() {
        assert_eq!(shape("A := 1 + 2 * 3; B = -A"), "(A:=(1+(2*3)));(B=(-A))");
        assert_eq!(shape("a && b || !c"), "((a&&b)||(!c))");
        assert_eq!(shape("a < b <= 3 && c == 'x'"), "((a<b<=3)&&(c=='x'))");
        assert_eq!(shape("a ? 1 : b ? 2 : 3"), "(a?1:(b?2:3))");
        assert_eq!(shape("A += (1 | 2) ^ 0x1F & 3"), "(A+=((1|2)^(31&3)))");
        assert_eq!(shape("m := 'a' .. 1.50 .. true"), "(m:=(('a'..1.5)..true))");
        // A semicolon between statements may be missing.
        assert_eq!(shape("A := 1 B := 2"), "(A:=1);(B:=2)");
        assert_eq!(shape(";;"), "expected a value, found `;`");
        assert_eq!(shape(""), "");
    }

    #[test]
    fn faults_say_what_was_expected() {
        assert_eq!(shape("a == "), "expected a value, found the end of the script");
        assert_eq!(shape("(a"), "expected `)`, found the end of the script");
        assert_eq!(shape("1 := 2"), "`:=` sets an entry of the blackboard: expected its name before it");
        assert_eq!(shape("a )"), "expected a value, found `)`");
        assert_eq!(shape("a := 'b"), "the text 'b has no end: expected a second `'`");
        assert_eq!(shape("a # b"), "`#` is not part of the language of scripts");
        assert!(shape("a := 1.").starts_with("`1.` is not a number"));
        assert!(shape(&"(".repeat(1000)).starts_with("the script is nested"));
        assert!(shape(&"-".repeat(1000)).starts_with("the script is nested"));
    }

    #[test]
    fn long_chains_take_no_native_stack() {
        let text = format!("a{}", " + a".repeat(100_000));
        assert_eq!(parse(&text).expect("a script").expressions.len(), 200_001);
    }
}
