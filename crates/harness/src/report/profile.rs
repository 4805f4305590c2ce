//! Performance profiles (Dolan & Moré 2002): on what fraction of the problems a method is within a factor of the
//! fastest.

use super::attempt::attempts;
use super::config::Targets;
use super::prelude::*;
use super::progress::ProgressAxis;

/// One method on one problem, as written to `timing_profile.csv`, `profile_evaluations.csv` and `profile_work.csv`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Row<'a> {
    scene: &'a str,
    target: String,
    method: &'a str,
    /// Median over repetitions; empty if the median run never reached the target.
    x: Option<f64>,
    /// Over the fastest method's.
    ratio_to_fastest: Option<f64>,
}

pub(super) fn write(config: &Targets, rows: &Rows) -> Result<Output, Error> {
    let mut output = Output::new(&config.source, &config.title);
    for axis in ProgressAxis::of(rows, &config.methods) {
        let table = ratios(config, rows, axis);
        let problems = table.len() / config.methods.len().max(1);
        axis.add_csv(&mut output, "profile", &table)?;
        let caption = format!(
            "On what fraction of {problems} problems the median run is within a factor of the fastest method's. A \
             problem is a scene with a target: {}. A method that ends before a target for want of budget counts as never reaching it.",
            each(&config.targets, |target| Some(target.to_string()))
        );
        let panels = vec![draw(config, &table, problems, axis)];
        output.add_figure(axis.file("profile"), caption, 1, panels);
        if axis == ProgressAxis::Work {
            output.reading = reading(config, &table, problems);
        }
    }
    Ok(output)
}

/// Every method on every problem, problem by problem.
fn ratios<'a>(config: &'a Targets, rows: &'a Rows, axis: ProgressAxis) -> Vec<Row<'a>> {
    let attempts = attempts(config, rows, axis);
    let problems = attempts.chunks(config.methods.len().max(1));
    let of_problem = problems.flat_map(|attempts| {
        let fastest = attempts
            .iter()
            .filter_map(|attempt| attempt.median)
            .reduce(f64::min);
        attempts.iter().map(move |attempt| Row {
            scene: attempt.scene,
            target: attempt.target.to_string(),
            method: attempt.method,
            x: attempt.median,
            ratio_to_fastest: attempt
                .median
                .zip(fastest)
                .map(|(x, fastest)| x / fastest),
        })
    });
    of_problem.collect()
}

fn draw(config: &Targets, table: &[Row], problems: usize, axis: ProgressAxis) -> Panel {
    let end = table
        .iter()
        .filter_map(|row| row.ratio_to_fastest)
        .fold(1.0, f64::max)
        * 1.2;
    let layer = |method: &String| {
        let own = table.iter().filter(|row| row.method == method);
        let mut ratios: Vec<f64> = own
            .filter_map(|row| row.ratio_to_fastest)
            .collect();
        ratios.sort_by(f64::total_cmp);
        Layer::new(method, Marks::Steps(profile(&ratios, problems, end)))
    };
    let x = Axis::log(format!("{} over that of the fastest method", axis.label())).range(1.0, end);
    let y = Axis::linear("fraction of problems").range(0.0, 1.02);
    panel("", x, y, config.methods.iter().map(layer).collect())
}

/// The fraction of the problems whose sorted ratio is at most x, from 1 to `end`.
fn profile(ratios: &[f64], problems: usize, end: f64) -> Vec<(f64, f64)> {
    let fraction = |count: usize| count as f64 / problems as f64;
    let fastest = ratios
        .iter()
        .filter(|ratio| **ratio <= 1.0)
        .count();
    let mut steps = vec![(1.0, fraction(fastest))];
    steps.extend(
        ratios
            .iter()
            .zip(1..)
            .skip(fastest)
            .map(|(&ratio, count)| (ratio, fraction(count))),
    );
    steps.push((end, fraction(ratios.len())));
    steps
}

fn reading(config: &Targets, table: &[Row], problems: usize) -> String {
    let solved = each(&config.methods, |method| {
        let own = || {
            table
                .iter()
                .filter(|row| row.method == method)
                .filter_map(|row| row.ratio_to_fastest)
        };
        let fastest = own().filter(|ratio| *ratio <= 1.0).count();
        Some(format!("{method} {} ({fastest} as the fastest)", own().count()))
    });
    format!("Of {problems} problems, a scene with a target each, solved by work: {solved}.")
}

#[cfg(test)]
mod tests {
    use super::profile;

    #[test]
    fn a_profile_begins_with_the_wins_and_ends_with_what_was_solved() {
        assert_eq!(
            profile(&[1.0, 2.0, 2.5], 4, 3.0),
            [(1.0, 0.25), (2.0, 0.5), (2.5, 0.75), (3.0, 0.75)]
        );
        assert_eq!(profile(&[], 4, 3.0), [(1.0, 0.0), (3.0, 0.0)]);
    }
}
