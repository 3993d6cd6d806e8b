//! Worker threads of a search: this thread alone, or several, each with a machine of its own.
//!
//! The search hands out a batch of places at a time. Tree and states do not change while a batch is under
//! way. The results of its runs are merged afterwards, in the order of the batch: so a search finds the same,
//! in the same order, whatever the number of workers.

use core::time::Duration;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard};

use super::left_out::{NeededPoints, ShownPoints};
use super::search::Search;
use super::trace::{RunTrace, TraceEnd, Tracer};
use super::{Settings, Subject};
use crate::task::TaskNumber;

/// A place of the tree from which a run goes on.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunPlace {
    pub(super) node: u32,
    /// Number of the run, which no other run of the search has.
    pub(super) serial: u64,
}

/// A step of a run of a batch: the number of the run in the batch, and that of the step.
pub(super) type ClaimedStep = (usize, usize);

/// A state, the task that has run last, and the order in which the fingerprint has visited the tasks: what a
/// run does from there on follows from these.
type Claimable = (u128, TaskNumber, u64);

/// The states that the runs of a batch have come to, each with the first step that has.
#[derive(Default)]
pub(super) struct Claims([Mutex<HashMap<Claimable, ClaimedStep>>; 16]);

impl Claims {
    /// Claims a state for a step. Returns the step that has claimed it before, if one has.
    pub(super) fn claim(&self, state: Claimable, step: ClaimedStep) -> Option<ClaimedStep> {
        let mut part = self.0[state.0 as usize & 15].lock().unwrap_or_else(PoisonError::into_inner);
        match part.entry(state) {
            Entry::Occupied(first) => Some(*first.get()),
            Entry::Vacant(free) => {
                free.insert(step);
                None
            }
        }
    }
}

/// The workers of a search.
pub(super) trait Workers<T, E> {
    /// Runs on from each of these places, and returns what the runs have come by, in the same order. Where
    /// one comes to what another one has claimed, it ends. Stops all when `goes_on` is false, which is told
    /// the number of new states that the batch has come to so far.
    ///
    /// # Errors
    /// That with which a machine could not be begun.
    fn run(
        &mut self,
        batch: Vec<RunPlace>,
        goes_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Vec<RunTrace<T>>, E>;
}

/// Borrows the search for reading; no thread writes to it while a batch is under way.
fn read(search: &RwLock<Search>) -> RwLockReadGuard<'_, Search> {
    search.read().unwrap_or_else(PoisonError::into_inner)
}

/// This thread alone.
pub(super) struct SingleWorker<'a, S: Subject> {
    search: &'a RwLock<Search>,
    tracer: Tracer<'a, S>,
}

impl<'a, S: Subject> SingleWorker<'a, S> {
    pub(super) fn new(
        (settings, needed): (&'a Settings, &'a NeededPoints),
        search: &'a RwLock<Search>,
        subject: S,
    ) -> SingleWorker<'a, S> {
        SingleWorker { search, tracer: Tracer::new((settings, needed), settings.memory, subject) }
    }
}

impl<S: Subject> Workers<S::Ending, S::Error> for SingleWorker<'_, S> {
    fn run(
        &mut self,
        batch: Vec<RunPlace>,
        goes_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Vec<RunTrace<S::Ending>>, S::Error> {
        let mut states = 0;
        let mut goes_on = || {
            states += 1;
            goes_on(states)
        };
        let search = read(self.search);
        self.tracer.settle(&search);
        let claims = Claims::default();
        let mut traces = Vec::with_capacity(batch.len());
        for (place, number) in batch.into_iter().zip(0..) {
            traces.push(self.tracer.run(&search, place, (number, &claims), &mut goes_on)?);
        }
        Ok(traces)
    }
}

/// A batch that threads work on.
struct SharedBatch {
    places: Vec<RunPlace>,
    /// Whether each of them is taken by a worker.
    taken: Vec<AtomicBool>,
    claims: Claims,
    /// Number of new states that its runs have come to.
    states: AtomicUsize,
}

impl SharedBatch {
    /// Returns the numbers of the places in the order in which to take them: first those of which `is_near`
    /// is true, then the others from the last one on.
    fn order(&self, is_near: impl Fn(RunPlace) -> bool) -> Vec<usize> {
        let (mut order, far): (Vec<usize>, Vec<usize>) =
            (0..self.places.len()).partition(|&number| is_near(self.places[number]));
        order.extend(far.into_iter().rev());
        order
    }

    /// Takes a place for the calling worker. Returns whether it was free.
    fn take(&self, number: usize) -> bool {
        !self.taken[number].swap(true, Ordering::Relaxed)
    }
}

/// A thread's part of a batch: what its runs have come by, with their places in the batch, and with what a
/// machine could not be begun.
struct BatchPart<T, E> {
    traces: Vec<(usize, RunTrace<T>)>,
    failed: Option<E>,
}

