//! The library in a Rust program.

mod calls;
mod depth;
mod loops;
mod operations;
mod questions;
mod replays;
mod things;
mod vectors;

use std::time::Duration;

use esl::engine::Operation;
use esl::host::RealHost;
use esl::{Config, Data, Engine};

/// Returns an engine whose time is real and whose output is dropped.
fn engine() -> Engine {
    let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
    Engine::with(Config::default(), Box::new(host)).expect("there is room for the library")
}

#[track_caller]
fn check(engine: &mut Engine, text: &str, expected: &str) {
    match engine.eval(text) {
        Ok(value) => assert_eq!(value.to_string(), expected, "{text}"),
        Err(error) => panic!("{text}: {error}"),
    }
}

/// Defines `(lag milliseconds value)`, an operation that another thread completes after a time.
fn define_lag(engine: &mut Engine) {
    let begin = |operation: Operation| {
        std::thread::spawn(move || {
            let call = operation.call().clone();
            let time = call.get::<u32>("milliseconds").expect("the test passes an integer");
            std::thread::sleep(Duration::from_millis(time.into()));
            operation.complete(call.get::<Data>("value").expect("there is a value"));
        });
    };
    engine.define_operation("LAG", "(milliseconds &optional value)", "Lags.", begin).expect("it compiles");
}
