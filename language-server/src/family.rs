//! Families: names that a definition makes from another one, and that are renamed with it. A structure makes
//! its constructor, copier, predicate and accessors; a condition its cause.

use std::collections::HashSet;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

use super::document::OpenText;
use super::rename::RenameRefusal;

/// A name and the one that it becomes: without packages, in lower case, causes with their colons.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RenamedName {
    pub(super) old: String,
    pub(super) new: String,
}

/// The names that are renamed together.
#[derive(Debug, Default)]
pub(super) struct Family {
    pub(super) names: Vec<RenamedName>,
    /// Further names: slots where they are defined, and keywords of constructors. Each with the number of its
    /// text, its node, and the name that it becomes, without its colon.
    pub(super) places: Vec<(usize, NodeId, String)>,
}

/// A definition by `defstruct`.
#[derive(Debug)]
struct StructureForm {
    text: usize,
    form: NodeId,
    name: String,
    parent: Option<String>,
    /// The prefix of accessors: the name and a hyphen, unless the definition says something else.
    prefix: String,
    has_own_prefix: bool,
    /// Names that are made from that of the structure, but accessors.
    made: Vec<String>,
    /// All constructors.
    constructors: Vec<String>,
    /// Slots that it defines, or whose defaults it changes.
    slots: Vec<(String, NodeId)>,
    changed: Vec<(String, NodeId)>,
    /// Names in the lambda lists of constructors.
    parameters: HashSet<String>,
}

/// The patterns of names that a structure makes; `*` stands for its name.
const MADE: [&str; 3] = ["make-*", "copy-*", "*-p"];

/// Returns what has to be renamed with a global name.
///
/// # Errors
/// The new name does not fit into the family, or not all of the family is known.
pub(super) fn family(texts: &[OpenText], name: &str, new: &str) -> Result<Family, RenameRefusal> {
    let structures: Vec<StructureForm> =
        texts.iter().enumerate().flat_map(|(at, text)| structures(at, &text.tree)).collect();
    if structures.iter().any(|structure| structure.name == name) {
        return of_structure(&structures, name, new);
    }
    if let Some(structure) =
        structures.iter().find(|structure| structure.made.iter().any(|made| made == name))
    {
        let pattern = MADE.into_iter().find(|pattern| pattern.replace('*', &structure.name) == name);
        let pattern = pattern.unwrap_or(MADE[0]);
        let (start, end) = pattern.split_once('*').unwrap_or_default();
        let other = new.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
        return match other.filter(|other| !other.is_empty()) {
            Some(other) => of_structure(&structures, &structure.name, other),
            None => Err(RenameRefusal::Made {
                name: name.into(),
                by: structure.name.clone(),
                pattern: pattern.replace('*', "NAME"),
            }),
        };
    }
    for structure in &structures {
        let slots = all_slots(&structures, structure).unwrap_or_default();
        if let Some(slot) = slots.iter().find(|slot| structure.prefix.clone() + slot == name) {
            return of_slot(texts, &structures, structure, slot, new);
        }
    }
    let bare = name.trim_start_matches(':');
    let names = |old: String, new: String| RenamedName { old, new };
    let is_condition = |text: &OpenText| {
        let tree = &text.tree;
        let defines = |&form: &NodeId| {
            tree.operator(form).as_deref() == Some("define-condition")
                && tree.data(form).nth(1).and_then(|name| tree.name(name)).map(bare_name).as_deref()
                    == Some(bare)
        };
        tree.nodes().filter(|&node| tree.kind(node) == SyntaxKind::List).any(|form| defines(&form))
    };
    let mut family = Family { names: vec![names(name.into(), new.into())], places: Vec::new() };
    if texts.iter().any(is_condition) {
        let new = new.trim_start_matches(':');
        let other = if name.starts_with(':') {
            names(bare.into(), new.into())
        } else {
            names(format!(":{bare}"), format!(":{new}"))
        };
        family.names.push(other);
    }
    Ok(family)
}

/// Returns whether a structure makes a name.
pub(super) fn is_made(texts: &[OpenText], name: &str) -> bool {
    let structures: Vec<StructureForm> =
        texts.iter().enumerate().flat_map(|(at, text)| structures(at, &text.tree)).collect();
    structures.iter().any(|structure| {
        let is_accessor = |slot: &String| structure.prefix.clone() + slot == name;
        structure.made.iter().any(|made| made == name)
            || all_slots(&structures, structure).is_ok_and(|slots| slots.iter().any(is_accessor))
    })
}

fn of_structure(structures: &[StructureForm], name: &str, new: &str) -> Result<Family, RenameRefusal> {
    let mut names = vec![RenamedName { old: name.into(), new: new.into() }];
    for structure in structures.iter().filter(|structure| structure.name == name) {
        for pattern in MADE {
            let old = pattern.replace('*', name);
            if structure.made.contains(&old) {
                names.push(RenamedName { old, new: pattern.replace('*', new) });
            }
        }
        if structure.has_own_prefix {
            continue;
        }
        for slot in all_slots(structures, structure)? {
            names.push(RenamedName { old: format!("{name}-{slot}"), new: format!("{new}-{slot}") });
        }
    }
    Ok(Family { names, places: Vec::new() })
}

