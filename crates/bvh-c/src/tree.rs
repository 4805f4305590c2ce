//! Trees: made from boxes or triangles, improved, measured, saved, loaded, and lent as nodes.

use crate::failure::{BvhStatus, Failure, array, given, given_mut, made, slice, status};
use bvh_search::bvh_core::{FirstCountNode, Primitives, cost::Objective, cost::SahConstants};
use bvh_search::prelude::*;
use bvh_search::{Objects, Observer, OwnedTree};
use std::ffi::{CStr, c_char, c_void};

/// A tree with its objects. Any number of threads may read one at the same time; whoever improves or frees it must be alone.
pub struct BvhTree {
    pub(crate) owned: OwnedTree,
    nodes: Vec<BvhNode>,
}

/// A binary node of 32 bytes, as tinybvh's `BVH::BVHNode`. Node 0 is the root. Where there are more, node 1 is not used, so that both
/// children of a node share a cache line.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhNode {
    /// Lower corner of the box.
    pub min: [f32; 3],
    /// Index of the first of two adjacent children, or position of the leaf's first object id.
    pub first: u32,
    /// Upper corner of the box.
    pub max: [f32; 3],
    /// Number of object ids of a leaf; 0 for an inner node.
    pub count: u32,
}

/// What a cost is; the numbers are those of tree files.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhCost {
    /// Total half area of the inner nodes' boxes.
    InternalArea = 0,
    /// Goldsmith and Salmon's.
    GoldsmithSalmon = 1,
    /// The surface area heuristic with both constants 1.
    Sah = 2,
    /// The layout that `bvh_tracer_new` makes.
    Layout = 3,
}

/// The best tree over `count` boxes that is found in about `seconds`, 0 or more. Each box is 6 floats: lower corner, upper corner.
///
/// `boxes` points to 6 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_from_boxes(
    boxes: *const f32,
    count: usize,
    seconds: f64,
) -> *mut BvhTree {
    made(|| {
        // SAFETY: promised by the caller.
        let boxes = unsafe { boxes_of(boxes, count) }?;
        found(boxes, 1.0, seconds)
    })
}

/// The best tree over `count` triangles that is found in about `seconds`, 0 or more. Each triangle is 9 floats: three corners.
/// With `references` above 1, up to 16, triangles may be divided among leaves, into so many parts each on average.
///
/// `corners` points to 9 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_from_triangles(
    corners: *const f32,
    count: usize,
    seconds: f64,
    references: f64,
) -> *mut BvhTree {
    made(|| {
        if !(1.0..=16.0).contains(&references) {
            return Err(Failure::invalid(format!("references is {references}; accepted: 1 to 16")));
        }
        // SAFETY: promised by the caller.
        let triangles = unsafe { triangles_of(corners, count) }?;
        found(triangles, references, seconds)
    })
}

/// Improves a tree for about `seconds`, 0 or more. Arrays that `bvh_tree_nodes` and `bvh_tree_object_ids` lent end here.
///
/// `tree` is a tree that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_improve(tree: *mut BvhTree, seconds: f64) -> BvhStatus {
    // SAFETY: promised by the caller.
    unsafe { bvh_tree_improve_until(tree, seconds, None, std::ptr::null_mut()) }
}

/// As `bvh_tree_improve`, and ends soon after `cancelled(context)` is not 0, with the best tree until then, which is no failure. To
/// cancel a search from its beginning, make the tree in 0 seconds first.
///
/// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws nothing, and that any threads may call, several
/// at once, until this returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_improve_until(
    tree: *mut BvhTree,
    seconds: f64,
    cancelled: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    context: *mut c_void,
) -> BvhStatus {
    status(|| {
        // SAFETY: promised by the caller.
        let tree = unsafe { given_mut("tree", tree) }?;
        let until = Until { deadline: deadline(seconds)?, cancelled, context };
        tree.owned
            .improve(&until)
            .map_err(Failure::invalid)?;
        tree.nodes = nodes(&tree.owned);
        Ok(())
    })
}

/// Ends a search at its deadline, or when the caller says so.
struct Until {
    deadline: Deadline,
    cancelled: Option<unsafe extern "C" fn(*mut c_void) -> u8>,
    context: *mut c_void,
}

// SAFETY: the context goes to nothing but the caller's function, which any threads may call.
unsafe impl Sync for Until {}

impl Observer for Until {
    fn cancelled(&self) -> bool {
        // SAFETY: promised by the caller.
        self.deadline.has_passed()
            || self
                .cancelled
                .is_some_and(|cancelled| unsafe { cancelled(self.context) } != 0)
    }

    fn progress(&self) -> Option<f64> {
        Some(self.deadline.fraction())
    }
}

/// Writes a cost of the tree, one of `BvhCost`, to `cost`.
///
/// `tree` is a tree; `cost` points to a double.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_cost(
    tree: *const BvhTree,
    kind: u32,
    cost: *mut f64,
) -> BvhStatus {
    status(|| {
        let kinds = [
            (BvhCost::InternalArea, Objective::InternalArea),
            (BvhCost::GoldsmithSalmon, Objective::GoldsmithSalmon),
            (BvhCost::Sah, Objective::Sah(SahConstants::default())),
            (BvhCost::Layout, Objective::Layout),
        ];
        let found = kinds
            .iter()
            .find(|(number, _)| *number as u32 == kind);
        let refused = || Failure::invalid(format!("kind is {kind}; accepted: 0 to 3"));
        let (_, objective) = found.ok_or_else(refused)?;
        // SAFETY: promised by the caller.
        let (tree, cost) = unsafe { (given("tree", tree)?, given_mut("cost", cost)?) };
        *cost = tree.owned.cost(*objective);
        Ok(())
    })
}

