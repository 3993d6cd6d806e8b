//! MQTT: clients of a broker, which connect again by themselves when the connection is lost.
//!
//! A client has a task on the event loop, which keeps the connection up and gathers what arrives, at most
//! [`MOST_KEPT`] messages: then it does not read on until the program has taken some, or waits for an answer
//! (`room`). While there is no connection, publishing and subscribing fail with the reason.
//!
//! Guarantees: a message of level 2 that the broker repeats before it releases it is delivered once. Nothing
//! is sent that the protocol does not allow.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, LastWill, MqttOptions, Outgoing, Packet, QoS,
    SubscribeReasonCode, TlsConfiguration, Transport,
};
use tokio::sync::{Notify, oneshot, watch};

use crate::data::{CallArguments, Numbered, boolean, failure, integer, nil, text, text_of_bytes};
use crate::event_loop;
use crate::operation::{Completion, define};

mod room;
mod text;

use room::{HandingOver, await_room};
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

/// A message: its topic, its bytes, and whether the broker has kept it for new subscribers.
type Message = (String, Vec<u8>, bool);

/// How a subscription has come out.
type Subscribed = oneshot::Sender<bool>;

/// What the task on the event loop shares with the operations.
struct State {
    messages: VecDeque<Message>,
    /// What is subscribed to, for when the connection is made again.
    filters: HashMap<String, QoS>,
    /// Who waits for the answers to subscriptions that have yet to be sent, in their order; nobody for one
    /// that is made again.
    subscribing: VecDeque<Option<Subscribed>>,
    /// Who waits for those to subscriptions that were sent, by the protocol's numbers.
    asked: HashMap<u16, Option<Subscribed>>,
    /// Who waits for the acknowledgements of messages that have yet to be sent, in the order of the requests,
    /// with numbers of their own.
    publishing: VecDeque<(u64, oneshot::Sender<()>)>,
    /// Who waits for those of messages that were sent, by the protocol's numbers.
    sent: HashMap<u16, oneshot::Sender<()>>,
    /// Number of messages that are being handed over.
    handing_over: usize,
    /// Why there is no connection.
    problem: Option<String>,
}

struct ClientState {
    state: Mutex<State>,
    /// Notified when a message comes.
    came: Notify,
    /// Notified when messages were taken, and when the program asks for something.
    taken: Notify,
    /// Held by who hands over a message that is acknowledged, so that the order of the requests is known.
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
            Some(problem) => Err(failure("CONNECTION-LOST", problem)),
        }
    }
}

/// A client of the program's.
#[derive(Clone)]
struct Client {
    client: AsyncClient,
    shared: Arc<ClientState>,
    /// Set when the client is to end; dropped with the machine.
    closing: Arc<watch::Sender<bool>>,
    /// Changes when it has ended.
    ended: watch::Receiver<bool>,
}

/// The clients of a machine, by number, and the greatest number so far.
#[derive(Clone, Default)]
struct Clients(Arc<Mutex<Numbered<Client>>>);

impl Clients {
    fn lock(&self) -> MutexGuard<'_, Numbered<Client>> {
        // As above.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, number: i64) -> Result<Client, HostFailure> {
        let client = self.lock().1.get(&number).cloned().flatten();
        client.ok_or_else(|| mqtt_failure("the client is closed"))
    }
}

fn mqtt_failure(reason: impl ToString) -> HostFailure {
    failure("MQTT-ERROR", reason)
}

fn qos(level: i64) -> QoS {
    match level {
        0 => QoS::AtMostOnce,
        1 => QoS::AtLeastOnce,
        _ => QoS::ExactlyOnce,
    }
}

