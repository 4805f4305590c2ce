//! Attempts: the runs of a method at a problem, which is a scene with a target. Reports on run time
//! are made from attempts.

use super::config::Targets;
use super::data::Rows;
use super::progress::{ProgressAxis, Series, longest, median_reached, reached, series};
use super::target::Target;
use crate::statistics::sorted;

/// One method's runs on one problem.
pub struct Attempt<'a> {
    pub scene: &'a str,
    pub target: &'a Target,
    /// The target as a cost on the scene.
    pub cost: f64,
    pub method: &'a str,
    pub runs: usize,
    /// The times at which runs reached the target, ascending; fewer than `runs` if some did not.
    pub solved: Vec<f64>,
    /// The time at which the median run reached the target; `None` if it did not.
    pub median: Option<f64>,
    /// The end of the method's longest run on the scene.
    pub end: f64,
}

/// Returns the attempts of all methods at all problems, scene by scene, then target by target.
pub fn attempts<'a>(config: &'a Targets, rows: &'a Rows, axis: ProgressAxis) -> Vec<Attempt<'a>> {
    let mut attempts = Vec::new();
    for scene in rows.scenes() {
        let own = |method: &'a String| {
            (method.as_str(), series(rows, scene, method, axis), longest(rows, scene, method, axis))
        };
        let methods: Vec<(&str, Vec<Series>, f64)> = config.methods.iter().map(own).collect();
        for target in &config.targets {
            let Some(cost) = target.cost(rows, scene) else { continue };
            attempts.extend(methods.iter().map(|(method, runs, end)| {
                let solved: Vec<f64> = runs
                    .iter()
                    .filter_map(|run| reached(run, cost))
                    .collect();
                let solved = sorted(&solved);
                let median = median_reached(runs, cost);
                Attempt { scene, target, cost, method, runs: runs.len(), solved, median, end: *end }
            }));
        }
    }
    attempts
}

/// Returns the corners of the empirical distribution function that rises to each `(x, fraction)`,
/// from 0 at the first x up to `end`. Empty if it never rises.
pub fn staircase(rises: Vec<(f64, f64)>, end: f64) -> Vec<(f64, f64)> {
    let (Some(&(first, _)), Some(&(last, fraction))) = (rises.first(), rises.last()) else {
        return rises;
    };
    std::iter::once((first, 0.0))
        .chain(rises)
        .chain([(end.max(last), fraction)])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::staircase;

    #[test]
    fn a_staircase_begins_at_nothing_and_stays_until_the_end() {
        let rises = vec![(2.0, 0.25), (3.0, 0.5)];
        assert_eq!(staircase(rises, 9.0), [(2.0, 0.0), (2.0, 0.25), (3.0, 0.5), (9.0, 0.5)]);
        assert_eq!(staircase(vec![], 9.0), []);
    }
}
