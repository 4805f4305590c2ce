//! Trees: found over boxes or triangles, improved, measured, saved, loaded, and lent as nodes.

use crate::failure::{BvhStatus, Failure, array, given, given_mut, made, slice, status};
use bvh_search::bvh_core::Primitives;
use bvh_search::bvh_core::cost::{Objective, SahConstants};
use bvh_search::bvh_core::export::{FirstCountNode, Target};
use bvh_search::prelude::*;
use bvh_search::bvh_core::glam::{DMat3, DVec3};
use bvh_search::{Frames, Objects, Observer, Options, OwnedTree};
use std::ffi::{CStr, c_char, c_void};
use std::mem::offset_of;
use std::sync::Arc;

/// A tree with its objects. Any number of threads may read a tree at the same time. A thread that
/// improves or frees it must be the only user.
pub struct BvhTree {
    /// Tracers share the tree until it is improved.
    pub(crate) owned: Arc<OwnedTree>,
    nodes: Vec<FirstCountNode>,
}

/// A binary node of 32 bytes with the layout of tinybvh's `BVH::BVHNode`. Node 0 is the root. If
/// there are more nodes, node 1 is unused, so that both children of a node share a cache line.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhNode {
    /// The lower corner of the box.
    pub min: [f32; 3],
    /// The index of the first of two adjacent children, or the position of the leaf's first object
    /// id.
    pub first: u32,
    /// The upper corner of the box.
    pub max: [f32; 3],
    /// The number of object ids of a leaf; 0 for an inner node.
    pub count: u32,
}

// `bvh_tree_nodes` lends the library's nodes as these.
const _: () = assert!(
    size_of::<BvhNode>() == size_of::<FirstCountNode>()
        && align_of::<BvhNode>() == align_of::<FirstCountNode>()
        && offset_of!(BvhNode, min) == offset_of!(FirstCountNode, min)
        && offset_of!(BvhNode, first) == offset_of!(FirstCountNode, first)
        && offset_of!(BvhNode, max) == offset_of!(FirstCountNode, max)
        && offset_of!(BvhNode, count) == offset_of!(FirstCountNode, count)
);

/// A kind of cost. Tree files use the same numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhCost {
    /// The total half area of the inner nodes' boxes.
    InternalArea = 0,
    /// The cost of Goldsmith and Salmon.
    GoldsmithSalmon = 1,
    /// The surface area heuristic with both constants 1.
    Sah = 2,
    /// The cost of the layout that `bvh_tracer_new` makes.
    Layout = 3,
}

/// Searches for the best tree over `count` boxes for about `seconds`, 0 or more. Each box is 6
/// floats: the lower corner, then the upper corner.
///
/// `boxes` points to 6 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_from_boxes(
    boxes: *const f32,
    count: usize,
    seconds: f64,
) -> *mut BvhTree {
    made(|| {
        // SAFETY: `boxes` points to 6 floats for each of `count` boxes.
        let boxes = unsafe { boxes_of(boxes, count) }?;
        found(boxes, &Options::default(), Some(seconds))
    })
}

/// Searches for the best tree over `count` triangles for about `seconds`, 0 or more. Each triangle
/// is 9 floats: three corners. With `references` above 1, up to 16, triangles may be divided among
/// leaves, on average into that many parts each.
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
        // SAFETY: `corners` points to 9 floats for each of `count` triangles.
        let triangles = unsafe { triangles_of(corners, count) }?;
        let frame = Frames::File;
        found(triangles, &Options { references, frame, ..Options::default() }, Some(seconds))
    })
}

/// A search with every choice. Fields that are 0 or null have their defaults; either `boxes` or
/// `corners` is given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvhBake {
    /// 6 floats for each of `count` boxes: the lower corner, then the upper corner.
    pub boxes: *const f32,
    /// 9 floats for each of `count` triangles: three corners.
    pub corners: *const f32,
    /// The number of boxes or triangles.
    pub count: usize,
    /// 6 floats for each of `ray_count` recorded rays that the tree is for: its origin, then its
    /// hit or a point outside the scene.
    pub rays: *const f32,
    /// The number of rays; 0 for a tree for random lines.
    pub ray_count: usize,
    /// The average number of parts into which triangles may be divided among leaves, up to 16; 0 is
    /// 1, for whole triangles.
    pub references: f64,
    /// The time of the search in seconds, if there is no `work` or if it is not 0.
    pub seconds: f64,
    /// The largest number of nodes created or visited; 0 is no limit. With `work` and without
    /// `seconds`, the tree is the same on every machine, and the same as from Python and from the
    /// program `bvh`.
    pub work: u64,
    /// The seed of the random numbers, which is 1 by default in Python and in the program `bvh`.
    pub seed: u64,
    /// 1 lets the boxes of triangles lie in a frame where that saves area, as by default in Python
    /// and in the program `bvh`: they are then no boxes for other tracers. 0 keeps the axes.
    pub frame: u32,
}

