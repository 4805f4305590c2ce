//! Lays a heat map out: a table of coloured cells with its names and its key.

use plotters::style::RGBColor;
use plotters::style::colors::colormaps::{ColorMap, DerivedColorMap};

use super::canvas::{Anchor, Canvas, Fault, Frame, Pen};
use super::figure::{BORDER, Head, WIDTH};
use super::model::{Axis, Cell, HeatMap, Key};
use super::scale::{Span, Tick};
use super::style::{GREY, INK, WHITE};
use super::text::{BODY, Ruler, SMALL};

/// Height of a row of cells.
const ROW: f64 = 20.0;
/// Cells are not wider than this unless their texts need it.
const CELL: f64 = 110.0;
/// Width of the figure at most.
const WIDEST: f64 = 2.0 * WIDTH;
/// Longest row or column name in pixels.
const LONGEST: f64 = 220.0;
/// Cells without a colour.
const BLANK: RGBColor = RGBColor(232, 232, 232);
/// From good to bad by way of white; told apart by all kinds of colour vision.
const DIVERGING: [RGBColor; 5] = [
    RGBColor(44, 123, 182),
    RGBColor(171, 217, 233),
    RGBColor(255, 255, 255),
    RGBColor(253, 174, 97),
    RGBColor(215, 48, 39),
];
/// From good to bad: pale where nothing is to be seen, darker the worse.
const CLASSES: [RGBColor; 5] = [
    RGBColor(198, 219, 239),
    RGBColor(254, 227, 145),
    RGBColor(254, 153, 41),
    RGBColor(204, 76, 2),
    RGBColor(102, 37, 6),
];
/// From light to dark.
const SEQUENTIAL: [RGBColor; 4] =
    [RGBColor(247, 251, 255), RGBColor(158, 202, 225), RGBColor(49, 130, 189), RGBColor(8, 48, 107)];

fn ramp(colours: &[RGBColor], at: f64) -> RGBColor {
    DerivedColorMap::new(colours).get_color(at.clamp(0.0, 1.0))
}

