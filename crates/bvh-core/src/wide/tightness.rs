//! The number of tests by each test of boxes, for the promise that it is at most twice the number
//! in real arithmetic.

use super::box_ray::{BoxRay, BoxTest, FarBoxRay};
use super::instructions::{Instructions, Task};
use super::lanes::Lanes;
use super::layout::WideNode;
use super::packet::Culling;
use super::prepared::{Prepared, Ready};
use super::ray_lanes::{RayBounds, Rays};
use super::{WideBvh, vector};
use crate::{Aabb, Kernel, Ray, TestCounts};
use core::mem::MaybeUninit;

/// A test of the boxes of a node.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub enum NodeTest<'a> {
    /// That of a vector kernel for a ray by itself.
    Alone,
    /// That of a vector kernel for rays in flight.
    InFlight,
    /// That of a vector kernel for a packet, here of equal rays.
    Packet,
    /// Any other.
    Given(&'a dyn Fn(&Aabb) -> bool),
}

impl WideBvh {
    /// Counts the tests of a traversal that finds no hit: all nodes whose boxes the ray enters
    /// before its end, in any order.
    ///
    /// # Panics
    /// If the kernel is the portable one, which counts its own tests, and the test is of another.
    #[doc(hidden)]
    pub fn tests_without_hits(&self, ray: &Ray, test: NodeTest) -> TestCounts {
        let mut counts = TestCounts::default();
        let mut open = vec![];
        open.extend(self.root);
        while let Some(child) = open.pop() {
            if !child.is_node() {
                counts.objects += Self::OBJECTS_OF_BLOCK * self.leaf(child).len() as u64;
                continue;
            }
            counts.boxes += Self::BOXES_OF_NODE;
            let node = &self.nodes[child.index()];
            let mask = self.entered(ray, node, test);
            let lanes = (0..WideNode::LANES).filter(|lane| mask >> lane & 1 == 1);
            open.extend(lanes.map(|lane| node.children[lane]));
        }
        counts
    }

    /// Returns a bit for each box of a node that the ray enters.
    fn entered(&self, ray: &Ray, node: &WideNode, test: NodeTest) -> u32 {
        if let NodeTest::Given(is_entered) = test {
            let is_entered = |lane: &usize| node.lane_box(*lane).as_ref().is_some_and(is_entered);
            return (0..WideNode::LANES).filter(is_entered).map(|lane| 1 << lane).sum();
        }
        assert!(self.kernel != Kernel::Portable, "the portable kernel counts its tests itself");
        // SAFETY: a layout's kernel is available.
        unsafe { vector::dispatch(self.kernel, Entered { wide: self, ray, node, test }) }
    }
}

/// One of the tests of an instruction set.
struct Entered<'a> {
    wide: &'a WideBvh,
    ray: &'a Ray,
    node: &'a WideNode,
    test: NodeTest<'a>,
}

impl<K: Instructions> Task<K> for Entered<'_> {
    type Output = u32;

    #[inline(always)]
    unsafe fn run(self) -> u32 {
        let Self { wide, ray, node, test } = self;
        let t_max = ray.t_max();
        // SAFETY: the processor has the instructions.
        let (boxed, is_near) = unsafe { wide.boxed::<K::Block>(ray) };
        let equal = [*ray; 16];
        const { assert!(K::Rays::N <= 16) };
        // SAFETY: the processor has the instructions, and there are as many rays as lanes.
        unsafe {
            let (lanes, boxes) = (&equal[..]).load::<K::Rays>(0, wide.frame());
            match test {
                // Packets are of rays that begin near the scene.
                NodeTest::Packet if is_near => {
                    let mut bounds = RayBounds::none();
                    bounds.add(&lanes, &boxes);
                    Culling::new(&bounds, boxes.octant()).cull::<K>(node, t_max).1
                }
                // In flight are rays that begin near the scene, too.
                NodeTest::InFlight if is_near => {
                    let mut rays = [const { MaybeUninit::<Prepared>::zeroed() }; 16];
                    let places = rays.each_mut().map(MaybeUninit::as_mut_ptr);
                    Ready::new((lanes, boxes), wide).write(0, places);
                    rays[0].assume_init_ref().boxes::<K>(node, t_max).1
                }
                _ if is_near => {
                    BoxTest::<K>::boxes(&BoxRay::<K::Boxes>::new(&boxed), node, t_max).1
                }
                _ => {
                    let boxes = FarBoxRay::new(&boxed, &wide.far_ray(ray));
                    BoxTest::<K>::boxes(&boxes, node, t_max).1
                }
            }
        }
    }
}
