//! Embree's library, with its own trees and with trees of ours in their place.
//!
//! Embree takes no tree. But the root of a committed scene can be replaced: the layouts of objects
//! here are those that version 4.4.0 has in memory, where its tutorial `bvh_access` reads them.

use attic::tracing::answers::SOME_HIT;
use attic::tracing::contender::{Batch, PART};
use bvh_core::{Aabb, Bvh, Hit, Ray, Triangle};
use bvh_scenes::trace::Query;
use bytemuck::Zeroable;
use libloading::Library;
use memmap2::{Advice, MmapMut, MmapOptions};
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::null_mut;
use std::time::Instant;

type Handle = *mut c_void;

// Values of the header's enumerations.
const TRIANGLES: c_int = 0;
const INDICES: c_int = 0;
const VERTICES: c_int = 1;
const UINT3: c_int = 0x5003;
const FLOAT3: c_int = 0x9003;
const MEDIUM: c_int = 1;
const HIGH: c_int = 2;
const COHERENT: c_uint = 1 << 16;

/// The one version whose objects are known.
const VERSION: isize = 40_400;
/// One thread, and the instructions that most processors have.
const CONFIG: &CStr = c"threads=1,set_affinity=0,isa=avx2";

/// A ray and its hit, `RTCRayHit`.
#[derive(Clone, Copy, Zeroable)]
#[repr(C, align(16))]
struct One {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    time: f32,
    t_max: f32,
    mask: u32,
    id_flags: [u32; 2],
    normal_uv: [f32; 5],
    triangle: u32,
    geometry: u32,
    instance: [u32; 2],
    end: [u32; 3],
}

const LANES: usize = 8;

/// Which of eight rays are traced, -1 for those: aligned as the library reads it.
#[derive(Clone, Copy, Zeroable)]
#[repr(C, align(32))]
struct Valid([c_int; LANES]);

/// Eight rays and their hits, `RTCRayHit8`.
#[derive(Clone, Copy, Zeroable)]
#[repr(C, align(32))]
struct Eight {
    origin: [[f32; LANES]; 3],
    t_min: [f32; LANES],
    direction: [[f32; LANES]; 3],
    time: [f32; LANES],
    t_max: [f32; LANES],
    mask: [u32; LANES],
    id_flags: [[u32; LANES]; 2],
    normal_uv: [[f32; LANES]; 5],
    triangle: [u32; LANES],
    geometry: [u32; LANES],
    instance: [[u32; LANES]; 2],
}

/// `RTCIntersectArguments` and `RTCOccludedArguments`, which have the same members.
#[repr(C)]
struct Arguments {
    flags: c_uint,
    features: c_uint,
    unused: [Handle; 3],
    width: f32,
}

/// The functions of the library that are called here.
struct Functions {
    new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    device_property: unsafe extern "C" fn(Handle, c_int) -> isize,
    device_error: unsafe extern "C" fn(Handle) -> c_int,
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    set_quality: unsafe extern "C" fn(Handle, c_int),
    new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    new_buffer: unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> Handle,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach_geometry: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    commit_scene: unsafe extern "C" fn(Handle),
    intersect_one: unsafe extern "C" fn(Handle, *mut One, *mut Arguments),
    occluded_one: unsafe extern "C" fn(Handle, *mut One, *mut Arguments),
    intersect_eight: unsafe extern "C" fn(*const c_int, Handle, *mut Eight, *mut Arguments),
    occluded_eight: unsafe extern "C" fn(*const c_int, Handle, *mut Eight, *mut Arguments),
}

/// A device of the library.
pub struct Embree {
    functions: Functions,
    device: Handle,
    /// Stays loaded, as its device does.
    _library: ManuallyDrop<Library>,
}

