//! Trees: found over boxes or triangles, improved, measured, saved, loaded, and lent as nodes.

use crate::failure::{
    BvsStatus, Failure, array, given, given_mut, made, slice, status, strided, try_made,
};
use bvh_search::bvh_core::cost::{Objective, SahConstants};
use bvh_search::bvh_core::export::{FirstCountNode, Target};
use bvh_search::bvh_core::glam::{DMat3, DVec3};
use bvh_search::bvh_core::{DRay, Primitives};
use bvh_search::prelude::*;
use bvh_search::{Anywhere, Frames, Objects, Observer, Options, OwnedTree};
use std::ffi::{CStr, c_char, c_void};
use std::fmt::Debug;
use std::ptr::null;
use std::sync::Arc;

/// A tree with its objects. Any number of threads may read a tree at the same time. A thread that
/// improves, updates or frees it must be the only user.
pub struct BvsTree {
    /// Tracers share the tree until it is improved.
    pub(crate) owned: Arc<OwnedTree>,
    nodes: Vec<FirstCountNode>,
}

/// A binary node of 32 bytes with the layout of tinybvh's `BVH::BVHNode`. Node 0 is the root. If
/// there are more nodes, node 1 is unused, so that both children of a node share a cache line.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsNode {
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

// `bvs_tree_nodes` lends the library's nodes as these.
same_layout!(BvsNode, FirstCountNode, min, first, max, count);

/// A kind of cost. Tree files use the same numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvsCost {
    /// The total half area of the inner nodes' boxes.
    InternalArea = 0,
    /// The cost of Goldsmith and Salmon.
    GoldsmithSalmon = 1,
    /// The surface area heuristic with both constants 1, relative to the root's box: in a frame
    /// that makes this box smaller it may rise, although the area falls.
    Sah = 2,
    /// The cost of the layout that `bvs_tracer_new` makes.
    Layout = 3,
}

/// Searches for the best tree over `count` boxes for about `seconds`, 0 or more. Each box is 6
/// floats: the lower corner, then the upper corner.
///
/// `boxes` points to 6 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_from_boxes(
    boxes: *const f32,
    count: usize,
    seconds: f64,
) -> *mut BvsTree {
    made(|| {
        // SAFETY: `boxes` points to 6 floats for each of `count` boxes.
        let boxes = unsafe { objects_of(&BvsObjects { count, boxes, ..BvsObjects::NONE }) }?;
        found(boxes, &Options::default(), Some(seconds))
    })
}

/// Searches for the best tree over `count` triangles for about `seconds`, 0 or more. Each triangle
/// is 9 floats: three vertices. With `references` above 1, up to 16, triangles may be divided among
/// leaves, on average into that many parts each.
///
/// `vertices` points to 9 * `count` floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_from_triangles(
    vertices: *const f32,
    count: usize,
    seconds: f64,
    references: f64,
) -> *mut BvsTree {
    made(|| {
        let triangles = BvsObjects { count, vertices, ..BvsObjects::NONE };
        // SAFETY: `vertices` points to 9 floats for each of `count` triangles.
        let triangles = unsafe { objects_of(&triangles) }?;
        let references = Some(references);
        let options = Options { references, frame: Frames::File, ..Options::default() };
        found(triangles, &options, Some(seconds))
    })
}

/// Boxes, or triangles between vertices. One of `boxes`, `vertices` and `vertices_f64` is given;
/// other fields that are 0 or null have their defaults. Coordinates are finite numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsObjects {
    /// The number of boxes or triangles. 0 is an empty scene, also where arrays are given: calls
    /// succeed, and the tree is empty.
    pub count: usize,
    /// 6 floats for each of `count` boxes: the lower corner, then the upper corner.
    pub boxes: *const f32,
    /// 3 floats for each vertex.
    pub vertices: *const f32,
    /// 3 doubles for each vertex, at most 2^120 in size; below 2^-150 they count as 0. Trees over
    /// them are traced by `bvs_tracer_f64_new`. Their boxes lie in a frame with its centre in the
    /// middle.
    pub vertices_f64: *const f64,
    /// The number of vertices; without `indices` 0 is 3 * `count`.
    pub vertex_count: usize,
    /// The bytes from a vertex to the next one, a multiple of 4, or of 8 for doubles; 0 is 12 or 24.
    pub vertex_stride: usize,
    /// The 3 vertices of each of `count` triangles, counted from 0; null for 0, 1, 2, then 3, 4, 5,
    /// and so on.
    pub indices: *const u32,
    /// The bytes from a triangle's indices to the next one's, a multiple of 4; 0 is 12.
    pub index_stride: usize,
}

