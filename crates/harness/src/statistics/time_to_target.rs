//! The shifted exponential distribution of the time that a randomised search takes to reach a
//! target.
//!
//! Aiex, Resende & Ribeiro 2007, 'TTT plots: a perl program to create time-to-target plots'; Hoos &
//! Stützle 1998 for runs that never reach the target.

use super::sorted;

/// P(solved within t) = 1 − exp(−(t − shift) / mean) for t ≥ shift, both in the unit of the times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShiftedExponential {
    /// The time before which no run reaches the target; a fit may give a negative one.
    pub shift: f64,
    /// The mean time after `shift`.
    pub mean: f64,
}

impl ShiftedExponential {
    /// Fits the distribution to the quartiles of times, as the source does, which is robust against
    /// outliers. `solved` are the times, in any order, of the runs among `runs` that reached the
    /// target.
    ///
    /// `None` if fewer than three quarters of the runs did, or if the quartiles are equal.
    pub fn fit(solved: &[f64], runs: usize) -> Option<Self> {
        let sorted = sorted(solved);
        let lower = at(&sorted, runs, 0.25)?;
        let upper = at(&sorted, runs, 0.75)?;
        let mean = (upper - lower) / (standard_quantile(0.75) - standard_quantile(0.25));
        (mean > 0.0).then(|| Self { shift: lower - mean * standard_quantile(0.25), mean })
    }

    /// Returns P(solved within `time`).
    pub fn probability(&self, time: f64) -> f64 {
        -libm::expm1(-((time - self.shift) / self.mean).max(0.0))
    }

    /// Returns the greatest difference between the fit and the distribution of these times
    /// (Kolmogorov–Smirnov).
    pub fn distance(&self, solved: &[f64], runs: usize) -> f64 {
        let steps = sorted(solved)
            .into_iter()
            .zip(0u32..)
            .flat_map(|(time, before)| {
                [before, before + 1]
                    .map(|count| (f64::from(count) / runs as f64 - self.probability(time)).abs())
            });
        steps.fold(0.0, f64::max)
    }
}

/// Returns the quantile of the exponential distribution with mean 1.
fn standard_quantile(probability: f64) -> f64 {
    -libm::log1p(-probability)
}

/// Returns the time of this probability. The i-th of n runs has the probability (i − ½) / n; times
/// in between are interpolated linearly.
fn at(sorted: &[f64], runs: usize, probability: f64) -> Option<f64> {
    let position = (runs as f64 * probability - 0.5).max(0.0);
    let below = sorted.get(position.floor() as usize)?;
    let above = sorted.get(position.ceil() as usize)?;
    Some(below + (above - below) * position.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the distribution's quantiles as the times of all runs.
    fn times(law: ShiftedExponential, runs: u32) -> Vec<f64> {
        let quantile = |probability| law.shift + law.mean * standard_quantile(probability);
        (0..runs)
            .map(|i| quantile((f64::from(i) + 0.5) / f64::from(runs)))
            .collect()
    }

    #[test]
    fn a_shifted_exponential_is_found_again() {
        let law = ShiftedExponential { shift: 3.0, mean: 0.7 };
        for runs in [26, 102] {
            let mut times = times(law, runs);
            times.reverse();
            let fit = ShiftedExponential::fit(&times, times.len()).unwrap();
            assert!((fit.shift - 3.0).abs() < 1e-12 && (fit.mean - 0.7).abs() < 1e-12, "{fit:?}");
            assert!(fit.distance(&times, times.len()) <= 0.5 / f64::from(runs) + 1e-12);
        }
    }

    #[test]
    fn unsolved_runs_count_and_too_many_prevent_the_fit() {
        let law = ShiftedExponential { shift: 1.0, mean: 2.0 };
        let times = times(law, 26);
        let fit = ShiftedExponential::fit(&times[..20], 26).unwrap();
        assert!((fit.mean - 2.0).abs() < 1e-12, "{fit:?}");
        assert_eq!(ShiftedExponential::fit(&times[..18], 26), None);
        assert_eq!(ShiftedExponential::fit(&[1.0; 5], 5), None);
        assert_eq!(ShiftedExponential::fit(&[], 0), None);
    }

    #[test]
    fn no_run_is_solved_before_the_shift_and_as_many_later_as_the_times_say() {
        let law = ShiftedExponential { shift: 1.0, mean: 2.0 };
        assert_eq!(law.probability(0.5), 0.0);
        assert!((law.probability(times(law, 5)[4]) - 0.9).abs() < 1e-15);
    }
}
