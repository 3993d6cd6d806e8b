//! The graph: the nodes of a domain and their endpoints, as their signs of life tell.
//!
//! An endpoint of another node that does not fit one of this node's is told to the program: another type
//! or another version of it under the same name, a quality of service that does not match, another node of
//! the same name.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_host::{IntoDatum, Keyword};

use super::qos::misfit;
use super::wire::{EndpointEntity, EndpointKind, GraphEntity, NodeEntity};

/// Most entities that are remembered: a peer cannot take more memory by making up some.
const MOST_ENTITIES: usize = 20_000;

/// The nodes and endpoints that are there, by their signs of life.
#[derive(Default)]
pub(super) struct NodeGraph(Mutex<HashMap<String, GraphEntity>>);

/// Something in the graph that is worth telling: its kind, a text, and the name of the topic or the node.
pub(super) struct GraphEvent {
    pub(super) kind: &'static str,
    pub(super) text: String,
    pub(super) name: String,
}

/// Returns the name of a node with its namespace.
pub(super) fn full_name(node: &NodeEntity) -> String {
    let namespace = node.namespace.trim_end_matches('/');
    format!("{namespace}/{}", node.name)
}

/// Returns the name of a type for users, from that on the wire: `std_msgs/msg/String`.
fn type_name(endpoint: &EndpointEntity) -> String {
    endpoint.type_name.trim_end_matches('_').replace("::dds_::", "/").replace("::", "/")
}

impl NodeGraph {
    fn lock(&self) -> MutexGuard<'_, HashMap<String, GraphEntity>> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a sign of life that comes. Returns the entity, if that is new and well-formed.
    pub(super) fn add(&self, sign: &str) -> Option<GraphEntity> {
        let entity = GraphEntity::of_sign(sign)?;
        let mut entities = self.lock();
        if entities.len() >= MOST_ENTITIES || entities.contains_key(sign) {
            return None;
        }
        entities.insert(sign.to_owned(), entity.clone());
        Some(entity)
    }

    /// Notes that a sign of life has gone. Returns the entity, if it was known.
    pub(super) fn remove(&self, sign: &str) -> Option<GraphEntity> {
        self.lock().remove(sign)
    }

    /// Returns the number of endpoints of a kind under a name.
    pub(super) fn count(&self, kind: EndpointKind, name: &str) -> usize {
        let entities = self.lock();
        let endpoints = entities.values().filter_map(|entity| match entity {
            GraphEntity::Endpoint(endpoint) => Some(endpoint),
            GraphEntity::Node(_) => None,
        });
        endpoints.filter(|endpoint| endpoint.kind == kind && endpoint.topic == name).count()
    }

    /// Returns the endpoints of other nodes than `own`.
    pub(super) fn endpoints_of_others(&self, own: &NodeEntity) -> Vec<EndpointEntity> {
        let is_other = |endpoint: &&EndpointEntity| endpoint.node != *own;
        let entities = self.lock();
        let endpoints = entities.values().filter_map(|entity| match entity {
            GraphEntity::Endpoint(endpoint) => Some(endpoint),
            GraphEntity::Node(_) => None,
        });
        endpoints.filter(is_other).cloned().collect()
    }

