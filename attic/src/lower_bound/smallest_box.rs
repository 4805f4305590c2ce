//! The smallest box around an object and enough others: an anytime branch and bound over its six
//! faces.

use super::clusters::{Clusters, Reach};
use bvh_core::with_vector_instructions;
use bvh_search::Observer;
use std::cmp::Ordering;

/// A cluster that weighs at most 1/128 of the size in question counts as inside a box as soon as
/// one of its objects is.
const CLUSTERS_PER_SIZE: u64 = 128;

impl Clusters {
    /// Returns a lower bound of the half area of every box that contains an object of the cluster
    /// `seed` and weighs at least `weight`, which must not exceed the total weight. The bound is
    /// the exact minimum for a single object and enough effort, and 0 once the observer cancels.
    pub fn smallest_box(
        &self,
        seed: usize,
        weight: u64,
        effort: u32,
        observer: &dyn Observer,
    ) -> f64 {
        if observer.cancelled() { 0.0 } else { search(self, seed, weight, effort, observer) }
    }
}

/// A cluster that a box may contain.
#[derive(Clone, Copy)]
struct Member {
    /// Half area of the box around the cluster and everything that must be inside.
    area: f64,
    cluster: u32,
    weight: u32,
}

impl Member {
    /// Orders members by area. The cluster breaks ties, so that the order is total and the result
    /// deterministic.
    #[inline(always)]
    fn compare(&self, other: &Self) -> Ordering {
        self.area.total_cmp(&other.area).then(self.cluster.cmp(&other.cluster))
    }
}

#[inline(always)]
fn total_weight(members: &[Member]) -> u64 {
    members.iter().map(|member| u64::from(member.weight)).sum()
}

/// All boxes that contain `must` and only `members`, weigh enough, and are smaller than the best
/// known box.
struct Region {
    must: Reach,
    members: Vec<Member>,
    /// The number of members that weigh enough together, in increasing order of the area that they
    /// need.
    enough: usize,
    /// The area that the last of these members needs. No box of the region is smaller.
    bound: f64,
}

impl Region {
    /// Builds the region; `None` if it has no box smaller than `known`. Lowers `known` to the area
    /// of the best box found.
    #[inline(always)]
    fn new(
        clusters: &Clusters,
        must: Reach,
        members: impl Iterator<Item = Member>,
        weight: u64,
        known: &mut f64,
    ) -> Option<Self> {
        let mut members: Vec<Member> = members
            .map(|member| {
                let reach = &clusters.nodes[member.cluster as usize].reach;
                Member { area: must.union(reach).half_area(), ..member }
            })
            .filter(|member| member.area < *known)
            .collect();
        if total_weight(&members) < weight {
            return None;
        }
        // Invariant: the smallest prefix that weighs enough ends within `low..high`. Quickselect
        // finds it in O(n) without a full sort.
        let mut low = 0;
        let mut high = members.len();
        let mut missing = weight;
        while high - low > 1 {
            let half = (high - low) / 2;
            members[low..high].select_nth_unstable_by(half, Member::compare);
            let lower = total_weight(&members[low..low + half]);
            if lower >= missing {
                high = low + half;
            } else {
                missing -= lower;
                low += half;
            }
        }
        let bound = members[low].area;
        let region = Self { must, members, enough: low + 1, bound };
        *known = known.min(region.around(clusters).half_area());
        Some(region)
    }

    /// Returns the reaches of the first `enough` members.
    #[inline(always)]
    fn nearest<'a>(&'a self, clusters: &'a Clusters) -> impl Iterator<Item = &'a Reach> {
        self.members[..self.enough]
            .iter()
            .map(|member| &clusters.nodes[member.cluster as usize].reach)
    }

    /// Returns the box around these members, a good box of the region.
    #[inline(always)]
    fn around(&self, clusters: &Clusters) -> Reach {
        self.nearest(clusters).fold(self.must, |union, reach| union.union(reach))
    }

