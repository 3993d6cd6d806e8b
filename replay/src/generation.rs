//! A generation of a journal: the place in the course of a run at which its file begins.
//!
//! The first journal of a run begins with the run itself. Each further one begins at a snapshot of the
//! machine, with a frame that has the further knowledge of the run's writer and host at that place: the
//! base of the differences that records state, and the calls that are under way.

use esl_bytecode::datum::Datum;
use esl_host::{ActionId, CallEffect};

use super::file::{frame, kind};
use super::journal::{JournalLife, read_life_fields, write_life_fields};
use super::pack::{ByteReader, ByteWriter};
use super::records::Before;

/// A call that is under way.
#[derive(Clone, Debug)]
pub struct OpenCall {
    /// Number of the operation.
    pub number: u64,
    /// Name of the function.
    pub name: String,
    /// Arguments.
    pub arguments: Vec<Datum>,
    /// Declared effect.
    pub effect: CallEffect,
    /// Identity of the call.
    pub action: ActionId,
}

/// An argument of a call that lasts.
#[derive(Clone, Debug)]
pub enum StoredArgument {
    /// Data.
    Data(Datum),
    /// An object of the host, by its number in the machine.
    Object(u64),
}

/// A call that lasts, which each process makes again.
#[derive(Clone, Debug)]
pub struct StoredCall {
    /// Name of the function.
    pub name: String,
    /// Arguments.
    pub arguments: Vec<StoredArgument>,
    /// The objects among its values, by their numbers in the machine.
    pub values: Vec<Option<u64>>,
}

/// The place at which a journal begins.
#[derive(Clone, Debug, Default)]
pub struct JournalGeneration {
    /// Its number; that of the first journal is 0.
    pub number: u64,
    /// The process that has begun it.
    pub life: JournalLife,
    /// Number of records before it, in all journals of the run.
    pub records: u64,
    /// Number of effects among them.
    pub effects: u64,
    /// Number of upgrades before it.
    pub upgrades: u64,
    /// Number of senders of the inbox.
    pub senders: u64,
    /// Greatest number of a question.
    pub asked: u64,
    /// Number of questions whether a timer is due that were answered no.
    pub not_due: u64,
    /// The arguments of the program, if it has asked for them.
    pub arguments: Option<Vec<String>>,
    /// The calls under way, by number.
    pub open: Vec<OpenCall>,
    /// The states that operations under way have saved, by their numbers.
    pub saved: Vec<(u64, Vec<u8>)>,
    /// The calls that last, in the order in which they were made.
    pub lasting: Vec<StoredCall>,
    pub(super) before: Before,
}

impl JournalGeneration {
    /// Returns the time of the program's clock at the last record before it that has one.
    pub fn time(&self) -> u64 {
        self.before.time()
    }

    /// Returns the frame.
    pub(super) fn to_frame(&self, mark: u64) -> Vec<u8> {
        let JournalGeneration {
            number,
            life,
            records,
            effects,
            upgrades,
            senders,
            asked,
            not_due,
            arguments,
            open,
            saved,
            lasting,
            before,
        } = self;
        let mut out = ByteWriter::default();
        out.number(mark);
        let numbers = [*number, *records, *effects, *upgrades, *senders, *asked, *not_due];
        numbers.into_iter().for_each(|number| out.number(number));
        write_life_fields(&mut out, life);
        out.list(arguments.as_slice(), |out, texts| out.list(texts, |out, text| out.text(text)));
        out.list(open, |out, call| {
            out.number(call.number);
            out.text(&call.name);
            out.list(&call.arguments, |out, argument| out.datum(argument));
            out.byte(call.effect as u8);
            out.0.extend_from_slice(&call.action.0.to_le_bytes());
        });
        out.list(saved, |out, (number, state)| {
            out.number(*number);
            out.bytes(state);
        });
        out.list(lasting, |out, call| {
            out.text(&call.name);
            out.list(&call.arguments, |out, argument| match argument {
                StoredArgument::Data(datum) => {
                    out.byte(0);
                    out.datum(datum);
                }
                StoredArgument::Object(number) => {
                    out.byte(1);
                    out.number(*number);
                }
            });
            // Numbers of objects begin at 1.
            out.list(&call.values, |out, number| out.number(number.unwrap_or(0)));
        });
        before.write(&mut out);
        let mut bytes = Vec::new();
        frame(&mut bytes, kind::GENERATION, &out.0);
        bytes
    }

