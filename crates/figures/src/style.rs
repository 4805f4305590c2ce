//! Gives every series of a figure its colour, dash and marker.

use plotters::style::RGBColor;

use super::canvas::steps;
use super::model::{COLOURS, Figure};

/// The colour of the background.
pub(super) const WHITE: RGBColor = RGBColor(255, 255, 255);
/// The colour of text and axes.
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
/// The colour of captions and reference lines.
pub(super) const GREY: RGBColor = RGBColor(85, 85, 85);
/// The colour of grid lines at labelled ticks.
pub(super) const GRID: RGBColor = RGBColor(221, 221, 221);
/// The colour of grid lines between labelled ticks.
pub(super) const FAINT: RGBColor = RGBColor(240, 240, 240);

/// The colours of Okabe and Ito without yellow, which is invisible on white, and black, which looks
/// like the axes; then brown, grey and darker colours of Paul Tol.
const PALETTE: [RGBColor; COLOURS] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(136, 34, 85),
    RGBColor(130, 130, 130),
    RGBColor(51, 34, 136),
    RGBColor(153, 153, 51),
    RGBColor(140, 86, 75),
    RGBColor(17, 119, 51),
];

/// Lengths of a dash and of the gap after it in pixels; `None` for a solid line.
type Dash = Option<(f64, f64)>;
/// The dashes of series. Four successive series share a dash, and the next series of the same
/// colour has another.
const DASHES: [Dash; 3] = [None, Some((9.0, 3.0)), Some((3.0, 2.5))];
/// The dash of reference lines.
const REFERENCE_DASH: Dash = Some((5.0, 4.0));

/// A star: number of points, inner radius relative to the outer radius, and direction of the first
/// point in turns, clockwise from the right. A regular polygon is a star without notches.
type Star = (u32, f64, f64);
/// The markers: disc, square, triangle, diamond, inverted triangle, upright cross and star.
const MARKERS: [Star; 7] = [
    (6, 1.0, 0.0),
    (4, 0.71, 0.125),
    (3, 0.5, 0.75),
    (4, 0.71, 0.0),
    (3, 0.5, 0.25),
    (4, 0.42, 0.0),
    (5, 0.45, 0.75),
];

/// The colour, dash and marker of one series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub colour: RGBColor,
    pub dash: Dash,
    marker: Star,
}

impl Stroke {
    fn of(look: usize) -> Self {
        Self {
            colour: PALETTE[look % PALETTE.len()],
            dash: DASHES[(look / 4 + look / 12) % DASHES.len()],
            marker: MARKERS[look % MARKERS.len()],
        }
    }

    /// Returns the marker around the origin as a polygon with about the area of a disc of this
    /// radius.
    pub fn outline(&self, radius: f64) -> Vec<(i32, i32)> {
        let (points, inner, first) = self.marker;
        let outer = radius * (1.6 - 0.6 * inner);
        let corner = |index: u32| {
            let turn = f64::from(index) / f64::from(2 * points);
            let part = if index.is_multiple_of(2) { 1.0 } else { inner };
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * (first + turn));
            (steps(outer * part * cos), steps(outer * part * sin))
        };
        (0..2 * points).map(corner).collect()
    }
}

/// The stroke of reference lines.
pub(super) const REFERENCE_LINE: Stroke =
    Stroke { colour: GREY, dash: REFERENCE_DASH, marker: MARKERS[0] };
/// The stroke of series without a name.
const UNNAMED: Stroke = Stroke { colour: GREY, dash: None, marker: MARKERS[0] };

/// The strokes of all series of a figure, in order of their first appearance.
pub(super) struct Strokes {
    pub series: Vec<(String, Stroke)>,
    /// True if lines carry markers: colours and dashes alone distinguish only four lines at a
    /// glance.
    pub marked_lines: bool,
}

impl Strokes {
    pub fn new(figure: &Figure) -> Self {
        let layers = || figure.panels.iter().flat_map(|panel| &panel.layers);
        let shown = |name: &str| layers().any(|layer| layer.series() == Some(name));
        let set = |name: &str| {
            figure.looks.iter().find(|(known, _)| known == name).map(|&(_, look)| look)
        };
        let taken = |number| figure.looks.iter().any(|(name, look)| *look == number && shown(name));
        // Series without a given look avoid the looks of series that have one.
        let mut free = (0..).filter(|&number| !taken(number));
        let mut series: Vec<(String, Stroke)> = Vec::new();
        let mut lines: Vec<&str> = Vec::new();
        for layer in layers() {
            let Some(name) = layer.series().filter(|name| !name.is_empty()) else { continue };
            if series.iter().all(|(known, _)| known != name) {
                let look = set(name).or_else(|| free.next()).unwrap_or(0);
                series.push((name.to_owned(), Stroke::of(look)));
            }
            if layer.is_line() && !lines.contains(&name) {
                lines.push(name);
            }
        }
        Self { series, marked_lines: lines.len() > 4 }
    }

    /// Returns the place of the named series in the order of appearance, and its stroke; solid grey
    /// for a series without a name.
    pub fn of(&self, name: &str) -> (usize, Stroke) {
        let place = self.series.iter().position(|(known, _)| known == name);
        place.map_or((0, UNNAMED), |place| (place, self.series[place].1))
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{Layer, Marks, Panel};
    use super::*;

    fn strokes(names: &[String], looks: Vec<(String, usize)>) -> Strokes {
        let line = |name: &String| Layer::new(name, Marks::Line(Vec::new()));
        let layers = names.iter().chain(names.iter().rev()).map(line).collect();
        let panel = Panel { layers, ..Panel::default() };
        Strokes::new(&Figure { panels: vec![panel], looks, ..Figure::default() })
    }

    #[test]
    fn every_series_has_its_own_look_and_twelve_their_own_colour() {
        let names: Vec<String> = (0..84).map(|i| format!("series {i}")).collect();
        let series = strokes(&names, Vec::new()).series;
        assert!(series.iter().map(|(name, _)| name).eq(&names));
        for (i, (_, one)) in series.iter().enumerate() {
            for (_, other) in &series[..i] {
                assert!(
                    one != other && (i >= 12 || one.colour != other.colour),
                    "series {i} looks like another"
                );
            }
        }
    }

    #[test]
    fn looks_given_in_advance_are_kept_and_not_given_again() {
        let looks = vec![("GRASP".to_owned(), 0)];
        let strokes = strokes(&["MF", "GRASP"].map(str::to_owned), looks);
        assert_eq!(strokes.of("GRASP").1, Stroke::of(0));
        assert_eq!(strokes.of("MF").1, Stroke::of(1));
    }
}
