// What rays cost in three-mesh-bvh with its own trees and with searched ones, into results/interop.
//   npm run bench              tracer_tests.csv: counted tests, the same on every machine, and in
//                              tracer_gains.csv the cost of the library's best tree over the searched one's
//   npm run bench -- --time    timing_tracers.csv, too: speeds, on a machine that does nothing else
// Needs the program bvh (BVH names it; otherwise that of `cargo build --release`), and scripts/fetch-scenes.
import { execFileSync } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { cpus } from 'node:os';
import { fileURLToPath } from 'node:url';
import { Box3, BufferAttribute, BufferGeometry, DoubleSide, Ray, TorusKnotGeometry, Vector3 } from 'three';
import { OBJLoader } from 'three/examples/jsm/loaders/OBJLoader.js';
import { MeshBVH, SAH } from 'three-mesh-bvh';
import { bake, countTests } from 'bvh-search';

const top = new URL('../../../', import.meta.url);
const bvh = process.env.BVH ?? fileURLToPath(new URL('target/release/bvh', top));

/** What every scene is searched for, in nodes visited. */
const WORK = 100_000_000;
/** The searched trees, and how many leaves a triangle may be in. */
const searched = [['searched', 1], ['divided', 1.3]];
const COUNTED = 65_536;
const TIMED = 16_384;
const ROUNDS = 15;
/** What a test of a box and of a triangle costs there, as in `Target::THREE_MESH_BVH`. */
const [BOX, TRIANGLE] = [0.9, 1.25];

/** Reads a scene that `bvh` knows. */
function named(name) {
    const text = execFileSync(bvh, ['scenes', name], { cwd: fileURLToPath(top), maxBuffer: 1 << 30, encoding: 'utf8' });
    return new OBJLoader().parse(text).children[0].geometry;
}

/** A smooth closed surface of bumps, over a sphere. */
function pebble() {
    const [columns, rows] = [700, 350];
    const corners = [];
    for (let row = 0; row <= rows; row++) {
        for (let column = 0; column <= columns; column++) {
            const [polar, azimuth] = [(Math.PI * row) / rows, (2 * Math.PI * (column % columns)) / columns];
            const point = [Math.sin(polar) * Math.cos(azimuth), Math.cos(polar), Math.sin(polar) * Math.sin(azimuth)];
            const [x, y, z] = point;
            const bump = 1 + 0.12 * Math.sin(5 * x + 1) * Math.sin(6 * y) + 0.05 * Math.sin(17 * z + 3 * x) * Math.sin(13 * y + 2);
            corners.push(...point.map((coordinate) => bump * coordinate));
        }
    }
    const index = [];
    for (let row = 0; row < rows; row++) {
        for (let column = 0; column < columns; column++) {
            const a = row * (columns + 1) + column;
            const b = a + columns + 1;
            if (row > 0) index.push(a, a + 1, b);
            if (row < rows - 1) index.push(a + 1, b + 1, b);
        }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners), 3));
    geometry.setIndex(index);
    return geometry;
}

const outside = { eye: [1.9, 1.3, 2.2], target: [0.5, 0.5, 0.5] };
/** The scenes, and what is seen in fractions of their boxes, as in experiments/peers.toml. */
const scenes = {
    sponza: { make: () => named('sponza'), eye: [0.15, 0.25, 0.5], target: [0.9, 0.35, 0.5] },
    kitchen: { make: () => named('kitchen'), eye: [0.5, 0.6, 0.5], target: [0.9, 0.4, 0.9] },
    cloister: { make: () => named('cloister'), eye: [0.2, 0.3, 0.3], target: [0.8, 0.4, 0.6] },
    escher: { make: () => named('escher'), ...outside },
    spot: { make: () => named('spot'), ...outside },
    knot: { make: () => new TorusKnotGeometry(1, 0.35, 1250, 40), ...outside },
    pebble: { make: pebble, ...outside },
};

/** Numbers from 0 to 1, the same in every run. */
function random(seed) {
    return () => {
        seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
        return seed / 2 ** 32;
    };
}

