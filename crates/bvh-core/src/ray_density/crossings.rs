//! Counts where segments start and which faces of grid cells they cross, and sums the counts into tables.

use super::{Cell, Corner};
use alloc::vec;
use alloc::vec::Vec;
use glam::DVec3;

/// Cells of the grid along each axis.
pub(super) const CELLS: usize = 32;
/// Grid points along each axis.
const POINTS: usize = CELLS + 1;

/// A cell's place in tables.
#[inline]
pub(super) fn index(cell: [usize; 3]) -> usize {
    (cell[2] * CELLS + cell[1]) * CELLS + cell[0]
}

/// Where segments start and which faces of cells they cross.
pub(super) struct Crossings {
    /// Segments that meet the grid.
    pub segments: u32,
    /// Per cell.
    starts: Vec<u32>,
    /// `[axis][downward][plane][cell of the plane]`.
    faces: [[Vec<u32>; 2]; 3],
}

/// The two other axes, in their order.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

impl Crossings {
    pub fn new() -> Self {
        let faces = || [0, 1].map(|_| vec![0; POINTS * CELLS * CELLS]);
        Self { segments: 0, starts: vec![0; CELLS * CELLS * CELLS], faces: [faces(), faces(), faces()] }
    }

    /// Records a segment given in cells: the cells that it visits within the grid, face by face.
    pub fn record(&mut self, from: DVec3, to: DVec3) {
        let ray = to - from;
        let most = CELLS as f64;
        // The part within the grid.
        let (mut first, mut last, mut entered) = (0.0f64, 1.0f64, None);
        for axis in 0..3 {
            if ray[axis] == 0.0 {
                if !(0.0..=most).contains(&from[axis]) {
                    return;
                }
                continue;
            }
            let (near, far) = if ray[axis] > 0.0 { (0.0, most) } else { (most, 0.0) };
            let (enter, leave) = ((near - from[axis]) / ray[axis], (far - from[axis]) / ray[axis]);
            if enter > first {
                (first, entered) = (enter, Some(axis));
            }
            last = last.min(leave);
        }
        if first > last {
            return;
        }
        self.segments += 1;
        let cell_at = |t: f64| {
            [0, 1, 2].map(|axis| ((from[axis] + t * ray[axis]).clamp(0.0, most) as usize).min(CELLS - 1))
        };
        let (mut cell, end) = (cell_at(first), cell_at(last));
        match entered {
            None => self.starts[index(cell)] += 1,
            Some(axis) => {
                cell[axis] = if ray[axis] > 0.0 { 0 } else { CELLS - 1 };
                self.cross(axis, ray[axis] < 0.0, cell);
            }
        }
        // From cell to cell, through the face that comes first, until the last cell: each axis takes exactly the steps
        // that it has to go, so that the way ends there whatever the rounding.
        while cell != end {
            let when = |axis: usize| {
                if cell[axis] == end[axis] {
                    return f64::INFINITY;
                }
                let plane = if cell[axis] < end[axis] { cell[axis] + 1 } else { cell[axis] };
                let t = (plane as f64 - from[axis]) / ray[axis];
                if t.is_nan() { 0.0 } else { t.min(f64::MAX) }
            };
            let times = [when(0), when(1), when(2)];
            let axis = (0..3).min_by(|&a, &b| times[a].total_cmp(&times[b])).unwrap_or(0);
            let downward = end[axis] < cell[axis];
            cell[axis] = if downward { cell[axis] - 1 } else { cell[axis] + 1 };
            self.cross(axis, downward, cell);
        }
    }

    /// Records that a segment has come into a cell across an axis.
    fn cross(&mut self, axis: usize, downward: bool, into: [usize; 3]) {
        let plane = into[axis] + usize::from(downward);
        self.faces[axis][usize::from(downward)][face(axis, plane, into)] += 1;
    }

