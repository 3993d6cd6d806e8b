//! The content of a state, as the fingerprint visits it: a method for each field that the list of all state
//! calls content.

use super::fingerprint::{NamedSymbol, Walk};
use esl_host::Output;

use crate::compiler::Compilations;
use crate::heap::Heap;
use crate::heap::layout::SymbolObject;
use crate::interp::frames::entry_word;
use crate::names::Names;
use crate::outside::Outside;
use crate::schedule::{Due, Scheduler};
use crate::shape::{CodeKind, Shape};
use crate::state::{
    VisitCompiler, VisitControl, VisitCourse, VisitExtra, VisitNames, VisitOutside, VisitRunning,
    VisitScheduler, VisitTask, VisitVm,
};
use crate::task::{Allowance, Control, Entry, Extra, RunningCleanup, Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

impl VisitVm for Walk<'_> {
    fn scheduler(&mut self, vm: &Vm) {
        self.scheduler_content(&vm.scheduler);
    }

    fn names(&mut self, vm: &Vm) {
        self.names_content(&vm.names);
    }

    fn database(&mut self, vm: &Vm) {
        self.course(&vm.database);
        if !vm.database.is_quiet() {
            // Where a query stands is not looked into.
            self.unlike_any_other();
        }
        vm.database.visit_state(&mut |item| match item {
            Ok(word) => self.word(word),
            Err(v) => {
                if !self.is_strict {
                    self.no_value();
                }
                self.value(v);
            }
        });
    }

    fn compiler(&mut self, vm: &Vm) {
        self.compiler_content(&vm.compiler);
    }

    fn outside(&mut self, vm: &Vm) {
        self.outside_content(&vm.outside);
    }
}

impl VisitScheduler for Walk<'_> {
    fn tasks(&mut self, scheduler: &Scheduler) {
        self.course(&scheduler.tasks);
        let all = self.vm.scheduler.tasks.iter();
        let is_strict = self.is_strict;
        let mut tasks: Vec<&Task> = all.filter(|task| is_strict || task.state != TaskState::Ended).collect();
        tasks.sort_unstable_by_key(|task| task.number);
        self.word(tasks.len() as u64);
        if !is_strict && scheduler.points.has_numbers {
            self.word(scheduler.counts.made);
            tasks.iter().for_each(|task| self.word(task.number.0));
        }
        if !is_strict && scheduler.points.has_symmetry {
            self.put_in_order_of_likeness(&mut tasks);
        }
        for task in &tasks {
            // All tasks first, so that their numbers are their places in this order.
            self.value(task.object);
        }
        for task in tasks {
            self.task = Some(task);
            let index = event::task_index(&self.vm.heap, task.object);
            let standstill = index.map(|index| scheduler.tasks.standstill(index));
            self.word(standstill.map_or(0, |standstill| u64::from(standstill.times)));
            self.word(index.map_or(0, |index| scheduler.tasks.rest(index) as u64));
            self.task_content(task);
        }
    }

    fn any_event(&mut self, scheduler: &Scheduler) {
        self.value(scheduler.any_event);
    }

    /// Mixes in the timers, in order: time, task and action.
    fn timers(&mut self, scheduler: &Scheduler) {
        for timer in scheduler.timers.in_order() {
            let Some(task) = scheduler.tasks.at(timer.index) else { continue };
            if self.is_strict || !scheduler.is_wanted(timer) {
                continue;
            }
            self.time(timer.time);
            self.value(task.object);
            match timer.due {
                Due::Wait(_) => self.word(0),
                Due::Cleanup => self.word(1),
                Due::Limit(number) => {
                    let limits = task.extra.iter().flat_map(|extra| &extra.limits);
                    let position = limits.take_while(|limit| limit.number != number).count();
                    self.word(2 + position as u64);
                }
            }
        }
    }
}

impl VisitTask for Walk<'_> {
    fn flags(&mut self, task: &Task) {
        self.word(u64::from(task.flags.bits()));
    }

    fn priority(&mut self, task: &Task) {
        self.word(u64::from(task.priority));
    }

    fn critical(&mut self, task: &Task) {
        self.word(u64::from(task.critical));
    }

    fn state(&mut self, task: &Task) {
        self.word(task.state as u64);
    }

    fn wait(&mut self, task: &Task) {
        self.value(task.wait);
    }

    fn notify(&mut self, task: &Task) {
        self.value(task.notify);
    }

    fn stack(&mut self, task: &Task) {
        self.course(&task.stack);
        self.frames(task);
    }

    fn control(&mut self, task: &Task) {
        if let Some(control) = task.control.get() {
            self.control_content(control);
        }
    }

    fn account(&mut self, task: &Task) {
        let mut words = Vec::new();
        self.vm.scheduler.accounts.visit_left(task.account, &mut |left| words.push(left));
        self.digest.add_all(words.into_iter());
    }

    fn extra(&mut self, task: &Task) {
        if let Some(extra) = &task.extra {
            self.extra_content(extra);
        }
    }
}

