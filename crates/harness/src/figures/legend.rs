//! The key to the series of a figure, shared by all its panels.

use super::canvas::{Anchor, Canvas, Fault, Frame, Pen};
use super::model::{Figure, Layer};
use super::style::{INK, REFERENCE_LINE, Stroke, Strokes};
use super::text::{BODY, Ruler};

/// Widths of samples of lines, of reference lines among bars, and of other marks.
const LINE: f64 = 30.0;
const RULE: f64 = 20.0;
const MARK: f64 = 14.0;
/// From a sample to its name, and from a name to the next sample.
const GAPS: (f64, f64) = (7.0, 22.0);
/// Height of a row.
const ROW: f64 = 20.0;

/// One series with the kinds of marks it has.
struct Entry {
    name: String,
    stroke: Stroke,
    line: bool,
    band: bool,
    marker: bool,
    whisker: bool,
    bar: bool,
}

impl Entry {
    fn new(name: &str, stroke: Stroke) -> Self {
        let name = name.to_owned();
        Self { name, stroke, line: false, band: false, marker: false, whisker: false, bar: false }
    }
}

/// The entries, in order of the series' appearance, then the reference lines of bar charts.
pub(super) struct Legend<'a> {
    entries: Vec<Entry>,
    ruler: &'a Ruler,
    /// Width of all samples.
    sample: f64,
}

/// Where the entries stand.
pub(super) struct Arrangement {
    /// Upper left corners, from that of the legend.
    corners: Vec<(f64, f64)>,
    /// Longest name in pixels.
    room: f64,
    pub width: f64,
    pub height: f64,
}

impl<'a> Legend<'a> {
    pub fn new(figure: &Figure, strokes: &Strokes, ruler: &'a Ruler) -> Self {
        let layers = || figure.panels.iter().flat_map(|panel| &panel.layers);
        let entry = |name: &str| {
            let has =
                |kind: fn(&Layer) -> bool| layers().any(|layer| layer.name() == Some(name) && kind(layer));
            Entry {
                line: has(|layer| matches!(layer, Layer::Line { .. } | Layer::Steps { .. })),
                band: has(|layer| matches!(layer, Layer::Band { .. } | Layer::StepBand { .. })),
                marker: has(|layer| matches!(layer, Layer::Points { .. } | Layer::ErrorBars { .. })),
                whisker: has(|layer| matches!(layer, Layer::ErrorBars { .. })),
                bar: has(|layer| matches!(layer, Layer::Bars { .. })),
                ..Entry::new(name, strokes.of(name))
            }
        };
        let mut entries: Vec<Entry> = strokes.names().map(entry).collect();
        let mut sample = if entries.iter().any(|entry| entry.line || entry.band) { LINE } else { MARK };
        for panel in figure.panels.iter().filter(|panel| panel.has_bars()) {
            for layer in &panel.layers {
                let Layer::HLine { label, .. } = layer else { continue };
                if !label.trim().is_empty() && entries.iter().all(|entry| entry.name != *label) {
                    sample = sample.max(RULE);
                    entries.push(Entry { line: true, ..Entry::new(label, REFERENCE_LINE) });
                }
            }
        }
        Self { entries, ruler, sample }
    }

    /// One row if it fits the width, otherwise columns of equal width, filled row by row.
    pub fn arrange(&self, width: f64) -> Arrangement {
        let before = self.sample + GAPS.0;
        let needed = |entry: &Entry| before + self.ruler.width(&entry.name, BODY) + GAPS.1;
        let widths: Vec<f64> = self.entries.iter().map(needed).collect();
        let (total, widest) = (widths.iter().sum::<f64>(), widths.iter().copied().fold(1.0, f64::max));
        let count = widths.len();
        let most = if total - GAPS.1 <= width { count } else { ((width + GAPS.1) / widest).floor() as usize };
        // As even rows as possible: 4 + 4 rather than 7 + 1.
        let rows = count.div_ceil(most.max(1));
        let columns = count.div_ceil(rows.max(1)).max(1);
        let corner = |index: usize| {
            let left =
                if rows <= 1 { widths.iter().take(index).sum() } else { widest * (index % columns) as f64 };
            (left, ROW * (index / columns) as f64)
        };
        Arrangement {
            corners: (0..count).map(corner).collect(),
            room: width - before,
            width: (if rows <= 1 { total } else { widest * columns as f64 } - GAPS.1).max(0.0),
            height: ROW * rows as f64,
        }
    }