impl BvsObjects {
    pub(crate) const NONE: Self = Self {
        count: 0,
        boxes: null(),
        vertices: null(),
        vertices_f64: null(),
        vertex_count: 0,
        vertex_stride: 0,
        indices: null(),
        index_stride: 0,
    };
}

/// A search with every choice. Fields that are 0 or null have their defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsBake {
    /// What the tree is over.
    pub objects: BvsObjects,
    /// 6 floats for each of `ray_count` recorded rays that the tree is for: its origin, then its
    /// hit or a point outside the scene.
    pub rays: *const f32,
    /// The number of rays; 0 for a tree for random lines.
    pub ray_count: usize,
    /// The average number of parts into which triangles may be divided among leaves, up to 16; 1 is
    /// for whole triangles, as triangles that will move should be (see `bvs_tree_update`). 0 is 1
    /// with `work` or `seconds`, and chosen without.
    pub references: f64,
    /// The time of the search in seconds; 0 is no limit. Without `seconds` and `work`, the search
    /// chooses its work, its cost and its rays, as Python and the program `bvh` do.
    pub seconds: f64,
    /// The largest number of nodes created or visited; 0 is no limit. With `work` and without
    /// `seconds`, the tree is the same on every machine, and the same as from Python and from the
    /// program `bvh`.
    pub work: u64,
    /// The seed of the random numbers, which is 1 by default in Python and in the program `bvh`.
    pub seed: u64,
    /// 1 lets the boxes of triangles lie in a frame where that saves area, as by default in Python
    /// and in the program `bvh`: they are then no boxes for other tracers. The choice takes at most
    /// a tenth of the budget. 0 keeps the axes.
    pub frame: u32,
}

/// Searches for the best tree with these choices. Searches and other work on large trees run on as
/// many threads as the environment variable RAYON_NUM_THREADS says when the first begins, by default
/// on all processors. Calls that trace rays or look up points run on the thread that calls: several
/// threads may pass parts of an array each.
///
/// `bake` is a search whose arrays have the promised lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_bake(bake: *const BvsBake) -> *mut BvsTree {
    made(|| {
        // SAFETY: `bake` is null or points to a search.
        let bake = *unsafe { given("bake", bake) }?;
        let BvsBake { objects, rays, ray_count, seconds, work, seed, .. } = bake;
        let frame = match bake.frame {
            0 => Frames::File,
            1 => Frames::Auto,
            other => return Err(Failure::invalid(format!("frame is {other}; accepted: 0 or 1"))),
        };
        // SAFETY: the arrays of the objects have the promised lengths.
        let objects = unsafe { objects_of(&objects) }?;
        // SAFETY: `rays` points to 6 floats for each of `ray_count` rays.
        let rays = unsafe { slice("rays", rays.cast::<[[f32; 3]; 2]>(), ray_count) }?;
        let rays: Vec<Segment> = rays.iter().map(|&[from, to]| Segment { from, to }).collect();
        let references = (bake.references != 0.0).then_some(bake.references);
        let max_work = (work > 0).then_some(work);
        let budget = Budget { max_work, ..Budget::UNLIMITED };
        let anywhere: Option<Anywhere> = Some(bvh_scenes::rays::anywhere);
        let options = Options { references, seed, budget, rays: &rays, anywhere, frame };
        found(objects, &options, (seconds != 0.0).then_some(seconds))
    })
}

/// Improves a tree for about `seconds`, 0 or more. Arrays from `bvs_tree_nodes` and
/// `bvs_tree_object_ids` become invalid.
///
/// `tree` is a tree that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_improve(tree: *mut BvsTree, seconds: f64) -> BvsStatus {
    // SAFETY: the caller promises that no other thread uses the tree, and there is no function to
    // call.
    unsafe { bvs_tree_improve_until(tree, seconds, None, std::ptr::null_mut()) }
}

/// Improves a tree like `bvs_tree_improve`, and ends soon after `cancelled(context)` returns a
/// number other than 0. The tree is then the best one so far, and the call succeeds. To cancel a
/// search from its beginning, create the tree in 0 seconds first.
///
/// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws no
/// exception and that any number of threads may call at the same time until this call returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_improve_until(
    tree: *mut BvsTree,
    seconds: f64,
    cancelled: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    context: *mut c_void,
) -> BvsStatus {
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

/// Moves the objects of the tree: as many boxes or triangles as it has, elsewhere. Boxes become
/// tight again round whole objects, and nodes remain. Bake triangles that move with `references` =
/// 1: every part of a divided triangle gets the box of the whole, even where nothing has moved, and
/// the cost may grow severalfold. The growth of the cost tells when a search is worth its time.
/// Arrays from `bvs_tree_nodes` and `bvs_tree_object_ids` become invalid. Tracers do not move.
///
/// `tree` is a tree that no other thread uses; `objects` are objects whose arrays have the promised
/// lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_update(
    tree: *mut BvsTree,
    objects: *const BvsObjects,
) -> BvsStatus {
    status(|| {
        // SAFETY: no other thread uses the tree during the call.
        let tree = unsafe { given_mut("tree", tree) }?;
        // SAFETY: `objects` is null or points to objects.
        *tree = whole(unsafe { moved(&tree.owned, objects) }?);
        Ok(())
    })
}

