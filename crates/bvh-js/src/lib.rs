//! The search behind the npm package `bvh-search`. `js/index.js` gives it the shape of a module for
//! three.js.

use bvh_core::cost::internal_area;
use bvh_core::export::Target;
use bvh_core::{Bvh, Primitives, Triangle};
use bvh_search::{Bake, Budget, Choice, Event, Objects, Observer, OwnedTree};
use js_sys::{Array, Float32Array, Function, Uint8Array, Uint32Array};
use std::cell::{Cell, RefCell};
use std::fmt::Display;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use wasm_bindgen::prelude::*;

/// The tree that JavaScript traces by.
const TARGET: Target = Target::THREE_MESH_BVH;

#[wasm_bindgen]
extern "C" {
    /// Milliseconds of the page's or the process's clock.
    #[wasm_bindgen(js_namespace = performance)]
    fn now() -> f64;
}

thread_local! {
    /// The function that follows the search of this thread, and its error if it threw one.
    static FOLLOWER: RefCell<Option<Function>> = const { RefCell::new(None) };
    static THROWN: RefCell<Option<JsValue>> = const { RefCell::new(None) };
    static REPORTED: Cell<f64> = const { Cell::new(0.0) };
}

/// Milliseconds between two reports of the progress without an improvement.
const BETWEEN_REPORTS: f64 = 50.0;

/// Follows a search by JavaScript's clock and function.
struct Watch {
    start: f64,
    /// The limit of the search in milliseconds.
    limit: Option<f64>,
    most_work: Option<u64>,
    counted: AtomicU64,
    /// The cost for the tracer of a tree without internal area, and what a unit of this area adds;
    /// NaN if they are unknown.
    estimate: [f64; 2],
}

impl Watch {
    fn fraction(&self) -> f64 {
        let of_time = self.limit.map(|limit| (now() - self.start) / limit);
        let counted = self.counted.load(Relaxed);
        let of_work = self.most_work.map(|most| counted as f64 / most as f64);
        of_time.into_iter().chain(of_work).fold(0.0, f64::max).min(1.0)
    }
}

/// Calls `onProgress` with the fraction of the budget and, of an improvement, its cost.
fn report(fraction: f64, cost: f64) {
    let follower = FOLLOWER.with_borrow(Clone::clone);
    let Some(follower) = follower else { return };
    REPORTED.set(now());
    if let Err(error) = follower.call2(&JsValue::NULL, &fraction.into(), &cost.into()) {
        THROWN.set(Some(error));
    }
}

impl Observer for Watch {
    fn event(&self, event: &Event) {
        if event.cost <= event.incumbent {
            let [cost, added] = self.estimate;
            report(self.fraction(), cost + added * event.incumbent);
        }
    }

    fn counted(&self, _evaluations: u64, work: u64) {
        self.counted.store(work, Relaxed);
        if now() - REPORTED.get() > BETWEEN_REPORTS {
            report(self.fraction(), f64::NAN);
        }
    }

    fn cancelled(&self) -> bool {
        // An exception of the follower is how JavaScript stops a search.
        THROWN.with_borrow(Option::is_some)
            || self.limit.is_some_and(|limit| now() - self.start >= limit)
    }

    fn progress(&self) -> Option<f64> {
        self.limit.map(|_| self.fraction())
    }
}

/// Searches a tree over triangles of nine coordinates each, for `seconds` or up to so much `work`, in
/// nodes visited, or as much as a bake chooses. Returns the [parts](parts) of the tree.
#[wasm_bindgen]
pub fn bake(
    corners: &Float32Array,
    seconds: Option<f64>,
    work: Option<f64>,
    seed: f64,
    references: f64,
    follower: Option<Function>,
) -> Result<Array, JsValue> {
    let start = now();
    let limit = seconds.map(|seconds| 1000.0 * seconds);
    let shapes = Primitives::Triangles(triangles(corners)?);
    let boxes = shapes.boxes();
    let budget = match (work, seconds) {
        (None, None) => Budget::of_objects(boxes.len()),
        _ => Budget { max_work: work.map(|work| work as u64), ..Budget::UNLIMITED },
    };
    let most_work = budget.max_work;
    let watch = Watch { start, limit, most_work, counted: 0.into(), estimate: [f64::NAN; 2] };
    let seed = seed as u64;
    let bake = Bake { shapes: Some(&shapes), references, seed, budget, ..Bake::new(&boxes) };
    FOLLOWER.set(follower);
    THROWN.set(None);
    let found = search(&bake, watch);
    if let Ok(parts) = &found {
        report(1.0, parts.get(3).as_f64().unwrap_or(f64::NAN));
    }
    FOLLOWER.set(None);
    THROWN.take().map_or(found, Err)
}