    /// Reads the content of a frame, behind its mark.
    pub(super) fn read(from: &mut ByteReader<'_>) -> Option<JournalGeneration> {
        let mut numbers = [0; 7];
        for number in &mut numbers {
            *number = from.number()?;
        }
        let [number, records, effects, upgrades, senders, asked, not_due] = numbers;
        let life = read_life_fields(from)?;
        let mut arguments = from.list(|from| from.list(|from| Some(from.text()?.to_owned())))?;
        let open = from.list(|from| {
            Some(OpenCall {
                number: from.number()?,
                name: from.text()?.into(),
                arguments: from.list(ByteReader::datum)?,
                effect: effect(from.byte()?)?,
                action: ActionId(u128::from_le_bytes(from.array()?)),
            })
        })?;
        let saved = from.list(|from| Some((from.number()?, from.bytes()?.to_vec())))?;
        let lasting = from.list(|from| {
            let name = from.text()?.into();
            let arguments = from.list(|from| match from.byte()? {
                0 => from.datum().map(StoredArgument::Data),
                1 => from.number().map(StoredArgument::Object),
                _ => None,
            })?;
            let values = from.list(|from| from.number().map(|number| (number > 0).then_some(number)))?;
            Some(StoredCall { name, arguments, values })
        })?;
        let before = Before::read(from)?;
        let is_whole = from.is_empty() && number > 0 && arguments.len() < 2;
        is_whole.then(|| JournalGeneration {
            number,
            life,
            records,
            effects,
            upgrades,
            senders,
            asked,
            not_due,
            arguments: arguments.pop(),
            open,
            saved,
            lasting,
            before,
        })
    }
}

fn effect(byte: u8) -> Option<CallEffect> {
    use CallEffect::{Closes, Idempotent, Lasts, Local, Once, Releases};
    let all = [Local, Closes, Releases, Idempotent, Once, Lasts];
    all.into_iter().find(|&effect| effect as u8 == byte)
}

#[cfg(test)]
mod tests {
    use esl_bytecode::span::Span;
    use esl_host::NotedRecord;

    use super::*;
    use crate::tests::{bytes_of, records};
    use crate::{JournalWriter, Recorded, Rerun, RunJournal, journal_beginning, journal_life};

    #[test]
    fn a_journal_of_the_next_generation_goes_on_where_the_one_before_ends() {
        let (records, beginning) =
            (records(), Recorded::read(&bytes_of(&records())).expect("it is whole").beginning);
        let life = JournalLife { number: 3, wall: 7, time: 5, chance: 11, ..JournalLife::default() };
        let half = records.len() / 2;
        let mut writer = JournalWriter::default();
        let mut first = journal_beginning(&beginning);
        first.extend(journal_life(&life, first.len() as u64));
        records[..half].iter().for_each(|noted| _ = writer.add(noted));
        first.extend(writer.take(first.len() as u64));
        let datum = Datum::string("there", Span::default());
        let call = OpenCall {
            number: 4,
            name: "GO".into(),
            arguments: vec![datum],
            effect: esl_host::CallEffect::Idempotent,
            action: esl_host::ActionId(99),
        };
        let mut generation =
            JournalGeneration { number: 1, life, records: half as u64, ..Default::default() };
        generation.arguments = Some(vec!["one".into(), String::new()]);
        generation.open = vec![call];
        generation.saved = vec![(4, vec![0, 255])];
        let mut second = writer.begin_generation(&beginning, generation.clone());
        let length = second.len();
        records[half..].iter().for_each(|noted| _ = writer.add(noted));
        second.extend(writer.take(length as u64));
        let journal = |bytes: &[u8]| RunJournal::read(bytes).expect("it is a journal");
        let text = |records: &[NotedRecord]| format!("{records:?}");
        let next = journal(&second);
        let start = next.recorded.start.clone().expect("it begins in the middle of the run");
        assert_eq!(text(&next.recorded.records), text(&records[half..]));
        let told = |generation: &JournalGeneration| {
            let JournalGeneration { number, life, records, arguments, open, saved, .. } = generation;
            format!("{number} {life:?} {records} {arguments:?} {open:?} {saved:?}")
        };
        assert_eq!(told(&start.generation), told(&generation));
        let mut whole = journal(&first);
        assert!(whole.append(next) && whole.generation == 1 && whole.lives == [life]);
        assert_eq!(text(&whole.recorded.records), text(&records));
        assert!(!whole.append(journal(&second)), "it is there already");
        // Another journal before it has another end.
        let cut = journal_beginning(&beginning).len() + journal_life(&life, 0).len() + 1;
        let mut shorter = journal(&first[..cut.min(first.len() - 1)]);
        assert!(!shorter.append(journal(&second)));
        // Without its snapshot it cannot be run.
        assert!(Rerun::begin(&Recorded::read(&second).expect("it is whole"), |_, _| ()).is_err());
        for bit in (0..length * 8).step_by(7) {
            let mut flipped = second.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(RunJournal::read(&flipped).is_err(), "bit {bit}");
        }
    }
}
