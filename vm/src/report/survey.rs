//! Surveys: what there is to see of a run between two turns, as data.
//!
//! A survey reads the machine and changes nothing. Its cost is bounded by what it tells of, but for one pass
//! over the records of the tasks.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use esl_bytecode::symbol::Symbol;
use esl_database::RelationFigures;
use esl_host::{
    FrameRow, InputRow, LockRow, RelationRow, RunFigures, Survey, SurveyRequest, SurveyedTask, TaskStanding,
};

use super::holders::{holders_of, number_of};
use super::label::{field_of, items};
use super::tasks::{is_of_library, number_of_owner, place_of, program_place};
use super::{reason_of, task_label, variable_rows};
use crate::describe::{describe, function_name};
use crate::interp::frames::Frames;
use crate::names::records::{lock, subscription};
use crate::schedule::Due;
use crate::table::Table;
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, input};

/// Most frames of a task, locks, and inputs that are told of.
const FRAMES: usize = 200;
const LOCKS: usize = 500;
const INPUTS: usize = 500;
/// Facts on a page.
const FACTS: usize = 500;

impl Vm {
    /// Returns what there is to see of the run, while no task runs.
    pub fn survey(&self, request: &SurveyRequest) -> Survey {
        let owners = lock_owners(self);
        let (mut chosen, mut named): (Vec<&Task>, Vec<&Task>) = (Vec::new(), Vec::new());
        let mut counts = [0; 4];
        for task in self.scheduler.tasks.iter().filter(|task| is_of_program(self, task)) {
            counts[standing_of(self, task) as usize] += 1;
            if request.tasks > 0 && task.number.0 > request.after {
                chosen.push(task);
            } else if request.named.contains(&task.number.0) {
                named.push(task);
            }
        }
        let has_more_tasks = chosen.len() > request.tasks;
        if has_more_tasks {
            chosen.select_nth_unstable_by_key(request.tasks, |task| task.number);
            let rest = chosen.split_off(request.tasks);
            named.extend(rest.into_iter().filter(|task| request.named.contains(&task.number.0)));
        }
        chosen.append(&mut named);
        chosen.sort_unstable_by_key(|task| task.number);
        let mut survey = Survey {
            figures: figures(self, counts),
            tasks: rows_of(self, &chosen, &owners),
            has_more_tasks,
            ..Survey::default()
        };
        if let Some(number) = request.frames_of {
            let task = self.scheduler.tasks.iter().find(|task| task.number.0 == number);
            survey.frames = task.map_or(Vec::new(), |task| frames(self, task));
        }
        if request.data {
            let relations = self.database.relation_figures(&self.heap, describe);
            survey.relations = relations.into_iter().map(relation_row).collect();
            survey.locks = locks(self).take(LOCKS).map(|lock| lock_row(self, lock)).collect();
            survey.inputs = inputs(self);
        }
        if let Some((relation, from)) = &request.facts {
            survey.facts = self.database.fact_texts(&self.heap, describe, relation, *from, FACTS);
        }
        if let Some(after) = request.failures_after {
            let recent = self.watch.journal.recent.iter();
            survey.failures = recent.filter(|row| row.number > after).cloned().collect();
        }
        survey
    }
}

/// Returns the row of a survey for a relation.
fn relation_row(relation: RelationFigures) -> RelationRow {
    let RelationFigures { name, width, facts, is_property } = relation;
    RelationRow { name, width, facts, is_property }
}

/// Returns whether a task is one of the program that has not ended, and not one that answers a question from
/// outside.
fn is_of_program(vm: &Vm, task: &Task) -> bool {
    let is_call = || {
        let index = event::task_index(&vm.heap, task.object);
        index.is_some_and(|index| vm.embedder.calls.contains_key(&index))
    };
    task.state != TaskState::Ended && !task.flags.hidden() && !(task.flags.kept() && is_call())
}

fn standing_of(vm: &Vm, task: &Task) -> TaskStanding {
    match task.state {
        _ if vm.scheduler.is_suspended(&vm.heap, task) => TaskStanding::Suspended,
        TaskState::Runnable | TaskState::Ended => TaskStanding::Ready,
        TaskState::Waiting => TaskStanding::Waits,
        TaskState::Reading | TaskState::Writing => TaskStanding::WaitsForStream,
    }
}

/// Returns the number of the task that has made a task; 0 if the embedder has.
pub(super) fn maker_of(vm: &Vm, task: &Task) -> u64 {
    number_of_owner(vm, task.object)
}

/// Returns what there is to say of tasks, with the times at which their waits end.
fn rows_of(vm: &Vm, tasks: &[&Task], owners: &BTreeMap<u64, u64>) -> Vec<SurveyedTask> {
    let row = |task: &&Task| (task.number.0, row_of(vm, task, owners));
    let mut rows: BTreeMap<u64, SurveyedTask> = tasks.iter().map(row).collect();
    for &Reverse(timer) in &vm.scheduler.timers.heap {
        if let Due::Wait(serial) = timer.due
            && let Some(task) = vm.scheduler.tasks.at(timer.index)
            && task.is_waiting_since(serial)
            && let Some(row) = rows.get_mut(&task.number.0)
        {
            row.ends_at = Some(timer.time);
        }
    }
    // The order is that of their numbers.
    rows.into_values().collect()
}

