// Nodes of 32 bytes, as `Bvh::to_first_count` makes them: the nearer child first. For trees of depth 64 at most.

struct Node { low: vec3f, first: u32, high: vec3f, count: u32 }

@group(0) @binding(0) var<storage, read> nodes: array<Node>;

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
