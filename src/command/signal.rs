//! Signals of the operating system, passed on to the machine: the first one asks the run to end.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_vm::host::{Inbox, Incoming, ProcessSignal};

use super::{SIGNALLED, complain};

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
    let all = [ProcessSignal::HangUp, ProcessSignal::Interrupt, ProcessSignal::Terminate];
    on_signal(&all, move |signal| {
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
    /// Has signals put into this inbox from now on, and those that nobody has taken so far.
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
    let interrupts = AtomicUsize::new(0);
    let all = [ProcessSignal::HangUp, ProcessSignal::Interrupt, ProcessSignal::Terminate];
    on_signal(&all, move |signal| {
        let inbox = target.lock();
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

/// Calls `handler` on a thread of its own with each of these signals that comes.
#[cfg(unix)]
fn on_signal(signals: &[ProcessSignal], handler: impl Fn(ProcessSignal) + Send + 'static) {
    let signals = signals.to_vec();
    let numbers: Vec<i32> = signals.iter().map(|signal| signal.number().into()).collect();
    // Without a handler a signal ends the process at once, which is the next best thing.
    let Ok(mut coming) = signal_hook::iterator::Signals::new(numbers) else { return };
    let pass_on = move || {
        for number in coming.forever() {
            signals
                .iter()
                .filter(|signal| i32::from(signal.number()) == number)
                .for_each(|&signal| handler(signal));
        }
    };
    drop(std::thread::Builder::new().name("signals".into()).spawn(pass_on));
}

/// Calls `handler` on a thread of its own with each Ctrl-C.
#[cfg(not(unix))]
fn on_signal(_signals: &[ProcessSignal], handler: impl Fn(ProcessSignal) + Send + 'static) {
    // Without a handler Ctrl-C ends the process at once, which is the next best thing.
    drop(ctrlc::set_handler(move || handler(ProcessSignal::Interrupt)));
}
