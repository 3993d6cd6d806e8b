//! Settings of an engine that is to be made.

use std::cell::RefCell;
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::Arc;

use esl::Config;
use esl::host::{Host, NotedRecord, RealHost, Recording, RecordingHost, ReplayHost, Right, Rights};

use crate::border::{freeing, guarded, look, making, take, text};
use crate::failure::{Fault, esl_failure};
use crate::function::{UserData, esl_destructor, no_callback};
use crate::status::esl_status::{self, ESL_INVALID_ARGUMENT};

/// Settings for engines: limits, rights, clock. A new one has the defaults: a gigabyte of memory, no rights,
/// real time. One thread at a time.
pub struct esl_config(pub(crate) RefCell<Settings>);

#[derive(Clone, Default)]
pub(crate) struct Settings {
    pub(crate) machine: Config,
    pub(crate) ticks: Option<u64>,
    rights: Rights,
    pub(crate) has_virtual_time: bool,
    pub(crate) is_recorded: bool,
    pub(crate) replayed: Option<Arc<[NotedRecord]>>,
    output: Option<Arc<OutputOfC>>,
}

/// A function that takes the output of programs. It is called on the threads of engines, with `length` bytes
/// that live until it returns; they are UTF-8, but may begin or end within a character.
pub type esl_output = Option<unsafe extern "C" fn(user: *mut c_void, bytes: *const c_char, length: usize)>;

struct OutputOfC {
    function: unsafe extern "C" fn(user: *mut c_void, bytes: *const c_char, length: usize),
    user: UserData,
}

// SAFETY: `esl_config_set_output` asks for a function that takes the pointer on the threads of all engines.
unsafe impl Sync for OutputOfC {}

impl OutputOfC {
    fn write(&self, bytes: &[u8]) {
        // SAFETY: the embedder has given the function for this pointer; the bytes live until it returns.
        unsafe { (self.function)(self.user.pointer, bytes.as_ptr().cast(), bytes.len()) };
    }
}

impl Settings {
    /// Returns the settings that C holds, or the defaults for null.
    ///
    /// # Safety
    /// The pointer is null, or to settings that are not freed meanwhile.
    pub(crate) unsafe fn of(config: *const esl_config) -> Result<Settings, Fault> {
        if config.is_null() {
            return Ok(Settings::default());
        }
        // SAFETY: each pointer is null, or to what C holds and lends.
        Ok(unsafe { look(config) }?.0.borrow().clone())
    }

    /// Returns the system as these settings let programs see it.
    pub(crate) fn real_host(&self) -> RealHost {
        let mut host = RealHost::new(Vec::new()).with_rights(self.rights.clone());
        if self.has_virtual_time {
            host = host.with_virtual_time();
        }
        if let Some(output) = self.output.clone() {
            host = host.with_screen(Box::new(move |bytes| {
                output.write(bytes);
                Ok(())
            }));
        }
        host
    }

    /// Returns the host of an engine, and what it records or replays.
    pub(crate) fn host(&self) -> (Box<dyn Host + Send>, Memory) {
        if let Some(records) = &self.replayed {
            let mut host = ReplayHost::new(records.clone());
            if let Some(output) = self.output.clone() {
                host = host.with_screen(move |_, bytes| output.write(bytes));
            }
            return (Box::new(host.clone()), Memory::Replayed(host));
        }
        let host = self.real_host();
        if !self.is_recorded {
            return (Box::new(host), Memory::None);
        }
        let host = RecordingHost::new(host);
        let recording = host.recording();
        (Box::new(host), Memory::Recorded(recording))
    }
}

/// The recording that an engine keeps or replays.
pub(crate) enum Memory {
    None,
    Recorded(Recording),
    Replayed(ReplayHost),
}

/// Creates settings with the defaults.
#[unsafe(no_mangle)]
pub extern "C" fn esl_config_new() -> *mut esl_config {
    making(|| Ok(esl_config(RefCell::default())))
}

/// Frees settings; null is ignored. Engines that were made with them keep theirs.
///
/// # Safety
/// `config` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_free(config: *mut esl_config) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(config) }));
}

/// Changes settings.
///
/// # Safety
/// `config` is settings, or null.
pub(crate) unsafe fn change(config: *const esl_config, change: impl FnOnce(&mut Settings)) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            change(&mut look(config)?.0.borrow_mut());
            Ok(())
        })
    }
}

/// Limits the memory of a program, in bytes.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_memory(config: *const esl_config, bytes: usize) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { change(config, |settings| settings.machine.memory = bytes) }
}

/// Limits the ticks (calls and turns of loops) of the whole run.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_budget(config: *const esl_config, ticks: u64) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { change(config, |settings| settings.machine.budget = Some(ticks)) }
}

/// Limits the ticks of each evaluation.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_ticks(config: *const esl_config, ticks: u64) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { change(config, |settings| settings.ticks = Some(ticks)) }
}

/// Sets the seed of all random choices.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_seed(config: *const esl_config, seed: u64) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { change(config, |settings| settings.machine.seed = seed) }
}

/// Makes time virtual, so that it passes only while all tasks wait; or real.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_virtual_time(
    config: *const esl_config,
    is_virtual: bool,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { change(config, |settings| settings.has_virtual_time = is_virtual) }
}

/// Has a function take what programs write, to standard output as well as to standard error, in place of the
/// streams of the process. `user` is freed when neither the settings nor an engine needs it any more; with a
/// status other than `ESL_OK` at once.
///
/// # Safety
/// `config` is settings; `output` and `destructor` can be called with `user` on the threads of all engines
/// that are made with the settings; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_output(
    config: *const esl_config,
    output: esl_output,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let function = output.ok_or_else(no_callback)?;
            look(config)?.0.borrow_mut().output = Some(Arc::new(OutputOfC { function, user }));
            Ok(())
        })
    }
}

/// Grants a right, as the options `--allow-…` of the commands do: "net=127.0.0.1:1883" grants access to that
/// address, "read" to all files. The rights are read, write, net, run, env, serial and fleet.
///
/// # Safety
/// `config` is settings; `right` is a text with a null character at its end; `failure` is a place that can be
/// written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_allow(
    config: *const esl_config,
    right: *const c_char,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let mut settings = look(config)?.0.borrow_mut();
            let text = text(right, "right")?;
            let (name, object) = match text.split_once('=') {
                Some((name, object)) => (name, Some(object)),
                None => (text, None),
            };
            let Some(right) = Right::of_name(name) else {
                let names = Right::ALL.map(Right::name).join(", ");
                let message = format!("`{name}` is not a right: expected one of {names}");
                return Err(Fault::new(ESL_INVALID_ARGUMENT, message));
            };
            let rights = std::mem::take(&mut settings.rights);
            settings.rights = match object {
                Some(object) => rights.with(right, object),
                None => rights.with_all(right),
            };
            Ok(())
        })
    }
}
