//! Safepoints: preemption, and the collector's turns.
//!
//! Here is everything that the collector has to find: [`mark_roots`] names the fixed roots, [`scan`] the
//! values of a task. A task's stack is scanned once in a cycle: that of the running task when the cycle
//! begins, every other one when the marker gets to it or just before the task runs, whichever is first.
//!
//! A stack may take hundreds of megabytes. A large one is scanned piece by piece, and its task does not run
//! until that is done: the task leaves its slice when a cycle begins, and each of its turns is spent on
//! another piece. So other tasks have their turns between.

use super::{Leave, code_of};
use crate::compiler::Compilations;
use crate::embedder::Embedder;
use crate::exchange::Exchange;
use crate::heap::{Heap, Phase, SLICE_VISITS, SliceOutcome};
use crate::names::{Names, Opaques};
use crate::outside::Outside;
use crate::saved_pc::SavedPc;
use crate::schedule::{Scheduler, TurnEnd};
use crate::task::{Control, Task, Tasks};
#[cfg(feature = "native")]
use crate::tier::CompiledFunctions;
use crate::vm::Vm;
use crate::wait::Deliveries;

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

/// Words of a stack, or parts of a control stack, that are scanned in one piece.
const PIECE: usize = 1024;

/// Pieces that are scanned in one turn: in about 0.1 ms.
const PIECES_IN_TURN: usize = 64;

/// Words of a stack that are too many to be scanned, wiped or freed at once.
pub(super) const LARGE_STACK: usize = PIECES_IN_TURN * PIECE;

/// Words of the stack of a task that does not run.
pub(crate) fn top_of_task(task: &Task) -> usize {
    // SAFETY: F3: the base of a task that does not run is that of its frame.
    unsafe { top_of(task, task.base as usize) }
}

/// Marks everything that a task holds.
///
/// # Safety
/// `task.base` is the offset of its running frame.
unsafe fn scan(heap: &mut Heap, task: &mut Task) {
    task.stack.scan = 0;
    // SAFETY: F3: by the contract the base is that of the frame, up to which the stack holds values.
    _ = unsafe { scan_pieces(heap, task, usize::MAX) };
}

/// Marks more of what a task holds, so many pieces or fewer, and notes when that was all. Returns how many
/// words and parts it was.
///
/// # Safety
/// `task.base` is the offset of its running frame, and it has not run since the first piece was scanned in
/// this cycle.
unsafe fn scan_pieces(heap: &mut Heap, task: &mut Task, most: usize) -> usize {
    // SAFETY: by the contract the base is that of a frame.
    let top = unsafe { top_of(task, task.base as usize) };
    let capacity = task.stack.capacity();
    let (words, parts) = (capacity.div_ceil(PIECE), task.control.get().map_or(0, Control::parts));
    let (first, mut seen) = (task.stack.scan as usize, 0);
    let end = (words + parts.div_ceil(PIECE)).min(first.saturating_add(most));
    if first < words {
        let (from, to) = (first * PIECE, (end * PIECE).min(capacity));
        // The interpreter does not note how high it has written: above the top there may be anything that
        // was an object once.
        task.stack.wipe_range(from.max(top), to);
        heap.mark_slice(&task.stack.words(top)[from.min(top)..to.min(top)]);
        seen += to - from;
    }
    if end > words
        && let Some(control) = task.control.get()
    {
        let from = first.max(words) - words;
        let range = from * PIECE..((end - words) * PIECE).min(parts);
        seen += range.len();
        control.visit_parts(range, &mut |value| heap.mark(value));
    }
    task.stack.scan = end as u32;
    if end < words + parts.div_ceil(PIECE) {
        return seen;
    }
    for value in [task.object, task.wait, task.notify] {
        heap.mark(value);
    }
    if let Some(extra) = &task.extra {
        extra.visit(&mut |value| heap.mark(value));
    }
    if let Some(control) = task.control.get() {
        control.visit_unwinding(&mut |value| heap.mark(value));
    }
    task.stack.scan = 0;
    task.scanned = heap.cycle_id();
    task.recount(heap);
    seen
}

/// Gives back most of the stacks of a task that does not run if they are much too large for what is on them.
fn trim(heap: &mut Heap, task: &mut Task) {
    let top = top_of_task(task);
    let is_trimmed = task.control.trim() | (task.stack.scan == 0 && trim_stack(task, top));
    if is_trimmed {
        task.recount(heap);
    }
}

