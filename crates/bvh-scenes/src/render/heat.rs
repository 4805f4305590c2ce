//! The heat map: how many tests each pixel took, as a colour, with a key below.

use super::film::Film;
use super::key::{self, BadFont};

/// 'inferno' of matplotlib (van der Walt & Smith 2015; CC0), every sixteenth part: evenly brighter to the eye.
const INFERNO: [[u8; 3]; 17] = [
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

/// The numbers of a heat map: tests per ray through a pixel, with all that follows from the ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Of the pixel with the fewest.
    pub min: f64,
    /// Of the pixel in the middle.
    pub median: f64,
    /// What one pixel in two hundred exceeds: the top of the colours, so that a few do not darken all others.
    pub top: f64,
    /// Of the pixel with the most.
    pub max: f64,
}

/// The distribution of tests over the pixels of a film with this many rays through each pixel.
pub fn range(film: &Film, rays_per_pixel: u32) -> Range {
    let mut sorted = film.tests.clone();
    sorted.sort_unstable();
    let at = |index: usize| {
        sorted
            .get(index)
            .map_or(0.0, |&tests| tests as f64 / f64::from(rays_per_pixel))
    };
    let last = sorted.len().saturating_sub(1);
    Range { min: at(0), median: at(last / 2), top: at(last - last / 200), max: at(last) }
}

/// A film's heat map: its width, its pixels, and the key below them.
pub fn map(film: &Film, rays_per_pixel: u32) -> Result<Vec<[u8; 3]>, BadFont> {
    let range = range(film, rays_per_pixel);
    let top = range.top.max(f64::MIN_POSITIVE) * f64::from(rays_per_pixel);
    let mut pixels: Vec<[u8; 3]> = film
        .tests
        .iter()
        .map(|&tests| colour(tests as f64 / top))
        .collect();
    let colours: Vec<[u8; 3]> = (0..=255)
        .map(|part| colour(f64::from(part) / 255.0))
        .collect();
    pixels.extend(key::draw(film.width, &colours, &labels(&range))?);
    Ok(pixels)
}

/// The colour at a part of the range, 0 to 1; what is beyond has the last one's.
fn colour(at: f64) -> [u8; 3] {
    let at = at.clamp(0.0, 1.0) * (INFERNO.len() - 1) as f64;
    let index = (at as usize).min(INFERNO.len() - 2);
    let low = INFERNO[index];
    let high = INFERNO[index + 1];
    let part = at - index as f64;
    [0, 1, 2]
        .map(|c| (f64::from(low[c]) + (f64::from(high[c]) - f64::from(low[c])) * part + 0.5) as u8)
}

/// The texts below the left end of the key, its middle and its right end.
fn labels(range: &Range) -> [String; 3] {
    [
        "0".into(),
        format!("tests per pixel: median {:.0}, most {:.0}", range.median, range.max),
        format!("{:.0}", range.top),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(width: u32, tests: Vec<u64>) -> Film {
        Film { width, tests, ..Film::default() }
    }

    #[test]
    fn the_range_is_that_of_the_pixels_whatever_few_of_them_take() {
        let mut tests: Vec<u64> = (0..1000).collect();
        tests[500] = 1_000_000;
        // 499 is now the five hundredth of a thousand.
        let range = range(&film(10, tests), 4);
        assert_eq!((range.min, range.median, range.max), (0.0, 499.0 / 4.0, 250_000.0));
        assert!(range.top > 240.0 && range.top < 250.0, "{range:?}");
    }

    #[test]
    fn more_tests_are_brighter_and_the_key_is_below() {
        let luminance = |[r, g, b]: [u8; 3]| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let shades: Vec<f64> = (0..=64)
            .map(|i| luminance(colour(f64::from(i) / 64.0)))
            .collect();
        assert!(shades.is_sorted_by(|a, b| a < b), "{shades:?}");
        for width in [64, 65] {
            let pixels = map(&film(width, (0..u64::from(width) * 8).collect()), 1).unwrap();
            assert_eq!(pixels.len() % width as usize, 0);
            assert_eq!((pixels[0], pixels[width as usize * 8]), (INFERNO[0], [255; 3]));
        }
    }

    #[test]
    fn a_picture_without_tests_has_a_heat_map_too() {
        assert!(
            map(&film(40, vec![0; 40]), 1).unwrap()[..40]
                .iter()
                .all(|&pixel| pixel == INFERNO[0])
        );
    }
}
