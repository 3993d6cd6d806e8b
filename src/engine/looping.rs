//! Running an engine: to the end, in portions of a loop of the embedder's, or as a future.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};
use std::time::{Duration, Instant};

use esl_bytecode::datum::Datum;
use esl_host::{FunctionRef, Question, Sender};
use esl_vm::run::RunOutcome;

use super::{Engine, Reply, TaskHandle};
use crate::data::Data;

/// Ticks that a future of a run takes at a time, so that others on its executor have their turns.
const PORTION: u64 = 100_000;

/// Why a run is over, for now: later evaluations and calls begin another one.
///
/// ```
/// use esl::Engine;
/// use esl::engine::Ending;
///
/// let mut engine = Engine::new()?;
/// engine.begin("(spawn (sleep 0.01) (exit 3))");
/// assert_eq!(engine.run(), Ending::Exited(3));
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ending {
    /// Every task has ended.
    Done,
    /// The program has asked to end with this status.
    Exited(u8),
    /// The tasks that are left wait for what cannot come.
    Deadlocked,
    /// The machine has spent [`Config::budget`](crate::Config::budget).
    BudgetSpent,
    /// [`Incoming::Stop`](crate::host::Incoming::Stop) has come.
    Stopped,
}

/// Where a run stands after a portion of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Poll {
    /// Some task can go on at once.
    Busy,
    /// All tasks wait.
    Idle {
        /// When the first of them goes on, if it is for a time; something may come from outside before.
        until: Option<Instant>,
    },
    /// The run is over.
    Ended(Ending),
}

impl Engine {
    /// Has a text evaluated as a task of the runs to come, and returns what will become of it. Unlike
    /// [`Engine::eval`], does not run anything.
    pub fn begin(&mut self, text: &str) -> Reply<Data> {
        self.spawn_text(text).into_reply()
    }

    /// Has a text evaluated as a task of the runs to come, as [`Engine::begin`] does, which can be aborted.
    ///
    /// ```
    /// use esl::{Engine, Error};
    ///
    /// let mut engine = Engine::new()?;
    /// let patrol = engine.spawn_text("(loop (sleep 0.01))");
    /// patrol.abort();
    /// engine.run();
    /// assert_eq!(patrol.wait(), Err(Error::Aborted));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn spawn_text(&mut self, text: &str) -> TaskHandle {
        self.spawn_as(text, None)
    }

    /// As [`Engine::spawn_text`]; positions in the text are reported under the name, if there is one.
    pub(super) fn spawn_as(&mut self, text: &str, name: Option<&str>) -> TaskHandle {
        let arguments = std::iter::once(text).chain(name).map(|text| Datum::string(text, Default::default()));
        let question = Question::Call {
            function: FunctionRef::Named("ESL::%EVAL-TEXT".into()),
            arguments: arguments.collect(),
            goes_first: false,
        };
        TaskHandle::begin(Sender::new(&self.machine.inbox()), question)
    }

    /// Runs tasks until all have ended or wait for what cannot come. Waits while all of them wait.
    pub fn run(&mut self) -> Ending {
        let outcome = self.machine.run(u64::MAX);
        self.ending_of(outcome)
    }

    /// Runs tasks for a portion of ticks, for a loop of the embedder's, which says what time it is. Comes
    /// back when all tasks wait; never waits itself. Timers that are due fire. Into which portions a run is
    /// divided changes nothing in it. A replay ([`ReplayHost`](crate::host::ReplayHost)) waits for nothing
    /// either: it is busy until it ends, or diverges.
    ///
    /// ```
    /// use std::time::{Duration, Instant};
    ///
    /// use esl::Engine;
    /// use esl::engine::{Ending, Poll};
    ///
    /// let mut engine = Engine::new()?;
    /// let sum = engine.begin("(progn (sleep 0.01) (+ 1 2))");
    /// let ending = loop {
    ///     match engine.poll(Instant::now(), 10_000) {
    ///         Poll::Busy => {}
    ///         // Here other work of the loop has its time.
    ///         Poll::Idle { until } => std::thread::sleep(Duration::from_millis(1)),
    ///         Poll::Ended(ending) => break ending,
    ///     }
    /// };
    /// assert_eq!(ending, Ending::Done);
    /// assert_eq!(sum.wait()?.as_integer(), Some(3));
    /// # Ok::<(), esl::Error>(())
    /// ```
    pub fn poll(&mut self, now: Instant, ticks: u64) -> Poll {
        let outcome = self.machine.run_due(ticks);
        self.machine.flush();
        if outcome == RunOutcome::TicksUsed {
            return Poll::Busy;
        }
        if outcome == RunOutcome::Waiting && self.machine.expects_something() {
            let until = self.machine.time_to_next_timer().map(Duration::from_nanos);
            if self.machine.replays() {
                return Poll::Busy;
            }
            return Poll::Idle { until: until.and_then(|time| now.checked_add(time)) };
        }
        Poll::Ended(self.ending_of(outcome))
    }

    /// Has `waker` woken when something has come from outside for tasks that wait, at once if it has already:
    /// a loop that waits after [`Poll::Idle`] goes on then, or at the time that it names. A waker is woken
    /// once, and replaces the one before.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use std::task::{Wake, Waker};
    /// use std::thread::{self, Thread};
    /// use std::time::Instant;
    ///
    /// use esl::Engine;
    /// use esl::engine::Poll;
    ///
    /// struct Unpark(Thread);
    ///
    /// impl Wake for Unpark {
    ///     fn wake(self: Arc<Unpark>) {
    ///         self.0.unpark();
    ///     }
    /// }
    ///
    /// let mut engine = Engine::new()?;
    /// engine.eval("(define-input button)")?;
    /// let handle = engine.handle();
    /// let pressed = engine.begin("(wait-for-event button)");
    /// thread::spawn(move || handle.signal("button", ["red".into()]));
    /// let waker = Waker::from(Arc::new(Unpark(thread::current())));
    /// while let Poll::Idle { until: None } = engine.poll(Instant::now(), 10_000) {
    ///     engine.wake_when_ready(&waker);
    ///     thread::park();
    /// }
    /// assert_eq!(pressed.wait()?.as_str(), Some("red"));
    /// # Ok::<(), esl::Error>(())
    /// ```
    pub fn wake_when_ready(&self, waker: &Waker) {
        self.machine.inbox().wake_when_rung(waker);
    }

    fn ending_of(&mut self, outcome: RunOutcome) -> Ending {
        self.machine.flush();
        if outcome == RunOutcome::BudgetSpent {
            return Ending::BudgetSpent;
        }
        if let Some(status) = self.machine.take_exit_status() {
            return Ending::Exited(status);
        }
        match outcome {
            RunOutcome::BudgetSpent => Ending::BudgetSpent,
            RunOutcome::Stopped | RunOutcome::TicksUsed => Ending::Stopped,
            RunOutcome::Waiting => Ending::Deadlocked,
            RunOutcome::Done => Ending::Done,
        }
    }

    /// Runs tasks as [`Engine::run`] does, as a future for any executor: it waits without a thread of its
    /// own, but for one that keeps the time, and lets others of its executor go on in between.
    ///
    /// ```
    /// use esl::Engine;
    /// use esl::engine::Ending;
    ///
    /// async fn mission(engine: &mut Engine) -> Result<Option<i64>, esl::Error> {
    ///     let sum = engine.begin("(progn (sleep 0.01) (+ 1 2))");
    ///     assert_eq!(engine.run_async().await, Ending::Done);
    ///     Ok(sum.await?.as_integer())
    /// }
    /// # let mut engine = Engine::new()?;
    /// # let mut future = std::pin::pin!(mission(&mut engine));
    /// # let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    /// # let three = loop {
    /// #     if let std::task::Poll::Ready(sum) = future.as_mut().poll(&mut context) { break sum? }
    /// # };
    /// # use std::future::Future;
    /// # assert_eq!(three, Some(3));
    /// # Ok::<(), esl::Error>(())
    /// ```
    pub fn run_async(&mut self) -> Running<'_> {
        Running { engine: self, alarm: None }
    }
}

