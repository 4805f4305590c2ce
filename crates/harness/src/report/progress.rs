//! The costs of runs over wall time.

use super::data::Rows;

/// The value of a run that has none, such as a run without an incumbent: worse than every other.
pub const WORST: f64 = f64::INFINITY;

/// The incumbents of a run: seconds since its start, and cost.
pub type Series = Vec<(f64, f64)>;

/// Returns the incumbents of every run of a method on a scene.
pub fn series(rows: &Rows, scene: &str, method: &str) -> Vec<Series> {
    let mut points = Vec::new();
    for (index, row) in rows.history.iter().enumerate() {
        if row.scene == scene && row.method == method {
            // `timing_history.csv` has one row for every row of `history.csv`, in the same order.
            let seconds = rows.clock.get(index).map_or(f64::NAN, |clock| clock.seconds);
            points.push((row.repetition, (seconds, row.incumbent)));
        }
    }
    points
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| run.iter().map(|(_, point)| *point).collect())
        .collect()
}

/// Returns the seconds after which a run first had an incumbent of at most this cost, if it ever
/// had.
pub fn reached(run: &Series, cost: f64) -> Option<f64> {
    run.iter().find(|(_, incumbent)| *incumbent <= cost).map(|(seconds, _)| *seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_reached_by_the_first_incumbent_at_or_below_it() {
        let run = vec![(1.0, 9.0), (2.0, 7.0), (5.0, 6.0)];
        let when = [9.5, 7.0, 6.5, 1.0].map(|cost| reached(&run, cost));
        assert_eq!(when, [Some(1.0), Some(2.0), Some(5.0), None]);
    }
}
