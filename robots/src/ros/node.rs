//! Nodes: what a program is in the graph of ROS, and what it has there.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::Bytes;
use esl_host::{HostFailure, HostInput, HostObject, IntoDatum, Keyword};
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::sample::{Sample, SampleKind};

use super::attachment::MessageAttachment;
use super::graph::{GraphEvent, NodeGraph, full_name};
use super::wire::{EndpointEntity, EndpointKind, GraphEntity, NodeEntity, QosProfile, signs_of};
use crate::zenoh::delivery::InputDelivery;
use crate::zenoh::runtime::in_background;
use crate::zenoh::session::OpenSession;

/// Numbers of the entities of this process: they differ from each other in every session.
static NUMBERS: AtomicUsize = AtomicUsize::new(0);

fn next_number() -> usize {
    NUMBERS.fetch_add(1, Ordering::Relaxed)
}

/// A node of the program's.
pub(super) struct RosNode {
    session: Arc<OpenSession>,
    entity: NodeEntity,
    /// Whether the others are reached by `zenoh-bridge-ros2dds`: then keys are names, and there is no graph.
    is_bridged: bool,
    graph: Arc<NodeGraph>,
    /// Endpoints of this node, which those of others are held against.
    endpoints: Arc<Mutex<Vec<EndpointEntity>>>,
    /// Signals the program's input with what it is to know.
    events: Arc<InputDelivery>,
    /// Declared in the session: the sign of life, and the watch of the others.
    declared: Mutex<Option<Box<dyn Send>>>,
}

impl HostObject for RosNode {
    const KIND: &'static str = "ROS-NODE";
}

/// A name and a type that an endpoint has.
#[derive(Clone, Debug)]
pub(super) struct Topic {
    pub(super) name: String,
    /// Name of the type on the wire, `std_msgs::msg::dds_::String_`.
    pub(super) dds_name: String,
    /// Hash of the type, `RIHS01_…`.
    pub(super) hash: String,
}

/// An endpoint of a node: its key, the name by which its messages tell it, and its sign of life.
pub(super) struct Endpoint {
    pub(super) key: String,
    gid: [u8; 16],
    pub(super) name: String,
    number: usize,
    endpoints: Arc<Mutex<Vec<EndpointEntity>>>,
    /// Its sign of life, if it has one.
    sign: Option<String>,
    token: Option<LivelinessToken>,
}

impl Endpoint {
    /// Returns whether its peers are behind a bridge.
    pub(super) fn is_bridged(&self) -> bool {
        self.sign.is_none()
    }

    /// Returns the attachment of a message with this number. A bridge takes that of a request for one of its
    /// own, so it gets none.
    pub(super) fn attachment(&self, number: i64) -> Option<Bytes> {
        (!self.is_bridged()).then(|| MessageAttachment::now(number, self.gid).encode())
    }

    /// Declares the sign of life. To be called when the endpoint can be reached, so that those who see it
    /// reach it.
    pub(super) async fn announce(&mut self, session: &OpenSession) -> Result<(), HostFailure> {
        let Some(sign) = self.sign.clone() else { return Ok(()) };
        let declare = move |session: &zenoh::Session| session.liveliness().declare_token(sign).wait();
        self.token = Some(session.call(declare).await?);
        Ok(())
    }
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        lock(&self.endpoints).retain(|known| known.id != self.number);
        let token = self.token.take();
        // The network is told, which may take its time.
        in_background(async move { drop(token) });
    }
}