impl Embree {
    /// Loads `libembree4.so` from a folder.
    pub fn load(folder: &Path) -> Self {
        let file = folder.join("libembree4.so");
        // SAFETY: the library has no conditions for being loaded.
        let library = unsafe { Library::new(&file) };
        let library = library.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        /// A function of the library.
        ///
        /// # Safety
        /// It has the type `F`.
        unsafe fn function<F: Copy>(library: &Library, name: &str) -> F {
            let found = unsafe { library.get::<F>(name.as_bytes()) };
            *found.unwrap_or_else(|error| panic!("{name}: {error}"))
        }
        // SAFETY: the types are those of version 4's header.
        let functions = unsafe {
            Functions {
                new_device: function(&library, "rtcNewDevice"),
                device_property: function(&library, "rtcGetDeviceProperty"),
                device_error: function(&library, "rtcGetDeviceError"),
                new_scene: function(&library, "rtcNewScene"),
                set_quality: function(&library, "rtcSetSceneBuildQuality"),
                new_geometry: function(&library, "rtcNewGeometry"),
                new_buffer: function(&library, "rtcSetNewGeometryBuffer"),
                commit_geometry: function(&library, "rtcCommitGeometry"),
                attach_geometry: function(&library, "rtcAttachGeometry"),
                commit_scene: function(&library, "rtcCommitScene"),
                intersect_one: function(&library, "rtcIntersect1"),
                occluded_one: function(&library, "rtcOccluded1"),
                intersect_eight: function(&library, "rtcIntersect8"),
                occluded_eight: function(&library, "rtcOccluded8"),
            }
        };
        // SAFETY: the configuration ends with a zero, and the property 0 is the version.
        let (device, version) = unsafe {
            let device = (functions.new_device)(CONFIG.as_ptr());
            (device, (functions.device_property)(device, 0))
        };
        assert_eq!(version, VERSION, "the version of {}; accepted: {VERSION}", file.display());
        Self { functions, device, _library: ManuallyDrop::new(library) }
    }
}

/// `AABBNode` of eight children: references first, then lower and upper bounds along each axis.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Node {
    children: [usize; LANES],
    bounds: [[[f32; LANES]; 2]; 3],
}

impl Node {
    const EMPTY: Self = Self {
        children: [LEAF; LANES],
        bounds: [[[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]]; 3],
    };
}

/// Marks a reference to blocks of triangles, whose number is added. Alone it is no child.
const LEAF: usize = 8;
const MOST_BLOCKS: usize = 7;
/// The bits of a reference that are no address.
const FLAGS: usize = 15;

/// `Triangle4`: a corner, the edge that ends there and the edge that begins there.
#[derive(Clone, Copy, Zeroable)]
#[repr(C, align(16))]
struct Block {
    /// `corner_edges[vector][axis][lane]`
    corner_edges: [[[f32; 4]; 3]; 3],
    geometry: [u32; 4],
    triangle: [u32; 4],
}

impl Block {
    const LANES: usize = 4;

    fn new(ids: &[u32], triangles: &[Triangle]) -> Self {
        let mut block = Self::zeroed();
        (block.geometry, block.triangle) = ([u32::MAX; Self::LANES], [u32::MAX; Self::LANES]);
        for (lane, &id) in ids.iter().enumerate() {
            let [a, b, c] = triangles[id as usize].0;
            for (vector, value) in [a, a - b, c - a].into_iter().enumerate() {
                (0..3).for_each(|axis| block.corner_edges[vector][axis][lane] = value[axis]);
            }
            (block.geometry[lane], block.triangle[lane]) = (0, id);
        }
        block
    }
}

/// Where `Accel` has the pointer to its tree, and `BVHN` has its type and its root.
const TREE_OF_SCENE: usize = 88;
const TYPE_OF_TREE: usize = 80;
const EIGHT_WIDE: c_int = 4;
const ROOT_OF_TREE: usize = 112;

/// How a ray is given to Embree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Calls {
    /// One by one.
    Single,
    /// Eight at once, traversed one after the other.
    Eight,
    /// Eight at once, traversed together.
    EightTogether,
}

/// A scene that Embree traces. It is never released, nor are its mesh and the device: Embree would
/// free a root of ours as its own.
pub struct Traced<'e> {
    embree: &'e Embree,
    scene: Handle,
    /// What a root of ours leads to.
    _memory: Option<[MmapMut; 2]>,
}

impl<'e> Traced<'e> {
    /// Builds Embree's own tree: by default, or of high quality, which divides triangles.
    pub fn own(embree: &'e Embree, triangles: &[Triangle], is_high: bool) -> Self {
        let Functions { new_scene, set_quality, new_geometry, new_buffer, .. } = embree.functions;
        let corners: &[[f32; 3]] = bytemuck::cast_slice(triangles);
        // SAFETY: handles are the library's, and buffers have the sizes that they were asked for.
        let scene = unsafe {
            let scene = new_scene(embree.device);
            set_quality(scene, if is_high { HIGH } else { MEDIUM });
            let mesh = new_geometry(embree.device, TRIANGLES);
            let buffer = new_buffer(mesh, VERTICES, 0, FLOAT3, 12, corners.len());
            buffer.cast::<[f32; 3]>().copy_from_nonoverlapping(corners.as_ptr(), corners.len());
            let buffer = new_buffer(mesh, INDICES, 0, UINT3, 12, triangles.len()).cast::<u32>();
            (0..corners.len()).for_each(|index| buffer.add(index).write(index as u32));
            (embree.functions.commit_geometry)(mesh);
            (embree.functions.attach_geometry)(scene, mesh);
            (embree.functions.commit_scene)(scene);
            assert_eq!((embree.functions.device_error)(embree.device), 0, "Embree's error");
            scene
        };
        let traced = Self { embree, scene, _memory: None };
        traced.check(triangles.len());
        traced
    }

