//! Orders in which tasks take resources: tasks that hold one resource while they wait for another can wait
//! for each other in a circle.
//!
//! Each task is followed through the code that it may run, with the resources that it holds there. A wait for
//! another resource is a *step* from each held one. A circle of steps is reported if they can be of different
//! tasks, and no resource is held at all of them, which would keep them apart (Havelund 2000, GoodLock). Only
//! resources count of which there is one, and waits without a limit of time. `meeting` tells tasks apart that
//! never run at the same time. Not known: resources that recovery procedures take while code inside of their
//! form holds others.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{BoundVariable, Callee, LambdaId, NodeId, NodeKind};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::effect::NodeEffect;
use crate::flow::ValueFlow;
use crate::forms::{CoreForm, CoreForms};
use crate::meeting::{TaskMeetings, is_begun_often};
use crate::solve::bodies_of_works;
use crate::value::{Code, NO_CONTEXT, TaskKind, WorkId, WorkKey};

/// Most pairs of code and held resources that are looked at.
const MOST_STATES: usize = 50_000;
/// Most resources in a circle.
const LONGEST: usize = 4;

/// A task that takes resources: the main task is `None`.
pub(crate) type Taker = Option<WorkId>;

/// A resource, by its number in the order of names.
type ResourceNumber = usize;

/// Held resources, each with the form that holds it, and whether that is one of the task around.
type HeldResources = BTreeMap<ResourceNumber, (Span, bool)>;

/// A wait for a resource by a task that holds another one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct OrderStep {
    from: ResourceNumber,
    to: ResourceNumber,
    taker: Taker,
    /// The forms that hold the one and wait for the other.
    places: [(u32, usize, usize); 2],
    /// All resources that are held, each with whether the task around holds it.
    held: Vec<(ResourceNumber, bool)>,
}

/// Code to be looked at, with the resources held there.
struct HoldingCode {
    code: Code,
    taker: Taker,
    held: HeldResources,
}

/// The search for steps.
struct OrderWalk<'w, 'a> {
    flow: &'w ValueFlow<'a>,
    bodies: Vec<Vec<Code>>,
    /// Resources of which there is one, by name.
    single: Vec<Symbol>,
    pending: VecDeque<HoldingCode>,
    seen: FxHashSet<(Code, Taker, Vec<ResourceNumber>)>,
    steps: BTreeSet<OrderStep>,
    spans: FxHashMap<(u32, usize, usize), Span>,
}

/// A request for resources.
struct ResourceRequest {
    names: Vec<Symbol>,
    waits: bool,
}

/// Returns warnings about resources that tasks take in different orders.
pub(crate) fn findings(flow: &ValueFlow<'_>) -> Vec<Diagnostic> {
    let single = single_resources(flow.forms);
    let mut walk = OrderWalk {
        flow,
        bodies: bodies_of_works(flow),
        single,
        pending: VecDeque::new(),
        seen: FxHashSet::default(),
        steps: BTreeSet::new(),
        spans: FxHashMap::default(),
    };
    for form in 0..flow.forms.forms.len() {
        let code = Code { form: form as u32, lambda: LambdaId(0), context: NO_CONTEXT };
        walk.enter(code, None, &HeldResources::new());
    }
    for index in 0..flow.works.len() {
        walk.enter_work(WorkId(index as u32), &HeldResources::new());
    }
    while let Some(next) = walk.pending.pop_front() {
        walk.look_at(&next);
    }
    walk.circles()
}

/// Returns the resources of which there is one, by constant definitions.
pub(crate) fn single_resources(forms: &CoreForms) -> Vec<Symbol> {
    let mut single = FxHashSet::default();
    let mut others = FxHashSet::default();
    for form in &forms.forms {
        for node in &form.core.nodes {
            let NodeKind::Call(callee, arguments) = &node.kind else { continue };
            if called(callee).is_none_or(|name| name != "%DEFINE-RESOURCE") {
                continue;
            }
            let [name, capacity, ..] = arguments.as_slice() else { continue };
            let Some(name) = form.symbol(*name) else { continue };
            let is_one =
                matches!(form.kind(*capacity), NodeKind::Constant(datum) if datum.to_string() == "1");
            if is_one {
                single.insert(name.clone())
            } else {
                others.insert(name.clone())
            };
        }
    }
    let mut single: Vec<Symbol> = single.into_iter().filter(|name| !others.contains(name)).collect();
    single.sort_by_key(ToString::to_string);
    single
}

fn called(callee: &Callee) -> Option<String> {
    match callee {
        Callee::Global(symbol) => Some(symbol.name().to_string()),
        Callee::Builtin(builtin) => Some(builtin.symbol().name().to_string()),
        Callee::Local(_) | Callee::Value(_) => None,
    }
}

