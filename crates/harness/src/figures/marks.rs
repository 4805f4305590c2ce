//! Turns the layers of a panel into lines, areas and markers in pixels, and draws them.

use std::collections::BTreeSet;

use plotters::style::RGBColor;

use super::canvas::{Canvas, Fault, Frame, Pen};
use super::label::Labels;
use super::model::Layer;
use super::plot::Plot;
use super::scale::Span;
use super::style::{INK, REFERENCE_LINE, Strokes};

/// Widths of data lines, and of whiskers and reference lines.
const LINE: f64 = 2.0;
const THIN: f64 = 1.3;
/// Opacity of bands.
const BAND: f64 = 0.2;

type Point = (f64, f64);

/// A panel's layers in a place. Points are pixels from its upper left corner, unless said otherwise.
pub(super) struct Marks<'a> {
    plot: &'a Plot<'a>,
    frame: Frame,
    strokes: &'a Strokes,
}

/// One bar of a bar chart.
struct Bar {
    colour: RGBColor,
    frame: Frame,
    whisker: Option<[Point; 2]>,
}

/// Markers of a panel, in pixels of the figure.
pub(super) struct Markers<'a> {
    /// The series and place of each.
    pub places: Vec<(&'a str, Point)>,
    pub radius: f64,
    /// Width of the white edge that tells neighbours apart.
    pub edge: f64,
}

/// The unbroken parts of a sequence.
fn runs<T: Copy>(placed: &[Option<T>]) -> Vec<Vec<T>> {
    let parts = placed.split(|point| point.is_none());
    parts.filter(|part| !part.is_empty()).map(|part| part.iter().copied().flatten().collect()).collect()
}

/// The path itself, or with each y held until the next x.
fn stepped(path: Vec<Point>, stairs: bool) -> Vec<Point> {
    if !stairs {
        return path;
    }
    let corners = path.iter().zip(path.iter().skip(1)).flat_map(|(&(x, y), &(next, _))| [(x, y), (next, y)]);
    corners.chain(path.last().copied()).collect()
}

impl<'a> Marks<'a> {
    pub fn new(plot: &'a Plot<'a>, frame: Frame, strokes: &'a Strokes) -> Self {
        Self { plot, frame, strokes }
    }

