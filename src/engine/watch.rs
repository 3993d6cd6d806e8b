//! Watching the facts of a program.

use std::panic::{AssertUnwindSafe, catch_unwind};

use esl_bytecode::symbol::USER_PACKAGE;
use esl_host::{FunctionRef, HostFailure, Question, Sender};
use esl_vm::embed::HostFunction;

use super::{Engine, QueryAnswer, TaskHandle, handle};
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

/// A watch over facts, which lasts until it is dropped.
#[derive(Debug)]
pub struct FactWatch(TaskHandle);

impl Drop for FactWatch {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Engine {
    /// Calls `function` for each change of a fact that matches a pattern, in the order of the changes, until
    /// the watch is dropped. `function` is called on the thread that runs the engine, between two turns of
    /// the program's tasks, and cannot call back. A panic in it ends the watch. Tasks of the program may have
    /// some turns until the watch has begun.
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
        mut function: impl FnMut(WatchedFact) + Send + 'static,
    ) -> Result<FactWatch, Error> {
        self.load_embedding()?;
        self.watches += 1;
        let name = format!("%WATCH-{}", self.watches);
        let teller = HostFunction::AtOnce(Box::new(move |arguments| {
            let data: Vec<Data> = arguments.iter().map(Data::from_datum).collect();
            if let Some(change) = WatchedFact::of_call(&data) {
                catch_unwind(AssertUnwindSafe(|| function(change)))
                    .map_err(|panic| HostFailure::of_panic(&*panic))?;
            }
            Ok(Data::Nil.to_datum(USER_PACKAGE))
        }));
        self.machine.add_host_function(&name, teller);
        let teller = Data::Symbol(name.clone()).to_datum(USER_PACKAGE);
        let question = Question::Call {
            function: FunctionRef::Named("ESL::%WATCH-FACTS".into()),
            arguments: handle::data([pattern.into(), Data::Symbol(name)]),
            // Once it is taken, it begins before the other tasks go on.
            goes_first: true,
        };
        let watch = FactWatch(TaskHandle::begin(Sender::new(&self.machine.inbox()), question));
        self.call_embedding("%AWAIT-WATCH", &[teller])?;
        Ok(watch)
    }
}
