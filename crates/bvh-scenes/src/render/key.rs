//! Draws the key of a heat map: a strip of colours with labels below both ends and the middle.

use ab_glyph::{Font, FontRef, PxScale, point};

/// DejaVu Sans, reduced to the characters of the key.
const FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-key.ttf");
/// The height of the key in pixels.
const HEIGHT: usize = 50;
/// The number of free pixels on either side of the strip.
const MARGIN: f64 = 16.0;
/// The rows of the strip.
const STRIP: std::ops::Range<usize> = 10..22;
/// The font size in pixels.
const SIZE: f64 = 14.0;
/// The distance from the top to the baseline of the labels.
const BASELINE: f64 = 40.0;
/// The colour of the labels, almost black.
const INK: [u8; 3] = [34, 34, 34];

/// Reports that the font in the program is damaged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the font of heat maps is damaged")]
pub struct BadFont;

/// Draws the key below an image of this width. Returns its pixels row by row.
pub fn draw(
    width: u32,
    colours: &[[u8; 3]],
    labels: &[String; 3],
) -> Result<Vec<[u8; 3]>, BadFont> {
    let font = FontRef::try_from_slice(FONT).map_err(|_| BadFont)?;
    let columns = width as usize;
    let mut pixels = vec![[255; 3]; columns * HEIGHT];
    let room = f64::from(width) - 2.0 * MARGIN;
    for x in 0..columns {
        let part = (x as f64 + 0.5 - MARGIN) / room;
        // An image narrower than its margins has no strip.
        if room > 0.0 && (0.0..1.0).contains(&part) {
            let colour = colours[(part * colours.len() as f64) as usize];
            for y in STRIP {
                pixels[y * columns + x] = colour;
            }
        }
    }
    for (label, part) in labels.iter().zip([0.0, 0.5, 1.0]) {
        // The first label is flush left, the second centred and the third flush right.
        let start = MARGIN + part * (room - length(&font, label));
        write(&font, label, start, columns, &mut pixels);
    }
    Ok(pixels)
}

/// Returns the advance of a character in pixels.
fn advance(font: &FontRef, character: char) -> f64 {
    let units = font.units_per_em().unwrap_or(1.0);
    SIZE * f64::from(font.h_advance_unscaled(font.glyph_id(character)) / units)
}

/// Returns the length of a text in pixels.
fn length(font: &FontRef, text: &str) -> f64 {
    text.chars().map(|character| advance(font, character)).sum()
}

/// Writes a text that begins at the column `start`. Columns outside the picture are cut off.
fn write(font: &FontRef, text: &str, start: f64, columns: usize, pixels: &mut [[u8; 3]]) {
    // The font library scales by the font's full height, and `SIZE` is the size of its em square.
    let scale = SIZE as f32 * font.height_unscaled() / font.units_per_em().unwrap_or(1.0);
    let mut x = start;
    for character in text.chars() {
        let place = point(x as f32, BASELINE as f32);
        let glyph = font.glyph_id(character).with_scale_and_position(PxScale::from(scale), place);
        x += advance(font, character);
        // A space has no outline.
        let Some(outline) = font.outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|right, down, coverage| {
            let column = corner.x as i64 + i64::from(right);
            let row = corner.y as i64 + i64::from(down);
            let is_inside =
                (0..columns as i64).contains(&column) && (0..HEIGHT as i64).contains(&row);
            if is_inside {
                blend(&mut pixels[row as usize * columns + column as usize], coverage);
            }
        });
    }
}

/// Covers a fraction of a pixel with ink.
fn blend(pixel: &mut [u8; 3], coverage: f32) {
    for (channel, ink) in pixel.iter_mut().zip(INK) {
        let old = f32::from(*channel);
        *channel = (old + (f32::from(ink) - old) * coverage.min(1.0)).round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_is_written_and_narrow_images_cut_it_off() {
        let colours = [[0, 0, 4], [252, 255, 164]];
        let labels = ["0", "tests per pixel: median 3, most 9", "7"].map(str::to_owned);
        for width in [1, 40, 400] {
            let pixels = draw(width, &colours, &labels).unwrap();
            assert_eq!(pixels.len(), width as usize * HEIGHT);
            let dark = pixels[STRIP.end * width as usize..].iter().filter(|pixel| pixel[0] < 128);
            assert_eq!(dark.count() > 200, width == 400, "{width}");
        }
        let font = FontRef::try_from_slice(FONT).unwrap();
        let known = "0123456789abcdefghijklmnopqrstuvwxyz:,";
        assert!(known.chars().all(|character| font.glyph_id(character).0 != 0));
    }
}
