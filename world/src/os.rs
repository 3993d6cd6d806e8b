//! The process itself, and the time of day.

use std::time::{SystemTime, UNIX_EPOCH};

use esl_host::{HostRows, Inbox, Right};

/// Returns the functions of `:os`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.at_once("%OS-GETENV", ["name"], "Returns the value of a variable of the environment.", getenv)
        .needs(Right::Env, "name")
        .everywhere();
    rows.at_once("%OS-HOSTNAME", [], "Returns the name of the machine.", || Ok(host_name())).everywhere();
    rows.at_once("%OS-PROCESS-ID", [], "Returns the number of the process.", || Ok(std::process::id()))
        .everywhere();
    rows
}

/// Returns the functions of `:time`.
pub(crate) fn clock_rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    let inbox = inbox.clone();
    rows.at_once("%TIME-NOW", [], "Returns the seconds since 1970, UTC.", move || {
        if let Some(told) = inbox.told_time() {
            return Ok(told as f64 / 1e9);
        }
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        Ok(since.map_or_else(|before| -before.duration().as_secs_f64(), |after| after.as_secs_f64()))
    })
    .local();
    rows
}

fn getenv(name: String) -> Result<Option<String>, esl_host::HostFailure> {
    // The system has no variables of other names.
    if name.is_empty() || name.contains(['=', '\0']) {
        return Ok(None);
    }
    Ok(std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
}

#[cfg(unix)]
fn host_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

#[cfg(not(unix))]
fn host_name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}
