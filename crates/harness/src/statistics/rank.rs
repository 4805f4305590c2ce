//! Significance tests of the difference between two methods. They use ranks and assume no
//! distribution.
//!
//! P values are two-sided: twice the smaller tail, at most 1. For samples of up to [`MOST_EXACT`]
//! values they are exact, even with ties: dynamic programming over sums of ranks counts all
//! assignments of the ranks. Larger samples use the normal approximation, with the variance
//! corrected for ties and the statistic for continuity.

use super::{ranks, sorted};

/// The maximum number of values for which all assignments are counted.
pub const MOST_EXACT: usize = 60;

/// The outcome of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// W⁺, the sum of the ranks of positive differences; or U, the number of pairs in which the
    /// first sample's value is greater. Ties count a half.
    pub statistic: f64,
    /// The probability of a statistic at least this extreme if there is no difference.
    pub p_value: f64,
}

/// Performs Wilcoxon's signed-rank test (Wilcoxon 1945) of paired differences, ignoring zeros.
/// `None` if all differences are zero.
pub fn wilcoxon_signed_rank(differences: &[f64]) -> Option<Test> {
    let differences: Vec<f64> = differences
        .iter()
        .copied()
        .filter(|&difference| difference != 0.0)
        .collect();
    (!differences.is_empty()).then(|| signed_ranks(&differences, differences.len() <= MOST_EXACT))
}

fn signed_ranks(differences: &[f64], exact: bool) -> Test {
    let ranks = ranks(
        &differences
            .iter()
            .map(|difference| difference.abs())
            .collect::<Vec<_>>(),
    );
    let positive = ranks
        .iter()
        .zip(differences)
        .filter(|(_, difference)| **difference > 0.0);
    let statistic: f64 = positive.map(|(rank, _)| rank).sum();
    let n = ranks.len() as f64;
    let p_value = if exact {
        two_sided(&subsets_by_sum(&ranks, None), statistic)
    } else {
        let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties(&ranks) / 48.0;
        normal_two_sided(statistic - n * (n + 1.0) / 4.0, variance)
    };
    Test { statistic, p_value }
}

/// Performs the Mann–Whitney U test (Mann & Whitney 1947) of two independent samples. `None` if
/// either is empty.
pub fn mann_whitney(first: &[f64], second: &[f64]) -> Option<Test> {
    let some = !first.is_empty() && !second.is_empty();
    some.then(|| rank_sum(first, second, first.len() + second.len() <= MOST_EXACT))
}

fn rank_sum(first: &[f64], second: &[f64], exact: bool) -> Test {
    let ranks = ranks(&[first, second].concat());
    let m = first.len() as f64;
    let n = second.len() as f64;
    let sum: f64 = ranks[..first.len()].iter().sum();
    let statistic = sum - m * (m + 1.0) / 2.0;
    let p_value = if exact {
        two_sided(&subsets_by_sum(&ranks, Some(first.len())), sum)
    } else {
        let all = m + n;
        let variance = m * n / 12.0 * (all + 1.0 - ties(&ranks) / (all * (all - 1.0)));
        normal_two_sided(statistic - m * n / 2.0, variance)
    };
    Test { statistic, p_value }
}

/// Returns the effect size A₁₂ (Vargha & Delaney 2000): the probability that a value of the first
/// sample is greater than a value of the second, where ties count a half. 0.5 is no difference.
/// `None` if either sample is empty.
pub fn a12(first: &[f64], second: &[f64]) -> Option<f64> {
    let pairs = (first.len() * second.len()) as f64;
    mann_whitney(first, second).map(|test| test.statistic / pairs)
}

/// Returns the least p-value that the signed-rank test can give for this number of nonzero
/// differences.
pub fn least_signed_rank(samples: usize) -> f64 {
    (2.0 * 0.5f64.powi(samples as i32)).min(1.0)
}

/// Returns the least p-value that the Mann–Whitney test can give for samples of these sizes:
/// 2 / C(m + n, m).
pub fn least_rank_sum(first: usize, second: usize) -> f64 {
    let sets = (1..=first)
        .map(|i| (second + i) as f64 / i as f64)
        .product::<f64>();
    (2.0 / sets).min(1.0)
}

