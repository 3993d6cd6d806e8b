//! A session of an operator: what it does for each request.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{
    Answer, FrameVariable, FunctionRef, Incoming, Question, Right, Sender, SurveyRequest, SurveyedTask,
    TaskStanding,
};

use super::datum::{boolean, codes_of, form_of, integer, list, string};
use super::form::WireForm;
use super::request::SessionRequest;
use crate::refusal::{NeededArgument, OperatorRefusal};
use crate::scope::RunScope;
use crate::secrets::OperatorRole;
use crate::slime::{self, SlimeCall, SlimeStep};

/// Ticks that an evaluation may use.
const TICKS: i64 = 100_000_000;
/// Tasks that an evaluation may have made and not seen to their ends at a time.
const MADE: i64 = 1000;
/// Part of the memory of the run that an evaluation may allocate: one of so many.
const PARTS: usize = 2;
/// Tasks that a tree shows.
const TASKS: usize = 1000;

/// A session.
pub(super) struct OperatorSession {
    number: u64,
    role: OperatorRole,
    scope: RunScope,
    /// Permits signals: as long as such a session exists, a run that waits is not deadlocked.
    sender: Option<Sender>,
    /// Numbers of the questions that the machine has yet to answer.
    open: Mutex<BTreeSet<u64>>,
    /// Numbers of the tasks in the table that SLIME was given last.
    table: Mutex<Vec<u64>>,
}

