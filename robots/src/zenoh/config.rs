//! Configuration of a session: where it connects and listens, each only after the program was asked for its
//! right.
//!
//! A configuration begins with no place to connect to or to listen at. Those of a file are handed out, and so
//! are the files of keys and certificates that it names, so that the module asks for each of them; they come
//! back by [`SessionConfig::add_place`]. A configuration of the operator's needs no such question.

use std::fmt::Display;

use esl_host::HostFailure;
use serde_json::Value;
use zenoh::Config;

use super::zenoh_failure;

/// Most bytes of a message that is received.
const MOST_BYTES: usize = 64 << 20;
/// Address at which peers find each other by multicast.
const SCOUTING: &str = "224.0.0.224:7446";

/// Side of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// It is made from here.
    Connect,
    /// It is accepted here.
    Listen,
}

impl Side {
    fn section(self) -> &'static str {
        match self {
            Side::Connect => "connect",
            Side::Listen => "listen",
        }
    }
}

/// A part of a configuration that the program needs a right for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ConfiguredPlace {
    /// An endpoint.
    Endpoint(Side, String),
    /// Peers are found by multicast at this address.
    Scouting(String),
    /// A file that is read, with the name of its setting.
    File(String, String),
}

/// Protocols of endpoints.
const PROTOCOLS: [&str; 4] = ["tcp", "tls", "udp", "unixsock-stream"];
/// Protocols that Zenoh has, and sessions here do not speak.
const OTHER_PROTOCOLS: [&str; 6] = ["quic", "quic_datagram", "serial", "unixpipe", "vsock", "ws"];
/// The path of the settings of TLS.
const TLS: &str = "transport/link/tls";
/// Settings of TLS that name files.
const TLS_FILES: [&str; 5] = [
    "root_ca_certificate",
    "listen_private_key",
    "listen_certificate",
    "connect_private_key",
    "connect_certificate",
];
/// Settings without effect here, on which a user of Zenoh could rely, and what to use in their place.
const WITHOUT_EFFECT: [(&str, &str); 3] = [
    ("transport/auth/usrpwd", "use TLS with certificates"),
    ("transport/auth/pubkey", "use TLS with certificates"),
    ("plugins", "run `zenohd` for them, and connect to it"),
];

/// Configuration of a session that is not open.
#[derive(Clone, Debug, Default)]
pub(crate) struct SessionConfig {
    config: Config,
    connect: Vec<String>,
    listen: Vec<String>,
    scouts: bool,
    /// Whether peers that other peers tell of are connected to.
    follows_gossip: bool,
}

fn config_failure(reason: impl Display) -> HostFailure {
    HostFailure::new("ZENOH-ERROR", format!("invalid configuration: {reason}"))
}

fn insert(config: &mut Config, key: &str, value: &str) -> Result<(), HostFailure> {
    config.insert_json5(key, value).map_err(config_failure)
}

/// Returns a setting as JSON.
fn get(config: &Config, key: &str) -> Result<Value, HostFailure> {
    let text = config.get_json(key).map_err(config_failure)?;
    serde_json::from_str(&text).map_err(config_failure)
}

impl SessionConfig {
    /// Returns the configuration that a text in JSON5 describes, and the places in it, which are not part of
    /// the configuration yet.
    ///
    /// # Errors
    /// `:zenoh-error`.
    pub(crate) fn of_text(text: &str) -> Result<(SessionConfig, Vec<ConfiguredPlace>), HostFailure> {
        let mut config = Config::from_json5(text).map_err(config_failure)?;
        let standard = Config::default();
        for (key, instead) in WITHOUT_EFFECT {
            if get(&config, key)? != get(&standard, key)? {
                return Err(config_failure(format_args!("`{key}` has no effect in a session: {instead}")));
            }
        }
        let mode = get(&config, "mode")?;
        let mut places = Vec::new();
        for side in [Side::Connect, Side::Listen] {
            let key = format!("{}/endpoints", side.section());
            let setting = get(&config, &key)?;
            insert(&mut config, &key, "[]")?;
            // Zenoh's own places to listen at are those of a role that the file says.
            if mode.is_string() || setting != get(&standard, &key)? {
                let endpoints = endpoints_in(&setting, mode.as_str().unwrap_or("peer")).into_iter();
                places.extend(endpoints.map(|endpoint| ConfiguredPlace::Endpoint(side, endpoint)));
            }
        }
        if get(&config, "scouting/multicast/enabled")? == Value::Bool(true) {
            let address = match get(&config, "scouting/multicast/address")? {
                Value::String(address) => address,
                _ => SCOUTING.into(),
            };
            places.push(ConfiguredPlace::Scouting(address));
        }
        for name in TLS_FILES {
            let key = format!("{TLS}/{name}");
            if let Value::String(path) = get(&config, &key)? {
                insert(&mut config, &key, "null")?;
                places.push(ConfiguredPlace::File(name.into(), path));
            }
        }
        Ok((SessionConfig { config, ..SessionConfig::default() }, places))
    }