impl OrderWalk<'_, '_> {
    /// Has code looked at that a task runs while it holds resources.
    fn enter(&mut self, code: Code, taker: Taker, held: &HeldResources) {
        let names = held.keys().copied().collect();
        if self.seen.len() < MOST_STATES && self.seen.insert((code, taker, names)) {
            self.pending.push_back(HoldingCode { code, taker, held: held.clone() });
        }
    }

    /// Has the code of a task looked at, while those around it hold resources.
    fn enter_work(&mut self, work: WorkId, around: &HeldResources) {
        let held: HeldResources = around.iter().map(|(number, (span, _))| (*number, (*span, true))).collect();
        for code in self.bodies[work.index()].clone() {
            self.enter(code, Some(work), &held);
        }
    }

    fn look_at(&mut self, next: &HoldingCode) {
        let flow = self.flow;
        let form = &flow.forms.forms[next.code.form as usize];
        let Some(number) = flow.number_of(next.code) else { return };
        let mut effects: FxHashMap<NodeId, Vec<NodeEffect>> = FxHashMap::default();
        for (node, effect) in &flow.running[number].effects {
            effects.entry(*node).or_default().push(*effect);
        }
        let lambda = &form.core.lambdas[next.code.lambda.index()];
        let mut requested: Option<(ResourceRequest, NodeId)> = None;
        let mut row: Vec<(NodeId, HeldResources)> = vec![(lambda.body, next.held.clone())];
        while let Some((node, held)) = row.pop() {
            let kind = form.kind(node);
            let mut inside = held.clone();
            let mut is_limited = false;
            let mut body = None;
            match kind {
                NodeKind::Call(callee, arguments) => match called(callee).as_deref() {
                    Some("%REQUEST-AT-ONCE") => {
                        let names = arguments.first().and_then(|name| form.symbol(*name));
                        let names = names.cloned().into_iter().collect();
                        requested = Some((ResourceRequest { names, waits: true }, node));
                    }
                    Some("%ACQUIRE") => {
                        let fails = arguments.get(1).and_then(|word| form.symbol(*word));
                        if let Some((request, _)) = &mut requested {
                            request.waits &= fails.is_none_or(|word| word.name() != "FAIL");
                        }
                    }
                    Some("%CALL-WITH-RESOURCES" | "%CALL-WITH-FLEET-RESOURCES") => {
                        if let Some(list) = arguments.first() {
                            self.take(next, form, node, &request_in(form, *list), &mut inside);
                        }
                    }
                    Some("%CALL-WITH-LIMIT") => {
                        is_limited = arguments.first().is_some_and(|seconds| !form.is_nil(*seconds));
                    }
                    _ => {}
                },
                NodeKind::Let { bindings, body: inner, .. } => {
                    let is_held = bindings.iter().any(|(variable, _)| {
                        matches!(variable, BoundVariable::Special(symbol) if symbol.name() == "*%OUTER*")
                    });
                    if is_held && let Some((request, at)) = requested.take() {
                        self.take(next, form, at, &request, &mut inside);
                        body = Some(*inner);
                    }
                }
                NodeKind::Recovery { procedures, .. } => {
                    if let NodeKind::Lambda(lambda) = form.kind(*procedures) {
                        self.enter(Code { lambda: *lambda, ..next.code }, next.taker, &held);
                    }
                }
                _ => {}
            }
            for effect in effects.get(&node).into_iter().flatten() {
                match effect {
                    // A limit ends the wait.
                    NodeEffect::Call(_) | NodeEffect::CallMany | NodeEffect::Absorb(_) => {
                        let flow = self.flow;
                        let called = flow.called_by(effect).iter().filter(|_| !is_limited);
                        called.for_each(|code| self.enter(*code, next.taker, &inside));
                    }
                    NodeEffect::Start(work) if self.flow.works[work.index()].kind == TaskKind::Part => {
                        self.enter_work(*work, &held);
                    }
                    _ => {}
                }
            }
            // The last is looked at first.
            let mut inner = Vec::new();
            children(kind, &mut |child| inner.push(child));
            for child in inner.into_iter().rev() {
                let held = if body == Some(child) { std::mem::take(&mut inside) } else { held.clone() };
                row.push((child, held));
            }
        }
    }

    /// Notes that a task takes resources at a node, and adds them to those that it holds.
    fn take(
        &mut self,
        next: &HoldingCode,
        form: &CoreForm,
        node: NodeId,
        request: &ResourceRequest,
        held: &mut HeldResources,
    ) {
        let span = form.core.nodes[node.index()].span;
        let new: Vec<ResourceNumber> = (0..self.single.len())
            .filter(|number| request.names.contains(&self.single[*number]) && !held.contains_key(number))
            .collect();
        if request.waits {
            let all: Vec<_> = held.iter().map(|(number, (_, is_around))| (*number, *is_around)).collect();
            for (from, (place, _)) in held.iter() {
                for to in &new {
                    let places = [self.key(*place), self.key(span)];
                    let step =
                        OrderStep { from: *from, to: *to, taker: next.taker, places, held: all.clone() };
                    self.steps.insert(step);
                }
            }
        }
        for number in new {
            held.insert(number, (span, false));
        }
    }