    /// Puts a tree with at most eight children a node into the place of Embree's.
    pub fn with_tree(embree: &'e Embree, triangles: &[Triangle], tree: &Bvh) -> Self {
        let mut traced = Self::own(embree, triangles, false);
        let leaf_blocks = |node: &bvh_core::Node| node.prims().len().div_ceil(Block::LANES);
        let inner = tree.nodes.iter().filter(|node| !node.is_leaf()).count();
        let blocks = tree.nodes.iter().map(leaf_blocks).sum::<usize>();
        let mut memory =
            [huge_pages(inner * size_of::<Node>()), huge_pages(blocks * size_of::<Block>())];
        let [mut free_node, mut free_block] =
            [memory[0].as_mut_ptr() as usize, memory[1].as_mut_ptr() as usize];
        // Nodes of the tree, and the addresses of the references to them.
        let mut open = vec![(0, traced.root() as usize)];
        while let Some((index, place)) = open.pop() {
            let node = &tree.nodes[index];
            let reference = if node.is_leaf() {
                let first = free_block;
                assert!(leaf_blocks(node) <= MOST_BLOCKS, "a leaf of {:?}", node.prims());
                for ids in tree.prim_ids[node.prims()].chunks(Block::LANES) {
                    // SAFETY: there is memory for the blocks of all leaves.
                    unsafe { (free_block as *mut Block).write(Block::new(ids, triangles)) };
                    free_block += size_of::<Block>();
                }
                first | (LEAF + leaf_blocks(node))
            } else {
                let mut wide = Node::EMPTY;
                for (lane, child) in node.children().enumerate() {
                    let Aabb { min, max } = tree.nodes[child].aabb;
                    for (axis, bounds) in wide.bounds.iter_mut().enumerate() {
                        [bounds[0][lane], bounds[1][lane]] = [min[axis], max[axis]];
                    }
                    open.push((child, free_node + lane * size_of::<usize>()));
                }
                // SAFETY: there is memory for all inner nodes.
                unsafe { (free_node as *mut Node).write(wide) };
                free_node += size_of::<Node>();
                free_node - size_of::<Node>()
            };
            // SAFETY: the place is the root's, or in a node that was written.
            unsafe { (place as *mut usize).write(reference) };
        }
        traced._memory = Some(memory);
        traced.check(triangles.iter().filter(|triangle| !triangle.is_degenerate()).count());
        traced
    }

    /// The place of the reference to the root.
    fn root(&self) -> *mut usize {
        // SAFETY: the objects of this version have these members.
        unsafe {
            let tree = self.scene.byte_add(TREE_OF_SCENE).cast::<Handle>().read();
            assert_eq!(
                tree.byte_add(TYPE_OF_TREE).cast::<c_int>().read(),
                EIGHT_WIDE,
                "a tree of eight"
            );
            tree.byte_add(ROOT_OF_TREE).cast()
        }
    }

    /// Checks that the tree reaches this number of triangles.
    fn check(&self, triangles: usize) {
        let mut found = std::collections::BTreeSet::new();
        // SAFETY: the root is a reference.
        let mut open = vec![unsafe { self.root().read() }];
        while let Some(reference) = open.pop() {
            let (address, flags) = (reference & !FLAGS, reference & FLAGS);
            if flags == 0 {
                // SAFETY: references without flags are to nodes.
                open.extend(unsafe { (*(address as *const Node)).children });
                continue;
            }
            assert!(flags >= LEAF, "a node of another kind: {flags}");
            // SAFETY: references to leaves are to this number of blocks.
            let blocks = unsafe {
                std::slice::from_raw_parts(address.max(16) as *const Block, flags - LEAF)
            };
            for block in blocks {
                let used = block
                    .geometry
                    .iter()
                    .zip(block.triangle)
                    .filter(|(geometry, _)| **geometry == 0);
                found.extend(used.map(|(_, id)| id));
            }
        }
        assert_eq!(found.len(), triangles, "triangles that the tree reaches");
    }

