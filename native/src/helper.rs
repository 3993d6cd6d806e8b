//! A thread that makes machine code, so that nothing waits for it.
//!
//! It is given copies of what is translated, and knows nothing of the machine. It ends when its owner is
//! dropped; machine code that was not taken is released.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

use esl_heap::realtime;

use crate::maker::{MachineCode, MachineCodeMaker, NativeSource, NotMade};

/// Bytes of the thread's stack.
const STACK: usize = 4 << 20;

/// The outcome of an order.
#[derive(Debug)]
pub struct MadeCode {
    /// Number of the order.
    pub order: u64,
    /// The machine code.
    pub result: Result<MachineCode, NotMade>,
    /// How long it took.
    pub duration: Duration,
}

/// Makes machine code on a thread of its own, in the order in which it is asked for.
#[derive(Debug)]
pub struct MachineCodeHelper {
    orders: Sender<(u64, NativeSource)>,
    made: Receiver<MadeCode>,
}

impl MachineCodeHelper {
    /// Starts the thread.
    ///
    /// # Errors
    /// [`NotMade::Unsupported`] if there is no thread to be had.
    pub fn start() -> Result<MachineCodeHelper, NotMade> {
        let (orders, work) = channel();
        let (finished, made) = channel();
        thread::Builder::new()
            .name("machine code".into())
            .stack_size(STACK)
            .spawn(move || {
                realtime::join_below();
                make_all(&work, &finished);
            })
            .map_err(|error| NotMade::Unsupported(format!("there is no thread for it: {error}")))?;
        Ok(MachineCodeHelper { orders, made })
    }

    /// Asks for machine code; the number tells orders apart.
    pub fn ask(&self, order: u64, source: NativeSource) {
        // A thread that has ended makes nothing, which is as good as being slow.
        let _ = self.orders.send((order, source));
    }

    /// Returns something that was made, if there is anything.
    pub fn take(&self) -> Option<MadeCode> {
        self.made.try_recv().ok()
    }
}

fn make_all(orders: &Receiver<(u64, NativeSource)>, finished: &Sender<MadeCode>) {
    let mut maker = MachineCodeMaker::new();
    while let Ok((order, source)) = orders.recv() {
        let (result, duration) = match &mut maker {
            Ok(maker) => maker.make(&source),
            Err(reason) => (Err(reason.clone()), Duration::ZERO),
        };
        if finished.send(MadeCode { order, result, duration }).is_err() {
            return;
        }
    }
}
