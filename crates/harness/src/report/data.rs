//! Reads the rows of an experiment's CSV files and selects from them for reports.

use super::query;
use crate::Error;
use crate::rows::csv_file::parse;
use crate::rows::{self, ClockRow, HistoryRow, ReferenceRow, Row, RunRow, TrialRow};
use bvh_scenes::SceneKind;
use indexmap::IndexMap;
use std::hash::Hash;
use std::path::{Path, PathBuf};

/// The incumbents of a run: seconds since its start, and cost.
pub type Series = Vec<(f64, f64)>;

/// The rows of an experiment's files; none of a file that no run wrote.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs, reason = "rows of these kinds")]
pub struct Rows {
    /// The experiment's folder, for reports that read further files.
    pub folder: PathBuf,
    /// The CSV files of earlier reports: names without extension, and bytes.
    pub made: Vec<(String, Vec<u8>)>,
    pub runs: Vec<RunRow>,
    pub history: Vec<HistoryRow>,
    pub trials: Vec<TrialRow>,
    /// One row for every row of `history`, in the same order, or none.
    pub clock: Vec<ClockRow>,
    /// Those by the experiment's objective.
    pub references: Vec<ReferenceRow>,
}

impl Rows {
    /// Reads the CSV files in an experiment's folder. Only `runs.csv` is required.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        Ok(Self {
            folder: folder.to_owned(),
            made: vec![],
            runs: rows::read(&folder.join(RunRow::FILE))?,
            history: rows::read_if_any(folder)?,
            trials: rows::read_if_any(folder)?,
            clock: rows::read_if_any(folder)?,
            references: rows::read_if_any(folder)?,
        })
    }

    /// Reads a CSV file of the experiment's runs or of an earlier report.
    pub fn read_file(&self, file: &str) -> Result<Vec<query::Row>, Error> {
        let path = self.folder.join(file);
        let is_of_file = |(name, _): &&(String, _)| file.strip_suffix(".csv") == Some(name);
        if let Some((_, bytes)) = self.made.iter().find(is_of_file) {
            return parse(bytes, &path);
        }
        // What else lies in the folder is of an earlier experiment.
        if !rows::FILES.contains(&file) || !path.is_file() {
            let of_runs = rows::FILES.iter().filter(|file| self.folder.join(file).is_file());
            let made = self.made.iter().map(|(name, _)| format!("{name}.csv"));
            let accepted: Vec<String> =
                of_runs.map(|file| (*file).to_owned()).chain(made).collect();
            let message = format!(
                "neither these runs nor a report before this one write this file; accepted: {}",
                accepted.join(", ")
            );
            return Err(Error::Query { path, message });
        }
        rows::read(&path)
    }

    /// Returns the scenes in the order of the rows.
    pub fn scenes(&self) -> Vec<&str> {
        distinct(self.runs.iter().map(|run| run.scene.as_str()))
    }

    /// Returns the kind of a scene, or of what stands turned or in part in `runs.csv`.
    pub fn kind(&self, scene: &str) -> &str {
        let is_of = |run: &&RunRow| {
            let rest = run.scene.strip_prefix(scene);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(':'))
        };
        self.runs.iter().find(is_of).map_or("", |run| run.scene_kind.as_str())
    }

    /// Returns the scene's name for tables and figures: its kind follows unless it is a file.
    pub fn shown(&self, scene: &str) -> String {
        let kind = self.kind(scene);
        // Every scene that is no file is marked, so that no stand-in passes for an original.
        let is_plain = kind.is_empty() || kind == SceneKind::File.to_string();
        if is_plain { scene.into() } else { format!("{scene} ({kind})") }
    }

    /// Returns the cost of the scene's greedy tree.
    pub fn base_cost(&self, scene: &str) -> f64 {
        self.runs.iter().find(|run| run.scene == scene).map_or(f64::NAN, |run| run.base_cost)
    }

    /// Returns the reference that gaps on the scene are measured from.
    pub fn reference(&self, scene: &str) -> Option<&ReferenceRow> {
        self.references.iter().find(|row| row.scene == scene)
    }

    /// Returns the incumbents of every run of one method on one scene.
    pub fn series(&self, scene: &str, method: &str) -> Vec<Series> {
        let mut points = Vec::new();
        for (index, row) in self.history.iter().enumerate() {
            if row.scene == scene && row.method == method {
                let seconds = self.clock.get(index).map_or(f64::NAN, |clock| clock.seconds);
                points.push((row.repetition, (seconds, row.incumbent)));
            }
        }
        let runs = points.chunk_by(|a, b| a.0 == b.0);
        runs.map(|run| run.iter().map(|(_, point)| *point).collect()).collect()
    }

    /// Returns the trials of one method on one scene, one list per repetition.
    pub fn trials_of(&self, scene: &str, method: &str) -> Vec<Vec<&TrialRow>> {
        let own = |row: &&TrialRow| row.scene == scene && row.method == method;
        let rows: Vec<&TrialRow> = self.trials.iter().filter(own).collect();
        rows.chunk_by(|a, b| a.repetition == b.repetition).map(<[_]>::to_vec).collect()
    }

    /// Returns the costs of all trials of one method on one scene, over all repetitions.
    pub fn trial_costs(&self, scene: &str, method: &str) -> Vec<f64> {
        self.trials_of(scene, method).concat().iter().map(|row| row.cost).collect()
    }

    /// Returns the costs over base of one method's trials on one scene, one list per repetition, in
    /// order.
    pub fn trials_over_base(&self, scene: &str, method: &str) -> Vec<Vec<f64>> {
        let base = self.base_cost(scene);
        let over_base =
            |trials: Vec<&TrialRow>| trials.iter().map(|row| ratio(row.cost, base)).collect();
        self.trials_of(scene, method).into_iter().map(over_base).collect()
    }
}

/// Makes the row of an ordinary run on the scene `s`.
#[cfg(test)]
pub(super) fn run(method: &str, repetition: u32) -> RunRow {
    let row = format!("s,file,{method},0,{repetition},100,3,0,completed,1,1,1,1,1,1,1,199,9");
    csv::StringRecord::from_iter(row.split(',')).deserialize(None).unwrap()
}

/// Returns a ratio of costs; 1 when the denominator is 0, as in `runs.csv`.
pub fn ratio(cost: f64, base: f64) -> f64 {
    if base > 0.0 { cost / base } else { 1.0 }
}

/// Returns the items by their keys, in the order of the first item of each.
pub(crate) fn grouped<K: Hash + Eq, T>(
    items: impl IntoIterator<Item = T>,
    key: impl Fn(&T) -> K,
) -> IndexMap<K, Vec<T>> {
    let mut groups: IndexMap<K, Vec<T>> = IndexMap::new();
    for item in items {
        groups.entry(key(&item)).or_default().push(item);
    }
    groups
}

/// Returns the distinct items in the order of their first occurrence.
pub(crate) fn distinct<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}
