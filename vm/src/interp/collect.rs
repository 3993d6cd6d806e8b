//! Safepoints: preemption, and the collector's turns.
//!
//! Here is everything that the collector has to find: [`mark_roots`] names the fixed roots, [`scan`] the
//! values of a task. A task's stack is scanned once in a cycle: that of the running task when the cycle
//! begins, every other one when the marker gets to it or just before the task runs, whichever is first.

use super::{Leave, code_of};
use crate::compiler::Compilations;
use crate::embedder::Embedder;
use crate::exchange::Exchange;
use crate::heap::{Heap, Phase, SLICE_VISITS, SliceOutcome};
use crate::outside::Outside;
use crate::saved_pc::SavedPc;
use crate::schedule::{Scheduler, TurnEnd};
use crate::task::{Task, Tasks};
use crate::vm::Vm;
use crate::wait::Deliveries;
use crate::world::World;

/// Offset of the first word above the frame with the given base.
///
/// # Safety
/// `base` is the offset of a frame of `task`.
unsafe fn top_of(task: &Task, base: usize) -> usize {
    // SAFETY: F2: below the base of a frame is its link, which begins with its function.
    unsafe {
        let function = *task.stack.start().add(base - 2);
        // The saved pc of a failed instruction lies behind the registers, below the frame that handles it.
        base + (*code_of(function)).nregs as usize
    }
}

/// Turns of the collector after which a slice ends, however many ticks are left: they take their time too.
/// The ticks are not charged.
const TURNS_IN_SLICE: u32 = 8;

/// Words of a stack that count as one visit of the collector.
const WORDS_PER_VISIT: usize = 4;

/// Words of the stack of a task that does not run.
pub(crate) fn top_of_task(task: &Task) -> usize {
    // SAFETY: F3: the base of a task that does not run is that of its frame.
    unsafe { top_of(task, task.base as usize) }
}

/// Marks everything that a task holds; gives how many words that are.
///
/// # Safety
/// `task.base` is the offset of its running frame.
unsafe fn scan(heap: &mut Heap, task: &mut Task) -> usize {
    // SAFETY: by the contract the base is that of a frame.
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
    task.recount(heap);
    let Some(control) = task.control.get() else { return top };
    control.visit(&mut |value| heap.mark(value));
    top + control.entries.len() + 2 * control.bindings.len()
}

/// Marks everything that is reachable without a task.
fn mark_roots(
    heap: &mut Heap,
    world: &World,
    compiler: &Compilations,
    exchange: &Exchange,
    embedder: &Embedder,
    deliveries: &Deliveries,
    outside: &Outside,
) {
    world.roots(&mut |value| heap.mark(value));
    compiler.roots(&mut |value| heap.mark(value));
    heap.mark_slice(&exchange.values);
    heap.mark_slice(&exchange.requested_call);
    if let Some(raised) = &exchange.raised {
        raised.visit(&mut |value| heap.mark(value));
    }
    embedder.visit(&mut |value| heap.mark(value));
    deliveries.visit(&mut |value| heap.mark(value));
    outside.visit(&mut |value| heap.mark(value));
}

