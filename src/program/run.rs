//! Machines that have the library, and running programs on them.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_compiler::session::Compiler;
use esl_host::{Host, ProcessSignal};
use esl_vm::explore::Settings;
use esl_vm::heap::HeapStats;
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use super::Program;
use crate::error::Error;
use crate::module_path::ModulePath;

/// Way in which a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The program came to its end, or asked to end with this status.
    Normally(u8),
    /// A failure left the main task.
    Failed,
    /// A failure for want of memory left the main task.
    HeapExhausted,
    /// The budget of the run is spent.
    BudgetSpent,
    /// Every task waits for an event that no task can signal.
    Deadlocked,
    /// A signal of the process has ended the run.
    Signalled(ProcessSignal),
}

impl Ended {
    /// Status of a run that came to its end.
    pub const SUCCESS: u8 = 0;
    /// Status of a run whose main task a failure left.
    pub const FAILED: u8 = 1;
    /// Status of a run in which no task can ever run again.
    pub const DEADLOCKED: u8 = 4;
    /// Status of a run that has spent its budget, or needs more memory than it may have.
    pub const BUDGET_OR_MEMORY_SPENT: u8 = 5;
    /// Status of a run that a signal has ended, less the number of the signal, as shells report it.
    pub const SIGNALLED: u8 = 128;

    /// Returns the exit status of a command whose run has ended so.
    ///
    /// ```
    /// use esl::host::ProcessSignal;
    /// use esl::program::Ended;
    ///
    /// assert_eq!(Ended::Normally(7).exit_status(), 7);
    /// assert_eq!(Ended::Signalled(ProcessSignal::Terminate).exit_status(), 143);
    /// ```
    pub fn exit_status(self) -> u8 {
        match self {
            Ended::Normally(status) => status,
            Ended::Failed => Ended::FAILED,
            Ended::Deadlocked => Ended::DEADLOCKED,
            Ended::BudgetSpent | Ended::HeapExhausted => Ended::BUDGET_OR_MEMORY_SPENT,
            Ended::Signalled(signal) => Ended::SIGNALLED + signal.number(),
        }
    }
}

/// Figures of a run.
///
/// ```
/// use esl::Config;
/// use esl::host::VirtualHost;
/// use esl::program::{Ended, Source, compile, run};
///
/// let program = compile(&[Source::new("two.esl", "(spawn (sleep 1))")]).program.expect("it compiles");
/// let summary = run(&program, Config::default(), Box::new(VirtualHost::new()))?;
/// assert_eq!((summary.ended, summary.tasks), (Ended::Normally(0), 2));
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Summary {
    /// Way in which the run ended.
    pub ended: Ended,
    /// Report of the failure or the deadlock that has ended it.
    pub report: Option<String>,
    /// Ticks of all tasks.
    pub ticks: u64,
    /// Tasks made, the main task included.
    pub tasks: u64,
    /// Turns of tasks.
    pub turns: u64,
    /// Turns that came after a turn of another task.
    pub switches: u64,
    /// Figures of the heap.
    pub heap: HeapStats,
}

/// Creates a machine with the library, and with a compiler for `eval` and `load`.
///
/// # Errors
/// [`Error::NoMemory`], if the limit of memory leaves no room for the library.
pub fn machine(config: Config, host: Box<dyn Host + Send>) -> Result<Vm, Error> {
    // The library is loaded at full speed; the settings count from the program on.
    let unhurried =
        Config { slice: Config::DEFAULT.slice, budget: None, collect_always: false, ..config.clone() };
    let mut machine = Vm::new(unhurried, host).map_err(|_| Error::NoMemory("the library"))?;
    machine.set_compiler(Box::new(Compiler::default()));
    esl_stdlib::load(&mut machine).map_err(|_| Error::NoMemory("the library"))?;
    #[cfg(feature = "world")]
    esl_world::install_modules(&mut machine);
    machine.begin_program(config);
    Ok(machine)
}

/// Has a machine write to its error output what happens to `failures`, `goals` or `tasks`. Nothing changes if
/// `traces` is empty.
///
/// # Errors
/// [`Error::NoMemory`].
pub fn set_traces(machine: &mut Vm, traces: &[String]) -> Result<(), Error> {
    if traces.is_empty() {
        return Ok(());
    }
    let keyword = |name: &String| Datum::symbol(Symbol::keyword(&name.to_uppercase()), Span::default());
    call_with_list(machine, "%SET-TRACES", traces.iter().map(keyword))?;
    machine.trace_tasks(traces.iter().any(|name| name == "tasks"));
    Ok(())
}

/// Has `require` search the folders of `path`, and tells the program its file.
///
/// # Errors
/// [`Error::NoMemory`].
pub fn set_module_path(machine: &mut Vm, path: &ModulePath) -> Result<(), Error> {
    let folders: Vec<String> =
        path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
    set_module_folders(machine, &folders)?;
    set_program_file(machine, &path.program_file())
}