/// The future of a run.
pub struct Running<'a> {
    engine: &'a mut Engine,
    alarm: Option<Alarm>,
}

impl Future for Running<'_> {
    type Output = Ending;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> std::task::Poll<Ending> {
        match self.engine.poll(Instant::now(), PORTION) {
            Poll::Ended(ending) => return std::task::Poll::Ready(ending),
            Poll::Busy => context.waker().wake_by_ref(),
            Poll::Idle { until } => {
                if let Some(until) = until {
                    let alarm = self.alarm.get_or_insert_with(Alarm::begin);
                    if !alarm.set(until, context.waker()) {
                        // Without a thread for the time the executor has to look again.
                        context.waker().wake_by_ref();
                    }
                }
                self.engine.machine.inbox().wake_when_rung(context.waker());
            }
        }
        std::task::Poll::Pending
    }
}

/// The setting of an alarm.
#[derive(Default)]
struct AlarmSetting {
    next: Option<(Instant, Waker)>,
    is_over: bool,
}

/// State of an alarm, shared with its thread.
#[derive(Default)]
struct Bell {
    setting: Mutex<AlarmSetting>,
    has_changed: Condvar,
}

impl Bell {
    fn setting(&self) -> MutexGuard<'_, AlarmSetting> {
        // The setting is whole at every moment, so a panic elsewhere does not corrupt it.
        self.setting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A thread that wakes a future at a time.
struct Alarm {
    bell: Arc<Bell>,
    has_thread: bool,
}

impl Alarm {
    fn begin() -> Alarm {
        let bell = Arc::<Bell>::default();
        let shared = bell.clone();
        let thread = std::thread::Builder::new().name("esl-alarm".into()).spawn(move || keep_time(&shared));
        Alarm { bell, has_thread: thread.is_ok() }
    }

    /// Has `waker` woken at a time, in place of what was set before. Returns whether that will happen.
    fn set(&self, time: Instant, waker: &Waker) -> bool {
        self.bell.setting().next = Some((time, waker.clone()));
        self.bell.has_changed.notify_all();
        self.has_thread
    }
}

impl Drop for Alarm {
    fn drop(&mut self) {
        self.bell.setting().is_over = true;
        self.bell.has_changed.notify_all();
    }
}

/// Wakes the waker that is set when its time has come, until the alarm is dropped.
fn keep_time(bell: &Bell) {
    let mut setting = bell.setting();
    while !setting.is_over {
        let now = Instant::now();
        let left = setting.next.as_ref().map(|(time, _)| time.saturating_duration_since(now));
        setting = match left {
            Some(Duration::ZERO) => {
                if let Some((_, waker)) = setting.next.take() {
                    waker.wake();
                }
                continue;
            }
            Some(left) => {
                bell.has_changed.wait_timeout(setting, left).unwrap_or_else(PoisonError::into_inner).0
            }
            None => bell.has_changed.wait(setting).unwrap_or_else(PoisonError::into_inner),
        };
    }
}
