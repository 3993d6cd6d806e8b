//! Keys, signs of life and texts of quality of service, as `rmw_zenoh` has them.
//!
//! The key of a topic or a service is `DOMAIN/NAME/TYPE/HASH`. A sign of life is
//! `@ros2_lv/DOMAIN/SESSION/NODE/ENTITY/KIND/ENCLAVE/NAMESPACE/NODE_NAME`.
//! That of an endpoint has `/NAME/TYPE/HASH/QOS` behind it, and `%` stands for each `/` within a part.
//!
//! The crate `hiroz-protocol` has the same. Without its feature `std` it does not compile, and that feature
//! asks for all features of Zenoh, TLS and QUIC among them.
//! Source: the design document of `rmw_zenoh_cpp`.

use std::fmt;
use std::str::FromStr;

/// First part of all signs of life.
const SIGNS: &str = "@ros2_lv";
/// Stands for an empty part, and for `/`.
const ESCAPE: &str = "%";
/// Depth that a text of quality of service leaves out.
const UNSAID_DEPTH: usize = 42;

/// A node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NodeEntity {
    pub(super) domain: usize,
    /// Name of its session.
    pub(super) session: String,
    pub(super) id: usize,
    pub(super) name: String,
    /// Begins with `/`.
    pub(super) namespace: String,
}

/// Kind of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndpointKind {
    Publisher,
    Subscription,
    Service,
    Client,
}

/// A publisher, a subscription, a server or a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct EndpointEntity {
    pub(super) id: usize,
    pub(super) node: NodeEntity,
    pub(super) kind: EndpointKind,
    /// Name of the topic or the service, which begins with `/`.
    pub(super) topic: String,
    /// Name of the type, `std_msgs::msg::dds_::String_`.
    pub(super) type_name: String,
    /// Hash of the type, `RIHS01_…`, or what stands for none.
    pub(super) type_hash: String,
    pub(super) qos: QosProfile,
}

/// A node or an endpoint, as a sign of life stands for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum GraphEntity {
    Node(NodeEntity),
    Endpoint(EndpointEntity),
}

impl EndpointKind {
    fn name(self) -> &'static str {
        match self {
            EndpointKind::Publisher => "MP",
            EndpointKind::Subscription => "MS",
            EndpointKind::Service => "SS",
            EndpointKind::Client => "SC",
        }
    }
}

impl FromStr for EndpointKind {
    type Err = &'static str;

    fn from_str(name: &str) -> Result<EndpointKind, Self::Err> {
        let kinds = [
            EndpointKind::Publisher,
            EndpointKind::Subscription,
            EndpointKind::Service,
            EndpointKind::Client,
        ];
        kinds.into_iter().find(|kind| kind.name() == name).ok_or("expected MP, MS, SS or SC")
    }
}

/// Returns a text as one part of a key.
fn mangled(text: &str) -> String {
    if text.is_empty() { ESCAPE.into() } else { text.replace('/', ESCAPE) }
}

fn plain(part: &str) -> String {
    part.replace('%', "/")
}

impl fmt::Display for NodeEntity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let NodeEntity { domain, session, id, name, namespace } = self;
        let (name, namespace) = (mangled(name), mangled(namespace));
        write!(f, "{SIGNS}/{domain}/{session}/{id}/{id}/NN/{ESCAPE}/{namespace}/{name}")
    }
}

/// The sign of life.
impl fmt::Display for EndpointEntity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let NodeEntity { domain, session, id: node, name, namespace } = &self.node;
        let (id, kind) = (self.id, self.kind.name());
        let (name, namespace, topic) = (mangled(name), mangled(namespace), mangled(&self.topic));
        let (of_type, hash, qos) = (mangled(&self.type_name), &self.type_hash, &self.qos);
        write!(
            f,
            "{SIGNS}/{domain}/{session}/{node}/{id}/{kind}/{ESCAPE}/{namespace}/{name}/{topic}/{of_type}/{hash}/{qos}"
        )
    }
}

impl EndpointEntity {
    /// Returns the key of what is sent.
    pub(super) fn key(&self) -> String {
        let topic = self.topic.trim_matches('/');
        format!("{}/{topic}/{}/{}", self.node.domain, self.type_name, self.type_hash)
    }
}

