//! Chooses the ticks of a panel's sides and measures how deep a side is with its label.

use super::model::{Axis, Scale};
use super::scale::{Span, Tick, Ticks};
use super::text::{BODY, Ruler, SMALL};

/// Longest category name in pixels.
const LONGEST: f64 = 150.0;
/// From an axis to its tick labels, and on to its label.
pub(super) const TICK: f64 = 7.0;
pub(super) const LABEL: f64 = 5.0;

/// An axis with its ticks and label, ready to be drawn.
pub(super) struct Side {
    pub ticks: Ticks,
    /// Tick labels stand upright.
    pub upright: bool,
    /// The axis label with the ticks' common factor, and its lines.
    pub label: String,
    pub lines: Vec<String>,
    /// Pixels from the plot to the outer edge of the tick labels.
    pub depth: f64,
}

/// Pixels for an axis label beyond the tick labels.
pub(super) fn label_depth(lines: &[String]) -> f64 {
    if lines.is_empty() { 0.0 } else { LABEL + BODY.line() * lines.len() as f64 }
}

/// The lower side of a plot of this width.
pub(super) fn horizontal(axis: &Axis, span: Span, length: f64, ruler: &Ruler) -> Side {
    let width = |tick: &Tick| ruler.width(&tick.label, SMALL);
    let (ticks, upright) = if let Scale::Category(names) = &axis.scale {
        let room = length / names.len().max(1) as f64;
        let upright = names.iter().any(|name| ruler.width(name, SMALL) + 8.0 > room);
        (category_ticks(names, span, room, if upright { SMALL.line() } else { room }, ruler), upright)
    } else {
        let apart =
            |one: &Tick, next: &Tick| (next.at - one.at) * length >= (width(one) + width(next)) / 2.0 + 9.0;
        let fit = |ticks: &[Tick]| ticks.iter().zip(ticks.iter().skip(1)).all(|(one, next)| apart(one, next));
        (span.ticks(((length / 36.0) as usize).clamp(4, 12), fit), false)
    };
    let deepest = ticks.major.iter().map(width).fold(0.0, f64::max);
    let depth = TICK + if upright { deepest } else { SMALL.line() };
    Side::new(axis, ticks, upright, length, depth, ruler)
}

/// The left side of a plot of this height.
pub(super) fn vertical(axis: &Axis, span: Span, length: f64, ruler: &Ruler) -> Side {
    let ticks = if let Scale::Category(names) = &axis.scale {
        category_ticks(names, span, length / names.len().max(1) as f64, SMALL.line(), ruler)
    } else {
        let apart = |one: &Tick, next: &Tick| (next.at - one.at) * length >= SMALL.line();
        let fit = |ticks: &[Tick]| ticks.iter().zip(ticks.iter().skip(1)).all(|(one, next)| apart(one, next));
        span.ticks(((length / 32.0) as usize).clamp(3, 10), fit)
    };
    let depth = TICK + ruler.widest(ticks.major.iter().map(|tick| tick.label.as_str()), SMALL);
    Side::new(axis, ticks, false, length, depth, ruler)
}

/// Ticks at every category, or every second, third, ... one where they need more room than they have.
fn category_ticks(names: &[String], span: Span, room: f64, needed: f64, ruler: &Ruler) -> Ticks {
    let every = (needed / room.max(1e-3)).ceil().clamp(1.0, 1e6) as usize;
    let tick = |(index, name): (usize, &String)| {
        Some(Tick { at: span.place(index as f64)?, label: ruler.shorten(name, LONGEST, SMALL) })
    };
    Ticks { major: names.iter().enumerate().step_by(every).filter_map(tick).collect(), ..Ticks::default() }
}

impl Side {
    fn new(axis: &Axis, ticks: Ticks, upright: bool, length: f64, depth: f64, ruler: &Ruler) -> Self {
        let factor = if ticks.factor.is_empty() { String::new() } else { format!("[{}]", ticks.factor) };
        let label = format!("{} {factor}", axis.label).trim().to_owned();
        let lines = ruler.wrap(&label, length, BODY);
        Self { ticks, upright, label, lines, depth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_do_not_fit_side_by_side_stand_upright() {
        let ruler = Ruler::new().unwrap();
        let names = |count: usize| (0..count).map(|i| format!("scene {i}")).collect::<Vec<_>>();
        let side = |count| {
            let axis = Axis::categories("", names(count));
            horizontal(&axis, Span::new(&axis, &[], 0.0), 400.0, &ruler)
        };
        assert!(!side(5).upright && side(5).ticks.major.len() == 5);
        assert!(side(15).upright && side(15).ticks.major.len() == 15);
        assert!(side(150).upright && side(150).ticks.major.len() < 50);
    }

    #[test]
    fn tick_labels_do_not_touch() {
        let ruler = Ruler::new().unwrap();
        for axis in [Axis::linear(""), Axis::log("")] {
            for values in [[1.0, 1.1], [1.0, 90.0], [1e-9, 1e9], [123_456.1, 123_456.2], [1e14, 1.1e14]] {
                for length in [60.0, 150.0, 700.0] {
                    let side = horizontal(&axis, Span::new(&axis, &values, 0.0), length, &ruler);
                    let ends = |tick: &Tick| {
                        let half = ruler.width(&tick.label, SMALL) / 2.0;
                        (tick.at * length - half, tick.at * length + half)
                    };
                    let ticks = &side.ticks.major;
                    let clear = ticks.iter().zip(&ticks[1..]).all(|(one, next)| ends(one).1 < ends(next).0);
                    assert!(clear, "{values:?} in {length}: {ticks:?}");
                }
            }
        }
    }
}
