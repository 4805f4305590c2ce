//! Lays a heat map out, a table of coloured cells with its names and its key.

use plotters::prelude::DrawingBackend;
use plotters::style::RGBColor;

use super::canvas::{Align, Fault, Frame, Layout, Picture, Sheet};
use super::figure::{BORDER, Head, WIDTH};
use super::legend::Legend;
use super::model::{FigureError, HeatMap};
use super::style::{GREY, INK, WHITE};
use super::text::{Fonts, SMALL, Type};

/// Height of a row of cells.
const ROW: f64 = 20.0;
/// Cells are not wider than this.
const CELL: f64 = 110.0;
/// Longest row or column name in pixels.
const LONGEST: f64 = 190.0;
/// Font sizes of row names and of the texts in cells.
const NAME_SIZES: [f64; 2] = [12.0, 10.0];
const CELL_SIZES: [f64; 3] = [10.0, 9.0, 8.0];
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
    key: Legend,
    left: f64,
    top: f64,
    cell: f64,
    row: f64,
    columns: Vec<String>,
    /// The column names read upwards.
    upright: bool,
    /// The names of rows and the texts in cells, in lines, with their types.
    rows: Vec<(Vec<String>, Type)>,
    texts: Vec<(Vec<String>, Type)>,
}

impl Picture for HeatMap {
    fn title(&self) -> &str {
        &self.title
    }

    fn lay_out<'a>(&'a self, fonts: &'a Fonts) -> Result<impl Layout + 'a, FigureError> {
        let rows = self.rows.len();
        let columns = self.columns.len();
        let cells = self.cells.len();
        if rows.checked_mul(columns) != Some(cells) {
            return Err(FigureError::CellCount { title: self.title.clone(), rows, columns, cells });
        }
        let head = Head::new(&self.title, &self.caption, fonts);
        let classes = self
            .classes
            .iter()
            .cloned()
            .zip((0..).map(|class| colour_of(Some(class))));
        let key = Legend::of_areas(classes, WIDTH - 2.0 * BORDER, fonts);
        let columns: Vec<String> = self
            .columns
            .iter()
            .map(|name| fonts.shorten(name, LONGEST, SMALL))
            .collect();
        let rows: Vec<_> = self
            .rows
            .iter()
            .map(|name| fonts.fit(name, LONGEST, &NAME_SIZES))
            .collect();
        let beside = rows
            .iter()
            .map(|(lines, kind)| fonts.widest(lines, *kind));
        let left = BORDER
            + beside
                .fold(fonts.width(&self.row_label, SMALL), f64::max)
                .ceil()
            + 8.0;
        let cell = ((WIDTH - left - BORDER) / columns.len().max(1) as f64).clamp(2.0, CELL);
        let widest = fonts.widest(&columns, SMALL);
        let upright = widest + 6.0 > cell;
        let above = if upright { widest + 8.0 } else { SMALL.line() + 4.0 };
        let top = head.bottom + key.height() + 10.0 + above;
        let texts: Vec<_> = self
            .cells
            .iter()
            .map(|each| fonts.fit(&each.text, cell - 2.0, &CELL_SIZES))
            .collect();
        let height = |(lines, kind): &(Vec<String>, Type)| kind.line() * lines.len() as f64;
        let row = rows
            .iter()
            .chain(&texts)
            .map(height)
            .fold(ROW, f64::max);
        Ok(Table { map: self, head, key, left, top, cell, row, columns, upright, rows, texts })
    }
}

impl Layout for Table<'_> {
    fn size(&self) -> (f64, f64) {
        (WIDTH, self.top + self.row * self.rows.len() as f64 + BORDER)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<B>) -> Result<(), Fault<B>> {
        self.head.draw(sheet)?;
        self.key.draw(sheet, (BORDER, self.head.bottom))?;
        let above = self.top - 4.0 - SMALL.line() / 2.0;
        sheet.text((self.left - 6.0, above), &self.map.row_label, SMALL, GREY, Align::Right)?;
        let align = if self.upright { Align::Up } else { Align::Center };
        for (index, name) in self.columns.iter().enumerate() {
            let x = self.left + self.cell * (index as f64 + 0.5);
            sheet.text(
                (x, if self.upright { self.top - 5.0 } else { above }),
                name,
                SMALL,
                INK,
                align,
            )?;
        }
        for (index, (lines, kind)) in self.rows.iter().enumerate() {
            let first =
                self.top + self.row * (index as f64 + 0.5) - kind.line() * lines.len() as f64 / 2.0;
            sheet.lines((self.left - 6.0, first), lines, *kind, INK, Align::Right)?;
        }
        for (index, (cell, (lines, kind))) in self.map.cells.iter().zip(&self.texts).enumerate() {
            let row = index / self.columns.len();
            let column = index % self.columns.len();
            let left = self.left + self.cell * column as f64;
            let top = self.top + self.row * row as f64;
            let colour = colour_of(
                cell.class
                    .filter(|&class| class < self.map.classes.len()),
            );
            let inner = Frame {
                left: left + 0.5,
                top: top + 0.5,
                width: self.cell - 1.0,
                height: self.row - 1.0,
            };
            sheet.rectangle(inner, colour)?;
            let first = top + (self.row - kind.line() * lines.len() as f64) / 2.0;
            let middle = left + self.cell / 2.0;
            sheet.lines((middle, first), lines, *kind, readable_on(colour), Align::Center)?;
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
            let one = luminance(colour) + 0.05;
            let other = luminance(readable_on(colour)) + 0.05;
            assert!(one.max(other) / one.min(other) >= 4.0, "{colour:?}");
        }
    }
}
