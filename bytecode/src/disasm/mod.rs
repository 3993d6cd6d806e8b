//! Modules as text: for `eslc disasm`, and for the snapshots of the compiler's tests.
//!
//! ```text
//! function 1: COUNT-DOWN (N)
//!   4 registers; 1 required
//!   ; count.esl:3
//!     0  load-int r1 0
//! L1:
//!     1  call-global r2.. 1 want 1 k0  ; TICK
//! ```
//!
//! Guarantees: any module has a text, also one that the verifier refuses; the text depends on nothing but the
//! module; its instructions are those that [`crate::assembler`] reads.

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use crate::builtin::Builtin;
use crate::module::{
    CaptureSource, Constant, FunctionNumber, LineEntry, Module, ModuleFunction, PoolIdx, VariablePlace,
    VariableRange,
};
use crate::opcode::{Instr, TypeCode};
use crate::operand::Role;

/// Returns the text of the whole module: its functions, then which of them the top-level forms are.
pub fn module(module: &Module) -> String {
    let mut text = String::new();
    for number in 0..module.functions.len() as u32 {
        text.push_str(&function(module, FunctionNumber(number)));
        text.push('\n');
    }
    text.push_str("top level:");
    for FunctionNumber(number) in &module.toplevel {
        push(&mut text, format_args!(" {number}"));
    }
    text.push('\n');
    text
}

/// Returns the text of one function; empty if the module has no such function.
pub fn function(module: &Module, number: FunctionNumber) -> String {
    let mut text = String::new();
    if let Some(function) = module.functions.get(number.0 as usize) {
        push(&mut text, format_args!("function {}: {}\n", number.0, title(module, function)));
        push(&mut text, format_args!("  {}\n", frame(module, function)));
        for (index, capture) in function.captures.iter().enumerate() {
            let boxed = if capture.boxed { ", a box" } else { "" };
            push(&mut text, format_args!("  capture #{index}: {}{boxed}\n", capture.source));
        }
        for VariableRange { name, place, from, to } in &function.variables {
            let place = match place {
                VariablePlace::Register(register) => format!("r{register}"),
                VariablePlace::Capture(index) => format!("#{index}"),
            };
            push(&mut text, format_args!("  ; {} in {place}, {from} to {to}\n", name.escape_debug()));
        }
        let listing = Listing { module, function, labels: labels(function) };
        listing.write(&mut text);
    }
    text
}

/// Returns a constant as it is shown beside an instruction: long ones are cut off with `...`.
pub fn constant(module: &Module, index: PoolIdx) -> String {
    let mut text = String::new();
    let mut left = SHOWN_NODES;
    show(module, index, 0, &mut left, &mut text);
    // A text of one line: names may contain anything.
    if text.contains(char::is_control) { text.escape_debug().to_string() } else { text }
}

/// Appends to a string, which cannot fail.
fn push(text: &mut String, arguments: fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a string does not fail");
}

fn title(module: &Module, function: &ModuleFunction) -> String {
    let name = function.name.map_or("(anonymous)".to_owned(), |name| constant(module, name));
    match function.lambda_list {
        Some(lambda_list) if module.constants.get(lambda_list.0 as usize) == Some(&Constant::Nil) => {
            format!("{name} ()")
        }
        Some(lambda_list) => format!("{name} {}", constant(module, lambda_list)),
        None => name,
    }
}

fn frame(module: &Module, function: &ModuleFunction) -> String {
    let parameters = &function.parameters;
    let mut text = format!("{} registers; {} required", function.registers, parameters.required);
    if parameters.optional > 0 {
        push(&mut text, format_args!(", {} optional", parameters.optional));
    }
    if parameters.rest {
        text.push_str(", rest");
    }
    if let Some(keys) = &parameters.keys {
        text.push_str(", keys");
        for &key in keys {
            push(&mut text, format_args!(" {}", constant(module, key)));
        }
    }
    if parameters.allow_other_keys {
        text.push_str(", allow other keys");
    }
    text
}

