//! A text as a program: what compiles passes the verifier, and runs without harm.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Some(module) = esl_conformance::anything::compile(text) {
        assert!(esl_conformance::anything::run(&module));
    }
});
