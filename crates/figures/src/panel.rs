//! Draws one panel as a plotters chart: ticks, labels, and the marks of its layers.

use std::collections::BTreeSet;

use plotters::chart::ChartBuilder;
use plotters::element::{DashedPathElement, EmptyElement, PathElement, Polygon, Rectangle};
use plotters::prelude::{Cartesian2d, Color, DrawingArea, DrawingBackend, RGBColor};

use super::axis::{Ruled, axes};
use super::canvas::{Align, Fault, Frame, Sheet, font, pen, steps};
use super::model::{Layer, Marks, Panel, Scale};
use super::style::{FAINT, GREY, GRID, INK, REFERENCE_LINE, Stroke, Strokes, WHITE};
use super::text::{BODY, Fonts, HEADING, SMALL};

/// Width of data lines.
const LINE: f64 = 2.0;
/// Width of whiskers and reference lines.
const THIN: f64 = 1.3;
/// Length of ticks; their labels are twice as far from the axis.
const TICK: f64 = 4.0;
/// Distance from tick labels to the axis label.
const LABEL: f64 = 5.0;
/// Distance between markers on a line.
const APART: f64 = 110.0;

type Point = (f64, f64);
type Area<B> = DrawingArea<B, Cartesian2d<Ruled, Ruled>>;

/// A panel with the space it needs around its plot.
pub(super) struct Plot<'a> {
    panel: &'a Panel,
    x: Ruled,
    y: Ruled,
    has_data: bool,
    /// The names of categories below the plot, in lines, with their coordinates.
    names: Vec<(f64, Vec<String>)>,
    /// True if the names are written upwards.
    upright: bool,
    title: Vec<String>,
    x_label: Vec<String>,
    y_label: Vec<String>,
    /// Pixels above the plot; `left` and `below` are the pixels on its other sides.
    pub above: f64,
    pub left: f64,
    pub below: f64,
}

impl<'a> Plot<'a> {
    /// Finds the ranges of both axes and the ticks of a y axis of this height.
    pub fn new(panel: &'a Panel, height: f64, fonts: &Fonts) -> Self {
        let (x, mut y, has_data) = axes(panel);
        y.rule((height / 28.0) as usize);
        let y_label = fonts.wrap(&format!("{} {}", panel.y.label, y.factor), height, BODY);
        let widest = fonts.widest(y.major.iter().map(|tick| &tick.1), SMALL);
        let left = (2.0 * TICK + widest + LABEL + BODY.line() * y_label.len() as f64).ceil();
        let names = Vec::new();
        let title = Vec::new();
        let x_label = Vec::new();
        Self {
            panel,
            x,
            y,
            has_data,
            names,
            upright: false,
            title,
            x_label,
            y_label,
            above: 0.0,
            left,
            below: 0.0,
        }
    }

    /// Finds the ticks of an x axis of this width, and breaks the texts above and below into lines.
    pub fn fit_width(&mut self, width: f64, fonts: &Fonts) {
        let mut depth = SMALL.line();
        if let Scale::Category(names) = &self.panel.x.scale {
            let room = width / names.len().max(1) as f64;
            let fits = |name: &String| {
                name.split_whitespace()
                    .all(|word| fonts.width(word, SMALL) <= room - 6.0)
            };
            self.upright = !names.iter().all(fits);
            let every = if self.upright { (SMALL.line() / room).ceil() as usize } else { 1 };
            let lines = |name: String| {
                if self.upright { vec![name] } else { fonts.wrap(&name, room - 6.0, SMALL) }
            };
            let named = names.iter().zip(0..).step_by(every);
            self.names = named
                .map(|(name, at)| (f64::from(at), lines(name.clone())))
                .collect();
            let size = |(_, lines): &(f64, Vec<String>)| {
                if self.upright {
                    fonts.widest(lines, SMALL)
                } else {
                    SMALL.line() * lines.len() as f64
                }
            };
            depth = self.names.iter().map(size).fold(0.0, f64::max);
        } else {
            self.x.rule((width / 46.0) as usize);
        }
        self.title = fonts.wrap(&self.panel.title, width, HEADING);
        self.above = HEADING.line() * self.title.len() as f64 + 5.0;
        self.x_label =
            fonts.wrap(&format!("{} {}", self.panel.x.label, self.x.factor), width, BODY);
        self.below = (2.0 * TICK + depth + LABEL + BODY.line() * self.x_label.len() as f64).ceil();
    }

