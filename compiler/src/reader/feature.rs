//! Feature expressions: the condition between `#+` or `#-` and the datum that is read or left out.
//!
//! An expression is a name, or `(and …)`, `(or …)`, `(not …)` of expressions. Names are compared without
//! their package. Expressions are evaluated on their tokens, with an explicit stack.

use super::lexer::{Lexeme, Token};
use super::name;

/// The features of this implementation, as `*features*` has them at first.
pub const FEATURES: [&str; 2] = ["ESL", "COMMON-LISP"];

/// A fault of a feature expression, and its place.
#[derive(Debug)]
pub(super) struct FeatureError {
    pub(super) start: u32,
    pub(super) end: u32,
    pub(super) message: String,
}

/// The part of `(and …)`, `(or …)` or `(not …)` that has been evaluated.
struct FeatureOperation {
    operator: FeatureOperator,
    value: bool,
    operands: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum FeatureOperator {
    And,
    Or,
    Not,
}

/// Says whether a feature of this name, in upper case, is present.
pub(super) type HasFeature<'a> = &'a dyn Fn(&str) -> bool;

/// Whether the feature expression with these tokens holds. The tokens are balanced.
///
/// # Errors
/// The first fault.
pub(super) fn holds(
    text: &str,
    lexemes: &[Lexeme],
    has_feature: HasFeature<'_>,
) -> Result<bool, FeatureError> {
    let mut operations: Vec<FeatureOperation> = Vec::new();
    let mut lexemes = lexemes.iter();
    while let Some(lexeme) = lexemes.next() {
        let value = match lexeme.token {
            Token::Open => {
                let operator = lexemes.next().map_or(Err(lexeme), |next| operator(text, next).ok_or(next));
                let operator =
                    operator.map_err(|found| fault(found, "expected `and`, `or` or `not`", text))?;
                operations.push(FeatureOperation {
                    operator,
                    value: operator == FeatureOperator::And,
                    operands: 0,
                });
                continue;
            }
            Token::Close => match operations.pop() {
                Some(FeatureOperation { operator: FeatureOperator::Not, operands, .. }) if operands != 1 => {
                    return Err(fault(lexeme, "expected exactly one feature after `not`", text));
                }
                Some(operation) => operation.value,
                None => return Err(fault(lexeme, "expected a feature", text)),
            },
            Token::Atom | Token::Escaped => {
                let name = feature(text, lexeme).ok_or_else(|| fault(lexeme, "expected a feature", text))?;
                has_feature(&name)
            }
            _ => return Err(fault(lexeme, "expected a feature", text)),
        };
        let Some(outer) = operations.last_mut() else { return Ok(value) };
        outer.operands += 1;
        outer.value = match outer.operator {
            FeatureOperator::And => outer.value && value,
            FeatureOperator::Or => outer.value || value,
            FeatureOperator::Not => !value,
        };
    }
    Err(FeatureError { start: 0, end: 0, message: "expected a feature".into() })
}

fn operator(text: &str, lexeme: &Lexeme) -> Option<FeatureOperator> {
    match feature(text, lexeme)?.as_str() {
        "AND" => Some(FeatureOperator::And),
        "OR" => Some(FeatureOperator::Or),
        "NOT" => Some(FeatureOperator::Not),
        _ => None,
    }
}

/// Returns the name of a feature or operator.
fn feature(text: &str, lexeme: &Lexeme) -> Option<String> {
    if !matches!(lexeme.token, Token::Atom | Token::Escaped) {
        return None;
    }
    let parts = name::parse(&text[lexeme.start as usize..lexeme.end as usize]).ok()?;
    Some(parts.name)
}

fn fault(found: &Lexeme, expected: &str, text: &str) -> FeatureError {
    let shown = name::shorten(&text[found.start as usize..found.end as usize]);
    FeatureError { start: found.start, end: found.end, message: format!("{expected}, found `{shown}`") }
}
