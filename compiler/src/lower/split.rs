//! Division of functions that are too large for the format: parts of their text become functions of their
//! own, which capture the variables that they need and are called in place.
//!
//! The parts keep their meaning, since everything lexical may cross the border of a function: assigned
//! variables get boxes, exits become throws. The parts are slower, which is the price of a function with
//! thousands of forms, hundreds of variables, or expressions a hundred levels deep.

use esl_bytecode::compile::Work;
use esl_bytecode::span::Span;

use super::gather::GatheredVariables;
use crate::core::*;
use crate::resolve::{children, lambda_nodes};

/// Limits on the size of a part.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// In nodes.
    weight: usize,
    /// In levels of nodes.
    height: usize,
    /// In variables of one `let`.
    bindings: usize,
}

/// Limits that are tried, one after the other, until all functions fit.
pub(super) const LIMITS: [Limits; 4] = [
    Limits { weight: 3000, height: 100, bindings: 60 },
    Limits { weight: 1000, height: 50, bindings: 40 },
    Limits { weight: 300, height: 25, bindings: 30 },
    Limits { weight: 100, height: 12, bindings: 20 },
];

/// Limits so small that every form is taken out, for tests.
#[cfg(test)]
pub(super) const TINY: Limits = Limits { weight: 12, height: 5, bindings: 2 };

/// Weight below which a part is not worth a call.
const MIN_WEIGHT: usize = 6;

/// Returns the lambdas whose texts have more than `limit` nodes, those of lambdas inside them not counted.
pub(super) fn larger_than(core: &Core, limit: usize) -> Vec<LambdaId> {
    if core.nodes.len() <= limit {
        return Vec::new();
    }
    let is_large = |lambda: &LambdaId| {
        let mut pending = Vec::new();
        lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push(node));
        let mut count = 0;
        while let Some(node) = pending.pop() {
            count += 1;
            if count > limit {
                return true;
            }
            children(&core.nodes[node.index()].kind, &mut |child| pending.push(child));
        }
        false
    };
    (0..core.lambdas.len()).map(|index| LambdaId(index as u32)).filter(is_large).collect()
}

/// The division of the texts of functions. It is done in parts; each is given the same form.
pub(super) struct FunctionDivision {
    limits: Limits,
    variables: GatheredVariables,
    /// Roots that are still to be divided, and the lambdas that they belong to.
    roots: Vec<(NodeId, LambdaId)>,
    lambdas: Vec<LambdaId>,
    /// Root that is being divided.
    current: Option<CurrentRoot>,
    /// Sizes of nodes.
    sizes: Vec<Size>,
    /// Lambdas from here on are new, and do not own what they bind yet.
    unsettled: Option<usize>,
}

/// A root that is being divided.
struct CurrentRoot {
    root: NodeId,
    lambda: LambdaId,
    /// Its nodes, children behind their parents.
    order: Vec<NodeId>,
    /// How many of them have their children in the order.
    opened: usize,
}

impl FunctionDivision {
    /// Begins to divide the texts of `lambdas`.
    /// If they make closures with too many captures, their variables share vectors.
    pub(super) fn new(
        core: &Core,
        lambdas: Vec<LambdaId>,
        limits: Limits,
        shares_vectors: bool,
    ) -> FunctionDivision {
        let variables = GatheredVariables::new(core, &lambdas, limits.bindings, shares_vectors);
        let roots = Vec::new();
        FunctionDivision {
            limits,
            variables,
            roots,
            lambdas,
            current: None,
            sizes: Vec::new(),
            unsettled: None,
        }
    }

    /// Goes on. Returns whether all is done; otherwise the work that is allowed is done.
    pub(super) fn run(&mut self, core: &mut Core, work: &mut Work) -> bool {
        if !self.variables.run(core, work) {
            return false;
        }
        if self.unsettled.is_none() {
            self.unsettled = Some(core.lambdas.len());
            for &lambda in &self.lambdas {
                lambda_nodes(&core.lambdas[lambda.index()], &mut |node| self.roots.push((node, lambda)));
            }
            self.roots.reverse();
        }
        loop {
            if let Some(current) = &mut self.current {
                let mut splitter = Splitter { core, lambda: current.lambda, limits: self.limits };
                if !splitter.go_on(current, &mut self.sizes, work) {
                    return false;
                }
            }
            let Some((root, lambda)) = self.roots.pop() else { break };
            self.current = Some(CurrentRoot { root, lambda, order: vec![root], opened: 0 });
        }
        self.current = None;
        while let Some(made) = self.unsettled.filter(|&made| made < core.lambdas.len()) {
            if work.is_done() {
                return false;
            }
            work.add(adopt(core, LambdaId(made as u32)) / NODES_PER_UNIT);
            self.unsettled = Some(made + 1);
        }
        true
    }
}

