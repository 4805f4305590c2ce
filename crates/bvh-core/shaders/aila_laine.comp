#version 450
// Traces nodes of 64 bytes, as `Bvh::to_aila_laine` makes them: one fetch for both children, the nearer first. For trees of depth 64 at
// most. Distances are those of float arithmetic on a GPU, not bit by bit those of the crate.

layout(local_size_x = 64) in;

struct Node {
    vec3 left_min; uint left;
    vec3 left_max; uint right;
    vec3 right_min; uint count;
    vec3 right_max; uint first;
};
// The least and the greatest distance are behind origin and direction.
struct Ray { vec4 origin; vec4 direction; };
struct Hit { float t; uint object; };

layout(std430, set = 0, binding = 0) readonly buffer Nodes { Node nodes[]; };
layout(std430, set = 0, binding = 1) readonly buffer Ids { uint prim_ids[]; };
// Nine numbers per triangle, by its id.
layout(std430, set = 0, binding = 2) readonly buffer Corners { float corners[]; };
layout(std430, set = 0, binding = 3) readonly buffer Rays { Ray rays[]; };
layout(std430, set = 0, binding = 4) buffer Hits { Hit hits[]; };

const float FAR = 3.4e38;

// Where the ray enters a box, which grows by the rounding of its planes; FAR if that is behind `t_max` or nowhere.
float entry(vec3 low, vec3 high, Ray ray, vec3 inverse, float t_max) {
    vec3 slack = 1e-6 * (abs(ray.origin.xyz) + max(abs(low), abs(high)));
    vec3 a = (low - slack - ray.origin.xyz) * inverse;
    vec3 b = (high + slack - ray.origin.xyz) * inverse;
    vec3 near = min(a, b);
    vec3 far = max(a, b);
    float enter = max(max(near.x, near.y), max(near.z, ray.origin.w));
    float leave = min(min(far.x, far.y), min(far.z, t_max));
    return enter <= leave * 1.000001 ? enter : FAR;
}

// A corner, sheared so that the ray runs along z from the origin.
vec3 sheared(uint id, uint which, Ray ray, uint z) {
    uint at = 9 * id + 3 * which;
    vec3 p = vec3(corners[at], corners[at + 1], corners[at + 2]) - ray.origin.xyz;
    uint x = (z + 1) % 3;
    uint y = (z + 2) % 3;
    vec2 slope = vec2(ray.direction[x], ray.direction[y]) / ray.direction[z];
    return vec3(p[x] - slope.x * p[z], p[y] - slope.y * p[z], p[z]);
}

// The nearer of `hit` and what the ray meets among objects `first..first + count` (Woop, Benthin & Wald 2013).
Hit nearer(Hit hit, uint first, uint count, Ray ray) {
    vec3 size = abs(ray.direction.xyz);
    uint z = size.z > max(size.x, size.y) ? 2 : (size.y > size.x ? 1 : 0);
    for (uint at = first; at < first + count; at++) {
        uint id = prim_ids[at];
        vec3 a = sheared(id, 0, ray, z);
        vec3 b = sheared(id, 1, ray, z);
        vec3 c = sheared(id, 2, ray, z);
        vec3 sides = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        float determinant = sides.x + sides.y + sides.z;
        float t = dot(sides, vec3(a.z, b.z, c.z)) / (determinant * ray.direction[z]);
        float least = min(sides.x, min(sides.y, sides.z));
        float most = max(sides.x, max(sides.y, sides.z));
        bool inside = (least >= 0.0 || most <= 0.0) && determinant != 0.0 && t >= ray.origin.w;
        if (inside && (t < hit.t || (t == hit.t && id < hit.object))) {
            hit.t = t;
            hit.object = id;
        }
    }
    return hit;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= rays.length()) {
        return;
    }
    Ray ray = rays[index];
    vec3 d = ray.direction.xyz;
    vec3 sign_of = vec3(d.x < 0.0 ? -1.0 : 1.0, d.y < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
    vec3 inverse = sign_of / max(abs(d), vec3(1e-30));
    Hit hit;
    hit.t = ray.direction.w;
    hit.object = 0xffffffffu;
    uint stack[64];
    int open = 0;
    uint at = 0;
    while (true) {
        Node node = nodes[at];
        if (node.count > 0) {
            hit = nearer(hit, node.first, node.count, ray);
        } else {
            float left = entry(node.left_min, node.left_max, ray, inverse, hit.t);
            float right = entry(node.right_min, node.right_max, ray, inverse, hit.t);
            bool right_first = right < left;
            if (min(left, right) < FAR) {
                if (max(left, right) < FAR) {
                    stack[open] = right_first ? node.left : node.right;
                    open++;
                }
                at = right_first ? node.right : node.left;
                continue;
            }
        }
        if (open == 0) {
            break;
        }
        open--;
        at = stack[open];
    }
    hits[index] = hit;
}
