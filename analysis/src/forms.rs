//! The program as the analysis reads it: top-level forms of the core language, with the lambda and the
//! innermost handling form of each node, and the definitions that stand at fixed places.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, setf_cell};
use esl_compiler::core::{Callee, Core, LambdaId, NodeId, NodeKind, VarId};
use esl_compiler::{children, lambda_nodes};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::is_mistake;
use crate::clause::{Clause, can_end, clauses_of};
use crate::declared::DeclaredCauses;

/// A form that handles failures, or a part of a program that is looked at by itself, such as a clause.
#[derive(Clone, Debug)]
pub(crate) struct HandlingScope {
    pub(crate) kind: ScopeKind,
    /// Innermost scope around it in the same lambda.
    pub(crate) parent: Option<usize>,
}

/// Kind of a scope.
#[derive(Clone, Debug)]
pub(crate) enum ScopeKind {
    /// The body of a recovery form, with its clauses and the lambda that runs these.
    Recovery { node: NodeId, clauses: Vec<Clause>, procedures: LambdaId },
    /// The body of a `handler-case`, with the types of its clauses.
    Cases { node: NodeId, types: Vec<Datum> },
    /// The body of a `handler-bind`, with the types of its handlers that never return.
    Handlers { node: NodeId, types: Vec<Datum> },
    /// A clause of a recovery form, by its position, in the lambda that runs the clauses.
    ClauseBody(usize),
}

impl ScopeKind {
    /// Returns the handling form.
    pub(crate) fn node(&self) -> Option<NodeId> {
        match self {
            ScopeKind::Recovery { node, .. }
            | ScopeKind::Cases { node, .. }
            | ScopeKind::Handlers { node, .. } => Some(*node),
            ScopeKind::ClauseBody(_) => None,
        }
    }
}

/// A top-level form.
#[derive(Debug)]
pub(crate) struct CoreForm {
    pub(crate) core: Core,
    /// Lambda of each node.
    pub(crate) owners: Vec<LambdaId>,
    /// Innermost scope of each node.
    pub(crate) scope_of: Vec<Option<usize>>,
    /// Scopes; those around others come first.
    pub(crate) scopes: Vec<HandlingScope>,
    /// Scopes of each lambda.
    pub(crate) scopes_of: Vec<Vec<usize>>,
    /// Nodes of each lambda.
    pub(crate) nodes_of: Vec<Vec<NodeId>>,
    /// Node of each block.
    pub(crate) block_nodes: Vec<NodeId>,
    /// Whether each node is in the cleanup of an `unwind-protect` of the same lambda.
    pub(crate) in_cleanup: Vec<bool>,
    /// Variables that have the state of a recovery form.
    states: FxHashSet<VarId>,
    /// Bodies of the clauses of a lambda that runs clauses, with their positions.
    clause_bodies: FxHashMap<LambdaId, FxHashMap<NodeId, usize>>,
    /// Calls with keywords among their arguments, by lambda and range, if the form begins tasks with options.
    option_lists: FxHashMap<(LambdaId, Span), Vec<NodeId>>,
}

impl CoreForm {
    fn new(core: Core) -> CoreForm {
        let count = core.nodes.len();
        let mut form = CoreForm {
            owners: vec![LambdaId(0); count],
            scope_of: vec![None; count],
            scopes: Vec::new(),
            scopes_of: vec![Vec::new(); core.lambdas.len()],
            nodes_of: vec![Vec::new(); core.lambdas.len()],
            block_nodes: vec![NodeId(0); core.blocks.len()],
            in_cleanup: vec![false; count],
            states: FxHashSet::default(),
            clause_bodies: FxHashMap::default(),
            option_lists: FxHashMap::default(),
            core,
        };
        form.note_places();
        form.note_cleanups();
        form.note_option_lists();
        form
    }

