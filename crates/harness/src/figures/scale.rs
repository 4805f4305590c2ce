//! Turns values into positions along an axis, and chooses and labels the ticks.

use super::model::{Axis, Scale};

/// Values above this size, in either direction, count as non-finite, so that no difference overflows.
const LARGEST: f64 = 1e300;
/// Positions are kept within this many axis lengths of the axis; a line to a point beyond that is
/// nearly upright or level anyway.
const FARTHEST: f64 = 100.0;

/// The shown part of an axis: `low < high`, in units of the value or of its decimal logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    log: bool,
    low: f64,
    high: f64,
}

/// A labelled position on an axis, as a fraction of its length from the low end.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub at: f64,
    pub label: String,
}

/// The ticks of one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ticks {
    pub major: Vec<Tick>,
    /// Positions of unlabelled grid lines.
    pub minor: Vec<f64>,
    /// The power of ten every label is to be multiplied with, or empty.
    pub factor: String,
}

/// The value's coordinate on a linear or logarithmic line, if it has one there.
fn coordinate(log: bool, value: f64) -> Option<f64> {
    let shown = if log { value > 0.0 && value <= LARGEST } else { value.abs() <= LARGEST };
    shown.then(|| if log { libm::log10(value) } else { value })
}

impl Span {
    /// The part of `axis` that shows its own range or, where it has none, all `values` and a margin
    /// of `margin` times their extent.
    pub fn new(axis: &Axis, values: &[f64], margin: f64) -> Self {
        if let Scale::Category(names) = &axis.scale {
            return Self { log: false, low: -0.5, high: names.len().max(1) as f64 - 0.5 };
        }
        let log = axis.scale == Scale::Log;
        let shown = || values.iter().filter_map(|&value| coordinate(log, value));
        let least = shown().reduce(f64::min);
        let most = shown().reduce(f64::max);
        let set_low = axis.low.and_then(|value| coordinate(log, value));
        let set_high = axis.high.and_then(|value| coordinate(log, value));
        if let (Some(low), Some(high)) = (set_low, set_high)
            && low < high
        {
            return Self { log, low, high }.widened();
        }
        let (Some(least), Some(most)) = (least, most) else {
            let low = set_low.unwrap_or(0.0);
            return Self { log, low, high: set_high.filter(|&high| high > low).unwrap_or(low + 1.0) }.widened();
        };
        let low = set_low.filter(|&low| low < most);
        let high = set_high.filter(|&high| high > low.unwrap_or(least));
        // A single value stands in the middle of a range of its own size, or of one decade.
        let alone = if log || least == 0.0 { 0.5 } else { 0.1 * least.abs() };
        let extent = high.unwrap_or(most) - low.unwrap_or(least);
        let margin = if extent > 0.0 { margin * extent } else { alone };
        // No margin beyond zero: a length or a count does not become negative.
        let below = if !log && least >= 0.0 { (least - margin).max(0.0) } else { least - margin };
        let above = if !log && most <= 0.0 && least < most { (most + margin).min(0.0) } else { most + margin };
        Self { log, low: low.unwrap_or(below), high: high.unwrap_or(above) }.widened()
    }

    /// The same span, made wide enough for its ends to be told apart in ten digits.
    fn widened(self) -> Self {
        let narrowest = (1e-9 * self.low.abs().max(self.high.abs())).max(1e-200);
        let missing = narrowest - (self.high - self.low);
        if missing > 0.0 { Self { low: self.low - missing, high: self.high + missing, ..self } } else { self }
    }

    fn fraction(self, coordinate: f64) -> f64 {
        ((coordinate - self.low) / (self.high - self.low)).clamp(-FARTHEST, FARTHEST)
    }

    /// The value's position as a fraction of the axis length; outside 0..=1 when it is not shown.
    pub fn place(self, value: f64) -> Option<f64> {
        coordinate(self.log, value).map(|coordinate| self.fraction(coordinate))
    }

    /// As [`Self::place`], but finite values without a logarithm are far below the axis.
    pub fn place_or_below(self, value: f64) -> Option<f64> {
        self.place(value).or_else(|| (-LARGEST..=0.0).contains(&value).then_some(-FARTHEST))
    }

    /// The densest ticks whose labels `fit`, of at most `most` (at least 2).
    pub fn ticks(self, most: usize, fit: impl Fn(&[Tick]) -> bool) -> Ticks {
        if self.log {
            self.log_ticks(most, &fit)
        } else {
            let factor = self.factor();
            let major = self.linear_ticks(self.low, self.high, factor, most, &fit);
            Ticks { major, minor: Vec::new(), factor: power_label(factor) }
        }
    }

