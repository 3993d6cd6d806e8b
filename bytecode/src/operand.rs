//! Operands of instructions. An operand's type says how wide it is, what it may be and how it is printed.
//!
//! Operands are packed in the order of the opcode table: those of 8, 16 and 24 bits into the instruction word
//! after the opcode (low bits first), the one of 32 bits, if any, into the *aux* word that follows.

use std::fmt;

/// How an operand is packed, and what the verifier has to know of it.
pub trait Operand: Copy + fmt::Display {
    /// Width in bits: 8, 16 or 24 in the instruction word, 32 for the aux word.
    const WIDTH: u32;
    /// The operand as it stands in the code, in the low `WIDTH` bits.
    fn to_bits(self) -> u32;
    /// The operand with these bits; higher bits are ignored.
    fn from_bits(bits: u32) -> Self;
    /// Its role, for the verifier.
    fn role(self) -> Role;
}

/// What an operand does, as far as a check without knowledge of the opcode can go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A register that is read.
    Read(u8),
    /// A register that is written.
    Write(u8),
    /// A register from which on the instruction uses a range; the opcode's own rule says how long.
    Base(u8),
    /// A constant of any kind.
    Constant(u32),
    /// A constant that must be a symbol.
    SymbolConstant(u32),
    /// A constant that must name a function of the module.
    FunctionConstant(u32),
    /// A constant that must name a structure class.
    ClassConstant(u32),
    /// A constant that must be a vector.
    VectorConstant(u32),
    /// A jump, relative to the next instruction, that must not go back.
    Forward(i32),
    /// A jump, relative to the next instruction, that must go back: a turn of a loop.
    Backward(i32),
    /// A builtin's number.
    Builtin(u32),
    /// A type code.
    TypeCode(u8),
    /// How many values are wanted.
    Want(Want),
    /// A word that must be zero.
    Pad(u32),
    /// A plain number.
    Number(i32),
}

macro_rules! operand {
    ($(#[$doc:meta])* $name:ident($repr:ty), $width:literal, $role:expr, $show:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub $repr);

        impl Operand for $name {
            const WIDTH: u32 = $width;
            fn to_bits(self) -> u32 {
                // Sign bits above the width are cut off.
                (self.0 as u32) & (u32::MAX >> (32 - $width))
            }
            fn from_bits(bits: u32) -> Self {
                // Shifting up and down again extends the sign when the representation is signed.
                let shifted = bits << (32 - $width);
                let value = if <$repr>::MIN != 0 {
                    i64::from(shifted as i32 >> (32 - $width))
                } else {
                    i64::from(shifted >> (32 - $width))
                };
                $name(value as $repr)
            }
            fn role(self) -> Role {
                #[allow(clippy::redundant_closure_call, reason = "the table gives roles as closures")]
                ($role)(self.0)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, $show, self.0)
            }
        }
    };
}

operand!(/** A register that is read. */ Reg(u8), 8, Role::Read, "r{}");
operand!(/** A register that is written. */ Dst(u8), 8, Role::Write, "r{}");
operand!(/** First register of a range: a call window, the items of a list, values. */ Base(u8), 8, Role::Base, "r{}..");
operand!(/** A number of registers or arguments. */ Count(u8), 8, |n| Role::Number(i32::from(n)), "{}");
operand!(/** Index of a slot or a capture. */ Index(u8), 8, |n| Role::Number(i32::from(n)), "#{}");
operand!(/** A small integer. */ Int8(i8), 8, |n| Role::Number(i32::from(n)), "{}");
operand!(/** An integer of 16 bits. */ Int16(i16), 16, |n| Role::Number(i32::from(n)), "{}");
operand!(/** An integer of 32 bits. */ Int32(i32), 32, Role::Number, "{}");
operand!(/** A constant of the function. */ ConstIdx(u16), 16, |n| Role::Constant(u32::from(n)), "k{}");
operand!(/** A constant that is a symbol. */ SymbolIdx(u16), 16, |n| Role::SymbolConstant(u32::from(n)), "k{}");
operand!(/** A constant that is a symbol, in the aux word. */ WideSymbolIdx(u32), 32, Role::SymbolConstant, "k{}");
operand!(/** A constant that is a function of the module. */ FunctionIdx(u16), 16, |n| Role::FunctionConstant(u32::from(n)), "k{}");
operand!(/** A constant that is a structure class, in the aux word. */ WideClassIdx(u32), 32, Role::ClassConstant, "k{}");
operand!(/** A constant that is a structure class. */ ClassIdx(u16), 16, |n| Role::ClassConstant(u32::from(n)), "k{}");
operand!(/** A constant that is a vector. */ VectorIdx(u16), 16, |n| Role::VectorConstant(u32::from(n)), "k{}");
operand!(/** A jump forward. */ Jump16(i16), 16, |n| Role::Forward(i32::from(n)), "{:+}");
operand!(/** A jump forward. */ Jump24(i32), 24, Role::Forward, "{:+}");
operand!(/** A jump forward, in the aux word. */ Jump(i32), 32, Role::Forward, "{:+}");
operand!(/** A jump back. */ Back16(i16), 16, |n| Role::Backward(i32::from(n)), "{:+}");
operand!(/** A jump back. */ Back24(i32), 24, Role::Backward, "{:+}");
operand!(/** A jump back, in the aux word. */ Back(i32), 32, Role::Backward, "{:+}");
operand!(/** Number of a builtin, in the aux word. */ BuiltinIdx(u32), 32, Role::Builtin, "b{}");
operand!(/** An aux word that only keeps calls two words long. */ Pad(u32), 32, Role::Pad, "{}");
operand!(/** Number of a [`crate::opcode::TypeCode`]. */ TypeIdx(u8), 8, Role::TypeCode, "t{}");

/// How many values the receiver of a call, a block or a catch wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Want(pub u8);

impl Want {
    /// Exactly one value, in the first register of the window.
    pub const ONE: Want = Want(0);
    /// All values: they go to the task's value list, and the first one (or `NIL`) to the window.
    pub const ALL: Want = Want(255);
    /// The largest number of values that [`Want::exactly`] can ask for.
    pub const MAX: u8 = 250;

    /// Exactly `n` values, missing ones `NIL`, in consecutive registers of the window. Zero is as one.
    pub fn exactly(n: u8) -> Want {
        if n <= 1 { Want::ONE } else { Want(n) }
    }

    /// How many registers of the window receive a value.
    pub fn registers(self) -> u8 {
        match self {
            Want::ONE | Want::ALL => 1,
            Want(n) => n,
        }
    }
}

impl Operand for Want {
    const WIDTH: u32 = 8;
    fn to_bits(self) -> u32 {
        u32::from(self.0)
    }
    fn from_bits(bits: u32) -> Want {
        Want(bits as u8)
    }
    fn role(self) -> Role {
        Role::Want(self)
    }
}

impl fmt::Display for Want {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Want::ONE => f.write_str("want 1"),
            Want::ALL => f.write_str("want all"),
            Want(n) => write!(f, "want {n}"),
        }
    }
}

impl Reg {
    /// Returns the register `count` above this one, or the last one if there is none so far up.
    pub fn offset(self, count: u8) -> Reg {
        Reg(self.0.saturating_add(count))
    }
}

impl From<Reg> for Dst {
    fn from(reg: Reg) -> Dst {
        Dst(reg.0)
    }
}

impl From<Reg> for Base {
    fn from(reg: Reg) -> Base {
        Base(reg.0)
    }
}
