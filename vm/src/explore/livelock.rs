//! Livelocks: fair cycles of the graph of states, which a run may follow for ever.
//!
//! A cycle is fair if each task that could go on at each of its states goes on at one of them, if time passes
//! where a timer runs at each of them, and if each alternative of a `choose` is taken. The search goes
//! through the strongly connected components of the graph, without the states at which an alternative leaves
//! the component: a component has a fair cycle exactly if the cycle through all of it is fair.
//!
//! A task is identified by its rank among the tasks that exist. A step that changes which tasks exist belongs
//! to no cycle, and neither does a step among more than 63 tasks.
//!
//! Source: components by Tarjan 1972; fair components as by Lichtenstein and Pnueli 1985.

use std::collections::VecDeque;

use super::search::LeftChoices;

/// Rank that stands for time.
pub(super) const TIME: u8 = 63;
/// Rank that stands for no task.
pub(super) const NO_TASK: u8 = u8::MAX;

/// The tasks in a state, as far as the search for livelocks needs them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct StateTasks {
    /// Those that can go on, by rank, and whether a timer runs.
    pub(super) able: u64,
    /// Number of ways among which the program chooses; 0 if it does not.
    pub(super) ways: u16,
    /// Whether tasks may be asked to end, by further choices.
    pub(super) has_aborts: bool,
    /// Rank of the task that ran last, when the state was reached first.
    pub(super) last: u8,
    /// Number of the list of choices at points that were left out before the state, then.
    pub(super) left: u32,
}

/// The cause of a step from a state to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StepCause {
    /// Rank of the task that was chosen, [`TIME`], or [`NO_TASK`] if that is not known.
    pub(super) chosen: u8,
    /// Rank of the task that ran last on the way.
    pub(super) last: u8,
    /// Those that went on, by rank, and whether time passed.
    pub(super) ran: u64,
    /// The alternative that the program chose.
    pub(super) way: u16,
    /// Whether the same tasks were there afterwards.
    pub(super) keeps_tasks: bool,
}

/// A step from a state to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct StateStep {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) cause: StepCause,
    /// Number of the list of choices at points that were left out on the way.
    pub(super) left: u32,
}

/// A fair way round: the state at which it begins and ends, and the choices on it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FairLap {
    pub(super) state: u32,
    pub(super) choices: Vec<u32>,
}

/// The graph of states.
pub(super) struct StateGraph<'a> {
    tasks: &'a [StateTasks],
    left: &'a LeftChoices,
    /// The steps that keep tasks, by the state from which they lead.
    steps: Vec<StateStep>,
    /// Where those from each state begin.
    starts: Vec<u32>,
    /// Whether timers may end at any point, which is a choice then.
    has_timers: bool,
    /// Whether only fair cycles count.
    is_fair: bool,
    /// The part to which each state belongs; 0 for those left out.
    parts: Vec<u32>,
}

