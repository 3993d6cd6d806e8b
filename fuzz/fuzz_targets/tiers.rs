//! Reads bytes as a compiled file, with corrected checksums: code that the verifier accepts runs alike by the
//! interpreter and as machine code.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    esl_conformance::anything::run_file_in_tiers(&esl_conformance::anything::with_checksums(bytes));
});