fn search(bake: &Bake, mut watch: Watch) -> Result<Array, JsValue> {
    let greedy = bake.greedy(&watch).map_err(error)?;
    let mut comparison = f64::INFINITY;
    if let Some(tree) = &greedy {
        let cost = TARGET.cost(&TARGET.fit(tree));
        comparison = 1000.0 * Target::comparison_seconds(cost);
        // All trees of whole triangles have the same area of leaves.
        if bake.references == 1.0 {
            let root = tree.root_aabb().map_or(0.0, |root| root.half_area());
            let added = TARGET.constants.traversal() / root;
            watch.estimate = [cost - added * internal_area(tree), added];
        }
    }
    // Of many equal triangles, every ray meets all.
    let is_compared = watch.limit.is_none_or(|limit| comparison <= 0.25 * limit);
    if is_compared {
        watch.limit = watch.limit.map(|limit| limit - comparison);
    }
    // A search by the clock that has a tree begins with the division, which may take all its time.
    let divides_later = watch.limit.is_some() && bake.references > 1.0;
    let start = if divides_later { None } else { greedy.clone() };
    let baked = bake.search(start, &watch).map_err(error)?;
    let mut tree = baked.outcome.tree;
    let fitted = match (greedy, bake.shapes) {
        (Some(greedy), Some(Primitives::Triangles(shapes))) if is_compared => {
            let better = TARGET.fit_better(&tree, &greedy, shapes);
            if !better.is_searched() {
                tree = greedy;
            }
            better.tree
        }
        _ => TARGET.fit(&tree),
    };
    let file = bake.write(&tree, baked.outcome.work, |sections| sections.concat());
    Ok(parts(&fitted, &file.map_err(error)?))
}

/// Reads a tree over these triangles from the bytes of a tree file. Returns its [parts](parts).
#[wasm_bindgen]
pub fn load(corners: &Float32Array, bytes: &[u8]) -> Result<Array, JsValue> {
    let shapes = Objects::Shapes(Primitives::Triangles(triangles(corners)?));
    let tree = OwnedTree::load(shapes, bytes).map_err(error)?;
    Ok(parts(&TARGET.fit(tree.tree()), bytes))
}

/// Returns the rotation to axes along which a tree over these triangles is smaller, row by row, and
/// the fraction of area that it saves; nothing if no other axes certainly save some.
#[wasm_bindgen]
pub fn axes(corners: &Float32Array) -> Result<Vec<f64>, JsValue> {
    /// The work of a search whose tenth chooses the axes, as of `bvh orient`: a second or two.
    const WORK: u64 = 300_000_000;
    let budget = Budget { max_work: Some(WORK), ..Budget::UNLIMITED };
    let choice = Choice::of(&triangles(corners)?, budget, &());
    let Some(frame) = choice.frame else { return Ok(Vec::new()) };
    let rows = frame.rotation().transpose().to_cols_array();
    Ok([&rows[..], &[choice.gain]].concat())
}

/// Returns what JavaScript keeps of a tree, so that none of it stays in WebAssembly: the file, the
/// nodes for three-mesh-bvh, the triangles in the order of the leaves, and the cost of a ray.
fn parts(fitted: &Bvh, file: &[u8]) -> Array {
    let nodes = fitted.to_three_mesh();
    Array::of4(
        &Uint8Array::from(file),
        &Uint8Array::from(bytemuck::cast_slice::<_, u8>(&nodes)),
        &Uint32Array::from(&*fitted.prim_ids),
        &TARGET.cost(fitted).into(),
    )
}

/// Returns the cost of a ray in a tree of three-mesh-bvh, by the bytes of one of its roots.
#[wasm_bindgen(js_name = costOfRoot)]
pub fn cost_of_root(bytes: &[u8], triangles: u32) -> Result<f64, JsValue> {
    let nodes: Vec<_> = bytes.chunks_exact(32).map(bytemuck::pod_read_unaligned).collect();
    let order: Vec<u32> = (0..triangles).collect();
    let tree = bvh_core::Bvh::from_three_mesh(&nodes, &order).map_err(error)?;
    Ok(TARGET.cost(&tree))
}

fn triangles(corners: &Float32Array) -> Result<Vec<Triangle>, JsValue> {
    let corners = corners.to_vec();
    let (triangles, rest) = corners.as_chunks::<9>();
    if !rest.is_empty() {
        let found = corners.len();
        return Err(error(format!("corners has {found} numbers; accepted: nine per triangle")));
    }
    let triangle =
        |t: &[f32; 9]| Triangle::from([[t[0], t[1], t[2]], [t[3], t[4], t[5]], [t[6], t[7], t[8]]]);
    Ok(triangles.iter().map(triangle).collect())
}

fn error(found: impl Display) -> JsValue {
    js_sys::Error::new(&found.to_string()).into()
}
