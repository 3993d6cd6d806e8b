//! Calls that last: servers, clients and subscriptions that each process of a run opens again.
//!
//! A call lasts from its success until one of its objects is closed, or the program lets go of it. The next
//! process makes those calls again, in their order; things that they make stand for those of the first call,
//! wherever the program holds them. A call that fails is tried again after a pause; until then, so are the
//! later ones of its objects, and the others go on.

use std::any::Any;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{CallEffect, HostCall, HostFailure, Inbox, Incoming, News, RepeatedCall, Sender};
use esl_replay::{StoredArgument, StoredCall};
use esl_vm::vm::Vm;

use super::control::DurableControl;

/// The numbers of operations that are begun again are above this one.
pub(crate) const REPEATED: u64 = 1 << 62;
/// Calls from which on the list is searched for those that are over.
const SOME: usize = 64;
/// Pauses before a call that has failed is tried again: the first, and the longest.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(10));

/// An object of the host that the program may hold.
#[derive(Clone)]
struct HeldThing(Weak<dyn Any + Send + Sync>);

impl HeldThing {
    fn of(datum: &Datum) -> Option<HeldThing> {
        let DatumKind::Opaque(thing) = datum.kind() else { return None };
        Some(HeldThing(Arc::downgrade(thing.value())))
    }

    /// Returns what `OpaqueDatum::identity` does. The memory is not used again while this is there.
    fn identity(&self) -> usize {
        self.0.as_ptr().cast::<()>().addr()
    }

    fn is_held(&self) -> bool {
        self.0.strong_count() > 0
    }
}

/// An argument of a call that lasts.
#[derive(Clone)]
enum LastingArgument {
    Data(Datum),
    Thing(HeldThing),
}

/// A call that lasts.
#[derive(Clone)]
struct LastingCall {
    name: String,
    arguments: Vec<LastingArgument>,
    /// The objects among its values.
    values: Vec<Option<HeldThing>>,
}

impl LastingCall {
    fn of(call: HostCall<'_>) -> LastingCall {
        let argument = |datum: &Datum| match HeldThing::of(datum) {
            Some(thing) => LastingArgument::Thing(thing),
            None => LastingArgument::Data(datum.clone()),
        };
        let arguments = call.arguments.iter().map(argument).collect();
        LastingCall { name: call.name.into(), arguments, values: Vec::new() }
    }

    /// Returns the objects among its arguments.
    fn given(&self) -> impl Iterator<Item = &HeldThing> {
        self.arguments.iter().filter_map(|argument| match argument {
            LastingArgument::Thing(thing) => Some(thing),
            LastingArgument::Data(_) => None,
        })
    }

    /// Returns whether both are calls of one function with equal arguments.
    fn is_equal(&self, other: &LastingCall) -> bool {
        use LastingArgument::{Data, Thing};
        let is_equal = |pair: (&LastingArgument, &LastingArgument)| match pair {
            (Thing(one), Thing(two)) => one.identity() == two.identity(),
            (Data(one), Data(two)) => one.to_string() == two.to_string(),
            _ => false,
        };
        self.name == other.name
            && self.arguments.len() == other.arguments.len()
            && self.arguments.iter().zip(&other.arguments).all(is_equal)
    }

    fn things(&self) -> impl Iterator<Item = &HeldThing> {
        self.given().chain(self.values.iter().flatten())
    }

    /// Returns whether all of its objects are held.
    fn is_held(&self) -> bool {
        self.things().all(HeldThing::is_held)
    }

    /// Returns whether two calls have an argument in common that is an object.
    fn shares(&self, other: &LastingCall) -> bool {
        self.given().any(|one| other.given().any(|two| one.identity() == two.identity()))
    }
}

/// A call that this process has yet to make again.
struct WaitingCall {
    call: LastingCall,
    /// The pause after the next failure.
    pause: Duration,
    /// Time before which it is not tried.
    not_before: Option<Instant>,
    /// Whether one of its objects was closed meanwhile.
    is_closed: bool,
}

#[derive(Default)]
struct LastingState {
    /// The calls that last, in the order in which they were made.
    calls: Vec<LastingCall>,
    /// Those of operations under way, by number.
    begun: HashMap<u64, LastingCall>,
    /// Those that are still to be made again, in their order.
    waiting: Vec<WaitingCall>,
    /// The number of operations that were begun again, and the place of the call under way among those that
    /// wait.
    repeated: (u64, Option<usize>),
    /// Objects of this process, by the identities of those for which they stand.
    stand_ins: HashMap<usize, (HeldThing, Datum)>,
    /// Keeps the run from ending while calls wait.
    sender: Option<Sender>,
}

/// The calls of a run that last. Clones are the same.
#[derive(Clone, Default)]
pub(crate) struct LastingCalls(Arc<Mutex<LastingState>>);

