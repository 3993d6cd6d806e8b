//! A session of an operator: what it does for each request.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_vm::host::{Answer, FunctionRef, Incoming, Question, Sender, SurveyRequest, SurveyedTask};

use super::form::WireForm;
use super::request::SessionRequest;
use crate::operate::scope::RunScope;
use crate::operate::secrets::OperatorRole;

/// Ticks that an evaluation may use.
const TICKS: i64 = 100_000_000;
/// Tasks that a tree shows.
const TASKS: usize = 1000;

/// A session.
pub(super) struct OperatorSession {
    number: u64,
    role: OperatorRole,
    scope: RunScope,
    /// Who may signal something: as long as such a session is there, a run that waits is not deadlocked.
    sender: Option<Sender>,
    /// Numbers of the questions that the machine has yet to answer.
    open: Mutex<BTreeSet<u64>>,
}

impl OperatorSession {
    pub(super) fn new(number: u64, role: OperatorRole, scope: RunScope) -> OperatorSession {
        let sender = (role >= OperatorRole::Command).then(|| scope.sender());
        OperatorSession { number, role, scope, sender, open: Mutex::default() }
    }

    fn open(&self) -> MutexGuard<'_, BTreeSet<u64>> {
        // The set is whole at every moment, so a panic elsewhere does not corrupt it.
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Has the calls aborted that are under way.
    pub(super) fn interrupt(&self) {
        if let Some(sender) = &self.sender {
            self.open().iter().for_each(|&number| sender.inbox().put(Incoming::AbortCall(number)));
        }
    }

    /// Ends what the session has begun.
    pub(super) fn end(&self) {
        self.interrupt();
        if self.role >= OperatorRole::Patch
            && let Some(sender) = &self.sender
        {
            // Nobody waits for the answer.
            drop(sender.ask(call("%SESSION-END", vec![integer(self.number as i64)])));
        }
    }

    /// Does what a form asks for.
    ///
    /// # Errors
    /// Why it was not done.
    pub(super) async fn perform(&self, form: &WireForm) -> Result<WireForm, String> {
        let items = form.items().unwrap_or_default();
        let name = items.first().and_then(WireForm::name).unwrap_or_default();
        let Some(request) = SessionRequest::named(&name) else {
            return Err(format!("`{name}` is no request of a session"));
        };
        if self.role < request.role() {
            return Err(format!(
                "`{name}` needs the role {}, and this session has {}",
                request.role(),
                self.role
            ));
        }
        let arguments = &items[1..];
        let number = || {
            let number = arguments.first().and_then(WireForm::as_integer).and_then(|n| u64::try_from(n).ok());
            number.filter(|&number| number > 0).ok_or_else(|| format!("`{name}` needs the number of a task"))
        };
        let text = |index: usize| {
            let text = arguments.get(index).and_then(WireForm::as_text);
            text.ok_or_else(|| format!("`{name}` needs a string as argument {}", index + 1))
        };
        match request {
            SessionRequest::Connect => Ok(self.description()),
            SessionRequest::Tasks => {
                let survey = self.look(SurveyRequest { tasks: TASKS, ..SurveyRequest::default() }).await?;
                let mut tree = survey.tree_text();
                if tree.is_empty() {
                    tree.push_str("There are no tasks.\n");
                }
                if survey.has_more_tasks {
                    let all: u64 = survey.figures.tasks.iter().sum();
                    _ = writeln!(tree, "and {} more", all as usize - survey.tasks.len().min(all as usize));
                }
                Ok(WireForm::Text(tree))
            }
            SessionRequest::Backtrace => self.backtrace(number()?).await,
            SessionRequest::Facts => self.facts(arguments).await,
            SessionRequest::Data => self.data().await,
            SessionRequest::Failures => self.failures().await,
            SessionRequest::Abort => {
                let number = number()?;
                self.task(number).await?;
                self.sender()?.inbox().put(Incoming::Abort(number));
                Ok(WireForm::symbol("t"))
            }
            SessionRequest::Suspend | SessionRequest::Resume => {
                let suspends = request == SessionRequest::Suspend;
                let arguments = vec![integer(number()? as i64), boolean(suspends)];
                self.call("%SESSION-SUSPEND", arguments).await
            }
            SessionRequest::Pause | SessionRequest::Continue => {
                self.sender()?.inbox().put(Incoming::Pause(request == SessionRequest::Pause));
                Ok(WireForm::symbol("t"))
            }
            SessionRequest::Signal => {
                let data = codes_of(text(1)?)?;
                self.call("%SESSION-SIGNAL", vec![string(&text(0)?.to_uppercase()), data]).await
            }
            SessionRequest::Evaluate => self.call_in("%SESSION-EVALUATE", &[text(0)?]).await,
            SessionRequest::Watch => self.call_in("%SESSION-WATCH", &[text(0)?]).await,
            SessionRequest::Complete => self.call_in("%SESSION-COMPLETE", &[text(0)?]).await,
            SessionRequest::Change => self.call_in("%SESSION-PATCH", &[text(0)?, text(1)?]).await,
            SessionRequest::Undo => self.call("%SESSION-UNDO", Vec::new()).await,
        }
    }

