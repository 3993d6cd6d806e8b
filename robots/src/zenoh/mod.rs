//! Zenoh: sessions, in which a program publishes, subscribes, asks and answers under keys.
//!
//! Guarantees: a session connects to nothing and listens at nothing that the program lacks the right for.
//! Callbacks of Zenoh never wait for the program (`delivery`). A lost connection is made again, after pauses
//! that get longer, and what was declared is declared there again, by Zenoh itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_host::{
    FromArgument, HostFailure, HostHandle, HostInput, HostRows, Inbox, IntoDatum, Keyword, Payload, Right,
    Sender,
};
use esl_world::{ready_soon, spawned};
use zenoh::Wait;

mod config;
pub(crate) mod defaults;
pub(crate) mod delivery;
pub(crate) mod entity;
pub(crate) mod payload;
pub(crate) mod query;
pub(crate) mod runtime;
pub(crate) mod session;

use config::{ConfiguredPlace, SessionConfig, Side, parts_of_endpoint};
use entity::DeclaredEntity;
use payload::PayloadForm;
use query::{PendingQuery, QueryRequest, datum_of_reply, get};
use session::{ZenohSession, short};

/// Returns the failure for an error of Zenoh's.
pub(crate) fn zenoh_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("ZENOH-ERROR", short(&reason.to_string()))
}

impl FromArgument for Side {
    const TYPE: &'static str = "SYMBOL";

    fn from_argument(datum: &Datum) -> Result<Side, HostFailure> {
        match datum.as_symbol().map(|symbol| symbol.name()) {
            Some("CONNECT") => Ok(Side::Connect),
            Some("LISTEN") => Ok(Side::Listen),
            _ => Err(HostFailure::of_type(datum, Self::TYPE)),
        }
    }
}

/// Returns a place of a configuration as the module takes it.
fn datum_of_place(place: &ConfiguredPlace) -> Result<Datum, HostFailure> {
    let texts = |kind, texts: &[&str]| {
        let texts = texts.iter().map(|&text| text.into_datum());
        std::iter::once(Keyword(kind).into_datum()).chain(texts).collect::<Vec<_>>().into_datum()
    };
    Ok(match place {
        ConfiguredPlace::Scouting(address) => texts("SCOUT", &[address]),
        ConfiguredPlace::File(setting, path) => texts("FILE", &[setting, path]),
        ConfiguredPlace::Endpoint(side, endpoint) => {
            let (protocol, address, rest) = parts_of_endpoint(endpoint)?;
            let kind = if *side == Side::Connect { "CONNECT" } else { "LISTEN" };
            texts(kind, &[protocol, address, rest])
        }
    })
}

/// Returns the functions of `:zenoh`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    add_sessions(&mut rows);
    add_entities(&mut rows);
    add_queries(&mut rows);
    rows
}

