//! What robots speak, for programs in ESL: modules over Zenoh, and messages of ROS 2.
//!
//! ```
//! esl_world::add_modules(esl_robots::MODULES);
//! ```
#![forbid(unsafe_code)]

pub mod message;

use esl_host::HostModule;

/// The modules.
pub const MODULES: &[HostModule] = &[];