impl LastingCalls {
    fn lock(&self) -> MutexGuard<'_, LastingState> {
        // Each change is made whole, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes note of a call of a function that has returned at once.
    pub(crate) fn hear_call(&self, call: HostCall<'_>, answer: &Result<Datum, HostFailure>) {
        match (call.effect, answer) {
            (CallEffect::Lasts, Ok(value)) => {
                let values = vec![HeldThing::of(value)];
                self.lock().add(LastingCall { values, ..LastingCall::of(call) });
            }
            (CallEffect::Closes, _) => self.lock().forget(call.arguments),
            _ => {}
        }
    }

    /// Takes note of an operation that has begun.
    pub(crate) fn hear_begin(&self, call: HostCall<'_>) {
        match (call.effect, call.operation) {
            (CallEffect::Lasts, Some(number)) => _ = self.lock().begun.insert(number, LastingCall::of(call)),
            (CallEffect::Closes, _) => self.lock().forget(call.arguments),
            _ => {}
        }
    }

    /// Takes note of the news of operations.
    pub(crate) fn hear_news(&self, contents: &[Incoming]) {
        for incoming in contents {
            match incoming {
                Incoming::Operation { number, news: News::Completed(values) } => {
                    let state = &mut *self.lock();
                    if let Some(call) = state.begun.remove(number) {
                        let values = values.iter().map(HeldThing::of).collect();
                        state.add(LastingCall { values, ..call });
                    }
                }
                Incoming::Operation { number, news: News::Failed(_) } => _ = self.lock().begun.remove(number),
                _ => {}
            }
        }
    }

    /// Returns the calls that last as data, with the numbers that their objects have in the machine.
    pub(crate) fn stored(&self, machine: &Vm) -> Vec<StoredCall> {
        let state = &mut *self.lock();
        state.calls.retain(LastingCall::is_held);
        state.stand_ins.retain(|_, (thing, _)| thing.is_held());
        let number = |thing: &HeldThing| machine.number_of_thing(thing.identity());
        let argument = |argument: &LastingArgument| match argument {
            LastingArgument::Data(datum) => Some(StoredArgument::Data(datum.clone())),
            LastingArgument::Thing(thing) => number(thing).map(StoredArgument::Object),
        };
        let stored = |call: &LastingCall| {
            let arguments = call.arguments.iter().map(argument).collect::<Option<Vec<_>>>()?;
            let value = |value: &Option<HeldThing>| match value {
                None => Some(None),
                Some(thing) => number(thing).map(Some),
            };
            let values = call.values.iter().map(value).collect::<Option<Vec<_>>>()?;
            Some(StoredCall { name: call.name.clone(), arguments, values })
        };
        // A call with an object that the program does not hold any more is over.
        state.calls.iter().filter_map(stored).collect()
    }

    /// Takes the calls of a snapshot, whose objects are in the machine.
    pub(crate) fn restore(&self, stored: &[StoredCall], machine: &Vm) {
        let thing = |number: u64| machine.thing_numbered(number).as_ref().and_then(HeldThing::of);
        let argument = |argument: &StoredArgument| match argument {
            StoredArgument::Data(datum) => Some(LastingArgument::Data(datum.clone())),
            StoredArgument::Object(number) => thing(*number).map(LastingArgument::Thing),
        };
        let call = |call: &StoredCall| {
            let arguments = call.arguments.iter().map(argument).collect::<Option<Vec<_>>>()?;
            let values = call.values.iter().map(|number| number.and_then(thing)).collect();
            Some(LastingCall { name: call.name.clone(), arguments, values })
        };
        self.lock().calls = stored.iter().filter_map(call).collect();
    }

    /// Begins to make the calls again. Returns how many there are.
    pub(crate) fn begin_again(&self, inbox: &Inbox) -> usize {
        let state = &mut *self.lock();
        // Their objects are gone, and so is whatever is under way.
        state.begun.clear();
        state.calls.retain(LastingCall::is_held);
        let waiting = |call: &LastingCall| WaitingCall {
            call: call.clone(),
            pause: PAUSES.0,
            not_before: None,
            is_closed: false,
        };
        state.waiting = state.calls.iter().map(waiting).collect();
        if !state.waiting.is_empty() {
            state.sender = Some(Sender::new(inbox));
        }
        state.waiting.len()
    }

