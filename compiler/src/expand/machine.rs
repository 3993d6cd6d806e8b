//! The machine of jobs that expands one form after another.
//!
//! A job expands one form into one node, or does what has to be done between two forms. Jobs stand on a stack, so a
//! form of any depth takes no native stack, and the machine can stop at any macro call and go on when the answer comes.
//!
//! Invariants: jobs run in the order of the text, from left to right; a hole is filled by exactly one job; names enter
//! and leave the [`Scope`] by jobs only, never while a form is being looked at.

use esl_bytecode::compile::{Answer, Environment, MacroCall, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::form::{Checked, Form, is_known, name, quoted};
use super::lambda::LambdaText;
use super::modify::PlaceUse;
use super::place::Place;
use super::scope::{Entry, Scope};
use super::toplevel::Top;
use super::unit::Unit;
use crate::core::{
    Block, BlockId, Core, Lambda, LambdaId, Node, NodeId, NodeKind, Tagbody, TagbodyId, VarId, Variable,
};
use crate::diagnostic::code;

/// How deeply nodes may be nested.
pub(super) const MAX_DEPTH: u32 = 5_000;
/// How many macro calls one top-level form may take.
pub(super) const MAX_EXPANSIONS: u32 = 1_000_000;
/// How many macros may expand into one another in one place.
pub(super) const MAX_CHAIN: u32 = 10_000;

/// A macro call that made a form. The outermost one that is written in the source is the one to be shown.
#[derive(Clone, Debug)]
pub(super) struct Origin {
    /// Name of the macro.
    name: Symbol,
    /// Where the call was written.
    span: Span,
    /// Whether the macro belongs to the language: it is not to blame then.
    is_standard: bool,
    /// How many macro calls are around it.
    chain: u32,
}

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
    /// Processes a top-level form.
    TopLevel(Datum, Top),
    /// Ends a chunk.
    FinishChunk,
    /// Finds the five parts of a place.
    Place(Datum, To),
    /// Uses the newest places.
    Use(Box<PlaceUse>, To),
}

/// What a chunk is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purpose {
    /// Whether it belongs to the module that is being made.
    pub emit: bool,
    /// Whether it is to be loaded now.
    pub load: bool,
    /// Whether its value is wanted: [`Answer::Object`].
    pub keep: bool,
}

