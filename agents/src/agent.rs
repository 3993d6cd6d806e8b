//! An agent that is awake: its machine, on a thread of its own, until it sleeps or ends.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use esl::program::{self, Program};
use esl_durable::{DurableError, DurableOptions, DurableRun, RunRest};
use esl_host::{Host, Incoming, RealHost};
use esl_replay::RunSetup;
use esl_vm::run::RunOutcome;
use esl_vm::vm::{Tier, Vm};

use super::error::AgentError;
use super::folder::{agent_folder, read_arguments, write_arguments};
use super::host::HostTable;
use super::mailbox::AgentMailbox;
use super::outside::{AgentOutside, AwakeFlags};

/// Begins an agent in the folder of a host, which need not be there. It takes its first turn when a host
/// finds it, or is asked to start it. `prepare` gives its machine the functions of the outside, as that of
/// the host.
///
/// # Errors
/// [`AgentError`].
pub fn begin_agent(
    folder: &Path,
    name: &str,
    (program, arguments): (&Program, &[String]),
    setup: &RunSetup,
    prepare: impl FnOnce(&mut Vm),
) -> Result<(), AgentError> {
    let path = agent_folder(folder, name)?;
    let run = DurableRun::open(&path, DurableOptions::default())?;
    if run.found().is_some() {
        return Err(AgentError::Exists(name.into()));
    }
    write_arguments(&path, arguments).map_err(|error| AgentError::Folder(path, error))?;
    let host = Box::new(run.host(RealHost::new(arguments.to_vec())));
    let config = run.config(setup.config.clone());
    let mut machine = program::machine(config, host).map_err(DurableError::Machine)?;
    // That part of the library makes upgrades.
    program::load_operators(&mut machine).map_err(DurableError::Machine)?;
    prepare(&mut machine);
    run.begin(program, setup, &machine)?;
    run.put_off()?;
    Ok(())
}

/// Runs an agent until it sleeps, or its run is over. Returns how it rests.
///
/// # Errors
/// [`AgentError`].
pub(crate) fn run_agent(
    shared: &Arc<HostTable>,
    name: &Arc<str>,
    mailbox: &Arc<AgentMailbox>,
) -> Result<RunRest, AgentError> {
    let flags = Arc::<AwakeFlags>::default();
    let rest = run_awake(shared, name, mailbox, &flags);
    // The machine is gone, which may have taken letters at last.
    let mut under_way = flags.under_way();
    if rest.is_ok() {
        under_way.answer_taken();
    }
    mailbox.put_back(std::mem::take(&mut under_way.delivered));
    rest
}

fn run_awake(
    shared: &Arc<HostTable>,
    name: &Arc<str>,
    mailbox: &Arc<AgentMailbox>,
    flags: &Arc<AwakeFlags>,
) -> Result<RunRest, AgentError> {
    let path = agent_folder(&shared.folder, name)?;
    let run = DurableRun::open(&path, shared.settings.durable)?;
    run.warnings().iter().for_each(|warning| shared.report(name, warning));
    if let Some(status) = run.ended() {
        return Ok(RunRest::Ended(status));
    }
    let beginning = run.found().ok_or(DurableError::NoBeginning)?;
    let arguments = run.arguments().map_or_else(|| read_arguments(&path), <[String]>::to_vec);
    let rights = beginning.folders.iter().fold(shared.settings.rights.clone(), |rights, folder| {
        // As `eslvm run` does: a program may load its modules.
        rights.with_modules(folder.as_str())
    });
    let screen = {
        let (shared, name) = (shared.clone(), name.clone());
        Box::new(move |bytes: &[u8]| {
            shared.print(&name, bytes);
            Ok(())
        })
    };
    let host = RealHost::new(arguments).with_rights(rights).with_elapsed(run.elapsed()).with_screen(screen);
    let inbox = host.inbox();
    inbox.put(Incoming::Hosted);
    let outside = AgentOutside::new(host, mailbox.clone(), &run, shared.rule.clone(), flags.clone());
    let warned = (shared.clone(), name.clone());
    run.control().on_warning(move |warning| warned.0.report(&warned.1, warning));
    shared.note_open(name, run.control(), inbox);
    let (mut machine, main) = run.go_on(outside, |machine| shared.prepare(machine))?;
    machine.set_tier(Tier::Auto);
    let control = run.control();
    let outcome = loop {
        let outcome = machine.run(u64::MAX);
        run.check()?;
        let comes_back = outcome == RunOutcome::Stopped && !control.is_pausing();
        if !comes_back || !flags.may_sleep.swap(false, Ordering::Relaxed) {
            break outcome;
        }
        if is_free(&machine, &run) {
            if mailbox.is_empty() && machine.next_turn() != Some(0) {
                control.pause();
            }
        } else if flags.refusals.fetch_add(1, Ordering::Relaxed) == 0 {
            shared.note_tied(name);
        }
    };
    if control.begin_end() {
        if is_free(&machine, &run) {
            return Ok(run.sleep(&mut machine)?);
        }
        // It goes on at once, and hears that its ties are gone.
        run.pause(&machine)?;
        return Ok(RunRest::Asleep(Some(i64::MIN)));
    }
    flags.is_ending.store(true, Ordering::Relaxed);
    let summary = program::finish(&mut machine, main, outcome);
    run.check()?;
    let status = summary.ended.exit_status();
    run.end(&machine, status)?;
    Ok(RunRest::Ended(status))
}

/// Returns whether the run has no ties to this process.
fn is_free(machine: &Vm, run: &DurableRun) -> bool {
    !machine.is_tied_to_process() && !run.journal().has_open_calls()
}