/// Gives back most of the stack of a task, of which the words below `top` are used, if it is large and has
/// been four times as high. Returns whether it has moved.
fn trim_stack(task: &mut Task, top: usize) -> bool {
    let (capacity, enough) = (task.stack.capacity(), 2 * top + PIECE);
    if capacity <= LARGE_STACK || top >= capacity / 4 {
        return false;
    }
    // As much at a time as does not take long; but nothing goes on before there is room.
    loop {
        let before = task.stack.capacity();
        task.stack.shrink(enough);
        if task.stack.capacity() == before {
            return before < capacity;
        }
    }
}

/// Returns whether what a task holds is too much to be scanned at once.
fn is_large(task: &Task) -> bool {
    task.stack.capacity() + task.control.get().map_or(0, Control::parts) > LARGE_STACK
}

/// Marks everything that is reachable without a task.
fn mark_roots(
    heap: &mut Heap,
    names: &Names,
    compiler: &Compilations,
    exchange: &Exchange,
    embedder: &Embedder,
    deliveries: &Deliveries,
    outside: &Outside,
) {
    names.roots(&mut |value| heap.mark(value));
    compiler.roots(&mut |value| heap.mark(value));
    heap.mark_slice(&exchange.values);
    heap.mark_slice(&exchange.requested_call);
    heap.mark_slice(exchange.sought.as_slice());
    if let Some((class, found)) = &exchange.found {
        heap.mark(*class);
        heap.mark_slice(found);
    }
    if let Some(raised) = &exchange.raised {
        raised.visit(&mut |value| heap.mark(value));
    }
    embedder.visit(&mut |value| heap.mark(value));
    deliveries.visit(&mut |value| heap.mark(value));
    outside.visit(&mut |value| heap.mark(value));
}

/// Marks more: a slice of what is known to be reachable, then the tasks whose stacks have yet to be scanned.
fn mark_more(
    heap: &mut Heap,
    tasks: &mut Tasks,
    opaques: &mut Opaques,
    #[cfg(feature = "native")] compiled: &mut CompiledFunctions,
) {
    let SliceOutcome::Drained { left } = heap.slice(SLICE_VISITS) else { return };
    let (mut left, mut has_scanned) = (left as usize, false);
    let cycle = heap.cycle_id();
    while let Some((task, held)) = tasks.next_unmet() {
        let mut cost = 1;
        heap.mark(held);
        if let Some(task) = task
            && task.scanned != cycle
        {
            let most = (left * WORDS_PER_VISIT).div_ceil(PIECE);
            // SAFETY: F3: the base of a task that does not run is that of its frame; and it does not run
            // before all of it is scanned.
            cost += unsafe { scan_pieces(heap, task, most) } / WORDS_PER_VISIT;
            has_scanned = true;
            if task.scanned != cycle {
                return tasks.meet_again();
            }
        }
        left = left.saturating_sub(cost);
        if left == 0 {
            return;
        }
    }
    if !has_scanned {
        opaques.note_unreachable(heap);
        #[cfg(feature = "native")]
        Vm::give_back_code(compiled, heap);
        // SAFETY: the roots were marked when the cycle began, and so was the running task, or it has not run
        // since; and every other task since, before it ran.
        unsafe { heap.end_marking() };
    }
}

