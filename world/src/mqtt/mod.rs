//! MQTT: clients of a broker, which connect again by themselves when the connection is lost.
//!
//! A client has a task on the event loop, which keeps the connection up and signals the inputs of its
//! subscriptions with what arrives (`delivery`). At most [`MOST_KEPT`] messages wait for room in an input:
//! then the task does not read on until there is some, or the program waits for an answer (`room`). While
//! there is no connection, publishing and subscribing fail with the reason.
//!
//! Guarantees: a message of level 2 that the broker repeats before it releases it is delivered once. Nothing
//! is sent that the protocol does not allow.

use std::collections::{HashMap, HashSet, VecDeque};
use std::hash::{BuildHasher, RandomState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_host::{
    FromArgument, HostFailure, HostHandle, HostInput, HostObject, HostRows, Inbox, Payload, Right, Sender,
};
use rumqttc::{AsyncClient, ConnectionError, LastWill, MqttOptions, QoS, TlsConfiguration, Transport};
use tokio::sync::{Notify, oneshot, watch};

use crate::event_loop;
use crate::operation::spawned;

mod delivery;
mod driver;
mod room;
mod text;

use delivery::{Message, Subscription, deliver};
use driver::Driver;
use room::HandingOver;
use text::{check_filter, check_length, check_text, check_topic};

/// Most messages that are kept for the program.
const MOST_KEPT: usize = 1000;
/// Requests that wait until they are sent.
const MOST_REQUESTS: usize = 100;
/// Most bytes of a packet.
const MOST_BYTES: usize = 16 << 20;
/// Bytes of a packet with a message, beside its topic and its payload, at most.
const MOST_BESIDE: usize = 9;
/// Pauses before the connection is tried again: the first, and the longest.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(10));
/// Time that the last requests have to be sent when a client is closed.
const GOODBYE: Duration = Duration::from_secs(2);

/// How a subscription has come out.
type Subscribed = oneshot::Sender<bool>;

/// The state that the task on the event loop shares with the operations.
#[derive(Default)]
struct State {
    /// Messages that have yet to be delivered.
    messages: VecDeque<Message>,
    subscriptions: Vec<Subscription>,
    /// The greatest number of a subscription so far.
    subscribed: u64,
    /// Receivers of the answers to subscriptions that have yet to be sent, in their order; `None` for one
    /// that is renewed.
    subscribing: VecDeque<Option<Subscribed>>,
    /// Receivers of the answers to subscriptions that were sent, by the protocol's numbers.
    asked: HashMap<u16, Option<Subscribed>>,
    /// Receivers of the acknowledgements of messages that have yet to be sent, in the order of the requests,
    /// with numbers of their own.
    publishing: VecDeque<(u64, oneshot::Sender<()>)>,
    /// Receivers of the acknowledgements of messages that were sent, by the protocol's numbers.
    sent: HashMap<u16, oneshot::Sender<()>>,
    /// Number of messages that are being handed over.
    handing_over: usize,
    /// Why there is no connection.
    problem: Option<String>,
}

#[derive(Default)]
struct ClientState {
    state: Mutex<State>,
    /// Notified when a message comes.
    came: Notify,
    /// Notified when messages were delivered, and when the program asks for something.
    taken: Notify,
    /// Held by the operation that hands over a message to be acknowledged, so that the order of the requests
    /// is known.
    turn: tokio::sync::Mutex<u64>,
}

impl ClientState {
    fn state(&self) -> MutexGuard<'_, State> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the failure for a request, if there is no connection.
    fn check(&self) -> Result<(), HostFailure> {
        match &self.state().problem {
            None => Ok(()),
            Some(problem) => Err(HostFailure::new("CONNECTION-LOST", problem)),
        }
    }
}

/// A client of the program's; nothing before it is connected, and after it is closed.
#[derive(Default)]
struct Client(Mutex<Option<Connected>>);

impl HostObject for Client {
    const KIND: &'static str = "MQTT-CLIENT";
}

/// A client that was connected.
#[derive(Clone)]
struct Connected {
    client: AsyncClient,
    shared: Arc<ClientState>,
    /// Set when the client is to end; dropped when the program has lost it.
    closing: Arc<watch::Sender<bool>>,
    /// Changes when it has ended.
    ended: watch::Receiver<bool>,
}

impl Client {
    fn lock(&self) -> MutexGuard<'_, Option<Connected>> {
        // As above.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self) -> Result<Connected, HostFailure> {
        self.lock().clone().ok_or_else(|| mqtt_failure("the client is closed"))
    }
}

fn mqtt_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("MQTT-ERROR", reason)
}

/// MessageLevel of quality of a message or a subscription.
struct MessageLevel(QoS);

impl FromArgument for MessageLevel {
    const TYPE: &'static str = "INTEGER";

    fn from_argument(datum: &Datum) -> Result<MessageLevel, HostFailure> {
        Ok(MessageLevel(match i64::from_argument(datum)? {
            0 => QoS::AtMostOnce,
            1 => QoS::AtLeastOnce,
            _ => QoS::ExactlyOnce,
        }))
    }
}

