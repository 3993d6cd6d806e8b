//! The expander's state, and the loop over its jobs.
//!
//! Jobs stand on a stack. So a form of any depth takes no native stack, and the expander can stop at any
//! macro call and continue when the answer comes.
//!
//! Invariants: jobs run in the order of the text, from left to right; exactly one job fills a hole; only jobs
//! change the [`Scope`], never the code that looks at a form.

use esl_bytecode::compile::{Environment, MacroCall, MacroRef, StepOutcome, Work};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::chunk::{Chunk, OpenChunk, Purpose};
use super::failure::{FailurePlace, MacroFailure};
use super::form::{Checked, Form, Make, name};
use super::global::GlobalUses;
use super::job::{AwaitedOutcome, Job, To, Top};
use super::origin::{OriginId, Origins};
use super::scope::Scope;
use super::setf::SetfExpansion;
use super::warning::AllowedWarnings;
use crate::core::NodeKind;
use crate::diagnostic::code;

/// Limit on the nesting of nodes.
pub(super) const MAX_DEPTH: u32 = 5_000;

/// Limit on the size of the expansion of one top-level form, in bytes.
const MAX_BYTES: usize = 64 << 20;
/// Limit on the parts of data that go through the macros of one top-level form, as calls or expansions.
const MAX_PASSED: u64 = 10_000_000;
/// Forms after which the size of the expansion is looked at again.
const MEASURED_EACH: u32 = 256;
/// Names that come into scope, or go out of it, in one job.
const NAMES_AT_ONCE: usize = 32;

/// Expands a form of an operator into a node.
pub(super) type Operator = fn(&mut Expander, &mut dyn Environment, Form, To) -> Checked;

/// Why the expander stopped.
#[derive(Debug)]
pub enum Stop {
    /// A macro is to be run. Continue with [`StepOutcome::Expansion`] or [`StepOutcome::Failed`].
    Macro(MacroCall),
    /// A chunk is finished. If it is to be kept, continue with [`StepOutcome::Object`] or
    /// [`StepOutcome::Failed`]; if it is to be loaded and that failed, with [`StepOutcome::Failed`].
    Chunk(Box<Chunk>),
    /// The work that is allowed is done. Continue.
    More,
    /// All forms are expanded.
    Done,
}

/// Expands the forms of one compilation unit, one after another.
#[derive(Debug)]
pub struct Expander {
    /// Returns the operator of a name, if the compiler knows one.
    pub(super) find_operator: fn(&Symbol) -> Option<Operator>,
    /// Jobs to be done, the next one last.
    pub(super) jobs: Vec<Job>,
    /// Chunks under construction, the innermost last.
    pub(super) open: Vec<OpenChunk>,
    /// Meanings of local names.
    pub(super) scope: Scope,
    /// Macro calls of the current top-level form.
    pub(super) origins: Origins,
    /// Places that are found but not used yet.
    pub(super) places: Vec<SetfExpansion>,
    /// Functions of local macros that have no name yet; `None` for one whose definition failed.
    pub(super) objects: Vec<Option<ObjectId>>,
    /// The request that the next answer belongs to.
    pub(super) waiting: AwaitedOutcome,
    /// Form of the last macro call for which the expander stopped.
    pub(super) call: Option<Datum>,
    /// Why the expander stops after the current job.
    pub(super) stopped: Option<Stop>,
    /// Findings that have not been taken yet.
    pub(super) diagnostics: Vec<Diagnostic>,
    /// Code, place and message of all findings.
    pub(super) reported: FxHashSet<(&'static str, Span, String)>,
    /// Number of errors so far.
    pub(super) errors: usize,
    /// Warnings that forms allow.
    pub(super) allowed: Vec<AllowedWarnings>,
    /// Whether the forms are those of a file, to which objects cannot be written.
    pub(super) is_file: bool,
    /// Whether the limit on depth has been reported for the current top-level form.
    is_too_deep: bool,
    /// Whether a limit on the expansion of the current top-level form has been reported. Its other forms are
    /// left out.
    is_given_up: bool,
    /// Parts of data that went through the macros of the current top-level form.
    passed: u64,
    /// Jobs until the size of the current top-level form is looked at.
    unmeasured: u32,
    /// Number of bindings of `let` forms that are known to be in order.
    pub(super) checked_parts: u64,
    /// Uses and definitions of global names.
    pub(super) globals: GlobalUses,
    /// Forms of the current top-level form that handle failures.
    pub(super) guards: Vec<Span>,
}

impl Expander {
    /// Creates an expander that knows the operators that `find_operator` finds.
    pub(super) fn with_operators(find_operator: fn(&Symbol) -> Option<Operator>) -> Expander {
        Expander {
            find_operator,
            jobs: Vec::new(),
            open: Vec::new(),
            scope: Scope::default(),
            origins: Origins::default(),
            places: Vec::new(),
            objects: Vec::new(),
            waiting: AwaitedOutcome::Nothing,
            call: None,
            stopped: None,
            diagnostics: Vec::new(),
            reported: FxHashSet::default(),
            errors: 0,
            allowed: Vec::new(),
            is_file: false,
            is_too_deep: false,
            is_given_up: false,
            passed: 0,
            unmeasured: 0,
            checked_parts: 0,
            globals: GlobalUses::default(),
            guards: Vec::new(),
        }
    }

