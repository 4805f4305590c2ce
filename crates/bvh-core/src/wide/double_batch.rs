//! Batches of rays in f64: traced as those in f32, with distances between bounds, and at the end the
//! distance of each ray's hit.

use super::answer::{ANY_HIT, Bounded, Find, Known, NEAREST_HIT};
use super::double::DWideBvh;
use super::double_block::{RAYS, gathered, rounded_distances};
use super::instructions::{Instructions, Task};
use super::lanes::{DoubleLanes, Lanes};
use super::layout::WideBvh;
use super::ray_lanes::{BoxLanes, RayLanes, Rays, in_frame};
use super::triangles::TriangleBlock;
use super::vector;
use crate::double::{NearestHit, Query};
use crate::{Coherence, DHit, DRay, DTriangle, Frame, Hit, Kernel, Select};

/// The number of rays of which something is kept at a time.
const AT_ONCE: usize = 4096;

impl DWideBvh {
    /// Writes the [nearest hit](Self::nearest_hit) of every ray. `select` excludes the same number of
    /// ids for each ray, ray after ray.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many, or the number of excluded ids is no multiple.
    pub fn nearest_hits(
        &self,
        rays: &[DRay],
        select: Select,
        hits: &mut [Option<DHit>],
        coherence: Coherence,
    ) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        let mut nearest = Vec::new();
        for (part, hits) in self.parts(rays, select).zip(hits.chunks_mut(AT_ONCE)) {
            nearest.clear();
            nearest.extend(part.rays.iter().map(NearestHit::new));
            self.wide.trace(Nearest { part, nearest: &mut nearest }, part.coherence(coherence));
            self.resolve(part.rays, &mut nearest);
            for (hit, nearest) in hits.iter_mut().zip(&nearest) {
                *hit = nearest.hit();
            }
        }
    }

    /// Writes whether every ray meets [any triangle](Self::any_hit), as
    /// [`nearest_hits`](Self::nearest_hits) does.
    ///
    /// # Panics
    /// As [`nearest_hits`](Self::nearest_hits).
    pub fn any_hits(&self, rays: &[DRay], select: Select, hits: &mut [bool], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        for (part, hits) in self.parts(rays, select).zip(hits.chunks_mut(AT_ONCE)) {
            if select.counts_all() {
                self.wide.trace(Any::<true> { part, hits }, coherence);
            } else {
                self.wide.trace(Any::<false> { part, hits }, part.coherence(coherence));
            }
        }
    }

    /// Appends [all hits](Self::all_hits) of every ray to `hits`, ray after ray, and writes the number
    /// of hits of each ray.
    ///
    /// # Panics
    /// Panics if `rays` and `counts` are not equally many.
    pub fn all_hits_of(&self, rays: &[DRay], hits: &mut Vec<DHit>, counts: &mut [u32]) {
        assert_eq!(rays.len(), counts.len(), "a count for every ray");
        counts.fill(0);
        for (part, counts) in self.parts(rays, Select::default()).zip(counts.chunks_mut(AT_ONCE)) {
            let (mut numbers, mut found) = (Vec::new(), Vec::new());
            let all = All { part, numbers: &mut numbers, found: &mut found };
            self.wide.trace(all, Coherence::Incoherent);
            let rays: Vec<DRay> = numbers.iter().map(|&number| part.rays[number]).collect();
            self.resolve(&rays, &mut found);
            // No distance is negative or −0, so distances are ordered as their bits are.
            let key =
                |(&number, hit): (&usize, &NearestHit)| (number, hit.low.to_bits(), hit.object);
            let mut sorted: Vec<_> = numbers.iter().zip(&found).map(key).collect();
            sorted.sort_unstable();
            // A divided triangle is hit in several leaves, every time at the same distance.
            sorted.dedup();
            for (number, t, object) in sorted {
                counts[number] += 1;
                hits.push(DHit { t: f64::from_bits(t), object });
            }
        }
    }

    fn parts<'a>(&'a self, rays: &'a [DRay], select: Select<'a>) -> impl Iterator<Item = Part<'a>> {
        let excluded = select.exclude.len().checked_div(rays.len()).unwrap_or(0);
        assert_eq!(select.exclude.len(), excluded * rays.len(), "ids to exclude for every ray");
        rays.chunks(AT_ONCE).enumerate().map(move |(number, rays)| {
            let exclude = &select.exclude[excluded * number * AT_ONCE..][..excluded * rays.len()];
            Part { layout: self, rays, select: Select { exclude, ..select }, excluded }
        })
    }

    /// Finds the distances that are not known yet.
    fn resolve(&self, rays: &[DRay], nearest: &mut [NearestHit]) {
        if self.wide.kernel != Kernel::Portable {
            let task = Resolve { layout: self, rays, nearest };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.wide.kernel, task) };
        }
        for (ray, nearest) in rays.iter().zip(nearest) {
            self.resolve_alone(ray, nearest);
        }
    }
}

/// The bounds of a distance that is found at the end.
const UNKNOWN: (f64, f64) = (0.0, f64::INFINITY);