    /// Returns the next call that is to be made again now.
    pub(crate) fn next(&self) -> Option<RepeatedCall> {
        let state = &mut *self.lock();
        if state.waiting.is_empty() || state.repeated.1.is_some() {
            return None;
        }
        state.waiting.retain(|waiting| waiting.call.is_held() && !waiting.is_closed);
        let now = Instant::now();
        let place = (0..state.waiting.len()).find(|&place| {
            let WaitingCall { call, not_before, .. } = &state.waiting[place];
            not_before.is_none_or(|time| now >= time)
                && call.given().all(|thing| state.stand_ins.contains_key(&thing.identity()))
                && !state.waiting[..place].iter().any(|earlier| earlier.call.shares(call))
        });
        let Some(place) = place else {
            if state.waiting.is_empty() {
                state.sender = None;
            }
            return None;
        };
        let call = &state.waiting[place].call;
        let argument = |argument: &LastingArgument| match argument {
            LastingArgument::Data(datum) => Some(datum.clone()),
            LastingArgument::Thing(thing) => {
                state.stand_ins.get(&thing.identity()).map(|(_, datum)| datum.clone())
            }
        };
        let arguments = call.arguments.iter().filter_map(argument).collect();
        let name = call.name.clone();
        state.repeated = (state.repeated.0 + 1, Some(place));
        Some(RepeatedCall { number: REPEATED + state.repeated.0, name, arguments })
    }

    /// Takes the values of the call that was made again, or its failure.
    pub(crate) fn answer(
        &self,
        answer: Result<&[Datum], &HostFailure>,
        inbox: &Inbox,
        control: &DurableControl,
    ) {
        let state = &mut *self.lock();
        let Some(place) = state.repeated.1.take() else { return };
        match answer {
            Ok(values) => {
                let WaitingCall { call, is_closed, .. } = state.waiting.remove(place);
                for (thing, value) in call.values.iter().zip(values) {
                    // Without a reference, an object closes itself.
                    if let Some(thing) = thing.as_ref().filter(|_| !is_closed) {
                        state.stand_ins.insert(thing.identity(), (thing.clone(), value.clone()));
                    }
                }
                if state.waiting.is_empty() {
                    state.sender = None;
                }
            }
            Err(failure) => {
                let waiting = &mut state.waiting[place];
                if waiting.not_before.is_none() {
                    let (name, cause) = (&waiting.call.name, &failure.cause);
                    let reason: Vec<String> = failure.arguments.iter().map(Datum::to_string).collect();
                    control.warn(&format!(
                        "a call of {name} from an earlier process has failed in this one: {cause} {}; it is tried again",
                        reason.join(" ")
                    ));
                }
                waiting.not_before = Some(Instant::now() + waiting.pause);
                let (pause, inbox) = (waiting.pause, inbox.clone());
                waiting.pause = (2 * pause).min(PAUSES.1);
                // Without a thread, the next arrival is the occasion.
                _ = std::thread::Builder::new().spawn(move || {
                    std::thread::sleep(pause);
                    inbox.ring();
                });
            }
        }
    }

    /// Takes news of calls that are made again out of those of the run.
    pub(crate) fn take_news(&self, inbox: &Inbox, control: &DurableControl) {
        if self.lock().repeated.1.is_none() {
            return;
        }
        for incoming in inbox.take() {
            match incoming {
                Incoming::Operation { number, news } if number > REPEATED => match &news {
                    News::Completed(values) => self.answer(Ok(values), inbox, control),
                    News::Failed(failure) => self.answer(Err(failure), inbox, control),
                    News::Progress(_) => {}
                },
                other => inbox.put(other),
            }
        }
    }

    /// Returns arguments with objects of this process in place of those that are gone; `None` if none of them
    /// has such an object.
    pub(crate) fn stand_in(&self, arguments: &[Datum]) -> Option<Vec<Datum>> {
        let state = self.lock();
        if state.stand_ins.is_empty() {
            return None;
        }
        let of = |datum: &Datum| match datum.kind() {
            DatumKind::Opaque(thing) => {
                state.stand_ins.get(&thing.identity()).map(|(_, datum)| datum.clone())
            }
            _ => None,
        };
        let found = arguments.iter().any(|datum| of(datum).is_some());
        found.then(|| arguments.iter().map(|datum| of(datum).unwrap_or_else(|| datum.clone())).collect())
    }
}

impl LastingState {
    /// Adds a call that lasts. If it makes no object, it takes the place of an equal one before it: the list
    /// does not grow with a program that repeats a definition or a setting.
    fn add(&mut self, call: LastingCall) {
        if call.values.iter().all(Option::is_none) {
            self.calls.retain(|known| !known.is_equal(&call));
        }
        // Now and then, those of objects that the program has let go of are left out.
        if self.calls.len() >= SOME && self.calls.len().is_power_of_two() {
            self.calls.retain(LastingCall::is_held);
        }
        self.calls.push(call);
    }

    /// Forgets the calls of objects that are closed.
    fn forget(&mut self, closed: &[Datum]) {
        let closed: Vec<HeldThing> = closed.iter().filter_map(HeldThing::of).collect();
        let is_one = |thing: &HeldThing| closed.iter().any(|one| one.identity() == thing.identity());
        self.calls.retain(|call| !call.things().any(is_one));
        for waiting in &mut self.waiting {
            waiting.is_closed |= waiting.call.things().any(is_one);
        }
        self.stand_ins.retain(|_, (thing, _)| !is_one(thing));
    }
}
