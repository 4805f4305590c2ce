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

/// The figure's name. It has no CSV file: `numbers.csv` and `timing_numbers.csv` hold its numbers.
pub const FIGURE: &str = "overview";

/// Medians of one method over repetitions, over all scenes with a reference.
struct OverScenes {
    scenes: usize,
    seconds: f64,
    /// Of the scene that takes longest.
    latest: f64,
    gap: f64,
    least: f64,
    most: f64,
}

impl OverScenes {
    fn of(rows: &Rows, method: &str) -> Option<Self> {
        let of_scene = |scene| {
            let costs: Vec<f64> = rows.runs_of(scene, method).map(|run| run.cost).collect();
            let gap = ratio(median(&costs)?, rows.reference(scene)?.cost) - 1.0;
            Some((median(&rows.seconds_of(scene, method))?, gap))
        };
        let (seconds, gaps): (Vec<f64>, Vec<f64>) =
            rows.scenes().into_iter().filter_map(of_scene).unzip();
        let (least, most) = range(gaps.iter().copied())?;
        let (_, latest) = range(seconds.iter().copied())?;
        let (seconds, gap) = (median(&seconds)?, median(&gaps)?);
        Some(Self { scenes: gaps.len(), seconds, latest, gap, least, most })
    }

    /// The range over scenes, and the median on it.
    fn marks(&self, name: &str) -> [Layer; 2] {
        let range = [(self.seconds, self.least), (self.seconds, self.most)];
        let point = Marks::Points(vec![(self.seconds, self.gap)]);
        [Layer::new(name, Marks::Spans(vec![range])), Layer::new(name, point)]
    }
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let line: Vec<OverScenes> =
            self.line.methods.iter().filter_map(|method| OverScenes::of(rows, method)).collect();
        let finding = finding(&line);
        let mut layers = Vec::new();
        for Series { name, methods } in &self.points {
            for point in methods.iter().filter_map(|method| OverScenes::of(rows, method)) {
                layers.extend(point.marks(name));
                layers.push(Layer::new(name, Marks::Text((point.seconds, point.most))));
            }
        }
        let name = &self.line.name;
        let medians: Vec<_> = line.iter().map(|at| (at.seconds, at.gap)).collect();
        let band = line.iter().map(|at| (at.seconds, at.least, at.most)).collect();
        layers.push(Layer::new(name, Marks::Band(band)));
        layers.push(Layer::new(name, Marks::Line(medians.clone())));
        layers.push(Layer::new(name, Marks::Points(medians)));
        if let Some(end) = line.last() {
            layers.push(Layer::new(name, Marks::Text((end.seconds, end.most))));
            layers.extend(self.longer(rows, end)?);
        }
        let scenes = line.first().map_or(0, |at| at.scenes);
        let caption = format!(
            "Cost above the cheapest known binary tree of whole objects: median of {scenes} \
             scenes, and from least to greatest. How far the optimum is below is unknown."
        );
        let x = Axis::log("time on one thread").unit(Unit::Seconds);
        let y = Axis::log("").unit(Unit::Percent);
        let mut output = Output { finding: Some(finding), ..Output::default() };
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

/// Says what the point of the line that is closest to a second costs at most, after how long.
fn finding(line: &[OverScenes]) -> String {
    let from_second = |at: &&OverScenes| at.seconds.ln().abs();
    let closest = line.iter().min_by(|a, b| from_second(a).total_cmp(&from_second(b)));
    let Some(OverScenes { latest, most, .. }) = closest else {
        return "Error against run time".into();
    };
    // Rounded up, so that no scene is above it.
    let (most, latest) = ((1e3 * most).ceil() / 10.0, (10.0 * latest).ceil() / 10.0);
    format!("Within {most} % of the best tree known after {latest} s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_title_is_of_the_point_at_about_a_second_and_rounds_its_worst_scenes_up() {
        let at = |seconds, most| {
            let (gap, least, latest) = (0.0, 0.0, 1.1 * seconds);
            OverScenes { scenes: 2, seconds, latest, gap, least, most }
        };
        let line = [at(0.1, 0.03), at(0.83, 0.0121), at(9.0, 0.002)];
        assert_eq!(finding(&line), "Within 1.3 % of the best tree known after 1 s");
    }
}