/// Divides the texts of `lambdas`.
#[cfg(test)]
pub(super) fn split(core: &mut Core, lambdas: &[LambdaId], limits: Limits) {
    FunctionDivision::new(core, lambdas.to_vec(), limits, false).run(core, &mut Work::unbounded());
}

/// Nodes that count as a unit of work.
const NODES_PER_UNIT: u64 = 8;

struct Splitter<'a> {
    core: &'a mut Core,
    lambda: LambdaId,
    limits: Limits,
}

/// Size of a form without the parts that were taken out of it.
#[derive(Clone, Copy, Default)]
struct Size {
    weight: usize,
    height: usize,
}

impl Splitter<'_> {
    /// Goes on to divide a form. `sizes` are for use, with the sizes of other forms. Returns whether it is
    /// divided.
    fn go_on(&mut self, current: &mut CurrentRoot, sizes: &mut Vec<Size>, work: &mut Work) -> bool {
        let CurrentRoot { root, order, opened, .. } = current;
        while let Some(&node) = order.get(*opened) {
            if (*opened as u64).is_multiple_of(NODES_PER_UNIT) {
                if work.is_done() {
                    return false;
                }
                work.add(1);
            }
            children(&self.core.nodes[node.index()].kind, &mut |child| order.push(child));
            *opened += 1;
            if *opened == order.len() {
                sizes.resize(self.core.nodes.len(), Size::default());
                // Nothing is left to be opened from here on, though the order gets shorter.
                *opened = usize::MAX;
            }
        }
        // Children come behind their parents.
        while let Some(&node) = order.last() {
            if (order.len() as u64).is_multiple_of(NODES_PER_UNIT) {
                if work.is_done() {
                    return false;
                }
                work.add(1);
            }
            order.pop();
            let mut size = Size::default();
            children(&self.core.nodes[node.index()].kind, &mut |child| {
                size = size.with(sizes[child.index()])
            });
            if size.weight > self.limits.weight {
                size = self.divide_forms(node, sizes).unwrap_or(size);
            }
            if let Some(smaller) = self.divide_bindings(node, sizes) {
                size = smaller;
            }
            size.weight += 1;
            size.height += 1;
            let is_large = size.weight > self.limits.weight || size.height > self.limits.height;
            if is_large && node != *root && size.weight >= MIN_WEIGHT {
                self.take_out(node);
                size = Size { weight: 3, height: 1 };
            }
            sizes[node.index()] = size;
        }
        true
    }

    fn node(&mut self, kind: NodeKind, span: Span) -> NodeId {
        self.core.nodes.push(Node { kind, span });
        NodeId(self.core.nodes.len() as u32 - 1)
    }

    /// Makes a function of a form, and puts a call of it in its place.
    fn take_out(&mut self, node: NodeId) {
        let span = self.core.nodes[node.index()].span;
        let kind = std::mem::replace(&mut self.core.nodes[node.index()].kind, NodeKind::Hole);
        let body = self.node(kind, span);
        let lambda = LambdaId(self.core.lambdas.len() as u32);
        self.core.lambdas.push(Lambda::without_parameters(Some(self.lambda), span, body));
        let closure = self.node(NodeKind::Lambda(lambda), span);
        // A call of a plain lambda would become part of the frame again.
        let hidden = self.node(NodeKind::Progn(vec![closure]), span);
        self.core.nodes[node.index()].kind = NodeKind::Call(Callee::Value(hidden), Vec::new());
    }

    /// Takes out runs of consecutive forms; returns the new size, or `None` if the node has no such forms.
    fn divide_forms(&mut self, node: NodeId, sizes: &[Size]) -> Option<Size> {
        let span = self.core.nodes[node.index()].span;
        let mut size = Size::default();
        let mut run: Vec<NodeId> = Vec::new();
        let mut weight = 0;
        match std::mem::replace(&mut self.core.nodes[node.index()].kind, NodeKind::Hole) {
            NodeKind::Progn(forms) => {
                let mut divided = Vec::new();
                for form in forms {
                    if weight + sizes[form.index()].weight > self.limits.weight {
                        divided.extend(self.take_out_run(std::mem::take(&mut run), span));
                        weight = 0;
                    }
                    weight += sizes[form.index()].weight;
                    run.push(form);
                }
                divided.extend(self.take_out_run(run, span));
                divided.iter().for_each(|_| size = size.with(Size { weight: 3, height: 1 }));
                self.core.nodes[node.index()].kind = NodeKind::Progn(divided);
            }
            NodeKind::Tagbody(tagbody, items) => {
                let mut divided = Vec::new();
                for item in items {
                    match item {
                        TagbodyItem::Form(form)
                            if weight + sizes[form.index()].weight <= self.limits.weight =>
                        {
                            weight += sizes[form.index()].weight;
                            run.push(form);
                        }
                        other => {
                            let taken = self.take_out_run(std::mem::take(&mut run), span);
                            divided.extend(taken.map(TagbodyItem::Form));
                            weight = 0;
                            match other {
                                TagbodyItem::Tag => divided.push(TagbodyItem::Tag),
                                TagbodyItem::Form(form) => {
                                    weight = sizes[form.index()].weight;
                                    run.push(form);
                                }
                            }
                        }
                    }
                }
                divided.extend(self.take_out_run(run, span).map(TagbodyItem::Form));
                divided.iter().for_each(|_| size = size.with(Size { weight: 3, height: 1 }));
                self.core.nodes[node.index()].kind = NodeKind::Tagbody(tagbody, divided);
            }
            other => {
                self.core.nodes[node.index()].kind = other;
                return None;
            }
        }
        Some(size)
    }

    fn take_out_run(&mut self, run: Vec<NodeId>, span: Span) -> Option<NodeId> {
        if run.is_empty() {
            return None;
        }
        let node = self.node(NodeKind::Progn(run), span);
        self.take_out(node);
        Some(node)
    }

    /// Binds the later variables of a long `let` in functions of their own; returns the new size if it did.
    fn divide_bindings(&mut self, node: NodeId, sizes: &[Size]) -> Option<Size> {
        let Node { kind: NodeKind::Let { sequential, bindings, body }, span } =
            &mut self.core.nodes[node.index()]
        else {
            return None;
        };
        // Names are resolved, so variables may be bound one after another, unless bindings are dynamic.
        let in_order =
            *sequential || bindings.iter().all(|(target, _)| matches!(target, BoundVariable::Lexical(_)));
        if bindings.len() <= self.limits.bindings || !in_order {
            return None;
        }
        let (span, mut body) = (*span, *body);
        let bindings = std::mem::take(bindings);
        let size = bindings[..self.limits.bindings]
            .iter()
            .fold(Size { weight: 3, height: 1 }, |size, (_, value)| size.with(sizes[value.index()]));
        for chunk in bindings.chunks(self.limits.bindings).skip(1).rev() {
            body = self.node(NodeKind::Let { sequential: true, bindings: chunk.to_vec(), body }, span);
            self.take_out(body);
        }
        let first = bindings[..self.limits.bindings].to_vec();
        self.core.nodes[node.index()].kind = NodeKind::Let { sequential: true, bindings: first, body };
        Some(size)
    }
}

