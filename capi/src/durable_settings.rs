//! Settings of a durable run, before it is opened.

use std::ffi::c_char;

use ::esl_durable::{Downtime, Durability};

use crate::border::{guarded, text};
use crate::durable::esl_durable;
use crate::failure::{Fault, esl_failure};
use crate::status::esl_status::{self, ESL_INVALID_ARGUMENT};

/// Has the run survive loss of power too: it waits for the disk before each effect.
///
/// # Safety
/// `durable` is a durable run that is not open; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_set_power(
    durable: *const esl_durable,
    survives_loss_of_power: bool,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let durability = if survives_loss_of_power { Durability::Power } else { Durability::Process };
            esl_durable::lock(durable)?.preparation()?.options.durability = durability;
            Ok(())
        })
    }
}

/// Has the program's clock stand still between two processes, or count that time, which is the default. A
/// virtual clock stands still.
///
/// # Safety
/// As for `esl_durable_set_power`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_set_downtime(
    durable: *const esl_durable,
    counts: bool,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let downtime = if counts { Downtime::Counts } else { Downtime::Stops };
            esl_durable::lock(durable)?.preparation()?.options.downtime = downtime;
            Ok(())
        })
    }
}

/// Says when snapshots are taken, as `--snapshot-every` does: "60s", "64M" or "never".
///
/// # Safety
/// As for `esl_durable_set_power`; `when` ends with a null character.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_set_snapshots(
    durable: *const esl_durable,
    when: *const c_char,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let when = text(when, "time of snapshots")?;
            let snapshots = when.parse().map_err(|message| Fault::new(ESL_INVALID_ARGUMENT, message))?;
            esl_durable::lock(durable)?.preparation()?.options.snapshots = snapshots;
            Ok(())
        })
    }
}

/// Has a run of another version of the machine begin anew, with its facts and the variables of `defdurable`,
/// as `--from-facts` does. A run of this version goes on.
///
/// # Safety
/// As for `esl_durable_set_power`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_set_from_facts(
    durable: *const esl_durable,
    from_facts: bool,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            esl_durable::lock(durable)?.preparation()?.options.from_facts = from_facts;
            Ok(())
        })
    }
}

/// Has a run whose program has changed make the new definitions before it goes on, as `--upgrade` does.
///
/// # Safety
/// As for `esl_durable_set_power`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_durable_set_upgrade(
    durable: *const esl_durable,
    upgrades: bool,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            esl_durable::lock(durable)?.preparation()?.upgrades = upgrades;
            Ok(())
        })
    }
}