function boundsOf(geometry) {
    const bounds = new Box3().setFromBufferAttribute(geometry.attributes.position);
    const size = bounds.getSize(new Vector3());
    return { size, at: (fractions) => new Vector3(...fractions).multiply(size).add(bounds.min) };
}

function primary({ at }, { eye, target }, count) {
    const side = Math.sqrt(count);
    const origin = at(eye);
    const forward = at(target).sub(origin).normalize();
    const right = forward.clone().cross(new Vector3(0, 1, 0)).normalize();
    const up = right.clone().cross(forward);
    // An angle of view of 60 degrees.
    const half = 1 / Math.sqrt(3);
    return Array.from({ length: count }, (_, pixel) => {
        const [x, y] = [pixel % side, Math.floor(pixel / side)].map((place) => half * ((2 * (place + 0.5)) / side - 1));
        const direction = forward.clone().addScaledVector(right, x).addScaledVector(up, -y);
        return { ray: new Ray(origin, direction.normalize()) };
    });
}

function incoherent({ at }, count) {
    const next = random(1);
    return Array.from({ length: count }, () => {
        const direction = new Vector3();
        do direction.set(next(), next(), next()).multiplyScalar(2).subScalar(1);
        while (direction.lengthSq() > 1 || direction.lengthSq() < 1e-6);
        return { ray: new Ray(at([next(), next(), next()]), direction.normalize()) };
    });
}

/** From what the primary rays hit to a light: `raycastFirst` up to there, since the library has no query for any hit. */
function shadow({ at, size }, seen, tree) {
    const light = at([0.5, 0.95, 0.5]);
    const points = seen.map(({ ray }) => tree.raycastFirst(ray, DoubleSide)?.point).filter(Boolean);
    return seen.map((_, to) => {
        const origin = points[to % points.length];
        const distance = light.distanceTo(origin);
        const direction = light.clone().sub(origin).divideScalar(distance);
        return { ray: new Ray(origin, direction), near: 1e-4 * size.length(), far: distance };
    });
}

const castOf = (kind, tree) => (kind === 'all hits'
    ? ({ ray }) => tree.raycast(ray, DoubleSide)
    : ({ ray, near, far }) => tree.raycastFirst(ray, DoubleSide, near, far));

function kindsOf(scene, bounds, tree, count) {
    const seen = primary(bounds, scene, count);
    const anywhere = incoherent(bounds, count);
    return { primary: seen, incoherent: anywhere, shadow: shadow(bounds, seen, tree), 'all hits': anywhere };
}

/** The library's default, its best builder with all sizes of leaves, and the searched trees. */
async function treesOf(geometry) {
    const trees = new Map([['default', new MeshBVH(geometry.clone())]]);
    for (const targetLeafSize of [1, 2, 4, 10]) {
        trees.set(`SAH, leaf size ${targetLeafSize}`, new MeshBVH(geometry.clone(), { strategy: SAH, targetLeafSize }));
    }
    for (const [name, references] of searched) {
        const copy = geometry.clone();
        trees.set(name, (await bake(copy, { work: WORK, references })).toMeshBVH(copy));
    }
    return trees;
}

/** The trees that answer the query: all hits of a divided triangle are found once for each part. */
const answering = (kind, trees) => new Map([...trees].filter(([name]) => kind !== 'all hits' || name !== 'divided'));

function counted(kind, rays, tree) {
    const sum = { hits: 0, boxes: 0, triangles: 0 };
    const query = kind === 'all hits' ? 'raycast' : 'raycastFirst';
    for (const { ray, near, far } of rays) {
        const { hit, boxes, triangles } = countTests(tree, ray, { side: DoubleSide, near, far, query });
        sum.hits += Array.isArray(hit) ? hit.length : Number(hit !== null);
        sum.boxes += boxes;
        sum.triangles += triangles;
    }
    return sum;
}

const sorted = (values) => values.toSorted((a, b) => a - b);
const median = (values) => sorted(values)[Math.floor(values.length / 2)];

