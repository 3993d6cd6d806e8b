//! Configuration of a session: where it connects and listens, each only after the program was asked for its
//! right.
//!
//! A configuration begins with no place to connect to or to listen at. Those of a file are handed out, so
//! that the module asks for each of them, and come back by [`SessionConfig::add_endpoint`].

use std::fmt::Display;

use esl_host::HostFailure;
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

/// Configuration of a session that is not open.
#[derive(Clone, Debug, Default)]
pub(crate) struct SessionConfig {
    config: Config,
    connect: Vec<String>,
    listen: Vec<String>,
    scouts: bool,
}

fn config_failure(reason: impl Display) -> HostFailure {
    HostFailure::new("ZENOH-ERROR", format!("invalid configuration: {reason}"))
}

fn insert(config: &mut Config, key: &str, value: &str) -> Result<(), HostFailure> {
    config.insert_json5(key, value).map_err(config_failure)
}

/// An endpoint of a file: its side, or `None` for the address of scouting, and its text.
pub(crate) type ConfiguredEndpoint = (Option<Side>, String);

impl SessionConfig {
    /// Returns the configuration that a text in JSON5 describes, and the endpoints in it, which are not part
    /// of the configuration yet.
    ///
    /// # Errors
    /// `:zenoh-error`.
    pub(crate) fn of_text(text: &str) -> Result<(SessionConfig, Vec<ConfiguredEndpoint>), HostFailure> {
        let mut config = Config::from_json5(text).map_err(config_failure)?;
        let mut endpoints = Vec::new();
        for side in [Side::Connect, Side::Listen] {
            let key = format!("{}/endpoints", side.section());
            let found = config.get_json(&key).map_err(config_failure)?;
            endpoints.extend(texts_in(&found).into_iter().map(|endpoint| (Some(side), endpoint)));
            insert(&mut config, &key, "[]")?;
        }
        let flag = config.get_json("scouting/multicast/enabled").map_err(config_failure)?;
        if flag == "true" {
            let address = config.get_json("scouting/multicast/address").map_err(config_failure)?;
            let address = texts_in(&address).pop().unwrap_or_else(|| SCOUTING.into());
            endpoints.push((None, address));
        }
        Ok((SessionConfig { config, ..SessionConfig::default() }, endpoints))
    }

    /// Adds an endpoint, which the program has the right to.
    pub(crate) fn add_endpoint(&mut self, side: Side, endpoint: String) {
        match side {
            Side::Connect => self.connect.push(endpoint),
            Side::Listen => self.listen.push(endpoint),
        }
    }

    /// Has peers be found by multicast at an address, which the program has the right to; also peers that
    /// other peers tell of.
    pub(crate) fn scout(&mut self, address: &str) -> Result<(), HostFailure> {
        self.scouts = true;
        insert(&mut self.config, "scouting/multicast/address", &quoted(address))
    }

    /// Sets the role of the session. Without one it is a client, if it only connects, and a peer otherwise.
    pub(crate) fn set_mode(&mut self, mode: Option<&str>) -> Result<(), HostFailure> {
        let only_connects = !self.connect.is_empty() && self.listen.is_empty() && !self.scouts;
        let mode = mode.unwrap_or(if only_connects { "client" } else { "peer" });
        insert(&mut self.config, "mode", &quoted(mode))
    }

    /// Returns the endpoints to which a session connects, as a text.
    pub(crate) fn peers(&self) -> String {
        self.connect.join(" or ")
    }