/// Adds the functions of sessions.
fn add_sessions(rows: &mut HostRows) {
    let mut made = 0;
    rows.at_once("%ZENOH-NEW", [], "Returns a session that is not open.", move || {
        made += 1;
        Ok(HostHandle::new(made, ZenohSession::default()))
    })
    .lasts();
    rows.at_once(
        "%ZENOH-CONFIGURE",
        ["session", "text"],
        "Takes the configuration that TEXT describes, in JSON5; returns the places in it, which are not part of it \
         yet: lists of :CONNECT or :LISTEN, protocol, address and rest; of :SCOUT and an address; or of :FILE, a \
         setting and a path.",
        |session: HostHandle<ZenohSession>, text: String| {
            let (config, places) = SessionConfig::of_text(&text)?;
            session.configure(|old| {
                *old = config;
                Ok(())
            })?;
            places.iter().map(datum_of_place).collect::<Result<Vec<Datum>, HostFailure>>()
        },
    )
    .lasts();
    rows.at_once(
        "%ZENOH-FILE",
        ["session", "setting", "path"],
        "Adds a file of keys or certificates.",
        |session: HostHandle<ZenohSession>, setting: String, path: String| {
            session.configure(|config| config.add_place(ConfiguredPlace::File(setting, path)))
        },
    )
    .needs(Right::Read, "path")
    .lasts();
    rows.at_once(
        "%ZENOH-DEFAULTS",
        [],
        "Returns the name of the agent that the command names, or NIL, and whether it has a configuration.",
        || Ok(defaults::as_data()),
    )
    .everywhere();
    rows.at_once(
        "%ZENOH-BY-COMMAND",
        ["session", "fleet"],
        "Takes the configuration of the command, for an agent of FLEET.",
        |session: HostHandle<ZenohSession>, _fleet: String| {
            let config = defaults::session()?;
            session.configure(|old| {
                *old = config;
                Ok(())
            })
        },
    )
    .needs(Right::Fleet, "fleet")
    .lasts();
    rows.at_once(
        "%ZENOH-PARTS",
        ["endpoint"],
        "Returns the list of protocol, address and rest of a text `protocol/address`.",
        |endpoint: String| {
            let (protocol, address, rest) = parts_of_endpoint(&endpoint)?;
            Ok(vec![protocol.to_owned(), address.to_owned(), rest.to_owned()])
        },
    )
    .everywhere();
    rows.at_once(
        "%ZENOH-ENDPOINT",
        ["session", "side", "protocol", "address", "rest"],
        "Adds an endpoint of the network.",
        |session: HostHandle<ZenohSession>, side: Side, protocol: String, address: String, rest: String| {
            // Settings of an endpoint may name files, for which no right was asked.
            if protocol == "unixsock-stream" || rest.contains('/') || (protocol == "tls" && !rest.is_empty())
            {
                return Err(zenoh_failure(format!(
                    "`{protocol}/{address}{rest}` is not an endpoint of the network"
                )));
            }
            let place = ConfiguredPlace::Endpoint(side, format!("{protocol}/{address}{rest}"));
            session.configure(|config| config.add_place(place))
        },
    )
    .needs(Right::Net, "address")
    .lasts();
    rows.at_once(
        "%ZENOH-SOCKET",
        ["session", "side", "path"],
        "Adds an endpoint that is a Unix socket.",
        |session: HostHandle<ZenohSession>, side: Side, path: String| {
            let place = ConfiguredPlace::Endpoint(side, format!("unixsock-stream/{path}"));
            session.configure(|config| config.add_place(place))
        },
    )
    .needs(Right::Read, "path")
    .needs(Right::Write, "path")
    .lasts();
    rows.at_once(
        "%ZENOH-SCOUT",
        ["session", "address"],
        "Finds peers by multicast at ADDRESS.",
        |session: HostHandle<ZenohSession>, address: String| {
            session.configure(|config| config.add_place(ConfiguredPlace::Scouting(address)))
        },
    )
    .needs(Right::Net, "address")
    .lasts();
    rows.operation(
        spawned,
        "%ZENOH-OPEN",
        ["session", "input", "mode", "milliseconds"],
        "Opens SESSION. The input is signalled with :CONNECTED or :LOST, the peer and its role.",
        |sender: Sender,
         session: HostHandle<ZenohSession>,
         input: HostInput,
         mode: Option<String>,
         milliseconds: u64| async move { session.open(mode, milliseconds, input, sender).await },
    )
    .lasts();
    rows.operation(
        spawned,
        "%ZENOH-CLOSE",
        ["session"],
        "Closes SESSION, when earlier requests are handed over.",
        |session: HostHandle<ZenohSession>| async move { session.close().await },
    )
    .closes();
    rows.at_once(
        "%ZENOH-ID",
        ["session"],
        "Returns the name of the session.",
        |session: HostHandle<ZenohSession>| Ok(session.get()?.zenoh().zid().to_string()),
    );
    rows.operation(
        ready_soon,
        "%ZENOH-PUT",
        ["session", "key", "payload", "encoding", "attachment"],
        "Publishes PAYLOAD, a text or bytes, under KEY.",
        |session: HostHandle<ZenohSession>,
         key: String,
         Payload(payload): Payload,
         encoding: Option<String>,
         attachment: Option<Payload>| async move {
            let session = session.get()?;
            let key = zenoh::key_expr::KeyExpr::new(key).map_err(zenoh_failure)?;
            let zenoh = session.zenoh();
            let put = move || {
                let put = zenoh.put(key, payload).encoding(encoding.unwrap_or_default());
                let attachment = attachment.map(|Payload(bytes)| bytes);
                // A session that is closed meanwhile takes nothing.
                _ = put
                    .attachment(attachment)
                    .congestion_control(zenoh::qos::CongestionControl::Block)
                    .wait();
            };
            session.requests().put(put).await
        },
    );
    rows.operation(
        ready_soon,
        "%ZENOH-DELETE",
        ["session", "key"],
        "Tells that there is nothing under KEY any more.",
        |session: HostHandle<ZenohSession>, key: String| async move {
            let session = session.get()?;
            let key = zenoh::key_expr::KeyExpr::new(key).map_err(zenoh_failure)?;
            let zenoh = session.zenoh();
            // As above.
            session.requests().put(move || _ = zenoh.delete(key).wait()).await
        },
    );
}

