//! Modules for programs that talk to robots: over Zenoh, with messages of ROS 2.
//!
//! ```
//! esl_world::add_modules(esl_robots::MODULES);
//! ```
#![forbid(unsafe_code)]

pub mod message;

use esl_host::HostModule;

/// The modules.
pub const MODULES: &[HostModule] = &[];