/// Message that the broker publishes if the client is lost: a list of topic, payload, level, and whether it
/// is kept.
struct Will(LastWill);

impl FromArgument for Will {
    const TYPE: &'static str = "LIST";

    fn from_argument(datum: &Datum) -> Result<Will, HostFailure> {
        let [topic, payload, level, is_kept] = datum.as_list().unwrap_or_default()[..] else {
            return Err(HostFailure::of_type(datum, Self::TYPE));
        };
        let (topic, Payload(payload)) = (String::from_argument(topic)?, Payload::from_argument(payload)?);
        check_topic(&topic)?;
        check_length("payload of the last will", payload.len())?;
        let MessageLevel(level) = MessageLevel::from_argument(level)?;
        Ok(Will(LastWill::new(topic, payload, level, bool::from_argument(is_kept)?)))
    }
}

/// Returns the functions of `:mqtt`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.constructor::<Client>("%MQTT-NEW", "Returns a client that is not connected.").lasts();
    rows.operation(
        spawned,
        "%MQTT-OPEN",
        ["client", "address", "id", "keep-alive", "credentials", "will", "tls", "ca-file"],
        "Connects CLIENT to the broker at ADDRESS. CREDENTIALS is a pair of user and password, WILL a list of topic, \
         payload, QoS and retention.",
        |sender: Sender,
         client: HostHandle<Client>,
         address: String,
         id: Option<String>,
         keep_alive: u16,
         credentials: Option<(String, Option<String>)>,
         will: Option<Will>,
         tls: bool,
         ca_file: Option<String>| {
            let options = options(&address, id, keep_alive, credentials, will);
            async move { open(client, sender, options?, tls.then_some(ca_file)).await }
        },
    )
    .needs(Right::Net, "address")
    .needs(Right::Read, "ca-file")
    .lasts();
    rows.operation(
        spawned,
        "%MQTT-PUBLISH",
        ["client", "topic", "payload", "qos", "retain"],
        "Publishes PAYLOAD, a text or bytes, under TOPIC.",
        publish,
    );
    rows.operation(
        spawned,
        "%MQTT-SUBSCRIBE",
        ["client", "input", "filter", "qos", "as-bytes"],
        "Signals the input with the name INPUT with topic, payload and retention of messages for FILTER.",
        subscribe,
    )
    .lasts();
    rows.at_once(
        "%MQTT-PROBLEM",
        ["client"],
        "Returns the reason why there is no connection, or NIL.",
        |client: HostHandle<Client>| Ok(client.get()?.shared.state().problem.clone()),
    )
    .local();
    rows.operation(
        spawned,
        "%MQTT-CLOSE",
        ["client"],
        "Ends CLIENT: sends its last requests, and waits until it has ended.",
        |client: HostHandle<Client>| async move {
            let connected = client.lock().take();
            if let Some(Connected { closing, mut ended, .. }) = connected {
                // It may have ended by itself.
                _ = closing.send(true);
                _ = ended.wait_for(|&has_ended| has_ended).await;
            }
            Ok(())
        },
    )
    .closes();
    rows
}

/// Returns the options of a client.
fn options(
    address: &str,
    id: Option<String>,
    keep_alive: u16,
    credentials: Option<(String, Option<String>)>,
    will: Option<Will>,
) -> Result<MqttOptions, HostFailure> {
    let (host, port) = address.rsplit_once(':').unwrap_or((address, "1883"));
    let port = port.parse().map_err(mqtt_failure)?;
    // A broker ends the connection of a client when another one comes by its name.
    let id = id.unwrap_or_else(|| format!("esl-{:016x}", RandomState::new().hash_one(std::process::id())));
    check_text("name of the client", &id)?;
    let mut options = MqttOptions::new(id, host.trim_matches(['[', ']']), port);
    options.set_keep_alive(Duration::from_secs(keep_alive.into()));
    options.set_max_packet_size(MOST_BYTES, MOST_BYTES);
    if let Some((user, password)) = credentials {
        let password = password.unwrap_or_default();
        check_text("user", &user)?;
        check_length("password", password.len())?;
        options.set_credentials(user, password);
    }
    if let Some(Will(will)) = will {
        options.set_last_will(will);
    }
    Ok(options)
}