/// Returns the slots of a structure, those of its parents among them.
///
/// # Errors
/// A parent is not known.
fn all_slots(structures: &[StructureForm], structure: &StructureForm) -> Result<Vec<String>, RenameRefusal> {
    let mut slots = Vec::new();
    for one in with_parents(structures, structure)? {
        slots.extend(one.slots.iter().map(|(slot, _)| slot.clone()));
    }
    Ok(slots)
}

fn with_parents<'a>(
    structures: &'a [StructureForm],
    structure: &'a StructureForm,
) -> Result<Vec<&'a StructureForm>, RenameRefusal> {
    let mut found = vec![structure];
    let mut at = structure;
    while let Some(parent) = &at.parent {
        let unknown = || RenameRefusal::UnknownParent { name: at.name.clone(), parent: parent.clone() };
        at = structures.iter().find(|other| other.name == *parent).ok_or_else(unknown)?;
        if found.iter().any(|other| std::ptr::eq(*other, at)) {
            return Err(unknown());
        }
        found.push(at);
    }
    Ok(found)
}

/// Renames a slot, by an accessor: all its accessors, the slot, and the keywords of constructors.
fn of_slot(
    texts: &[OpenText],
    structures: &[StructureForm],
    structure: &StructureForm,
    slot: &str,
    new: &str,
) -> Result<Family, RenameRefusal> {
    let made = |pattern: String| RenameRefusal::Made {
        name: structure.prefix.clone() + slot,
        by: structure.name.clone(),
        pattern,
    };
    let renamed = new.strip_prefix(&*structure.prefix).filter(|renamed| !renamed.is_empty());
    let renamed = renamed.ok_or_else(|| made(structure.prefix.clone() + "NAME"))?;
    let mut family = Family::default();
    for other in structures {
        let line = with_parents(structures, other)?;
        let defines = |one: &&StructureForm| one.slots.iter().any(|(name, _)| name == slot);
        let owner = line.iter().copied().find(defines);
        let shared = owner.is_some_and(|owner| {
            let own_line = with_parents(structures, structure).unwrap_or_default();
            own_line.iter().any(|one| std::ptr::eq(*one, owner))
        });
        if !shared {
            continue;
        }
        if other.parameters.contains(slot) {
            return Err(RenameRefusal::SlotElsewhere { slot: slot.into(), form: ":constructor".into() });
        }
        let names = RenamedName { old: other.prefix.clone() + slot, new: other.prefix.clone() + renamed };
        if !family.names.contains(&names) {
            family.names.push(names);
        }
        let written = other.slots.iter().chain(&other.changed).filter(|(name, _)| name == slot);
        family.places.extend(written.map(|&(_, node)| (other.text, node, renamed.to_owned())));
        for (at, text) in texts.iter().enumerate() {
            let keys = keywords(&text.tree, other, slot);
            family.places.extend(keys.into_iter().map(|node| (at, node, renamed.to_owned())));
        }
    }
    for text in texts {
        let tree = &text.tree;
        let is_slot = |&node: &NodeId| tree.name(node).map(bare_name).as_deref() == Some(slot);
        let form = tree.nodes().filter(is_slot).find_map(|node| form_with_slot(tree, node));
        if let Some(form) = form {
            return Err(RenameRefusal::SlotElsewhere { slot: slot.into(), form });
        }
    }
    Ok(family)
}

/// Returns the keywords by which constructors of a structure are given a slot.
fn keywords(tree: &SyntaxTree, structure: &StructureForm, slot: &str) -> Vec<NodeId> {
    let is_key =
        |&node: &NodeId| tree.name(node).is_some_and(|name| name.to_lowercase() == format!(":{slot}"));
    let is_maker = |name: &str| structure.constructors.contains(&bare_name(name));
    let takes_it = |&node: &NodeId| {
        let Some(list) = tree.parent(node).filter(|&list| tree.kind(list) == SyntaxKind::List) else {
            return false;
        };
        // `(make-it :slot …)`, `(apply #'make-it :slot …)`, `#S(it :slot …)`
        let is_literal =
            tree.parent(list).is_some_and(|mark| tree.kind(mark) == SyntaxKind::Mark(Token::Structure));
        tree.data(list).take(3).any(|part| {
            let inner = if matches!(tree.kind(part), SyntaxKind::Mark(_)) {
                tree.data(part).next()
            } else {
                Some(part)
            };
            let name = inner.and_then(|inner| tree.name(inner));
            name.is_some_and(|name| is_maker(name) || is_literal && bare_name(name) == structure.name)
        })
    };
    tree.nodes().filter(is_key).filter(takes_it).collect()
}