    /// Draws the entries with the arrangement's upper left corner at a point.
    pub fn draw(
        &self,
        canvas: &mut Canvas,
        (left, top): (f64, f64),
        arrangement: &Arrangement,
    ) -> Result<(), Fault> {
        for (entry, &(x, y)) in self.entries.iter().zip(&arrangement.corners) {
            let sample = Frame { left: left + x, top: top + y, width: self.sample, height: ROW };
            let dash = if entry.line { entry.stroke.dash } else { &[] };
            canvas.inside(sample, dash, |pen| self.draw_sample(pen, entry))?;
        }
        canvas.over(|pen| {
            for (entry, &(x, y)) in self.entries.iter().zip(&arrangement.corners) {
                let name = self.ruler.shorten(&entry.name, arrangement.room, BODY);
                let at = (left + x + self.sample + GAPS.0, top + y + ROW / 2.0);
                pen.text(at, &name, BODY, INK, Anchor::Start)?;
            }
            Ok(())
        })
    }

    fn draw_sample(&self, pen: &Pen, entry: &Entry) -> Result<(), Fault> {
        let Stroke { colour, marker, .. } = entry.stroke;
        let (centre, middle) = (self.sample / 2.0, ROW / 2.0);
        if entry.band {
            let band = Frame { left: 0.0, top: middle - 6.0, width: self.sample, height: 12.0 };
            pen.rectangle(band, colour, 0.2)?;
        }
        if entry.bar {
            let bar = Frame { left: centre - MARK / 2.0, top: middle - 6.0, width: MARK, height: 12.0 };
            pen.rectangle(bar, colour, 1.0)?;
        }
        if entry.line {
            pen.path(&[(0.0, middle), (self.sample, middle)], colour, 2.0)?;
        }
        if entry.whisker {
            pen.path(&[(centre, middle - 8.0), (centre, middle + 8.0)], colour, 1.3)?;
        }
        if entry.marker {
            pen.marker((centre, middle), marker, colour, 4.0, 1.0)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::{Axis, Panel};
    use super::*;

    fn figure(names: usize) -> Figure {
        let layer = |i: usize| Layer::Line { name: format!("method {}", i % names), points: Vec::new() };
        let layers = (0..2 * names).map(layer).collect();
        let panel = Panel { title: String::new(), x: Axis::linear(""), y: Axis::linear(""), layers };
        Figure { panels: vec![panel], ..Figure::default() }
    }

    #[test]
    fn each_series_has_one_entry_and_no_two_entries_touch() {
        let ruler = Ruler::new().unwrap();
        for names in [1, 5, 8, 23] {
            let strokes = Strokes::new(&figure(names));
            let legend = Legend::new(&figure(names), &strokes, &ruler);
            for width in [10.0, 200.0, 770.0] {
                let arrangement = legend.arrange(width);
                assert_eq!(arrangement.corners.len(), names);
                assert!(arrangement.width <= width || arrangement.corners.iter().all(|corner| corner.0 == 0.0));
                let taken = |entry: &Entry, &(left, top): &(f64, f64)| Frame {
                    left,
                    top,
                    width: LINE + GAPS.0 + ruler.width(&entry.name, BODY),
                    height: ROW,
                };
                let frames: Vec<Frame> = legend
                    .entries
                    .iter()
                    .zip(&arrangement.corners)
                    .map(|(entry, corner)| taken(entry, corner))
                    .collect();
                let clear =
                    |(i, frame): (usize, &Frame)| frames[..i].iter().all(|other| !other.overlaps(*frame));
                assert!(frames.iter().enumerate().all(clear), "{names} names in {width} pixels");
            }
        }
    }
}