    /// Returns the configuration that an operator has written: an endpoint to connect to, or a text in JSON5
    /// with all its places.
    ///
    /// # Errors
    /// `:zenoh-error`.
    pub(crate) fn of_operator(text: &str, is_endpoint: bool) -> Result<SessionConfig, HostFailure> {
        if is_endpoint {
            let mut config = SessionConfig::default();
            config.add_place(ConfiguredPlace::Endpoint(Side::Connect, text.into()))?;
            return Ok(config);
        }
        let (mut config, places) = SessionConfig::of_text(text)?;
        config.follows_gossip = !get(&config.config, "scouting/gossip/autoconnect")?.is_null();
        for place in places {
            config.add_place(place)?;
        }
        Ok(config)
    }

    /// Adds a place, which the program has the right to.
    ///
    /// # Errors
    /// `:zenoh-error`, if it is an endpoint of a protocol that sessions do not speak.
    pub(crate) fn add_place(&mut self, place: ConfiguredPlace) -> Result<(), HostFailure> {
        match place {
            ConfiguredPlace::Endpoint(side, endpoint) => {
                check_protocol(parts_of_endpoint(&endpoint)?.0)?;
                match side {
                    Side::Connect => self.connect.push(endpoint),
                    Side::Listen => self.listen.push(endpoint),
                }
                Ok(())
            }
            ConfiguredPlace::Scouting(address) => {
                self.scouts = true;
                insert(&mut self.config, "scouting/multicast/address", &quoted(&address))
            }
            ConfiguredPlace::File(name, path) => {
                insert(&mut self.config, &format!("{TLS}/{name}"), &quoted(&path))
            }
        }
    }

    /// Sets the role of the session. Without one it has that of its file; if that says none, it is a client
    /// if it only connects, and a peer otherwise.
    pub(crate) fn set_mode(&mut self, mode: Option<&str>) -> Result<(), HostFailure> {
        let only_connects = !self.connect.is_empty() && self.listen.is_empty() && !self.scouts;
        let mode = match mode {
            Some(mode) => mode,
            None if !get(&self.config, "mode")?.is_null() => return Ok(()),
            None if only_connects => "client",
            None => "peer",
        };
        insert(&mut self.config, "mode", &quoted(mode))
    }

    /// Returns the endpoints to which a session connects, as a text.
    pub(crate) fn peers(&self) -> String {
        self.connect.join(" or ")
    }

    /// Returns the whole configuration. A client waits at most `milliseconds` for its first connection.
    pub(crate) fn finish(mut self, milliseconds: u64) -> Result<Config, HostFailure> {
        let list = |endpoints: &[String]| Value::from(endpoints).to_string();
        let (connect, listen) = (list(&self.connect), list(&self.listen));
        let waiting = format!("{{ router: -1, peer: -1, client: {milliseconds} }}");
        let scouts = self.scouts.to_string();
        let mut settings = vec![
            ("connect/endpoints", connect.as_str()),
            ("listen/endpoints", listen.as_str()),
            ("connect/timeout_ms", &waiting),
            ("connect/exit_on_failure", "{ router: false, peer: false, client: true }"),
            ("listen/timeout_ms", "0"),
            ("listen/exit_on_failure", "true"),
            ("scouting/multicast/enabled", &scouts),
        ];
        if get(&self.config, "connect/retry")?.is_null() {
            let retry = "{ period_init_ms: 100, period_max_ms: 10000, period_increase_factor: 2 }";
            settings.push(("connect/retry", retry));
        }
        if !self.scouts && !self.follows_gossip {
            // The program has no right to the places that a peer tells of.
            settings.push(("scouting/gossip/autoconnect", "{ router: [], peer: [], client: [] }"));
        }
        for (key, value) in settings {
            insert(&mut self.config, key, value)?;
        }
        // Samples of publishers that keep their last ones are told apart by it.
        insert(&mut self.config, "timestamping/enabled", "{ router: true, peer: true, client: true }")?;
        insert(&mut self.config, "transport/link/rx/max_message_size", &MOST_BYTES.to_string())?;
        Ok(self.config)
    }
}

