//! `bvh bake --parts`: cuts a scene by space into parts, bakes each as a job of its own, and joins
//! the trees of the parts under a greedy top.

use super::BakeArgs;
use super::found::Found;
use super::plan::{self, Plan, Prepared, Start};
use super::watch::Watch;
use crate::Error;
use crate::answer::{Answer, gain, short, whole};
use crate::interrupt::is_interrupted;
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Bvh, Node, NodeKind};
use bvh_scenes::files::{Reserved, WriteError};
use bvh_scenes::tree_file;
use bvh_scenes::{Scene, fnv1a};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// The fraction of the budget for the parts. The rest moves subtrees across the borders.
const SHARE_OF_PARTS: f64 = 0.8;

struct Part {
    /// The identifier, which another scene, seed, budget or number of parts changes.
    id: String,
    /// The objects, ascending.
    objects: Vec<usize>,
    plan: Plan,
}

impl Part {
    fn scene(&self, whole: &Scene) -> Scene {
        let primitives = whole.primitives.select(&self.objects);
        Scene::new(&format!("{}, part {}", whole.name, self.id), whole.kind, primitives)
    }

    fn path(&self, folder: &Path) -> PathBuf {
        folder.join(&self.id).with_extension("bvh")
    }
}

/// Lists the parts, bakes one part, or bakes the missing parts and joins all.
pub fn bake(args: &BakeArgs, count: u32, answer: &mut Answer) -> Result<(), Error> {
    let Prepared { out, scene, plan, .. } = plan::prepare(args, answer)?;
    let parts = parts(&plan, &scene, count)?;
    if args.list {
        for (number, Part { id, objects, plan }) in (1..).zip(&parts) {
            let objects = objects.len();
            let work = plan.budget(objects).max_work.unwrap_or(objects as u64);
            // Programs that start the parts read these lines.
            answer.say(&format!("{id} {work} part {number} of {count}, {objects} objects"));
            answer.list("parts", json!({ "id": id, "work": work, "objects": objects }));
        }
        return Ok(());
    }
    let folder = out.with_extension("parts");
    let chosen: Vec<&Part> =
        parts.iter().filter(|part| args.part.as_ref().is_none_or(|id| *id == part.id)).collect();
    if let ([], Some(id)) = (&chosen[..], &args.part) {
        let accepted = "an identifier that --list prints for the same scene, budget and seed";
        return Err(Error::Usage(format!("--part {id}: no such part; accepted: {accepted}")));
    }
    fs::create_dir_all(&folder).map_err(WriteError::of(&folder, "create the folder"))?;
    for part in chosen {
        let path = part.path(&folder);
        if path.exists() {
            continue;
        }
        let scene = part.scene(&scene);
        let watch = Watch::new(part.plan.effort);
        let found = part.plan.search(&scene, None, watch, answer)?;
        // A part whose search was cut short would differ from run to run.
        if is_interrupted() {
            let folder = folder.display();
            let left =
                format!("finished parts are in {folder}, and the same command bakes the rest");
            return Err(Error::Interrupted(left));
        }
        save_part(&found, &path, answer)?;
    }
    if args.part.is_some() {
        return Ok(());
    }
    let reserved = Reserved::new(&out, plan.most_bytes(&scene), args.out.is_none())?;
    let start = join(&scene, &parts, &folder)?;
    let plan = plan.share(1.0 - SHARE_OF_PARTS);
    let found = plan.search(&scene, Some(&start), Watch::new(plan.effort), answer)?;
    found.save(&out, reserved, answer)
}

/// Cuts a scene, and gives every part a share of the budget in proportion to its objects.
fn parts(plan: &Plan, scene: &Scene, count: u32) -> Result<Vec<Part>, Error> {
    let all = scene.boxes.len();
    if count as usize > all {
        let accepted = match all {
            0 | 1 => "no parts".into(),
            _ => format!("2 to the number of objects, {all}"),
        };
        return Err(Error::Usage(format!("--parts {count}; accepted: {accepted}")));
    }
    let checksum = scene.checksum();
    let mut parts = Vec::new();
    for (number, objects) in cut(&scene.boxes, count as usize).into_iter().enumerate() {
        let share = SHARE_OF_PARTS * objects.len() as f64 / all as f64;
        let plan = plan.share(share);
        let Plan { method, effort, seed, objective, references, .. } = &plan;
        let method = method.name();
        let identity = format!(
            "{checksum} {count} {number} {method} {effort:?} {seed} {objective:?} {references}"
        );
        let id = format!("{:016x}", fnv1a(identity.into_bytes()));
        parts.push(Part { id, objects, plan });
    }
    Ok(parts)
}

