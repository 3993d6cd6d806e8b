//! `--realtime`: settings of the process, for a run that reacts in time.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Write};

use esl_command::say_error;
use esl_vm::realtime::{LockedMemory, keep_memory, lock_memory, set_priority, set_timer_slack, touch_stack};

/// Bytes of the stack of the machine's thread that are touched before the run.
const STACK: usize = 1 << 20;

/// Most bytes of memory that are touched before the run, for objects to come.
const HEADROOM: usize = 64 << 20;

/// Has this thread and this process react in time, as far as the system permits it, and reports each refusal.
/// The objects of the run have at most so many bytes.
pub(super) fn react_in_time(priority: u8, memory: usize) {
    keep_memory(memory.min(HEADROOM));
    touch_stack(STACK);
    match lock_memory() {
        Ok(LockedMemory::All) => {}
        Ok(LockedMemory::Present(limit)) => say(format_args!(
            "memory that the run takes later is not locked: the system permits {} KiB; `ulimit -l unlimited` \
             raises it",
            limit >> 10
        )),
        Err(error) => {
            say(format_args!("memory is not locked: {error}; `ulimit -l unlimited` raises the limit"));
        }
    }
    if let Err(error) = set_priority(priority) {
        say(format_args!("the priority is not set: {error}; `ulimit -r {priority}` permits it"));
    }
    set_timer_slack();
    match keep_processors_awake() {
        // The system has them awake as long as the file is open.
        Ok(file) => std::mem::forget(file),
        // A machine whose processors do not sleep has no such file.
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => say(format_args!("idle processors may sleep deeply: {PROCESSORS}: {error}")),
    }
}

/// Where Linux takes the longest time in microseconds that a processor may need to wake.
const PROCESSORS: &str = "/dev/cpu_dma_latency";

fn keep_processors_awake() -> io::Result<File> {
    let mut file = File::options().write(true).open(PROCESSORS)?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

fn say(text: impl Display) {
    say_error!("eslvm: --realtime: {text}");
}