    /// The power of ten to divide labels by: 0 unless they would be long.
    fn factor(self) -> i32 {
        let size = libm::log10(self.low.abs().max(self.high.abs())).floor() as i32;
        if (-3..5).contains(&size) { 0 } else { size }
    }

    /// Ticks at multiples of 1, 2 or 5 times a power of ten between two values.
    fn linear_ticks(
        self,
        low: f64,
        high: f64,
        factor: i32,
        most: usize,
        fit: &dyn Fn(&[Tick]) -> bool,
    ) -> Vec<Tick> {
        let first = libm::log10((high - low) / most.max(2) as f64).floor() as i32;
        let mut ticks = Vec::new();
        for (power, mantissa) in (first..first + 3).flat_map(|power| [1, 2, 5].map(|m| (power, m))) {
            let step = f64::from(mantissa) * libm::exp10(f64::from(power));
            let (from, to) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
            let count = to - from + 1.0;
            if count > most.max(2) as f64 {
                continue;
            }
            if count < 2.0 && !ticks.is_empty() {
                break;
            }
            let digits = (factor - power).clamp(0, 11) as usize;
            ticks = (0..count.max(0.0) as i64)
                .map(|i| (from as i64 + i) * i64::from(mantissa))
                .filter_map(|units| {
                    let value = units as f64 * libm::exp10(f64::from(power));
                    let label = decimal(units as f64 * libm::exp10(f64::from(power - factor)), digits);
                    Some(Tick { at: self.place(value)?, label })
                })
                .collect();
            if fit(&ticks) {
                return ticks;
            }
        }
        // None fit: the ends, or if these do not either, one.
        if let [first, .., last] = &ticks[..] {
            ticks = vec![first.clone(), last.clone()];
            if !fit(&ticks) {
                ticks.pop();
            }
        }
        ticks
    }

    fn log_ticks(self, most: usize, fit: &dyn Fn(&[Tick]) -> bool) -> Ticks {
        let (first, last) = ((self.low - 1e-9).ceil() as i32, (self.high + 1e-9).floor() as i32);
        let at = |power: i32, mantissa: i32| self.fraction(f64::from(power) + libm::log10(f64::from(mantissa)));
        let inside = |at: &f64| (-1e-9..=1.0 + 1e-9).contains(at);
        let between: Vec<(i32, i32)> =
            (first - 1..=last).flat_map(|power| (2..10).map(move |mantissa| (power, mantissa))).collect();
        let fine: Vec<f64> = between.iter().map(|&(power, m)| at(power, m)).filter(inside).collect();

        // At least two decades: every power of ten, or every second, third... one.
        if last > first {
            for every in 1..=last - first {
                let labelled: Vec<i32> = (first..=last).filter(|power| power.rem_euclid(every) == 0).collect();
                if labelled.len() < 2 {
                    break;
                }
                let marks = labelled.iter().map(|&power| (power, 1)).collect::<Vec<_>>();
                let major = labels(&marks, at);
                if major.len() <= most.max(2) && fit(&major) {
                    let coarse = || (first..=last).map(|power| at(power, 1)).collect();
                    return Ticks {
                        major,
                        minor: if every == 1 { fine } else { coarse() },
                        factor: String::new(),
                    };
                }
            }
        }
        // Less: also their multiples, as many as fit.
        for mantissas in [&[1, 2, 3, 4, 5, 6, 7, 8, 9][..], &[1, 2, 3, 5], &[1, 2, 5], &[1, 3]] {
            let marks: Vec<(i32, i32)> = (first - 1..=last)
                .flat_map(|power| mantissas.iter().map(move |&mantissa| (power, mantissa)))
                .filter(|&(power, mantissa)| inside(&at(power, mantissa)))
                .collect();
            let major = labels(&marks, at);
            if marks.len() >= 3 && major.len() <= most.max(3) && fit(&major) {
                return Ticks { major, minor: fine, factor: String::new() };
            }
        }
        // A small part of a decade is nearly linear.
        let (low, high) = (libm::exp10(self.low), libm::exp10(self.high));
        let factor = Self { log: false, low, high }.factor();
        let major = self.linear_ticks(low, high, factor, most, fit);
        Ticks { major, minor: Vec::new(), factor: power_label(factor) }
    }
}

/// Ticks at mantissa × 10^power, all written out or all as powers.
fn labels(marks: &[(i32, i32)], at: impl Fn(i32, i32) -> f64) -> Vec<Tick> {
    let plain = marks.iter().all(|&(power, _)| (-3..5).contains(&power));
    let label = |power: i32, mantissa: i32| {
        if plain {
            decimal(f64::from(mantissa) * libm::exp10(f64::from(power)), (-power).max(0) as usize)
        } else if mantissa == 1 {
            format!("10{}", superscript(power))
        } else {
            format!("{mantissa}×10{}", superscript(power))
        }
    };
    marks.iter().map(|&(power, m)| Tick { at: at(power, m), label: label(power, m) }).collect()
}

