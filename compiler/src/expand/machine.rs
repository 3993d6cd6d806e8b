//! The machine of jobs that expands one form after another.
//!
//! A job expands one form into one node, or does what has to be done between two forms. Jobs stand on a stack, so a
//! form of any depth takes no native stack, and the machine can stop at any macro call and go on when the answer comes.
//!
//! Invariants: jobs run in the order of the text, from left to right; a hole is filled by exactly one job; names enter
//! and leave the [`Scope`] by jobs only, never while a form is being looked at.

use esl_bytecode::compile::{Answer, Environment, MacroCall};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::chunk::{Chunk, Open, Purpose};
use super::form::{Checked, Form, is_known};
use super::lambda::LambdaText;
use super::modify::PlaceUse;
use super::origin::Origin;
use super::place::Place;
use super::scope::{Entry, Scope};
use super::toplevel::Top;
use super::unit::Unit;
use crate::core::{LambdaId, NodeId, NodeKind, VarId};
use crate::diagnostic::code;

/// How deeply nodes may be nested.
pub(super) const MAX_DEPTH: u32 = 5_000;

/// Where an expansion goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct To {
    /// The node to be filled.
    pub(super) node: NodeId,
    /// The lambda that the node is in.
    pub(super) lambda: LambdaId,
    /// How deeply the node is nested.
    pub(super) depth: u32,
    /// The macro call that made the form, as an index.
    pub(super) origin: Option<u32>,
    /// Where the form was written, or the one around it.
    pub(super) span: Span,
    /// Whether nothing is done with the value.
    pub(super) is_dropped: bool,
}

/// Something to be done.
#[derive(Debug)]
pub(super) enum Job {
    /// Expands a form.
    Expand(Datum, To),
    /// Gives names meanings.
    Enter(Vec<Entry>),
    /// Takes the newest meanings back.
    Leave(usize),
    /// Expands a function's text.
    Lambda(Box<LambdaText>, LambdaId, To),
    /// Compiles the function of a local macro, given as a form.
    Macro(Datum, To),
    /// Gives local macros their functions, the newest of the kept objects.
    EnterMacros(Vec<Symbol>),
    /// Looks at the finished body of a recovery clause, which may be empty.
    CheckClause(To, bool),
    /// Looks at the finished text of a local function, which is kept in this variable.
    CheckReturn(VarId, LambdaId),
    /// Processes a top-level form.
    TopLevel(Datum, Top),
    /// Ends a chunk.
    FinishChunk,
    /// Finds the five parts of a place.
    Place(Datum, To),
    /// Uses the newest places.
    Use(Box<PlaceUse>, To),
}

/// Why the machine stopped.
#[derive(Debug)]
pub enum Event {
    /// A macro is to be run: go on with [`Answer::Expansion`] or [`Answer::Failed`].
    Macro(MacroCall),
    /// A chunk is finished. If it is to be kept, go on with [`Answer::Object`] or [`Answer::Failed`]; if it is to be
    /// loaded and that failed, with [`Answer::Failed`].
    Chunk(Box<Chunk>),
    /// All forms are expanded.
    Done,
}

/// What the machine needs the next answer for.
#[derive(Debug)]
pub(super) enum Waiting {
    /// Nothing.
    Nothing,
    /// The expansion of a form.
    Form(To),
    /// What a compiler macro makes of a call.
    Call(Form, To),
    /// The expansion of a place.
    Place(To),
    /// The five values of a `define-setf-expander`.
    Five(Datum, To),
    /// The expansion of a top-level form.
    TopLevel(Top),
    /// The function of a local macro.
    Object(Span),
    /// Whether a chunk could be loaded.
    Load(Span),
}

