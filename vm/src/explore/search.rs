//! The state of a search: the tree of choices that were made, those to be made, and the states found.

use std::collections::HashMap;
use std::sync::Arc;

use super::livelock::{StateGraph, StateStep, StateTasks};
use super::set::StateSet;
use super::{Fairness, Livelock, SearchProgress, Settings, TimerGrain, UnmetCondition};

/// A choice at a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MadeChoice {
    pub(super) choice: u32,
    /// State in which the choice was made.
    pub(super) state: u32,
    /// Number of the list of choices at points that were left out since the choice before.
    pub(super) left: u32,
}

/// Lists of choices at points that were left out, by number; the first one is empty.
pub(super) struct LeftChoices {
    lists: Vec<Arc<[u32]>>,
    numbers: HashMap<Arc<[u32]>, u32>,
}

impl Default for LeftChoices {
    fn default() -> LeftChoices {
        let none: Arc<[u32]> = Arc::default();
        LeftChoices { lists: vec![none.clone()], numbers: HashMap::from([(none, 0)]) }
    }
}

impl LeftChoices {
    /// Returns the list with this number.
    pub(super) fn get(&self, number: u32) -> &[u32] {
        &self.lists[number as usize]
    }

    /// Returns the number of a list.
    pub(super) fn number(&mut self, choices: &[u32]) -> u32 {
        if let Some(&number) = self.numbers.get(choices) {
            return number;
        }
        let number = self.lists.len() as u32;
        let list: Arc<[u32]> = choices.into();
        self.lists.push(list.clone());
        self.numbers.insert(list, number);
        number
    }
}

/// A node in the tree of choices: its last choice, after those of its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChoiceNode {
    pub(super) parent: u32,
    pub(super) made: MadeChoice,
    /// Number of choices so far, by `choose`, that were not the first form.
    pub(super) faults: u32,
    /// Number of nodes after it that are still to be continued from, or from which a run is under way.
    pub(super) open: u32,
}

/// The first node.
pub(super) const ROOT: u32 = 0;

/// The state of a search.
#[derive(Default)]
pub(super) struct Search {
    pub(super) nodes: Vec<ChoiceNode>,
    /// Nodes to continue from, by number of preemptions; the latest is last.
    open: Vec<Vec<u32>>,
    /// The states found so far.
    pub(super) states: StateSet,
    /// Node from which each state was reached first.
    pub(super) places: Vec<u32>,
    /// The tasks in each state.
    pub(super) tasks: Vec<StateTasks>,
    /// The bits of the conditions that are still to become true in each state; states behind have none.
    pending: Vec<u64>,
    /// Choices at points that were left out.
    pub(super) left: LeftChoices,
    /// Steps between states.
    pub(super) steps: Vec<StateStep>,
    /// States from which a step leads to the end.
    pub(super) last: Vec<u32>,
    /// Nodes at which other choices of the last batch's runs stand open, by run and step.
    pub(super) placed: HashMap<(u64, usize), u32>,
    /// Nodes after which nothing is open any more since the last batch.
    pub(super) closed: Vec<u32>,
}

impl Search {
    /// Opens the first node.
    pub(super) fn begin(&mut self) {
        self.open(0, (ROOT, MadeChoice::default(), 0));
    }

    /// Adds a node: its parent, its choice, and the faults so far.
    pub(super) fn node(&mut self, (parent, made, faults): (u32, MadeChoice, u32)) -> u32 {
        self.nodes.push(ChoiceNode { parent, made, faults, open: 0 });
        (self.nodes.len() - 1) as u32
    }

    /// Adds a node to continue from, after so many preemptions.
    pub(super) fn open(&mut self, switches: usize, node: (u32, MadeChoice, u32)) {
        let node = self.node(node);
        self.open_again(switches, node);
    }

    /// Makes a node one to continue from.
    pub(super) fn open_again(&mut self, switches: usize, node: u32) {
        if self.open.len() <= switches {
            self.open.resize(switches + 1, Vec::new());
        }
        self.open[switches].push(node);
        let parent = self.nodes[node as usize].parent;
        self.nodes[parent as usize].open += 1;
    }

    /// Takes the next nodes to continue from, at most so many. They have the same number of preemptions, the
    /// fewest of all, which is returned with them.
    pub(super) fn next(&mut self, most: usize) -> Option<(usize, Vec<u32>)> {
        let is_open = |(_, nodes): &(usize, &mut Vec<u32>)| !nodes.is_empty();
        let (switches, nodes) = self.open.iter_mut().enumerate().find(is_open)?;
        let rest = nodes.len().saturating_sub(most);
        Some((switches, nodes.drain(rest..).rev().collect()))
    }

    /// Notes that the run from a node is over.
    pub(super) fn close(&mut self, node: u32) {
        let parent = self.nodes[node as usize].parent;
        let open = &mut self.nodes[parent as usize].open;
        *open -= 1;
        if *open == 0 {
            self.closed.push(parent);
        }
    }

    /// Forgets the notes for the workers, which have read them.
    pub(super) fn settled(&mut self) {
        self.placed.clear();
        self.closed.clear();
    }

    /// Returns the number of the state with this fingerprint, and whether it is new; then it was reached
    /// first from this node.
    pub(super) fn state(&mut self, fingerprint: u128, node: u32, tasks: StateTasks) -> (u32, bool) {
        let (state, is_new) = self.states.insert(fingerprint);
        if is_new {
            self.places.push(node);
            self.tasks.push(tasks);
        }
        (state, is_new)
    }

