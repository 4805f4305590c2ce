//! Packets of rays through instances: the rays of a packet that enter an instance are moved into
//! its part together, and are a packet there.

use super::answer::{Answers, Batch};
use super::instances::Instances;
use super::instructions::{Instructions, Part};
use super::lanes::{Lanes, Mask};
use super::packet::{Packet, VECTORS};
use super::source::Source;
use core::mem::MaybeUninit;

/// The maximum number of rays in a packet.
const RAYS: usize = 8 * VECTORS;

impl<K: Instructions> Packet<K> {
    /// Traces the rays that enter an instance in its part. `entered` has a bit per ray of the
    /// vector `first` that enters the box of these planes, and earlier vectors do not enter it.
    /// Returns whether any ray has a new nearest hit.
    ///
    /// # Safety
    /// As for [`trace`](super::batch::trace).
    #[inline(always)]
    pub(super) unsafe fn visit_instance<const ANY: bool>(
        &mut self,
        scene: &Instances,
        instance: u32,
        first: usize,
        entered: u32,
        planes: &[[f32; 2]; 3],
    ) -> bool {
        let visit = Visit::<K, ANY> { packet: self, scene, instance, first, entered, planes };
        // SAFETY: the caller's promises.
        unsafe { K::call(visit) }
    }
}

/// A visit of a packet to an instance.
struct Visit<'a, K: Instructions, const ANY: bool> {
    packet: &'a mut Packet<K>,
    scene: &'a Instances,
    instance: u32,
    first: usize,
    entered: u32,
    planes: &'a [[f32; 2]; 3],
}

impl<K: Instructions, const ANY: bool> Part for Visit<'_, K, ANY> {
    type Output = bool;

    #[inline(always)]
    unsafe fn run(self) -> bool {
        let Self { packet, scene, instance, first, mut entered, planes } = self;
        let placed = &scene.placed()[instance as usize];
        let part = scene.part_of(instance);
        let mut found = InPart::NONE;
        // The packet brings its own rays.
        let mut in_part = Batch::new(Source::Rays(&[]), &mut found);
        let mut entries = [const { MaybeUninit::<K::Rays>::uninit() }; VECTORS];
        let mut visited = 0u32;
        // SAFETY: the caller's promises; vectors below the count are written.
        unsafe {
            let mut moved_packet = Packet::<K>::new();
            for (i, entry_of_vector) in
                entries.iter_mut().enumerate().take(packet.count).skip(first)
            {
                if i > first {
                    entered = packet.enter(i, planes);
                }
                if entered == 0 {
                    continue;
                }
                let vector = packet.vectors[i].assume_init_ref();
                let (entry, enters) = vector.rays.entry(&scene.bounds(), &placed.aabb);
                let enters = enters & entry.le(vector.t) & Mask::from_bits(entered);
                if enters.bits() == 0 {
                    continue;
                }
                let (mut moved, is_valid) = vector.rays.moved(&placed.to_local);
                let enters = enters & is_valid;
                // The range of the other rays is empty.
                moved.t_max = Lanes::select(enters, vector.t, K::Rays::splat(-1.0));
                entry_of_vector.write(entry);
                visited |= 1 << i;
                let number = i * K::Rays::N;
                if moved.cohere(&part.near) {
                    if !moved_packet.takes(moved.octant()) {
                        moved_packet.trace::<ANY>(part, &mut in_part);
                    }
                    moved_packet.add(moved, number);
                    continue;
                }
                let mut left = enters.bits();
                while left != 0 {
                    let lane = left.trailing_zeros() as usize;
                    left &= left - 1;
                    in_part.alone::<ANY>(number + lane, part, &moved.ray(lane));
                }
            }
            if !moved_packet.is_empty() {
                moved_packet.trace::<ANY>(part, &mut in_part);
            }
            let mut is_hit = false;
            while visited != 0 {
                let i = visited.trailing_zeros() as usize;
                visited &= visited - 1;
                let vector = packet.vectors[i].assume_init_mut();
                let number = i * K::Rays::N;
                let object = K::Rays::load_unaligned(found.objects.as_ptr().add(number).cast());
                let t = K::Rays::load_unaligned(found.distances.as_ptr().add(number));
                // A hit in front of the instance's box would depend on the tree: a tree that visits
                // the box later would skip it.
                let t = t.max(entries[i].assume_init());
                let own = K::Rays::splat_bits(instance);
                let precedes = t.lt(vector.t) | t.eq(vector.t) & own.below(vector.instance);
                let hits = object.below(K::Rays::splat_bits(u32::MAX));
                let hits = if ANY { hits } else { hits & precedes };
                if hits.bits() != 0 {
                    is_hit = true;
                    // A ray that has its answer ends before it begins.
                    let t = if ANY { K::Rays::splat(-1.0) } else { t };
                    vector.t = Lanes::select(hits, t, vector.t);
                    vector.object = Lanes::select(hits, object, vector.object);
                    vector.instance = Lanes::select(hits, own, vector.instance);
                }
            }
            is_hit
        }
    }
}

/// The answers of the rays of a packet in one instance, by their places in the packet.
struct InPart {
    distances: [f32; RAYS],
    /// Ids, `u32::MAX` for none.
    objects: [u32; RAYS],
}

impl InPart {
    const NONE: Self = Self { distances: [0.0; RAYS], objects: [u32::MAX; RAYS] };
}

impl Answers for InPart {
    fn write(&mut self, number: usize, t: f32, _: u32, object: u32) {
        self.distances[number] = t;
        self.objects[number] = object;
    }
}
