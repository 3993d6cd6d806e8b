//! Questions from outside to a run, and the answers.
//!
//! A question comes into the inbox as plain data with a number. The machine does not know the destination of
//! the answer: it goes to the caller that waits for that number, if there is one. So a replay, which has no
//! such callers, is the same run.

use std::collections::BTreeMap;
use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

use esl_bytecode::datum::Datum;

use super::{FailureFrame, Inbox, Incoming, Sender};

/// A function of the program, as the outside knows it.
#[derive(Clone, Debug)]
pub enum FunctionRef {
    /// Its name, in upper case; `PACKAGE:NAME` outside of the package of programs.
    Named(String),
    /// One that the machine keeps under this number.
    Kept(u64),
}

/// A value of a program that its machine keeps for the outside, until the last clone is dropped.
#[derive(Clone)]
pub struct Kept(Arc<KeptNumber>);

struct KeptNumber {
    number: u64,
    inbox: Inbox,
}

impl Drop for KeptNumber {
    fn drop(&mut self) {
        self.inbox.put(Incoming::Release(self.number));
    }
}

impl fmt::Debug for Kept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Kept({})", self.0.number)
    }
}

impl Kept {
    /// Creates the note that the machine keeps a value under this number.
    #[doc(hidden)]
    pub fn new(number: u64, inbox: Inbox) -> Kept {
        Kept(Arc::new(KeptNumber { number, inbox }))
    }

    /// Returns what a question to the machine with this inbox calls the value: nothing, if another one keeps
    /// it.
    pub fn callee(&self, inbox: &Inbox) -> FunctionRef {
        FunctionRef::Kept(if self.0.inbox.is_same(inbox) { self.0.number } else { u64::MAX })
    }
}

/// A question to a run.
#[derive(Clone, Debug)]
pub enum Question {
    /// A call of a function in a task of its own.
    Call {
        /// The function.
        function: FunctionRef,
        /// The arguments.
        arguments: Vec<Datum>,
        /// Whether the task has its turns before the others, and calls and messages that come later are
        /// deferred until it has ended, or waits.
        goes_first: bool,
    },
    /// Which tasks there are.
    Tasks,
}

/// A task as the outside is told of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TaskInfo {
    /// Number of the task.
    pub number: u64,
    /// Number of the task that has made it; 0 if the embedder has.
    pub maker: u64,
    /// Its name in reports.
    pub name: String,
    /// The object of its wait, as in reports; `None` if it can run.
    pub waits_for: Option<String>,
    /// Ticks that it has used.
    pub ticks: u64,
}

/// An answer of a run.
#[derive(Clone, Debug)]
pub enum Answer {
    /// The values of the call.
    Values(Vec<Datum>),
    /// A value contains itself, so it is not data.
    Circular,
    /// A value is too large.
    TooLarge,
    /// The call has failed.
    Failed {
        /// Cause of the failure, as the program prints it.
        cause: String,
        /// Text of the condition.
        message: String,
        /// Report of the failure, with its places.
        report: String,
        /// The same with all calls of the library, if it was kept.
        full_report: Option<String>,
        /// Arguments of the failure, if its cause is one of the program's.
        arguments: Vec<Datum>,
        /// The calls that it has left unfinished, innermost first.
        frames: Vec<FailureFrame>,
    },
    /// The task of the call was aborted.
    Aborted,
    /// The program has asked to end with this status, which has aborted the task of the call.
    Exited(u8),
    /// The tasks that have not ended, in the order in which they were made.
    Tasks(Vec<TaskInfo>),
    /// The machine is gone, or the run has ended.
    Ended,
}

/// The place where an answer is waited for.
#[derive(Default)]
struct Slot {
    state: Mutex<SlotState>,
    /// Notified when the answer has come and a thread waits.
    ready: Condvar,
}

#[derive(Default)]
struct SlotState {
    answer: Option<Answer>,
    waker: Option<Waker>,
    /// Whether a thread waits. A notification without one is a call of the system too.
    is_awaited: bool,
}

impl Slot {
    fn state(&self) -> MutexGuard<'_, SlotState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fill(&self, answer: Answer) {
        let waker = {
            let mut state = self.state();
            state.answer = Some(answer);
            if state.is_awaited {
                self.ready.notify_all();
            }
            state.waker.take()
        };
        if let Some(waker) = waker {
            waker.wake();
        }
    }
}

/// The callers that wait for answers, by the numbers of their questions.
#[derive(Default)]
pub(super) struct Asking(Mutex<OpenQuestions>);

