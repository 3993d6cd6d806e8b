//! Improvement of a function's graph. Instructions saved in a hot loop matter most.
//!
//! - Threading: an edge to an empty segment goes to the destination of that segment.
//! - Rotation: a jump to the short test of a loop, at its head or at its end, becomes a copy of the test, so
//!   that each turn executes one conditional jump back. See [`super::loops`] for the shapes that profit.
//! - Counting: an addition to a counter right before its comparison with a limit becomes one instruction with
//!   it.
//! - Joining: registers side by side that become `NIL` one after the other become so in one instruction.
//! - Segments that control cannot reach are dropped.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::Reg;

use super::graph::{Cond, Graph, SegmentExit, SegmentLabel};

/// Instructions of a test that is copied to the jumps to it, at most.
const ROTATED_LENGTH: usize = 8;

/// Improves `graph`. Afterwards its order lists only the segments that control can reach.
pub(crate) fn improve(graph: &mut Graph) {
    thread(graph);
    drop_unreachable(graph);
    rotate(graph);
    thread(graph);
    drop_unreachable(graph);
    count(graph);
    join_nils(graph);
}

/// Lets edges skip empty segments.
fn thread(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let resolve = |label: SegmentLabel| resolve(graph, label);
        let is_back = |label: SegmentLabel| positions[label.index()] <= position;
        // A conditional edge may turn into one that goes back only if there is an instruction for it.
        let follow = |label: SegmentLabel, cond: Cond, sense: bool| {
            let end = resolve(label);
            if is_back(end) && !is_back(label) && !cond.loops(sense) { label } else { end }
        };
        let exit = match graph.segments[index].exit {
            SegmentExit::Jump(to) => SegmentExit::Jump(resolve(to)),
            SegmentExit::Branch { cond, holds, fails } => {
                let (holds, fails) = (follow(holds, cond, true), follow(fails, cond, false));
                if holds == fails && cannot_fail(cond) {
                    SegmentExit::Jump(holds)
                } else {
                    SegmentExit::Branch { cond, holds, fails }
                }
            }
            other => other,
        };
        graph.segments[index].exit = exit;
    }
}

/// Whether evaluating the condition has no effect and cannot fail.
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

/// Returns the segment that control reaches from `label` by way of empty segments.
fn resolve(graph: &Graph, label: SegmentLabel) -> SegmentLabel {
    let mut end = label;
    // An empty loop has no end. After this many steps the segments count as one.
    for _ in 0..64 {
        let segment = &graph.segments[end.index()];
        match segment.exit {
            SegmentExit::Jump(to) if segment.ops.is_empty() && to != end => end = to,
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
            SegmentExit::End => {}
            SegmentExit::Jump(to) | SegmentExit::Fall(to) => pending.push(to),
            SegmentExit::Branch { holds, fails, .. } => pending.extend([holds, fails]),
        }
    }
    graph.order.retain(|label| reached[label.index()]);
}

/// Copies the short tests of loops to the jumps to them.
fn rotate(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let SegmentExit::Jump(head) = graph.segments[index].exit else { continue };
        if head.index() == index {
            continue;
        }
        let test = &graph.segments[head.index()];
        let SegmentExit::Branch { cond, holds, fails } = test.exit else { continue };
        // The copy pays if a test can then jump back by itself: the copy, from the end of a loop to its body;
        // or the original, if it is at the end already, joined with the code before it.
        let from = position.max(positions[head.index()]);
        let is_back = |label: SegmentLabel| positions[label.index()] <= from;
        let pays = (is_back(holds) && cond.loops(true)) || (is_back(fails) && cond.loops(false));
        // Points change no loop's shape, so that a program has the same ticks with them.
        let length = test.ops.iter().filter(|op| op.instr != Instr::Point {}).count();
        if !pays || length > ROTATED_LENGTH || test.ops.iter().any(|op| op.landing.is_some()) {
            continue;
        }
        let (ops, exit, span, scope) = (test.ops.clone(), test.exit, test.span, test.scope);
        let segment = &mut graph.segments[index];
        segment.ops.extend(ops);
        segment.exit = exit;
        segment.span = span;
        segment.scope = scope;
    }
}

/// Joins instructions that load `NIL` into registers side by side.
fn join_nils(graph: &mut Graph) {
    for label in &graph.order {
        graph.segments[label.index()].ops.dedup_by(|op, before| {
            let (Instr::LoadNil { first: next, count: more }, Instr::LoadNil { first, count }) =
                (op.instr, &mut before.instr)
            else {
                return false;
            };
            match count.0.checked_add(more.0) {
                Some(sum) if first.0.checked_add(count.0) == Some(next.0) => {
                    count.0 = sum;
                    true
                }
                _ => false,
            }
        });
    }
}

/// Joins an addition to a counter with the jump back that compares it with a limit.
fn count(graph: &mut Graph) {
    let positions = graph.positions();
    for position in 0..graph.order.len() {
        let index = graph.order[position].index();
        let segment = &mut graph.segments[index];
        let SegmentExit::Branch { cond: Cond::Less(counter, limit), holds, fails } = segment.exit else {
            continue;
        };
        if positions[holds.index()] > position || counter == limit {
            continue;
        }
        let Some(last) = segment.ops.last() else { continue };
        let Instr::AddInt { dst, left, value: step } = last.instr else { continue };
        if left != counter || Reg(dst.0) != counter {
            continue;
        }
        segment.ops.pop();
        segment.exit = SegmentExit::Branch { cond: Cond::Count { counter, limit, step }, holds, fails };
    }
}
