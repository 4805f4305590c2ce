//! The contents of a mesh file, and the faults of all formats.

use bvh_core::{Aabb, Corners, DTriangle, Primitives, Triangle};
use glam::DVec3;
use std::fmt;
use std::marker::PhantomData;

/// The largest number of triangles that one file may contain. Together with boxes and a tree they
/// need ten gigabytes. The limit matters because a small file can name one mesh many times.
pub const MOST_TRIANGLES: usize = 100_000_000;

/// A triangle of a mesh: in f32, or in f64 with the coordinates that the file has.
pub trait FromFile: Corners {
    /// Rounds a coordinate once. It may be infinite then.
    fn round(exact: f64) -> f64;

    /// Returns the rounded number that a word spells.
    fn parse(word: &str) -> Option<f64>;

    /// Makes a triangle from rounded corners.
    fn of(corners: [DVec3; 3]) -> Self;

    /// Returns whether the corners coincide or are collinear.
    fn is_degenerate(&self) -> bool;

    /// Returns the objects of a scene.
    fn primitives(triangles: Vec<Self>) -> Primitives;
}

impl FromFile for Triangle {
    fn round(exact: f64) -> f64 {
        f64::from(exact as f32)
    }

    fn parse(word: &str) -> Option<f64> {
        // Twice rounded, a number may be another.
        word.parse::<f32>().ok().map(f64::from)
    }

    fn of(corners: [DVec3; 3]) -> Self {
        Self(corners.map(|corner| corner.as_vec3()))
    }

    fn is_degenerate(&self) -> bool {
        self.is_degenerate()
    }

    fn primitives(triangles: Vec<Self>) -> Primitives {
        Primitives::Triangles(triangles)
    }
}

impl FromFile for DTriangle {
    fn round(exact: f64) -> f64 {
        exact
    }

    fn parse(word: &str) -> Option<f64> {
        word.parse().ok()
    }

    fn of(corners: [DVec3; 3]) -> Self {
        corners.map(|corner| corner.to_array()).into()
    }

    fn is_degenerate(&self) -> bool {
        self.is_degenerate()
    }

    fn primitives(triangles: Vec<Self>) -> Primitives {
        Primitives::Doubles(triangles)
    }
}

/// The triangles of one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<T = Triangle> {
    /// The triangles in world units with finite corners, in the order of the file across its
    /// objects and groups. A face of n ≥ 3 vertices becomes n − 2 triangles: the fan around its
    /// first vertex where that covers the face, otherwise triangles between its vertices that do.
    pub triangles: Vec<T>,
    /// The file's contents besides plain triangles, one clause for each kind.
    pub remarks: Vec<String>,
}

impl<T: FromFile> Mesh<T> {
    /// Creates a mesh of these triangles. Adds a remark on those without area (collinear or
    /// repeated corners), which stay in the mesh, to the given remarks.
    pub fn new(triangles: Vec<T>, mut remarks: Vec<String>) -> Self {
        let degenerate = triangles.iter().filter(|triangle| triangle.is_degenerate()).count();
        remarks.extend(counted("triangles without area", degenerate));
        Self { triangles, remarks }
    }

    /// Joins the remarks to one sentence, if there are any.
    pub fn remark(&self) -> Option<String> {
        (!self.remarks.is_empty()).then(|| self.remarks.join("; "))
    }
}

/// Returns a clause about `count` things, and nothing if there are none.
pub(super) fn counted(things: &str, count: usize) -> Option<String> {
    (count > 0).then(|| format!("{things}: {count}"))
}

/// What coordinates lose when they are rounded to those of triangles `T`.
pub(super) struct Rounding<T> {
    /// The largest loss by the exponent of the rounded number, so that the far vertices that no
    /// face uses do not count.
    lost: [f64; 256],
    of: PhantomData<T>,
}

impl<T> Default for Rounding<T> {
    fn default() -> Self {
        Self { lost: [0.0; 256], of: PhantomData }
    }
}

impl<T: FromFile> Rounding<T> {
    /// The loss that matters, as a fraction of the smallest extent of a mesh.
    const MOST: f64 = 1e-4;

    pub fn round(&mut self, exact: f64) -> f64 {
        let rounded = T::round(exact);
        self.note(rounded, || Some(exact));
        rounded
    }

    /// Notes the loss of a number, and asks for the exact one only if no number of about this size
    /// has lost nearly as much as possible.
    pub fn note(&mut self, rounded: f64, exact: impl FnOnce() -> Option<f64>) {
        let single = rounded as f32;
        let lost = &mut self.lost[exponent(single)];
        // Half the distance of the next number; 0 for subnormal ones, which no move would help.
        let power = f32::from_bits(single.to_bits() & f32::INFINITY.to_bits());
        let most = f64::from(power) * f64::from(f32::EPSILON) / 2.0;
        if *lost < 0.9 * most
            && let Some(exact) = exact().filter(|exact| exact.is_finite())
        {
            *lost = lost.max((exact - rounded).abs());
        }
    }

    /// Returns a clause about the loss of a mesh if it matters.
    pub fn remark(&self, triangles: &[T]) -> Option<String> {
        let boxes = triangles.iter().map(|triangle| triangle.aabb_in(None));
        let bounds = boxes.fold(Aabb::EMPTY, |all, b| all.union(&b));
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        let lost = self.lost[..=exponent(largest)].iter().copied().fold(0.0, f64::max);
        let extents = bounds.extent().to_array().into_iter().filter(|&extent| extent > 0.0);
        let smallest = extents.reduce(f64::min).unwrap_or(0.0);
        (lost > Self::MOST * smallest).then(|| {
            format!(
                "coordinates lose up to {lost:.1e} by rounding to single precision, and the \
                 smallest extent is {smallest:.1e}, so move the mesh to the origin"
            )
        })
    }
}

/// Returns the exponent in the bits of a number, without its bias.
fn exponent(number: f32) -> usize {
    (number.to_bits() >> 23 & 0xff) as usize
}

/// Vertices that often show that an export went wrong.
pub(super) const UNUSED: &str = "vertices that no face uses";
/// Bytes after the last triangle.
pub(super) const AFTER_END: &str = "bytes ignored at the end";

/// The reason why a file was rejected, in the words of its format: the place in the file, what was
/// found there, and what would be accepted. Its text follows the path of the file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {message}")]
pub struct Fault {
    place: String,
    message: String,
}

impl Fault {
    /// Creates a fault of the whole file.
    pub fn of_file(message: impl fmt::Display) -> Self {
        // A message must fit a terminal, whatever names and numbers the file contains.
        Self { place: String::new(), message: shortened(&message.to_string(), 300) }
    }

    /// Creates a fault of a line, counted from 1. A continued statement has the number of its first
    /// line.
    pub fn in_line(line: usize, message: impl fmt::Display) -> Self {
        Self { place: format!(":{line}"), ..Self::of_file(message) }
    }

    /// Creates a fault of a part of the file, with the name or number that its format gives it.
    pub fn of(part: &str, message: impl fmt::Display) -> Self {
        Self { place: format!(": {}", shortened(part, 80)), ..Self::of_file(message) }
    }
}

/// Makes a text of a file, or of a parser that quotes the file, one line of at most `most`
/// printable characters.
pub(super) fn shortened(text: &str, most: usize) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let line: String = words.join(" ").chars().filter(|c| !c.is_control()).collect();
    if line.chars().nth(most).is_none() {
        return line;
    }
    let beginning: String = line.chars().take(most - 1).collect();
    format!("{beginning}…")
}
