//! Assembly: from a finished graph to words and line entries. Chooses jump instructions and fills in
//! distances.

use esl_bytecode::module::{LineEntry, MAX_CODE};
use esl_bytecode::opcode::{Instr, Substitute};
use esl_bytecode::operand::*;
use esl_bytecode::span::Span;

use super::graph::{Cond, Graph, SegmentExit, SegmentLabel};
use super::lines::SourceLines;
use super::scopes::{self, RegisterRange, ScopedInstr, VariableScope, VariableScopes};
use crate::core::VarId;

/// The code of a function is longer than [`MAX_CODE`].
#[derive(Debug)]
pub(crate) struct TooLong;

/// An instruction in its final order, with the segment to which it jumps.
struct Placed {
    instr: Instr,
    target: Option<SegmentLabel>,
    span: Span,
    scope: VariableScope,
}

/// The finished code of a function.
#[derive(Debug, Default)]
pub(crate) struct AssembledCode {
    pub(crate) words: Vec<u32>,
    pub(crate) lines: Vec<LineEntry>,
    /// Where variables are.
    pub(crate) variables: Vec<RegisterRange>,
}

/// Returns the code of `graph`. `have_one_name` tells whether two variables have the same name.
///
/// # Errors
/// [`TooLong`] if there are too many words.
pub(crate) fn assemble(
    graph: &Graph,
    lines: &SourceLines,
    have_one_name: impl Fn(VarId, VarId) -> bool,
) -> Result<AssembledCode, TooLong> {
    let positions = graph.positions();
    let mut placed: Vec<Placed> = Vec::new();
    // The index into `placed` at which each segment begins, by position.
    let mut starts = Vec::with_capacity(graph.order.len());
    for (position, label) in graph.order.iter().enumerate() {
        starts.push(placed.len());
        let segment = &graph.segments[label.index()];
        placed.extend(segment.ops.iter().map(|op| Placed {
            instr: op.instr,
            target: op.landing,
            span: op.span,
            scope: op.scope,
        }));
        let (span, scope) = (segment.span, segment.scope);
        let mut put = |instr, target| placed.push(Placed { instr, target: Some(target), span, scope });
        let next = graph.order.get(position + 1).copied();
        let is_back = |label: SegmentLabel| positions[label.index()] <= position;
        let go = |label| {
            if is_back(label) { Instr::Loop { to: Back24(0) } } else { Instr::JumpAlways { to: Jump24(0) } }
        };
        match segment.exit {
            SegmentExit::End => {}
            SegmentExit::Fall(to) => debug_assert_eq!(Some(to), next, "a cleanup follows its protected part"),
            SegmentExit::Jump(to) => {
                if Some(to) != next {
                    put(go(to), to);
                }
            }
            SegmentExit::Branch { cond, holds, fails } => {
                // The conditional jump goes to the edge that is not next, or that has a jump of its own.
                let prefers_fails = Some(holds) == next
                    || (Some(fails) != next && jump(cond, true, is_back(holds)).is_none())
                    || (Some(fails) != next && is_back(fails) && !is_back(holds) && cond.loops(false));
                let (sense, taken, other) =
                    if prefers_fails { (false, fails, holds) } else { (true, holds, fails) };
                if let Some(instr) = jump(cond, sense, is_back(taken)) {
                    put(instr, taken);
                    if Some(other) != next {
                        put(go(other), other);
                    }
                } else if let (false, Some(instr)) = (is_back(other), jump(cond, !sense, false)) {
                    put(instr, other);
                    put(go(taken), taken);
                } else {
                    // Both edges go back, or there is no jump of this sense: jump over an unconditional jump.
                    let instr = jump(cond, !sense, false).or_else(|| jump(cond, sense, false));
                    let (over, first, second) = match jump(cond, !sense, false) {
                        Some(_) => (instr, taken, other),
                        None => (instr, other, taken),
                    };
                    if let Some(mut instr) = over {
                        instr.retarget(1);
                        placed.push(Placed { instr, target: None, span, scope });
                    }
                    placed.push(Placed { instr: go(first), target: Some(first), span, scope });
                    if Some(second) != next {
                        placed.push(Placed { instr: go(second), target: Some(second), span, scope });
                    }
                }
            }
        }
    }
    encode(&placed, &starts, &positions, lines, &graph.scopes, have_one_name)
}

fn encode(
    placed: &[Placed],
    starts: &[usize],
    positions: &[usize],
    lines: &SourceLines,
    scopes: &VariableScopes,
    have_one_name: impl Fn(VarId, VarId) -> bool,
) -> Result<AssembledCode, TooLong> {
    let mut offsets = Vec::with_capacity(placed.len() + 1);
    let mut length = 0usize;
    for item in placed {
        offsets.push(length);
        length += item.instr.opcode().words();
    }
    offsets.push(length);
    if length > MAX_CODE {
        return Err(TooLong);
    }
    let mut code = Vec::with_capacity(length);
    let mut entries: Vec<LineEntry> = Vec::new();
    let mut scoped: Vec<ScopedInstr> = Vec::with_capacity(placed.len());
    // A task begins at the first instruction.
    let mut stops = vec![0];
    for (index, item) in placed.iter().enumerate() {
        let mut instr = item.instr;
        if let Some(target) = item.target {
            let start = offsets[starts[positions[target.index()]]];
            instr.retarget(start as i32 - offsets[index + 1] as i32);
            if instr.opcode().is_loop() {
                stops.push(starts[positions[target.index()]]);
            }
        }
        if shows_its_line(&instr) {
            note_line(&mut entries, offsets[index], item.span, lines);
        }
        let (word, aux) = instr.encode();
        code.push(word);
        code.extend(aux);
        scoped.push(ScopedInstr {
            words: (offsets[index] as u32, offsets[index + 1] as u32),
            scope: item.scope,
            is_stop: shows_its_line(&instr),
            window: instr.call().map(|call| Reg(call.window.0)),
        });
    }
    for index in stops {
        if let Some(instr) = scoped.get_mut(index) {
            instr.is_stop = true;
        }
    }
    let variables = scopes::ranges(scopes, scoped.into_iter(), have_one_name);
    Ok(AssembledCode { words: code, lines: entries, variables })
}