/// Splits an endpoint into its protocol, its address, and what follows.
///
/// # Errors
/// `:zenoh-error`, if it has another form.
pub(crate) fn parts_of_endpoint(endpoint: &str) -> Result<(&str, &str, &str), HostFailure> {
    let invalid = || zenoh_failure(format!("`{endpoint}` is not an endpoint: expected `tcp/HOST:PORT`"));
    let (protocol, rest) = endpoint.split_once('/').ok_or_else(invalid)?;
    let (address, metadata) = rest.split_at(rest.find(['?', '#']).unwrap_or(rest.len()));
    if address.is_empty() { Err(invalid()) } else { Ok((protocol, address, metadata)) }
}

/// Refuses a protocol that sessions do not speak.
fn check_protocol(protocol: &str) -> Result<(), HostFailure> {
    if PROTOCOLS.contains(&protocol) {
        return Ok(());
    }
    let known = PROTOCOLS.join(", ");
    Err(zenoh_failure(format!("unknown protocol `{protocol}`: expected one of {known}")))
}

/// Returns whether a text of an operator's is an endpoint; otherwise it is a path.
pub(crate) fn is_endpoint(text: &str) -> bool {
    let is_protocol = |protocol| PROTOCOLS.contains(&protocol) || OTHER_PROTOCOLS.contains(&protocol);
    text.split_once('/').is_some_and(|(protocol, _)| is_protocol(protocol))
}

fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

