//! Returning to the places of a search: by a snapshot of the place, or by following choices from one before.
//!
//! There is a snapshot of the beginning, and of each place from which something is still to be tried, as far
//! as memory has room for them. Without room the oldest go: the search tries first what comes after the
//! newest.

use std::collections::{HashMap, VecDeque};
use std::rc::Rc;

use super::Settings;
use super::fingerprint::Fingerprints;
use super::point::{PointRun, explore_by};
use super::search::{ROOT, Search};
use crate::snapshot::Snapshot;
use crate::vm::Vm;

/// Number of choices that are followed rather than kept a snapshot for, when a place has lost its own.
const FEW: usize = 8;

/// A place of the search, as the machine stood there.
struct KeptPlace {
    snapshot: Snapshot,
    run: PointRun,
    fingerprints: Fingerprints,
    /// Bytes that it takes beside the image of the heap.
    bytes: usize,
}

/// The machine of a search, and the places to which it can return.
pub(super) struct Keeper<'a> {
    settings: &'a Settings,
    machine: Option<Vm>,
    pub(super) fingerprints: Fingerprints,
    /// The beginning.
    start: Option<Rc<KeptPlace>>,
    /// Other places, by node.
    kept: HashMap<u32, Rc<KeptPlace>>,
    /// Their nodes, the oldest first; some have gone.
    order: VecDeque<u32>,
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
    /// Creates a keeper of nothing.
    pub(super) fn new(settings: &'a Settings) -> Keeper<'a> {
        Keeper {
            settings,
            machine: None,
            fingerprints: Fingerprints::default(),
            start: None,
            kept: HashMap::new(),
            order: VecDeque::new(),
            base: None,
            bytes: 0,
            taken: 0,
            followed: 0,
        }
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
        begin: &mut impl FnMut() -> Result<Vm, E>,
    ) -> Result<(Vm, PointRun, Vec<u32>), E> {
        let mut before = place;
        let mut kept = None;
        while before != ROOT && kept.is_none() {
            before = search.nodes[before as usize].parent;
            kept = self.kept.get(&before).cloned();
        }
        let parent = search.nodes[place as usize].parent;
        if search.nodes[parent as usize].open == 0 {
            self.forget(parent);
        }
        if let Some(kept) = kept.or_else(|| self.start.clone())
            && let Some(mut machine) = self.machine.take()
            && machine.restore(&kept.snapshot)
        {
            self.fingerprints.restore(&kept.fingerprints);
            let choices = search.choices_after(before, place);
            self.followed = choices.len();
            let run = kept.run;
            self.base = Some(kept);
            return Ok((machine, run, choices));
        }
        // Snapshots of the machine before are of no use to another.
        self.kept.clear();
        self.order.clear();
        (self.start, self.base, self.bytes) = (None, None, 0);
        let mut machine = begin()?;
        explore_by(&mut machine, self.settings);
        self.fingerprints.begin_machine();
        let run = PointRun::begin(&mut machine, self.settings);
        self.start = self.save(&mut machine, run);
        let choices = search.choices(place);
        self.followed = choices.len();
        Ok((machine, run, choices))
    }

    /// Takes the machine back after a run.
    pub(super) fn take_back(&mut self, machine: Vm) {
        self.machine = Some(machine);
    }

    /// Keeps the place after a node, where the machine stands.
    pub(super) fn keep(&mut self, vm: &mut Vm, run: PointRun, node: u32) {
        // Without the beginning there was no snapshot of the machine; the first one of a large heap is as
        // large as that.
        if self.start.is_none() || vm.heap.stats().committed as usize > self.settings.memory / 2 {
            return;
        }
        if let Some(kept) = self.save(vm, run) {
            self.kept.insert(node, kept);
            self.order.push_back(node);
            self.make_room();
        }
    }

    /// Keeps a place that has lost its snapshot, if it was far to there and it is needed again.
    pub(super) fn keep_on_the_way(&mut self, vm: &mut Vm, run: PointRun, search: &Search, node: u32) {
        let is_needed = self.followed > FEW && search.nodes[node as usize].open > 0;
        if is_needed && !self.kept.contains_key(&node) {
            self.keep(vm, run, node);
        }
    }

    /// Notes that the search takes so many bytes. Returns whether there is room for that.
    pub(super) fn has_room(&mut self, taken: usize) -> bool {
        self.taken = taken;
        self.make_room();
        taken <= self.settings.memory
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
            && start.snapshot.bytes_of_all() + self.bytes + self.taken > self.settings.memory
            && let Some(oldest) = self.order.pop_front()
        {
            self.forget(oldest);
        }
        if self.order.len() > 2 * self.kept.len() + 64 {
            let kept = &self.kept;
            self.order.retain(|node| kept.contains_key(node));
        }
    }
}
