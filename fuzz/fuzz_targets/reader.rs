//! Reads bytes as a source file: no panic, no endless loop.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_conformance::anything::read(bytes);
});
