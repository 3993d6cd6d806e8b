//! The kind and the parameters of a Code, which the interpreter needs beside its words.
//!
//! A [`Shape`] is packed into `Code::spare[0]`; `Code::spare[1]` is the number of captures. The loader lays a
//! Code out so:
//!
//! ```text
//! constants   | the function's constants ... | names of its keys ... |
//! words       | instructions ...             | one word for each capture: where it comes from |
//! ```
//!
//! A constant operand of `make-closure` is, for a function without captures, its Function; for one with
//! captures, its Code, ready to run. `Code::arity` is the exact number of arguments of bytecode that takes
//! just required ones, and [`Code::ANY_ARITY`] for everything else, so that only the slow path of a call
//! looks at the shape.
//!
//! [`Code::ANY_ARITY`]: crate::heap::layout::Code::ANY_ARITY

use esl_bytecode::module::{Capture, CaptureSource, Parameters};

/// The kind of a Code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum CodeKind {
    /// Instructions, ready to run.
    Bytecode = 0,
    /// A builtin: its number is in the shape.
    Native = 1,
    /// The placeholder in a symbol without a function.
    Undefined = 2,
    /// A function of a loaded module that has not been called yet: `owner` says which.
    Lazy = 3,
}

/// Kind and parameters of a Code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// The kind.
    pub kind: CodeKind,
    /// Number of required parameters.
    pub required: u8,
    /// Number of optional parameters.
    pub optional: u8,
    /// Whether a register receives the list of the remaining arguments.
    pub rest: bool,
    /// Whether there are key parameters, maybe none.
    pub takes_keys: bool,
    /// Whether keys other than the named ones are allowed.
    pub allow_other_keys: bool,
    /// For bytecode the number of key parameters, for a builtin its number.
    pub number: u16,
}

impl Shape {
    /// The shape of bytecode that takes these parameters.
    pub(crate) fn bytecode(parameters: &Parameters) -> Shape {
        Shape {
            kind: CodeKind::Bytecode,
            required: parameters.required,
            optional: parameters.optional,
            rest: parameters.rest,
            takes_keys: parameters.keys.is_some(),
            allow_other_keys: parameters.allow_other_keys,
            number: parameters.keys.as_ref().map_or(0, |keys| keys.len() as u16),
        }
    }

    /// The shape of a Code of another kind; `number` is that of a builtin, else 0.
    pub(crate) fn other(kind: CodeKind, number: u16) -> Shape {
        Shape {
            kind,
            required: 0,
            optional: 0,
            rest: false,
            takes_keys: false,
            allow_other_keys: false,
            number,
        }
    }

    /// As it stands in the Code.
    pub(crate) fn pack(self) -> u64 {
        let flags =
            u64::from(self.rest) | u64::from(self.takes_keys) << 1 | u64::from(self.allow_other_keys) << 2;
        self.kind as u64
            | u64::from(self.required) << 8
            | u64::from(self.optional) << 16
            | flags << 24
            | u64::from(self.number) << 32
    }

    /// Returns whether packed bits are those of instructions that are ready to run.
    #[inline(always)]
    pub(crate) fn is_bytecode(bits: u64) -> bool {
        bits as u8 == CodeKind::Bytecode as u8
    }

    /// Reads what [`Shape::pack`] made.
    pub(crate) fn unpack(bits: u64) -> Shape {
        let kind = match bits as u8 {
            1 => CodeKind::Native,
            2 => CodeKind::Undefined,
            3 => CodeKind::Lazy,
            _ => CodeKind::Bytecode,
        };
        Shape {
            kind,
            required: (bits >> 8) as u8,
            optional: (bits >> 16) as u8,
            rest: bits >> 24 & 1 != 0,
            takes_keys: bits >> 25 & 1 != 0,
            allow_other_keys: bits >> 26 & 1 != 0,
            number: (bits >> 32) as u16,
        }
    }
}

/// A capture as a word behind the instructions.
pub(crate) fn capture_word(capture: Capture) -> u32 {
    match capture.source {
        CaptureSource::Register(index) => u32::from(index),
        CaptureSource::Capture(index) => 1 << 8 | u32::from(index),
        CaptureSource::Later => 2 << 8,
    }
}

/// Reads what [`capture_word`] made.
pub(crate) fn capture_source(word: u32) -> CaptureSource {
    match word >> 8 {
        0 => CaptureSource::Register(word as u8),
        1 => CaptureSource::Capture(word as u8),
        _ => CaptureSource::Later,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::module::PoolIdx;

    #[test]
    fn shapes_survive_packing() {
        let keys = Some(vec![PoolIdx(1), PoolIdx(2)]);
        let parameters = Parameters { required: 200, optional: 3, rest: true, keys, allow_other_keys: true };
        let shape = Shape::bytecode(&parameters);
        assert_eq!(Shape::unpack(shape.pack()), shape);
        let native = Shape::other(CodeKind::Native, 700);
        assert_eq!(Shape::unpack(native.pack()), native);
    }

    #[test]
    fn captures_survive_packing() {
        for source in [CaptureSource::Register(249), CaptureSource::Capture(3), CaptureSource::Later] {
            assert_eq!(capture_source(capture_word(Capture::value(source))), source);
        }
    }
}