/// Searches for the best tree with these choices.
///
/// `bake` is a search whose arrays have the promised lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_bake(bake: *const BvhBake) -> *mut BvhTree {
    made(|| {
        // SAFETY: `bake` is null or points to a search.
        let bake = *unsafe { given("bake", bake) }?;
        let BvhBake { boxes, corners, count, rays, ray_count, seconds, work, seed, .. } = bake;
        let frame = match bake.frame {
            0 => Frames::File,
            1 => Frames::Auto,
            other => return Err(Failure::invalid(format!("frame is {other}; accepted: 0 or 1"))),
        };
        let objects = match (boxes.is_null(), corners.is_null()) {
            // SAFETY: `corners` points to 9 floats for each of `count` triangles.
            (true, _) => unsafe { triangles_of(corners, count) }?,
            // SAFETY: `boxes` points to 6 floats for each of `count` boxes.
            (false, true) => unsafe { boxes_of(boxes, count) }?,
            (false, false) => {
                return Err(Failure::invalid("boxes and corners; accepted: one of the two"));
            }
        };
        // SAFETY: `rays` points to 6 floats for each of `ray_count` rays.
        let rays = unsafe { slice("rays", rays.cast::<[[f32; 3]; 2]>(), ray_count) }?;
        let rays: Vec<Segment> = rays.iter().map(|&[from, to]| Segment { from, to }).collect();
        let references = if bake.references == 0.0 { 1.0 } else { bake.references };
        let max_work = (work > 0).then_some(work);
        let budget = Budget { max_work, ..Budget::UNLIMITED };
        let options = Options { references, seed, budget, rays: &rays, frame };
        let is_timed = max_work.is_none() || seconds != 0.0;
        found(objects, &options, is_timed.then_some(seconds))
    })
}

/// Improves a tree for about `seconds`, 0 or more. Arrays from `bvh_tree_nodes` and
/// `bvh_tree_object_ids` become invalid.
///
/// `tree` is a tree that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_improve(tree: *mut BvhTree, seconds: f64) -> BvhStatus {
    // SAFETY: the caller promises that no other thread uses the tree, and there is no function to
    // call.
    unsafe { bvh_tree_improve_until(tree, seconds, None, std::ptr::null_mut()) }
}

/// Improves a tree like `bvh_tree_improve`, and ends soon after `cancelled(context)` returns a
/// number other than 0. The tree is then the best one so far, and the call succeeds. To cancel a
/// search from its beginning, create the tree in 0 seconds first.
///
/// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws no
/// exception and that any number of threads may call at the same time until this call returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_improve_until(
    tree: *mut BvhTree,
    seconds: f64,
    cancelled: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    context: *mut c_void,
) -> BvhStatus {
    status(|| {
        // SAFETY: no other thread uses the tree during the call.
        let tree = unsafe { given_mut("tree", tree) }?;
        let until = Until { deadline: deadline(seconds)?, cancelled, context };
        let improvement =
            tree.owned.improvement(Budget::UNLIMITED, &until).map_err(Failure::invalid)?;
        Arc::make_mut(&mut tree.owned).apply(improvement);
        tree.nodes = tree.owned.tree().to_first_count_aligned();
        Ok(())
    })
}

/// Ends a search at its deadline or when the caller cancels it.
struct Until {
    deadline: Deadline,
    cancelled: Option<unsafe extern "C" fn(*mut c_void) -> u8>,
    context: *mut c_void,
}

// SAFETY: the context is passed only to the caller's function, which any number of threads may call
// at the same time.
unsafe impl Sync for Until {}

impl Observer for Until {
    fn cancelled(&self) -> bool {
        if self.deadline.cancelled() {
            return true;
        }
        let Some(cancelled) = self.cancelled else { return false };
        // SAFETY: any thread may call the function with this context until the search has ended.
        unsafe { cancelled(self.context) != 0 }
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.progress()
    }
}

