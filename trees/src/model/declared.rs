//! `<TreeNodesModel>`: the nodes and ports that a file declares.

use crate::catalogue::{BehaviourKind, Direction, PortRow};
use crate::model::Declared;
use crate::model::build::Builder;
use crate::xml::XmlElement;

/// Returns the kind that the tag of a model, or of a node in full form, stands for.
pub(super) fn kind_of_tag(tag: &str) -> Option<BehaviourKind> {
    Some(match tag {
        "Action" => BehaviourKind::Action,
        "Condition" => BehaviourKind::Condition,
        "Control" => BehaviourKind::CustomControl,
        "Decorator" => BehaviourKind::CustomDecorator,
        "SubTree" | "SubTreePlus" => BehaviourKind::SubTree,
        _ => return None,
    })
}

/// Returns the ports that a model declares.
fn ports(elements: &[XmlElement], model: &XmlElement) -> Vec<PortRow> {
    let children = model.children.iter().map(|&child| &elements[child]);
    let ports = children.filter_map(|port| {
        let direction = match &*port.name {
            "input_port" => Direction::In,
            "output_port" => Direction::Out,
            "inout_port" | "bidirectional_port" => Direction::Both,
            _ => return None,
        };
        let default = port.value("default").map(str::to_owned);
        Some(PortRow {
            name: port.value("name")?.to_owned(),
            direction,
            is_needed: default.is_none(),
            default,
        })
    });
    ports.collect()
}

impl Builder {
    /// Takes in the models of a file.
    pub(crate) fn declare(&mut self, file: usize, elements: &[XmlElement]) {
        let Some(root) = elements.first() else { return };
        let models = root.children.iter().map(|&child| &elements[child]);
        for models in models.filter(|element| element.name == "TreeNodesModel") {
            for model in models.children.iter().map(|&child| &elements[child]) {
                let Some(kind) = kind_of_tag(&model.name) else {
                    let text = format!(
                        "`<{}>` is not part of `<TreeNodesModel>`: expected `<Action>`, `<Condition>`, `<Control>`, \
                         `<Decorator>` or `<SubTree>`",
                        model.name
                    );
                    self.fault(file, model.place, text);
                    continue;
                };
                let Some(id) = model.value("ID") else {
                    let text =
                        format!("the model `<{}>` has no name: expected the attribute `ID`", model.name);
                    self.fault(file, model.place, text);
                    continue;
                };
                let ports = ports(elements, model);
                if kind == BehaviourKind::SubTree {
                    self.model.subtrees.insert(id.to_owned(), ports);
                } else {
                    self.model.declared.insert(id.to_owned(), Declared { kind, ports });
                }
            }
        }
    }
}