impl Drop for RosNode {
    fn drop(&mut self) {
        self.end();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // The guarded value is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RosNode {
    /// Declares a node. `events` is signalled with a kind, a text and a name.
    pub(super) async fn declare(
        session: Arc<OpenSession>,
        events: HostInput,
        domain: usize,
        namespace: String,
        name: String,
        is_bridged: bool,
    ) -> Result<RosNode, HostFailure> {
        let session_name = session.zenoh().zid().to_string();
        let entity = NodeEntity { domain, session: session_name, id: next_number(), name, namespace };
        let events = InputDelivery::begin(events)?;
        let (graph, endpoints) = (Arc::<NodeGraph>::default(), Arc::<Mutex<Vec<EndpointEntity>>>::default());
        let watch = {
            let (graph, endpoints, events, own) =
                (graph.clone(), endpoints.clone(), events.clone(), entity.clone());
            move |sample: Sample| note_sign(&sample, &graph, &endpoints, &events, &own)
        };
        let own = entity.clone();
        let declare = move |session: &zenoh::Session| {
            if is_bridged {
                return Ok(None);
            }
            let liveliness = session.liveliness();
            let watch =
                liveliness.declare_subscriber(signs_of(own.domain)).history(true).callback(watch).wait()?;
            let token = liveliness.declare_token(own.to_string()).wait()?;
            Ok(Some((watch, token)))
        };
        let declared: Box<dyn Send> = Box::new(session.call(declare).await?);
        Ok(RosNode {
            session,
            entity,
            is_bridged,
            graph,
            endpoints,
            events,
            declared: Mutex::new(Some(declared)),
        })
    }

    /// Ends it.
    pub(super) fn end(&self) {
        self.events.end();
        let declared = lock(&self.declared).take();
        in_background(async move { drop(declared) });
    }

    pub(super) fn session(&self) -> &Arc<OpenSession> {
        &self.session
    }

    pub(super) fn graph(&self) -> &NodeGraph {
        &self.graph
    }

    pub(super) fn events(&self) -> &Arc<InputDelivery> {
        &self.events
    }

    /// Returns an endpoint that is not announced yet.
    pub(super) fn endpoint(&self, kind: EndpointKind, topic: Topic, qos: QosProfile) -> Endpoint {
        let number = next_number();
        let entity = EndpointEntity {
            id: number,
            node: self.entity.clone(),
            kind,
            topic: topic.name.clone(),
            type_name: topic.dds_name,
            type_hash: topic.hash,
            qos,
        };
        let mut gid = [0; 16];
        let (of_session, of_endpoint) = gid.split_at_mut(8);
        of_session.copy_from_slice(&self.session.zenoh().zid().to_le_bytes()[..8]);
        of_endpoint.copy_from_slice(&(number as u64).to_le_bytes());
        lock(&self.endpoints).push(entity.clone());
        for other in self.graph.endpoints_of_others(&self.entity) {
            if let Some(event) = NodeGraph::misfits(&entity, &other) {
                tell(&self.events, event);
            }
        }
        let key = if self.is_bridged { topic.name.trim_matches('/').to_owned() } else { entity.key() };
        let sign = (!self.is_bridged).then(|| entity.to_string());
        let endpoints = self.endpoints.clone();
        Endpoint { key, gid, name: topic.name, number, endpoints, sign, token: None }
    }
}

/// Signals an event.
pub(super) fn tell(events: &InputDelivery, event: GraphEvent) {
    let GraphEvent { kind, text, name } = event;
    events.put(text.len(), || vec![Keyword(kind).into_datum(), text.into_datum(), name.into_datum()]);
}

/// Notes a sign of life that comes or goes.
fn note_sign(
    sample: &Sample,
    graph: &NodeGraph,
    endpoints: &Mutex<Vec<EndpointEntity>>,
    events: &InputDelivery,
    own: &NodeEntity,
) {
    let key = sample.key_expr();
    let changed = match sample.kind() {
        SampleKind::Put => graph.add(key.as_str()),
        SampleKind::Delete => graph.remove(key.as_str()),
    };
    let Some(entity) = changed else { return };
    let node = match &entity {
        GraphEntity::Node(node) => node,
        GraphEntity::Endpoint(endpoint) => &endpoint.node,
    };
    let is_own = node.session == own.session && node.id == own.id;
    if sample.kind() == SampleKind::Put && !is_own {
        match &entity {
            GraphEntity::Node(node) if node.name == own.name && node.namespace == own.namespace => {
                let name = full_name(node);
                let text = format!("another node has the name {name} too");
                tell(events, GraphEvent { kind: "DUPLICATE-NODE", text, name });
            }
            GraphEntity::Node(_) => {}
            GraphEntity::Endpoint(theirs) => {
                let misfits: Vec<GraphEvent> =
                    lock(endpoints).iter().filter_map(|ours| NodeGraph::misfits(ours, theirs)).collect();
                misfits.into_iter().for_each(|event| tell(events, event));
            }
        }
    }
    events.put(0, || vec![Keyword("GRAPH").into_datum()]);
}
