//! Durable runs that C embeds: killed at any place, they go on in the next process where they were.

use std::ffi::{c_char, c_void};
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ::esl_durable::{
    Downtime, DurableControl, DurableEnding, DurableEngine, DurableError, DurableOptions, DurableSettings,
};
use esl::Config;
use esl::engine::HostDefinition;
use esl::host::RealHost;
use esl::module_path::ModulePath;
use esl::program::Source;

use crate::border::{freeing, give, guarded, hand, look, store, take, text};
use crate::config::{Settings, esl_config};
use crate::failure::{Fault, esl_failure};
use crate::fork::Process;
use crate::function::{UserData, call_function, esl_destructor, esl_function, no_callback};
use crate::handle::esl_handle;
use crate::operation::{esl_operation, esl_operation_function};
use crate::status::esl_status::{
    self, ESL_BUSY, ESL_DIVERGED, ESL_ENDED, ESL_INVALID_ARGUMENT, ESL_NOT_DURABLE, ESL_UNREADABLE,
};

/// A durable run: a program whose state is kept in a folder. It is made, given its functions, opened with its
/// program, and run; all of that in the same way in each process. From all threads.
pub struct esl_durable {
    stage: Mutex<Stage>,
    process: Process,
}

/// The stage of a durable run in this process.
pub(crate) enum Stage {
    /// It gets its functions.
    Preparing(Box<Preparation>),
    /// It can be run.
    Open(Box<DurableEngine>, DurableControl),
    /// A thread runs it.
    Running(DurableControl),
    /// It was run, or could not be opened.
    Over(Option<DurableControl>),
}

/// The settings and functions of a durable run, before it is opened.
pub(crate) struct Preparation {
    folder: PathBuf,
    machine: Config,
    host: RealHost,
    pub(crate) options: DurableOptions,
    functions: Vec<HostDefinition>,
    pub(crate) upgrades: bool,
}

/// The effect of making a call of a function twice. It decides about a call that the end of a process has
/// interrupted.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum esl_effect {
    /// It may not be made twice: the call fails with `:INTERRUPTED-BY-RESTART`, unless its operation has
    /// saved a state.
    ESL_ONCE = 0,
    /// It only reads, or the second time changes nothing: the next process makes the call again.
    ESL_IDEMPOTENT = 1,
}

use esl_effect::*;

/// The end of a durable run in this process.
#[repr(C)]
pub struct esl_durable_ending {
    /// Whether it was paused: the next process goes on.
    pub is_paused: bool,
    /// The exit status of a run that has ended, now or in an earlier process.
    pub exit_status: u8,
}

impl From<DurableError> for Fault {
    fn from(error: DurableError) -> Fault {
        let status = match error {
            DurableError::Machine(error) => return error.into(),
            DurableError::Diverged(_) => ESL_DIVERGED,
            _ => ESL_NOT_DURABLE,
        };
        Fault::new(status, error.to_string())
    }
}

impl esl_durable {
    /// Returns the stage of the run that C names.
    ///
    /// # Errors
    /// A fault.
    ///
    /// # Safety
    /// The pointer is null, or to a durable run that is not freed meanwhile.
    pub(crate) unsafe fn lock<'a>(durable: *const esl_durable) -> Result<MutexGuard<'a, Stage>, Fault> {
        // SAFETY: each pointer is null, or to what C holds and lends.
        let durable = unsafe { look(durable) }?;
        durable.process.check()?;
        // Each stage is whole, so a panic elsewhere does not corrupt it.
        Ok(durable.stage.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Returns the fault of a call that comes at another stage.
fn too_late() -> Fault {
    Fault::new(ESL_INVALID_ARGUMENT, "the durable run is open: it gets its functions and settings before")
}

impl Stage {
    pub(crate) fn preparation(&mut self) -> Result<&mut Preparation, Fault> {
        match self {
            Stage::Preparing(preparation) => Ok(preparation),
            _ => Err(too_late()),
        }
    }

    /// Returns the control, once the run is open.
    fn control(&self) -> Option<&DurableControl> {
        match self {
            Stage::Preparing(_) => None,
            Stage::Open(_, control) | Stage::Running(control) => Some(control),
            Stage::Over(control) => control.as_ref(),
        }
    }

    fn take_preparation(&mut self) -> Result<Preparation, Fault> {
        match std::mem::replace(self, Stage::Over(None)) {
            Stage::Preparing(preparation) => Ok(*preparation),
            other => {
                *self = other;
                Err(too_late())
            }
        }
    }
}

/// Creates a durable run whose state is in a folder, which is made if there is none. `config` may be null;
/// one that records or replays is refused, since a durable run keeps a journal of its own. Limits and seed
/// are the same in each process.
///
/// # Safety
/// `folder` ends with a null character; `config` is settings, or null; `durable` and `failure` are places
/// that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_new(
    folder: *const c_char,
    config: *const esl_config,
    durable: *mut *mut esl_durable,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let folder = PathBuf::from(text(folder, "folder")?);
            let settings = Settings::of(config)?;
            if settings.is_recorded || settings.replayed.is_some() || settings.ticks.is_some() {
                return Err(Fault::new(
                    ESL_INVALID_ARGUMENT,
                    "a durable run keeps a journal of its own: it takes no recording, and no ticks of evaluations",
                ));
            }
            let mut options = DurableOptions::default();
            if settings.has_virtual_time {
                options.downtime = Downtime::Stops;
            }
            let host = settings.real_host();
            let machine = settings.machine;
            let (functions, upgrades) = (Vec::new(), false);
            let preparation = Preparation { folder, machine, host, options, functions, upgrades };
            let stage = Mutex::new(Stage::Preparing(Box::new(preparation)));
            hand(durable, esl_durable { stage, process: Process::this() });
            Ok(())
        })
    }
}

