//! Failures that begin in the modules of the system, as a program sees them: each begins at the calls of
//! these modules through which it comes into the program's own code.

use rustc_hash::{FxHashMap, FxHashSet};

use esl_compiler::core::NodeId;

use crate::effect::NodeEffect;
use crate::flow::ValueFlow;
use crate::guard::FailureId;
use crate::solve::{Solution, bodies_of_works};
use crate::value::Code;

/// The places of the program's own code at which failures of modules enter it.
#[derive(Debug, Default)]
pub(crate) struct FoldedModules {
    /// Whether each form is of a module.
    of_module: Vec<bool>,
    /// For each failure, numbers of pieces of code with the nodes there.
    entries: FxHashMap<FailureId, Vec<(usize, NodeId)>>,
}

impl FoldedModules {
    /// Finds them; `of_module` says of each form whether it is of a module.
    pub(crate) fn new(flow: &ValueFlow<'_>, solution: &Solution, of_module: Vec<bool>) -> FoldedModules {
        if !of_module.contains(&true) {
            return FoldedModules { of_module, entries: FxHashMap::default() };
        }
        let bodies = bodies_of_works(flow);
        let called = |number: usize| -> Vec<(NodeId, usize)> {
            let effects = flow.running[number].effects.iter();
            let codes = effects.flat_map(|(node, effect)| {
                let codes: &[Code] = match effect {
                    NodeEffect::FailAs(work)
                    | NodeEffect::FailByCauseOf(work)
                    | NodeEffect::FailAll(work) => &bodies[work.index()],
                    effect => flow.called_by(effect),
                };
                codes.iter().filter_map(|code| Some((*node, flow.number_of(*code)?)))
            });
            codes.collect()
        };
        let direct = direct_failures(flow, solution, &of_module, &called);
        let mut entries: FxHashMap<FailureId, Vec<(usize, NodeId)>> = FxHashMap::default();
        for (number, running) in flow.running.iter().enumerate() {
            if of_module[running.code.form as usize] {
                continue;
            }
            // Code of the program has no direct failures.
            for (node, called) in called(number) {
                for failure in &direct[called] {
                    entries.entry(*failure).or_default().push((number, node));
                }
            }
        }
        FoldedModules { of_module, entries }
    }

    /// Whether a form is of a module.
    pub(crate) fn is_of_module(&self, form: u32) -> bool {
        self.of_module[form as usize]
    }

    /// Returns the entries of a failure in some pieces of code.
    pub(crate) fn entries<'f>(
        &'f self,
        failure: FailureId,
        within: &'f FxHashSet<usize>,
    ) -> impl Iterator<Item = (usize, NodeId)> + 'f {
        let all = self.entries.get(&failure).into_iter().flatten().copied();
        all.filter(|(number, _)| within.contains(number))
    }
}

/// Returns for each piece of code of modules the failures that leave it and have not been in code of the
/// program on their way.
fn direct_failures(
    flow: &ValueFlow<'_>,
    solution: &Solution,
    of_module: &[bool],
    called: &dyn Fn(usize) -> Vec<(NodeId, usize)>,
) -> Vec<FxHashSet<FailureId>> {
    let mut direct: Vec<FxHashSet<FailureId>> = vec![FxHashSet::default(); flow.running.len()];
    let mut callers: Vec<Vec<usize>> = vec![Vec::new(); flow.running.len()];
    let mut pending = Vec::new();
    for (number, running) in flow.running.iter().enumerate() {
        if !of_module[running.code.form as usize] {
            continue;
        }
        let called = called(number);
        for (_, called) in &called {
            callers[*called].push(number);
        }
        // Also in the clauses of the same function, which have code of their own, and where the failure of a
        // task is another one of the same cause.
        let begins_here = |failure: &&FailureId| {
            let form = solution.failures.keys[**failure as usize].form;
            let is_of_called =
                |(_, called): &(NodeId, usize)| solution.leaving[*called].failures.contains(failure);
            form == running.code.form || of_module[form as usize] && !called.iter().any(is_of_called)
        };
        direct[number] = solution.leaving[number].failures.iter().filter(begins_here).copied().collect();
        pending.push(number);
    }
    while let Some(number) = pending.pop() {
        let failures = std::mem::take(&mut direct[number]);
        for caller in callers[number].iter().copied().filter(|caller| *caller != number) {
            let leaving = &solution.leaving[caller].failures;
            let before = direct[caller].len();
            direct[caller].extend(failures.iter().filter(|failure| leaving.contains(failure)));
            if direct[caller].len() > before {
                pending.push(caller);
            }
        }
        direct[number] = failures;
    }
    direct
}
