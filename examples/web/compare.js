// Two trees beside each other: counted tests, and speed in turns.
import { Box3, DoubleSide, Ray, Vector3 } from 'three';
import { MeshBVH, SAH } from 'three-mesh-bvh';
import { countTests } from 'bvh-search';
import { random } from './scenes.js';

/** What a test of a box and of a triangle take there, about, in arbitrary units. */
const weight = ({ boxes, triangles }) => 0.9 * boxes + 1.25 * triangles;

/** Lets the page draw and answer. */
export const pause = () => new Promise((resolve) => setTimeout(resolve));

export const cast = (bvh, ray) => bvh.raycastFirst(ray, DoubleSide);

/** Mean tests per ray. */
export function meanTests(bvh, rays) {
    const sum = { boxes: 0, triangles: 0 };
    for (const ray of rays) {
        const { boxes, triangles } = countTests(bvh, ray, { side: DoubleSide });
        sum.boxes += boxes;
        sum.triangles += triangles;
    }
    return { boxes: sum.boxes / rays.length, triangles: sum.triangles / rays.length };
}

/** Rays that begin anywhere in the box and go in any direction. */
export function raysInside(geometry, count) {
    const next = random(5);
    const bounds = new Box3().setFromBufferAttribute(geometry.attributes.position);
    const size = bounds.getSize(new Vector3());
    return Array.from({ length: count }, () => {
        const origin = new Vector3(next(), next(), next()).multiply(size).add(bounds.min);
        // Rejected outside the sphere, so that all directions are equally likely.
        const direction = new Vector3();
        do direction.set(next(), next(), next()).multiplyScalar(2).subScalar(1);
        while (direction.lengthSq() > 1 || direction.lengthSq() < 1e-6);
        return new Ray(origin, direction.normalize());
    });
}

/** The library's own tree with the fewest tests of these rays, of all sizes of leaves. */
export async function bestOwn(geometry, rays) {
    let best;
    for (const targetLeafSize of [1, 2, 4, 10]) {
        await pause();
        const bvh = new MeshBVH(geometry.clone(), { strategy: SAH, targetLeafSize });
        const tests = weight(meanTests(bvh, rays));
        if (!best || tests < best.tests) best = { bvh, tests, targetLeafSize };
    }
    return best;
}

/** How many times as many tests the first tree takes as the second. */
export const gain = (first, second) => weight(first) / weight(second);

const median = (values) => values.sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** Rays per second by each tree, and the median over rounds of how many times as fast the second is. */
export async function speeds(trees, rays, rounds) {
    const seconds = (bvh) => {
        const start = performance.now();
        for (const ray of rays) cast(bvh, ray);
        return (performance.now() - start) / 1000;
    };
    trees.map(seconds);
    const taken = [];
    for (let round = 0; round < rounds; round++) {
        await pause();
        // The one that begins is the other one in the next round.
        taken.push(round % 2 ? trees.map(seconds) : trees.toReversed().map(seconds).reverse());
    }
    return {
        rates: trees.map((_, tree) => rays.length / median(taken.map((round) => round[tree]))),
        ratio: median(taken.map(([first, second]) => first / second)),
    };
}
