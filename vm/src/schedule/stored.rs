//! The scheduler as bytes: see [`crate::stored`].

use esl_heap::store::{Stored, StoredBytes};

use super::Scheduler;

impl Scheduler {
    /// Adds the state between two turns to `out`. Returns whether that is possible: the program is not
    /// explored, and no turn is open.
    pub(crate) fn store(&self, out: &mut Vec<u8>) -> bool {
        // Without `..`: a new field does not compile until it is handled here.
        let Scheduler {
            tasks,
            queues,
            choices,
            timers,
            accounts,
            deliveries,
            readers,
            writers,
            end_of_all,
            any_event,
            starter,
            main,
            main_number,
            counts,
            serial,
            clock,
            spent,
            rounds,
            is_paused,
            canary,
            open_turn,
            running,
            turn,
            points,
        } = self;
        if open_turn.is_some() || running.is_some() || points.grain.is_some() {
            return false;
        }
        tasks.store(out);
        queues.store(out);
        choices.store(out);
        timers.store(out);
        accounts.store(out);
        deliveries.store(out);
        readers.store(out);
        writers.store(out);
        end_of_all.store(out);
        any_event.store(out);
        starter.store(out);
        main.store(out);
        main_number.store(out);
        counts.store(out);
        serial.store(out);
        clock.store(out);
        spent.store(out);
        rounds.store(out);
        is_paused.store(out);
        canary.store(out);
        turn.store(out);
        true
    }

    /// Makes the state one that was stored. `None` if the bytes end before.
    pub(crate) fn load(&mut self, from: &mut StoredBytes<'_>) -> Option<()> {
        self.tasks = Stored::load(from)?;
        self.queues = Stored::load(from)?;
        self.choices = Stored::load(from)?;
        self.timers = Stored::load(from)?;
        self.accounts = Stored::load(from)?;
        self.deliveries = Stored::load(from)?;
        self.readers = Stored::load(from)?;
        self.writers = Stored::load(from)?;
        self.end_of_all = Stored::load(from)?;
        self.any_event = Stored::load(from)?;
        self.starter = Stored::load(from)?;
        self.main = Stored::load(from)?;
        self.main_number = Stored::load(from)?;
        self.counts = Stored::load(from)?;
        self.serial = Stored::load(from)?;
        self.clock = Stored::load(from)?;
        self.spent = Stored::load(from)?;
        self.rounds = Stored::load(from)?;
        self.is_paused = Stored::load(from)?;
        self.canary = Stored::load(from)?;
        self.turn = Stored::load(from)?;
        self.open_turn = None;
        self.running = None;
        Some(())
    }
}
