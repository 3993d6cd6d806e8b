//! Attacks on recordings: truncated and changed files, changed answers, and places reached on every path.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use esl::program::{Ended, Source, compile};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{Symbol, USER_PACKAGE};
use esl_host::{
    FileAnswer, FunctionRef, HostError, HostFailure, Incoming, Input, News, NotedRecord, Permit,
    ProcessSignal, Question, QuestionHash, RealHost, Record, Rights, RunCheck, VirtualHost, Wake,
};
use proptest::prelude::*;

use super::breakpoint::Target;
use super::debugger::Debugger;
use super::file::{beginning_bytes, end_bytes};
use super::journal::JournalWriter;
use super::pack::{ByteReader, ByteWriter};
use super::*;

/// A program that shows all that it learns.
const CURIOUS: &str = r#"
(defvar *n* 0)
(defun work (n) (dotimes (i n) (incf *n*)))
(assert '(door north open))
(let ((tasks (loop for i below 3 collect
               (let ((i i))
                 (spawn (:name (intern (format nil "T~a" i)))
                   (dotimes (j 3)
                     (sleep (* 0.001 (1+ i)))
                     (work 700)
                     (assert (list 'done i j))))))))
  (dolist (task tasks) (wait-for-task task)))
(retract '(door north open))
(with-recovery-procedures ((:odd (abort 'recovered)))
  (fail :odd 1))
(format t "~a ~a ~a~%" (now) (get-universal-time) (get-internal-real-time))
(format t "~a~%" (probe-file "no-such-file"))
"#;

/// A file of its own for a test, removed in the end.
struct TestFile(PathBuf);

impl TestFile {
    fn new() -> TestFile {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        TestFile(std::env::temp_dir().join(format!("esl-recorded-{}-{number}.eslj", std::process::id())))
    }
}

impl Drop for TestFile {
    fn drop(&mut self) {
        // One that is not there need not be removed.
        drop(std::fs::remove_file(&self.0));
    }
}

fn program(text: &str) -> Program {
    compile(&[Source::new("test.esl", text)]).program.expect("it compiles")
}

/// Records the run of a program under the real clock. Returns the bytes of the file.
fn recorded_bytes(text: &str) -> Vec<u8> {
    let file = TestFile::new();
    let host = RealHost::new(Vec::new()).with_rights(Rights::all()).with_screen(Box::new(|_| Ok(())));
    record(&program(text), &RunSetup::default(), host, &file.0, |_| ()).expect("it can be recorded");
    std::fs::read(&file.0).expect("the file is there")
}

fn read(bytes: &[u8]) -> Recorded {
    Recorded::read(bytes).expect("it is a recording")
}

fn rerun(recorded: &Recorded) -> Replayed {
    let mut rerun = Rerun::begin(recorded, |_, _| ()).expect("it can be begun");
    rerun.run(u64::MAX).expect("it ends").clone()
}

fn beginning() -> Beginning {
    Beginning {
        schedule: None,
        program: vec![7; 5000],
        config: Config { budget: Some(9), stack: Some(1 << 20), ..Config::DEFAULT },
        traces: vec!["tasks".into()],
        folders: vec![".".into()],
        program_file: vec!["main.esl".into(), "/main.esl".into()],
        functions: vec![GivenFunction { name: "F".into(), is_operation: true, needs: Vec::new() }],
        has_operators: true,
        kept: Some("5\n(:fact (A))\n".into()),
        identity: ExecutionIdentity::current().to_string(),
    }
}

/// Data of every kind, with a shared part.
fn data() -> Vec<Datum> {
    let datum = |kind| Datum::new(kind, Span::default());
    let text = datum(DatumKind::String("ä\"".into()));
    let numbers = [
        datum(DatumKind::Integer(num_bigint::BigInt::from(-3).pow(99).into())),
        datum(DatumKind::Ratio((-1).into(), 3.into())),
        datum(DatumKind::Float(-0.5)),
        datum(DatumKind::Character('λ')),
    ];
    let packed = [
        PackedVector::Bytes((0..=255).collect::<Vec<u8>>().into()),
        PackedVector::Integers([i64::MIN, 0, i64::MAX].into()),
        PackedVector::Floats([-0.0, f64::INFINITY, 1e300].into()),
    ];
    let packed = packed.map(|vector| datum(DatumKind::Packed(vector)));
    let vector = datum(DatumKind::Vector(vec![text.clone(), text.clone()].into()));
    let table = datum(DatumKind::Table(vec![text.clone(), numbers[0].clone()].into()));
    let array = datum(DatumKind::Array(vec![1, 2].into(), numbers[..2].to_vec().into()));
    let symbols = [Symbol::new(&USER_PACKAGE.into(), "X"), Symbol::uninterned(3, "G"), Symbol::keyword("K")];
    let symbols = symbols.map(|symbol| Datum::symbol(symbol, Span::default()));
    let all = numbers
        .into_iter()
        .chain(symbols)
        .chain([vector, array, table, Datum::nil(Span::default())])
        .chain(packed);
    vec![Datum::list_with_tail(all.collect::<Vec<_>>(), text, Span::default())]
}

/// A record of every kind.
pub(crate) fn records() -> Vec<NotedRecord> {
    let failure = || HostFailure { cause: "LOST".into(), arguments: data() };
    let call = |function| Question::Call { function, arguments: data(), goes_first: true };
    let incoming = vec![
        Incoming::Signal(ProcessSignal::Terminate),
        Incoming::Stop,
        Incoming::Input,
        Incoming::Output,
        Incoming::Operation { number: 1, news: News::Progress(data()) },
        Incoming::Operation { number: 2, news: News::Completed(data()) },
        Incoming::Operation { number: 3, news: News::Failed(failure()) },
        Incoming::Message { input: "I".into(), arguments: data() },
        Incoming::Question { number: 4, question: call(FunctionRef::Named("F".into())) },
        Incoming::Question { number: 5, question: call(FunctionRef::Kept(u64::MAX)) },
        Incoming::Question { number: 6, question: Question::Tasks },
        Incoming::Abort(7),
        Incoming::AbortCall(8),
        Incoming::Pause(true),
        Incoming::Release(9),
        Incoming::Watch,
        Incoming::SenderCame,
        Incoming::SenderLeft,
        Incoming::Attended,
        Incoming::Unattended,
        Incoming::Hosted,
        Incoming::Interlude,
    ];
    let errors = [HostError::BrokenPipe, HostError::NotFound, HostError::Refused, HostError::Exists];
    let mut all = vec![
        Record::Monotonic(u64::MAX),
        Record::Monotonic(5),
        Record::WallClock(i64::MIN),
        Record::ProcessorTime(u64::MAX),
        Record::Waited(Wake::Time),
        Record::Waited(Wake::Arrival),
        Record::Waited(Wake::Never),
        Record::Virtual(true),
        Record::Seed(1 << 63),
        Record::Arguments(vec!["a".into(), String::new()]),
        Record::Written(Ok(())),
        Record::PassedOn(Ok(3)),
        Record::Read(Input::Data(vec![0, 255])),
        Record::Read(Input::WouldBlock),
        Record::Read(Input::End),
        Record::Read(Input::Failed(HostError::Other("x".into()))),
        Record::Interactive(false),
        Record::Filed(Ok(FileAnswer::Names(vec!["n/".into()]))),
        Record::Filed(Ok(FileAnswer::Date(-1))),
        Record::Filed(Ok(FileAnswer::Done(true))),
        Record::Permitted(Permit::Granted("/a".into())),
        Record::Permitted(Permit::NotGranted),
        Record::Permitted(Permit::Narrowed),
        Record::FileRead(Ok(vec![9; 10_000])),
        Record::Exists(true),
        Record::Called(Ok(data().remove(0))),
        Record::Called(Err(failure())),
        Record::BrokenOutput(141),
        Record::Due((3, 1 << 40)),
        Record::Received((77, incoming)),
        Record::Checked(RunCheck { round: 4096, ticks: 12, canary: u64::MAX }),
    ];
    all.extend(errors.map(|error| Record::Written(Err(error))));
    let question = |record: &Record| match record {
        Record::Received(_) | Record::Checked(_) => QuestionHash::default(),
        _ => QuestionHash(0xFFFF_FFFE),
    };
    all.into_iter().map(|record| NotedRecord { question: question(&record), record }).collect()
}

/// Bytes of a file in which each of some records has a frame of its own.
pub(crate) fn bytes_of(records: &[NotedRecord]) -> Vec<u8> {
    let mut bytes = beginning_bytes(&beginning());
    let mut unwritten = JournalWriter::default();
    for noted in records {
        unwritten.add(noted);
        bytes.extend(unwritten.take_unmarked());
    }
    let check = RunCheck { round: 5, ticks: 6, canary: 7 };
    bytes.extend(end_bytes(&RecordedEnd { status: 3, check }));
    bytes
}

#[test]
fn a_file_gives_back_what_was_written() {
    let records = records();
    let recorded = read(&bytes_of(&records));
    assert_eq!(format!("{:?}", recorded.records), format!("{records:?}"));
    assert_eq!(format!("{:?}", recorded.beginning), format!("{:?}", beginning()));
    assert_eq!(recorded.end.map(|end| (end.status, end.check.canary)), Some((3, 7)));
    assert_eq!(recorded.torn, 0);
}

#[test]
fn what_is_shared_stays_shared_and_depth_takes_no_stack() {
    let mut out = ByteWriter::default();
    out.datum(&data()[0]);
    let datum = ByteReader(&out.0).datum().expect("it is one");
    let items: Vec<Datum> = datum.elements().cloned().collect();
    let DatumKind::Vector(parts) = items[7].kind() else { panic!("a vector is the eighth") };
    assert!(parts[0].is_same(&parts[1]));
    let deep = (0..1_000_000).fold(Datum::nil(Span::default()), |datum, _| {
        Datum::cons(datum, Datum::nil(Span::default()), Span::default())
    });
    let mut out = ByteWriter::default();
    out.datum(&deep);
    assert!(ByteReader(&out.0).datum().is_some());
}

#[test]
fn a_file_that_is_cut_anywhere_is_a_shorter_recording() {
    let records = records();
    let bytes = bytes_of(&records);
    let text = |noted: &NotedRecord| format!("{noted:?}");
    let mut counts = Vec::new();
    for length in 0..bytes.len() {
        match Recorded::read(&bytes[..length]) {
            Ok(recorded) => {
                assert!(recorded.end.is_none());
                counts.push(recorded.records.len());
                let last = recorded.records.last();
                assert_eq!(last.map(text), recorded.records.len().checked_sub(1).map(|n| text(&records[n])));
            }
            Err(error) => assert_eq!((error, counts.len()), (RecordedError::NoBeginning, 0), "{length}"),
        }
    }
    assert!(counts.is_sorted() && counts.last() == Some(&records.len()));
    // Zeros at the end are what a system leaves that has crashed.
    let with_zeros = [&bytes[..bytes.len() - 9], &[0; 100]].concat();
    assert_eq!(read(&with_zeros).end, None);
    let with_zeros = [&bytes[..], &[0; 100]].concat();
    assert_eq!(read(&with_zeros).torn, 100);
}

#[test]
fn a_file_that_is_changed_anywhere_is_refused() {
    let bytes = bytes_of(&records());
    let last = end_bytes(&RecordedEnd { status: 3, check: RunCheck::default() }).len();
    for at in 0..bytes.len() - last - 20 {
        let mut changed = bytes.clone();
        changed[at] ^= 0x10;
        assert!(Recorded::read(&changed).is_err(), "byte {at}");
    }
    assert_eq!(Recorded::read(b"(defun f ())").err(), Some(RecordedError::NotOne));
    let mut other = bytes.clone();
    other[8] = u8::MAX;
    assert_eq!(Recorded::read(&other).err(), Some(RecordedError::Format(u32::from(u8::MAX))));
    let twice = [&bytes[..], &bytes[12..]].concat();
    assert!(matches!(Recorded::read(&twice), Err(RecordedError::Damaged { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// Content with a right checksum is read, or refused, whatever it is.
    #[test]
    fn no_content_is_too_strange(kind in 0_u8..6, content in proptest::collection::vec(any::<u8>(), 0..300)) {
        let mut bytes = beginning_bytes(&beginning());
        super::file::frame(&mut bytes, kind, &content);
        drop(Recorded::read(&bytes));
        let mut bytes = bytes[..12].to_vec();
        super::file::frame(&mut bytes, 1, &content);
        drop(Recorded::read(&bytes));
        drop(Recorded::read(&content));
    }

    /// So is that of a record in which a byte has changed.
    #[test]
    fn no_record_is_too_strange(which in 0_usize..34, at in any::<prop::sample::Index>(), byte: u8) {
        let mut unwritten = JournalWriter::default();
        unwritten.add(&records()[which]);
        let mut frame = unwritten.take_unmarked();
        let content = &mut frame[11..];
        let index = at.index(content.len());
        content[index] = byte;
        let mut bytes = beginning_bytes(&beginning());
        let kind = frame[8];
        super::file::frame(&mut bytes, kind, &frame[11..]);
        drop(Recorded::read(&bytes));
    }
}

#[test]
fn a_run_in_real_time_is_replayed() {
    let bytes = recorded_bytes(CURIOUS);
    let recorded = read(&bytes);
    assert!(recorded.last_check().is_some(), "there is a check at a wait");
    assert_eq!(rerun(&recorded), Replayed::Equal(0));
}

#[test]
fn a_recording_that_is_cut_is_replayed_to_its_end() {
    let bytes = recorded_bytes("(dotimes (i 3) (print i) (sleep 0.001))");
    let whole = read(&bytes);
    let mut ends = 0;
    let step = (bytes.len() / 60).max(1);
    for length in (0..bytes.len()).step_by(step) {
        match Recorded::read(&bytes[..length]) {
            Ok(recorded) => {
                assert!(recorded.records.len() <= whole.records.len());
                // A file that ends before the program was begun has nothing to be replayed.
                if let Ok(mut rerun) = Rerun::begin(&recorded, |_, _| ()) {
                    assert_eq!(rerun.run(u64::MAX), Some(&Replayed::Cut), "{length}");
                    ends += 1;
                }
            }
            Err(error) => assert_eq!(error, RecordedError::NoBeginning),
        }
    }
    assert!(ends > 0);
}

/// Returns the record with another answer; nothing if none makes a difference to a program that shows all.
fn changed(record: &Record) -> Option<Record> {
    Some(match record {
        Record::WallClock(time) => Record::WallClock(time + 10_000_000_000),
        Record::ProcessorTime(time) => Record::ProcessorTime(time + 10_000_000_000),
        Record::Read(_) => Record::Read(Input::Data(b"changed\n".to_vec())),
        Record::Exists(exists) => Record::Exists(!exists),
        Record::Checked(check) => Record::Checked(RunCheck { canary: check.canary ^ 1, ..*check }),
        Record::Received((round, contents)) => Record::Received((round + 1_000_000, contents.clone())),
        Record::Due((n, time)) => Record::Due((n + 1_000_000, *time)),
        _ => return None,
    })
}

#[test]
fn each_changed_answer_is_a_divergence() {
    let recorded = read(&recorded_bytes(CURIOUS));
    let mut tried = 0;
    for at in 0..recorded.records.len() {
        let with = |noted: NotedRecord| {
            let mut records = recorded.records.to_vec();
            records[at] = noted;
            Recorded { records: records.into(), ..recorded.clone() }
        };
        let NotedRecord { question, record } = recorded.records[at].clone();
        let mut others = vec![NotedRecord { question: QuestionHash(question.0 ^ 1), record: record.clone() }];
        others.extend(changed(&record).map(|record| NotedRecord { question, record }));
        if matches!(record, Record::Received(_) | Record::Checked(_)) {
            others.remove(0);
        }
        for other in others {
            let text = format!("record {}: {:?} in place of {record:?}", at + 1, other.record);
            // A fault in the beginning keeps the run from beginning.
            let Ok(mut rerun) = Rerun::begin(&with(other), |_, _| ()) else { continue };
            let Some(Replayed::Diverged(said)) = rerun.run(u64::MAX) else { panic!("{text} is not noticed") };
            assert!(said.contains("diverged at"), "{said}");
            tried += 1;
        }
    }
    assert!(tried > 30, "only {tried}");
    let shorter = recorded.records[..recorded.records.len() - 1].to_vec();
    let shorter = Recorded { records: shorter.into(), ..recorded.clone() };
    assert!(matches!(rerun(&shorter), Replayed::Diverged(_)));
    let end = recorded.end.map(|end| RecordedEnd { status: 9, ..end });
    assert!(matches!(rerun(&Recorded { end, ..recorded }), Replayed::Diverged(_)));
}

#[test]
fn the_program_of_another_run_diverges() {
    let (one, other) = (recorded_bytes("(print 1)"), recorded_bytes("(print 2)"));
    let mixed = Recorded { beginning: read(&other).beginning, ..read(&one) };
    let Replayed::Diverged(said) = rerun(&mixed) else { panic!("it has not diverged") };
    assert!(said.contains("to write") && said.contains("other arguments"), "{said}");
    let mut beginning = read(&one).beginning;
    beginning.identity.push('x');
    // Records of another machine may be unknown here, which is not damage.
    let mut bytes = beginning_bytes(&beginning);
    super::file::frame(&mut bytes, 2, &[255, 1, 2, 3]);
    assert_eq!(Recorded::read(&bytes).err(), Some(RecordedError::OtherMachine));
    let error = Rerun::begin(&Recorded { beginning, ..read(&one) }, |_, _| ()).err();
    assert!(matches!(error, Some(RerunError::Recording(RecordedError::OtherMachine))));
}

#[test]
fn functions_of_the_embedder_are_not_called_again() {
    use esl_vm::embed::HostFunction;
    let file = TestFile::new();
    let calls = Arc::new(AtomicUsize::new(0));
    let counted = calls.clone();
    let host = VirtualHost::new();
    let text = "(print (esl::%call-host 'count-calls (list 5)))";
    let setup = RunSetup { config: Config { seed: 7, ..Config::DEFAULT }, ..RunSetup::default() };
    let summary = record(&program(text), &setup, host, &file.0, |machine| {
        let count = move |arguments: &[Datum]| {
            counted.fetch_add(1, Ordering::Relaxed);
            Ok(arguments[0].clone())
        };
        machine.add_host_function("COUNT-CALLS", HostFunction::AtOnce(Box::new(count)));
    });
    assert_eq!(summary.expect("it runs").ended, Ended::Normally(0));
    let again = replay(&file.0).expect("it can be replayed");
    assert_eq!((again.replayed, &*again.output), (Replayed::Equal(0), "\n5 "));
    assert_eq!(calls.load(Ordering::Relaxed), 1);
}

/// The state at a place, as far as it can be said.
fn state(debugger: &mut Debugger) -> String {
    let place = debugger.place().expect("there is room");
    format!("{place} {:016x}\n{}", debugger.canary(), debugger.tasks().expect("there is room"))
}

#[test]
fn a_place_is_the_same_whatever_way_leads_there() {
    let recorded = read(&recorded_bytes(CURIOUS));
    let mut debugger = Debugger::begin(recorded, Vec::new(), |_, _| ()).expect("it can be begun");
    let mut forward = Vec::new();
    while debugger.replayed().is_none() {
        forward.push((debugger.ticks(), state(&mut debugger)));
        debugger.step(41).expect("there is room");
    }
    assert!(forward.len() > 50, "only {} places", forward.len());
    let mut random = 12345_u64;
    for _ in 0..1000 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let (ticks, expected) = &forward[(random >> 33) as usize % forward.len()];
        if random & 1 << 32 != 0 {
            let value =
                debugger.evaluate("(list (setq *n* -1) (retract '(done ?i ?j)))").expect("there is room");
            // An answer begins on a line of its own, wherever the program has stopped in one.
            assert!(value.trim_start().starts_with("(-1 "), "{value}");
        }
        debugger.go_to(*ticks).expect("there is room");
        assert_eq!(&state(&mut debugger), expected);
    }
}

#[test]
fn records_are_places_in_both_directions() {
    let recorded = read(&recorded_bytes(CURIOUS));
    let count = recorded.records.len() as u64;
    let mut debugger = Debugger::begin(recorded, Vec::new(), |_, _| ()).expect("it can be begun");
    let go = |debugger: &mut Debugger, number| {
        assert!(debugger.go(&Target::Record(number)).expect("there is room"), "record {number}");
        debugger.ticks()
    };
    let forward: Vec<u64> = (0..count - 9).map(|number| go(&mut debugger, number)).collect();
    assert!(forward.is_sorted() && forward.last() > Some(&2000), "{forward:?}");
    for number in (0..count - 9).rev().step_by(7) {
        assert_eq!(go(&mut debugger, number), forward[number as usize], "record {number}");
    }
    assert!(!debugger.go(&Target::Record(count + 1)).expect("there is room"));
}

#[test]
fn breakpoints_stop_in_both_directions() {
    let recorded = read(&recorded_bytes(CURIOUS));
    let breakpoints =
        ["fact:(done 1 ?j)", "failure:odd", "task:t2"].map(|text| text.parse().expect("it is one"));
    let mut debugger = Debugger::begin(recorded, breakpoints.into(), |_, _| ()).expect("it can be begun");
    let mut forward = Vec::new();
    while let Some(what) = debugger.go_on().expect("there is room") {
        forward.push((debugger.ticks(), what));
    }
    let facts = forward.iter().filter(|(_, what)| what.ends_with("asserts (DONE 1 2)")).count();
    assert_eq!(facts, 1, "{forward:?}");
    assert!(forward.iter().any(|(_, what)| what == "the main task fails with :ODD"), "{forward:?}");
    assert!(forward.iter().any(|(_, what)| what == "task T2 has its turn"), "{forward:?}");
    let mut backward = Vec::new();
    while let Some(what) = debugger.go_back().expect("there is room") {
        backward.push((debugger.ticks(), what));
    }
    backward.reverse();
    assert_eq!(backward, forward);
    assert!(debugger.ticks() <= 1);
    debugger.add_breakpoint("function:work".parse().expect("it is one")).expect("there is room");
    let what = debugger.go_on().expect("there is room").expect("it is called");
    assert!(what.ends_with("calls WORK") || what.ends_with("has its turn"), "{what}");
}
