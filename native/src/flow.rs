//! The blocks of a function's bytecode: which instructions machine code can reach, and where jumps lead.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Role;

/// An instruction that machine code can reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlowStep {
    /// The instruction.
    pub(crate) instr: Instr,
    /// Where it jumps to, if it jumps.
    pub(crate) target: Option<usize>,
    /// Word behind it.
    pub(crate) next: usize,
    /// Whether a jump leads to it.
    pub(crate) is_target: bool,
}

/// The flow of a function.
#[derive(Debug)]
pub(crate) struct NativeFlow {
    /// The reachable instruction at each word.
    pub(crate) steps: Vec<Option<FlowStep>>,
    /// Words of the loop instructions, in their order: machine code may be entered there.
    pub(crate) loops: Vec<usize>,
}

impl NativeFlow {
    /// Follows the instructions of verified code; `None` for code that ends in the midst of one.
    pub(crate) fn of(words: &[u32]) -> Option<NativeFlow> {
        let loops = loop_words(words)?;
        let mut steps: Vec<Option<FlowStep>> = vec![None; words.len()];
        let mut open = vec![0];
        open.extend(&loops);
        let mut edges = Vec::new();
        while let Some(at) = open.pop() {
            if steps.get(at)?.is_some() {
                continue;
            }
            let instr = Instr::decode(words, at)?;
            let next = at + instr.opcode().words();
            let target = target_of(&instr, next);
            steps[at] = Some(FlowStep { instr, target, next, is_target: false });
            if let Some(target) = target {
                open.push(target);
                edges.push((target, true));
            }
            if instr.opcode().falls_through() {
                open.push(next);
                edges.push((next, false));
            }
        }
        edges.push((0, true));
        edges.extend(loops.iter().map(|&at| (at, true)));
        for (to, is_jump) in edges {
            let step = steps.get_mut(to)?.as_mut()?;
            step.is_target |= is_jump;
        }
        Some(NativeFlow { steps, loops })
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
