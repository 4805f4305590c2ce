//! The key to the series of a figure, shared by all its panels.

use super::canvas::{Anchor, Fault, Frame, Pen};
use super::model::{Figure, Layer};
use super::style::{INK, Stroke, Strokes};
use super::text::{BODY, Ruler};

/// Length of a line sample.
const SAMPLE: f64 = 30.0;
/// Distance from sample to name, and from name to the next sample.
const GAPS: (f64, f64) = (7.0, 20.0);
/// Height of a row.
const ROW: f64 = 20.0;

/// One series with the kinds of marks it has.
struct Entry {
    name: String,
    stroke: Stroke,
    line: bool,
    band: bool,
    marker: bool,
    bar: bool,
}

/// The entries, in order of the series' appearance.
pub(super) struct Legend(Vec<Entry>);

/// Where entries stand: their upper left corners, from that of the legend, and its height.
pub(super) struct Arrangement {
    corners: Vec<(f64, f64)>,
    pub height: f64,
    pub width: f64,
}

impl Legend {
    pub fn new(figure: &Figure, strokes: &Strokes) -> Self {
        let layers = || figure.panels.iter().flat_map(|panel| &panel.layers);
        let entry = |name: &str| {
            let has = |kind: fn(&Layer) -> bool| layers().any(|layer| layer.name() == Some(name) && kind(layer));
            Entry {
                name: name.to_owned(),
                stroke: strokes.of(name),
                line: has(|layer| matches!(layer, Layer::Line { .. } | Layer::Steps { .. })),
                band: has(|layer| matches!(layer, Layer::Band { .. } | Layer::StepBand { .. })),
                marker: has(|layer| matches!(layer, Layer::Points { .. } | Layer::ErrorBars { .. })),
                bar: has(|layer| matches!(layer, Layer::Bars { .. })),
            }
        };
        Self(strokes.names().map(entry).collect())
    }

    /// One row if it fits the width, otherwise columns of equal width, filled row by row.
    pub fn arrange(&self, width: f64, ruler: &Ruler) -> Arrangement {
        let widths: Vec<f64> =
            self.0.iter().map(|entry| SAMPLE + GAPS.0 + ruler.width(&entry.name, BODY) + GAPS.1).collect();
        let total: f64 = widths.iter().sum();
        let widest = widths.iter().copied().fold(1.0, f64::max);
        let columns = if total - GAPS.1 <= width {
            self.0.len().max(1)
        } else {
            (((width + GAPS.1) / widest).floor() as usize).max(1)
        };
        // As even rows as possible: 4 + 4 rather than 7 + 1.
        let rows = self.0.len().div_ceil(columns);
        let columns = self.0.len().div_ceil(rows.max(1)).max(1);
        let corner = |index: usize| {
            let row = ROW * (index / columns) as f64;
            let before: f64 = widths.iter().take(index).sum();
            (if rows <= 1 { before } else { widest * (index % columns) as f64 }, row)
        };
        Arrangement {
            corners: (0..self.0.len()).map(corner).collect(),
            height: ROW * rows as f64,
            width: (if rows <= 1 { total } else { widest * columns as f64 } - GAPS.1).max(0.0),
        }
    }

    /// Draws the entries with the arrangement's upper left corner at a point.
    pub fn draw(
        &self,
        canvas: &mut super::canvas::Canvas,
        (left, top): (f64, f64),
        room: f64,
        arrangement: &Arrangement,
        ruler: &Ruler,
    ) -> Result<(), Fault> {
        for (entry, &(x, y)) in self.0.iter().zip(&arrangement.corners) {
            let (x, y) = (left + x, top + y);
            let sample = Frame { left: x, top: y, width: SAMPLE, height: ROW };
            let colour = entry.stroke.colour;
            let dash = if entry.line { entry.stroke.dash } else { &[] };
            canvas.inside(sample, dash, |pen: &Pen| {
                let middle = ROW / 2.0;
                if entry.band {
                    let band = Frame { left: 0.0, top: middle - 6.0, width: SAMPLE, height: 12.0 };
                    pen.rectangle(band, colour, 0.2)?;
                }
                if entry.bar {
                    let bar = Frame { left: SAMPLE - 14.0, top: middle - 6.0, width: 14.0, height: 12.0 };
                    pen.rectangle(bar, colour, 1.0)?;
                }
                if entry.line {
                    pen.path(&[(0.0, middle), (SAMPLE, middle)], colour, 2.0)?;
                }
                if entry.marker {
                    pen.marker((SAMPLE / 2.0, middle), entry.stroke.marker, colour, 4.0)?;
                }
                Ok(())
            })?;
            let name = ruler.shorten(&entry.name, (room - SAMPLE - GAPS.0).max(0.0), BODY);
            canvas.over(|pen| pen.text((x + SAMPLE + GAPS.0, y + ROW / 2.0), &name, BODY, INK, Anchor::Start))?;
        }
        Ok(())
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