    fn layers(&self) -> &'a [Layer] {
        &self.plot.panel.layers
    }

    fn across(&self, fraction: f64) -> f64 {
        fraction * self.frame.width
    }

    fn down(&self, fraction: f64) -> f64 {
        (1.0 - fraction) * self.frame.height
    }

    fn at(&self, x: f64, y: f64) -> Option<Point> {
        Some((self.across(self.plot.x.place(x)?), self.down(self.plot.y.place(y)?)))
    }

    /// A height that is below the floor where a logarithmic axis has no place for it.
    fn low(&self, y: f64) -> Option<f64> {
        self.plot.y.place_or_below(y).map(|y| self.down(y))
    }

    /// The unbroken parts of a line or staircase.
    fn paths(&self, points: &[Point], stairs: bool) -> Vec<Vec<Point>> {
        let place = if stairs { Span::place_or_below } else { Span::place };
        let at =
            |&(x, y): &Point| Some((self.across(place(self.plot.x, x)?), self.down(place(self.plot.y, y)?)));
        let placed: Vec<Option<Point>> = points.iter().map(at).collect();
        runs(&placed).into_iter().map(|path| stepped(path, stairs)).collect()
    }

    /// The outlines of a band's unbroken parts.
    fn outlines(&self, points: &[(f64, f64, f64)], stairs: bool) -> Vec<Vec<Point>> {
        let place = if stairs { Span::place_or_below } else { Span::place };
        let at = |&(x, low, high): &(f64, f64, f64)| {
            Some((self.across(place(self.plot.x, x)?), self.low(low)?, self.low(high)?))
        };
        let placed: Vec<Option<(f64, f64, f64)>> = points.iter().map(at).collect();
        let outline = |run: Vec<(f64, f64, f64)>| {
            let mut outline = stepped(run.iter().map(|&(x, low, _)| (x, low)).collect(), stairs);
            outline
                .extend(stepped(run.iter().map(|&(x, _, high)| (x, high)).collect(), stairs).into_iter().rev());
            outline
        };
        runs(&placed).into_iter().map(outline).collect()
    }

    fn bars(&self) -> Vec<Bar> {
        let is_bars = |layer: &&Layer| matches!(layer, Layer::Bars { .. });
        let series = self.layers().iter().filter(is_bars).count().max(1) as f64;
        let width = 0.8 / series;
        let mut bars = Vec::new();
        for (order, layer) in self.layers().iter().filter(is_bars).enumerate() {
            let Layer::Bars { name, values, spread, base } = layer else { continue };
            let base = self.down(self.plot.y.place(*base).unwrap_or(0.0));
            for (i, &value) in values.iter().enumerate() {
                let left = i as f64 - 0.4 + width * order as f64;
                let (Some((from, tip)), Some(to)) = (self.at(left, value), self.plot.x.place(left + width))
                else {
                    continue;
                };
                let to = self.across(to);
                let middle = (from + to) / 2.0;
                let whisker =
                    |&(low, high): &Point| Some([(middle, self.low(low)?), (middle, self.low(high)?)]);
                // A hair of white between neighbours.
                let gap = 0.5_f64.min((to - from) / 8.0);
                let (top, height) = (tip.min(base), (tip - base).abs());
                bars.push(Bar {
                    colour: self.strokes.of(name).colour,
                    frame: Frame { left: from + gap, top, width: to - from - 2.0 * gap, height },
                    whisker: spread.get(i).and_then(whisker),
                });
            }
        }
        bars
    }

    /// Draws all that the panel's edges cut off, and tells `labels` to keep off it.
    pub fn draw_inside(&self, canvas: &mut Canvas, labels: &mut Labels) -> Result<(), Fault> {
        canvas.inside(self.frame, &[], |pen| {
            self.draw_bands(pen, labels)?;
            self.draw_bars(pen, labels)?;
            self.draw_error_bars(pen, labels)
        })?;
        canvas.inside(self.frame, REFERENCE_LINE.dash, |pen| self.draw_references(pen, labels))?;
        for layer in self.layers() {
            let (Layer::Line { name, points } | Layer::Steps { name, points }) = layer else { continue };
            let paths = self.paths(points, matches!(layer, Layer::Steps { .. }));
            let stroke = self.strokes.of(name);
            canvas.inside(self.frame, stroke.dash, |pen| {
                for path in paths {
                    pen.path(&path, stroke.colour, LINE)?;
                    labels.avoid(&self.shifted(&path));
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The path in pixels of the figure.
    fn shifted(&self, path: &[Point]) -> Vec<Point> {
        path.iter().map(|&(x, y)| (x + self.frame.left, y + self.frame.top)).collect()
    }

    fn draw_bands(&self, pen: &Pen, labels: &mut Labels) -> Result<(), Fault> {
        for layer in self.layers() {
            let (Layer::Band { name, points } | Layer::StepBand { name, points }) = layer else { continue };
            for outline in self.outlines(points, matches!(layer, Layer::StepBand { .. })) {
                pen.polygon(&outline, self.strokes.of(name).colour, BAND)?;
                labels.avoid(&self.shifted(&outline));
            }
        }
        Ok(())
    }

    fn draw_bars(&self, pen: &Pen, labels: &mut Labels) -> Result<(), Fault> {
        let bars = self.bars();
        for Bar { frame, colour, .. } in &bars {
            pen.rectangle(*frame, *colour, 1.0)?;
            labels.avoid_area(Frame {
                left: frame.left + self.frame.left,
                top: frame.top + self.frame.top,
                ..*frame
            });
        }
        for whisker in bars.iter().filter_map(|bar| bar.whisker) {
            draw_whisker(pen, whisker, INK)?;
            labels.avoid(&self.shifted(&whisker));
        }
        Ok(())
    }

    fn draw_error_bars(&self, pen: &Pen, labels: &mut Labels) -> Result<(), Fault> {
        for layer in self.layers() {
            let Layer::ErrorBars { name, points } = layer else { continue };
            for &(x, low, middle, high) in points {
                if let (Some((x, _)), Some(low), Some(high)) =
                    (self.at(x, middle), self.low(low), self.low(high))
                {
                    let whisker = [(x, low), (x, high)];
                    draw_whisker(pen, whisker, self.strokes.of(name).colour)?;
                    labels.avoid(&self.shifted(&whisker));
                }
            }
        }
        Ok(())
    }

    fn draw_references(&self, pen: &Pen, labels: &mut Labels) -> Result<(), Fault> {
        for layer in self.layers() {
            let line = match *layer {
                Layer::HLine { y, .. } => {
                    self.plot.y.place(y).map(|y| [(0.0, self.down(y)), (self.frame.width, self.down(y))])
                }
                Layer::VLine { x, .. } => {
                    self.plot.x.place(x).map(|x| [(self.across(x), 0.0), (self.across(x), self.frame.height)])
                }
                _ => None,
            };
            if let Some(line) = line {
                pen.path(&line, REFERENCE_LINE.colour, THIN)?;
                labels.avoid(&self.shifted(&line));
            }
        }
        Ok(())
    }

    /// The markers inside the panel: smaller ones without edges where there are many, and only one
    /// of those that nobody could tell apart. Also lines of a single point, which would not show.
    pub fn markers(&self) -> Markers<'a> {
        let mut all: Vec<(&str, Point)> = Vec::new();
        for layer in self.layers() {
            match layer {
                Layer::Points { name, points } => {
                    all.extend(points.iter().filter_map(|&(x, y)| Some((name.as_str(), self.at(x, y)?))));
                }
                Layer::ErrorBars { name, points } => {
                    all.extend(points.iter().filter_map(|&(x, _, y, _)| Some((name.as_str(), self.at(x, y)?))));
                }
                Layer::Line { name, points } | Layer::Steps { name, points } => {
                    let paths = self.paths(points, matches!(layer, Layer::Steps { .. }));
                    all.extend(paths.iter().filter_map(|path| match path[..] {
                        [only] => Some((name.as_str(), only)),
                        _ => None,
                    }));
                }
                _ => {}
            }
        }
        let (radius, edge, grain) = match all.len() {
            0..300 => (4.0, 1.0, 0.25),
            300..3000 => (2.5, 0.0, 0.5),
            _ => (1.5, 0.0, 1.0),
        };
        let mut seen: BTreeSet<(&str, i32, i32)> = BTreeSet::new();
        let wide =
            Frame { left: -0.5, top: -0.5, width: self.frame.width + 1.0, height: self.frame.height + 1.0 };
        all.retain(|&(name, (x, y))| {
            wide.contains((x, y)) && seen.insert((name, (x / grain).round() as i32, (y / grain).round() as i32))
        });
        let figure = |(x, y): Point| (x + self.frame.left, y + self.frame.top);
        Markers { places: all.into_iter().map(|(name, at)| (name, figure(at))).collect(), radius, edge }
    }

    /// Texts of the reference lines and notes that are inside the panel, with as many coordinates, in
    /// pixels of the figure, as they have.
    pub fn notes(&self) -> Vec<(&'a str, Option<f64>, Option<f64>)> {
        let inside = |at: Option<f64>| at.filter(|at| (-1e-9..=1.0 + 1e-9).contains(at));
        let across = |x: f64| inside(self.plot.x.place(x)).map(|x| self.frame.left + self.across(x));
        let down = |y: f64| inside(self.plot.y.place(y)).map(|y| self.frame.top + self.down(y));
        let note = |layer: &'a Layer| match layer {
            Layer::HLine { y, label } if !self.plot.panel.has_bars() => {
                Some((label.as_str(), None, Some(down(*y)?)))
            }
            Layer::VLine { x, label } => Some((label.as_str(), Some(across(*x)?), None)),
            Layer::Note { x, y, text } => Some((text.as_str(), Some(across(*x)?), Some(down(*y)?))),
            _ => None,
        };
        self.layers().iter().filter_map(note).filter(|(text, ..)| !text.trim().is_empty()).collect()
    }
}

/// Draws an upright bar with caps.
fn draw_whisker(pen: &Pen, ends: [Point; 2], colour: RGBColor) -> Result<(), Fault> {
    pen.path(&ends, colour, THIN)?;
    for (x, y) in ends {
        pen.path(&[(x - 3.5, y), (x + 3.5, y)], colour, THIN)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::model::{Axis, Figure, Panel};
    use super::*;

    const FRAME: Frame = Frame { left: 0.0, top: 0.0, width: 100.0, height: 100.0 };

    /// The panel's only line or staircase on axes from 0 to 10, or logarithmic from 1 to 100.
    fn drawn(layer: Layer, log: bool) -> Vec<Vec<Point>> {
        let axis = || if log { Axis::log("").range(1.0, 100.0) } else { Axis::linear("").range(0.0, 10.0) };
        let panel = Panel { title: String::new(), x: axis(), y: axis(), layers: vec![layer.clone()] };
        let (plot, strokes) = (Plot::new(&panel), Strokes::new(&Figure::default()));
        let marks = Marks::new(&plot, FRAME, &strokes);
        let mut parts = match layer {
            Layer::Line { points, .. } => marks.paths(&points, false),
            Layer::Steps { points, .. } => marks.paths(&points, true),
            Layer::Band { points, .. } => marks.outlines(&points, false),
            _ => Vec::new(),
        };
        for (x, y) in parts.iter_mut().flatten() {
            (*x, *y) = ((*x * 1e6).round() / 1e6, (*y * 1e6).round() / 1e6);
        }
        parts
    }

    #[test]
    fn a_point_that_cannot_be_shown_interrupts_the_line() {
        let points =
            vec![(0.0, 0.0), (5.0, 5.0), (6.0, f64::NAN), (7.0, 1.0), (f64::INFINITY, 1.0), (10.0, 10.0)];
        let parts = drawn(Layer::Line { name: String::new(), points }, false);
        assert_eq!(parts, [vec![(0.0, 100.0), (50.0, 50.0)], vec![(70.0, 90.0)], vec![(100.0, 0.0)]]);
    }

    #[test]
    fn steps_hold_their_value_until_the_next_x() {
        let parts = drawn(
            Layer::Steps { name: String::new(), points: vec![(0.0, 8.0), (5.0, 2.0), (10.0, 1.0)] },
            false,
        );
        assert_eq!(parts, [vec![(0.0, 20.0), (50.0, 20.0), (50.0, 80.0), (100.0, 80.0), (100.0, 90.0)]]);
    }

    #[test]
    fn steps_fall_through_the_floor_of_a_log_axis_at_zero() {
        let parts = drawn(Layer::Steps { name: String::new(), points: vec![(0.0, 10.0), (10.0, 0.0)] }, true);
        let [path] = &parts[..] else { panic!("{} parts", parts.len()) };
        assert!(path[0].0 < 0.0, "{path:?} does not enter from the left");
        assert_eq!((path[0].1, path[1]), (50.0, (50.0, 50.0)));
        assert!(path[2].1 > FRAME.height, "{path:?} does not leave through the floor");
    }

    #[test]
    fn a_band_with_a_lower_end_of_zero_reaches_the_floor_of_a_log_axis() {
        let points = vec![(1.0, 0.0, 10.0), (100.0, 1.0, 10.0)];
        let outlines = drawn(Layer::Band { name: String::new(), points }, true);
        let [outline] = &outlines[..] else { panic!("{} parts", outlines.len()) };
        assert!(outline[0].1 > FRAME.height);
        assert_eq!(outline[1..], [(100.0, 100.0), (100.0, 50.0), (0.0, 50.0)]);
    }

    #[test]
    fn grouped_bars_stand_beside_each_other_from_the_base() {
        let bars = |name: &str, values: Vec<f64>| Layer::Bars {
            name: name.to_owned(),
            values,
            spread: Vec::new(),
            base: 1.0,
        };
        let panel = Panel {
            title: String::new(),
            x: Axis::categories("", vec!["a".to_owned(), "b".to_owned()]),
            y: Axis::linear("").range(0.0, 2.0),
            layers: vec![bars("one", vec![2.0, f64::NAN]), bars("two", vec![0.5, 1.5])],
        };
        let (plot, strokes) = (Plot::new(&panel), Strokes::new(&Figure::default()));
        let frames: Vec<Frame> =
            Marks::new(&plot, FRAME, &strokes).bars().iter().map(|bar| bar.frame).collect();
        let [one, two, three] = frames[..] else { panic!("{frames:?}") };
        assert!(one.right() < two.left && two.right() < 50.0 && three.left > 50.0);
        assert_eq!((one.top, one.bottom(), two.top, two.bottom()), (0.0, 50.0, 50.0, 75.0));
    }
}
