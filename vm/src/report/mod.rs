//! Texts about tasks: for observers, traces, reports and figures.

mod calls;
mod figures;
mod history;
mod holders;
mod kept;
mod label;
mod observe;
mod stand;
mod survey;
mod tail_calls;
mod tasks;
mod trace;
mod variables;

pub(crate) use calls::note_end_in_meter;
pub(crate) use figures::note_end_in_figures;
pub(crate) use history::NotedFrame;
pub use kept::KeptData;
pub(crate) use label::{
    arguments_label, cause_label, end_label, event_label, failure_arguments, label_of, lack_of, reason_of,
    report_in_short, task_label,
};
pub(crate) use observe::{
    note_end_by_failure, show, tell_of_change, tell_of_failure, tell_of_recovery, tell_of_signal,
    tell_of_waking,
};
pub(crate) use tasks::{number_of_owner, operations_left, place_in_program, program_place, tasks_left};
pub(crate) use trace::{Happening, note, trace_end};
pub(crate) use variables::{variable_rows, variables_of, with_variables};
