//! A durable run that a program in Rust embeds.

use std::path::Path;

use esl::engine::{Handle, HostDefinition};
use esl::module_path::ModulePath;
use esl::program::{self, Compiled, Modules, Source};
use esl_compiler::diagnostic::Sources;
use esl_host::{HostRows, Inbox, RealHost};
use esl_replay::RunSetup;
use esl_vm::task::TaskId;
use esl_vm::vm::{Config, Tier, Vm};

use super::{DurableControl, DurableError, DurableOptions, DurableRun, KeptFacts};

/// Settings of an engine whose run is durable.
#[derive(Default)]
pub struct DurableSettings {
    /// Those of this process of the run.
    pub durable: DurableOptions,
    /// Limits of the machine, the same each time.
    pub config: Config,
    /// The outside; by default the system, without rights. Its clock is set.
    pub host: Option<RealHost>,
    /// Functions with lambda lists, beside those that are declared as rows: the same ones each time.
    pub functions: Vec<HostDefinition>,
    /// Where `require` finds modules.
    pub path: ModulePath,
    /// Whether the run makes the definitions of another version of its program.
    pub upgrades: bool,
}

/// The end of a durable run in this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DurableEnding {
    /// It was paused: the next process goes on.
    Paused,
    /// It has ended with this status.
    Ended(u8),
}

/// A machine whose run is durable, for programs in Rust.
///
/// The program is a text. Rust code gives it functions, as rows or as [`HostDefinition`]s, and reaches it by
/// [`DurableEngine::handle`]: everything goes through the journal. The effect of each function decides about
/// a call that the end of a process has interrupted: an [idempotent](esl_host::HostRow::idempotent) one is
/// made again with the same identity (`HostOperation::action`); the others fail with
/// `:interrupted-by-restart`. An operation that has [saved](esl_host::HostOperation::save) bytes of its own
/// is begun again too, and restores them there.
pub struct DurableEngine {
    run: DurableRun,
    machine: Vm,
    main: TaskId,
    /// The status of a run that has ended in an earlier process.
    ended: Option<u8>,
}

impl DurableEngine {
    /// Begins a run in a folder, or goes on with the run of this folder. `rows` makes the functions of the
    /// host, for the inbox of the machine: the same ones each time.
    ///
    /// # Errors
    /// [`DurableError`]; [`DurableError::Machine`] with [`esl::Error::DoesNotCompile`] for a program with
    /// errors.
    pub fn open(
        folder: &Path,
        sources: &[Source],
        settings: DurableSettings,
        rows: impl FnOnce(&Inbox) -> HostRows,
    ) -> Result<DurableEngine, DurableError> {
        let mut run = DurableRun::open(folder, settings.durable)?;
        let host = settings.host.unwrap_or_else(|| RealHost::new(Vec::new())).with_elapsed(run.elapsed());
        let rows = rows(&esl_host::Host::inbox(&host));
        let functions = settings.functions;
        let variables = HostDefinition::variables(&functions).map_err(DurableError::Machine)?;
        let (given, texts) = compile(sources, &rows, &functions, &settings.path)?;
        let program = run.choose_program(&given, &texts, settings.upgrades)?;
        let config = run.config(settings.config.clone());
        let machine = program::machine(config, Box::new(run.host(host)));
        let mut machine = machine.map_err(DurableError::Machine)?;
        // That part of the library makes upgrades.
        program::load_operators(&mut machine).map_err(DurableError::Machine)?;
        rows.into_iter().for_each(|row| machine.add_host_row(row));
        for (function, variables) in functions.into_iter().zip(variables) {
            function.give_to(&mut machine, variables);
        }
        // A run that goes on looks for modules where it did before.
        let given = || settings.path.folders().iter().map(|folder| folder.to_string_lossy().into_owned());
        let (folders, program_file) = match run.found() {
            Some(found) => (found.folders.clone(), found.program_file.clone()),
            None => (given().collect(), settings.path.program_file()),
        };
        // A copy of the run takes the same steps.
        program::set_module_folders(&mut machine, &folders).map_err(DurableError::Machine)?;
        program::set_program_file(&mut machine, &program_file).map_err(DurableError::Machine)?;
        run.prepare(&mut machine)?;
        let setup = RunSetup { config: settings.config, folders, program_file, ..RunSetup::default() };
        run.begin(&program, &setup, &machine)?;
        machine.set_tier(Tier::Auto);
        let ended = run.ended();
        let main = match run.restore(&mut machine)? {
            Some(main) => main,
            None => program::begin(&mut machine, &program).map_err(DurableError::Machine)?,
        };
        run.take_snapshots(&mut machine);
        Ok(DurableEngine { run, machine, main, ended })
    }

    /// Returns a handle, through which other threads reach the run. While there is one, a program that waits
    /// for an input is not deadlocked.
    pub fn handle(&self) -> Handle {
        Handle::to(&self.machine)
    }

    /// Returns the control, which pauses the run from any thread.
    pub fn control(&self) -> DurableControl {
        self.run.control()
    }

    /// Returns warnings about the files.
    pub fn warnings(&self) -> &[String] {
        self.run.warnings()
    }

    /// Returns the facts from which the run begins anew, if another version of the machine has begun it and
    /// [`DurableOptions::from_facts`] is set.
    pub fn kept_facts(&self) -> Option<&KeptFacts> {
        self.run.kept_facts()
    }

    /// Runs the program until it ends, or is paused. Waits while all tasks wait.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn run(mut self) -> Result<DurableEnding, DurableError> {
        if let Some(status) = self.ended {
            return Ok(DurableEnding::Ended(status));
        }
        let outcome = self.machine.run(u64::MAX);
        self.run.check()?;
        if self.run.control().begin_end() {
            self.run.pause(&self.machine)?;
            return Ok(DurableEnding::Paused);
        }
        let summary = program::finish(&mut self.machine, self.main, outcome);
        self.run.check()?;
        let status = summary.ended.exit_status();
        self.run.end(&self.machine, status)?;
        Ok(DurableEnding::Ended(status))
    }
}

/// Compiles a program after the definitions of the functions of the host.
fn compile(
    sources: &[Source],
    rows: &HostRows,
    functions: &[HostDefinition],
    path: &ModulePath,
) -> Result<(program::Program, Sources), DurableError> {
    let mut definitions: String = rows
        .iter()
        .map(|row| {
            let documentation = row.documentation.replace('\\', "\\\\").replace('"', "\\\"");
            let waits = if row.waits() { "T" } else { "NIL" };
            let parameters = row.parameters.join(" ");
            format!("(esl::%define-host-function {} ({parameters}) \"{documentation}\" {waits})\n", row.name)
        })
        .collect();
    for function in functions {
        definitions += &function.form();
        definitions.push('\n');
    }
    let mut all = vec![Source::new("functions of the host", definitions)];
    all.extend(sources.iter().cloned());
    let Compiled { program, diagnostics, sources, .. } = program::compile_with(&all, path, Modules::Inside);
    let refused = || DurableError::Machine(esl::Error::DoesNotCompile(diagnostics));
    Ok((program.ok_or_else(refused)?, sources))
}