    /// Notes the owner and the scope of each node.
    fn note_places(&mut self) {
        // A lambda of clauses is looked at after the form that it belongs to.
        let mut lambdas: Vec<LambdaId> = Vec::new();
        let mut pending = vec![LambdaId(0)];
        while let Some(lambda) = pending.pop() {
            lambdas.push(lambda);
            let mut row: Vec<(NodeId, Option<usize>)> = Vec::new();
            lambda_nodes(&self.core.lambdas[lambda.index()], &mut |node| row.push((node, None)));
            while let Some((node, scope)) = row.pop() {
                let bodies = self.clause_bodies.get(&lambda);
                let scope = match bodies.and_then(|bodies| bodies.get(&node)) {
                    Some(position) => Some(self.add_scope(lambda, ScopeKind::ClauseBody(*position), scope)),
                    None => scope,
                };
                self.owners[node.index()] = lambda;
                self.scope_of[node.index()] = scope;
                self.nodes_of[lambda.index()].push(node);
                self.enter(node, scope, &mut row, &mut pending);
            }
        }
    }

    /// Notes the nodes of cleanups.
    fn note_cleanups(&mut self) {
        let mut pending = Vec::new();
        for node in &self.core.nodes {
            if let NodeKind::UnwindProtect(_, cleanup) = &node.kind {
                pending.push(*cleanup);
            }
        }
        while let Some(node) = pending.pop() {
            if !std::mem::replace(&mut self.in_cleanup[node.index()], true) {
                children(&self.core.nodes[node.index()].kind, &mut |child| pending.push(child));
            }
        }
    }

    /// Returns the clauses of a recovery form.
    pub(crate) fn clauses(&self, form: NodeId) -> &[Clause] {
        let clauses = self.scopes.iter().find_map(|scope| match &scope.kind {
            ScopeKind::Recovery { node, clauses, .. } if *node == form => Some(clauses.as_slice()),
            _ => None,
        });
        clauses.unwrap_or_default()
    }

    /// Whether a variable has the state of a recovery form, to which its clauses leave.
    pub(crate) fn is_state(&self, variable: VarId) -> bool {
        self.states.contains(&variable)
    }

    /// Whether a node begins a task with options: a call of `%spawn`.
    fn begins_with_options(&self, node: NodeId) -> bool {
        matches!(self.kind(node), NodeKind::Call(callee, arguments)
            if arguments.len() > 1 && symbol_of(callee).is_some_and(|symbol| symbol.name() == "%SPAWN"))
    }

    /// Notes the lists in which the options of tasks may be.
    fn note_option_lists(&mut self) {
        let mut all = (0..self.core.nodes.len() as u32).map(NodeId);
        if !all.any(|node| self.begins_with_options(node)) {
            return;
        }
        let is_keyword = |item: &NodeId| self.symbol(*item).is_some_and(Symbol::is_keyword);
        let mut lists: FxHashMap<(LambdaId, Span), Vec<NodeId>> = FxHashMap::default();
        for (index, nodes) in self.nodes_of.iter().enumerate() {
            for node in nodes {
                if let NodeKind::Call(_, items) = self.kind(*node)
                    && items.iter().step_by(2).any(is_keyword)
                {
                    let key = (LambdaId(index as u32), self.core.nodes[node.index()].span);
                    lists.entry(key).or_default().push(*node);
                }
            }
        }
        self.option_lists = lists;
    }

    /// Returns the value of an option of the `spawn` whose call of `%spawn` a node is, not of one in its
    /// body.
    pub(crate) fn spawn_option(&self, node: NodeId, name: &str) -> Option<NodeId> {
        if !self.begins_with_options(node) {
            return None;
        }
        // The macro makes the list of the options, too, so that both have the range of its call.
        let key = (self.owners[node.index()], self.core.nodes[node.index()].span);
        let is_name =
            |item: &NodeId| self.symbol(*item).is_some_and(|key| key.is_keyword() && key.name() == name);
        self.option_lists.get(&key)?.iter().find_map(|list| {
            let NodeKind::Call(_, items) = self.kind(*list) else { return None };
            let position = items.iter().step_by(2).position(is_name)? * 2;
            let is_inside = key.1.contains(self.core.nodes[items[position].index()].span);
            items.get(position + 1).copied().filter(|_| is_inside)
        })
    }

    fn add_scope(&mut self, owner: LambdaId, kind: ScopeKind, parent: Option<usize>) -> usize {
        self.scopes_of[owner.index()].push(self.scopes.len());
        self.scopes.push(HandlingScope { kind, parent });
        self.scopes.len() - 1
    }

