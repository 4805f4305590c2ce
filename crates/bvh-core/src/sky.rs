//! What many points see of the same directions: views of the sky, hours of sun.
//!
//! Urban climate, daylight and comfort studies ask for 10⁵ to 10⁶ points which of hundreds of
//! directions are free. The rays need not exist one by one: neighbouring points look along a
//! direction together, as a beam, and a point far from others in many directions, as a fan.

use crate::Traced;
use crate::wide::{POINTS_OF_BEAM, transpose};
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use core::num::NonZeroU32;
use glam::DVec3;

/// Directions that many points look along, and what each is worth.
///
/// ```
/// use bvh_core::{Aabb, Bvh, Node, Sky, Triangle, View, WideBvh, glam::DVec3, neighbours};
/// // A wall across x = 1, and two points, of which the second is behind it.
/// let wall = [Triangle::from([[1.0, -9.0, 0.0], [1.0, 9.0, 0.0], [1.0, 0.0, 9.0]])];
/// let tree = Bvh::new(vec![Node::leaf(wall[0].aabb(), 0, 1)], vec![0]);
/// let wide = WideBvh::new(&tree, &wall)?;
/// let sky = Sky::new(vec![DVec3::X, DVec3::Z], [0.0, f64::INFINITY])?;
/// let view = View { points: &[[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]].map(Into::into), normals: None };
/// sky.visible(&wide, view, &neighbours(view.points), |point, row| {
///     assert_eq!(row, [[0b10], [0b11]][point]);
/// });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    directions: Vec<DVec3>,
    range: [f64; 2],
    /// A row for each direction.
    weights: Vec<f64>,
    columns: usize,
}

/// The reason why numbers are rejected as a sky.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // The messages explain the fields.
pub enum InvalidSky {
    /// A direction is not finite, or zero, tiny or huge.
    #[error(
        "direction {index} is {found}; accepted: finite, its largest component between 2^-100 and 2^100"
    )]
    Direction { index: usize, found: DVec3 },
    /// The range is NaN or extends behind the points.
    #[error("the range {0}..={1} must not be NaN and must start at 0 or later")]
    Range(f64, f64),
    /// There are not as many weights for each direction.
    #[error("there are {weights} weights for {directions} directions; accepted: as many for each")]
    Weights { weights: usize, directions: usize },
    /// A weight is NaN or infinite.
    #[error("weight {0} is {1}; accepted: finite numbers")]
    Weight(usize, f64),
}

/// Points, and the normals of the surfaces that they lie on. With normals, only directions d with
/// n · d > 0 in f64 count, and cosines are known. Points and normals have to be finite.
#[derive(Clone, Copy, Debug)]
pub struct View<'a, P> {
    /// The points.
    pub points: &'a [P],
    /// A normal for each point, of any length.
    pub normals: Option<&'a [P]>,
}

impl Sky {
    /// Makes a sky of these directions, over `range[0] <= t <= range[1]` in multiples of their
    /// lengths. Each direction weighs 1.
    ///
    /// A layout in f32 takes directions and range rounded to f32.
    pub fn new(directions: Vec<DVec3>, range: [f64; 2]) -> Result<Self, InvalidSky> {
        let limit = 100.0f64.exp2();
        for (index, &found) in directions.iter().enumerate() {
            let largest = found.abs().max_element();
            if !(found.is_finite() && (1.0 / limit..=limit).contains(&largest)) {
                return Err(InvalidSky::Direction { index, found });
            }
        }
        let weights = vec![1.0; directions.len()];
        Self { directions, range, weights, columns: 1 }.with_range(range)
    }

    /// Returns the sky above the plane of x (east) and y (north) in patches, and their solid angles
    /// over π as weights: with cosines, their sum is the sky view factor, 1 for a free horizontal
    /// surface. The 145 patches of Tregenza for a `division` of 1, the 577 of Reinhart for 2, and so on,
    /// each by the direction of its middle, in rows from the horizon to the zenith, from north over
    /// east.
    ///
    /// Source: Tregenza 1987, 'Subdivision of the sky hemisphere for luminance measurements'; Reinhart
    /// 2001, for divisions in the form that the program `genskyvec` has.
    pub fn patches(division: NonZeroU32) -> Self {
        const IN_ROW: [u32; 7] = [30, 30, 24, 24, 18, 12, 6];
        let division = division.get();
        let height = FRAC_PI_2 / (7.0 * f64::from(division) + 0.5);
        let mut directions = Vec::new();
        let mut weights = Vec::new();
        for row in 0..7 * division {
            let count = IN_ROW[(row / division) as usize] * division;
            let [low, high] = [row, row + 1].map(|row| libm::sin(f64::from(row) * height));
            let (up, out) = libm::sincos((f64::from(row) + 0.5) * height);
            for patch in 0..count {
                let (east, north) = libm::sincos(TAU * f64::from(patch) / f64::from(count));
                directions.push(DVec3::new(out * east, out * north, up));
                weights.push(2.0 * (high - low) / f64::from(count));
            }
        }
        directions.push(DVec3::Z);
        weights.push(2.0 * (1.0 - libm::cos(0.5 * height)));
        Self { directions, range: [0.0, f64::MAX], weights, columns: 1 }
    }

