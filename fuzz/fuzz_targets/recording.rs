//! Reads bytes as a recorded run, as they are and with corrected checksums: no panic, no more memory than a
//! small multiple of them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_conformance::anything::read_recording(bytes);
});
