//! An agent that is awake: its machine, on a thread of its own, until it sleeps or ends.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use esl::program::{self, Program};
use esl_durable::{DurableError, DurableOptions, DurableRun, KeptFacts, RunRest};
use esl_host::{Host, Incoming, RealHost};
use esl_replay::RunSetup;
use esl_vm::run::RunOutcome;
use esl_vm::vm::{Tier, Vm};

use super::error::AgentError;
use super::folder::{agent_folder, read_arguments, write_arguments};
use super::host::{AwakeAgent, HostTable};
use super::mailbox::AgentMailbox;
use super::origin::AgentOrigin;
use super::outside::{AgentOutside, AwakeFlags};

/// Things missing in the facts of an earlier run that are named.
const LEFT_OUT: usize = 5;

/// An agent that is to begin.
#[derive(Clone, Copy)]
pub struct NewAgent<'a> {
    /// Its program.
    pub program: &'a Program,
    /// The arguments of the program.
    pub arguments: &'a [String],
    /// Its settings.
    pub setup: &'a RunSetup,
    /// Source of the program, to read again if the agent has to begin anew, with its facts, in another
    /// version of the machine; without it, that is not possible.
    pub origin: Option<&'a AgentOrigin>,
}

/// Begins an agent in the folder of a host, which need not be there. It takes its first turn when a host
/// finds it, or is asked to start it. `prepare` gives its machine the functions of the outside, as that of
/// the host.
///
/// # Errors
/// [`AgentError`].
pub fn begin_agent(
    folder: &Path,
    name: &str,
    agent: NewAgent<'_>,
    prepare: impl FnOnce(&mut Vm),
) -> Result<(), AgentError> {
    let path = agent_folder(folder, name)?;
    let run = DurableRun::open(&path, DurableOptions::default())?;
    if run.found().is_some() {
        return Err(AgentError::Exists(name.into()));
    }
    begin_run(&run, agent, prepare)?;
    let noted = write_arguments(&path, agent.arguments);
    let noted = noted.and_then(|()| agent.origin.map_or(Ok(()), |origin| origin.note(&path)));
    noted.map_err(|error| AgentError::Folder(path, error))
}

/// Begins a run, which is put off before its first turn.
fn begin_run(run: &DurableRun, agent: NewAgent<'_>, prepare: impl FnOnce(&mut Vm)) -> Result<(), AgentError> {
    let NewAgent { program, arguments, setup, origin: _ } = agent;
    let host = Box::new(run.host(RealHost::new(arguments.to_vec())));
    let config = run.config(setup.config.clone());
    let mut machine = program::machine(config, host).map_err(DurableError::Machine)?;
    // That part of the library makes upgrades.
    program::load_operators(&mut machine).map_err(DurableError::Machine)?;
    prepare(&mut machine);
    run.prepare(&mut machine)?;
    run.begin(program, setup, &machine)?;
    run.put_off(&machine)?;
    Ok(())
}

/// Begins the run of an agent anew, with its facts, where another version of the machine has begun it.
fn begin_anew(
    shared: &HostTable,
    name: &str,
    path: &Path,
    run: &DurableRun,
    kept: &KeptFacts,
) -> Result<(), AgentError> {
    let origin = AgentOrigin::of(path).ok_or(AgentError::NoOrigin)?;
    let (program, arguments, setup) = (origin.program()?, read_arguments(path), origin.setup());
    let agent = NewAgent { program: &program, arguments: &arguments, setup: &setup, origin: None };
    begin_run(run, agent, |machine| shared.prepare(machine))?;
    shared.report(name, &format!(
        "begun by another version of eslvm, and begins anew with {} facts and {} variables, as {:.1} s ago; its files \
         are in {}",
        kept.facts,
        kept.variables,
        kept.seconds,
        kept.earlier.display()
    ));
    kept.left_out.iter().take(LEFT_OUT).for_each(|what| shared.report(name, &format!("missing: {what}")));
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
    let mut run = DurableRun::open_found(&path, shared.settings.durable)?;
    if let Some(kept) = run.kept_facts() {
        begin_anew(shared, name, &path, &run, kept)?;
        drop(run);
        run = DurableRun::open_found(&path, shared.settings.durable)?;
    }
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
    shared.note_open(
        name,
        AwakeAgent { control: run.control(), inbox, flags: flags.clone(), range: run.range() },
    );
    let made = run.go_on(outside, |machine| shared.prepare(machine));
    if let (Err(DurableError::AddressesTaken), Some(range)) = (&made, run.range()) {
        shared.make_room(name, range);
    }
    let (mut machine, main) = made?;
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