/// Whether a backtrace may point at the instruction, since it can fail, call, or end the task's slice.
fn shows_its_line(instr: &Instr) -> bool {
    instr.opcode().substitute() != Substitute::Silent || instr.opcode().is_loop()
}

fn note_line(entries: &mut Vec<LineEntry>, pc: usize, span: Span, lines: &SourceLines) {
    // Code that the compiler added has an empty span, and counts as part of the code before it.
    if span == Span::default() && !entries.is_empty() {
        return;
    }
    let Some((line, column)) = lines.line_and_column(span) else { return };
    let source = span.source.0;
    if entries.last().is_some_and(|last| (last.source, last.line, last.column) == (source, line, column)) {
        return;
    }
    entries.push(LineEntry { pc: pc as u32, source, line, column });
}

/// Returns the instruction that jumps, forward or back, if `cond` holds (`sense`) or fails; `None` if there
/// is none.
fn jump(cond: Cond, sense: bool, is_back: bool) -> Option<Instr> {
    if is_back {
        return loop_back(cond, sense);
    }
    let to = Jump(0);
    let near = Jump16(0);
    Some(match (cond, sense) {
        (Cond::Nil(test), true) => Instr::JumpIfNil { test, to: near },
        (Cond::Nil(test), false) => Instr::JumpIfNotNil { test, to: near },
        (Cond::Cons(test), true) => Instr::JumpIfCons { test, to: near },
        (Cond::Cons(test), false) => Instr::JumpIfNotCons { test, to: near },
        (Cond::Supplied(test), true) => Instr::JumpIfSupplied { test, to: near },
        (Cond::Eq(left, right), true) => Instr::JumpEq { left, right, to },
        (Cond::Eq(left, right), false) => Instr::JumpNotEq { left, right, to },
        (Cond::Eql(left, right), true) => Instr::JumpEql { left, right, to },
        (Cond::Eql(left, right), false) => Instr::JumpNotEql { left, right, to },
        (Cond::EqlConst(left, constant), true) => Instr::JumpEqlConst { left, constant, to },
        (Cond::EqlConst(left, constant), false) => Instr::JumpNotEqlConst { left, constant, to },
        (Cond::Type(test, code), true) => Instr::JumpIfType { test, code, to },
        (Cond::Type(test, code), false) => Instr::JumpIfNotType { test, code, to },
        (Cond::Instance(test, class), false) => Instr::JumpIfNotInstance { test, class, to },
        (Cond::NumEq(left, right), true) => Instr::JumpNumEq { left, right, to },
        (Cond::NumEq(left, right), false) => Instr::JumpNotNumEq { left, right, to },
        (Cond::Less(left, right), true) => Instr::JumpLess { left, right, to },
        (Cond::Less(left, right), false) => Instr::JumpNotLess { left, right, to },
        (Cond::LessEq(left, right), true) => Instr::JumpLessEq { left, right, to },
        (Cond::LessEq(left, right), false) => Instr::JumpNotLessEq { left, right, to },
        (Cond::NumEqInt(left, value), true) => Instr::JumpNumEqInt { left, value, to },
        (Cond::NumEqInt(left, value), false) => Instr::JumpNotNumEqInt { left, value, to },
        (Cond::LessInt(left, value), true) => Instr::JumpLessInt { left, value, to },
        (Cond::LessInt(left, value), false) => Instr::JumpNotLessInt { left, value, to },
        (Cond::GreaterInt(left, value), true) => Instr::JumpGreaterInt { left, value, to },
        (Cond::GreaterInt(left, value), false) => Instr::JumpNotGreaterInt { left, value, to },
        (Cond::Instance(..), true) | (Cond::Supplied(_), false) | (Cond::Count { .. }, _) => return None,
    })
}

fn loop_back(cond: Cond, sense: bool) -> Option<Instr> {
    Some(match (cond, sense) {
        (Cond::Nil(test), true) => Instr::LoopIfNil { test, to: Back16(0) },
        (Cond::Nil(test), false) => Instr::LoopIfNotNil { test, to: Back16(0) },
        (Cond::Cons(test), true) => Instr::LoopIfCons { test, to: Back16(0) },
        (Cond::Less(left, right), true) => Instr::LoopLess { left, right, to: Back(0) },
        (Cond::Less(left, right), false) => Instr::LoopNotLess { left, right, to: Back(0) },
        (Cond::Count { counter, limit, step }, true) => {
            Instr::LoopCount { counter, limit, step, to: Back(0) }
        }
        _ => return None,
    })
}
