//! Gives every series of a figure its colour, dash and marker.

use plotters::style::RGBColor;

use super::model::{Figure, Look};

/// The background.
pub(super) const WHITE: RGBColor = RGBColor(255, 255, 255);
/// Text and axes.
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
/// Captions and reference lines.
pub(super) const GREY: RGBColor = RGBColor(85, 85, 85);
/// Grid lines at labelled ticks.
pub(super) const GRID: RGBColor = RGBColor(221, 221, 221);
/// Grid lines between them.
pub(super) const FAINT: RGBColor = RGBColor(240, 240, 240);

/// Okabe and Ito's colours, with grey for yellow, which is lost on white; black is the reference's.
/// There is one more than dashes and markers, so that combinations repeat only after 42 series.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];

/// On and off lengths in pixels.
const DASHES: [&[f64]; 6] = [&[], &[8.0, 3.0], &[2.5, 2.0], &[9.0, 3.0, 2.5, 3.0], &[14.0, 3.0], &[5.0, 2.5]];

/// The dash of reference lines.
const RULE: &[f64] = &[4.0, 3.0];
/// The dash of reference series.
const REFERENCE_DASH: &[f64] = &[6.0, 4.0];

/// Unit markers: polygons of radius about 1 around the origin, y downwards. The last is the reference's.
const MARKERS: [&[(f64, f64)]; 7] = [
    &[
        (0.95, 0.0),
        (0.82, 0.48),
        (0.48, 0.82),
        (0.0, 0.95),
        (-0.48, 0.82),
        (-0.82, 0.48),
        (-0.95, 0.0),
        (-0.82, -0.48),
        (-0.48, -0.82),
        (0.0, -0.95),
        (0.48, -0.82),
        (0.82, -0.48),
    ],
    &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
    &[(0.0, -1.1), (1.05, 0.75), (-1.05, 0.75)],
    &[(0.0, -1.2), (1.0, 0.0), (0.0, 1.2), (-1.0, 0.0)],
    &[(0.0, 1.1), (1.05, -0.75), (-1.05, -0.75)],
    &[
        (-0.35, -1.1),
        (0.35, -1.1),
        (0.35, -0.35),
        (1.1, -0.35),
        (1.1, 0.35),
        (0.35, 0.35),
        (0.35, 1.1),
        (-0.35, 1.1),
        (-0.35, 0.35),
        (-1.1, 0.35),
        (-1.1, -0.35),
        (-0.35, -0.35),
    ],
    &[
        (0.0, -0.5),
        (0.6, -1.1),
        (1.1, -0.6),
        (0.5, 0.0),
        (1.1, 0.6),
        (0.6, 1.1),
        (0.0, 0.5),
        (-0.6, 1.1),
        (-1.1, 0.6),
        (-0.5, 0.0),
        (-1.1, -0.6),
        (-0.6, -1.1),
    ],
];

/// How one series is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub colour: RGBColor,
    /// Lengths in pixels; empty for a solid line.
    pub dash: &'static [f64],
    /// A polygon of radius about 1.
    pub marker: &'static [(f64, f64)],
}

impl Stroke {
    fn of(look: Look) -> Self {
        match look {
            Look::Reference => {
                Self { colour: RGBColor(0, 0, 0), dash: REFERENCE_DASH, marker: MARKERS[MARKERS.len() - 1] }
            }
            Look::Slot(slot) => Self {
                colour: COLOURS[slot % COLOURS.len()],
                dash: DASHES[slot % DASHES.len()],
                marker: MARKERS[slot % (MARKERS.len() - 1)],
            },
        }
    }
}

/// Reference lines.
pub(super) const REFERENCE_LINE: Stroke = Stroke { colour: GREY, dash: RULE, marker: MARKERS[0] };

/// The strokes of all series of a figure, in order of their first appearance.
pub(super) struct Strokes(Vec<(String, Stroke)>);

impl Strokes {
    pub fn new(figure: &Figure) -> Self {
        let mut names: Vec<&str> = Vec::new();
        for name in figure.panels.iter().flat_map(|panel| &panel.layers).filter_map(|layer| layer.name()) {
            if !name.is_empty() && !names.contains(&name) {
                names.push(name);
            }
        }
        let set = |name: &str| figure.looks.iter().find(|(known, _)| known == name).map(|&(_, look)| look);
        let taken = |slot| figure.looks.iter().any(|&(_, look)| look == Look::Slot(slot));
        let mut free = (0..).filter(|&slot| !taken(slot));
        let stroke = |name: &str| {
            Stroke::of(set(name).or_else(|| free.next().map(Look::Slot)).unwrap_or(Look::Reference))
        };
        let strokes: Vec<Stroke> = names.iter().copied().map(stroke).collect();
        Self(names.into_iter().map(str::to_owned).zip(strokes).collect())
    }

    /// The named series' stroke; solid grey for the unnamed one.
    pub fn of(&self, name: &str) -> Stroke {
        let unnamed = Stroke { colour: GREY, dash: &[], marker: MARKERS[0] };
        self.0.iter().find(|(known, _)| known == name).map_or(unnamed, |&(_, stroke)| stroke)
    }

    /// Names in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(name, _)| name.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{Axis, Layer, Panel};
    use super::*;

    fn figure(names: &[&str], looks: Vec<(String, Look)>) -> Figure {
        let line = |name: &&str| Layer::Line { name: (*name).to_owned(), points: Vec::new() };
        let panel = |names: &[&str]| Panel {
            title: String::new(),
            x: Axis::linear(""),
            y: Axis::linear(""),
            layers: names.iter().map(line).collect(),
        };
        let reversed: Vec<&str> = names.iter().rev().copied().collect();
        Figure { panels: vec![panel(names), panel(&reversed)], looks, ..Figure::default() }
    }

    #[test]
    fn every_series_has_its_own_look_in_all_panels() {
        let names: Vec<String> = (0..18).map(|i| format!("series {i}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let strokes = Strokes::new(&figure(&names, Vec::new()));
        assert_eq!(strokes.names().collect::<Vec<_>>(), names);
        for (i, one) in names.iter().enumerate() {
            for other in &names[..i] {
                assert_ne!(strokes.of(one), strokes.of(other), "{one} looks like {other}");
            }
        }
    }

    #[test]
    fn looks_given_in_advance_are_kept_and_not_given_again() {
        let looks = vec![("paper".to_owned(), Look::Reference), ("GRASP".to_owned(), Look::Slot(0))];
        let strokes = Strokes::new(&figure(&["MF", "GRASP", "paper"], looks));
        assert_eq!(strokes.of("GRASP").colour, COLOURS[0]);
        assert_eq!(strokes.of("MF").colour, COLOURS[1]);
        assert_eq!(strokes.of("paper").colour, RGBColor(0, 0, 0));
    }
}