/// Frees a durable run; null is ignored. One that was not run to its end goes on in the next process. Returns
/// `ESL_BUSY`, and frees nothing, while a thread runs it.
///
/// # Safety
/// `durable` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_free(durable: *mut esl_durable) -> esl_status {
    if durable.is_null() {
        return esl_status::ESL_OK;
    }
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            if !look(durable)?.process.is_this() {
                // Its tasks are those of the parent.
                std::mem::forget(take(durable)?);
                return Ok(());
            }
            let is_running = matches!(&*esl_durable::lock(durable)?, Stage::Running(_));
            if is_running {
                return Err(busy());
            }
            let taken = take(durable)?;
            freeing(|| drop(taken));
            Ok(())
        })
    }
}

fn busy() -> Fault {
    Fault::new(ESL_BUSY, "a thread runs the durable run: pause it, and wait for the end of `esl_durable_run`")
}

/// Adds a function before the run is opened.
///
/// # Safety
/// The pointer is null, or to a durable run that is not freed meanwhile.
unsafe fn add(
    durable: *const esl_durable,
    effect: esl_effect,
    definition: HostDefinition,
) -> Result<(), Fault> {
    let definition = match effect {
        ESL_ONCE => definition,
        ESL_IDEMPOTENT => definition.idempotent(),
    };
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { esl_durable::lock(durable) }?.preparation()?.functions.push(definition);
    Ok(())
}

/// Gives a durable run a function of C before it is opened, as `esl_define` gives one to an engine: the same
/// ones in each process.
///
/// # Safety
/// `durable` is a durable run; the texts end with null characters; `function` and `destructor` can be called
/// with `user` on the thread that runs it; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_define(
    durable: *const esl_durable,
    name: *const c_char,
    lambda_list: *const c_char,
    documentation: *const c_char,
    effect: esl_effect,
    function: esl_function,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (name, lambda_list) = (text(name, "name")?, text(lambda_list, "lambda list")?);
            let documentation = text(documentation, "documentation")?;
            let function = function.ok_or_else(no_callback)?;
            let call = move |call: esl::engine::Call| call_function(function, &user, &call);
            add(durable, effect, HostDefinition::at_once(name, lambda_list, documentation, call))
        })
    }
}

/// Gives a durable run a function whose calls are operations, as `esl_durable_define` gives functions. An
/// operation that the end of a process has interrupted is begun again if it has saved a state
/// (`esl_operation_save`), or if its effect is `ESL_IDEMPOTENT`.
///
/// # Safety
/// As for `esl_durable_define`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_define_operation(
    durable: *const esl_durable,
    name: *const c_char,
    lambda_list: *const c_char,
    documentation: *const c_char,
    effect: esl_effect,
    begin: esl_operation_function,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends; `begin` gets the pointer that came with it.
    unsafe {
        guarded(failure, || {
            let (name, lambda_list) = (text(name, "name")?, text(lambda_list, "lambda list")?);
            let documentation = text(documentation, "documentation")?;
            let begin = begin.ok_or_else(no_callback)?;
            let perform = move |operation| {
                let user: &UserData = &user;
                begin(user.pointer, give(esl_operation::new(operation)));
            };
            add(durable, effect, HostDefinition::operation(name, lambda_list, documentation, perform))
        })
    }
}