/// Gives a machine the operations of `:mqtt`.
pub(crate) fn install(machine: &mut Vm) {
    let clients = Clients::default();
    let known = clients.clone();
    let add = move |_: &[Datum]| {
        let mut clients = known.lock();
        clients.0 += 1;
        let number = clients.0;
        clients.1.insert(number, None);
        Ok(integer(number))
    };
    machine.add_host_function("%MQTT-NEW", HostFunction::AtOnce(Box::new(add)));
    let known = clients.clone();
    let take = move |arguments: &[Datum]| {
        let shared = known.get(CallArguments(arguments.to_vec()).integer(0)?)?.shared;
        let Some((topic, bytes, is_kept)) = shared.state().messages.pop_front() else { return Ok(nil()) };
        shared.taken.notify_one();
        Ok(Datum::list([text(&topic), text_of_bytes(&bytes), boolean(is_kept)], Span::default()))
    };
    machine.add_host_function("%MQTT-TAKE", HostFunction::AtOnce(Box::new(take)));
    let known = clients.clone();
    let problem = move |arguments: &[Datum]| {
        let shared = known.get(CallArguments(arguments.to_vec()).integer(0)?)?.shared;
        let problem = shared.state().problem.as_deref().map_or_else(nil, text);
        Ok(problem)
    };
    machine.add_host_function("%MQTT-PROBLEM", HostFunction::AtOnce(Box::new(problem)));
    let known = clients.clone();
    let needs = [Need { right: Right::Net, argument: 1 }, Need { right: Right::Read, argument: 11 }];
    define(machine, "%MQTT-OPEN", &needs, move |arguments| open(arguments, known.clone()));
    let known = clients.clone();
    define(machine, "%MQTT-AWAIT", &[], move |arguments| {
        let client = arguments.integer(0).and_then(|number| known.get(number));
        async move {
            let Client { shared, mut ended, .. } = client?;
            let come = async {
                loop {
                    let came = shared.came.notified();
                    if !shared.state().messages.is_empty() {
                        return;
                    }
                    came.await;
                }
            };
            tokio::select! {
                () = come => Ok(Vec::new()),
                _ = ended.wait_for(|&has_ended| has_ended) => Err(mqtt_failure("the client is closed")),
            }
        }
    });
    let known = clients.clone();
    define(machine, "%MQTT-PUBLISH", &[], move |arguments| publish(arguments, known.clone()));
    let known = clients.clone();
    define(machine, "%MQTT-SUBSCRIBE", &[], move |arguments| subscribe(arguments, known.clone()));
    define(machine, "%MQTT-CLOSE", &[], move |arguments| {
        let client = arguments.integer(0).map(|number| clients.lock().1.remove(&number).flatten());
        async move {
            if let Some(Client { closing, mut ended, .. }) = client? {
                // It may have ended by itself.
                _ = closing.send(true);
                _ = ended.wait_for(|&has_ended| has_ended).await;
            }
            Ok(Vec::new())
        }
    });
}

/// `%MQTT-OPEN`: number, address, name of the client, seconds between signs of life, user and password,
/// topic, payload, level and retention of the last will, whether the connection is secured, file of what
/// is trusted.
async fn open(arguments: CallArguments, clients: Clients) -> Completion {
    let (number, address) = (arguments.integer(0)?, arguments.text(1)?);
    let (host, port) = address.rsplit_once(':').unwrap_or((&address, "1883"));
    let port = port.parse().map_err(mqtt_failure)?;
    let id = arguments.text(2)?;
    check_text("name of the client", &id)?;
    let mut options = MqttOptions::new(id, host.trim_matches(['[', ']']), port);
    let seconds = u64::try_from(arguments.integer(3)?).unwrap_or(0);
    options.set_keep_alive(Duration::from_secs(seconds));
    options.set_max_packet_size(MOST_BYTES, MOST_BYTES);
    if let Some(user) = arguments.text_if_any(4)? {
        let password = arguments.text_if_any(5)?.unwrap_or_default();
        check_text("user", &user)?;
        check_length("password", password.len())?;
        options.set_credentials(user, password);
    }
    if let Some(topic) = arguments.text_if_any(6)? {
        let payload = arguments.bytes(7)?;
        check_topic(&topic)?;
        check_length("payload of the last will", payload.len())?;
        options.set_last_will(LastWill::new(
            topic,
            payload,
            qos(arguments.integer(8)?),
            arguments.is_true(9),
        ));
    }
    if arguments.is_true(10) {
        let config = crate::tls::client_config(arguments.text_if_any(11)?).await?;
        options.set_transport(Transport::tls_with_config(TlsConfiguration::Rustls(config)));
    }
    let (client, mut events) = AsyncClient::new(options, MOST_REQUESTS);
    // An acknowledgement is small, and the other side waits for it.
    let mut network = events.network_options();
    network.set_tcp_nodelay(true);
    events.set_network_options(network);
    match events.poll().await {
        Ok(_) => {}
        Err(error) => return Err(connection_failure(&error)),
    }
    let state = State {
        messages: VecDeque::new(),
        filters: HashMap::new(),
        subscribing: VecDeque::new(),
        asked: HashMap::new(),
        publishing: VecDeque::new(),
        sent: HashMap::new(),
        handing_over: 0,
        problem: None,
    };
    let shared = Arc::new(ClientState {
        state: Mutex::new(state),
        came: Notify::new(),
        taken: Notify::new(),
        turn: tokio::sync::Mutex::default(),
    });
    let (closing, close) = watch::channel(false);
    let (end, ended) = watch::channel(false);
    let driver =
        Driver { client: client.clone(), events, shared: shared.clone(), close, delivered: HashSet::new() };
    let drive = async move {
        driver.run().await;
        // Nobody may wait for it.
        _ = end.send(true);
    };
    event_loop::spawn(drive).map_err(mqtt_failure)?;
    if let Some(place) = clients.lock().1.get_mut(&number) {
        *place = Some(Client { client, shared, closing: Arc::new(closing), ended });
    }
    Ok(vec![integer(number)])
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
    failure(cause, error)
}

