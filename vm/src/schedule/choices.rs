//! Choices of a run where the language leaves an order open.

use esl_heap::list_state;
use esl_heap::state::{StateSink, Stated};
use esl_heap::{stored, stored_enum};
use std::collections::VecDeque;

/// Source of choices.
#[derive(Clone, Debug, Default)]
enum ChoiceSource {
    /// Always the first.
    #[default]
    First,
    /// At random, from this state.
    Seeded(u64),
    /// As given; the first when the list is used up.
    Given(VecDeque<u32>),
}

/// Choices of a run where the language leaves an order open.
#[derive(Clone, Debug, Default)]
pub struct Choices {
    source: ChoiceSource,
    record: Option<Vec<u32>>,
}

list_state! { Choices { source: Run, record: Process } }

impl Stated for ChoiceSource {
    fn tell(&self, sink: &mut dyn StateSink) {
        match self {
            ChoiceSource::First => sink.word(1),
            ChoiceSource::Seeded(state) => sink.word(*state),
            ChoiceSource::Given(rest) => rest.tell(sink),
        }
    }
}

impl Choices {
    /// Creates choices that are always the first: plain round-robin with whole slices.
    pub fn first() -> Choices {
        Choices::default()
    }

    /// Creates choices that follow from a seed; those of the seed 0 are always the first.
    pub fn seeded(seed: u64) -> Choices {
        let source = if seed == 0 { ChoiceSource::First } else { ChoiceSource::Seeded(seed) };
        Choices { source, record: None }
    }

    /// Creates choices that are as given, then always the first.
    pub fn given(list: &[u32]) -> Choices {
        Choices { source: ChoiceSource::Given(list.iter().copied().collect()), record: None }
    }

    /// Has the choices noted that are made, so that the list of them reproduces the run.
    #[must_use]
    pub fn recorded(mut self) -> Choices {
        self.record = Some(Vec::new());
        self
    }

    /// Returns the choices made so far, if they were noted.
    pub fn made(&self) -> &[u32] {
        self.record.as_deref().unwrap_or(&[])
    }

    #[inline]
    pub(super) fn is_first(&self) -> bool {
        matches!(self.source, ChoiceSource::First)
    }

    /// Chooses a number below `count`.
    pub(crate) fn choose(&mut self, count: usize) -> usize {
        if count <= 1 {
            return 0;
        }
        let choice = match &mut self.source {
            ChoiceSource::First => return 0,
            ChoiceSource::Seeded(state) => (next_random(state) % count as u64) as usize,
            ChoiceSource::Given(list) => list.pop_front().map_or(0, |choice| choice as usize % count),
        };
        if let Some(record) = &mut self.record {
            record.push(choice as u32);
        }
        choice
    }

    /// Chooses the length of a slice of at most `slice` ticks.
    #[inline]
    pub(crate) fn slice(&mut self, slice: u32) -> u32 {
        if self.is_first() { slice } else { slice - self.choose(slice as usize) as u32 }
    }
}

/// Steele, Lea and Flood's SplitMix: a full period from any state.
fn next_random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

stored_enum! { ChoiceSource { First = 0, Seeded(state) = 1, Given(rest) = 2 } }
stored! { Choices { source, record } }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noted_choices_reproduce_a_run() {
        let mut seeded = Choices::seeded(7).recorded();
        let made: Vec<usize> = (2..40).map(|count| seeded.choose(count)).collect();
        let mut given = Choices::given(seeded.made());
        assert_eq!(made, (2..40).map(|count| given.choose(count)).collect::<Vec<_>>());
        assert_ne!(made, vec![0; made.len()]);
    }
}
