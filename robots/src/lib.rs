//! Modules for ESL programs that talk to robots: Zenoh, nodes and messages of ROS 2, MAVLink, and
//! files of MCAP.
//!
//! ```
//! esl_world::add_modules(esl_robots::MODULES);
//! ```
#![forbid(unsafe_code)]

mod lease_clock;
pub mod mavlink;
pub mod mcap;
pub mod message;
mod ros;
pub mod run;
mod zenoh;

use esl_host::{HostModule, HostRows};

pub use self::zenoh::defaults::{AgentDefaults, AgentDefaultsError};

/// The modules. Those whose names begin with `ros-` are parts of `ros`, which requires them; so are those of
/// `mavlink-` and `fleet-`.
pub const MODULES: &[HostModule] = &[
    HostModule { name: "fleet", text: include_str!("../modules/fleet.esl"), rows: HostRows::new },
    HostModule {
        name: "fleet-auctions",
        text: include_str!("../modules/fleet-auctions.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "fleet-etcd",
        text: include_str!("../modules/fleet-etcd.esl"),
        rows: lease_clock::rows,
    },
    HostModule { name: "fleet-facts", text: include_str!("../modules/fleet-facts.esl"), rows: HostRows::new },
    HostModule {
        name: "fleet-leases",
        text: include_str!("../modules/fleet-leases.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "fleet-offers",
        text: include_str!("../modules/fleet-offers.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "fleet-picture",
        text: include_str!("../modules/fleet-picture.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "fleet-requests",
        text: include_str!("../modules/fleet-requests.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "fleet-worlds",
        text: include_str!("../modules/fleet-worlds.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "fleet-zenoh", text: include_str!("../modules/fleet-zenoh.esl"), rows: HostRows::new },
    HostModule { name: "mavlink", text: include_str!("../modules/mavlink.esl"), rows: mavlink::rows },
    HostModule {
        name: "mavlink-commands",
        text: include_str!("../modules/mavlink-commands.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "mavlink-missions",
        text: include_str!("../modules/mavlink-missions.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "mavlink-parameters",
        text: include_str!("../modules/mavlink-parameters.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "mavlink-transfers",
        text: include_str!("../modules/mavlink-transfers.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "mavlink-vehicle",
        text: include_str!("../modules/mavlink-vehicle.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "mavlink-worlds",
        text: include_str!("../modules/mavlink-worlds.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "mcap", text: include_str!("../modules/mcap.esl"), rows: self::mcap::rows },
    HostModule { name: "ros", text: include_str!("../modules/ros.esl"), rows: ros::rows },
    HostModule { name: "ros-actions", text: include_str!("../modules/ros-actions.esl"), rows: HostRows::new },
    HostModule { name: "ros-bags", text: include_str!("../modules/ros-bags.esl"), rows: HostRows::new },
    HostModule { name: "ros-bonds", text: include_str!("../modules/ros-bonds.esl"), rows: HostRows::new },
    HostModule { name: "ros-clock", text: include_str!("../modules/ros-clock.esl"), rows: HostRows::new },
    HostModule {
        name: "ros-diagnostics",
        text: include_str!("../modules/ros-diagnostics.esl"),
        rows: HostRows::new,
    },
    HostModule {
        name: "ros-geometry",
        text: include_str!("../modules/ros-geometry.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "ros-graph", text: include_str!("../modules/ros-graph.esl"), rows: HostRows::new },
    HostModule {
        name: "ros-lifecycle",
        text: include_str!("../modules/ros-lifecycle.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "ros-node", text: include_str!("../modules/ros-node.esl"), rows: HostRows::new },
    HostModule {
        name: "ros-transforms",
        text: include_str!("../modules/ros-transforms.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "ros-worlds", text: include_str!("../modules/ros-worlds.esl"), rows: HostRows::new },
    HostModule { name: "zenoh", text: include_str!("../modules/zenoh.esl"), rows: self::zenoh::rows },
];

#[cfg(test)]
mod tests {
    use esl_host::unused_functions;

    use super::*;

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        assert_eq!(unused_functions(MODULES), [""; 0]);
    }

    #[test]
    fn the_machine_knows_these_modules_without_them() {
        let feature = |module: &HostModule| esl_world::feature_with_module(module.name);
        assert!(MODULES.iter().all(|module| feature(module) == Some("robots")));
    }
}
