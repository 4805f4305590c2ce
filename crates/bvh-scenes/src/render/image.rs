//! Pictures in memory: assembled from rows, and exposed.

use crate::rays::View;
use bvh_core::TestCounts;
use glam::DVec3;

/// The contents and the resolution of a picture.
#[derive(Clone, Debug)]
pub struct Options {
    /// The number of pixels per row.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
    /// The square root of the number of rays per pixel, which form a grid; 1 or more.
    pub samples: u32,
    /// The largest number of successive mirror reflections.
    pub depth: u32,
    /// The view.
    pub view: View,
    /// True to draw a ground below a scene that is seen from outside.
    pub ground: bool,
}

impl Options {
    /// Returns the options of a whole picture from this view, with four rays per pixel.
    pub fn new(width: u32, height: u32, view: View) -> Self {
        Self { width, height, samples: 2, depth: 4, view, ground: true }
    }
}

/// A picture, or a row that one thread has drawn, with its numbers of rays and tests. Rows run
/// from the top, and pixels from the left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// The number of pixels per row.
    pub width: u32,
    /// The sRGB colour of each pixel.
    pub pixels: Vec<[u8; 3]>,
    /// The number of tests that all rays of each pixel made against boxes and objects.
    pub tests: Vec<u64>,
    /// The number of tests of the whole picture.
    pub counts: TestCounts,
    /// The number of rays of the whole picture: through pixels, to lights, and along mirror
    /// reflections.
    pub rays: u64,
}

impl Film {
    /// Adds the rows of another picture below the last row.
    pub fn append(&mut self, mut below: Self) {
        self.pixels.append(&mut below.pixels);
        self.tests.append(&mut below.tests);
        self.counts.boxes += below.counts.boxes;
        self.counts.objects += below.counts.objects;
        self.rays += below.rays;
    }
}

/// The exposure that makes a white surface in the automatic light just darker than white.
const EXPOSURE: f64 = 0.66;

/// Maps linear light of any strength to 0..1 like film: overexposed light loses its colour but not
/// its shape.
///
/// Source: Narkowicz 2015, 'ACES filmic tone mapping curve'.
pub fn expose(light: DVec3) -> DVec3 {
    light.map(|x| {
        // Larger values would overflow to ∞ / ∞, and are white long before.
        let x = (EXPOSURE * x).min(1e6);
        ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0)
    })
}

/// Converts exposed light to sRGB bytes (IEC 61966-2-1).
pub fn encode(light: DVec3) -> [u8; 3] {
    light.to_array().map(|x| {
        let x = x.clamp(0.0, 1.0);
        let encoded =
            if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
        (encoded * 255.0 + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_has_the_bytes_of_srgb_and_the_curve_of_film() {
        // The grey card of photographers, and the ends of the straight part.
        for (light, byte) in
            [(0.0, 0), (0.003_130_8, 10), (0.18, 118), (0.5, 188), (1.0, 255), (9.0, 255)]
        {
            assert_eq!(encode(DVec3::splat(light)), [byte; 3], "{light}");
        }
        for (light, expected) in [(0.0, 0.0), (1.0, 2.54 / 3.16), (1e9, 1.0)] {
            let film = expose(DVec3::splat(light / EXPOSURE)).x;
            assert!((film - expected).abs() < 1e-15, "{light}: {film}");
        }
    }
}
