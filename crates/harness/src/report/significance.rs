//! Whether one method really differs from others: paired across scenes, and run against run within each.

use super::statistics::median;
use super::statistics::rank_tests::{Test, a12, holm, mann_whitney, wilcoxon_signed_rank};
use super::{Output, Rows, text_table};
use crate::Error;
use crate::run::rows::to_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A comparison of one method's final costs with those of others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Heading.
    pub title: String,
    /// Label of the method that is compared.
    pub method: String,
    /// Labels of the others.
    pub against: Vec<String>,
    /// Corrected p-values below this are called different. Default 0.05.
    #[serde(default = "five_percent")]
    pub level: f64,
}

fn five_percent() -> f64 {
    0.05
}

/// One comparison, as written to `significance.csv`. Holm's correction is over all rows of the same test.
#[derive(Serialize)]
struct Row<'a> {
    /// `all` for the comparison across scenes.
    scene: &'a str,
    method: &'a str,
    against: &'a str,
    /// `Wilcoxon signed-rank`, of the medians over base, paired by scene; or `Mann–Whitney`, of the runs.
    test: &'a str,
    /// Scenes, or runs of the method; and of the other.
    samples: usize,
    samples_against: usize,
    /// W⁺ or U.
    statistic: f64,
    p_value: f64,
    holm_p_value: f64,
    /// How likely a run of the method ends below one of the other, ties counting a half; across scenes, its mean over
    /// them.
    a12: f64,
    /// `lower` or `higher` cost than the other's if the corrected p-value is below the level, else `not different`.
    verdict: &'static str,
}

const WILCOXON: &str = "Wilcoxon signed-rank";
const MANN_WHITNEY: &str = "Mann–Whitney";

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let across = self.against.iter().filter_map(|against| self.across(rows, against)).collect();
        let scenes = rows.scenes();
        let within = scenes.iter().flat_map(|&(scene, _)| {
            self.against.iter().filter_map(move |against| self.within(rows, scene, against))
        });
        let mut table = self.judged(across);
        table.extend(self.judged(within.collect()));
        Ok(Output {
            csv: vec![("significance".into(), to_bytes(&table, Path::new("significance.csv"))?)],
            text: self.text(rows, &table),
            reading: self.reading(&table),
            ..Output::default()
        })
    }

    fn across<'a>(&'a self, rows: &'a Rows, against: &'a str) -> Option<Row<'a>> {
        let (mut differences, mut sizes) = (Vec::new(), Vec::new());
        for (scene, _) in rows.scenes() {
            let [own, other] = [&self.method, against].map(|method| costs(rows, scene, method));
            differences.extend(median(&own).zip(median(&other)).map(|(own, other)| own - other));
            sizes.extend(a12(&other, &own));
        }
        let samples = differences.len();
        // Scenes on which both cost the same say nothing; if there are no others, nothing differs.
        let test = wilcoxon_signed_rank(&differences).unwrap_or(Test { statistic: 0.0, p_value: 1.0 });
        let effect = sizes.iter().sum::<f64>() / samples as f64;
        let others = differences.iter().filter(|difference| **difference != 0.0).count() as f64;
        let lower = test.statistic < others * (others + 1.0) / 4.0;
        (samples > 0).then(|| self.row(["all", against, WILCOXON], [samples, samples], test, effect, lower))
    }

    fn within<'a>(&'a self, rows: &'a Rows, scene: &'a str, against: &'a str) -> Option<Row<'a>> {
        let [own, other] = [&self.method, against].map(|method| costs(rows, scene, method));
        let (test, effect) = (mann_whitney(&own, &other)?, a12(&other, &own)?);
        let samples = [own.len(), other.len()];
        // One run says nothing about the others.
        let some = samples.into_iter().all(|samples| samples > 1);
        some.then(|| self.row([scene, against, MANN_WHITNEY], samples, test, effect, effect > 0.5))
    }

    fn row<'a>(
        &'a self,
        [scene, against, test]: [&'a str; 3],
        [samples, samples_against]: [usize; 2],
        Test { statistic, p_value }: Test,
        a12: f64,
        lower: bool,
    ) -> Row<'a> {
        Row {
            scene,
            method: &self.method,
            against,
            test,
            samples,
            samples_against,
            statistic,
            p_value,
            holm_p_value: 1.0,
            a12,
            verdict: if lower { "lower" } else { "higher" },
        }
    }

    /// The rows of one test with their p-values corrected.
    fn judged<'a>(&self, mut table: Vec<Row<'a>>) -> Vec<Row<'a>> {
        let corrected = holm(&table.iter().map(|row| row.p_value).collect::<Vec<_>>());
        for (row, p_value) in table.iter_mut().zip(corrected) {
            row.holm_p_value = p_value;
            if p_value >= self.level {
                row.verdict = "not different";
            }
        }
        table
    }

    fn reading(&self, table: &[Row]) -> String {
        let of = |against: &String| {
            let own = |verdict: Option<&str>| {
                let within = table.iter().filter(|row| row.against == against && row.test == MANN_WHITNEY);
                within.filter(|row| verdict.is_none_or(|verdict| row.verdict == verdict)).count()
            };
            let across = table.iter().find(|row| row.against == against && row.test == WILCOXON);
            let across = across.map_or_else(String::new, |row| format!(", across all {}", row.verdict));
            format!(
                "{against}: lower on {}, higher on {} of {} scenes{across}",
                own(Some("lower")),
                own(Some("higher")),
                own(None)
            )
        };
        let all: Vec<String> = self.against.iter().map(of).collect();
        format!(
            "Costs of {} after Holm's correction at {}, against {}.",
            self.method,
            self.level,
            all.join("; against ")
        )
    }

    fn text(&self, rows: &Rows, table: &[Row]) -> String {
        let header = ["scene", "against", "test", "p", "p, Holm", "A12", "cost is"];
        let mut text = text_table(header);
        for row in table {
            let scene = if row.scene == "all" { "all".into() } else { rows.shown(row.scene) };
            text.add_row([
                scene,
                row.against.into(),
                row.test.into(),
                format!("{:.2e}", row.p_value),
                format!("{:.2e}", row.holm_p_value),
                format!("{:.2}", row.a12),
                row.verdict.into(),
            ]);
        }
        format!("{}: '{}' against others\n{text}\n", self.title, self.method)
    }
}

/// The final costs of a method's runs over base.
fn costs(rows: &Rows, scene: &str, method: &str) -> Vec<f64> {
    rows.runs_of(scene, method).map(|run| super::over(run.cost, run.base_cost)).collect()
}
