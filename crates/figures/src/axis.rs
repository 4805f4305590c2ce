//! Chooses the shown part of an axis and its ticks.
//!
//! Panels are drawn in coordinates: the values of a linear axis, the decimal logarithms of a
//! logarithmic axis, and the negative indices of rows. Logarithms come from a library whose last
//! digit is the same on every machine.

use super::model::{Axis, Marks, Panel, Scale, Unit};

/// Values of a larger magnitude count as non-finite, so that no difference overflows.
const LARGEST: f64 = 1e300;

/// The shown part of an axis with its ticks, in coordinates: `low < high`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ruled {
    log: bool,
    /// True for rows, which are counted downwards.
    down: bool,
    unit: Unit,
    pub low: f64,
    pub high: f64,
    /// Labelled ticks.
    pub major: Vec<(f64, String)>,
    /// Unlabelled grid lines.
    pub minor: Vec<f64>,
}

/// Returns both axes of a panel, without ticks, and true if any series has data to show.
pub(super) fn axes(panel: &Panel) -> (Ruled, Ruled, bool) {
    // Only the scale decides whether a value has a coordinate, so axes without ranges suffice here.
    let any = (Ruled::new(&panel.x, &[], 0.0), Ruled::new(&panel.y, &[], 0.0));
    let mut xs = Vec::new();
    let mut ys = Vec::new();
    let mut add = |x: f64, heights: &[f64]| {
        for &y in heights
            .iter()
            .filter(|&&y| any.0.coordinate(x).is_some() && any.1.coordinate(y).is_some())
        {
            xs.push(x);
            ys.push(y);
        }
    };
    let mut other_xs = Vec::new();
    let mut other_ys = Vec::new();
    let mut marked = false;
    for layer in &panel.layers {
        marked |= layer.is_marked();
        match &layer.marks {
            Marks::Line(points) | Marks::Steps(points) | Marks::Points(points) => {
                points.iter().for_each(|&(x, y)| add(x, &[y]));
            }
            Marks::Band(points) => {
                points.iter().for_each(|&(x, low, high)| add(x, &[low, high]));
            }
            Marks::Spans(spans) => {
                spans.iter().flatten().for_each(|&(x, y)| {
                    other_xs.push(x);
                    other_ys.push(y);
                });
            }
            Marks::HLine(y) => other_ys.push(*y),
            Marks::VLine(x) => other_xs.push(*x),
            Marks::Text(_) => {}
        }
    }
    let has_data = !xs.is_empty();
    // Lines may run from edge to edge; markers and upright reference lines need room at the ends.
    let margin = if marked || !other_xs.is_empty() { 0.04 } else { 0.0 };
    xs.extend(other_xs);
    ys.extend(other_ys);
    (Ruled::new(&panel.x, &xs, margin), Ruled::new(&panel.y, &ys, 0.05), has_data)
}

impl Ruled {
    /// Chooses the shown part of `axis`: its own range if it has one, otherwise all `values` with a
    /// margin of `margin` times their extent.
    pub fn new(axis: &Axis, values: &[f64], margin: f64) -> Self {
        let log = axis.scale == Scale::Log;
        let any = Self { log, unit: axis.unit, ..Self::default() };
        if let Scale::Rows(names, _) = &axis.scale {
            return Self { low: 0.5 - names.len().max(1) as f64, high: 0.5, down: true, ..any };
        }
        let shown = || values.iter().filter_map(|&value| any.coordinate(value));
        let least = shown().reduce(f64::min).unwrap_or(0.0);
        let most = shown().reduce(f64::max).unwrap_or(1.0);
        // A single value is in the middle of a range proportional to it, or of one decade.
        let alone = if log || least == 0.0 { 0.5 } else { 0.1 * least.abs() };
        let margin = if most > least { margin * (most - least) } else { alone };
        // No margin beyond zero: a length or a count does not become negative.
        let low = if !log && least >= 0.0 { (least - margin).max(0.0) } else { least - margin };
        let high = if !log && most <= 0.0 && least < most {
            (most + margin).min(0.0)
        } else {
            most + margin
        };
        let set = |end: Option<f64>| end.and_then(|value| any.coordinate(value));
        let low = set(axis.range.map(|range| range.0)).unwrap_or(low);
        let high = set(axis.range.map(|range| range.1)).filter(|&high| high > low).unwrap_or(high);
        // A narrower range would have ends that are equal in ten digits.
        let narrowest = (1e-9 * low.abs().max(high.abs())).max(1e-200);
        Self {
            low,
            high: if high > low { high.max(low + narrowest) } else { low + narrowest.max(1.0) },
            ..any
        }
    }

