//! Services: calls of the program's, and calls that it answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, HostInput, HostObject, IntoDatum};
use zenoh::Wait;
use zenoh::query::Query;

use super::attachment::MessageAttachment;
use super::node::{Endpoint, RosNode, Topic};
use super::topic::{Malformed, malformed_failure};
use super::wire::{EndpointKind, QosProfile};
use crate::message::{MessageType, ServiceType, decode, encode};
use crate::zenoh::delivery::InputDelivery;
use crate::zenoh::entity::DeclaredEntity;
use crate::zenoh::query::{PendingQuery, QueryHandles, QueryRequest, error_text, get};
use crate::zenoh::session::OpenSession;

/// Most tries to reach a server that is seen.
const MOST_TRIES: usize = 20;
/// Pause between two of them.
const PAUSE: Duration = Duration::from_millis(100);

/// A client of a service.
pub(super) struct ServiceClient {
    session: Arc<OpenSession>,
    endpoint: Endpoint,
    of_type: Arc<ServiceType>,
    sent: AtomicI64,
}

impl HostObject for ServiceClient {
    const KIND: &'static str = "ROS-CLIENT";
}

fn topic(name: String, of_type: &ServiceType) -> Topic {
    Topic { name, dds_name: of_type.dds_name(), hash: of_type.hash().to_owned() }
}

/// Declares a client.
pub(super) async fn client(
    node: &RosNode,
    name: String,
    of_type: Arc<ServiceType>,
    qos: QosProfile,
) -> Result<ServiceClient, HostFailure> {
    let mut endpoint = node.endpoint(EndpointKind::Client, topic(name, &of_type), qos);
    endpoint.announce(node.session()).await?;
    Ok(ServiceClient { session: node.session().clone(), endpoint, of_type, sent: AtomicI64::new(0) })
}

/// Calls a service, and returns its response. QueryInFlight the future ends the call.
///
/// # Errors
/// `:no-server`, if there is none; `:server-lost`, if it goes without an answer; `:service-failed`, if it
/// answers by an error; `:malformed-payload`; `:invalid-message`.
pub(super) async fn call(
    node: &RosNode,
    client: &ServiceClient,
    request: &Datum,
) -> Result<Datum, HostFailure> {
    let name = client.endpoint.name.as_str();
    let payload = encode(&client.of_type.request, request)?;
    let number = client.sent.fetch_add(1, Ordering::Relaxed) + 1;
    let attachment = client.endpoint.attachment(number);
    let has_server = || node.graph().count(EndpointKind::Service, name) > 0;
    let had_server = has_server();
    let mut tries = 0;
    let replies = loop {
        let request = QueryRequest {
            selector: client.endpoint.key.clone(),
            payload: Some(payload.clone()),
            encoding: None,
            attachment: attachment.clone(),
            timeout: None,
            is_call: true,
            // The services of a bridge are not declared as complete.
            asks_complete: !client.endpoint.is_bridged(),
        };
        let replies = get(&client.session, request).await?;
        tries += 1;
        if !replies.is_empty() || !has_server() || tries == MOST_TRIES {
            break replies;
        }
        // A server that is seen but was not reached has not declared its service yet. One that has gone is
        // not seen any more.
        tokio::time::sleep(PAUSE).await;
        if !has_server() {
            break replies;
        }
    };
    let mut error = None;
    for reply in &replies {
        match reply.result() {
            Ok(sample) => {
                let response = decode(&client.of_type.response, &sample.payload().to_bytes());
                return response
                    .map_err(|fault| malformed_failure(format!("the response of {name}: {fault}")));
            }
            Err(found) => error = Some(error_text(found)),
        }
    }
    Err(match error {
        Some(text) => HostFailure {
            cause: "SERVICE-FAILED".into(),
            arguments: vec![name.into_datum(), text.into_datum()],
        },
        None if had_server && !has_server() => HostFailure::new("SERVER-LOST", name),
        None => HostFailure::new("NO-SERVER", name),
    })
}

/// A call that the program answers.
pub(super) struct UnansweredCall {
    query: HostHandle<PendingQuery>,
    /// Key of the service: that of the query may have wildcards.
    key: Arc<str>,
    response: Arc<MessageType>,
    attachment: Option<MessageAttachment>,
}

impl HostObject for UnansweredCall {
    const KIND: &'static str = "ROS-CALL";
}

impl UnansweredCall {
    /// Answers it.
    pub(super) async fn respond(&self, response: &Datum) -> Result<(), HostFailure> {
        let payload = encode(&self.response, response)?;
        // The number and the name are those of the request, so that the client knows its own.
        let attachment = self.attachment.map(|request| {
            let MessageAttachment { number, gid, .. } = request;
            MessageAttachment::now(number, gid).encode()
        });
        let result = self.query.reply(Some(self.key.to_string()), payload, None, attachment).await;
        self.query.finish();
        result
    }

    /// Answers it by an error.
    pub(super) async fn refuse(&self, text: String) -> Result<(), HostFailure> {
        let result = self.query.reply_error(text).await;
        self.query.finish();
        result
    }
}

/// Declares a server. The input is signalled with the handle and the request of each call.
pub(super) async fn serve(
    node: &RosNode,
    input: HostInput,
    name: String,
    of_type: Arc<ServiceType>,
    qos: QosProfile,
) -> Result<DeclaredEntity, HostFailure> {
    let mut endpoint = node.endpoint(EndpointKind::Service, topic(name.clone(), &of_type), qos);
    let delivery = InputDelivery::begin(input)?;
    let delivering = delivery.clone();
    let handles = QueryHandles::new(node.session().requests().clone());
    let malformed = Malformed::new(node.events().clone(), name);
    let made = AtomicI64::new(0);
    let key = Arc::<str>::from(endpoint.key.as_str());
    let deliver = move |query: Query| {
        let payload = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
        let attachment = query.attachment();
        let attachment = attachment.and_then(|bytes| MessageAttachment::decode(&bytes.to_bytes()));
        match decode(&of_type.request, &payload) {
            Ok(request) => delivering.put(payload.len(), || {
                let number = made.fetch_add(1, Ordering::Relaxed) + 1;
                let response = of_type.response.clone();
                let pending =
                    UnansweredCall { query: handles.add(query), key: key.clone(), response, attachment };
                vec![HostHandle::new(number, pending).into_datum(), request]
            }),
            Err(fault) => {
                malformed.note(attachment.map(|attachment| attachment.gid), &fault.to_string());
                handles.refuse(query, format!("the request is malformed: {fault}"));
            }
        }
    };
    let key = endpoint.key.clone();
    let declare = move |session: &zenoh::Session| {
        session.declare_queryable(key).complete(true).callback(deliver).wait()
    };
    let queryable = node.session().call(declare).await?;
    endpoint.announce(node.session()).await?;
    Ok(DeclaredEntity::new((queryable, endpoint), Some(delivery)))
}
