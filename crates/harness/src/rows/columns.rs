//! CSV files as rows of a type. The fields of the type are the columns; its documentation names the
//! files and describes the columns. From it alone the page of all columns is made, docs/COLUMNS.md.

use crate::Error;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::fmt;
use std::path::Path;

/// A kind of rows in a file of its own.
pub trait Row: Serialize + DeserializeOwned {
    /// The CSV file that holds them; its name begins with `timing` if they hold seconds.
    const FILE: &'static str;
}

/// Columns that many files have; a type of rows describes them only where it means something else.
const COMMON: &[(&str, &str)] = &[
    ("scene", "Name of the scene."),
    ("scene_kind", "`stand-in`, `procedural` or `file`."),
    ("method", "Label of the method in the spec."),
    ("seed", "Seed of the run, derived from the spec's."),
    ("repetition", "Number of the repetition, from 0."),
    ("objects", "Number of the scene's objects."),
    ("layout", "How the tree lies in memory while rays are traced."),
    ("family", "Where the random rays come from."),
    ("query", "What the random rays ask."),
    ("count", "Number of rays."),
    ("runs", "Number of runs."),
    ("evaluations", "Trees or moves evaluated."),
    ("work", "Nodes made or visited."),
    ("threads", "Threads at its disposal."),
    ("target", "The cost to be reached, in words."),
    ("target_cost", "The cost to be reached."),
    ("cost_over_base", "Cost over that of the greedy Müller–Fellner tree."),
    ("boxes_per_ray", "Mean number of tests against boxes."),
    ("boxes_low", "Lower end of the mean's 95 % interval."),
    ("boxes_high", "Its upper end."),
    ("objects_per_ray", "Mean number of tests against objects."),
    ("missed_hits", "Rays that should hit and do not."),
    ("false_hits", "Rays that should not hit and do."),
    ("other_hits", "Rays that hit elsewhere than they should."),
    ("ns_per_ray", "Nanoseconds per ray on one thread."),
    ("mrays_per_second", "Million rays per second on one thread."),
    ("gap_quartile_1", "Lower quartile of the cost over the reference, minus 1, over repetitions."),
    ("gap_median", "Its median."),
    ("gap_quartile_3", "Its upper quartile."),
    ("pearson", "Pearson's correlation; empty where it is not defined."),
    ("spearman", "Spearman's rank correlation; empty where it is not defined."),
    (
        "goldsmith_salmon",
        "Goldsmith and Salmon's cost: boxes below the root that a random line through the root's box is tested against.",
    ),
    (
        "collapsed_sah",
        "The surface area heuristic with both constants 1, after the best collapse of leaves.",
    ),
    (
        "references_per_object",
        "Leaves that name an object, per object: more than 1 where objects are divided.",
    ),
    ("bytes_per_object", "Bytes over the number of objects."),
    ("internal_area", "Total half area of inner nodes, world units squared."),
    ("nodes", "Nodes of the tree."),
    ("depth", "Edges from the root to the deepest leaf."),
    ("rays", "Kind of the rays."),
    ("judged_on", "Kind of the rays that judge the tree."),
    ("trained_on", "Rays that the tree was trained on: `none`, `default`, `camera` or `inside`."),
    (
        "camera",
        "Whether the rays come from the training's path of cameras: `same`, `other`, or `none` without a camera.",
    ),
    ("solved", "How many runs reached the target."),
    ("solved_fraction", "Fraction of the runs that have reached the target so far."),
    ("trees", "Number of trees compared."),
    ("build_seconds", "Wall time of making the structure, in the fastest repetition."),
    ("over_first_low", "The least over all pairs of runs, of the method and of the first."),
    ("over_first_high", "The greatest."),
    ("trials", "Number of trials."),
    ("lowest_cost", "The lowest cost."),
    ("median_cost", "The median cost."),
    ("highest_cost", "The highest cost."),
    ("seconds_quartile_1", "Lower quartile of the runs' wall times."),
    ("seconds_median", "Their median."),
    ("seconds_quartile_3", "Their upper quartile."),
    ("omission", "What is left out."),
    ("x", "How far the run has come along the file's axis."),
];

/// Columns under whose names files along the axes of run time hold `x`.
const AXES: [&str; 3] = ["seconds", "evaluations", "work"];

/// In the documentation of rows, stands in file names for what a spec chooses.
const CHOSEN: &str = "FILE";

