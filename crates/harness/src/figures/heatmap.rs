//! Lays a heat map out, a table of coloured cells with its names and its key, and the colour bar below an image.

use plotters::prelude::DrawingBackend;
use plotters::style::RGBColor;

use super::canvas::{Align, Fault, Frame, Layout, Picture, Sheet};
use super::figure::{BORDER, Head, WIDTH};
use super::model::{Cell, ColourBar, FigureError, HeatMap};
use super::raster::PNG_SCALE;
use super::style::{GREY, INK, WHITE};
use super::text::{BODY, Fonts, SMALL, Type};

/// Height of a row of cells.
const ROW: f64 = 20.0;
/// Cells are not wider than this.
const CELL: f64 = 110.0;
/// Longest row or column name in pixels.
const LONGEST: f64 = 190.0;
/// Long row names.
const SMALLER: Type = Type { size: 10.0, bold: false };
/// Width of a class's sample in the key.
const SAMPLE: f64 = 18.0;
/// Cells without a class.
const BLANK: RGBColor = RGBColor(232, 232, 232);
/// From good to bad: pale where nothing is to be seen, darker the worse.
const CLASSES: [RGBColor; 5] = [
    RGBColor(198, 219, 239),
    RGBColor(254, 227, 145),
    RGBColor(254, 153, 41),
    RGBColor(204, 76, 2),
    RGBColor(102, 37, 6),
];

/// A class's colour; there are as many as [`CLASSES`], and further classes share the last.
fn colour_of(class: Option<usize>) -> RGBColor {
    class.map_or(BLANK, |class| CLASSES[class.min(CLASSES.len() - 1)])
}

/// White on dark colours, otherwise black.
fn readable_on(RGBColor(red, green, blue): RGBColor) -> RGBColor {
    let luma = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
    if luma < 110.0 { WHITE } else { RGBColor(0, 0, 0) }
}

/// A heat map with a place for everything.
struct Table<'a> {
    map: &'a HeatMap,
    head: Head,
    /// Left edges and rows of the key's entries.
    key: Vec<(f64, f64)>,
    left: f64,
    top: f64,
    cell: f64,
    row: f64,
    /// The rows' names in lines, and their types.
    rows: Vec<(Vec<String>, Type)>,
    columns: Vec<String>,
    /// The column names read upwards.
    upright: bool,
    /// The cells' texts in lines, and their type.
    texts: Vec<Vec<String>>,
    text_type: Type,
}

impl Picture for HeatMap {
    fn title(&self) -> &str {
        &self.title
    }

    fn lay_out<'a>(&'a self, fonts: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        let (rows, columns, cells) = (self.rows.len(), self.columns.len(), self.cells.len());
        if rows.checked_mul(columns) != Some(cells) {
            return Err(FigureError::CellCount { title: self.title.clone(), rows, columns, cells });
        }
        let head = Head::new(&self.title, &self.caption, fonts);
        let mut key: Vec<(f64, f64)> = Vec::new();
        let (mut x, mut y) = (BORDER, head.bottom);
        for name in &self.classes {
            let needed = SAMPLE + 6.0 + fonts.width(name, BODY);
            if x > BORDER && x + needed > WIDTH - BORDER {
                (x, y) = (BORDER, y + ROW);
            }
            key.push((x, y));
            x += needed + 20.0;
        }
        let short = |name: &String| fonts.shorten(name, LONGEST, SMALL);
        // A long name stands in two smaller lines.
        let in_lines = |name: &String| match fonts.width(name, SMALL) <= LONGEST {
            true => (vec![name.clone()], SMALL),
            false => (fonts.wrap(name, LONGEST, SMALLER).into_iter().take(2).collect(), SMALLER),
        };
        let rows: Vec<(Vec<String>, Type)> = self.rows.iter().map(in_lines).collect();
        let beside = rows.iter().map(|(lines, kind)| fonts.widest(lines, *kind)).fold(0.0, f64::max);
        let columns: Vec<String> = self.columns.iter().map(short).collect();
        let left = (BORDER + beside.max(fonts.width(&self.row_label, SMALL)) + 8.0).ceil();
        let cell = ((WIDTH - left - BORDER) / columns.len().max(1) as f64).clamp(2.0, CELL);
        let widest = fonts.widest(&columns, SMALL);
        let upright = widest + 6.0 > cell;
        let top = y + ROW + 10.0 + if upright { widest + 8.0 } else { SMALL.line() + 4.0 };

