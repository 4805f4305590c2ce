import { Ray, Vector3 } from 'three';
import { checkNames } from './options.js';

const plain = new Ray();
let boxes = 0;
let triangles = 0;

/**
 * A ray that counts what it is tested against: three-mesh-bvh reads its origin once for each box,
 * and has it meet each triangle.
 */
class CountingRay extends Ray {
    constructor() {
        super(new CountingOrigin(), plain.direction);
    }

    intersectTriangle(...corners) {
        triangles++;
        return plain.intersectTriangle(...corners);
    }
}

class CountingOrigin extends Vector3 {
    get x() {
        boxes++;
        return plain.origin.x;
    }

    // Three's constructors assign a coordinate.
    set x(_) {}

    distanceTo(point) {
        return plain.origin.distanceTo(point);
    }
}

const counting = new CountingRay();

export function countTests(meshBVH, ray, options = {}) {
    checkNames(options, ['side', 'near', 'far', 'query']);
    const { side, near, far, query = 'raycastFirst' } = options;
    if (typeof meshBVH?.raycastFirst !== 'function') throw new TypeError('meshBVH is another object; accepted: a MeshBVH');
    if (!(ray?.origin && ray.direction)) throw new TypeError('ray is another object; accepted: a Ray, as raycaster.ray');
    if (!/^raycast(First)?$/.test(query)) throw new TypeError(`query is "${query}"; accepted: raycastFirst, raycast`);
    plain.copy(ray);
    counting.origin.y = ray.origin.y;
    counting.origin.z = ray.origin.z;
    boxes = 0;
    triangles = 0;
    const hit = meshBVH[query](counting, side, near, far);
    return { hit, boxes, triangles };
}