/// Returns the pattern of the signs of life of a domain.
pub(super) fn signs_of(domain: usize) -> String {
    format!("{SIGNS}/{domain}/**")
}

impl GraphEntity {
    /// Returns what a sign of life stands for, if it is well-formed.
    pub(super) fn of_sign(sign: &str) -> Option<GraphEntity> {
        let parts: Vec<&str> = sign.split('/').collect();
        let (&[signs, domain, session, node, id, kind, _, namespace, name], rest) =
            parts.split_first_chunk()?;
        if signs != SIGNS {
            return None;
        }
        let node = NodeEntity {
            domain: domain.parse().ok()?,
            session: session.to_owned(),
            id: node.parse().ok()?,
            name: plain(name),
            namespace: plain(namespace),
        };
        if kind == "NN" {
            return rest.is_empty().then_some(GraphEntity::Node(node));
        }
        let &[topic, of_type, hash, qos] = rest else { return None };
        Some(GraphEntity::Endpoint(EndpointEntity {
            id: id.parse().ok()?,
            node,
            kind: kind.parse().ok()?,
            topic: plain(topic),
            type_name: plain(of_type),
            type_hash: hash.to_owned(),
            qos: QosProfile::of_text(qos)?,
        }))
    }
}

/// A time in a profile: seconds and nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct QosDuration {
    pub(super) sec: u64,
    pub(super) nsec: u64,
}

impl QosDuration {
    /// No limit.
    pub(super) const INFINITE: QosDuration = QosDuration { sec: 9_223_372_036, nsec: 854_775_807 };

    fn of_texts(sec: &str, nsec: &str) -> Option<QosDuration> {
        let number =
            |text: &str, unsaid| if text.is_empty() { Some(unsaid) } else { text.parse::<u64>().ok() };
        Some(QosDuration { sec: number(sec, Self::INFINITE.sec)?, nsec: number(nsec, Self::INFINITE.nsec)? })
    }
}

/// A part without limit is left out.
impl fmt::Display for QosDuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.sec != Self::INFINITE.sec {
            write!(f, "{}", self.sec)?;
        }
        f.write_str(",")?;
        if self.nsec == Self::INFINITE.nsec { Ok(()) } else { write!(f, "{}", self.nsec) }
    }
}

/// Quality of service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct QosProfile {
    pub(super) is_reliable: bool,
    pub(super) is_transient_local: bool,
    /// Messages that are kept; `None` for all.
    pub(super) depth: Option<usize>,
    pub(super) deadline: QosDuration,
    pub(super) lifespan: QosDuration,
    /// Whether liveliness is asserted by topic.
    pub(super) is_manual: bool,
    pub(super) lease: QosDuration,
}

impl Default for QosProfile {
    fn default() -> QosProfile {
        QosProfile {
            is_reliable: true,
            is_transient_local: false,
            depth: Some(10),
            deadline: QosDuration::INFINITE,
            lifespan: QosDuration::INFINITE,
            is_manual: false,
            lease: QosDuration::INFINITE,
        }
    }
}

/// The text in a sign of life, which leaves out what is the default.
impl fmt::Display for QosProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_reliable { ":" } else { "2:" })?;
        f.write_str(if self.is_transient_local { "1:" } else { ":" })?;
        match self.depth {
            Some(UNSAID_DEPTH) => f.write_str(",")?,
            Some(depth) => write!(f, ",{depth}")?,
            None => f.write_str("2,")?,
        }
        write!(f, ":{}:{}:", self.deadline, self.lifespan)?;
        f.write_str(if self.is_manual { "3," } else { "," })?;
        self.lease.fmt(f)
    }
}

