// Measures three-mesh-bvh in its own trees and in searched ones, for the bench `interop` of the attic, which writes the folder:
//
//   node interop.js FOLDER ROUNDS TREE...
//
// scripts/ray-peers/interop.cpp describes the files and the lines that are written. 'all hits' are those of the incoherent rays.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { BufferAttribute, BufferGeometry, DoubleSide, Ray, Vector3 } from 'three';
import { MeshBVH, SAH } from 'three-mesh-bvh';
import { loadExport } from '../examples/load-export.mjs';
import { countTests } from '../js/tests.js';

const [folder, rounds, ...searched] = process.argv.slice(2);

const read = (name) => new Uint8Array(readFileSync(join(folder, name))).buffer;

function geometryOf(corners) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(corners, 3));
    geometry.setIndex(new BufferAttribute(Uint32Array.from({ length: corners.length / 3 }, (_, corner) => corner), 1));
    return geometry;
}

/** The library's default, its best builder with all sizes of leaves, and the searched trees. */
function treesOf(corners) {
    const trees = new Map([['default', new MeshBVH(geometryOf(corners))]]);
    for (const targetLeafSize of [1, 2, 4, 10]) {
        trees.set(`SAH leaf size ${targetLeafSize}`, new MeshBVH(geometryOf(corners), { strategy: SAH, targetLeafSize }));
    }
    for (const name of searched) {
        trees.set(name, ordered(read(`${name}.three-mesh-bvh.bin`), geometryOf(corners)));
    }
    return trees;
}

/** A tree of whole triangles is traced in the order of its leaves, as the library's own are. */
function ordered(file, geometry) {
    const tree = loadExport(file, geometry);
    const { roots, indirectBuffer } = MeshBVH.serialize(tree, { cloneBuffers: false });
    if (3 * indirectBuffer.length !== geometry.index.count) return tree;
    const index = new Uint32Array(geometry.index.count);
    indirectBuffer.forEach((id, to) => index.set([3 * id, 3 * id + 1, 3 * id + 2], 3 * to));
    return MeshBVH.deserialize({ version: 1, roots, index, indirectBuffer: null }, geometry);
}

function raysOf(kind) {
    const numbers = new Float32Array(read(`${kind}.bin`));
    return Array.from({ length: numbers.length / 8 }, (_, place) => {
        const [x, y, z, near, dx, dy, dz, far] = numbers.subarray(8 * place, 8 * place + 8);
        return { ray: new Ray(new Vector3(x, y, z), new Vector3(dx, dy, dz)), near, far };
    });
}

const castOf = (kind, tree) => (kind === 'all hits'
    ? ({ ray, near, far }) => tree.raycast(ray, DoubleSide, near, far)
    : ({ ray, near, far }) => tree.raycastFirst(ray, DoubleSide, near, far));

function counted(kind, rays, tree) {
    const sum = { hits: 0, boxes: 0, triangles: 0 };
    const query = kind === 'all hits' ? 'raycast' : 'raycastFirst';
    for (const { ray, near, far } of rays) {
        const { hit, boxes, triangles } = countTests(tree, ray, { side: DoubleSide, near, far, query });
        sum.hits += Array.isArray(hit) ? hit.length : Number(hit !== null);
        sum.boxes += boxes;
        sum.triangles += triangles;
    }
    return Object.values(sum);
}

/** Seconds per round and tree, another tree first in each round. */
function times(kind, rays, trees) {
    const names = [...trees.keys()];
    const seconds = new Map(names.map((name) => [name, []]));
    // The first round is for the compiler.
    for (let round = -1; round < rounds; round++) {
        for (let turn = 0; turn < names.length; turn++) {
            const name = names[(turn + round + names.length) % names.length];
            const cast = castOf(kind, trees.get(name));
            const start = performance.now();
            for (const ray of rays) cast(ray);
            if (round >= 0) seconds.get(name).push((performance.now() - start) / 1000);
        }
    }
    return seconds;
}

const say = (what, kind, name, numbers) => console.log([what, 'three-mesh-bvh', kind, name, numbers.join(' ')].join(','));
const trees = treesOf(new Float32Array(read('triangles.bin')));
const kinds = { primary: 'primary', incoherent: 'incoherent', shadow: 'shadow', 'all hits': 'incoherent' };
/** A query for all hits finds a divided triangle once for each part. */
const answering = (kind) => new Map([...trees].filter(([name]) => kind !== 'all hits' || name !== 'divided'));
// Times before counts: the rays that count would make the library's compiled code more general.
for (const [kind, rays] of Number(rounds) > 0 ? Object.entries(kinds) : []) {
    for (const [name, seconds] of times(kind, raysOf(rays), answering(kind))) say('times', kind, name, seconds);
}
for (const [kind, rays] of Object.entries(kinds)) {
    const all = raysOf(rays);
    for (const [name, tree] of answering(kind)) say('tests', kind, name, counted(kind, all, tree));
}