impl<'a> StateGraph<'a> {
    /// Creates the graph of these states and steps, without the states of which `is_out` is true.
    pub(super) fn new(
        (tasks, steps, left): (&'a [StateTasks], &[StateStep], &'a LeftChoices),
        (has_timers, is_fair): (bool, bool),
        is_out: impl Fn(u32) -> bool,
    ) -> StateGraph<'a> {
        let stays = |step: &&StateStep| step.cause.keeps_tasks && !is_out(step.from) && !is_out(step.to);
        let mut kept: Vec<StateStep> = steps.iter().filter(stays).copied().collect();
        kept.sort_unstable_by_key(|step| (step.from, step.to, step.cause.chosen, step.cause.way));
        let mut starts = vec![0; tasks.len() + 1];
        kept.iter().for_each(|step| starts[step.from as usize + 1] += 1);
        for state in 0..tasks.len() {
            starts[state + 1] += starts[state];
        }
        StateGraph { tasks, left, steps: kept, starts, has_timers, is_fair, parts: vec![1; tasks.len()] }
    }

    fn steps_from(&self, state: u32) -> &[StateStep] {
        &self.steps[self.starts[state as usize] as usize..self.starts[state as usize + 1] as usize]
    }

    /// Returns the steps from a state that stay in its part.
    fn inner_steps(&self, state: u32) -> impl Iterator<Item = StateStep> + '_ {
        let part = self.parts[state as usize];
        self.steps_from(state).iter().filter(move |step| self.parts[step.to as usize] == part).copied()
    }

    /// Returns the first fair way round; the first one of all, if they need not be fair.
    pub(super) fn fair_lap(&mut self) -> Option<FairLap> {
        let mut number = 1;
        let mut open: VecDeque<Vec<u32>> = VecDeque::from([(0..self.tasks.len() as u32).collect()]);
        while let Some(states) = open.pop_front() {
            for part in self.strong_parts(&states) {
                number += 1;
                part.iter().for_each(|&state| self.parts[state as usize] = number);
                if part.iter().all(|&state| self.inner_steps(state).next().is_none()) {
                    continue;
                }
                if !self.is_fair {
                    return self.shortest_lap(&part);
                }
                let leaves = |state: u32| {
                    let ways = self.tasks[state as usize].ways;
                    let mut inner: Vec<u16> = self.inner_steps(state).map(|step| step.cause.way).collect();
                    inner.dedup();
                    inner.sort_unstable();
                    inner.dedup();
                    inner.len() < usize::from(ways)
                };
                let (out, rest): (Vec<u32>, Vec<u32>) = part.iter().partition(|&&state| leaves(state));
                if out.is_empty() {
                    if let Some(lap) = self.lap_of(&part) {
                        return Some(lap);
                    }
                } else {
                    out.iter().for_each(|&state| self.parts[state as usize] = 0);
                    open.push_back(rest);
                }
            }
        }
        None
    }

    /// Returns the strongly connected parts of states that belong to one part so far.
    fn strong_parts(&self, states: &[u32]) -> Vec<Vec<u32>> {
        const UNSEEN: u32 = u32::MAX;
        let count = self.tasks.len();
        let (mut order, mut low) = (vec![UNSEEN; count], vec![UNSEEN; count]);
        let mut is_open = vec![false; count];
        let (mut found, mut stack, mut next) = (Vec::new(), Vec::new(), 0);
        for &root in states {
            if order[root as usize] != UNSEEN {
                continue;
            }
            // State, and number of the steps from it that were followed.
            let mut way: Vec<(u32, usize)> = vec![(root, 0)];
            while let Some(&(state, followed)) = way.last() {
                let at = state as usize;
                if followed == 0 {
                    (order[at], low[at]) = (next, next);
                    next += 1;
                    stack.push(state);
                    is_open[at] = true;
                }
                if let Some(step) = self.steps_from(state).get(followed) {
                    if let Some(top) = way.last_mut() {
                        top.1 += 1;
                    }
                    let to = step.to as usize;
                    if self.parts[to] != self.parts[at] {
                        continue;
                    }
                    if order[to] == UNSEEN {
                        way.push((step.to, 0));
                    } else if is_open[to] {
                        low[at] = low[at].min(order[to]);
                    }
                    continue;
                }
                way.pop();
                if let Some(&(before, _)) = way.last() {
                    low[before as usize] = low[before as usize].min(low[at]);
                }
                if low[at] == order[at] {
                    let begin = stack.iter().rposition(|&other| other == state).unwrap_or(0);
                    let part = stack.split_off(begin);
                    part.iter().for_each(|&state| is_open[state as usize] = false);
                    found.push(part);
                }
            }
        }
        found
    }

    /// Returns a shortest way round from the first state of a part.
    fn shortest_lap(&self, part: &[u32]) -> Option<FairLap> {
        let state = *part.iter().min()?;
        let lap = self.way_to(state, &|step| step.to == state)?;
        Some(FairLap { state, choices: self.choices_of(state, &lap) })
    }

    /// Returns a fair way round in a part, if the way through all of it is fair.
    fn lap_of(&self, part: &[u32]) -> Option<FairLap> {
        let able = |state: u32| self.tasks[state as usize].able;
        let always = part.iter().fold(u64::MAX, |all, &state| all & able(state));
        let ever = part.iter().fold(0, |all, &state| all | able(state));
        let steps = part.iter().flat_map(|&state| self.inner_steps(state));
        let run = steps.fold(0, |all, step| all | step.cause.ran);
        if always & !run != 0 {
            return None;
        }
        let first = *part.iter().min()?;
        let mut lap: Vec<StateStep> = Vec::new();
        let mut here = first;
        for rank in (0..64).filter(|rank| ever >> rank & 1 == 1) {
            let is_done =
                |step: &StateStep| step.cause.ran >> rank & 1 == 1 || able(step.to) >> rank & 1 == 0;
            if !lap.iter().any(is_done) {
                lap.extend(self.way_to(here, &is_done)?);
                here = lap.last().map_or(here, |step| step.to);
            }
        }
        if here != first || lap.is_empty() {
            lap.extend(self.way_to(here, &|step| step.to == first)?);
        }
        Some(FairLap { state: first, choices: self.choices_of(first, &lap) })
    }

    /// Returns a shortest way in the part of a state, whose last step is such a one.
    fn way_to(&self, from: u32, is_last: &dyn Fn(&StateStep) -> bool) -> Option<Vec<StateStep>> {
        let mut reached: Vec<(StateStep, Option<usize>)> = Vec::new();
        let mut known = std::collections::HashSet::from([from]);
        let mut open = VecDeque::from([(from, None)]);
        while let Some((state, before)) = open.pop_front() {
            for step in self.inner_steps(state) {
                if is_last(&step) {
                    let mut way = vec![step];
                    let mut at = before;
                    while let Some(index) = at {
                        let (step, before): (StateStep, Option<usize>) = reached[index];
                        way.push(step);
                        at = before;
                    }
                    way.reverse();
                    return Some(way);
                }
                if known.insert(step.to) {
                    reached.push((step, before));
                    open.push_back((step.to, Some(reached.len() - 1)));
                }
            }
        }
        None
    }

    /// Returns the choices along steps from a state, as it was reached first.
    fn choices_of(&self, first: u32, steps: &[StateStep]) -> Vec<u32> {
        let mut last = self.tasks[first as usize].last;
        let mut choices = Vec::new();
        for StateStep { from, cause, left, .. } in steps {
            let StateTasks { able, ways, has_aborts, .. } = self.tasks[*from as usize];
            let tasks = able & !(1 << TIME);
            let count = tasks.count_ones() + u32::from(self.has_timers && able >> TIME == 1);
            let is_able = |rank: u8| rank < TIME && tasks >> rank & 1 == 1;
            if ways > 0 {
                if ways > 1 {
                    choices.push(u32::from(cause.way));
                }
            } else if count > 1 || has_aborts {
                // The task that ran last comes first, then the others by rank, then time.
                let before = (tasks & ((1 << cause.chosen.min(TIME)) - 1)).count_ones();
                let choice = match cause.chosen {
                    rank if rank == last && is_able(last) => 0,
                    rank if is_able(last) && last > rank => before + 1,
                    _ => before,
                };
                choices.push(choice);
            }
            if cause.last < TIME {
                last = cause.last;
            }
            choices.extend_from_slice(self.left.get(*left));
        }
        choices
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(able: u64) -> StateTasks {
        StateTasks { able, ways: 0, has_aborts: false, last: 0, left: 0 }
    }

    fn step(from: u32, to: u32, ran: u8) -> StateStep {
        StateStep { from, to, cause: cause(ran, 0), left: 0 }
    }

    fn cause(chosen: u8, way: u16) -> StepCause {
        StepCause { chosen, last: chosen, ran: 1 << chosen, way, keeps_tasks: true }
    }

    fn lap(tasks: &[StateTasks], steps: &[StateStep]) -> Option<FairLap> {
        StateGraph::new((tasks, steps, &LeftChoices::default()), (false, true), |_| false).fair_lap()
    }

    fn any_lap(tasks: &[StateTasks], steps: &[StateStep]) -> Option<FairLap> {
        StateGraph::new((tasks, steps, &LeftChoices::default()), (false, false), |_| false).fair_lap()
    }

    #[test]
    fn a_way_round_is_fair_to_those_who_could_go_on_all_along() {
        // Two tasks turn by turn, beside an exit.
        let tasks = [state(0b11), state(0b11), state(0b11)];
        let both = [step(0, 1, 0), step(1, 0, 1), step(1, 2, 0)];
        assert_eq!(lap(&tasks, &both), Some(FairLap { state: 0, choices: vec![0, 1] }));
        // One of them alone, while the other one could go on.
        let one = [step(0, 1, 0), step(1, 0, 0), step(1, 2, 1)];
        assert_eq!(lap(&tasks, &one), None);
        assert_eq!(any_lap(&tasks, &one), Some(FairLap { state: 0, choices: vec![0, 0] }));
        assert_eq!(any_lap(&tasks, &one[..1]), None);
        // The other one waits somewhere.
        let tasks = [state(0b11), state(0b01), state(0b11)];
        assert_eq!(lap(&tasks, &one), Some(FairLap { state: 0, choices: vec![0] }));
        // Or a timer would end the matter.
        let timer = 1 << TIME;
        let tasks = [state(timer | 0b11), state(timer | 0b01), state(0b11)];
        assert_eq!(lap(&tasks, &one), None);
        // After a step to other tasks, ranks do not name the same tasks.
        let mut others = both;
        others[0].cause.keeps_tasks = false;
        assert_eq!(lap(&[state(0b11); 3], &others), None);
        assert_eq!(lap(&[state(1)], &[]), None);
        assert_eq!(lap(&[state(1)], &[step(0, 0, 0)]), Some(FairLap { state: 0, choices: vec![] }));
    }

    #[test]
    fn a_choice_that_leads_out_is_made_at_some_time() {
        let asks = StateTasks { ways: 2, ..state(1) };
        let way = |from, to, way| StateStep { from, to, cause: cause(0, way), left: 0 };
        let leaves = [way(0, 1, 0), way(0, 2, 1), step(1, 0, 0)];
        assert_eq!(lap(&[asks, state(1), state(0)], &leaves), None);
        let stays = [way(0, 1, 0), way(0, 1, 1), step(1, 0, 0)];
        assert_eq!(lap(&[asks, state(1)], &stays), Some(FairLap { state: 0, choices: vec![0] }));
    }
}
