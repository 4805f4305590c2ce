//! Finds the ranges of a panel's axes from its data.

use super::model::{Layer, Panel, Scale};
use super::scale::Span;

/// A panel whose axes' ranges are known.
pub(super) struct Plot<'a> {
    pub panel: &'a Panel,
    pub x: Span,
    pub y: Span,
    /// Whether any series has something to show.
    pub has_data: bool,
}

impl<'a> Plot<'a> {
    pub fn new(panel: &'a Panel) -> Self {
        let mut values = Values::new(panel);
        for layer in &panel.layers {
            match layer {
                Layer::Line { points, .. } | Layer::Steps { points, .. } | Layer::Points { points, .. } => {
                    points.iter().for_each(|&(x, y)| values.add(x, &[y]));
                }
                Layer::Band { points, .. } | Layer::StepBand { points, .. } => {
                    points.iter().for_each(|&(x, low, high)| values.add(x, &[low, high]));
                }
                Layer::ErrorBars { points, .. } => {
                    let has_middle = |point: &&(f64, f64, f64, f64)| values.any.1.place(point.2).is_some();
                    let shown: Vec<_> = points.iter().filter(has_middle).collect();
                    shown.into_iter().for_each(|&(x, low, middle, high)| values.add(x, &[low, middle, high]));
                }
                Layer::Bars { values: heights, spread, base, .. } => {
                    heights.iter().enumerate().for_each(|(i, &height)| values.add(i as f64, &[height]));
                    let ends = spread.iter().take(heights.len()).flat_map(|&(low, high)| [low, high]);
                    values.y.extend(ends.chain([*base]));
                }
                Layer::HLine { y, .. } => values.y.push(*y),
                Layer::VLine { x, .. } => values.x.push(*x),
                Layer::Note { x, y, .. } => {
                    values.x.push(*x);
                    values.y.push(*y);
                }
            }
        }
        // Markers need room at the ends; lines may run from edge to edge.
        let marked = |layer: &Layer| matches!(layer, Layer::Points { .. } | Layer::ErrorBars { .. });
        let margin = if panel.layers.iter().any(marked) { 0.04 } else { 0.0 };
        Self {
            panel,
            x: Span::new(&panel.x, &values.x, margin),
            y: Span::new(&panel.y, &values.y, 0.05),
            has_data: values.has_data,
        }
    }

    /// Whether the x axis has names instead of numbers.
    pub fn has_categories(&self) -> bool {
        matches!(self.panel.x.scale, Scale::Category(_))
    }
}

/// The values that the axes should show.
struct Values {
    /// Axes of any range, that say which values their scales can show at all.
    any: (Span, Span),
    x: Vec<f64>,
    y: Vec<f64>,
    has_data: bool,
}

impl Values {
    fn new(panel: &Panel) -> Self {
        let any = (Span::new(&panel.x, &[], 0.0), Span::new(&panel.y, &[], 0.0));
        Self { any, x: Vec::new(), y: Vec::new(), has_data: false }
    }

    fn add(&mut self, x: f64, ys: &[f64]) {
        let (any_x, any_y) = self.any;
        for &y in ys.iter().filter(|&&y| any_x.place(x).is_some() && any_y.place(y).is_some()) {
            self.has_data = true;
            self.x.push(x);
            self.y.push(y);
        }
    }
}
