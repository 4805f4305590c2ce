//! A sheet for drawing through plotters, and the SVG document made from it.

use std::fmt::Write as _;

use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::element::Rectangle;
use plotters::prelude::{Color, DrawingArea, IntoDrawingArea, RGBColor, SVGBackend, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontDesc, FontFamily, FontStyle, FontTransform, TextStyle};

use super::model::FigureError;
use super::text::{FAMILY, Type};

/// Steps of plotters' integer coordinates per pixel.
pub(super) const STEPS: f64 = 4.0;
/// plotters' SVG backend divides font sizes by this.
pub(super) const FONT_SIZE: f64 = 1.24;

/// An error of plotters.
pub(super) type Fault = DrawingAreaErrorKind<std::io::Error>;

/// The position of a text relative to its point; always centred across the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Center,
    Right,
    /// Upwards, with the point in its middle.
    Up,
}

/// A rectangle in pixels, y downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// A drawing area with coordinates in pixels.
pub(super) struct Sheet<'a>(pub(super) DrawingArea<SVGBackend<'a>, Shift>);

/// Converts pixels to steps. Casting saturates; the limit leaves room for plotters' own additions.
pub(super) fn steps(pixels: f64) -> i32 {
    (pixels * STEPS).clamp(-1e8, 1e8).round() as i32
}

/// Returns the style of a line of this width in pixels.
pub(super) fn pen(colour: RGBColor, width: f64) -> ShapeStyle {
    colour.stroke_width(steps(width) as u32)
}

/// Returns plotters' text style of this type and colour.
pub(super) fn font(style: Type, colour: RGBColor) -> TextStyle<'static> {
    let weight = if style.bold { FontStyle::Bold } else { FontStyle::Normal };
    let font = FontDesc::new(FontFamily::Name(FAMILY), style.size * STEPS * FONT_SIZE, weight);
    TextStyle { color: colour.to_backend_color(), ..TextStyle::from(font) }
}

/// Removes control characters, which XML does not allow even escaped.
pub(super) fn printable(text: &str) -> String {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    text.chars().map(|c| if legal(c) { c } else { ' ' }).collect()
}

impl Sheet<'_> {
    /// Draws a line of text.
    pub(super) fn text(
        &self,
        (x, y): (f64, f64),
        text: &str,
        style: Type,
        colour: RGBColor,
        align: Align,
    ) -> Result<(), Fault> {
        if text.is_empty() {
            return Ok(());
        }
        let (side, turn) = match align {
            Align::Left => (HPos::Left, FontTransform::None),
            Align::Center => (HPos::Center, FontTransform::None),
            Align::Right => (HPos::Right, FontTransform::None),
            Align::Up => (HPos::Center, FontTransform::Rotate270),
        };
        let style = font(style, colour).pos(Pos::new(side, VPos::Center)).transform(turn);
        self.0.draw_text(&printable(text), &style, (steps(x), steps(y)))
    }

    /// Draws lines of text, the first just below `top`.
    pub(super) fn lines(
        &self,
        (x, top): (f64, f64),
        lines: &[String],
        style: Type,
        colour: RGBColor,
        align: Align,
    ) -> Result<(), Fault> {
        let place = |index: usize| (x, top + style.line() * (index as f64 + 0.5));
        lines
            .iter()
            .enumerate()
            .try_for_each(|(index, line)| self.text(place(index), line, style, colour, align))
    }

    /// Fills a rectangle.
    pub(super) fn rectangle(&self, frame: Frame, colour: impl Color) -> Result<(), Fault> {
        let corner = |x: f64, y: f64| (steps(frame.left + x), steps(frame.top + y));
        self.0.draw(&Rectangle::new(
            [corner(0.0, 0.0), corner(frame.width, frame.height)],
            colour.filled(),
        ))
    }
}

/// Makes an SVG document of this size in pixels, with integer coordinates, [`STEPS`] per pixel.
/// Screen readers read the title.
pub(super) fn svg(
    title: &str,
    (width, height): (f64, f64),
    draw: impl FnOnce(&Sheet) -> Result<(), Fault>,
) -> Result<String, FigureError> {
    let across = steps(width.ceil());
    let down = steps(height.ceil());
    let mut body = String::new();
    {
        let area =
            SVGBackend::with_string(&mut body, (across as u32, down as u32)).into_drawing_area();
        let refused =
            |fault: Fault| FigureError::Draw { title: title.to_owned(), reason: fault.to_string() };
        draw(&Sheet(area.clone())).map_err(refused)?;
        area.present().map_err(refused)?;
    }
    let title = printable(title).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let mut document = String::new();
    let _ = write!(
        document,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {across} {down}\" \
         role=\"img\" stroke-linejoin=\"round\">\n<title>{title}</title>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n{}</svg>\n",
        width.ceil(),
        height.ceil(),
        joined(&body),
    );
    Ok(document)
}

/// Joins successive lines of one style, such as the dashes of a line, into one element. The
/// document shrinks to a fifth.
fn joined(svg: &str) -> String {
    let mut joined = String::with_capacity(svg.len());
    let mut open: Option<&str> = None;
    for line in svg.lines() {
        let path = line.strip_prefix("<polyline ").and_then(|rest| rest.split_once(" points=\""));
        if open.is_some() && open != path.map(|(style, _)| style) {
            joined.push_str("\"/>\n");
            open = None;
        }
        match path {
            Some((style, points)) => {
                if open.is_none() {
                    let _ = write!(joined, "<path {style} d=\"");
                    open = Some(style);
                }
                let _ = write!(joined, "M{}", points.trim_end_matches([' ', '"', '/', '>']));
            }
            None => {
                joined.push_str(line);
                joined.push('\n');
            }
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_of_one_style_become_one_path() {
        let line =
            |style: &str, points: &str| format!("<polyline {style} points=\"{points} \"/>\n");
        let svg = format!(
            "<svg>\n{}{}{}</svg>\n",
            line("a", "1,2 3,4"),
            line("a", "5,6 7,8"),
            line("b", "1,1 2,2")
        );
        let paths = "<path a d=\"M1,2 3,4M5,6 7,8\"/>\n<path b d=\"M1,1 2,2\"/>\n";
        assert_eq!(joined(&svg), format!("<svg>\n{paths}</svg>\n"));
    }
}
