//! Topics: publishers and subscriptions of a node.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostInput, HostObject, IntoDatum};
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig, HistoryConfig,
};

use super::attachment::MessageAttachment;
use super::graph::GraphEvent;
use super::node::{Endpoint, RosNode, Topic, tell};
use super::wire::{EndpointKind, QosProfile};
use crate::message::{MessageType, decode, encode};
use crate::run::note_topic;
use crate::zenoh::delivery::InputDelivery;
use crate::zenoh::entity::DeclaredEntity;
use crate::zenoh::runtime::in_background;
use crate::zenoh::session::Requests;
use crate::zenoh::zenoh_failure;

/// Most messages that a publisher keeps for late subscriptions.
const MOST_KEPT: usize = 1000;

/// A publisher on the network, with the cache that its durability asks for.
enum Publisher {
    Volatile(zenoh::pubsub::Publisher<'static>),
    TransientLocal(AdvancedPublisher<'static>),
}

struct DeclaredPublisher {
    publisher: Publisher,
    endpoint: Endpoint,
}

/// A publisher of the program's.
pub(super) struct TopicPublisher {
    declared: Mutex<Option<Arc<DeclaredPublisher>>>,
    name: String,
    of_type: Arc<MessageType>,
    sent: AtomicI64,
    requests: Requests,
}

impl HostObject for TopicPublisher {
    const KIND: &'static str = "ROS-PUBLISHER";
}

/// Returns how many messages are kept by a history.
fn depth(qos: &QosProfile) -> usize {
    qos.depth.map_or(MOST_KEPT, |depth| depth.clamp(1, MOST_KEPT))
}

/// Returns the topic of a type under a name.
pub(super) fn topic(name: String, of_type: &MessageType) -> Topic {
    Topic { name, dds_name: of_type.dds_name(), hash: of_type.hash().to_owned() }
}

/// Declares a publisher.
pub(super) async fn advertise(
    node: &RosNode,
    name: String,
    of_type: Arc<MessageType>,
    qos: QosProfile,
) -> Result<TopicPublisher, HostFailure> {
    let mut endpoint = node.endpoint(EndpointKind::Publisher, topic(name.clone(), &of_type), qos);
    let key = endpoint.key.clone();
    let declare = move |session: &zenoh::Session| {
        let is_reliable = qos.is_reliable;
        // As rmw_zenoh does: only a publisher that keeps all waits for room.
        let waits = is_reliable && qos.depth.is_none();
        let congestion = if waits { CongestionControl::Block } else { CongestionControl::Drop };
        let reliability =
            if is_reliable { zenoh::qos::Reliability::Reliable } else { zenoh::qos::Reliability::BestEffort };
        let builder = session.declare_publisher(key).congestion_control(congestion).reliability(reliability);
        if qos.is_transient_local {
            let cache = CacheConfig::default().max_samples(depth(&qos));
            builder.cache(cache).publisher_detection().wait().map(Publisher::TransientLocal)
        } else {
            builder.wait().map(Publisher::Volatile)
        }
    };
    let publisher = node.session().call(declare).await?;
    endpoint.announce(node.session()).await?;
    Ok(TopicPublisher {
        declared: Mutex::new(Some(Arc::new(DeclaredPublisher { publisher, endpoint }))),
        name,
        of_type,
        sent: AtomicI64::new(0),
        requests: node.session().requests().clone(),
    })
}

impl TopicPublisher {
    fn lock(&self) -> std::sync::MutexGuard<'_, Option<Arc<DeclaredPublisher>>> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.declared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Publishes a message. Waits until the session has room for it.
    pub(super) async fn publish(&self, message: &Datum) -> Result<(), HostFailure> {
        let declared = self.lock().clone();
        let declared =
            declared.ok_or_else(|| HostFailure::new("PUBLISHER-CLOSED", "the publisher is closed"))?;
        let payload = encode(&self.of_type, message)?;
        note_topic(&self.name, &self.of_type, &payload);
        let number = self.sent.fetch_add(1, Ordering::Relaxed) + 1;
        let attachment = declared.endpoint.attachment(number);
        let send = move || {
            let encoding = "application/cdr";
            // A session that is closed meanwhile takes nothing.
            _ = match &declared.publisher {
                Publisher::Volatile(publisher) => {
                    publisher.put(payload).encoding(encoding).attachment(attachment).wait()
                }
                Publisher::TransientLocal(publisher) => {
                    publisher.put(payload).encoding(encoding).attachment(attachment).wait()
                }
            };
        };
        self.requests.put(send).await
    }

    /// Closes it.
    pub(super) fn close(&self) {
        let declared = self.lock().take();
        if let Some(declared) = declared {
            in_background(async move { drop(declared) });
        }
    }
}

impl Drop for TopicPublisher {
    fn drop(&mut self) {
        self.close();
    }
}

/// Messages of a subscription that cannot be read, counted, and told once for each sender.
pub(super) struct Malformed {
    events: Arc<InputDelivery>,
    name: String,
    senders: Mutex<Vec<Option<[u8; 16]>>>,
}

/// Most senders that are told of.
const MOST_SENDERS: usize = 100;

impl Malformed {
    pub(super) fn new(events: Arc<InputDelivery>, name: String) -> Malformed {
        Malformed { events, name, senders: Mutex::default() }
    }

    /// Notes one of a sender.
    pub(super) fn note(&self, sender: Option<[u8; 16]>, reason: &str) {
        let mut senders = self.senders.lock().unwrap_or_else(PoisonError::into_inner);
        if senders.len() < MOST_SENDERS && !senders.contains(&sender) {
            senders.push(sender);
            let text =
                format!("a message is malformed: {reason}; further ones of this sender are dropped silently");
            tell(&self.events, GraphEvent { kind: "MALFORMED-PAYLOAD", text, name: self.name.clone() });
        }
    }
}

/// Declares a subscription. The input is signalled with each message, and the seconds since 1970 at which it
/// was sent, or `NIL`.
pub(super) async fn subscribe(
    node: &RosNode,
    input: HostInput,
    name: String,
    of_type: Arc<MessageType>,
    qos: QosProfile,
) -> Result<DeclaredEntity, HostFailure> {
    let mut endpoint = node.endpoint(EndpointKind::Subscription, topic(name.clone(), &of_type), qos);
    let delivery = InputDelivery::begin(input)?;
    let delivering = delivery.clone();
    let malformed = Malformed::new(node.events().clone(), name.clone());
    let deliver = move |sample: Sample| {
        let payload = sample.payload().to_bytes();
        let attachment = sample.attachment();
        let attachment = attachment.and_then(|bytes| MessageAttachment::decode(&bytes.to_bytes()));
        match decode(&of_type, &payload) {
            Ok(message) => {
                note_topic(&name, &of_type, &payload);
                delivering.put(payload.len(), || {
                    let time = attachment.map(|attachment| attachment.time as f64 / 1e9);
                    vec![message, time.into_datum()]
                });
            }
            Err(fault) => malformed.note(attachment.map(|attachment| attachment.gid), &fault.to_string()),
        }
    };
    let key = endpoint.key.clone();
    if qos.is_transient_local {
        let history = HistoryConfig::default().detect_late_publishers().max_samples(depth(&qos));
        let declare = move |session: &zenoh::Session| {
            session.declare_subscriber(key).callback(deliver).history(history).wait()
        };
        let subscriber = node.session().call(declare).await?;
        endpoint.announce(node.session()).await?;
        Ok(DeclaredEntity::new((subscriber, endpoint), Some(delivery)))
    } else {
        let declare =
            move |session: &zenoh::Session| session.declare_subscriber(key).callback(deliver).wait();
        let subscriber = node.session().call(declare).await?;
        endpoint.announce(node.session()).await?;
        Ok(DeclaredEntity::new((subscriber, endpoint), Some(delivery)))
    }
}

/// Returns the failure for a payload that cannot be read.
pub(super) fn malformed_failure(reason: impl ToString) -> HostFailure {
    let HostFailure { arguments, .. } = zenoh_failure(reason);
    HostFailure { cause: "MALFORMED-PAYLOAD".into(), arguments }
}
