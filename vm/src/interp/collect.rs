//! Safepoints: preemption, and the collector's turns.
//!
//! Here is everything that the collector has to find: [`mark_roots`] names the fixed roots, [`scan`] the values of a
//! task. A task's stack is scanned once in a cycle: that of the running task when the cycle begins, every other one when
//! the marker gets to it or just before the task runs, whichever is first.

use super::{Leave, code_of};
use crate::control::End;
use crate::heap::{Heap, Phase, SLICE_VISITS, SliceOutcome};
use crate::raise::{Expected, Raised};
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::world::World;

/// Offset of the first word above the frame with the given base.
///
/// # Safety
/// `base` is the offset of a frame of `task`.
unsafe fn top_of(task: &Task, base: usize) -> usize {
    // SAFETY: below a frame's base is its link, which begins with its function.
    unsafe {
        let function = *task.stack.start().add(base - 2);
        // The saved pc of a failed instruction lies behind the registers, below the frame that handles it.
        base + (*code_of(function)).nregs as usize
    }
}

/// Words of a stack that count as one visit of the collector.
const WORDS_PER_VISIT: usize = 4;

/// Marks everything that a task holds; gives how many words that are.
///
/// # Safety
/// `task.base` is the offset of its running frame.
unsafe fn scan(heap: &mut Heap, task: &mut Task) -> usize {
    // SAFETY: by the contract.
    let top = unsafe { top_of(task, task.base) };
    task.stack.wipe(top);
    heap.mark_slice(task.stack.words(top));
    task.control.visit(&mut |value| heap.mark(value));
    heap.mark_slice(&task.values);
    if let TaskState::Ended(End::Failed(condition)) = task.state {
        heap.mark(condition);
    }
    task.scanned = heap.cycle_id();
    top + task.control.entries.len() + 2 * task.control.bindings.len()
}

/// Marks everything that is reachable without a task.
fn mark_roots(heap: &mut Heap, world: &World, lists: [&mut Vec<Value>; 3], raised: Option<&Raised>) {
    world.roots(&mut |value| heap.mark(value));
    for list in lists {
        heap.mark_slice(list);
    }
    if let Some(raised) = raised {
        raised.visit(&mut |value| heap.mark(value));
    }
}

impl Vm {
    /// What happens at a tick when none is left: a turn of the collector, and the end of the slice if it is over.
    pub(super) fn safepoint(&mut self) -> Option<Leave> {
        // `ticks` is negative here: at least by the tick that was not there, and more if builtins have overdrawn.
        let left = self.cpu.reserve + self.cpu.ticks + 1;
        self.cpu.reserve = 0;
        if self.config.collect_always {
            self.collect_fully();
        } else if self.heap.gc_due() {
            self.collect_slice();
        }
        if left > 0 {
            self.cpu.ticks = left;
            self.arm();
            return None;
        }
        self.cpu.ticks = left;
        Some(Leave::Slice)
    }

    /// Arranges for the next tick to be a safepoint, if one is wanted there.
    pub(super) fn arm(&mut self) {
        let wanted = self.config.collect_always || self.heap.gc_due();
        if wanted && self.cpu.ticks > 1 && self.cpu.reserve == 0 {
            // One tick goes through, so that the task gets on.
            self.cpu.reserve = self.cpu.ticks - 1;
            self.cpu.ticks = 1;
        }
    }

    /// Whether a builtin or an allocation has left something to be seen to.
    #[inline(always)]
    pub(super) fn wants_attention(&self) -> bool {
        self.charged != 0 || self.heap.gc_due()
    }

    /// Takes what was charged from the ticks that are left, and sees to it that the collector has its turn at the next
    /// tick. Gives the ticks until then.
    #[cold]
    #[inline(never)]
    pub(super) fn attend(&mut self, ticks: i32) -> i32 {
        // A task that owes more than this has had its slice many times over.
        let charged = std::mem::take(&mut self.charged).min(1 << 29) as i32;
        let ticks = ticks.saturating_sub(charged);
        if self.heap.gc_due() && self.cpu.reserve == 0 && ticks > 0 {
            self.cpu.reserve = ticks;
            return 0;
        }
        ticks
    }

