//! Modules for ESL programs that talk to robots: Zenoh, nodes and messages of ROS 2, MAVLink, and
//! files of MCAP.
//!
//! ```
//! esl_world::add_modules(esl_robots::MODULES);
//! ```
#![forbid(unsafe_code)]

pub mod mavlink;
pub mod mcap;
pub mod message;
mod ros;
pub mod run;
mod zenoh;

use esl_host::{HostModule, HostRows, Inbox};

/// Functions of a module that has none of its own.
fn none(inbox: &Inbox) -> HostRows {
    HostRows::new(inbox)
}

/// The modules. Those whose names begin with `ros-` are parts of `ros`, which requires them; so are those of
/// `mavlink-`.
pub const MODULES: &[HostModule] = &[
    HostModule { name: "mavlink", text: include_str!("../modules/mavlink.esl"), rows: mavlink::rows },
    HostModule {
        name: "mavlink-commands",
        text: include_str!("../modules/mavlink-commands.esl"),
        rows: none,
    },
    HostModule {
        name: "mavlink-missions",
        text: include_str!("../modules/mavlink-missions.esl"),
        rows: none,
    },
    HostModule {
        name: "mavlink-parameters",
        text: include_str!("../modules/mavlink-parameters.esl"),
        rows: none,
    },
    HostModule {
        name: "mavlink-transfers",
        text: include_str!("../modules/mavlink-transfers.esl"),
        rows: none,
    },
    HostModule { name: "mavlink-vehicle", text: include_str!("../modules/mavlink-vehicle.esl"), rows: none },
    HostModule { name: "mavlink-worlds", text: include_str!("../modules/mavlink-worlds.esl"), rows: none },
    HostModule { name: "mcap", text: include_str!("../modules/mcap.esl"), rows: self::mcap::rows },
    HostModule { name: "ros", text: include_str!("../modules/ros.esl"), rows: ros::rows },
    HostModule { name: "ros-actions", text: include_str!("../modules/ros-actions.esl"), rows: none },
    HostModule { name: "ros-bags", text: include_str!("../modules/ros-bags.esl"), rows: none },
    HostModule { name: "ros-clock", text: include_str!("../modules/ros-clock.esl"), rows: none },
    HostModule { name: "ros-diagnostics", text: include_str!("../modules/ros-diagnostics.esl"), rows: none },
    HostModule { name: "ros-geometry", text: include_str!("../modules/ros-geometry.esl"), rows: none },
    HostModule { name: "ros-graph", text: include_str!("../modules/ros-graph.esl"), rows: none },
    HostModule { name: "ros-lifecycle", text: include_str!("../modules/ros-lifecycle.esl"), rows: none },
    HostModule { name: "ros-node", text: include_str!("../modules/ros-node.esl"), rows: none },
    HostModule { name: "ros-transforms", text: include_str!("../modules/ros-transforms.esl"), rows: none },
    HostModule { name: "ros-worlds", text: include_str!("../modules/ros-worlds.esl"), rows: none },
    HostModule { name: "zenoh", text: include_str!("../modules/zenoh.esl"), rows: self::zenoh::rows },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        for HostModule { name, text, rows } in MODULES {
            let rows = rows(&Inbox::new());
            let defines = text.contains(&format!("(esl::%define-host-functions \"{name}\")"));
            assert_eq!(defines, rows.iter().next().is_some(), "{name}");
            for row in rows.iter() {
                let call = row.name.to_lowercase();
                let is_called = MODULES.iter().any(|module| module.text.to_lowercase().contains(&call));
                assert!(is_called, "{}", row.name);
                assert!(row.documentation.ends_with('.'), "{}", row.name);
            }
        }
    }
}
