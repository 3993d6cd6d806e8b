//! Room on the running task's stack, and the reserves that are for handling the exhaustion of stack and heap,
//! and for cleanups.

use crate::config::Config;
use crate::raise::{Exit, Raised};
use crate::task::{Bindings, Control, Entry, Task, TaskEnd, UnwindTarget, Unwinding};
use crate::value::Value;
use crate::vm::Vm;

/// Words beyond the limit of the stack for the handling of its exhaustion.
const RESERVE: usize = 8192;

/// Words by which a stack grows at a time while memory is exhausted.
const MODEST: usize = 1024;

/// Entries or bindings by which the control stack grows at first.
const FEW: usize = 4;

/// Entries or bindings from which on it grows by a quarter instead of doubling.
const MANY: usize = 1 << 14;

/// Words that the stack, the entries and the bindings of a task may have together now. Running cleanups take
/// their part before the limit is reached, but not from the reserve.
#[inline]
fn whole_limit(config: &Config, task: &Task) -> usize {
    if task.flags.uses_reserve() {
        return config.stack_words() + RESERVE;
    }
    config.stack_words().saturating_sub(task.control.get().map_or(0, Control::words_of_cleanups))
}

/// Words that the stack of a task may have now: the rest is taken by its control stack.
#[inline]
fn stack_limit(config: &Config, task: &Task) -> usize {
    whole_limit(config, task).saturating_sub(task.control.get().map_or(0, Control::words))
}

/// Address up to which the stack of a task may be used: its end, or its limit if that comes first.
#[inline]
pub(super) fn stack_end(config: &Config, task: &Task) -> *mut Value {
    let capacity = task.stack.capacity();
    // A small stack meets its limit when it grows: the control stack of a task that is switched to need not
    // be measured.
    let end =
        if capacity < config.stack_words() / 4 { capacity } else { capacity.min(stack_limit(config, task)) };
    // SAFETY: the offset is at most the capacity of the stack.
    unsafe { task.stack.start().add(end) }
}

impl Vm {
    /// Offset of an address in the running task's stack.
    pub(crate) fn offset_of(&self, base: *mut Value) -> usize {
        self.scheduler.task().offset_of(base)
    }

    /// Notes up to where the running task's stack may be used, after that has changed.
    pub(super) fn update_stack_end(&mut self) {
        let stack_end = stack_end(&self.config, self.scheduler.task());
        // SAFETY: it is that of the running task's stack.
        unsafe { self.cpu.set_stack_end(stack_end) };
    }

    /// Makes room in the running task's stack for `words` words in all.
    ///
    /// # Errors
    /// `:stack-exhausted` at the limit, and [`Exit::Collect`] if there is no memory for it. Handling either
    /// has a reserve; see [`Vm::leave_reserve`].
    pub(super) fn reserve_stack(&mut self, words: usize) -> Result<(), Exit> {
        if words > stack_limit(&self.config, self.scheduler.task())
            && !(self.trim_control() && words <= stack_limit(&self.config, self.scheduler.task()))
        {
            return self.run_out_of_stack();
        }
        if words <= self.scheduler.task().stack.capacity() {
            return Ok(());
        }
        let offset = self.offset_of(self.cpu.base());
        let task = self.scheduler.task_mut();
        let more = |capacity: usize| (capacity - task.stack.capacity()) * size_of::<Value>();
        let mut capacity = task.stack.larger(words);
        if let Err(error) = self.heap.check_room(more(capacity)) {
            if !self.heap.is_reserve_open() {
                return Err(error.into());
            }
            // A failure for want of memory is being handled, with what little there is.
            capacity = words + MODEST;
            self.heap.check_room(more(capacity))?;
        }
        task.stack.grow(capacity);
        task.recount(&mut self.heap);
        // SAFETY: the offset was inside of the stack, which has grown.
        unsafe {
            let base = self.scheduler.task().stack.start().add(offset);
            self.cpu.set_base(base);
        }
        self.update_stack_end();
        Ok(())
    }

    /// Gives back the room of the running task's control stack that an earlier recursion has left, since the
    /// stack needs it. Returns whether there was any.
    fn trim_control(&mut self) -> bool {
        let task = self.scheduler.task_mut();
        let is_trimmed = task.control.give_back(FEW);
        if is_trimmed {
            task.recount(&mut self.heap);
            self.update_stack_end();
        }
        is_trimmed
    }

    /// Fails because the stack and the control stack of the running task have reached their limit, or leaves
    /// the handling of that if it has used up its reserve.
    #[cold]
    fn run_out_of_stack<T>(&mut self) -> Result<T, Exit> {
        if self.scheduler.task().flags.uses_reserve() {
            self.leave_reserve(self.names.known.stack_exhausted);
            return Err(Exit::Unwind);
        }
        self.scheduler.task_mut().flags.set_uses_reserve(true);
        self.update_stack_end();
        self.exchange.raise(Raised::StackExhausted)
    }

    /// Makes room for more entries of the running task's control stack, which is full. The running frame has
    /// its base at the offset `base`.
    ///
    /// # Errors
    /// `:stack-exhausted` at the limit, and [`Exit::Collect`] if there is no memory for it.
    #[cold]
    #[inline(never)]
    pub(super) fn reserve_entries(&mut self, base: u32) -> Result<(), Exit> {
        let count = self.scheduler.task().control.entries.len();
        let more = self.room_on_control_stack(base, count, size_of::<Entry>())?;
        let task = self.scheduler.task_mut();
        task.control.entries.reserve_exact(more);
        task.recount(&mut self.heap);
        self.update_stack_end();
        Ok(())
    }