    /// Returns the whole configuration. A client waits at most `milliseconds` for its first connection.
    pub(crate) fn finish(mut self, milliseconds: u64) -> Result<Config, HostFailure> {
        let list = |endpoints: &[String]| {
            let quoted: Vec<String> = endpoints.iter().map(|endpoint| quoted(endpoint)).collect();
            format!("[{}]", quoted.join(","))
        };
        let (connect, listen) = (list(&self.connect), list(&self.listen));
        let waiting = format!("{{ router: -1, peer: -1, client: {milliseconds} }}");
        let scouts = self.scouts.to_string();
        let mut settings = vec![
            ("connect/endpoints", connect.as_str()),
            ("listen/endpoints", listen.as_str()),
            ("connect/timeout_ms", &waiting),
            ("connect/exit_on_failure", "{ router: false, peer: false, client: true }"),
            ("connect/retry", "{ period_init_ms: 100, period_max_ms: 10000, period_increase_factor: 2 }"),
            ("listen/timeout_ms", "0"),
            ("listen/exit_on_failure", "true"),
            ("scouting/multicast/enabled", &scouts),
        ];
        if !self.scouts {
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

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control.is_control() => quoted.push_str(&format!("\\u{:04x}", u32::from(control))),
            other => quoted.push(other),
        }
    }
    quoted + "\""
}

/// Returns the strings in a text in JSON, in their order, those behind colons too.
fn texts_in(json: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut characters = json.chars().peekable();
    while let Some(character) = characters.next() {
        if character != '"' {
            continue;
        }
        let mut text = String::new();
        while let Some(next) = characters.next() {
            match next {
                '"' => break,
                '\\' => text.extend(characters.next()),
                other => text.push(other),
            }
        }
        // Names of members: an endpoint may be given for each role.
        if characters.peek() != Some(&':') {
            found.push(text);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn get(config: &Config, key: &str) -> String {
        config.get_json(key).expect("the key exists")
    }

    #[test]
    fn a_session_reaches_nothing_that_was_not_added() {
        let mut config = SessionConfig::default();
        config.set_mode(None).expect("the role is known");
        let whole = config.finish(0).expect("the settings are known");
        assert_eq!(get(&whole, "mode"), "\"peer\"");
        assert_eq!(
            (get(&whole, "connect/endpoints"), get(&whole, "listen/endpoints")),
            ("[]".into(), "[]".into())
        );
        assert_eq!(get(&whole, "scouting/multicast/enabled"), "false");
        assert!(!get(&whole, "scouting/gossip/autoconnect").contains("router\",\"peer"));
    }

    #[test]
    fn a_session_that_only_connects_is_a_client() {
        let mut config = SessionConfig::default();
        config.add_endpoint(Side::Connect, "tcp/a:1".into());
        config.set_mode(None).expect("the role is known");
        let whole = config.finish(1500).expect("the settings are known");
        assert_eq!(get(&whole, "mode"), "\"client\"");
        assert_eq!(get(&whole, "connect/endpoints"), "[\"tcp/a:1\"]");
        assert!(get(&whole, "connect/timeout_ms").contains("1500"));
    }

    #[test]
    fn endpoints_of_a_file_are_handed_out_and_taken_out() {
        let text = r#"{ mode: "peer", connect: { endpoints: ["tcp/a:1", "udp/b:2"] },
                        listen: { endpoints: { peer: ["tcp/c:3"] } },
                        scouting: { multicast: { enabled: true } } }"#;
        let (config, endpoints) = SessionConfig::of_text(text).expect("it is valid");
        let expected = [
            (Some(Side::Connect), "tcp/a:1"),
            (Some(Side::Connect), "udp/b:2"),
            (Some(Side::Listen), "tcp/c:3"),
            (None, SCOUTING),
        ];
        assert_eq!(endpoints, expected.map(|(side, text)| (side, text.to_owned())));
        let whole = config.finish(0).expect("the settings are known");
        assert_eq!(
            (get(&whole, "connect/endpoints"), get(&whole, "listen/endpoints")),
            ("[]".into(), "[]".into())
        );
        assert_eq!(get(&whole, "scouting/multicast/enabled"), "false");
        assert!(SessionConfig::of_text("{ mode: 1 }").is_err());
    }

    #[test]
    fn an_endpoint_has_a_protocol_and_an_address() {
        let parts = |text| parts_of_endpoint(text).ok();
        assert_eq!(parts("tcp/[::1]:7447#iface=lo"), Some(("tcp", "[::1]:7447", "#iface=lo")));
        assert_eq!(parts("unixsock-stream//tmp/a"), Some(("unixsock-stream", "/tmp/a", "")));
        assert_eq!((parts("tcp"), parts("tcp/"), parts("")), (None, None, None));
    }
}
