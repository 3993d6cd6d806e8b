//! The possible failures of a program: the causes of failures that can leave each function and each task,
//! where they begin, which clauses take them and how these answer.
//!
//! The analysis works on the core language of a whole program with its modules, which the compiler keeps on
//! request. It needs no annotation. Two passes: `flow` finds which functions may be called where, `solve`
//! which failures leave which code, form and task. Functions of the library are known by tables
//! (`library`); functions of the host by declarations, `(declaim (fails name cause*))`.
//!
//! `orders` finds resources that tasks take in different orders, `types` calls that cannot succeed.
//!
//! Guarantees: a failure that leaves a task in a run is in the table, apart from the cases that the chapter
//! "Possible failures" of the manual lists. Not here: reading files, printing.
#![forbid(unsafe_code)]

mod advice;
mod call;
mod cause;
mod cells;
mod clause;
mod declared;
mod effect;
mod evaluate;
mod explain;
mod flow;
mod folded;
mod forms;
mod goals;
mod guard;
mod handling;
mod hot;
mod library;
mod many;
mod meeting;
mod objects;
mod orders;
mod pending;
mod resuming;
mod rights;
mod row;
mod solve;
mod spent;
mod table;
mod taken;
mod types;
mod value;

pub mod render;

use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::diagnostic::{Diagnostic, Label};
use esl_bytecode::span::Span;
use esl_compiler::core::{Core, LambdaId};
use esl_compiler::diagnostic::Sources;

use effect::{FailureKind, NodeEffect, Reason};
use flow::ValueFlow;
use folded::FoldedModules;
use forms::CoreForms;
use table::Maker;
use value::{Code, NO_CONTEXT};

pub use cause::shown_cause;
pub use rights::{NeededRights, needed_rights};
pub use row::{
    CauseRow, ClauseRow, CodePlace, FailingTask, FailureOrigin, FailureTable, FunctionRow, GoalMethod,
    GoalRow, HandlingForm,
};
pub use types::{KnownField, MessageFields, compare_message_fields};
#[doc(hidden)]
pub use types::{LibraryTypes, library_types, table_of_library};
pub use value::TaskKind;

/// Options of an analysis.
#[derive(Clone, Debug, Default)]
pub struct AnalysisOptions {
    /// Whether programming errors are listed.
    pub all: bool,
    /// Cause whose ways are explained.
    pub explained: Option<String>,
}

/// Returns the causes that functions of the library begin by themselves, in upper case.
pub fn causes_of_the_library() -> impl Iterator<Item = &'static str> {
    library::all_causes()
}

/// Analyses a program: its top-level forms, and the sources that their places refer to. Returns the table,
/// and the explanation of a cause if one was asked for. If too many values flow, the table has only the
/// findings of the types and an error for each declaration of failures, and says that it
/// [is incomplete](FailureTable::is_incomplete).
pub fn analyze(cores: Vec<Core>, sources: &Sources, options: &AnalysisOptions) -> (FailureTable, String) {
    let forms = CoreForms::new(cores);
    let mut findings = types::findings(&forms, sources);
    let Some(mut flow) = solved(&forms, Some(sources)) else {
        findings.extend(declared::unchecked(&forms, sources));
        let declared = declared::declared(&forms);
        let table = FailureTable { declared, findings, is_incomplete: true, ..FailureTable::default() };
        return (table, String::new());
    };
    // Computed causes without a known value.
    for spot in std::mem::take(&mut flow.computed) {
        if !flow.fails_at(spot) {
            flow.note(spot, NodeEffect::Fail(FailureKind::Any(Reason::Computed)));
        }
    }
    let solution = solve::solve(&flow);
    let numbers = table::numbers_of(&flow);
    let folded = FoldedModules::new(&flow, &solution, of_modules(&forms, sources));
    let maker = Maker { flow: &flow, solution: &solution, folded, sources, all: options.all, numbers };
    let explanation = options.explained.as_ref().map(|cause| maker.explain(cause)).unwrap_or_default();
    let mut table = maker.table();
    table.findings.extend(findings);
    (table, explanation)
}

/// Codes of the warnings of an analysis.
pub const WARNINGS: [&str; 5] = esl_compiler::diagnostic::code::OF_ANALYSES;