    /// Returns the names of the nodes, sorted, each once.
    pub(super) fn nodes(&self) -> Vec<String> {
        let entities = self.lock();
        let mut names: Vec<String> = entities
            .values()
            .filter_map(|entity| match entity {
                GraphEntity::Node(node) => Some(full_name(node)),
                GraphEntity::Endpoint(_) => None,
            })
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Returns the endpoints: lists of kind, name, type and node, sorted.
    pub(super) fn endpoints(&self) -> Datum {
        let entities = self.lock();
        let mut rows: Vec<(String, String, String, &'static str)> = entities
            .values()
            .filter_map(|entity| match entity {
                GraphEntity::Endpoint(endpoint) => Some((
                    endpoint.topic.clone(),
                    type_name(endpoint),
                    full_name(&endpoint.node),
                    kind_name(endpoint.kind),
                )),
                GraphEntity::Node(_) => None,
            })
            .collect();
        rows.sort_unstable();
        let row = |(topic, of_type, node, kind): (String, String, String, &'static str)| {
            vec![Keyword(kind).into_datum(), topic.into_datum(), of_type.into_datum(), node.into_datum()]
                .into_datum()
        };
        rows.into_iter().map(row).collect::<Vec<Datum>>().into_datum()
    }

    /// Returns what `theirs`, an endpoint of another node, does not fit in `ours`.
    pub(super) fn misfits(ours: &EndpointEntity, theirs: &EndpointEntity) -> Option<GraphEvent> {
        let is_pair = matches!(
            (ours.kind, theirs.kind),
            (EndpointKind::Publisher, EndpointKind::Subscription)
                | (EndpointKind::Subscription, EndpointKind::Publisher)
                | (EndpointKind::Service, EndpointKind::Client)
                | (EndpointKind::Client, EndpointKind::Service)
        );
        if !is_pair || ours.topic != theirs.topic {
            return None;
        }
        let name = ours.topic.clone();
        let there = full_name(&theirs.node);
        let event = |kind, text| Some(GraphEvent { kind, text, name });
        let (our_type, their_type) = (type_name(ours), type_name(theirs));
        let (our_hash, their_hash) = (&ours.type_hash, &theirs.type_hash);
        if our_type != their_type {
            let text = format!("{there} has the type {their_type} where this node has {our_type}");
            event("TYPE-MISMATCH", text)
        } else if our_hash != their_hash {
            let text = format!(
                "{there} has another version of {our_type}: {their_hash} where this node has {our_hash}; \
                 their messages do not reach each other"
            );
            event("TYPE-MISMATCH", text)
        } else {
            let (offered, requested) = match ours.kind {
                EndpointKind::Publisher | EndpointKind::Service => (&ours.qos, &theirs.qos),
                EndpointKind::Subscription | EndpointKind::Client => (&theirs.qos, &ours.qos),
            };
            let reason = misfit(offered, requested)?;
            event("INCOMPATIBLE-QOS", format!("quality of service does not match that of {there}: {reason}"))
        }
    }
}

fn kind_name(kind: EndpointKind) -> &'static str {
    match kind {
        EndpointKind::Publisher => "PUBLISHER",
        EndpointKind::Subscription => "SUBSCRIPTION",
        EndpointKind::Service => "SERVER",
        EndpointKind::Client => "CLIENT",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
    const OTHER: &str = "RIHS01_0000000000000000000000000000000000000000000000000000000000000001";

    fn token(kind: &str, of_type: &str, hash: &str, qos: &str) -> String {
        format!("@ros2_lv/0/a1/3/4/{kind}/%/%/talker/%chatter/{of_type}/{hash}/{qos}")
    }

    fn endpoint(text: &str) -> EndpointEntity {
        match NodeGraph::default().add(text) {
            Some(GraphEntity::Endpoint(endpoint)) => endpoint,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn signs_of_life_come_and_go() {
        let graph = NodeGraph::default();
        let texts = [
            "@ros2_lv/0/a1/3/3/NN/%/%/talker".to_owned(),
            token("MP", "std_msgs::msg::dds_::String_", HASH, "::,10:,:,:,,"),
        ];
        for text in &texts {
            assert!(graph.add(text).is_some() && graph.add(text).is_none(), "{text}");
        }
        assert_eq!(graph.nodes(), ["/talker"]);
        assert_eq!(graph.count(EndpointKind::Publisher, "/chatter"), 1);
        assert_eq!(
            graph.endpoints().to_string(),
            "((:PUBLISHER \"/chatter\" \"std_msgs/msg/String\" \"/talker\"))"
        );
        assert!(graph.remove(&texts[1]).is_some());
        assert_eq!(graph.count(EndpointKind::Publisher, "/chatter"), 0);
        for malformed in
            ["@ros2_lv/0", "@ros2_lv/x/a1/3/3/NN/%/%/talker", "@ros2_lv/0/a1/3/3/XX/%/%/talker/a", "a"]
        {
            assert!(graph.add(malformed).is_none(), "{malformed}");
        }
    }

    #[test]
    fn endpoints_that_do_not_fit_are_told() {
        let text = "std_msgs::msg::dds_::String_";
        let ours = endpoint(&token("MS", text, HASH, "::,10:,:,:,,"));
        let event =
            |theirs: &str| NodeGraph::misfits(&ours, &endpoint(theirs)).map(|event| (event.kind, event.text));
        assert_eq!(event(&token("MP", text, HASH, "::,10:,:,:,,")), None);
        assert_eq!(event(&token("MS", text, OTHER, "::,10:,:,:,,")), None);
        let (kind, said) = event(&token("MP", text, OTHER, "::,10:,:,:,,")).expect("the hashes differ");
        assert!(kind == "TYPE-MISMATCH" && said.contains(HASH) && said.contains(OTHER), "{said}");
        let (kind, said) = event(&token("MP", "std_msgs::msg::dds_::Bool_", HASH, "::,10:,:,:,,"))
            .expect("the types differ");
        assert!(kind == "TYPE-MISMATCH" && said.contains("std_msgs/msg/Bool"), "{said}");
        let (kind, said) = event(&token("MP", text, HASH, "2::,10:,:,:,,")).expect("it is best-effort");
        assert!(kind == "INCOMPATIBLE-QOS" && said.contains("/talker"), "{said}");
    }
}