/// A finished piece of the program.
#[derive(Debug)]
pub struct Chunk {
    /// Its code.
    pub core: Core,
    /// What it is for.
    pub purpose: Purpose,
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
enum Waiting {
    Nothing,
    Form(To),
    Place(To),
    /// The five values of a `define-setf-expander`.
    Five(Datum, To),
    TopLevel(Top),
    Object(Span),
    Load(Span),
}

/// A chunk under construction.
#[derive(Debug)]
struct Open {
    core: Core,
    /// How many errors there were when it was begun.
    errors: usize,
    span: Span,
    purpose: Purpose,
    /// The macros that it defines.
    macros: Vec<Symbol>,
}

/// The expander's state between two steps.
#[derive(Debug)]
pub(super) struct Machine {
    jobs: Vec<Job>,
    open: Vec<Open>,
    pub(super) scope: Scope,
    origins: Vec<Origin>,
    pub(super) places: Vec<Place>,
    objects: Vec<Option<ObjectId>>,
    waiting: Waiting,
    stopped: Option<Event>,
    diagnostics: Vec<Diagnostic>,
    reported: FxHashSet<(&'static str, Span, String)>,
    errors: usize,
    expansions: u32,
    /// Whether the limit on depth was reported for this top-level form.
    is_too_deep: bool,
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

    // ---- nodes

    /// The chunk that is being built.
    pub(super) fn core(&mut self) -> &mut Core {
        let open = self.open.last_mut();
        &mut open.expect("forms are expanded within a chunk").core
    }

    /// How many chunks are being built: the innermost one's level.
    pub(super) fn level(&self) -> usize {
        self.open.len()
    }

    /// Says what a node is.
    pub(super) fn fill(&mut self, to: To, kind: NodeKind) {
        let node = &mut self.core().nodes[to.node.index()];
        debug_assert!(matches!(node.kind, NodeKind::Hole), "a node is filled once");
        *node = Node { kind, span: to.span };
    }

    /// Makes a node `NIL`, whatever it was: its form is wrong.
    fn fill_nil(&mut self, to: To) {
        self.core().nodes[to.node.index()] =
            Node { kind: NodeKind::Constant(Datum::nil(to.span)), span: to.span };
    }

    /// A fresh node within `to`.
    pub(super) fn child(&mut self, to: To) -> To {
        let nodes = &mut self.core().nodes;
        let node = NodeId(nodes.len() as u32);
        nodes.push(Node { kind: NodeKind::Hole, span: to.span });
        To { node, depth: to.depth + 1, ..to }
    }

    /// Fresh nodes within `to`, one for each form, and the jobs that fill them.
    pub(super) fn children(
        &mut self,
        forms: impl IntoIterator<Item = Datum>,
        to: To,
    ) -> (Vec<NodeId>, Vec<Job>) {
        let mut nodes = Vec::new();
        let mut jobs = Vec::new();
        for form in forms {
            let child = self.child(to);
            nodes.push(child.node);
            jobs.push(Job::Expand(form, child));
        }
        (nodes, jobs)
    }

    /// A fresh node within `to` for `form`, and the job that fills it.
    pub(super) fn part(&mut self, form: Datum, to: To) -> (NodeId, Job) {
        let child = self.child(to);
        (child.node, Job::Expand(form, child))
    }

    /// A fresh lexical variable, bound in the lambda of `to`.
    pub(super) fn variable(&mut self, name: Symbol, span: Span, to: To) -> VarId {
        self.variable_in(name, span, to.lambda)
    }

    /// A fresh lexical variable, bound in `owner`.
    pub(super) fn variable_in(&mut self, name: Symbol, span: Span, owner: LambdaId) -> VarId {
        let variables = &mut self.core().variables;
        variables.push(Variable {
            name,
            span,
            owner,
            is_assigned: false,
            is_captured: false,
            is_read: false,
        });
        VarId(variables.len() as u32 - 1)
    }

    /// Notes that code in the lambda of `to` reads a variable.
    pub(super) fn note_read(&mut self, variable: VarId, to: To) {
        let variable = &mut self.core().variables[variable.index()];
        variable.is_read = true;
        variable.is_captured |= variable.owner != to.lambda;
    }

    /// Makes `to` a read of a variable.
    pub(super) fn read(&mut self, variable: VarId, to: To) {
        self.note_read(variable, to);
        self.fill(to, NodeKind::Local(variable));
    }

    /// Notes that code in the lambda of `to` sets a variable.
    pub(super) fn note_assigned(&mut self, variable: VarId, to: To) {
        let variable = &mut self.core().variables[variable.index()];
        variable.is_assigned = true;
        variable.is_captured |= variable.owner != to.lambda;
    }

    /// A fresh block in the lambda of `to`.
    pub(super) fn block(&mut self, name: Option<Symbol>, to: To) -> BlockId {
        let blocks = &mut self.core().blocks;
        blocks.push(Block { name, owner: to.lambda, is_captured: false, is_used: false });
        BlockId(blocks.len() as u32 - 1)
    }

    /// A fresh tagbody in the lambda of `to`.
    pub(super) fn tagbody(&mut self, to: To) -> TagbodyId {
        let tagbodies = &mut self.core().tagbodies;
        tagbodies.push(Tagbody { owner: to.lambda, is_captured: false });
        TagbodyId(tagbodies.len() as u32 - 1)
    }

    // ---- chunks

    /// Begins a chunk, and gives the node of its first lambda's body.
    pub(super) fn begin_chunk(&mut self, span: Span, origin: Option<u32>, purpose: Purpose) -> To {
        let body = NodeId(0);
        let core = Core {
            nodes: vec![Node { kind: NodeKind::Hole, span }],
            lambdas: vec![Lambda::top_level(span, body)],
            ..Core::default()
        };
        self.open.push(Open { core, errors: self.errors, span, purpose, macros: Vec::new() });
        To { node: body, lambda: LambdaId(0), depth: 0, origin, span }
    }

    /// Whether something was wrong with the chunk that is being built.
    pub(super) fn is_failing(&self) -> bool {
        self.open.last().is_some_and(|open| self.errors > open.errors)
    }

    /// What the chunk that is being built is for.
    pub(super) fn purpose(&self) -> Purpose {
        self.open.last().expect("forms are expanded within a chunk").purpose
    }

    /// Notes that the chunk being built defines a macro.
    pub(super) fn note_macro(&mut self, symbol: &Symbol) {
        let open = self.open.last_mut();
        open.expect("forms are expanded within a chunk").macros.push(symbol.clone());
    }

    fn finish_chunk(&mut self) {
        let open = self.open.pop().expect("a chunk was begun");
        let purpose = open.purpose;
        if self.errors > open.errors {
            for symbol in &open.macros {
                self.unit.note_broken_macro(symbol);
            }
            if purpose.keep {
                self.objects.push(None);
            }
            return;
        }
        debug_assert!(
            !open.core.nodes.iter().any(|node| matches!(node.kind, NodeKind::Hole)),
            "all nodes are filled"
        );
        self.waiting = match purpose {
            Purpose { keep: true, .. } => Waiting::Object(open.span),
            Purpose { load: true, .. } => Waiting::Load(open.span),
            _ => Waiting::Nothing,
        };
        self.stopped = Some(Event::Chunk(Box::new(Chunk { core: open.core, purpose })));
    }

    fn enter_macros(&mut self, names: Vec<Symbol>) {
        let level = self.level();
        let functions = self.objects.split_off(self.objects.len() - names.len());
        for (name, function) in names.into_iter().zip(functions) {
            self.scope.enter(Entry::Function(name, super::scope::Function::Macro(function)), level);
        }
    }

    // ---- macro calls

    /// Stops for the expansion of a macro call in a form.
    pub(super) fn stop_for_form(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        to: To,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, to.origin)?;
        self.waiting = Waiting::Form(To { origin, ..to });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    /// Stops for the expansion of a macro call that stands for a place.
    pub(super) fn stop_for_place(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        to: To,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, to.origin)?;
        self.waiting = Waiting::Place(To { origin, ..to });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    /// Stops for the five values that the macro `expander` gives for a place.
    pub(super) fn stop_for_five(&mut self, expander: Symbol, form: &Form, to: To) -> Checked {
        let origin = self.origin(&form.operator, form.span, true, to.origin)?;
        self.waiting = Waiting::Five(form.datum.clone(), To { origin, ..to });
        self.stop_for_macro(MacroRef::Global(expander), form.datum.clone());
        Ok(())
    }

    /// Stops for the expansion of a top-level macro call.
    pub(super) fn stop_for_top(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        top: Top,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, top.origin)?;
        self.waiting = Waiting::TopLevel(Top { origin, ..top });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    fn stop_for_macro(&mut self, function: MacroRef, form: Datum) {
        let locals = self.scope.locals();
        self.stopped = Some(Event::Macro(MacroCall { function, form, locals }));
    }

    /// Notes a macro call, unless there have been too many.
    pub(super) fn origin(
        &mut self,
        operator: &Symbol,
        span: Span,
        is_standard: bool,
        around: Option<u32>,
    ) -> Checked<Option<u32>> {
        let parent = around.map(|index| &self.origins[index as usize]);
        let chain = parent.map_or(0, |parent| parent.chain + 1);
        self.expansions += 1;
        if self.expansions > MAX_EXPANSIONS || chain > MAX_CHAIN {
            let outermost =
                parent.filter(|parent| parent.span == span).map_or(operator, |parent| &parent.name);
            let message = format!("the expansion of {} does not end", name(outermost));
            return Err(Box::new(code::MACRO_FAILED.at(span, message)));
        }
        let origin = match parent {
            // A call that a macro has made is shown as what made it.
            Some(parent) if parent.span == span => Origin { chain, ..parent.clone() },
            _ => Origin { name: operator.clone(), span, is_standard, chain },
        };
        self.origins.push(origin);
        Ok(Some(self.origins.len() as u32 - 1))
    }

    fn macro_failed(&mut self, failure: &str, origin: Option<u32>, span: Span) {
        let failed = match origin.map(|index| &self.origins[index as usize]) {
            Some(origin) => name(&origin.name),
            None => "a macro".to_string(),
        };
        // So begins what a macro of the library says about parts that do not fit.
        let diagnostic = if failure.starts_with("needs ") {
            code::MALFORMED_FORM.at(span, format!("{failed} {failure}"))
        } else {
            code::MACRO_FAILED.at(span, format!("{failed} failed while it was expanded: {failure}"))
        };
        self.report(diagnostic, None);
    }

    // ---- diagnostics

    /// Reports a finding about a form that the macro call `origin`, if any, has made.
    pub(super) fn report(&mut self, mut diagnostic: Diagnostic, origin: Option<u32>) {
        if diagnostic.severity == Severity::Error {
            self.errors += 1;
            if let Some(origin) = origin.map(|index| &self.origins[index as usize]) {
                let text = format!("in the expansion of {}", name(&origin.name));
                if diagnostic.primary.span == origin.span && diagnostic.primary.text.is_empty() {
                    diagnostic.primary.text = text;
                } else if !origin.is_standard && is_known(origin.span) {
                    diagnostic = diagnostic.also(origin.span, text);
                }
            }
        }
        // A macro may have used the same part twice.
        let place = (diagnostic.code, diagnostic.primary.span, diagnostic.message.clone());
        if self.reported.insert(place) {
            self.diagnostics.push(diagnostic);
        }
    }

    /// `span`, if a form of that place was written there; an empty one, if the macro call `origin` has made it: what a
    /// macro makes has the place of its call.
    pub(super) fn written(&self, span: Span, origin: Option<u32>) -> Span {
        let is_made = origin.is_some_and(|index| self.origins[index as usize].span == span);
        if is_made { Span::default() } else { span }
    }

    /// Whether a form at `span` was made by a macro that belongs to the language.
    pub(super) fn is_of_library(&self, span: Span, origin: Option<u32>) -> bool {
        let is_made = !is_known(self.written(span, origin));
        is_made && origin.is_some_and(|index| self.origins[index as usize].is_standard)
    }

    /// The findings so far.
    pub(super) fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// How many errors have been reported.
    pub(super) fn errors(&self) -> usize {
        self.errors
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

impl Form {
    /// Takes a compound form apart. `span` is where it, or the form around it, was written.
    pub(super) fn of(datum: &Datum, span: Span) -> Checked<Form> {
        let malformed = |what: String| Box::new(code::MALFORMED_FORM.at(span, what));
        let Some((head, rest)) = datum.as_cons() else {
            return Err(malformed(format!("{} is no compound form", quoted(datum))));
        };
        // A call of a `lambda` expression goes by the name of that.
        let operator = match head.as_symbol() {
            Some(symbol) => symbol.clone(),
            None if super::form::is_cl_form(head, "LAMBDA") => Symbol::cl("LAMBDA"),
            None => {
                let message =
                    format!("a form begins with the name of an operator, not with {}", quoted(head));
                return Err(malformed(message));
            }
        };
        match rest.as_list() {
            Some(args) => {
                let args = args.into_iter().cloned().collect();
                Ok(Form { datum: datum.clone(), operator, args, span })
            }
            None => Err(malformed(format!("{} ends in a dot and something that is no list", quoted(datum)))),
        }
    }
}
