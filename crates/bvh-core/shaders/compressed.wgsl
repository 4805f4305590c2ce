// Nodes of 80 bytes with up to eight children, as `CompressedBvh::new` makes them: slots in the order of the ray's octant.

struct Node { words: array<u32, 20> }

@group(0) @binding(0) var<storage, read> nodes: array<Node>;

fn byte(node: u32, at: u32) -> u32 {
    return extractBits(nodes[node].words[at / 4u], 8u * (at % 4u), 8u);
}

// The planes of a slot, in steps from the node's corner.
fn planes(node: u32, at: u32) -> vec3f {
    return vec3f(f32(byte(node, at)), f32(byte(node, at + 8u)), f32(byte(node, at + 16u)));
}

fn nearest(ray: Ray, none: Hit) -> Hit {
    let inverse = reciprocal(ray.direction);
    // The slot that a ray of this direction meets first.
    let octant = dot(select(vec3u(0), vec3u(4, 2, 1), ray.direction < vec3f(0.0)), vec3u(1));
    var hit = none;
    var stack: array<u32, 128>;
    stack[0] = 0u;
    var open = 1;
    while open > 0 {
        open--;
        let node = stack[open];
        let origin = vec3f(
            bitcast<f32>(nodes[node].words[0]), bitcast<f32>(nodes[node].words[1]), bitcast<f32>(nodes[node].words[2]));
        let step = bitcast<vec3f>(vec3u(byte(node, 12u), byte(node, 13u), byte(node, 14u)) << vec3u(23));
        let inner = byte(node, 15u);
        // The nearest slot last, so that it is on top of the stack.
        for (var order = 0u; order < 8u; order++) {
            let slot = (7u - order) ^ octant;
            let what = byte(node, 24u + slot);
            let low = origin + planes(node, 32u + slot) * step;
            let high = origin + planes(node, 56u + slot) * step;
            if what == 0u || entry(low, high, ray, inverse, hit.t) == FAR {
                continue;
            }
            if extractBits(inner, slot, 1u) == 1u {
                stack[open] = nodes[node].words[4] + countOneBits(extractBits(inner, 0u, slot));
                open++;
            } else {
                hit = nearer(hit, nodes[node].words[5] + (what & 31u), countOneBits(what >> 5u), ray);
            }
        }
    }
    return hit;
}