        // The largest type in which every text fits its cell in two lines; the smallest is cut if it does not.
        let lines = |cell: f64, text_type: Type, text: &str| {
            if fonts.width(text, text_type) <= cell - 2.0 {
                vec![text.to_owned()]
            } else if text.split_whitespace().all(|word| fonts.width(word, text_type) <= cell - 2.0) {
                fonts.wrap(text, cell - 2.0, text_type)
            } else {
                vec![fonts.shorten(text, cell - 2.0, text_type)]
            }
        };
        let fits = |text_type: Type| {
            let fit = |lines: Vec<String>, text: &str| lines.len() <= 2 && lines.join(" ") == text;
            self.cells.iter().all(|Cell { text, .. }| fit(lines(cell, text_type, text), text))
        };
        let sizes = [12.0, 11.0, 10.0, 9.0].map(|size| Type { size, bold: false });
        let text_type = sizes.into_iter().find(|&text_type| fits(text_type)).unwrap_or(sizes[3]);
        let texts: Vec<Vec<String>> = self
            .cells
            .iter()
            .map(|Cell { text, .. }| lines(cell, text_type, text).into_iter().take(2).collect())
            .collect();
        let two_lines = rows.iter().map(|(lines, _)| lines).chain(&texts).any(|lines| lines.len() > 1);
        let row = if two_lines { 2.0 * SMALLER.line() } else { ROW };
        Ok(Table { map: self, head, key, left, top, cell, row, rows, columns, upright, texts, text_type })
    }
}

impl Layout for Table<'_> {
    fn size(&self) -> (f64, f64) {
        (WIDTH, self.top + self.row * self.rows.len() as f64 + BORDER)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        let classes = &self.map.classes;
        self.head.draw(sheet)?;
        for ((class, name), &(left, top)) in classes.iter().enumerate().zip(&self.key) {
            let sample = Frame { left, top: top + 3.0, width: SAMPLE, height: ROW - 6.0 };
            sheet.rectangle(sample, colour_of(Some(class)))?;
            sheet.text((left + SAMPLE + 6.0, top + ROW / 2.0), name, BODY, INK, Align::Left)?;
        }
        let above = self.top - 4.0 - SMALL.line() / 2.0;
        sheet.text((self.left - 6.0, above), &self.map.row_label, SMALL, GREY, Align::Right)?;
        let align = if self.upright { Align::Up } else { Align::Center };
        for (index, name) in self.columns.iter().enumerate() {
            let x = self.left + self.cell * (index as f64 + 0.5);
            sheet.text((x, if self.upright { self.top - 5.0 } else { above }), name, SMALL, INK, align)?;
        }
        for (index, (lines, kind)) in self.rows.iter().enumerate() {
            let first = self.top + self.row * (index as f64 + 0.5) - kind.line() * lines.len() as f64 / 2.0;
            sheet.lines((self.left - 6.0, first), lines, *kind, INK, Align::Right)?;
        }
        for (index, (cell, lines)) in self.map.cells.iter().zip(&self.texts).enumerate() {
            let (row, column) = (index / self.columns.len(), index % self.columns.len());
            let (left, top) = (self.left + self.cell * column as f64, self.top + self.row * row as f64);
            let colour = colour_of(cell.class.filter(|&class| class < classes.len()));
            let inner =
                Frame { left: left + 0.5, top: top + 0.5, width: self.cell - 1.0, height: self.row - 1.0 };
            sheet.rectangle(inner, colour)?;
            let first = top + (self.row - self.text_type.line() * lines.len() as f64) / 2.0;
            let middle = left + self.cell / 2.0;
            sheet.lines((middle, first), lines, self.text_type, readable_on(colour), Align::Center)?;
        }
        Ok(())
    }
}

impl Picture for ColourBar {
    fn title(&self) -> &str {
        &self.labels[1]
    }

    fn lay_out<'a>(&'a self, _: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        Ok(self)
    }
}

impl Layout for &ColourBar {
    /// As wide in a PNG as the image.
    fn size(&self) -> (f64, f64) {
        (f64::from(self.width.div_ceil(PNG_SCALE)), 25.0)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        let (width, small) = (self.size().0 - 16.0, Type { size: 7.0, bold: false });
        let piece = width / self.colours.len() as f64;
        for (&[red, green, blue], part) in self.colours.iter().zip(0..) {
            let frame = Frame { left: 8.0 + piece * f64::from(part), top: 5.0, width: piece, height: 6.0 };
            sheet.rectangle(frame, RGBColor(red, green, blue))?;
        }
        for ((at, align), label) in
            [(0.0, Align::Left), (0.5, Align::Center), (1.0, Align::Right)].iter().zip(&self.labels)
        {
            sheet.text((8.0 + width * at, 18.0), label, small, INK, *align)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_can_be_read_on_every_colour() {
        // Relative luminance and contrast as in WCAG 2.
        let luminance = |RGBColor(red, green, blue): RGBColor| {
            let linear = |part: u8| {
                let part = f64::from(part) / 255.0;
                if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
        };
        for class in (0..CLASSES.len()).map(Some).chain([None]) {
            let colour = colour_of(class);
            let (one, other) = (luminance(colour) + 0.05, luminance(readable_on(colour)) + 0.05);
            assert!(one.max(other) / one.min(other) >= 4.0, "{colour:?}");
        }
    }
}