    /// Begins a form of a file. The form before it must be finished ([`Stop::Done`]).
    pub fn begin_file_form(&mut self, form: Datum) {
        self.is_file = true;
        self.begin(form, Top::file());
    }

    /// Begins a form for `eval`. The value of the last chunk that is to be emitted is that of the form.
    pub fn begin_evaluation(&mut self, form: Datum) {
        self.is_file = false;
        self.begin(form, Top::evaluate());
    }

    fn begin(&mut self, form: Datum, top: Top) {
        debug_assert!(self.jobs.is_empty() && self.open.is_empty(), "the last form is finished");
        self.origins.clear();
        self.guards.clear();
        self.is_too_deep = false;
        self.is_given_up = false;
        self.passed = 0;
        self.jobs.push(Job::TopLevel(form, top));
    }

    /// Works until something is needed from outside, or the work that is allowed is done.
    pub fn run(&mut self, environment: &mut dyn Environment, work: &mut Work) -> Stop {
        self.passed += work.take_passed();
        loop {
            let Some(job) = self.jobs.pop() else { return Stop::Done };
            let before = self.progress();
            self.work(environment, job);
            work.add(self.progress().saturating_sub(before) + 1);
            if let Some(stop) = self.stopped.take() {
                return stop;
            }
            if work.is_done() {
                return Stop::More;
            }
        }
    }

    /// Returns the number of nodes in the chunk that is being built, and of the bindings looked at before.
    fn progress(&self) -> u64 {
        self.open.last().map_or(0, |open| open.core.nodes.len() as u64) + self.checked_parts
    }

    /// Returns about how many bytes the expansion of the current top-level form takes.
    pub fn bytes(&self) -> usize {
        let jobs = self.jobs.capacity() * size_of::<Job>();
        let open: usize = self.open.iter().map(|open| open.core.bytes()).sum();
        jobs + open + self.origins.bytes()
    }

    /// Whether the compiler itself expands forms of the operator `symbol`.
    pub(super) fn is_operator(&self, symbol: &Symbol) -> bool {
        (self.find_operator)(symbol).is_some()
    }

    // ---- jobs

    /// Puts jobs on the stack so that they run in the order given, before all others.
    pub(super) fn schedule<I>(&mut self, jobs: I)
    where
        I: IntoIterator<Item = Job>,
        I::IntoIter: DoubleEndedIterator,
    {
        self.jobs.extend(jobs.into_iter().rev());
    }

    fn work(&mut self, environment: &mut dyn Environment, job: Job) {
        if self.is_given_up {
            match job {
                Job::Expand(_, to) => return self.fill_nil(to),
                Job::CheckLet(state) => return self.fill_nil(state.to),
                Job::Cond(state) => return self.fill_nil(state.to),
                Job::LocalFunctions(state) => return self.fill_nil(state.to),
                Job::Place(_, to) => return self.places.push(SetfExpansion::broken(to.span)),
                Job::Macro(..) => return self.objects.push(None),
                Job::TopLevel(..) => return,
                _ => {}
            }
        }
        match job {
            Job::Expand(form, to) => {
                let to = to.at(&form);
                let outcome = self.expand(environment, form, to);
                self.settle(outcome, to);
            }
            Job::Enter(entries) if entries.len() > NAMES_AT_ONCE => {
                let mut entries = entries.into_iter().peekable();
                let mut jobs = Vec::new();
                while entries.peek().is_some() {
                    jobs.push(Job::Enter(entries.by_ref().take(NAMES_AT_ONCE).collect()));
                }
                self.schedule(jobs);
            }
            Job::Enter(entries) => {
                let level = self.level();
                self.scope.enter_all(entries, level, environment);
            }
            Job::Leave(count) => {
                if count > NAMES_AT_ONCE {
                    self.schedule([Job::Leave(count - NAMES_AT_ONCE)]);
                }
                for _ in 0..count.min(NAMES_AT_ONCE) {
                    if let Some(gone) = self.scope.leave() {
                        self.check_use(&gone);
                    }
                }
            }
            Job::CheckLet(state) => {
                let to = state.to;
                let outcome = self.check_let(environment, state);
                self.settle(outcome, to);
            }
            Job::Let(bindings) => self.go_on_with_let(environment, bindings),
            Job::Cond(state) => {
                let to = state.to;
                let outcome = self.go_on_with_cond(state);
                self.settle(outcome, to);
            }
            Job::LocalFunctions(state) => {
                let to = state.to;
                let outcome = self.go_on_with_functions(environment, state);
                self.settle(outcome, to);
            }
            Job::Lambda(text, lambda, to) => self.expand_lambda(environment, *text, lambda, to),
            Job::Macro(form, to) => {
                let purpose = Purpose { emit: false, load: true, keep: true };
                let inside = self.begin_chunk(to.span, to.origin, purpose);
                self.schedule([Job::Expand(form, inside), Job::FinishChunk]);
            }
            Job::CheckClause(to, is_empty) => self.check_clause(to, is_empty),
            Job::CheckReturns(functions) => self.check_returns(&functions),
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
                let to = to.at(&form);
                let outcome = self.find_place(environment, form, to);
                self.settle_place(outcome, to);
            }
            Job::Use(usage, to) => {
                let outcome = self.use_places(environment, *usage, to);
                self.settle(outcome, to);
            }
        }
    }

