//! The interface to JavaScript: functions of numbers, and one buffer for texts in either direction.
//!
//! A caller reserves the buffer, writes a text in UTF-8 into it, and calls a function; what the function
//! returns is the length of the answer, which then is in the buffer.

// Only the names of the functions: a linker takes them as they are, and nothing else defines them.
#![allow(unsafe_code)]

use std::cell::RefCell;

use serde_json::json;

use crate::{EXAMPLES, Playground};

thread_local! {
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static PLAYGROUND: RefCell<Playground> = RefCell::default();
}

/// Takes the text in the buffer.
fn text() -> String {
    BUFFER.with_borrow_mut(|buffer| String::from_utf8_lossy(&std::mem::take(buffer)).into_owned())
}

/// Puts an answer into the buffer.
fn answer(text: impl ToString) -> usize {
    BUFFER.with_borrow_mut(|buffer| {
        *buffer = text.to_string().into_bytes();
        buffer.len()
    })
}

/// Makes the buffer so many bytes long, and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut u8 {
    BUFFER.with_borrow_mut(|buffer| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// The address of the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn buffer() -> *const u8 {
    BUFFER.with_borrow(|buffer| buffer.as_ptr())
}

/// Compiles the text in the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn check() -> usize {
    let text = text();
    answer(PLAYGROUND.with_borrow(|playground| playground.check(&text)))
}

/// Compiles the text in the buffer and begins to run it: with this seed, and traces if `is_traced` is not 0.
#[unsafe(no_mangle)]
pub extern "C" fn begin(seed: u32, is_traced: u32) -> usize {
    let text = text();
    let traces: &[&str] = if is_traced == 0 { &[] } else { &["failures", "goals"] };
    let traces: Vec<String> = traces.iter().map(ToString::to_string).collect();
    answer(PLAYGROUND.with_borrow_mut(|playground| playground.begin(&text, seed.into(), &traces)))
}

/// Indents the text in the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn format() -> usize {
    let text = text();
    answer(PLAYGROUND.with_borrow(|playground| playground.format(&text)))
}

/// The programs to begin with.
#[unsafe(no_mangle)]
pub extern "C" fn examples() -> usize {
    let examples = EXAMPLES.map(|(title, text)| json!({ "title": title, "text": text }));
    answer(json!(examples))
}

/// Runs so many ticks.
#[unsafe(no_mangle)]
pub extern "C" fn step(ticks: u32) -> usize {
    answer(PLAYGROUND.with_borrow_mut(|playground| playground.step(ticks.into())))
}

/// Has the run end; the steps that follow run its cleanups.
#[unsafe(no_mangle)]
pub extern "C" fn stop() {
    PLAYGROUND.with_borrow_mut(Playground::stop);
}

/// Draws the run.
#[unsafe(no_mangle)]
pub extern "C" fn timeline() -> usize {
    answer(PLAYGROUND.with_borrow(Playground::timeline))
}
