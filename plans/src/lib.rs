//! Plans in time for programs in ESL: the module `plans`. It consists of texts in ESL alone, so a plan that
//! is executed is part of the state of its machine: it is saved, explored and replayed as any other program
//! is. The module `plans-planners` starts planners, by a program in Python.
#![forbid(unsafe_code)]

use esl_host::{HostModule, HostRows, Inbox};

/// Returns the functions that the module `plans-planners` calls.
fn planner_rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.at_once("%PLANNER-PROGRAM", [], "Returns the program in Python that calls planners.", || {
        Ok(include_str!("../bridge/solve.py"))
    })
    .everywhere();
    rows
}

/// The modules. Those whose names begin with `plans-` are parts of `plans`, which requires them, all but
/// `plans-planners`: programs that use planners require that.
pub const MODULES: &[HostModule] = &[
    HostModule { name: "plans", text: include_str!("../modules/plans.esl"), rows: HostRows::new },
    HostModule {
        name: "plans-activities",
        text: include_str!("../modules/plans-activities.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "plans-control",
        text: include_str!("../modules/plans-control.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "plans-dispatch",
        text: include_str!("../modules/plans-dispatch.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "plans-network",
        text: include_str!("../modules/plans-network.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "plans-order", text: include_str!("../modules/plans-order.esl"), rows: HostRows::new },
    HostModule {
        name: "plans-picture",
        text: include_str!("../modules/plans-picture.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "plans-planners",
        text: include_str!("../modules/plans-planners.esl"),
        rows: planner_rows,
    },
    HostModule {
        name: "plans-relations",
        text: include_str!("../modules/plans-relations.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "plans-repair",
        text: include_str!("../modules/plans-repair.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "plans-tasks", text: include_str!("../modules/plans-tasks.esl"), rows: HostRows::new },
];

#[cfg(test)]
mod tests {
    use esl_host::unused_functions;

    use super::*;

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        assert_eq!(unused_functions(MODULES), [""; 0]);
    }
}
