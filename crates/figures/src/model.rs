//! The parts of a figure: panels, axes and layers of data series, in data units, without layout.

use thiserror::Error;

/// Panels in a grid under one title, with one legend for all of them.
///
/// A series name means the same colour, dash, marker and legend entry wherever it occurs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Printed bold at the top; wrapped. Also the title of the SVG for readers who cannot see it.
    pub title: String,
    /// Printed under the title; wrapped. Says what is shown, of what, how often.
    pub caption: String,
    /// Panels per row, 1 to 4 (other values are brought into this range); rows are filled in order.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Looks given to series in advance, so that a method looks the same in every figure. Names not
    /// listed take the free slots in order of appearance.
    pub looks: Vec<(String, Look)>,
}

/// How the marks of a series are told from those of the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// The n-th combination of colour, dash and marker, from 0; they repeat after 84.
    Slot(usize),
    /// Black and dashed: what the others are compared with, such as the paper's values.
    Reference,
}

impl Look {
    /// So many slots, the first, differ in colour.
    pub const COLOURS: usize = 12;
}

/// One pair of axes with the layers drawn over each other, the first at the bottom of its kind:
/// bands, then bars, error bars, reference lines, lines and points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Printed bold above the panel; may be empty.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The data. Without any that can be drawn the panel says 'no data'.
    pub layers: Vec<Layer>,
}

/// The quantity along one side of a panel, and the part of it that is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// Name and unit, such as `time (s)`. A power of ten common to all ticks is appended to it.
    pub label: String,
    /// How values become positions.
    pub scale: Scale,
    /// Lower end, in data units; categories have none. `None`, or a value the scale cannot show: just
    /// below the data.
    pub low: Option<f64>,
    /// Upper end, in data units, above `low`. `None`, or a value the scale cannot show: just above
    /// the data.
    pub high: Option<f64>,
}

/// How values become positions along an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Scale {
    /// Equal differences are equal distances. Values beyond ±10³⁰⁰ have no position.
    #[default]
    Linear,
    /// Equal ratios are equal distances; values of 0 and below have no position.
    Log,
    /// Value i, from 0, is the middle of the i-th name's place, from the left or bottom; places are 1
    /// wide.
    Category(Vec<String>),
}

impl Axis {
    /// A linear axis around the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A logarithmic axis around the data.
    pub fn log(label: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label) }
    }

    /// An axis with one place for each name.
    pub fn categories(label: impl Into<String>, names: Vec<String>) -> Self {
        Self { scale: Scale::Category(names), ..Self::linear(label) }
    }

    /// The same axis from `low` to `high`, whatever the data.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { low: Some(low), high: Some(high), ..self }
    }

    /// The same axis beginning at `low`.
    #[must_use]
    pub fn starting_at(self, low: f64) -> Self {
        Self { low: Some(low), ..self }
    }
}

/// The marks of one kind of a series, or a reference line over the whole panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// The series, or what the legend calls the reference line. An empty name has no legend entry.
    pub name: String,
    /// The marks.
    pub marks: Marks,
}

/// The marks of a layer. Coordinates are data units; points an axis cannot show (non-finite, or not
/// positive on a logarithmic axis) are skipped and interrupt a line.
#[derive(Clone, Debug, PartialEq)]
pub enum Marks {
    /// Straight lines from point to point: `(x, y)`, in drawing order.
    Line(Vec<(f64, f64)>),
    /// A staircase: y holds until the next x. On a logarithmic axis it falls through the floor at the
    /// first y that is 0 or below. `(x, y)`, x ascending; the last point ends the last step.
    Steps(Vec<(f64, f64)>),
    /// Markers at `(x, y)`.
    Points(Vec<(f64, f64)>),
    /// A translucent area between two lines: `(x, lower, upper)`, x ascending; a lower value of 0 or
    /// below reaches the floor of a logarithmic axis.
    Band(Vec<(f64, f64, f64)>),
    /// A translucent area between two staircases, as for [`Marks::Band`]; both values hold until the
    /// next x.
    StepBand(Vec<(f64, f64, f64)>),
    /// Markers with a vertical bar: `(x, lower, middle, upper)`, the marker at `middle`. On a category
    /// axis, offsets of x by less than a half keep several series beside each other.
    ErrorBars(Vec<(f64, f64, f64, f64)>),
    /// One bar per category of a category x axis; several such layers stand beside each other.
    Bars {
        /// Height of each category's bar; skipped if not finite.
        values: Vec<f64>,
        /// Lower and upper end of the whisker on each bar; may be shorter than `values`, or empty.
        spread: Vec<(f64, f64)>,
        /// Where bars begin: 0, or 1 for ratios. A logarithmic axis's floor if it cannot show this.
        base: f64,
    },
    /// A horizontal reference line at this height.
    HLine(f64),
    /// A vertical reference line at this place.
    VLine(f64),
}

impl Layer {
    /// A layer of these marks.
    pub fn new(name: impl Into<String>, marks: Marks) -> Self {
        Self { name: name.into(), marks }
    }

    /// Bars of these heights from `base` on, without whiskers.
    pub fn bars(name: impl Into<String>, values: Vec<f64>, base: f64) -> Self {
        Self::new(name, Marks::Bars { values, spread: vec![], base })
    }

    /// The series, of layers that belong to one.
    pub fn series(&self) -> Option<&str> {
        let is_reference = matches!(self.marks, Marks::HLine(_) | Marks::VLine(_));
        (!is_reference).then_some(&self.name)
    }

    /// Whether it is a line or a staircase.
    pub(super) fn is_line(&self) -> bool {
        matches!(self.marks, Marks::Line(_) | Marks::Steps(_))
    }

    /// Whether it has markers at its points.
    pub(super) fn is_marked(&self) -> bool {
        matches!(self.marks, Marks::Points(_) | Marks::ErrorBars(_))
    }
}

/// A table of coloured cells with its key.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Printed bold at the top; wrapped.
    pub title: String,
    /// Printed under the title; wrapped.
    pub caption: String,
    /// The kind of the rows, such as `case`; may be empty.
    pub row_label: String,
    /// One name per row, from the top.
    pub rows: Vec<String>,
    /// One name per column, from the left.
    pub columns: Vec<String>,
    /// `rows.len() * columns.len()` cells, row by row.
    pub cells: Vec<Cell>,
    /// The meanings of the colours, from best to worst; at most five.
    pub classes: Vec<String>,
}

/// One cell of a heat map.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// Which of the classes gives the cell its colour; grey if none does.
    pub class: Option<usize>,
    /// Printed in the cell; may be empty.
    pub text: String,
}

/// Why there is no picture.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum FigureError {
    /// A heat map whose cells do not fill its table.
    #[error(
        "heat map '{title}' has {rows} rows of {columns} cells, and {cells} cells instead of their product"
    )]
    CellCount { title: String, rows: usize, columns: usize, cells: usize },
    /// The drawing library failed.
    #[error("figure '{title}' could not be drawn: {reason}")]
    Draw { title: String, reason: String },
    /// One of the fonts in the program could not be read.
    #[error("the embedded font could not be read: {reason}")]
    Font { reason: String },
}
