//! Arithmetic and comparisons: on fixnums, and on doubles that are words.

use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{Block, InstBuilder, Value as Ssa, types};
use esl_heap::Value;

use crate::doubles::TAG_DOUBLE;
use crate::flow::FlowStep;
use crate::kinds::Known;
use crate::translate::Translator;

/// Operation of arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
}

/// Order of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberOrder {
    Equal,
    Less,
    LessEqual,
    Greater,
}

impl NumberOrder {
    fn of_fixnums(self) -> IntCC {
        match self {
            NumberOrder::Equal => IntCC::Equal,
            NumberOrder::Less => IntCC::SignedLessThan,
            NumberOrder::LessEqual => IntCC::SignedLessThanOrEqual,
            NumberOrder::Greater => IntCC::SignedGreaterThan,
        }
    }

    fn of_doubles(self) -> FloatCC {
        match self {
            NumberOrder::Equal => FloatCC::Equal,
            NumberOrder::Less => FloatCC::LessThan,
            NumberOrder::LessEqual => FloatCC::LessThanOrEqual,
            NumberOrder::Greater => FloatCC::GreaterThan,
        }
    }
}

impl Translator<'_, '_> {
    pub(crate) fn registers(&mut self, operation: Arithmetic, dst: u8, left: u8, right: u8) {
        let is_double = |register: u8| self.known[usize::from(register)] == Known::Double;
        if is_double(left) || is_double(right) {
            return self.with_double(operation, dst, left, right);
        }
        self.close_batch();
        let (x, y) = (self.operand(left), self.operand(right));
        if self.guess == Some(dst) {
            let wrong = self.wrong();
            let [p, q] = [x, y].map(|(word, known)| match known {
                Known::Fixnum => self.convert(word),
                _ => self.double_of(word, wrong),
            });
            return self.on_doubles_later(operation, p, q, dst);
        }
        if operation != Arithmetic::Divide && x.1 == Known::Fixnum && y.1 == Known::Fixnum {
            // An overflow leaves the machine code, so the result is a fixnum.
            let exit = self.exit();
            let result = self.on_fixnums(operation, x.0, y.0, exit);
            return self.set(dst, result, Known::Fixnum);
        }
        let (slow, zeros, done) = (self.cold_block(), self.cold_block(), self.block_with_value());
        if operation != Arithmetic::Divide
            && let Some(test) = self.not_fixnums(x, y)
        {
            let (fixnums, others) = (self.block(), self.block());
            self.branch(test, others, fixnums);
            self.go_to(fixnums);
            let result = self.on_fixnums(operation, x.0, y.0, slow);
            self.jump_with(done.0, result);
            self.go_to(others);
        }
        if x.1 != Known::Fixnum && y.1 != Known::Fixnum {
            let (doubles, mixed) = (self.block(), self.block());
            let both = self.b.ins().band(x.0, y.0);
            let difference = self.differs_from_tag(both, TAG_DOUBLE, TAG_DOUBLE);
            self.branch(difference, mixed, doubles);
            self.go_to(doubles);
            let (p, q) = (self.decode(x.0), self.decode(y.0));
            self.on_doubles(operation, p, q, zeros, done.0);
            self.go_to(mixed);
        }
        if x.1 == Known::Fixnum && y.1 == Known::Fixnum {
            self.jump(slow);
        } else {
            self.mixed(operation, x, y, zeros, done.0);
            self.go_to(zeros);
            self.on_zeros(operation, x, y, slow, done.0);
        }
        self.finish_value(slow, done, dst, Known::Nothing);
    }

    /// Arithmetic where an operand or the result may be a zero, which has a word of its own; others go to
    /// `otherwise`.
    fn on_zeros(
        &mut self,
        operation: Arithmetic,
        x: (Ssa, Known),
        y: (Ssa, Known),
        otherwise: Block,
        done: Block,
    ) {
        let [p, q] = [x, y].map(|(word, known)| match known {
            Known::Fixnum => self.convert(word),
            _ => self.double_of(word, otherwise),
        });
        let result = self.operate(operation, p, q);
        let bits = self.bits_of(result);
        let word = self.rotated(bits);
        let (is_word, no_word) = (self.is_word(word), self.cold_block());
        self.b.ins().brif(is_word, done, &[word.into()], no_word, &[]);
        self.go_to(no_word);
        let zero = self.b.ins().f64const(0.0);
        let is_zero = self.b.ins().fcmp(FloatCC::Equal, result, zero);
        self.require(is_zero, otherwise);
        let zero = self.zero_of(bits);
        self.jump_with(done, zero);
    }