    /// Drops the label of the x axis if the panel below has the same label.
    pub fn share_x_label(&mut self, below: &Self) {
        if self.x_label == below.x_label {
            self.below -= BODY.line() * self.x_label.len() as f64;
            self.x_label.clear();
        }
    }

    /// Draws the panel with its plot in a place of the sheet.
    pub fn draw<B: DrawingBackend>(
        &self,
        sheet: &Sheet<B>,
        frame: Frame,
        strokes: &Strokes,
    ) -> Result<(), Fault<B>> {
        let Frame { left, top, width, height } = frame;
        let area = sheet.0.clone().shrink(
            (steps(left - self.left), steps(top)),
            (steps(self.left + width), steps(height + self.below)),
        );
        let mut chart = ChartBuilder::on(&area)
            .y_label_area_size(steps(self.left))
            .x_label_area_size(steps(self.below))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(pen(GRID, 1.0))
            .light_line_style(pen(FAINT, 1.0))
            .axis_style(pen(INK, 1.0))
            .label_style(font(SMALL, INK))
            .set_all_tick_mark_size(steps(TICK))
            .draw()?;
        Layers { plot: self, area: chart.plotting_area(), strokes, frame }.draw()?;

        sheet.lines((left, top - self.above), &self.title, HEADING, INK, Align::Left)?;
        let centre = left + width / 2.0;
        let middle = top + height / 2.0;
        let bottom = top + height;
        if !self.has_data {
            sheet.text((centre, middle), "no data", BODY, GREY, Align::Center)?;
        }
        for (at, lines) in &self.names {
            let x = left + self.x.fraction(*at) * width;
            match &lines[..] {
                [name] if self.upright => {
                    sheet.text((x, bottom + 2.0 * TICK), name, SMALL, INK, Align::UpTo)?
                }
                _ => sheet.lines((x, bottom + TICK), lines, SMALL, INK, Align::Center)?,
            }
        }
        let below = bottom + self.below - BODY.line() * self.x_label.len() as f64;
        sheet.lines((centre, below), &self.x_label, BODY, INK, Align::Center)?;
        self.y_label
            .iter()
            .zip(0..)
            .try_for_each(|(line, index)| {
                let beside = left - self.left + BODY.line() * (f64::from(index) + 0.5);
                sheet.text((beside, middle), line, BODY, INK, Align::UpCenter)
            })
    }
}

/// The layers of a panel being drawn.
struct Layers<'a, B: DrawingBackend> {
    plot: &'a Plot<'a>,
    area: &'a Area<B>,
    strokes: &'a Strokes,
    frame: Frame,
}

