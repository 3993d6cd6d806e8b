//! Operands of instructions. An operand's type says how wide it is, what it may be and how it is printed.
//!
//! Operands are packed in the order of the opcode table: those of 8, 16 and 24 bits into the instruction word
//! after the opcode (low bits first), the one of 32 bits, if any, into the *aux* word that follows.

use std::fmt;

/// Packing of an operand, and its meaning for the verifier.
pub trait Operand: Copy + fmt::Display {
    /// Width in bits: 8, 16 or 24 in the instruction word, 32 for the aux word.
    const WIDTH: u32;
    /// Returns the operand as it stands in the code, in the low `WIDTH` bits.
    fn to_bits(self) -> u32;
    /// Returns the operand with these bits; higher bits are ignored.
    fn from_bits(bits: u32) -> Self;
    /// Role of the operand, for the verifier.
    fn role(self) -> Role;
    /// Makes a jump or a landing lead this many words from the next instruction on. Leaves other operands as
    /// they are.
    fn retarget(&mut self, distance: i32);
    /// Adds `by` to the number of a register. Leaves other operands as they are.
    fn move_register(&mut self, by: u8);
}

/// Meaning of an operand that is independent of its opcode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Register that is read.
    Read(u8),
    /// Register that is written.
    Write(u8),
    /// First of a range of registers that are read; the count that follows is its length.
    ReadRange(u8),
    /// First of a range of registers that are written; the count that follows is its length.
    WriteRange(u8),
    /// First register of a window; the opcode's own rule says how far it goes.
    Window(u8),
    /// Number of registers, arguments, entries or bindings.
    Count(u8),
    /// Constant of any kind.
    Constant(u32),
    /// Constant that must be a symbol.
    SymbolConstant(u32),
    /// Constant that must name a function of the module.
    FunctionConstant(u32),
    /// Constant that must name a structure class.
    ClassConstant(u32),
    /// Constant that must be a vector.
    VectorConstant(u32),
    /// Distance of a jump from the next instruction, not negative.
    Forward(i32),
    /// Distance of a jump from the next instruction, negative: an iteration of a loop.
    Backward(i32),
    /// Distance of the landing of the entry pushed from the next instruction, not negative.
    Landing(i32),
    /// Number of a builtin.
    Builtin(u32),
    /// Type code.
    TypeCode(u8),
    /// Number of values that are wanted.
    Want(Want),
    /// Word that must be zero.
    Pad(u32),
    /// Plain number.
    Number(i32),
}

macro_rules! operands {
    ($( $(#[$doc:meta])* $name:ident($repr:ty), $width:literal, $role:expr, $show:literal; )*) => {$(
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
            fn retarget(&mut self, distance: i32) {
                if let Role::Forward(_) | Role::Backward(_) | Role::Landing(_) = self.role() {
                    self.0 = distance as $repr;
                }
            }
            fn move_register(&mut self, by: u8) {
                if let Role::Read(register)
                | Role::Write(register)
                | Role::ReadRange(register)
                | Role::WriteRange(register)
                | Role::Window(register) = self.role()
                {
                    self.0 = register.wrapping_add(by) as $repr;
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, $show, self.0)
            }
        }
    )*};
}

operands! {
    /// A register that is read.
    Reg(u8), 8, Role::Read, "r{}";
    /// A register that is written.
    Dst(u8), 8, Role::Write, "r{}";
    /// First of a range of registers that are read. A `Count` follows.
    Items(u8), 8, Role::ReadRange, "r{}..";
    /// First of a range of registers that are written. A `Count` follows.
    Room(u8), 8, Role::WriteRange, "r{}..";
    /// First register of the window of a call or of a control entry.
    Window(u8), 8, Role::Window, "r{}..";
    /// A number of registers, arguments, entries or bindings.
    Count(u8), 8, Role::Count, "{}";
    /// Form that throws.
    ThrowKind(u8), 8, |n| Role::Number(i32::from(n)), "{}";
    /// Index of a slot or a capture.
    Index(u8), 8, |n| Role::Number(i32::from(n)), "#{}";
    /// Number of a place whose passages are counted.
    PassIdx(u32), 24, |n| Role::Number(n as i32), "#{}";
    /// A small integer.
    Int8(i8), 8, |n| Role::Number(i32::from(n)), "{}";
    /// An integer of 16 bits.
    Int16(i16), 16, |n| Role::Number(i32::from(n)), "{}";
    /// A constant of the function.
    ConstIdx(u16), 16, |n| Role::Constant(u32::from(n)), "k{}";
    /// A constant that is a symbol.
    SymbolIdx(u16), 16, |n| Role::SymbolConstant(u32::from(n)), "k{}";
    /// A constant that is a symbol, in the aux word.
    WideSymbolIdx(u32), 32, Role::SymbolConstant, "k{}";
    /// A constant that is a function of the module.
    FunctionIdx(u16), 16, |n| Role::FunctionConstant(u32::from(n)), "k{}";
    /// A constant that is a structure class, in the aux word.
    WideClassIdx(u32), 32, Role::ClassConstant, "k{}";
    /// A constant that is a structure class.
    ClassIdx(u16), 16, |n| Role::ClassConstant(u32::from(n)), "k{}";
    /// A constant that is a vector.
    VectorIdx(u16), 16, |n| Role::VectorConstant(u32::from(n)), "k{}";
    /// A jump forward.
    Jump16(i16), 16, |n| Role::Forward(i32::from(n)), "{:+}";
    /// A jump forward.
    Jump24(i32), 24, Role::Forward, "{:+}";
    /// A jump forward, in the aux word.
    Jump(i32), 32, Role::Forward, "{:+}";
    /// Where a control entry lands, in the aux word.
    Landing(i32), 32, Role::Landing, "{:+}";
    /// A jump back.
    Back16(i16), 16, |n| Role::Backward(i32::from(n)), "{:+}";
    /// A jump back.
    Back24(i32), 24, Role::Backward, "{:+}";
    /// A jump back, in the aux word.
    Back(i32), 32, Role::Backward, "{:+}";
    /// Number of a builtin, in the aux word.
    BuiltinIdx(u32), 32, Role::Builtin, "b{}";
    /// An aux word that only keeps calls two words long.
    Pad(u32), 32, Role::Pad, "{}";
    /// Number of a [`crate::opcode::TypeCode`].
    TypeIdx(u8), 8, Role::TypeCode, "t{}";
}

impl ThrowKind {
    /// A `throw`.
    pub const THROW: ThrowKind = ThrowKind(0);
    /// A `return-from` a block that has to be unwound to.
    pub const RETURN_FROM: ThrowKind = ThrowKind(1);
    /// A `go` to a tagbody that has to be unwound to.
    pub const GO: ThrowKind = ThrowKind(2);
}

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

    /// Returns how many registers of the window receive a value.
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
    fn retarget(&mut self, _distance: i32) {}
    fn move_register(&mut self, _by: u8) {}
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

impl From<Reg> for Items {
    fn from(reg: Reg) -> Items {
        Items(reg.0)
    }
}

impl From<Reg> for Room {
    fn from(reg: Reg) -> Room {
        Room(reg.0)
    }
}

impl From<Reg> for Window {
    fn from(reg: Reg) -> Window {
        Window(reg.0)
    }
}
