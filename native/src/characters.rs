//! Builtins of one character: in line for the characters of ASCII, whose values are in a table.

use std::sync::LazyLock;

use cranelift_codegen::ir::{InstBuilder, types};
use esl_bytecode::builtin::Builtin;
use esl_heap::{Value, character};

use crate::emit::{WORD, memory};
use crate::kinds::Known;
use crate::translate::Translator;

/// Number of the characters of ASCII.
const CODES: usize = 0x80;

/// The words of the values that a builtin has for them.
pub(crate) type AsciiValues = [u64; CODES];

/// Returns the value of a builtin for a code.
type AsciiFunction = fn(u32) -> Value;

/// The builtins, called with one argument, and what each returns.
const ROWS: [(Builtin, AsciiFunction); 10] = [
    (Builtin::AlphaCharp, |code| character::is_alphabetic(code).into()),
    (Builtin::Alphanumericp, |code| character::is_alphanumeric(code).into()),
    (Builtin::BothCasep, |code| (character::is_upper(code) || character::is_lower(code)).into()),
    (Builtin::CharCode, |code| Value::index(code as usize)),
    (Builtin::CharDowncase, |code| of(character::downcase(code))),
    (Builtin::CharUpcase, |code| of(character::upcase(code))),
    (Builtin::DigitCharp, |code| match character::digit_weight(code, 10) {
        Some(weight) => Value::index(weight as usize),
        None => Value::NIL,
    }),
    (Builtin::GraphicCharp, |code| character::is_graphic(code).into()),
    (Builtin::LowerCasep, |code| character::is_lower(code).into()),
    (Builtin::UpperCasep, |code| character::is_upper(code).into()),
];

static TABLES: LazyLock<[AsciiValues; ROWS.len()]> =
    LazyLock::new(|| ROWS.map(|(_, value)| std::array::from_fn(|code| value(code as u32).bits())));

fn of(code: u32) -> Value {
    Value::character(code).unwrap_or(Value::NIL)
}

/// Returns the values of a builtin that is called with so many arguments, if it is one of those.
pub(crate) fn values_of(builtin: u32, count: u8) -> Option<&'static AsciiValues> {
    let row = ROWS.iter().position(|(other, _)| count == 1 && other.number() == builtin)?;
    Some(&TABLES[row])
}

impl Translator<'_, '_> {
    /// Calls a builtin of one character. Its ticks are those of the machine: one.
    pub(crate) fn of_character(&mut self, window: u8, values: &'static AsciiValues) {
        self.spill();
        self.tick();
        let (slow, (done, value)) = (self.cold_block(), self.block_with_value());
        self.require_nothing_due(slow);
        let argument = self.get(window + 2);
        let mark = of(0).bits();
        // The code, shifted as in the word, if that is a character.
        let code = self.b.ins().bxor_imm_s(argument, mark as i64);
        let other = self.b.ins().band_imm_s(code, !((CODES as i64 - 1) << 8));
        self.refuse(other, slow);
        let distance = self.b.ins().ushr_imm_s(code, 8 - i64::from(WORD.trailing_zeros()));
        let table = self.word(values.as_ptr().expose_provenance() as u64);
        let place = self.b.ins().iadd(table, distance);
        let found = self.b.ins().load(types::I64, memory(), place, 0);
        self.jump_with(done, found);

        self.go_to(slow);
        let found = self.value_of_builtin(window);
        self.jump_with(done, found);
        self.go_to(done);
        self.set(window, value, Known::Nothing);
    }
}
