//! The outside of a machine: its host, the standard streams, the embedder's functions, and the operations
//! that these have begun.

mod under_way;

use std::collections::BTreeMap;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_heap::state::{StateSink, Stated};
use esl_host::machine::{Asked, Canceller, Console};
use esl_host::{
    ActionId, CallEffect, Host, HostCall, HostFailure, HostFunction, HostOperation, Inbox, Need, Output,
    RepeatedCall,
};
use indexmap::IndexMap;
use rustc_hash::FxBuildHasher;
use smallvec::SmallVec;

use crate::task::TaskNumber;
use crate::value::Value;
pub(crate) use under_way::Operations;

/// A function of the embedder's, and what it needs.
pub(crate) struct Given {
    pub(crate) function: HostFunction,
    pub(crate) needs: Vec<Need>,
    pub(crate) effect: CallEffect,
}

/// Answers of functions of the embedder's for which the heap has no room yet. The functions have effects, so
/// they are not called again.
///
/// An answer belongs to the frame of a task that has made the call. The frame takes it when it executes the
/// call again; it is dropped when the call fails, or the frame is left.
#[derive(Default)]
pub(crate) struct KeptAnswers(Vec<(TaskNumber, u32, Result<Datum, HostFailure>)>);

impl KeptAnswers {
    /// Returns whether none is kept.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Keeps the answer to a call of the frame whose base has this offset in the stack of `task`.
    pub(crate) fn keep(&mut self, task: TaskNumber, base: u32, answer: Result<Datum, HostFailure>) {
        self.0.push((task, base, answer));
    }

    /// Takes the answer to a call of this frame.
    pub(crate) fn take(&mut self, task: TaskNumber, base: u32) -> Option<Result<Datum, HostFailure>> {
        let at = self.0.iter().position(|kept| (kept.0, kept.1) == (task, base))?;
        Some(self.0.swap_remove(at).2)
    }

    /// Drops the answers to calls of the frames of `task` from this one inward.
    pub(crate) fn drop_from(&mut self, task: TaskNumber, base: u32) {
        self.0.retain(|kept| kept.0 != task || kept.1 < base);
    }

    /// Drops all answers.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }
}

/// A function of the embedder's, by its place among those given to the machine. None is ever taken away.
#[derive(Clone, Copy)]
pub(crate) struct GivenIndex(usize);

/// Arguments of a call of the host, of which most calls have few.
pub(crate) type HostArguments = SmallVec<[Datum; 6]>;

/// Functions of the embedder's that are found without a search; a power of two.
const FOUND: usize = 8;

/// Returns the place of a symbol among these.
fn place_of(symbol: Value) -> usize {
    (symbol.bits() >> 5) as usize % FOUND
}

/// Everything through which a machine reaches the outside.
pub(crate) struct Outside {
    /// Clocks, files and streams.
    pub(crate) host: Asked,
    /// The host's inbox.
    pub(crate) inbox: Inbox,
    /// The standard streams, buffered.
    pub(crate) console: Console,
    /// The embedder's functions, by name, in the order in which they were given.
    pub(crate) functions: IndexMap<String, Given, FxBuildHasher>,
    /// Those that programs have called last, by the addresses of their names.
    pub(crate) found: [(Value, GivenIndex); FOUND],
    /// Number of calls of these.
    pub(crate) calls: u64,
    /// Arguments of the call that is being made. Numbers stay behind, and their data are those of the next
    /// call.
    pub(crate) arguments: HostArguments,
    /// Answers of these, while there is no room for them in the heap.
    pub(crate) answers: KeptAnswers,
    /// The operations under way.
    pub(crate) operations: Operations,
    /// The inputs that the outside may signal, by name.
    pub(crate) inputs: BTreeMap<String, Value>,
    /// Number of senders outside that may signal them.
    pub(crate) senders: u64,
    /// Whether operators may attach that can signal them.
    pub(crate) attendance: ExpectedOperators,
    /// Stream that reports are written to.
    pub(crate) complaints: Output,
    /// Status that the program has asked to end with.
    pub(crate) exit_status: Option<u8>,
}