    /// Returns the value's coordinate, which may be outside the shown part; `None` if the axis
    /// cannot show the value.
    pub fn coordinate(&self, value: f64) -> Option<f64> {
        let possible = value.abs() <= LARGEST && (value > 0.0 || !self.log);
        possible.then(|| match (self.log, self.down) {
            (true, _) => libm::log10(value),
            (_, true) => -value,
            _ => value,
        })
    }

    /// Returns the coordinate if it is in the shown part or less than a pixel outside.
    pub fn shown(&self, value: f64) -> Option<f64> {
        self.coordinate(value).filter(|&at| (-1e-3..=1.001).contains(&self.fraction(at)))
    }

    /// Returns the shown coordinate nearest to the value; the lower end for a finite value without
    /// a logarithm.
    pub fn nearest(&self, value: f64) -> Option<f64> {
        let at = self.coordinate(value).or((value.abs() <= LARGEST).then_some(self.low));
        at.map(|at| at.clamp(self.low, self.high))
    }

    /// Returns the position of a coordinate on the axis, 0 at the low end and 1 at the high end.
    pub fn fraction(&self, at: f64) -> f64 {
        (at - self.low) / (self.high - self.low)
    }

    /// Adds at most `most` ticks, and at least three if possible.
    pub fn rule(&mut self, most: usize) {
        if self.unit == Unit::Bare {
            return;
        }
        if self.down {
            // Faint lines guide the eye from a name to its marks.
            self.minor = (0..=(-self.low) as i32).map(|row| f64::from(-row)).collect();
        } else if !self.log || !self.rule_decades(most) {
            let (low, high) = if self.log {
                (libm::exp10(self.low), libm::exp10(self.high))
            } else {
                (self.low, self.high)
            };
            self.rule_evenly(low, high, most.max(3));
        }
    }

    /// Adds ticks at multiples of 1, 2 or 5 times a power of ten between two values.
    fn rule_evenly(&mut self, low: f64, high: f64, most: usize) {
        let size = libm::log10(low.abs().max(high.abs())).floor() as i32;
        // Labels of more than five digits would collide, so they are multiples of a power of ten.
        let plain = self.unit != Unit::Number || (-3..5).contains(&size);
        let factor = if plain { 0 } else { size };
        let power_of_ten =
            if plain { String::new() } else { format!("×10{}", superscript(factor)) };
        let first = libm::log10((high - low) / most as f64).floor() as i32;
        for (power, mantissa) in
            (first..first + 3).flat_map(|power| [1, 2, 5].map(|mantissa| (power, mantissa)))
        {
            let step = f64::from(mantissa) * libm::exp10(f64::from(power));
            let from = (low / step - 1e-6).ceil();
            let to = (high / step + 1e-6).floor();
            if to - from < most as f64 {
                // All labels of an axis have as many decimals as its step needs.
                let digits = (factor - power).clamp(0, 11) as usize;
                let ticks = (0..=(to - from) as i64).filter_map(|index| {
                    let units = (from + index as f64) * f64::from(mantissa);
                    let label = self.label(units * libm::exp10(f64::from(power - factor)), digits)
                        + &power_of_ten;
                    Some((self.coordinate(units * libm::exp10(f64::from(power)))?, label))
                });
                self.major = ticks.collect();
                break;
            }
        }
    }

    /// Adds ticks at powers of ten, and at their multiples if there are few powers. Returns false
    /// if there are too few of both.
    fn rule_decades(&mut self, most: usize) -> bool {
        let first = (self.low - 1e-9).ceil() as i32;
        let last = (self.high + 1e-9).floor() as i32;
        // Numbers of this size are easier to read than powers of ten.
        let plain = self.unit != Unit::Number || first >= -3 && last < 5;
        let at = |power: i32, mantissa: i32| f64::from(power) + libm::log10(f64::from(mantissa));
        let marks = |mantissas: &'static [i32]| -> Vec<(i32, i32)> {
            let all = (first - 1..=last)
                .flat_map(|power| mantissas.iter().map(move |&mantissa| (power, mantissa)));
            all.filter(|&(power, mantissa)| (self.low..=self.high).contains(&at(power, mantissa)))
                .collect()
        };
        let tick = |&(power, mantissa): &(i32, i32)| {
            let label = if plain {
                let value = f64::from(mantissa) * libm::exp10(f64::from(power));
                self.label(value, (-power).max(0) as usize)
            } else if mantissa == 1 {
                format!("10{}", superscript(power))
            } else {
                format!("{mantissa}×10{}", superscript(power))
            };
            (at(power, mantissa), label)
        };
        let every = |step: i32| {
            (first..=last)
                .filter(|power| power.rem_euclid(step) == 0)
                .map(|power| (power, 1))
                .collect()
        };
        let multiples = [marks(&[1, 2, 3, 5]), marks(&[1, 2, 5]), marks(&[1, 3])]
            .into_iter()
            .filter(|_| plain || last <= first);
        let chosen = multiples
            .filter(|ticks| ticks.len() >= 3)
            .chain((1..=last - first).map(every).filter(|ticks: &Vec<_>| ticks.len() >= 2))
            .find(|ticks| ticks.len() <= most.max(3));
        let fine =
            if self.high - self.low <= 6.0 { marks(&[2, 3, 4, 5, 6, 7, 8, 9]) } else { every(1) };
        let major = chosen.iter().flatten().map(tick).collect();
        self.minor = fine.iter().map(|&(power, mantissa)| at(power, mantissa)).collect();
        self.major = major;
        chosen.is_some()
    }
}