    fn description(&self) -> WireForm {
        WireForm::list([
            WireForm::symbol(":lisp-implementation"),
            WireForm::list([
                WireForm::symbol(":type"),
                WireForm::text("ESL"),
                WireForm::symbol(":name"),
                WireForm::text("esl"),
            ]),
            WireForm::symbol(":version"),
            WireForm::text(env!("CARGO_PKG_VERSION")),
            WireForm::symbol(":role"),
            WireForm::text(self.role.name()),
        ])
    }

    fn sender(&self) -> Result<&Sender, String> {
        self.sender.as_ref().ok_or_else(|| "this session may only look".into())
    }

    async fn look(&self, request: SurveyRequest) -> Result<esl_vm::host::Survey, String> {
        self.scope.survey(request).await.ok_or_else(|| "the machine does not answer".into())
    }

    /// Returns what there is to say of a task that has not ended, and its frames.
    async fn task(&self, number: u64) -> Result<(SurveyedTask, Vec<esl_vm::host::FrameRow>), String> {
        let request =
            SurveyRequest { named: vec![number], frames_of: Some(number), ..SurveyRequest::default() };
        let survey = self.look(request).await?;
        let row = survey.tasks.into_iter().next();
        row.map(|row| (row, survey.frames)).ok_or_else(|| format!("there is no task {number}"))
    }

    async fn backtrace(&self, number: u64) -> Result<WireForm, String> {
        let (row, frames) = self.task(number).await?;
        let state = row.waits_for.map_or("can run".into(), |reason| format!("waits for {reason}"));
        let mut text = format!("{} {state}, {} ticks\n", row.name, row.ticks);
        for frame in frames {
            let place = frame.place.map_or(String::new(), |place| format!(", {place}"));
            _ = writeln!(text, "  in {}{place}", frame.function);
        }
        Ok(WireForm::Text(text))
    }

    async fn facts(&self, arguments: &[WireForm]) -> Result<WireForm, String> {
        let name = arguments.first().and_then(WireForm::as_text).unwrap_or_default().to_uppercase();
        let from = arguments.get(1).and_then(WireForm::as_integer).and_then(|n| usize::try_from(n).ok());
        let request = SurveyRequest { facts: Some((name, from.unwrap_or(0))), ..SurveyRequest::default() };
        let facts = self.look(request).await?.facts;
        Ok(WireForm::Text(if facts.is_empty() {
            "There are none.\n".into()
        } else {
            facts.join("\n") + "\n"
        }))
    }

    async fn data(&self) -> Result<WireForm, String> {
        let survey = self.look(SurveyRequest { data: true, ..SurveyRequest::default() }).await?;
        let mut text = String::new();
        for row in &survey.relations {
            let what = if row.is_property { "property" } else { "relation" };
            _ = writeln!(text, "{what} {} of {}: {} facts", row.name, row.width, row.facts);
        }
        for row in &survey.locks {
            let tasks: Vec<String> = row.subscribers.iter().map(u64::to_string).collect();
            _ = writeln!(text, "lock {}: {}, tasks {}", row.property, row.state, tasks.join(" "));
        }
        for row in &survey.inputs {
            _ = writeln!(
                text,
                "input {}: {} of {} kept, {} signals, {} dropped",
                row.name, row.kept, row.capacity, row.signals, row.dropped
            );
        }
        Ok(WireForm::Text(if text.is_empty() {
            "There are no relations, locks or inputs.\n".into()
        } else {
            text
        }))
    }

