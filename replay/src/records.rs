//! Records as bytes.
//!
//! A record is a tag, the hash of the question, and what the tag says. Times are differences from the time
//! before, and rounds from the round before: both sides keep track.
//!
//! Each row of the tables states a tag, the parts that follow it, and the value that they make, as a pattern
//! for the writer and as an expression for the reader. So both have the same bytes.

use std::sync::Arc;

use esl_bytecode::datum::Datum;
use esl_host::{
    ActionId, FileAnswer, FunctionRef, HostError, HostFailure, Incoming, Input, Intent, News, NotedRecord,
    Permit, ProcessSignal, Question, QuestionHash, Record, RunCheck, Wake,
};

use super::pack::{ByteReader, ByteWriter};

/// The base of the difference that the next record states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Before {
    time: u64,
    not_due: u64,
    check: RunCheck,
    round: u64,
}

impl Before {
    /// Writes it, for a journal that begins here.
    pub(super) fn write(&self, out: &mut ByteWriter) {
        let Before { time, not_due, check, round } = *self;
        let RunCheck { round: checked, ticks, canary } = check;
        [time, not_due, round, checked, ticks].into_iter().for_each(|number| out.number(number));
        out.0.extend_from_slice(&canary.to_le_bytes());
    }

    /// Reads it.
    pub(super) fn read(from: &mut ByteReader<'_>) -> Option<Before> {
        let (time, not_due, round) = (from.number()?, from.number()?, from.number()?);
        let (checked, ticks) = (from.number()?, from.number()?);
        let check = RunCheck { round: checked, ticks, canary: u64::from_le_bytes(from.array()?) };
        Some(Before { time, not_due, check, round })
    }

    /// Returns the last time that was answered.
    pub(super) fn time(&self) -> u64 {
        self.time
    }
}

/// Data that are written as bytes and read back.
trait Packed: Sized {
    fn write(&self, out: &mut ByteWriter);
    /// Returns `None` if the bytes are not what is read.
    fn read(from: &mut ByteReader<'_>) -> Option<Self>;
}

macro_rules! packed_as {
    ($( $type:ty : |$value:ident, $out:ident| $write:expr, |$from:ident| $read:expr; )*) => { $(
        impl Packed for $type {
            fn write(&self, $out: &mut ByteWriter) {
                let $value = self;
                let () = $write;
            }

            fn read($from: &mut ByteReader<'_>) -> Option<Self> {
                $read
            }
        }
    )* };
}

packed_as! {
    (): |_nothing, _out| (), |_from| Some(());
    u8: |byte, out| out.byte(*byte), |from| from.byte();
    u64: |number, out| out.number(*number), |from| from.number();
    usize: |number, out| out.number(*number as u64), |from| from.number()?.try_into().ok();
    i64: |number, out| out.signed(*number), |from| from.signed();
    bool: |flag, out| out.byte((*flag).into()), |from| from.flag();
    String: |text, out| out.text(text), |from| Some(from.text()?.into());
    Arc<str>: |text, out| out.text(text), |from| Some(from.text()?.into());
    Datum: |datum, out| out.datum(datum), |from| from.datum();
    Vec<u8>: |bytes, out| out.bytes(bytes), |from| Some(from.bytes()?.into());
    Vec<String>: |items, out| out.list(items, |out, item| item.write(out)), |from| from.list(Packed::read);
    Vec<Datum>: |items, out| out.list(items, |out, item| item.write(out)), |from| from.list(Packed::read);
    Vec<Incoming>: |items, out| out.list(items, |out, item| item.write(out)), |from| from.list(Packed::read);
    ProcessSignal: |signal, out| out.byte(signal.number()),
        |from| ProcessSignal::from_number(from.byte()?.into());
    HostFailure: |failure, out| {
            failure.cause.write(out);
            failure.arguments.write(out);
        },
        |from| Some(HostFailure { cause: Packed::read(from)?, arguments: Packed::read(from)? });
    Intent: |intent, out| {
            out.0.extend_from_slice(&intent.action.0.to_le_bytes());
            out.number(intent.operation.unwrap_or(0));
            out.number(intent.before);
        },
        |from| Some(Intent {
            action: ActionId(u128::from_le_bytes(from.array()?)),
            operation: Some(from.number()?).filter(|&number| number > 0),
            before: from.number()?,
        });
    // Surveys are not recorded.
    Wake: |wake, out| out.byte(match wake {
            Wake::Time => 0,
            Wake::Arrival | Wake::Inspection => 1,
            Wake::Never => 2,
        }),
        |from| Some(match from.byte()? {
            0 => Wake::Time,
            1 => Wake::Arrival,
            2 => Wake::Never,
            _ => return None,
        });
}

impl<T: Packed, E: Packed> Packed for Result<T, E> {
    fn write(&self, out: &mut ByteWriter) {
        match self {
            Ok(value) => {
                out.byte(0);
                value.write(out);
            }
            Err(error) => {
                out.byte(1);
                error.write(out);
            }
        }
    }

