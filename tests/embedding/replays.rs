//! Replays in a loop of the embedder's: they wait for nothing, and end where they differ from the recording.

use std::time::{Duration, Instant};

use esl::engine::{Ending, Poll};
use esl::host::{RealHost, RecordingHost, ReplayHost};
use esl::{Config, Data, Engine, Error};

use super::{check, define_lag};

/// Polls that no replay of these tests needs.
const TOO_MANY: usize = 1_000_000;

/// Polls an engine until its run is over, with a pause after each poll.
fn drive(engine: &mut Engine, pause: Option<Duration>) -> Ending {
    for _ in 0..TOO_MANY {
        match engine.poll(Instant::now(), 1000) {
            Poll::Ended(ending) => return ending,
            Poll::Idle { .. } => assert!(pause.is_some(), "a replay has nothing to wait for"),
            Poll::Busy => {}
        }
        if let Some(pause) = pause {
            std::thread::sleep(pause);
        }
    }
    panic!("the run does not end")
}

const TEXT: &str = "(progn (sleep 0.003) (list (lag 3 1) (now) (wait-for-event scan)))";

fn prepare(engine: &mut Engine) {
    define_lag(engine);
    check(engine, "(define-input scan :capacity 1 :when-full :wait)", "SCAN");
}

/// Records a run in a loop that polls often while nothing has come. Returns the replay, its host, the value
/// and the canary of the run.
fn recorded() -> (Engine, ReplayHost, Data, u64) {
    let host = RecordingHost::new(RealHost::new(Vec::new()));
    let recording = host.recording();
    let mut engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    prepare(&mut engine);
    let answer = engine.begin(TEXT);
    let handle = engine.handle();
    let sender = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(10));
        handle.signal("scan", [7_i64.into()])
    });
    assert_eq!(drive(&mut engine, Some(Duration::from_micros(200))), Ending::Done);
    assert_eq!(sender.join().ok(), Some(Ok(())));
    let value = answer.take().expect("it has come").expect("it is a value");
    let host = ReplayHost::new(recording.to_records());
    let mut replay =
        Engine::with(Config::default(), Box::new(host.clone())).expect("there is room for the library");
    prepare(&mut replay);
    (replay, host, value, engine.canary())
}

#[test]
fn a_run_in_a_loop_is_replayed_without_waiting() {
    let (mut replay, host, value, canary) = recorded();
    let answer = replay.begin(TEXT);
    assert_eq!(drive(&mut replay, None), Ending::Done);
    assert_eq!(answer.wait(), Ok(value));
    assert_eq!((replay.canary(), host.divergence()), (canary, None));
}

#[test]
fn a_question_that_was_answered_before_it_is_asked_has_that_answer() {
    let (mut replay, _, value, _) = recorded();
    assert_eq!(drive(&mut replay, None), Ending::Done);
    assert_eq!(replay.begin(TEXT).wait(), Ok(value));
}

#[test]
fn questions_that_were_not_recorded_end() {
    let (mut replay, ..) = recorded();
    let handle = replay.handle();
    let other = std::thread::spawn(move || {
        let answers = [(); 3].map(|()| handle.call::<i64>("+", [1_i64.into()]));
        // There is room for the signals, since none of them comes.
        let signals = [(); 3].map(|()| handle.signal("scan", [1_i64.into()]));
        (answers.map(esl::engine::Reply::wait), signals)
    });
    while !other.is_finished() {
        drive(&mut replay, None);
        // A question without a record rings the bell.
        drop(replay.eval("(+ 1 2)"));
    }
    let (answers, signals) = other.join().expect("it does not panic");
    assert_eq!(answers[2], Err(Error::Ended));
    assert_eq!(signals, [Ok(()), Ok(()), Ok(())]);
}

#[test]
fn a_replay_with_other_calls_ends() {
    let (mut replay, host, ..) = recorded();
    // The recorded run has asked nothing of the host here.
    let evaluated = replay.eval("(sleep 3600)");
    assert!(matches!(evaluated, Err(Error::Stopped | Error::Aborted)), "{evaluated:?}");
    assert!(host.has_diverged());
    let answer = replay.begin(TEXT);
    assert_ne!(drive(&mut replay, None), Ending::Done);
    assert_eq!(answer.wait(), Err(Error::Ended));
}

#[test]
fn a_replay_that_is_paused_for_ever_ends() {
    let host = RecordingHost::new(RealHost::new(Vec::new()));
    let recording = host.recording();
    let mut engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    let handle = engine.handle();
    let asked = engine.begin("(sleep 0.001)");
    handle.pause();
    assert_eq!(engine.poll(Instant::now(), 1000), Poll::Idle { until: None });
    let host = ReplayHost::new(recording.to_records());
    let mut replay = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
    assert_ne!(drive(&mut replay, None), Ending::Done);
    drop((handle, asked));
}