    /// Reports a fault of a form, and puts `NIL` in its place so that its neighbours can be looked at.
    fn settle(&mut self, outcome: Checked, to: To) {
        if let Err(diagnostic) = outcome {
            self.report(*diagnostic, to.origin);
            self.fill_nil(to);
        }
    }

    /// Reports a fault of a place, and puts a stand-in on the list of places.
    fn settle_place(&mut self, outcome: Checked, to: To) {
        if let Err(diagnostic) = outcome {
            self.report(*diagnostic, to.origin);
            self.places.push(SetfExpansion::broken(to.span));
        }
    }

    fn expand(&mut self, environment: &mut dyn Environment, datum: Datum, to: To) -> Checked {
        if to.depth > MAX_DEPTH {
            return self.too_deep(to);
        }
        self.unmeasured += 1;
        if self.unmeasured >= MEASURED_EACH {
            self.measure(to.origin, to.span)?;
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
            DatumKind::Object(object) if environment.is_pair(*object) => Err(Box::new(
                code::MALFORMED_FORM.at(to.span, "expected a form, found one that contains itself"),
            )),
            _ => {
                self.literal(datum, to);
                Ok(())
            }
        }
    }

    /// Expands to a literal. In a file, a macro of the library makes a form that makes one with objects.
    pub(super) fn literal(&mut self, datum: Datum, to: To) {
        if self.is_file && datum.has_objects() {
            let form = Make(to.span).esl("%LITERAL", [datum]);
            self.schedule([Job::Expand(form, to)]);
        } else {
            self.fill(to, NodeKind::Constant(datum));
        }
    }

    /// Checks that the expansion of the current top-level form does not grow without bound.
    ///
    /// # Errors
    /// `expansion-too-large`.
    fn measure(&mut self, origin: Option<OriginId>, span: Span) -> Checked {
        self.unmeasured = 0;
        let reason = if self.bytes() > MAX_BYTES {
            format!("it takes more than {} MiB", MAX_BYTES >> 20)
        } else if self.passed > MAX_PASSED {
            format!("its macros were given more than {} million parts of forms", MAX_PASSED / 1_000_000)
        } else {
            return Ok(());
        };
        self.is_given_up = true;
        let outermost = origin.map(|origin| name(&self.origins.get(origin).name));
        let whose = outermost.unwrap_or_else(|| "this form".to_string());
        let message = format!("the expansion of {whose} is too large: {reason}");
        let help = "divide the form, or let the macro make calls of functions instead of copies of forms";
        Err(Box::new(code::EXPANSION_TOO_LARGE.at(span, message).help(help)))
    }

    /// Notes a macro call, or the use of a symbol macro, as [`Origins::enter`] does.
    ///
    /// # Errors
    /// `macro-failed`, `expansion-too-large`.
    pub(super) fn enter_origin(
        &mut self,
        operator: &Symbol,
        span: Span,
        form: Option<&Datum>,
        is_standard: bool,
        around: Option<OriginId>,
    ) -> Checked<Option<OriginId>> {
        self.measure(around, span)?;
        let origin = self.origins.enter(operator, span, form, is_standard, around);
        self.is_given_up |= origin.is_err();
        origin
    }

    fn too_deep(&mut self, to: To) -> Checked {
        // Macros may have made many more such forms.
        self.is_given_up |= to.origin.is_some();
        if self.is_too_deep {
            self.errors += 1;
            self.fill_nil(to);
            return Ok(());
        }
        self.is_too_deep = true;
        let message = format!("forms are nested more than {MAX_DEPTH} deep");
        Err(Box::new(code::NESTED_TOO_DEEPLY.at(to.span, message)))
    }

