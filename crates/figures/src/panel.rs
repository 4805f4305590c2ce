//! Draws one panel: axes, ticks, names and, by [`Layers`], the marks.

use super::axis::{Ruled, axes};
use super::canvas::{Align, Frame, Sheet};
use super::layers::Layers;
use super::model::{Panel, Scale, Unit};
use super::style::{FAINT, GREY, GRID, INK, Strokes};
use super::text::{self, BODY, HEADING};

/// Length of ticks; their labels are twice as far from the axis.
const TICK: f64 = 4.0;
/// Distance from tick labels to the axis label.
const LABEL: f64 = 5.0;
/// The greatest width of the names of rows; longer ones are shortened.
const NAMES: f64 = 310.0;

/// A panel with the space it needs around its plot.
pub(super) struct Plot<'a> {
    panel: &'a Panel,
    x: Ruled<'a>,
    y: Ruled<'a>,
    has_data: bool,
    /// The names of rows.
    names: Vec<String>,
    title: Vec<String>,
    x_label: Vec<String>,
    y_label: Vec<String>,
    /// Pixels above the plot; `left` and `below` are the pixels on its other sides.
    pub above: f64,
    pub left: f64,
    pub below: f64,
    /// Height of the plot.
    pub height: f64,
}

impl<'a> Plot<'a> {
    /// Finds the ranges of both axes and the ticks of a y axis of this height, unless rows have
    /// another.
    pub fn new(panel: &'a Panel, height: f64) -> Self {
        let (x, mut y, has_data) = axes(panel);
        y.rule((height / 34.0) as usize);
        let y_label = text::wrap(&panel.y.label, height, BODY);
        let (names, height) = match &panel.y.scale {
            Scale::Rows(names, row) => (
                names.iter().map(|name| text::shorten(name, NAMES, BODY)).collect(),
                row * names.len() as f64,
            ),
            _ => (Vec::new(), height),
        };
        let widest = text::widest(y.ticks.iter().map(|tick| &tick.1).chain(&names), BODY);
        let left = (2.0 * TICK + widest + LABEL + BODY.line() * y_label.len() as f64).ceil();
        Self {
            panel,
            x,
            y,
            has_data,
            names,
            title: Vec::new(),
            x_label: Vec::new(),
            y_label,
            above: 0.0,
            left,
            below: 0.0,
            height,
        }
    }

    /// Finds the ticks of an x axis of this width, and breaks the texts above and below into lines.
    pub fn fit_width(&mut self, width: f64) {
        let apart = if self.panel.x.scale == Scale::Log { 55.0 } else { 40.0 };
        // Fewer ticks, not some without a label, keep the distances between them regular.
        for most in (2..=((width / apart) as usize).max(2)).rev() {
            self.x.rule(most);
            if !self.labels_touch(width) {
                break;
            }
        }
        self.title = text::wrap(&self.panel.title, width, HEADING);
        self.above = HEADING.line() * self.title.len() as f64 + 5.0;
        self.x_label = text::wrap(&self.panel.x.label, width, BODY);
        let ticks = if self.panel.x.unit == Unit::Bare { 0.0 } else { 2.0 * TICK + BODY.line() };
        self.below = (ticks + LABEL + BODY.line() * self.x_label.len() as f64).ceil();
    }

    /// Returns true if two neighbouring labels of the x axis leave no gap between them.
    fn labels_touch(&self, width: f64) -> bool {
        let ends = self.x.ticks.iter().map(|(at, label)| {
            let (middle, half) = (self.x.fraction(*at) * width, text::width(label, BODY) / 2.0);
            (middle - half, middle + half)
        });
        let ends: Vec<(f64, f64)> = ends.collect();
        ends.windows(2).any(|pair| pair[1].0 < pair[0].1 + 6.0)
    }

    /// Drops the label of the x axis if the panel below has the same label.
    pub fn share_x_label(&mut self, below: &Self) {
        if self.x_label == below.x_label {
            self.below -= BODY.line() * self.x_label.len() as f64;
            self.x_label.clear();
        }
    }

    /// Draws the panel with its plot in a place of the sheet.
    pub fn draw(&self, sheet: &mut Sheet, frame: Frame, strokes: &Strokes) {
        let Frame { left, top, width, height } = frame;
        let (right, bottom) = (left + width, top + height);
        let (centre, middle) = (left + width / 2.0, top + height / 2.0);
        let across = |at: f64| left + self.x.fraction(at) * width;
        let down = |at: f64| bottom - self.y.fraction(at) * height;
        // Faint lines guide the eye from a name to its marks.
        for row in 0..self.names.len() {
            let y = down(row as f64);
            sheet.line(&[(left, y), (right, y)], FAINT, 1.0, None);
        }
        for x in self.x.ticks.iter().map(|tick| across(tick.0)) {
            sheet.line(&[(x, top), (x, bottom)], GRID, 1.0, None);
        }
        for y in self.y.ticks.iter().map(|tick| down(tick.0)) {
            sheet.line(&[(left, y), (right, y)], GRID, 1.0, None);
        }
        sheet.line(&[(left, top), (left, bottom), (right, bottom)], INK, 1.0, None);
        let (layers, x, y) = (&self.panel.layers, &self.x, &self.y);
        Layers { layers, x, y, strokes, frame }.draw(sheet);
        for (at, label) in &self.x.ticks {
            let x = across(*at);
            sheet.line(&[(x, bottom), (x, bottom + TICK)], INK, 1.0, None);
            let below = bottom + 2.0 * TICK + BODY.line() / 2.0;
            sheet.text((x, below), label, BODY, INK, Align::Center);
        }
        for (at, label) in &self.y.ticks {
            let y = down(*at);
            sheet.line(&[(left - TICK, y), (left, y)], INK, 1.0, None);
            sheet.text((left - 2.0 * TICK, y), label, BODY, INK, Align::Right);
        }
        for (row, name) in self.names.iter().enumerate() {
            let place = (left - 2.0 * TICK, down(row as f64));
            sheet.text(place, name, BODY, INK, Align::Right);
        }
        if !self.has_data {
            sheet.text((centre, middle), "no data", BODY, GREY, Align::Center);
        }
        sheet.lines((left, top - self.above), &self.title, HEADING, INK, Align::Left);
        let below = bottom + self.below - BODY.line() * self.x_label.len() as f64;
        sheet.lines((centre, below), &self.x_label, BODY, INK, Align::Center);
        for (line, index) in self.y_label.iter().zip(0..) {
            let beside = left - self.left + BODY.line() * (f64::from(index) + 0.5);
            sheet.text((beside, middle), line, BODY, INK, Align::Up);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Axis;
    use super::*;

    #[test]
    fn labels_below_a_plot_of_any_width_are_as_far_apart_as_each_other_and_touch_nowhere() {
        let ends = [(1.0, 1.065), (0.0, 256_000.0), (-0.04, 0.01)];
        for (low, high) in ends {
            let panel = Panel { x: Axis::linear("").range(low, high), ..Panel::default() };
            for width in (160..600).step_by(10) {
                let mut plot = Plot::new(&panel, 100.0);
                plot.fit_width(f64::from(width));
                let ticks: Vec<f64> = plot.x.ticks.iter().map(|tick| tick.0).collect();
                let gaps: Vec<f64> = ticks.windows(2).map(|pair| pair[1] - pair[0]).collect();
                assert!(ticks.len() > 1 && !plot.labels_touch(f64::from(width)), "{ticks:?}");
                assert!(gaps.iter().all(|gap| (gap / gaps[0] - 1.0).abs() < 1e-6), "{ticks:?}");
            }
        }
    }
}
