//! `eslvm state`: durable runs, inspected without going on with them.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::Args;
use esl::host::SurveyRequest;
use esl::module_path::ModulePath;
use esl::program::{self, Modules};
use esl_command::{
    NOT_COMPILED, ProgramFile, SUCCESS, USAGE, complain, print_diagnostics, read_program, say, say_part,
    wants_color,
};
use esl_compiler::diagnostic::{Format, Renderer, Sources};
use esl_durable::{DurableError, DurableRun, DurableState, Rehearsal, fork, look, rehearse};

use super::durable::{counted, refused, upgrade_text};
use super::options::LibraryOption;

/// The time of a run before its last record on which an upgrade is tried.
const REHEARSED: Duration = Duration::from_secs(3600);
/// Lines of reports of that which are shown.
const REPORT_LINES: usize = 20;

/// Options of `eslvm state`.
#[derive(Args)]
pub(crate) struct LookOptions {
    /// Show the facts of this relation
    #[arg(long, value_name = "NAME")]
    facts: Option<String>,
    /// Show the tasks as a tree
    #[arg(long, conflicts_with = "facts")]
    tasks: bool,
    /// Show the processes of the run, its pauses and its upgrades
    #[arg(long, conflicts_with_all = ["facts", "tasks"])]
    log: bool,
    /// Show the patches of operators that are in force, the newest first
    #[arg(long, conflicts_with_all = ["facts", "tasks", "log"])]
    patches: bool,
    /// Show the changes of this program, and try an upgrade to it on copies of the run: as it is, and as it
    /// was an hour before its last record, or as long as its journal is kept, with the messages from then on
    #[arg(long, value_name = "PROGRAM", conflicts_with_all = ["facts", "tasks", "log", "patches"])]
    upgrade: Option<std::path::PathBuf>,
    /// Copy the run into this folder: a run of its own, for experiments
    #[arg(long, value_name = "COPY", conflicts_with_all = ["facts", "tasks", "log", "patches", "upgrade"])]
    fork: Option<std::path::PathBuf>,
    /// Copy the run as it was so long before its last record, such as 90s or 2h
    #[arg(long, value_name = "TIME", requires = "fork", value_parser = humantime::parse_duration)]
    back: Option<Duration>,
    #[command(flatten)]
    modules: LibraryOption,
    /// Folder of a durable run
    #[arg(value_name = "FOLDER")]
    folder: std::path::PathBuf,
}

/// Shows a durable run at the end of its journal. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_state(options: &LookOptions) -> Result<u8, u8> {
    if let Some(program) = &options.upgrade {
        return check_upgrade(&options.folder, program, &options.modules.library);
    }
    if let Some(copy) = &options.fork {
        return make_fork(&options.folder, copy, options.back.unwrap_or_default());
    }
    let mut state = look(&options.folder).map_err(|error| refused(&error))?;
    match &options.facts {
        Some(name) => return print_facts(&mut state, name),
        None if options.tasks => print_tasks(&mut state),
        None if options.log => print_log(&state),
        None if options.patches => print_patches(&mut state).map_err(|error| refused(&error))?,
        None => print_state(&mut state),
    }
    Ok(SUCCESS)
}

/// Shows the changes of a program, and tries an upgrade to it on a copy of the run. Returns the exit status.
fn check_upgrade(folder: &Path, file: &Path, library: &[std::path::PathBuf]) -> Result<u8, u8> {
    let refuse = |error: DurableError| refused(&error);
    let run = DurableRun::open_to_look(folder).map_err(refuse)?;
    let (program, sources) = match read_program(file)? {
        ProgramFile::Compiled(program) => (program, Sources::new()),
        ProgramFile::Source(source) => {
            let path = ModulePath::new([file], library);
            let compiled = program::compile_with(&[source], &path, Modules::Inside);
            print_diagnostics(&compiled, &Renderer { color: wants_color(), format: Format::Human });
            (compiled.program.ok_or(NOT_COMPILED)?, compiled.sources)
        }
    };
    let Some(changes) = run.changes_to(&program, &sources).map_err(refuse)? else {
        say!("the run has this program");
        return Ok(SUCCESS);
    };
    say!("{changes}");
    let report = run.try_upgrade(&program, &changes).map_err(refuse)?;
    say!("{}", upgrade_text("on a copy of the run", &report));
    drop(run);
    match rehearse(folder, &program, &sources, REHEARSED) {
        Ok(Some(rehearsal)) => print_rehearsal(&rehearsal),
        Ok(None) => say!("the journal that is kept begins with this program"),
        Err(error) => say!("not tried on the past of the run: {error}"),
    }
    Ok(SUCCESS)
}

/// Prints the course that another program has taken with the last stretch of a run.
fn print_rehearsal(rehearsal: &Rehearsal) {
    let Rehearsal { upgrade, stretch, arrivals, alike, others, named, left_out, errors, ended, .. } =
        rehearsal;
    if arrivals + alike + others + left_out == 0 {
        say!("its past has no messages and no calls to try the program on");
    } else {
        let time = humantime::format_duration(Duration::from_millis(stretch.as_millis() as u64));
        let copy = match upgrade {
            Some(_) => format!("on a copy of the run as it was {time} ago"),
            None => format!("on a run that begins with it, for {time}"),
        };
        say!(
            "{copy}, with the {} that the run had: {} made as by the run, {others} others, {left_out} left out",
            counted(*arrivals, "message"),
            counted(*alike, "call"),
        );
    }
    named.iter().for_each(|(seconds, call)| say!("  after {seconds:.1} s: {call}"));
    if others > &named.len() {
        say!("  and {} more", others - named.len());
    }
    if let Some(status) = ended {
        say!("  the program has ended before that, with status {status}");
    }
    errors.lines().take(REPORT_LINES).for_each(|line| say!("  {line}"));
}