/// A part that is sent when nothing is left to be taken of the batch, also if the thread panics. It is sent
/// as a whole: the receiver sleeps meanwhile, and leaves the processors to the workers.
struct TellsAtEnd<'a, T, E> {
    part: BatchPart<T, E>,
    tell: &'a Sender<BatchPart<T, E>>,
}

impl<T, E> Drop for TellsAtEnd<'_, T, E> {
    fn drop(&mut self) {
        let traces = std::mem::take(&mut self.part.traces);
        // The receiver is gone once the search is over.
        _ = self.tell.send(BatchPart { traces, failed: self.part.failed.take() });
    }
}

/// A pool of worker threads.
pub(super) struct WorkerPool<'a, T, E> {
    workers: Vec<Sender<Arc<SharedBatch>>>,
    told: Receiver<BatchPart<T, E>>,
    /// Whether all are to stop.
    stop: &'a AtomicBool,
}

/// The work of one thread of a pool.
pub(super) type PoolWorker<'a> = Box<dyn FnOnce() + Send + 'a>;

impl<'a, T: Send + 'a, E: Send + 'a> WorkerPool<'a, T, E> {
    /// Creates a pool of so many workers, which the caller runs in threads. Each makes a subject of its own.
    pub(super) fn new<S: Subject<Ending = T, Error = E>>(
        jobs: usize,
        (settings, needed): (&'a Settings, &'a NeededPoints),
        (search, stop): (&'a RwLock<Search>, &'a AtomicBool),
        subject: &'a (impl Fn() -> S + Sync),
    ) -> (WorkerPool<'a, T, E>, Vec<PoolWorker<'a>>) {
        let (tell, told) = channel();
        let (mut workers, mut works) = (Vec::new(), Vec::<PoolWorker<'a>>::new());
        for _ in 0..jobs {
            let (order, orders) = channel::<Arc<SharedBatch>>();
            let tell = tell.clone();
            works.push(Box::new(move || {
                let mut tracer = Tracer::new((settings, needed), settings.memory / jobs, subject());
                for batch in orders {
                    let part = BatchPart { traces: Vec::new(), failed: None };
                    let mut told = TellsAtEnd { part, tell: &tell };
                    work(&mut tracer, &read(search), &batch, stop, &mut told.part);
                }
            }));
            workers.push(order);
        }
        (WorkerPool { workers, told, stop }, works)
    }
}

/// Does one thread's part of a batch.
fn work<S: Subject>(
    tracer: &mut Tracer<'_, S>,
    search: &Search,
    batch: &SharedBatch,
    stop: &AtomicBool,
    part: &mut BatchPart<S::Ending, S::Error>,
) {
    tracer.settle(search);
    for number in batch.order(|place| tracer.is_near(search, place)) {
        if !batch.take(number) {
            continue;
        }
        let mut goes_on = || {
            batch.states.fetch_add(1, Ordering::Relaxed);
            !stop.load(Ordering::Relaxed)
        };
        match tracer.run(search, batch.places[number], (number, &batch.claims), &mut goes_on) {
            Ok(trace) => part.traces.push((number, trace)),
            Err(error) => {
                // The others will not be able to, either.
                part.failed = Some(error);
                stop.store(true, Ordering::Relaxed);
                return;
            }
        }
    }
}

impl<T: Send, E: Send> Workers<T, E> for WorkerPool<'_, T, E> {
    fn run(
        &mut self,
        batch: Vec<RunPlace>,
        goes_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Vec<RunTrace<T>>, E> {
        let taken = batch.iter().map(|_| AtomicBool::new(false)).collect();
        let count = batch.len();
        let batch = Arc::new(SharedBatch {
            places: batch,
            taken,
            claims: Claims::default(),
            states: AtomicUsize::new(0),
        });
        let mut working = 0;
        for worker in &self.workers {
            working += usize::from(worker.send(batch.clone()).is_ok());
        }
        let mut traces: Vec<Option<RunTrace<T>>> = (0..count).map(|_| None).collect();
        let mut failed = None;
        while working > 0 {
            match self.told.recv_timeout(Duration::from_millis(50)) {
                Ok(part) => {
                    working -= 1;
                    failed = failed.or(part.failed);
                    part.traces.into_iter().for_each(|(number, trace)| traces[number] = Some(trace));
                }
                Err(RecvTimeoutError::Timeout) => {}
                // A thread has panicked, which the scope tells.
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if !goes_on(batch.states.load(Ordering::Relaxed)) {
                self.stop.store(true, Ordering::Relaxed);
            }
        }
        match failed {
            Some(error) => Err(error),
            None => Ok(traces.into_iter().map(|trace| trace.unwrap_or_else(RunTrace::stopped)).collect()),
        }
    }
}

impl<T> RunTrace<T> {
    /// Returns the trace of a run that did not begin.
    pub(super) fn stopped() -> RunTrace<T> {
        RunTrace { steps: Vec::new(), end: TraceEnd::Stopped, shown: ShownPoints::default() }
    }
}