/// The key with the range of its colours.
enum Colours<'a> {
    Classes(&'a [String]),
    Numbers { axis: &'a Axis, span: Span, middle: Option<f64> },
}

impl<'a> Colours<'a> {
    fn new(map: &'a HeatMap) -> Self {
        match &map.key {
            Key::Classes(names) => Self::Classes(names),
            Key::Numbers { axis, middle } => {
                let values: Vec<f64> = map.cells.iter().map(|cell| cell.value).chain(*middle).collect();
                let span = Span::new(axis, &values, 0.0);
                let middle = middle.and_then(|value| span.place(value)).filter(|at| (0.0..=1.0).contains(at));
                Self::Numbers { axis, span, middle }
            }
        }
    }

    fn of(&self, value: f64) -> Option<RGBColor> {
        match self {
            Self::Classes(names) => {
                let known = value >= 0.0 && value.fract() == 0.0 && value < names.len() as f64;
                let last = names.len().saturating_sub(1).max(1) as f64;
                known.then(|| ramp(&CLASSES, value / last))
            }
            Self::Numbers { span, middle, .. } => Some(Self::shade(span.place(value)?, *middle)),
        }
    }

    /// The colour at a fraction of the range.
    fn shade(at: f64, middle: Option<f64>) -> RGBColor {
        let at = at.clamp(0.0, 1.0);
        match middle {
            None => ramp(&SEQUENTIAL, at),
            // Both sides have the same scale, so that equal distances look equal.
            Some(middle) => {
                let reach = middle.max(1.0 - middle).max(1e-9);
                ramp(&DIVERGING, 0.5 + (at - middle) / reach / 2.0)
            }
        }
    }
}

/// Relative luminance, 0 to 1, as in WCAG 2.
fn luminance(RGBColor(red, green, blue): RGBColor) -> f64 {
    let linear = |part: u8| {
        let part = f64::from(part) / 255.0;
        if part <= 0.04045 { part / 12.92 } else { libm::pow((part + 0.055) / 1.055, 2.4) }
    };
    0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
}

/// The contrast ratio of WCAG 2, 1 to 21.
fn contrast(one: RGBColor, other: RGBColor) -> f64 {
    let (one, other) = (luminance(one) + 0.05, luminance(other) + 0.05);
    one.max(other) / one.min(other)
}

/// White if it can be read on the colour, otherwise black.
fn readable_on(colour: RGBColor) -> RGBColor {
    if contrast(colour, WHITE) >= 4.0 { WHITE } else { RGBColor(0, 0, 0) }
}

/// Where the table's parts go, in pixels.
struct Table {
    /// Upper left corner of the cells.
    left: f64,
    top: f64,
    /// Width of a cell.
    cell: f64,
    rows: Vec<String>,
    columns: Vec<String>,
    /// Column names stand upright.
    upright: bool,
    /// Space above the cells for the column names, and above those for what they are.
    names: f64,
    label: f64,
}

impl Table {
    /// The table with its cells from y = 0, as wide as the texts in them need, within limits.
    fn new(map: &HeatMap, ruler: &Ruler) -> Self {
        let short = |name: &String| ruler.shorten(name, LONGEST, SMALL);
        let rows: Vec<String> = map.rows.iter().map(short).collect();
        let columns: Vec<String> = map.columns.iter().map(short).collect();
        let row_label = short(&map.row_label);
        let left = BORDER + ruler.widest(rows.iter().chain([&row_label]).map(String::as_str), SMALL) + 8.0;
        let share = |width: f64| (width - left - BORDER) / columns.len().max(1) as f64;
        let needed = ruler.widest(map.cells.iter().map(|cell| cell.text.as_str()), SMALL) + 8.0;
        let cell = needed.max(share(WIDTH).min(CELL)).min(share(WIDEST)).floor().max(2.0);
        let widest = ruler.widest(columns.iter().map(String::as_str), SMALL);
        let upright = widest + 6.0 > cell;
        let names = (if upright { widest + 8.0 } else { SMALL.line() + 4.0 }).ceil();
        let label = if map.column_label.is_empty() { 0.0 } else { BODY.line().ceil() };
        Self { left: left.ceil(), top: 0.0, cell, rows, columns, upright, names, label }
    }

    fn right(&self) -> f64 {
        self.left + self.cell * self.columns.len() as f64
    }

    fn bottom(&self) -> f64 {
        self.top + ROW * self.rows.len() as f64
    }

    fn draw_names(&self, pen: &Pen, map: &HeatMap, ruler: &Ruler) -> Result<(), Fault> {
        let middle = (self.left + self.right()) / 2.0;
        let label = ruler.shorten(&map.column_label, WIDTH - 2.0 * BORDER, BODY);
        pen.text((middle, self.top - self.names - self.label / 2.0), &label, BODY, INK, Anchor::Middle)?;
        let above = self.top - 4.0 - SMALL.line() / 2.0;
        let label = ruler.shorten(&map.row_label, LONGEST, SMALL);
        pen.text((self.left - 6.0, above), &label, SMALL, GREY, Anchor::End)?;
        for (index, name) in self.columns.iter().enumerate() {
            let x = self.left + self.cell * (index as f64 + 0.5);
            let (y, anchor) =
                if self.upright { (self.top - 6.0, Anchor::UpStart) } else { (above, Anchor::Middle) };
            pen.text((x, y), name, SMALL, INK, anchor)?;
        }
        for (index, name) in self.rows.iter().enumerate() {
            let y = self.top + ROW * (index as f64 + 0.5);
            pen.text((self.left - 6.0, y), name, SMALL, INK, Anchor::End)?;
        }
        Ok(())
    }

    fn draw_cells(&self, pen: &Pen, map: &HeatMap, colours: &Colours, ruler: &Ruler) -> Result<(), Fault> {
        for (row, cells) in map.cells.chunks(self.columns.len().max(1)).enumerate() {
            for (column, Cell { value, text }) in cells.iter().enumerate() {
                let (x, y) = (self.left + self.cell * column as f64, self.top + ROW * row as f64);
                let colour = colours.of(*value).unwrap_or(BLANK);
                let inner = Frame { left: x + 0.5, top: y + 0.5, width: self.cell - 1.0, height: ROW - 1.0 };
                pen.rectangle(inner, colour, 1.0)?;
                let middle = (x + self.cell / 2.0, y + ROW / 2.0);
                let text = ruler.shorten(text, self.cell - 4.0, SMALL);
                pen.text(middle, &text, SMALL, readable_on(colour), Anchor::Middle)?;
            }
        }
        Ok(())
    }
}

/// The heat map as an SVG; its cells fill the table.
pub(super) fn draw(map: &HeatMap, ruler: &Ruler) -> Result<String, Fault> {
    let mut table = Table::new(map, ruler);
    let width = (table.right() + BORDER).max(WIDTH);
    let colours = Colours::new(map);
    let head = Head::new(&map.title, &map.caption, width, ruler);
    let key = KeyPlan::new(&colours, width - 2.0 * BORDER, ruler);
    table.top = head.bottom + key.height + table.label + table.names;

    let mut canvas = Canvas::new(&map.title, width, table.bottom() + BORDER);
    canvas.over(|pen| {
        head.draw(pen)?;
        key.draw(pen, (BORDER, head.bottom), &colours, ruler)?;
        table.draw_names(pen, map, ruler)?;
        table.draw_cells(pen, map, &colours, ruler)?;
        if map.cells.is_empty() {
            pen.text((width / 2.0, table.top - 4.0), "no data", BODY, GREY, Anchor::Middle)?;
        }
        Ok(())
    })?;
    Ok(canvas.finish())
}

/// Where the parts of the key go.
struct KeyPlan {
    /// Left edges of the classes' samples and their rows; empty for numbers.
    samples: Vec<(f64, f64)>,
    height: f64,
}

impl KeyPlan {
    /// Width of a class's sample, and of the bar of numbers.
    const SAMPLE: f64 = 18.0;
    const BAR: f64 = 260.0;

    fn new(colours: &Colours, width: f64, ruler: &Ruler) -> Self {
        let Colours::Classes(names) = colours else {
            return Self { samples: Vec::new(), height: 48.0 };
        };
        let (mut x, mut y) = (0.0, 0.0);
        let mut samples = Vec::new();
        for name in *names {
            let needed = Self::SAMPLE + 6.0 + ruler.width(name, BODY);
            if x > 0.0 && x + needed > width {
                (x, y) = (0.0, y + ROW);
            }
            samples.push((x, y));
            x += needed + 20.0;
        }
        Self { samples, height: y + ROW + 10.0 }
    }

    fn draw(&self, pen: &Pen, (left, top): (f64, f64), colours: &Colours, ruler: &Ruler) -> Result<(), Fault> {
        match colours {
            Colours::Classes(names) => {
                for ((index, name), &(x, y)) in names.iter().enumerate().zip(&self.samples) {
                    let sample =
                        Frame { left: left + x, top: top + y + 3.0, width: Self::SAMPLE, height: ROW - 6.0 };
                    pen.rectangle(sample, colours.of(index as f64).unwrap_or(BLANK), 1.0)?;
                    let at = (left + x + Self::SAMPLE + 6.0, top + y + ROW / 2.0);
                    pen.text(at, name, BODY, INK, Anchor::Start)?;
                }
            }
            Colours::Numbers { axis, span, middle } => {
                let fit = |ticks: &[Tick]| {
                    let width: f64 = ticks.iter().map(|tick| ruler.width(&tick.label, SMALL) + 10.0).sum();
                    width <= Self::BAR
                };
                let ticks = span.ticks(7, fit);
                let label = format!("{} {}", axis.label, ticks.factor);
                let label = ruler.shorten(label.trim(), 400.0, BODY);
                let bar = left + if label.is_empty() { 0.0 } else { (ruler.width(&label, BODY) + 20.0).ceil() };
                pen.text((left, top + 8.0), &label, BODY, INK, Anchor::Start)?;
                let parts = 130.0;
                for part in 0..parts as i32 {
                    let at = f64::from(part) / parts;
                    // Parts overlap, lest white shows between them.
                    let width = (Self::BAR / parts + 0.5).min(Self::BAR * (1.0 - at));
                    let piece = Frame { left: bar + at * Self::BAR, top: top + 1.0, width, height: 14.0 };
                    pen.rectangle(piece, Colours::shade(at + 0.5 / parts, *middle), 1.0)?;
                }
                for tick in &ticks.major {
                    let x = bar + tick.at * Self::BAR;
                    pen.path(&[(x, top + 15.0), (x, top + 19.0)], INK, 1.0)?;
                    pen.text((x, top + 21.0 + SMALL.size / 2.0), &tick.label, SMALL, INK, Anchor::Middle)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_have_different_colours_and_unknown_ones_none() {
        for count in 1..=9_usize {
            let names = vec![String::new(); count];
            let colours = Colours::Classes(&names);
            let shades: Vec<RGBColor> = (0..count).filter_map(|class| colours.of(class as f64)).collect();
            assert_eq!(shades.len(), count);
            assert!(shades.iter().enumerate().all(|(i, shade)| !shades[..i].contains(shade)), "{shades:?}");
            for unknown in [f64::NAN, -1.0, 0.5, count as f64] {
                assert_eq!(colours.of(unknown), None);
            }
        }
    }

    #[test]
    fn the_middle_of_a_diverging_key_is_white() {
        assert_eq!(Colours::shade(0.2, Some(0.2)), DIVERGING[2]);
        assert_eq!(Colours::shade(1.0, Some(0.2)), DIVERGING[4]);
        assert_ne!(Colours::shade(0.0, Some(0.2)), DIVERGING[0]);
    }

    #[test]
    fn text_can_be_read_on_every_colour() {
        for step in 0..=100 {
            let at = f64::from(step) / 100.0;
            for colour in [ramp(&CLASSES, at), ramp(&SEQUENTIAL, at), ramp(&DIVERGING, at)] {
                assert!(contrast(colour, readable_on(colour)) >= 4.0, "{colour:?}");
            }
        }
    }
}
