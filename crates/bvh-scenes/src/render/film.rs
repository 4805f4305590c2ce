//! A picture, put together from tiles, which are small pictures.

use bvh_core::TestCounts;

/// A picture, or a tile of one that one thread has drawn, with the rays and tests that it took. Rows run from the top, pixels from
/// the left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// Pixels per row.
    pub width: u32,
    /// The sRGB colour of each pixel.
    pub pixels: Vec<[u8; 3]>,
    /// For each pixel, the number of tests of all its rays against boxes and objects.
    pub tests: Vec<u64>,
    /// The tests of the whole picture.
    pub counts: TestCounts,
    /// The rays of the whole picture: through pixels, to lights, and along mirror reflections.
    pub rays: u64,
}

impl Film {
    /// Puts tiles together, `columns` of them side by side.
    pub fn of_tiles(width: u32, tiles: &[Self], columns: usize) -> Self {
        let mut film = Self { width, ..Self::default() };
        for row in tiles.chunks(columns) {
            let lines = row[0].pixels.len() / row[0].width as usize;
            for (y, tile) in (0..lines).flat_map(|y| row.iter().map(move |tile| (y, tile))) {
                let line = y * tile.width as usize..(y + 1) * tile.width as usize;
                film.pixels.extend(&tile.pixels[line.clone()]);
                film.tests.extend(&tile.tests[line]);
            }
        }
        tiles
            .iter()
            .for_each(|tile| film.count(tile.counts, tile.rays));
        film
    }

    /// Adds tests and rays to those of the whole picture.
    pub fn count(&mut self, tests: TestCounts, rays: u64) {
        self.counts.boxes += tests.boxes;
        self.counts.objects += tests.objects;
        self.rays += rays;
    }
}