/// Writes the cost of the kind `kind`, one of `BvsCost`, to `cost`.
///
/// `tree` is a tree; `cost` points to a double.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_cost(
    tree: *const BvsTree,
    kind: u32,
    cost: *mut f64,
) -> BvsStatus {
    status(|| {
        // A parameter of an enum's type would be undefined behaviour for any other number from C.
        let kinds = [
            (BvsCost::InternalArea, Objective::InternalArea),
            (BvsCost::GoldsmithSalmon, Objective::GoldsmithSalmon),
            (BvsCost::Sah, Objective::Sah(SahConstants::default())),
            (BvsCost::Layout, Objective::Layout),
        ];
        let found = kinds.iter().find(|(number, _)| *number as u32 == kind);
        let Some((_, objective)) = found else {
            return Err(Failure::invalid(format!("kind is {kind}; accepted: 0 to 3")));
        };
        // SAFETY: nobody changes the tree during the call, or uses `cost`, which points to a double.
        let (tree, cost) = unsafe { (given("tree", tree)?, given_mut("cost", cost)?) };
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
pub unsafe extern "C" fn bvs_tree_frame(tree: *const BvsTree, frame: *mut f64) -> BvsStatus {
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
/// and are valid until it is improved, updated or freed. Their boxes lie in its frame, if it has
/// one: see `bvs_tree_frame`.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_nodes(tree: *const BvsTree, count: *mut usize) -> *const BvsNode {
    array(|| {
        // SAFETY: nobody changes the tree during the call, or uses `count`, which points to a size.
        let (tree, count) = unsafe { (given("tree", tree)?, given_mut("count", count)?) };
        *count = tree.nodes.len();
        Ok(tree.nodes.as_ptr().cast())
    })
}

/// Returns the object ids, to which leaves refer by position, and writes their number to `count`.
/// The ids belong to the tree and are valid until it is improved, updated or freed.
///
/// `tree` is a tree; `count` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_object_ids(
    tree: *const BvsTree,
    count: *mut usize,
) -> *const u32 {
    array(|| {
        // SAFETY: nobody changes the tree during the call, or uses `count`, which points to a size.
        let (tree, count) = unsafe { (given("tree", tree)?, given_mut("count", count)?) };
        let ids = &tree.owned.tree().prim_ids;
        *count = ids.len();
        Ok(ids.as_ptr())
    })
}

/// Loads the tree over these objects from the file `path`, in UTF-8.
///
/// `path` is a string; `objects` are objects whose arrays have the promised lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_load(
    path: *const c_char,
    objects: *const BvsObjects,
) -> *mut BvsTree {
    made(|| {
        // SAFETY: `path` is null or ends with a zero.
        let path = unsafe { text("path", path) }?;
        // SAFETY: `objects` is null or points to objects whose arrays have the promised lengths.
        let objects = unsafe { objects_of(given("objects", objects)?) }?;
        let bytes = bvh_scenes::tree_file::read(path.as_ref())?;
        let loaded = OwnedTree::load(objects, &bytes);
        loaded.map(whole).map_err(|error| Failure::invalid(format!("{path}: {error}")))
    })
}

/// Loads the tree over these objects from the bytes of a tree file.
///
/// `bytes` points to `size` bytes; `objects` are objects whose arrays have the promised lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_from_bytes(
    bytes: *const u8,
    size: usize,
    objects: *const BvsObjects,
) -> *mut BvsTree {
    made(|| {
        // SAFETY: `bytes` points to `size` bytes.
        let bytes = unsafe { slice("bytes", bytes, size) }?;
        // SAFETY: `objects` is null or points to objects whose arrays have the promised lengths.
        let objects = unsafe { objects_of(given("objects", objects)?) }?;
        OwnedTree::load(objects, bytes).map(whole).map_err(Failure::invalid)
    })
}