    /// Notes where the running task stands, for a scan or a switch.
    pub(crate) fn save_cpu(&mut self) {
        let offset = self.offset_of(self.cpu.base);
        let pc = self.cpu.pc;
        let task = self.task_mut();
        task.base = offset;
        task.pc = pc;
    }

    /// A whole cycle at once: because there is no room, or because every safepoint is to be one.
    pub(crate) fn collect_fully(&mut self) {
        if self.running.is_some() {
            self.save_cpu();
        }
        let Vm { heap, world, values, requested_call, pinned, raised, running, tasks, .. } = self;
        // SAFETY: all roots and all tasks are marked; `save_cpu` has noted the running frame of the running task, those
        // of the others were noted at the switch.
        unsafe {
            heap.collect_fully(|heap| {
                mark_roots(heap, world, [values, requested_call, pinned], raised.as_ref());
                for task in running.iter_mut().chain(tasks.values_mut().flatten()) {
                    _ = scan(heap, task);
                }
            });
        }
    }

    /// The collector's turn.
    pub(crate) fn collect_slice(&mut self) {
        if self.running.is_some() {
            self.save_cpu();
        }
        let Vm { heap, world, values, requested_call, pinned, raised, running, tasks, roster, .. } = self;
        match heap.phase() {
            Phase::Marking => {
                let SliceOutcome::Drained { left } = heap.slice(SLICE_VISITS) else { return };
                let (mut left, mut has_scanned) = (left as usize, false);
                let cycle = heap.cycle_id();
                while let Some(id) = roster.next(tasks) {
                    let mut cost = 1;
                    if let Some(Some(task)) = tasks.get_mut(id)
                        && task.scanned != cycle
                    {
                        // SAFETY: a task that does not run stands where it was noted at the switch.
                        cost += unsafe { scan(heap, task) } / WORDS_PER_VISIT;
                        has_scanned = true;
                    }
                    left = left.saturating_sub(cost);
                    if left == 0 {
                        return;
                    }
                }
                if !has_scanned {
                    // SAFETY: the roots and the running task were marked when the cycle began, and every other task
                    // since, before it ran.
                    unsafe { heap.end_marking() };
                }
            }
            Phase::Sweeping => _ = heap.slice(SLICE_VISITS),
            Phase::Idle => {
                heap.begin_cycle();
                roster.begin();
                mark_roots(heap, world, [values, requested_call, pinned], raised.as_ref());
                if let Some(task) = running {
                    // SAFETY: `save_cpu` has noted its running frame.
                    _ = unsafe { scan(heap, task) };
                }
            }
        }
    }

    /// Sees to it that a task's stack has been scanned in the cycle under way before the task runs.
    pub(crate) fn scan_before_running(&mut self) {
        if self.heap.phase() != Phase::Marking {
            return;
        }
        let cycle = self.heap.cycle_id();
        if let Some(task) = &mut self.running
            && task.scanned != cycle
        {
            // SAFETY: the task has not run since its frame was noted.
            _ = unsafe { scan(&mut self.heap, task) };
        }
    }
}

impl Raised {
    /// Calls `visit` with every value of the failure.
    fn visit(&self, visit: &mut dyn FnMut(Value)) {
        match self {
            Raised::Type(datum, expected) => {
                visit(*datum);
                if let Expected::Specifier(specifier) = expected {
                    visit(*specifier);
                }
            }
            Raised::DivisionByZero(_, operands) => operands.iter().copied().for_each(visit),
            Raised::UnboundVariable(value)
            | Raised::UndefinedFunction(value)
            | Raised::EndOfFile(value)
            | Raised::Stream(value, _)
            | Raised::Cause(_, value) => visit(*value),
            _ => {}
        }
    }
}