impl Size {
    fn with(self, part: Size) -> Size {
        Size { weight: self.weight + part.weight, height: self.height.max(part.height) }
    }
}

/// Makes `lambda` the owner of everything that its text binds. Returns the number of its nodes.
fn adopt(core: &mut Core, lambda: LambdaId) -> u64 {
    let mut nodes = 0;
    let mut pending = vec![core.lambdas[lambda.index()].body];
    while let Some(node) = pending.pop() {
        let kind = &core.nodes[node.index()].kind;
        let variables = &mut core.variables;
        let mut own = |variable: VarId| variables[variable.index()].owner = lambda;
        let mut own_target = |target: &BoundVariable| match target {
            BoundVariable::Lexical(variable) => own(*variable),
            BoundVariable::Special(_) => {}
        };
        match kind {
            NodeKind::Let { bindings, .. } => bindings.iter().for_each(|(target, _)| own_target(target)),
            NodeKind::BindValues(targets, ..) => targets.iter().for_each(own_target),
            NodeKind::HandlerCase(_, clauses) => clauses.iter().for_each(|clause| own(clause.variable)),
            NodeKind::Functions { definitions, .. } => {
                definitions.iter().for_each(|(variable, _)| own(*variable))
            }
            NodeKind::Block(block, _) => core.blocks[block.index()].owner = lambda,
            NodeKind::Tagbody(tagbody, _) => core.tagbodies[tagbody.index()].owner = lambda,
            _ => {}
        }
        children(kind, &mut |child| pending.push(child));
        nodes += 1;
    }
    nodes
}
