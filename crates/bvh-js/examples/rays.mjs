// Casts rays at a scaffold with the tree of three-mesh-bvh and with a searched one: node examples/rays.mjs
import { BoxGeometry, DoubleSide, Ray, Vector3 } from 'three';
import { mergeGeometries } from 'three/examples/jsm/utils/BufferGeometryUtils.js';
import { MeshBVH, SAH } from 'three-mesh-bvh';
import { bakeInWorker, costOf } from 'bvh-search';

// Poles, planks and walls of all lengths, as interiors have.
const parts = Array.from({ length: 2000 }, () => {
    const size = [0, 1, 2].map(() => 0.02 * 150 ** Math.random());
    const place = new Vector3().random().multiplyScalar(10);
    return new BoxGeometry(...size).translate(...place);
});
const geometry = mergeGeometries(parts);
geometry.clearGroups();
const theirs = new MeshBVH(geometry.clone(), { strategy: SAH, targetLeafSize: 1 });
const tree = await bakeInWorker(geometry, {
    seconds: 3,
    onProgress: ({ fraction }) => process.stderr.write(`\r${Math.round(100 * fraction)} %`),
});
const ours = tree.toMeshBVH(geometry);
console.log(`\ncost of a ray: ${(await costOf(theirs)).toFixed(1)} before, ${tree.cost.toFixed(1)} after`);

const rays = Array.from({ length: 50_000 }, () => {
    const point = () => new Vector3().random().multiplyScalar(10);
    const origin = point();
    return new Ray(origin, point().sub(origin).normalize());
});
const seconds = new Map([[theirs, Infinity], [ours, Infinity]]);
for (let turn = 0; turn < 6; turn++) {
    for (const bvh of seconds.keys()) {
        const start = performance.now();
        for (const ray of rays) bvh.raycastFirst(ray, DoubleSide);
        seconds.set(bvh, Math.min(seconds.get(bvh), (performance.now() - start) / 1000));
    }
}
console.log(`rays: ${(seconds.get(theirs) / seconds.get(ours)).toFixed(2)} times as fast`);
