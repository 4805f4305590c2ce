//! A search without its command line, its result, and the tree file.

use super::effort::Effort;
use super::watch::Watch;
use crate::Error;
use crate::interrupt::{INTERRUPTED, hold};
use crate::rays::Rays;
use bvh_core::cost::{Objective, internal_area};
use bvh_core::file::Header;
use bvh_core::{Bvh, Frame, Node, RayDensity};
use bvh_scenes::Scene;
use bvh_scenes::files::Reserved;
use bvh_scenes::tree_file::{self, TreeFileError};
use bvh_search::{Bake, Baked, Budget, Division, Method};
use std::path::Path;

/// A search for the best tree of any scene.
#[derive(Clone, Debug)]
pub struct Plan {
    pub method: Method,
    pub effort: Effort,
    pub seed: u64,
    pub objective: Objective,
    /// The largest number of references per object; 1 for whole objects.
    pub references: f64,
    /// The rays whose visits replace areas.
    pub rays: Option<Rays>,
}

/// Returns the size in bytes of the largest file of a tree over a scene with at most so many
/// references per object.
pub fn most_bytes(scene: &Scene, references: f64) -> usize {
    // A tree with n leaves has fewer than 2n nodes; each node may have a number of visits.
    let reference = 2 * (size_of::<Node>() + size_of::<f32>()) + size_of::<u32>();
    Header::BYTES
        + size_of::<Frame>()
        + (references * scene.boxes.len() as f64) as usize * reference
}

/// The tree of an earlier bake of the scene, from which a search continues.
pub struct Start {
    pub tree: Bvh,
    /// The work of the earlier bake, in nodes built or visited.
    pub work: u64,
}

impl Start {
    /// Reads the tree of `--from` over the scene. Rejects a tree with nodes that no search moves.
    pub fn load(from: &Path, scene: &Scene) -> Result<Self, Error> {
        let (tree, header) = tree_file::load(from, scene)?;
        let is_wide = |node: &Node| !node.is_leaf() && node.children().len() != 2;
        if let Some(wide) = tree.nodes.iter().position(is_wide) {
            return Err(Error::Usage(format!(
                "--from {}: inner node {wide} has {} children; accepted: a tree of nodes with two",
                from.display(),
                tree.nodes[wide].children().len()
            )));
        }
        Ok(Self { tree, work: header.work })
    }
}

/// The results of a decision that the search needs too, and would otherwise make again.
#[derive(Default)]
pub struct Prepared {
    pub greedy: Option<Bvh>,
    /// The density of the plan's rays.
    pub density: Option<RayDensity>,
    /// The division of the objects with spatial splits.
    pub division: Option<Bvh>,
    /// The best trial of a decision that the user interrupted, and the rays that judged it.
    pub tried: Option<(Baked, RayDensity)>,
}

impl Plan {
    /// Returns the bake of a scene.
    pub fn bake<'a>(&'a self, scene: &'a Scene, rays: Option<&'a RayDensity>) -> Bake<'a> {
        Bake {
            frame: scene.frame.as_ref(),
            shapes: Some(&scene.primitives),
            rays,
            objective: Some(self.objective),
            references: self.references,
            method: match &self.method {
                Method::Best(_) => None,
                method => Some((method.name(), method)),
            },
            seed: self.seed,
            budget: Budget { max_work: self.effort.work(), ..Budget::UNLIMITED },
            ..Bake::new(&scene.boxes)
        }
    }

    /// Searches until the budget is spent or the user interrupts. The time of a budget begins
    /// when the greedy tree is built.
    pub fn search<'a>(
        &'a self,
        scene: &'a Scene,
        start: Option<&'a Start>,
        prepared: Prepared,
    ) -> Result<Found<'a>, Error> {
        hold();
        let failed = |error| Error::search(&scene.name, self.method.name())(error);
        let Prepared { mut greedy, mut density, division, tried } = prepared;
        if greedy.is_none() {
            greedy = self.bake(scene, None).greedy(&INTERRUPTED).map_err(failed)?;
        }
        let watch = Watch::new(self.effort);
        if let (None, Some(rays), Some(tree)) = (&density, &self.rays, &greedy) {
            density = rays.density(scene, tree, self.seed)?;
        }
        let area_of_greedy = greedy.as_ref().map(internal_area);
        let bake = Bake {
            division: division.as_ref(),
            start: start.map(|start| &start.tree),
            ..self.bake(scene, density.as_ref())
        };
        let (baked, judging) = match tried {
            Some((baked, judging)) => (Ok(baked), Some(judging)),
            None => (bake.search(greedy, &watch), None),
        };
        watch.bar.finish_and_clear();
        let baked = baked.map_err(failed)?;
        let seconds = watch.deadline.elapsed().as_secs_f64();
        // The work of all bakes that led to this tree, one after the other.
        let work = start.map_or(0, |start| start.work).saturating_add(baked.outcome.work);
        Ok(Found { plan: self, scene, density, baked, judging, area_of_greedy, work, seconds })
    }
}

/// The result of a search, with what its file and its summary need.
pub struct Found<'a> {
    pub plan: &'a Plan,
    pub scene: &'a Scene,
    pub density: Option<RayDensity>,
    pub baked: Baked,
    /// The rays that judged the tree, if it is a trial.
    judging: Option<RayDensity>,
    /// The total area of inner nodes of the greedy tree, which the documentation compares.
    pub area_of_greedy: Option<f64>,
    work: u64,
    /// The time since the greedy tree was built.
    pub seconds: f64,
}

impl Found<'_> {
    /// Writes the file of the tree. Returns its number of bytes.
    pub fn save(&self, path: &Path, reserved: Reserved) -> Result<usize, Error> {
        let bake = self.plan.bake(self.scene, self.density.as_ref());
        let written = bake.write(&self.baked.outcome.tree, self.work, |sections| {
            reserved.write(sections)?;
            Ok(sections.iter().map(|section| section.len()).sum())
        });
        written.map_err(TreeFileError::of(path))?
    }

    /// Returns whether the file at the path has a tree over the scene that is no worse than the one
    /// of this interrupted search.
    pub fn is_behind(&self, path: &Path) -> bool {
        let Ok((old, _)) = tree_file::load(path, self.scene) else { return false };
        let Baked { outcome, greedy, division, .. } = &self.baked;
        let bake = self.plan.bake(self.scene, self.density.as_ref());
        let [old, new] = [&old, &outcome.tree].map(|tree| match &self.judging {
            Some(judging) => Objective::Layout.cost_by(tree, judging),
            None => bake.cost(tree, *division),
        });
        // The old tree may be for another cost, by which a greedy tree would be behind.
        old <= new || *greedy == Some(outcome.cost)
    }

    /// Names the cost that the search minimised, unless it is the total area of inner nodes.
    pub fn unit(&self) -> Option<&'static str> {
        match (self.plan.objective, self.density.is_some()) {
            (Objective::Layout, true) => Some("cost of the wide layout for rays"),
            (Objective::Layout, false) => Some("cost of the wide layout"),
            (_, true) => Some("visits of rays"),
            (_, false) if self.baked.division == Division::Allowed => Some("area of all nodes"),
            (_, false) => None,
        }
    }
}
