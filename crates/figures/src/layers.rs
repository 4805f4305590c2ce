//! Draws the marks of a panel's layers.

use std::collections::BTreeSet;

use plotters::element::{DashedPathElement, EmptyElement, PathElement, Polygon, Rectangle};
use plotters::prelude::{Cartesian2d, Color, DrawingArea, RGBColor, SVGBackend};

use super::axis::Ruled;
use super::canvas::{Fault, Frame, pen, steps};
use super::model::{Layer, Marks};
use super::style::{INK, REFERENCE_LINE, Stroke, Strokes, WHITE};

/// Width of data lines.
const LINE: f64 = 2.0;
/// Width of whiskers and reference lines.
const THIN: f64 = 1.3;
/// Distance between markers on a line.
const APART: f64 = 110.0;

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
        self.bars()?;
        layers.iter().try_for_each(|layer| self.reference(layer))?;
        layers.iter().try_for_each(|layer| self.line(layer))?;
        self.points()
    }

    fn band(&self, layer: &Layer) -> Result<(), Fault> {
        let (Marks::Band(points) | Marks::StepBand(points)) = &layer.marks else { return Ok(()) };
        let stairs = matches!(layer.marks, Marks::StepBand(_));
        let x = self.x;
        let y = self.y;
        let at = |&(at, low, high): &(f64, f64, f64)| {
            Some((x.nearest(at)?, y.nearest(low)?, y.nearest(high)?))
        };
        for run in runs(points.iter().map(at)) {
            let side = |height: fn(&(f64, f64, f64)) -> f64| {
                self.thinned(&stepped(
                    run.iter().map(|point| (point.0, height(point))).collect(),
                    stairs,
                ))
            };
            let upper = side(|point| point.2).into_iter().rev();
            let outline: Vec<Point> = side(|point| point.1).into_iter().chain(upper).collect();
            self.area
                .draw(&Polygon::new(outline, self.strokes.of(&layer.name).1.colour.mix(0.2)))?;
        }
        Ok(())
    }

    /// Draws the bars of all series next to each other, and then their whiskers.
    fn bars(&self) -> Result<(), Fault> {
        let x = self.x;
        let y = self.y;
        let layers =
            || self.layers.iter().filter(|layer| matches!(layer.marks, Marks::Bars { .. }));
        let width = 0.8 / layers().count().max(1) as f64;
        let mut whiskers = Vec::new();
        for (order, layer) in layers().enumerate() {
            let Marks::Bars { values, spread, base } = &layer.marks else { continue };
            let base = y.coordinate(*base).map_or(y.low, |base| base.clamp(y.low, y.high));
            for (index, &value) in values.iter().enumerate() {
                let left = index as f64 - 0.4 + width * order as f64;
                let Some((_, tip)) = x.shown(index as f64).zip(y.coordinate(value)) else {
                    continue;
                };
                // A thin white gap separates neighbours of similar colours.
                let corners =
                    [(left + 0.03 * width, base), (left + 0.97 * width, tip.clamp(y.low, y.high))];
                self.area.draw(&Rectangle::new(
                    corners,
                    self.strokes.of(&layer.name).1.colour.filled(),
                ))?;
                // Whiskers are drawn after all bars, so that no bar covers one.
                whiskers
                    .extend(spread.get(index).map(|&(low, high)| (left + width / 2.0, low, high)));
            }
        }
        whiskers.into_iter().try_for_each(|(at, low, high)| self.whisker(at, low, high, INK))
    }

    /// Draws an upright bar with caps at the ends that are inside the panel.
    fn whisker(&self, x: f64, low: f64, high: f64, colour: RGBColor) -> Result<(), Fault> {
        let y = self.y;
        let style = pen(colour, THIN);
        let Some((from, to)) = y.nearest(low).zip(y.nearest(high)) else { return Ok(()) };
        self.area.draw(&PathElement::new(vec![(x, from), (x, to)], style))?;
        for end in [low, high].into_iter().filter_map(|end| y.shown(end)) {
            let cap = PathElement::new(vec![(steps(-3.5), 0), (steps(3.5), 0)], style);
            self.area.draw(&(EmptyElement::at((x, end)) + cap))?;
        }
        Ok(())
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

    /// Draws a line or staircase, with markers along it if lines carry markers.
    fn line(&self, layer: &Layer) -> Result<(), Fault> {
        let (order, stroke) = self.strokes.of(&layer.name);
        for path in self.paths(layer) {
            let markers = if self.strokes.marked_lines {
                self.along(&path, 37.0 * order as f64)
            } else {
                Vec::new()
            };
            self.stroke(path, stroke, LINE)?;
            markers.into_iter().try_for_each(|at| self.marker(at, stroke, 3.5, 0.7))?;
        }
        Ok(())
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
        for (radius, colour) in [(radius + edge, WHITE), (radius, stroke.colour)] {
            self.area
                .draw(&(EmptyElement::at(at) + Polygon::new(stroke.outline(radius), colour)))?;
        }
        Ok(())
    }

    /// Draws points, smaller if there are many, and one marker for points that look the same. A
    /// line of a single point would be invisible, so it gets a marker too.
    fn points(&self) -> Result<(), Fault> {
        let x = self.x;
        let y = self.y;
        let mut all: Vec<(&str, Point)> = Vec::new();
        for layer in self.layers {
            let name = layer.name.as_str();
            match &layer.marks {
                Marks::Points(points) => {
                    all.extend(
                        points.iter().filter_map(|point| {
                            Some((name, (x.shown(point.0)?, y.shown(point.1)?)))
                        }),
                    );
                }
                _ => {
                    let alone = self.paths(layer).into_iter().filter(|path| path.len() == 1);
                    all.extend(alone.flatten().map(|at| (name, at)));
                }
            }
        }
        // Many large points would hide each other.
        let (radius, edge, grain) = match all.len() {
            0..300 => (4.0, 1.0, 0.25),
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
            .try_for_each(|(name, at)| self.marker(at, self.strokes.of(name).1, radius, edge))
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

    /// Returns places for markers along a path: every [`APART`] pixels from an offset on, or the
    /// middle of a short path.
    fn along(&self, path: &[Point], offset: f64) -> Vec<Point> {
        let pixel = |at: &Point| {
            (self.x.fraction(at.0) * self.frame.width, self.y.fraction(at.1) * self.frame.height)
        };
        let lengths: Vec<f64> = path
            .windows(2)
            .map(|ends| {
                let one = pixel(&ends[0]);
                let next = pixel(&ends[1]);
                ((next.0 - one.0) * (next.0 - one.0) + (next.1 - one.1) * (next.1 - one.1)).sqrt()
            })
            .collect();
        // Offsets by series keep the markers of coinciding lines apart.
        let mut missing = (10.0 + offset % APART).min(lengths.iter().sum::<f64>() / 2.0);
        let mut places = Vec::new();
        for (ends, &length) in path.windows(2).zip(&lengths) {
            while missing < length {
                let part = missing / length;
                let (one, next) = (ends[0], ends[1]);
                places.push((one.0 + part * (next.0 - one.0), one.1 + part * (next.1 - one.1)));
                missing += APART;
            }
            missing -= length;
        }
        places
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
