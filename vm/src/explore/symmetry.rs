//! Symmetry: tasks that can be exchanged.
//!
//! A fingerprint visits the tasks in some order, and all else as they refer to it. Two states with one
//! fingerprint are alike but for the tasks that take each other's places; so any order will do, as long as
//! the program cannot see the numbers of tasks. An order by the next steps of the tasks lets states coincide
//! that differ only by which of several like tasks has come further.
//!
//! Guarantees: an order that tells fewer tasks apart costs states, and loses none. Not here: which programs
//! see numbers or the order of tasks (`points.sees_numbers`, `points.sees_order`); livelocks, which are not
//! judged of where tasks are exchanged.
//!
//! Source: Clarke, Enders, Filkorn and Jha 1996; Ip and Dill 1996.

use super::digest::Digest;
use super::fingerprint::Walk;
use crate::heap::Kind;
use crate::interp::frames::{Frames, entry_word};
use crate::task::Task;
use crate::value::Value;
use crate::wait::event;

impl Walk<'_> {
    /// Puts tasks, which are in the order of their numbers, into that of what they are about to do; those
    /// that do the same stay as they are.
    pub(super) fn put_in_order_of_likeness(&mut self, tasks: &mut Vec<&Task>) {
        let mut ranked: Vec<(Digest, usize, &Task)> =
            tasks.iter().enumerate().map(|(rank, &task)| (self.likeness(task), rank, task)).collect();
        ranked.sort_unstable_by_key(|&(Digest(one, other), rank, _)| (one, other, rank));
        let mut order = Digest::default();
        order.add_all(ranked.iter().map(|&(_, rank, _)| rank as u64));
        self.note_order(order.0);
        tasks.clear();
        tasks.extend(ranked.into_iter().map(|(.., task)| task));
    }

    /// Returns what tells a task from others by itself: where it stands, and the values there.
    fn likeness(&mut self, task: &Task) -> Digest {
        let mut digest = Digest::default();
        let numbers =
            [task.state as u64, task.flags.bits().into(), task.priority.into(), task.critical.into()];
        digest.add_all(numbers.into_iter());
        let name = self.heap().slot_or_nil(task.object, event::NAME);
        [name, task.notify, task.wait].into_iter().for_each(|v| self.add_shallow(&mut digest, v));
        let waited = self.heap().record(task.wait, Kind::Wait).unwrap_or_default().to_vec();
        waited.into_iter().for_each(|v| self.add_shallow(&mut digest, v));
        for frame in Frames::of_task(task) {
            digest.add(frame.word as u64);
            self.add_shallow(&mut digest, frame.function);
            let captures = self.heap().function_captures(frame.function).unwrap_or_default().to_vec();
            let live = self.live(frame.function).at(frame.word);
            let registers = frame.registers().iter().enumerate();
            let registers = registers.filter(|&(register, _)| live.contains(register)).map(|(_, &v)| v);
            captures.into_iter().chain(registers).for_each(|v| self.add_shallow(&mut digest, v));
        }
        if let Some(control) = task.control.get() {
            for entry in &control.entries {
                digest.add(entry.kind as u64);
                digest.add(entry_word(task, entry).map_or(u64::MAX, |word| word as u64));
                self.add_shallow(&mut digest, entry.data);
            }
            for binding in control.bindings.all() {
                [binding.symbol, binding.value].into_iter().for_each(|v| self.add_shallow(&mut digest, v));
            }
        }
        digest
    }

    /// Adds a value: of an object its kind, of a symbol its name, of a function its code.
    fn add_shallow(&mut self, digest: &mut Digest, v: Value) {
        if self.is_return_address(v) {
            return digest.add(u64::MAX);
        }
        if !v.is_address() {
            return digest.add(v.bits());
        }
        let kind = self.heap().kind(v);
        digest.add(kind.map_or(0, |kind| 1 + kind as u64));
        let Digest(one, other) = match kind {
            Some(Kind::Symbol) => self.symbol(v).unwrap_or_default(),
            Some(Kind::Function) => self.code_of_function(v),
            _ => return,
        };
        digest.add(one ^ other);
    }
}