/// The nodes of the tree, and their number in `count`. They belong to the tree, until it is improved or freed.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_nodes(tree: *const BvhTree, count: *mut usize) -> *const BvhNode {
    array(|| {
        // SAFETY: promised by the caller.
        let (tree, count) = unsafe { (given("tree", tree)?, given_mut("count", count)?) };
        *count = tree.nodes.len();
        Ok(tree.nodes.as_ptr())
    })
}

/// The object ids that leaves name by position, and their number in `count`. They belong to the tree, until it is improved or freed.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_object_ids(
    tree: *const BvhTree,
    count: *mut usize,
) -> *const u32 {
    array(|| {
        // SAFETY: promised by the caller.
        let (tree, count) = unsafe { (given("tree", tree)?, given_mut("count", count)?) };
        let ids = &tree.owned.tree().prim_ids;
        *count = ids.len();
        Ok(ids.as_ptr())
    })
}

/// The tree over these boxes, as for `bvh_tree_from_boxes`, in the file `path`, UTF-8.
///
/// `path` is a string; `boxes` points to 6 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_load_boxes(
    path: *const c_char,
    boxes: *const f32,
    count: usize,
) -> *mut BvhTree {
    // SAFETY: promised by the caller.
    made(|| unsafe { loaded(text(path)?, boxes_of(boxes, count)?) })
}

/// The tree over these triangles, as for `bvh_tree_from_triangles`, in the file `path`, UTF-8.
///
/// `path` is a string; `corners` points to 9 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_load_triangles(
    path: *const c_char,
    corners: *const f32,
    count: usize,
) -> *mut BvhTree {
    // SAFETY: promised by the caller.
    made(|| unsafe { loaded(text(path)?, triangles_of(corners, count)?) })
}

/// Writes the tree to the file `path`, UTF-8. One that is there is replaced when the new one is complete: after a failure it is the old one.
///
/// `tree` is a tree; `path` is a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_save(tree: *const BvhTree, path: *const c_char) -> BvhStatus {
    status(|| {
        // SAFETY: promised by the caller.
        let (tree, path) = unsafe { (given("tree", tree)?, text(path)?) };
        let bytes = tree.owned.save().map_err(Failure::invalid)?;
        Ok(bvh_files::write(path.as_ref(), &bytes)?)
    })
}

/// Frees a tree. Null is left alone. Tracers of the tree stay.
///
/// `tree` is null, or a tree that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_free(tree: *mut BvhTree) {
    if !tree.is_null() {
        // SAFETY: it comes from `made`, and the caller gives it up.
        drop(unsafe { Box::from_raw(tree) });
    }
}

fn whole(owned: OwnedTree) -> BvhTree {
    BvhTree { nodes: nodes(&owned), owned }
}

fn nodes(owned: &OwnedTree) -> Vec<BvhNode> {
    let node = |FirstCountNode { min, first, max, count }| BvhNode { min, first, max, count };
    owned
        .tree()
        .to_first_count_aligned()
        .into_iter()
        .map(node)
        .collect()
}

fn found(objects: Objects, references: f64, seconds: f64) -> Result<BvhTree, Failure> {
    OwnedTree::find(objects, references, &deadline(seconds)?)
        .map(whole)
        .map_err(Failure::invalid)
}

fn loaded(path: &str, objects: Objects) -> Result<BvhTree, Failure> {
    let bytes = bvh_files::tree_file::read(path.as_ref())?;
    let loaded = OwnedTree::load(objects, &bytes);
    loaded
        .map(whole)
        .map_err(|error| Failure::invalid(format!("{path}: {error}")))
}

fn deadline(seconds: f64) -> Result<Deadline, Failure> {
    let time = Duration::try_from_secs_f64(seconds);
    let refused =
        |_| Failure::invalid(format!("seconds is {seconds}; accepted: 0 or more, finite"));
    time.map(Deadline::after).map_err(refused)
}

/// `first` points to 6 · `count` floats.
unsafe fn boxes_of(first: *const f32, count: usize) -> Result<Objects, Failure> {
    // SAFETY: promised by the caller; a box is its 6 floats.
    Ok(Objects::Boxes(unsafe { slice("boxes", first.cast::<Aabb>(), count) }?.to_vec()))
}

/// `first` points to 9 · `count` floats.
unsafe fn triangles_of(first: *const f32, count: usize) -> Result<Objects, Failure> {
    // SAFETY: promised by the caller; a triangle is its 9 floats.
    let triangles = unsafe { slice("corners", first.cast::<Triangle>(), count) }?.to_vec();
    Ok(Objects::Shapes(Primitives::Triangles(triangles)))
}

/// `path` is null or a string that ends with a zero.
unsafe fn text<'a>(path: *const c_char) -> Result<&'a str, Failure> {
    // SAFETY: promised by the caller.
    let path = unsafe { CStr::from_ptr(given("path", path)?) };
    path.to_str()
        .map_err(|_| Failure::invalid("path is not UTF-8"))
}
