//! Code from text, for tests and for trying things out. The text is what the disassembler prints:
//!
//! ```text
//!      0  load-int r0 10        ; comments and the number in front are optional
//! L1:
//!      1  add-int r0 r0 -1
//!      2  loop-less r1 r0 L1
//! L2:  4  call r2.. 1 want all  ; a label may stand in the line of its instruction
//! ```
//!
//! Constants, builtins and type codes are given by number. A jump goes to a label, or by a distance with a
//! sign.

use std::collections::HashMap;
use std::fmt;

use crate::for_each_opcode;
use crate::opcode::{Instr, Opcode};
use crate::operand::*;

/// Fault in a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssembleError {
    /// The line, from 1.
    pub line: usize,
    /// The fault in it.
    pub fault: AssembleFault,
}

/// A fault in a line. Words are spelt as in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AssembleFault {
    /// No opcode has this mnemonic.
    UnknownOpcode(String),
    /// An operand is missing.
    MissingOperand,
    /// The number after `want` is missing.
    MissingNumber,
    /// The word is neither an operand nor a label.
    NotAnOperand(String),
    /// The number is too large for its field.
    TooLarge(String),
    /// The word follows the last operand.
    Superfluous(String),
}

impl fmt::Display for AssembleFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AssembleFault::UnknownOpcode(word) => write!(f, "no opcode is called `{word}`"),
            AssembleFault::MissingOperand => f.write_str("expected more operands"),
            AssembleFault::MissingNumber => f.write_str("expected a number after `want`"),
            AssembleFault::NotAnOperand(word) => write!(f, "expected an operand, found `{word}`"),
            AssembleFault::TooLarge(word) => write!(f, "`{word}` does not fit its operand"),
            AssembleFault::Superfluous(word) => write!(f, "expected no more operands, found `{word}`"),
        }
    }
}

impl fmt::Display for AssembleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.fault)
    }
}

impl std::error::Error for AssembleError {}

/// Returns the code that `text` describes.
///
/// # Errors
/// [`AssembleError`] for the first line that cannot be understood.
pub fn assemble(text: &str) -> Result<Vec<u32>, AssembleError> {
    let mut labels: HashMap<&str, i64> = HashMap::new();
    let mut lines: Vec<SourceLine<'_>> = Vec::new();
    let mut pc = 0;
    for (number, text) in text.lines().enumerate() {
        let mut words = text.split(';').next().unwrap_or("").split_whitespace().peekable();
        while let Some(label) = words.next_if(|word| word.ends_with(':')) {
            labels.insert(label.trim_end_matches(':'), pc);
        }
        words.next_if(|word| word.bytes().all(|byte| byte.is_ascii_digit()));
        let Some(mnemonic) = words.next() else { continue };
        let unknown = || AssembleFault::UnknownOpcode(mnemonic.into());
        let opcode = opcode(mnemonic).ok_or_else(|| AssembleError { line: number + 1, fault: unknown() })?;
        pc += opcode.words() as i64;
        lines.push(SourceLine { number: number + 1, opcode, next: pc, operands: words.collect() });
    }
    let mut code = Vec::new();
    for line in lines {
        let mut operands = Operands { words: line.operands.into_iter(), labels: &labels, next: line.next };
        let instr = instruction(line.opcode, &mut operands).and_then(|instr| match operands.words.next() {
            None => Ok(instr),
            Some(word) => Err(AssembleFault::Superfluous(word.into())),
        });
        let instr = instr.map_err(|fault| AssembleError { line: line.number, fault })?;
        let (word, aux) = instr.encode();
        code.push(word);
        code.extend(aux);
    }
    Ok(code)
}

struct SourceLine<'a> {
    number: usize,
    opcode: Opcode,
    /// The word after the instruction.
    next: i64,
    operands: Vec<&'a str>,
}

struct Operands<'a> {
    words: std::vec::IntoIter<&'a str>,
    labels: &'a HashMap<&'a str, i64>,
    next: i64,
}

impl Operands<'_> {
    /// Returns the next operand, of the type that is called `kind`.
    fn take<T: Operand>(&mut self, kind: &str) -> Result<T, AssembleFault> {
        if kind == "Pad" {
            return Ok(T::from_bits(0));
        }
        let mut word = self.words.next().ok_or(AssembleFault::MissingOperand)?;
        if kind == "Want" && word == "want" {
            word = self.words.next().ok_or(AssembleFault::MissingNumber)?;
        }
        let value = self.value(word, kind).ok_or_else(|| AssembleFault::NotAnOperand(word.into()))?;
        let operand = T::from_bits(value as u32);
        // A number that is too large for its field would come back as another one.
        let fits = T::WIDTH == 32 || (-(1 << (T::WIDTH - 1))..1 << T::WIDTH).contains(&value);
        if fits { Ok(operand) } else { Err(AssembleFault::TooLarge(word.into())) }
    }

    fn value(&self, word: &str, kind: &str) -> Option<i64> {
        match word {
            "all" if kind == "Want" => return Some(i64::from(Want::ALL.0)),
            "1" if kind == "Want" => return Some(i64::from(Want::ONE.0)),
            _ => {}
        }
        if let Some(target) = self.labels.get(word) {
            return Some(target - self.next);
        }
        let digits = word.trim_start_matches(['r', 'k', 'b', 't', '#', '+']).trim_end_matches("..");
        digits.parse().ok()
    }
}

macro_rules! define_assembler {
    ($( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal, $($kind:ident)+
        { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )*) => {
        fn opcode(mnemonic: &str) -> Option<Opcode> {
            match mnemonic {
                $( $mnemonic => Some(Opcode::$name), )*
                _ => None,
            }
        }

        fn instruction(opcode: Opcode, operands: &mut Operands<'_>) -> Result<Instr, AssembleFault> {
            Ok(match opcode {
                $( Opcode::$name => Instr::$name { $( $field: operands.take::<$ty>(stringify!($ty))? ),* }, )*
            })
        }
    };
}

for_each_opcode!(define_assembler);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_distances() {
        let code =
            assemble("L1: add-int r0 r0 -1\n loop-less r1 r0 L1\n 3 jump L2 ; no more\nL2:\n return-all");
        let expected = [
            Instr::AddInt { dst: Dst(0), left: Reg(0), value: Int8(-1) },
            Instr::LoopLess { left: Reg(1), right: Reg(0), to: Back(-3) },
            Instr::JumpAlways { to: Jump24(0) },
            Instr::ReturnAll {},
        ];
        let expected = expected.iter().map(Instr::encode);
        let expected: Vec<u32> = expected.flat_map(|(word, aux)| std::iter::once(word).chain(aux)).collect();
        assert_eq!(code, Ok(expected));
    }

    #[test]
    fn what_is_not_understood_is_named() {
        let check = |text, expected| assert_eq!(assemble(text).unwrap_err().to_string(), expected);
        check("\nfly r0", "line 2: no opcode is called `fly`");
        check("move r0", "line 1: expected more operands");
        check("move r0 r1 r2", "line 1: expected no more operands, found `r2`");
        check("jump nowhere", "line 1: expected an operand, found `nowhere`");
        check("move r0 r300", "line 1: `r300` does not fit its operand");
    }
}