/// Corrects the p-values of a family of tests (Holm 1979): with probability 1 − α, every difference
/// whose corrected value is below α exists.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut corrected = vec![0.0; p_values.len()];
    let mut highest = 0.0f64;
    for (done, at) in order.into_iter().enumerate() {
        highest = highest
            .max((p_values.len() - done) as f64 * p_values[at])
            .min(1.0);
        corrected[at] = highest;
    }
    corrected
}

/// Counts, for every s, the subsets of the ranks that have the sum s / 2 and, if given, this
/// `size`. Ranks are multiples of a half. O(n · size · s).
fn subsets_by_sum(ranks: &[f64], size: Option<usize>) -> Vec<f64> {
    let doubled: Vec<usize> = ranks
        .iter()
        .map(|rank| (2.0 * rank) as usize)
        .collect();
    let sums = doubled.iter().sum::<usize>() + 1;
    // Without a size, all sizes are counted together.
    let mut counts = vec![vec![0.0; sums]; size.unwrap_or(0) + 1];
    counts[0][0] = 1.0;
    for rank in doubled {
        for to in (0..counts.len()).rev() {
            let from = if size.is_some() { to.checked_sub(1) } else { Some(to) };
            let Some(from) = from else { continue };
            for sum in (rank..sums).rev() {
                counts[to][sum] += counts[from][sum - rank];
            }
        }
    }
    counts.pop().unwrap_or_default()
}

/// Returns twice the smaller tail at `sum` of a distribution over multiples of a half.
fn two_sided(counts: &[f64], sum: f64) -> f64 {
    let at = (2.0 * sum) as usize;
    let (below, above): (f64, f64) = (counts[..=at].iter().sum(), counts[at..].iter().sum());
    (2.0 * below.min(above) / counts.iter().sum::<f64>()).min(1.0)
}

/// Returns Σ t³ − t over groups of t equal ranks.
fn ties(ranks: &[f64]) -> f64 {
    sorted(ranks)
        .chunk_by(|a, b| a == b)
        .map(|group| group.len() as f64)
        .map(|t| t * t * t - t)
        .sum()
}

