//! Quality of service: from the property list of a program to the profile on the wire, and whether two of
//! them fit.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{FromArgument, HostFailure};

use super::wire::{QosDuration, QosProfile};

/// A profile, as an argument: a property list with `:RELIABILITY`, `:DURABILITY`, `:HISTORY`, `:DEPTH`,
/// `:DEADLINE`,
/// `:LIFESPAN`, `:LIVELINESS` and `:LEASE`.
#[derive(Clone, Copy, Debug)]
pub(super) struct QosArgument(pub(super) QosProfile);

fn qos_failure(name: &str, value: &Datum, expected: &str) -> HostFailure {
    let reason =
        format!("invalid quality of service: {} is {value}, expected {expected}", name.to_lowercase());
    HostFailure::new("INVALID-QOS", reason)
}

fn duration(name: &str, value: &Datum) -> Result<QosDuration, HostFailure> {
    if value.is_nil() {
        return Ok(QosDuration::INFINITE);
    }
    let seconds = match value.kind() {
        DatumKind::Ratio(..) => None,
        _ => f64::from_argument(value).ok(),
    };
    let seconds = seconds.filter(|seconds| (0.0..9e9).contains(seconds));
    let seconds = seconds.ok_or_else(|| qos_failure(name, value, "seconds from 0"))?;
    Ok(QosDuration { sec: seconds as u64, nsec: (seconds.fract() * 1e9) as u64 })
}

impl FromArgument for QosArgument {
    const TYPE: &'static str = "LIST";

    fn from_argument(datum: &Datum) -> Result<QosArgument, HostFailure> {
        let mut profile = QosProfile::default();
        let (mut keeps_all, mut depth) = (false, 10);
        let items = datum.as_list().ok_or_else(|| HostFailure::of_type(datum, Self::TYPE))?;
        for pair in items.chunks(2) {
            let &[name, value] = pair else { return Err(HostFailure::of_type(datum, Self::TYPE)) };
            let name = name.as_symbol().map(|name| name.name()).unwrap_or_default();
            let word = value.as_symbol().map(|word| word.name()).unwrap_or_default();
            match (name, word) {
                ("RELIABILITY", "RELIABLE") => profile.is_reliable = true,
                ("RELIABILITY", "BEST-EFFORT") => profile.is_reliable = false,
                ("RELIABILITY", _) => return Err(qos_failure(name, value, ":reliable or :best-effort")),
                ("DURABILITY", "VOLATILE") => profile.is_transient_local = false,
                ("DURABILITY", "TRANSIENT-LOCAL") => profile.is_transient_local = true,
                ("DURABILITY", _) => return Err(qos_failure(name, value, ":volatile or :transient-local")),
                ("HISTORY", "KEEP-LAST") => keeps_all = false,
                ("HISTORY", "KEEP-ALL") => keeps_all = true,
                ("HISTORY", _) => return Err(qos_failure(name, value, ":keep-last or :keep-all")),
                ("DEPTH", _) => {
                    let found =
                        usize::from_argument(value).ok().filter(|&depth| (1..=100_000).contains(&depth));
                    depth = found.ok_or_else(|| qos_failure(name, value, "an integer from 1 to 100000"))?;
                }
                ("DEADLINE", _) => profile.deadline = duration(name, value)?,
                ("LIFESPAN", _) => profile.lifespan = duration(name, value)?,
                ("LIVELINESS", "AUTOMATIC") => profile.is_manual = false,
                ("LIVELINESS", "MANUAL-BY-TOPIC") => profile.is_manual = true,
                ("LIVELINESS", _) => return Err(qos_failure(name, value, ":automatic or :manual-by-topic")),
                ("LEASE", _) => profile.lease = duration(name, value)?,
                _ => {
                    let reason = format!(
                        "unknown quality of service `{}`: expected :reliability, :durability, :history, :depth, \
                         :deadline, :lifespan, :liveliness or :lease",
                        name.to_lowercase()
                    );
                    return Err(HostFailure::new("INVALID-QOS", reason));
                }
            }
        }
        profile.depth = Some(depth).filter(|_| !keeps_all);
        Ok(QosArgument(profile))
    }
}

/// Returns the reason why a publisher with the profile `offered` and a subscription with `requested` do not
/// fit by the rules of DDS, if they do not.
pub(super) fn misfit(offered: &QosProfile, requested: &QosProfile) -> Option<String> {
    if !offered.is_reliable && requested.is_reliable {
        Some("the publisher is best-effort, and the subscription asks for reliable".into())
    } else if !offered.is_transient_local && requested.is_transient_local {
        Some("the publisher is volatile, and the subscription asks for transient-local".into())
    } else if offered.deadline > requested.deadline {
        Some("the publisher's deadline is longer than the one that the subscription asks for".into())
    } else if !offered.is_manual && requested.is_manual {
        Some("the publisher's liveliness is automatic, and the subscription asks for manual-by-topic".into())
    } else if offered.lease > requested.lease {
        Some("the publisher's lease is longer than the one that the subscription asks for".into())
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_host::{IntoDatum, Keyword};

    fn keyword(name: &'static str) -> Datum {
        Keyword(name).into_datum()
    }

    fn profile(items: Vec<Datum>) -> Result<QosProfile, String> {
        let profile = QosArgument::from_argument(&items.into_datum());
        profile.map(|QosArgument(profile)| profile).map_err(|failure| failure.arguments[0].to_string())
    }

    #[test]
    fn profiles_have_the_texts_of_rmw_zenoh() {
        let text = |items| profile(items).map(|profile| profile.to_string());
        assert_eq!(text(Vec::new()), Ok("::,10:,:,:,,".into()));
        let items =
            vec![keyword("RELIABILITY"), keyword("BEST-EFFORT"), keyword("DEPTH"), 5_i64.into_datum()];
        assert_eq!(text(items), Ok("2::,5:,:,:,,".into()));
        let items =
            vec![keyword("DURABILITY"), keyword("TRANSIENT-LOCAL"), keyword("DEADLINE"), 0.5.into_datum()];
        assert_eq!(text(items), Ok(":1:,10:0,500000000:,:,,".into()));
        assert_eq!(text(vec![keyword("HISTORY"), keyword("KEEP-ALL")]), Ok("::2,:,:,:,,".into()));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let reason = |items| profile(items).expect_err("it is wrong");
        assert!(reason(vec![keyword("DEPTH"), 0_i64.into_datum()]).contains("depth is 0"));
        assert!(reason(vec![keyword("RELIABILITY"), keyword("SURE")]).contains(":reliable or :best-effort"));
        assert!(
            reason(vec![keyword("DEPHT"), 1_i64.into_datum()]).contains("unknown quality of service `depht`")
        );
        assert!(reason(vec![keyword("LEASE"), (-1_i64).into_datum()]).contains("seconds from 0"));
    }

    #[test]
    fn a_publisher_offers_what_a_subscription_asks_for() {
        let of = |items| profile(items).expect("it is right");
        let (plain, best_effort) = (of(Vec::new()), of(vec![keyword("RELIABILITY"), keyword("BEST-EFFORT")]));
        assert_eq!((misfit(&plain, &plain), misfit(&plain, &best_effort)), (None, None));
        assert!(misfit(&best_effort, &plain).is_some_and(|text| text.contains("reliable")));
        let deadline = of(vec![keyword("DEADLINE"), 0.1.into_datum()]);
        assert_eq!(misfit(&deadline, &plain), None);
        assert!(misfit(&plain, &deadline).is_some_and(|text| text.contains("deadline")));
    }
}
