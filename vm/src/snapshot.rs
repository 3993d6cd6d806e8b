//! Snapshots: the state of a machine between two turns, to be had again in the same machine.
//!
//! A snapshot is an image of the heap, and copies of everything beside it. Large tables that seldom change
//! are shared with the machine until they do ([`CopyOnWrite`](esl_host::machine::CopyOnWrite)), and so are
//! the pages of the heap with another snapshot. The machine and its outside are taken apart here without
//! `..`, by the groups of the list of all state ([`crate::state`]): a new field does not compile until it is
//! saved, or named as one that need not be.
//!
//! Guarantees: after [`Vm::restore`] the machine goes on as it did after [`Vm::save`], to the tick.
//!
//! Not here: hosts other than those in memory, of which nothing can be taken back, and what the embedder's
//! functions have done. There is no snapshot of a machine with a query or a compilation under way, nor while
//! the collector works; and no way back over a call of the embedder's functions, or a compilation.

use std::collections::BTreeMap;

use esl_database::Database;
use esl_host::HostState;
use esl_host::machine::{Canary, Console};

use crate::config::Config;
use crate::embedder::Embedder;
use crate::exchange::{Charges, Exchange};
use crate::heap::HeapImage;
use crate::lookup::Lookups;
use crate::names::Names;
use crate::outside::{ExpectedOperators, Operations, Outside};
use crate::overhead::CollectionOverhead;
use crate::saved_pc::SavedPc;
use crate::schedule::Scheduler;
use crate::trust;
use crate::value::Value;
use crate::vm::Vm;

/// State of a machine between two turns.
pub struct Snapshot {
    heap: HeapImage,
    names: Names,
    /// Number of compilations begun until then.
    compilations: u64,
    database: Database,
    scheduler: Scheduler,
    outside: SavedOutside,
    exchange: SavedExchange,
    embedder: Embedder,
    config: Config,
}

/// State of the outside of a machine.
struct SavedOutside {
    host: (HostState, Canary),
    console: Console,
    /// Number of calls of the embedder's functions until then.
    calls: u64,
    operations: Operations,
    inputs: BTreeMap<String, Value>,
    senders: u64,
    attendance: ExpectedOperators,
    exit_status: Option<u8>,
}

/// The contents of the exchange between two turns.
struct SavedExchange {
    values: Vec<Value>,
    lookups: Lookups,
    collected_at: Option<(SavedPc, u64)>,
    overhead: CollectionOverhead,
}

impl Snapshot {
    /// Returns the bytes that the images of the heap take, about, of all snapshots of this machine that exist
    /// now.
    pub fn bytes_of_all(&self) -> usize {
        self.heap.bytes_of_all()
    }

    /// Returns the bytes that the rest of this snapshot takes, about.
    pub fn bytes_of_rest(&self) -> usize {
        let Scheduler { tasks, queues, .. } = &self.scheduler;
        size_of::<Snapshot>()
            + self.heap.bytes_of_tables()
            + tasks.bytes()
            + queues.bytes()
            + self.database.footprint()
    }
}

