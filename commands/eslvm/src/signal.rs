//! Signals of the operating system, passed on to the machine: the first one asks the run to end.
//!
//! Guarantees: of the signals by which the system ends a process that does not handle them, each ends the run
//! with its cleanups, but for SIGKILL and for those that report a fault of the process itself (`FAULTS`).
//! SIGPIPE and SIGXFSZ end nothing: the write fails.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_command::{SIGNALLED, complain};
use esl_host::{Inbox, Incoming, ProcessSignal};

/// Ctrl-C of a session of several evaluations.
pub struct Interrupts {
    /// Whether there was one during the present evaluation.
    was_asked: Arc<AtomicBool>,
}

impl Interrupts {
    /// Forgets the Ctrl-C of an evaluation that is over.
    pub fn forget(&self) {
        self.was_asked.store(false, Ordering::Relaxed);
    }
}

/// Has Ctrl-C interrupt the machine. A second one during the same evaluation ends the process. Other signals
/// end the evaluation, and are passed to `end`.
pub fn interrupt_on_signal(inbox: Inbox, end: impl Fn(ProcessSignal) + Send + 'static) -> Interrupts {
    let was_asked = Arc::new(AtomicBool::new(false));
    let interrupts = Interrupts { was_asked: was_asked.clone() };
    // The line editor has a handler of its own for the size of the terminal.
    on_signal(false, move |signal| {
        if inbox.is_handled(signal) {
            return inbox.put(Incoming::Signal(signal));
        }
        if signal != ProcessSignal::Interrupt {
            end(signal);
            inbox.put(Incoming::Signal(signal));
            return inbox.put(Incoming::Stop);
        }
        if was_asked.swap(true, Ordering::Relaxed) {
            std::process::exit((SIGNALLED + signal.number()).into());
        }
        inbox.put(Incoming::Signal(signal));
    });
    interrupts
}

/// Inbox of the machine that receives the signals of the process: that in which the program is compiled, then
/// that in which it runs.
#[derive(Clone, Default)]
pub struct SignalTarget(Arc<Mutex<Inbox>>);

impl SignalTarget {
    /// Has signals put into this inbox from now on, and moves pending ones to it.
    pub fn set(&self, inbox: Inbox) {
        let mut target = self.lock();
        let left = std::mem::replace(&mut *target, inbox).take();
        for signal in left.into_iter().filter(|left| matches!(left, Incoming::Signal(_))) {
            target.put(signal);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inbox> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Has signals end the compilation or the run, with its cleanups. A second Ctrl-C cuts that short, and a
/// third one ends the process whatever the machine does.
pub fn end_on_signal(target: SignalTarget) {
    end_on_signal_unless(target, |_| false);
}

/// As [`end_on_signal`], but for the signals that `takes` has taken.
pub fn end_on_signal_unless(target: SignalTarget, takes: impl Fn(ProcessSignal) -> bool + Send + 'static) {
    let interrupts = AtomicUsize::new(0);
    on_signal(true, move |signal| {
        let inbox = target.lock();
        if !signal.ends_a_run() && !inbox.is_handled(signal) || !inbox.is_handled(signal) && takes(signal) {
            return;
        }
        if !inbox.is_handled(signal)
            && signal == ProcessSignal::Interrupt
            && interrupts.fetch_add(1, Ordering::Relaxed) > 1
        {
            complain("interrupted");
            std::process::exit((SIGNALLED + signal.number()).into());
        }
        inbox.put(Incoming::Signal(signal));
    });
}

/// Signals that report a fault of the process, after which nothing of it can be relied on: SIGILL, SIGTRAP,
/// SIGBUS, SIGFPE, SIGSEGV. SIGKILL and SIGSTOP cannot be handled.
#[cfg(unix)]
const FAULTS: [i32; 5] = {
    use signal_hook::consts::{SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGTRAP};
    [SIGILL, SIGTRAP, SIGBUS, SIGFPE, SIGSEGV]
};

/// The first of the signals without a meaning of their own, which are handled soon after the others: to add
/// them to those takes as long as a small program.
#[cfg(unix)]
const FIRST_REAL_TIME: i32 = 32;

/// Returns the signal of a number of the system's, if it is to be passed on to the machine.
#[cfg(unix)]
fn signal_of(number: i32) -> Option<ProcessSignal> {
    use signal_hook::consts as known;
    Some(match number {
        known::SIGHUP => ProcessSignal::HangUp,
        known::SIGINT => ProcessSignal::Interrupt,
        known::SIGUSR1 => ProcessSignal::User1,
        known::SIGUSR2 => ProcessSignal::User2,
        known::SIGTERM => ProcessSignal::Terminate,
        known::SIGWINCH => ProcessSignal::Window,
        // The system's default for these is to stop the process, to let it go on, or nothing.
        known::SIGCHLD | known::SIGCONT | known::SIGURG => return None,
        known::SIGSTOP | known::SIGTSTP | known::SIGTTIN | known::SIGTTOU => return None,
        // The write fails, as it does for a full disk.
        known::SIGPIPE | known::SIGXFSZ => return None,
        known::SIGKILL => return None,
        fault if FAULTS.contains(&fault) => return None,
        // The C library keeps 32 and 33 for itself.
        other @ (1..=31 | 34..=64) => ProcessSignal::Other(u8::try_from(other).ok()?),
        _ => return None,
    })
}

/// Calls `handler` on a thread of its own with each signal that comes, of those that are passed on to the
/// machine; SIGWINCH only `with_window`.
#[cfg(unix)]
fn on_signal(with_window: bool, handler: impl Fn(ProcessSignal) + Send + 'static) {
    // A signal without a handler would end the process. Children have the system's own handling again, as
    // they would not if this one were ignored.
    _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
    let is_wanted = move |&number: &i32| {
        signal_of(number).is_some_and(|signal| with_window || signal != ProcessSignal::Window)
    };
    // Without a handler a signal ends the process at once, which is the next best thing.
    let Ok(mut coming) = signal_hook::iterator::Signals::new(std::iter::empty::<i32>()) else { return };
    // The system may not have one.
    (1..FIRST_REAL_TIME).filter(is_wanted).for_each(|number| _ = coming.add_signal(number));
    let pass_on = move || {
        (FIRST_REAL_TIME..=64).filter(is_wanted).for_each(|number| _ = coming.add_signal(number));
        coming.forever().filter_map(signal_of).for_each(handler);
    };
    drop(std::thread::Builder::new().name("signals".into()).spawn(pass_on));
}

/// Calls `handler` on a thread of its own with each Ctrl-C.
#[cfg(not(unix))]
fn on_signal(_with_window: bool, handler: impl Fn(ProcessSignal) + Send + 'static) {
    // Without a handler Ctrl-C ends the process at once, which is the next best thing.
    drop(ctrlc::set_handler(move || handler(ProcessSignal::Interrupt)));
}