    /// Notes the children of a node.
    fn enter(
        &mut self,
        node: NodeId,
        scope: Option<usize>,
        row: &mut Vec<(NodeId, Option<usize>)>,
        pending: &mut Vec<LambdaId>,
    ) {
        let kind = self.core.nodes[node.index()].kind.clone();
        let owner = self.owners[node.index()];
        let mut inner = None;
        match &kind {
            NodeKind::Lambda(lambda) => pending.push(*lambda),
            NodeKind::Functions { definitions, .. } => {
                pending.extend(definitions.iter().map(|(_, lambda)| *lambda));
            }
            NodeKind::Block(block, _) => self.block_nodes[block.index()] = node,
            NodeKind::Recovery { table, procedures, body } => {
                if let NodeKind::Lambda(lambda) = self.core.nodes[procedures.index()].kind {
                    let (clauses, bodies) = clauses_of(&self.core, *table, lambda);
                    let state = self.core.lambdas[lambda.index()].required.first();
                    self.states.extend(state.map(|parameter| parameter.variable));
                    let places = self.clause_bodies.entry(lambda).or_default();
                    for (position, body) in bodies.into_iter().enumerate() {
                        places.entry(body).or_insert(position);
                    }
                    let kind = ScopeKind::Recovery { node, clauses, procedures: lambda };
                    inner = Some((*body, self.add_scope(owner, kind, scope)));
                }
            }
            NodeKind::HandlerCase(body, clauses) => {
                let types = clauses.iter().map(|clause| clause.condition_type.clone()).collect();
                inner = Some((*body, self.add_scope(owner, ScopeKind::Cases { node, types }, scope)));
            }
            NodeKind::Handlers(list, body) => {
                let types = leaving_handlers(&self.core, *list);
                inner = Some((*body, self.add_scope(owner, ScopeKind::Handlers { node, types }, scope)));
            }
            _ => {}
        }
        children(&kind, &mut |child| {
            let scope = match inner {
                Some((body, own)) if body == child => Some(own),
                _ => scope,
            };
            row.push((child, scope));
        });
    }

    /// Returns the expression of a node.
    pub(crate) fn kind(&self, node: NodeId) -> &NodeKind {
        &self.core.nodes[node.index()].kind
    }

    /// Returns the symbol that a node quotes.
    pub(crate) fn symbol(&self, node: NodeId) -> Option<&Symbol> {
        match self.kind(node) {
            NodeKind::Constant(datum) => datum.as_symbol(),
            _ => None,
        }
    }

    /// Returns whether a node is the constant `NIL`.
    pub(crate) fn is_nil(&self, node: NodeId) -> bool {
        matches!(self.kind(node), NodeKind::Constant(datum) if datum.is_nil())
    }

    /// Returns whether `variable` is a parameter of `lambda`.
    pub(crate) fn is_parameter(&self, lambda: LambdaId, variable: VarId) -> bool {
        let lambda = &self.core.lambdas[lambda.index()];
        let optional = lambda.optional.iter().map(|optional| optional.parameter);
        let keys = lambda.keys.iter().flatten().map(|key| key.optional.parameter);
        let all = lambda.required.iter().copied().chain(optional).chain(lambda.rest).chain(keys);
        all.into_iter().any(|parameter| parameter.variable == variable)
    }
}

/// Returns the types of the handlers in a list that leave for sure.
fn leaving_handlers(core: &Core, list: NodeId) -> Vec<Datum> {
    let NodeKind::Call(_, pairs) = &core.nodes[list.index()].kind else { return Vec::new() };
    let leaving = pairs.iter().filter_map(|pair| {
        let NodeKind::Call(_, parts) = &core.nodes[pair.index()].kind else { return None };
        let [condition_type, function] = parts.as_slice() else { return None };
        let NodeKind::Constant(condition_type) = &core.nodes[condition_type.index()].kind else {
            return None;
        };
        let NodeKind::Lambda(lambda) = core.nodes[function.index()].kind else { return None };
        let ends = can_end(core, core.lambdas[lambda.index()].body, &|_| false);
        (!ends).then(|| condition_type.clone())
    });
    leaving.collect()
}

