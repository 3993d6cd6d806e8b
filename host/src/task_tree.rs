//! The tree of the tasks in a survey: each task below its maker.

use std::collections::BTreeMap;

use super::{Survey, SurveyedTask};

/// Returns the order in which tasks are shown, each after its maker, with their depths in the tree. `tasks`
/// are the numbers of each task and of its maker, in the order of the former.
pub fn task_order(tasks: impl Iterator<Item = (u64, u64)>) -> Vec<(usize, usize)> {
    let mut made: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    let mut numbers = Vec::new();
    let mut makers = Vec::new();
    for (position, (number, maker)) in tasks.enumerate() {
        made.entry(maker).or_default().push(position);
        numbers.push(number);
        makers.push(maker);
    }
    let is_there = |number: &u64| numbers.binary_search(number).is_ok();
    let mut open: Vec<(usize, usize)> = (0..numbers.len())
        .rev()
        .filter(|&position| !is_there(&makers[position]))
        .map(|root| (root, 0))
        .collect();
    let mut order = Vec::new();
    while let Some((position, depth)) = open.pop() {
        order.push((position, depth));
        let children = made.get(&numbers[position]).map_or(&[][..], Vec::as_slice);
        open.extend(children.iter().rev().map(|&child| (child, depth + 1)));
    }
    order
}

impl SurveyedTask {
    /// Returns the line for the task in a tree of tasks, at some depth.
    #[doc(hidden)]
    pub fn line(&self, depth: usize) -> String {
        let state = match &self.waits_for {
            None => "can run".to_string(),
            Some(reason) => format!("waits for {reason}"),
        };
        let place = self.place.as_ref().map_or(String::new(), |place| format!(", {place}"));
        format!("{}{} {state}{place}, {} ticks\n", "  ".repeat(depth.min(20)), self.name, self.ticks)
    }
}

impl Survey {
    /// Returns the order in which its tasks are shown, each after its maker, with their depths in the tree.
    pub fn tree(&self) -> Vec<(usize, usize)> {
        task_order(self.tasks.iter().map(|row| (row.number, row.maker)))
    }

    /// Returns a text that shows its tasks as a tree, each line with the number of the task.
    pub fn tree_text(&self) -> String {
        let line = |(position, depth): (usize, usize)| {
            let row = &self.tasks[position];
            format!("{:>6}  {}", row.number, row.line(depth))
        };
        self.tree().into_iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::task_order;

    #[test]
    fn tasks_come_after_their_makers() {
        let tasks = [(2, 1), (4, 2), (5, 3), (7, 4), (8, 2), (9, 5)];
        let tree: Vec<(u64, usize)> = task_order(tasks.into_iter())
            .into_iter()
            .map(|(position, depth)| (tasks[position].0, depth))
            .collect();
        assert_eq!(tree, [(2, 0), (4, 1), (7, 2), (8, 1), (5, 0), (9, 1)]);
    }
}
