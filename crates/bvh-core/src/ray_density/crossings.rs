//! Counts the segments that start in each cell of a grid and that cross each face, and sums the
//! counts into tables.

use super::{Cell, Corner};
use crate::each::Each;
use glam::{DVec3, Vec4};

/// The number of cells of the grid along each axis.
pub(super) const CELLS: usize = 32;
const POINTS: usize = CELLS + 1;
const END: f64 = CELLS as f64;

#[inline]
pub(super) fn index(cell: [usize; 3]) -> usize {
    (cell[2] * CELLS + cell[1]) * CELLS + cell[0]
}

/// The counts of segments that start in each cell and that cross each face of a cell.
pub(super) struct Crossings {
    /// The number of segments that meet the grid.
    pub segments: u32,
    starts: Vec<u32>,
    /// `[axis][downward][plane][cell of the plane]`.
    faces: [[Vec<u32>; 2]; 3],
}

/// The two other axes of each axis, in their order.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// The part of a segment inside the grid.
struct Clipped {
    /// The parameters of the ends, from 0 to 1 along the segment.
    first: f64,
    last: f64,
    /// The axis across which the segment enters the grid; `None` if it starts inside.
    entered: Option<usize>,
}

impl Crossings {
    pub fn new() -> Self {
        let faces = [[(); 2]; 3].map(|ways| ways.map(|()| vec![0; POINTS * CELLS * CELLS]));
        Self { segments: 0, starts: vec![0; CELLS * CELLS * CELLS], faces }
    }

    /// Records the cells that a segment visits within the grid, face by face. Coordinates are in
    /// cells.
    pub fn record(&mut self, from: DVec3, to: DVec3) {
        let ray = to - from;
        let Some(Clipped { first, last, entered }) = clip_to_grid(from, ray) else { return };
        self.segments += 1;
        let mut cell = cell_at(from + first * ray);
        let end = cell_at(from + last * ray);
        match entered {
            None => self.starts[index(cell)] += 1,
            Some(axis) => {
                // Rounding may have put the point of entry into the next cell.
                cell[axis] = if ray[axis] > 0.0 { 0 } else { CELLS - 1 };
                self.cross(axis, ray[axis] < 0.0, cell);
            }
        }
        self.walk(from, ray, cell, end);
    }

    /// Walks from cell to cell through the face that comes first. Each axis takes exactly the steps
    /// between the two cells, so the walk reaches the last cell despite rounding.
    ///
    /// Which face comes first cannot be predicted. So hardly a branch depends on it, and the time of
    /// the face after the next is known before it is needed.
    fn walk(&mut self, from: DVec3, ray: DVec3, cell: [usize; 3], end: [usize; 3]) {
        let downward = [0, 1, 2].each(|axis| end[axis] < cell[axis]);
        let mut left = [0, 1, 2].each(|axis| cell[axis].abs_diff(end[axis]) as u32);
        let step = downward.each(|downward| if downward { -1.0 } else { 1.0 });
        let last_plane = [0, 1, 2].each(|axis| (end[axis] + usize::from(downward[axis])) as f64);
        // When the segment crosses an axis with so many steps left.
        let time = |axis: usize, left: u32| {
            let plane = last_plane[axis] - step[axis] * (f64::from(left) - 1.0);
            let time = (plane - from[axis]) / ray[axis];
            // Finite, so that an axis with steps left always comes before an axis without.
            let time = if time.is_nan() { 0.0 } else { time.min(f64::MAX) };
            order(if left == 0 { f64::INFINITY } else { time })
        };
        let mut times = [0, 1, 2].each(|axis| time(axis, left[axis]));
        let mut next = [0, 1, 2].each(|axis| time(axis, left[axis].saturating_sub(1)));
        let plane = |axis: usize| cell[axis] + usize::from(!downward[axis]);
        let mut faces = [0, 1, 2].each(|axis| face(axis, plane(axis), cell));
        // Numbers of faces are linear: a step adds the number of its own place.
        let strides = [0, 1, 2].each(|along| {
            let unit = [0, 1, 2].each(|axis| usize::from(axis == along));
            let strides = [0, 1, 2].each(|axis| face(axis, unit[axis], unit));
            strides.each(|stride| if downward[along] { stride.wrapping_neg() } else { stride })
        });
        for _ in 0..left.iter().sum() {
            let earlier = usize::from(times[1] < times[0]);
            let axis = if times[2] < times[0].min(times[1]) { 2 } else { earlier };
            self.faces[axis][usize::from(downward[axis])][faces[axis]] += 1;
            for (face, stride) in faces.iter_mut().zip(strides[axis]) {
                *face = face.wrapping_add(stride);
            }
            left[axis] -= 1;
            times[axis] = next[axis];
            next[axis] = time(axis, left[axis].saturating_sub(1));
        }
    }

    fn cross(&mut self, axis: usize, downward: bool, into: [usize; 3]) {
        let plane = into[axis] + usize::from(downward);
        self.faces[axis][usize::from(downward)][face(axis, plane, into)] += 1;
    }

    /// Returns the tables of signed counts, one per corner of a box; see [the measure](super).
    pub fn corner_tables(&self) -> Vec<Corner> {
        let summed = |ways: &[Vec<u32>; 2]| ways.each_ref().map(|faces| summed_faces(faces));
        let faces = self.faces.each_ref().map(summed);
        let sums = Sums { starts: summed_starts(&self.starts), faces };
        let mut tables = Vec::with_capacity(8 * CELLS * CELLS * CELLS);
        for cell in cells() {
            tables.extend((0..8).map(|corner| sums.around(cell, corner)));
        }
        tables
    }

