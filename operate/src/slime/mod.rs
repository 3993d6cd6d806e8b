//! Sessions of SLIME, the Lisp environment for Emacs: what its requests need and how they are answered.
//!
//! Most requests are functions of the library, in `stdlib/slime*.esl`. Here are the table of them, and the
//! translation of arguments and answers: names from outside stay strings, so they make no symbols in the
//! program.
//!
//! Guarantees: each request is answered, if only by a refusal; each says which role it needs.
//!
//! Source: the protocol of SLIME 2.27.

mod request;

use std::path::Path;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{LockRow, SurveyedTask};

use super::attach::WireForm;
use super::attach::datum::{boolean, integer, list, string};
use super::refusal::{NeededArgument, OperatorRefusal};
use super::secrets::OperatorRole;
use request::{SlimeAnswer, SlimeRequest};

/// Version of the protocol: SLIME asks its user if it has another one.
pub(super) const VERSION: &str = "2.27";

/// The one function that a request may be told to call for each of some rows.
const MAPPED: &str = "swank:kill-nth-thread";

/// The next step for a request of SLIME.
pub(super) enum SlimeStep {
    /// It is answered.
    Answer(WireForm),
    /// The table of tasks is wanted.
    Tasks,
    /// The tasks in these rows of the table are to be aborted.
    AbortTasks(Vec<usize>),
    /// A function of the library is to be called: see `%slime-request`.
    Call(SlimeCall),
}

/// A call of a function of the library.
pub(super) struct SlimeCall {
    /// Name of the function.
    pub(super) function: &'static str,
    /// Its arguments.
    pub(super) arguments: Vec<Datum>,
    /// The row of the task that it is to be called with, in the table of tasks.
    pub(super) task: Option<usize>,
    /// Whether its failures are debugged.
    pub(super) is_evaluation: bool,
}

/// Returns the role that a request needs, and what is to be done for it; `None` if SLIME has no such request.
pub(super) fn step(
    name: &str,
    arguments: &[WireForm],
) -> Option<(OperatorRole, Result<SlimeStep, OperatorRefusal>)> {
    let request = SlimeRequest::named(name)?;
    let number = |form: &WireForm| form.as_integer().and_then(|n| usize::try_from(n).ok());
    let needs_row = || {
        let needed = NeededArgument::TaskRow;
        OperatorRefusal::Argument { request: name.into(), needed }
    };
    let row = || arguments.first().and_then(number).ok_or_else(needs_row);
    let rows = || match arguments {
        [function, rows] if unquoted(function).name().as_deref() == Some(MAPPED) => {
            let rows = unquoted(rows).items().unwrap_or_default();
            rows.iter().map(number).collect::<Option<Vec<usize>>>().ok_or_else(needs_row)
        }
        _ => Err(OperatorRefusal::Wraps { request: name.into(), only: MAPPED }),
    };
    let call = |function, task, is_evaluation| {
        let arguments = arguments.iter().map(datum_of).collect();
        Ok(SlimeStep::Call(SlimeCall { function, arguments, task, is_evaluation }))
    };
    let step = match request.answer {
        SlimeAnswer::Names => Ok(SlimeStep::Answer(names(arguments))),
        SlimeAnswer::Nothing => Ok(SlimeStep::Answer(WireForm::nil())),
        SlimeAnswer::Unknown => Ok(SlimeStep::Answer(WireForm::symbol(":not-implemented"))),
        SlimeAnswer::Folder => {
            let folder = std::env::current_dir().unwrap_or_default();
            Ok(SlimeStep::Answer(WireForm::text(folder.to_string_lossy())))
        }
        SlimeAnswer::Tasks => Ok(SlimeStep::Tasks),
        SlimeAnswer::AbortTask => row().map(|row| SlimeStep::AbortTasks(vec![row])),
        SlimeAnswer::AbortTasks => rows().map(SlimeStep::AbortTasks),
        SlimeAnswer::OfTask(function) => row().and_then(|row| call(function, Some(row), true)),
        SlimeAnswer::Call(function) => call(function, None, false),
        SlimeAnswer::Evaluate(function) => call(function, None, true),
    };
    Some((request.role, step))
}