/// Tells the program the names of its file, as [`ModulePath::program_file`] returns them.
///
/// # Errors
/// [`Error::NoMemory`].
pub fn set_program_file(machine: &mut Vm, names: &[String]) -> Result<(), Error> {
    if names.is_empty() {
        return Ok(());
    }
    call_with_list(
        machine,
        "%SET-PROGRAM-FILE",
        names.iter().map(|name| Datum::string(name, Span::default())),
    )
}

/// Has `require` search these folders.
///
/// # Errors
/// [`Error::NoMemory`].
pub fn set_module_folders(machine: &mut Vm, folders: &[String]) -> Result<(), Error> {
    let folders = folders.iter().map(|folder| Datum::string(folder, Span::default()));
    call_with_list(machine, "%SET-MODULE-PATH", folders)
}

/// Has a program begin with facts and variables of an earlier run: `data` are a number of milliseconds since
/// then, and texts of lists, as `stdlib/durable.esl` reads them.
///
/// # Errors
/// [`Error::NoMemory`], and those of a call, if a text cannot be read.
pub fn set_kept(machine: &mut Vm, data: impl Iterator<Item = Datum>) -> Result<(), Error> {
    call_with_list(machine, "%SET-KEPT", data)
}

/// Notes that a machine only compiles a program, so that messages about rights name no option of a run.
///
/// # Errors
/// [`Error::NoMemory`].
pub(super) fn only_compile(machine: &mut Vm) -> Result<(), Error> {
    call_with_list(machine, "%ONLY-COMPILE", std::iter::empty())
}

/// Calls a function of the library with a list of `items`.
fn call_with_list(machine: &mut Vm, function: &str, items: impl Iterator<Item = Datum>) -> Result<(), Error> {
    let list = Datum::list(items.collect::<Vec<_>>(), Span::default());
    let list = machine.import(&list).map_err(|_| Error::NoMemory("the settings"))?;
    let function = machine.library_function(function)?;
    machine.call_without_budget(function, &[list], u64::MAX)?;
    Ok(())
}

/// Runs a program to its end.
///
/// # Errors
/// [`Error::NoMemory`] or [`Error::Refused`], if the program cannot be begun. A program that fails returns
/// [`Ended::Failed`].
pub fn run(program: &Program, config: Config, host: Box<dyn Host + Send>) -> Result<Summary, Error> {
    let mut machine = machine(config, host)?;
    run_in(&mut machine, program)
}

/// Loads a program into a machine that has the library, and makes its main task. Running the machine runs it.
///
/// # Errors
/// As [`run`].
pub fn begin(machine: &mut Vm, program: &Program) -> Result<TaskId, Error> {
    begin_with(machine, program, "%RUN-TOPLEVEL", &[])
}

/// Loads a program into a machine that has the library, and returns the functions of its top-level forms.
///
/// # Errors
/// As [`run`].
pub fn load(machine: &mut Vm, program: &Program) -> Result<Value, Error> {
    Ok(machine.load_module(&program.module)?)
}

/// Loads a program, and makes a main task that calls a function of the library with the functions of the
/// program's top-level forms and further arguments.
///
/// # Errors
/// As [`run`].
pub fn begin_with(
    machine: &mut Vm,
    program: &Program,
    function: &str,
    further: &[Datum],
) -> Result<TaskId, Error> {
    let mut arguments = vec![load(machine, program)?];
    for datum in further {
        arguments.push(machine.import(datum).map_err(|_| Error::NoMemory("an argument"))?);
    }
    let main = machine.spawn_library(function, &arguments)?;
    machine.set_interruptible(Some(main));
    machine.set_main(main);
    Ok(main)
}

/// Runs a program in a machine that has the library.
///
/// # Errors
/// As [`run`].
pub fn run_in(machine: &mut Vm, program: &Program) -> Result<Summary, Error> {
    run_as(machine, program, |machine| machine.run(u64::MAX))
}

/// Runs a program in a machine that has the library, by a list of choices that an exploration with these
/// settings has found.
///
/// # Errors
/// As [`run`].
pub fn run_by(
    machine: &mut Vm,
    program: &Program,
    settings: &Settings,
    choices: &[u32],
) -> Result<Summary, Error> {
    run_as(machine, program, |machine| machine.follow(settings, choices))
}

/// Runs a program as [`run_in`] does, in portions of so many ticks, which changes nothing in the run, and
/// calls `inspect` after each.
///
/// # Errors
/// As [`run`].
pub fn run_in_portions(
    machine: &mut Vm,
    program: &Program,
    ticks: u64,
    inspect: &mut dyn FnMut(&mut Vm),
) -> Result<Summary, Error> {
    run_as(machine, program, |machine| {
        loop {
            let outcome = machine.run(ticks);
            inspect(machine);
            if outcome != RunOutcome::TicksUsed {
                return outcome;
            }
        }
    })
}

