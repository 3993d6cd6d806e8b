//! Fingerprints of the two tables that compiler and virtual machine must agree on, computed at compile time.
//!
//! They cover what the meaning of a file depends on: numbers, operands and substitute rules of opcodes, type
//! codes, and names and arities of builtins in their order. Texts for people are left out.

use crate::builtin::{BUILTINS, Visibility};
use crate::opcode::{OPCODES, TypeCode};

/// Fingerprint of the opcode table.
pub const OPCODE_TABLE: u64 = opcode_table();
/// Fingerprint of the builtin table.
pub const BUILTIN_TABLE: u64 = builtin_table();

const fn opcode_table() -> u64 {
    let mut hash = FNV_START;
    let mut row = 0;
    while row < OPCODES.len() {
        let info = &OPCODES[row];
        hash = mix(hash, &[info.opcode as u8, info.substitute as u8]);
        hash = mix_str(hash, info.mnemonic);
        let mut operand = 0;
        while operand < info.operands.len() {
            hash = mix_str(hash, info.operands[operand].0);
            hash = mix_str(hash, info.operands[operand].1);
            operand += 1;
        }
        row += 1;
    }
    let mut code = 0;
    while code < TypeCode::ALL.len() {
        hash = mix(hash, &[TypeCode::ALL[code] as u8]);
        code += 1;
    }
    hash
}

const fn builtin_table() -> u64 {
    let mut hash = FNV_START;
    let mut row = 0;
    while row < BUILTINS.len() {
        let info = &BUILTINS[row];
        hash = mix(hash, &[matches!(info.visibility, Visibility::Cl) as u8]);
        hash = mix_str(hash, info.name);
        hash = mix(hash, &info.arity.min.to_le_bytes());
        let max = match info.arity.max {
            Some(max) => max,
            None => u32::MAX,
        };
        hash = mix(hash, &max.to_le_bytes());
        row += 1;
    }
    hash
}

const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a. `0xFF` ends a string, which no UTF-8 text contains.
const fn mix_str(hash: u64, text: &str) -> u64 {
    mix(mix(hash, text.as_bytes()), &[0xFF])
}

const fn mix(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut at = 0;
    while at < bytes.len() {
        hash = (hash ^ bytes[at] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        at += 1;
    }
    hash
}
