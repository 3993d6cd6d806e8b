//! A module as text, for snapshots.

use std::fmt::Write;

use esl_bytecode::module::{Constant, Module};
use esl_bytecode::opcode::Instr;

/// The functions of a module, one instruction a line.
pub(super) fn listing(module: &Module) -> String {
    let mut text = String::new();
    for (number, function) in module.functions.iter().enumerate() {
        let name = function.name.map_or("-".to_string(), |name| constant(module, name.0));
        let _ = writeln!(text, "function {number} {name}, {} registers", function.registers);
        for capture in &function.captures {
            let _ = writeln!(text, "  captures {capture:?}");
        }
        let mut pc = 0;
        while pc < function.code.len() {
            let instr = Instr::decode(&function.code, pc).expect("an instruction");
            let mut line = instr.to_string();
            for (index, entry) in function.constants.iter().enumerate().rev() {
                line = line.replace(&format!("k{index}"), &constant(module, entry.0));
            }
            let _ = writeln!(text, "{pc:4}  {line}");
            pc += instr.opcode().words();
        }
    }
    text
}

fn constant(module: &Module, index: u32) -> String {
    match &module.constants[index as usize] {
        Constant::Nil => "NIL".to_string(),
        Constant::True => "T".to_string(),
        Constant::Symbol(symbol) => symbol.to_string(),
        Constant::Integer(value) => value.to_string(),
        Constant::Float(value) => format!("{value:?}"),
        Constant::String(value) => format!("{value:?}"),
        Constant::Function(number) => format!("function {}", number.0),
        Constant::Class(name) => format!("class {name}"),
        Constant::Cons(car, cdr) => format!("({} . {})", constant(module, car.0), constant(module, cdr.0)),
        other => format!("{other:?}"),
    }
}