    /// Returns, for each cell, the flux through its faces and its starts as linear functions of a
    /// box's ends.
    pub fn cell_table(&self) -> Vec<Cell> {
        cells().map(|cell| self.cell(cell)).collect()
    }

    fn cell(&self, cell: [usize; 3]) -> Cell {
        let mut rows = [Vec4::ZERO; 4];
        for axis in 0..3 {
            let lower = face(axis, cell[axis], cell);
            let upper = face(axis, cell[axis] + 1, cell);
            let [upward, downward] = &self.faces[axis];
            // The counts at the low end of the cell, and their differences across it.
            rows[0][axis] =
                (upward[lower] as f32 + downward[lower] as f32) * super::FRACTIONS as f32;
            rows[1][axis] = upward[upper] as f32 - upward[lower] as f32;
            rows[2][axis] = downward[upper] as f32 - downward[lower] as f32;
        }
        rows[3][0] = self.starts[index(cell)] as f32;
        Cell(rows)
    }
}

/// Returns the part of the segment `from + t · ray`, t from 0 to 1, inside the grid; `None` if
/// there is none.
fn clip_to_grid(from: DVec3, ray: DVec3) -> Option<Clipped> {
    let mut clipped = Clipped { first: 0.0, last: 1.0, entered: None };
    for axis in 0..3 {
        if ray[axis] == 0.0 {
            if !(0.0..=END).contains(&from[axis]) {
                return None;
            }
            continue;
        }
        let (near, far) = if ray[axis] > 0.0 { (0.0, END) } else { (END, 0.0) };
        let enter = (near - from[axis]) / ray[axis];
        let leave = (far - from[axis]) / ray[axis];
        if enter > clipped.first {
            clipped.first = enter;
            clipped.entered = Some(axis);
        }
        clipped.last = clipped.last.min(leave);
    }
    (clipped.first <= clipped.last).then_some(clipped)
}

/// Returns the cell of a point, or the nearest cell if rounding has moved the point out of the
/// grid.
fn cell_at(point: DVec3) -> [usize; 3] {
    let cell = point.to_array().each(|x| x.clamp(0.0, END) as usize);
    cell.each(|index| index.min(CELLS - 1))
}

/// Returns a number in the order of [`f64::total_cmp`].
#[inline(always)]
fn order(x: f64) -> i64 {
    let bits = x.to_bits() as i64;
    bits ^ ((bits >> 63) as u64 >> 1) as i64
}

/// Summed-area tables of all counts.
struct Sums {
    starts: Vec<i64>,
    /// `[axis][downward]`
    faces: [[Vec<i64>; 2]; 3],
}

impl Sums {
    /// Returns the signed counts of a box's corner at the eight grid points of a cell.
    fn around(&self, cell: [usize; 3], corner: usize) -> Corner {
        let [x, y, z] = cell;
        let plane = |z: usize| {
            let points = [[x, y, z], [x + 1, y, z], [x, y + 1, z], [x + 1, y + 1, z]];
            Vec4::from(points.each(|point| self.signed_count(corner, point)))
        };
        Corner([plane(z), plane(z + 1)])
    }

    /// Returns the term of a box's corner in the number of entries if the corner is at a grid
    /// point.
    fn signed_count(&self, corner: usize, point: [usize; 3]) -> f32 {
        let high = [0, 1, 2].each(|axis| corner >> axis & 1);
        let sign = high.each(|high| if high == 1 { 1.0 } else { -1.0 });
        let starts = self.starts[(point[2] * POINTS + point[1]) * POINTS + point[0]];
        let mut sum = sign[0] * sign[1] * sign[2] * starts as f64;
        for axis in 0..3 {
            let [u, v] = OTHERS[axis];
            // Segments enter the lower face upwards and the upper face downwards.
            let faces = &self.faces[axis][high[axis]];
            let flux = faces[(point[axis] * POINTS + point[v]) * POINTS + point[u]];
            sum += sign[u] * sign[v] * flux as f64;
        }
        sum as f32
    }
}

fn cells() -> impl Iterator<Item = [usize; 3]> {
    (0..CELLS * CELLS * CELLS).map(|i| [i % CELLS, i / CELLS % CELLS, i / (CELLS * CELLS)])
}

/// Returns the index of the face of a cell that is in a plane.
fn face(axis: usize, plane: usize, cell: [usize; 3]) -> usize {
    let [u, v] = OTHERS[axis];
    (plane * CELLS + cell[v]) * CELLS + cell[u]
}

/// Returns the sums of all cells below each grid point: `[z][y][x]`.
fn summed_starts(starts: &[u32]) -> Vec<i64> {
    let mut sums = vec![0; POINTS * POINTS];
    sums.extend(summed_faces(starts));
    for i in POINTS * POINTS..sums.len() {
        sums[i] += sums[i - POINTS * POINTS];
    }
    sums
}

/// Returns, in each plane, the sums of all faces below each grid point: `[plane][v][u]`.
fn summed_faces(faces: &[u32]) -> Vec<i64> {
    let mut sums = vec![0i64; faces.len() / (CELLS * CELLS) * POINTS * POINTS];
    for (row, faces) in faces.chunks(CELLS).enumerate() {
        let (plane, v) = (row / CELLS, row % CELLS + 1);
        let point = |u: usize, v: usize| (plane * POINTS + v) * POINTS + u;
        let mut sum = 0;
        for (u, &face) in (1..).zip(faces) {
            sum += i64::from(face);
            sums[point(u, v)] = sum + sums[point(u, v - 1)];
        }
    }
    sums
}