/// The expander's state between two steps.
#[derive(Debug)]
pub(super) struct Machine {
    /// What is to be done, the next thing last.
    pub(super) jobs: Vec<Job>,
    /// The chunks under construction, the innermost last.
    pub(super) open: Vec<Open>,
    /// What local names mean here.
    pub(super) scope: Scope,
    /// The macro calls of this top-level form.
    pub(super) origins: Vec<Origin>,
    /// Places that were found and are still to be used.
    pub(super) places: Vec<Place>,
    /// Functions of local macros that still have no name; `None` for one that failed.
    pub(super) objects: Vec<Option<ObjectId>>,
    /// What the next answer is about.
    pub(super) waiting: Waiting,
    /// Why the machine stops after this job.
    pub(super) stopped: Option<Event>,
    /// Findings that nobody has taken yet.
    pub(super) diagnostics: Vec<Diagnostic>,
    /// Code, place and message of all findings.
    pub(super) reported: FxHashSet<(&'static str, Span, String)>,
    /// How many errors there have been.
    pub(super) errors: usize,
    /// How many macro calls this top-level form has taken.
    pub(super) expansions: u32,
    /// Whether the limit on depth was reported for this top-level form.
    pub(super) is_too_deep: bool,
    /// Uses and definitions of global names.
    pub(super) unit: Unit,
}

impl Machine {
    pub(super) fn new() -> Machine {
        Machine {
            jobs: Vec::new(),
            open: Vec::new(),
            scope: Scope::default(),
            origins: Vec::new(),
            places: Vec::new(),
            objects: Vec::new(),
            waiting: Waiting::Nothing,
            stopped: None,
            diagnostics: Vec::new(),
            reported: FxHashSet::default(),
            errors: 0,
            expansions: 0,
            is_too_deep: false,
            unit: Unit::default(),
        }
    }

    // ---- running

    /// Begins a top-level form.
    pub(super) fn begin(&mut self, form: Datum, top: Top) {
        debug_assert!(self.jobs.is_empty() && self.open.is_empty(), "the last form is finished");
        self.origins.clear();
        self.expansions = 0;
        self.is_too_deep = false;
        self.jobs.push(Job::TopLevel(form, top));
    }

    /// Works until something is needed from outside.
    pub(super) fn run(&mut self, environment: &mut dyn Environment, charge: &mut dyn FnMut(u64)) -> Event {
        loop {
            let Some(job) = self.jobs.pop() else { return Event::Done };
            charge(1);
            self.work(environment, job);
            if let Some(event) = self.stopped.take() {
                return event;
            }
        }
    }

    fn work(&mut self, environment: &mut dyn Environment, job: Job) {
        match job {
            Job::Expand(form, to) => {
                let to = at(to, &form);
                let outcome = self.expand(environment, form, to);
                self.settle(outcome, to);
            }
            Job::Enter(entries) => {
                let level = self.level();
                for entry in entries {
                    self.scope.enter(entry, level);
                }
            }
            Job::Leave(count) => {
                for _ in 0..count {
                    if let Some(gone) = self.scope.leave() {
                        self.check_use(&gone);
                    }
                }
            }
            Job::Lambda(text, lambda, to) => self.expand_lambda(environment, *text, lambda, to),
            Job::Macro(form, to) => {
                let purpose = Purpose { emit: false, load: true, keep: true };
                let inside = self.begin_chunk(to.span, to.origin, purpose);
                self.schedule([Job::Expand(form, inside), Job::FinishChunk]);
            }
            Job::CheckClause(to, is_empty) => self.check_clause(to, is_empty),
            Job::CheckReturn(function, lambda) => self.check_return(function, lambda),
            Job::EnterMacros(names) => self.enter_macros(names),
            Job::TopLevel(form, top) => {
                let top = top.at(&form);
                let outcome = self.top_level(environment, form, top);
                if let Err(diagnostic) = outcome {
                    self.report(*diagnostic, top.origin);
                }
            }
            Job::FinishChunk => self.finish_chunk(),
            Job::Place(form, to) => {
                let to = at(to, &form);
                let outcome = self.find_place(environment, form, to);
                if let Err(diagnostic) = outcome {
                    self.report(*diagnostic, to.origin);
                    self.places.push(Place::broken(to.span));
                }
            }
            Job::Use(usage, to) => {
                let outcome = self.use_places(environment, *usage, to);
                self.settle(outcome, to);
            }
        }
    }

    /// Reports what is wrong with a form, and puts `NIL` in its place so that its neighbours can be looked at.
    fn settle(&mut self, outcome: Checked, to: To) {
        if let Err(diagnostic) = outcome {
            self.report(*diagnostic, to.origin);
            self.fill_nil(to);
        }
    }

    /// Puts jobs on the stack so that they run in the order given, before all that stand there.
    pub(super) fn schedule<I>(&mut self, jobs: I)
    where
        I: IntoIterator<Item = Job>,
        I::IntoIter: DoubleEndedIterator,
    {
        self.jobs.extend(jobs.into_iter().rev());
    }

