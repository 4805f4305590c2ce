// Rays through nodes of 32 bytes, as `Bvh::to_first_count` makes them, in trees of depth 64 at most, one invocation per ray.
// Distances are those of f32 arithmetic on a GPU, not bit by bit those of the crate.

struct Node { low: vec3f, first: u32, high: vec3f, count: u32 }
struct Ray { origin: vec3f, t_min: f32, direction: vec3f, t_max: f32 }
struct Hit { t: f32, object: u32 }

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> prim_ids: array<u32>;
// Nine numbers per triangle, by its id.
@group(0) @binding(2) var<storage, read> corners: array<f32>;
@group(0) @binding(3) var<storage, read> rays: array<Ray>;
@group(0) @binding(4) var<storage, read_write> hits: array<Hit>;

const MISS: u32 = 0xffffffff;
const FAR: f32 = 3.4e38;

// One over a direction; finite where a component is zero.
fn reciprocal(direction: vec3f) -> vec3f {
    let tiny = abs(direction) < vec3f(1e-30);
    return 1.0 / select(direction, select(vec3f(1e-30), vec3f(-1e-30), direction < vec3f(0.0)), tiny);
}

// Where the ray enters a box, which grows by the rounding of its planes; FAR if that is behind `t_max` or nowhere.
fn entry(low: vec3f, high: vec3f, ray: Ray, inverse: vec3f, t_max: f32) -> f32 {
    let slack = 1e-6 * (abs(ray.origin) + max(abs(low), abs(high)));
    let a = (low - slack - ray.origin) * inverse;
    let b = (high + slack - ray.origin) * inverse;
    let near = min(a, b);
    let far = max(a, b);
    let enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    let leave = min(min(far.x, far.y), min(far.z, t_max));
    return select(FAR, enter, enter <= leave * 1.000001);
}

// A corner of a triangle, sheared so that the ray runs along z from the origin.
fn sheared(id: u32, which: u32, ray: Ray, z: u32) -> vec3f {
    let at = 9u * id + 3u * which;
    let p = vec3f(corners[at], corners[at + 1u], corners[at + 2u]) - ray.origin;
    let x = (z + 1u) % 3u;
    let y = (z + 2u) % 3u;
    let slope = vec2f(ray.direction[x], ray.direction[y]) / ray.direction[z];
    return vec3f(p[x] - slope.x * p[z], p[y] - slope.y * p[z], p[z]);
}

// The nearer of `hit` and what the ray meets among objects `first..first + count` (Woop, Benthin & Wald 2013).
fn nearer(hit: Hit, first: u32, count: u32, ray: Ray) -> Hit {
    let size = abs(ray.direction);
    let z = select(select(0u, 1u, size.y > size.x), 2u, size.z > max(size.x, size.y));
    var best = hit;
    for (var at = first; at < first + count; at++) {
        let id = prim_ids[at];
        let a = sheared(id, 0u, ray, z);
        let b = sheared(id, 1u, ray, z);
        let c = sheared(id, 2u, ray, z);
        let sides = vec3f(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        let determinant = sides.x + sides.y + sides.z;
        let t = dot(sides, vec3f(a.z, b.z, c.z)) / (determinant * ray.direction[z]);
        let inside = (all(sides >= vec3f(0.0)) || all(sides <= vec3f(0.0))) && determinant != 0.0;
        if inside && t >= ray.t_min && (t < best.t || (t == best.t && id < best.object)) {
            best = Hit(t, id);
        }
    }
    return best;
}

// Visits the nearer child first.
fn nearest(ray: Ray, none: Hit) -> Hit {
    let inverse = reciprocal(ray.direction);
    var hit = none;
    var stack: array<u32, 64>;
    var open = 0;
    var at = 0u;
    loop {
        let node = nodes[at];
        if node.count > 0u {
            hit = nearer(hit, node.first, node.count, ray);
        } else {
            var near = node.first;
            var far = node.first + 1u;
            var enter = entry(nodes[near].low, nodes[near].high, ray, inverse, hit.t);
            var enter_far = entry(nodes[far].low, nodes[far].high, ray, inverse, hit.t);
            if enter_far < enter {
                let swap = vec2u(far, near);
                near = swap.x;
                far = swap.y;
                let times = vec2f(enter_far, enter);
                enter = times.x;
                enter_far = times.y;
            }
            if enter < FAR {
                if enter_far < FAR {
                    stack[open] = far;
                    open++;
                }
                at = near;
                continue;
            }
        }
        if open == 0 {
            return hit;
        }
        open--;
        at = stack[open];
    }
    return hit;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) invocation: vec3u) {
    let at = invocation.x;
    if at < arrayLength(&rays) {
        hits[at] = nearest(rays[at], Hit(rays[at].t_max, MISS));
    }
}