/// By how many rays the triangles that they hit are fetched ahead.
const AHEAD: usize = 16;

/// The search for distances that are not known yet.
struct Resolve<'a> {
    layout: &'a DWideBvh,
    rays: &'a [DRay],
    nearest: &'a mut [NearestHit],
}

impl<K: Instructions> Task<K> for Resolve<'_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { layout, rays, nearest } = self;
        let last = layout.triangles.len().saturating_sub(1);
        // Lanes without a hit have others of these.
        let mut their_rays = [rays.as_ptr(); RAYS];
        let mut their_triangles = [layout.triangles.as_ptr(); RAYS];
        let mut numbers = [0; RAYS];
        let mut count = 0;
        for number in 0..nearest.len() {
            if let Some(ahead) = nearest.get(number + AHEAD) {
                let object = last.min(ahead.object as usize);
                let triangle = layout.triangles.as_ptr().wrapping_add(object);
                // SAFETY: the processor has the instructions; a prefetch may name any address.
                unsafe { K::prefetch_bytes(triangle.cast(), size_of::<DTriangle>()) };
            }
            let hit = nearest[number];
            if !hit.is_known() {
                their_rays[count] = &rays[number];
                their_triangles[count] = &layout.triangles[hit.object as usize];
                numbers[count] = number;
                count += 1;
            }
            if count < K::Rays::N && (number + 1 < nearest.len() || count == 0) {
                continue;
            }
            // SAFETY: the processor has the instructions; the rays and what they hit exist.
            let (rounded, is_decided) =
                unsafe { rounded_distances::<K::Rays>(&their_rays, &their_triangles) };
            for (lane, &number) in numbers[..count].iter().enumerate() {
                if is_decided >> lane & 1 != 0 {
                    let hit = &mut nearest[number];
                    (hit.low, hit.high) = (rounded[lane], rounded[lane]);
                } else {
                    layout.resolve_alone(&rays[number], &mut nearest[number]);
                }
            }
            count = 0;
        }
    }
}

/// Some rays of a batch, with what counts for each.
#[derive(Clone, Copy)]
struct Part<'a> {
    layout: &'a DWideBvh,
    rays: &'a [DRay],
    select: Select<'a>,
    /// The number of ids that each ray excludes.
    excluded: usize,
}

impl<'a> Part<'a> {
    #[inline(always)]
    fn query(&self, number: usize) -> Query<'a> {
        let exclude = &self.select.exclude[self.excluded * number..][..self.excluded];
        let triangles = &self.layout.triangles;
        Query { triangles, ray: &self.rays[number], select: Select { exclude, ..self.select } }
    }

    /// Packets exclude nothing.
    fn coherence(&self, coherence: Coherence) -> Coherence {
        if self.excluded == 0 { coherence } else { Coherence::Incoherent }
    }

    #[inline(always)]
    fn rays(&self) -> DRays<'a> {
        DRays { rays: self.rays, frame: &self.layout.frame }
    }
}

/// Rays in f64, to be traced in a frame.
#[derive(Clone, Copy)]
struct DRays<'a> {
    rays: &'a [DRay],
    frame: &'a Frame,
}

impl Rays for DRays<'_> {
    #[inline(always)]
    fn count(self) -> usize {
        self.rays.len()
    }

    /// Returns what [`DWideBvh::boxed`] returns for every ray, but for operations that are fused.
    #[inline(always)]
    unsafe fn load_up_to<L: Lanes>(
        self,
        first: usize,
        end: usize,
        _: Option<&Frame>,
    ) -> (RayLanes<L>, BoxLanes<L>) {
        let last = end - 1 - first;
        let ray = |lane: usize| self.rays.as_ptr().wrapping_add(first + lane.min(last)).cast();
        // SAFETY: the processor has the instructions; the rays exist.
        unsafe {
            let rays = core::array::from_fn(ray);
            let [x, y, z, dx, dy, dz, t_min, t_max] = gathered::<L::Double, 8, RAYS>(&rays);
            let size = dx.abs().max(dy.abs()).max(dz.abs()).power_of_two();
            let unit = size.filled(1.0) / size;
            let along = [dx * unit, dy * unit, dz * unit];
            let (direction, boxed) = in_frame::<L>([x, y, z], along, self.frame);
            let t_min = L::single(t_min * size);
            let t_max = L::single(t_max * size);
            let most = t_max.filled(f32::MAX);
            let (t_min, t_max) = (t_min.min(most), t_max.min(most));
            (RayLanes { origin: boxed.origin, direction, t_min, t_max }, boxed)
        }
    }

    #[inline(always)]
    unsafe fn prefetch<K: Instructions>(self, first: usize) {
        let next = self.rays.as_ptr().wrapping_add(first).cast::<u8>();
        // SAFETY: a prefetch may name any address.
        unsafe { K::prefetch_bytes(next, K::Rays::N * size_of::<DRay>()) };
    }
}

/// The nearest hit of every ray.
struct Nearest<'a> {
    part: Part<'a>,
    nearest: &'a mut [NearestHit],
}