/// Halves the objects by the centres of their boxes, along the longest axis of the centres, until
/// there are `count` parts of about the same number of objects. Returns the objects of each part,
/// ascending. O(n log count).
fn cut(boxes: &[Aabb], count: usize) -> Vec<Vec<usize>> {
    let mut parts = Vec::new();
    let mut open = vec![((0..boxes.len()).collect::<Vec<usize>>(), count)];
    while let Some((mut objects, count)) = open.pop() {
        if count == 1 {
            objects.sort_unstable();
            parts.push(objects);
            continue;
        }
        let centers = objects.iter().map(|&object| boxes[object].doubled_centroid());
        let low = centers.clone().reduce(|a, b| a.min(b));
        let high = centers.reduce(|a, b| a.max(b));
        let extent = high.unwrap_or_default() - low.unwrap_or_default();
        let axis = extent.max_position();
        let left_count = count / 2;
        let left = objects.len() * left_count / count;
        objects.select_nth_unstable_by(left, |&a, &b| {
            let [center_a, center_b] = [a, b].map(|object| boxes[object].doubled_centroid()[axis]);
            center_a.total_cmp(&center_b).then(a.cmp(&b))
        });
        let right = objects.split_off(left);
        open.push((right, count - left_count));
        open.push((objects, left_count));
    }
    parts
}

/// Reads the trees of all parts, and joins them under a greedy tree over their boxes.
fn join(scene: &Scene, parts: &[Part], folder: &Path) -> Result<Start, Error> {
    let mut trees = Vec::new();
    let mut work = 0;
    for part in parts {
        let (tree, header) = tree_file::load(&part.path(folder), &part.scene(scene))?;
        work += header.work;
        trees.push(tree);
    }
    let boxes: Vec<Aabb> = trees.iter().filter_map(Bvh::root_aabb).collect();
    let top = muller_fellner::Config::default()
        .build(&boxes)
        .map_err(Error::search(&scene.name, "the tree over all parts"))?;
    let objects: Vec<&[usize]> = parts.iter().map(|part| &part.objects[..]).collect();
    Ok(Start { tree: joined(&top, &trees, &objects), work })
}

/// Replaces every leaf of `top`, which has one object each, by the tree with the number of the
/// object. `objects` has the ids of each tree's objects.
fn joined(top: &Bvh, trees: &[Bvh], objects: &[&[usize]]) -> Bvh {
    let mut whole = Bvh::new(top.nodes.clone(), Vec::new());
    for (index, leaf) in top.nodes.iter().enumerate() {
        let NodeKind::Leaf { first, .. } = leaf.kind() else { continue };
        let part = top.prim_ids[first as usize] as usize;
        let nodes_before = whole.nodes.len() as u32;
        let references_before = whole.prim_ids.len() as u32;
        for (place, node) in trees[part].nodes.iter().enumerate() {
            let moved = match node.kind() {
                NodeKind::Leaf { first, count } => {
                    Node::leaf(node.aabb, first + references_before, count)
                }
                // The root takes the place of the leaf, so that its descendants move by one less.
                NodeKind::Inner { first, count } => {
                    Node::inner(node.aabb, first + nodes_before - 1, count)
                }
            };
            if place == 0 {
                whole.nodes[index] = moved;
            } else {
                whole.nodes.push(moved);
            }
        }
        let ids = &trees[part].prim_ids;
        whole.prim_ids.extend(ids.iter().map(|&id| objects[part][id as usize] as u32));
    }
    whole
}

fn save_part(found: &Found, path: &Path, answer: &mut Answer) -> Result<(), Error> {
    found.write(path, Reserved::new(path, 0, false)?)?;
    let cost = found.baked.outcome.cost;
    let Some(base) = found.baked.greedy_cost else { return Ok(()) };
    let objects = found.scene.boxes.len();
    let file = path.display().to_string();
    answer.say(&format!(
        "{file}: {} objects, {} {}, {} against a greedy tree",
        whole(objects),
        found.unit().unwrap_or("total area of inner nodes"),
        short(cost),
        gain(cost, base)
    ));
    answer.list(
        "trees",
        json!({ "file": file, "objects": objects, "minimised_cost": cost,
            "minimised_cost_of_greedy": base }),
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::validate;
    use bvh_scenes::builtin::stiff::{STIFF, boxes};

    #[test]
    fn every_object_is_in_one_part_and_the_joined_tree_is_valid() {
        let config = muller_fellner::Config::default();
        for (case, triangles) in STIFF {
            for (objects, count) in [(2, 2), (50, 3), (301, 7), (301, 64)] {
                let boxes = boxes(&triangles(objects));
                if boxes.len() < count {
                    continue;
                }
                let parts = cut(&boxes, count);
                assert_eq!(parts.len(), count, "{case}");
                let mut all = parts.concat();
                all.sort_unstable();
                assert!(all.into_iter().eq(0..boxes.len()), "{case}");
                let sizes = parts.iter().map(Vec::len);
                assert!(sizes.clone().max().unwrap() <= sizes.min().unwrap() + 7, "{case}");
                let tree = |part: &Vec<usize>| {
                    let boxes: Vec<Aabb> = part.iter().map(|&object| boxes[object]).collect();
                    config.build(&boxes).unwrap()
                };
                let trees: Vec<Bvh> = parts.iter().map(tree).collect();
                let roots: Vec<Aabb> = trees.iter().filter_map(Bvh::root_aabb).collect();
                let objects: Vec<&[usize]> = parts.iter().map(|part| &part[..]).collect();
                let whole = joined(&config.build(&roots).unwrap(), &trees, &objects);
                validate(&whole, &boxes).unwrap_or_else(|error| panic!("{case}: {error}"));
            }
        }
    }
}
