//! Improves a function's graph: what takes instructions in a hot loop is worth most.
//!
//! - Threading: an edge to an empty segment goes where that goes.
//! - Rotation: a jump to the short test of a loop becomes a copy of the test, be it at the head of the loop or at its
//!   end, so that each turn executes one conditional jump back. See [`super::loops`] for the shapes that profit.
//! - Counting: an addition to a counter right before its comparison with a limit becomes one instruction with it.
//! - Segments that control cannot get to are dropped.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Reg;

use super::graph::{Cond, Exit, Graph, Label};

/// A test of at most so many instructions is copied to the jumps back to it.
const ROTATED_LENGTH: usize = 8;

/// Improves `graph`. Afterwards its order lists just the segments that control can get to.
pub(crate) fn improve(graph: &mut Graph) {
    thread(graph);
    drop_unreachable(graph);
    rotate(graph);
    thread(graph);
    drop_unreachable(graph);
    count(graph);
}

/// Lets edges skip empty segments.
fn thread(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let resolve = |label: Label| resolve(graph, label);
        let is_back = |label: Label| positions[label.index()] <= position;
        // Where a conditional edge would turn back it must have an instruction that can.
        let follow = |label: Label, cond: Cond, sense: bool| {
            let end = resolve(label);
            if is_back(end) && !is_back(label) && !cond.loops(sense) { label } else { end }
        };
        let exit = match graph.segments[index].exit {
            Exit::Jump(to) => Exit::Jump(resolve(to)),
            Exit::Branch { cond, holds, fails } => {
                let (holds, fails) = (follow(holds, cond, true), follow(fails, cond, false));
                if holds == fails && cannot_fail(cond) {
                    Exit::Jump(holds)
                } else {
                    Exit::Branch { cond, holds, fails }
                }
            }
            other => other,
        };
        graph.segments[index].exit = exit;
    }
}

/// Whether leaving the question out changes nothing.
fn cannot_fail(cond: Cond) -> bool {
    matches!(
        cond,
        Cond::Nil(_)
            | Cond::Cons(_)
            | Cond::Eq(..)
            | Cond::Eql(..)
            | Cond::EqlConst(..)
            | Cond::Type(..)
            | Cond::Instance(..)
    )
}

/// Where control ends up that goes to `label`.
fn resolve(graph: &Graph, label: Label) -> Label {
    let mut end = label;
    // An empty loop has no end: after so many steps it is one.
    for _ in 0..64 {
        let segment = &graph.segments[end.index()];
        match segment.exit {
            Exit::Jump(to) if segment.ops.is_empty() && to != end => end = to,
            _ => return end,
        }
    }
    label
}

fn drop_unreachable(graph: &mut Graph) {
    let mut reached = vec![false; graph.segments.len()];
    let mut pending = vec![graph.order[0]];
    while let Some(label) = pending.pop() {
        if std::mem::replace(&mut reached[label.index()], true) {
            continue;
        }
        let segment = &graph.segments[label.index()];
        pending.extend(segment.ops.iter().filter_map(|op| op.landing));
        match segment.exit {
            Exit::End => {}
            Exit::Jump(to) | Exit::Fall(to) => pending.push(to),
            Exit::Branch { holds, fails, .. } => pending.extend([holds, fails]),
        }
    }
    graph.order.retain(|label| reached[label.index()]);
}

/// Copies the short tests of loops to the jumps to them.
fn rotate(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let Exit::Jump(head) = graph.segments[index].exit else { continue };
        if head.index() == index {
            continue;
        }
        let test = &graph.segments[head.index()];
        let Exit::Branch { cond, holds, fails } = test.exit else { continue };
        // The copy pays if a test can then jump back by itself: this one, from the end of a loop to its body, or, when
        // the test stands at the end already, that one, now joined with what comes before it.
        let from = position.max(positions[head.index()]);
        let is_back = |label: Label| positions[label.index()] <= from;
        let pays = (is_back(holds) && cond.loops(true)) || (is_back(fails) && cond.loops(false));
        if !pays || test.ops.len() > ROTATED_LENGTH || test.ops.iter().any(|op| op.landing.is_some()) {
            continue;
        }
        let (ops, exit, span) = (test.ops.clone(), test.exit, test.span);
        let segment = &mut graph.segments[index];
        segment.ops.extend(ops);
        segment.exit = exit;
        segment.span = span;
    }
}

/// Joins an addition to a counter with the jump back that compares it with a limit.
fn count(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let segment = &mut graph.segments[index];
        let Exit::Branch { cond: Cond::Less(counter, limit), holds, fails } = segment.exit else { continue };
        if positions[holds.index()] > position || counter == limit {
            continue;
        }
        let Some(last) = segment.ops.last() else { continue };
        let Instr::AddInt { dst, left, value: step } = last.instr else { continue };
        if left != counter || Reg(dst.0) != counter {
            continue;
        }
        segment.ops.pop();
        segment.exit = Exit::Branch { cond: Cond::Count { counter, limit, step }, holds, fails };
    }
}