/// A type of rows: what one is, and the columns in order with their meaning.
#[derive(Clone, Debug)]
pub struct Columns {
    about: String,
    columns: Vec<(String, String)>,
}

impl Columns {
    /// Those of a type of rows.
    pub fn of<R: JsonSchema>() -> Self {
        let settings = SchemaSettings::draft07()
            .for_serialize()
            .with(|settings| settings.inline_subschemas = true);
        let schema = settings
            .into_generator()
            .into_root_schema_for::<R>()
            .to_value();
        let text = |of: &Value, key: &str| {
            of.get(key)
                .and_then(Value::as_str)
                .unwrap_or_default()
                .replace('\n', " ")
        };
        let column = |name: &Value| {
            let name = name.as_str().unwrap_or_default();
            let own = text(&schema["properties"][name], "description");
            let common = COMMON
                .iter()
                .find(|(common, _)| own.is_empty() && *common == name);
            let meaning = common.map_or(own, |(_, meaning)| (*meaning).to_owned());
            // The words of an enum stand alone, or each beside its description.
            let of = &schema["properties"][name];
            let words = of["enum"]
                .as_array()
                .or(of["oneOf"].as_array())
                .into_iter()
                .flatten();
            let words = words.map(|word| {
                word.as_str()
                    .map_or_else(|| text(word, "const"), str::to_owned)
            });
            let words: Vec<String> = words.map(|word| format!("`{word}`")).collect();
            let meaning =
                if words.is_empty() { meaning } else { format!("{meaning} {}.", words.join(", ")) };
            (name.to_owned(), meaning)
        };
        // In a schema of what is written every field is required, in the order of the declaration.
        let columns = schema["required"]
            .as_array()
            .into_iter()
            .flatten()
            .map(column)
            .collect();
        Self { about: text(&schema, "description"), columns }
    }

    /// Returns the names of the files that hold such rows: all that the documentation names before
    /// it says what they hold.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let names = self
            .about
            .split([':', ';'])
            .next()
            .unwrap_or_default();
        names
            .split('`')
            .filter(|word| word.ends_with(".csv") && !word.contains(' '))
    }

    /// Whether a file of this name and with this header is one of these.
    pub fn are_of(&self, file: &str, header: &[&str]) -> bool {
        let named = |name: &str| match name.split_once(CHOSEN) {
            Some((before, after)) => file.starts_with(before) && file.ends_with(after),
            None => file == name,
        };
        let same = |(found, (name, _)): (&&str, &(String, String))| {
            found == name || name == "x" && AXES.contains(found)
        };
        let columns =
            header.len() == self.columns.len() && header.iter().zip(&self.columns).all(same);
        columns && self.files().any(named)
    }

    /// The first column that nothing is said of, or a word for the file if it has no name.
    pub fn unsaid(&self) -> Option<&str> {
        let unsaid = self
            .columns
            .iter()
            .find(|(_, meaning)| meaning.is_empty())
            .map(|(name, _)| name.as_str());
        unsaid.or(self
            .files()
            .next()
            .is_none()
            .then_some("the file's name"))
    }
}

impl fmt::Display for Columns {
    /// The section of a page in Markdown.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files: Vec<String> = self
            .files()
            .map(|file| format!("`{file}`"))
            .collect();
        writeln!(
            f,
            "\n## {}\n\n{}\n\n| column | meaning |\n|---|---|",
            files.join(", "),
            self.about
        )?;
        self.columns
            .iter()
            .try_for_each(|(name, meaning)| {
                let name = if name == "x" { AXES.join("` or `") } else { name.clone() };
                writeln!(f, "| `{name}` | {} |", meaning.replace('|', "\\|"))
            })
    }
}

/// Reads all rows of a CSV file.
pub fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, Error> {
    let mut reader = csv::Reader::from_path(path).map_err(Error::csv(path))?;
    reader
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(Error::csv(path))
}

/// The bytes of a CSV file with a header and these rows; the header alone needs at least one row.
pub fn to_bytes<R: Serialize>(rows: &[R], path: &Path) -> Result<Vec<u8>, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(Error::csv(path))?;
    }
    writer.into_inner().map_err(|error| Error::Io {
        path: path.to_owned(),
        action: "write",
        source: std::io::Error::other(error.to_string()),
    })
}
