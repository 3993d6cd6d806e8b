//! The topic `/clock`: the time of a simulator, or of a recording that is played, which the machine goes by
//! under `--clock ros`.
//!
//! A callback of Zenoh tells the time to the machine's host; the program hears only of its beginning and of
//! steps back.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use esl_host::{ClockStep, HostFailure, HostInput, Inbox, IntoDatum, Keyword};
use zenoh::Wait;
use zenoh::sample::Sample;

use super::attachment::MessageAttachment;
use super::node::RosNode;
use super::topic::{Malformed, topic};
use super::wire::{EndpointKind, QosProfile};
use crate::message::{MessageType, decode};
use crate::zenoh::delivery::InputDelivery;
use crate::zenoh::entity::DeclaredEntity;
use crate::zenoh::zenoh_failure;

/// Name of the topic.
const CLOCK: &str = "/clock";
/// The time without a message after which the program hears of it.
const PATIENCE: Duration = Duration::from_secs(5);

/// Returns the nanoseconds in a payload of type `rosgraph_msgs/msg/Clock`, which is well-formed.
fn nanoseconds(payload: &[u8]) -> Option<i64> {
    let (header, rest) = payload.split_first_chunk::<4>()?;
    let (seconds, rest) = rest.split_first_chunk::<4>()?;
    let (nanoseconds, _) = rest.split_first_chunk::<4>()?;
    let (seconds, nanoseconds) = match header[1] & 1 {
        0 => (i32::from_be_bytes(*seconds), u32::from_be_bytes(*nanoseconds)),
        _ => (i32::from_le_bytes(*seconds), u32::from_le_bytes(*nanoseconds)),
    };
    Some(i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds))
}

/// Has the host of `inbox` go by the topic. The input is signalled with `:begun`; with `:back` and the
/// seconds by which time goes back; with `:silent`, if there is no time for some seconds at the beginning.
pub(super) async fn follow(
    node: &RosNode,
    inbox: Inbox,
    input: HostInput,
    of_type: Arc<MessageType>,
    qos: QosProfile,
) -> Result<DeclaredEntity, HostFailure> {
    let mut endpoint = node.endpoint(EndpointKind::Subscription, topic(CLOCK.into(), &of_type), qos);
    let delivery = InputDelivery::begin(input)?;
    let has_begun = Arc::new(AtomicBool::new(false));
    let malformed = Malformed::new(node.events().clone(), CLOCK.into());
    let deliver = {
        let (delivery, has_begun) = (delivery.clone(), has_begun.clone());
        move |sample: Sample| {
            let payload = sample.payload().to_bytes();
            if let Err(fault) = decode(&of_type, &payload) {
                let attachment = sample.attachment();
                let attachment = attachment.and_then(|bytes| MessageAttachment::decode(&bytes.to_bytes()));
                return malformed.note(attachment.map(|attachment| attachment.gid), &fault.to_string());
            }
            let Some(time) = nanoseconds(&payload) else { return };
            let step = inbox.set_time(time);
            if !has_begun.swap(true, Ordering::Relaxed) {
                delivery.put(0, || vec![Keyword("BEGUN").into_datum()]);
            }
            if let ClockStep::Back(nanoseconds) = step {
                let seconds = nanoseconds as f64 / 1e9;
                delivery.put(0, || vec![Keyword("BACK").into_datum(), seconds.into_datum()]);
            }
        }
    };
    let key = endpoint.key.clone();
    let declare = move |session: &zenoh::Session| session.declare_subscriber(key).callback(deliver).wait();
    let subscriber = node.session().call(declare).await?;
    endpoint.announce(node.session()).await?;
    let watched = Arc::downgrade(&delivery);
    let watch = async move {
        tokio::time::sleep(PATIENCE).await;
        if let Some(delivery) = watched.upgrade()
            && !has_begun.load(Ordering::Relaxed)
        {
            delivery.put(0, || vec![Keyword("SILENT").into_datum(), PATIENCE.as_secs_f64().into_datum()]);
        }
    };
    esl_world::spawn(watch).map_err(zenoh_failure)?;
    Ok(DeclaredEntity::new((subscriber, endpoint), Some(delivery)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_in_a_payload_is_in_its_byte_order() {
        let payload =
            |id: u8, seconds: [u8; 4], nanoseconds: [u8; 4]| [[0, id, 0, 0], seconds, nanoseconds].concat();
        let little = payload(1, 1_700_000_000_i32.to_le_bytes(), 123_456_789_u32.to_le_bytes());
        assert_eq!(nanoseconds(&little), Some(1_700_000_000_123_456_789));
        assert_eq!(nanoseconds(&little[..11]), None);
        let big = payload(0, (-1_i32).to_be_bytes(), 7_u32.to_be_bytes());
        assert_eq!(nanoseconds(&big), Some(-999_999_993));
    }
}
