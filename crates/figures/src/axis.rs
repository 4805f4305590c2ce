//! Chooses the shown part of an axis and its ticks.
//!
//! Panels are drawn in coordinates: the values of a linear axis, the decimal logarithms of a
//! logarithmic axis, and the indices of rows. Logarithms come from a library whose last digit is the
//! same on every machine.

use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;
use plotters::data::float::pretty_print_float;

use super::model::{Axis, LARGEST, Layer, Marks, Panel, Scale, Unit};

/// An axis as it is drawn: its shown part, in coordinates, and its ticks. `low` is at the left or the
/// bottom; it is above `high` for rows, which are counted from the top.
#[derive(Clone, Debug)]
pub(super) struct Ruled<'a> {
    axis: &'a Axis,
    pub low: f64,
    pub high: f64,
    /// Ticks with labels.
    pub ticks: Vec<(f64, String)>,
}

/// Returns both axes of a panel, without ticks, and true if any series has data to show.
pub(super) fn axes(panel: &Panel) -> (Ruled<'_>, Ruled<'_>, bool) {
    let Panel { x, y, layers, .. } = panel;
    let is_shown = |at: &(f64, f64)| x.coordinate(at.0).is_some() && y.coordinate(at.1).is_some();
    let data = layers.iter().flat_map(|layer| layer.marks.data()).filter(is_shown);
    let (mut xs, mut ys): (Vec<f64>, Vec<f64>) = data.unzip();
    let data = xs.len();
    for layer in layers {
        match &layer.marks {
            Marks::Spans(spans) => {
                xs.extend(spans.iter().flatten().map(|end| end.0));
                ys.extend(spans.iter().flatten().map(|end| end.1));
            }
            Marks::HLine(at) => ys.push(*at),
            Marks::VLine(at) => xs.push(*at),
            _ => {}
        }
    }
    // Lines may run from edge to edge; markers and upright reference lines need room at the ends.
    let has_margin = xs.len() > data || layers.iter().any(Layer::is_marked);
    let margin = if has_margin { 0.04 } else { 0.0 };
    (Ruled::new(x, &xs, margin), Ruled::new(y, &ys, 0.05), data > 0)
}

/// Gives the axes of all panels, which have the same scales, the ranges that show the data of all of
/// them.
pub fn share_axes(panels: &mut [Panel]) {
    let axes: Vec<(Ruled, Ruled, bool)> = panels.iter().map(axes).collect();
    let (xs, ys): (Vec<&Ruled>, Vec<&Ruled>) = axes.iter().map(|(x, y, _)| (x, y)).unzip();
    let [x, y] = [xs, ys].map(|ruled| {
        let low = ruled.iter().map(|axis| axis.low).fold(f64::INFINITY, f64::min);
        let high = ruled.iter().map(|axis| axis.high).fold(f64::NEG_INFINITY, f64::max);
        ruled.first().map(|axis| (axis.axis.value(low), axis.axis.value(high)))
    });
    for panel in panels {
        (panel.x.range, panel.y.range) = (x, y);
    }
}

impl<'a> Ruled<'a> {
    /// Whether the axis is of named rows.
    pub fn is_rows(&self) -> bool {
        matches!(self.axis.scale, Scale::Rows(..))
    }

    /// Chooses the shown part of `axis`: its own range if it has one, otherwise all `values` with a
    /// margin of `margin` times their extent.
    fn new(axis: &'a Axis, values: &[f64], margin: f64) -> Self {
        let (low, high) = match &axis.scale {
            Scale::Rows(names, _) => (names.len().max(1) as f64 - 0.5, -0.5),
            _ => range(axis, values, margin),
        };
        Self { axis, low, high, ticks: Vec::new() }
    }

    /// Returns the coordinate if it is in the shown part or less than a pixel outside.
    pub fn shown(&self, value: f64) -> Option<f64> {
        self.axis.coordinate(value).filter(|&at| (-1e-3..=1.001).contains(&self.fraction(at)))
    }

    /// Returns the shown coordinate nearest to the value; the lower end for a finite value without
    /// a logarithm.
    pub fn nearest(&self, value: f64) -> Option<f64> {
        let at = self.axis.coordinate(value).or((value.abs() <= LARGEST).then_some(self.low));
        at.map(|at| at.clamp(self.low.min(self.high), self.high.max(self.low)))
    }

    /// Returns the position of a coordinate on the axis, 0 at the low end and 1 at the high end.
    pub fn fraction(&self, at: f64) -> f64 {
        (at - self.low) / (self.high - self.low)
    }

    /// Adds at most `most` ticks, and at least two if possible.
    pub fn rule(&mut self, most: usize) {
        let axis = self.axis;
        if axis.unit == Unit::Bare {
            return;
        }
        let mut ticks = if axis.scale == Scale::Log { self.decades(most) } else { vec![] };
        // One tick tells no distance.
        if ticks.len() < 2 {
            let ends = axis.value(self.low)..axis.value(self.high);
            let linear = |most| RangedCoordf64::from(ends.clone()).key_points(most);
            let ample = (most..most + 4).map(linear).find(|ticks| ticks.len() > 1);
            ticks = ample.unwrap_or_else(|| linear(most));
        }
        let tick = |value| Some((axis.coordinate(value)?, label(value, axis.unit)));
        self.ticks = ticks.into_iter().filter_map(tick).collect();
    }

