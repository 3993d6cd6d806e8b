//! Compiles a text as a program: compiled code passes the verifier and runs without harm.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    esl_conformance::anything::compile_and_run(text);
});