impl<B: DrawingBackend> Layers<'_, B> {
    fn draw(&self) -> Result<(), Fault<B>> {
        let layers = &self.plot.panel.layers;
        layers
            .iter()
            .try_for_each(|layer| self.band(layer))?;
        self.bars()?;
        layers
            .iter()
            .try_for_each(|layer| self.reference(layer))?;
        layers
            .iter()
            .try_for_each(|layer| self.line(layer))?;
        self.points()
    }

    fn band(&self, layer: &Layer) -> Result<(), Fault<B>> {
        let (Marks::Band(points) | Marks::StepBand(points)) = &layer.marks else { return Ok(()) };
        let stairs = matches!(layer.marks, Marks::StepBand(_));
        let x = &self.plot.x;
        let y = &self.plot.y;
        let at = |&(at, low, high): &(f64, f64, f64)| {
            Some((x.nearest(at)?, y.nearest(low)?, y.nearest(high)?))
        };
        for run in runs(points.iter().map(at)) {
            let side = |height: fn(&(f64, f64, f64)) -> f64| {
                self.thinned(&stepped(
                    run.iter()
                        .map(|point| (point.0, height(point)))
                        .collect(),
                    stairs,
                ))
            };
            let upper = side(|point| point.2).into_iter().rev();
            let outline: Vec<Point> = side(|point| point.1)
                .into_iter()
                .chain(upper)
                .collect();
            self.area
                .draw(&Polygon::new(outline, self.strokes.of(&layer.name).1.colour.mix(0.2)))?;
        }
        Ok(())
    }

    /// Draws the bars of all series next to each other, and then their whiskers.
    fn bars(&self) -> Result<(), Fault<B>> {
        let x = &self.plot.x;
        let y = &self.plot.y;
        let layers = || {
            self.plot
                .panel
                .layers
                .iter()
                .filter(|layer| matches!(layer.marks, Marks::Bars { .. }))
        };
        let width = 0.8 / layers().count().max(1) as f64;
        let mut whiskers = Vec::new();
        for (order, layer) in layers().enumerate() {
            let Marks::Bars { values, spread, base } = &layer.marks else { continue };
            let base = y
                .coordinate(*base)
                .map_or(y.low, |base| base.clamp(y.low, y.high));
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
                whiskers.extend(
                    spread
                        .get(index)
                        .map(|&(low, high)| (left + width / 2.0, low, high)),
                );
            }
        }
        whiskers
            .into_iter()
            .try_for_each(|(at, low, high)| self.whisker(at, low, high, INK))
    }

    /// Draws an upright bar with caps at the ends that are inside the panel.
    fn whisker(&self, x: f64, low: f64, high: f64, colour: RGBColor) -> Result<(), Fault<B>> {
        let y = &self.plot.y;
        let style = pen(colour, THIN);
        let Some((from, to)) = y.nearest(low).zip(y.nearest(high)) else { return Ok(()) };
        self.area
            .draw(&PathElement::new(vec![(x, from), (x, to)], style))?;
        for end in [low, high]
            .into_iter()
            .filter_map(|end| y.shown(end))
        {
            let cap = PathElement::new(vec![(steps(-3.5), 0), (steps(3.5), 0)], style);
            self.area
                .draw(&(EmptyElement::at((x, end)) + cap))?;
        }
        Ok(())
    }

    fn reference(&self, layer: &Layer) -> Result<(), Fault<B>> {
        let x = &self.plot.x;
        let y = &self.plot.y;
        let ends = match layer.marks {
            Marks::HLine(at) => y
                .shown(at)
                .map(|at| vec![(x.low, at), (x.high, at)]),
            Marks::VLine(at) => x
                .shown(at)
                .map(|at| vec![(at, y.low), (at, y.high)]),
            _ => None,
        };
        ends.map_or(Ok(()), |ends| self.stroke(ends, REFERENCE_LINE, THIN))
    }

    /// Draws a line or staircase, with markers along it if lines carry markers.
    fn line(&self, layer: &Layer) -> Result<(), Fault<B>> {
        let (order, stroke) = self.strokes.of(&layer.name);
        for path in self.paths(layer) {
            let markers = if self.strokes.marks(stroke) {
                self.along(&path, 37.0 * order as f64)
            } else {
                Vec::new()
            };
            self.stroke(path, stroke, LINE)?;
            markers
                .into_iter()
                .try_for_each(|at| self.marker(at, stroke, 3.5, 0.7))?;
        }
        Ok(())
    }

    fn stroke(&self, path: Vec<Point>, stroke: Stroke, width: f64) -> Result<(), Fault<B>> {
        let style = pen(stroke.colour, width);
        match stroke.dash {
            None => self.area.draw(&PathElement::new(path, style)),
            Some((on, off)) => {
                self.area
                    .draw(&DashedPathElement::new(path, steps(on), steps(off), style))
            }
        }
    }

    /// Draws a marker with a white edge, which separates it from its neighbours.
    fn marker(&self, at: Point, stroke: Stroke, radius: f64, edge: f64) -> Result<(), Fault<B>> {
        for (radius, colour) in [(radius + edge, WHITE), (radius, stroke.colour)] {
            self.area
                .draw(&(EmptyElement::at(at) + Polygon::new(stroke.outline(radius), colour)))?;
        }
        Ok(())
    }

    /// Draws points, smaller if there are many, and one marker for points that look the same. A line
    /// of a single point would be invisible, so it gets a marker too.
    fn points(&self) -> Result<(), Fault<B>> {
        let x = &self.plot.x;
        let y = &self.plot.y;
        let mut all: Vec<(&str, Point)> = Vec::new();
        for layer in &self.plot.panel.layers {
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
                    let alone = self
                        .paths(layer)
                        .into_iter()
                        .filter(|path| path.len() == 1);
                    all.extend(alone.flatten().map(|at| (name, at)));
                }
            }
        }
        let (radius, edge, grain) = match all.len() {
            0..300 => (4.0, 1.0, 0.25),
            300..3000 => (2.5, 0.3, 0.5),
            _ => (1.5, 0.0, 1.0),
        };
        let cell = |axis: &Ruled, at: f64, length: f64| {
            (axis.fraction(at) * length / grain).round() as i32
        };
        let mut seen: BTreeSet<(&str, i32, i32)> = BTreeSet::new();
        all.retain(|&(name, at)| {
            seen.insert((name, cell(x, at.0, self.frame.width), cell(y, at.1, self.frame.height)))
        });
        all.into_iter()
            .try_for_each(|(name, at)| self.marker(at, self.strokes.of(name).1, radius, edge))
    }

    /// Returns the unbroken parts of a line or staircase. Points outside the panel move to its edge.
    fn paths(&self, layer: &Layer) -> Vec<Vec<Point>> {
        let (Marks::Line(points) | Marks::Steps(points)) = &layer.marks else { return Vec::new() };
        let stairs = matches!(layer.marks, Marks::Steps(_));
        let shown = |axis: &Ruled, value| {
            axis.nearest(value)
                .filter(|_| stairs || axis.coordinate(value).is_some())
        };
        let at =
            |point: &Point| Some((shown(&self.plot.x, point.0)?, shown(&self.plot.y, point.1)?));
        runs(points.iter().map(at))
            .into_iter()
            .map(|path| self.thinned(&stepped(path, stairs)))
            .collect()
    }

    /// Thins a path without a visible change: of successive points within half a pixel of x, keeps
    /// the first, lowest, highest and last; of a level line, keeps the ends.
    fn thinned(&self, path: &[Point]) -> Vec<Point> {
        let column =
            |point: &Point| (self.plot.x.fraction(point.0) * self.frame.width * 2.0).floor();
        let mut kept: Vec<Point> = Vec::new();
        for points in path.chunk_by(|one, next| column(one) == column(next)) {
            let by_height = |one: &&Point, other: &&Point| one.1.total_cmp(&other.1);
            let low = points.iter().min_by(by_height);
            let high = points.iter().max_by(by_height);
            for &point in [points.first(), low, high, points.last()]
                .into_iter()
                .flatten()
            {
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

    /// Returns places for markers along a path: every [`APART`] pixels from an offset on, or the middle
    /// of a short path.
    fn along(&self, path: &[Point], offset: f64) -> Vec<Point> {
        let pixel = |at: &Point| {
            (
                self.plot.x.fraction(at.0) * self.frame.width,
                self.plot.y.fraction(at.1) * self.frame.height,
            )
        };
        let lengths: Vec<f64> = path
            .windows(2)
            .map(|ends| {
                let one = pixel(&ends[0]);
                let next = pixel(&ends[1]);
                ((next.0 - one.0) * (next.0 - one.0) + (next.1 - one.1) * (next.1 - one.1)).sqrt()
            })
            .collect();
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
    let parts = placed
        .split(Option::is_none)
        .map(|part| part.iter().copied().flatten().collect());
    parts
        .filter(|part: &Vec<T>| !part.is_empty())
        .collect()
}

/// Returns the path, or the staircase that holds each y until the next x.
fn stepped(path: Vec<Point>, stairs: bool) -> Vec<Point> {
    if !stairs {
        return path;
    }
    let corners = path
        .windows(2)
        .flat_map(|ends| [ends[0], (ends[1].0, ends[0].1)]);
    corners.chain(path.last().copied()).collect()
}