/// Returns the names that `swank-require` asks for, as strings: SLIME keeps them, and does not ask again.
fn names(arguments: &[WireForm]) -> WireForm {
    let names = arguments.first().map(unquoted);
    let name = |form: &WireForm| match form {
        WireForm::Symbol(name) | WireForm::Text(name) => {
            Some(WireForm::text(name.trim_start_matches(':').to_uppercase()))
        }
        _ => None,
    };
    let names = names.and_then(WireForm::items).unwrap_or_default();
    WireForm::list(names.iter().filter_map(name))
}

/// Returns the form that a quoted one is about.
fn unquoted(form: &WireForm) -> &WireForm {
    match form.items() {
        Some([quote, form]) if quote.name().as_deref() == Some("quote") => form,
        _ => form,
    }
}

/// Names that arguments may have.
const KEYWORDS: [&str; 3] = [":line", ":position", ":offset"];

/// Returns an argument as data, with 0 in place of symbols but `t`, `nil` and a few keywords. The depth of a
/// form is bounded.
fn datum_of(form: &WireForm) -> Datum {
    match unquoted(form) {
        WireForm::Integer(n) => integer(*n),
        WireForm::Text(text) => string(text),
        WireForm::List(items) => list(items.iter().map(datum_of)),
        WireForm::Symbol(name) if name.eq_ignore_ascii_case("t") => boolean(true),
        WireForm::Symbol(name) => match KEYWORDS.iter().find(|keyword| name.eq_ignore_ascii_case(keyword)) {
            Some(keyword) => {
                let symbol = esl_bytecode::symbol::Symbol::keyword(&keyword[1..].to_uppercase());
                Datum::new(DatumKind::Symbol(symbol), Default::default())
            }
            None => integer(0),
        },
    }
}

/// Returns what names the task that a request is about, for the library.
pub(super) fn thread_of(form: &WireForm) -> Datum {
    form.as_integer().map_or(boolean(false), integer)
}

/// Returns the table of tasks, with the properties whose locks each owns.
pub(super) fn table(tasks: &[SurveyedTask], locks: &[LockRow]) -> WireForm {
    let titles = [":id", ":name", ":status", ":holds"].map(WireForm::symbol);
    let held_by = |task: &SurveyedTask| {
        let held = locks.iter().filter(|lock| lock.subscribers.first() == Some(&task.number));
        held.map(|lock| &*lock.property).collect::<Vec<_>>().join(", ")
    };
    let row = |task: &SurveyedTask| {
        let state = match &task.waits_for {
            Some(reason) => format!("waits for {reason}"),
            None => "can run".into(),
        };
        WireForm::list([
            WireForm::Integer(task.number as i64),
            WireForm::text(&task.name),
            WireForm::Text(state),
            WireForm::Text(held_by(task)),
        ])
    };
    WireForm::list([WireForm::list(titles)].into_iter().chain(tasks.iter().map(row)))
}

/// Has the places in an answer name files as Emacs finds them: by absolute paths. A place in a file that is
/// not there, such as one of the library, is unknown.
pub(super) fn settle(form: &mut WireForm) {
    let WireForm::List(items) = form else { return };
    let is_location = items.first().and_then(WireForm::name).as_deref() == Some(":location");
    if let ([_, WireForm::List(place), ..], true) = (&mut items[..], is_location)
        && let [kind, WireForm::Text(file)] = &mut place[..]
        && kind.name().as_deref() == Some(":file")
    {
        match std::path::absolute(Path::new(file)) {
            Ok(path) if path.is_file() => *file = path.to_string_lossy().into_owned(),
            _ => {
                let reason = format!("the file {file} does not exist here");
                *form = WireForm::list([WireForm::symbol(":error"), WireForm::Text(reason)]);
            }
        }
        return;
    }
    items.iter_mut().for_each(settle);
}
