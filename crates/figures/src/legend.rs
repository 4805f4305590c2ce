//! The legend of a figure: its series and reference lines, shared by all panels.

use super::canvas::{Align, Point, Sheet};
use super::model::{Figure, Layer};
use super::style::{BAND, INK, REFERENCE_LINE, Stroke, Strokes};
use super::text::{self, BODY};

/// Width of a sample.
const SAMPLE: f64 = 30.0;
/// Distances from a sample to its name, and from a name to the next sample.
const GAPS: (f64, f64) = (7.0, 18.0);
/// Height of a row.
const ROW: f64 = 23.0;

/// One series or reference line with the kinds of marks it has.
struct Entry {
    name: String,
    stroke: Stroke,
    line: bool,
    marker: bool,
}

/// The entries: series in order of appearance, then reference lines. Columns have equal widths and
/// are filled row by row.
pub(super) struct Legend {
    entries: Vec<Entry>,
    columns: usize,
    column_width: f64,
}

impl Legend {
    pub fn new(figure: &Figure, strokes: &Strokes, width: f64) -> Self {
        let before = SAMPLE + GAPS.0;
        let entry = |(name, stroke): &(String, Stroke)| {
            let layers = figure.panels.iter().flat_map(|panel| &panel.layers);
            let has = |kind: fn(&Layer) -> bool| {
                layers.clone().any(|layer| layer.name == *name && kind(layer))
            };
            let line = has(Layer::is_line) || *stroke == REFERENCE_LINE;
            let marker = has(Layer::is_marked);
            let name = text::shorten(name, width - before, BODY);
            Entry { name, stroke: *stroke, line, marker }
        };
        let entries: Vec<Entry> = strokes.0.iter().map(entry).collect();
        let column_width =
            before + text::widest(entries.iter().map(|entry| &entry.name), BODY) + GAPS.1;
        let most = (((width + GAPS.1) / column_width).floor() as usize).max(1);
        // As even rows as possible: 4 + 4 rather than 7 + 1.
        let columns = entries.len().div_ceil(entries.len().div_ceil(most).max(1)).max(1);
        Self { entries, columns, column_width }
    }

    pub fn height(&self) -> f64 {
        match self.entries.len().div_ceil(self.columns) {
            0 => 0.0,
            rows => ROW * rows as f64 + 8.0,
        }
    }

    /// Draws the entries with their upper left corner at a point.
    pub fn draw(&self, sheet: &mut Sheet, corner: Point) {
        for (index, entry) in self.entries.iter().enumerate() {
            let left = corner.0 + self.column_width * (index % self.columns) as f64;
            let middle = corner.1 + ROW * ((index / self.columns) as f64 + 0.5);
            let Entry { stroke, .. } = entry;
            // A series that has nothing but bands.
            if !entry.line && !entry.marker {
                let corners = [(8.0, -6.0), (22.0, -6.0), (22.0, 6.0), (8.0, 6.0)];
                let corners = corners.map(|(x, y)| (left + x, middle + y));
                sheet.polygon(&corners, stroke.colour, BAND);
            }
            if entry.line {
                let ends = [(left, middle), (left + SAMPLE, middle)];
                sheet.line(&ends, stroke.colour, 2.0, stroke.dash);
            }
            if entry.marker {
                stroke.mark(sheet, (left + SAMPLE / 2.0, middle), 5.0, 0.0);
            }
            sheet.text((left + SAMPLE + GAPS.0, middle), &entry.name, BODY, INK, Align::Left);
        }
    }
}
