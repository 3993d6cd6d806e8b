use super::*;
use crate::{RecordingHost, VirtualHost};

/// A stand-in for a program: describes what it learns from `host`.
fn run(host: &mut dyn Host) -> String {
    let mut log = format!("{} {:?} ", host.seed(), host.arguments());
    log += &format!("{:?} {} ", host.wait(Some(30), Awaited::default()), host.monotonic());
    log += &format!("{:?} {:?} ", host.read_input(), host.read_file("f"));
    log += &format!("{:?} {}", host.write(Output::Standard, b"hello"), host.file_exists("g"));
    log
}

#[test]
fn a_replay_gives_the_recorded_answers() {
    let host = VirtualHost::new().with_seed(7).with_input("in").with_file("f", "1").with_output_limit(2);
    let mut recording_host = RecordingHost::new(host.with_arguments(vec!["x".into()]));
    let recording = recording_host.recording();
    let first = run(&mut recording_host);
    let mut replay = ReplayHost::new(recording.to_records());
    assert_eq!(run(&mut replay), first);
    assert!(replay.is_at_end() && !replay.has_diverged());
    assert_eq!(replay.captured().output(), "hello");
}

#[test]
fn what_came_comes_again_in_the_same_round_and_at_the_same_question() {
    let host = VirtualHost::new().with_arrival(0, Incoming::Stop).with_arrival(20, Incoming::Input);
    let mut recording_host = RecordingHost::new(host);
    let recording = recording_host.recording();
    let rounds = |host: &mut dyn Host| {
        let look = |host: &mut dyn Host, round| {
            if host.inbox().is_rung() { host.poll(round) } else { Vec::new() }
        };
        let mut log = String::new();
        for round in 1..5 {
            log += &format!("{:?} {:?}; ", look(host, round), host.due(15));
            host.advance(10);
        }
        log
    };
    let first = rounds(&mut recording_host);
    assert_eq!(first, "[Stop] None; [] None; [Input] Some(20); [] Some(30); ");
    assert_eq!(recording.to_records().len(), 4);
    let mut replay = ReplayHost::new(recording.to_records());
    assert_eq!(rounds(&mut replay), first);
    assert!(replay.is_at_end() && !replay.has_diverged());
}

#[test]
fn another_question_is_a_divergence() {
    let mut replay = ReplayHost::new([Record::Seed(3), Record::Monotonic(9)].map(plain));
    assert_eq!(replay.seed(), 3);
    assert_eq!(replay.wall_clock(), 0);
    assert!(replay.has_diverged());
    assert_eq!(replay.monotonic(), 0);
    let divergence = replay.divergence().expect("it has diverged").to_string();
    assert!(divergence.contains("record 2: the program asks the time of day; recorded is the time"));
}

fn plain(record: Record) -> NotedRecord {
    NotedRecord { question: QuestionHash::default(), record }
}

#[test]
fn other_arguments_and_another_course_are_divergences() {
    let mut recording_host = RecordingHost::new(VirtualHost::new());
    let recording = recording_host.recording();
    assert!(!recording_host.file_exists("a"));
    let check = RunCheck { round: 5000, ticks: 7, canary: 1 };
    recording_host.check(check);
    let replay = || ReplayHost::new(recording.to_records());
    let mut other = replay();
    other.file_exists("b");
    let text = other.divergence().expect("it has diverged").to_string();
    assert!(text.contains("whether there is `b`") && text.contains("other arguments"), "{text}");
    let mut other = replay();
    other.file_exists("a");
    other.check(RunCheck { round: 4096, ..check });
    other.check(RunCheck { canary: 2, ..check });
    assert!(other.has_diverged());
    let mut equal = replay();
    equal.file_exists("a");
    equal.check(check);
    assert!(equal.is_at_end() && !equal.has_diverged() && equal.checks() == (1, Some(check)));
    assert_eq!(equal.wait(None, Awaited::default()), Wake::Never);
    assert_eq!(equal.asked_at_end().as_deref(), Some("to wait"));
    assert_eq!(equal.poll(9).len(), 2, "the machine comes back");
}
