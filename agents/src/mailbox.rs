//! Letters to an agent: they wait here while it sleeps.
//!
//! Guarantees: a letter is answered once, or its sender learns that it was not: when the agent has taken it
//! into its journal, or refuses it.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;

use super::error::AgentError;

/// Letters that wait at most for one agent.
const LIMIT: usize = 10_000;

/// The answer to a letter.
pub(crate) type LetterAnswer = Result<(), AgentError>;

/// The contents of a letter.
#[derive(Clone, Debug)]
pub(crate) enum LetterContents {
    /// A signal of an input of the program.
    Message {
        /// Name of the input.
        input: String,
        /// Arguments of the signal.
        arguments: Vec<Datum>,
    },
    /// The run is to end, with its cleanups.
    End,
}

/// A letter, with the place for its answer.
pub(crate) struct Letter {
    pub(crate) contents: LetterContents,
    answer: SyncSender<LetterAnswer>,
}

impl Letter {
    /// Creates a letter. Its answer can be received; if there is none, the agent has left before.
    pub(crate) fn new(contents: LetterContents) -> (Letter, Receiver<LetterAnswer>) {
        let (answer, receiver) = sync_channel(1);
        (Letter { contents, answer }, receiver)
    }

    /// Answers the letter.
    pub(crate) fn answer(self, answer: LetterAnswer) {
        // The sender may have gone.
        drop(self.answer.try_send(answer));
    }
}

/// The letters that wait for an agent.
#[derive(Default)]
pub(crate) struct AgentMailbox(Mutex<VecDeque<Letter>>);

impl AgentMailbox {
    fn letters(&self) -> MutexGuard<'_, VecDeque<Letter>> {
        // The letters are whole at every moment, so a panic elsewhere does not corrupt them.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a letter, or answers that there is no room.
    pub(crate) fn put(&self, letter: Letter) {
        let mut letters = self.letters();
        if letters.len() < LIMIT {
            letters.push_back(letter);
        } else {
            letter.answer(Err(AgentError::Full));
        }
    }

    /// Returns whether no letter waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.letters().is_empty()
    }

    /// Takes all letters.
    pub(crate) fn take(&self) -> VecDeque<Letter> {
        std::mem::take(&mut *self.letters())
    }

    /// Puts letters back, in front of those that have come since.
    pub(crate) fn put_back(&self, mut letters: VecDeque<Letter>) {
        let mut since = self.letters();
        letters.append(&mut since);
        *since = letters;
    }
}

/// Letters that have left the mailbox, and are not answered yet.
#[derive(Default)]
pub(crate) struct LettersUnderWay {
    /// Those whose contents are in the inbox.
    pub(crate) delivered: VecDeque<Letter>,
    /// Those whose contents were taken from there, which the journal notes.
    pub(crate) taken: VecDeque<Letter>,
}

impl LettersUnderWay {
    /// Answers the letters that are in the journal, which is safe.
    pub(crate) fn answer_taken(&mut self) {
        self.taken.drain(..).for_each(|letter| letter.answer(Ok(())));
    }
}
