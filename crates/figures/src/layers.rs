//! Draws the marks of a panel's layers.

use std::collections::BTreeSet;

use plotters::element::{DashedPathElement, EmptyElement, PathElement, Polygon};
use plotters::prelude::{Cartesian2d, Color, DrawingArea, SVGBackend};

use super::axis::Ruled;
use super::canvas::{Fault, Frame, pen, steps};
use super::model::{Layer, Marks};
use super::style::{BAND, REFERENCE_LINE, Stroke, Strokes, WHITE};

/// Width of data lines.
const LINE: f64 = 2.5;
/// Width of spans and reference lines.
const THIN: f64 = 1.5;

type Point = (f64, f64);
type Area<'a> = DrawingArea<SVGBackend<'a>, Cartesian2d<Ruled, Ruled>>;

/// The layers of a panel being drawn.
pub(super) struct Layers<'a, 's> {
    pub layers: &'a [Layer],
    /// The horizontal axis.
    pub x: &'a Ruled,
    /// The vertical axis.
    pub y: &'a Ruled,
    pub area: &'a Area<'s>,
    pub strokes: &'a Strokes,
    /// The place of the plot on the sheet.
    pub frame: Frame,
}

impl Layers<'_, '_> {
    /// Draws all layers, each kind of marks on top of the kinds before.
    pub fn draw(&self) -> Result<(), Fault> {
        let layers = self.layers;
        layers.iter().try_for_each(|layer| self.band(layer))?;
        layers.iter().try_for_each(|layer| self.reference(layer))?;
        layers.iter().try_for_each(|layer| self.spans(layer))?;
        layers.iter().try_for_each(|layer| self.line(layer))?;
        self.points()
    }

    fn band(&self, layer: &Layer) -> Result<(), Fault> {
        let Marks::Band(points) = &layer.marks else { return Ok(()) };
        let x = self.x;
        let y = self.y;
        let at = |&(at, low, high): &(f64, f64, f64)| {
            Some((x.nearest(at)?, y.nearest(low)?, y.nearest(high)?))
        };
        for run in runs(points.iter().map(at)) {
            let side = |height: fn(&(f64, f64, f64)) -> f64| {
                let side: Vec<Point> = run.iter().map(|point| (point.0, height(point))).collect();
                self.thinned(&side)
            };
            let upper = side(|point| point.2).into_iter().rev();
            let outline: Vec<Point> = side(|point| point.1).into_iter().chain(upper).collect();
            self.area
                .draw(&Polygon::new(outline, self.strokes.of(&layer.name).colour.mix(BAND)))?;
        }
        Ok(())
    }

    /// Draws the part of every span that is inside the panel.
    fn spans(&self, layer: &Layer) -> Result<(), Fault> {
        let Marks::Spans(spans) = &layer.marks else { return Ok(()) };
        let style = pen(self.strokes.of(&layer.name).colour, THIN);
        let end = |&(x, y): &Point| Some((self.x.nearest(x)?, self.y.nearest(y)?));
        spans
            .iter()
            .filter_map(|[from, to]| Some(vec![end(from)?, end(to)?]))
            .try_for_each(|ends| self.area.draw(&PathElement::new(ends, style)))
    }

    fn reference(&self, layer: &Layer) -> Result<(), Fault> {
        let x = self.x;
        let y = self.y;
        let ends = match layer.marks {
            Marks::HLine(at) => y.shown(at).map(|at| vec![(x.low, at), (x.high, at)]),
            Marks::VLine(at) => x.shown(at).map(|at| vec![(at, y.low), (at, y.high)]),
            _ => None,
        };
        ends.map_or(Ok(()), |ends| self.stroke(ends, REFERENCE_LINE, THIN))
    }

    fn line(&self, layer: &Layer) -> Result<(), Fault> {
        let stroke = self.strokes.of(&layer.name);
        self.paths(layer).into_iter().try_for_each(|path| self.stroke(path, stroke, LINE))
    }

    fn stroke(&self, path: Vec<Point>, stroke: Stroke, width: f64) -> Result<(), Fault> {
        let style = pen(stroke.colour, width);
        match stroke.dash {
            None => self.area.draw(&PathElement::new(path, style)),
            Some((on, off)) => {
                self.area.draw(&DashedPathElement::new(path, steps(on), steps(off), style))
            }
        }
    }