/// The forms of a program, and its definitions at fixed places.
#[derive(Debug, Default)]
pub(crate) struct CoreForms {
    pub(crate) forms: Vec<CoreForm>,
    /// Names of the functions that the program defines, each with the form and the node of a definition.
    pub(crate) defined: FxHashMap<Symbol, (usize, NodeId)>,
    /// Those that it defines more than once.
    pub(crate) redefined: FxHashSet<Symbol>,
    /// Parents of causes, by `define-cause`, and of conditions, by `define-condition`.
    pub(crate) parents: FxHashMap<Symbol, Vec<Symbol>>,
    /// Form and node of the definition of each cause.
    pub(crate) causes: FxHashMap<Symbol, (usize, NodeId)>,
    /// Names of condition types.
    pub(crate) condition_types: FxHashSet<Symbol>,
    /// Declarations of failures, by the names of functions.
    pub(crate) declared: FxHashMap<Symbol, DeclaredCauses>,
    /// Names of functions that have methods.
    pub(crate) generic: FxHashSet<Symbol>,
    /// Names of goals, properties and other things that a program defines by name.
    pub(crate) noted: FxHashSet<Symbol>,
    /// Operations whose calls exclude each other.
    pub(crate) exclusive: FxHashSet<Symbol>,
    /// Operations that a world answers.
    pub(crate) scripted: FxHashSet<Symbol>,
    /// Included structure of each structure.
    pub(crate) included: FxHashMap<Symbol, Symbol>,
    /// Whether the program defines causes with the names of the standard's.
    pub(crate) redefines_mistakes: bool,
    /// Whether the program declares causes.
    pub(crate) declares_causes: bool,
    /// Whether the program narrows its rights.
    pub(crate) narrows_rights: bool,
    /// Whether the program aborts tasks.
    pub(crate) aborts: bool,
}

/// Returns the symbol under which a constant names a function: a symbol, or that of `(setf symbol)`.
pub(crate) fn function_name(datum: &Datum) -> Option<Symbol> {
    if let Some(symbol) = datum.as_symbol() {
        return Some(symbol.clone());
    }
    let items = datum.as_list()?;
    match items.as_slice() {
        [head, named] if head.as_symbol()?.is_cl("SETF") => Some(setf_cell(named.as_symbol()?)),
        _ => None,
    }
}

impl CoreForms {
    /// Takes a program apart.
    pub(crate) fn new(cores: Vec<Core>) -> CoreForms {
        let mut forms =
            CoreForms { forms: cores.into_iter().map(CoreForm::new).collect(), ..CoreForms::default() };
        for index in 0..forms.forms.len() {
            forms.note_definitions(index);
        }
        let mut causes = forms.parents.keys().filter(|known| known.is_keyword());
        forms.redefines_mistakes = causes.any(|known| is_mistake(known.name()));
        forms
    }

    fn note_definitions(&mut self, index: usize) {
        let form = &self.forms[index];
        let mut found = Vec::new();
        for (number, node) in form.core.nodes.iter().enumerate() {
            if let NodeKind::Call(callee, arguments) | NodeKind::Apply(callee, arguments) = &node.kind {
                let Some(symbol) = symbol_of(callee) else { continue };
                found.push((NodeId(number as u32), symbol, arguments.clone()));
            }
        }
        for (node, symbol, arguments) in found {
            self.note_call(index, node, symbol.name(), &arguments);
        }
    }

