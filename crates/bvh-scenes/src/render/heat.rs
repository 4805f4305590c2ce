//! The heat map: the number of tests of each pixel as a colour, with a key below.

use super::image::Film;
use ab_glyph::{Font, FontRef, PxScale, point};

/// Every sixteenth colour of matplotlib's 'inferno' (van der Walt & Smith 2015; CC0), whose
/// brightness increases evenly to the eye.
pub const INFERNO: [[u8; 3]; 17] = [
    [0, 0, 4],
    [11, 7, 36],
    [32, 12, 74],
    [60, 9, 101],
    [87, 16, 110],
    [114, 25, 110],
    [140, 41, 99],
    [165, 53, 92],
    [188, 55, 84],
    [209, 70, 67],
    [227, 89, 51],
    [241, 113, 31],
    [249, 142, 9],
    [252, 172, 17],
    [249, 203, 53],
    [242, 234, 105],
    [252, 255, 164],
];

/// The distribution of a heat map's values: tests per ray through a pixel, with the tests of the
/// rays that follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The smallest value.
    pub min: f64,
    /// The median.
    pub median: f64,
    /// The value that one pixel in two hundred exceeds. The colours end here, because a few extreme
    /// pixels would darken all others.
    pub top: f64,
    /// The largest value.
    pub max: f64,
}

/// Returns the distribution of tests over the pixels of a film with this many rays through each
/// pixel.
pub fn range(film: &Film, rays_per_pixel: u32) -> Range {
    let mut sorted = film.tests.clone();
    sorted.sort_unstable();
    // A film without pixels has zeros.
    let last = sorted.len().saturating_sub(1);
    let [min, median, top, max] = [0, last / 2, last - last / 200, last].map(|index| {
        let tests = sorted.get(index).copied().unwrap_or(0);
        tests as f64 / f64::from(rays_per_pixel)
    });
    Range { min, median, top, max }
}

/// Returns the pixels of a film's heat map and of the key below it, with the film's [`range`].
pub fn map(film: &Film, rays_per_pixel: u32) -> Result<Vec<[u8; 3]>, BadFont> {
    let range = range(film, rays_per_pixel);
    let mut pixels = colours(film, range.top * f64::from(rays_per_pixel));
    let colours: Vec<[u8; 3]> = (0..=255).map(|part| colour(f64::from(part) / 255.0)).collect();
    pixels.extend(key(film.width, &colours, &labels(&range))?);
    Ok(pixels)
}

/// Returns the colours of a film's pixels, without a key. They end at `top` tests of a pixel.
pub fn colours(film: &Film, top: f64) -> Vec<[u8; 3]> {
    // A picture without tests has the top 0, and its colours would be 0 / 0.
    let top = top.max(f64::MIN_POSITIVE);
    film.tests.iter().map(|&tests| colour(tests as f64 / top)).collect()
}

/// Returns the colour of a value relative to the range, 0 to 1. Larger values have the last colour.
fn colour(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (INFERNO.len() - 1) as f64;
    let index = (place as usize).min(INFERNO.len() - 2);
    let part = place - index as f64;
    [0, 1, 2].map(|channel| {
        let low = f64::from(INFERNO[index][channel]);
        let high = f64::from(INFERNO[index + 1][channel]);
        (low + (high - low) * part + 0.5) as u8
    })
}

fn labels(range: &Range) -> [String; 3] {
    [
        "0".into(),
        format!("tests per pixel: median {:.0}", range.median),
        format!("{:.0} or more", range.top),
    ]
}

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
fn key(width: u32, colours: &[[u8; 3]], labels: &[String; 3]) -> Result<Vec<[u8; 3]>, BadFont> {
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

fn advance(font: &FontRef, character: char) -> f64 {
    let units = font.units_per_em().unwrap_or(1.0);
    SIZE * f64::from(font.h_advance_unscaled(font.glyph_id(character)) / units)
}

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

fn blend(pixel: &mut [u8; 3], coverage: f32) {
    for (channel, ink) in pixel.iter_mut().zip(INK) {
        let old = f32::from(*channel);
        *channel = (old + (f32::from(ink) - old) * coverage.min(1.0)).round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(width: u32, tests: Vec<u64>) -> Film {
        Film { width, tests, ..Film::default() }
    }

    #[test]
    fn a_few_extreme_pixels_change_only_the_maximum() {
        let mut tests: Vec<u64> = (0..1000).collect();
        tests[500] = 1_000_000;
        // 499 is now the five hundredth of a thousand values.
        let range = range(&film(10, tests), 4);
        assert_eq!((range.min, range.median, range.max), (0.0, 499.0 / 4.0, 250_000.0));
        assert!(range.top > 240.0 && range.top < 250.0, "{range:?}");
    }

    #[test]
    fn more_tests_are_brighter_and_the_key_is_below() {
        let shades: Vec<f64> = (0..=64)
            .map(|i| colour(f64::from(i) / 64.0).map(f64::from))
            .map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
            .collect();
        assert!(shades.is_sorted_by(|a, b| a < b), "{shades:?}");
        for width in [64, 65] {
            let tests = (0..u64::from(width) * 8).collect();
            let film = film(width, tests);
            let pixels = map(&film, 1).unwrap();
            assert_eq!(pixels.len() % width as usize, 0);
            assert_eq!((pixels[0], pixels[width as usize * 8]), (INFERNO[0], [255; 3]));
        }
    }

    #[test]
    fn the_same_number_of_tests_has_one_colour_under_one_scale() {
        let (few, many) = (film(64, vec![5; 64]), film(64, vec![10; 64]));
        assert_eq!([colours(&few, 10.0)[0], colours(&many, 10.0)[0]], [colour(0.5), colour(1.0)]);
    }

    #[test]
    fn a_picture_without_tests_has_a_heat_map_too() {
        let film = film(40, vec![0; 40]);
        let pixels = map(&film, 1).unwrap();
        assert_eq!(pixels[..40], [INFERNO[0]; 40]);
    }

    #[test]
    fn every_label_is_written_and_narrow_images_cut_it_off() {
        let colours = [[0, 0, 4], [252, 255, 164]];
        let labels = ["0", "tests per pixel: median 3, most 9", "7"].map(str::to_owned);
        for width in [1, 40, 400] {
            let pixels = key(width, &colours, &labels).unwrap();
            assert_eq!(pixels.len(), width as usize * HEIGHT);
            let dark = pixels[STRIP.end * width as usize..].iter().filter(|pixel| pixel[0] < 128);
            assert_eq!(dark.count() > 200, width == 400, "{width}");
        }
        let font = FontRef::try_from_slice(FONT).unwrap();
        let known = "0123456789abcdefghijklmnopqrstuvwxyz:,";
        assert!(known.chars().all(|character| font.glyph_id(character).0 != 0));
    }
}
