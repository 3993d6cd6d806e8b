//! The state of a search: the tree of choices that were made, those to be made, and the states found.

use std::collections::HashMap;

use super::SearchProgress;

/// A node in the tree of choices: its last choice, after those of its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChoiceNode {
    pub(super) parent: u32,
    pub(super) choice: u32,
    /// State in which the choice was made.
    pub(super) state: u32,
    /// Number of choices so far, by `choose`, that were not the first form.
    pub(super) faults: u32,
    /// Number of nodes after it that are still to be continued from.
    pub(super) open: u32,
}

impl ChoiceNode {
    /// Creates a node from which nothing is open.
    pub(super) fn new(parent: u32, choice: u32, state: u32, faults: u32) -> ChoiceNode {
        ChoiceNode { parent, choice, state, faults, open: 0 }
    }
}

/// The first node.
pub(super) const ROOT: u32 = 0;

/// The state of a search.
#[derive(Default)]
pub(super) struct Search {
    pub(super) nodes: Vec<ChoiceNode>,
    /// Nodes to continue from, by number of preemptions; the latest is last.
    open: Vec<Vec<u32>>,
    /// Numbers of states, by fingerprint.
    pub(super) states: HashMap<u128, u32>,
    /// Node from which each state was reached first.
    pub(super) places: Vec<u32>,
    /// Steps, as pairs of the states before and after.
    pub(super) steps: Vec<(u32, u32)>,
    /// States from which a step leads to the end.
    pub(super) last: Vec<u32>,
}

impl Search {
    /// Adds a node.
    pub(super) fn node(&mut self, node: ChoiceNode) -> u32 {
        self.nodes.push(node);
        (self.nodes.len() - 1) as u32
    }

    /// Adds a node to continue from, after so many preemptions.
    pub(super) fn open(&mut self, switches: usize, node: u32) {
        if self.open.len() <= switches {
            self.open.resize(switches + 1, Vec::new());
        }
        self.open[switches].push(node);
        let parent = self.nodes[node as usize].parent;
        self.nodes[parent as usize].open += 1;
    }

    /// Returns the next node to continue from, one with the fewest preemptions, and that number.
    pub(super) fn next(&mut self) -> Option<(usize, u32)> {
        let pop = |(switches, nodes): (usize, &mut Vec<u32>)| Some((switches, nodes.pop()?));
        let (switches, node) = self.open.iter_mut().enumerate().find_map(pop)?;
        let parent = self.nodes[node as usize].parent;
        self.nodes[parent as usize].open -= 1;
        Some((switches, node))
    }

    /// Returns the bytes that the search takes, about.
    pub(super) fn bytes(&self) -> usize {
        let open = self.open.iter().map(Vec::capacity).sum::<usize>();
        let numbers = open + self.places.capacity() + self.last.capacity() + 2 * self.steps.capacity();
        self.nodes.capacity() * size_of::<ChoiceNode>()
            + self.states.capacity() * (size_of::<(u128, u32)>() + 1)
            + numbers * size_of::<u32>()
    }

    /// Returns how far the search has come.
    pub(super) fn progress(&self, runs: usize, switches: usize, endings: usize) -> SearchProgress {
        let open = self.open.iter().map(Vec::len).sum::<usize>() + 1;
        SearchProgress { states: self.states.len(), runs, open, switches, endings }
    }

    /// Returns the choices that lead to a node.
    pub(super) fn choices(&self, node: u32) -> Vec<u32> {
        self.choices_after(ROOT, node)
    }

    /// Returns the choices that lead from a node to one after it.
    pub(super) fn choices_after(&self, first: u32, node: u32) -> Vec<u32> {
        let mut choices = Vec::new();
        let mut at = node;
        while at != first {
            choices.push(self.nodes[at as usize].choice);
            at = self.nodes[at as usize].parent;
        }
        choices.reverse();
        choices
    }

    /// Returns choices that lead to a state from which the end cannot be reached.
    pub(super) fn endless(&self) -> Option<Vec<u32>> {
        let mut before = vec![Vec::new(); self.places.len()];
        for &(from, to) in &self.steps {
            before[to as usize].push(from);
        }
        let mut ends = vec![false; self.places.len()];
        let mut found = self.last.clone();
        while let Some(state) = found.pop() {
            if !std::mem::replace(&mut ends[state as usize], true) {
                found.extend(&before[state as usize]);
            }
        }
        let stuck = ends.iter().position(|ends| !ends)?;
        Some(self.choices(self.places[stuck]))
    }

    /// Returns whether steps lead from a state back to it: whether states remain when those without a step to
    /// them are removed repeatedly.
    pub(super) fn has_cycle(&self) -> bool {
        let mut after = vec![Vec::new(); self.places.len()];
        let mut steps_to = vec![0_u32; self.places.len()];
        for &(from, to) in &self.steps {
            after[from as usize].push(to);
            steps_to[to as usize] += 1;
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