    fn note_call(&mut self, index: usize, node: NodeId, called: &str, arguments: &[NodeId]) {
        let form = &self.forms[index];
        let constant = |argument: usize| match form.kind(*arguments.get(argument)?) {
            NodeKind::Constant(datum) => Some(datum.clone()),
            _ => None,
        };
        let symbols = |datum: Datum| -> Vec<Symbol> {
            datum.elements().filter_map(|one| one.as_symbol().cloned()).collect()
        };
        self.narrows_rights |= called == "%CALL-WITH-RIGHTS";
        let Some(first) = constant(0) else {
            match called {
                "ABORT-TASK" | "%REQUEST-ABORT" => self.aborts = true,
                "%CALL-IN-WORLD" => {
                    let scripts = arguments.first().map(|list| script_names(form, *list)).unwrap_or_default();
                    self.scripted.extend(scripts);
                }
                _ => {}
            }
            return;
        };
        let named = first.as_symbol().cloned();
        if let ("%PUT" | "%DEFINE-PROPERTY", Some(name)) = (called, &named) {
            self.noted.insert(name.clone());
        }
        match (called, named) {
            (
                "%SET-FUNCTION" | "%SET-FUNCTION-NAMED" | "(SETF FDEFINITION)" | "(SETF SYMBOL-FUNCTION)",
                _,
            ) => {
                if let Some(name) = function_name(&first)
                    && self.defined.insert(name.clone(), (index, node)).is_some()
                {
                    self.redefined.insert(name);
                }
            }
            ("%DEFINE-CAUSE", Some(name)) => {
                let parents = constant(1).map(symbols).unwrap_or_default();
                self.declares_causes = true;
                self.causes.insert(name.clone(), (index, node));
                self.parents.insert(name, parents);
            }
            ("%DEFINE-CONDITION", Some(name)) => {
                let parents = constant(1).map(symbols).unwrap_or_default();
                self.condition_types.insert(name.clone());
                self.parents.insert(name, parents);
            }
            ("%ADD-METHOD", _) => self.generic.extend(function_name(&first)),
            ("%DECLARE-EXCLUSIVE", Some(name)) => _ = self.exclusive.insert(name),
            ("%MAKE-CLASS", Some(name)) => {
                if let Some(parent) = constant(1).map(symbols).and_then(|parents| parents.first().cloned()) {
                    self.included.insert(name, parent);
                }
            }
            ("%PUT", Some(name)) if constant(1).is_some_and(|key| is_esl(&key, "%FAILS")) => {
                let causes = constant(2).map(symbols).unwrap_or_default();
                self.declared.entry(name).or_default().add((index, node), causes);
            }
            _ => {}
        }
    }

    /// Returns the structure that a structure includes in the end, which stands for all that include it.
    pub(crate) fn base_class<'a>(&'a self, class: &'a Symbol) -> &'a Symbol {
        let mut base = class;
        for _ in 0..100 {
            match self.included.get(base) {
                Some(parent) => base = parent,
                None => break,
            }
        }
        base
    }
}

/// Returns whether a datum is the symbol `name` of the package `ESL`.
pub(crate) fn is_esl(datum: &Datum, name: &str) -> bool {
    datum.as_symbol().is_some_and(|symbol| symbol.name() == name && symbol.is_in("ESL"))
}

/// Returns the calls of `vector` that a node which lists scripts makes.
pub(crate) fn script_nodes(form: &CoreForm, list: NodeId) -> Vec<Vec<NodeId>> {
    let NodeKind::Call(_, scripts) = form.kind(list) else { return Vec::new() };
    let parts = scripts.iter().filter_map(|script| match form.kind(*script) {
        NodeKind::Call(_, parts) if parts.len() >= 5 => Some(parts.clone()),
        _ => None,
    });
    parts.collect()
}

fn script_names(form: &CoreForm, list: NodeId) -> Vec<Symbol> {
    script_nodes(form, list).iter().filter_map(|parts| form.symbol(parts[0]).cloned()).collect()
}

/// Returns the symbol that a call names.
fn symbol_of(callee: &Callee) -> Option<Symbol> {
    match callee {
        Callee::Global(symbol) => Some(symbol.clone()),
        Callee::Builtin(builtin) => Some(builtin.symbol()),
        Callee::Local(_) | Callee::Value(_) => None,
    }
}

/// Returns the elements of a constant, at all depths, that are symbols.
pub(crate) fn symbols_inside(datum: &Datum) -> Vec<Symbol> {
    /// Most parts of a constant that are looked at.
    const MOST: usize = 2_000;
    let mut found = Vec::new();
    let mut pending = vec![datum];
    for _ in 0..MOST {
        let Some(datum) = pending.pop() else { break };
        match datum.kind() {
            DatumKind::Symbol(symbol) => found.push(symbol.clone()),
            DatumKind::Cons(head, tail) => pending.extend([tail, head]),
            DatumKind::Vector(items) => pending.extend(items.iter()),
            _ => {}
        }
    }
    found
}
