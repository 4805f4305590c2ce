//! Finds the objects on a ray: one interface over every structure, with and without counting tests.

use super::kd_tree::KdTree;
use bvh_core::{
    Bvh, Counter, Hit, Primitives, Ray, Shear, TestCounts, WideBvh, any_hit_by, any_hit_of_all,
    nearest_hit_by, nearest_hit_of_all,
};
use std::borrow::Cow;

/// What a ray asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Query {
    /// Whether it hits anything: the paper's shadow rays.
    Any,
    /// What it hits first.
    Nearest,
    /// Everything on its way: no hit ends it.
    All,
}

/// What narrows down the objects that a ray may hit.
#[derive(Clone, Debug)]
pub enum Structure<'a> {
    /// Nothing does: every object is tested.
    Brute,
    /// A KD-tree.
    KdTree(KdTree),
    /// A hierarchy.
    Tree(Cow<'a, Bvh>),
    /// A hierarchy of triangles in the wide layout, traced with the best instructions of this machine, which count no
    /// tests.
    Wide(WideBvh),
    /// The same, traced with portable code.
    WidePortable(WideBvh),
}

impl Structure<'_> {
    #[inline(always)]
    fn nearest_hit(
        &self,
        objects: usize,
        ray: &Ray,
        test: impl FnMut(u32, f32) -> Option<f32>,
        counter: &mut impl Counter,
    ) -> Option<Hit> {
        match self {
            Self::Tree(tree) => nearest_hit_by(&**tree, ray, test, counter),
            Self::KdTree(tree) => tree.nearest_hit(ray, test, counter),
            _ => nearest_hit_of_all(objects as u32, ray, test, counter),
        }
    }

    #[inline(always)]
    fn any_hit(
        &self,
        objects: usize,
        ray: &Ray,
        test: impl FnMut(u32) -> bool,
        counter: &mut impl Counter,
    ) -> bool {
        match self {
            Self::Tree(tree) => any_hit_by(&**tree, ray, test, counter),
            Self::KdTree(tree) => tree.any_hit(ray, test, counter),
            _ => any_hit_of_all(objects as u32, test, counter),
        }
    }
}

/// Objects with a structure over them. Every structure gives the same answers, bit by bit.
#[derive(Clone, Debug)]
pub struct Accelerator<'a> {
    objects: &'a Primitives,
    structure: Structure<'a>,
}

impl<'a> Accelerator<'a> {
    /// `structure` must have been built over these objects; otherwise rays may panic or be answered wrongly.
    pub fn new(objects: &'a Primitives, structure: Structure<'a>) -> Self {
        Self { objects, structure }
    }

    /// A hierarchy as it is.
    pub fn of_tree(objects: &'a Primitives, tree: &'a Bvh) -> Self {
        Self::new(objects, Structure::Tree(Cow::Borrowed(tree)))
    }

    /// The objects.
    pub fn objects(&self) -> &'a Primitives {
        self.objects
    }

    /// The nearest object in the ray's range; of several at the same distance the one of the lowest id.
    #[inline]
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        match &self.structure {
            Structure::Wide(wide) => wide.nearest_hit(ray),
            _ => self.nearest_hit_uncounted(ray),
        }
    }

    /// Whether anything is in the ray's range. The first hit ends the traversal.
    #[inline]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        match &self.structure {
            Structure::Wide(wide) => wide.any_hit(ray),
            _ => self.any_hit_uncounted(ray),
        }
    }

    // What follows is not generic, so that it is compiled here, optimised, however its callers are compiled.

    fn nearest_hit_uncounted(&self, ray: &Ray) -> Option<Hit> {
        self.find(ray, &mut ())
    }

    fn any_hit_uncounted(&self, ray: &Ray) -> bool {
        self.meets(ray, &mut ())
    }

    /// [`nearest_hit`](Self::nearest_hit) with its tests counted, but for those of [`Structure::Wide`].
    pub fn nearest_hit_counted(&self, ray: &Ray, counts: &mut TestCounts) -> Option<Hit> {
        match &self.structure {
            Structure::Wide(wide) => wide.nearest_hit(ray),
            _ => self.find(ray, counts),
        }
    }

    /// [`any_hit`](Self::any_hit) with its tests counted likewise.
    pub fn any_hit_counted(&self, ray: &Ray, counts: &mut TestCounts) -> bool {
        match &self.structure {
            Structure::Wide(wide) => wide.any_hit(ray),
            _ => self.meets(ray, counts),
        }
    }

    /// Asks as `query` says and counts the tests, the same number on every machine: the wide layout's by portable code.
    /// Returns whether the ray hits. [`Query::All`] through a wide layout tests every object.
    pub fn count(&self, query: Query, ray: &Ray, counts: &mut TestCounts) -> bool {
        match query {
            Query::All => self.visit(ray, false, counts),
            Query::Nearest => self.find(ray, counts).is_some(),
            Query::Any => self.meets(ray, counts),
        }
    }

    /// The nearest object; the wide layouts' by portable code.
    #[inline(always)]
    fn find(&self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        match (&self.structure, self.objects) {
            (Structure::Wide(wide) | Structure::WidePortable(wide), _) => {
                wide.nearest_hit_counted(ray, counter)
            }
            (structure, Primitives::Triangles(triangles)) => {
                let shear = Shear::new(ray);
                let test = |id: u32, t_max| triangles[id as usize].intersect(&shear, t_max);
                structure.nearest_hit(triangles.len(), ray, test, counter)
            }
            (structure, Primitives::Spheres(spheres)) => {
                let test = |id: u32, t_max| spheres[id as usize].intersect(ray, t_max);
                structure.nearest_hit(spheres.len(), ray, test, counter)
            }
        }
    }

    /// Whether there is any object; by portable code too.
    #[inline(always)]
    fn meets(&self, ray: &Ray, counter: &mut impl Counter) -> bool {
        match &self.structure {
            Structure::Wide(wide) | Structure::WidePortable(wide) => {
                wide.any_hit_counted(ray, counter)
            }
            _ => self.visit(ray, true, counter),
        }
    }

    /// Tests objects on the ray's way: up to the first hit, or all of them. Returns whether there was a hit.
    #[inline(always)]
    fn visit(&self, ray: &Ray, ends_at_hit: bool, counter: &mut impl Counter) -> bool {
        let mut found = false;
        let mut note = |hit: Option<f32>| {
            found |= hit.is_some();
            found && ends_at_hit
        };
        match self.objects {
            Primitives::Triangles(triangles) => {
                let shear = Shear::new(ray);
                let test = |id: u32| note(triangles[id as usize].intersect(&shear, ray.t_max()));
                self.structure
                    .any_hit(triangles.len(), ray, test, counter);
            }
            Primitives::Spheres(spheres) => {
                let test = |id: u32| note(spheres[id as usize].intersect(ray, ray.t_max()));
                self.structure
                    .any_hit(spheres.len(), ray, test, counter);
            }
        }
        found
    }
}
