//! Files of wide layouts keep every answer, and no bytes make a traversal leave the layout.

use crate::support::{Random, SHAPES, ball, boxes, rays, scaled, soup, tree};
use bvh_core::file::{FileError, load_layout, save_layout, view_layout};
use bvh_core::{Coherence, Hit, Kernel, Triangle, WideBvh};

/// Bytes at a multiple of 64, as mapped files have them.
struct Mapped {
    bytes: Vec<u8>,
    start: usize,
    length: usize,
}

impl Mapped {
    fn new(file: &[u8]) -> Self {
        let mut bytes = vec![0; file.len() + 64];
        let start = bytes.as_ptr().align_offset(64);
        bytes[start..start + file.len()].copy_from_slice(file);
        Self { bytes, start, length: file.len() }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[self.start..][..self.length]
    }
}

fn layout(triangles: &[Triangle], shape: usize) -> WideBvh {
    let tree = tree(&boxes(triangles), SHAPES[shape], &mut Random(5));
    WideBvh::new(&tree, triangles).unwrap()
}

/// Writes the checksum as a forger would.
fn seal(file: &mut [u8]) {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&file[128..]);
    hasher.update(&file[..124]);
    file[124..128].copy_from_slice(&hasher.finalize().to_le_bytes());
}

#[test]
fn saved_layouts_have_the_same_bytes_and_answers() {
    let mut random = Random(1);
    let flat = vec![Triangle([glam::Vec3::ONE; 3]); 3];
    for triangles in [soup(1, &mut random), soup(300, &mut random), ball(3), flat] {
        for shape in 0..SHAPES.len() {
            let wide = layout(&triangles, shape);
            let file = save_layout(&wide);
            let mapped = Mapped::new(&file);
            let view = view_layout(mapped.bytes()).unwrap();
            // An odd address.
            let moved = [&[0], file.as_slice()].concat();
            let copy = load_layout(&moved[1..]).unwrap();
            assert_eq!(save_layout(&view), file);
            assert_eq!(save_layout(&copy), file);
            assert_eq!(view.expected_visits(), wide.expected_visits());
            for ray in rays(&triangles, 200, &mut random) {
                assert_eq!(view.nearest_hit(&ray), wide.nearest_hit(&ray));
                assert_eq!(copy.all_hits(&ray), wide.all_hits(&ray));
            }
        }
    }
}

#[test]
fn a_clone_of_a_view_outlives_its_bytes_and_can_be_refitted() {
    let triangles = ball(2);
    let mapped = Mapped::new(&save_layout(&layout(&triangles, 0)));
    let mut clone = (*view_layout(mapped.bytes()).unwrap()).clone();
    drop(mapped);
    let moved = scaled(&triangles, 2.0);
    clone.refit(&moved).unwrap();
    for ray in rays(&moved, 200, &mut Random(2)) {
        assert_eq!(clone.all_hits(&ray), layout(&moved, 0).all_hits(&ray));
    }
}

#[test]
fn damage_is_rejected() {
    let file = save_layout(&layout(&ball(1), 0));
    for at in 0..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(load_layout(&damaged).is_err(), "byte {at}");
    }
    for length in [0, 7, 100, file.len() - 1] {
        assert!(load_layout(&file[..length]).is_err(), "{length} bytes");
    }
    let found = load_layout(&[file.as_slice(), &[0]].concat());
    assert!(matches!(found, Err(FileError::Length { .. })), "{found:?}");
    let moved = Mapped::new(&[&[0; 4], file.as_slice()].concat());
    let found = view_layout(&moved.bytes()[4..]);
    assert!(matches!(found, Err(FileError::Alignment(_))), "{found:?}");
}

#[test]
fn traversals_of_forged_layouts_end_and_stay_in_bounds() {
    let mut random = Random(3);
    let mut accepted = 0;
    for triangles in [ball(2), soup(60, &mut random)] {
        let file = save_layout(&layout(&triangles, 1));
        let rays = rays(&triangles, 20, &mut random);
        for _ in 0..6000 {
            let mut forged = file.clone();
            for _ in 0..1 + random.below(3) {
                // Any word but the checksum gets bits of another word, or one bit less or more.
                let word = |random: &mut Random| 4 * random.below(file.len() / 4);
                let to = word(&mut random);
                let from = word(&mut random);
                if random.below(2) == 0 {
                    forged.copy_within(from..from + 4, to);
                } else {
                    forged[to + random.below(4)] ^= 1 << random.below(8);
                }
            }
            seal(&mut forged);
            let Ok(wide) = load_layout(&forged) else { continue };
            accepted += 1;
            for kernel in Kernel::ALL {
                let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
                let mut counts = vec![0; rays.len()];
                wide.all_hits_of(&rays, &mut vec![], &mut counts);
                for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    wide.nearest_hits(&rays, &mut hits, coherence);
                    // Nothing is in an unused lane.
                    let is_object = |hit: &Hit| hit.object < 1 << 30 || *hit == Hit::MISS;
                    assert!(hits.iter().all(is_object), "{hits:?}");
                }
                for ray in &rays {
                    wide.nearest_hit(ray);
                    wide.any_hit(ray);
                    wide.closest_point(ray.origin());
                }
            }
        }
    }
    assert!(accepted > 1000, "{accepted}");
}
