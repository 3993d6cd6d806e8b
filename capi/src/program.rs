//! The program in an engine: its definitions, changes of them, and a watch over its facts.

use std::ffi::{c_char, c_void};
use std::ptr;

use esl::Data;
use esl::engine::{FactWatch, ProgramDefinition, WatchedFact};

use crate::border::{freeing, guarded, hand, look_within, store, take, text};
use crate::engine::esl_engine;
use crate::failure::esl_failure;
use crate::function::{UserData, esl_destructor, no_callback};
use crate::observer::RunWatch;
use crate::status::esl_status;
use crate::value::esl_value;

/// Makes the definitions of a text in the program, all at once, or none of them if any fails: calls that are
/// under way keep the code that they have. `name` stands for the text in messages. Stores the number of
/// definitions.
///
/// # Safety
/// `engine` is an engine; `name` and `text` end with null characters; `count` and `failure` are places that
/// can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_patch(
    engine: *const esl_engine,
    name: *const c_char,
    text: *const c_char,
    count: *mut usize,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (name, text) = (self::text(name, "name")?, self::text(text, "text")?);
            store(count, esl_engine::lock(engine)?.patch(name, text)?);
            Ok(())
        })
    }
}

/// Takes the newest patch back: its names mean what they meant before. Stores the number of its definitions;
/// 0 if there is no patch.
///
/// # Safety
/// `engine` is an engine; `count` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_undo_patch(
    engine: *const esl_engine,
    count: *mut usize,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            store(count, esl_engine::lock(engine)?.undo_patch()?.unwrap_or(0));
            Ok(())
        })
    }
}

/// Returns a definition as a property list.
fn row(definition: ProgramDefinition) -> Data {
    let key = |name: &str| Data::Keyword(name.into());
    Data::list([
        key("KIND"),
        Data::Keyword(definition.kind.name().to_uppercase()),
        key("NAME"),
        Data::String(definition.name),
        key("PARAMETERS"),
        Data::String(definition.parameters),
        key("DOCUMENTATION"),
        Data::String(definition.documentation),
    ])
}

/// Stores the definitions of the program in a package, "esl-user" unless it says otherwise, sorted by name: a
/// list of property lists such as (:KIND :FUNCTION :NAME "DRIVE" :PARAMETERS "metres &key (speed 0.1)"
/// :DOCUMENTATION "Drives."). The kinds are function, operation, macro, property, input, variable, constant.
///
/// # Safety
/// `engine` is an engine; `package` ends with a null character; `definitions` and `failure` are places that
/// can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_definitions(
    engine: *const esl_engine,
    package: *const c_char,
    definitions: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let rows = esl_engine::lock(engine)?.definitions(text(package, "name of the package")?)?;
            hand(definitions, esl_value(Data::list(rows.into_iter().map(row))));
            Ok(())
        })
    }
}

/// A watch, over facts or over all events of a run. It belongs to the caller, and lasts until it is freed.
/// From any thread, one at a time.
pub struct esl_watch(#[expect(dead_code, reason = "it is held until it is dropped")] pub(crate) Watched);

/// Facts or a run, over which a watch is; the watch ends when this is dropped.
pub(crate) enum Watched {
    Facts(#[expect(dead_code, reason = "it is held until it is dropped")] FactWatch),
    Run(#[expect(dead_code, reason = "it is held until it is dropped")] RunWatch),
}

/// A function that is told of a change of a fact: whether the fact is in the database now, the fact, and the
/// values of the pattern's variables in it, a property list such as (:ROBOT ROVER :PLACE RIDGE). Both live
/// until it returns. It is called on the thread of the engine, while no task runs: it returns soon, and uses
/// handles only. It must not leave by an exception of C++ or by `longjmp`.
pub type esl_fact_function = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        is_there: bool,
        fact: *const esl_value,
        bindings: *const esl_value,
    ),
>;

struct WatcherOfC {
    function: unsafe extern "C" fn(
        user: *mut c_void,
        is_there: bool,
        fact: *const esl_value,
        bindings: *const esl_value,
    ),
    user: UserData,
}

impl WatcherOfC {
    fn tell(&self, change: WatchedFact) {
        let bindings = change.bindings.iter();
        let bindings = bindings.flat_map(|(name, value)| [Data::Keyword(name.to_owned()), value.clone()]);
        let (fact, bindings) = (esl_value(change.fact), esl_value(Data::list(bindings)));
        let (fact, bindings) = (ptr::from_ref(&fact), ptr::from_ref(&bindings));
        // SAFETY: the embedder has given the function for this pointer; the values live until it returns.
        unsafe { (self.function)(self.user.pointer, change.is_there, fact, bindings) };
    }
}

/// Has a function called for each change of a fact that matches a pattern, such as "(at ?robot ?place)", in
/// the order of the changes, until the watch is freed. With a status other than `ESL_OK`, `user` is freed at
/// once, otherwise with the engine.
///
/// # Safety
/// `engine` is an engine and `pattern` a value; `function` and `destructor` can be called with `user`;
/// `watch` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_watch_facts(
    engine: *const esl_engine,
    pattern: *const esl_value,
    function: esl_fact_function,
    user: *mut c_void,
    destructor: esl_destructor,
    watch: *mut *mut esl_watch,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let watcher = WatcherOfC { function: function.ok_or_else(no_callback)?, user };
            let pattern = look_within(pattern)?.0.clone();
            let begun = esl_engine::lock(engine)?.watch_facts(pattern, move |change| watcher.tell(change))?;
            hand(watch, esl_watch(Watched::Facts(begun)));
            Ok(())
        })
    }
}

/// Ends a watch, and frees it; null is ignored.
///
/// # Safety
/// `watch` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_watch_free(watch: *mut esl_watch) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(watch) }));
}
