//! Tests of definitions, payloads and frames, held against the crate mavlink, whose types are generated from
//! the same definitions.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, IntoDatum};
use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message};

use super::definitions::{Dialect, keyword};
use super::frame::{FrameOrigin, StreamPart, first_frame, frame, scan};
use super::payload::{command_of, decode, encode, message_of, padded};

fn list<const N: usize>(items: [Datum; N]) -> Datum {
    Datum::list(items, Span::default())
}

fn encoded(name: &str, fields: Datum) -> Result<String, HostFailure> {
    let message = message_of(&keyword(name))?;
    Ok(decode(message, &encode(message, &fields, (0, 0))?).to_string())
}

/// Returns cause, text and path of a failure.
fn fault(name: &str, fields: Datum) -> String {
    let failure = encoded(name, fields).expect_err("it is wrong");
    format!(
        "{} {}",
        failure.cause,
        failure.arguments.iter().map(Datum::to_string).collect::<Vec<_>>().join(" ")
    )
}

#[test]
fn messages_are_those_of_the_crate() {
    let mut known = 0;
    for number in 0..70_000 {
        let Some(theirs) = MavMessage::default_message_from_id(number) else {
            assert!(Dialect::get().message(number).is_none(), "{number}");
            continue;
        };
        let ours = Dialect::get().message(number).expect("it is defined");
        assert_eq!(ours.name, theirs.message_name());
        assert_eq!(ours.extra_crc, MavMessage::extra_crc(number), "{}", ours.name);
        let mut bytes = [0; 300];
        assert_eq!(theirs.ser(MavlinkVersion::V1, &mut bytes), ours.base_length, "{}", ours.name);
        // Their fields are at the same places.
        let payload = padded(&bytes[..ours.base_length]);
        let again = encode(ours, &decode(ours, &payload), (0, 0)).expect("it is right");
        assert_eq!(again[..ours.length], payload[..ours.length], "{}", ours.name);
        known += 1;
    }
    assert!(known > 300, "{known}");
}

#[test]
fn frames_are_those_of_the_crate() {
    let message = message_of(&keyword("COMMAND-LONG")).expect("it is defined");
    let fields = list([keyword("COMMAND"), keyword("NAV-TAKEOFF"), keyword("PARAM7"), 10_i64.into_datum()]);
    let payload = encode(message, &fields, (1, 1)).expect("it is right");
    let origin = FrameOrigin { system: 255, component: 190, sequence: 3 };
    for (bytes, version) in [
        (frame(message, &payload, origin, false), MavlinkVersion::V2),
        (first_frame(message, &payload, origin).expect("it is in version 1"), MavlinkVersion::V1),
    ] {
        let mut reader = mavlink::MavlinkReader::new(&bytes[..]);
        let (header, read) = reader.read_any_message::<MavMessage>().expect("it is a frame");
        assert_eq!((header.system_id, header.component_id, header.sequence), (255, 190, 3));
        assert_eq!(read.message_name(), "COMMAND_LONG");
        let mut found = Vec::new();
        let done = scan(&bytes, true, |part| {
            if let StreamPart::Frame(frame) = part {
                let theirs = MavMessage::parse(version, frame.message.number, frame.payload);
                found.push((frame.system, frame.component, frame.sequence, format!("{theirs:?}")));
            }
        });
        assert_eq!((done, found.len()), (bytes.len(), 1));
        assert_eq!((found[0].0, found[0].1, found[0].2), (255, 190, 3));
        assert!(
            found[0].3.contains("param7: 10.0") && found[0].3.contains("MAV_CMD_NAV_TAKEOFF"),
            "{}",
            found[0].3
        );
    }
}

#[test]
fn values_of_enumerations_are_keywords_and_others_numbers() {
    let heartbeat = |fields| encoded("HEARTBEAT", fields).expect("it is right");
    let fields = list([
        keyword("TYPE"),
        keyword("QUADROTOR"),
        keyword("AUTOPILOT"),
        200_i64.into_datum(),
        keyword("BASE-MODE"),
        list([keyword("SAFETY-ARMED"), keyword("MAV-MODE-FLAG-CUSTOM-MODE-ENABLED")]),
    ]);
    assert_eq!(
        heartbeat(fields),
        "(:TYPE :QUADROTOR :AUTOPILOT 200 :BASE-MODE (:SAFETY-ARMED :CUSTOM-MODE-ENABLED) :CUSTOM-MODE 0 \
         :SYSTEM-STATUS :UNINIT :MAVLINK-VERSION 3)"
    );
    assert!(encoded("COMMAND-ACK", list([keyword("COMMAND"), 60_000_i64.into_datum()])).is_ok());
}