/// `%MQTT-PUBLISH`: number, topic, bytes, level, whether the broker keeps it.
async fn publish(arguments: CallArguments, clients: Clients) -> Completion {
    let client = clients.get(arguments.integer(0)?)?;
    let (topic, bytes) = (arguments.text(1)?, arguments.bytes(2)?);
    check_topic(&topic)?;
    let most = MOST_BYTES - MOST_BESIDE - topic.len();
    if bytes.len() > most {
        return Err(mqtt_failure(format!("the payload has {} bytes: at most {most} are sent", bytes.len())));
    }
    client.shared.check()?;
    let level = qos(arguments.integer(3)?);
    let refused = |_| mqtt_failure("the client is closed");
    let is_kept = arguments.is_true(4);
    let handing_over = HandingOver::begin(&client.shared);
    if level == QoS::AtMostOnce {
        client.client.publish(topic.clone(), level, is_kept, bytes).await.map_err(refused)?;
        handing_over.goes_on();
        return Ok(Vec::new());
    }
    let acknowledged = {
        let mut turn = client.shared.turn.lock().await;
        *turn += 1;
        let (sender, acknowledged) = oneshot::channel();
        client.shared.state().publishing.push_back((*turn, sender));
        let mut request = PublishRequest { shared: &client.shared, number: *turn, is_made: false };
        client.client.publish(topic.clone(), level, is_kept, bytes).await.map_err(refused)?;
        request.is_made = true;
        acknowledged
    };
    let lost = |_| failure("CONNECTION-LOST", "the connection was lost before the message was acknowledged");
    acknowledged.await.map_err(lost)?;
    Ok(Vec::new())
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

/// `%MQTT-SUBSCRIBE`: number, filter, level.
async fn subscribe(arguments: CallArguments, clients: Clients) -> Completion {
    let client = clients.get(arguments.integer(0)?)?;
    check_filter(&arguments.text(1)?)?;
    client.shared.check()?;
    let (filter, level) = (arguments.text(1)?, qos(arguments.integer(2)?));
    let (sender, answer) = oneshot::channel();
    {
        // In the order of the requests, which is that of the answers.
        let mut state = client.shared.state();
        let refused = |_| mqtt_failure("too many pending requests");
        client.client.try_subscribe(filter.clone(), level).map_err(refused)?;
        state.subscribing.push_back(Some(sender));
        client.shared.taken.notify_one();
        state.filters.insert(filter.clone(), level);
    }
    match answer.await {
        Ok(true) => Ok(Vec::new()),
        Ok(false) => {
            client.shared.state().filters.remove(&filter);
            Err(mqtt_failure(format!("the broker refuses the subscription to `{filter}`")))
        }
        Err(_) => Err(failure("CONNECTION-LOST", "the connection was lost before the broker has answered")),
    }
}

/// Keeps the connection of a client up.
struct Driver {
    client: AsyncClient,
    events: EventLoop,
    shared: Arc<ClientState>,
    close: watch::Receiver<bool>,
    /// Numbers of the messages of level 2 that were delivered and that the broker has not released.
    delivered: HashSet<u16>,
}

impl Driver {
    async fn run(mut self) {
        let mut pause = PAUSES.0;
        loop {
            let next = async {
                await_room(&self.shared, &mut self.events).await;
                self.events.poll().await
            };
            let event = tokio::select! {
                biased;
                _ = self.close.wait_for(|&is_closing| is_closing) => None,
                event = next => Some(event),
            };
            let Some(event) = event else { return self.say_goodbye().await };
            match event {
                Ok(event) => {
                    if matches!(event, Event::Incoming(_)) {
                        pause = PAUSES.0;
                    }
                    self.note(event);
                }
                Err(error) => {
                    // These belong to the connection that is lost, as the numbers in them do.
                    for event in std::mem::take(&mut self.events.state.events) {
                        self.note(event);
                    }
                    {
                        let mut state = self.shared.state();
                        state.problem = Some(error.to_string());
                        // Who waits for an answer hears that there will be none.
                        state.subscribing.clear();
                        state.asked.clear();
                        state.publishing.clear();
                        state.sent.clear();
                        state.handing_over = 0;
                    }
                    tokio::select! {
                        _ = self.close.wait_for(|&is_closing| is_closing) => return,
                        () = tokio::time::sleep(pause) => {}
                    }
                    pause = (pause * 2).min(PAUSES.1);
                }
            }
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            Event::Incoming(packet) => self.take_in(packet),
            Event::Outgoing(Outgoing::Publish(0)) => self.shared.state().hand_over_one(),
            Event::Outgoing(Outgoing::Publish(number)) => {
                let mut state = self.shared.state();
                if !state.sent.contains_key(&number)
                    && let Some((_, waiting)) = state.publishing.pop_front()
                {
                    state.sent.insert(number, waiting);
                }
            }
            Event::Outgoing(Outgoing::Subscribe(number)) => {
                let mut state = self.shared.state();
                if let Some(waiting) = state.subscribing.pop_front() {
                    state.asked.insert(number, waiting);
                }
            }
            Event::Outgoing(_) => {}
        }
    }

    fn take_in(&mut self, packet: Packet) {
        let mut state = self.shared.state();
        match packet {
            Packet::ConnAck(_) => {
                // The broker knows nothing of an earlier session, since each begins anew.
                self.delivered.clear();
                state.problem = None;
                for (filter, &level) in state.filters.clone().iter() {
                    // There is room for all but a great many, which the broker would have to know still.
                    if self.client.try_subscribe(filter.clone(), level).is_ok() {
                        state.subscribing.push_back(None);
                    }
                }
            }
            Packet::SubAck(answer) => {
                let is_granted = !answer.return_codes.contains(&SubscribeReasonCode::Failure);
                if let Some(Some(waiting)) = state.asked.remove(&answer.pkid) {
                    // The call may have been left.
                    _ = waiting.send(is_granted);
                }
            }
            Packet::PubAck(rumqttc::PubAck { pkid }) | Packet::PubComp(rumqttc::PubComp { pkid }) => {
                if let Some(waiting) = state.sent.remove(&pkid) {
                    // The call may have been left.
                    _ = waiting.send(());
                }
            }
            Packet::PubRel(release) => _ = self.delivered.remove(&release.pkid),
            Packet::Publish(message) => {
                if message.qos == QoS::ExactlyOnce && !self.delivered.insert(message.pkid) {
                    return;
                }
                state.messages.push_back((message.topic, message.payload.to_vec(), message.retain));
                self.shared.came.notify_waiters();
            }
            _ => {}
        }
    }

    /// Sends what is to be sent, and ends the connection.
    async fn say_goodbye(mut self) {
        if self.shared.state().problem.is_some() || self.client.try_disconnect().is_err() {
            return;
        }
        let send_rest = async {
            while !matches!(self.events.poll().await, Ok(Event::Outgoing(Outgoing::Disconnect)) | Err(_)) {}
        };
        // A broker that does not take it is left.
        drop(tokio::time::timeout(GOODBYE, send_rest).await);
    }
}
