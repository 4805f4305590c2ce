//! Counts the scenes on which costs are below or above the base.

/// The numbers of scenes whose whole interval is below the base or above it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sides {
    below: usize,
    above: usize,
    scenes: usize,
}

impl Sides {
    /// Counts intervals of costs over base, one for each scene.
    pub(super) fn of(intervals: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut sides = Self { below: 0, above: 0, scenes: 0 };
        for (low, high) in intervals {
            // An interval that holds 1 is on neither side: another repetition could change its
            // side.
            sides.below += usize::from(high < 1.0);
            sides.above += usize::from(low > 1.0);
            sides.scenes += 1;
        }
        sides
    }

    /// Returns a sentence about `name`.
    pub(super) fn say(self, name: &str) -> String {
        let Self { below, above, scenes } = self;
        let inconclusive = scenes - below - above;
        if above == scenes {
            return format!("The {name} costs more than greedy on all {scenes} scenes.");
        }
        if below == scenes {
            return format!("The {name} costs less than greedy on all {scenes} scenes.");
        }
        if inconclusive == scenes {
            return format!(
                "Whether the {name} costs more or less than greedy is inconclusive on all {scenes} scenes."
            );
        }
        let mut sides = Vec::new();
        if below > 0 {
            sides.push(format!("less than greedy on {below}"));
        }
        if above > 0 {
            sides.push(format!("more than greedy on {above}"));
        }
        let inconclusive = if inconclusive > 0 {
            format!("; {inconclusive} are inconclusive")
        } else {
            String::new()
        };
        format!("The {name} costs {} of {scenes} scenes{inconclusive}.", sides.join(" and "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_that_holds_the_base_is_on_neither_side() {
        let said = |intervals: &[(f64, f64)]| Sides::of(intervals.iter().copied()).say("best");
        assert_eq!(
            said(&[(0.9, 0.95), (0.98, 0.99)]),
            "The best costs less than greedy on all 2 scenes."
        );
        assert_eq!(
            said(&[(0.9, 1.01)]),
            "Whether the best costs more or less than greedy is inconclusive on all 1 scenes."
        );
        assert_eq!(
            said(&[(0.9, 0.95), (1.01, 1.1), (1.0, 1.1)]),
            "The best costs less than greedy on 1 and more than greedy on 1 of 3 scenes; 1 are inconclusive."
        );
    }
}
