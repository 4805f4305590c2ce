//! Ordinary rays lead no kernel to subnormal numbers, each of which costs Intel processors about
//! 150 cycles.
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Bvh, Coherence, Hit, Kernel, Ray, WideBvh};
use bvh_scenes::Scene;
use bvh_scenes::builtin::stand_ins::STAND_INS;
use bvh_scenes::rays::{RenderedRays, TracedRay, Viewpoint, in_box, of_inside, of_renderer};
use std::arch::asm;

/// The flags of the control and status register for subnormal operands and results.
const SUBNORMAL_OPERAND: u32 = 1 << 1;
const UNDERFLOW: u32 = 1 << 4;
const ALL_FLAGS: u32 = 0b11_1111;

fn control_and_status() -> u32 {
    let mut register = 0u32;
    // SAFETY: the instruction writes exactly the four bytes of `register`.
    unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut register, options(nostack)) };
    register
}

/// Returns the flags of subnormal numbers that `work` raises.
fn raised_by(work: impl FnOnce()) -> u32 {
    let cleared = control_and_status() & !ALL_FLAGS;
    // SAFETY: only the flags of past exceptions change, which no compiled code relies on.
    unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const cleared, options(nostack)) };
    work();
    control_and_status() & (SUBNORMAL_OPERAND | UNDERFLOW)
}

/// Answers rays in every way that a layout has. Returns each way with the flags that it raised.
fn flags(wide: &WideBvh, rays: &[Ray]) -> Vec<(&'static str, u32)> {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut shadows = vec![false; rays.len()];
    let mut hit_count = 0;
    let single_nearest =
        raised_by(|| hit_count += rays.iter().filter_map(|ray| wide.nearest_hit(ray)).count());
    let single_any = raised_by(|| hit_count += rays.iter().filter(|ray| wide.any_hit(ray)).count());
    assert!(hit_count > 0, "rays that meet nothing try no triangle");
    let mut flags = vec![("nearest_hit", single_nearest), ("any_hit", single_any)];
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let nearest = raised_by(|| wide.nearest_hits(rays, &mut hits, coherence));
        let any = raised_by(|| wide.any_hits(rays, &mut shadows, coherence));
        flags.extend([("nearest_hits", nearest), ("any_hits", any)]);
    }
    flags
}

/// Returns random rays, and those of cameras outside and inside of a scene, sorted by their kind.
fn ordinary(scene: &Scene, tree: &Bvh) -> Vec<TracedRay> {
    let root = tree.root_aabb().unwrap();
    let inside = Viewpoint { eye: [0.3, 0.4, 0.6], target: [0.8, 0.5, 0.3] };
    let mut rays = Vec::new();
    // Each camera stands still, because packets of rays of one origin are traced in another way.
    for camera in [Viewpoint::default(), inside].map(|view| view.in_box(&root)) {
        let lights = vec![in_box(&root, [0.5, 0.95, 0.5]).to_array()];
        let cameras = vec![camera];
        let config = RenderedRays { cameras, lights, count: 4096, ..Default::default() };
        rays.extend(of_renderer(&config, scene, tree, &|| false));
    }
    rays.sort_by_key(|traced| traced.kind.name());
    [of_inside(4096, scene, tree, 1), rays].concat()
}

#[test]
fn ordinary_rays_make_no_kernel_meet_subnormal_numbers() {
    let mut broken = Vec::new();
    for name in STAND_INS.map(|scene| scene.name) {
        let scene = Scene::load(&format!("{name}:4000")).unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let wide = WideBvh::new(&tree, scene.triangles().unwrap()).unwrap();
        for rays in ordinary(&scene, &tree).chunk_by(|a, b| a.kind == b.kind) {
            let kind = rays[0].kind.name();
            let rays: Vec<Ray> = rays.iter().map(|traced| traced.ray).collect();
            for kernel in Kernel::ALL {
                let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
                let flags = flags(&wide, &rays).into_iter().filter(|(_, raised)| *raised != 0);
                broken.extend(flags.map(|(call, raised)| {
                    format!("{name}, {kind}, {kernel:?}, {call}: flags {raised:#b}")
                }));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_flags_tell_subnormal_numbers_from_others() {
    let product = |a: f32, b: f32| {
        _ = std::hint::black_box(std::hint::black_box(a) * std::hint::black_box(b))
    };
    assert_eq!(raised_by(|| product(1.5, 2.5)), 0);
    assert_eq!(raised_by(|| product(1e-40, 2.5e10)), SUBNORMAL_OPERAND);
    assert_eq!(raised_by(|| product(1e-20, 1.1e-20)), UNDERFLOW);
}
