//! The parts of a figure: panels, axes and layers of data series, in data units, without layout.

/// Panels in a grid under one title, with one legend for all of them.
///
/// A series name means the same colour, dash, marker and legend entry wherever it occurs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The title, printed bold at the top and wrapped. Screen readers read it as the SVG's title.
    pub title: String,
    /// The caption under the title, wrapped. It names the quantity, the subjects and the number of
    /// repetitions.
    pub caption: String,
    /// Panels per row, clamped to 1 to 2; rows are filled in order.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Colours of some series, so that a method has the same in every figure. Other series take
    /// free ones in order of appearance.
    pub hues: Vec<(String, Hue)>,
}

/// The colours of Okabe and Ito without yellow, which is invisible on white; then darker ones of
/// Paul Tol, and the colour of text. Their numbers are red, green and blue.
#[allow(missing_docs, reason = "the names of colours")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hue {
    Blue = 0x0072B2,
    Orange = 0xD55E00,
    Green = 0x009E73,
    Pink = 0xCC79A7,
    Amber = 0xE69F00,
    Sky = 0x56B4E9,
    Wine = 0x882255,
    Grey = 0x828282,
    Indigo = 0x332288,
    Olive = 0x999933,
    Brown = 0x8C564B,
    Forest = 0x117733,
    Ink = 0x222222,
}

/// One pair of axes with layers. Bands are drawn first, then reference lines, spans, lines and
/// points; within a kind, the first layer is at the bottom.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// The title, printed bold above the panel; may be empty.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The data. A panel without any drawable data shows 'no data'.
    pub layers: Vec<Layer>,
}

/// The quantity along one side of a panel, and the part of it that is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// Name and unit, such as `time (s)`.
    pub label: String,
    /// The map from values to positions.
    pub scale: Scale,
    /// How ticks are written.
    pub unit: Unit,
    /// Both ends in data units; unused for rows. Without them, or if the scale cannot show one, the
    /// axis begins and ends a little beyond the data.
    pub range: Option<(f64, f64)>,
}

/// The map from values to positions along an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Scale {
    /// Equal differences are equal distances. Values beyond ±10³⁰⁰ have no position.
    #[default]
    Linear,
    /// Equal ratios are equal distances; values of 0 and below have no position.
    Log,
    /// Named rows from the top, for vertical axes: names, and the height of a row in pixels. The
    /// value i, from 0, is the middle of a row.
    Rows(Vec<String>, f64),
}

/// How the ticks of an axis are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// As numbers.
    #[default]
    Number,
    /// Fractions in per cent.
    Percent,
    /// Not at all: there are no ticks.
    Bare,
}

/// Values of a larger magnitude count as non-finite, so that no difference overflows.
pub(super) const LARGEST: f64 = 1e300;

impl Axis {
    /// Returns a value's coordinate: the value, or its logarithm; `None` if the scale cannot show it.
    pub(super) fn coordinate(&self, value: f64) -> Option<f64> {
        let is_log = self.scale == Scale::Log;
        let is_possible = value.abs() <= LARGEST && (value > 0.0 || !is_log);
        is_possible.then(|| if is_log { libm::log10(value) } else { value })
    }

    /// Returns the value of a coordinate.
    pub(super) fn value(&self, coordinate: f64) -> f64 {
        if self.scale == Scale::Log { libm::exp10(coordinate) } else { coordinate }
    }

    /// Makes a linear axis around the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// Makes a logarithmic axis around the data.
    pub fn log(label: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label) }
    }

    /// Makes a vertical axis with a row of this height in pixels for each name.
    pub fn rows(names: Vec<String>, height: f64) -> Self {
        Self { scale: Scale::Rows(names, height), unit: Unit::Bare, ..Self::default() }
    }

    /// Chooses how ticks are written.
    #[must_use]
    pub fn unit(self, unit: Unit) -> Self {
        Self { unit, ..self }
    }

    /// Fixes the range to `low` to `high`, independent of the data.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }
}

/// The marks of one kind of a series, or a reference line over the whole panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name of the series or reference line in the legend. An empty name has no entry.
    pub name: String,
    /// The marks.
    pub marks: Marks,
}

/// The marks of a layer in data units. Points that are not finite are skipped and interrupt a line.
/// On a logarithmic axis, lines and bands run along the floor at values of 0 and below, and points
/// there are skipped.
#[derive(Clone, Debug, PartialEq)]
pub enum Marks {
    /// Straight lines through the points `(x, y)` in drawing order.
    Line(Vec<(f64, f64)>),
    /// Markers at `(x, y)`.
    Points(Vec<(f64, f64)>),
    /// A translucent area between two lines: `(x, lower, upper)`, x ascending.
    Band(Vec<(f64, f64, f64)>),
    /// Straight thin lines from point to point, such as the range of a value.
    Spans(Vec<[(f64, f64); 2]>),
    /// A horizontal reference line at this height.
    HLine(f64),
    /// A vertical reference line at this place.
    VLine(f64),
}

impl Marks {
    /// The points of a series with data; none for spans and reference lines.
    pub(super) fn data(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Line(points) | Self::Points(points) => points.clone(),
            Self::Band(points) => {
                points.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]).collect()
            }
            _ => vec![],
        }
    }
}

impl Layer {
    /// Makes a layer of these marks.
    pub fn new(name: impl Into<String>, marks: Marks) -> Self {
        Self { name: name.into(), marks }
    }

    /// Returns the series; `None` for reference lines, which belong to none.
    pub fn series(&self) -> Option<&str> {
        let is_reference = matches!(self.marks, Marks::HLine(_) | Marks::VLine(_));
        (!is_reference).then_some(&self.name)
    }

    /// Returns true for lines, except those of reference.
    pub(super) fn is_line(&self) -> bool {
        matches!(self.marks, Marks::Line(_))
    }

    /// Returns true for layers with markers at their points.
    pub(super) fn is_marked(&self) -> bool {
        matches!(self.marks, Marks::Points(_))
    }
}