impl<'a> Find for Nearest<'a> {
    type Rays = DRays<'a>;
    const DECIDES: bool = true;

    #[inline(always)]
    fn rays(&self) -> DRays<'a> {
        self.part.rays()
    }

    #[inline(always)]
    fn counted(&self, certain: u32, along: u32) -> u32 {
        self.part.select.oriented(certain, along)
    }

    fn learn(&mut self, number: usize, Known { low, high, object }: Known) {
        let nearest = &mut self.nearest[number];
        // What is known of the same triangle already is more.
        if object != nearest.object {
            *nearest = NearestHit::between(self.part.rays[number].doubles(low, high), object);
        }
    }

    fn known(&self, number: usize) -> Known {
        let NearestHit { low, high, object } = self.nearest[number];
        let ray = &self.part.rays[number];
        Known { low: ray.single(low).next_down(), high: ray.single(high).next_up(), object }
    }

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        let nearest = &mut self.nearest[number];
        if object != nearest.object {
            *nearest = NearestHit::between(UNKNOWN, object);
        }
    }

    #[inline(always)]
    unsafe fn decide<K: Instructions>(
        &mut self,
        number: usize,
        block: &TriangleBlock,
        bounded: &Bounded,
    ) -> Option<Hit> {
        let query = self.part.query(number);
        let nearest = &mut self.nearest[number];
        // SAFETY: the processor has the instructions; the block is one of the layout.
        let end = unsafe { self.part.layout.offer_block::<K>(&query, nearest, block, bounded) };
        end.map(|t| Hit { t, object: nearest.object })
    }

    fn alone(&mut self, _: &WideBvh, number: usize) {
        let query = self.part.query(number);
        self.part.layout.search::<NEAREST_HIT>(&query, &mut self.nearest[number]);
    }
}

/// Whether each ray hits anything. All triangles count if `PLAIN`.
struct Any<'a, const PLAIN: bool> {
    part: Part<'a>,
    hits: &'a mut [bool],
}

impl<'a, const PLAIN: bool> Find for Any<'a, PLAIN> {
    type Rays = DRays<'a>;
    const ANY: bool = true;
    const DECIDES: bool = true;
    const TAKES_CERTAIN: bool = PLAIN;

    #[inline(always)]
    fn rays(&self) -> DRays<'a> {
        self.part.rays()
    }

    #[inline(always)]
    fn counted(&self, certain: u32, along: u32) -> u32 {
        self.part.select.oriented(certain, along)
    }

    #[inline(always)]
    unsafe fn decide<K: Instructions>(
        &mut self,
        number: usize,
        block: &TriangleBlock,
        bounded: &Bounded,
    ) -> Option<Hit> {
        let query = self.part.query(number);
        // SAFETY: the processor has the instructions; the block is one of the layout.
        let hit = unsafe { self.part.layout.any_of::<K>(&query, block, bounded) };
        hit.map(|object| Hit { t: 0.0, object })
    }

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self.hits[number] = object != u32::MAX;
    }

    fn alone(&mut self, _: &WideBvh, number: usize) {
        let query = self.part.query(number);
        let mut nearest = NearestHit::new(query.ray);
        self.hits[number] = self.part.layout.search::<ANY_HIT>(&query, &mut nearest);
    }
}

/// All hits of every ray, in no order; those of a divided triangle once for each of its leaves.
struct All<'a> {
    part: Part<'a>,
    /// The rays of the hits.
    numbers: &'a mut Vec<usize>,
    found: &'a mut Vec<NearestHit>,
}

impl All<'_> {
    fn take(&mut self, number: usize, hit: DHit) {
        self.numbers.push(number);
        self.found.push(NearestHit::between((hit.t, hit.t), hit.object));
    }
}

impl<'a> Find for All<'a> {
    type Rays = DRays<'a>;
    const ALL: bool = true;
    const DECIDES: bool = true;

    #[inline(always)]
    fn rays(&self) -> DRays<'a> {
        self.part.rays()
    }

    #[inline(always)]
    unsafe fn decide<K: Instructions>(
        &mut self,
        number: usize,
        block: &TriangleBlock,
        Bounded { possible, certain, .. }: &Bounded,
    ) -> Option<Hit> {
        let Part { layout, rays, .. } = self.part;
        let ray = &rays[number];
        // SAFETY: the processor has the instructions.
        let mut lanes = possible & unsafe { block.used::<K::Block>() };
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if certain >> lane & 1 == 0 {
                let hit = layout.hit_of(ray, block.id(lane));
                hit.into_iter().for_each(|hit| self.take(number, hit));
            } else {
                // It crosses no edge, in the ray's range.
                self.numbers.push(number);
                self.found.push(NearestHit::between(UNKNOWN, block.id(lane)));
            }
        }
        None
    }

    fn alone(&mut self, _: &WideBvh, number: usize) {
        let hits = self.part.layout.all_hits(&self.part.rays[number]);
        hits.into_iter().for_each(|hit| self.take(number, hit));
    }
}