/// Runs a program to its end as `turns` lets its tasks take turns.
fn run_as(
    machine: &mut Vm,
    program: &Program,
    turns: impl FnOnce(&mut Vm) -> RunOutcome,
) -> Result<Summary, Error> {
    let main = begin(machine, program)?;
    let outcome = turns(machine);
    Ok(finish(machine, main, outcome))
}

/// Ends a run that [`begin`] has begun, when the machine has come back from running it with any outcome but
/// [`RunOutcome::TicksUsed`]: reports what is to be reported, aborts the tasks that are left, and runs their
/// cleanups.
pub fn finish(machine: &mut Vm, main: TaskId, outcome: RunOutcome) -> Summary {
    let report = machine.report(main);
    let ended = end(machine, main, outcome);
    let report = report.or_else(|| (ended == Ended::Deadlocked).then(|| machine.deadlock_report()));
    end_rest(machine);
    let (tasks, turns, switches) = machine.tasks_turns_and_switches();
    Summary { ended, report, ticks: machine.ticks(), tasks, turns, switches, heap: machine.heap_stats() }
}

/// Aborts the tasks that are left at the end of a run, runs their cleanups, and says what does not end.
pub fn end_rest(machine: &mut Vm) {
    let left = machine.end_run();
    machine.flush();
    if !left.is_empty() {
        let lines: Vec<String> = left.iter().map(|left| format!("  {left}\n")).collect();
        machine.complain(&format!("The end of the run was cut short. Unfinished tasks:\n{}", lines.concat()));
    }
}

