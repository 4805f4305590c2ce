//! Turns an SVG into a PNG with the embedded fonts only.

use std::sync::Arc;

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use super::model::ChartError;
use super::text::{BOLD, REGULAR};

/// Pixels of the PNG per pixel of the SVG, each way.
pub const PNG_SCALE: u32 = 2;
/// Pixels in the largest PNG.
const LARGEST: u64 = 100_000_000;

/// Rasterises an SVG at twice its size. Every text is set in DejaVu Sans, whatever fonts the machine
/// has; characters outside Latin, Greek and mathematics show as empty boxes.
///
/// # Errors
/// [`ChartError::Svg`] if it is none, [`ChartError::TooLarge`] above a hundred million pixels,
/// [`ChartError::Png`] if encoding fails.
pub fn png(svg: &str) -> Result<Vec<u8>, ChartError> {
    let mut fonts = Database::new();
    fonts.load_font_data(REGULAR.to_vec());
    fonts.load_font_data(BOLD.to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let options =
        Options { font_family: "DejaVu Sans".to_owned(), fontdb: Arc::new(fonts), ..Options::default() };
    let tree = Tree::from_str(svg, &options).map_err(|error| ChartError::Svg { reason: error.to_string() })?;
    let size = tree.size().to_int_size();
    let (width, height) = (size.width().saturating_mul(PNG_SCALE), size.height().saturating_mul(PNG_SCALE));
    let too_large = ChartError::TooLarge { width, height };
    if u64::from(width) * u64::from(height) > LARGEST {
        return Err(too_large);
    }
    let mut pixels = Pixmap::new(width, height).ok_or(too_large)?;
    pixels.fill(Color::WHITE);
    let scale = PNG_SCALE as f32;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| ChartError::Png { reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, Figure, Layer, Panel, svg};
    use super::*;

    fn figure(title: &str) -> Figure {
        let line = Layer::Line { name: String::new(), points: vec![(0.0, 0.0), (1.0, 1.0)] };
        let panel =
            Panel { title: String::new(), x: Axis::linear("x"), y: Axis::linear("y"), layers: vec![line] };
        Figure { title: title.to_owned(), panels: vec![panel], ..Figure::default() }
    }

    fn pixels(svg: &str) -> Pixmap {
        Pixmap::decode_png(&png(svg).unwrap()).unwrap()
    }

    #[test]
    fn the_png_is_twice_as_large_as_the_svg() {
        let picture = svg(&figure("title")).unwrap();
        let tree = Tree::from_str(&picture, &Options::default()).unwrap();
        let size = (tree.size().width() as u32, tree.size().height() as u32);
        let pixels = pixels(&picture);
        assert_eq!((pixels.width(), pixels.height()), (PNG_SCALE * size.0, PNG_SCALE * size.1));
    }

    #[test]
    fn text_is_drawn_with_the_embedded_font() {
        let dark = |title: &str| {
            let picture = pixels(&svg(&figure(title)).unwrap());
            let head = picture.pixels().iter().take(PNG_SCALE as usize * 34 * picture.width() as usize);
            head.filter(|pixel| pixel.red() < 100).count()
        };
        // Fourteen letters of 17 pixels: some hundred dark pixels each at twice the size.
        assert!(dark("Error and time") > 14 * 40, "{} dark pixels", dark("Error and time"));
        // A missing glyph would be a box like any other missing one.
        assert_ne!(dark("10⁻³ × α"), dark("10⁻² × α"));
    }

    #[test]
    fn what_is_no_svg_is_an_error() {
        assert!(matches!(png("no svg"), Err(ChartError::Svg { .. })));
        let huge = r#"<svg xmlns="http://www.w3.org/2000/svg" width="20000" height="20000"/>"#;
        assert!(matches!(png(huge), Err(ChartError::TooLarge { width: 40_000, height: 40_000 })));
    }
}