    /// Answers all rays, and returns the seconds of each part. Conversions are not timed.
    pub fn trace(&self, calls: Calls, batch: &Batch, hits: &mut [Option<Hit>]) -> Vec<f64> {
        let part = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
            let blocks = rays.chunks(IN_CACHE).zip(hits.chunks_mut(IN_CACHE));
            let time = |(rays, hits)| match calls {
                Calls::Single => self.trace_singly(batch.query, rays, hits),
                _ => self.trace_eights(calls == Calls::EightTogether, batch.query, rays, hits),
            };
            blocks.map(time).sum()
        };
        batch.rays.chunks(PART).zip(hits.chunks_mut(PART)).map(part).collect()
    }

    fn trace_singly(&self, query: Query, rays: &[Ray], hits: &mut [Option<Hit>]) -> f64 {
        let mut block = [One::zeroed(); IN_CACHE];
        let block = &mut block[..rays.len()];
        for (one, ray) in block.iter_mut().zip(rays) {
            (one.origin, one.direction) = (ray.origin().to_array(), ray.direction().to_array());
            (one.t_min, one.t_max, one.mask) = (ray.t_min(), ray.t_max(), u32::MAX);
            (one.geometry, one.instance) = (u32::MAX, [u32::MAX; 2]);
        }
        let Functions { intersect_one, occluded_one, .. } = self.embree.functions;
        let call = if query == Query::Any { occluded_one } else { intersect_one };
        let start = Instant::now();
        for one in &mut *block {
            // SAFETY: the scene is committed, and the ray is complete.
            unsafe { call(self.scene, one, null_mut()) };
        }
        let seconds = start.elapsed().as_secs_f64();
        for (hit, one) in hits.iter_mut().zip(block) {
            *hit = answer(query, one.t_max, one.geometry, one.triangle);
        }
        seconds
    }

    fn trace_eights(
        &self,
        is_together: bool,
        query: Query,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) -> f64 {
        let mut block = [Eight::zeroed(); IN_CACHE / LANES];
        let mut valid = [Valid::zeroed(); IN_CACHE / LANES];
        let packets = rays.len().div_ceil(LANES);
        for (index, ray) in rays.iter().enumerate() {
            let (eight, lane) = (&mut block[index / LANES], index % LANES);
            let [origin, direction] = [ray.origin(), ray.direction()];
            for axis in 0..3 {
                eight.origin[axis][lane] = origin[axis];
                eight.direction[axis][lane] = direction[axis];
            }
            (eight.t_min[lane], eight.t_max[lane], eight.mask[lane]) =
                (ray.t_min(), ray.t_max(), u32::MAX);
            eight.geometry[lane] = u32::MAX;
            eight.instance.iter_mut().for_each(|instance| instance[lane] = u32::MAX);
            valid[index / LANES].0[lane] = -1;
        }
        let flags = if is_together { COHERENT } else { 0 };
        let mut arguments =
            Arguments { flags, features: c_uint::MAX, unused: [null_mut(); 3], width: 0.0 };
        let Functions { intersect_eight, occluded_eight, .. } = self.embree.functions;
        let call = if query == Query::Any { occluded_eight } else { intersect_eight };
        let start = Instant::now();
        for (eight, valid) in block[..packets].iter_mut().zip(&valid) {
            // SAFETY: the scene is committed, the rays of valid lanes are complete, and the types of
            // both are aligned to 32 bytes.
            unsafe { call(valid.0.as_ptr(), self.scene, eight, &mut arguments) };
        }
        let seconds = start.elapsed().as_secs_f64();
        for (index, hit) in hits.iter_mut().enumerate() {
            let (eight, lane) = (&block[index / LANES], index % LANES);
            *hit = answer(query, eight.t_max[lane], eight.geometry[lane], eight.triangle[lane]);
        }
        seconds
    }
}

/// The number of rays that are converted at once. They stay in the first cache.
const IN_CACHE: usize = 256;

fn answer(query: Query, t_max: f32, geometry: u32, triangle: u32) -> Option<Hit> {
    match query {
        Query::Any => (t_max < 0.0).then_some(SOME_HIT),
        _ => (geometry != u32::MAX).then_some(Hit { t: t_max, object: triangle }),
    }
}

/// Returns memory as Embree's own: in pages of two megabytes where the system permits it.
fn huge_pages(bytes: usize) -> MmapMut {
    let memory = MmapOptions::new().len(bytes.max(1)).map_anon().expect("memory");
    memory.advise(Advice::HugePage).expect("advice about pages");
    memory
}
