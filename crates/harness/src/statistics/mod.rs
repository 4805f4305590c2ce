//! Statistics: quantiles, intervals, the expected best of several trials, correlations.

pub mod best_of;

/// Returns the values in ascending order.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// Returns the `q`-quantile of values that are not NaN, 0 ≤ q ≤ 1, interpolated linearly between order
/// statistics; `None` if there are no values.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let sorted = sorted(values);
    let position = q * (sorted.len().checked_sub(1)? as f64);
    let below = sorted[position.floor() as usize];
    let above = sorted[position.ceil() as usize];
    // The difference of two infinite values is NaN.
    Some(if below == above { below } else { below + (above - below) * position.fract() })
}

/// Returns the median of finite values; `None` if there are no values.
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// Returns two of the values that enclose the median of their distribution with a probability of at
/// least 95 %: the narrowest pair of order statistics with equally many values outside on both
/// sides (the interval of the sign test).
///
/// Returns the lowest and the highest of fewer than six values, which enclose the median with a
/// lower probability, and `None` if there are no values. O(N log N).
pub fn median_interval(values: &[f64]) -> Option<(f64, f64)> {
    let sorted = sorted(values);
    let n = sorted.len();
    let last = n.checked_sub(1)?;
    // Probability that exactly `left_out` of the values are below the median.
    let mut exactly = 0.5f64.powi(n as i32);
    let mut at_most = 0.0;
    let mut left_out = 0;
    while left_out < last - left_out {
        at_most += exactly;
        if at_most > 0.025 {
            break;
        }
        exactly *= (n - left_out) as f64 / (left_out + 1) as f64;
        left_out += 1;
    }
    let left_out = left_out.saturating_sub(1);
    Some((sorted[left_out], sorted[last - left_out]))
}

/// Returns the lower quartile, the median and the upper quartile of finite values; NaN if there are
/// no values.
pub fn quartiles(values: &[f64]) -> [f64; 3] {
    [0.25, 0.5, 0.75].map(|q| quantile(values, q).unwrap_or(f64::NAN))
}

/// Returns the lowest and the highest value.
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    })
}

/// Returns the lowest value.
pub fn minimum(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    values.into_iter().min_by(f64::total_cmp)
}

/// Returns the exact expectation of the lowest of `m` values drawn without replacement from a pool:
/// E\[min of m\] = Σᵢ c₍ᵢ₎ · C(N − i, m − 1) / C(N, m), values ascending. `None` unless 1 ≤ m ≤ N.
/// O(N log N).
pub fn expected_best_of(pool: &[f64], m: usize) -> Option<f64> {
    let n = pool.len();
    if m == 0 || m > n {
        return None;
    }
    let sorted = sorted(pool);
    // Each weight follows from the previous one, which avoids binomials that overflow.
    let mut weight = m as f64 / n as f64;
    let mut expected = 0.0;
    for (i, value) in (1..=n - m + 1).zip(sorted) {
        expected += weight * value;
        if i < n {
            weight *= (n - i + 1 - m) as f64 / (n - i) as f64;
        }
    }
    Some(expected)
}

/// Half the width of the normal distribution's central 95 % interval, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Returns the mean of values; NaN if there are no values.
pub fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

/// Returns the geometric mean of positive values; NaN if there are no values.
pub fn geometric_mean(values: &[f64]) -> f64 {
    libm::exp(values.iter().copied().map(libm::log).sum::<f64>() / values.len() as f64)
}

/// Returns the variance of the distribution that values are drawn from; `None` for fewer than two
/// values.
pub fn variance(values: &[f64]) -> Option<f64> {
    let freedom = values.len().checked_sub(1).filter(|&freedom| freedom > 0)?;
    let mean = mean(values.iter().copied());
    Some(values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / freedom as f64)
}

/// Returns the standard error of the mean of values; `None` for fewer than two values.
pub fn standard_error(values: &[f64]) -> Option<f64> {
    variance(values).map(|variance| (variance / values.len() as f64).sqrt())
}

/// Returns the mean of values and the 95 % interval of their distribution's mean, by Student's t.
///
/// Fewer than two values have no interval, and no values have no mean.
pub fn mean_interval(values: &[f64]) -> Option<(f64, Option<(f64, f64)>)> {
    if values.is_empty() {
        return None;
    }
    let mean = mean(values.iter().copied());
    let half = student(values.len()).zip(standard_error(values));
    let half = half.map(|(factor, error)| factor * error);
    Some((mean, half.map(|half| (mean - half, mean + half))))
}

/// Returns half the width of the 95 % interval of a mean, in standard errors; `None` for fewer than
/// two values.
pub fn student(values: usize) -> Option<f64> {
    let freedom = values.checked_sub(1).filter(|&freedom| freedom > 0)?;
    STUDENT.get(freedom - 1).or(STUDENT.last()).copied()
}

/// The 97.5 % quantiles of Student's t for 1 to 20 degrees of freedom. The last one also serves
/// more degrees of freedom, for which it is slightly too wide.
const STUDENT: [f64; 20] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
];

/// Returns Pearson's correlation of pairs; `None` for fewer than two, or if either side is
/// constant.
pub fn pearson(pairs: &[(f64, f64)]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean_x = pairs.iter().map(|pair| pair.0).sum::<f64>() / n;
    let mean_y = pairs.iter().map(|pair| pair.1).sum::<f64>() / n;
    let centred = pairs.iter().map(|&(x, y)| (x - mean_x, y - mean_y));
    let xx: f64 = centred.clone().map(|(x, _)| x * x).sum();
    let yy: f64 = centred.clone().map(|(_, y)| y * y).sum();
    let xy: f64 = centred.map(|(x, y)| x * y).sum();
    (pairs.len() > 1 && xx > 0.0 && yy > 0.0).then(|| xy / (xx.sqrt() * yy.sqrt()))
}