    /// Arithmetic of which one operand is known to be a double.
    fn with_double(&mut self, operation: Arithmetic, dst: u8, left: u8, right: u8) {
        let p = self.double_operand(left);
        let q = self.double_operand(right);
        self.on_doubles_later(operation, p, q, dst);
    }

    /// Computes with two doubles; the result is tested with the batch.
    fn on_doubles_later(&mut self, operation: Arithmetic, p: Ssa, q: Ssa, dst: u8) {
        let result = match self.results.get(&(operation, p, q)) {
            Some(&result) => result,
            None => {
                let result = self.operate(operation, p, q);
                self.test_later(result, true);
                self.results.insert((operation, p, q), result);
                result
            }
        };
        self.set_double(dst, result);
    }

    /// Returns the number in a register as a double, for arithmetic with a double; the machine code is left
    /// if it is neither a fixnum nor a double without a box.
    fn double_operand(&mut self, register: u8) -> Ssa {
        let known = self.known[usize::from(register)];
        if known == Known::Double {
            return self.get_double(register);
        }
        let word = self.get(register);
        if known == Known::Fixnum {
            return self.convert(word);
        }
        self.close_batch();
        let (done, wrong) = (self.block_with(types::F64), self.wrong());
        let (others, fixnums, zeros) = (self.block(), self.block(), self.cold_block());
        let tag = self.decode_or(word, done.0, others);
        self.branch(tag, zeros, fixnums);
        self.go_to(fixnums);
        let double = self.convert(word);
        self.jump_with(done.0, double);
        self.go_to(zeros);
        self.zero_or(word, done.0, wrong);
        self.go_to(done.0);
        done.1
    }

    pub(crate) fn add_int(&mut self, dst: u8, left: u8, addend: i32) {
        if self.known[usize::from(left)] == Known::Double {
            // The interpreter leaves zeros to the numeric tower here, whose work may end a slice.
            let (p, q) = (self.get_double(left), self.b.ins().f64const(f64::from(addend)));
            self.test_later(p, false);
            let sum = self.operate(Arithmetic::Add, p, q);
            self.test_later(sum, false);
            return self.set_double(dst, sum);
        }
        self.close_batch();
        let x = self.operand(left);
        if x.1 == Known::Fixnum {
            let exit = self.exit();
            let (sum, overflow) = self.add_constant(x.0, addend);
            self.refuse(overflow, exit);
            return self.set(dst, sum, Known::Fixnum);
        }
        let (slow, done) = (self.cold_block(), self.block_with_value());
        let (fixnums, others) = (self.block(), self.block());
        let tag = self.b.ins().band_imm_s(x.0, 3);
        self.branch(tag, others, fixnums);
        self.go_to(fixnums);
        let (sum, overflow) = self.add_constant(x.0, addend);
        self.refuse(overflow, slow);
        self.jump_with(done.0, sum);
        self.go_to(others);
        self.require_double(x.0, slow);
        let (p, q) = (self.decode(x.0), self.b.ins().f64const(f64::from(addend)));
        self.on_doubles(Arithmetic::Add, p, q, slow, done.0);
        self.finish_value(slow, done, dst, Known::Nothing);
    }

    /// Returns the result of two fixnums; what overflows goes to `otherwise`.
    pub(crate) fn on_fixnums(&mut self, operation: Arithmetic, x: Ssa, y: Ssa, otherwise: Block) -> Ssa {
        let (result, overflow) = match operation {
            Arithmetic::Add => self.b.ins().sadd_overflow(x, y),
            Arithmetic::Subtract => self.b.ins().ssub_overflow(x, y),
            Arithmetic::Multiply | Arithmetic::Divide => {
                let x = self.b.ins().sshr_imm_s(x, 2);
                self.b.ins().smul_overflow(x, y)
            }
        };
        self.refuse(overflow, otherwise);
        result
    }

    /// Goes on only if the word is that of a double, or the words whose common bits these are.
    fn require_double(&mut self, word: Ssa, otherwise: Block) {
        let difference = self.differs_from_tag(word, TAG_DOUBLE, TAG_DOUBLE);
        self.refuse(difference, otherwise);
    }