/// Connects a client. `tls` says whether the connection is secured, and by which file of certificates.
async fn open(
    client: HostHandle<Client>,
    sender: Sender,
    mut options: MqttOptions,
    tls: Option<Option<String>>,
) -> Result<(), HostFailure> {
    if let Some(ca_file) = tls {
        let config = crate::tls::client_config(ca_file).await?;
        options.set_transport(Transport::tls_with_config(TlsConfiguration::Rustls(config)));
    }
    let (requests, mut events) = AsyncClient::new(options, MOST_REQUESTS);
    // An acknowledgement is small, and the other side waits for it.
    let mut network = events.network_options();
    network.set_tcp_nodelay(true);
    events.set_network_options(network);
    match events.poll().await {
        Ok(_) => {}
        Err(error) => return Err(connection_failure(&error)),
    }
    let shared = Arc::<ClientState>::default();
    let (closing, close) = watch::channel(false);
    let (end, ended) = watch::channel(false);
    let driver =
        Driver { client: requests.clone(), events, shared: shared.clone(), close, delivered: HashSet::new() };
    let delivering = shared.clone();
    let drive = async move {
        tokio::select! {
            () = driver.run() => {}
            () = deliver(&delivering) => {}
        }
        drop(sender);
        // No operation may wait for it.
        _ = end.send(true);
    };
    event_loop::spawn(drive).map_err(mqtt_failure)?;
    *client.lock() = Some(Connected { client: requests, shared, closing: Arc::new(closing), ended });
    Ok(())
}

/// Returns the failure for a connection that is not made.
fn connection_failure(error: &ConnectionError) -> HostFailure {
    let cause = match error {
        ConnectionError::Io(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => {
            "CONNECTION-REFUSED"
        }
        ConnectionError::Tls(_) => "TLS-ERROR",
        ConnectionError::NetworkTimeout | ConnectionError::FlushTimeout => "TIMEOUT",
        _ => "MQTT-ERROR",
    };
    HostFailure::new(cause, error)
}

/// Publishes a message.
async fn publish(
    client: HostHandle<Client>,
    topic: String,
    Payload(payload): Payload,
    MessageLevel(level): MessageLevel,
    is_kept: bool,
) -> Result<(), HostFailure> {
    let client = client.get()?;
    check_topic(&topic)?;
    let most = MOST_BYTES - MOST_BESIDE - topic.len();
    if payload.len() > most {
        return Err(mqtt_failure(format!(
            "the payload has {} bytes: at most {most} are sent",
            payload.len()
        )));
    }
    client.shared.check()?;
    let refused = |_| mqtt_failure("the client is closed");
    let handing_over = HandingOver::begin(&client.shared);
    if level == QoS::AtMostOnce {
        client.client.publish_bytes(topic, level, is_kept, payload).await.map_err(refused)?;
        handing_over.goes_on();
        return Ok(());
    }
    let acknowledged = {
        let mut turn = client.shared.turn.lock().await;
        *turn += 1;
        let (sender, acknowledged) = oneshot::channel();
        client.shared.state().publishing.push_back((*turn, sender));
        let mut request = PublishRequest { shared: &client.shared, number: *turn, is_made: false };
        client.client.publish_bytes(topic, level, is_kept, payload).await.map_err(refused)?;
        request.is_made = true;
        acknowledged
    };
    let lost = |_| {
        HostFailure::new("CONNECTION-LOST", "the connection was lost before the message was acknowledged")
    };
    acknowledged.await.map_err(lost)
}

/// A message that is being handed over. If that is left, there is nothing to be acknowledged.
struct PublishRequest<'a> {
    shared: &'a ClientState,
    number: u64,
    is_made: bool,
}

impl Drop for PublishRequest<'_> {
    fn drop(&mut self) {
        if !self.is_made {
            self.shared.state().publishing.retain(|&(number, _)| number != self.number);
        }
    }
}

/// Subscribes to topics. Messages may come before the answer.
async fn subscribe(
    client: HostHandle<Client>,
    input: HostInput,
    filter: String,
    MessageLevel(level): MessageLevel,
    as_bytes: bool,
) -> Result<(), HostFailure> {
    let client = client.get()?;
    check_filter(&filter)?;
    client.shared.check()?;
    let (sender, answer) = oneshot::channel();
    let mut request = {
        // In the order of the requests, which is that of the answers.
        let mut state = client.shared.state();
        let refused = |_| mqtt_failure("too many pending requests");
        client.client.try_subscribe(filter.clone(), level).map_err(refused)?;
        state.subscribing.push_back(Some(sender));
        client.shared.taken.notify_one();
        state.subscribed += 1;
        let number = state.subscribed;
        let filter = filter.clone();
        state.subscriptions.push(Subscription { number, filter, level, input, as_bytes });
        SubscribeRequest { shared: &client.shared, number, is_granted: false }
    };
    match answer.await {
        Ok(true) => {
            request.is_granted = true;
            Ok(())
        }
        Ok(false) => Err(mqtt_failure(format!("the broker refuses the subscription to `{filter}`"))),
        Err(_) => {
            Err(HostFailure::new("CONNECTION-LOST", "the connection was lost before the broker has answered"))
        }
    }
}

/// A subscription whose answer has yet to come. It is removed if the call is left, or if the broker refuses
/// it.
struct SubscribeRequest<'a> {
    shared: &'a ClientState,
    number: u64,
    is_granted: bool,
}

impl Drop for SubscribeRequest<'_> {
    fn drop(&mut self) {
        if !self.is_granted {
            self.shared.state().subscriptions.retain(|subscription| subscription.number != self.number);
        }
    }
}