impl fmt::Display for CaptureSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CaptureSource::Register(register) => write!(f, "r{register} of the maker"),
            CaptureSource::Capture(index) => write!(f, "capture #{index} of the maker"),
            CaptureSource::Later => f.write_str("comes later"),
        }
    }
}

/// Where instructions begin; the words in between are `None`.
fn instructions(function: &ModuleFunction) -> impl Iterator<Item = (usize, Option<Instr>)> + '_ {
    let mut pc = 0;
    std::iter::from_fn(move || {
        if pc >= function.code.len() {
            return None;
        }
        let at = pc;
        let instr = Instr::decode(&function.code, at);
        pc += instr.map_or(1, |instr| instr.opcode().words());
        Some((at, instr))
    })
}

/// Names for the words that jumps go to, in order.
fn labels(function: &ModuleFunction) -> BTreeMap<usize, usize> {
    let mut labels: BTreeMap<usize, usize> = BTreeMap::new();
    for (pc, instr) in instructions(function) {
        let Some(instr) = instr else { continue };
        instr.visit_operands(|role| {
            if let Role::Forward(distance) | Role::Backward(distance) | Role::Landing(distance) = role {
                labels.extend(target(pc, instr, distance).map(|target| (target, 0)));
            }
        });
    }
    let starts: std::collections::BTreeSet<usize> = instructions(function).map(|(pc, _)| pc).collect();
    labels.retain(|target, _| starts.contains(target));
    for (number, label) in labels.values_mut().enumerate() {
        *label = number + 1;
    }
    labels
}

fn target(pc: usize, instr: Instr, distance: i32) -> Option<usize> {
    (pc + instr.opcode().words()).checked_add_signed(distance as isize)
}

struct Listing<'a> {
    module: &'a Module,
    function: &'a ModuleFunction,
    labels: BTreeMap<usize, usize>,
}

impl Listing<'_> {
    fn write(&self, text: &mut String) {
        let mut lines = self.function.lines.iter().peekable();
        let mut last = None;
        for (pc, instr) in instructions(self.function) {
            let mut line = None;
            while let Some(entry) = lines.next_if(|entry| entry.pc as usize <= pc) {
                line = Some(entry);
            }
            if let Some(LineEntry { source, line, .. }) = line
                && last != Some((source, line))
            {
                let name = self.module.sources.get(*source as usize).map_or("?", String::as_str);
                push(text, format_args!("  ; {name}:{line}\n"));
                last = Some((source, line));
            }
            if let Some(label) = self.labels.get(&pc) {
                push(text, format_args!("L{label}:\n"));
            }
            match instr {
                Some(instr) => push(text, format_args!("{pc:5}  {}\n", self.instruction(pc, instr))),
                None => {
                    push(text, format_args!("{pc:5}  ; no instruction: {:#010x}\n", self.function.code[pc]))
                }
            }
        }
    }

    fn instruction(&self, pc: usize, instr: Instr) -> String {
        let mut text = instr.opcode().mnemonic().to_owned();
        let mut comment = String::new();
        instr.visit_texts(|kind, operand, role| {
            match role {
                Role::Forward(distance) | Role::Backward(distance) | Role::Landing(distance) => {
                    let label = target(pc, instr, distance).and_then(|target| self.labels.get(&target));
                    match label {
                        Some(label) => push(&mut text, format_args!(" L{label}")),
                        None => push(&mut text, format_args!(" {operand}")),
                    }
                }
                // It only fills the aux word.
                _ if kind == "Pad" => {}
                _ => push(&mut text, format_args!(" {operand}")),
            }
            if let Some(meaning) = self.meaning(role) {
                comment.push_str(if comment.is_empty() { "  ; " } else { ", " });
                comment.push_str(&meaning);
            }
        });
        text + &comment
    }

    /// Returns the meaning of an operand that is only a number.
    fn meaning(&self, role: Role) -> Option<String> {
        match role {
            Role::Constant(index)
            | Role::SymbolConstant(index)
            | Role::ClassConstant(index)
            | Role::VectorConstant(index)
            | Role::FunctionConstant(index) => {
                Some(constant(self.module, *self.function.constants.get(index as usize)?))
            }
            Role::Builtin(number) => Some(Builtin::from_number(number)?.info().name.to_owned()),
            Role::TypeCode(code) => Some(TypeCode::from_number(code)?.type_name().to_owned()),
            _ => None,
        }
    }
}