/// Returns the operator of a form in which a name stands for a slot, other than its definition.
fn form_with_slot(tree: &SyntaxTree, node: NodeId) -> Option<String> {
    let list = tree.list_around(node)?;
    let operator = tree.operator(list);
    if matches!(operator.as_deref(), Some("slot-value" | "slot-boundp" | "slot-makunbound" | "slot-exists-p"))
    {
        let is_quoted =
            tree.parent(node).is_some_and(|mark| tree.kind(mark) == SyntaxKind::Mark(Token::Quote));
        return operator.filter(|_| is_quoted);
    }
    // `(with-slots (slot (variable slot)) …)`
    let outer = tree.list_around(list)?;
    let form =
        if tree.operator(outer).as_deref() == Some("with-slots") { outer } else { tree.list_around(outer)? };
    let is_inside = tree.operator(form).as_deref() == Some("with-slots")
        && tree.data(form).nth(1).is_some_and(|slots| tree.range(slots).contains(&tree.range(node).start));
    is_inside.then(|| "with-slots".into())
}

/// Whether a name stands for a slot: where it is defined, or in a form that takes it.
pub(super) fn is_slot(tree: &SyntaxTree, node: NodeId) -> bool {
    let defines = || {
        let mut slot = node;
        let mut list = tree.parent(node)?;
        // A slot with options.
        let is_head = tree.data(list).next() == Some(node) && tree.kind(list) == SyntaxKind::List;
        if is_head {
            (slot, list) = (list, tree.parent(list)?);
        }
        let is_in_structure = |form: NodeId, slot: NodeId| {
            tree.operator(form).as_deref() == Some("defstruct")
                && !tree.data(form).take(2).any(|part| part == slot)
        };
        if is_in_structure(list, slot) {
            return Some(());
        }
        let form = tree.parent(list)?;
        let has_slots = matches!(tree.operator(form).as_deref(), Some("defclass" | "define-condition"));
        (has_slots && tree.data(form).nth(3) == Some(list)).then_some(())
    };
    defines().is_some() || form_with_slot(tree, node).is_some()
}

/// Returns the structures that a text defines.
fn structures(text: usize, tree: &SyntaxTree) -> Vec<StructureForm> {
    let forms = tree.nodes().filter(|&node| tree.kind(node) == SyntaxKind::List);
    let forms = forms.filter(|&node| tree.operator(node).as_deref() == Some("defstruct"));
    forms.filter_map(|form| structure(text, tree, form)).collect()
}

fn structure(text: usize, tree: &SyntaxTree, form: NodeId) -> Option<StructureForm> {
    let head = tree.data(form).nth(1)?;
    let (name, options) = match tree.kind(head) {
        SyntaxKind::List => (tree.data(head).next()?, tree.data(head).skip(1).collect()),
        _ => (head, Vec::new()),
    };
    let name = bare_name(tree.name(name)?);
    let mut found = StructureForm {
        text,
        form,
        parent: None,
        prefix: format!("{name}-"),
        has_own_prefix: false,
        made: MADE.iter().map(|pattern| pattern.replace('*', &name)).collect(),
        constructors: Vec::new(),
        slots: Vec::new(),
        changed: Vec::new(),
        parameters: HashSet::new(),
        name,
    };
    let mut constructors: Option<Vec<String>> = None;
    for option in options {
        let parts: Vec<NodeId> = match tree.kind(option) {
            SyntaxKind::List => tree.data(option).collect(),
            _ => vec![option],
        };
        let key = tree.text(*parts.first()?).to_lowercase();
        let argument = parts.get(1).map(|&argument| tree.text(argument));
        let given = argument.map(bare_name);
        match &*key {
            ":conc-name" => {
                let prefix = given.filter(|prefix| prefix != "nil").unwrap_or_default();
                found.prefix = prefix.trim_matches('"').to_owned();
                found.has_own_prefix = true;
            }
            ":constructor" => {
                let all = constructors.get_or_insert_default();
                let default = MADE[0].replace('*', &found.name);
                all.extend(given.or(Some(default.clone())).filter(|name| name != "nil"));
                // One that is written out is a name of its own.
                if argument.is_some() {
                    found.made.retain(|made| *made != default);
                }
                let parameters = parts.get(2).into_iter().flat_map(|&list| tree.nodes_in(list));
                found.parameters.extend(parameters.filter_map(|node| tree.name(node)).map(bare_name));
            }
            ":copier" | ":predicate" if given.is_some() => {
                let pattern = if key == ":copier" { MADE[1] } else { MADE[2] };
                let default = pattern.replace('*', &found.name);
                found.made.retain(|made| *made != default);
            }
            ":include" => {
                found.parent = given;
                let changed = parts.iter().skip(2).filter_map(|&slot| slot_name(tree, slot));
                found.changed = changed.collect();
            }
            _ => {}
        }
    }
    found.constructors = constructors.unwrap_or_else(|| vec![MADE[0].replace('*', &found.name)]);
    found.slots = tree.data(found.form).skip(2).filter_map(|slot| slot_name(tree, slot)).collect();
    Some(found)
}

fn slot_name(tree: &SyntaxTree, slot: NodeId) -> Option<(String, NodeId)> {
    let name = if tree.kind(slot) == SyntaxKind::List { tree.data(slot).next()? } else { slot };
    Some((bare_name(tree.name(name)?), name))
}