/// Leaves out the warnings of the compiler about clauses that merely fall off their ends if the program's
/// functions show that control cannot reach these; to the others it adds the failures that the value of the
/// clause answers.
pub fn sharpen(diagnostics: &mut Vec<Diagnostic>, table: &FailureTable) {
    let of_clause = |diagnostic: &Diagnostic| {
        let is_it = |clause: &&ClauseRow| diagnostic.primary.span.contains(clause.span);
        if diagnostic.code == "clause-falls-off" { table.clauses.iter().find(is_it) } else { None }
    };
    diagnostics.retain(|diagnostic| of_clause(diagnostic).is_none_or(|clause| !clause.never_ends));
    for diagnostic in diagnostics {
        let Some(clause) = of_clause(diagnostic) else { continue };
        let origins = clause.causes.iter().flat_map(|row| row.origins.iter().map(move |one| (row, one)));
        let shown: Vec<(String, Span)> = origins
            .take(MOST_ORIGINS)
            .map(|(row, origin)| (format!("{} begins here", row.cause), origin.span()))
            .collect();
        diagnostic.secondary.extend(shown.into_iter().map(|(text, span)| Label { span, text }));
    }
}

/// Most failures that the warning about a clause names.
const MOST_ORIGINS: usize = 3;

/// Returns the causes with which a function of the library, named in lower case, may fail by itself, apart
/// from programming errors.
///
/// ```
/// assert_eq!(esl_analysis::causes_of_function("next-bindings"), [":no-more-bindings"]);
/// ```
pub fn causes_of_function(name: &str) -> Vec<String> {
    let causes = library::causes_of(&name.to_uppercase()).iter();
    causes.map(|cause| format!(":{}", cause.trim_start_matches('!').to_lowercase())).collect()
}

/// Returns warnings about resources that tasks of a program take in different orders, so that they can
/// wait for each other.
pub fn resource_orders(cores: Vec<Core>) -> Vec<Diagnostic> {
    let forms = CoreForms::new(cores);
    // Programs without resources are many.
    if orders::single_resources(&forms).len() < 2 {
        return Vec::new();
    }
    solved(&forms, None).map(|flow| orders::findings(&flow)).unwrap_or_default()
}

/// Looks at the top-level forms of a program, and at all that these run; with `sources`, at its functions
/// that nothing calls, too. If too many values flow, contexts are not told apart, which takes less; if there
/// are still too many, returns nothing.
fn solved<'a>(forms: &'a CoreForms, sources: Option<&Sources>) -> Option<ValueFlow<'a>> {
    [flow::DEPTH, 0].into_iter().find_map(|depth| {
        let mut flow = ValueFlow::new(forms, depth);
        for form in 0..forms.forms.len() {
            flow.run(Code { form: form as u32, lambda: LambdaId(0), context: NO_CONTEXT });
        }
        flow.solve();
        if let Some(sources) = sources {
            add_uncalled(&mut flow, sources);
            flow.solve();
        }
        (!flow.was_given_up()).then_some(flow)
    })
}

/// Returns of each form whether it is of a module that comes with the system.
fn of_modules(forms: &CoreForms, sources: &Sources) -> Vec<bool> {
    let spans = forms.forms.iter().map(|form| form.core.nodes.first().map(|node| node.span));
    spans.map(|span| span.is_some_and(|span| !is_of_program(sources, span))).collect()
}

/// Returns whether a place is in the program, not in a module that comes with the system.
fn is_of_program(sources: &Sources, span: Span) -> bool {
    !sources.name(span.source).is_some_and(|name| name.starts_with(MODULE_SOURCES))
}

/// Looks at the program's own functions without a call, and at those that call their arguments, apart
/// from any call.
fn add_uncalled(flow: &mut ValueFlow<'_>, sources: &Sources) {
    let forms = flow.forms;
    let mut defined: Vec<_> = forms.defined.values().copied().collect();
    defined.sort_unstable();
    for (form, node) in defined {
        let span = forms.forms[form].core.nodes[node.index()].span;
        if !is_of_program(sources, span) {
            continue;
        }
        let esl_compiler::core::NodeKind::Call(_, arguments) = forms.forms[form].kind(node) else { continue };
        let Some(function) = arguments.get(1) else { continue };
        if let esl_compiler::core::NodeKind::Lambda(lambda) = forms.forms[form].kind(*function) {
            flow.run(Code { form: form as u32, lambda: *lambda, context: NO_CONTEXT });
        }
    }
}
