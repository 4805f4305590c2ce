//! Ratios of times from interleaved rounds, which cancel a drift of the machine's speed.

use harness::statistics::quantile;
use std::time::Instant;

/// A named piece of work.
pub type Contender<'a> = (&'a str, Box<dyn FnMut() + 'a>);

/// Runs all contenders in `rounds` interleaved rounds after a warm-up. Prints the median and the
/// least time of each, and the quartiles of its ratio to the first contender in the same round.
pub fn compare(title: &str, rounds: usize, contenders: Vec<Contender<'_>>) {
    compare_each_after(|| (), title, rounds, contenders);
}

/// Does the same as [`compare`], with untimed work before each contender.
pub fn compare_each_after(
    mut before: impl FnMut(),
    title: &str,
    rounds: usize,
    mut contenders: Vec<Contender<'_>>,
) {
    let mut seconds = vec![Vec::with_capacity(rounds); contenders.len()];
    for round in 0..=rounds {
        for ((_, work), times) in contenders.iter_mut().zip(&mut seconds) {
            before();
            let start = Instant::now();
            work();
            if round > 0 {
                times.push(start.elapsed().as_secs_f64());
            }
        }
    }
    println!("\n{title}");
    for ((name, _), times) in contenders.iter().zip(&seconds) {
        let ratios: Vec<f64> =
            times.iter().zip(&seconds[0]).map(|(own, first)| own / first).collect();
        let [low, middle, high] =
            [0.25, 0.5, 0.75].map(|q| quantile(&ratios, q).unwrap_or(f64::NAN));
        let median = quantile(times, 0.5).unwrap_or(f64::NAN) * 1e3;
        let least = times.iter().copied().fold(f64::INFINITY, f64::min) * 1e3;
        println!(
            "  {name:<44} {median:9.3} ms, least {least:9.3} ms   ratio {middle:.4}  ({low:.4} to {high:.4})"
        );
    }
}
