//! Any bytes as a file of MCAP.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    esl_robots::mcap::noise::understand(bytes);
});