    /// Chooses the division of the region: the face whose move from `must` to that box costs most
    /// area, at the median of the reaches that it passes.
    fn division(&self, clusters: &Clusters) -> Option<(usize, f32)> {
        let around = self.around(clusters);
        let mut best = None;
        for face in [0, 1, 2, 4, 5, 6] {
            let mut moved = self.must;
            moved.0[face] = around.0[face];
            let gain = (moved.half_area(), around.0[face] - self.must.0[face]);
            if gain.1 > 0.0 && best.is_none_or(|(least, _)| gain > least) {
                best = Some((gain, face));
            }
        }
        let (_, face) = best?;
        let mut passed: Vec<f32> = self
            .nearest(clusters)
            .map(|reach| reach.0[face])
            .filter(|&reach| reach > self.must.0[face])
            .collect();
        let middle = passed.len() / 2;
        passed.select_nth_unstable_by(middle, f32::total_cmp);
        Some((face, passed[middle]))
    }
}

with_vector_instructions! {
    search = search_plain(
        clusters: &Clusters, seed: usize, weight: u64, effort: u32, observer: &dyn Observer,
    ) -> f64
}

#[inline(always)]
fn search_plain(
    clusters: &Clusters,
    seed: usize,
    weight: u64,
    effort: u32,
    observer: &dyn Observer,
) -> f64 {
    let mut around = seed;
    // The box of the smallest ancestor with enough weight is a first upper bound.
    while around != 0 && clusters.weight_of(&clusters.nodes[around].objects) < weight {
        around = clusters.nodes[around].parent;
    }
    let mut known = clusters.nodes[around].half_area;
    let must = clusters.nodes[seed].reach;
    let members = neighbours(clusters, &must, weight / CLUSTERS_PER_SIZE, known);
    // Invariant: the regions together contain all boxes smaller than `known`.
    let mut regions: Vec<Region> =
        Region::new(clusters, must, members.into_iter(), weight, &mut known).into_iter().collect();
    let mut left =
        regions.iter().map(|region| region.members.len() as u64).sum::<u64>() * u64::from(effort);
    loop {
        let least =
            (0..regions.len()).min_by(|&a, &b| regions[a].bound.total_cmp(&regions[b].bound));
        let Some(least) = least.filter(|&least| regions[least].bound < known) else { return known };
        if left == 0 || observer.cancelled() {
            return regions[least].bound;
        }
        // The region with the least bound first: the search's bound is that least bound, so only
        // its division can raise it.
        let region = regions.swap_remove(least);
        left = left.saturating_sub(2 * region.members.len() as u64);
        let Some((face, plane)) = region.division(clusters) else { return region.bound };
        let members = || region.members.iter().copied();
        // Every box either ends below the plane on this face, which excludes the members beyond, or
        // reaches the plane. The two regions cover both cases.
        let short = members()
            .filter(|member| clusters.nodes[member.cluster as usize].reach.0[face] < plane);
        let mut far = region.must;
        far.0[face] = plane;
        regions.extend(Region::new(clusters, region.must, short, weight, &mut known));
        regions.extend(Region::new(clusters, far, members(), weight, &mut known));
    }
}

/// Returns the clusters that need less area than `known` together with `must`: single objects, or
/// clusters that weigh at most `most`.
#[inline(always)]
fn neighbours(clusters: &Clusters, must: &Reach, most: u64, known: f64) -> Vec<Member> {
    let mut found = vec![];
    let mut stack = vec![0];
    while let Some(index) = stack.pop() {
        let cluster = &clusters.nodes[index];
        let area = must.union(&cluster.reach).half_area();
        if area >= known {
            continue;
        }
        let weight = clusters.weight_of(&cluster.objects);
        if cluster.children == 0 || weight <= most {
            found.push(Member { area, cluster: index as u32, weight: weight as u32 });
        } else {
            stack.extend([cluster.children + 1, cluster.children]);
        }
    }
    found
}