/// Marks more: a slice of what is known to be reachable, then the tasks whose stacks have yet to be scanned.
fn mark_more(heap: &mut Heap, tasks: &mut Tasks) {
    let SliceOutcome::Drained { left } = heap.slice(SLICE_VISITS) else { return };
    let (mut left, mut has_scanned) = (left as usize, false);
    let cycle = heap.cycle_id();
    while let Some(task) = tasks.next_unmet() {
        let mut cost = 1;
        if let Some(task) = task
            && task.scanned != cycle
        {
            // SAFETY: F3: the base of a task that does not run is that of its frame.
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

impl Vm {
    /// What happens at a tick when none is left: a turn of the collector, and the end of the slice if it is
    /// over.
    pub(super) fn safepoint(&mut self) -> Option<Leave> {
        // `ticks` is negative here: at least by the tick that was not there, and more if builtins have
        // overdrawn.
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

    /// Returns whether the slice of the running task may go on, as far as its turn and the collector are
    /// concerned.
    pub(crate) fn slice_may_go_on(&self) -> bool {
        self.scheduler.turn.end == TurnEnd::Spent && self.cpu.collections < TURNS_IN_SLICE
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

    /// Returns whether a builtin or an allocation wants the next tick to be a safepoint, or has charged
    /// ticks.
    #[inline(always)]
    pub(super) fn wants_safepoint(&self) -> bool {
        !self.exchange.charges.is_empty() || self.heap.gc_due()
    }

    /// Takes what was charged from the ticks that are left, and sees to it that the next tick is a safepoint
    /// if one is wanted there. Returns the ticks until then.
    #[cold]
    #[inline(never)]
    pub(super) fn prepare_safepoint(&mut self, ticks: i32) -> i32 {
        let charges = self.exchange.charges.take();
        // A task that owes more than this has had its slice many times over.
        let mut ticks = ticks.saturating_sub(charges.ticks().min(1 << 29) as i32);
        if charges.ends_slice() {
            let left = ticks + self.cpu.reserve;
            self.cpu.granted -= left.max(0);
            self.cpu.reserve = 0;
            ticks = left.min(0);
            self.scheduler.turn.end_with(TurnEnd::Cut);
        }
        if self.heap.gc_due() && self.cpu.reserve == 0 && ticks > 0 {
            self.cpu.reserve = ticks;
            return 0;
        }
        ticks
    }

    /// Notes where the running task stands, for a scan or a switch.
    pub(crate) fn save_cpu(&mut self) {
        let offset = self.offset_of(self.cpu.base());
        let pc = SavedPc::new(self.cpu.pc());
        let task = self.scheduler.task_mut();
        task.base = offset as u32;
        task.pc = pc;
    }

    /// Completes a whole cycle: for want of room, or since each safepoint is to collect.
    pub(crate) fn collect_fully(&mut self) {
        let pause = self.begin_pause();
        let Vm { heap, world, compiler, scheduler, outside, exchange, embedder, .. } = self;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        // SAFETY: all roots and all tasks are marked; `begin_pause` has noted the running frame of the
        // running task, those of the others were noted at the switch.
        unsafe {
            heap.collect_fully(|heap| {
                mark_roots(heap, world, compiler, exchange, embedder, deliveries, outside);
                for task in running.as_deref_mut().into_iter().chain(tasks.iter_mut()) {
                    _ = scan(heap, task);
                }
            });
        }
        self.end_pause(pause);
    }

    /// The collector's turn.
    pub(crate) fn collect_slice(&mut self) {
        let pause = self.begin_pause();
        let Vm { heap, world, compiler, scheduler, outside, exchange, embedder, .. } = self;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        match heap.phase() {
            Phase::Marking => mark_more(heap, tasks),
            Phase::Sweeping => _ = heap.slice(SLICE_VISITS),
            Phase::Idle => {
                heap.begin_cycle();
                tasks.begin_cycle();
                mark_roots(heap, world, compiler, exchange, embedder, deliveries, outside);
                if let Some(task) = running {
                    // SAFETY: `begin_pause` has noted the base of its running frame.
                    _ = unsafe { scan(heap, task) };
                }
            }
        }
        self.end_pause(pause);
    }

    /// Begins a turn of the collector: notes where the running task stands, and tells whoever watches.
    /// Returns when it began, if the run is watched.
    fn begin_pause(&mut self) -> Option<u64> {
        if self.scheduler.running.is_some() {
            self.save_cpu();
        }
        let Vm { watch, outside, scheduler, .. } = self;
        watch.is_watched.then(|| watch.begin_pause(&mut outside.host, scheduler))
    }

    /// Ends a turn of the collector.
    fn end_pause(&mut self, began: Option<u64>) {
        if let Some(began) = began {
            let is_last = self.heap.phase() == Phase::Idle;
            self.watch.end_pause(&mut self.outside.host, &self.scheduler, began, is_last);
        }
    }

    /// Scans the stack of a task that is about to run, unless the cycle under way has scanned it.
    pub(crate) fn scan_before_running(&mut self) {
        if self.heap.phase() != Phase::Marking {
            return;
        }
        let cycle = self.heap.cycle_id();
        if let Some(task) = &mut self.scheduler.running
            && task.scanned != cycle
        {
            // SAFETY: F3: the task has not run since its base was noted.
            _ = unsafe { scan(&mut self.heap, task) };
        }
    }
}
