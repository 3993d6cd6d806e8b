//! Records as bytes.
//!
//! A record is a tag, the hash of the question, and what the tag says. Times are differences from the time
//! before, and rounds from the round before: both sides keep track.

use esl_host::{
    FileAnswer, FunctionRef, HostError, HostFailure, Incoming, Input, News, NotedRecord, Permit,
    ProcessSignal, Question, QuestionHash, Record, RunCheck, Wake,
};

use super::pack::{ByteReader, ByteWriter};

/// The base of the difference that the next record states.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Before {
    time: u64,
    not_due: u64,
    check: RunCheck,
    round: u64,
}

/// Tags of records. Those from 64 to 67 are kept for the intents, outcomes, choices and snapshots of later
/// versions.
mod tag {
    pub(super) const MONOTONIC: u8 = 1;
    pub(super) const WALL_CLOCK: u8 = 2;
    pub(super) const WAITED: u8 = 3;
    pub(super) const VIRTUAL: u8 = 4;
    pub(super) const SEED: u8 = 5;
    pub(super) const ARGUMENTS: u8 = 6;
    pub(super) const WRITTEN: u8 = 7;
    pub(super) const PASSED_ON: u8 = 8;
    pub(super) const READ: u8 = 9;
    pub(super) const INTERACTIVE: u8 = 10;
    pub(super) const FILED: u8 = 11;
    pub(super) const PERMITTED: u8 = 12;
    pub(super) const FILE_READ: u8 = 13;
    pub(super) const EXISTS: u8 = 14;
    pub(super) const CALLED: u8 = 15;
    pub(super) const BROKEN_OUTPUT: u8 = 16;
    pub(super) const PROCESSOR_TIME: u8 = 17;
    pub(super) const DUE: u8 = 32;
    pub(super) const RECEIVED: u8 = 33;
    pub(super) const CHECK: u8 = 48;
}

/// Tags of what comes into the inbox.
mod arrival {
    pub(super) const SIGNAL: u8 = 0;
    pub(super) const STOP: u8 = 1;
    pub(super) const INPUT: u8 = 2;
    pub(super) const OUTPUT: u8 = 3;
    pub(super) const PROGRESS: u8 = 4;
    pub(super) const COMPLETED: u8 = 5;
    pub(super) const FAILED: u8 = 6;
    pub(super) const MESSAGE: u8 = 7;
    pub(super) const CALL: u8 = 8;
    pub(super) const TASKS: u8 = 9;
    pub(super) const ABORT: u8 = 10;
    pub(super) const ABORT_CALL: u8 = 11;
    pub(super) const PAUSE: u8 = 12;
    pub(super) const RELEASE: u8 = 13;
    pub(super) const WATCH: u8 = 14;
    pub(super) const SENDER_CAME: u8 = 15;
    pub(super) const SENDER_LEFT: u8 = 16;
    pub(super) const ATTENDED: u8 = 17;
}

