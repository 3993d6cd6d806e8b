//! The goals of a program: their methods, the functions that these call, and the functions that pursue them.

use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{Callee, LambdaId, NodeId, NodeKind};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::forms::CoreForm;
use crate::row::{GoalMethod, GoalRow};
use crate::table::{Maker, shown_function};

/// Most characters of a test that are shown.
const MOST_CHARACTERS: usize = 30;

impl Maker<'_, '_> {
    /// Returns the goals for which the program's own sources have methods.
    pub(crate) fn goals(&self) -> Vec<GoalRow> {
        let mut goals: FxHashMap<Symbol, GoalRow> = FxHashMap::default();
        for (index, form) in self.flow.forms.forms.iter().enumerate() {
            for (number, node) in form.core.nodes.iter().enumerate() {
                let NodeKind::Call(callee, arguments) = &node.kind else { continue };
                let [named, indicator, function] = arguments.as_slice() else { continue };
                let is_put = name_of(callee).is_some_and(|name| name == "%PUT");
                let is_method = form.symbol(*indicator).is_some_and(|symbol| symbol.name() == "%ACHIEVE");
                let (Some(name), NodeKind::Lambda(lambda)) = (form.symbol(*named), form.kind(*function))
                else {
                    continue;
                };
                let place = self.place(index as u32, NodeId(number as u32));
                if !is_put || !is_method || !self.is_own(&place.source) {
                    continue;
                }
                let text = &form.core.lambdas[lambda.index()];
                let parameters = text.required.iter().map(|parameter| {
                    let variable = &form.core.variables[parameter.variable.index()];
                    format!(" {}", variable.name.name().to_lowercase())
                });
                let title = format!("({}{})", shown_function(name), parameters.collect::<String>());
                let methods = self.methods(form, text.body);
                let row = GoalRow { title, place, methods, pursued_in: Vec::new() };
                goals.insert(name.clone(), row);
            }
        }
        for (name, function) in self.pursuits() {
            if let Some(row) = goals.get_mut(&name) {
                row.pursued_in.push(function);
            }
        }
        let mut rows: Vec<GoalRow> = goals.into_values().collect();
        rows.iter_mut().for_each(|row| row.pursued_in.sort_unstable());
        rows.sort_by(|left, right| left.place.cmp(&right.place));
        rows
    }

    /// Returns the methods of a goal, whose body is a `cond`.
    fn methods(&self, form: &CoreForm, body: NodeId) -> Vec<GoalMethod> {
        let mut methods = Vec::new();
        let mut node = body;
        loop {
            match form.kind(node) {
                NodeKind::If(test, then, otherwise) => {
                    methods
                        .push(GoalMethod { test: self.shown(form, *test), calls: self.calls(form, *then) });
                    node = *otherwise;
                }
                NodeKind::Progn(nodes) if nodes.len() == 1 => node = nodes[0],
                NodeKind::Block(_, inner) | NodeKind::Let { body: inner, .. } => node = *inner,
                NodeKind::Constant(datum) if datum.is_nil() => return methods,
                _ => {
                    let test = if methods.is_empty() { "always" } else { "otherwise" };
                    methods.push(GoalMethod { test: test.into(), calls: self.calls(form, node) });
                    return methods;
                }
            }
        }
    }

    /// Returns the text of a node, on one line.
    fn shown(&self, form: &CoreForm, node: NodeId) -> String {
        let span = form.core.nodes[node.index()].span;
        let text =
            self.sources.text(span.source).and_then(|text| text.get(span.start as usize..span.end as usize));
        let line = text.unwrap_or_default().split_whitespace().collect::<Vec<&str>>().join(" ");
        match line.chars().count() > MOST_CHARACTERS {
            true => line.chars().take(MOST_CHARACTERS - 1).chain(['…']).collect(),
            false => line,
        }
    }

    /// Returns the functions of the program that a part of a form calls.
    fn calls(&self, form: &CoreForm, node: NodeId) -> Vec<String> {
        let mut names = Vec::new();
        let mut pending = vec![node];
        while let Some(node) = pending.pop() {
            let kind = form.kind(node);
            if let NodeKind::Call(Callee::Global(name), _) | NodeKind::Apply(Callee::Global(name), _) = kind {
                let is_own = self
                    .flow
                    .forms
                    .defined
                    .get(name)
                    .is_some_and(|(form, node)| self.is_own(&self.place(*form as u32, *node).source));
                let shown = shown_function(name);
                if is_own && !names.contains(&shown) {
                    names.push(shown);
                }
            }
            if let NodeKind::Lambda(lambda) = kind {
                pending.push(form.core.lambdas[lambda.index()].body);
            }
            children(kind, &mut |child| pending.push(child));
        }
        names
    }

    /// Returns the names of goals and properties with the functions that achieve or maintain them.
    fn pursuits(&self) -> FxHashSet<(Symbol, String)> {
        let mut found = FxHashSet::default();
        for (index, form) in self.flow.forms.forms.iter().enumerate() {
            for (number, node) in form.core.nodes.iter().enumerate() {
                let NodeKind::Call(callee, arguments) = &node.kind else { continue };
                // A property is maintained under a key, a list that begins with its name.
                let is_pursuit = name_of(callee).is_some_and(|name| matches!(name, "%ACHIEVE" | "CONS"));
                let Some(name) = arguments.first().and_then(|first| form.symbol(*first)) else { continue };
                let owner = form.owners[number];
                let source = self.place(index as u32, NodeId(number as u32)).source;
                if is_pursuit && self.is_own(&source) && owner != LambdaId(0) {
                    found.insert((name.clone(), self.function_around(index as u32, owner)));
                }
            }
        }
        found
    }
}

/// Returns the name of a function that is called by name.
fn name_of(callee: &Callee) -> Option<&str> {
    match callee {
        Callee::Global(symbol) => Some(symbol.name()),
        Callee::Builtin(builtin) => Some(builtin.info().name),
        _ => None,
    }
}
