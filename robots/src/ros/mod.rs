//! ROS 2 by Zenoh, in the manner of `rmw_zenoh`: nodes with topics and services. Actions, parameters and the
//! rest are made of these in ESL, in `modules/ros.esl`.
//!
//! Guarantees: no payload stops a node or its program. An unreadable payload is counted, reported once for
//! each sender, and dropped; a type, a quality of service or a name that does not fit is told by its name.

use std::path::PathBuf;

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, HostInput, HostRows, Inbox, IntoDatum, Right};
use esl_world::{ready_soon, spawned};

mod attachment;
mod clock;
mod graph;
mod node;
mod qos;
mod service;
mod topic;
mod types;
mod wire;

use crate::message::{Types, complete, encode};
use crate::run::{is_on, note_topic};
use crate::zenoh::session::ZenohSession;
use node::RosNode;
use qos::QosArgument;
use service::{ServiceClient, UnansweredCall};
use topic::TopicPublisher;
use wire::EndpointKind;

/// Bytes of the name of a goal.
const UUID: usize = 16;

/// Returns the functions of `:ros`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    let types = Types::bundled();
    add_types(&mut rows, &types);
    add_nodes(&mut rows);
    add_topics(&mut rows, &types);
    add_services(&mut rows, &types);
    add_clock(&mut rows, &types, inbox);
    rows
}

/// Adds the functions of types and messages, which reach nothing outside, save for folders of definitions.
fn add_types(rows: &mut HostRows, types: &Types) {
    let known = types.clone();
    rows.at_once(
        "%ROS-FOLDER",
        ["path"],
        "Adds the folder PATH to the search for definitions, before others.",
        move |path: String| {
            known.add_folder(PathBuf::from(path));
            Ok(())
        },
    )
    .needs(Right::Read, "path")
    .lasts();
    let known = types.clone();
    rows.at_once(
        "%ROS-DEFINE",
        ["name", "text"],
        "Makes TEXT the definition of the type NAME.",
        move |name: String, text: String| Ok(known.define(&name, &text)?),
    )
    .everywhere()
    .lasts();
    let known = types.clone();
    rows.at_once(
        "%ROS-COMPLETE",
        ["type", "message"],
        "Returns MESSAGE, of the message type TYPE, with all fields, when it is checked.",
        move |of_type: String, message: Datum| Ok(complete(&*types::message(&known, &of_type)?, &message)?),
    )
    .everywhere();
    let known = types.clone();
    rows.at_once(
        "%ROS-CHECK-TYPE",
        ["kind", "name"],
        "Fails unless there is a type NAME of the kind MESSAGE, SERVICE or ACTION; returns its whole name.",
        move |kind: String, name: String| {
            Ok(match kind.as_str() {
                "SERVICE" => types::service(&known, &name)?.name().to_owned(),
                "ACTION" => known.action(&name)?.name().to_owned(),
                _ => types::message(&known, &name)?.name().to_owned(),
            })
        },
    )
    .everywhere();
    let known = types.clone();
    rows.at_once(
        "%ROS-DESCRIBE",
        ["name"],
        "Returns the parts of the type NAME: of each its name and its description.",
        move |name: String| {
            let described = |parts: &[(&str, Datum)]| -> Vec<Datum> {
                let part =
                    |(name, fields): &(&str, Datum)| vec![name.into_datum(), fields.clone()].into_datum();
                parts.iter().map(part).collect()
            };
            if let Ok(action) = known.action(&name) {
                let (goal, result, feedback) = (&action.goal, &action.result, &action.feedback);
                return Ok(described(&[
                    ("GOAL", goal.description()),
                    ("RESULT", result.description()),
                    ("FEEDBACK", feedback.description()),
                ]));
            }
            if let Ok(service) = known.service(&name) {
                let (request, response) = (&service.request, &service.response);
                return Ok(described(&[
                    ("REQUEST", request.description()),
                    ("RESPONSE", response.description()),
                ]));
            }
            Ok(described(&[("MESSAGE", known.message(&name)?.description())]))
        },
    )
    .everywhere();
    rows.at_once("%ROS-IS-NOTED", [], "Returns whether a recorder of the run hears of messages.", || {
        Ok(is_on())
    })
    .everywhere();
    let known = types.clone();
    rows.at_once(
        "%ROS-NOTE",
        ["topic", "type", "message"],
        "Tells the recorder of the run of MESSAGE, in a graph in memory.",
        move |topic: String, of_type: String, message: Datum| {
            let of_type = types::message(&known, &of_type)?;
            note_topic(&topic, &of_type, &encode(&of_type, &message)?);
            Ok(())
        },
    )
    .everywhere();
    let known = types.clone();
    rows.at_once(
        "%ROS-JOINED-TEXT",
        ["type"],
        "Returns the text of the definition of TYPE, and of the types that it names.",
        move |name: String| Ok(known.joined_text(&name)?),
    )
    .everywhere();
    rows.at_once("%ROS-UUID", [], "Returns the bytes of a new name of a goal.", || {
        let mut bytes = vec![0; UUID];
        getrandom::fill(&mut bytes).map_err(|error| HostFailure::new("ROS-ERROR", error))?;
        Ok(esl_bytecode::Bytes::from(bytes))
    });
}