/// `×10ⁿ`, or nothing for n = 0.
fn power_label(power: i32) -> String {
    if power == 0 { String::new() } else { format!("×10{}", superscript(power)) }
}

/// The number with this many decimals and a true minus sign.
fn decimal(value: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", value.abs());
    let zero = text.bytes().all(|byte| byte == b'0' || byte == b'.');
    if value < 0.0 && !zero { format!("−{text}") } else { text }
}

/// The integer in superscript digits.
fn superscript(number: i32) -> String {
    let raise = |digit| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' => '⁰',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        _ => '⁹',
    };
    number.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels_of(axis: &Axis, values: &[f64], most: usize) -> Vec<String> {
        let ticks = Span::new(axis, values, 0.0).ticks(most, |_| true);
        ticks.major.into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn a_log_axis_is_labelled_at_powers_of_ten_with_minor_lines_between() {
        let span = Span::new(&Axis::log(""), &[0.01, 100.0], 0.0);
        let ticks = span.ticks(10, |_| true);
        let labels: Vec<&str> = ticks.major.iter().map(|tick| tick.label.as_str()).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10", "100"]);
        let at: Vec<f64> = ticks.major.iter().map(|tick| tick.at).collect();
        assert_eq!(at, [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(ticks.minor.len(), 4 * 8);
        assert_eq!(labels_of(&Axis::log(""), &[1e-7, 1e-4], 10), ["10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴"]);
    }

    #[test]
    fn crowded_decades_are_labelled_every_few() {
        let ticks = Span::new(&Axis::log(""), &[1e-12, 1.0], 0.0).ticks(5, |_| true);
        let labels: Vec<&str> = ticks.major.iter().map(|tick| tick.label.as_str()).collect();
        assert_eq!(labels, ["10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "10⁰"]);
    }

    #[test]
    fn less_than_two_decades_are_labelled_inside() {
        assert_eq!(labels_of(&Axis::log(""), &[1.5, 60.0], 6), ["2", "5", "10", "20", "50"]);
        assert_eq!(labels_of(&Axis::log(""), &[1.01, 1.04], 6), ["1.01", "1.02", "1.03", "1.04"]);
    }

    #[test]
    fn linear_ticks_are_round_numbers() {
        assert_eq!(labels_of(&Axis::linear(""), &[0.0, 100.0], 6), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(labels_of(&Axis::linear(""), &[-0.1, 0.1], 5), ["−0.10", "−0.05", "0.00", "0.05", "0.10"]);
    }

    #[test]
    fn long_numbers_share_a_power_of_ten() {
        let ticks = Span::new(&Axis::linear(""), &[1.0e14, 1.5e14], 0.0).ticks(6, |_| true);
        assert_eq!(ticks.factor, "×10¹⁴");
        assert_eq!(ticks.major[1].label, "1.1");
    }

    #[test]
    fn one_value_or_none_still_gives_an_axis() {
        for axis in [Axis::linear(""), Axis::log("")] {
            for values in [vec![], vec![7.0], vec![1e-320], vec![0.0], vec![1e300, -1e300, f64::NAN]] {
                let span = Span::new(&axis, &values, 0.05);
                assert!(span.low < span.high, "{values:?} gave {span:?}");
                let ticks = span.ticks(8, |_| true).major;
                assert!((1..=8).contains(&ticks.len()), "{values:?} gave {ticks:?}");
            }
        }
    }

    #[test]
    fn values_an_axis_cannot_show_have_no_place() {
        let span = Span::new(&Axis::log(""), &[1.0, 10.0], 0.0);
        assert_eq!((span.place(0.0), span.place(-1.0), span.place(f64::NAN)), (None, None, None));
        assert_eq!((span.place(1.0), span.place(10.0)), (Some(0.0), Some(1.0)));
        assert!(span.place_or_below(0.0).is_some_and(|at| at < 0.0));
    }

    #[test]
    fn a_set_range_wins_over_the_data_unless_it_is_empty() {
        let span = |axis: Axis| Span::new(&axis, &[3.0, 4.0], 0.0);
        assert_eq!(span(Axis::linear("").range(0.0, 10.0)), Span { log: false, low: 0.0, high: 10.0 });
        assert_eq!(span(Axis::linear("").starting_at(0.0)), Span { log: false, low: 0.0, high: 4.0 });
        assert_eq!(span(Axis::linear("").range(9.0, f64::NAN)), Span { log: false, low: 3.0, high: 4.0 });
    }
}