    fn key(&mut self, span: Span) -> (u32, usize, usize) {
        let key = (span.source.0, span.start as usize, span.end as usize);
        self.spans.insert(key, span);
        key
    }

    /// Whether a task may run more than once at the same time.
    fn is_many(&self, taker: Taker) -> bool {
        let Some(work) = taker else { return false };
        let is_begun = matches!(self.flow.works[work.index()].key, WorkKey::Begun(..));
        let is_spawned = self.flow.works[work.index()].kind == TaskKind::Spawned;
        !is_begun || is_spawned && is_begun_often(self.flow, work)
    }

    /// Returns warnings about the circles of steps, one for each set of resources.
    fn circles(&self) -> Vec<Diagnostic> {
        let steps: Vec<&OrderStep> = self.steps.iter().collect();
        let mut told: BTreeSet<Vec<ResourceNumber>> = BTreeSet::new();
        let mut found = Vec::new();
        // Most programs have no circle.
        let meetings = TaskMeetings::new(self.flow, if steps.is_empty() { &[] } else { &self.bodies });
        for length in 2..=LONGEST {
            for first in &steps {
                self.close(&meetings, &steps, &mut vec![first], length, &mut told, &mut found);
            }
        }
        found
    }

    /// Adds steps to a row of some until it is a circle of `length`.
    fn close<'s>(
        &self,
        meetings: &TaskMeetings<'_, '_>,
        steps: &[&'s OrderStep],
        row: &mut Vec<&'s OrderStep>,
        length: usize,
        told: &mut BTreeSet<Vec<ResourceNumber>>,
        found: &mut Vec<Diagnostic>,
    ) {
        let (first, last) = (row[0], row[row.len() - 1]);
        if row.len() == length {
            let mut numbers: Vec<ResourceNumber> = row.iter().map(|step| step.from).collect();
            numbers.sort_unstable();
            // One with fewer resources has been told.
            let is_new = !told.iter().any(|known| known.iter().all(|number| numbers.contains(number)));
            if last.to == first.from && is_new {
                found.push(self.warning(row));
                told.insert(numbers);
            }
            return;
        }
        for next in steps.iter().filter(|next| next.from == last.to) {
            // A circle begins with its smallest resource, and has each once.
            let is_next = next.from > first.from
                && row.iter().all(|step| step.from != next.from && self.may_meet(meetings, step, next));
            if is_next {
                row.push(next);
                self.close(meetings, steps, row, length, told, found);
                row.pop();
            }
        }
    }

    /// Whether two tasks may be at these steps at the same time.
    fn may_meet(&self, meetings: &TaskMeetings<'_, '_>, one: &OrderStep, other: &OrderStep) -> bool {
        let are_apart = one.held.iter().any(|(name, is_around)| {
            other.held.iter().any(|(known, is_too)| known == name && !(*is_around && *is_too))
        });
        let are_apart = are_apart || meetings.are_apart(one.taker, other.taker);
        !are_apart && (one.taker != other.taker || self.is_many(one.taker))
    }

    fn warning(&self, row: &[&OrderStep]) -> Diagnostic {
        let name = |number: ResourceNumber| self.single[number].name().to_lowercase();
        let names: Vec<String> = row.iter().map(|step| format!("`{}`", name(step.from))).collect();
        let span = |key: (u32, usize, usize)| self.spans.get(&key).copied().unwrap_or_default();
        let message =
            format!("tasks that take {} in different orders can wait for each other", listed(&names));
        let mut found = Diagnostic::new("resource-order", Severity::Warning, message, span(row[0].places[1]));
        for (index, step) in row.iter().enumerate() {
            if index > 0 {
                found = found.also(span(step.places[1]), format!("here one waits for `{}`", name(step.to)));
            } else {
                found = found.label(format!("here one waits for `{}`", name(step.to)));
            }
            found = found.also(span(step.places[0]), format!("and holds `{}` since here", name(step.from)));
        }
        found.help("take them in the same order everywhere, or all at once by `with-resources`")
    }
}

/// Returns the request in a list of specifications.
fn request_in(form: &CoreForm, list: NodeId) -> ResourceRequest {
    let mut names = Vec::new();
    let mut waits = true;
    let mut pending = vec![list];
    while let Some(node) = pending.pop() {
        if let Some(symbol) = form.symbol(node) {
            match (symbol.is_keyword(), symbol.name()) {
                (true, "TIMEOUT" | "IF-DENIED") => waits = false,
                (true, _) => {}
                (false, _) => names.push(symbol.clone()),
            }
        }
        children(form.kind(node), &mut |child| pending.push(child));
    }
    ResourceRequest { names, waits }
}

fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