impl VisitExtra for Walk<'_> {
    fn limits(&mut self, extra: &Extra) {
        self.word(extra.limits.len() as u64);
        for limit in &extra.limits {
            self.course(limit);
            self.word(u64::from(limit.entry));
            self.value(limit.expired.unwrap_or(Value::NIL));
        }
    }

    fn interrupts(&mut self, extra: &Extra) {
        self.values(&extra.interrupts);
    }

    fn fund(&mut self, extra: &Extra) {
        self.course(&extra.fund);
        match extra.fund {
            Some(fund) => {
                self.word(fund.depth as u64);
                self.word(fund.floor.map_or(u64::MAX, |floor| floor as u64));
                self.time(fund.ends.time);
            }
            None => self.word(0),
        }
    }
}

impl VisitControl for Walk<'_> {
    fn entries(&mut self, control: &Control) {
        self.word(control.entries.len() as u64);
        for entry in &control.entries {
            let Entry { data, base, bindings, window, want, kind, .. } = *entry;
            self.word(u64::from(base) << 32 | u64::from(bindings));
            self.word(u64::from(window) << 16 | u64::from(want) << 8 | kind as u64);
            let landing = self.task.and_then(|task| entry_word(task, entry));
            self.word(landing.map_or(u64::MAX, |word| word as u64));
            self.value(data);
        }
    }

    fn running(&mut self, control: &Control) {
        self.word(control.running.len() as u64);
        for running in &control.running {
            self.running_content(running);
        }
    }

    fn unwinding(&mut self, control: &Control) {
        Walk::unwinding(self, control.unwinding.as_ref());
    }

    fn bindings(&mut self, control: &Control) {
        for binding in control.bindings.all() {
            self.value(binding.symbol);
            self.value(binding.value);
        }
    }
}

impl VisitRunning for Walk<'_> {
    fn pending(&mut self, running: &RunningCleanup) {
        Walk::unwinding(self, running.pending.as_ref());
    }

    fn values(&mut self, running: &RunningCleanup) {
        Walk::values(self, &running.values);
    }

    fn allowance(&mut self, running: &RunningCleanup) {
        self.course(&running.allowance);
        match running.allowance {
            Some(Allowance::OVER) => self.word(1),
            Some(allowance) => self.time(allowance.time),
            None => self.word(0),
        }
    }
}

impl VisitNames for Walk<'_> {
    /// Values, functions and properties that the program has given to symbols of packages.
    fn symbols(&mut self, _: &Names) {
        let vm = self.vm;
        for &NamedSymbol { digest, object: v, function, .. } in &*self.named() {
            let Some(object) = vm.heap.symbol(v) else { continue };
            let has_value = object.value != Value::UNBOUND
                && object.header.flags & (SymbolObject::CONSTANT | SymbolObject::KEYWORD) == 0;
            let has_function = object.function != function && is_of_program(&vm.heap, object.function);
            if !has_value && !has_function && !object.plist.is_true() {
                continue;
            }
            self.digest_of(digest);
            if has_value {
                self.value(object.value);
            }
            if has_function {
                self.value(object.function);
            }
            self.value(object.plist);
        }
    }
}

/// Returns whether a function has code that is not the library's.
pub(super) fn is_of_program(heap: &Heap, function: Value) -> bool {
    let code = heap.function_code(function).and_then(|code| heap.code(code));
    code.is_some_and(|code| {
        let is_of_image = code.owner.as_index().is_some() && code.debug.as_index().is_some();
        !is_of_image && Shape::unpack(code.spare[0]).kind == CodeKind::Bytecode
    })
}

impl VisitCompiler for Walk<'_> {
    fn jobs(&mut self, compiler: &Compilations) {
        if !compiler.jobs.is_empty() {
            // How far a compilation is, is not looked into.
            self.unlike_any_other();
        }
    }
}

impl VisitOutside for Walk<'_> {
    fn exit_status(&mut self, outside: &Outside) {
        self.word(outside.exit_status.map_or(0, |status| 1 + u64::from(status)));
    }

    fn console(&mut self, outside: &Outside) {
        self.course(&outside.console);
        self.word(outside.console.noted());
        if !self.is_strict && self.vm.scheduler.points.has_columns {
            let columns = [Output::Standard, Output::Error].map(|output| outside.console.column(output));
            columns.into_iter().for_each(|column| self.word(column as u64));
        }
    }

    fn operations(&mut self, outside: &Outside) {
        self.course(&outside.operations);
        for open in outside.operations.open.values() {
            self.value(open.handle);
            self.word(u64::from(open.is_cancelled));
        }
    }

    fn inputs(&mut self, outside: &Outside) {
        outside.inputs.values().for_each(|&input| self.value(input));
    }
}