/// Writes the cost of the kind `kind`, one of `BvhCost`, to `cost`.
///
/// `tree` is a tree; `cost` points to a double.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_cost(
    tree: *const BvhTree,
    kind: u32,
    cost: *mut f64,
) -> BvhStatus {
    status(|| {
        // A parameter of an enum's type would be undefined behaviour for any other number from C.
        let kinds = [
            (BvhCost::InternalArea, Objective::InternalArea),
            (BvhCost::GoldsmithSalmon, Objective::GoldsmithSalmon),
            (BvhCost::Sah, Objective::Sah(SahConstants::default())),
            (BvhCost::Layout, Objective::Layout),
        ];
        let found = kinds.iter().find(|(number, _)| *number as u32 == kind);
        let Some((_, objective)) = found else {
            return Err(Failure::invalid(format!("kind is {kind}; accepted: 0 to 3")));
        };
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: `cost` points to a double that nobody else uses during the call.
        let cost = unsafe { given_mut("cost", cost) }?;
        *cost = tree.owned.cost(*objective);
        Ok(())
    })
}

/// Writes the frame of the tree's boxes: 9 numbers, the rows of a rotation, then 3, a centre. The
/// boxes contain rotation * (p - centre) for the points p of their objects. Without a frame, these
/// are the identity and 0.
///
/// `tree` is a tree; `frame` points to 12 doubles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_frame(tree: *const BvhTree, frame: *mut f64) -> BvhStatus {
    status(|| {
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: `frame` points to 12 doubles that nobody else uses during the call.
        let numbers = unsafe { given_mut("frame", frame.cast::<[[f64; 3]; 4]>()) }?;
        let frame = tree.owned.tree().frame;
        let rows = frame.map_or(DMat3::IDENTITY, |frame| frame.rotation()).transpose();
        let [x, y, z] = rows.to_cols_array_2d();
        *numbers = [x, y, z, frame.map_or(DVec3::ZERO, |frame| frame.centre()).to_array()];
        Ok(())
    })
}

/// Returns the nodes of the tree, and writes their number to `count`. The nodes belong to the tree
/// and are valid until it is improved or freed. Their boxes lie in its frame, if it has one: see
/// `bvh_tree_frame`.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_nodes(tree: *const BvhTree, count: *mut usize) -> *const BvhNode {
    array(|| {
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: `count` points to a size that nobody else uses during the call.
        let count = unsafe { given_mut("count", count) }?;
        *count = tree.nodes.len();
        Ok(tree.nodes.as_ptr().cast())
    })
}

/// Returns the object ids, to which leaves refer by position, and writes their number to `count`.
/// The ids belong to the tree and are valid until it is improved or freed.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_object_ids(
    tree: *const BvhTree,
    count: *mut usize,
) -> *const u32 {
    array(|| {
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: `count` points to a size that nobody else uses during the call.
        let count = unsafe { given_mut("count", count) }?;
        let ids = &tree.owned.tree().prim_ids;
        *count = ids.len();
        Ok(ids.as_ptr())
    })
}

/// Loads the tree over these boxes, given as for `bvh_tree_from_boxes`, from the file `path`, in
/// UTF-8.
///
/// `path` is a string; `boxes` points to 6 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_load_boxes(
    path: *const c_char,
    boxes: *const f32,
    count: usize,
) -> *mut BvhTree {
    made(|| {
        // SAFETY: `path` is null or ends with a zero.
        let path = unsafe { text("path", path) }?;
        // SAFETY: `boxes` points to 6 floats for each of `count` boxes.
        let boxes = unsafe { boxes_of(boxes, count) }?;
        loaded(path, boxes)
    })
}

/// Loads the tree over these triangles, given as for `bvh_tree_from_triangles`, from the file
/// `path`, in UTF-8.
///
/// `path` is a string; `corners` points to 9 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_load_triangles(
    path: *const c_char,
    corners: *const f32,
    count: usize,
) -> *mut BvhTree {
    made(|| {
        // SAFETY: `path` is null or ends with a zero.
        let path = unsafe { text("path", path) }?;
        // SAFETY: `corners` points to 9 floats for each of `count` triangles.
        let triangles = unsafe { triangles_of(corners, count) }?;
        loaded(path, triangles)
    })
}