    /// The tables of signed counts, one per corner of a box; see [the measure](super).
    pub fn corner_tables(&self) -> Vec<Corner> {
        let starts = summed_starts(&self.starts);
        let faces = [0, 1, 2].map(|axis| [0, 1].map(|way| summed_faces(&self.faces[axis][way])));
        let point = |at: [usize; 3]| (at[2] * POINTS + at[1]) * POINTS + at[0];
        let value = |corner: usize, at: [usize; 3]| -> f32 {
            let high = [0, 1, 2].map(|axis| corner >> axis & 1);
            let sign = high.map(|high| if high == 1 { 1.0 } else { -1.0 });
            let mut sum = sign[0] * sign[1] * sign[2] * starts[point(at)] as f64;
            for axis in 0..3 {
                let [u, v] = OTHERS[axis];
                // The lower face is entered upward, the upper one downward.
                let flux = faces[axis][high[axis]][(at[axis] * POINTS + at[v]) * POINTS + at[u]];
                sum += sign[u] * sign[v] * flux as f64;
            }
            sum as f32
        };
        let around = |cell: [usize; 3], corner| {
            Corner(core::array::from_fn(|i| {
                value(corner, [cell[0] + (i & 1), cell[1] + (i >> 1 & 1), cell[2] + (i >> 2)])
            }))
        };
        cells().flat_map(|cell| (0..8).map(move |corner| around(cell, corner))).collect()
    }

    /// For each cell, the flux through its faces and its starts as linear functions of a box's ends.
    pub fn cell_table(&self) -> Vec<Cell> {
        let of_cell = |cell: [usize; 3]| {
            let mut rows = [0.0; 16];
            for axis in 0..3 {
                let flux =
                    |way: usize, upper| self.faces[axis][way][face(axis, cell[axis] + upper, cell)] as f32;
                rows[axis] = (flux(0, 0) + flux(1, 0)) * super::FRACTIONS as f32;
                rows[4 + axis] = flux(0, 1) - flux(0, 0);
                rows[8 + axis] = flux(1, 1) - flux(1, 0);
            }
            rows[12] = self.starts[index(cell)] as f32;
            Cell(rows)
        };
        cells().map(of_cell).collect()
    }
}

/// All cells in the order of tables.
fn cells() -> impl Iterator<Item = [usize; 3]> {
    (0..CELLS * CELLS * CELLS).map(|i| [i % CELLS, i / CELLS % CELLS, i / (CELLS * CELLS)])
}

/// Index of the face of a cell that lies in a plane.
fn face(axis: usize, plane: usize, cell: [usize; 3]) -> usize {
    let [u, v] = OTHERS[axis];
    (plane * CELLS + cell[v]) * CELLS + cell[u]
}

/// Sums of all cells below each grid point: `[z][y][x]`.
fn summed_starts(starts: &[u32]) -> Vec<i64> {
    let mut sums = vec![0i64; POINTS * POINTS * POINTS];
    let at = |x: usize, y: usize, z: usize| (z * POINTS + y) * POINTS + x;
    for z in 1..POINTS {
        for y in 1..POINTS {
            let mut row = 0;
            for x in 1..POINTS {
                row += i64::from(starts[index([x - 1, y - 1, z - 1])]);
                sums[at(x, y, z)] =
                    row + sums[at(x, y - 1, z)] + sums[at(x, y, z - 1)] - sums[at(x, y - 1, z - 1)];
            }
        }
    }
    sums
}

/// In each plane, the sums of all faces below each grid point: `[plane][v][u]`.
fn summed_faces(faces: &[u32]) -> Vec<i64> {
    let mut sums = vec![0i64; POINTS * POINTS * POINTS];
    for plane in 0..POINTS {
        let at = |u: usize, v: usize| (plane * POINTS + v) * POINTS + u;
        for v in 1..POINTS {
            let mut row = 0;
            for u in 1..POINTS {
                row += i64::from(faces[(plane * CELLS + v - 1) * CELLS + u - 1]);
                sums[at(u, v)] = row + sums[at(u, v - 1)];
            }
        }
    }
    sums
}