impl Ruled {
    /// Writes a value that is exact in this many decimals.
    fn label(&self, value: f64, digits: usize) -> String {
        match self.unit {
            Unit::Percent => format!("{} %", decimal(100.0 * value, digits.saturating_sub(2))),
            Unit::Seconds if value < 0.099 => {
                format!("{} ms", decimal(1000.0 * value, digits.saturating_sub(3)))
            }
            Unit::Seconds => format!("{} s", decimal(value, digits)),
            Unit::Number | Unit::Bare => decimal(value, digits),
        }
    }
}

/// Formats a number with this many decimals and a true minus sign.
fn decimal(value: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", value.abs());
    let zero = text.bytes().all(|byte| byte == b'0' || byte == b'.');
    if value < 0.0 && !zero { format!("−{text}") } else { text }
}

/// Formats an integer in superscript digits.
fn superscript(number: i32) -> String {
    let raised = |digit: char| match digit.to_digit(10) {
        Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
        None => '⁻',
    };
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::super::model::Layer;
    use super::*;

    fn labels(axis: &Axis, values: &[f64], most: usize) -> Vec<String> {
        let mut ruled = Ruled::new(axis, values, 0.0);
        ruled.rule(most);
        ruled.major.into_iter().map(|tick| tick.1).collect()
    }

    #[test]
    fn a_log_axis_is_labelled_at_powers_of_ten_and_between_them_where_they_are_few() {
        assert_eq!(labels(&Axis::log(""), &[0.01, 100.0], 5), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(labels(&Axis::log(""), &[1e-7, 1e-4], 10), ["10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴"]);
        assert_eq!(
            labels(&Axis::log(""), &[1e-12, 1.0], 5),
            ["10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "10⁰"]
        );
        assert_eq!(labels(&Axis::log(""), &[1.5, 60.0], 6), ["2", "5", "10", "20", "50"]);
        assert_eq!(labels(&Axis::log(""), &[1.01, 1.04], 6), ["1.01", "1.02", "1.03", "1.04"]);
    }

    #[test]
    fn linear_ticks_are_round_numbers_and_long_ones_share_a_power_of_ten() {
        assert_eq!(
            labels(&Axis::linear(""), &[0.0, 100.0], 6),
            ["0", "20", "40", "60", "80", "100"]
        );
        assert_eq!(
            labels(&Axis::linear(""), &[-0.1, 0.1], 5),
            ["−0.10", "−0.05", "0.00", "0.05", "0.10"]
        );
        assert_eq!(
            labels(&Axis::linear(""), &[1.0e14, 1.3e14], 4),
            ["1.0×10¹⁴", "1.1×10¹⁴", "1.2×10¹⁴", "1.3×10¹⁴"]
        );
    }

    #[test]
    fn one_value_or_none_still_gives_an_axis() {
        for axis in [
            Axis::linear(""),
            Axis::log(""),
            Axis::log("").range(2.0, 1.0),
            Axis::linear("").range(9.0, f64::NAN),
        ] {
            for values in
                [vec![], vec![7.0], vec![1e-320], vec![0.0], vec![1e300, -1e300, f64::NAN]]
            {
                let ruled = Ruled::new(&axis, &values, 0.05);
                assert!(ruled.low < ruled.high, "{values:?} gave {ruled:?}");
                let ticks = labels(&axis, &values, 8);
                assert!((1..=9).contains(&ticks.len()), "{values:?} gave {ticks:?}");
            }
        }
    }

    #[test]
    fn a_reference_line_beside_the_data_is_inside_the_panel() {
        let layers = vec![
            Layer::new("", Marks::Line(vec![(2.0, 1.0), (3.0, 2.0)])),
            Layer::new("", Marks::VLine(1.0)),
            Layer::new("", Marks::HLine(3.0)),
        ];
        let (x, y, has_data) = axes(&Panel { layers, ..Panel::default() });
        assert!(has_data && x.low < 1.0 && y.high > 3.0);
    }
}
