//! Watching the facts of a program.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::symbol::USER_PACKAGE;
use esl_host::{FunctionRef, HostFailure, Question, Sender};
use esl_vm::embed::HostFunction;

use super::{Engine, QueryAnswer, Reply, TaskHandle, handle};
use crate::data::Data;
use crate::error::Error;

/// A change of a fact that matches a watched pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct WatchedFact {
    /// Whether the fact is in the database now: it was asserted, not retracted.
    pub is_there: bool,
    /// The fact.
    pub fact: Data,
    /// The values that the variables of the pattern have in it.
    pub bindings: QueryAnswer,
}

impl WatchedFact {
    /// Returns the change that the arguments of the library's call stand for.
    fn of_call(arguments: &[Data]) -> Option<WatchedFact> {
        let [Data::Keyword(kind), fact, bindings] = arguments else { return None };
        Some(WatchedFact {
            is_there: kind == "ASSERT",
            fact: fact.clone(),
            bindings: QueryAnswer::of_list(bindings)?,
        })
    }
}

/// A function of the embedder's that watches facts.
type WatchFunction = Box<dyn FnMut(WatchedFact) + Send>;

/// The function of a watch, until the watch is over.
struct Watcher {
    function: Mutex<Option<WatchFunction>>,
    is_over: AtomicBool,
}

impl Watcher {
    fn new(function: impl FnMut(WatchedFact) + Send + 'static) -> Watcher {
        Watcher { function: Mutex::new(Some(Box::new(function))), is_over: AtomicBool::new(false) }
    }

    /// Calls the function, unless the watch is over.
    fn tell(&self, change: WatchedFact) -> Result<(), HostFailure> {
        let called = {
            // A function that has panicked is there or not, and its watch ends.
            let mut function = self.function.lock().unwrap_or_else(PoisonError::into_inner);
            match function.as_mut().filter(|_| !self.is_over.load(Ordering::SeqCst)) {
                Some(function) => catch_unwind(AssertUnwindSafe(|| function(change))),
                None => Ok(()),
            }
        };
        // The function, or another thread, may have ended the watch meanwhile.
        if self.is_over.load(Ordering::SeqCst) {
            self.forget();
        }
        called.map_err(|panic| HostFailure::of_panic(&*panic))
    }

    /// Drops the function; if it is being called, at the end of that call.
    fn end(&self) {
        self.is_over.store(true, Ordering::SeqCst);
        self.forget();
    }

    fn forget(&self) {
        let function = self.function.try_lock().ok().and_then(|mut function| function.take());
        drop(function);
    }
}

/// The name of a watch that is over, with the end of its task to come.
type LeftWatch = (String, Reply<Data>);

/// The names of watches that are over. One is free when the end of its task has come.
#[derive(Clone, Default)]
pub(super) struct LeftWatches(Arc<Mutex<Vec<LeftWatch>>>);

impl LeftWatches {
    fn add(&self, name: String, end: Reply<Data>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((name, end));
    }

    /// Takes a name that is free.
    fn take_free(&self) -> Option<String> {
        let mut left = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = left.iter().position(|(_, end)| end.take().is_some())?;
        Some(left.swap_remove(place).0)
    }
}

/// A watch over facts, which lasts until it is dropped. Its function is dropped with it.
pub struct FactWatch {
    name: String,
    watcher: Arc<Watcher>,
    /// There until the watch is dropped.
    task: Option<TaskHandle>,
    left: LeftWatches,
}

impl fmt::Debug for FactWatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("FactWatch").field(&self.name).finish()
    }
}

impl Drop for FactWatch {
    fn drop(&mut self) {
        self.watcher.end();
        if let Some(task) = self.task.take() {
            task.abort();
            // Without the handle's sender, which would keep a waiting program from being deadlocked.
            self.left.add(std::mem::take(&mut self.name), task.into_reply());
        }
    }
}

