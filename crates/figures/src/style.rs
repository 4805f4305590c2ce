//! Gives every series of a figure its colour, dash and marker.

use plotters::prelude::RGBColor;

use super::canvas::{Colour, Dash, Point, Sheet, WHITE};
use super::model::{Figure, Hue, Layer};

/// The colour of text and axes.
pub(super) const INK: Colour = colour(Hue::Ink);
/// The colour of captions and reference lines.
pub(super) const GREY: Colour = RGBColor(0x55, 0x55, 0x55);
/// The colour of grid lines at labelled ticks.
pub(super) const GRID: Colour = RGBColor(0xDD, 0xDD, 0xDD);
/// The colour of the lines of rows.
pub(super) const FAINT: Colour = RGBColor(0xF0, 0xF0, 0xF0);

/// The opacity of bands.
pub(super) const BAND: f64 = 0.2;

/// The dashes of series, repeating.
const DASHES: [Dash; 3] = [None, Some((9.0, 3.0)), Some((3.0, 2.5))];

/// A star: number of points, inner radius relative to the outer radius, and direction of the first
/// point in turns, clockwise from the right. A regular polygon is a star without notches.
pub(super) type Star = (u32, f64, f64);
/// The markers of series, repeating.
const MARKERS: [Star; 7] = [
    (6, 1.0, 0.0),
    (4, 0.71, 0.125),
    (3, 0.5, 0.75),
    (4, 0.71, 0.0),
    (3, 0.5, 0.25),
    (4, 0.42, 0.0),
    (5, 0.45, 0.75),
];

/// Returns the colour of a hue.
const fn colour(hue: Hue) -> Colour {
    let [_, red, green, blue] = (hue as u32).to_be_bytes();
    RGBColor(red, green, blue)
}

/// The colour, dash and marker of one series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub colour: Colour,
    pub dash: Dash,
    pub marker: Star,
}

impl Stroke {
    /// The stroke of the series of this number in its figure. Successive ones can be told apart in
    /// grey.
    fn of(hue: Hue, number: usize) -> Self {
        Self {
            colour: colour(hue),
            dash: DASHES[number % DASHES.len()],
            marker: MARKERS[number % MARKERS.len()],
        }
    }

    /// Draws the marker with a white edge, which separates it from its neighbours.
    pub fn mark(&self, sheet: &mut Sheet, at: Point, radius: f64, edge: f64) {
        sheet.marker(&self.outline(at, radius), self.colour, WHITE, 2.0 * edge);
    }

    /// Returns the marker around a point as a polygon with about the area of a disc of this
    /// radius.
    fn outline(&self, (x, y): Point, radius: f64) -> Vec<Point> {
        let (points, inner, first) = self.marker;
        let outer = radius * (1.6 - 0.6 * inner);
        let corner = |index: u32| {
            let turn = f64::from(index) / f64::from(2 * points);
            let part = if index.is_multiple_of(2) { 1.0 } else { inner };
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * (first + turn));
            (x + outer * part * cos, y + outer * part * sin)
        };
        (0..2 * points).map(corner).collect()
    }
}

/// The stroke of reference lines.
pub(super) const REFERENCE_LINE: Stroke =
    Stroke { colour: GREY, dash: Some((5.0, 4.0)), marker: MARKERS[0] };
/// The stroke of series without a name.
const UNNAMED: Stroke = Stroke { colour: GREY, dash: None, marker: MARKERS[0] };

/// The colours of series without a given one, in order, those that methods have most often last.
const FREE: [Hue; 12] = {
    use Hue::{Amber, Blue, Brown, Forest, Green, Grey, Indigo, Olive, Orange, Pink, Sky, Wine};
    [Wine, Amber, Sky, Pink, Olive, Forest, Brown, Grey, Indigo, Green, Orange, Blue]
};

/// The strokes of all series of a figure, in order of their first appearance, and then those of
/// named reference lines.
pub(super) struct Strokes(pub Vec<(String, Stroke)>);

impl Strokes {
    pub fn new(figure: &Figure) -> Self {
        let layers = figure.panels.iter().flat_map(|panel| &panel.layers);
        let named = layers.filter(|layer| !layer.name.trim().is_empty());
        let (series, lines): (Vec<&Layer>, Vec<&Layer>) =
            named.partition(|layer| layer.series().is_some());
        // Series without a given colour get some that no other has, while they last.
        let used = figure.hues.iter().filter(|(name, _)| series.iter().any(|s| s.name == *name));
        let is_free = |hue: &Hue| used.clone().all(|(_, given)| given != hue);
        let mut free = FREE.into_iter().filter(is_free).chain(FREE.into_iter().cycle());
        let mut strokes: Vec<(String, Stroke)> = Vec::new();
        for layer in series.iter().chain(&lines) {
            let name = &layer.name;
            if strokes.iter().any(|(known, _)| known == name) {
                continue;
            }
            let given = figure.hues.iter().find(|(known, _)| known == name);
            let stroke = match (layer.series(), given) {
                (None, _) => REFERENCE_LINE,
                (_, Some((_, hue))) => Stroke::of(*hue, strokes.len()),
                _ => Stroke::of(free.next().expect("endless"), strokes.len()),
            };
            strokes.push((name.clone(), stroke));
        }
        Self(strokes)
    }

    /// Returns the stroke of the named series; solid grey for a series without a name.
    pub fn of(&self, name: &str) -> Stroke {
        self.0.iter().find(|(known, _)| known == name).map_or(UNNAMED, |(_, stroke)| *stroke)
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{Marks, Panel};
    use super::*;

    fn strokes(names: &[String], hues: Vec<(String, Hue)>) -> Vec<(String, Stroke)> {
        let line = |name: &String| Layer::new(name, Marks::Line(Vec::new()));
        let layers = names.iter().chain(names.iter().rev()).map(line).collect();
        let panel = Panel { layers, ..Panel::default() };
        Strokes::new(&Figure { panels: vec![panel], hues, ..Figure::default() }).0
    }

    #[test]
    fn twelve_series_have_their_own_colours_and_more_have_some() {
        let names: Vec<String> = (0..30).map(|i| format!("series {i}")).collect();
        let series = strokes(&names, Vec::new());
        assert!(series.iter().map(|(name, _)| name).eq(&names));
        for (i, (_, one)) in series[..12].iter().enumerate() {
            for (_, other) in &series[..i] {
                assert!(one.colour != other.colour, "series {i} looks like another");
            }
        }
    }

    #[test]
    fn a_colour_given_in_advance_is_given_to_no_other() {
        let names = ["MF", "GRASP"].map(str::to_owned);
        // A colour of a series of other figures stays free.
        let hues = vec![("GRASP".into(), Hue::Wine), ("PLOC".into(), Hue::Amber)];
        let series = strokes(&names, hues);
        let expected = [Stroke::of(Hue::Amber, 0), Stroke::of(Hue::Wine, 1)];
        assert_eq!([series[0].1, series[1].1], expected);
    }
}