/// Prints the patches that are in force.
fn print_patches(state: &mut DurableState) -> Result<(), DurableError> {
    let patches = state.patches()?;
    if patches.is_empty() {
        say!("no patches are in force");
    }
    for patch in patches {
        let changes = patch.changes.iter().map(|(kind, name)| format!("{kind} {name}"));
        let changes: Vec<String> = changes.collect();
        say!("{}: {}", counted(patch.definitions, "definition"), changes.join(", "));
    }
    Ok(())
}

/// Copies a run as it was. Returns the exit status.
fn make_fork(folder: &Path, copy: &Path, back: Duration) -> Result<u8, u8> {
    let made = fork(folder, copy, back).map_err(|error| refused(&error))?;
    let back = humantime::format_duration(Duration::from_millis(made.back.as_millis() as u64));
    say!(
        "{} has the run as it was {back} before its last record, in process {}; `eslvm run --state` goes on with it",
        copy.display(),
        made.processes
    );
    Ok(SUCCESS)
}

/// Prints the tasks as a tree.
fn print_tasks(state: &mut DurableState) {
    let request = SurveyRequest { tasks: 100_000, ..SurveyRequest::default() };
    say_part!("{}", state.survey(&request).tree_text());
}

/// Prints the processes of the run, its pauses and its upgrades.
fn print_log(state: &DurableState) {
    for life in &state.lives {
        let date = date_of(UNIX_EPOCH + Duration::from_nanos(u64::try_from(life.wall).unwrap_or(0)));
        let event = match (life.is_pause, life.is_asleep) {
            (_, true) => "put to sleep in",
            (true, false) => "paused in",
            (false, false) => "begun by",
        };
        say!("{date}  {event} process {}", life.number);
        if !life.is_pause && state.upgrades.contains(&life.number) {
            say!("{date}  upgraded in process {}", life.number);
        }
    }
}

/// Returns a time as a date of UTC.
fn date_of(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}

/// Prints the facts of a relation. Returns the exit status.
fn print_facts(state: &mut DurableState, name: &str) -> Result<u8, u8> {
    let name = name.to_uppercase();
    let mut count = 0;
    loop {
        let request =
            SurveyRequest { data: true, facts: Some((name.clone(), count)), ..SurveyRequest::default() };
        let survey = state.survey(&request);
        if !survey.relations.iter().any(|relation| relation.name == name) {
            let known: Vec<String> = survey
                .relations
                .iter()
                .map(|relation| format!("`{}`", relation.name.to_lowercase()))
                .collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            complain(format_args!(
                "the run has no facts called `{}`; its relations: {known}",
                name.to_lowercase()
            ));
            return Err(USAGE);
        }
        if survey.facts.is_empty() {
            return Ok(SUCCESS);
        }
        count += survey.facts.len();
        for fact in &survey.facts {
            say!("{fact}");
        }
    }
}

fn print_state(state: &mut DurableState) {
    let survey = state.survey(&SurveyRequest { data: true, ..SurveyRequest::default() });
    let file = state.program_file.first().map_or("standard input", String::as_str);
    let process = state.lives.last().map_or(0, |life| life.number);
    let standing = match (state.ended, state.lives.last()) {
        (Some(status), _) => format!("ended with status {status}"),
        (None, Some(last)) if last.is_asleep => "asleep".into(),
        (None, Some(last)) if last.is_pause => "paused".into(),
        _ => "cut off".into(),
    };
    let facts: usize = survey.relations.iter().map(|relation| relation.facts).sum();
    say!("program: {file}");
    say!("machine: {}", state.identity);
    say!("run: {standing}, tick {}, process {process}", state.ticks);
    say!("tasks: {}", survey.figures.tasks.iter().sum::<u64>());
    say!("facts: {facts} in {} relations", survey.relations.len());
    say!(
        "journal: {} records, {} effects, {} bytes{}",
        state.records,
        state.effects,
        state.bytes,
        if state.torn > 0 { format!(", and {} bytes that are cut off", state.torn) } else { String::new() }
    );
    if state.generation > 0 {
        let from = match state.base {
            0 => "goes on from its beginning".into(),
            base => format!("goes on from snapshot {base}, {} bytes", state.snapshot_bytes),
        };
        say!("generations: {} to {}; {from}", state.oldest, state.generation);
    }
    state.warnings.iter().for_each(|warning| say!("warning: {warning}"));
    if let Some(written) = state.written {
        let since = SystemTime::now().duration_since(written).unwrap_or(Duration::ZERO);
        let since = humantime::format_duration(Duration::from_secs(since.as_secs()));
        say!("written: {}, {since} ago", date_of(written));
    }
    if !state.upgrades.is_empty() {
        say!("upgrades: {}", state.upgrades.len());
    }
    say!("verified: the run takes the course of its journal");
}
