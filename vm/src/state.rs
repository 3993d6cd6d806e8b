//! The list of all state: what each field of a machine is to a run.
//!
//! Every struct that a machine is made of is taken apart here without `..` (the heap's in its own crate, the
//! database in `database`), so a new field does not compile until it is listed in one of these groups:
//!
//! * `content`: state of the run that decides what programs may still do, so it belongs to every fingerprint.
//!   The list makes a trait with a method for each of these fields, which visitors of a state implement: a
//!   field that is not visited does not compile either.
//! * `course`: state of the run that says how it came here, and decides when things happen: ticks, numbers,
//!   the order of queues. Two states that differ here only are one to the explorer; the strict fingerprint is
//!   made of it too, as the list tells it, by the function behind `by` if there is one.
//! * `parts`: made of structs that are listed themselves.
//! * `transient`: without meaning while no task runs. A state is one between two turns.
//! * `derived`: follows from other fields, and is kept to save time.
//! * `process`: belongs to the process: an address, a handle, a setting of observers.

use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};

use esl_bytecode::compile::SourcePlace;
use esl_bytecode::package::{PackageId, Packages};
use esl_bytecode::symbol::Symbol;
use esl_heap::list_state;
use esl_heap::state::{StateSink, Stated};
use esl_host::Incoming;

use crate::compiler::Compilations;
use crate::embedder::Embedder;
use crate::exchange::Exchange;
use crate::names::{Names, Opaques, RootMap};
use crate::observe::{Figures, Journal, Observers, Watch};
use crate::outside::{Operations, Outside};
use crate::overhead::CollectionOverhead;
use crate::schedule::{Accounts, Clock, Counts, EndOfAll, Points, RunQueues, Scheduler, Timers, Turn};
use crate::task::{Control, Extra, RunningCleanup, Shortage, Task};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::Deliveries;

/// The part of a visitor of content that handles the course: the fields that describe themselves.
pub(crate) trait VisitCourse {
    /// Visits the course of a struct.
    fn course(&mut self, whole: &dyn Stated);
}