/// Returns how a program with this main task has ended, and writes the reports of its failure or deadlock.
pub fn end(machine: &mut Vm, main: TaskId, outcome: RunOutcome) -> Ended {
    machine.flush();
    if let Some(report) = machine.report(main) {
        machine.complain(&report);
    }
    let result = machine.result(main);
    if let Some(signal) = machine.ended_by()
        && machine.exit_status().is_none()
        && !matches!(result, TaskResult::Failed(_))
    {
        return Ended::Signalled(signal);
    }
    match (outcome, result) {
        (RunOutcome::BudgetSpent, _) => Ended::BudgetSpent,
        (RunOutcome::Waiting, _) => {
            let report = machine.deadlock_report();
            machine.complain(&report);
            Ended::Deadlocked
        }
        (_, TaskResult::Failed(condition)) if machine.is_heap_exhausted(condition) => Ended::HeapExhausted,
        (_, TaskResult::Failed(_)) => Ended::Failed,
        (_, TaskResult::Aborted) if machine.exit_status().is_none() => Ended::Failed,
        _ => Ended::Normally(machine.exit_status().unwrap_or(0)),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use esl_host::{Inbox, Inspection, Survey, SurveyRequest, VirtualHost};
    use esl_vm::observe::{Observer, Seen};
    use esl_vm::task::TaskNumber;

    use super::*;
    use crate::program::{Source, compile};
    use esl_vm::embed::HostFunction;

    #[test]
    fn an_end_ends_though_cleanups_make_tasks_that_have_cleanups() {
        for pause in ["(sleep 1)", "(dotimes (i 3) (sleep 0))"] {
            let text = format!(
                "(defun work () (unwind-protect (sleep 100) (spawn (work)) (spawn (work)) {pause}))
                 (spawn (work))
                 (sleep 1)
                 (error \"over\")"
            );
            let program = compile(&[Source::new("chain.esl", &*text)]).program.expect("it compiles");
            let config = Config { cleanup_ticks: 10_000, ..Config::DEFAULT };
            let summary = run(&program, config, Box::new(VirtualHost::new())).expect("it runs");
            assert_eq!(summary.ended, Ended::Failed, "{pause}");
        }
    }

    #[test]
    fn what_a_program_leaves_in_a_machine_is_not_the_next_ones() {
        let ends = |text: &str, machine: &mut Vm| {
            let program = compile(&[Source::new("next.esl", text)]).program.expect("it compiles");
            machine.begin_program(Config::DEFAULT);
            run_in(machine, &program).expect("it runs").ended
        };
        let host = VirtualHost::new();
        let captured = host.captured();
        let mut machine = machine(Config::DEFAULT, Box::new(host)).expect("there is room");
        let started = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&started);
        let keep = move |operation| kept.lock().expect("nobody panics").push(operation);
        machine.add_host_function("DRIVE", HostFunction::Operation(Box::new(keep)));
        // It never ends, and no task waits for its end.
        let leaves = "(on-signal :hup (print 'hung-up)) (esl::%begin-operation 'drive () t) (exit 7)";
        assert_eq!(ends(leaves, &mut machine), Ended::Normally(7));
        assert_eq!(started.lock().expect("nobody panics").len(), 1);
        for _ in 0..2 {
            assert_eq!(ends("(wait-for-event (make-event 'bell))", &mut machine), Ended::Deadlocked);
        }
        assert!(captured.error().contains("waits for event BELL"), "{}", captured.error());
        assert_eq!(ends("(print 1)", &mut machine), Ended::Normally(0));
        // The awaited end may come, although an earlier program has begun the operation.
        let waits =
            "(defvar *h* (esl::%begin-operation 'drive () t)) (with-timeout 5 (operation-result *h*))";
        assert_eq!(ends(waits, &mut machine), Ended::Failed);
        let waits = "(wait-for-events (list (symbol-value '*h*) (make-event)) :timeout 5)";
        assert_eq!(ends(waits, &mut machine), Ended::Failed);
    }

    /// Surveys the machine whenever something happens.
    struct Onlooker {
        inbox: Inbox,
        seen: Arc<Mutex<Vec<Survey>>>,
        surveys: u64,
    }

    impl Observer for Onlooker {
        fn see(&mut self, _: u64, _: TaskNumber, _: Seen<'_>) {
            self.surveys += 1;
            let request = SurveyRequest {
                tasks: 100,
                data: true,
                facts: Some((String::new(), 0)),
                frames_of: Some(self.surveys % 9),
                failures_after: Some(0),
                ..SurveyRequest::default()
            };
            let seen = self.seen.clone();
            let tell = Box::new(move |survey| seen.lock().expect("nobody panics").push(survey));
            self.inbox.inspect(Inspection::Survey(request, tell));
        }
    }

    #[test]
    fn surveys_change_nothing() {
        let text = "(define-property mode ())
            (define-input news :capacity 2)
            (define-resource arm)
            (assert '(mode calm))
            (spawn (:name 'worker) (with-resource (arm) (sleep 2) (ignore-errors (fail :slip 7))))
            (spawn (:name 'rival) (sleep 1) (with-resource (arm) (assert '(mode busy))))
            (dotimes (i 30) (signal news i) (sleep 0.1) (princ (random 10)) (dotimes (j 3000)))";
        let program = compile(&[Source::new("looked-at.esl", text)]).program.expect("it compiles");
        let canary = |is_watched: bool| {
            let host = VirtualHost::new();
            let captured = host.captured();
            let mut machine = machine(Config::DEFAULT, Box::new(host)).expect("there is room");
            let seen = Arc::default();
            if is_watched {
                machine.keep_journal();
                machine.gather_figures(true);
                let onlooker = Onlooker { inbox: machine.inbox(), seen: Arc::clone(&seen), surveys: 0 };
                machine.coming_observers().add(Box::new(onlooker));
                machine.inbox().inspect(Inspection::Watch);
            }
            let summary = run_in(&mut machine, &program).expect("it runs");
            assert_eq!(summary.ended, Ended::Normally(0), "{}", captured.error());
            let seen = std::mem::take(&mut *seen.lock().expect("nobody panics"));
            (machine.canary(), captured.output(), seen)
        };
        let (alone, output, _) = canary(false);
        let (watched, same, seen) = canary(true);
        assert_eq!((alone, output), (watched, same));
        let rival = seen
            .iter()
            .flat_map(|survey| &survey.tasks)
            .find(|row| row.waits_for.as_deref() == Some("resource ARM, held by task WORKER"));
        let worker = seen.iter().flat_map(|survey| &survey.tasks).find(|row| row.name == "task WORKER");
        assert_eq!(rival.map(|row| row.held_by.clone()), worker.map(|row| vec![row.number]));
        let last = seen.last().expect("it was looked at");
        assert_eq!((last.inputs[0].name.as_str(), last.inputs[0].kept), ("NEWS", 2));
        assert!(seen.iter().any(|survey| survey.facts == ["(MODE CALM)"]), "{seen:?}");
    }

    #[test]
    fn what_cleanups_may_take_can_be_set() {
        let text =
            "(let ((task (spawn (unwind-protect (loop) (dotimes (i 5000)) (princ 'a) (sleep 5) (princ 'b)))))
                      (sleep 0)
                      (abort-task task)
                      (princ 'over))";
        let output = |config: Config| {
            let program = compile(&[Source::new("cleanup.esl", text)]).program.expect("it compiles");
            let host = VirtualHost::new();
            let captured = host.captured();
            run(&program, config, Box::new(host)).expect("it runs");
            captured.output()
        };
        assert_eq!(output(Config::DEFAULT), "ABOVER");
        assert_eq!(output(Config { cleanup_ticks: 1000, ..Config::DEFAULT }), "OVER");
        assert_eq!(output(Config { cleanup_time: 1_000_000_000, ..Config::DEFAULT }), "AOVER");
    }
}
