//! The commands `eslvm` and `eslc` within the extension module, so that a wheel has the machine once: the
//! starter in `packaging/starter.c` opens the module as a library, without Python, and calls [`esl_command`].

// Only the name of the function, by which the starter finds it: nothing else defines it.
#![allow(unsafe_code)]

use std::panic;
use std::process;

/// Runs the command line of the process, and ends the process. A panic on any thread ends it too, as in the
/// commands that are programs of their own.
#[unsafe(no_mangle)]
pub extern "C" fn esl_command() -> ! {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        report(panic);
        process::abort();
    }));
    process::exit(i32::from(eslvm::main()))
}
