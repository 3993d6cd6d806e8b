//! Which places of a row of a drawing are free for texts.

/// The covered parts of a row, as intervals of x.
#[derive(Clone, Default)]
pub(super) struct Covered {
    /// In its bars: signs, bars of running, and arrows between other rows.
    pub(super) bars: Vec<(f64, f64)>,
    /// Above its bars: arrows.
    pub(super) above: Vec<f64>,
}

impl Covered {
    /// Returns the x of the first place in a bar, from `x` to `right`, in which a text of this width is read.
    pub(super) fn place_in_bar(&self, x: f64, right: f64, width: f64) -> Option<f64> {
        let mut place = x;
        while place + width <= right {
            let covers = |&&(begin, end): &&(f64, f64)| begin < place + width && end > place;
            match self.bars.iter().filter(covers).map(|&(_, end)| end).reduce(f64::max) {
                None => return Some(place),
                Some(end) => place = end + 2.0,
            }
        }
        None
    }

    /// Returns whether a text above the bars is read as a whole.
    pub(super) fn is_free_above(&self, x: f64, width: f64) -> bool {
        !self.above.iter().any(|&arrow| arrow > x && arrow < x + width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_stands_where_nothing_covers_it() {
        let covered = Covered { bars: vec![(10.0, 20.0), (40.0, 42.0)], above: vec![50.0] };
        assert_eq!(covered.place_in_bar(0.0, 100.0, 8.0), Some(0.0));
        assert_eq!(covered.place_in_bar(0.0, 100.0, 15.0), Some(22.0));
        assert_eq!(covered.place_in_bar(0.0, 100.0, 30.0), Some(44.0));
        assert_eq!(covered.place_in_bar(0.0, 60.0, 30.0), None);
        assert!(covered.is_free_above(50.0, 20.0) && !covered.is_free_above(40.0, 20.0));
    }
}