    fn operate(&mut self, operation: Arithmetic, p: Ssa, q: Ssa) -> Ssa {
        match operation {
            Arithmetic::Add => self.b.ins().fadd(p, q),
            Arithmetic::Subtract => self.b.ins().fsub(p, q),
            Arithmetic::Multiply => self.b.ins().fmul(p, q),
            Arithmetic::Divide => self.b.ins().fdiv(p, q),
        }
    }

    /// Jumps to `done` with the word of the result of two doubles; a result that is not a word goes to
    /// `otherwise`.
    fn on_doubles(&mut self, operation: Arithmetic, p: Ssa, q: Ssa, otherwise: Block, done: Block) {
        let result = self.operate(operation, p, q);
        let bits = self.bits_of(result);
        let bias = self.word(Value::DOUBLE_BIAS);
        let bits = self.b.ins().iadd(bits, bias);
        let word = self.b.ins().rotl_imm_s(bits, 3);
        self.require_double(word, otherwise);
        self.jump_with(done, word);
    }

    /// Arithmetic on a fixnum and a double, in either order; others go to `otherwise`. One of both may be a
    /// double.
    fn mixed(
        &mut self,
        operation: Arithmetic,
        x: (Ssa, Known),
        y: (Ssa, Known),
        otherwise: Block,
        done: Block,
    ) {
        let (left, right) = (self.block(), self.block());
        let tag = self.b.ins().band_imm_s(x.0, 3);
        self.branch(tag, right, left);
        self.go_to(left);
        self.require_double(y.0, otherwise);
        let (p, q) = (self.convert(x.0), self.decode(y.0));
        self.on_doubles(operation, p, q, otherwise, done);
        self.go_to(right);
        self.require_double(x.0, otherwise);
        let tag = self.b.ins().band_imm_s(y.0, 3);
        self.refuse(tag, otherwise);
        let (p, q) = (self.decode(x.0), self.convert(y.0));
        self.on_doubles(operation, p, q, otherwise, done);
    }

    /// Returns a fixnum as a double.
    fn convert(&mut self, word: Ssa) -> Ssa {
        let n = self.b.ins().sshr_imm_s(word, 2);
        self.b.ins().fcvt_from_sint(types::F64, n)
    }

    /// A comparison that gives `t` or `nil`.
    pub(crate) fn compare(&mut self, order: NumberOrder, dst: u8, left: u8, right: u8) {
        let (x, y) = (self.operand(left), self.operand(right));
        let (slow, done) = (self.cold_block(), self.block_with_value());
        if let Some(test) = self.order_with_double(order, left, right, slow) {
            let value = self.boolean(test);
            self.jump_with(done.0, value);
            return self.finish_value(slow, done, dst, Known::Nothing);
        }
        let (test, others) = self.order_of_fixnums(order, x, y);
        let value = self.boolean(test);
        self.jump_with(done.0, value);
        self.go_to(others);
        if let Some(test) = self.order_of_doubles(order, x, y, slow) {
            let value = self.boolean(test);
            self.jump_with(done.0, value);
        }
        self.finish_value(slow, done, dst, Known::Nothing);
    }

    /// Returns the test of two numbers of which one is known to be a double; a value that is not a double
    /// without a box goes to `slow`, and so does a fixnum, which is compared exactly.
    fn order_with_double(&mut self, order: NumberOrder, left: u8, right: u8, slow: Block) -> Option<Ssa> {
        let is_double = |register: u8| self.known[usize::from(register)] == Known::Double;
        if !is_double(left) && !is_double(right) {
            return None;
        }
        let p = self.exact_double(left, slow);
        let q = self.exact_double(right, slow);
        Some(self.b.ins().fcmp(order.of_doubles(), p, q))
    }

    /// Returns the double in a register, if it is one that needs no box and has no constant of its own, or is
    /// known to be one.
    fn exact_double(&mut self, register: u8, otherwise: Block) -> Ssa {
        if self.known[usize::from(register)] == Known::Double {
            return self.get_double(register);
        }
        let word = self.get(register);
        self.require_double(word, otherwise);
        self.decode(word)
    }

