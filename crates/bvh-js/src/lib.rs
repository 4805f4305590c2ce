//! The search behind the npm package `bvh-search`. `js/index.js` gives it the shape of a module for
//! three.js.

use bvh_core::export::Target;
use bvh_core::file::FileError;
use bvh_core::{Primitives, Triangle};
use bvh_search::{Budget, Event, Objects, Observer, Options, OwnedTree};
use js_sys::{Float32Array, Function};
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
    /// The limit in milliseconds.
    limit: Option<f64>,
    most_work: Option<u64>,
    counted: AtomicU64,
}

impl Watch {
    fn fraction(&self) -> f64 {
        let of_time = self.limit.map(|limit| (now() - self.start) / limit);
        let counted = self.counted.load(Relaxed);
        let of_work = self.most_work.map(|most| counted as f64 / most as f64);
        of_time.into_iter().chain(of_work).fold(0.0, f64::max).min(1.0)
    }

    /// Calls `onProgress` with the fraction of the budget and, of an improvement, its cost.
    fn report(&self, cost: f64) {
        let follower = FOLLOWER.with_borrow(Clone::clone);
        let Some(follower) = follower else { return };
        REPORTED.set(now());
        if let Err(error) = follower.call2(&JsValue::NULL, &self.fraction().into(), &cost.into()) {
            THROWN.set(Some(error));
        }
    }
}

impl Observer for Watch {
    fn event(&self, event: &Event) {
        if event.cost <= event.incumbent {
            self.report(event.incumbent);
        }
    }

    fn counted(&self, _evaluations: u64, work: u64) {
        self.counted.store(work, Relaxed);
        if now() - REPORTED.get() > BETWEEN_REPORTS {
            self.report(f64::NAN);
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

/// A tree over triangles.
#[wasm_bindgen]
pub struct Tree(OwnedTree);

#[wasm_bindgen]
impl Tree {
    /// Searches a tree over triangles of nine coordinates each, for `seconds` or up to so much
    /// `work`, in nodes visited.
    pub fn bake(
        corners: &Float32Array,
        seconds: Option<f64>,
        work: Option<f64>,
        seed: f64,
        references: f64,
        follower: Option<Function>,
    ) -> Result<Tree, JsValue> {
        let most_work = work.map(|work| work as u64);
        let budget = Budget { max_work: most_work, ..Budget::UNLIMITED };
        let options = Options { references, seed: seed as u64, budget, rays: &[] };
        FOLLOWER.set(follower);
        THROWN.set(None);
        let limit = seconds.map(|seconds| 1000.0 * seconds);
        let watch = Watch { start: now(), limit, most_work, counted: 0.into() };
        let found = OwnedTree::find(triangles(corners)?, &options, &watch);
        FOLLOWER.set(None);
        match THROWN.take() {
            Some(thrown) => Err(thrown),
            None => better(found.map_err(error)?, corners),
        }
    }

    /// Reads a tree over these triangles from the bytes of a tree file.
    pub fn load(corners: &Float32Array, bytes: &[u8]) -> Result<Tree, JsValue> {
        OwnedTree::load(triangles(corners)?, bytes).map(Self).map_err(error)
    }

    /// Returns the tree as a file, which the program `bvh` and all other interfaces read.
    pub fn save(&self) -> Result<Vec<u8>, JsValue> {
        self.0.save().map_err(|found: FileError| error(found))
    }

    /// The number of triangles.
    #[wasm_bindgen(getter)]
    pub fn triangles(&self) -> usize {
        self.0.objects()
    }

    /// Returns the tree for three-mesh-bvh.
    #[wasm_bindgen(js_name = forThreeMesh)]
    pub fn for_three_mesh(&self) -> ThreeMesh {
        let fitted = TARGET.fit(self.0.tree());
        let cost = TARGET.cost(&fitted);
        let nodes = bytemuck::cast_slice(&fitted.to_three_mesh()).to_vec();
        ThreeMesh { nodes, order: fitted.prim_ids, cost }
    }
}

/// The nodes of a tree for three-mesh-bvh, and the triangles in the order of its leaves.
#[wasm_bindgen]
pub struct ThreeMesh {
    nodes: Vec<u8>,
    order: Vec<u32>,
    cost: f64,
}

#[wasm_bindgen]
impl ThreeMesh {
    /// The bytes of the nodes.
    #[wasm_bindgen(getter)]
    pub fn nodes(&self) -> Vec<u8> {
        self.nodes.clone()
    }

    /// The triangles in the order of the leaves.
    #[wasm_bindgen(getter)]
    pub fn order(&self) -> Vec<u32> {
        self.order.clone()
    }

    /// The cost of a ray by the library's costs.
    #[wasm_bindgen(getter)]
    pub fn cost(&self) -> f64 {
        self.cost
    }
}

/// Returns the cost of a ray in a tree of three-mesh-bvh, by the bytes of one of its roots.
#[wasm_bindgen(js_name = costOfRoot)]
pub fn cost_of_root(bytes: &[u8], triangles: u32) -> Result<f64, JsValue> {
    let nodes: Vec<_> = bytes.chunks_exact(32).map(bytemuck::pod_read_unaligned).collect();
    let order: Vec<u32> = (0..triangles).collect();
    let tree = bvh_core::Bvh::from_three_mesh(&nodes, &order).map_err(error)?;
    Ok(TARGET.cost(&tree))
}

/// Returns a greedy tree instead of a searched one in which rays of three-mesh-bvh take more tests.
fn better(searched: OwnedTree, corners: &Float32Array) -> Result<Tree, JsValue> {
    // A search without any time is the greedy tree that others begin with.
    let watch = Watch { start: now(), limit: Some(0.0), most_work: None, counted: 0.into() };
    let greedy = OwnedTree::find(triangles(corners)?, &Options::default(), &watch);
    let greedy = greedy.map_err(error)?;
    let shapes = searched.triangles().unwrap_or_default();
    let better = TARGET.fit_better(searched.tree(), greedy.tree(), shapes);
    Ok(Tree(if better.is_searched() { searched } else { greedy }))
}

fn triangles(corners: &Float32Array) -> Result<Objects, JsValue> {
    let corners = corners.to_vec();
    let (triangles, rest) = corners.as_chunks::<9>();
    if !rest.is_empty() {
        let found = corners.len();
        return Err(error(format!("corners has {found} numbers; accepted: nine per triangle")));
    }
    let triangle = |t: &[f32; 9]| {
        Triangle::from([[t[0], t[1], t[2]], [t[3], t[4], t[5]], [t[6], t[7], t[8]]])
    };
    Ok(Objects::Shapes(Primitives::Triangles(triangles.iter().map(triangle).collect())))
}

fn error(found: impl Display) -> JsValue {
    js_sys::Error::new(&found.to_string()).into()
}
