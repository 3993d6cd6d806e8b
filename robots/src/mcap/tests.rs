//! Tests of reading what is damaged, and of what is written.

use std::io::Cursor;

use esl_bytecode::Bytes;
use mcap::Compression;

use super::file::McapFile;
use super::noise;
use super::order::{McapSelection, OrderedMessages};
use super::output::{McapOutput, OutputChannel, OutputOptions};

/// Messages of a file of these tests, of which each has some hundred bytes.
const MESSAGES: u64 = 600;

fn channel(topic: &str) -> OutputChannel {
    let schema = Some(("Text".into(), "jsonschema".into(), Bytes::from_static(b"{}")));
    OutputChannel { topic: topic.into(), encoding: "json".into(), schema, metadata: Vec::new() }
}

/// Returns a file of messages at the times 0 to 599 ns, alternately under `/a` and `/b`.
fn written(options: &OutputOptions) -> Vec<u8> {
    written_with(options, MESSAGES, 100)
}

/// Returns a file of so many messages, whose texts have so many bytes, or up to six more.
fn written_with(options: &OutputOptions, messages: u64, bytes: usize) -> Vec<u8> {
    let output = McapOutput::in_memory(options).expect("the options are allowed");
    let channels = ["/a", "/b"].map(|topic| output.channel(channel(topic)).expect("there is room"));
    for time in 0..messages {
        let payload = format!("{{\"n\":{time},\"text\":\"{}\"}}", "x".repeat(bytes + (time % 7) as usize));
        output.write(channels[(time % 2) as usize], (time, time), None, Bytes::from(payload));
    }
    output.finish();
    output.take().to_vec()
}

fn options(compression: Option<Compression>, chunk_size: Option<u64>) -> OutputOptions {
    OutputOptions { compression, chunk_size, profile: "test".into() }
}

/// Returns the times of the messages that are read, and the texts about damage.
fn read(bytes: &[u8], selection: McapSelection) -> (Vec<u64>, Vec<String>) {
    let mut files = [McapFile::of(Cursor::new(bytes)).expect("it begins as a file of MCAP")];
    let mut messages = OrderedMessages::new(&files, selection);
    let mut times = Vec::new();
    while let Some(message) = messages.next(&mut files).expect("a vector is read") {
        let topic = ["/a", "/b"][(message.log_time % 2) as usize];
        assert_eq!(message.channel.topic, topic);
        assert!(message.data.starts_with(format!("{{\"n\":{},", message.log_time).as_bytes()));
        times.push(message.log_time);
    }
    assert!(times.is_sorted());
    (times, files[0].index.damage.iter().map(ToString::to_string).collect())
}

/// Returns the places of the chunks of a file, and their lengths with their heads.
fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    let file = McapFile::of(Cursor::new(bytes)).expect("it is a file of MCAP");
    let sections = file.index.sections.iter().filter(|section| section.is_chunk);
    sections.map(|section| (section.place as usize, (section.end - section.place) as usize)).collect()
}

#[test]
fn all_compressions_and_files_without_chunks_or_summary_are_read() {
    let all: Vec<u64> = (0..MESSAGES).collect();
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let bytes = written(&options(compression, Some(8192)));
        assert_eq!(read(&bytes, McapSelection::default()), (all.clone(), Vec::new()));
        let file = McapFile::of(Cursor::new(&bytes)).expect("it is a file of MCAP");
        assert!(file.index.is_indexed && file.index.sections.len() > 5);
        let summary = file.index.counts.clone();
        // Without its last bytes, the file is read from its beginning, with the same figures.
        let cut = &bytes[..bytes.len() - 8];
        let scanned = McapFile::of(Cursor::new(cut)).expect("it is a file of MCAP");
        assert!(!scanned.index.is_indexed);
        assert_eq!((scanned.index.counts, scanned.index.times), (summary, file.index.times));
        assert_eq!(read(cut, McapSelection::default()), (all.clone(), Vec::new()));
    }
    let bytes = written(&options(None, None));
    assert_eq!(read(&bytes, McapSelection::default()), (all, Vec::new()));
}

#[test]
fn a_selection_is_by_topic_and_time() {
    let bytes = written(&options(Some(Compression::Zstd), Some(4096)));
    let topics = Some(["/b".to_owned()].into());
    let selection = McapSelection { topics, start: 100, end: Some(110) };
    assert_eq!(read(&bytes, selection).0, [101, 103, 105, 107, 109]);
}

#[test]
fn messages_that_were_written_in_disorder_come_in_order() {
    let output = McapOutput::in_memory(&options(None, Some(2000))).expect("the options are allowed");
    let channels = ["/a", "/b"].map(|topic| output.channel(channel(topic)).expect("there is room"));
    // Two rows of times that go on at the same time, one of them backwards.
    for time in (0..100_u64).flat_map(|n| [n, 199 - n]) {
        let payload = format!("{{\"n\":{time},\"text\":\"{}\"}}", "x".repeat(100));
        output.write(channels[(time % 2) as usize], (time, time), None, Bytes::from(payload));
    }
    output.finish();
    let bytes = output.take();
    assert_eq!(read(&bytes, McapSelection::default()).0, (0..200).collect::<Vec<u64>>());
}

