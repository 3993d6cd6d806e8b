//! Compiles a text as a program: compiled code passes the verifier and runs without harm.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Some(module) = esl_conformance::anything::compile(text) {
        assert!(esl_conformance::anything::run(&module));
    }
});
