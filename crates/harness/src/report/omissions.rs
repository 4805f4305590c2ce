//! The ablation of what scenes do not need: that leaving it out changes no cost, and what it saves.

use super::config::Labels;
use super::data::ratio;
use super::prelude::*;
use crate::rows::RunRow;
use crate::statistics::quartiles;

bvh_config::config! { serde;
    /// An ablation. Fails if leaving something out has made a cost higher, or different where it must not.
    pub struct Config {
        /// Heading.
        title: String;
        /// What is compared.
        pairs: Vec<Pair>, in OneOrMore;
    }
}

bvh_config::config! { serde;
    /// The same method with something left out and without.
    pub struct Pair {
        /// What is left out.
        name: String;
        /// Label of the method that leaves it out.
        out: String;
        /// Label of the method that does not.
        kept: String;
        /// Whether the cost may be lower with it left out, an optimum being in the place of a search.
        may_be_lower: bool = false;
    }
}

impl Labels for Pair {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        [self.out.labels(&format!("{key}.out")), self.kept.labels(&format!("{key}.kept"))].concat()
    }
}

/// One comparison, as written to `omissions.csv`.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Compared<'a> {
    scene: &'a str,
    omission: &'a str,
    runs: usize,
    /// Whether all runs cost the same, bit for bit.
    same_cost: bool,
    /// The highest of cost with it left out / cost without; 1 when both are 0.
    cost_ratio: f64,
    /// Work with it left out / work without, over all runs.
    work_ratio: f64,
}

/// Times of one comparison, as written to `timing_omissions.csv`.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Times<'a> {
    scene: &'a str,
    omission: &'a str,
    /// Lower quartile of the ratios of seconds, left out / not, repetition by repetition.
    ratio_low: f64,
    /// Their median.
    ratio_median: f64,
    /// The upper quartile.
    ratio_high: f64,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let scenes = rows.scenes();
        let problems = || {
            self.pairs
                .iter()
                .flat_map(|pair| scenes.iter().map(move |scene| (pair, scene)))
        };
        let compared: Vec<Compared> = problems()
            .map(|(pair, scene)| pair.compare(rows, scene))
            .collect::<Result<_, _>>()?;
        let times: Vec<Times> = problems()
            .map(|(pair, scene)| pair.times(rows, scene))
            .collect();
        let mut output = Output::new("", &self.title);
        output.add_csv("omissions", &compared)?;
        output.add_csv("timing_omissions", &times)?;
        let caption = "Ratios repetition by repetition: median, and from quartile to quartile.";
        output.add_figure("timing_omissions", caption, 1, vec![self.draw(rows, &times)]);
        let columns = "omission scene runs same_cost cost_ratio work_ratio";
        output.show("Cost and work with it left out over those without:", &compared, columns)?;
        let columns = "omission scene ratio_low ratio_median ratio_high";
        output.show(
            "Time with it left out over time without, median and quartiles:",
            &times,
            columns,
        )?;
        let other = compared
            .iter()
            .filter(|row| !row.same_cost)
            .count();
        let names = self.pairs.iter().map(|pair| pair.name.as_str());
        let saved = spans(names, &times, |row| row.omission, |row| Some(row.ratio_median), 2);
        let cost = match other {
            0 => "No cost changes".into(),
            other => {
                format!(
                    "Costs are lower in {other} of {} comparisons, otherwise the same",
                    compared.len()
                )
            }
        };
        output.reading =
            format!("{cost}. Time over that without leaving out, medians over scenes: {saved}.");
        Ok(output)
    }

    fn draw(&self, rows: &Rows, times: &[Times]) -> Panel {
        let pairs = self.pairs.len() as f64;
        // Pairs stand beside each other within the place of a scene.
        let bars = |(index, pair): (usize, &Pair)| {
            let offset = 0.8 * ((index as f64 + 0.5) / pairs - 0.5);
            let own = times
                .iter()
                .filter(|times| times.omission == pair.name)
                .enumerate();
            let points =
                own.map(|(at, t)| (at as f64 + offset, t.ratio_low, t.ratio_median, t.ratio_high));
            Layer::new(&pair.name, Marks::ErrorBars(points.collect()))
        };
        let mut layers: Vec<Layer> = self.pairs.iter().enumerate().map(bars).collect();
        layers.push(Layer::new("nothing left out", Marks::HLine(1.0)));
        let y = Axis::log("time / time without leaving it out");
        panel(
            "",
            Axis::categories(
                "",
                rows.scenes()
                    .into_iter()
                    .map(str::to_owned)
                    .collect(),
            ),
            y,
            layers,
        )
    }
}

impl Pair {
    fn compare<'a>(&'a self, rows: &Rows, scene: &'a str) -> Result<Compared<'a>, Error> {
        let pairs: Vec<(&RunRow, &RunRow)> = rows
            .runs_of(scene, &self.out)
            .zip(rows.runs_of(scene, &self.kept))
            .collect();
        let same = |(out, kept): &(&RunRow, &RunRow)| out.cost.to_bits() == kept.cost.to_bits();
        let allowed = |pair: &(&RunRow, &RunRow)| {
            same(pair) || self.may_be_lower && pair.0.cost < pair.1.cost
        };
        if let Some((out, kept)) = pairs.iter().find(|pair| !allowed(pair)) {
            return Err(Error::Ablation {
                scene: scene.into(),
                message: format!(
                    "{} left out: the cost is {}, and {} without",
                    self.name, out.cost, kept.cost
                ),
            });
        }
        let work =
            |side: fn(&(&RunRow, &RunRow)) -> u64| pairs.iter().map(side).sum::<u64>() as f64;
        Ok(Compared {
            scene,
            omission: &self.name,
            runs: pairs.len(),
            same_cost: pairs.iter().all(same),
            cost_ratio: pairs
                .iter()
                .map(|(out, kept)| ratio(out.cost, kept.cost))
                .fold(0.0, f64::max),
            work_ratio: ratio(work(|pair| pair.0.work), work(|pair| pair.1.work)),
        })
    }

    fn times<'a>(&'a self, rows: &Rows, scene: &'a str) -> Times<'a> {
        let [out, kept] = [&self.out, &self.kept].map(|label| rows.seconds_of(scene, label));
        let ratios: Vec<f64> = out
            .iter()
            .zip(kept)
            .map(|(out, kept)| out / kept)
            .collect();
        let [ratio_low, ratio_median, ratio_high] = quartiles(&ratios);
        Times { scene, omission: &self.name, ratio_low, ratio_median, ratio_high }
    }
}