#[test]
fn a_broken_chunk_in_the_middle_is_told_and_passed_over() {
    let bytes = written(&options(Some(Compression::Lz4), Some(8192)));
    let (place, length) = chunks(&bytes)[2];
    for cut in [0, 8] {
        let mut broken = bytes[..bytes.len() - cut].to_vec();
        broken[place + length / 2] ^= 0xff;
        let (times, damage) = read(&broken, McapSelection::default());
        let lost = MESSAGES as usize - times.len();
        assert!(times.contains(&0) && times.contains(&(MESSAGES - 1)) && lost > 10, "{lost} are lost");
        let [text] = &damage[..] else { panic!("{damage:?}") };
        assert!(text.starts_with(&format!("chunk at byte {place}: ")), "{text}");
        assert!(text.ends_with(&format!(", {lost} messages lost")), "{text}");
    }
    // A checksum alone is wrong.
    let plain = written(&options(None, Some(8192)));
    let (place, _) = chunks(&plain)[1];
    let mut broken = plain.clone();
    let text = broken[place..].windows(5).position(|part| part == b"xxxxx").expect("it has a message");
    broken[place + text] = b'y';
    let (times, damage) = read(&broken, McapSelection::default());
    assert!(times.len() > 400 && damage.len() == 1, "{damage:?}");
    assert!(damage[0].contains(": CRC ") && damage[0].contains(" skipped, "), "{damage:?}");
}

#[test]
fn a_file_is_read_up_to_the_chunk_within_which_it_ends() {
    let bytes = written(&options(Some(Compression::Zstd), Some(8192)));
    let all = chunks(&bytes);
    let (place, length) = all[4];
    let (times, damage) = read(&bytes[..place + length / 2], McapSelection::default());
    assert!(times.len() > 100 && times.last() == Some(&(times.len() as u64 - 1)));
    let needed = format!("the file ends within the chunk, of whose {length} bytes it has {}", length / 2);
    assert_eq!(damage, [format!("chunk at byte {place}: {needed}, its messages are lost")]);
    // It ends between two records.
    let (_, damage) = read(&bytes[..place], McapSelection::default());
    let text = "the file ends here, without a summary: its writer did not close it";
    assert_eq!(damage, [format!("byte {place}: {text}")]);
}

#[test]
fn behind_bytes_that_are_no_record_reading_goes_on() {
    for chunk_size in [Some(8192), None] {
        // Messages of a chunk without compression would be found.
        let bytes = written(&options(chunk_size.map(|_| Compression::Lz4), chunk_size));
        let place = match chunk_size {
            Some(_) => chunks(&bytes)[2].0,
            None => bytes.windows(9).position(|part| part == b"{\"n\":200,").expect("it is there") - 31,
        };
        // The length of a record is wrong, so its end is not where it seems to be.
        let mut broken = bytes[..bytes.len() - 8].to_vec();
        broken[place + 4] = 0x7f;
        let (times, damage) = read(&broken, McapSelection::default());
        assert!(times.contains(&0) && times.contains(&(MESSAGES - 1)), "{}", times.len());
        assert!(times.len() < MESSAGES as usize && times.len() > 500, "{}", times.len());
        let [text] = &damage[..] else { panic!("{damage:?}") };
        assert!(text.starts_with(&format!("byte {place}: no record up to byte ")), "{text}");
    }
}

#[test]
fn what_is_not_of_mcap_is_named() {
    let fault = |bytes: &[u8]| McapFile::of(Cursor::new(bytes.to_vec())).err().map(|fault| fault.to_string());
    let expected = |is: &str| Some(format!("not an MCAP file: {is}"));
    assert_eq!(fault(b""), expected("it is empty"));
    assert_eq!(fault(b"\x89MC"), expected("it ends within its first bytes"));
    assert_eq!(fault(b"hello, world"), expected("it begins with \"hello, w\""));
    assert!(fault(b"SQLite format 3\0").is_some_and(|text| text.contains("ros2 bag convert")));
}

#[test]
fn no_bytes_harm_a_reader() {
    // Most are small: a change of a byte meets a record more often, and more of them are read in a second.
    let small = |options: &OutputOptions| written_with(options, 12, 10);
    let files = [
        written(&options(Some(Compression::Zstd), Some(2048))),
        written(&options(Some(Compression::Lz4), Some(2048))),
        written(&options(None, None)),
    ];
    let small_files = [
        small(&options(Some(Compression::Zstd), Some(200))),
        small(&options(Some(Compression::Lz4), Some(200))),
        small(&options(None, Some(200))),
        small(&options(None, None)),
    ];
    // A generator of numbers, so that a finding can be repeated.
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    // ESL_NOISE is for longer runs by hand.
    let rounds = std::env::var("ESL_NOISE").ok().and_then(|text| text.parse().ok()).unwrap_or(1500);
    for round in 0..rounds {
        let mut bytes = match round % 100 {
            0 => files[random(files.len())].clone(),
            _ => small_files[random(small_files.len())].clone(),
        };
        for _ in 0..=random(6) {
            let place = random(bytes.len());
            bytes[place] = random(256) as u8;
        }
        bytes.truncate(bytes.len() - random(bytes.len() / 2));
        noise::understand(&bytes);
    }
}
