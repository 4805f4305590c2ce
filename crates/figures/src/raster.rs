//! Draws pictures into pixels: plotters' shapes at twice the resolution of the result, averaged, as a PNG.

use std::convert::Infallible;

use plotters::prelude::{DrawingBackend, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontStyle,
    FontTransform,
};

use super::canvas::{FONT_SIZE, Layout as _, Picture, STEPS, Sheet, steps};
use super::model::FigureError;
use super::text::{Fonts, Type};

/// Pixels of a PNG per pixel of the SVG, each way.
pub const PNG_SCALE: u32 = 2;
/// Pixels in the largest PNG.
const LARGEST: u64 = 40_000_000;
/// Steps per pixel of the result, each way.
const SAMPLES: usize = STEPS as usize / PNG_SCALE as usize;
/// Pixels that are compared with white at once.
const RUN: usize = 16;

/// A picture in RGB, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Pixels {
    /// Pixels per row.
    width: usize,
    /// Number of rows.
    height: usize,
    /// `width * height` colours.
    colours: Vec<[u8; 3]>,
}

/// plotters' backend for an image in memory.
struct Raster<'a> {
    width: i32,
    height: i32,
    colours: &'a mut [[u8; 3]],
    fonts: &'a Fonts,
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

impl Raster<'_> {
    fn blend(&mut self, x: i32, y: i32, colour: BackendColor) {
        if (0..self.width).contains(&x) && (0..self.height).contains(&y) {
            let pixel = &mut self.colours[y as usize * self.width as usize + x as usize];
            let (red, green, blue) = colour.rgb;
            if colour.alpha >= 1.0 {
                *pixel = [red, green, blue];
                return;
            }
            for (old, new) in pixel.iter_mut().zip([red, green, blue]) {
                let old_part = f64::from(*old);
                *old =
                    (old_part + (f64::from(new) - old_part) * colour.alpha.max(0.0)).round() as u8;
            }
        }
    }
}

impl DrawingBackend for Raster<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.width as u32, self.height as u32)
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Drawn {
        self.blend(x, y, colour);
        Ok(())
    }

    /// A rectangle for every segment, which at inner points reaches as far beyond as to fill the joint; plotters' own
    /// outline of a thick line is ragged where dashes turn.
    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        let points: Vec<(f64, f64)> = path
            .into_iter()
            .map(|(x, y)| (f64::from(x), f64::from(y)))
            .collect();
        let half = f64::from(style.stroke_width()) / 2.0;
        let joint = |index: usize| if index > 0 && index + 1 < points.len() { 1.0 } else { 0.0 };
        for (index, ends) in points.windows(2).enumerate() {
            let [(x0, y0), (x1, y1)] = [ends[0], ends[1]];
            let length = ((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
                .sqrt()
                .max(1e-9);
            let dx = (x1 - x0) / length * half;
            let dy = (y1 - y0) / length * half;
            let before = joint(index);
            let after = joint(index + 1);
            let corner = |x: f64, y: f64, part: f64, side: f64| {
                (
                    (x + dx * part - dy * side).round() as i32,
                    (y + dy * part + dx * side).round() as i32,
                )
            };
            let corners = [
                corner(x0, y0, -before, 1.0),
                corner(x1, y1, after, 1.0),
                corner(x1, y1, after, -1.0),
                corner(x0, y0, -before, -1.0),
            ];
            self.fill_polygon(corners, &style.color())?;
        }
        Ok(())
    }

    /// Places the baseline where plotters' SVG backend does.
    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Drawn {
        /// Height of lower-case letters in DejaVu Sans, in font sizes.
        const LOWER_CASE: f64 = 0.547;
        let bold = matches!(style.style(), FontStyle::Bold);
        let kind = Type { size: style.size() / FONT_SIZE, bold };
        let width = self.fonts.width(text, kind);
        let start = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -width / 2.0,
            HPos::Right => -width,
        };
        let baseline = match style.anchor().v_pos {
            VPos::Top => 0.76 * kind.size,
            VPos::Center => 0.5 * LOWER_CASE * kind.size,
            VPos::Bottom => -0.5 * LOWER_CASE * kind.size,
        };
        let colour = style.color();
        let turned = matches!(style.transform(), FontTransform::Rotate270);
        self.fonts
            .rasterise(text, kind, (start, baseline), |right, down, coverage| {
                let (right, down) = if turned { (down, -1 - right) } else { (right, down) };
                self.blend(x + right, y + down, colour.mix(coverage));
            });
        Ok(())
    }
}

