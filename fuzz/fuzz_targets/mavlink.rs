//! Bytes of a link of MAVLink: as one datagram, and as a stream that is cut anywhere.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    esl_robots::mavlink::noise::feed(bytes);
});
