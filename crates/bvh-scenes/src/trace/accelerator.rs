//! Finds the objects on a ray through one interface over every acceleration structure, with and
//! without counting tests.

use super::kd_tree::KdTree;
use super::unpruned;
use bvh_core::{
    Bvh, Counter, DRay, Hit, PreparedRay, Primitives, Ray, TestCounts, WideBvh, any_hit_by,
    any_hit_of_all, nearest_hit_by, nearest_hit_of_all,
};
use std::borrow::Cow;

bvh_config::config! {
    /// The question that a ray answers.
    #[derive(Copy, Eq)]
    pub enum Query {
        /// Does the ray hit any object? The paper's shadow rays ask this.
        Any,
        /// Which object does the ray hit first?
        Nearest,
        /// Which objects are on the ray? No hit ends the traversal.
        All,
    }
}

/// A structure that narrows down the objects that a ray may hit.
#[derive(Clone, Debug)]
pub enum Structure<'a> {
    /// No structure: every object is tested.
    Brute,
    /// A KD-tree.
    KdTree(KdTree),
    /// A hierarchy.
    Tree(Cow<'a, Bvh>),
    /// A hierarchy, traced as in Chang's CSS 552 report: last child first, without pruning, and
    /// hits count only within the box of their leaf. Rounding can lose hits.
    Unpruned(Cow<'a, Bvh>),
    /// A hierarchy of triangles in the wide layout, traced with the best instructions of this
    /// machine, which count no tests.
    Wide(WideBvh),
    /// A hierarchy of triangles in the wide layout, traced with portable code.
    WidePortable(WideBvh),
}

/// Objects with a structure over them. Every structure gives the same answers, bit for bit, except
/// [`Structure::Unpruned`].
#[derive(Clone, Debug)]
pub struct Accelerator<'a> {
    objects: &'a Primitives,
    structure: Structure<'a>,
}

impl<'a> Accelerator<'a> {
    /// Combines objects with a structure, which must have been built over these objects. Otherwise
    /// rays may panic or return wrong answers.
    pub fn new(objects: &'a Primitives, structure: Structure<'a>) -> Self {
        Self { objects, structure }
    }

    /// Uses a hierarchy without any other layout.
    pub fn of_tree(objects: &'a Primitives, tree: &'a Bvh) -> Self {
        Self::new(objects, Structure::Tree(Cow::Borrowed(tree)))
    }

    /// Returns the objects.
    pub fn objects(&self) -> &'a Primitives {
        self.objects
    }

    /// Returns the nearest object in the ray's range; of several at the same distance, the object
    /// with the lowest id.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.nearest_hit_counted(ray, &mut ())
    }

    /// Returns whether any object is in the ray's range. The first hit ends the traversal.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.any_hit_counted(ray, &mut ())
    }

    /// Answers as [`nearest_hit`](Self::nearest_hit) does and counts the tests, except in
    /// [`Structure::Wide`].
    pub fn nearest_hit_counted(&self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        let test = || test(self.objects, ray);
        match &self.structure {
            Structure::Wide(wide) => wide.nearest_hit(ray),
            Structure::WidePortable(wide) => wide.nearest_hit_counted(ray, counter),
            Structure::Tree(tree) => nearest_hit_by(&**tree, ray, test(), counter),
            Structure::Unpruned(tree) => unpruned::nearest_hit(tree, ray, test(), counter),
            Structure::KdTree(tree) => tree.nearest_hit(ray, test(), counter),
            Structure::Brute => {
                nearest_hit_of_all(self.objects.count() as u32, ray, test(), counter)
            }
        }
    }

    /// Answers as [`any_hit`](Self::any_hit) does and counts the tests, except in
    /// [`Structure::Wide`].
    pub fn any_hit_counted(&self, ray: &Ray, counter: &mut impl Counter) -> bool {
        match &self.structure {
            Structure::Wide(wide) => wide.any_hit(ray),
            Structure::WidePortable(wide) => wide.any_hit_counted(ray, counter),
            // Its hits need distances, and none of them ends the traversal.
            Structure::Unpruned(_) => self.nearest_hit_counted(ray, counter).is_some(),
            _ => self.visit(ray, true, counter),
        }
    }

    /// Answers `query` and counts the tests. Returns whether the ray hits. The wide layouts use
    /// portable code here, so that the counts are the same on every machine; for [`Query::All`]
    /// they test every object.
    pub fn count(&self, query: Query, ray: &Ray, counts: &mut TestCounts) -> bool {
        match (query, &self.structure) {
            (Query::All, _) => self.visit(ray, false, counts),
            (Query::Nearest, Structure::Wide(wide)) => {
                wide.nearest_hit_counted(ray, counts).is_some()
            }
            (Query::Nearest, _) => self.nearest_hit_counted(ray, counts).is_some(),
            (Query::Any, Structure::Wide(wide)) => wide.any_hit_counted(ray, counts),
            (Query::Any, _) => self.any_hit_counted(ray, counts),
        }
    }

    /// Tests the objects on the ray, up to the first hit or all of them. Returns whether there was
    /// a hit.
    #[inline(always)]
    fn visit(&self, ray: &Ray, ends_at_hit: bool, counter: &mut impl Counter) -> bool {
        let test = test(self.objects, ray);
        let mut is_hit = false;
        // To visit all objects, the tests report no hit, so that the traversal continues.
        let visited = |id: u32| {
            is_hit |= test(id, ray.t_max()).is_some();
            is_hit && ends_at_hit
        };
        let _ = match &self.structure {
            Structure::Tree(tree) | Structure::Unpruned(tree) => {
                any_hit_by(&**tree, ray, visited, counter)
            }
            Structure::KdTree(tree) => tree.any_hit(ray, visited, counter),
            _ => any_hit_of_all(self.objects.count() as u32, visited, counter),
        };
        is_hit
    }
}

/// Returns the test of a ray against the object of an id, up to a distance.
#[inline(always)]
fn test(objects: &Primitives, ray: &Ray) -> impl Fn(u32, f32) -> Option<f32> {
    let prepared = PreparedRay::new(ray);
    move |id, t_max| match objects {
        Primitives::Triangles(triangles) => triangles[id as usize].intersect(&prepared, t_max),
        Primitives::Doubles(triangles) => {
            let [origin, direction] = [ray.origin(), ray.direction()].map(|end| end.as_dvec3());
            let ray = DRay::new(origin, direction, ray.t_min().into(), t_max.into()).ok()?;
            triangles[id as usize].intersect(&ray).map(|t| t as f32)
        }
        Primitives::Spheres(spheres) => spheres[id as usize].intersect(ray, t_max),
    }
}
