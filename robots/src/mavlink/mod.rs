//! MAVLink: messages of vehicles, and links to them.
//!
//! Guarantees: a link reaches nothing that the program lacks the right for; what arrives is bounded and never
//! waited for (`link`, `transport`). The protocols of commands, missions and parameters are in ESL, over
//! subscriptions and messages that are sent.

use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{
    FromArgument, HostFailure, HostHandle, HostInput, HostRows, Inbox, IntoDatum, Payload, Right, Sender,
};
use esl_world::spawned;
use num_traits::ToPrimitive;
use sha2::{Digest, Sha256};

mod definitions;
mod fault;
mod frame;
mod link;
#[doc(hidden)]
pub mod noise;
mod payload;
mod signing;
#[cfg(test)]
mod tests;
mod transport;

use definitions::Dialect;
use link::{LinkCore, MavlinkLink, MavlinkSubscription, MessageSource};
use payload::{command_of, datum_of_value, decode, encode, message_of, value_of_datum};
use signing::Signing;

/// Returns the functions of `:mavlink`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    add_definitions(&mut rows);
    add_links(&mut rows);
    add_messages(&mut rows);
    rows
}

/// Adds the functions that look into the definitions.
fn add_definitions(rows: &mut HostRows) {
    rows.at_once(
        "%MAVLINK-COMPLETE",
        ["name", "fields", "system", "component"],
        "Returns the message as its receiver gets it: all fields, in their types. It is for the system and the \
         component, if FIELDS do not say so.",
        |name: Datum, fields: Datum, system: u8, component: u8| {
            let message = message_of(&name)?;
            Ok(decode(message, &encode(message, &fields, (system, component))?))
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-DESCRIBE",
        ["name"],
        "Returns the fields of a message: lists of keyword, type, and keywords of values.",
        |name: Datum| {
            let message = message_of(&name)?;
            let describe = |field: &definitions::PayloadField| {
                let element = field.element.name().trim_end_matches("_t");
                let of_type = match field.count {
                    Some(count) => format!("{element}[{count}]"),
                    None => element.to_owned(),
                };
                let values = field.enumeration.iter().flat_map(|values| &values.entries);
                let values: Vec<Datum> = values.map(|(_, keyword)| keyword.clone()).collect();
                vec![field.keyword.clone(), of_type.into_datum(), values.into_datum()]
            };
            Ok(message.fields.iter().map(describe).collect::<Vec<_>>())
        },
    )
    .everywhere();
    rows.at_once("%MAVLINK-NUMBER", ["name"], "Returns the number of a message.", |name: Datum| {
        Ok(message_of(&name)?.number)
    })
    .everywhere();
    rows.at_once(
        "%MAVLINK-MESSAGE",
        ["number"],
        "Returns the keyword of the message of a number; NIL if there is none.",
        |number: i64| {
            let message = u32::try_from(number).ok().and_then(|number| Dialect::get().message(number));
            Ok(message.map(|message| message.keyword.clone()))
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-COMMAND",
        ["name", "parameters"],
        "Returns the keyword of a command, or its number if it has none, and its seven parameters, floats.",
        |name: Datum, parameters: Datum| {
            let (number, values) = command_of(&name, &parameters)?;
            let commands = Dialect::get().enumeration("MAV_CMD");
            let keyword = commands.and_then(|commands| commands.keyword(number).cloned());
            let mut list = vec![keyword.unwrap_or_else(|| (number as i64).into_datum())];
            list.extend(values.map(IntoDatum::into_datum));
            Ok(list)
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-VALUE",
        ["enumeration", "name"],
        "Returns the number of a keyword, or of a list of some, in ENUMERATION; NIL if it has none.",
        |enumeration: String, name: Datum| {
            let value = Dialect::get().enumeration(&enumeration);
            Ok(value.and_then(|values| value_of_datum(values, &name).ok()).map(|value| value as i64))
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-NAME",
        ["enumeration", "value"],
        "Returns the keyword of a number in ENUMERATION; the number if it has none.",
        |enumeration: String, value: i64| {
            let found = Dialect::get().enumeration(&enumeration);
            Ok(found.map_or_else(|| value.into_datum(), |found| datum_of_value(found, value as u64)))
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-NAMES",
        ["enumeration"],
        "Returns the keywords of ENUMERATION.",
        |enumeration: String| {
            let found = Dialect::get().enumeration(&enumeration);
            let entries = found.into_iter().flat_map(|found| &found.entries);
            Ok(entries.map(|(_, keyword)| keyword.clone()).collect::<Vec<Datum>>())
        },
    )
    .everywhere();
    rows.at_once(
        "%MAVLINK-BITS",
        ["value"],
        "Returns the bits of a float of single precision.",
        |value: f64| Ok((value as f32).to_bits()),
    )
    .everywhere();
}

/// Adds the functions of links.
fn add_links(rows: &mut HostRows) {
    let mut made = 0;
    rows.at_once(
        "%MAVLINK-NEW",
        ["input", "system", "component", "version"],
        "Returns a link that is not open. Faults signal the input with a kind and a text.",
        move |sender: Sender, input: HostInput, system: u8, component: u8, version: i64| {
            made += 1;
            let core = LinkCore::new((system, component), version == 1, input, sender);
            Ok(HostHandle::new(made, MavlinkLink(Arc::new(core))))
        },
    )
    .lasts();
    rows.operation(
        spawned,
        "%MAVLINK-OPEN",
        ["link", "kind", "address"],
        "Opens LINK by the network; KIND is udpin, udpout, tcpin or tcpout. Returns the local port.",
        |link: HostHandle<MavlinkLink>, kind: String, address: String| async move {
            transport::open(&link.0, &kind, &address).await.map(i64::from)
        },
    )
    .needs(Right::Net, "address")
    .lasts();
    rows.operation(
        spawned,
        "%MAVLINK-OPEN-SERIAL",
        ["link", "path", "baud"],
        "Opens LINK by the serial line PATH.",
        |link: HostHandle<MavlinkLink>, path: String, baud: u32| async move {
            transport::open_serial(&link.0, path, baud).await
        },
    )
    .needs(Right::Serial, "path")
    .lasts();
    rows.at_once("%MAVLINK-CLOSE", ["link"], "Closes LINK.", |link: HostHandle<MavlinkLink>| {
        link.0.close();
        Ok(())
    })
    .closes();
    rows.at_once(
        "%MAVLINK-SIGN",
        ["link", "key", "number", "accepts-unsigned"],
        "Signs messages with KEY, a vector of 32 bytes or a phrase, and checks those of others.",
        |link: HostHandle<MavlinkLink>, key: Datum, number: u8, accepts_unsigned: bool| {
            let bytes = match key.kind() {
                DatumKind::String(phrase) => Sha256::digest(phrase.as_bytes()).into(),
                _ => {
                    let Payload(bytes) = Payload::from_argument(&key)?;
                    <[u8; 32]>::try_from(&bytes[..]).map_err(|_| {
                        let reason = format!("a key has 32 bytes, not {}", bytes.len());
                        HostFailure::new("MAVLINK-ERROR", reason)
                    })?
                }
            };
            link.0.sign(Signing::new(bytes, number, accepts_unsigned));
            Ok(())
        },
    )
    .lasts();
    rows.at_once(
        "%MAVLINK-TARGET",
        ["link", "system", "component"],
        "Makes this component of this system the vehicle of LINK.",
        |link: HostHandle<MavlinkLink>, system: u8, component: u8| {
            link.0.set_target((system, component));
            Ok(())
        },
    )
    .lasts();
    rows.at_once(
        "%MAVLINK-COUNTS",
        ["link"],
        "Returns the counters of LINK: a property list.",
        |link: HostHandle<MavlinkLink>| Ok(link.0.counts()),
    );
}

/// Returns the source that a program names: NIL, :VEHICLE or :COMPONENTS, or the number of a system.
fn source_of(system: &Datum, component: Option<u8>) -> Result<MessageSource, HostFailure> {
    let wrong = || HostFailure::of_type(system, "(OR (MEMBER :VEHICLE :COMPONENTS :ANY) (INTEGER 0 255))");
    match system.kind() {
        DatumKind::Integer(number) => {
            number.to_u8().map(|system| MessageSource::System(system, component)).ok_or_else(wrong)
        }
        DatumKind::Symbol(symbol) if symbol.is_keyword() => match symbol.name() {
            "ANY" => Ok(MessageSource::Any),
            "VEHICLE" => Ok(MessageSource::Target { all_components: false }),
            "COMPONENTS" => Ok(MessageSource::Target { all_components: true }),
            _ => Err(wrong()),
        },
        _ => Err(wrong()),
    }
}

/// Adds the functions that send and receive.
fn add_messages(rows: &mut HostRows) {
    let mut made = 0;
    rows.at_once(
        "%MAVLINK-SUBSCRIBE",
        ["link", "input", "names", "system", "component"],
        "Signals the input with messages, their keywords, and the system and component of their senders.",
        move |link: HostHandle<MavlinkLink>,
              input: HostInput,
              names: Datum,
              system: Datum,
              component: Option<u8>| {
            let source = source_of(&system, component)?;
            let numbers: Result<Vec<u32>, HostFailure> =
                names.elements().map(|name| Ok(message_of(name)?.number)).collect();
            let numbers = if names.is_nil() { None } else { Some(numbers?) };
            made += 1;
            Ok(HostHandle::new(made, link.0.subscribe(input, numbers, source)?))
        },
    )
    .lasts();
    rows.at_once(
        "%MAVLINK-UNSUBSCRIBE",
        ["subscription"],
        "Ends SUBSCRIPTION.",
        |subscription: HostHandle<MavlinkSubscription>| {
            subscription.end();
            Ok(())
        },
    )
    .closes();
    rows.at_once(
        "%MAVLINK-SEND",
        ["link", "name", "fields", "system", "component"],
        "Sends a message, as %MAVLINK-COMPLETE makes it; returns whether there was a peer.",
        |link: HostHandle<MavlinkLink>, name: Datum, fields: Datum, system: u8, component: u8| {
            let message = message_of(&name)?;
            link.0.send(message, &encode(message, &fields, (system, component))?)
        },
    );
}