/// Returns the bytes of the tree's file, and writes their number to `size`. `bvs_bytes_free` frees
/// them.
///
/// `tree` is a tree; `size` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_to_bytes(tree: *const BvsTree, size: *mut usize) -> *mut u8 {
    try_made(|| {
        // SAFETY: nobody changes the tree during the call, or uses `size`, which points to a size.
        let (tree, size) = unsafe { (given("tree", tree)?, given_mut("size", size)?) };
        let bytes = tree.owned.save().map_err(Failure::invalid)?.into_boxed_slice();
        *size = bytes.len();
        Ok(Box::into_raw(bytes).cast())
    })
}

/// Frees the bytes of a tree. Ignores null.
///
/// `bytes` is null, or `size` bytes from `bvs_tree_to_bytes`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_bytes_free(bytes: *mut u8, size: usize) {
    if !bytes.is_null() {
        // SAFETY: `bvs_tree_to_bytes` has created both from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(bytes, size)) });
    }
}

/// Writes the tree to the file `path`, in UTF-8. An existing file is replaced when the new one is
/// complete; a failure leaves the old one.
///
/// `tree` is a tree; `path` is a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_save(tree: *const BvsTree, path: *const c_char) -> BvsStatus {
    status(|| {
        // SAFETY: nobody changes the tree during the call; `path` is null or ends with a zero.
        let (tree, path) = unsafe { (given("tree", tree)?, text("path", path)?) };
        let bytes = tree.owned.save().map_err(Failure::invalid)?;
        Ok(bvh_scenes::files::write(path.as_ref(), &bytes)?)
    })
}

/// Writes the tree to the file `path`, in UTF-8, for the tracer of another library, by its name for
/// `bvh export` (docs/use/INTEROP.md). The file is the same as of that command. A query for all hits of
/// three-mesh-bvh, of the crate bvh and of a reader of json finds a divided triangle more than once:
/// for these, `divided` is 1 if your queries are for the nearest or any hit. 0 rejects such a tree.
///
/// `tree` is a tree; `tracer` and `path` are strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_export(
    tree: *const BvsTree,
    tracer: *const c_char,
    divided: u32,
    path: *const c_char,
) -> BvsStatus {
    status(|| {
        // SAFETY: nobody changes the tree during the call; both strings are null or end with a zero.
        let (tree, tracer, path) =
            unsafe { (given("tree", tree)?, text("tracer", tracer)?, text("path", path)?) };
        let target = Target::named(tracer)
            .map_err(|unknown| Failure::invalid(format!("tracer is {unknown}")))?;
        if divided > 1 {
            return Err(Failure::invalid(format!("divided is {divided}; accepted: 0 or 1")));
        }
        let bytes = tree.owned.export(&target, divided == 1).map_err(Failure::invalid)?;
        Ok(bvh_scenes::files::write(path.as_ref(), &bytes)?)
    })
}

/// Frees a tree. Ignores null. Tracers of the tree remain valid.
///
/// `tree` is null, or a tree that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tree_free(tree: *mut BvsTree) {
    if !tree.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(tree) });
    }
}

fn whole(owned: OwnedTree) -> BvsTree {
    BvsTree { nodes: owned.tree().to_first_count_aligned(), owned: Arc::new(owned) }
}

fn found(objects: Objects, options: &Options, seconds: Option<f64>) -> Result<BvsTree, Failure> {
    let deadline = seconds.map(deadline).transpose()?;
    let observer = deadline.as_ref().map_or(&() as &dyn Observer, |deadline| deadline);
    OwnedTree::find(objects, options, observer).map(whole).map_err(Failure::invalid)
}

pub(crate) fn deadline(seconds: f64) -> Result<Deadline, Failure> {
    Duration::try_from_secs_f64(seconds)
        .map(Deadline::after)
        .map_err(|_| Failure::invalid(format!("seconds is {seconds:?}; accepted: 0 to 1e19")))
}

const BOXES: &str = "boxes";
const TRIANGLES: &str = "triangles";
const TRIANGLES_F64: &str = "triangles in f64";

/// Returns what the tree is over.
pub(crate) fn kind(tree: &OwnedTree) -> &'static str {
    match (tree.triangles(), tree.doubles()) {
        (Some(_), _) => TRIANGLES,
        (_, Some(_)) => TRIANGLES_F64,
        _ => BOXES,
    }
}

