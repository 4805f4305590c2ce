//! Tests of whether one method is really better than another: by ranks, so that no distribution is assumed.
//!
//! P values are two-sided: twice the smaller tail, at most 1. For samples of up to [`MOST_EXACT`] values they are
//! exact, given the ranks, ties included: every assignment of the ranks is counted, by dynamic programming over their
//! sums. Larger samples use the normal approximation with the variance corrected for ties and the statistic for
//! continuity.

use super::{ranks, sorted};

/// The most values for which all assignments are counted.
pub const MOST_EXACT: usize = 60;

/// The outcome of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// W⁺, the sum of the ranks of positive differences; or U, the number of pairs in which the first sample's value is
    /// the greater one, ties counting a half.
    pub statistic: f64,
    /// How likely a statistic as far out or farther is if there is no difference.
    pub p_value: f64,
}

/// Wilcoxon's signed-rank test (Wilcoxon 1945) of paired differences; those of 0 are left out. `None` if no others are
/// left.
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

/// The Mann–Whitney U test (Mann & Whitney 1947) of two independent samples. `None` if either is empty.
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

/// The effect size A₁₂ (Vargha & Delaney 2000): how likely a value of the first sample is greater than one of the
/// second, ties counting a half. 0.5 is no difference. `None` if either is empty.
pub fn a12(first: &[f64], second: &[f64]) -> Option<f64> {
    let pairs = (first.len() * second.len()) as f64;
    mann_whitney(first, second).map(|test| test.statistic / pairs)
}

/// The least p-value that the signed-rank test can give with so many differences, none of them 0.
pub fn least_signed_rank(samples: usize) -> f64 {
    (2.0 * 0.5f64.powi(samples as i32)).min(1.0)
}

/// The least p-value that the Mann–Whitney test can give with samples of these sizes: 2 / C(m + n, m).
pub fn least_rank_sum(first: usize, second: usize) -> f64 {
    let sets = (1..=first)
        .map(|i| (second + i) as f64 / i as f64)
        .product::<f64>();
    (2.0 / sets).min(1.0)
}

/// P values of tests made together, corrected so that all of those below α are right with probability 1 − α (Holm
/// 1979).
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

/// How many subsets of the ranks, of `size` if that is given, have the sum s / 2, for every s. Ranks are multiples of a
/// half. O(n · size · s).
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

/// Twice the smaller tail at `sum`, of a distribution over halves.
fn two_sided(counts: &[f64], sum: f64) -> f64 {
    let at = (2.0 * sum) as usize;
    let (below, above): (f64, f64) = (counts[..=at].iter().sum(), counts[at..].iter().sum());
    (2.0 * below.min(above) / counts.iter().sum::<f64>()).min(1.0)
}

/// Σ t³ − t over groups of t equal ranks.
fn ties(ranks: &[f64]) -> f64 {
    sorted(ranks)
        .chunk_by(|a, b| a == b)
        .map(|group| group.len() as f64)
        .map(|t| t * t * t - t)
        .sum()
}

/// Twice the tail beyond `deviation` less a half, of a normal distribution of this variance.
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
        // Hollander & Wolfe 1973, depression scale before and after (p. 29) and permeability of membranes (p. 69), as
        // in the manual of R's wilcox.test: one-sided p-values 0.01953 and 0.1272.
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

    /// The smaller tail at `found`, doubled, of what `statistic` is over all of `sets`.
    fn by_enumeration(
        sets: impl Iterator<Item = u32>,
        found: f64,
        statistic: impl Fn(u32) -> f64,
    ) -> f64 {
        let all: Vec<f64> = sets.map(statistic).collect();
        let tail = |count: usize| count as f64 / all.len() as f64;
        let below = tail(
            all.iter()
                .filter(|&&value| value <= found)
                .count(),
        );
        (2.0 * below.min(tail(
            all.iter()
                .filter(|&&value| value >= found)
                .count(),
        )))
        .min(1.0)
    }

    #[test]
    fn exact_p_values_are_those_of_all_assignments_ties_included() {
        let values = [3.0, -1.0, 2.0, 2.0, -3.0, 5.0, 1.0, 4.0, 3.0, 8.0];
        for n in 1..=values.len() {
            let values = &values[..n];
            let ranks = ranks(
                &values
                    .iter()
                    .map(|value: &f64| value.abs())
                    .collect::<Vec<_>>(),
            );
            let sum = |set: u32| {
                (0..n)
                    .filter(|i| set >> i & 1 == 1)
                    .map(|i| ranks[i])
                    .sum::<f64>()
            };
            let test = wilcoxon_signed_rank(values).unwrap();
            let expected = by_enumeration(0..1 << n, test.statistic, sum);
            assert!((test.p_value - expected).abs() < 1e-12, "{n}: {test:?}, {expected}");
        }
        for split in 1..values.len() {
            let (first, second) = values.split_at(split);
            let u = |set: u32| -> f64 {
                let of = |side: u32| (0..values.len()).filter(move |i| set >> i & 1 == side);
                let half = |a: f64, b: f64| if a == b { 0.5 } else { f64::from(u8::from(a > b)) };
                of(1)
                    .flat_map(|i| of(0).map(move |j| (i, j)))
                    .map(|(i, j)| half(values[i], values[j]))
                    .sum()
            };
            let test = mann_whitney(first, second).unwrap();
            let sets =
                (0..1 << values.len()).filter(|set: &u32| set.count_ones() as usize == split);
            let expected = by_enumeration(sets, test.statistic, u);
            assert!((test.p_value - expected).abs() < 1e-12, "{split}: {test:?}, {expected}");
        }
    }

    #[test]
    fn the_normal_approximation_is_near_the_exact_values_where_it_takes_over() {
        let values = |count: usize, shift: f64| -> Vec<f64> {
            (0..count)
                .map(|i| ((i * 37) % 23) as f64 - 11.0 + shift)
                .collect()
        };
        let near = |[exact, approximate]: [Test; 2]| {
            let difference = (exact.p_value - approximate.p_value).abs();
            assert!(
                difference < 0.003 && exact.statistic == approximate.statistic,
                "{exact:?}, {approximate:?}"
            );
        };
        for shift in [0.3, 1.0, 2.6, 4.7] {
            near([true, false].map(|exact| signed_ranks(&values(MOST_EXACT, shift), exact)));
            let half = MOST_EXACT / 2;
            near(
                [true, false]
                    .map(|exact| rank_sum(&values(half, shift), &values(half, 0.0), exact)),
            );
        }
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