/// Draws a picture into pixels, [`PNG_SCALE`] of them per pixel of its SVG.
///
/// # Errors
/// [`FigureError::TooLarge`] above forty million pixels; otherwise as [`super::svg`].
fn pixels(picture: &impl Picture) -> Result<Pixels, FigureError> {
    let fonts = Fonts::new()?;
    let layout = picture.lay_out(&fonts)?;
    let (width, height) = layout.size();
    let across = steps(width.ceil()) as usize;
    let down = steps(height.ceil()) as usize;
    let width = across / SAMPLES;
    let height = down / SAMPLES;
    if width as u64 * height as u64 > LARGEST {
        return Err(FigureError::TooLarge { width, height });
    }
    let mut white = vec![255; across * down * 3];
    let (fine, _) = white.as_chunks_mut();
    let raster = Raster { width: across as i32, height: down as i32, colours: fine, fonts: &fonts };
    layout
        .draw(&Sheet(raster.into_drawing_area()))
        .map_err(|fault| FigureError::Draw {
            title: picture.title().to_owned(),
            reason: fault.to_string(),
        })?;
    // By how much the samples of each pixel are darker than white, which most of a figure is: runs of it are only compared.
    let mut dark = vec![[0; 3]; width * height];
    let blank = [255; RUN * SAMPLES * 3];
    for (y, row) in fine
        .chunks(across)
        .take(height * SAMPLES)
        .enumerate()
    {
        let pixels = dark[y / SAMPLES * width..][..width].chunks_mut(RUN);
        for (pixels, samples) in pixels.zip(row.chunks(RUN * SAMPLES)) {
            if samples.as_flattened() == &blank[..samples.len() * 3] {
                continue;
            }
            for (pixel, samples) in pixels.iter_mut().zip(samples.chunks(SAMPLES)) {
                for &[red, green, blue] in samples {
                    pixel[0] += usize::from(255 - red);
                    pixel[1] += usize::from(255 - green);
                    pixel[2] += usize::from(255 - blue);
                }
            }
        }
    }
    let mean = |dark: usize| ((255 * SAMPLES * SAMPLES - dark) / (SAMPLES * SAMPLES)) as u8;
    let colours = dark
        .into_iter()
        .map(|[red, green, blue]| [mean(red), mean(green), mean(blue)])
        .collect();
    Ok(Pixels { width, height, colours })
}

/// Draws a picture as a PNG, [`PNG_SCALE`] times as large as its SVG.
///
/// # Errors
/// [`FigureError::Png`] if encoding fails; otherwise as `pixels`.
pub fn png(picture: &impl Picture) -> Result<Vec<u8>, FigureError> {
    let Pixels { width, height, colours } = pixels(picture)?;
    let failed = |error: png::EncodingError| FigureError::Png { reason: error.to_string() };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer
        .write_image_data(colours.as_flattened())
        .map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::{Figure, Panel, svg};
    use super::*;

    fn figure(title: &str, panels: usize) -> Figure {
        Figure {
            title: title.to_owned(),
            panels: vec![Panel::default(); panels],
            ..Figure::default()
        }
    }

    #[test]
    fn the_png_is_twice_as_large_as_the_svg_up_to_a_limit() {
        let picture = figure("title", 1);
        let decoded = png::Decoder::new(std::io::Cursor::new(png(&picture).unwrap()))
            .read_info()
            .unwrap();
        let width = decoded.info().width / PNG_SCALE;
        let height = decoded.info().height / PNG_SCALE;
        assert!(
            svg(&picture)
                .unwrap()
                .contains(&format!("width=\"{width}\" height=\"{height}\""))
        );
        assert!(matches!(png(&figure("", 100)), Err(FigureError::TooLarge { width: 1600, .. })));
    }

    #[test]
    fn text_is_drawn_with_the_embedded_font() {
        let dark = |title: &str| {
            let picture = pixels(&figure(title, 0)).unwrap();
            picture
                .colours
                .iter()
                .filter(|colour| colour[0] < 100)
                .count()
        };
        // Fourteen letters of 17 pixels: some hundred dark pixels each at twice the size.
        assert!(dark("Error and time") > 14 * 40, "{} dark pixels", dark("Error and time"));
        // A missing glyph would be a box like any other missing one.
        assert_ne!(dark("10⁻³ × α"), dark("10⁻² × α"));
    }
}