/// Adds the functions of nodes and of the graph.
fn add_nodes(rows: &mut HostRows) {
    let mut made = 0;
    rows.operation(
        spawned,
        "%ROS-NODE",
        ["session", "events", "domain", "namespace", "name", "bridged"],
        "Declares a node; if BRIDGED, one for `zenoh-bridge-ros2dds`. The input EVENTS is signalled with a kind, a text \
         and a name.",
        move |session: HostHandle<ZenohSession>,
              events: HostInput,
              domain: usize,
              namespace: String,
              name: String,
              is_bridged: bool| {
            made += 1;
            let number = made;
            async move {
                let session = session.get()?;
                let node = RosNode::declare(session, events, domain, namespace, name, is_bridged).await?;
                Ok(HostHandle::new(number, node))
            }
        },
    )
    .lasts();
    rows.at_once("%ROS-END", ["node"], "Ends NODE.", |node: HostHandle<RosNode>| {
        node.end();
        Ok(())
    })
    .closes();
    rows.at_once(
        "%ROS-COUNT",
        ["node", "kind", "name"],
        "Returns the number of endpoints of KIND, MP, MS, SS or SC, under NAME that NODE sees.",
        |node: HostHandle<RosNode>, kind: String, name: String| {
            let kind: EndpointKind = kind.parse().map_err(|text| HostFailure::new("ROS-ERROR", text))?;
            Ok(i64::try_from(node.graph().count(kind, &name)).unwrap_or(i64::MAX))
        },
    );
    rows.at_once("%ROS-NODES", ["node"], "Returns the names of the nodes.", |node: HostHandle<RosNode>| {
        Ok(node.graph().nodes())
    });
    rows.at_once(
        "%ROS-ENDPOINTS",
        ["node"],
        "Returns the endpoints: lists of kind, name, type and node.",
        |node: HostHandle<RosNode>| Ok(node.graph().endpoints()),
    );
}

