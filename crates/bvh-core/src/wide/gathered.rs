//! Pairs of a ray and a triangle that it may hit, gathered from anywhere and decided side by side.

use super::lanes::{Lanes, Mask};
use super::pairs::{Crossings, Pairs};
use super::prepared::Prepared;
use super::triangles::{TriangleBlock, three_by_three};
use crate::exact::Line;
use crate::{Hit, Ray, Triangle};

const PAIRS: usize = TriangleBlock::LANES * Gathered::RAYS;

/// A number of every pair.
type Row = [f32; PAIRS];

#[repr(C, align(64))]
pub(crate) struct Gathered {
    /// The corners in the shear's order of axes.
    corners: [[Row; 3]; 3],
    /// What [`Prepared::of_pairs`] returns.
    rays: [Row; 10],
    /// The ends of the rays.
    t_max: Row,
    /// A bit per pair whose ray certainly crosses the triangle.
    certain: u64,
    /// The number of each pair's ray, and the lane of its triangle.
    names: [[u8; 2]; PAIRS],
    pub(crate) count: usize,
}

impl Gathered {
    /// The maximum number of rays, each at a block.
    pub(crate) const RAYS: usize = 16;
    // Decisions read whole registers, of which the last may be only partly filled.
    pub(crate) const EMPTY: Self = Self {
        corners: [[[0.0; PAIRS]; 3]; 3],
        rays: [[0.0; PAIRS]; 10],
        t_max: [0.0; PAIRS],
        certain: 0,
        names: [[0; 2]; PAIRS],
        count: 0,
    };

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.certain = 0;
        self.count = 0;
    }

    #[inline(always)]
    pub(crate) fn names(&self, pair: usize) -> (usize, usize) {
        let [ray, lane] = self.names[pair];
        (usize::from(ray), usize::from(lane))
    }

    /// Appends the pair of a ray that ends at `t_max`, number `number` of at most
    /// [`RAYS`](Self::RAYS), and the triangle in a lane of a block.
    ///
    /// # Safety
    /// There is room, and `lane` is one.
    #[inline(always)]
    pub(crate) unsafe fn push(
        &mut self,
        ray: &Prepared,
        block: &TriangleBlock,
        t_max: f32,
        lane: u32,
        number: u32,
        is_certain: u32,
    ) {
        let i = self.count;
        let axes = ray.axes();
        // SAFETY: the pair and the lane exist; axes are below 3.
        unsafe {
            for (rows, corner) in self.corners.iter_mut().zip(&block.corners) {
                for (row, &axis) in rows.iter_mut().zip(axes) {
                    let lanes = corner.get_unchecked(axis);
                    *row.get_unchecked_mut(i) = *lanes.get_unchecked(lane as usize);
                }
            }
            for (row, number) in self.rays.iter_mut().zip(ray.of_pairs()) {
                *row.get_unchecked_mut(i) = number;
            }
            *self.t_max.get_unchecked_mut(i) = t_max;
            *self.names.get_unchecked_mut(i) = [number as u8, lane as u8];
        }
        self.certain |= u64::from(is_certain) << i;
        self.count += 1;
    }

    /// Decides the pairs from number `first` on, a lane each: all that f64 leaves open as well,
    /// unless they are `left_open`.
    ///
    /// # Safety
    /// The processor has the instructions; `first` is a multiple of the lanes, below the count.
    #[inline(always)]
    pub(crate) unsafe fn decide<L: Lanes>(&self, first: usize, left_open: bool) -> Decided {
        // SAFETY: rows are aligned to the widest register, and hold whole ones.
        unsafe {
            let load = |row: &Row| L::load(row.as_ptr().add(first));
            let corners = three_by_three(|corner, axis| load(&self.corners[corner][axis]));
            let [x, y, z, dx, dy, dz, x_slope, y_slope, reach, t_min] = &self.rays;
            let rays = Pairs::new(
                [load(x), load(y), load(z)],
                [load(dx), load(dy), load(dz)],
                [load(x_slope), load(y_slope)],
                load(reach),
                load(t_min),
            );
            let t_max = load(&self.t_max);
            let lanes = (self.count - first).min(L::N);
            let possible = u32::MAX >> (32 - lanes);
            let certain = (self.certain >> first) as u32;
            let crossings = Crossings { possible, certain };
            if left_open {
                return Decided::new(rays.decide_in_f64(&corners, crossings, t_max));
            }
            let (hits, t) = rays.decide(&corners, crossings, t_max);
            Decided::new((hits, 0, t))
        }
    }
}

/// The answers of a test in f64.
pub(super) struct Decided {
    hits: u32,
    unsure: u32,
    distances: [f32; 16],
}

impl Decided {
    #[inline(always)]
    pub(super) fn new<L: Lanes>((hits, unsure, t): (L::Mask, u32, L)) -> Self {
        let mut distances = [0.0; 16];
        // SAFETY: there is room for sixteen lanes.
        unsafe { t.store(distances.as_mut_ptr()) };
        Self { hits: hits.bits(), unsure, distances }
    }

    /// Returns the bits of a pair's distance above those of `object`; the greatest number if it is
    /// no hit.
    #[inline(always)]
    pub(super) fn key(&self, pair: usize, object: u32) -> u64 {
        let key = u64::from(self.distances[pair & 15].to_bits()) << 32 | u64::from(object);
        if self.hits >> pair & 1 != 0 { key } else { u64::MAX }
    }

    /// Returns the hit of the pair in this lane, of a ray and a triangle of a block.
    #[inline(always)]
    pub(super) fn hit_of(
        &self,
        pair: usize,
        block: &TriangleBlock,
        lane: usize,
        ray: &Ray,
    ) -> Option<Hit> {
        if self.unsure >> pair & 1 != 0 {
            let (object, triangle) = block.triangle(lane)?;
            return hit_of(ray, &ray.line(), object, &triangle);
        }
        let hit = Hit { t: self.distances[pair & 15], object: block.id(lane) };
        (self.hits >> pair & 1 != 0).then_some(hit)
    }
}

#[inline(always)]
pub(super) fn hit_of(ray: &Ray, line: &Line, object: u32, triangle: &Triangle) -> Option<Hit> {
    let t = line.crossing(&triangle.0, true)?;
    (ray.t_min() <= t && t <= ray.t_max()).then_some(Hit { t, object })
}