impl Vm {
    /// Returns the state of the machine, between two turns. The snapshot shares with `base` what has not
    /// changed since. `None` if the machine was not made for it ([`Config::snapshots`]), if it is watched,
    /// and while there is something under way that cannot be copied: a collection, a query, a compilation,
    /// an operation of the outside.
    pub fn save(&mut self, base: Option<&Snapshot>) -> Option<Snapshot> {
        let Vm {
            heap,
            names,
            compiler,
            database,
            scheduler,
            outside,
            cpu: _,
            natives: _,
            compiled: _,
            exchange,
            watch,
            embedder,
            between_rounds: _,
            config,
        } = self;
        let Outside {
            host,
            inbox,
            console,
            functions: _,
            found: _,
            arguments: _,
            calls,
            answers,
            operations,
            inputs,
            senders,
            attendance,
            complaints: _,
            exit_status,
        } = outside;
        let rests = scheduler.running.is_none()
            && scheduler.tasks.has_freed_all()
            && compiler.jobs.is_empty()
            && operations.is_empty()
            && answers.is_empty()
            && !inbox.is_rung()
            && !watch.is_watched;
        if !rests {
            return None;
        }
        let Exchange {
            values,
            raised: _,
            requested_call: _,
            lookups,
            charges: _,
            collected_at,
            overhead,
            sought: _,
            found: _,
        } = exchange;
        let database = database.copy()?;
        let host = host.save_all()?;
        Some(Snapshot {
            heap: heap.save(base.map(|base| &base.heap))?,
            names: names.clone(),
            compilations: compiler.begun,
            database,
            scheduler: scheduler.clone(),
            outside: SavedOutside {
                host,
                console: console.clone(),
                calls: *calls,
                operations: operations.clone(),
                inputs: inputs.clone(),
                senders: *senders,
                attendance: *attendance,
                exit_status: *exit_status,
            },
            exchange: SavedExchange {
                values: values.clone(),
                lookups: lookups.saved(),
                collected_at: *collected_at,
                overhead: *overhead,
            },
            embedder: embedder.clone(),
            config: config.clone(),
        })
    }

    /// Makes the state of the machine that of a snapshot of it again. Returns whether that was possible: if
    /// the embedder's functions were called since, or something was compiled, or the snapshot is one of
    /// another machine, nothing happens.
    ///
    /// Values that the machine has handed out since are of no use any more, even if they were pinned.
    #[must_use]
    pub fn restore(&mut self, snapshot: &Snapshot) -> bool {
        let Snapshot { heap, names, compilations, database, scheduler, outside, exchange, embedder, config } =
            snapshot;
        let is_possible = self.compiler.begun == *compilations
            && self.outside.calls == outside.calls
            && self.scheduler.running.is_none();
        let Some(database) = database.copy().filter(|_| is_possible) else { return false };
        if !trust::restore_heap(&mut self.heap, heap) {
            return false;
        }
        self.names = names.clone();
        self.database = database;
        self.scheduler = scheduler.clone();
        // The hosts of one machine are one: it knows its states.
        let restored = self.outside.host.restore_all(&outside.host);
        debug_assert!(restored, "a host takes back a state of its own");
        self.outside.console = outside.console.clone();
        self.outside.answers.clear();
        self.outside.operations = outside.operations.clone();
        self.outside.inputs.clone_from(&outside.inputs);
        self.outside.senders = outside.senders;
        self.outside.attendance = outside.attendance;
        self.outside.exit_status = outside.exit_status;
        self.exchange = Exchange {
            values: exchange.values.clone(),
            raised: None,
            requested_call: Vec::new(),
            lookups: exchange.lookups.saved(),
            charges: Charges::default(),
            collected_at: exchange.collected_at,
            overhead: exchange.overhead,
            sought: None,
            found: None,
        };
        self.embedder = embedder.clone();
        self.config = config.clone();
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::vm::{Config, Vm};
    use esl_host::VirtualHost;

    #[test]
    fn a_machine_returns_to_its_own_states_only() {
        let machine = |snapshots| {
            let config = Config { snapshots, ..Config::default() };
            Vm::new(config, Box::new(VirtualHost::new())).expect("there is room for an empty machine")
        };
        let (mut one, mut other) = (machine(true), machine(true));
        assert!(machine(false).save(None).is_none());
        let before = one.fingerprint();
        let snapshot = one.save(None).expect("nothing is under way");
        let name = one.names.intern_esl(&mut one.heap, "NEW").expect("there is room");
        one.heap.symbol_set_value(name, name);
        assert_ne!(one.fingerprint(), before);
        assert!(one.restore(&snapshot) && !other.restore(&snapshot));
        assert_eq!(one.fingerprint(), before);
        assert_eq!(
            one.save(Some(&snapshot)).map(|again| again.bytes_of_all()),
            Some(snapshot.bytes_of_all())
        );
        one.compiler.begun += 1;
        assert!(!one.restore(&snapshot));
    }
}
