//! Bytes as a source file: no panic, no wait.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_conformance::anything::read(bytes);
});