impl QosProfile {
    /// Returns the profile that a text in a sign of life stands for, if it is well-formed.
    pub(super) fn of_text(text: &str) -> Option<QosProfile> {
        let fields: Vec<&str> = text.split(':').collect();
        let &[reliability, durability, history, deadline, lifespan, liveliness] = fields.as_slice() else {
            return None;
        };
        let duration = |field: &str| {
            let (sec, nsec) = field.split_once(',')?;
            QosDuration::of_texts(sec, nsec)
        };
        let (kind, depth) = history.split_once(',')?;
        let depth = match (kind, depth) {
            ("2", _) => None,
            (_, "") => Some(UNSAID_DEPTH),
            (_, depth) => Some(depth.parse().ok()?),
        };
        let parts: Vec<&str> = liveliness.split(',').collect();
        let &[kind, sec, nsec] = parts.as_slice() else { return None };
        Some(QosProfile {
            is_reliable: reliability != "2",
            is_transient_local: durability == "1",
            depth,
            deadline: duration(deadline)?,
            lifespan: duration(lifespan)?,
            is_manual: kind == "3",
            lease: QosDuration::of_texts(sec, nsec)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn publisher() -> EndpointEntity {
        let node = NodeEntity {
            domain: 0,
            session: "a1b2".into(),
            id: 3,
            name: "talker".into(),
            namespace: "/rover".into(),
        };
        EndpointEntity {
            id: 4,
            node,
            kind: EndpointKind::Publisher,
            topic: "/rover/chatter".into(),
            type_name: "std_msgs::msg::dds_::String_".into(),
            type_hash: HASH.into(),
            qos: QosProfile::default(),
        }
    }

    #[test]
    fn keys_and_signs_of_life_are_those_of_rmw_zenoh() {
        let publisher = publisher();
        assert_eq!(publisher.key(), format!("0/rover/chatter/std_msgs::msg::dds_::String_/{HASH}"));
        let sign = format!(
            "@ros2_lv/0/a1b2/3/4/MP/%/%rover/talker/%rover%chatter/std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
        );
        assert_eq!(publisher.to_string(), sign);
        assert_eq!(GraphEntity::of_sign(&sign), Some(GraphEntity::Endpoint(publisher.clone())));
        let node = NodeEntity { namespace: "/".into(), ..publisher.node };
        let sign = "@ros2_lv/0/a1b2/3/3/NN/%/%/talker";
        assert_eq!(
            (node.to_string().as_str(), GraphEntity::of_sign(sign)),
            (sign, Some(GraphEntity::Node(node)))
        );
    }

    #[test]
    fn malformed_signs_stand_for_nothing() {
        let sign = publisher().to_string();
        for end in 0..sign.len() {
            // Only a shorter depth or time is another well-formed text.
            if let Some(entity) = GraphEntity::of_sign(&sign[..end]) {
                panic!("{}: {entity:?}", &sign[..end]);
            }
        }
        for (part, other) in [("/0/", "/x/"), ("/MP/", "/XX/"), (":,10:", ":,ten:"), ("@ros2_lv", "@ros")] {
            assert_eq!(GraphEntity::of_sign(&sign.replacen(part, other, 1)), None, "{other}");
        }
        assert_eq!(GraphEntity::of_sign(&format!("{sign}/more")), None);
    }

    #[test]
    fn texts_of_quality_of_service_leave_out_defaults() {
        let seconds = |sec| QosDuration { sec, nsec: 0 };
        let profile = QosProfile::default();
        for (profile, text) in [
            (profile, "::,10:,:,:,,"),
            (QosProfile { depth: Some(UNSAID_DEPTH), ..profile }, "::,:,:,:,,"),
            (QosProfile { depth: None, ..profile }, "::2,:,:,:,,"),
            (QosProfile { is_reliable: false, is_transient_local: true, ..profile }, "2:1:,10:,:,:,,"),
            (QosProfile { deadline: seconds(1), lifespan: seconds(2), ..profile }, "::,10:1,0:2,0:,,"),
            (QosProfile { is_manual: true, lease: seconds(3), ..profile }, "::,10:,:,:3,3,0"),
        ] {
            assert_eq!((profile.to_string().as_str(), QosProfile::of_text(text)), (text, Some(profile)));
        }
        for text in ["", ":", "::,10:,:,:,,,", "::x:,:,:,,", "::,10:a,:,:,,", "::,10:,:,:,", "::,10:,:,"] {
            assert_eq!(QosProfile::of_text(text), None, "{text}");
        }
    }
}
