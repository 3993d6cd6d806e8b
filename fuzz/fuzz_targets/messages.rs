//! Takes bytes as the definition of a message of ROS 2 and as payloads: no panic, no more memory than a
//! multiple of them, and a message that has been read is the same when it is written and read again.
#![no_main]

use std::sync::OnceLock;

use esl_robots::message::{Types, noise};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    static TYPES: OnceLock<Types> = OnceLock::new();
    noise::understand(TYPES.get_or_init(Types::bundled), bytes);
});
