//! The blocks of a function's bytecode: which instructions machine code can reach, and where jumps lead.
//!
//! The instructions of functions that are inlined stand behind those of the function itself, once for each
//! call. All have their places in one numbering of words, and their registers in one numbering of registers:
//! that of the frame of the function itself, which the frames above it continue.

use esl_bytecode::opcode::{Instr, Opcode};
use esl_bytecode::operand::{Count, Role, Want, Window};
use esl_heap::Value;

use crate::maker::{FunctionSource, InlinedSource, NativeSource};

/// Most words of a function that is inlined.
pub const MAX_INLINED: usize = 48;

/// Most words of all that are inlined in one function.
const MAX_INLINED_IN_ALL: usize = 200;

/// Most calls of inlined functions within each other.
pub const MAX_DEPTH: usize = 3;

/// Most registers: an operand names one of so many.
const MAX_REGISTERS: usize = 256;

/// Returns whether a function of these instructions is so small and so simple that its calls may be replaced
/// by its instructions.
pub fn may_be_inlined(words: &[u32]) -> bool {
    is_simple(words, |opcode| opcode != Opcode::CallSelf)
}

/// Returns whether instructions are few, and go on one after the other but for jumps forward, calls and
/// returns; with what `may_be_there` says of their opcodes.
fn is_simple(words: &[u32], may_be_there: impl Fn(Opcode) -> bool) -> bool {
    if words.len() > MAX_INLINED {
        return false;
    }
    let mut at = 0;
    while at < words.len() {
        let Some(instr) = Instr::decode(words, at) else { return false };
        let opcode = instr.opcode();
        let is_simple =
            !opcode.is_loop() && !matches!(opcode, Opcode::Apply | Opcode::TailApply | Opcode::Throw);
        if !is_simple || !may_be_there(opcode) {
            return false;
        }
        at += opcode.words();
    }
    true
}

/// Most instructions before the return of a short path.
const SHORT: usize = 4;

/// Returns whether a short path leads from the instruction at a word to a return: past tests of registers,
/// and what writes constants and registers to others than those of the arguments. Its work in machine code
/// can be repeated from the beginning of the function.
fn returns_soon(words: &[u32], at: usize, arguments: u8, most: usize) -> bool {
    let Some(instr) = Instr::decode(words, at).filter(|_| most > 0) else { return false };
    let dst = match instr {
        Instr::Return { .. } => return true,
        Instr::Move { dst, .. }
        | Instr::LoadInt { dst, .. }
        | Instr::LoadConst { dst, .. }
        | Instr::LoadTrue { dst } => Some(dst.0),
        Instr::LoadNil { first, .. } => Some(first.0),
        Instr::JumpAlways { .. }
        | Instr::JumpIfNil { .. }
        | Instr::JumpIfNotNil { .. }
        | Instr::JumpIfCons { .. }
        | Instr::JumpIfNotCons { .. }
        | Instr::JumpEq { .. }
        | Instr::JumpNotEq { .. }
        | Instr::JumpNumEq { .. }
        | Instr::JumpNotNumEq { .. }
        | Instr::JumpLess { .. }
        | Instr::JumpNotLess { .. }
        | Instr::JumpLessEq { .. }
        | Instr::JumpNotLessEq { .. }
        | Instr::JumpNumEqInt { .. }
        | Instr::JumpNotNumEqInt { .. }
        | Instr::JumpLessInt { .. }
        | Instr::JumpNotLessInt { .. }
        | Instr::JumpGreaterInt { .. }
        | Instr::JumpNotGreaterInt { .. } => None,
        _ => return false,
    };
    let next = at + instr.opcode().words();
    let successors =
        instr.opcode().falls_through().then_some(next).into_iter().chain(target_of(&instr, next));
    dst.is_none_or(|dst| dst >= arguments)
        && successors.into_iter().any(|to| returns_soon(words, to, arguments, most - 1))
}

/// How an instruction leads from one frame to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FrameChange {
    /// It stays in its frame, or leaves the machine code.
    None,
    /// It is a call of an inlined function: with the window, and the number of arguments.
    Enter { window: u8, count: u8 },
    /// It returns from an inlined function: the value goes to this register.
    Return { to: u8 },
    /// It is not among the short paths that are inlined of a function: in its place the whole function is
    /// called, with so many arguments. The value goes to this register.
    Call { to: u8, count: u8 },
}

/// An instruction that machine code can reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlowStep {
    /// The instruction, its registers numbered from the frame of the function itself on.
    pub(crate) instr: Instr,
    /// Where it jumps to, if it jumps.
    pub(crate) target: Option<usize>,
    /// Word behind it; behind the call, if it returns from an inlined function.
    pub(crate) next: usize,
    /// Whether control may go on behind it.
    pub(crate) falls_through: bool,
    /// Whether a jump leads to it.
    pub(crate) is_target: bool,
    /// Number of its frame.
    pub(crate) frame: usize,
    /// How it leads to another frame.
    pub(crate) change: FrameChange,
}