/// Writes the tree to the file `path`, in UTF-8. An existing file is replaced when the new one is
/// complete; a failure leaves the old one.
///
/// `tree` is a tree; `path` is a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_save(tree: *const BvhTree, path: *const c_char) -> BvhStatus {
    status(|| {
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: `path` is null or ends with a zero.
        let path = unsafe { text("path", path) }?;
        let bytes = tree.owned.save().map_err(Failure::invalid)?;
        Ok(bvh_scenes::files::write(path.as_ref(), &bytes)?)
    })
}

/// Writes the tree to the file `path`, in UTF-8, for the tracer of another library, by its name for
/// `bvh export` (docs/INTEROP.md). The file is the same as of that command.
///
/// `tree` is a tree; `tracer` and `path` are strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_export(
    tree: *const BvhTree,
    tracer: *const c_char,
    path: *const c_char,
) -> BvhStatus {
    status(|| {
        // SAFETY: nobody changes the tree during the call.
        let tree = unsafe { given("tree", tree) }?;
        // SAFETY: both are null or end with a zero.
        let [tracer, path] = unsafe { [text("tracer", tracer)?, text("path", path)?] };
        let target = Target::named(tracer)
            .map_err(|unknown| Failure::invalid(format!("tracer is {unknown}")))?;
        let bytes = tree.owned.export(&target).map_err(Failure::invalid)?;
        Ok(bvh_scenes::files::write(path.as_ref(), &bytes)?)
    })
}

/// Frees a tree. Ignores null. Tracers of the tree remain valid.
///
/// `tree` is null, or a tree that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tree_free(tree: *mut BvhTree) {
    if !tree.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(tree) });
    }
}

fn whole(owned: OwnedTree) -> BvhTree {
    BvhTree { nodes: owned.tree().to_first_count_aligned(), owned: Arc::new(owned) }
}

fn found(objects: Objects, options: &Options, seconds: Option<f64>) -> Result<BvhTree, Failure> {
    let deadline = seconds.map(deadline).transpose()?;
    let observer = deadline.as_ref().map_or(&() as &dyn Observer, |deadline| deadline);
    OwnedTree::find(objects, options, observer).map(whole).map_err(Failure::invalid)
}

fn loaded(path: &str, objects: Objects) -> Result<BvhTree, Failure> {
    let bytes = bvh_scenes::tree_file::read(path.as_ref())?;
    let loaded = OwnedTree::load(objects, &bytes);
    loaded.map(whole).map_err(|error| Failure::invalid(format!("{path}: {error}")))
}

fn deadline(seconds: f64) -> Result<Deadline, Failure> {
    Duration::try_from_secs_f64(seconds)
        .map(Deadline::after)
        .map_err(|_| Failure::invalid(format!("seconds is {seconds:?}; accepted: 0 to 1e19")))
}

/// Copies boxes.
///
/// # Safety
/// `first` points to 6 · `count` floats.
unsafe fn boxes_of(first: *const f32, count: usize) -> Result<Objects, Failure> {
    // SAFETY: an `Aabb` is `repr(C)` with 6 floats, and `first` points to that many for each box.
    let boxes = unsafe { slice("boxes", first.cast::<Aabb>(), count) }?.to_vec();
    Ok(Objects::Boxes(boxes))
}

/// Copies triangles.
///
/// # Safety
/// `first` points to 9 · `count` floats.
unsafe fn triangles_of(first: *const f32, count: usize) -> Result<Objects, Failure> {
    // SAFETY: a `Triangle` is `repr(C)` with 9 floats, and `first` points to that many for each
    // triangle.
    let triangles = unsafe { slice("corners", first.cast::<Triangle>(), count) }?.to_vec();
    Ok(Objects::Shapes(Primitives::Triangles(triangles)))
}

/// Returns a string of C as text.
///
/// # Safety
/// `string` is null, or a string that ends with a zero and that nobody changes while the result is
/// in use.
unsafe fn text<'a>(name: &str, string: *const c_char) -> Result<&'a str, Failure> {
    // SAFETY: a pointer that is not null points to a string that ends with a zero.
    let string = unsafe { CStr::from_ptr(given(name, string)?) };
    string.to_str().map_err(|_| Failure::invalid(format!("{name} is not UTF-8")))
}
