//! Draws the marks of a panel's layers.

use super::axis::Ruled;
use super::canvas::{Frame, Point, Sheet};
use super::model::{Layer, Marks};
use super::style::{BAND, REFERENCE_LINE, Stroke, Strokes};

/// Width of data lines.
const LINE: f64 = 2.5;
/// Width of spans and reference lines.
const THIN: f64 = 1.5;

/// The layers of a panel being drawn. Their points are in coordinates.
pub(super) struct Layers<'a> {
    pub layers: &'a [Layer],
    /// The horizontal axis.
    pub x: &'a Ruled<'a>,
    /// The vertical axis.
    pub y: &'a Ruled<'a>,
    pub strokes: &'a Strokes,
    /// The place of the plot on the sheet.
    pub frame: Frame,
}

impl Layers<'_> {
    /// Draws all layers, each kind of marks on top of the kinds before.
    pub fn draw(&self, sheet: &mut Sheet) {
        self.layers.iter().for_each(|layer| self.band(sheet, layer));
        self.layers.iter().for_each(|layer| self.thin(sheet, layer));
        self.layers.iter().for_each(|layer| self.line(sheet, layer));
        self.points(sheet);
    }

    /// Returns the place of a point on the sheet.
    fn place(&self, at: &Point) -> Point {
        let Frame { left, top, width, height } = self.frame;
        (left + self.x.fraction(at.0) * width, top + (1.0 - self.y.fraction(at.1)) * height)
    }

    fn band(&self, sheet: &mut Sheet, layer: &Layer) {
        let Marks::Band(points) = &layer.marks else { return };
        let (x, y) = (self.x, self.y);
        let at = |&(at, low, high): &(f64, f64, f64)| {
            Some((x.nearest(at)?, y.nearest(low)?, y.nearest(high)?))
        };
        for run in runs(points.iter().map(at)) {
            let lower = run.iter().map(|&(at, low, _)| (at, low));
            let upper = run.iter().rev().map(|&(at, _, high)| (at, high));
            let outline: Vec<Point> = lower.chain(upper).map(|at| self.place(&at)).collect();
            sheet.polygon(&outline, self.strokes.of(&layer.name).colour, BAND);
        }
    }

    /// Draws reference lines, and the part of every span that is inside the panel.
    fn thin(&self, sheet: &mut Sheet, layer: &Layer) {
        let (x, y) = (self.x, self.y);
        let mut draw = |ends: [Point; 2], stroke: Stroke| {
            sheet.line(&ends.map(|end| self.place(&end)), stroke.colour, THIN, stroke.dash);
        };
        match &layer.marks {
            Marks::HLine(at) => {
                let ends = y.shown(*at).map(|at| [(x.low, at), (x.high, at)]);
                ends.into_iter().for_each(|ends| draw(ends, REFERENCE_LINE));
            }
            Marks::VLine(at) => {
                let ends = x.shown(*at).map(|at| [(at, y.low), (at, y.high)]);
                ends.into_iter().for_each(|ends| draw(ends, REFERENCE_LINE));
            }
            Marks::Spans(spans) => {
                let solid = Stroke { dash: None, ..self.strokes.of(&layer.name) };
                let end = |&(at, height): &Point| Some((x.nearest(at)?, y.nearest(height)?));
                let spans = spans.iter().filter_map(|[from, to]| Some([end(from)?, end(to)?]));
                spans.for_each(|span| draw(span, solid));
            }
            _ => {}
        }
    }

    /// Draws the unbroken parts of a line. Points outside the panel move to its edge.
    fn line(&self, sheet: &mut Sheet, layer: &Layer) {
        let Marks::Line(points) = &layer.marks else { return };
        let stroke = self.strokes.of(&layer.name);
        let at = |point: &Point| Some((self.x.nearest(point.0)?, self.y.nearest(point.1)?));
        for path in runs(points.iter().map(at)) {
            let path: Vec<Point> = path.iter().map(|at| self.place(at)).collect();
            sheet.line(&path, stroke.colour, LINE, stroke.dash);
        }
    }

    /// Draws points, smaller if there are many.
    fn points(&self, sheet: &mut Sheet) {
        let with_points = self.layers.iter().filter_map(|layer| match &layer.marks {
            Marks::Points(points) => Some((&layer.name, points)),
            _ => None,
        });
        let count: usize = with_points.clone().map(|(_, points)| points.len()).sum();
        // Many large points would hide each other; those of rows stand apart.
        let many = if self.y.is_rows() { 300 } else { 100 };
        let (radius, edge) = if count < many { (5.0, 1.0) } else { (2.5, 0.3) };
        let shown = |at: &Point| Some((self.x.shown(at.0)?, self.y.shown(at.1)?));
        for (name, points) in with_points {
            for at in points.iter().filter_map(shown) {
                self.strokes.of(name).mark(sheet, self.place(&at), radius, edge);
            }
        }
    }
}

/// Returns the unbroken parts of a sequence.
fn runs<T: Copy>(placed: impl Iterator<Item = Option<T>>) -> Vec<Vec<T>> {
    let placed: Vec<Option<T>> = placed.collect();
    let parts = placed.split(Option::is_none).map(|part| part.iter().copied().flatten().collect());
    parts.filter(|part: &Vec<T>| !part.is_empty()).collect()
}