/// Returns the 95 % interval of Pearson's correlation by Fisher's transformation; `None` for fewer
/// than four pairs.
pub fn pearson_interval(correlation: f64, pairs: usize) -> Option<(f64, f64)> {
    let freedom = pairs.checked_sub(3).filter(|&freedom| freedom > 0)?;
    let half = NORMAL_95 / (freedom as f64).sqrt();
    // The transformed correlation is nearly normal with a known variance.
    let transformed = libm::atanh(correlation);
    Some((libm::tanh(transformed - half), libm::tanh(transformed + half)))
}

/// Returns Spearman's rank correlation of pairs: Pearson's correlation of their ranks. Equal values
/// share their mean rank.
pub fn spearman(pairs: &[(f64, f64)]) -> Option<f64> {
    let (first, second): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let rank_pairs: Vec<(f64, f64)> = ranks(&first).into_iter().zip(ranks(&second)).collect();
    pearson(&rank_pairs)
}

/// Returns the rank of every value, from 1. Equal values share their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for ties in order.chunk_by(|&a, &b| values[a] == values[b]) {
        for &index in ties {
            ranks[index] = before as f64 + (ties.len() as f64 + 1.0) / 2.0;
        }
        before += ties.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_order_statistics() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!([0.0, 0.5, 1.0].map(|q| quantile(&values, q).unwrap()), [1.0, 2.5, 4.0]);
        assert_eq!(median(&[]), None);
        // Like the times of runs that never end.
        assert_eq!(
            [0.0, 0.5].map(|q| quantile(&[f64::INFINITY, 1.0], q)),
            [Some(1.0), Some(f64::INFINITY)]
        );
        assert_eq!(median(&[f64::INFINITY; 3]), Some(f64::INFINITY));
    }

    #[test]
    fn the_expected_best_equals_the_mean_over_all_subsets() {
        let pool = [5.0, 1.0, 4.0, 4.0, 9.0, 2.5, 7.0];
        for m in 1..=pool.len() {
            let minima: Vec<f64> = (0u32..1 << pool.len())
                .filter(|set| set.count_ones() as usize == m)
                .map(|set| {
                    minimum((0..pool.len()).filter(|i| set & (1 << i) != 0).map(|i| pool[i]))
                        .unwrap()
                })
                .collect();
            let mean = minima.iter().sum::<f64>() / minima.len() as f64;
            assert!((expected_best_of(&pool, m).unwrap() - mean).abs() < 1e-12, "m = {m}");
        }
        assert_eq!(expected_best_of(&pool, 8), None);
    }

    #[test]
    fn the_interval_of_a_median_is_that_of_the_sign_test() {
        // The 8th and the 18th value: 7 or fewer of 25 coins show heads with the probability
        // 0.0216, 8 or fewer with 0.054.
        let values: Vec<f64> = (1..=25).rev().map(f64::from).collect();
        assert_eq!(median_interval(&values), Some((8.0, 18.0)));
        assert_eq!(median_interval(&values[..6]), Some((20.0, 25.0)));
        assert_eq!(median_interval(&values[..2]), Some((24.0, 25.0)));
        assert_eq!(median_interval(&[3.0]), Some((3.0, 3.0)));
        assert_eq!(median_interval(&[]), None);
    }

    #[test]
    fn the_interval_of_a_mean_is_students() {
        assert_eq!(mean_interval(&[]), None);
        assert_eq!(mean_interval(&[2.5]), Some((2.5, None)));
        // Mean 3, standard deviation √2.5, over √5.
        let (mean, interval) = mean_interval(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        let (low, high) = interval.unwrap();
        assert!(mean == 3.0 && (low - 1.037).abs() < 1e-3 && (high - 4.963).abs() < 1e-3);
        let (_, interval) = mean_interval(&[7.0; 40]).unwrap();
        assert_eq!(interval, Some((7.0, 7.0)));
    }

    #[test]
    fn the_interval_of_a_correlation_is_fishers() {
        // The textbook's example: 0.5 of 28 pairs.
        let (low, high) = pearson_interval(0.5, 28).unwrap();
        assert!((low - 0.156).abs() < 1e-3 && (high - 0.736).abs() < 1e-3, "{low} {high}");
        assert_eq!(pearson_interval(1.0, 10), Some((1.0, 1.0)));
        assert_eq!(pearson_interval(0.5, 3), None);
    }

    #[test]
    fn correlations_are_one_for_what_rises_together() {
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 - 2.0 * f64::from(i))).collect();
        assert!((pearson(&line).unwrap() + 1.0).abs() < 1e-12);
        let cubes: Vec<_> = (0..9).map(|i| (f64::from(i), f64::from(i * i * i))).collect();
        assert!((spearman(&cubes).unwrap() - 1.0).abs() < 1e-12 && pearson(&cubes).unwrap() < 0.95);
        assert_eq!(ranks(&[2.0, 1.0, 2.0, 5.0]), [2.5, 1.0, 2.5, 4.0]);
        assert_eq!(pearson(&[(1.0, 2.0), (1.0, 3.0)]), None);
    }
}