#[test]
fn faults_name_the_path() {
    assert_eq!(
        fault("HEARTBEAT", list([keyword("TYP"), 1_i64.into_datum()])),
        "INVALID-FIELD \"`:typ` of :heartbeat: there is no such field; did you mean `:type`?\" \":typ\""
    );
    let fields = list([keyword("TYPE"), keyword("QUADROTER")]);
    assert!(fault("HEARTBEAT", fields).contains("did you mean `:quadrotor`?"));
    let fields = list([keyword("CUSTOM-MODE"), (-1_i64).into_datum()]);
    assert!(
        fault("HEARTBEAT", fields).contains("expected uint32_t, an integer from 0 to 4294967295, got -1")
    );
    let fields = list([keyword("Q"), list([1.5.into_datum(), "x".into_datum()])]);
    assert!(fault("ATTITUDE-TARGET", fields).ends_with("\":q 1\""));
    let fields = list([keyword("TEXT"), "x".repeat(51).into_datum()]);
    assert!(fault("STATUSTEXT", fields).contains("expected at most 50 bytes, got 51"));
    assert!(fault("STATUSTEXT", list([keyword("TEXT")])).contains("expected keywords and values"));
    let failure = message_of(&keyword("HARTBEAT")).expect_err("it is not defined");
    assert!(failure.arguments[0].to_string().contains("did you mean `:heartbeat`?"));
}

#[test]
fn parameters_of_commands_have_names_and_defaults() {
    let command = |name: &str, parameters| command_of(&keyword(name), &parameters);
    let parameters =
        list([keyword("ALTITUDE"), 10_i64.into_datum(), keyword("YAW"), Datum::nil(Span::default())]);
    let (number, values) = command("NAV-TAKEOFF", parameters).expect("it is right");
    assert!(number == 22 && values[6] == 10.0 && values[3].is_nan() && values[0] == 0.0);
    let failure =
        command("NAV-TAKEOFF", list([keyword("ALTTUDE"), 1_i64.into_datum()])).expect_err("it is wrong");
    assert!(failure.arguments[0].to_string().contains(":altitude"), "{}", failure.arguments[0]);
    assert!(command("NAV-TAKEOF", Datum::nil(Span::default())).is_err());
    assert!(command_of(&31_010_i64.into_datum(), &list([keyword("PARAM7"), 2.5.into_datum()])).is_ok());
}

#[test]
fn frames_are_found_between_other_bytes() {
    let message = message_of(&keyword("PING")).expect("it is defined");
    let payload = encode(message, &list([keyword("SEQ"), 7_i64.into_datum()]), (0, 0)).expect("it is right");
    let good = frame(message, &payload, FrameOrigin { system: 1, component: 1, sequence: 0 }, false);
    let mut bad = good.clone();
    let last = bad.len() - 1;
    bad[last] ^= 1;
    let bytes = [b"boot\r\n\xfd".as_slice(), &good, &bad, &good, &good[..9]].concat();
    let parts = |bytes: &[u8], whole| {
        let (mut frames, mut garbage, mut malformed) = (0, 0, 0);
        let done = scan(bytes, whole, |part| match part {
            StreamPart::Frame(_) => frames += 1,
            StreamPart::Garbage(count) => garbage += count,
            StreamPart::Malformed => malformed += 1,
            StreamPart::Unknown(_) => {}
        });
        (frames, garbage > 0, malformed > 0, bytes.len() - done)
    };
    assert_eq!(parts(&bytes, false), (2, true, true, 9), "the beginning of a frame is kept");
    assert_eq!(parts(&bytes, true), (2, true, true, 0), "nothing follows a datagram");
    for length in 0..good.len() {
        assert_eq!(parts(&good[..length], false), (0, false, false, length));
    }
}

/// A sequence of numbers from a seed.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % below as u64).expect("it is small")
    }
}

#[test]
fn any_bytes_are_taken_and_every_message_is_the_same_when_written_again() {
    let known: Vec<u32> = (0..70_000).filter(|&number| Dialect::get().message(number).is_some()).collect();
    // ESL_NOISE is for longer runs by hand.
    let count = std::env::var("ESL_NOISE").ok().and_then(|count| count.parse().ok()).unwrap_or(5_000);
    let mut numbers = Numbers(0x9e37_79b9_7f4a_7c15);
    let (mut frames, mut bytes) = (0, Vec::new());
    for _ in 0..count {
        let message = Dialect::get().message(known[numbers.next(known.len())]).expect("it is defined");
        let payload: Vec<u8> = (0..message.length).map(|_| numbers.next(256) as u8).collect();
        let origin = FrameOrigin { system: 1, component: 1, sequence: 0 };
        bytes.extend(frame(message, &payload, origin, numbers.next(8) == 0));
        match numbers.next(4) {
            0 => {
                let place = numbers.next(bytes.len());
                bytes[place] ^= 1 << numbers.next(8);
            }
            1 => bytes.truncate(numbers.next(bytes.len())),
            _ => {}
        }
        if bytes.len() > 1500 || numbers.next(3) == 0 {
            frames += super::noise::feed(&bytes);
            bytes.clear();
        }
    }
    assert!(frames > count / 2, "{frames}");
}