/// Returns the tree over its objects at other places.
///
/// # Safety
/// `objects` is null, or points to objects whose arrays have the promised lengths.
pub(crate) unsafe fn moved(
    tree: &OwnedTree,
    objects: *const BvsObjects,
) -> Result<OwnedTree, Failure> {
    // SAFETY: what the caller promises.
    let objects = unsafe { given("objects", objects) }?;
    let expected = kind(tree);
    let found = match objects {
        BvsObjects { boxes, .. } if !boxes.is_null() => BOXES,
        BvsObjects { vertices_f64, .. } if !vertices_f64.is_null() => TRIANGLES_F64,
        _ => TRIANGLES,
    };
    if (objects.count, found) != (tree.objects(), expected) {
        return Err(Failure::invalid(format!(
            "objects are {} {found}; accepted: {} {expected}, as the tree has",
            objects.count,
            tree.objects()
        )));
    }
    // SAFETY: what the caller promises.
    tree.refitted(unsafe { objects_of(objects) }?).map_err(Failure::invalid)
}

/// Copies objects.
///
/// # Safety
/// The arrays have the promised lengths.
unsafe fn objects_of(objects: &BvsObjects) -> Result<Objects, Failure> {
    let BvsObjects { count, boxes, vertices, vertices_f64, .. } = *objects;
    let given = [!boxes.is_null(), !vertices.is_null(), !vertices_f64.is_null()];
    if given.iter().filter(|&&is_given| is_given).count() > 1 {
        return Err(Failure::invalid("several of boxes, vertices and vertices_f64; accepted: one"));
    }
    if count > 0 && given == [false; 3] {
        return Err(Failure::invalid(
            "boxes, vertices and vertices_f64 are null; accepted: one of them",
        ));
    }
    if !boxes.is_null() {
        // SAFETY: an `Aabb` is `repr(C)` with 6 floats, and `boxes` points to that many for each.
        let boxes = unsafe { slice("boxes", boxes.cast::<Aabb>(), count) }?;
        return Ok(Objects::Boxes(boxes.to_vec()));
    }
    Ok(Objects::Shapes(if vertices_f64.is_null() {
        // SAFETY: what the caller promises.
        let triangles = unsafe { triangles_of("vertices", vertices, f32::MAX.into(), objects) }?;
        Primitives::Triangles(triangles)
    } else {
        // SAFETY: what the caller promises.
        let triangles = unsafe { triangles_of("vertices_f64", vertices_f64, DRay::MOST, objects) }?;
        Primitives::Doubles(triangles)
    }))
}

/// Copies triangles between vertices, whose coordinates are at most `most` in size.
///
/// # Safety
/// `vertices` are those of `objects`, whose arrays have the promised lengths.
unsafe fn triangles_of<N: Copy + Debug + Into<f64>, T: From<[[N; 3]; 3]>>(
    name: &str,
    vertices: *const N,
    most: f64,
    objects: &BvsObjects,
) -> Result<Vec<T>, Failure> {
    let BvsObjects { count, vertex_count, vertex_stride, indices, index_stride, .. } = *objects;
    let corners = count.saturating_mul(3);
    if indices.is_null() && vertex_count != 0 && vertex_count != corners {
        return Err(Failure::invalid(format!(
            "vertex_count is {vertex_count} without indices; accepted: 0, or 3 * count = {corners}"
        )));
    }
    let vertex_count = if indices.is_null() { corners } else { vertex_count };
    let index_count = if indices.is_null() { 0 } else { count };
    // SAFETY: there are 3 numbers in each of `vertex_count` strides, and if there are indices, 3 in
    // each of `count` strides.
    let (vertex, indices) = unsafe {
        let vertex = strided::<[N; 3]>(name, vertices.cast(), vertex_count, vertex_stride)?;
        (vertex, strided::<[u32; 3]>("indices", indices.cast(), index_count, index_stride)?)
    };
    let triangle = |number: usize| {
        let ids = indices(number).map(|ids| ids.map(|id| id as usize));
        let ids = ids.unwrap_or([3 * number, 3 * number + 1, 3 * number + 2]);
        let corners = ids.map(&vertex);
        let [Some(a), Some(b), Some(c)] = corners else {
            let missing = ids[corners.iter().position(Option::is_none).unwrap_or(0)];
            let range = format!("vertex {missing} of {vertex_count}, counted from 0");
            return Err(Failure::invalid(format!("triangle {number} has {range}")));
        };
        for (id, vertex) in ids.iter().zip([a, b, c]) {
            // NaN fails every comparison.
            if !vertex.iter().all(|&x| Into::<f64>::into(x).abs() <= most) {
                let accepted = format!("accepted: numbers up to {most:e} in size");
                return Err(Failure::invalid(format!(
                    "vertex {id} of triangle {number} is {vertex:?}; {accepted}"
                )));
            }
        }
        Ok(T::from([a, b, c]))
    };
    (0..count).map(triangle).collect()
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