/// Returns what there is to say of a task that does not run now.
pub(super) fn row_of(vm: &Vm, task: &Task, owners: &BTreeMap<u64, u64>) -> SurveyedTask {
    SurveyedTask {
        number: task.number.0,
        maker: maker_of(vm, task),
        name: task_label(vm, task.object),
        standing: standing_of(vm, task),
        waits_for: (task.state != TaskState::Runnable).then(|| reason_of(vm, task)),
        held_by: holders_of(vm, task, owners),
        place: program_place(vm, task),
        ends_at: None,
        ticks: task.ticks,
        is_daemon: task.flags.daemon(),
        runs_cleanup: task.runs_cleanup(),
    }
}

/// Returns the frames of a parked task that do not belong to the library.
fn frames(vm: &Vm, task: &Task) -> Vec<FrameRow> {
    let row = |frame: crate::interp::frames::Frame<'_>| {
        let place = place_of(vm, &frame)?;
        (!is_of_library(&place.source)).then(|| FrameRow {
            function: function_name(&vm.heap, frame.function),
            place: Some(format!("{}:{}:{}", place.source, place.line, place.column)),
            variables: variable_rows(vm, &frame),
        })
    };
    let mut rows: Vec<FrameRow> =
        Frames::of_task(task).take(10 * FRAMES).filter_map(row).take(FRAMES).collect();
    if rows.is_empty()
        && let Some(place) = program_place(vm, task)
    {
        // The last call of a function leaves no frame of it.
        let function = "a function that this call has left".into();
        rows.push(FrameRow { function, place: Some(place), variables: Vec::new() });
    }
    rows
}

fn figures(vm: &Vm, tasks: [u64; 4]) -> RunFigures {
    let (scheduler, heap, watch) = (&vm.scheduler, vm.heap.stats(), &vm.watch);
    let pauses = watch.figures.pauses;
    RunFigures {
        tasks,
        made: scheduler.counts.made,
        ticks: scheduler.spent,
        turns: scheduler.counts.turns,
        rounds: scheduler.rounds,
        time: scheduler.clock.now,
        idled: scheduler.clock.idled,
        is_paused: scheduler.is_paused,
        is_virtual: scheduler.clock.is_virtual,
        facts: vm.database.fact_count() as u64,
        live: heap.live,
        allocated: heap.allocated,
        committed: heap.committed,
        limit: vm.config.memory as u64,
        collections: heap.cycles,
        pauses: [pauses.count, pauses.total, pauses.longest],
        failures: watch.journal.causes.iter().map(|(cause, &count)| (cause.clone(), count)).collect(),
        failed: watch.journal.failed,
        ended_by_failure: watch.journal.ended,
        recoveries: watch.journal.recoveries,
        restarts: variable(vm, "*%RESTARTS*").as_index().unwrap_or(0) as u64,
        lateness: watch.journal.lateness,
    }
}

/// Returns the value of a variable of the library outside of all bindings; `NIL` if it has none.
fn variable(vm: &Vm, name: &str) -> Value {
    let symbol = vm.names.find(&Symbol::esl(name)).and_then(|symbol| vm.heap.symbol(symbol));
    symbol.map_or(Value::NIL, |symbol| symbol.value)
}

/// Returns the locks of properties.
fn locks(vm: &Vm) -> impl Iterator<Item = Value> {
    let table = Table::of(&vm.heap, variable(vm, "*%LOCKS*"));
    let entries = table.map_or(0, |table| table.used(&vm.heap));
    (0..entries).filter_map(move |entry| table?.entry(&vm.heap, entry)).map(|(_, lock)| lock)
}

/// Returns the owner of each lock that others may wait for, by the lock's event.
pub(super) fn lock_owners(vm: &Vm) -> BTreeMap<u64, u64> {
    let owner = |lock: Value| {
        let owner = items(vm, field_of(vm, lock, lock::SUBSCRIPTIONS)).next()?;
        let number = number_of(vm, field_of(vm, owner, subscription::TASK))?;
        Some((field_of(vm, lock, lock::EVENT).bits(), number))
    };
    locks(vm).take(LOCKS).filter_map(owner).collect()
}

fn lock_row(vm: &Vm, lock: Value) -> LockRow {
    let field = |index| field_of(vm, lock, index);
    let subscriptions = items(vm, field(lock::SUBSCRIPTIONS));
    let key = describe(&vm.heap, field(lock::KEY));
    let value = describe(&vm.heap, field(lock::VALUE));
    LockRow {
        property: format!("{} {value})", key.strip_suffix(')').unwrap_or(&key)),
        state: describe(&vm.heap, field(lock::STATE)).trim_start_matches(':').to_lowercase(),
        subscribers: subscriptions
            .filter_map(|one| number_of(vm, field_of(vm, one, subscription::TASK)))
            .collect(),
    }
}

fn inputs(vm: &Vm) -> Vec<InputRow> {
    let row = |(name, &object): (&String, &Value)| InputRow {
        name: name.clone(),
        kept: input::size(&vm.heap, object),
        capacity: input::capacity(&vm.heap, object),
        signals: event::count(&vm.heap, object).max(0) as u64,
        dropped: input::dropped(&vm.heap, object) as u64,
    };
    vm.outside.inputs.iter().take(INPUTS).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_without_a_library_can_be_surveyed() {
        let vm = Vm::for_tests();
        let canary = vm.canary();
        let survey = vm.survey(&SurveyRequest {
            tasks: 10,
            frames_of: Some(3),
            data: true,
            facts: Some((String::new(), 0)),
            failures_after: Some(0),
            ..SurveyRequest::default()
        });
        assert!(survey.tasks.is_empty() && survey.relations.is_empty() && survey.locks.is_empty());
        assert_eq!(vm.canary(), canary);
    }
}