    /// Takes the answer to what the machine stopped for.
    pub(super) fn answer(&mut self, answer: Answer) {
        let waiting = std::mem::replace(&mut self.waiting, Waiting::Nothing);
        match (waiting, answer) {
            (Waiting::Form(to), Answer::Expansion(form)) => self.jobs.push(Job::Expand(form, to)),
            (Waiting::Call(call, to), Answer::Expansion(form)) => {
                // A compiler macro that gives the form back leaves the call as it is.
                let form = if form.is_same(&call.datum) { call.globally() } else { form };
                self.jobs.push(Job::Expand(form, to));
            }
            (Waiting::Call(call, to), _) => self.jobs.push(Job::Expand(call.globally(), to)),
            (Waiting::Place(to), Answer::Expansion(form)) => self.jobs.push(Job::Place(form, to)),
            (Waiting::Five(place, to), Answer::Expansion(values)) => {
                let outcome = Place::from_values(&place, &values, to.span);
                match outcome {
                    Ok(place) => self.places.push(place),
                    Err(diagnostic) => {
                        self.report(*diagnostic, to.origin);
                        self.places.push(Place::broken(to.span));
                    }
                }
            }
            (Waiting::TopLevel(top), Answer::Expansion(form)) => self.jobs.push(Job::TopLevel(form, top)),
            (Waiting::Object(_), Answer::Object(object)) => self.objects.push(Some(object)),
            (Waiting::Form(to), Answer::Failed(failure)) => {
                self.macro_failed(&failure, to.origin, to.span);
                self.fill_nil(to);
            }
            (Waiting::Place(to) | Waiting::Five(_, to), Answer::Failed(failure)) => {
                self.macro_failed(&failure, to.origin, to.span);
                self.places.push(Place::broken(to.span));
            }
            (Waiting::TopLevel(top), Answer::Failed(failure)) => {
                self.macro_failed(&failure, top.origin, top.span);
            }
            (Waiting::Object(span), Answer::Failed(failure)) => {
                let message = format!("the definition of a local macro failed: {failure}");
                self.report(code::MACRO_FAILED.at(span, message), None);
                self.objects.push(None);
            }
            (Waiting::Load(span), Answer::Failed(failure)) => {
                self.report(
                    code::COMPILE_TIME_FAILURE
                        .at(span, format!("this form failed at compile time: {failure}")),
                    None,
                );
            }
            (Waiting::Object(_), _) => self.objects.push(None),
            // Nothing was to be told, or the driver has mixed up its answers: the form stays what it is.
            (Waiting::Form(to), _) => self.fill_nil(to),
            (Waiting::Place(to) | Waiting::Five(_, to), _) => self.places.push(Place::broken(to.span)),
            (Waiting::Nothing | Waiting::TopLevel(_) | Waiting::Load(_), _) => {}
        }
    }

    // ---- forms

    fn expand(&mut self, environment: &mut dyn Environment, datum: Datum, to: To) -> Checked {
        if to.depth > MAX_DEPTH {
            return self.too_deep(to);
        }
        match datum.kind() {
            DatumKind::Symbol(symbol) => {
                let symbol = symbol.clone();
                self.expand_variable(environment, &symbol, &datum, to)
            }
            DatumKind::Cons(head, _) => {
                let form = Form::of(&datum, to.span)?;
                match head.kind() {
                    DatumKind::Symbol(_) => self.expand_operation(environment, form, to),
                    _ => self.expand_lambda_call(environment, form, to),
                }
            }
            _ => {
                self.fill(to, NodeKind::Constant(datum));
                Ok(())
            }
        }
    }

    fn too_deep(&mut self, to: To) -> Checked {
        if self.is_too_deep {
            self.errors += 1;
            self.fill_nil(to);
            return Ok(());
        }
        self.is_too_deep = true;
        let message = format!("forms are nested more than {MAX_DEPTH} deep");
        Err(Box::new(code::NESTED_TOO_DEEPLY.at(to.span, message)))
    }
}

/// `to`, with the place of `form` if that is known.
fn at(to: To, form: &Datum) -> To {
    if is_known(form.span()) { To { span: form.span(), ..to } } else { to }
}