/// Writes a record.
pub(super) fn write(out: &mut ByteWriter, noted: &NotedRecord, before: &mut Before) {
    let begin = |out: &mut ByteWriter, tag: u8| {
        out.byte(tag);
        if tag < tag::DUE {
            out.number(u64::from(noted.question.0));
        }
    };
    match &noted.record {
        Record::Monotonic(time) => {
            begin(out, tag::MONOTONIC);
            out.signed(time.wrapping_sub(before.time) as i64);
            before.time = *time;
        }
        Record::WallClock(time) => {
            begin(out, tag::WALL_CLOCK);
            out.signed(*time);
        }
        Record::ProcessorTime(time) => {
            begin(out, tag::PROCESSOR_TIME);
            out.number(*time);
        }
        Record::Waited(wake) => {
            begin(out, tag::WAITED);
            out.byte(match wake {
                Wake::Time => 0,
                // Surveys are not recorded.
                Wake::Arrival | Wake::Look => 1,
                Wake::Never => 2,
            });
        }
        Record::Virtual(is_virtual) => {
            begin(out, tag::VIRTUAL);
            out.byte((*is_virtual).into());
        }
        Record::Seed(seed) => {
            begin(out, tag::SEED);
            out.number(*seed);
        }
        Record::Arguments(arguments) => {
            begin(out, tag::ARGUMENTS);
            out.list(arguments, |out, argument| out.text(argument));
        }
        Record::Written(outcome) => {
            begin(out, tag::WRITTEN);
            result(out, outcome, |_, ()| ());
        }
        Record::PassedOn(outcome) => {
            begin(out, tag::PASSED_ON);
            result(out, outcome, |out, &count| out.number(count as u64));
        }
        Record::Read(input) => {
            begin(out, tag::READ);
            match input {
                Input::Data(bytes) => {
                    out.byte(0);
                    out.bytes(bytes);
                }
                Input::WouldBlock => out.byte(1),
                Input::End => out.byte(2),
                Input::Failed(error) => {
                    out.byte(3);
                    host_error(out, error);
                }
            }
        }
        Record::Interactive(is_interactive) => {
            begin(out, tag::INTERACTIVE);
            out.byte((*is_interactive).into());
        }
        Record::Filed(outcome) => {
            begin(out, tag::FILED);
            result(out, outcome, |out, answer| match answer {
                FileAnswer::Names(names) => {
                    out.byte(0);
                    out.list(names, |out, name| out.text(name));
                }
                FileAnswer::Date(date) => {
                    out.byte(1);
                    out.signed(*date);
                }
                FileAnswer::Done(changed) => {
                    out.byte(2);
                    out.byte((*changed).into());
                }
            });
        }
        Record::Permitted(permit) => {
            begin(out, tag::PERMITTED);
            match permit {
                Permit::Granted(object) => {
                    out.byte(0);
                    out.text(object);
                }
                Permit::NotGranted => out.byte(1),
                Permit::Narrowed => out.byte(2),
            }
        }
        Record::FileRead(outcome) => {
            begin(out, tag::FILE_READ);
            result(out, outcome, |out, bytes| out.bytes(bytes));
        }
        Record::Exists(exists) => {
            begin(out, tag::EXISTS);
            out.byte((*exists).into());
        }
        Record::Called(outcome) => {
            begin(out, tag::CALLED);
            match outcome {
                Ok(datum) => {
                    out.byte(0);
                    out.datum(datum);
                }
                Err(failure) => {
                    out.byte(1);
                    host_failure(out, failure);
                }
            }
        }
        Record::BrokenOutput(status) => {
            begin(out, tag::BROKEN_OUTPUT);
            out.byte(*status);
        }
        Record::Due((not_due, time)) => {
            out.byte(tag::DUE);
            out.number(u64::from(noted.question.0));
            out.signed(not_due.wrapping_sub(before.not_due) as i64);
            out.signed(time.wrapping_sub(before.time) as i64);
            (before.not_due, before.time) = (*not_due, *time);
        }
        Record::Received((round, contents)) => {
            out.byte(tag::RECEIVED);
            out.signed(round.wrapping_sub(before.round) as i64);
            before.round = *round;
            out.list(contents, incoming);
        }
        Record::Checked(check) => {
            out.byte(tag::CHECK);
            out.signed(check.round.wrapping_sub(before.check.round) as i64);
            out.signed(check.ticks.wrapping_sub(before.check.ticks) as i64);
            out.0.extend_from_slice(&check.canary.to_le_bytes());
            before.check = *check;
            before.round = check.round;
        }
    }
}

fn result<T>(out: &mut ByteWriter, result: &Result<T, HostError>, write: impl FnOnce(&mut ByteWriter, &T)) {
    match result {
        Ok(value) => {
            out.byte(0);
            write(out, value);
        }
        Err(error) => {
            out.byte(1);
            host_error(out, error);
        }
    }
}

fn host_error(out: &mut ByteWriter, error: &HostError) {
    out.byte(match error {
        HostError::BrokenPipe => 0,
        HostError::NotFound => 1,
        HostError::Refused => 2,
        HostError::Exists => 3,
        HostError::Other(_) => 4,
    });
    if let HostError::Other(text) = error {
        out.text(text);
    }
}

fn host_failure(out: &mut ByteWriter, failure: &HostFailure) {
    out.text(&failure.cause);
    out.list(&failure.arguments, ByteWriter::datum);
}