impl Engine {
    /// Calls `function` for each change of a fact that matches a pattern, in the order of the changes, until
    /// the watch is dropped, and `function` with it. `function` is called on the thread that runs the engine,
    /// between two turns of the program's tasks, and cannot call back. A panic in it ends the watch. Tasks of
    /// the program may have some turns until the watch has begun.
    ///
    /// ```
    /// use std::sync::mpsc::channel;
    ///
    /// use esl::{Data, Engine};
    ///
    /// let mut engine = Engine::new()?;
    /// let (sender, changes) = channel();
    /// let pattern: Data = "(at ?robot ?place)".parse()?;
    /// let watch = engine.watch_facts(pattern, move |change| {
    ///     let place = change.bindings.data("place").map(ToString::to_string);
    ///     drop(sender.send((change.is_there, place.unwrap_or_default())));
    /// })?;
    /// engine.eval("(progn (assert '(at rover ridge)) (assert '(battery 90)) (retract '(at ? ?)))")?;
    /// engine.eval("(sleep 0.01)")?;
    /// drop(watch);
    /// engine.eval("(progn (assert '(at rover base)) (sleep 0.01))")?;
    /// let changes: Vec<(bool, String)> = changes.try_iter().collect();
    /// assert_eq!(changes, [(true, "RIDGE".into()), (false, "RIDGE".into())]);
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn watch_facts(
        &mut self,
        pattern: impl Into<Data>,
        function: impl FnMut(WatchedFact) + Send + 'static,
    ) -> Result<FactWatch, Error> {
        self.load_embedding()?;
        let name = self.left_watches.take_free().unwrap_or_else(|| {
            self.watches += 1;
            format!("%WATCH-{}", self.watches)
        });
        let watcher = Arc::new(Watcher::new(function));
        let told = watcher.clone();
        let teller = HostFunction::AtOnce(Box::new(move |arguments| {
            let data: Vec<Data> = arguments.iter().map(Data::from_datum).collect();
            WatchedFact::of_call(&data).map_or(Ok(()), |change| told.tell(change))?;
            Ok(Data::Nil.to_datum(USER_PACKAGE))
        }));
        self.machine.add_host_function(&name, teller);
        let teller = Data::Symbol(name.clone());
        let question = Question::Call {
            function: FunctionRef::Named("ESL::%WATCH-FACTS".into()),
            arguments: handle::data([pattern.into(), teller.clone()]),
            // Once it is taken, it begins before the other tasks go on.
            goes_first: true,
        };
        let task = TaskHandle::begin(Sender::new(&self.machine.inbox()), question);
        let watch = FactWatch { name, watcher, task: Some(task), left: self.left_watches.clone() };
        self.call_embedding("%AWAIT-WATCH", &[teller.to_datum(USER_PACKAGE)])?;
        Ok(watch)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_watch_that_is_over_leaves_nothing() {
        let mut engine = Engine::new().expect("there is room for the library");
        let held = Arc::new(());
        for _ in 0..50 {
            let (captured, pattern) = (held.clone(), Data::Symbol("?FACT".into()));
            let watch = engine.watch_facts(pattern, move |_| drop(captured.clone())).expect("it begins");
            assert_eq!(Arc::strong_count(&held), 2);
            drop(watch);
            assert_eq!(Arc::strong_count(&held), 1, "its function is dropped with it");
        }
        assert_eq!(engine.eval("(wait-for-event (make-event))"), Err(Error::Deadlocked));
        assert!(engine.watches <= 3, "{} names were made", engine.watches);
        let watches = engine.machine.host_functions().filter(|(name, ..)| name.starts_with("%WATCH-"));
        assert_eq!(watches.count() as u64, engine.watches);
    }

    #[test]
    fn a_watch_with_the_name_of_an_earlier_one_has_begun_when_it_is_returned() {
        let mut engine = Engine::new().expect("there is room for the library");
        let (sender, changes) = channel();
        for number in 0..20 {
            let sender = sender.clone();
            let pattern: Data = "(at ?place)".parse().expect("it is a pattern");
            let watch = engine.watch_facts(pattern, move |change| {
                sender.send((number, change.is_there)).expect("the test waits");
            });
            engine.eval("(progn (assert '(at ridge)) (retract '(at ridge)) (sleep 0.001))").expect("it runs");
            drop(watch.expect("it begins"));
            assert_eq!(changes.try_iter().collect::<Vec<_>>(), [(number, true), (number, false)]);
        }
    }

    #[test]
    fn a_function_may_end_its_own_watch() {
        let mut engine = Engine::new().expect("there is room for the library");
        let (place, told) = (Arc::new(Mutex::new(None)), Arc::new(()));
        let (own, counted) = (place.clone(), told.clone());
        let watch = engine.watch_facts(Data::Symbol("?FACT".into()), move |_| {
            std::mem::forget(counted.clone());
            drop(own.lock().map(|mut watch: std::sync::MutexGuard<'_, Option<FactWatch>>| watch.take()));
        });
        *place.lock().expect("no panic") = Some(watch.expect("it begins"));
        engine.eval("(progn (assert '(at ridge)) (assert '(at base)) (sleep 0.001))").expect("it runs");
        // Its own reference, and one that the only call has left; that of the function is dropped.
        assert_eq!(Arc::strong_count(&told), 2);
    }
}
