//! The state of the writer of a journal: what the next generation begins with.

use std::collections::BTreeMap;

use esl_host::{Incoming, News, Record};
use esl_replay::{Beginning, JournalUpgrade, OpenCall, Recorded};

/// The beginning of the next generation of the journal.
#[derive(Default)]
pub(crate) struct Standing {
    /// The beginning of the run, with its present program.
    pub(crate) beginning: Option<Beginning>,
    /// Number of the generation that is written, of that from which the run can go on, and of the oldest.
    pub(crate) number: u64,
    pub(crate) base: u64,
    pub(crate) oldest: u64,
    /// Number of records, of effects and of upgrades of the run so far.
    pub(crate) records: u64,
    pub(crate) effects: u64,
    pub(crate) upgrades: u64,
    pub(crate) senders: u64,
    pub(crate) asked: u64,
    pub(crate) arguments: Option<Vec<String>>,
    /// The calls under way, and some that are over.
    pub(crate) open: BTreeMap<u64, OpenCall>,
    /// The states that operations have saved, by their numbers.
    pub(crate) saved: BTreeMap<u64, Vec<u8>>,
}

impl Standing {
    /// Returns where a run stands after its journal, in which operations have saved these states.
    pub(crate) fn after(
        recorded: &Recorded,
        upgrades: &[JournalUpgrade],
        saved: BTreeMap<u64, Vec<u8>>,
    ) -> Standing {
        let beginning = Some(recorded.beginning.clone());
        let mut standing = Standing { beginning, saved, ..Standing::default() };
        if let Some(start) = &recorded.start {
            let generation = &start.generation;
            standing.records = generation.records;
            standing.effects = generation.effects;
            standing.upgrades = generation.upgrades;
            standing.senders = generation.senders;
            standing.asked = generation.asked;
            standing.arguments.clone_from(&generation.arguments);
            standing.open = generation.open.iter().map(|call| (call.number, call.clone())).collect();
        }
        recorded.records.iter().for_each(|noted| standing.hear(&noted.record));
        standing.upgrades += upgrades.len() as u64;
        if let (Some(beginning), Some(upgrade)) = (&mut standing.beginning, upgrades.last()) {
            beginning.program.clone_from(&upgrade.program);
        }
        standing
    }

    /// Takes the next record of the run into account.
    pub(crate) fn hear(&mut self, record: &Record) {
        self.records += 1;
        match record {
            Record::Intended(_) => self.effects += 1,
            Record::Arguments(arguments) => self.arguments = Some(arguments.clone()),
            Record::Received((_, contents)) => contents.iter().for_each(|incoming| match incoming {
                Incoming::SenderCame => self.senders += 1,
                Incoming::SenderLeft => self.senders = self.senders.saturating_sub(1),
                Incoming::Question { number, .. } => self.asked = self.asked.max(*number),
                Incoming::Operation { news: News::Progress(_), .. } => {}
                Incoming::Operation { number, .. } => {
                    self.open.remove(number);
                    self.saved.remove(number);
                }
                _ => {}
            }),
            _ => {}
        }
    }
}