    /// Returns powers of ten, every so many-th if there are many, and their multiples if there are
    /// few.
    fn decades(&self, most: usize) -> Vec<f64> {
        let (first, last) = (self.low.floor() as i32, self.high.floor() as i32);
        let ticks = |step: i32, multiples: &'static [i32]| -> Vec<f64> {
            let powers = (first..=last).filter(|power| power.rem_euclid(step) == 0);
            let values = powers.flat_map(|power| {
                let power = libm::exp10(f64::from(power));
                multiples.iter().map(move |&multiple| f64::from(multiple) * power)
            });
            let is_shown = |value: &f64| (0.0..=1.0).contains(&self.fraction(libm::log10(*value)));
            values.filter(is_shown).collect()
        };
        let fine = [ticks(1, &[1, 2, 3, 5]), ticks(1, &[1, 2, 5]), ticks(1, &[1, 3])].into_iter();
        fine.chain((1..=last - first).map(|step| ticks(step, &[1])))
            .find(|ticks| ticks.len() <= most)
            .unwrap_or_default()
    }
}

/// Returns the shown part of an axis of numbers, as [`Ruled::new`] says.
fn range(axis: &Axis, values: &[f64], margin: f64) -> (f64, f64) {
    let is_log = axis.scale == Scale::Log;
    let coordinates = || values.iter().filter_map(|&value| axis.coordinate(value));
    let least = coordinates().reduce(f64::min).unwrap_or(0.0);
    let most = coordinates().reduce(f64::max).unwrap_or(1.0);
    // A single value is in the middle of a range proportional to it, or of one decade.
    let alone = if is_log || least == 0.0 { 0.5 } else { 0.1 * least.abs() };
    let margin = if most > least { margin * (most - least) } else { alone };
    let (mut low, mut high) = (least - margin, most + margin);
    // No margin beyond zero: a length or a count does not become negative.
    if !is_log && least >= 0.0 {
        low = low.max(0.0);
    }
    if !is_log && most <= 0.0 && least < most {
        high = high.min(0.0);
    }
    if let Some((from, to)) = axis.range {
        low = axis.coordinate(from).unwrap_or(low);
        high = axis.coordinate(to).filter(|&to| to > low).unwrap_or(high);
    }
    // A narrower range would have ends that are equal in ten digits.
    let narrowest = (1e-9 * low.abs().max(high.abs())).max(1e-200);
    (low, if high > low { high.max(low + narrowest) } else { low + narrowest.max(1.0) })
}

/// Writes a value in up to ten digits.
fn label(value: f64, unit: Unit) -> String {
    let value = if unit == Unit::Percent { 100.0 * value } else { value };
    let is_plain = value == 0.0 || (1e-4..1e6).contains(&value.abs());
    let number = pretty_print_float(value, !is_plain).replace('-', "−");
    if unit == Unit::Percent { format!("{number} %") } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64], most: usize) -> Vec<String> {
        let mut ruled = Ruled::new(axis, values, 0.0);
        ruled.rule(most);
        ruled.ticks.into_iter().map(|tick| tick.1).collect()
    }

    #[test]
    fn ticks_are_round_numbers_and_powers_of_ten_where_they_are_many() {
        for (axis, ends, most, ticks) in [
            (Axis::linear(""), [0.0, 100.0], 6, "0 20 40 60 80 100"),
            (Axis::linear(""), [-0.1, 0.1], 5, "−0.1 −0.05 0 0.05 0.1"),
            (Axis::linear("").unit(Unit::Percent), [0.0, 0.1], 3, "0 % 5 % 10 %"),
            (Axis::log(""), [0.01, 100.0], 5, "0.01 0.1 1 10 100"),
            (Axis::log(""), [1.5, 60.0], 6, "2 5 10 20 50"),
            (Axis::log(""), [1.01, 1.04], 6, "1.01 1.02 1.03 1.04"),
            (Axis::log(""), [0.0057, 8.4], 4, "0.01 0.1 1"),
            (Axis::log(""), [0.0057, 14.0], 3, "0.01 1"),
            (Axis::linear(""), [33.0, 47.0], 2, "35 40 45"),
        ] {
            assert_eq!(labels(&axis, &ends, most).join(" "), ticks, "{axis:?}");
        }
    }

    #[test]
    fn shared_axes_show_the_data_of_all_panels() {
        let panel = |x: f64, y: f64| Panel {
            x: Axis::log(""),
            layers: vec![Layer::new("", Marks::Line(vec![(x, y), (2.0 * x, 2.0 * y)]))],
            ..Panel::default()
        };
        let mut panels = [panel(1.0, 5.0), panel(50.0, 1.0)];
        share_axes(&mut panels);
        for panel in &panels {
            let (x, y, _) = axes(panel);
            assert!(x.shown(1.0).is_some() && x.shown(100.0).is_some());
            assert!(y.shown(1.0).is_some() && y.shown(10.0).is_some());
        }
    }

    #[test]
    fn a_reference_line_beside_the_data_is_inside_the_panel() {
        let layers = vec![
            Layer::new("", Marks::Line(vec![(2.0, 1.0), (3.0, 2.0)])),
            Layer::new("", Marks::VLine(1.0)),
            Layer::new("", Marks::HLine(3.0)),
        ];
        let panel = Panel { layers, ..Panel::default() };
        let (x, y, has_data) = axes(&panel);
        assert!(has_data && x.low < 1.0 && y.high > 3.0);
    }
}
