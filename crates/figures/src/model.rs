//! The parts of a figure: panels, axes and layers of data series, in data units, without layout.

use thiserror::Error;

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
    /// Panels per row, clamped to 1 to 4; rows are filled in order.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Looks of some series, so that a method looks the same in every figure: numbers, from 0, of
    /// combinations of colour, dash and marker, which repeat after 84. Other series take the free
    /// numbers in order of appearance.
    pub looks: Vec<(String, usize)>,
}

/// Number of looks, from 0 on, that differ in colour.
pub const COLOURS: usize = 12;

/// One pair of axes with layers. Bands are drawn first, then bars, reference lines, lines and
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
    /// Name and unit, such as `time (s)`. A power of ten that all ticks share is appended.
    pub label: String,
    /// The map from values to positions.
    pub scale: Scale,
    /// Lower end in data units; unused for categories. Without it, or if the scale cannot show it,
    /// the axis begins just below the data.
    pub low: Option<f64>,
    /// Upper end in data units, above `low`. Without it, or if the scale cannot show it, the axis
    /// ends just above the data.
    pub high: Option<f64>,
}

/// The map from values to positions along an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Scale {
    /// Equal differences are equal distances. Values beyond ±10³⁰⁰ have no position.
    #[default]
    Linear,
    /// Equal ratios are equal distances; values of 0 and below have no position.
    Log,
    /// Each name has a place of width 1, from the left or bottom; the value i, from 0, is its
    /// middle.
    Category(Vec<String>),
}

impl Axis {
    /// Makes a linear axis around the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// Makes a logarithmic axis around the data.
    pub fn log(label: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label) }
    }

    /// Makes an axis with one place for each name.
    pub fn categories(label: impl Into<String>, names: Vec<String>) -> Self {
        Self { scale: Scale::Category(names), ..Self::linear(label) }
    }

    /// Fixes the range to `low` to `high`, independent of the data.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { low: Some(low), high: Some(high), ..self }
    }

    /// Fixes the lower end.
    #[must_use]
    pub fn starting_at(self, low: f64) -> Self {
        Self { low: Some(low), ..self }
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

/// The marks of a layer in data units. Points that an axis cannot show, because they are not finite
/// or not positive on a logarithmic axis, are skipped and interrupt a line.
#[derive(Clone, Debug, PartialEq)]
pub enum Marks {
    /// Straight lines through the points `(x, y)` in drawing order.
    Line(Vec<(f64, f64)>),
    /// A staircase through `(x, y)`, x ascending: y holds until the next x, and the last point ends
    /// the last step. On a logarithmic axis it falls to the floor at the first y that is 0 or
    /// below.
    Steps(Vec<(f64, f64)>),
    /// Markers at `(x, y)`.
    Points(Vec<(f64, f64)>),
    /// A translucent area between two lines: `(x, lower, upper)`, x ascending. A lower value of 0
    /// or below reaches the floor of a logarithmic axis.
    Band(Vec<(f64, f64, f64)>),
    /// A translucent area like [`Marks::Band`] between two staircases: both values hold until the
    /// next x.
    StepBand(Vec<(f64, f64, f64)>),
    /// One bar per category of a category x axis. Bars of several layers are next to each other.
    Bars {
        /// Height of each category's bar; skipped if not finite.
        values: Vec<f64>,
        /// Lower and upper end of the whisker on each bar; may be shorter than `values`, or empty.
        spread: Vec<(f64, f64)>,
        /// Value at which bars begin: 0, or 1 for ratios. Bars begin at the floor of an axis that
        /// cannot show it.
        base: f64,
    },
    /// A horizontal reference line at this height.
    HLine(f64),
    /// A vertical reference line at this place.
    VLine(f64),
}

impl Layer {
    /// Makes a layer of these marks.
    pub fn new(name: impl Into<String>, marks: Marks) -> Self {
        Self { name: name.into(), marks }
    }

    /// Makes bars from `base` to these heights, without whiskers.
    pub fn bars(name: impl Into<String>, values: Vec<f64>, base: f64) -> Self {
        Self::new(name, Marks::Bars { values, spread: vec![], base })
    }

    /// Returns the series; `None` for reference lines, which belong to none.
    pub fn series(&self) -> Option<&str> {
        let is_reference = matches!(self.marks, Marks::HLine(_) | Marks::VLine(_));
        (!is_reference).then_some(&self.name)
    }

    /// Returns true for lines and staircases.
    pub(super) fn is_line(&self) -> bool {
        matches!(self.marks, Marks::Line(_) | Marks::Steps(_))
    }

    /// Returns true for layers with markers at their points.
    pub(super) fn is_marked(&self) -> bool {
        matches!(self.marks, Marks::Points(_))
    }
}

/// The reason why there is no picture.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message names its fields")]
pub enum FigureError {
    /// The drawing library failed.
    #[error("figure '{title}' could not be drawn: {reason}")]
    Draw { title: String, reason: String },
    /// One of the fonts in the program could not be read.
    #[error("the embedded font could not be read: {reason}")]
    Font { reason: String },
}
