//! Safepoints: preemption, and the collector's turns.
//!
//! Here is everything that the collector has to find: [`mark_roots`] names the fixed roots, [`scan`] the values of a
//! task. A task's stack is scanned once in a cycle: that of the running task when the cycle begins, every other one when
//! the marker gets to it or just before the task runs, whichever is first.

use super::{Leave, code_of};
use crate::environment::Compiler;
use crate::exchange::Exchange;
use crate::heap::{Heap, Phase, SLICE_VISITS, SliceOutcome};
use crate::raise::{Expected, Raised};
use crate::saved_pc::SavedPc;
use crate::schedule::Scheduler;
use crate::task::Task;
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

/// Charged by whoever wants the slice to end at the next tick; the task goes on with the next slice.
const END_OF_SLICE: u64 = 1 << 40;

/// Turns of the collector after which a slice ends, however many ticks are left: they take their time too. The ticks are
/// not charged.
const TURNS_IN_SLICE: u32 = 8;

/// Words of a stack that count as one visit of the collector.
const WORDS_PER_VISIT: usize = 4;

/// Words of the stack of a task that does not run.
pub(crate) fn top_of_task(task: &Task) -> usize {
    // SAFETY: the task stands where it was noted at the switch.
    unsafe { top_of(task, task.base as usize) }
}

/// Marks everything that a task holds; gives how many words that are.
///
/// # Safety
/// `task.base` is the offset of its running frame.
unsafe fn scan(heap: &mut Heap, task: &mut Task) -> usize {
    // SAFETY: by the contract.
    let top = unsafe { top_of(task, task.base as usize) };
    task.stack.wipe(top);
    heap.mark_slice(task.stack.words(top));
    for value in [task.object, task.wait, task.notify] {
        heap.mark(value);
    }
    if let Some(extra) = &task.extra {
        extra.visit(&mut |value| heap.mark(value));
    }
    task.scanned = heap.cycle_id();
    let Some(control) = task.control.get() else { return top };
    control.visit(&mut |value| heap.mark(value));
    top + control.entries.len() + 2 * control.bindings.len()
}

/// Marks everything that is reachable without a task.
fn mark_roots(
    heap: &mut Heap,
    world: &World,
    compiler: &Compiler,
    lists: [&mut Vec<Value>; 3],
    raised: Option<&Raised>,
) {
    world.roots(&mut |value| heap.mark(value));
    compiler.roots(&mut |value| heap.mark(value));
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
            self.cpu.collections += 1;
            if left > 0 && self.cpu.collections >= TURNS_IN_SLICE {
                self.cpu.granted -= left;
                self.cpu.ticks = 0;
                return Some(Leave::Slice);
            }
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
        self.exchange.charged != 0 || self.heap.gc_due()
    }

    /// Takes what was charged from the ticks that are left, and sees to it that the collector has its turn at the next
    /// tick. Gives the ticks until then.
    #[cold]
    #[inline(never)]
    pub(super) fn attend(&mut self, ticks: i32) -> i32 {
        // A task that owes more than this has had its slice many times over.
        let charged = std::mem::take(&mut self.exchange.charged);
        let mut ticks = ticks.saturating_sub((charged % END_OF_SLICE).min(1 << 29) as i32);
        if charged >= END_OF_SLICE {
            let left = ticks + self.cpu.reserve;
            self.cpu.granted -= left.max(0);
            self.cpu.reserve = 0;
            ticks = left.min(0);
            self.scheduler.turn.slice_is_cut = true;
        }
        if self.heap.gc_due() && self.cpu.reserve == 0 && ticks > 0 {
            self.cpu.reserve = ticks;
            return 0;
        }
        ticks
    }

    /// Has the slice of the running task end at the next tick, to go on with another one: what the slice may take has changed.
    pub(crate) fn end_slice_here(&mut self) {
        self.exchange.charged |= END_OF_SLICE;
    }

    /// Notes where the running task stands, for a scan or a switch.
    pub(crate) fn save_cpu(&mut self) {
        let offset = self.offset_of(self.cpu.base);
        let pc = SavedPc::new(self.cpu.pc);
        let task = self.scheduler.task_mut();
        task.base = offset as u32;
        task.pc = pc;
    }

    /// A whole cycle at once: because there is no room, or because every safepoint is to be one.
    pub(crate) fn collect_fully(&mut self) {
        if self.watch.is_watched {
            self.watched_pause(Vm::collect_fully_now)
        } else {
            self.collect_fully_now()
        }
    }

    fn collect_fully_now(&mut self) {
        if self.scheduler.running.is_some() {
            self.save_cpu();
        }
        let Vm { heap, world, compiler, scheduler, exchange, embedder, .. } = self;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        let Exchange { values, requested_call, raised, .. } = exchange;
        let pinned = &mut embedder.pinned;
        // SAFETY: all roots and all tasks are marked; `save_cpu` has noted the running frame of the running task, those
        // of the others were noted at the switch.
        unsafe {
            heap.collect_fully(|heap| {
                mark_roots(heap, world, compiler, [values, requested_call, pinned], raised.as_ref());
                deliveries.iter().for_each(|delivery| delivery.visit(&mut |value| heap.mark(value)));
                for task in running.as_deref_mut().into_iter().chain(tasks.iter_mut()) {
                    _ = scan(heap, task);
                }
            });
        }
    }

    /// The collector's turn.
    pub(crate) fn collect_slice(&mut self) {
        if self.watch.is_watched {
            self.watched_pause(Vm::collect_slice_now)
        } else {
            self.collect_slice_now()
        }
    }

    fn collect_slice_now(&mut self) {
        if self.scheduler.running.is_some() {
            self.save_cpu();
        }
        let Vm { heap, world, compiler, scheduler, exchange, embedder, .. } = self;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        let Exchange { values, requested_call, raised, .. } = exchange;
        let pinned = &mut embedder.pinned;
        match heap.phase() {
            Phase::Marking => {
                let SliceOutcome::Drained { left } = heap.slice(SLICE_VISITS) else { return };
                let (mut left, mut has_scanned) = (left as usize, false);
                let cycle = heap.cycle_id();
                while let Some(task) = tasks.next_unmet() {
                    let mut cost = 1;
                    if let Some(task) = task
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
                tasks.begin_cycle();
                mark_roots(heap, world, compiler, [values, requested_call, pinned], raised.as_ref());
                deliveries.iter().for_each(|delivery| delivery.visit(&mut |value| heap.mark(value)));
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
        if let Some(task) = &mut self.scheduler.running
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
            Raised::Type(datum, expected) | Raised::Variable(_, datum, expected) => {
                // The variable is known to the machine.
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
