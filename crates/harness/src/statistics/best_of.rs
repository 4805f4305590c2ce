//! The interval of the best of several fresh trials, predicted from a pool of finished trials.

use super::sorted;

/// The probability that the best of the fresh trials is below the interval; the same holds above
/// it.
const TAIL: f64 = 0.05;

/// The largest fraction of the pool to which a tail is fitted.
const FITTED: f64 = 0.1;

/// The minimum number of values to which a tail is fitted, unless the pool is smaller.
const FEWEST: usize = 5;

/// Returns the ends of an interval that holds the lowest of `m` fresh values with a probability of
/// at least 90 %. The fresh values are independent and have the same distribution as the pool.
///
/// The upper end is an order statistic of the pool; the lower end is one if the pool has at least
/// 19 `m` values. Their coverage is exact for every continuous distribution (Hahn & Meeker 1991). A
/// smaller pool has no order statistic that is low enough. Its lower end is the lowest
/// extrapolation by exponential tails of several lengths, which is too wide for a normal
/// distribution and close for a few rare low values. It is too narrow if hardly any value of the
/// pool shows the tail.
///
/// `None` if the pool has fewer than `m` values, or only one. O(N log N).
pub fn predicted_best(pool: &[f64], m: usize) -> Option<(f64, f64)> {
    let n = pool.len();
    if m == 0 || n < m || n < 2 {
        return None;
    }
    let sorted = sorted(pool);
    // All fresh values are above the pool's lowest with the probability n / (n + m).
    let below_all = m as f64 / (n + m) as f64;
    let low = if below_all <= TAIL { exact_low(&sorted, m) } else { extrapolated_low(&sorted, m) };
    Some((low, exact_high(&sorted, m)))
}

/// Returns the probabilities that all of `m` fresh values are above the pool's j-th value, j from
/// 1.
fn all_above(n: usize, m: usize) -> impl Iterator<Item = f64> {
    (0..n).scan(1.0, move |probability, passed| {
        *probability *= (n - passed) as f64 / (n + m - passed) as f64;
        Some(*probability)
    })
}

/// Returns the pool's highest value that the lowest fresh value undercuts with a probability of at
/// most [`TAIL`].
fn exact_low(sorted: &[f64], m: usize) -> f64 {
    let undercut = all_above(sorted.len(), m).map(|above| 1.0 - above);
    let allowed = undercut.take_while(|&undercut| undercut <= TAIL).count();
    sorted[allowed.max(1) - 1]
}

/// Returns the pool's lowest value that the lowest fresh value exceeds with a probability of at
/// most [`TAIL`].
fn exact_high(sorted: &[f64], m: usize) -> f64 {
    let at = all_above(sorted.len(), m).position(|above| above <= TAIL);
    sorted[at.unwrap_or(sorted.len() - 1)]
}

/// Returns the lowest end of tails that are fitted to a tenth of the values, to half as many, and
/// so on.
fn extrapolated_low(sorted: &[f64], m: usize) -> f64 {
    let mut low = sorted[0];
    let mut fitted = ((FITTED * sorted.len() as f64) as usize).max(FEWEST).min(sorted.len() - 1);
    while fitted > 0 {
        low = low.min(end_of_tail(sorted, m, fitted));
        fitted = if fitted >= 2 * FEWEST { fitted / 2 } else { 0 };
    }
    low
}