    // ---- stops and answers

    /// Stops for a call of `function` on `form`, which the call `around` made. `waiting` says what becomes of
    /// the answer, given the origin of what the macro makes.
    ///
    /// # Errors
    /// As [`Origins::enter`].
    pub(super) fn stop_for_macro(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        around: Option<OriginId>,
        waiting: impl FnOnce(Option<OriginId>) -> AwaitedOutcome,
    ) -> Checked {
        let origin = self.enter_origin(&form.operator, form.span, Some(&form.datum), is_standard, around)?;
        self.waiting = waiting(origin);
        self.call = Some(form.datum.clone());
        let locals = self.scope.locals().clone();
        self.stopped = Some(Stop::Macro(MacroCall { function, form: form.datum.clone(), locals }));
        Ok(())
    }

    /// Takes the answer to the last stop.
    pub fn answer(&mut self, answer: StepOutcome) {
        let waiting = std::mem::replace(&mut self.waiting, AwaitedOutcome::Nothing);
        match (waiting, answer) {
            (AwaitedOutcome::Form(to), StepOutcome::Expansion(form)) => self.jobs.push(Job::Expand(form, to)),
            (AwaitedOutcome::Call(call, to), StepOutcome::Expansion(form)) => {
                // A compiler macro declines by returning the form itself.
                let form = if form.is_same(&call.datum) { call.globally() } else { form };
                self.jobs.push(Job::Expand(form, to));
            }
            (AwaitedOutcome::Call(call, to), _) => self.jobs.push(Job::Expand(call.globally(), to)),
            (AwaitedOutcome::Place(to), StepOutcome::Expansion(form)) => self.jobs.push(Job::Place(form, to)),
            (AwaitedOutcome::SetfExpansion(place, to), StepOutcome::Expansion(values)) => {
                let outcome = SetfExpansion::from_values(&place, &values, to.span);
                match outcome {
                    Ok(place) => self.places.push(place),
                    Err(fault) => self.settle_place(Err(fault), to),
                }
            }
            (AwaitedOutcome::TopLevel(top), StepOutcome::Expansion(form)) => {
                self.jobs.push(Job::TopLevel(form, top))
            }
            (AwaitedOutcome::Object(_), StepOutcome::Object(object)) => self.objects.push(Some(object)),
            (waiting, StepOutcome::Failed(failure)) => {
                self.waiting = waiting;
                self.fail(&failure.into());
            }
            (AwaitedOutcome::Object(_), _) => self.objects.push(None),
            // There is nothing to do, or the driver has mixed up its answers: the form stays as it is.
            (AwaitedOutcome::Form(to), _) => self.fill_nil(to),
            (AwaitedOutcome::Place(to) | AwaitedOutcome::SetfExpansion(_, to), _) => {
                self.places.push(SetfExpansion::broken(to.span));
            }
            (AwaitedOutcome::Nothing | AwaitedOutcome::TopLevel(_) | AwaitedOutcome::Load(_), _) => {}
        }
    }

    /// Takes the failure of the last stop.
    pub fn fail(&mut self, failure: &MacroFailure) {
        match std::mem::replace(&mut self.waiting, AwaitedOutcome::Nothing) {
            AwaitedOutcome::Nothing => {}
            AwaitedOutcome::Form(to) => {
                self.macro_failed(failure, to.origin, to.span);
                self.fill_nil(to);
            }
            // Without its compiler macro, a call is an ordinary one.
            AwaitedOutcome::Call(call, to) => self.jobs.push(Job::Expand(call.globally(), to)),
            AwaitedOutcome::Place(to) | AwaitedOutcome::SetfExpansion(_, to) => {
                self.macro_failed(failure, to.origin, to.span);
                self.places.push(SetfExpansion::broken(to.span));
            }
            AwaitedOutcome::TopLevel(top) => self.macro_failed(failure, top.origin, top.span),
            AwaitedOutcome::Object(span) => {
                let message = format!("the definition of a local macro failed: {}", failure.report);
                self.report(failure.located(code::MACRO_FAILED.at(span, message)), None);
                self.objects.push(None);
            }
            AwaitedOutcome::Load(span) => {
                let message = format!("this form failed at compile time: {}", failure.report);
                let diagnostic = match failure.place {
                    FailurePlace::Here(part) if span.contains(part) => {
                        code::COMPILE_TIME_FAILURE.at(part, message)
                    }
                    _ => failure.located(code::COMPILE_TIME_FAILURE.at(span, message)),
                };
                self.report(diagnostic, None);
            }
        }
    }
}