/// Operators of a run that are not attached yet, or the host of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExpectedOperators {
    /// None can come.
    None,
    /// They may come at any time.
    MayCome,
    /// They may, and it was said that the run waits for them.
    IsAwaited,
}

impl Stated for ExpectedOperators {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(*self as u64);
    }
}

impl Outside {
    /// Creates the outside that `host` stands for.
    pub(crate) fn new(host: Box<dyn Host + Send>) -> Outside {
        Outside {
            inbox: host.inbox(),
            host: Asked::new(host),
            console: Console::default(),
            functions: IndexMap::default(),
            found: [(Value::NIL, GivenIndex(0)); FOUND],
            calls: 0,
            arguments: HostArguments::new(),
            answers: KeptAnswers::default(),
            operations: Operations::default(),
            inputs: BTreeMap::new(),
            senders: 0,
            attendance: ExpectedOperators::None,
            complaints: Output::Error,
            exit_status: None,
        }
    }

    /// Returns the function of the embedder's with this name.
    pub(crate) fn function(&self, name: &str) -> Option<GivenIndex> {
        self.functions.get_index_of(name).map(GivenIndex)
    }

    /// Returns the function of the embedder's that this symbol has named before, if it has this name too: the
    /// address may be that of another symbol since.
    pub(crate) fn found_before(&self, symbol: Value, name: &[u32]) -> Option<GivenIndex> {
        let (known, index) = self.found[place_of(symbol)];
        let (given, _) = self.functions.get_index(index.0).filter(|_| known == symbol)?;
        let is_it = given.len() == name.len() && given.bytes().map(u32::from).eq(name.iter().copied());
        is_it.then_some(index)
    }

    /// Notes that a symbol names a function of the embedder's, whose name is ASCII.
    pub(crate) fn note_found(&mut self, symbol: Value, index: GivenIndex) {
        self.found[place_of(symbol)] = (symbol, index);
    }

    /// Lets go of the arguments of a call that is over, except for the numbers before all others.
    pub(crate) fn let_go_of_arguments(&mut self) {
        let is_number = |datum: &&Datum| match datum.kind() {
            DatumKind::Integer(integer) => integer.as_small().is_some(),
            kind => matches!(kind, DatumKind::Float(_)),
        };
        let numbers = self.arguments.iter().take_while(is_number).count();
        self.arguments.truncate(numbers);
    }

    /// Calls a function of the embedder's that returns at once; `None` if it begins an operation.
    pub(crate) fn call(&mut self, function: GivenIndex) -> Option<Result<Datum, HostFailure>> {
        self.calls += 1;
        let (name, given) = self.functions.get_index_mut(function.0)?;
        let call = HostCall { name, arguments: &self.arguments, effect: given.effect, operation: None };
        match &mut given.function {
            HostFunction::AtOnce(function) => Some(self.host.call(call, function)),
            HostFunction::Operation(_) => None,
        }
    }

    /// Returns whether a function of the embedder's begins an operation.
    pub(crate) fn is_operation(&self, function: GivenIndex) -> bool {
        matches!(self.functions[function.0].function, HostFunction::Operation(_))
    }

    /// Returns the rights that a function of the embedder's needs.
    pub(crate) fn needs(&self, function: GivenIndex) -> Vec<Need> {
        self.functions[function.0].needs.clone()
    }

    /// Begins an operation of the embedder's.
    pub(crate) fn begin_operation(
        &mut self,
        function: GivenIndex,
        handle: Value,
        is_detached: bool,
        begun_by: TaskNumber,
    ) {
        let Some((name, given)) = self.functions.get_index_mut(function.0) else { return };
        let HostFunction::Operation(function) = &mut given.function else { return };
        self.calls += 1;
        let canceller = Canceller::default();
        self.operations.begin(handle, canceller.clone(), is_detached, begun_by);
        let (number, arguments) = (self.operations.begun, &self.arguments[..]);
        let call = HostCall { name, arguments, effect: given.effect, operation: Some(number) };
        self.host.begin(call, &mut |arguments, action| {
            let arguments = arguments.to_vec();
            let operation = HostOperation::new(number, arguments, self.inbox.clone(), canceller.clone());
            function(operation.with_action(action));
        });
    }