impl OperatorSession {
    pub(super) fn new(number: u64, role: OperatorRole, scope: RunScope) -> OperatorSession {
        let sender = (role >= OperatorRole::Command).then(|| scope.sender());
        OperatorSession { number, role, scope, sender, open: Mutex::default(), table: Mutex::default() }
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
            // The answer is not awaited.
            drop(sender.ask(call("%SESSION-END", vec![integer(self.number as i64)])));
        }
    }

    /// Does what a form asks for, in a package, about a task.
    ///
    /// # Errors
    /// Why it was not done.
    pub(super) async fn perform(
        &self,
        form: &WireForm,
        package: &WireForm,
        thread: &WireForm,
    ) -> Result<WireForm, OperatorRefusal> {
        let items = form.items().unwrap_or_default();
        let name = items.first().and_then(WireForm::name).unwrap_or_default();
        let arguments = items.get(1..).unwrap_or_default();
        let Some(request) = SessionRequest::named(&name) else {
            let Some((role, step)) = slime::step(&name, arguments) else {
                return Err(OperatorRefusal::UnknownRequest(name));
            };
            self.check(&name, role)?;
            return self.take_step(step?, package, thread).await;
        };
        self.check(&name, request.role())?;
        let lacks = |needed| OperatorRefusal::Argument { request: name.clone(), needed };
        let number = || {
            let number = arguments.first().and_then(WireForm::as_integer).and_then(|n| u64::try_from(n).ok());
            number.filter(|&number| number > 0).ok_or_else(|| lacks(NeededArgument::TaskNumber))
        };
        let text = |index: usize| {
            let text = arguments.get(index).and_then(WireForm::as_text);
            text.ok_or_else(|| lacks(NeededArgument::Text(index)))
        };
        match request {
            SessionRequest::Connect => Ok(self.description()),
            SessionRequest::Tasks => {
                let survey = self.survey(SurveyRequest { tasks: TASKS, ..SurveyRequest::default() }).await?;
                let mut tree = survey.tree_text();
                if tree.is_empty() {
                    tree.push_str("No tasks.\n");
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
                let (task, _) = self.task(number).await?;
                self.sender()?.inbox().put(Incoming::Abort(number));
                let when = if self.is_paused().await? { "when the run goes on" } else { "now" };
                Ok(WireForm::Text(format!("; {}, number {number}, is aborted {when}\n", task.name)))
            }
            SessionRequest::Suspend | SessionRequest::Resume => {
                let suspends = request == SessionRequest::Suspend;
                let number = number()?;
                let (task, _) = self.task(number).await?;
                let is_suspended = task.standing == TaskStanding::Suspended;
                let name = task.name;
                if !suspends && !is_suspended {
                    return Ok(WireForm::Text(format!("; {name}, number {number}, is not suspended\n")));
                }
                let arguments = vec![integer(number as i64), boolean(suspends)];
                let answer = self.call("%SESSION-SUSPEND", arguments).await?;
                if answer.name().as_deref() != Some("t") {
                    return Ok(answer);
                }
                let what = match (suspends, is_suspended) {
                    (true, false) => "is suspended, with the tasks that it has made",
                    (true, true) => "is suspended once more: resume it as often",
                    (false, _) => "is resumed, with the tasks that it has made",
                };
                Ok(WireForm::Text(format!("; {name}, number {number}, {what}\n")))
            }
            SessionRequest::Pause | SessionRequest::Continue => {
                let pauses = request == SessionRequest::Pause;
                let was_paused = self.is_paused().await?;
                self.sender()?.inbox().put(Incoming::Pause(pauses));
                Ok(WireForm::text(match (pauses, was_paused) {
                    (true, false) => {
                        "; all tasks stand still; the clock runs on, and `:continue` ends the pause\n"
                    }
                    (true, true) => "; the run is paused already\n",
                    (false, true) => "; the tasks go on\n",
                    (false, false) => "; the run is not paused\n",
                }))
            }
            SessionRequest::Signal => {
                let data = codes_of(text(1)?)?;
                let name = text(0)?.to_uppercase();
                let answer = self.call("%SESSION-SIGNAL", vec![string(&name), data]).await?;
                if answer.name().as_deref() != Some("t") {
                    return Ok(answer);
                }
                let with = if text(1)?.is_empty() { String::new() } else { format!(" with {}", text(1)?) };
                Ok(WireForm::Text(format!("; {name} is signalled{with}\n")))
            }
            SessionRequest::Narrow => {
                let rights = rights_of(arguments).ok_or_else(|| lacks(NeededArgument::Pairs))?;
                self.call("%SESSION-NARROW", vec![integer(self.number as i64), rights]).await
            }
            SessionRequest::Evaluate => self.call_in("%SESSION-EVALUATE", &[text(0)?]).await,
            SessionRequest::Watch => self.call_in("%SESSION-WATCH", &[text(0)?]).await,
            SessionRequest::Complete => self.call_in("%SESSION-COMPLETE", &[text(0)?]).await,
            SessionRequest::Change => self.call_in("%SESSION-PATCH", &[text(0)?, text(1)?]).await,
            SessionRequest::Undo => self.call("%SESSION-UNDO", Vec::new()).await,
        }
    }

    /// Returns the role that a request needs; `None` if there is no such request.
    #[cfg(any(test, fuzzing))]
    pub(super) fn role_for(name: &str) -> Option<OperatorRole> {
        SessionRequest::named(name)
            .map(SessionRequest::role)
            .or_else(|| slime::step(name, &[]).map(|(role, _)| role))
    }

    /// Refuses a request for which the role of this session is not enough.
    fn check(&self, name: &str, role: OperatorRole) -> Result<(), OperatorRefusal> {
        if self.role >= role {
            return Ok(());
        }
        Err(OperatorRefusal::Role { request: name.into(), needed: role, held: self.role })
    }

    /// Does what SLIME has asked for.
    async fn take_step(
        &self,
        step: SlimeStep,
        package: &WireForm,
        thread: &WireForm,
    ) -> Result<WireForm, OperatorRefusal> {
        match step {
            SlimeStep::Answer(answer) => Ok(answer),
            SlimeStep::Tasks => {
                let survey = self
                    .survey(SurveyRequest { tasks: TASKS, data: true, ..SurveyRequest::default() })
                    .await?;
                *self.table() = survey.tasks.iter().map(|task| task.number).collect();
                Ok(slime::table(&survey.tasks, &survey.locks))
            }
            SlimeStep::AbortTasks(rows) => {
                for row in rows {
                    let number = self.task_in_row(row)?;
                    self.task(number).await?;
                    self.sender()?.inbox().put(Incoming::Abort(number));
                }
                Ok(WireForm::symbol("t"))
            }
            SlimeStep::Call(call) => self.call_for_slime(call, package, thread).await,
        }
    }

    fn table(&self) -> MutexGuard<'_, Vec<u64>> {
        // The table is whole at every moment, so a panic elsewhere does not corrupt it.
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn task_in_row(&self, row: usize) -> Result<u64, OperatorRefusal> {
        self.table().get(row).copied().ok_or(OperatorRefusal::NoRow(row))
    }

    /// Calls a function of the library for SLIME. A failure is an error: what it says first.
    async fn call_for_slime(
        &self,
        call: SlimeCall,
        package: &WireForm,
        thread: &WireForm,
    ) -> Result<WireForm, OperatorRefusal> {
        let arguments = match call.task {
            Some(row) => vec![integer(self.task_in_row(row)? as i64)],
            None => call.arguments,
        };
        let arguments = vec![
            integer(self.number as i64),
            string(package.as_text().unwrap_or_default()),
            slime::thread_of(thread),
            self.limits(),
            boolean(call.is_evaluation),
            Datum::symbol(Symbol::esl(call.function), Span::default()),
            list(arguments),
        ];
        let mut answer = self.call("%SLIME-REQUEST", arguments).await?;
        if answer.name().as_deref() == Some(":left") {
            return Err(OperatorRefusal::Left);
        }
        if let Some([kind, WireForm::Text(report), ..]) = answer.items()
            && kind.name().as_deref() == Some(":failed")
        {
            return Err(OperatorRefusal::Failed(report.lines().next().unwrap_or_default().to_string()));
        }
        slime::settle(&mut answer);
        Ok(answer)
    }

    /// Hands a text to the task that has asked for it.
    pub(super) fn typed(&self, thread: &WireForm, text: &str) {
        if self.role >= OperatorRole::Patch
            && let Some(sender) = &self.sender
        {
            let arguments = vec![integer(self.number as i64), slime::thread_of(thread), string(text)];
            // The answer is not awaited.
            drop(sender.ask(call("%SLIME-TYPED", arguments)));
        }
    }

    /// Returns the description of the machine for SLIME, and the role of the session.
    fn description(&self) -> WireForm {
        let plist = |rows: &[(&str, &str)]| {
            WireForm::list(rows.iter().flat_map(|(key, text)| [WireForm::symbol(key), WireForm::text(*text)]))
        };
        let version = env!("CARGO_PKG_VERSION");
        let codings = WireForm::list([WireForm::text("utf-8-unix"), WireForm::text("iso-latin-1-unix")]);
        WireForm::list([
            WireForm::symbol(":pid"),
            WireForm::Integer(std::process::id().into()),
            WireForm::symbol(":style"),
            WireForm::symbol(":spawn"),
            WireForm::symbol(":encoding"),
            WireForm::list([WireForm::symbol(":coding-systems"), codings]),
            WireForm::symbol(":lisp-implementation"),
            plist(&[(":type", "ESL"), (":name", "esl"), (":version", version), (":program", "eslvm")]),
            WireForm::symbol(":machine"),
            plist(&[
                (":instance", "esl"),
                (":type", std::env::consts::ARCH),
                (":version", std::env::consts::OS),
            ]),
            WireForm::symbol(":features"),
            WireForm::list([WireForm::symbol(":esl")]),
            WireForm::symbol(":modules"),
            WireForm::nil(),
            WireForm::symbol(":package"),
            plist(&[(":name", "ESL-USER"), (":prompt", "ESL-USER")]),
            WireForm::symbol(":version"),
            WireForm::text(slime::VERSION),
            WireForm::symbol(":role"),
            WireForm::text(self.role.name()),
        ])
    }

    fn sender(&self) -> Result<&Sender, OperatorRefusal> {
        self.sender.as_ref().ok_or(OperatorRefusal::ObservesOnly)
    }

    async fn is_paused(&self) -> Result<bool, OperatorRefusal> {
        Ok(self.survey(SurveyRequest::default()).await?.figures.is_paused)
    }

    async fn survey(&self, request: SurveyRequest) -> Result<esl_host::Survey, OperatorRefusal> {
        self.scope.survey(request).await.ok_or(OperatorRefusal::Silent)
    }

    /// Returns what there is to say of a task that has not ended, and its frames.
    async fn task(&self, number: u64) -> Result<(SurveyedTask, Vec<esl_host::FrameRow>), OperatorRefusal> {
        let request =
            SurveyRequest { named: vec![number], frames_of: Some(number), ..SurveyRequest::default() };
        let survey = self.survey(request).await?;
        let row = survey.tasks.into_iter().next();
        row.map(|row| (row, survey.frames)).ok_or(OperatorRefusal::NoTask(number))
    }

    async fn backtrace(&self, number: u64) -> Result<WireForm, OperatorRefusal> {
        let (row, frames) = self.task(number).await?;
        let state = row.waits_for.map_or("can run".into(), |reason| format!("waits for {reason}"));
        let mut text = format!("{} {state}, {} ticks\n", row.name, row.ticks);
        for frame in frames {
            let place = frame.place.map_or(String::new(), |place| format!(", {place}"));
            _ = writeln!(text, "  in {}{place}", frame.function);
            text.push_str(&FrameVariable::lines(&frame.variables));
        }
        Ok(WireForm::Text(text))
    }

    async fn facts(&self, arguments: &[WireForm]) -> Result<WireForm, OperatorRefusal> {
        let name = arguments.first().and_then(WireForm::as_text).unwrap_or_default().to_uppercase();
        let from = arguments.get(1).and_then(WireForm::as_integer).and_then(|n| usize::try_from(n).ok());
        let from = from.unwrap_or(0);
        let facts = Some((name.clone(), from));
        let survey = self.survey(SurveyRequest { data: true, facts, ..SurveyRequest::default() }).await?;
        if survey.facts.is_empty() {
            return Ok(WireForm::text("There are none.\n"));
        }
        let mut text = survey.facts.join("\n") + "\n";
        let rows = survey.relations.iter().filter(|row| name.is_empty() || row.name == name);
        let (to, all) = (from + survey.facts.len(), rows.map(|row| row.facts).sum::<usize>());
        if to < all {
            _ = writeln!(text, "; {} to {to} of {all}; `:facts NAME {to}` shows those after these", from + 1);
        }
        Ok(WireForm::Text(text))
    }

    async fn data(&self) -> Result<WireForm, OperatorRefusal> {
        let survey = self.survey(SurveyRequest { data: true, ..SurveyRequest::default() }).await?;
        let mut text = String::new();
        for row in &survey.relations {
            let what = if row.is_property { "property" } else { "relation" };
            let s = if row.facts == 1 { "" } else { "s" };
            _ = writeln!(text, "{what} {}/{}: {} fact{s}", row.name, row.width, row.facts);
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
        Ok(WireForm::Text(if text.is_empty() { "No relations, locks or inputs.\n".into() } else { text }))
    }

    async fn failures(&self) -> Result<WireForm, OperatorRefusal> {
        let survey =
            self.survey(SurveyRequest { failures_after: Some(0), ..SurveyRequest::default() }).await?;
        let mut text = String::new();
        for row in survey.failures {
            let place = row.place.map_or(String::new(), |place| format!(", {place}"));
            let arguments =
                if row.arguments.is_empty() { String::new() } else { format!(" {}", row.arguments) };
            let time = row.time as f64 / 1e9;
            _ = writeln!(text, "{time:>10.3} {} {}{arguments}{place}", row.name, row.cause);
            row.report
                .iter()
                .flat_map(|report| report.lines())
                .for_each(|line| _ = writeln!(text, "    {line}"));
        }
        Ok(WireForm::Text(if text.is_empty() { "Nothing has failed.\n".into() } else { text }))
    }

    /// Returns the limits of an evaluation: ticks, bytes and tasks.
    fn limits(&self) -> Datum {
        let bytes = i64::try_from(self.scope.memory() / PARTS).unwrap_or(i64::MAX);
        list([TICKS, bytes, MADE].map(integer))
    }

    /// Calls a function of the library with the number of this session, these texts, and the limits of
    /// what it may use.
    async fn call_in(&self, function: &str, texts: &[&str]) -> Result<WireForm, OperatorRefusal> {
        let mut arguments = vec![integer(self.number as i64)];
        arguments.extend(texts.iter().map(|text| string(text)));
        arguments.push(self.limits());
        self.call(function, arguments).await
    }

    /// Calls a function of the library. A failure is an answer, too: its report.
    async fn call(&self, function: &str, arguments: Vec<Datum>) -> Result<WireForm, OperatorRefusal> {
        let pending = self.sender()?.ask(call(function, arguments));
        let number = pending.number();
        self.open().insert(number);
        let answer = pending.await;
        self.open().remove(&number);
        match answer {
            Answer::Values(values) => Ok(values.first().map_or(WireForm::nil(), form_of)),
            Answer::Failed { report, full_report, .. } => {
                let full = full_report.map(WireForm::Text);
                let reports = [WireForm::symbol(":failed"), WireForm::Text(report)].into_iter().chain(full);
                Ok(WireForm::list(reports))
            }
            Answer::Aborted | Answer::Exited(_) => Err(OperatorRefusal::Aborted),
            Answer::Circular | Answer::TooLarge => Err(OperatorRefusal::ValueTooLarge),
            Answer::Ended => Err(OperatorRefusal::Ended),
            Answer::Tasks(_) => Err(OperatorRefusal::OtherAnswer),
        }
    }
}

/// Returns the list of rights that the arguments of a request are: names, each before what it is for.
fn rights_of(arguments: &[WireForm]) -> Option<Datum> {
    let (pairs, rest) = arguments.as_chunks::<2>();
    let part = |[name, object]: &[WireForm; 2]| {
        let name = Right::of_name(name.as_text()?)?.name().to_uppercase();
        let right = Datum::symbol(Symbol::keyword(&name), Span::default());
        let object = Some(object.as_text()?).filter(|object| !object.is_empty());
        Some(list([right].into_iter().chain(object.map(string))))
    };
    let rights = pairs.iter().map(part).collect::<Option<Vec<Datum>>>()?;
    (rest.is_empty() && !rights.is_empty()).then(|| list(rights))
}

fn call(function: &str, arguments: Vec<Datum>) -> Question {
    let function = FunctionRef::Named(format!("ESL::{function}"));
    Question::Call { function, arguments, goes_first: false }
}
