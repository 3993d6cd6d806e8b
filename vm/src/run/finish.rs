//! The end of a task: asking for it, noting how it came, telling who waits for it, and ending the run with the last.

use crate::heap::Kind;
use crate::interp;
use crate::raise::Exit;
use crate::report::Happening;
use crate::schedule::EndOfAll;
use crate::task::AccountId;
use crate::task::End;
use crate::task::{TaskId, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// Tasks that are asked to end in one step.
const AT_ONCE: usize = 1000;

impl Vm {
    /// Asks for the end of a task, wherever it is. It unwinds, and runs its cleanups, within two slices; inside a cleanup
    /// or a critical section the request waits for its end.
    pub fn abort(&mut self, id: TaskId) {
        if !self.scheduler.tasks.contains(id) {
            return;
        }
        let is_running = id.index == self.scheduler.turn.index && self.scheduler.running.is_some();
        let task =
            if is_running { self.scheduler.running.as_deref_mut() } else { self.scheduler.tasks.get_mut(id) };
        if let Some(task) = task
            && task.state != TaskState::Ended
        {
            task.flags.set_abort_pending(true);
            self.note(id.index, Happening::IsToEnd);
            self.call_attention(id.index);
        }
    }

    /// Asks for the end of every task, as if the program had asked to end.
    pub fn abort_all(&mut self) {
        self.abort_others();
    }

    /// Asks for the end of every task but the running one. Where there are many, the rest are asked between turns, and only those
    /// that are being ended have turns until then.
    pub(crate) fn abort_others(&mut self) {
        let except = self.scheduler.running.as_ref().map_or(0, |task| task.number);
        self.scheduler.end_of_all = Some(EndOfAll { place: 0, made: self.scheduler.counts.made, except });
        self.abort_more();
        if self.scheduler.end_of_all.is_some()
            && let Some(task) = &mut self.scheduler.running
        {
            task.flags.set_urgent(true);
        }
    }

    /// Asks the next tasks to end, if all are to.
    pub(crate) fn abort_more(&mut self) {
        let Some(all) = self.scheduler.end_of_all else { return };
        let end = self.scheduler.tasks.places().min(all.place + AT_ONCE);
        for index in all.place..end {
            let index = index as u32;
            if let Some(task) = self.scheduler.tasks.at(index)
                && task.number <= all.made
                && task.number != all.except
                && let Some(id) = self.scheduler.tasks.id_at(index)
            {
                self.abort(id);
            }
        }
        let is_over = end == self.scheduler.tasks.places();
        self.scheduler.end_of_all = if is_over { None } else { Some(EndOfAll { place: end, ..all }) };
    }

    /// Notes how the running task has ended, and tells those who want to know.
    pub(crate) fn finish_task(&mut self) {
        let end = match self.scheduler.turn.ending.take().unwrap_or(End::Succeeded) {
            End::Spent => End::Failed(self.world.known.budget_exhausted),
            end => end,
        };
        let mut values = std::mem::take(&mut self.exchange.values);
        let object = self.scheduler.task().object;
        // What others are told of has to be made before; here there is nothing to go back to.
        let result = match (end, &values[..]) {
            (End::Succeeded, &[value]) => value,
            (End::Succeeded, values) => self.make_for_end(|vm| Ok(vm.heap.list(values)?)),
            (End::Failed(condition), _) => condition,
            _ => Value::NIL,
        };
        let aux = u16::from(end == End::Succeeded && values.len() == 1);
        self.heap.set_aux(object, Kind::Task, aux);
        self.set_slot(object, event::RESULT, result);
        let status = match end {
            End::Succeeded => self.world.known.succeeded,
            End::Failed(_) | End::Spent => self.world.known.failed,
            End::Aborted => self.world.known.aborted,
        };
        self.set_slot(object, event::STATE, status);
        let is_awaited = self.slot(object, event::FIRST).is_true();
        let notify = std::mem::replace(&mut self.scheduler.task_mut().notify, Value::NIL);
        interp::start::drop_frames(self.scheduler.task_mut());
        let account = std::mem::replace(&mut self.scheduler.task_mut().account, AccountId::NONE);
        self.scheduler.accounts.leave(account);
        self.trace_end(self.slot(object, event::NAME), status);
        self.report_end(end, is_awaited || notify.is_true());
        let task = self.scheduler.task_mut();
        task.state = TaskState::Ended;
        if task.flags.kept() {
            let extra = task.extra_mut();
            extra.end = Some(end);
            extra.values = std::mem::take(&mut values);
        }
        values.clear();
        self.exchange.values = values;
        // The list of arguments is made only if somebody will see it.
        let has_waiters = self.slot(object, event::FIRST).is_true();
        let arguments: &[Value] = if has_waiters { &[self.world.known.task_end] } else { &[] };
        self.make_for_end(|vm| vm.signal_event(object, arguments).map(|()| Value::NIL));
        if self.heap.is(notify, Kind::Wait) {
            let cell = self.make_for_end(|vm| Ok(vm.heap.cons(object, Value::NIL)?));
            self.keep(notify, cell, object);
        } else if notify.is_true() {
            self.interrupt_by(notify);
        }
        self.end_run_if_over(end);
    }

    /// Does what needs room at the end of a task, where an instruction cannot be done again: with a collection if need be,
    /// and with the reserve of the heap.
    pub(crate) fn make_for_end(&mut self, mut make: impl FnMut(&mut Vm) -> Result<Value, Exit>) -> Value {
        for attempt in 0..3 {
            if let Ok(value) = make(self) {
                return value;
            }
            match attempt {
                0 => self.collect_fully(),
                _ => _ = self.heap.open_reserve(),
            }
        }
        Value::NIL
    }

    /// Reports the failure that has ended the running task, unless somebody waits for it or the embedder wants to.
    fn report_end(&mut self, end: End, is_awaited: bool) {
        let task = self.scheduler.task_mut();
        if task.flags.kept() || is_awaited {
            return;
        }
        let report = task.extra.as_mut().and_then(|extra| extra.report.take());
        let name = self.slot(self.scheduler.task().object, event::NAME);
        let label = self.label_of(name, self.scheduler.task().number);
        match (end, report) {
            (End::Failed(_), Some(report)) => {
                self.outside.complain(&format!("In {label}:\n{}", report.text()))
            }
            (End::Failed(condition), None) => {
                self.outside.complain(&format!("In {label}:\n{}", self.report_in_short(condition)));
            }
            _ => {}
        }
    }

    /// What is to be said of a failure that has ended a task when there was no room for more.
    pub(crate) fn report_in_short(&self, condition: Value) -> String {
        format!("Failure {}, no recovery available.\nAborted\n", self.describe(condition))
    }

    /// Ends the run with the running task, if it is the last that matters.
    fn end_run_if_over(&mut self, end: End) {
        self.scheduler.counts.alive -= 1;
        if !self.scheduler.task().flags.daemon() {
            self.scheduler.counts.foreground -= 1;
        }
        let Some(main) = self.scheduler.main else { return };
        let main_has_failed = main.index == self.scheduler.turn.index && (end != End::Succeeded);
        if main_has_failed || self.scheduler.counts.foreground == 0 {
            self.abort_others();
        }
    }
}