/// Adds the functions of topics.
fn add_topics(rows: &mut HostRows, types: &Types) {
    let (known, mut made) = (types.clone(), 0);
    rows.operation(
        spawned,
        "%ROS-ADVERTISE",
        ["node", "name", "type", "qos"],
        "Returns a publisher of a topic.",
        move |node: HostHandle<RosNode>, name: String, of_type: String, QosArgument(qos): QosArgument| {
            made += 1;
            let (number, of_type) = (made, types::message(&known, &of_type));
            async move { Ok(HostHandle::new(number, topic::advertise(&node, name, of_type?, qos).await?)) }
        },
    )
    .lasts();
    rows.operation(
        ready_soon,
        "%ROS-PUBLISH",
        ["publisher", "message"],
        "Publishes MESSAGE.",
        |publisher: HostHandle<TopicPublisher>, message: Datum| async move { publisher.publish(&message).await },
    );
    rows.at_once(
        "%ROS-CLOSE",
        ["publisher"],
        "Closes PUBLISHER.",
        |publisher: HostHandle<TopicPublisher>| {
            publisher.close();
            Ok(())
        },
    )
    .closes();
    let (known, mut made) = (types.clone(), 0);
    rows.operation(
        spawned,
        "%ROS-SUBSCRIBE",
        ["node", "input", "name", "type", "qos"],
        "Signals the input with the messages of a topic, and the times at which they were sent.",
        move |node: HostHandle<RosNode>,
              input: HostInput,
              name: String,
              of_type: String,
              QosArgument(qos): QosArgument| {
            made += 1;
            let (number, of_type) = (made, types::message(&known, &of_type));
            async move {
                let entity = topic::subscribe(&node, input, name, of_type?, qos).await?;
                Ok(HostHandle::new(number, entity))
            }
        },
    )
    .lasts();
}

/// Adds the functions of time.
fn add_clock(rows: &mut HostRows, types: &Types, inbox: &Inbox) {
    let host = inbox.clone();
    rows.at_once("%ROS-GOES-BY-CLOCK", [], "Returns whether time is that of the topic /clock.", move || {
        Ok(host.has_external_clock())
    })
    .everywhere();
    let (known, host, mut made) = (types.clone(), inbox.clone(), 0);
    rows.operation(
        spawned,
        "%ROS-CLOCK",
        ["node", "input", "qos"],
        "Makes the topic /clock the source of time. Signals the input with its beginning and with steps back.",
        move |node: HostHandle<RosNode>, input: HostInput, QosArgument(qos): QosArgument| {
            made += 1;
            let (number, of_type) = (made, types::message(&known, "rosgraph_msgs/msg/Clock"));
            let inbox = host.clone();
            async move {
                let entity = clock::follow(&node, inbox, input, of_type?, qos).await?;
                Ok(HostHandle::new(number, entity))
            }
        },
    );
}

/// Adds the functions of services.
fn add_services(rows: &mut HostRows, types: &Types) {
    let (known, mut made) = (types.clone(), 0);
    rows.operation(
        spawned,
        "%ROS-CLIENT",
        ["node", "name", "type", "qos"],
        "Returns a client of a service.",
        move |node: HostHandle<RosNode>, name: String, of_type: String, QosArgument(qos): QosArgument| {
            made += 1;
            let (number, of_type) = (made, types::service(&known, &of_type));
            async move { Ok(HostHandle::new(number, service::client(&node, name, of_type?, qos).await?)) }
        },
    )
    .lasts();
    rows.operation(
        spawned,
        "%ROS-CALL",
        ["node", "client", "request"],
        "Calls a service, and returns its response.",
        |node: HostHandle<RosNode>, client: HostHandle<ServiceClient>, request: Datum| async move {
            service::call(&node, &client, &request).await
        },
    );
    let (known, mut made) = (types.clone(), 0);
    rows.operation(
        spawned,
        "%ROS-SERVE",
        ["node", "input", "name", "type", "qos"],
        "Signals the input with the calls of a service: of each its handle and the request.",
        move |node: HostHandle<RosNode>,
              input: HostInput,
              name: String,
              of_type: String,
              QosArgument(qos): QosArgument| {
            made += 1;
            let (number, of_type) = (made, types::service(&known, &of_type));
            async move {
                let entity = service::serve(&node, input, name, of_type?, qos).await?;
                Ok(HostHandle::new(number, entity))
            }
        },
    )
    .lasts();
    rows.operation(
        ready_soon,
        "%ROS-RESPOND",
        ["call", "response"],
        "Answers a call.",
        |call: HostHandle<UnansweredCall>, response: Datum| async move { call.respond(&response).await },
    );
    rows.operation(
        ready_soon,
        "%ROS-REFUSE",
        ["call", "text"],
        "Answers a call by an error.",
        |call: HostHandle<UnansweredCall>, text: String| async move { call.refuse(text).await },
    );
}
