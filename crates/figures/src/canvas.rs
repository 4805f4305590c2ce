//! A sheet for drawing in pixels, y downwards, and the SVG document made from it.

use super::text::{FAMILY, Type};
use svg::Node as _;
use svg::node::element::{Path, Rectangle, SVG, Text, Title};

/// A colour as SVG writes it.
pub(super) type Colour = &'static str;

/// The colour of the background.
pub(super) const WHITE: Colour = "#FFFFFF";

/// A place in pixels.
pub(super) type Point = (f64, f64);

/// The position of a text relative to its point; always centred across the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Center,
    Right,
    /// Upwards, with the point in its middle.
    Up,
}

/// A rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// Lengths of a dash and of the gap after it; `None` for a solid line.
pub(super) type Dash = Option<(f64, f64)>;

/// An SVG document that is being drawn.
pub(super) struct Sheet(SVG);

/// Rounds to tenths of a pixel, which no eye distinguishes.
fn rounded(pixels: f64) -> f64 {
    // A sum with 0 is never −0.
    (10.0 * pixels).round().clamp(-1e8, 1e8) / 10.0 + 0.0
}

/// Returns the path through these points.
fn path(points: &[Point]) -> String {
    let places: Vec<String> =
        points.iter().map(|&(x, y)| format!("{} {}", rounded(x), rounded(y))).collect();
    format!("M{}", places.join("L"))
}

/// Removes control characters, which XML does not allow even escaped.
fn printable(text: &str) -> String {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    text.chars().map(|c| if legal(c) { c } else { ' ' }).collect()
}

impl Sheet {
    /// Draws a line of text.
    pub fn text(&mut self, at: Point, text: &str, style: Type, colour: Colour, align: Align) {
        if text.is_empty() {
            return;
        }
        let (x, y) = (rounded(at.0), rounded(at.1));
        let anchor = match align {
            Align::Left => "start",
            Align::Center | Align::Up => "middle",
            Align::Right => "end",
        };
        let mut element = Text::new(printable(text))
            .set("x", x)
            .set("y", y)
            .set("dy", "0.35em")
            .set("font-size", style.size)
            .set("text-anchor", anchor)
            .set("fill", colour);
        if style.bold {
            element.assign("font-weight", "bold");
        }
        if align == Align::Up {
            element.assign("transform", format!("rotate(-90 {x} {y})"));
        }
        self.0.append(element);
    }

    /// Draws lines of text, the first just below `top`.
    pub fn lines(
        &mut self,
        (x, top): Point,
        lines: &[String],
        style: Type,
        colour: Colour,
        align: Align,
    ) {
        for (line, index) in lines.iter().zip(0..) {
            let middle = top + style.line() * (f64::from(index) + 0.5);
            self.text((x, middle), line, style, colour, align);
        }
    }

    /// Fills a polygon.
    pub fn polygon(&mut self, corners: &[Point], colour: Colour, opacity: f64) {
        let area = Path::new().set("d", path(corners) + "Z").set("fill", colour);
        self.0.append(if opacity < 1.0 { area.set("opacity", opacity) } else { area });
    }

    /// Fills a polygon over its edge, of which the outer half is seen.
    pub fn marker(&mut self, corners: &[Point], fill: Colour, edge: Colour, width: f64) {
        let closed = [corners, &corners[..2]].concat();
        self.line(&closed, edge, width, None);
        self.polygon(corners, fill, 1.0);
    }

    /// Fills a rectangle.
    pub fn rectangle(&mut self, frame: Frame, colour: Colour, opacity: f64) {
        let Frame { left, top, width, height } = frame;
        let (right, bottom) = (left + width, top + height);
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        self.polygon(&corners, colour, opacity);
    }

    /// Draws a line through these points.
    pub fn line(&mut self, points: &[Point], colour: Colour, width: f64, dash: Dash) {
        let mut line = Path::new()
            .set("d", path(points))
            .set("fill", "none")
            .set("stroke", colour)
            .set("stroke-width", width);
        if let Some((on, off)) = dash {
            line.assign("stroke-dasharray", format!("{on} {off}"));
        }
        self.0.append(line);
    }
}

/// Makes an SVG document of this size. Screen readers read the title.
pub(super) fn svg(title: &str, size: (f64, f64), draw: impl FnOnce(&mut Sheet)) -> String {
    let (width, height) = (size.0.ceil(), size.1.ceil());
    let ground = Rectangle::new().set("width", width).set("height", height).set("fill", WHITE);
    let root = SVG::new()
        .set("width", width)
        .set("height", height)
        .set("viewBox", (0.0, 0.0, width, height))
        .set("role", "img")
        .set("font-family", FAMILY)
        .set("stroke-linejoin", "round");
    let mut sheet = Sheet(root.add(Title::new(printable(title))).add(ground));
    draw(&mut sheet);
    format!("{}\n", sheet.0)
}