#[derive(Default)]
struct OpenQuestions {
    slots: BTreeMap<u64, Arc<Slot>>,
    /// Answers to questions that are still to be asked: a replay takes the questions from its recording, and
    /// may be ahead of the callers that ask them again.
    early: BTreeMap<u64, Answer>,
    /// Number of questions so far.
    asked: u64,
    is_closed: bool,
}

impl Asking {
    fn waiting(&self) -> MutexGuard<'_, OpenQuestions> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inbox {
    /// Hands the answer to the question with this number to the caller that waits for it.
    #[doc(hidden)]
    pub fn answer(&self, number: u64, answer: Answer) {
        let slot = {
            let mut open = self.asking().waiting();
            if number > open.asked {
                open.early.insert(number, answer);
                return;
            }
            open.slots.remove(&number)
        };
        if let Some(slot) = slot {
            slot.fill(answer);
        }
    }

    /// Gives the questions from here on numbers above `last`: those up to it belong to earlier processes of
    /// the run.
    #[doc(hidden)]
    pub fn number_questions_above(&self, last: u64) {
        let mut open = self.asking().waiting();
        open.asked = open.asked.max(last);
    }

    /// Says that no question will be answered any more.
    #[doc(hidden)]
    pub fn end_answers(&self) {
        self.asking().waiting().is_closed = true;
        self.end_questions();
    }

    /// Says that none of the questions so far will be answered any more, since the run has ended.
    pub fn end_questions(&self) {
        let slots = std::mem::take(&mut self.asking().waiting().slots);
        slots.into_values().for_each(|slot| slot.fill(Answer::Ended));
    }
}

/// An answer to come: a future, which can also be waited for.
pub struct Pending {
    number: u64,
    slot: Arc<Slot>,
}

impl fmt::Debug for Pending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pending({})", self.number)
    }
}

impl Pending {
    /// Returns the number of the question.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Waits for the answer, on another thread than the one that runs the machine.
    pub fn wait(self) -> Answer {
        let mut state = self.slot.state();
        loop {
            match state.answer.take() {
                Some(answer) => return answer,
                None => {
                    state.is_awaited = true;
                    state = self.slot.ready.wait(state).unwrap_or_else(PoisonError::into_inner);
                }
            }
        }
    }

    /// Returns the answer if it has come.
    pub fn take(&self) -> Option<Answer> {
        self.slot.state().answer.take()
    }
}

impl Future for Pending {
    type Output = Answer;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Answer> {
        let mut state = self.slot.state();
        match state.answer.take() {
            Some(answer) => Poll::Ready(answer),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

impl Inbox {
    /// Returns the answer to come to a question that needs not be put in, since the machine knows it already.
    pub fn expect_answer(&self) -> Pending {
        let slot = Arc::<Slot>::default();
        let number = {
            let mut waiting = self.asking().waiting();
            waiting.asked += 1;
            let number = waiting.asked;
            match waiting.early.remove(&number) {
                Some(answer) => slot.fill(answer),
                None if waiting.is_closed => slot.fill(Answer::Ended),
                None => _ = waiting.slots.insert(number, slot.clone()),
            }
            number
        };
        Pending { number, slot }
    }
}

impl Sender {
    /// Asks something of the run.
    pub fn ask(&self, question: Question) -> Pending {
        let pending = self.inbox().expect_answer();
        self.inbox().put(Incoming::Question { number: pending.number, question });
        pending
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_goes_to_who_asked() {
        let inbox = Inbox::new();
        let sender = Sender::new(&inbox);
        let (first, second) = (sender.ask(Question::Tasks), sender.ask(Question::Tasks));
        assert!(first.take().is_none());
        inbox.answer(second.number(), Answer::Aborted);
        inbox.answer(1, Answer::Circular);
        inbox.answer(3, Answer::TooLarge);
        assert!(matches!(first.take(), Some(Answer::Circular)));
        let first = sender.ask(Question::Tasks);
        assert!(matches!(first.take(), Some(Answer::TooLarge)), "a replay has answered before");
        let first = sender.ask(Question::Tasks);
        assert!(matches!(second.wait(), Answer::Aborted));
        let thread = std::thread::spawn(move || first.wait());
        inbox.end_answers();
        assert!(matches!(thread.join(), Ok(Answer::Ended)));
        assert!(matches!(sender.ask(Question::Tasks).wait(), Answer::Ended));
    }
}
