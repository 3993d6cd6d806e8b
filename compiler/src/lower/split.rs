//! Division of functions that are too large for the format: parts of their text become functions of their
//! own, which capture the variables that they need and are called in place.
//!
//! The parts keep their meaning, since everything lexical may cross the border of a function: assigned
//! variables get boxes, exits become throws. The parts are slower, which is the price of a function with
//! thousands of forms, hundreds of variables, or expressions a hundred levels deep.

use esl_bytecode::span::Span;

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

/// Divides the texts of `lambdas`.
pub(super) fn split(core: &mut Core, lambdas: &[LambdaId], limits: Limits) {
    let before = core.lambdas.len();
    let mut sizes = Vec::new();
    for &lambda in lambdas {
        let mut roots = Vec::new();
        lambda_nodes(&core.lambdas[lambda.index()], &mut |node| roots.push(node));
        for root in roots {
            Splitter { core, lambda, limits }.split(root, &mut sizes);
        }
    }
    (before..core.lambdas.len()).for_each(|made| adopt(core, LambdaId(made as u32)));
}

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
    /// Divides the form `root`. `sizes` are for use, with the sizes of other forms.
    fn split(&mut self, root: NodeId, sizes: &mut Vec<Size>) {
        let mut order = vec![root];
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            children(&self.core.nodes[node.index()].kind, &mut |child| order.push(child));
            next += 1;
        }
        sizes.resize(self.core.nodes.len(), Size::default());
        // Children come behind their parents.
        for &node in order.iter().rev() {
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
            if is_large && node != root && size.weight >= MIN_WEIGHT {
                self.take_out(node);
                size = Size { weight: 3, height: 1 };
            }
            sizes[node.index()] = size;
        }
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

/// Makes `lambda` the owner of everything that its text binds.
fn adopt(core: &mut Core, lambda: LambdaId) {
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
    }
}
