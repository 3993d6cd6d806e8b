//! Questions from outside to a run that is replayed. The recorded ones are answered; those that callers ask
//! again are compared with them.

use std::collections::BTreeMap;

use super::text::call_text;
use super::{AnswerSource, ReplayHost};
use crate::record::{NotedRecord, QuestionHash, Record};
use crate::{Answer, FunctionRef, Incoming, Question};

/// A question from outside, in comparison with another one.
#[derive(PartialEq, Eq)]
struct QuestionText {
    hash: QuestionHash,
    /// Beginning of its text.
    text: String,
}

impl QuestionText {
    /// Returns the number and the text of what has come, if it is a question.
    fn of(incoming: &Incoming) -> Option<(u64, QuestionText)> {
        let Incoming::Question { number, question } = incoming else { return None };
        let (name, arguments) = match question {
            Question::Call { function: FunctionRef::Named(name), arguments, .. } => {
                (name.as_str(), &**arguments)
            }
            Question::Call { function: FunctionRef::Kept(_), arguments, .. } => ("#<FUNCTION>", &**arguments),
            Question::Tasks => ("ESL:TASKS", &[][..]),
        };
        let (hash, text) = (QuestionHash::of_call(name, arguments), call_text(name, arguments));
        Some((*number, QuestionText { hash, text }))
    }
}

/// The questions in the records by their numbers, once they were needed.
#[derive(Default)]
pub(super) struct RecordedQuestions(Option<BTreeMap<u64, QuestionText>>);

impl RecordedQuestions {
    fn numbered(&mut self, number: u64, records: &[NotedRecord]) -> Option<&QuestionText> {
        let questions = self.0.get_or_insert_with(|| {
            let arrivals = records.iter().filter_map(|noted| match &noted.record {
                Record::Received((_, arrivals)) => Some(arrivals),
                _ => None,
            });
            arrivals.flatten().filter_map(QuestionText::of).collect()
        });
        questions.get(&number)
    }
}

impl ReplayHost {
    /// Drops the contents of the inbox, which the recorded ones replace. A signal leaves its room to the
    /// next; a question that the recording does not have, or that comes after a divergence, ends without an
    /// answer.
    pub(super) fn drop_arrivals(&self) {
        for incoming in self.inbox.take() {
            if let Incoming::Message { input, .. } = &incoming {
                self.inbox.note_arrival(input);
            }
            if let Some((number, asked)) = QuestionText::of(&incoming) {
                self.compare(number, &asked);
            }
        }
        if self.has_diverged() {
            self.inbox.end_questions();
        }
    }

    /// Compares a question with the recorded one of its number.
    fn compare(&self, number: u64, asked: &QuestionText) {
        let mut guard = self.progress();
        let progress = &mut *guard;
        match progress.questions.numbered(number, &progress.records) {
            Some(recorded) if recorded == asked => {}
            Some(recorded) => {
                let recorded = recorded.text.clone();
                if progress.source == AnswerSource::Records {
                    let asked = format!("nothing, but is asked for {} from outside", asked.text);
                    self.diverge(progress, asked, recorded);
                }
            }
            None => {
                // The answer wakes code of the embedder's.
                drop(guard);
                self.inbox.answer(number, Answer::Ended);
            }
        }
    }
}