/// Returns twice the tail beyond `deviation` − ½ of a normal distribution with this variance.
fn normal_two_sided(deviation: f64, variance: f64) -> f64 {
    if variance <= 0.0 {
        return 1.0;
    }
    let z = (deviation.abs() - 0.5).max(0.0) / variance.sqrt();
    libm::erfc(z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::approx_constant, reason = "3.14 is a measurement here")]
    fn the_worked_examples_of_hollander_and_wolfe_come_out() {
        // Hollander & Wolfe 1973, depression scale before and after (p. 29) and permeability of
        // membranes (p. 69), as in the manual of R's wilcox.test: one-sided p-values 0.01953 and
        // 0.1272.
        let before = [1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30];
        let after = [0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29];
        let differences: Vec<f64> = before
            .iter()
            .zip(after)
            .map(|(before, after)| before - after)
            .collect();
        let test = wilcoxon_signed_rank(&differences).unwrap();
        assert_eq!(test.statistic, 40.0);
        assert!((test.p_value / 2.0 - 0.01953).abs() < 5e-6, "{test:?}");
        let term = [0.80, 0.83, 1.89, 1.04, 1.45, 1.38, 1.91, 1.64, 0.73, 1.46];
        let early = [1.15, 0.88, 0.90, 0.74, 1.21];
        let test = mann_whitney(&term, &early).unwrap();
        assert_eq!(test.statistic, 35.0);
        assert!((test.p_value / 2.0 - 0.1272).abs() < 5e-5, "{test:?}");
        assert_eq!(a12(&term, &early), Some(0.7));
    }

    /// Returns twice the smaller tail at `found` of the `statistic` over all `sets`.
    fn by_enumeration(
        sets: impl Iterator<Item = u32>,
        found: f64,
        statistic: impl Fn(u32) -> f64,
    ) -> f64 {
        let all: Vec<f64> = sets.map(statistic).collect();
        let below = all.iter().filter(|&&value| value <= found);
        let above = all.iter().filter(|&&value| value >= found);
        let tail = below.count().min(above.count()) as f64 / all.len() as f64;
        (2.0 * tail).min(1.0)
    }

    #[test]
    fn exact_p_values_are_those_of_all_assignments_ties_included() {
        let values = [3.0, -1.0, 2.0, 2.0, -3.0, 5.0, 1.0, 4.0, 3.0, 8.0];
        for n in 1..=values.len() {
            let values = &values[..n];
            let sizes: Vec<f64> = values.iter().copied().map(f64::abs).collect();
            let ranks = ranks(&sizes);
            let test = wilcoxon_signed_rank(values).unwrap();
            let expected = by_enumeration(0..1 << n, test.statistic, |set| {
                let chosen = (0..n).filter(|i| set >> i & 1 == 1);
                chosen.map(|i| ranks[i]).sum()
            });
            assert!((test.p_value - expected).abs() < 1e-12, "{n}: {test:?}, {expected}");
        }
        for split in 1..values.len() {
            let (first, second) = values.split_at(split);
            let test = mann_whitney(first, second).unwrap();
            let sets =
                (0..1 << values.len()).filter(|set: &u32| set.count_ones() as usize == split);
            let expected = by_enumeration(sets, test.statistic, |set| pairs_won(&values, set));
            assert!((test.p_value - expected).abs() < 1e-12, "{split}: {test:?}, {expected}");
        }
    }

    /// Counts the pairs in which the value of the set is greater than the other; ties count a half.
    fn pairs_won(values: &[f64], set: u32) -> f64 {
        let mut won = 0.0;
        for (i, a) in values.iter().enumerate() {
            for (j, b) in values.iter().enumerate() {
                if set >> i & 1 == 1 && set >> j & 1 == 0 {
                    won += if a == b { 0.5 } else { f64::from(u8::from(a > b)) };
                }
            }
        }
        won
    }

    #[test]
    fn the_normal_approximation_is_near_the_exact_values_where_it_takes_over() {
        for shift in [0.3, 1.0, 2.6, 4.7] {
            let paired = shifted_values(MOST_EXACT, shift);
            let first = shifted_values(MOST_EXACT / 2, shift);
            let second = shifted_values(MOST_EXACT / 2, 0.0);
            for [exact, approximate] in [
                [true, false].map(|is_exact| signed_ranks(&paired, is_exact)),
                [true, false].map(|is_exact| rank_sum(&first, &second, is_exact)),
            ] {
                let difference = (exact.p_value - approximate.p_value).abs();
                assert!(difference < 0.003, "{exact:?}, {approximate:?}");
                assert_eq!(exact.statistic, approximate.statistic);
            }
        }
    }

    fn shifted_values(count: usize, shift: f64) -> Vec<f64> {
        (0..count)
            .map(|i| ((i * 37) % 23) as f64 - 11.0 + shift)
            .collect()
    }

    #[test]
    fn the_least_p_values_are_those_of_samples_without_overlap() {
        for n in 1..9 {
            let differences: Vec<f64> = (1..=n).map(f64::from).collect();
            let found = wilcoxon_signed_rank(&differences)
                .unwrap()
                .p_value;
            assert!((found - least_signed_rank(differences.len())).abs() < 1e-12, "{n}");
            let above: Vec<f64> = (0..7).map(|i| 100.0 + f64::from(i)).collect();
            let found = mann_whitney(&differences, &above)
                .unwrap()
                .p_value;
            assert!((found - least_rank_sum(differences.len(), above.len())).abs() < 1e-12, "{n}");
        }
    }

    #[test]
    fn nothing_differs_from_itself() {
        assert_eq!(wilcoxon_signed_rank(&[0.0; 5]), None);
        assert_eq!(
            mann_whitney(&[1.0; 4], &[1.0; 70])
                .unwrap()
                .p_value,
            1.0
        );
        assert_eq!(
            (a12(&[1.0; 4], &[1.0; 7]), a12(&[2.0], &[1.0]), a12(&[], &[1.0])),
            (Some(0.5), Some(1.0), None)
        );
    }

    #[test]
    fn holm_multiplies_the_least_by_their_number_and_keeps_the_order() {
        let corrected = holm(&[0.01, 0.04, 0.03, 0.005, 0.9]);
        for (found, expected) in corrected
            .iter()
            .zip([0.04, 0.09, 0.09, 0.025, 0.9])
        {
            assert!((found - expected).abs() < 1e-15, "{corrected:?}");
        }
    }
}
