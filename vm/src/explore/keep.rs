//! Returning to the places of a search: by a snapshot of the place, or by following choices from one before.
//!
//! There is a snapshot of the beginning, and of each place from which something is still to be tried, as far
//! as memory has room for them. Without room the oldest go: the search tries first what comes after the
//! newest.

use std::collections::{HashMap, VecDeque};
use std::rc::Rc;

use super::Settings;
use super::fingerprint::{Fingerprints, MachineMemory};
use super::follow::explore_by;
use super::point::PointRun;
use super::search::{ROOT, Search};
use crate::snapshot::Snapshot;
use crate::vm::Vm;

/// Number of choices that are followed rather than kept a snapshot for, when a place has lost its own.
const FEW: usize = 8;

/// A place of the search, as the machine stood there.
struct KeptPlace {
    snapshot: Snapshot,
    run: PointRun,
    fingerprints: MachineMemory,
    /// Bytes that it takes beside the image of the heap.
    bytes: usize,
}

/// The machine of a search, and the places to which it can return.
pub(super) struct Keeper<'a> {
    settings: &'a Settings,
    /// Bytes that the snapshots may take, with what the search takes.
    memory: usize,
    machine: Option<Vm>,
    pub(super) fingerprints: Fingerprints,
    /// The beginning.
    start: Option<Rc<KeptPlace>>,
    /// Other places, by node.
    kept: HashMap<u32, Rc<KeptPlace>>,
    /// Their nodes, the oldest first; some have gone.
    order: VecDeque<u32>,
    /// Places that runs of this batch have come to, by run and step.
    fresh: VecDeque<((u64, usize), Rc<KeptPlace>)>,
    /// The place at which the machine was last: its next snapshot has most in common with that one.
    base: Option<Rc<KeptPlace>>,
    /// Sum of the bytes that all take beside the images of heaps.
    bytes: usize,
    /// Bytes that the search itself takes.
    taken: usize,
    /// Number of choices that the run under way has followed.
    followed: usize,
}

impl<'a> Keeper<'a> {
    /// Creates a keeper of nothing, which may take so many bytes.
    pub(super) fn new(settings: &'a Settings, memory: usize) -> Keeper<'a> {
        Keeper {
            settings,
            memory,
            machine: None,
            fingerprints: Fingerprints::default(),
            start: None,
            kept: HashMap::new(),
            order: VecDeque::new(),
            fresh: VecDeque::new(),
            base: None,
            bytes: 0,
            taken: 0,
            followed: 0,
        }
    }

    /// Takes note of what the search has made of the last batch: which places are open, and which no longer.
    pub(super) fn settle(&mut self, search: &Search) {
        for (at, kept) in std::mem::take(&mut self.fresh) {
            match search.placed.get(&at).filter(|&&node| search.nodes[node as usize].open > 0) {
                Some(&node) => {
                    self.kept.insert(node, kept);
                    self.order.push_back(node);
                }
                None => self.bytes -= kept.bytes,
            }
        }
        search.closed.iter().for_each(|&node| self.forget(node));
        self.taken = search.bytes();
        self.make_room();
    }

    /// Returns whether there is a snapshot of the place after a node.
    pub(super) fn has(&self, node: u32) -> bool {
        self.kept.contains_key(&node)
    }

    /// Returns the machine, how it goes on, and the choices that lead it to `place` and beyond the choice
    /// there.
    ///
    /// # Errors
    /// Those of `begin`.
    pub(super) fn go_to<E>(
        &mut self,
        search: &Search,
        place: u32,
        begin: impl FnOnce() -> Result<Vm, E>,
    ) -> Result<(Vm, PointRun, Vec<u32>), E> {
        let mut before = place;
        let mut kept = None;
        while before != ROOT && kept.is_none() {
            before = search.nodes[before as usize].parent;
            kept = self.kept.get(&before).cloned();
        }
        if let Some(kept) = kept.or_else(|| self.start.clone())
            && let Some(mut machine) = self.machine.take()
            && machine.restore(&kept.snapshot)
        {
            self.fingerprints.restore(&kept.fingerprints);
            let choices = search.choices_after(before, place);
            self.followed = choices.len();
            let run = kept.run.clone();
            self.base = Some(kept);
            return Ok((machine, run, choices));
        }
        // Snapshots of the machine before are of no use to another.
        self.kept.clear();
        self.order.clear();
        self.fresh.clear();
        (self.start, self.base, self.bytes) = (None, None, 0);
        let mut machine = begin()?;
        explore_by(&mut machine, self.settings);
        self.fingerprints.begin_machine();
        let run = PointRun::begin(&mut machine, self.settings);
        self.start = self.save(&mut machine, run.clone());
        let choices = search.choices_after(ROOT, place);
        self.followed = choices.len();
        Ok((machine, run, choices))
    }

    /// Takes the machine back after a run.
    pub(super) fn take_back(&mut self, machine: Vm) {
        self.machine = Some(machine);
    }

    /// Keeps the place at which the machine stands, a step of a run of this batch.
    pub(super) fn keep(&mut self, vm: &mut Vm, run: PointRun, at: (u64, usize)) {
        if let Some(kept) = self.save_if_small(vm, run) {
            self.fresh.push_back((at, kept));
            self.make_room();
        }
    }

    fn save_if_small(&mut self, vm: &mut Vm, run: PointRun) -> Option<Rc<KeptPlace>> {
        // Without the beginning there was no snapshot of the machine; the first one of a large heap is as
        // large as that.
        let is_large = vm.heap.stats().committed as usize > self.memory / 2;
        if self.start.is_none() || is_large { None } else { self.save(vm, run) }
    }

    /// Keeps a place that has lost its snapshot, if it was far to there and it is needed again.
    pub(super) fn keep_on_the_way(&mut self, vm: &mut Vm, run: PointRun, search: &Search, node: u32) {
        let is_needed = self.followed > FEW && search.nodes[node as usize].open > 1;
        if is_needed
            && !self.kept.contains_key(&node)
            && let Some(kept) = self.save_if_small(vm, run)
        {
            self.kept.insert(node, kept);
            self.order.push_back(node);
            self.make_room();
        }
    }

    fn save(&mut self, vm: &mut Vm, run: PointRun) -> Option<Rc<KeptPlace>> {
        if !self.settings.snapshots {
            return None;
        }
        let snapshot = vm.save(self.base.as_ref().map(|base| &base.snapshot))?;
        let bytes = snapshot.bytes_of_rest();
        self.bytes += bytes;
        let kept = Rc::new(KeptPlace { snapshot, run, fingerprints: self.fingerprints.of_machine(), bytes });
        self.base = Some(kept.clone());
        Some(kept)
    }

    fn forget(&mut self, node: u32) {
        if let Some(kept) = self.kept.remove(&node) {
            self.bytes -= kept.bytes;
        }
    }

    /// Gives up the oldest places, as far as there is no room for them.
    fn make_room(&mut self) {
        while let Some(start) = &self.start
            && start.snapshot.bytes_of_all() + self.bytes + self.taken > self.memory
        {
            if let Some(oldest) = self.order.pop_front() {
                self.forget(oldest);
            } else if let Some((_, kept)) = self.fresh.pop_front() {
                self.bytes -= kept.bytes;
            } else {
                break;
            }
        }
        if self.order.len() > 2 * self.kept.len() + 64 {
            let kept = &self.kept;
            self.order.retain(|node| kept.contains_key(node));
        }
    }
}
