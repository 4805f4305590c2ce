//! How far runs have come along the three axes of run time: wall seconds, evaluations, and work
//! units.

use super::data::Rows;
use super::output::Output;
use crate::Error;
use figures::Axis;
use serde::Serialize;

/// The value of a run that has none, such as a run without an incumbent: worse than every other.
pub const WORST: f64 = f64::INFINITY;

/// A measure of run time. Seconds belong to a machine and go into timing files only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgressAxis {
    /// Wall time.
    Seconds,
    /// Trees or moves.
    Evaluations,
    /// Nodes made or visited.
    Work,
}

impl ProgressAxis {
    /// Every axis.
    pub const ALL: [Self; 3] = [Self::Seconds, Self::Evaluations, Self::Work];

    /// The axes along which these methods can be compared. Where some count whole trees and others
    /// single moves, evaluations are not among them: a run that builds a tree with every evaluation
    /// visits at least as many nodes as there are objects.
    pub fn of(rows: &Rows, methods: &[String]) -> Vec<Self> {
        let own = rows
            .runs
            .iter()
            .filter(|run| methods.contains(&run.method));
        let mut trees = own.map(|run| run.work >= run.evaluations * run.objects as u64);
        let first = trees.next();
        let alike = trees.all(|of_run| Some(of_run) == first);
        Self::ALL
            .into_iter()
            .filter(|&axis| axis != Self::Evaluations || alike)
            .collect()
    }

    /// The name of a column of a CSV file, and what stands along an axis of a figure.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Seconds => ("seconds", "time (s)"),
            Self::Evaluations => ("evaluations", "evaluations (trees or moves)"),
            Self::Work => ("work", "work (nodes made or visited)"),
        }
    }

    /// Returns the label of an axis of a figure.
    pub fn label(self) -> &'static str {
        self.names().1
    }

    /// An axis of a figure.
    pub fn axis(self) -> Axis {
        Axis::log(self.label())
    }

    /// The name, without extension, of a file of this kind.
    pub fn file(self, kind: &str) -> String {
        match self {
            Self::Seconds => format!("timing_{kind}"),
            Self::Evaluations | Self::Work => format!("{kind}_{}", self.names().0),
        }
    }

    /// Adds a CSV file of rows whose column `x` is measured along this axis, and is called after
    /// it.
    pub fn add_csv(
        self,
        output: &mut Output,
        kind: &str,
        rows: &[impl Serialize],
    ) -> Result<(), Error> {
        output.add_csv(self.file(kind), rows)?;
        if let Some((_, bytes)) = output.csv.last_mut() {
            // All axes share one type of rows, so the column `x` gets its name here.
            let end = bytes
                .iter()
                .position(|&byte| byte == b'\n')
                .unwrap_or(bytes.len());
            let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
            let named = |column| if column == "x" { self.names().0 } else { column };
            let columns: Vec<&str> = header.split(',').map(named).collect();
            bytes.splice(..end, columns.join(",").into_bytes());
        }
        Ok(())
    }
}

/// The incumbents of a run: place along the axis, and cost.
pub type Series = Vec<(f64, f64)>;

/// Returns the incumbents of every run of a method on a scene.
pub fn series(rows: &Rows, scene: &str, method: &str, axis: ProgressAxis) -> Vec<Series> {
    let own = rows
        .history
        .iter()
        .enumerate()
        .filter(|(_, row)| row.scene == scene && row.method == method);
    let points = own.map(|(at, row)| {
        let x = match axis {
            ProgressAxis::Seconds => rows
                .clock
                .get(at)
                .map_or(f64::NAN, |clock| clock.seconds),
            ProgressAxis::Evaluations => row.evaluations as f64,
            ProgressAxis::Work => row.work as f64,
        };
        (row.repetition, (x, row.incumbent))
    });
    let points: Vec<(u32, (f64, f64))> = points.collect();
    points
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| run.iter().map(|(_, point)| *point).collect())
        .collect()
}

/// Returns the end of the longest run of a method on a scene; 0 if there is none.
pub fn longest(rows: &Rows, scene: &str, method: &str, axis: ProgressAxis) -> f64 {
    let ends: Vec<f64> = match axis {
        ProgressAxis::Seconds => rows.seconds_of(scene, method),
        ProgressAxis::Evaluations => rows
            .runs_of(scene, method)
            .map(|run| run.evaluations as f64)
            .collect(),
        ProgressAxis::Work => rows
            .runs_of(scene, method)
            .map(|run| run.work as f64)
            .collect(),
    };
    ends.into_iter().fold(0.0, f64::max)
}

/// Returns the end of the longest run of any of these methods on a scene.
pub fn longest_of_all(rows: &Rows, scene: &str, methods: &[String], axis: ProgressAxis) -> f64 {
    methods
        .iter()
        .map(|method| longest(rows, scene, method, axis))
        .fold(0.0, f64::max)
}

/// Returns the time at which a run first had an incumbent of at most this cost, if it ever had.
pub fn reached(run: &Series, cost: f64) -> Option<f64> {
    run.iter()
        .find(|(_, incumbent)| *incumbent <= cost)
        .map(|(x, _)| *x)
}

#[cfg(test)]
mod tests {
    use super::super::data::run;
    use super::*;

    #[test]
    fn a_column_is_called_after_the_axis_and_only_seconds_go_into_timing_files() {
        #[derive(Serialize)]
        struct Row {
            scene: &'static str,
            x: f64,
        }
        let mut output = Output::default();
        ProgressAxis::Work
            .add_csv(&mut output, "a", &[Row { scene: "x", x: 2.0 }])
            .unwrap();
        assert_eq!(output.csv, [("a_work".to_owned(), b"scene,work\nx,2.0\n".to_vec())]);
        let files = ProgressAxis::ALL.map(|axis| axis.file("a"));
        assert_eq!(files, ["timing_a", "a_evaluations", "a_work"]);
    }

    #[test]
    fn evaluations_are_no_axis_where_some_count_trees_and_others_moves() {
        let runs =
            vec![run("trees", 0, 5, 995), run("tree", 0, 1, 199), run("moves", 0, 9000, 90_000)];
        let rows = Rows { runs, ..Rows::default() };
        let axes = |methods: &[&str]| {
            ProgressAxis::of(
                &rows,
                &methods
                    .iter()
                    .map(|&m| m.to_owned())
                    .collect::<Vec<_>>(),
            )
        };
        assert_eq!(axes(&["trees", "tree"]), ProgressAxis::ALL);
        assert_eq!(axes(&["moves"]), ProgressAxis::ALL);
        assert_eq!(axes(&["trees", "moves"]), [ProgressAxis::Seconds, ProgressAxis::Work]);
    }

    #[test]
    fn a_target_is_reached_by_the_first_incumbent_at_or_below_it() {
        let run = vec![(1.0, 9.0), (2.0, 7.0), (5.0, 6.0)];
        let when = [9.5, 7.0, 6.5, 1.0].map(|cost| reached(&run, cost));
        assert_eq!(when, [Some(1.0), Some(2.0), Some(5.0), None]);
    }
}