    /// Begins an operation again that is under way, in the state that the machine has, by the function of
    /// this name. Returns whether there are both.
    pub(crate) fn begin_again(
        &mut self,
        number: u64,
        name: &str,
        arguments: &[Datum],
        action: ActionId,
    ) -> bool {
        let Some(open) = self.operations.open.get_mut(&number) else { return false };
        let Some(Given { function: HostFunction::Operation(function), .. }) = self.functions.get_mut(name)
        else {
            return false;
        };
        open.canceller = Canceller::default();
        let canceller = open.canceller.clone();
        let operation = HostOperation::new(number, arguments.to_vec(), self.inbox.clone(), canceller);
        function(operation.with_action(Some(action)));
        true
    }

    /// Makes the calls of an earlier process again that the host asks for.
    pub(crate) fn repeat_calls(&mut self) {
        while let Some(RepeatedCall { number, name, arguments }) = self.host.next_repeated() {
            let Some(given) = self.functions.get_mut(&name) else {
                self.host.answer_repeated(Err(HostFailure::new("NOT-IN-THIS-WORLD", name)));
                continue;
            };
            let host = &mut self.host;
            let mut is_refused = |need: &Need| match arguments.get(need.argument).map(Datum::kind) {
                Some(DatumKind::String(object)) => !host.permits_repeated(need.right, object.as_ref()),
                _ => false,
            };
            if given.needs.iter().any(&mut is_refused) {
                let failure = HostFailure::new("NOT-PERMITTED", "this process lacks a right");
                self.host.answer_repeated(Err(failure));
                continue;
            }
            match &mut given.function {
                HostFunction::AtOnce(function) => self.host.answer_repeated(function(&arguments)),
                HostFunction::Operation(function) => {
                    let canceller = Canceller::default();
                    function(HostOperation::new(number, arguments, self.inbox.clone(), canceller));
                }
            }
        }
    }

    /// Calls `visit` with every value.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        self.operations.visit(visit);
        self.inputs.values().for_each(|&input| visit(input));
    }

    /// Writes what programs have printed and is still in a buffer, as far as there is room.
    pub(crate) fn pass_on(&mut self) {
        self.console.pass_on(&mut self.host);
    }

    /// Writes what programs have printed and is still in a buffer.
    pub(crate) fn flush(&mut self) {
        self.console.flush(&mut self.host);
    }

    /// Writes a report, on lines of its own.
    pub(crate) fn complain(&mut self, text: &str) {
        let mut characters: Vec<u32> = text.chars().map(u32::from).collect();
        if self.console.column(self.complaints) > 0 {
            characters.insert(0, u32::from('\n'));
        }
        self.flush();
        self.console.write(&mut self.host, self.complaints, &characters);
        self.flush();
    }
}

impl Drop for Outside {
    fn drop(&mut self) {
        self.inbox.close_inputs();
        self.inbox.end_answers();
        self.inbox.end_inspections();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_taken_by_the_frame_that_has_called() {
        let answer = |text: &str| Err(HostFailure::new("FULL", text));
        let text = |taken: Option<Result<Datum, HostFailure>>| {
            taken.map(|answer| format!("{:?}", answer.expect_err("it is a failure").arguments))
        };
        let expected = |name: &str| text(Some(answer(name)));
        let (one, two) = (TaskNumber(1), TaskNumber(2));
        let mut answers = KeptAnswers::default();
        answers.keep(one, 8, answer("outer"));
        answers.keep(one, 20, answer("inner"));
        answers.keep(two, 20, answer("other"));
        assert_eq!(text(answers.take(two, 8)), None);
        // The inner frame is left.
        answers.drop_from(one, 12);
        assert_eq!(text(answers.take(one, 20)), None);
        assert_eq!(text(answers.take(two, 20)), expected("other"));
        assert_eq!(text(answers.take(one, 8)), expected("outer"));
        assert!(answers.is_empty());
    }
}