impl Vm {
    /// Does the work of a safepoint: a turn of the collector, and the end of the slice if no tick is left.
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
            if self.is_yet_to_be_scanned() {
                self.cpu.collections = TURNS_IN_SLICE;
            }
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
        #[cfg(feature = "native")]
        self.note_heat(left < 0);
        Some(Leave::Slice)
    }

    /// Returns whether the running task may not run on before it is scanned.
    fn is_yet_to_be_scanned(&self) -> bool {
        let task = self.scheduler.running.as_ref();
        self.heap.phase() == Phase::Marking && task.is_some_and(|task| task.scanned != self.heap.cycle_id())
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
    #[inline]
    pub(crate) fn save_cpu(&mut self) {
        let task = self.scheduler.task_mut();
        task.base = task.offset_of(self.cpu.base()) as u32;
        task.pc = SavedPc::new(self.cpu.pc());
    }

    /// Completes a whole cycle: for want of room, or since each safepoint is to collect.
    pub(crate) fn collect_fully(&mut self) {
        let pause = self.begin_pause();
        let sought = self.exchange.sought;
        let Vm { heap, names, compiler, scheduler, outside, exchange, embedder, .. } = self;
        #[cfg(feature = "native")]
        let compiled = &mut self.compiled;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        // SAFETY: all roots and all tasks are marked; `begin_pause` has noted the running frame of the
        // running task, those of the others were noted at the switch.
        unsafe {
            let mut opaques = std::mem::take(&mut names.opaques);
            let found = heap.collect_fully_and_find(
                sought,
                |heap| {
                    mark_roots(heap, names, compiler, exchange, embedder, deliveries, outside);
                    for task in tasks.iter_mut() {
                        trim(heap, task);
                    }
                    for task in running.as_deref_mut().into_iter().chain(tasks.iter_mut()) {
                        scan(heap, task);
                        if task.flags.lacks_room() {
                            task.flags.set_collected_for(true);
                        }
                    }
                    tasks.visit_standstills(&mut |value| heap.mark(value));
                },
                |heap| {
                    opaques.note_unreachable(heap);
                    #[cfg(feature = "native")]
                    Vm::give_back_code(compiled, heap);
                },
            );
            names.opaques = opaques;
            if let Some(class) = exchange.sought.take() {
                exchange.found = Some((class, found));
            }
        }
        self.end_pause(pause);
        self.names.opaques.let_go();
    }

    /// Gives back most of the stack of the running task if it is much too large for what is on it.
    ///
    /// # Safety
    /// F1: `vm.cpu` describes the running task. Its frame moves.
    pub(super) unsafe fn trim_running_stack(&mut self) {
        let offset = self.offset_of(self.cpu.base());
        let task = self.scheduler.task_mut();
        // SAFETY: by the contract the offset is that of a frame.
        let top = unsafe { top_of(task, offset) };
        let is_trimmed = task.control.trim() | trim_stack(task, top);
        if is_trimmed {
            task.recount(&mut self.heap);
            // SAFETY: the offset was inside of the stack, and below what is left of it.
            unsafe {
                let base = self.scheduler.task().stack.start().add(offset);
                self.cpu.set_base(base);
            }
            self.update_stack_end();
        }
    }

    /// The collector's turn.
    pub(crate) fn collect_slice(&mut self) {
        let pause = self.begin_pause();
        let Vm { heap, names, compiler, scheduler, outside, exchange, embedder, .. } = self;
        #[cfg(feature = "native")]
        let compiled = &mut self.compiled;
        let Scheduler { running, tasks, deliveries, .. } = scheduler;
        match heap.phase() {
            Phase::Marking => mark_more(
                heap,
                tasks,
                &mut names.opaques,
                #[cfg(feature = "native")]
                compiled,
            ),
            Phase::Sweeping => _ = heap.slice(SLICE_VISITS),
            Phase::Idle => {
                heap.begin_cycle();
                tasks.begin_cycle();
                mark_roots(heap, names, compiler, exchange, embedder, deliveries, outside);
                // A large one leaves its slice, and is scanned before the next.
                if let Some(task) = running
                    && !is_large(task)
                {
                    // SAFETY: `begin_pause` has noted the base of its running frame.
                    unsafe { scan(heap, task) };
                }
            }
        }
        self.end_pause(pause);
        self.names.opaques.let_go();
    }

    /// Begins a turn of the collector: notes where the running task stands, and tells the observers.
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
            unsafe { scan(&mut self.heap, task) };
        }
    }

    /// Scans a part of the stack of a task that is to run, unless the cycle under way has scanned all of it.
    /// Returns whether the task may run now.
    #[inline]
    pub(crate) fn scan_in_turn(&mut self, task: &mut Task) -> bool {
        let is_scanned = self.heap.phase() != Phase::Marking || task.scanned == self.heap.cycle_id();
        is_scanned || self.scan_part(task)
    }

    /// As [`Vm::scan_in_turn`], for a task that is yet to be scanned.
    #[cold]
    fn scan_part(&mut self, task: &mut Task) -> bool {
        let cycle = self.heap.cycle_id();
        let pause = self.begin_pause();
        let (capacity, top) = (task.stack.capacity(), top_of_task(task));
        if task.stack.scan == 0 && capacity > LARGE_STACK && top < capacity / 4 {
            // It is much too large for what is on it.
            task.stack.shrink(2 * top + PIECE);
            task.recount(&mut self.heap);
        } else {
            // SAFETY: F3: the base of a task that does not run is that of its frame; and it runs only when
            // all of it is scanned.
            _ = unsafe { scan_pieces(&mut self.heap, task, PIECES_IN_TURN) };
        }
        self.end_pause(pause);
        task.scanned == cycle
    }
}
