//! Turns the layers of a panel into lines, areas and markers in pixels.

use super::canvas::{Canvas, Fault, Frame};
use super::label::Labels;
use super::model::{Layer, Panel, Scale};
use super::scale::Span;
use super::style::{GREY, INK, Strokes};

/// Width of data lines.
const LINE: f64 = 2.0;
/// Radius of markers.
const RADIUS: f64 = 4.0;
/// On and off lengths of reference lines.
const RULE: &[f64] = &[4.0, 3.0];

type Point = (f64, f64);

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
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        let mut has_data = false;
        // Spans of single values say which values the scales can show at all.
        let (any_x, any_y) = (Span::new(&panel.x, &[], 0.0), Span::new(&panel.y, &[], 0.0));
        for layer in &panel.layers {
            let mut add = |x: f64, y: f64| {
                if any_x.place(x).is_some() && any_y.place(y).is_some() {
                    has_data = true;
                    xs.push(x);
                    ys.push(y);
                }
            };
            match layer {
                Layer::Line { points, .. } | Layer::Steps { points, .. } | Layer::Points { points, .. } => {
                    points.iter().for_each(|&(x, y)| add(x, y));
                }
                Layer::Band { points, .. } | Layer::StepBand { points, .. } => {
                    points.iter().for_each(|&(x, low, high)| [low, high].into_iter().for_each(|y| add(x, y)));
                }
                Layer::ErrorBars { points, .. } => points
                    .iter()
                    .filter(|point| any_y.place(point.2).is_some())
                    .for_each(|&(x, low, y, high)| [low, y, high].into_iter().for_each(|y| add(x, y))),
                Layer::Bars { values, spread, base, .. } => {
                    values.iter().enumerate().for_each(|(i, &value)| add(i as f64, value));
                    let ends = spread.iter().take(values.len()).flat_map(|&(low, high)| [low, high]);
                    ys.extend(ends.chain([*base]));
                }
                Layer::HLine { y, .. } => ys.push(*y),
                Layer::VLine { x, .. } => xs.push(*x),
                Layer::Note { x, y, .. } => {
                    xs.push(*x);
                    ys.push(*y);
                }
            }
        }
        // Markers need room at the ends; lines may run from edge to edge.
        let marked = |layer: &Layer| matches!(layer, Layer::Points { .. } | Layer::ErrorBars { .. });
        let margin = if panel.layers.iter().any(marked) { 0.04 } else { 0.0 };
        Self { panel, x: Span::new(&panel.x, &xs, margin), y: Span::new(&panel.y, &ys, 0.05), has_data }
    }

    /// The point in pixels from the frame's upper left corner.
    fn at(&self, frame: Frame, x: f64, y: f64) -> Option<Point> {
        Some((self.x.place(x)? * frame.width, (1.0 - self.y.place(y)?) * frame.height))
    }

    /// The unbroken parts of a line or staircase.
    fn paths(&self, frame: Frame, points: impl Iterator<Item = Point>, stairs: bool) -> Vec<Vec<Point>> {
        let mut paths: Vec<Vec<Point>> = vec![Vec::new()];
        for (x, y) in points {
            let place = |span: Span, value| if stairs { span.place_or_below(value) } else { span.place(value) };
            let (Some(x), Some(y)) = (place(self.x, x), place(self.y, y)) else {
                paths.push(Vec::new());
                continue;
            };
            let (x, y) = (x * frame.width, (1.0 - y) * frame.height);
            let Some(path) = paths.last_mut() else { continue };
            if let (true, Some(&(_, before))) = (stairs, path.last()) {
                path.push((x, before));
            }
            path.push((x, y));
        }
        paths.retain(|path| !path.is_empty());
        paths
    }

    /// The outlines of a band's unbroken parts.
    fn outlines(&self, frame: Frame, points: &[(f64, f64, f64)], stairs: bool) -> Vec<Vec<Point>> {
        // Both edges break at the same points.
        let whole = |&&(x, low, high): &&(f64, f64, f64)| {
            let x_shown = self.x.place(x).or_else(|| self.x.place_or_below(x).filter(|_| stairs));
            x_shown.is_some() && self.y.place_or_below(low).is_some() && self.y.place_or_below(high).is_some()
        };
        let floor = |value: f64| {
            let at = self.y.place_or_below(value).unwrap_or(0.0);
            (1.0 - at) * frame.height
        };
        let edge = |part: &[(f64, f64, f64)], value: fn(&(f64, f64, f64)) -> f64| {
            let mut path: Vec<Point> = Vec::new();
            for point in part {
                let (x, y) = (self.x.place_or_below(point.0).unwrap_or(0.0) * frame.width, floor(value(point)));
                if let (true, Some(&(_, before))) = (stairs, path.last()) {
                    path.push((x, before));
                }
                path.push((x, y));
            }
            path
        };
        let outline = |part: &[(f64, f64, f64)]| {
            let mut outline = edge(part, |point| point.1);
            outline.extend(edge(part, |point| point.2).into_iter().rev());
            outline
        };
        points
            .chunk_by(|one, next| whole(&one).eq(&whole(&next)))
            .filter(|part| part.first().is_some_and(|first| whole(&first)))
            .map(outline)
            .collect()
    }

    /// All bars with their whiskers, in pixels, each with the index of its layer.
    fn bars(&self, frame: Frame) -> Vec<(usize, Frame, Option<(Point, Point)>)> {
        let is_bars = |layer: &&Layer| matches!(layer, Layer::Bars { .. });
        let series = self.panel.layers.iter().filter(is_bars).count().max(1) as f64;
        let width = 0.8 / series;
        let mut bars = Vec::new();
        let mut order = 0.0;
        for (index, layer) in self.panel.layers.iter().enumerate() {
            let Layer::Bars { values, spread, base, .. } = layer else { continue };
            let offset = -0.4 + width * order;
            order += 1.0;
            let base = (1.0 - self.y.place(*base).unwrap_or(0.0)) * frame.height;
            for (i, &value) in values.iter().enumerate() {
                let left = i as f64 + offset;
                let (Some((from, tip)), Some(to)) = (self.at(frame, left, value), self.x.place(left + width)) else {
                    continue;
                };
                let to = to * frame.width;
                // A hair of white between neighbours.
                let bar = Frame { left: from + 0.5, top: tip.min(base), width: to - from - 1.0, height: (tip - base).abs() };
                let middle = (from + to) / 2.0;
                let end = |y: f64| self.y.place_or_below(y).map(|y| (middle, (1.0 - y) * frame.height));
                let whisker = spread.get(i).and_then(|&(low, high)| Some((end(low)?, end(high)?)));
                bars.push((index, bar, whisker));
            }
        }
        bars
    }

    /// Draws all that the panel's edges cut off, and tells `labels` to keep off it.
    pub fn draw_inside(&self, canvas: &mut Canvas, frame: Frame, strokes: &Strokes, labels: &mut Labels) -> Result<(), Fault> {
        let shifted = |path: &[Point]| -> Vec<Point> {
            path.iter().map(|&(x, y)| (x + frame.left, y + frame.top)).collect()
        };
        let layers = &self.panel.layers;
        let bars = self.bars(frame);
        canvas.inside(frame, &[], |pen| {
            for layer in layers {
                let (Layer::Band { name, points } | Layer::StepBand { name, points }) = layer else { continue };
                let stairs = matches!(layer, Layer::StepBand { .. });
                for outline in self.outlines(frame, points, stairs) {
                    pen.polygon(&outline, strokes.of(name).colour, 0.2)?;
                }
            }
            for (index, bar, _) in &bars {
                let name = layers.get(*index).and_then(Layer::name).unwrap_or_default();
                pen.rectangle(*bar, strokes.of(name).colour, 1.0)?;
            }
            for whisker in bars.iter().filter_map(|(_, _, whisker)| *whisker) {
                whiskers(pen, whisker, INK)?;
            }
            for layer in layers {
                let Layer::ErrorBars { name, points } = layer else { continue };
                for &(x, low, middle, high) in points {
                    if let (Some(x), Some(low), Some(_), Some(high)) =
                        (self.x.place(x), self.y.place_or_below(low), self.y.place(middle), self.y.place_or_below(high))
                    {
                        let end = |y: f64| (x * frame.width, (1.0 - y) * frame.height);
                        whiskers(pen, (end(low), end(high)), strokes.of(name).colour)?;
                        labels.avoid(&shifted(&[end(low), end(high)]));
                    }
                }
            }
            Ok(())
        })?;
        for (_, bar, _) in &bars {
            let (left, right) = (bar.left, bar.right());
            labels.avoid(&shifted(&[(left, bar.bottom()), (left, bar.top), (right, bar.top), (right, bar.bottom())]));
        }

        canvas.inside(frame, RULE, |pen| {
            for layer in layers {
                let line = match *layer {
                    Layer::HLine { y, .. } => self.y.place(y).map(|y| {
                        let y = (1.0 - y) * frame.height;
                        [(0.0, y), (frame.width, y)]
                    }),
                    Layer::VLine { x, .. } => self.x.place(x).map(|x| {
                        let x = x * frame.width;
                        [(x, 0.0), (x, frame.height)]
                    }),
                    _ => None,
                };
                if let Some(line) = line {
                    pen.path(&line, GREY, 1.3)?;
                    labels.avoid(&shifted(&line));
                }
            }
            Ok(())
        })?;

        for layer in layers {
            let (Layer::Line { name, points } | Layer::Steps { name, points }) = layer else { continue };
            let stairs = matches!(layer, Layer::Steps { .. });
            let stroke = strokes.of(name);
            canvas.inside(frame, stroke.dash, |pen| {
                for path in self.paths(frame, points.iter().copied(), stairs) {
                    // A line of one point would not show.
                    match path[..] {
                        [only] => pen.marker(only, stroke.marker, stroke.colour, RADIUS / 2.0)?,
                        _ => pen.path(&path, stroke.colour, LINE)?,
                    }
                    labels.avoid(&shifted(&path));
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The markers that are inside the panel, in pixels of the figure, each with its series.
    pub fn markers(&self, frame: Frame) -> Vec<(&'a str, Point)> {
        let mut markers = Vec::new();
        for layer in &self.panel.layers {
            let (name, points): (&str, Vec<Point>) = match layer {
                Layer::Points { name, points } => (name, points.clone()),
                Layer::ErrorBars { name, points } => {
                    (name, points.iter().map(|&(x, _, middle, _)| (x, middle)).collect())
                }
                _ => continue,
            };
            let mut places: Vec<(i32, i32)> = Vec::new();
            for at in points.into_iter().filter_map(|(x, y)| self.at(frame, x, y)) {
                let (x, y) = (at.0 + frame.left, at.1 + frame.top);
                let wide = Frame { left: frame.left - 0.5, top: frame.top - 0.5, width: frame.width + 1.0, height: frame.height + 1.0 };
                // Half a pixel apart, markers cannot be told apart.
                let place = ((2.0 * x).round() as i32, (2.0 * y).round() as i32);
                if wide.contains((x, y)) && !places.contains(&place) {
                    places.push(place);
                    markers.push((name.as_ref(), (x, y)));
                }
            }
        }
        markers
    }

    /// Reference lines and notes that are inside the panel and have a text: the text, and its point
    /// in pixels of the figure, or as many coordinates of it as there are.
    pub fn notes(&self, frame: Frame) -> Vec<(&'a str, Option<f64>, Option<f64>)> {
        let inside = |at: Option<f64>| at.filter(|at| (-1e-9..=1.0 + 1e-9).contains(at));
        let across = |x: f64| inside(self.x.place(x)).map(|x| frame.left + x * frame.width);
        let down = |y: f64| inside(self.y.place(y)).map(|y| frame.top + (1.0 - y) * frame.height);
        let note = |layer: &'a Layer| match layer {
            Layer::HLine { y, label } => Some((label.as_str(), None, Some(down(*y)?))),
            Layer::VLine { x, label } => Some((label.as_str(), Some(across(*x)?), None)),
            Layer::Note { x, y, text } => Some((text.as_str(), Some(across(*x)?), Some(down(*y)?))),
            _ => None,
        };
        self.panel.layers.iter().filter_map(note).filter(|(text, ..)| !text.trim().is_empty()).collect()
    }

    /// The marker radius.
    pub fn radius(&self) -> f64 {
        RADIUS
    }

    /// Whether the x axis has names instead of numbers.
    pub fn has_categories(&self) -> bool {
        matches!(self.panel.x.scale, Scale::Category(_))
    }
}

/// An upright bar with caps.
fn whiskers(pen: &super::canvas::Pen, (low, high): (Point, Point), colour: plotters::style::RGBColor) -> Result<(), Fault> {
    pen.path(&[low, high], colour, 1.3)?;
    for (x, y) in [low, high] {
        pen.path(&[(x - 3.5, y), (x + 3.5, y)], colour, 1.3)?;
    }
    Ok(())
}