fn incoming(out: &mut ByteWriter, incoming: &Incoming) {
    match incoming {
        Incoming::Signal(signal) => {
            out.byte(arrival::SIGNAL);
            out.byte(signal.number());
        }
        Incoming::Stop => out.byte(arrival::STOP),
        Incoming::Input => out.byte(arrival::INPUT),
        Incoming::Output => out.byte(arrival::OUTPUT),
        Incoming::Operation { number, news } => {
            out.byte(match news {
                News::Progress(_) => arrival::PROGRESS,
                News::Completed(_) => arrival::COMPLETED,
                News::Failed(_) => arrival::FAILED,
            });
            out.number(*number);
            match news {
                News::Progress(values) | News::Completed(values) => out.list(values, ByteWriter::datum),
                News::Failed(failure) => host_failure(out, failure),
            }
        }
        Incoming::Message { input, arguments } => {
            out.byte(arrival::MESSAGE);
            out.text(input);
            out.list(arguments, ByteWriter::datum);
        }
        Incoming::Question { number, question } => match question {
            Question::Call { function, arguments, goes_first } => {
                out.byte(arrival::CALL);
                out.number(*number);
                match function {
                    FunctionRef::Named(name) => {
                        out.byte(0);
                        out.text(name);
                    }
                    FunctionRef::Kept(number) => {
                        out.byte(1);
                        out.number(*number);
                    }
                }
                out.list(arguments, ByteWriter::datum);
                out.byte((*goes_first).into());
            }
            Question::Tasks => {
                out.byte(arrival::TASKS);
                out.number(*number);
            }
        },
        Incoming::Abort(number) => {
            out.byte(arrival::ABORT);
            out.number(*number);
        }
        Incoming::AbortCall(number) => {
            out.byte(arrival::ABORT_CALL);
            out.number(*number);
        }
        Incoming::Pause(pauses) => {
            out.byte(arrival::PAUSE);
            out.byte((*pauses).into());
        }
        Incoming::Release(number) => {
            out.byte(arrival::RELEASE);
            out.number(*number);
        }
        Incoming::Watch => out.byte(arrival::WATCH),
        Incoming::SenderCame => out.byte(arrival::SENDER_CAME),
        Incoming::SenderLeft => out.byte(arrival::SENDER_LEFT),
        Incoming::Attended => out.byte(arrival::ATTENDED),
    }
}

/// Reads a record; `None` if there is none.
pub(super) fn read(from: &mut ByteReader<'_>, before: &mut Before) -> Option<NotedRecord> {
    let tag = from.byte()?;
    let question = if tag <= tag::DUE { QuestionHash(from.small()?) } else { QuestionHash::default() };
    let record = match tag {
        tag::MONOTONIC => Record::Monotonic(time(from, before)?),
        tag::WALL_CLOCK => Record::WallClock(from.signed()?),
        tag::PROCESSOR_TIME => Record::ProcessorTime(from.number()?),
        tag::WAITED => Record::Waited(match from.byte()? {
            0 => Wake::Time,
            1 => Wake::Arrival,
            2 => Wake::Never,
            _ => return None,
        }),
        tag::VIRTUAL => Record::Virtual(from.flag()?),
        tag::SEED => Record::Seed(from.number()?),
        tag::ARGUMENTS => Record::Arguments(texts(from)?),
        tag::WRITTEN => Record::Written(read_result(from, |_| Some(()))?),
        tag::PASSED_ON => Record::PassedOn(read_result(from, |from| usize::try_from(from.number()?).ok())?),
        tag::READ => Record::Read(match from.byte()? {
            0 => Input::Data(from.bytes()?.into()),
            1 => Input::WouldBlock,
            2 => Input::End,
            3 => Input::Failed(read_host_error(from)?),
            _ => return None,
        }),
        tag::INTERACTIVE => Record::Interactive(from.flag()?),
        tag::FILED => Record::Filed(read_result(from, |from| {
            Some(match from.byte()? {
                0 => FileAnswer::Names(texts(from)?),
                1 => FileAnswer::Date(from.signed()?),
                2 => FileAnswer::Done(from.flag()?),
                _ => return None,
            })
        })?),
        tag::PERMITTED => Record::Permitted(match from.byte()? {
            0 => Permit::Granted(from.text()?.into()),
            1 => Permit::NotGranted,
            2 => Permit::Narrowed,
            _ => return None,
        }),
        tag::FILE_READ => Record::FileRead(read_result(from, |from| Some(from.bytes()?.into()))?),
        tag::EXISTS => Record::Exists(from.flag()?),
        tag::CALLED => Record::Called(match from.byte()? {
            0 => Ok(from.datum()?),
            1 => Err(read_host_failure(from)?),
            _ => return None,
        }),
        tag::BROKEN_OUTPUT => Record::BrokenOutput(from.byte()?),
        tag::DUE => {
            before.not_due = before.not_due.wrapping_add(from.signed()? as u64);
            Record::Due((before.not_due, time(from, before)?))
        }
        tag::RECEIVED => {
            before.round = before.round.wrapping_add(from.signed()? as u64);
            Record::Received((before.round, from.list(read_incoming)?))
        }
        tag::CHECK => {
            let check = &mut before.check;
            check.round = check.round.wrapping_add(from.signed()? as u64);
            check.ticks = check.ticks.wrapping_add(from.signed()? as u64);
            check.canary = u64::from_le_bytes(from.array()?);
            before.round = check.round;
            Record::Checked(*check)
        }
        _ => return None,
    };
    Some(NotedRecord { question, record })
}

