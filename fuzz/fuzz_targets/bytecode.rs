//! Reads bytes as a compiled file, with corrected checksums: code that the verifier accepts runs without
//! harm.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_conformance::anything::run_file(&esl_conformance::anything::with_checksums(bytes));
});
