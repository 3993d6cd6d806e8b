//! A program in ESL for a model.
//!
//! A tree is a function, a named node of some size too; entries of the blackboard are fluents; leaves are
//! functions that are declared once. A node is stated by forms of the language where these mean the same, and
//! stays a node of `bt:ticking` otherwise.
//!
//! Guarantees: the text takes time in proportion to the nodes, once for each use of a subtree with other
//! outputs, and no native recursion.

mod entries;
mod form;
mod instances;
mod leaves;
mod modes;
mod names;
mod plain;
mod program;
mod scripts;
mod single;
mod ticked;

use std::collections::{BTreeSet, HashMap, HashSet};

use crate::catalogue::BehaviourKind;
use crate::fault::TreeFault;
use crate::model::Model;
use crate::script::Expression;

use entries::EntryUses;
use form::{FormId, Forms};
use instances::Instance;
use leaves::Leaves;
use modes::Modes;
use names::ProgramNames;

pub(crate) use leaves::literal;
pub(crate) use ticked::{moment_name, operator};

/// Least number of atoms of a named node that becomes a function of its own.
const NAMED_SIZE: usize = 14;

/// Deepest nesting of forms in one function.
const MAX_DEPTH: usize = 11;

/// A global variable of the program.
struct FluentRow {
    name: String,
    documentation: String,
    initial: String,
}

/// Writes a program.
pub(crate) struct Emitter<'a> {
    model: &'a Model,
    entries: &'a EntryUses,
    modes: &'a Modes,
    forms: Forms,
    names: ProgramNames<'a>,
    leaves: Leaves,
    instances: Vec<Instance>,
    by_key: HashMap<instances::Key, usize>,
    /// The instance at hand, and its first node.
    current: usize,
    base: usize,
    tests: Vec<FormId>,
    bodies: Vec<Vec<FormId>>,
    ticks: Vec<Option<FormId>>,
    /// Definitions of functions, in the order in which they are made; those of an instance together.
    functions: Vec<Vec<FormId>>,
    globals: Vec<FluentRow>,
    entry_names: HashSet<String>,
    measures: Vec<(String, String)>,
    /// Entries that only true and false are stored in.
    booleans: HashSet<String>,
    /// Names in scripts that nothing sets, in upper case.
    enumerators: HashSet<String>,
    /// Causes of failures, without those of the language.
    causes: BTreeSet<String>,
    needs_bt: bool,
    notes_errors: bool,
}

/// Returns the text of the program for a model; `is_reserved` tells the names of the language.
pub(crate) fn program(
    model: &Model,
    title: &str,
    is_reserved: &dyn Fn(&str) -> bool,
) -> Result<String, TreeFault> {
    let entries = EntryUses::new(model);
    let modes = Modes::new(model, &entries);
    let mut names = ProgramNames::new(is_reserved);
    let leaves = Leaves::new(model, &entries, &mut names);
    let (booleans, enumerators) = kinds_of_names(model, &entries);
    let mut emitter = Emitter {
        model,
        entries: &entries,
        modes: &modes,
        forms: Forms::default(),
        names,
        leaves,
        instances: Vec::new(),
        by_key: HashMap::new(),
        current: 0,
        base: 0,
        tests: Vec::new(),
        bodies: Vec::new(),
        ticks: Vec::new(),
        functions: Vec::new(),
        globals: Vec::new(),
        entry_names: HashSet::new(),
        measures: Vec::new(),
        booleans,
        enumerators,
        causes: BTreeSet::new(),
        needs_bt: false,
        notes_errors: false,
    };
    emitter.write_instances()?;
    Ok(emitter.text(title))
}

/// Returns the entries that only true and false are stored in, and the enumerators.
fn kinds_of_names(model: &Model, entries: &EntryUses) -> (HashSet<String>, HashSet<String>) {
    let mut booleans: HashMap<String, bool> = HashMap::new();
    let mut mentioned: HashSet<String> = HashSet::new();
    for node in &model.nodes {
        for script in node.conditions.iter().map(|(_, script)| script).chain([&node.script]) {
            for expression in &script.expressions {
                match expression {
                    Expression::Assignment(_, name, value) => {
                        let value = &script.expressions[*value];
                        let is_boolean = matches!(
                            value,
                            Expression::Boolean(_) | Expression::Comparison(..) | Expression::Unary("!", _)
                        );
                        let known = booleans.entry(name.clone()).or_insert(true);
                        *known = *known && is_boolean;
                    }
                    Expression::Name(name) => _ = mentioned.insert(name.clone()),
                    _ => {}
                }
            }
        }
        for port in &node.ports {
            let (crate::model::PortValue::Text(text) | crate::model::PortValue::Entry(text)) = &port.value;
            let is_set = node.kind == BehaviourKind::SetBlackboard && port.name == "output_key";
            if is_set {
                let is_boolean = node.text("value").is_some_and(|value| ["true", "false"].contains(&&*value));
                let known = booleans.entry(text.clone()).or_insert(true);
                *known = *known && is_boolean;
            } else if matches!(port.value, crate::model::PortValue::Entry(_)) && !node.kind.is_leaf() {
                booleans.insert(text.clone(), false);
            }
        }
    }
    let is_set = |name: &str| entries.trees.iter().any(|tree| tree.set.contains(name));
    let is_port = |name: &str| {
        model.nodes.iter().any(|node| {
            node.ports.iter().any(|port| {
                port.name == name
                    || matches!(&port.value, crate::model::PortValue::Entry(entry) if entry == name)
            })
        })
    };
    let is_upper = |name: &str| name.len() > 1 && !name.contains(char::is_lowercase);
    let enumerators =
        mentioned.into_iter().filter(|name| is_upper(name) && !is_set(name) && !is_port(name)).collect();
    (booleans.into_iter().filter(|(_, is_boolean)| *is_boolean).map(|(name, _)| name).collect(), enumerators)
}