/// Opens a run with its program.
///
/// # Safety
/// The pointer is null, or to a durable run that is not freed meanwhile.
unsafe fn open(durable: *const esl_durable, source: Source, path: ModulePath) -> Result<(), Fault> {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let mut stage = unsafe { esl_durable::lock(durable) }?;
    let Preparation { folder, machine, host, options, functions, upgrades } = stage.take_preparation()?;
    let settings =
        DurableSettings { durable: options, config: machine, host: Some(host), functions, path, upgrades };
    let engine = DurableEngine::open(&folder, &[source], settings, esl::host::HostRows::new)?;
    let control = engine.control();
    *stage = Stage::Open(Box::new(engine), control);
    Ok(())
}

/// Opens a durable run with its program, a text: begins it, or goes on where an earlier process was. Nothing
/// runs yet. `name` is that of the text in reports. A folder that another process has, that is damaged, or
/// that has the run of another program is refused with `ESL_NOT_DURABLE`; the message says what to do.
///
/// # Safety
/// `durable` is a durable run; the texts end with null characters; `failure` is a place that can be written,
/// or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_open(
    durable: *const esl_durable,
    name: *const c_char,
    text: *const c_char,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let source = Source::new(self::text(name, "name")?, self::text(text, "text")?);
            open(durable, source, ModulePath::none())
        })
    }
}

/// As `esl_durable_open`, with the program in a source file. `require` finds modules beside it.
///
/// # Safety
/// As for `esl_durable_open`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_load(
    durable: *const esl_durable,
    path: *const c_char,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let path = text(path, "path")?;
            let source = std::fs::read_to_string(path)
                .map_err(|error| Fault::new(ESL_UNREADABLE, format!("`{path}` cannot be read: {error}")))?;
            open(durable, Source::new(path, source), ModulePath::new([Path::new(path)], &[]))
        })
    }
}

/// Creates a handle of a durable run that is open and does not run yet. While a program has a handle, it
/// waits for messages by it, which are in the journal before an effect depends on them.
///
/// # Safety
/// `durable` is a durable run; `handle` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_handle(
    durable: *const esl_durable,
    handle: *mut *mut esl_handle,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || match &*esl_durable::lock(durable)? {
            Stage::Open(engine, _) => {
                hand(handle, esl_handle(engine.handle()));
                Ok(())
            }
            Stage::Running(_) => Err(busy()),
            Stage::Preparing(_) => Err(not_open()),
            Stage::Over(_) => Err(over()),
        })
    }
}

fn not_open() -> Fault {
    Fault::new(ESL_INVALID_ARGUMENT, "the durable run is not open: call `esl_durable_open` before")
}

fn over() -> Fault {
    Fault::new(ESL_ENDED, "the durable run is over in this process: make another one of the folder")
}

/// Runs a durable run that is open until it ends or is paused. Waits while all tasks wait. The functions of
/// the program are called on this thread.
///
/// # Safety
/// `durable` is a durable run; `ending` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_run(
    durable: *const esl_durable,
    ending: *mut esl_durable_ending,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (engine, control) = {
                let mut stage = esl_durable::lock(durable)?;
                match std::mem::replace(&mut *stage, Stage::Over(None)) {
                    Stage::Open(engine, control) => {
                        *stage = Stage::Running(control.clone());
                        (engine, control)
                    }
                    other => {
                        let fault = match &other {
                            Stage::Preparing(_) => not_open(),
                            Stage::Running(_) => busy(),
                            _ => over(),
                        };
                        *stage = other;
                        return Err(fault);
                    }
                }
            };
            let ended = (*engine).run();
            *esl_durable::lock(durable)? = Stage::Over(Some(control));
            let (is_paused, exit_status) = match ended? {
                DurableEnding::Paused => (true, 0),
                DurableEnding::Ended(status) => (false, status),
            };
            store(ending, esl_durable_ending { is_paused, exit_status });
            Ok(())
        })
    }
}

/// Has `esl_durable_run` leave the run, so that it goes on in the next process. From any thread.
///
/// # Safety
/// `durable` is a durable run; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_pause(
    durable: *const esl_durable,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            esl_durable::lock(durable)?.control().ok_or_else(not_open)?.pause();
            Ok(())
        })
    }
}

/// Returns the number of the process in which the run goes on, from 2; 0 while it has not gone on: it began
/// in this process, or repeats its journal. Stores the seconds since the last record of the one before.
///
/// # Safety
/// `durable` is a durable run; `downtime` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_resumed(durable: *const esl_durable, downtime: *mut f64) -> u64 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        let Ok(stage) = esl_durable::lock(durable) else { return 0 };
        let Some(resumed) = stage.control().and_then(DurableControl::resumed) else { return 0 };
        store(downtime, resumed.downtime);
        resumed.life.number
    }
}
