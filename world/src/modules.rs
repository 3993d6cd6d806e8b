//! The modules: their texts, the functions of the host that they call, and how a machine finds both. A
//! program adds those of other crates.

use std::sync::{PoisonError, RwLock};

use esl_host::{HostModule, HostRows, Inbox, definitions};
use esl_vm::vm::Vm;

use crate::{file, os, process, socket};

/// The modules.
const MODULES: &[HostModule] = &[
    #[cfg(feature = "http")]
    HostModule { name: "http", text: include_str!("../modules/http.esl"), rows: crate::http::rows },
    HostModule { name: "json", text: include_str!("../modules/json.esl"), rows: HostRows::new },
    HostModule { name: "log", text: include_str!("../modules/log.esl"), rows: HostRows::new },
    #[cfg(feature = "mqtt")]
    HostModule { name: "mqtt", text: include_str!("../modules/mqtt.esl"), rows: crate::mqtt::rows },
    HostModule { name: "os", text: include_str!("../modules/os.esl"), rows: os::rows },
    HostModule { name: "process", text: include_str!("../modules/process.esl"), rows: process::rows },
    #[cfg(feature = "serial")]
    HostModule { name: "serial", text: include_str!("../modules/serial.esl"), rows: crate::serial::rows },
    HostModule { name: "sockets", text: include_str!("../modules/sockets.esl"), rows: socket::rows },
    HostModule { name: "time", text: include_str!("../modules/time.esl"), rows: os::clock_rows },
    #[cfg(feature = "http")]
    HostModule { name: "ws", text: include_str!("../modules/ws.esl"), rows: crate::ws::rows },
];

/// Functions that the library itself calls, by their names.
const OF_THE_LIBRARY: &[fn(&Inbox) -> HostRows] = &[
    file::rows,
    #[cfg(feature = "watch")]
    crate::watch::rows,
];

/// The modules of other crates.
static ADDED: RwLock<Vec<&'static HostModule>> = RwLock::new(Vec::new());

/// Modules of crates that a program may lack, and the feature of the commands that adds them. Those that
/// begin with such a name and a hyphen are parts of them.
const OPTIONAL: &[(&str, &str)] =
    &[("fleet", "robots"), ("mavlink", "robots"), ("mcap", "robots"), ("ros", "robots"), ("zenoh", "robots")];

/// Adds modules of other crates for all machines that this process makes from now on, and for its
/// compilations. A module in place of an earlier one of its name wins.
///
/// ```
/// use esl_host::{HostModule, HostRows};
///
/// static MODULES: &[HostModule] = &[HostModule {
///     name: "arm",
///     text: "(defpackage :arm\n  (:use :esl))",
///     rows: HostRows::new,
/// }];
/// esl_world::add_modules(MODULES);
/// assert!(esl_world::module("ARM").is_some());
/// ```
pub fn add_modules(modules: &'static [HostModule]) {
    let mut added = ADDED.write().unwrap_or_else(PoisonError::into_inner);
    added.retain(|known| !modules.iter().any(|module| module.name == known.name));
    added.extend(modules);
}

/// Returns all modules.
fn modules() -> Vec<&'static HostModule> {
    let added = ADDED.read().unwrap_or_else(PoisonError::into_inner);
    let own = MODULES.iter().filter(|own| !added.iter().any(|module| module.name == own.name));
    own.chain(added.iter().copied()).collect()
}

fn find(name: &str) -> Option<&'static HostModule> {
    modules().into_iter().find(|module| module.name.eq_ignore_ascii_case(name))
}

/// Returns the feature of the commands that adds the module of this name, in any case.
pub fn feature_with_module(name: &str) -> Option<&'static str> {
    let whole = name.split('-').next().unwrap_or(name);
    let (_, feature) = OPTIONAL.iter().find(|(known, _)| known.eq_ignore_ascii_case(whole))?;
    Some(feature)
}

/// Returns the feature of the commands that adds the module of this name, in any case, if this process lacks
/// it.
pub fn feature_of_module(name: &str) -> Option<&'static str> {
    feature_with_module(name).filter(|_| find(name).is_none())
}

