//! The trees of some files: nodes with their ports and conditions, checked.
//!
//! Guarantees: nodes are a flat list in which children come after their parents; kinds, numbers of children
//! and ports are those of the catalogue or of `<TreeNodesModel>`; no subtree contains itself.

mod build;
mod declared;
mod subtrees;

use std::collections::HashMap;
use std::sync::Arc;

use crate::catalogue::{self, BehaviourKind, PortRow};
use crate::fault::{FilePlace, TreeFault};
use crate::script::Script;
use crate::xml::{self, XmlElement};

/// A text of a tree, and the name of its file.
#[derive(Clone, Debug)]
pub struct TreeSource {
    /// Name of the file, for faults.
    pub name: Arc<str>,
    /// Contents.
    pub text: Arc<str>,
}

/// An `<include>` of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Include {
    /// Path as it is written, relative to the folder of the file.
    pub path: String,
    /// Package of ROS whose folder the path is relative to.
    pub ros_package: Option<String>,
    /// Place of the element.
    pub place: FilePlace,
}

/// Value of a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PortValue {
    /// An entry of the blackboard.
    Entry(String),
    Text(String),
}

/// A port of a node.
#[derive(Clone, Debug)]
pub(crate) struct Port {
    pub(crate) name: String,
    pub(crate) value: PortValue,
    pub(crate) place: FilePlace,
}

/// The moment of a pre- or post-condition, in the order in which they are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Moment {
    FailureIf,
    SuccessIf,
    SkipIf,
    While,
    OnHalted,
    OnFailure,
    OnSuccess,
    Post,
}

impl Moment {
    pub(crate) const ALL: [(&'static str, Moment); 8] = [
        ("_failureIf", Moment::FailureIf),
        ("_successIf", Moment::SuccessIf),
        ("_skipIf", Moment::SkipIf),
        ("_while", Moment::While),
        ("_onHalted", Moment::OnHalted),
        ("_onFailure", Moment::OnFailure),
        ("_onSuccess", Moment::OnSuccess),
        ("_post", Moment::Post),
    ];
}

/// A node of a tree.
#[derive(Clone, Debug)]
pub(crate) struct TreeNode {
    pub(crate) kind: BehaviourKind,
    /// Name of its type, or of the subtree.
    pub(crate) id: String,
    /// Name of this node.
    pub(crate) name: Option<String>,
    pub(crate) ports: Vec<Port>,
    pub(crate) conditions: Vec<(Moment, Script)>,
    /// Script of `Script`, `ScriptCondition` and `Precondition`.
    pub(crate) script: Script,
    /// Whether the ports of a subtree are remapped to entries of the same name.
    pub(crate) remaps_all: bool,
    pub(crate) children: Vec<usize>,
    pub(crate) parent: Option<usize>,
    pub(crate) tree: usize,
    pub(crate) place: FilePlace,
}

impl TreeNode {
    /// Returns the value of a port, or its default.
    pub(crate) fn port(&self, name: &str) -> Option<PortValue> {
        let port = self.ports.iter().find(|port| port.name == name);
        port.map(|port| port.value.clone()).or_else(|| {
            let row = catalogue::row(&self.id)?;
            let port = catalogue::ports(row.ports).find(|port| port.name == name)?;
            port.default.map(PortValue::Text)
        })
    }

    /// Returns the text of a port that names no entry.
    pub(crate) fn text(&self, name: &str) -> Option<String> {
        match self.port(name) {
            Some(PortValue::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// Returns a whole number that a port has.
    pub(crate) fn whole(&self, name: &str) -> Option<i64> {
        self.text(name)?.trim().parse().ok()
    }

    /// Returns the name of this node, or of its type.
    pub(crate) fn title(&self) -> &str {
        self.name.as_deref().unwrap_or(&self.id)
    }

    /// Returns the script of a condition.
    pub(crate) fn condition(&self, moment: Moment) -> Option<&Script> {
        self.conditions.iter().find(|(known, _)| *known == moment).map(|(_, script)| script)
    }
}

/// A tree of a file.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    pub(crate) id: String,
    pub(crate) root: usize,
    pub(crate) file: usize,
    pub(crate) place: FilePlace,
}

/// A node that a file declares.
#[derive(Clone, Debug)]
pub(crate) struct Declared {
    pub(crate) kind: BehaviourKind,
    pub(crate) ports: Vec<PortRow>,
}

/// The trees of some files.
#[derive(Debug, Default)]
pub(crate) struct Model {
    pub(crate) files: Vec<Arc<str>>,
    pub(crate) nodes: Vec<TreeNode>,
    pub(crate) trees: Vec<Tree>,
    numbers: HashMap<String, usize>,
    /// Index of the tree that is executed.
    pub(crate) main: usize,
    pub(crate) declared: HashMap<String, Declared>,
    /// Models of subtrees.
    pub(crate) subtrees: HashMap<String, Vec<PortRow>>,
}

impl Model {
    /// Reads files, the main one first.
    ///
    /// # Errors
    /// All faults.
    pub(crate) fn read(sources: &[TreeSource], main: Option<&str>) -> Result<Model, Vec<TreeFault>> {
        let mut documents = Vec::new();
        let mut faults = Vec::new();
        for source in sources {
            match xml::read(&source.name, &source.text) {
                Ok(elements) => documents.push(elements),
                Err(fault) => faults.push(fault),
            }
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let mut builder = build::Builder::new(sources.iter().map(|source| source.name.clone()).collect());
        for (file, elements) in documents.iter().enumerate() {
            builder.declare(file, elements);
        }
        for (file, elements) in documents.iter().enumerate() {
            builder.add_trees(file, elements);
        }
        builder.finish(main, documents.first().map_or(&[], |elements| &**elements))
    }

    /// Returns the index of the tree of this name.
    pub(crate) fn tree(&self, id: &str) -> Option<usize> {
        self.numbers.get(id).copied()
    }
}

/// Returns the files that a text includes.
///
/// # Errors
/// The first place that is not well-formed, or an `<include>` without a path.
pub fn includes(source: &TreeSource) -> Result<Vec<Include>, TreeFault> {
    let elements = xml::read(&source.name, &source.text)?;
    let Some(root) = elements.first() else { return Ok(Vec::new()) };
    let included =
        root.children.iter().map(|&child| &elements[child]).filter(|element| element.name == "include");
    let include = |element: &XmlElement| {
        let fault = || TreeFault {
            file: source.name.clone(),
            place: element.place,
            message: "`<include>` names no file: expected the attribute `path`".into(),
        };
        Ok(Include {
            path: element.value("path").filter(|path| !path.is_empty()).ok_or_else(fault)?.to_owned(),
            ros_package: element.value("ros_pkg").map(str::to_owned),
            place: element.place,
        })
    };
    included.map(include).collect()
}

#[cfg(test)]
mod tests;
