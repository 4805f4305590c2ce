//! Error against run time of all scenes in one panel: methods that take their own time as points,
//! a method by its budget as a line.

use super::config::Series;
use super::data::ratio;
use super::prelude::*;
use crate::statistics::{median, range};
use bvh_config::Nested;

report! {
    /// Error against run time of all scenes in one panel, `overview.svg`.
    pub struct Config {
        /// Methods that take their own time, by the name of their point.
        points: Vec<Series>, in Nested;
        /// The same method with ascending budgets.
        line: Series, in Nested;
        /// Another experiment, whose folder is beside this one's. Its last method is drawn as a
        /// point that continues the line.
        longer: String;
    }
}

/// The figure's name.
pub const FIGURE: &str = "overview";

/// Medians of one method over repetitions, over all scenes with a reference, as written to
/// `timing_overview.csv`.
#[derive(Serialize)]
struct OverScenes<'a> {
    method: &'a str,
    scenes: usize,
    seconds: f64,
    /// Of the scene that takes longest.
    latest_seconds: f64,
    gap: f64,
    least_gap: f64,
    greatest_gap: f64,
}

impl<'a> OverScenes<'a> {
    fn of(rows: &Rows, method: &'a str) -> Option<Self> {
        let of_scene = |scene| {
            let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
            let gap = ratio(median(&costs)?, rows.reference(scene)?.cost) - 1.0;
            Some((median(&rows.seconds_of(scene, method))?, gap))
        };
        let (seconds, gaps): (Vec<f64>, Vec<f64>) =
            rows.scenes().into_iter().filter_map(of_scene).unzip();
        let (least_gap, greatest_gap) = range(gaps.iter().copied())?;
        Some(Self {
            method,
            scenes: gaps.len(),
            seconds: median(&seconds)?,
            latest_seconds: range(seconds)?.1,
            gap: median(&gaps)?,
            least_gap,
            greatest_gap,
        })
    }

    /// The range over scenes, and the median on it.
    fn marks(&self, name: &str) -> [Layer; 2] {
        let range = [(self.seconds, self.least_gap), (self.seconds, self.greatest_gap)];
        let point = Marks::Points(vec![(self.seconds, self.gap)]);
        [Layer::new(name, Marks::Spans(vec![range])), Layer::new(name, point)]
    }
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let mut table = Vec::new();
        let mut layers = Vec::new();
        for Series { name, methods } in &self.points {
            for point in methods.iter().filter_map(|method| OverScenes::of(rows, method)) {
                layers.extend(point.marks(name));
                layers.push(Layer::new(name, Marks::Text((point.seconds, point.greatest_gap))));
                table.push(point);
            }
        }
        let Series { name, methods } = &self.line;
        let line: Vec<OverScenes> =
            methods.iter().filter_map(|method| OverScenes::of(rows, method)).collect();
        let medians: Vec<_> = line.iter().map(|at| (at.seconds, at.gap)).collect();
        let band = line.iter().map(|at| (at.seconds, at.least_gap, at.greatest_gap)).collect();
        layers.push(Layer::new(name, Marks::Band(band)));
        layers.push(Layer::new(name, Marks::Line(medians.clone())));
        layers.push(Layer::new(name, Marks::Points(medians)));
        if let Some(end) = line.last() {
            layers.push(Layer::new(name, Marks::Text((end.seconds, end.greatest_gap))));
            layers.extend(self.longer(rows, end)?);
        }
        table.extend(line);
        let scenes = table.last().map_or(0, |at| at.scenes);
        let caption = format!(
            "Cost above the cheapest known binary tree of whole objects: median of {scenes} \
             scenes, and from least to greatest. How far the optimum is below is unknown."
        );
        let x = Axis::log("time on one thread").unit(Unit::Seconds);
        let y = Axis::log("").unit(Unit::Percent);
        let mut output = Output::default();
        output.add_csv(format!("timing_{FIGURE}"), &table)?;
        output.add_figure(FIGURE, caption, 1, vec![panel("", x, y, layers)]);
        Ok(output)
    }

    /// The point that continues the line, if its experiment has been run.
    fn longer(&self, rows: &Rows, end: &OverScenes) -> Result<Vec<Layer>, Error> {
        let folder = rows.folder.with_file_name(&self.longer);
        if self.longer.is_empty() || !folder.is_dir() {
            return Ok(vec![]);
        }
        let rows = Rows::read(&folder)?;
        let method = rows.methods().pop().unwrap_or_default();
        let Some(point) = OverScenes::of(&rows, method) else { return Ok(vec![]) };
        let name = format!("a minute, {} scenes", point.scenes);
        let line = vec![(end.seconds, end.gap), (point.seconds, point.gap)];
        let [range, median] = point.marks(&name);
        let text = Marks::Text((point.seconds, point.gap));
        Ok(vec![Layer::new(&name, Marks::Line(line)), range, median, Layer::new(&name, text)])
    }
}