    /// Notes which conditions are still to become true in a state, by their bits.
    pub(super) fn note_pending(&mut self, state: u32, conditions: u64) {
        if conditions != 0 {
            self.pending.resize(state as usize, 0);
            self.pending.push(conditions);
        }
    }

    /// Returns the bytes that the search takes, about.
    pub(super) fn bytes(&self) -> usize {
        let open = self.open.iter().map(Vec::capacity).sum::<usize>();
        let numbers = open + self.places.capacity() + self.last.capacity();
        self.nodes.capacity() * size_of::<ChoiceNode>()
            + self.states.bytes()
            + self.tasks.capacity() * size_of::<StateTasks>()
            + self.steps.capacity() * size_of::<StateStep>()
            + self.pending.capacity() * size_of::<u64>()
            + numbers * size_of::<u32>()
    }

    /// Returns how far the search has come.
    pub(super) fn progress(&self, runs: usize, switches: usize, endings: usize) -> SearchProgress {
        let open = self.open.iter().map(Vec::len).sum::<usize>() + 1;
        SearchProgress { states: self.states.len(), runs, open, switches, endings }
    }

    /// Returns the choices that lead to a node, with those at points that were left out.
    pub(super) fn choices(&self, node: u32) -> Vec<u32> {
        let made = self.made_after(ROOT, node);
        let with_left = |made: &MadeChoice| [self.left.get(made.left), &[made.choice]].concat();
        made.iter().flat_map(with_left).collect()
    }

    /// Returns the choices that lead to a state on the way by which it was reached first, up to the state
    /// itself.
    pub(super) fn choices_to_state(&self, state: u32) -> Vec<u32> {
        let mut choices = self.choices(self.places[state as usize]);
        choices.extend_from_slice(self.left.get(self.tasks[state as usize].left));
        choices
    }

    /// Returns the choices that lead from a node to one after it, at the points of the search.
    pub(super) fn choices_after(&self, first: u32, node: u32) -> Vec<u32> {
        self.made_after(first, node).into_iter().map(|made| made.choice).collect()
    }

    fn made_after(&self, first: u32, node: u32) -> Vec<MadeChoice> {
        let mut made = Vec::new();
        let mut at = node;
        while at != first {
            made.push(self.nodes[at as usize].made);
            at = self.nodes[at as usize].parent;
        }
        made.reverse();
        made
    }

    /// Returns of each state whether the end can be reached from it.
    pub(super) fn ending(&self) -> Vec<bool> {
        let mut before = vec![Vec::new(); self.places.len()];
        for step in &self.steps {
            before[step.to as usize].push(step.from);
        }
        let mut ends = vec![false; self.places.len()];
        let mut found = self.last.clone();
        while let Some(state) = found.pop() {
            if !std::mem::replace(&mut ends[state as usize], true) {
                found.extend(&before[state as usize]);
            }
        }
        ends
    }

    /// Returns a schedule that goes on for ever, and is fair as far as the settings want, through states of
    /// which `is_out` is false.
    fn lap(&self, settings: &Settings, is_out: impl Fn(u32) -> bool) -> Option<Livelock> {
        let (has_timers, is_fair) = (settings.timers == TimerGrain::Any, settings.fairness == Fairness::Weak);
        let states = (&*self.tasks, &*self.steps, &self.left);
        let lap = StateGraph::new(states, (has_timers, is_fair), is_out).fair_lap()?;
        let before = self.choices_to_state(lap.state);
        Some(Livelock { lap: before.len(), choices: [before, lap.choices].concat() })
    }

    /// Returns a schedule that goes on for ever, beside states from which none leads to an end.
    pub(super) fn livelock(&self, settings: &Settings, ends: &[bool]) -> Option<Livelock> {
        self.lap(settings, |state| !ends[state as usize])
    }

    /// Returns the conditions that are to become true, and never do on a schedule that goes on for ever.
    pub(super) fn unmet(&self, settings: &Settings) -> Vec<UnmetCondition> {
        let all = self.pending.iter().fold(0, |all, pending| all | pending);
        let pending = |state: u32| self.pending.get(state as usize).copied().unwrap_or(0);
        let conditions = (0..u64::BITS).filter(|number| all >> number & 1 == 1);
        let unmet = conditions.filter_map(|condition| {
            let schedule = self.lap(settings, |state| pending(state) >> condition & 1 == 0)?;
            Some(UnmetCondition { condition, schedule })
        });
        unmet.collect()
    }

    /// Returns whether steps lead from a state back to it: whether states remain when those without a step to
    /// them are removed repeatedly.
    pub(super) fn has_cycle(&self) -> bool {
        let mut after = vec![Vec::new(); self.places.len()];
        let mut steps_to = vec![0_u32; self.places.len()];
        for step in &self.steps {
            after[step.from as usize].push(step.to);
            steps_to[step.to as usize] += 1;
        }
        let mut free: Vec<u32> =
            (0..self.places.len() as u32).filter(|&state| steps_to[state as usize] == 0).collect();
        let mut taken = 0;
        while let Some(state) = free.pop() {
            taken += 1;
            for &next in &after[state as usize] {
                steps_to[next as usize] -= 1;
                if steps_to[next as usize] == 0 {
                    free.push(next);
                }
            }
        }
        taken < self.places.len()
    }
}