    fn read(from: &mut ByteReader<'_>) -> Option<Self> {
        match from.byte()? {
            0 => Some(Ok(T::read(from)?)),
            1 => Some(Err(E::read(from)?)),
            _ => None,
        }
    }
}

macro_rules! packed_by_tag {
    ($( $type:ty : $( $tag:literal ( $( $part:ident ),* ) => { $( $value:tt )* } )* ; )*) => { $(
        impl Packed for $type {
            fn write(&self, out: &mut ByteWriter) {
                match self {
                    $( $( $value )* => {
                        out.byte($tag);
                        $( $part.write(out); )*
                    } )*
                }
            }

            fn read(from: &mut ByteReader<'_>) -> Option<Self> {
                Some(match from.byte()? {
                    $( $tag => {
                        $( let $part = Packed::read(from)?; )*
                        $( $value )*
                    } )*
                    _ => return None,
                })
            }
        }
    )* };
}

packed_by_tag! {
    Input:
        0 (bytes) => { Input::Data(bytes) }
        1 () => { Input::WouldBlock }
        2 () => { Input::End }
        3 (error) => { Input::Failed(error) };
    FileAnswer:
        0 (names) => { FileAnswer::Names(names) }
        1 (date) => { FileAnswer::Date(date) }
        2 (has_changed) => { FileAnswer::Done(has_changed) };
    Permit:
        0 (object) => { Permit::Granted(object) }
        1 () => { Permit::NotGranted }
        2 () => { Permit::Narrowed };
    HostError:
        0 () => { HostError::BrokenPipe }
        1 () => { HostError::NotFound }
        2 () => { HostError::Refused }
        3 () => { HostError::Exists }
        4 (text) => { HostError::Other(text) };
    FunctionRef:
        0 (name) => { FunctionRef::Named(name) }
        1 (number) => { FunctionRef::Kept(number) };
    Incoming:
        0 (signal) => { Incoming::Signal(signal) }
        1 () => { Incoming::Stop }
        2 () => { Incoming::Input }
        3 () => { Incoming::Output }
        4 (number, values) => { Incoming::Operation { number, news: News::Progress(values) } }
        5 (number, values) => { Incoming::Operation { number, news: News::Completed(values) } }
        6 (number, failure) => { Incoming::Operation { number, news: News::Failed(failure) } }
        7 (input, arguments) => { Incoming::Message { input, arguments } }
        8 (number, function, arguments, goes_first) => {
            Incoming::Question { number, question: Question::Call { function, arguments, goes_first } }
        }
        9 (number) => { Incoming::Question { number, question: Question::Tasks } }
        10 (number) => { Incoming::Abort(number) }
        11 (number) => { Incoming::AbortCall(number) }
        12 (pauses) => { Incoming::Pause(pauses) }
        13 (number) => { Incoming::Release(number) }
        14 () => { Incoming::Watch }
        15 () => { Incoming::SenderCame }
        16 () => { Incoming::SenderLeft }
        17 () => { Incoming::Attended }
        18 () => { Incoming::Hosted }
        19 () => { Incoming::Interlude }
        20 () => { Incoming::Unattended };
}

/// Tags of records that are differences from those before. Tags from 65 to 67 are kept for the choices and
/// snapshots of later versions.
const MONOTONIC: u8 = 1;
const DUE: u8 = 32;
const RECEIVED: u8 = 33;
const CHECK: u8 = 48;
/// Tag of an effect, the last one of those that have a question.
const INTENDED: u8 = 64;

macro_rules! define_answers {
    ($( $tag:literal $record:ident )*) => {
        /// Writes a record.
        pub(super) fn write(out: &mut ByteWriter, noted: &NotedRecord, before: &mut Before) {
            let begin = |out: &mut ByteWriter, tag: u8| {
                out.byte(tag);
                out.number(u64::from(noted.question.0));
            };
            match &noted.record {
                $( Record::$record(answer) => {
                    begin(out, $tag);
                    answer.write(out);
                } )*
                Record::Monotonic(time) => {
                    begin(out, MONOTONIC);
                    difference(out, &mut before.time, *time);
                }
                Record::Due((not_due, time)) => {
                    begin(out, DUE);
                    difference(out, &mut before.not_due, *not_due);
                    difference(out, &mut before.time, *time);
                }
                Record::Received((round, contents)) => {
                    out.byte(RECEIVED);
                    difference(out, &mut before.round, *round);
                    contents.write(out);
                }
                Record::Checked(check) => {
                    out.byte(CHECK);
                    difference(out, &mut before.check.round, check.round);
                    difference(out, &mut before.check.ticks, check.ticks);
                    out.0.extend_from_slice(&check.canary.to_le_bytes());
                    before.check.canary = check.canary;
                    before.round = check.round;
                }
            }
        }

        /// Reads a record; `None` if there is none.
        pub(super) fn read(from: &mut ByteReader<'_>, before: &mut Before) -> Option<NotedRecord> {
            let tag = from.byte()?;
            let is_asked = tag <= DUE || tag == INTENDED;
            let question = if is_asked { QuestionHash(from.small()?) } else { QuestionHash::default() };
            let record = match tag {
                $( $tag => Record::$record(Packed::read(from)?), )*
                MONOTONIC => Record::Monotonic(sum(from, &mut before.time)?),
                DUE => Record::Due((sum(from, &mut before.not_due)?, sum(from, &mut before.time)?)),
                RECEIVED => Record::Received((sum(from, &mut before.round)?, Packed::read(from)?)),
                CHECK => {
                    let check = &mut before.check;
                    before.round = sum(from, &mut check.round)?;
                    sum(from, &mut check.ticks)?;
                    check.canary = u64::from_le_bytes(from.array()?);
                    Record::Checked(*check)
                }
                _ => return None,
            };
            Some(NotedRecord { question, record })
        }
    };
}

define_answers! {
    2 WallClock
    3 Waited
    4 Virtual
    5 Seed
    6 Arguments
    7 Written
    8 PassedOn
    9 Read
    10 Interactive
    11 Filed
    12 Permitted
    13 FileRead
    14 Exists
    15 Called
    16 BrokenOutput
    17 ProcessorTime
    64 Intended
}

/// Writes a number as the difference from the one before.
fn difference(out: &mut ByteWriter, before: &mut u64, number: u64) {
    out.signed(number.wrapping_sub(*before) as i64);
    *before = number;
}

/// Reads a number that was written as the difference from the one before.
fn sum(from: &mut ByteReader<'_>, before: &mut u64) -> Option<u64> {
    *before = before.wrapping_add(from.signed()? as u64);
    Some(*before)
}