/// How deep, and up to how many parts, a constant is shown.
const SHOWN_DEPTH: usize = 6;
const SHOWN_NODES: usize = 50;
const SHOWN_CHARACTERS: usize = 60;

fn show(module: &Module, index: PoolIdx, depth: usize, left: &mut usize, text: &mut String) {
    let Some(constant) = module.constants.get(index.0 as usize) else {
        return push(text, format_args!("?{}", index.0));
    };
    if *left == 0 || depth > SHOWN_DEPTH {
        return text.push_str("...");
    }
    *left -= 1;
    match constant {
        Constant::Nil => text.push_str("NIL"),
        Constant::True => text.push('T'),
        Constant::Symbol(symbol) => shorten(&symbol.to_string(), text),
        Constant::Integer(value) => shorten(&value.to_string(), text),
        Constant::Ratio(numerator, denominator) => shorten(&format!("{numerator}/{denominator}"), text),
        Constant::Float(value) => push(text, format_args!("{value:?}")),
        Constant::Character(value) => push(text, format_args!("#\\{}", value.escape_debug())),
        Constant::String(value) => shorten(&format!("{value:?}"), text),
        Constant::Cons(..) => show_list(module, index, depth, left, text),
        Constant::Vector(items) => {
            text.push_str("#(");
            show_items(module, items, depth, left, text);
        }
        Constant::Array(dimensions, items) => {
            push(text, format_args!("#{}A(", dimensions.len()));
            show_items(module, items, depth, left, text);
        }
        Constant::Function(FunctionNumber(number)) => {
            push(text, format_args!("function {number}"));
            let name = module.functions.get(*number as usize).and_then(|function| function.name);
            if let Some(name) = name {
                text.push(' ');
                show(module, name, depth + 1, left, text);
            }
        }
        Constant::Class(name) => shorten(&format!("class {name}"), text),
        Constant::Object(id) => push(text, format_args!("#<object {}>", id.0)),
    }
}

fn show_items(module: &Module, items: &[PoolIdx], depth: usize, left: &mut usize, text: &mut String) {
    for (i, &item) in items.iter().enumerate() {
        if i > 0 {
            text.push(' ');
        }
        if *left == 0 {
            text.push_str("...");
            break;
        }
        show(module, item, depth + 1, left, text);
    }
    text.push(')');
}

fn show_list(module: &Module, start: PoolIdx, depth: usize, left: &mut usize, text: &mut String) {
    text.push('(');
    let mut rest = start;
    let mut first = true;
    loop {
        match module.constants.get(rest.0 as usize) {
            Some(Constant::Cons(car, cdr)) => {
                if !std::mem::take(&mut first) {
                    text.push(' ');
                }
                if *left == 0 {
                    text.push_str("...");
                    break;
                }
                *left -= 1;
                show(module, *car, depth + 1, left, text);
                rest = *cdr;
            }
            Some(Constant::Nil) => break,
            _ => {
                text.push_str(" . ");
                show(module, rest, depth + 1, left, text);
                break;
            }
        }
    }
    text.push(')');
}

/// Appends the beginning of what may be long.
fn shorten(long: &str, text: &mut String) {
    match long.char_indices().nth(SHOWN_CHARACTERS) {
        None => text.push_str(long),
        Some((end, _)) => {
            text.push_str(&long[..end]);
            text.push_str("...");
        }
    }
}

#[cfg(test)]
mod tests;