    /// Returns the test of two numbers if both are fixnums, and the block for others, which is not filled.
    fn order_of_fixnums(&mut self, order: NumberOrder, x: (Ssa, Known), y: (Ssa, Known)) -> (Ssa, Block) {
        let others = self.block();
        match self.not_fixnums(x, y) {
            Some(test) => self.refuse(test, others),
            None => self.b.set_cold_block(others),
        }
        (self.b.ins().icmp(order.of_fixnums(), x.0, y.0), others)
    }

    /// Returns the test of two numbers that are not both fixnums, if they may both be doubles; others go to
    /// `slow`.
    fn order_of_doubles(
        &mut self,
        order: NumberOrder,
        x: (Ssa, Known),
        y: (Ssa, Known),
        slow: Block,
    ) -> Option<Ssa> {
        if x.1 == Known::Fixnum || y.1 == Known::Fixnum {
            self.jump(slow);
            return None;
        }
        let both = self.b.ins().band(x.0, y.0);
        self.require_double(both, slow);
        let (p, q) = (self.decode(x.0), self.decode(y.0));
        Some(self.b.ins().fcmp(order.of_doubles(), p, q))
    }

    /// A jump that depends on the order of two registers; as a loop instruction it takes a tick.
    pub(crate) fn jump_order(&mut self, order: NumberOrder, left: u8, right: u8, step: &FlowStep) {
        let (x, y) = (self.operand(left), self.operand(right));
        let (target, next) = (self.target(step), self.block());
        let jumps_when = step.instr.opcode().jumps_when();
        let (holds, fails) = if jumps_when { (target, next) } else { (next, target) };
        // That both are fixnums, or both are doubles, is a guess where such are made: a call in a loop costs
        // the registers of the processor.
        let is_guess = self.kinds.tells_doubles() && x.1 != Known::Double && y.1 != Known::Double;
        let slow = if is_guess { self.wrong() } else { self.cold_block() };
        // Nothing takes a tick before a side exit.
        let is_loop = step.instr.opcode().is_loop();
        if is_loop && !is_guess {
            self.tick();
        }
        if let Some(test) = self.order_with_double(order, left, right, slow) {
            self.branch(test, holds, fails);
        } else {
            let (test, others) = self.order_of_fixnums(order, x, y);
            if is_loop && is_guess {
                self.tick();
            }
            self.branch(test, holds, fails);
            self.go_to(others);
            if let Some(test) = self.order_of_doubles(order, x, y, slow) {
                if is_loop && is_guess {
                    self.tick();
                }
                self.branch(test, holds, fails);
            }
        }
        if !is_guess {
            self.go_to(slow);
            self.step_test(target, next);
        }
        self.go_to(next);
    }

    /// A jump that depends on the order of a register and a small number.
    pub(crate) fn jump_order_int(&mut self, order: NumberOrder, left: u8, value: i16, step: &FlowStep) {
        let x = self.operand(left);
        let (target, next, slow) = (self.target(step), self.block(), self.cold_block());
        let (holds, fails) = if step.instr.opcode().jumps_when() { (target, next) } else { (next, target) };
        // Where the machine does not do the test, that of a double is worth its place.
        let others = if self.frame.is_begun_again() { self.cold_block() } else { slow };
        let test = if x.1 == Known::Double {
            let (p, q) = (self.get_double(left), self.b.ins().f64const(f64::from(value)));
            self.b.ins().fcmp(order.of_doubles(), p, q)
        } else {
            if x.1 != Known::Fixnum {
                let tag = self.b.ins().band_imm_s(x.0, 3);
                self.refuse(tag, others);
            }
            let word = Value::small(i32::from(value)).bits() as i64;
            self.b.ins().icmp_imm_s(order.of_fixnums(), x.0, word)
        };
        self.branch(test, holds, fails);
        if others != slow {
            self.go_to(others);
            self.require_double(x.0, slow);
            let (p, q) = (self.decode(x.0), self.b.ins().f64const(f64::from(value)));
            let test = self.b.ins().fcmp(order.of_doubles(), p, q);
            self.branch(test, holds, fails);
        }
        self.go_to(slow);
        self.step_test(target, next);
        self.go_to(next);
    }
}

/// Returns what is known of what is computed from two numbers, of two fixnums for the most part a fixnum.
pub(crate) fn of_both(x: Known, y: Known) -> Known {
    if (x, y) == (Known::Fixnum, Known::Fixnum) { Known::Fixnum } else { Known::Nothing }
}