    async fn failures(&self) -> Result<WireForm, String> {
        let survey = self.look(SurveyRequest { failures_after: Some(0), ..SurveyRequest::default() }).await?;
        let mut text = String::new();
        for row in survey.failures {
            let place = row.place.map_or(String::new(), |place| format!(", {place}"));
            _ = writeln!(text, "{:>10.3} {} {}{place}", row.time as f64 / 1e9, row.name, row.cause);
            row.report
                .iter()
                .flat_map(|report| report.lines())
                .for_each(|line| _ = writeln!(text, "    {line}"));
        }
        Ok(WireForm::Text(if text.is_empty() { "Nothing has failed.\n".into() } else { text }))
    }

    /// Calls a function of the library with the number of this session, these texts, and the ticks that it
    /// may use.
    async fn call_in(&self, function: &str, texts: &[&str]) -> Result<WireForm, String> {
        let mut arguments = vec![integer(self.number as i64)];
        arguments.extend(texts.iter().map(|text| string(text)));
        arguments.push(integer(TICKS));
        self.call(function, arguments).await
    }

    /// Calls a function of the library. A failure is an answer, too: its report.
    async fn call(&self, function: &str, arguments: Vec<Datum>) -> Result<WireForm, String> {
        let pending = self.sender()?.ask(call(function, arguments));
        let number = pending.number();
        self.open().insert(number);
        let answer = pending.await;
        self.open().remove(&number);
        match answer {
            Answer::Values(values) => Ok(values.first().map_or(WireForm::nil(), form_of)),
            Answer::Failed { report, .. } => {
                Ok(WireForm::list([WireForm::symbol(":failed"), WireForm::Text(report)]))
            }
            Answer::Aborted => Err("aborted".into()),
            Answer::Circular | Answer::TooLarge => Err("the value is too large".into()),
            Answer::Ended => Err("the run has ended".into()),
            Answer::Tasks(_) => Err("it has another answer".into()),
        }
    }
}

fn call(function: &str, arguments: Vec<Datum>) -> Question {
    let function = FunctionRef::Named(format!("ESL::{function}"));
    Question::Call { function, arguments, is_urgent: false }
}

/// Returns what stands for the data of a text: as `sessions.esl` says, so that their symbols are not made.
///
/// # Errors
/// Why it is no data.
pub(in crate::operate) fn codes_of(text: &str) -> Result<Datum, String> {
    let form =
        WireForm::parse(&format!("({text})")).map_err(|reason| format!("`{text}` is no data: {reason}"))?;
    Ok(list(form.items().unwrap_or_default().iter().map(code_of)))
}

// The depth of a form is bounded.
fn code_of(form: &WireForm) -> Datum {
    match form {
        WireForm::Integer(n) => integer(*n),
        WireForm::Text(text) => list([integer(0), string(text)]),
        WireForm::List(items) => list([integer(1)].into_iter().chain(items.iter().map(code_of))),
        WireForm::Symbol(name) => match name.parse::<f64>() {
            Ok(number) if number.is_finite() && name.contains(|c: char| c.is_ascii_digit()) => {
                Datum::new(DatumKind::Float(number), Span::default())
            }
            _ => string(&name.to_uppercase()),
        },
    }
}

fn list(items: impl IntoIterator<Item = Datum>) -> Datum {
    Datum::list(items.into_iter().collect::<Vec<_>>(), Span::default())
}

fn integer(n: i64) -> Datum {
    Datum::integer(n, Span::default())
}

fn string(text: &str) -> Datum {
    Datum::string(text, Span::default())
}

fn boolean(is_true: bool) -> Datum {
    if is_true {
        Datum::symbol(esl_bytecode::symbol::Symbol::cl("T"), Span::default())
    } else {
        Datum::nil(Span::default())
    }
}

/// Returns a value of the library's as a form: strings, integers and symbols, and lists of them.
fn form_of(datum: &Datum) -> WireForm {
    let Some(items) = datum.as_list() else { return atom_of(datum) };
    WireForm::List(items.iter().map(|item| atom_of(item)).collect())
}

fn atom_of(datum: &Datum) -> WireForm {
    match datum.kind() {
        DatumKind::String(text) => WireForm::text(&**text),
        DatumKind::Symbol(symbol) if symbol.is_keyword() => {
            WireForm::Symbol(format!(":{}", symbol.name().to_lowercase()))
        }
        DatumKind::Symbol(symbol) if symbol.is_cl("NIL") => WireForm::nil(),
        DatumKind::Symbol(symbol) => WireForm::Symbol(symbol.name().to_lowercase()),
        _ => datum.to_string().parse().map_or_else(|_| WireForm::text(datum.to_string()), WireForm::Integer),
    }
}