fn time(from: &mut ByteReader<'_>, before: &mut Before) -> Option<u64> {
    before.time = before.time.wrapping_add(from.signed()? as u64);
    Some(before.time)
}

fn texts(from: &mut ByteReader<'_>) -> Option<Vec<String>> {
    from.list(|from| Some(from.text()?.into()))
}

fn read_result<'a, T>(
    from: &mut ByteReader<'a>,
    read: impl FnOnce(&mut ByteReader<'a>) -> Option<T>,
) -> Option<Result<T, HostError>> {
    match from.byte()? {
        0 => Some(Ok(read(from)?)),
        1 => Some(Err(read_host_error(from)?)),
        _ => None,
    }
}

fn read_host_error(from: &mut ByteReader<'_>) -> Option<HostError> {
    Some(match from.byte()? {
        0 => HostError::BrokenPipe,
        1 => HostError::NotFound,
        2 => HostError::Refused,
        3 => HostError::Exists,
        4 => HostError::Other(from.text()?.into()),
        _ => return None,
    })
}

fn read_host_failure(from: &mut ByteReader<'_>) -> Option<HostFailure> {
    Some(HostFailure { cause: from.text()?.into(), arguments: from.list(ByteReader::datum)? })
}

fn read_incoming(from: &mut ByteReader<'_>) -> Option<Incoming> {
    Some(match from.byte()? {
        arrival::SIGNAL => Incoming::Signal(ProcessSignal::from_number(from.byte()?.into())?),
        arrival::STOP => Incoming::Stop,
        arrival::INPUT => Incoming::Input,
        arrival::OUTPUT => Incoming::Output,
        tag @ (arrival::PROGRESS | arrival::COMPLETED | arrival::FAILED) => {
            let number = from.number()?;
            let news = match tag {
                arrival::PROGRESS => News::Progress(from.list(ByteReader::datum)?),
                arrival::COMPLETED => News::Completed(from.list(ByteReader::datum)?),
                _ => News::Failed(read_host_failure(from)?),
            };
            Incoming::Operation { number, news }
        }
        arrival::MESSAGE => {
            Incoming::Message { input: from.text()?.into(), arguments: from.list(ByteReader::datum)? }
        }
        arrival::CALL => {
            let number = from.number()?;
            let function = match from.byte()? {
                0 => FunctionRef::Named(from.text()?.into()),
                1 => FunctionRef::Kept(from.number()?),
                _ => return None,
            };
            let (arguments, goes_first) = (from.list(ByteReader::datum)?, from.flag()?);
            Incoming::Question { number, question: Question::Call { function, arguments, goes_first } }
        }
        arrival::TASKS => Incoming::Question { number: from.number()?, question: Question::Tasks },
        arrival::ABORT => Incoming::Abort(from.number()?),
        arrival::ABORT_CALL => Incoming::AbortCall(from.number()?),
        arrival::PAUSE => Incoming::Pause(from.flag()?),
        arrival::RELEASE => Incoming::Release(from.number()?),
        arrival::WATCH => Incoming::Watch,
        arrival::SENDER_CAME => Incoming::SenderCame,
        arrival::SENDER_LEFT => Incoming::SenderLeft,
        arrival::ATTENDED => Incoming::Attended,
        _ => return None,
    })
}