impl FlowStep {
    /// Returns the words to which control goes from it.
    pub(crate) fn successors(&self) -> impl Iterator<Item = usize> + use<> {
        self.falls_through.then_some(self.next).into_iter().chain(self.target)
    }
}

/// The instructions of the function itself, or those of one call of an inlined one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlowFrame<'a> {
    /// The translated function.
    pub(crate) source: &'a FunctionSource,
    /// The word that its first one is.
    pub(crate) first: usize,
    /// The register that its first one is.
    pub(crate) base: u8,
    /// The function that the symbol of the call must have, for one that was inlined by its name.
    pub(crate) guard: Option<Value>,
    /// Number of the optional parameters that get no argument.
    pub(crate) unsupplied: u8,
    /// How much of it is inlined.
    part: InlinedPart,
    /// Where an inlined function returns to.
    back: Option<Back>,
}

impl FlowFrame<'_> {
    /// Returns whether what is done in it may be done again, in a call of the whole function.
    pub(crate) fn is_begun_again(&self) -> bool {
        self.part == InlinedPart::ShortPaths
    }
}

/// The function inlined at a call.
struct InlinedCall<'a> {
    source: &'a FunctionSource,
    guard: Option<Value>,
    unsupplied: u8,
    part: InlinedPart,
}

/// How much of a function is inlined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InlinedPart {
    /// All of it.
    Whole,
    /// The paths on which it returns soon; the function is called where another one begins.
    ShortPaths,
}

/// Where an inlined function returns to.
#[derive(Clone, Copy, Debug)]
struct Back {
    /// Number of the caller's frame.
    frame: usize,
    /// The register that gets the value.
    to: u8,
    /// Number of arguments.
    count: u8,
    /// The word behind the call.
    next: usize,
}

/// The flow of a function.
#[derive(Debug)]
pub(crate) struct NativeFlow<'a> {
    /// The reachable instruction at each word.
    pub(crate) steps: Vec<Option<FlowStep>>,
    /// Words of the loop instructions, in their order: machine code may be entered there.
    pub(crate) loops: Vec<usize>,
    /// The function itself, and the calls of inlined ones.
    pub(crate) frames: Vec<FlowFrame<'a>>,
    /// Number of registers of all frames.
    pub(crate) registers: usize,
}

