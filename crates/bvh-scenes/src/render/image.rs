//! Pictures in memory: assembled from rows, exposed, and as the bytes of a PNG file.

use crate::rays::View;
use bvh_core::TestCounts;
use glam::DVec3;
use std::io;

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

/// Encodes pixels, row by row from the top, as a PNG file with the highest compression.
pub fn png(width: u32, pixels: &[[u8; 3]]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, pixels.len() as u32 / width);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_light_gives_brighter_bytes_up_to_white() {
        let bytes =
            [0.0, 1e-2, 0.1, 0.5, 1.0, 4.0, 1e9].map(|x| encode(expose(DVec3::splat(x)))[0]);
        assert!(bytes.is_sorted_by(|a, b| a < b) && bytes[0] == 0 && bytes[6] == 255, "{bytes:?}");
    }

    #[test]
    fn decoded_pixels_equal_the_encoded_ones() {
        let pixels = [[1, 2, 3], [255, 0, 128], [9, 9, 9], [0, 0, 0], [7, 70, 250], [4, 5, 6]];
        let bytes = png(3, &pixels).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(bytes)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut read).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (3, 2, png::ColorType::Rgb));
        assert_eq!(read, pixels.as_flattened());
    }
}