/// Returns the value below which [`TAIL`] of `m` fresh values are expected if the lowest `fitted`
/// values thin out exponentially. The scale of the tail is also estimated, hence its gaps follow a
/// Pareto distribution instead of an exponential one.
fn end_of_tail(sorted: &[f64], m: usize, fitted: usize) -> f64 {
    let n = sorted.len();
    let threshold = sorted[fitted];
    let scale = sorted[..fitted].iter().map(|value| threshold - value).sum::<f64>() / fitted as f64;
    let expected_below = m as f64 * (fitted + 1) as f64 / (n + 1) as f64;
    let scales = fitted as f64 * (libm::pow(expected_below / TAIL, 1.0 / fitted as f64) - 1.0);
    threshold - scales.max(0.0) * scale
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::minimum;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// A distribution to draw from.
    type Draw = fn(&mut ChaCha8Rng) -> f64;

    /// Draws a standard normal value by the method of Box and Muller.
    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        let (radius, angle): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }

    fn uniform(rng: &mut ChaCha8Rng) -> f64 {
        rng.random()
    }

    fn exponential_to_the_left(rng: &mut ChaCha8Rng) -> f64 {
        (1.0 - rng.random::<f64>()).ln()
    }

    /// Draws a value that is skewed to the right, like the costs of trials.
    fn log_normal(rng: &mut ChaCha8Rng) -> f64 {
        (0.5 * normal(rng)).exp()
    }

    /// Draws mostly one value and seldom a lower one, as trials with very little noise do.
    fn seldom_lower(rng: &mut ChaCha8Rng) -> f64 {
        if rng.random::<f64>() < 0.05 {
            0.02 * exponential_to_the_left(rng)
        } else {
            0.001 * rng.random::<f64>()
        }
    }

    const POOLS: usize = 1000;

    /// Returns the fractions of fresh best-of-`m` values below and above the intervals that pools
    /// of `n` predict.
    fn missed(draw: Draw, n: usize, m: usize) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(33);
        let mut below = 0;
        let mut above = 0;
        for _ in 0..POOLS {
            let pool: Vec<f64> = (0..n).map(|_| draw(&mut rng)).collect();
            let (low, high) = predicted_best(&pool, m).unwrap();
            let best = minimum((0..m).map(|_| draw(&mut rng))).unwrap();
            below += usize::from(best < low);
            above += usize::from(best > high);
        }
        (below as f64 / POOLS as f64, above as f64 / POOLS as f64)
    }

    #[test]
    fn nine_of_ten_fresh_bests_lie_in_the_interval_that_a_pool_predicts() {
        // Four standard deviations of a fraction of 5 % among this number of pools.
        let most = TAIL + 4.0 * (TAIL * (1.0 - TAIL) / POOLS as f64).sqrt();
        let light: [Draw; 4] = [normal, uniform, exponential_to_the_left, log_normal];
        for (n, m) in [(400, 10), (400, 100), (100, 100), (40, 10)] {
            for (kind, draw) in light.into_iter().enumerate() {
                let (below, above) = missed(draw, n, m);
                assert!(
                    below <= most && above <= most,
                    "{kind}, best of {m} from {n}: {below} and {above}"
                );
            }
        }
        for (n, m) in [(400, 10), (400, 100)] {
            let (below, above) = missed(seldom_lower, n, m);
            assert!(
                below <= most && above <= most,
                "seldom lower, best of {m} from {n}: {below} and {above}"
            );
        }
    }

    #[test]
    fn the_interval_is_not_much_wider_than_an_exponential_tail_needs() {
        let (below, above) = missed(exponential_to_the_left, 400, 100);
        assert!(below > 0.01 && above > 0.03, "{below} and {above}");
    }

    #[test]
    fn a_pool_that_is_large_enough_gives_ends_that_are_order_statistics() {
        let pool: Vec<f64> = (0..400).map(f64::from).collect();
        let (low, high) = predicted_best(&pool, 10).unwrap();
        // One of ten fresh values undercuts the lowest of 400 with the probability 10 / 410, and
        // the second lowest with nearly twice that probability.
        assert_eq!(low, 1.0);
        assert!(high.fract() == 0.0 && (90.0..120.0).contains(&high), "{high}");
        assert!(predicted_best(&pool, 100).unwrap().0 < 0.0);
        assert_eq!(predicted_best(&pool, 401), None);
        assert_eq!(predicted_best(&[1.0], 1), None);
        assert_eq!(predicted_best(&[2.0; 30], 10), Some((2.0, 2.0)));
    }
}