/// Lists the fields of a struct by groups, and declares the trait of visitors of its content.
macro_rules! state {
    ($(#[$doc:meta])* $owner:ident by $visitor:ident :: $visit:ident {
        content { $($content:ident),* $(,)? }
        $(course { $($course:ident $(by $by:expr)?),* $(,)? })?
        $(parts { $($part:ident),* $(,)? })?
        $(transient { $($transient:ident),* $(,)? })?
        $(derived { $($derived:ident),* $(,)? })?
        $(process { $($process:ident),* $(,)? })?
    }) => {
        list_state! { $owner {
            $($content: Visited,)*
            $($($course: Run $(by $by)?,)*)?
            $($($part: Parts,)*)?
            $($($transient: Derived,)*)?
            $($($derived: Derived,)*)?
            $($($process: Process,)*)?
        } }

        $(#[$doc])*
        pub(crate) trait $visitor: VisitCourse {
            $(
                #[doc = concat!("Visits the field `", stringify!($content), "`.")]
                fn $content(&mut self, whole: &$owner);
            )*

            /// Visits the content, in the order of the list, and then the course.
            fn $visit(&mut self, whole: &$owner) {
                $(self.$content(whole);)*
                self.course(whole);
            }
        }
    };
}

state! {
    /// Visits the content of a machine.
    Vm by VisitVm :: machine {
        content { scheduler, names, database, compiler, outside }
        course { config }
        parts { heap, embedder, exchange, watch }
        transient { cpu }
        process { natives, compiled, between_rounds }
    }
}

state! {
    /// Visits the content of a scheduler.
    Scheduler by VisitScheduler :: scheduler_content {
        content { tasks, timers, any_event }
        course {
            choices, readers, writers, end_of_all, main, main_number, serial, spent, rounds, is_paused, canary,
            open_turn, starter,
        }
        parts { queues, accounts, deliveries, counts, clock, points, turn }
        transient { running }
    }
}

state! {
    /// Visits the content of a task.
    Task by VisitTask :: task_content {
        content { flags, priority, critical, state, wait, notify, stack, control, account, extra }
        course { object, ticks, serial, number, turns, pc by nothing, base }
        derived { scanned, counted, has_deadline }
    }
}

state! {
    /// Visits the content of the rarely used parts of a task.
    Extra by VisitExtra :: extra_content {
        content { limits, interrupts, fund }
        course { report, end, values }
    }
}

state! {
    /// Visits the content of a control stack.
    Control by VisitControl :: control_content {
        content { entries, running, unwinding, bindings }
    }
}

state! {
    /// Visits the content of a running cleanup.
    RunningCleanup by VisitRunning :: running_content {
        content { pending, values, allowance }
        derived { entry, bound }
    }
}

state! {
    /// Visits the content of the names.
    Names by VisitNames :: names_content {
        content { symbols }
        course {
            fresh by tell_fresh,
            packages by tell_packages,
            package_objects by tell_objects,
            classes by tell_count,
            is_open,
            images,
            undefined_yet by tell_symbols,
            opaques by tell_opaques,
        }
        transient { is_defining }
        derived { known, symbol_of, called, homes, runner, streams, nil, t, rights, undefined }
    }
}

state! {
    /// Visits the content of a compiler.
    Compilations by VisitCompiler :: compiler_content {
        content { jobs }
        transient { unit, refused, remains }
        derived { held }
        process { compiler, begun }
    }
}

state! {
    /// Visits the content of the outside.
    Outside by VisitOutside :: outside_content {
        content { exit_status, console, operations, inputs }
        course { senders, attendance }
        transient { answers }
        process { host, inbox, functions, found, calls, arguments, complaints }
    }
}

/// The frames of a task tell where it is.
fn nothing<T>(_: &T, _: &mut dyn StateSink) {}

fn tell_fresh(fresh: &Cell<u32>, sink: &mut dyn StateSink) {
    sink.word(u64::from(fresh.get()));
}

/// Packages are made and changed by the program only, so that what they take tells them apart well enough.
fn tell_packages(packages: &Packages, sink: &mut dyn StateSink) {
    sink.word(packages.bytes() as u64);
}

fn tell_objects(objects: &BTreeMap<PackageId, Value>, sink: &mut dyn StateSink) {
    objects.values().for_each(|&object| sink.value(object));
}

/// The classes themselves are reached from their names.
fn tell_count(classes: &RootMap<Value>, sink: &mut dyn StateSink) {
    sink.word(classes.len() as u64);
}

fn tell_symbols(symbols: &[Symbol], sink: &mut dyn StateSink) {
    symbols.iter().for_each(|symbol| symbol.name().as_bytes().tell(sink));
}

fn tell_opaques(opaques: &Opaques, sink: &mut dyn StateSink) {
    (opaques.made, opaques.len()).tell(sink);
}

fn tell_deferred(deferred: &VecDeque<Incoming>, sink: &mut dyn StateSink) {
    deferred.len().tell(sink);
    deferred.iter().for_each(|incoming| format!("{incoming:?}").tell(sink));
}

fn tell_place(place: &Option<SourcePlace>, sink: &mut dyn StateSink) {
    if let Some(SourcePlace { source, line, column }) = place {
        source.tell(sink);
        (*line, *column).tell(sink);
    }
}

list_state! { Operations { open: Run, begun: Run, by_task: Derived } }
list_state! { RunQueues { queues: Run, occupied: Derived, urgent: Run, turns: Run } }
list_state! { Timers { heap: Run, sequence: Run, sweep_at: Run } }
list_state! { Accounts { accounts: Run, free: Run, bytes_counted: Derived } }
list_state! { Deliveries { signals: Run, held: Run } }
list_state! { EndOfAll { left: Run } }
list_state! { Counts { alive: Run, foreground: Run, made: Run, made_at_end: Run, turns: Run, switches: Run } }
list_state! { Clock { is_virtual: Process, now: Run, looked_at: Run, moved_at: Run, more_is_due: Run, idled: Run } }
list_state! { Points {
    grain: Process,
    has_clock: Process,
    has_counts: Process,
    has_columns: Process,
    has_numbers: Process,
    has_symmetry: Process,
    sees_numbers: Process,
    sees_order: Process,
    is_open: Run,
    has_shown: Run,
    is_seen: Process,
    is_sudden: Process,
    raced: Process,
    found_raced: Process,
    is_timed: Process,
    was_hit: Process,
    requested: Process,
    has_guards: Process,
    asked: Run,
    asked_for: Process,
    chosen: Run,
    is_strict: Process,
    uses: Process,
    place: Process,
    objects: Process,
} }
list_state! { Turn {
    index: Run,
    end: Derived,
    left: Run,
    critical_left: Run,
    critical_is_new: Run,
    had_attention: Derived,
    shortage: Run by |&shortage: &Shortage, sink: &mut dyn StateSink| sink.word(shortage as u64),
    used_before: Derived,
    parking: Derived,
    ending: Derived,
} }
list_state! { Exchange {
    values: Derived,
    raised: Derived,
    requested_call: Derived,
    lookups: Derived,
    charges: Derived,
    collected_at: Derived,
    overhead: Run by |overhead: &CollectionOverhead, sink: &mut dyn StateSink| {
        overhead.words().into_iter().for_each(|word| sink.word(word));
    },
    sought: Derived,
    found: Derived,
} }
list_state! { Embedder {
    pinned: Run,
    calls: Run,
    first: Run,
    deferred: Run by tell_deferred,
    handlers: Run,
    kept: Run,
    kept_so_far: Run,
    interruptible: Run,
    signal_waits: Run,
    ended_by: Run,
    is_ending: Run,
    is_cut_short: Run,
    last_words: Run,
    last_place: Run by tell_place,
} }
list_state! { Watch {
    is_watched: Derived,
    is_followed: Derived,
    are_turns_noted: Derived,
    tells_variables: Process,
    observers: Process,
    coming: Process,
    figures: Process,
    meter: Process,
    journal: Process,
    traces_tasks: Process,
    passages: Process,
} }
list_state! { Journal {
    is_kept: Process,
    causes: Process,
    failed: Process,
    ended: Process,
    noted: Process,
    recent: Process,
    recoveries: Process,
    lateness: Process,
} }
list_state! { Observers {
    list: Process,
    start: Process,
    latest: Process,
    unsaid: Process,
    collects: Process,
} }
list_state! { Figures { pauses: Process, are_wanted: Process, of_tasks: Process, ended: Process } }

#[cfg(test)]
mod tests {
    use esl_heap::state::{Field, FieldRole, Listed};

    use super::*;

    /// Counts the fields of a list that are state of a run, and of the lists below it.
    fn fields_of_run(fields: &[Field]) -> usize {
        fields
            .iter()
            .map(|field| match field.role {
                FieldRole::Run => 1,
                FieldRole::Parts(parts) => fields_of_run(parts),
                FieldRole::Derived | FieldRole::Process => 0,
            })
            .sum()
    }

    #[test]
    fn the_list_is_a_tree_from_the_machine_down() {
        let names: Vec<&str> = Vm::FIELDS.iter().map(|field| field.name).collect();
        assert!(names.contains(&"heap") && names.contains(&"scheduler"));
        assert!(fields_of_run(Vm::FIELDS) > 20 && fields_of_run(Scheduler::FIELDS) > 20);
    }
}
