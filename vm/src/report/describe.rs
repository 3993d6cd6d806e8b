//! Values as short texts, for messages of the machine itself.
//!
//! The printer that programs use is written in ESL; this one is for failures that are put into words before any ESL can
//! run, such as a wrong number of arguments. It shows a few elements and levels and no more.

use num_bigint::BigInt;

use crate::heap::Kind;
use crate::heap::layout::{Code, Symbol};
use crate::value::Value;
use crate::vm::Vm;

/// Elements of a list or vector, characters of a string, and levels that are shown.
const LENGTH: usize = 10;
const CHARACTERS: usize = 60;
const DEPTH: usize = 3;
/// Limbs of an integer whose digits are shown.
const LIMBS: usize = 8;

impl Vm {
    /// A short text for a value.
    pub fn describe(&self, value: Value) -> String {
        let mut text = String::new();
        self.describe_into(value, DEPTH, &mut text);
        text
    }

    /// The name of a function, for messages.
    pub(crate) fn name_of_function(&self, function: Value) -> String {
        let code = self.heap.function_code(function).and_then(|code| self.heap.code(code));
        match code {
            Some(Code { name, .. }) if name.is_true() => self.describe(*name),
            _ => "an anonymous function".into(),
        }
    }

    // The depth is bounded by `DEPTH`, so recursion is fine here.
    fn describe_into(&self, value: Value, depth: usize, text: &mut String) {
        if let Some(n) = value.as_fixnum() {
            text.push_str(&n.to_string());
        } else if let Some(x) = self.heap.as_double(value) {
            text.push_str(&format!("{x:?}"));
        } else if let Some(code) = value.as_character() {
            text.push_str("#\\");
            text.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
        } else if value.is_nil() {
            text.push_str("NIL");
        } else if value == Value::T {
            text.push('T');
        } else if value.is_cons() {
            self.describe_list(value, depth, text);
        } else {
            self.describe_object(value, depth, text);
        }
    }

    fn describe_list(&self, list: Value, depth: usize, text: &mut String) {
        if depth == 0 {
            text.push('#');
            return;
        }
        text.push('(');
        let mut rest = list;
        for i in 0.. {
            let Some(pair) = self.heap.as_cons(rest) else { break };
            if i > 0 {
                text.push(' ');
            }
            if i == LENGTH {
                text.push_str("...)");
                return;
            }
            self.describe_into(pair.car, depth - 1, text);
            rest = pair.cdr;
        }
        if rest.is_true() {
            text.push_str(" . ");
            self.describe_into(rest, depth - 1, text);
        }
        text.push(')');
    }

    fn describe_object(&self, value: Value, depth: usize, text: &mut String) {
        match self.heap.kind(value) {
            Some(Kind::Symbol) => self.describe_symbol(value, text),
            Some(Kind::String) => {
                let characters = self.heap.string(value).unwrap_or(&[]);
                let shown: String = characters
                    .iter()
                    .take(CHARACTERS)
                    .map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
                    .collect();
                let more = if characters.len() > CHARACTERS { "..." } else { "" };
                text.push_str(&format!("\"{shown}{more}\""));
            }
            Some(Kind::Bignum) => {
                if let Some(big) = self.heap.bignum(value)
                    && big.limbs.len() <= LIMBS
                {
                    let bytes: Vec<u8> = big.limbs.iter().flat_map(|limb| limb.to_le_bytes()).collect();
                    let magnitude = BigInt::from_bytes_le(num_bigint::Sign::Plus, &bytes);
                    text.push_str(&if big.negative { -magnitude } else { magnitude }.to_string());
                } else {
                    text.push_str("a large integer");
                }
            }
            Some(Kind::Ratio) => {
                if let Some((numerator, denominator)) = self.heap.ratio(value) {
                    self.describe_into(numerator, depth, text);
                    text.push('/');
                    self.describe_into(denominator, depth, text);
                }
            }
            Some(Kind::SimpleVector) => {
                if depth == 0 {
                    text.push('#');
                    return;
                }
                text.push_str("#(");
                for (i, &element) in self.heap.vector(value).unwrap_or(&[]).iter().enumerate() {
                    if i > 0 {
                        text.push(' ');
                    }
                    if i == LENGTH {
                        text.push_str("...");
                        break;
                    }
                    self.describe_into(element, depth - 1, text);
                }
                text.push(')');
            }
            Some(Kind::Function) => text.push_str(&format!("#<function {}>", self.name_of_function(value))),
            Some(Kind::Structure) => {
                let class = self.heap.structure_class(value).unwrap_or(Value::NIL);
                text.push_str("#<");
                self.describe_into(self.class_name(class), depth, text);
                text.push('>');
            }
            Some(kind) => text.push_str(&format!("#<{}>", format!("{kind:?}").to_lowercase())),
            None => text.push_str("#<object>"),
        }
    }

    fn describe_symbol(&self, symbol: Value, text: &mut String) {
        let Some(cell) = self.heap.symbol(symbol) else { return };
        if cell.header.flags & Symbol::KEYWORD != 0 {
            text.push(':');
        }
        text.push_str(&self.heap.string_text(cell.name).unwrap_or_default());
    }
}