    /// Returns `count` directions of the sky, as [`patches`](Self::patches) are, each of the same
    /// solid angle, on a spiral of golden angles.
    pub fn uniform(count: u32) -> Self {
        let golden = PI * (3.0 - 5.0f64.sqrt());
        let direction = |number: u32| {
            let up = (f64::from(number) + 0.5) / f64::from(count);
            let out = (1.0 - up * up).sqrt();
            let (east, north) = libm::sincos(golden * f64::from(number));
            DVec3::new(out * east, out * north, up)
        };
        let directions = (0..count).map(direction).collect();
        let weights = vec![2.0 / f64::from(count); count as usize];
        Self { directions, range: [0.0, f64::MAX], weights, columns: 1 }
    }

    /// Sets the range: `range[0] <= t <= range[1]` in multiples of the directions' lengths.
    pub fn with_range(self, range: [f64; 2]) -> Result<Self, InvalidSky> {
        let [begin, end] = range;
        if begin.is_nan() || begin < 0.0 || end.is_nan() {
            return Err(InvalidSky::Range(begin, end));
        }
        Ok(Self { range: [begin, end.min(f64::MAX)], ..self })
    }

    /// Sets the weights: a row of as many numbers for each direction.
    pub fn with_weights(self, weights: Vec<f64>) -> Result<Self, InvalidSky> {
        let directions = self.directions.len();
        if let Some((index, &weight)) = weights.iter().enumerate().find(|(_, w)| !w.is_finite()) {
            return Err(InvalidSky::Weight(index, weight));
        }
        let columns = weights.len().checked_div(directions).unwrap_or(1);
        if columns == 0 || columns * directions != weights.len() {
            return Err(InvalidSky::Weights { weights: weights.len(), directions });
        }
        Ok(Self { weights, columns, ..self })
    }

    /// The directions.
    pub fn directions(&self) -> &[DVec3] {
        &self.directions
    }

    /// The weights: a row of [`columns`](Self::columns) for each direction.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The number of weights of each direction.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The number of words with a bit for each direction.
    pub fn words(&self) -> usize {
        self.directions.len().div_ceil(64)
    }

    /// Passes for each of some points its number and a row of [`words`](Self::words): direction `j`
    /// is free where the bit `j % 64` of word `j / 64` is set. A direction is free where no triangle
    /// is in the range, exactly as [`any_hit`](crate::WideBvh::any_hit) says.
    ///
    /// `order` has the numbers of the points; fastest where [`neighbours`](crate::neighbours) follow
    /// each other.
    /// Memory for 128 points at a time.
    ///
    /// # Panics
    /// If there are not as many normals as points, or fewer points than a number says.
    pub fn visible<L: Traced>(
        &self,
        layout: &L,
        view: View<'_, L::Point>,
        order: &[u32],
        mut row: impl FnMut(usize, &[u64]),
    ) {
        let words = self.words();
        if let Some(normals) = view.normals {
            assert_eq!(normals.len(), view.points.len(), "a normal for every point");
        }
        let (directions, range) = L::as_of_rays(&self.directions, self.range);
        let mut points = Vec::with_capacity(POINTS_OF_BEAM);
        let mut normals = Vec::with_capacity(POINTS_OF_BEAM);
        let mut rows = vec![0; POINTS_OF_BEAM * words];
        let mut parts = [(); POINTS_OF_BEAM / 64].map(|()| vec![0; 64 * words]);
        for numbers in order.chunks(POINTS_OF_BEAM) {
            let at = |from: &[L::Point], to: &mut Vec<L::Point>| {
                to.clear();
                to.extend(numbers.iter().map(|&number| from[number as usize]));
            };
            at(view.points, &mut points);
            view.normals.iter().for_each(|from| at(from, &mut normals));
            let above = view.normals.map(|_| &normals[..]);
            parts.iter_mut().for_each(|free| free.fill(0));
            layout.look(&points, above, &directions, range, &mut |direction, bits| {
                for (part, free) in parts.iter_mut().enumerate() {
                    free[direction] |= (bits >> (64 * part)) as u64;
                }
            });
            for (free, rows) in parts.iter_mut().zip(rows.chunks_mut((64 * words).max(1))) {
                for (word, free) in free.as_chunks_mut().0.iter_mut().enumerate() {
                    transpose(free);
                    for (row, &bits) in rows.chunks_exact_mut(words).zip(&*free) {
                        row[word] = bits;
                    }
                }
            }
            for (place, &number) in numbers.iter().enumerate() {
                row(number as usize, &rows[place * words..][..words]);
            }
        }
    }

    /// Returns the sums of the weights of the free directions in a row of [`visible`](Self::visible),
    /// in the order of the directions, in f64. With a normal, a weight counts by the cosine of its
    /// direction's angle with it.
    pub fn sums(&self, row: &[u64], normal: Option<DVec3>) -> Vec<f64> {
        let mut sums = vec![0.0; self.columns];
        // Of about the length 1, so that no square overflows.
        let unit = |vector: DVec3| (vector / vector.abs().max_element()).normalize();
        let normal = normal.map(unit);
        let weights = self.weights.chunks_exact(self.columns.max(1));
        for (number, (weights, direction)) in weights.zip(&self.directions).enumerate() {
            if row[number / 64] >> (number % 64) & 1 == 0 {
                continue;
            }
            let cosine = normal.map_or(1.0, |normal| normal.dot(unit(*direction)));
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum += weight * cosine;
            }
        }
        sums
    }
}