/// Returns the endpoints of a session with this role in a setting: a list of endpoints and of groups of them,
/// which may be given for each role.
fn endpoints_in(setting: &Value, mode: &str) -> Vec<String> {
    let list = if setting.is_object() { &setting[mode] } else { setting };
    let texts = list.as_array().into_iter().flatten().flat_map(|item| match item {
        Value::Object(group) => {
            group.get("locators").and_then(Value::as_array).map_or(&[][..], Vec::as_slice)
        }
        one => std::slice::from_ref(one),
    });
    texts.filter_map(|text| text.as_str().map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(config: &Config, key: &str) -> String {
        config.get_json(key).expect("the key exists")
    }

    fn endpoint(side: Side, text: &str) -> ConfiguredPlace {
        ConfiguredPlace::Endpoint(side, text.into())
    }

    #[test]
    fn a_session_reaches_nothing_that_was_not_added() {
        let mut config = SessionConfig::default();
        config.set_mode(None).expect("the role is known");
        let whole = config.finish(0).expect("the settings are known");
        assert_eq!(text(&whole, "mode"), "\"peer\"");
        assert_eq!(
            (text(&whole, "connect/endpoints"), text(&whole, "listen/endpoints")),
            ("[]".into(), "[]".into())
        );
        assert_eq!(text(&whole, "scouting/multicast/enabled"), "false");
        assert!(!text(&whole, "scouting/gossip/autoconnect").contains("router\",\"peer"));
    }

    #[test]
    fn a_session_that_only_connects_is_a_client() {
        let mut config = SessionConfig::default();
        config.add_place(endpoint(Side::Connect, "tcp/a:1")).expect("the protocol is known");
        config.set_mode(None).expect("the role is known");
        let whole = config.finish(1500).expect("the settings are known");
        assert_eq!(text(&whole, "mode"), "\"client\"");
        assert_eq!(text(&whole, "connect/endpoints"), "[\"tcp/a:1\"]");
        assert!(text(&whole, "connect/timeout_ms").contains("1500"));
    }

    #[test]
    fn places_of_a_file_are_handed_out_and_taken_out() {
        let source = r#"{ mode: "peer", connect: { endpoints: ["tcp/a:1", { strategy: "allOf",
                                                              locators: ["udp/b:2", "tls/d:4"] }] },
                          listen: { endpoints: { peer: ["tcp/c:3"], router: ["tcp/e:5"] } },
                          transport: { link: { tls: { root_ca_certificate: "/ca.pem" } } },
                          scouting: { multicast: { enabled: true } } }"#;
        let (mut config, places) = SessionConfig::of_text(source).expect("it is valid");
        let expected = [
            endpoint(Side::Connect, "tcp/a:1"),
            endpoint(Side::Connect, "udp/b:2"),
            endpoint(Side::Connect, "tls/d:4"),
            endpoint(Side::Listen, "tcp/c:3"),
            ConfiguredPlace::Scouting(SCOUTING.into()),
            ConfiguredPlace::File("root_ca_certificate".into(), "/ca.pem".into()),
        ];
        assert_eq!(places, expected);
        let whole = config.clone().finish(0).expect("the settings are known");
        let key = "transport/link/tls/root_ca_certificate";
        assert_eq!(
            (text(&whole, "connect/endpoints"), text(&whole, "listen/endpoints"), text(&whole, key)),
            ("[]".into(), "[]".into(), "null".into())
        );
        assert_eq!(text(&whole, "scouting/multicast/enabled"), "false");
        config.add_place(places[5].clone()).expect("the setting is known");
        let whole = config.finish(0).expect("the settings are known");
        assert_eq!(text(&whole, key), "\"/ca.pem\"");
        assert!(SessionConfig::of_text("{ mode: 1 }").is_err());
    }

    #[test]
    fn a_file_says_the_role_unless_the_program_does() {
        for (source, mode, expected) in [
            ("{ mode: 'router' }", None, "\"router\""),
            ("{ mode: 'router' }", Some("peer"), "\"peer\""),
            ("{ connect: { endpoints: ['tcp/a:1'] } }", None, "\"client\""),
            ("{ listen: { endpoints: ['tcp/a:1'] } }", None, "\"peer\""),
            ("{}", None, "\"peer\""),
        ] {
            let mut config = SessionConfig::of_operator(source, false).expect("it is valid");
            config.set_mode(mode).expect("the role is known");
            let whole = config.finish(0).expect("the settings are known");
            assert_eq!(text(&whole, "mode"), expected, "{source}");
        }
    }

    #[test]
    fn a_role_of_a_file_listens_where_zenoh_does() {
        let listens = |source: &str| {
            let (_, places) = SessionConfig::of_text(source).expect("it is valid");
            places
        };
        assert_eq!(listens("{}"), []);
        assert_eq!(listens("{ mode: 'client' }"), []);
        assert_eq!(listens("{ mode: 'router' }"), [endpoint(Side::Listen, "tcp/[::]:7447")]);
        assert_eq!(listens("{ mode: 'peer' }"), [endpoint(Side::Listen, "tcp/[::]:0")]);
        assert_eq!(listens("{ mode: 'router', listen: { endpoints: [] } }"), []);
    }

    #[test]
    fn what_has_no_effect_is_refused() {
        for (source, part) in [
            ("{ transport: { auth: { usrpwd: { user: 'a', password: 'b' } } } }", "usrpwd` has no effect"),
            ("{ plugins: { rest: { http_port: 8000 } } }", "plugins` has no effect"),
            ("{ listen: { endpoints: ['quic/a:1'] } }", "unknown protocol `quic`"),
            ("{ lissten: {} }", "unknown field `lissten`"),
        ] {
            let refused = SessionConfig::of_operator(source, false).expect_err("it is refused");
            let refused = super::super::defaults::reason_of(&refused);
            assert!(refused.contains(part), "{source}: {refused}");
        }
        assert!(is_endpoint("tls/a:1") && is_endpoint("quic/a:1"));
        assert!(!is_endpoint("zenoh.json5") && !is_endpoint("/etc/zenoh.json5"));
    }

    #[test]
    fn an_endpoint_has_a_protocol_and_an_address() {
        let parts = |text| parts_of_endpoint(text).ok();
        assert_eq!(parts("tcp/[::1]:7447#iface=lo"), Some(("tcp", "[::1]:7447", "#iface=lo")));
        assert_eq!(parts("unixsock-stream//tmp/a"), Some(("unixsock-stream", "/tmp/a", "")));
        assert_eq!((parts("tcp"), parts("tcp/"), parts("")), (None, None, None));
    }
}
