//! Figures of a run, as `--stats` prints them.

use esl::program::Summary;
use esl_command::say_error;
use esl_durable::SnapshotFigures;
use esl_vm::vm::{Tier, Vm};

use crate::profile::{Profile, ProfiledFunction, UsedResources};

/// Functions whose figures are printed, at most.
const SHOWN_FUNCTIONS: usize = 40;

/// Prints the figures of a run.
pub(crate) fn print_stats(machine: &Vm, summary: &Summary, seconds: f64) {
    let (heap, pauses) = (summary.heap, machine.pauses());
    let milliseconds = |nanoseconds: u64| nanoseconds as f64 / 1e6;
    say_error!("ticks         {:>14}", summary.ticks);
    say_error!("tasks         {:>14}", summary.tasks);
    say_error!("turns         {:>14}", summary.turns);
    say_error!("switches      {:>14}", summary.switches);
    say_error!("seconds       {seconds:>14.3}");
    say_error!("allocated     {:>14} bytes", heap.allocated);
    say_error!("peak heap     {:>14} bytes", heap.peak);
    say_error!("collections   {:>14}", heap.cycles);
    say_error!("pauses        {:>14}", pauses.count);
    say_error!("  all         {:>14.3} ms", milliseconds(pauses.total));
    say_error!("  longest     {:>14.3} ms", milliseconds(pauses.longest));
    say_error!("longest slice {:>14} objects", heap.longest_slice);
    let (tier, report) = machine.tier();
    if tier != Tier::Interpreter {
        match &report.refused {
            Some(reason) => say_error!("machine code            none: {reason}"),
            None => {
                say_error!("machine code  {:>14} functions", report.functions);
                say_error!("  size        {:>14} bytes", report.bytes);
                say_error!("  making it   {:>14.3} ms", milliseconds(report.nanoseconds));
            }
        }
    }
}

/// Prints figures of the snapshots of a durable run.
pub(crate) fn print_snapshots(figures: SnapshotFigures) {
    say_error!("snapshots     {:>14}", figures.taken);
    say_error!("  longest     {:>14.3} ms", figures.longest.as_secs_f64() * 1e3);
}

/// Prints the functions that have used most ticks.
pub(crate) fn print_functions(profile: &Profile) {
    let milliseconds = |used: UsedResources| used.nanoseconds as f64 / 1e6;
    say_error!("\n{:>14} {:>14} {:>12} {:>12}  function", "own ticks", "with calls", "own ms", "with calls");
    for function in profile.functions().iter().take(SHOWN_FUNCTIONS) {
        let ProfiledFunction { name, own, total } = function;
        let (own_time, time) = (milliseconds(*own), milliseconds(*total));
        say_error!("{:>14} {:>14} {own_time:>12.3} {time:>12.3}  {name}", own.ticks, total.ticks);
    }
}

/// Prints the figures of tasks.
pub(crate) fn print_tasks(machine: &Vm) {
    say_error!("\n{:>14} {:>10} {:>8}  {:<9}  task", "ticks", "turns", "stack", "status");
    for task in machine.task_figures() {
        say_error!(
            "{:>14} {:>10} {:>8}  {:<9}  {}",
            task.ticks,
            task.turns,
            task.stack,
            task.status,
            task.name
        );
    }
}