/// Returns the text of the module of this name, in any case.
pub fn module(name: &str) -> Option<&'static str> {
    find(name).map(|module| module.text)
}

/// Returns the names of the modules.
pub fn module_names() -> impl Iterator<Item = &'static str> {
    modules().into_iter().map(|module| module.name)
}

/// Has `require` find the modules when the program runs, and their texts find the functions that they call.
/// Adds the functions that reach nothing outside.
pub(crate) fn install(machine: &mut Vm) {
    let inbox = machine.inbox();
    let mut rows = HostRows::new(&inbox);
    rows.at_once("%MODULE-TEXT", ["name"], "Returns the text of a module, or NIL.", |name: String| {
        Ok(module(&name))
    })
    .local();
    rows.at_once(
        "%FEATURE-OF-MODULE",
        ["name"],
        "Returns the feature of the commands that adds a module that is missing, or NIL.",
        |name: String| Ok(feature_of_module(&name)),
    )
    .local();
    let for_definitions = inbox.clone();
    rows.at_once(
        "%HOST-FUNCTIONS",
        ["name"],
        "Returns the definitions of the functions that a module calls.",
        move |name: String| {
            let module = find(&name);
            Ok(module.map(|module| definitions(&(module.rows)(&for_definitions))))
        },
    )
    .local();
    rows.at_once("%TIME-NOW", [], "Returns NIL: the program's clock tells the time.", || Ok(None::<f64>))
        .local();
    rows.into_iter().for_each(|row| machine.add_host_row(row));
    let everywhere = all_rows(&inbox).filter(|row| row.is_everywhere);
    everywhere.for_each(|row| machine.add_host_row(row));
}

/// Adds the functions that reach the real world. They replace those of [`install`] too: functions of a module
/// may share what one of them sets.
pub(crate) fn install_operations(machine: &mut Vm) {
    let inbox = machine.inbox();
    all_rows(&inbox).for_each(|row| machine.add_host_row(row));
}

/// Returns the functions of all modules and of the library.
fn all_rows(inbox: &Inbox) -> impl Iterator<Item = esl_host::HostRow> {
    let makers = OF_THE_LIBRARY.iter().copied().chain(modules().into_iter().map(|module| module.rows));
    makers.flat_map(move |rows| rows(inbox))
}

#[cfg(test)]
mod tests {
    use esl_host::unused_functions;

    use super::*;

    #[test]
    fn modules_begin_with_a_package_of_their_name() {
        for HostModule { name, text, .. } in MODULES {
            assert!(text.contains(&format!("(defpackage :{name}\n")), "{name}");
            assert!(module(&name.to_uppercase()).is_some());
        }
        assert!(module("none").is_none());
    }

    #[test]
    fn modules_of_other_crates_are_found_and_replace_earlier_ones() {
        static FIRST: &[HostModule] = &[
            HostModule { name: "gripper", text: "first", rows: HostRows::new },
            HostModule { name: "wheel", text: "wheel", rows: HostRows::new },
        ];
        static SECOND: &[HostModule] = &[HostModule { name: "gripper", text: "second", rows: HostRows::new }];
        assert_eq!(module("gripper"), None);
        add_modules(FIRST);
        add_modules(SECOND);
        assert_eq!((module("gripper"), module("Wheel")), (Some("second"), Some("wheel")));
        assert_eq!(module_names().filter(|name| *name == "gripper").count(), 1);
        assert!(module("json").is_some());
    }

    #[test]
    fn a_missing_module_of_a_feature_names_the_feature() {
        assert_eq!((feature_of_module("ROS"), feature_of_module("json")), (Some("robots"), None));
        assert_eq!((feature_of_module("no-such-module"), feature_of_module("rosary")), (None, None));
        assert_eq!(feature_of_module("mavlink-missions"), Some("robots"));
    }

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        assert_eq!(unused_functions(MODULES), [""; 0]);
    }
}