/** Seconds per round and tree, the trees in another order in each round. */
function times(kind, rays, trees) {
    const names = [...trees.keys()];
    const seconds = new Map(names.map((name) => [name, []]));
    for (let round = -1; round < ROUNDS; round++) {
        for (let turn = 0; turn < names.length; turn++) {
            const name = names[(turn + round + names.length) % names.length];
            const cast = castOf(kind, trees.get(name));
            const start = performance.now();
            for (const ray of rays) cast(ray);
            // The first round is for the compiler.
            if (round >= 0) seconds.get(name).push((performance.now() - start) / 1000);
        }
    }
    return seconds;
}

/** The median and its interval: the fourth value from either end covers it with a probability of 96 % of 15. */
function ratio(theirs, ours) {
    const ratios = sorted(theirs.map((seconds, round) => seconds / ours[round]));
    return [median(ratios), ratios[3], ratios[ROUNDS - 4]];
}

const line = (fields) => `${fields.map((field) => (String(field).includes(',') ? `"${field}"` : field)).join(',')}\n`;
const folder = new URL('results/interop/', top);
mkdirSync(folder, { recursive: true });
const isTimed = process.argv.includes('--time');
const only = process.argv.find((argument) => argument in scenes);
let tests = 'tracer,scene,triangles,rays,count,tree,hits,box_tests,triangle_tests\n';
let gains = 'tracer,scene,rays,tree,over,gain\n';
let timing = 'tracer,processor,scene,rays,count,rounds,tree,over,over_tree,ratio_median,ratio_low,ratio_high\n';
const tracer = 'three-mesh-bvh';
for (const [name, scene] of Object.entries(scenes)) {
    if (only && only !== name) continue;
    const geometry = scene.make();
    const bounds = boundsOf(geometry);
    const triangles = (geometry.index ?? geometry.attributes.position).count / 3;
    const trees = await treesOf(geometry);
    // Before the counts: the rays that count would make the library's compiled code more general.
    if (isTimed) {
        for (const [kind, rays] of Object.entries(kindsOf(scene, bounds, trees.get('default'), TIMED))) {
            const seconds = times(kind, rays, answering(kind, trees));
            const own = [...seconds.keys()].filter((tree) => tree.startsWith('SAH'));
            const best = own.reduce((a, b) => (median(seconds.get(a)) <= median(seconds.get(b)) ? a : b));
            for (const [over, tree] of [['best', best], ['default', 'default']]) {
                for (const [ours] of searched.filter(([ours]) => seconds.has(ours))) {
                    const figures = ratio(seconds.get(tree), seconds.get(ours)).map((value) => value.toFixed(4));
                    timing += line([tracer, cpus()[0].model, name, kind, rays.length, ROUNDS, ours, over, tree, ...figures]);
                }
            }
        }
    }
    for (const [kind, rays] of Object.entries(kindsOf(scene, bounds, trees.get('default'), COUNTED))) {
        const costs = new Map();
        for (const [tree, meshBVH] of answering(kind, trees)) {
            const { hits, boxes, triangles: tested } = counted(kind, rays, meshBVH);
            tests += line([tracer, name, triangles, kind, rays.length, tree, hits, boxes, tested]);
            costs.set(tree, BOX * boxes + TRIANGLE * tested);
        }
        const least = (isOne) => Math.min(...[...costs].filter(([tree]) => isOne(tree)).map(([, cost]) => cost));
        for (const [over, isOne] of [['best', (tree) => tree.startsWith('SAH')], ['default', (tree) => tree === 'default']]) {
            for (const [ours] of searched.filter(([ours]) => costs.has(ours))) {
                gains += line([tracer, name, kind, ours, over, (least(isOne) / costs.get(ours)).toFixed(4)]);
            }
        }
    }
    console.error(name);
}
if (only) {
    process.stdout.write(tests + gains + (isTimed ? timing : ''));
} else {
    writeFileSync(new URL('tracer_tests.csv', folder), tests);
    writeFileSync(new URL('tracer_gains.csv', folder), gains);
    if (isTimed) writeFileSync(new URL('timing_tracers.csv', folder), timing);
}