impl<'a> NativeFlow<'a> {
    /// Follows the instructions of verified code; `None` for code that ends in the midst of one.
    pub(crate) fn of(source: &'a NativeSource) -> Option<NativeFlow<'a>> {
        let function = &source.function;
        let loops = loop_words(&function.words)?;
        let mut open = vec![0];
        open.extend(&loops);
        let mut flow = NativeFlow {
            steps: vec![None; function.words.len()],
            loops,
            frames: vec![FlowFrame {
                source: function,
                first: 0,
                base: 0,
                guard: None,
                unsupplied: 0,
                part: InlinedPart::Whole,
                back: None,
            }],
            registers: function.registers,
        };
        let mut edges = Vec::new();
        while let Some(at) = open.pop() {
            if flow.steps.get(at)?.is_some() {
                continue;
            }
            let step = flow.step(at, &source.inlined)?;
            flow.steps[at] = Some(step);
            open.extend(step.successors());
            edges.extend(step.target.map(|to| (to, true)));
            edges.extend(step.falls_through.then_some((step.next, false)));
        }
        edges.push((0, true));
        edges.extend(flow.loops.iter().map(|&at| (at, true)));
        for (to, is_jump) in edges {
            let step = flow.steps.get_mut(to)?.as_mut()?;
            step.is_target |= is_jump;
        }
        Some(flow)
    }

    /// Returns the number of the frame in which a word is.
    pub(crate) fn frame_at(&self, at: usize) -> usize {
        self.frames.partition_point(|frame| frame.first <= at) - 1
    }

    /// Decodes the instruction at a word; a call that is inlined gets a frame.
    fn step(&mut self, at: usize, inlined: &'a [InlinedSource]) -> Option<FlowStep> {
        let number = self.frame_at(at);
        let frame = self.frames[number];
        let mut instr = Instr::decode(&frame.source.words, at - frame.first)?;
        let callee = self.callee(number, &instr, inlined);
        instr.move_registers(frame.base);
        let next = at + instr.opcode().words();
        let mut step = FlowStep {
            instr,
            target: target_of(&instr, next),
            next,
            falls_through: instr.opcode().falls_through(),
            is_target: false,
            frame: number,
            change: FrameChange::None,
        };
        if let Some(back) = frame.back
            && frame.part == InlinedPart::ShortPaths
            && !returns_soon(&frame.source.words, at - frame.first, back.count, SHORT)
        {
            (step.next, step.target, step.falls_through) = (back.next, Some(back.next), false);
            step.change = FrameChange::Call { to: back.to, count: back.count };
        } else if let (Some(callee), Some((window, count))) = (callee, call_of(&instr)) {
            let (first, base) = (self.steps.len(), window.0 + 2);
            let back = Some(Back { frame: number, to: window.0, count: count.0, next });
            let InlinedCall { source, guard, unsupplied, part } = callee;
            self.frames.push(FlowFrame { source, first, base, guard, unsupplied, part, back });
            self.steps.resize(first + source.words.len(), None);
            self.registers = self.registers.max(usize::from(base) + source.registers);
            step.target = Some(first);
            step.falls_through = false;
            step.change = FrameChange::Enter { window: window.0, count: count.0 };
        } else if let Some(back) = frame.back
            && !step.falls_through
            && step.target.is_none()
        {
            (step.next, step.target) = (back.next, Some(back.next));
            step.change = FrameChange::Return { to: back.to };
        }
        Some(step)
    }

    /// Returns what an instruction of a frame calls, if that is inlined there: a small function that it
    /// names, or the function itself: all of it once, and its short paths.
    fn callee(&self, frame: usize, instr: &Instr, inlined: &'a [InlinedSource]) -> Option<InlinedCall<'a>> {
        let (window, count) = call_of(instr)?;
        let caller = &self.frames[frame];
        let callee = match *instr {
            Instr::CallSelf { .. } => {
                let source = caller.source;
                // Where variables are bound, the calls take less of the time.
                let is_whole = frame == 0 && is_simple(&source.words, |opcode| opcode != Opcode::Bind);
                let part = if is_whole { InlinedPart::Whole } else { InlinedPart::ShortPaths };
                let is_inlined = is_whole || returns_soon(&source.words, 0, count.0, SHORT);
                is_inlined.then_some(InlinedCall { source, guard: None, unsupplied: 0, part })?
            }
            Instr::CallGlobal { symbol, .. } => {
                let symbol = *caller.source.constants.get(symbol.0 as usize)?;
                let callee = inlined.iter().find(|callee| callee.symbol == symbol)?;
                let optional = count.0.checked_sub(callee.required)?;
                let unsupplied = callee.optional.checked_sub(optional)?;
                if self.is_within(frame, &callee.function) {
                    return None;
                }
                InlinedCall {
                    source: &callee.function,
                    guard: Some(callee.callee),
                    unsupplied,
                    part: InlinedPart::Whole,
                }
            }
            _ => return None,
        };
        let base = usize::from(caller.base) + usize::from(window.0) + 2;
        let words = self.steps.len() - self.frames[0].source.words.len();
        let fits = self.around(frame).count() <= MAX_DEPTH
            && base + callee.source.registers <= MAX_REGISTERS
            && words + callee.source.words.len() <= MAX_INLINED_IN_ALL;
        fits.then_some(callee)
    }

    /// Returns a frame, and those in which it is inlined.
    fn around(&self, frame: usize) -> impl Iterator<Item = &FlowFrame<'a>> {
        let outer = |frame: &&FlowFrame<'a>| frame.back.map(|back| &self.frames[back.frame]);
        std::iter::successors(Some(&self.frames[frame]), outer)
    }

    /// Returns whether a frame is one of this function, or inlined in one.
    fn is_within(&self, frame: usize, function: &FunctionSource) -> bool {
        self.around(frame).any(|frame| frame.source.words_at == function.words_at)
    }
}

/// Returns window and number of arguments of a call that may be inlined.
fn call_of(instr: &Instr) -> Option<(Window, Count)> {
    match *instr {
        Instr::CallGlobal { window, count, want: Want::ONE, .. }
        | Instr::CallSelf { window, count, want: Want::ONE, .. } => Some((window, count)),
        _ => None,
    }
}

/// Returns the words at which loop instructions stand.
fn loop_words(words: &[u32]) -> Option<Vec<usize>> {
    let (mut loops, mut at) = (Vec::new(), 0);
    while at < words.len() {
        let instr = Instr::decode(words, at)?;
        if instr.opcode().is_loop() {
            loops.push(at);
        }
        at += instr.opcode().words();
    }
    Some(loops)
}

/// Returns where an instruction jumps to.
fn target_of(instr: &Instr, next: usize) -> Option<usize> {
    let mut target = None;
    instr.visit_operands(|role| {
        if let Role::Forward(distance) | Role::Backward(distance) = role {
            target = next.checked_add_signed(distance as isize);
        }
    });
    target
}