/// Adds the functions of what is declared in a session.
fn add_entities(rows: &mut HostRows) {
    let made = AtomicI64::new(0);
    let next = Arc::new(move || made.fetch_add(1, Ordering::Relaxed) + 1);
    rows.operation(
        spawned,
        "%ZENOH-SUBSCRIBE",
        ["session", "input", "key", "form"],
        "Signals the input with key, payload, attachment, encoding and kind of each change under KEY.",
        {
            let next = next.clone();
            move |session: HostHandle<ZenohSession>, input: HostInput, key: String, form: PayloadForm| {
                let number = next();
                async move {
                    let session = session.get()?;
                    Ok(HostHandle::new(number, entity::subscribe(&session, input, key, form).await?))
                }
            }
        },
    )
    .lasts();
    rows.operation(
        spawned,
        "%ZENOH-SERVE",
        ["session", "input", "key", "form"],
        "Signals the input with queries for KEY: handle, key, parameters, payload, attachment, encoding.",
        {
            let next = next.clone();
            move |session: HostHandle<ZenohSession>, input: HostInput, key: String, form: PayloadForm| {
                let number = next();
                async move {
                    let session = session.get()?;
                    Ok(HostHandle::new(number, entity::serve(&session, input, key, form).await?))
                }
            }
        },
    )
    .lasts();
    rows.operation(spawned, "%ZENOH-ALIVE", ["session", "key"], "Declares a sign of life.", {
        let next = next.clone();
        move |session: HostHandle<ZenohSession>, key: String| {
            let number = next();
            async move {
                let session = session.get()?;
                Ok(HostHandle::new(number, entity::declare_alive(&session, key).await?))
            }
        }
    })
    .lasts();
    rows.operation(
        spawned,
        "%ZENOH-WATCH",
        ["session", "input", "key"],
        "Signals the input with :PUT or :DELETE and the key of signs of life that come or go.",
        move |session: HostHandle<ZenohSession>, input: HostInput, key: String| {
            let number = next();
            async move {
                let session = session.get()?;
                Ok(HostHandle::new(number, entity::watch_alive(&session, input, key).await?))
            }
        },
    )
    .lasts();
    rows.at_once(
        "%ZENOH-END",
        ["entity"],
        "Ends ENTITY, a declaration.",
        |entity: HostHandle<DeclaredEntity>| {
            entity.end();
            Ok(())
        },
    )
    .closes();
    rows.at_once(
        "%ZENOH-LOST",
        ["entity"],
        "Returns the number of arrivals that were dropped before they reached the input.",
        |entity: HostHandle<DeclaredEntity>| Ok(i64::try_from(entity.lost()).unwrap_or(i64::MAX)),
    );
}

/// Adds the functions of queries.
fn add_queries(rows: &mut HostRows) {
    rows.operation(
        spawned,
        "%ZENOH-GET",
        ["session", "selector", "payload", "encoding", "attachment", "milliseconds", "form"],
        "Returns the replies to a query: property lists.",
        |session: HostHandle<ZenohSession>,
         selector: String,
         payload: Option<Payload>,
         encoding: Option<String>,
         attachment: Option<Payload>,
         milliseconds: Option<u64>,
         form: PayloadForm| async move {
            let session = session.get()?;
            let bytes = |payload: Option<Payload>| payload.map(|Payload(bytes)| bytes);
            let request = QueryRequest {
                selector,
                payload: bytes(payload),
                encoding,
                attachment: bytes(attachment),
                timeout: milliseconds.map(Duration::from_millis),
                is_call: false,
                asks_complete: false,
            };
            let replies = get(&session, request).await?;
            Ok(replies.iter().filter_map(|reply| datum_of_reply(reply, form)).collect::<Vec<Datum>>())
        },
    );
    rows.operation(
        ready_soon,
        "%ZENOH-REPLY",
        ["query", "key", "payload", "encoding", "attachment"],
        "Replies PAYLOAD to QUERY, under KEY or that of the query.",
        |query: HostHandle<PendingQuery>,
         key: Option<String>,
         Payload(payload): Payload,
         encoding: Option<String>,
         attachment: Option<Payload>| async move {
            let attachment = attachment.map(|Payload(bytes)| bytes);
            query.reply(key, payload, encoding, attachment).await
        },
    );
    rows.operation(
        ready_soon,
        "%ZENOH-REPLY-ERROR",
        ["query", "text"],
        "Replies an error to QUERY.",
        |query: HostHandle<PendingQuery>, text: String| async move { query.reply_error(text).await },
    );
    rows.at_once(
        "%ZENOH-FINISH",
        ["query"],
        "Ends the replies to QUERY.",
        |query: HostHandle<PendingQuery>| {
            query.finish();
            Ok(())
        },
    );
}