    /// Draws a marker with a white edge, which separates it from its neighbours.
    fn marker(&self, at: Point, stroke: Stroke, radius: f64, edge: f64) -> Result<(), Fault> {
        let centre = if stroke.hollow { WHITE } else { stroke.colour };
        let rings = [(radius + edge, WHITE), (radius, stroke.colour), (0.6 * radius, centre)];
        for (radius, colour) in &rings[..if stroke.hollow { 3 } else { 2 }] {
            self.area
                .draw(&(EmptyElement::at(at) + Polygon::new(stroke.outline(*radius), colour)))?;
        }
        Ok(())
    }

    /// Draws points, smaller if there are many, and one marker for points that look the same.
    fn points(&self) -> Result<(), Fault> {
        let x = self.x;
        let y = self.y;
        let mut all: Vec<(&str, Point)> = Vec::new();
        for layer in self.layers {
            let Marks::Points(points) = &layer.marks else { continue };
            let shown = |point: &Point| Some((x.shown(point.0)?, y.shown(point.1)?));
            let name = layer.name.as_str();
            all.extend(points.iter().filter_map(|point| Some((name, shown(point)?))));
        }
        // Many large points would hide each other.
        let (radius, edge, grain) = match all.len() {
            0..300 => (5.0, 1.0, 0.25),
            300..3000 => (2.5, 0.3, 0.5),
            _ => (1.5, 0.0, 1.0),
        };
        let cell = |axis: &Ruled, at: f64, length: f64| {
            (axis.fraction(at) * length / grain).round() as i32
        };
        // A hundred thousand points would make an SVG of megabytes that looks the same.
        let mut seen: BTreeSet<(&str, i32, i32)> = BTreeSet::new();
        all.retain(|&(name, at)| {
            seen.insert((name, cell(x, at.0, self.frame.width), cell(y, at.1, self.frame.height)))
        });
        all.into_iter()
            .try_for_each(|(name, at)| self.marker(at, self.strokes.of(name), radius, edge))
    }

    /// Returns the unbroken parts of a line or staircase. Points outside the panel move to its
    /// edge.
    fn paths(&self, layer: &Layer) -> Vec<Vec<Point>> {
        let (Marks::Line(points) | Marks::Steps(points)) = &layer.marks else { return Vec::new() };
        let stairs = matches!(layer.marks, Marks::Steps(_));
        let shown = |axis: &Ruled, value| {
            axis.nearest(value).filter(|_| stairs || axis.coordinate(value).is_some())
        };
        let at = |point: &Point| Some((shown(self.x, point.0)?, shown(self.y, point.1)?));
        runs(points.iter().map(at))
            .into_iter()
            .map(|path| self.thinned(&stepped(path, stairs)))
            .collect()
    }

    /// Thins a path without a visible change: of successive points within half a pixel of x, keeps
    /// the first, lowest, highest and last; of a level line, keeps the ends.
    fn thinned(&self, path: &[Point]) -> Vec<Point> {
        let column = |point: &Point| (self.x.fraction(point.0) * self.frame.width * 2.0).floor();
        let mut kept: Vec<Point> = Vec::new();
        for points in path.chunk_by(|one, next| column(one) == column(next)) {
            let by_height = |one: &&Point, other: &&Point| one.1.total_cmp(&other.1);
            let low = points.iter().min_by(by_height);
            let high = points.iter().max_by(by_height);
            for &point in [points.first(), low, high, points.last()].into_iter().flatten() {
                if let [.., before, middle] = kept[..]
                    && [before.1, middle.1] == [point.1; 2]
                    && (before.0 <= middle.0) == (middle.0 <= point.0)
                {
                    kept.pop();
                }
                if kept.last() != Some(&point) {
                    kept.push(point);
                }
            }
        }
        kept
    }
}

/// Returns the unbroken parts of a sequence.
fn runs<T: Copy>(placed: impl Iterator<Item = Option<T>>) -> Vec<Vec<T>> {
    let placed: Vec<Option<T>> = placed.collect();
    let parts = placed.split(Option::is_none).map(|part| part.iter().copied().flatten().collect());
    parts.filter(|part: &Vec<T>| !part.is_empty()).collect()
}

/// Returns the path, or the staircase that holds each y until the next x.
fn stepped(path: Vec<Point>, stairs: bool) -> Vec<Point> {
    if !stairs {
        return path;
    }
    let corners = path.windows(2).flat_map(|ends| [ends[0], (ends[1].0, ends[0].1)]);
    corners.chain(path.last().copied()).collect()
}