    /// Makes room for more bindings of the running task, which has no room left for them. The running frame
    /// has its base at the offset `base`.
    ///
    /// # Errors
    /// As [`Vm::reserve_entries`].
    #[cold]
    #[inline(never)]
    pub(crate) fn reserve_bindings(&mut self, base: u32) -> Result<(), Exit> {
        let count = self.scheduler.task().control.bindings.len();
        let more = self.room_on_control_stack(base, count, Bindings::BYTES)?;
        let task = self.scheduler.task_mut();
        task.control.bindings.reserve(more);
        task.recount(&mut self.heap);
        self.update_stack_end();
        Ok(())
    }

    /// Returns for how many more items of so many bytes there is room, where `count` are and the running
    /// frame has its base at the offset `base`.
    fn room_on_control_stack(&mut self, base: u32, count: usize, bytes: usize) -> Result<usize, Exit> {
        let task = self.scheduler.task();
        let used = base as usize + task.control.words();
        let left = whole_limit(&self.config, task).saturating_sub(used) * size_of::<Value>() / bytes;
        if left == 0 {
            return self.run_out_of_stack();
        }
        let modest = left.min(MODEST / 8);
        if task.flags.uses_reserve() {
            return self.heap.check_room(modest * bytes).map(|()| modest).map_err(Exit::from);
        }
        let more = if count < MANY { count.max(FEW) } else { count / 4 }.min(left);
        if let Err(error) = self.heap.check_room(more * bytes) {
            if !self.heap.is_reserve_open() {
                return Err(error.into());
            }
            self.heap.check_room(modest * bytes)?;
            return Ok(modest);
        }
        Ok(more)
    }

    /// Closes the reserves of stack and heap once the handling of their exhaustion is over: an unwinding has
    /// landed.
    pub(super) fn close_reserves(&mut self) {
        if self.heap.is_reserve_open() {
            self.heap.close_reserve();
            self.exchange.overhead.allow_another();
        }
        let task = self.scheduler.task();
        if task.flags.uses_reserve()
            && self.offset_of(self.cpu.base()) + task.control.words_in_use() < self.config.stack_words() / 2
        {
            self.scheduler.task_mut().flags.set_uses_reserve(false);
            self.update_stack_end();
        }
    }

    /// Has the running task use the memory that is kept for cleanups, if it runs one or works for one.
    /// Returns false if it may not, or does already.
    pub(super) fn open_cleanup_memory(&mut self) -> bool {
        let task = self.scheduler.task_mut();
        let may_use = task.runs_cleanup() || task.flags.serves_cleanup();
        if !may_use || task.flags.uses_cleanup_memory() {
            return false;
        }
        self.lend_cleanup_memory();
        true
    }

    /// Has the running task, which fails for want of memory, use the memory that is kept for cleanups, so
    /// that its failure is reported although others have used up the reserve. Returns false if something may
    /// handle the failure, if a form is told of it instead, or if the task uses that memory already.
    pub(super) fn open_report_memory(&mut self) -> bool {
        let (task, mut steps) = (self.scheduler.task(), 0);
        if task.notify.is_true() && !task.flags.kept() {
            return false;
        }
        let is_handled = task.control.find_handlers(usize::MAX, true, &mut steps).is_some();
        self.exchange.charge(steps);
        if is_handled || self.scheduler.task().flags.uses_cleanup_memory() {
            return false;
        }
        self.lend_cleanup_memory();
        true
    }

    /// Lends the memory that is kept for cleanups to the running task.
    pub(crate) fn lend_cleanup_memory(&mut self) {
        self.scheduler.task_mut().flags.set_uses_cleanup_memory(true);
        self.heap.lend_to_cleanup(true);
    }

    /// Notes that a cleanup of the running task is over: with the outermost, so is the use of what is kept
    /// for cleanups.
    #[inline]
    pub(super) fn close_cleanup_memory(&mut self) {
        let task = self.scheduler.task_mut();
        if task.flags.uses_cleanup_memory() && !task.runs_cleanup() && !task.flags.serves_cleanup() {
            task.flags.set_uses_cleanup_memory(false);
            self.heap.lend_to_cleanup(false);
        }
    }

    /// The reserve is used up that was for handling the exhaustion of stack or heap: leaves what has handled
    /// it, which the library has put into a catch, so that the failure goes on outward. Without that, the
    /// task ends with `cause`.
    pub(crate) fn leave_reserve(&mut self, cause: Value) {
        let control = &self.scheduler.task().control;
        let (found, height) = (control.find_catch(self.names.known.reserve), control.entries.len());
        self.exchange.charge(height - found.unwrap_or(0));
        match found {
            Some(index) => {
                let unwinding = Unwinding { target: UnwindTarget::Entry(index), values: Vec::new() };
                self.scheduler.task_mut().control.unwinding = Some(unwinding);
            }
            None => self.scheduler.task_mut().begin_end(TaskEnd::Failed(cause)),
        }
    }
}
