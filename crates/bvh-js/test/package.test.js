// What the package promises: the library's own hits, the program's bytes, and errors that name what is wrong.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import {
    Box3, BufferAttribute, BufferGeometry, DoubleSide, InterleavedBuffer, InterleavedBufferAttribute, Ray, SphereGeometry,
    TorusKnotGeometry, Vector3,
} from 'three';
import { MeshBVH, SAH } from 'three-mesh-bvh';
import { bake, bakeInWorker, costOf, countTests, Tree } from 'bvh-search';
import { loadExport } from '../examples/load-export.mjs';

/** Numbers from 0 to 1, the same in every run. */
function random(seed) {
    return () => {
        seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
        return seed / 2 ** 32;
    };
}

/** A knot among stretched triangles, as scenes of buildings have. */
function scene({ isIndexed = true } = {}) {
    const next = random(1);
    const knot = new TorusKnotGeometry(1, 0.3, 120, 16);
    const corners = Array.from(knot.attributes.position.array);
    const index = Array.from(knot.index.array);
    for (let i = 0; i < 600; i++) {
        const centre = [next(), next(), next()].map((x) => 6 * x - 3);
        const axis = Math.floor(3 * next());
        for (let corner = 0; corner < 3; corner++) {
            index.push(corners.length / 3);
            for (let x = 0; x < 3; x++) corners.push(centre[x] + (x === axis ? 4 : 0.1) * (next() - 0.5));
        }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners), 3));
    geometry.setIndex(new BufferAttribute(new Uint32Array(index), 1));
    return isIndexed ? geometry : geometry.toNonIndexed();
}

function rays(count) {
    const next = random(2);
    const point = () => new Vector3(next(), next(), next()).multiplyScalar(6).subScalar(3);
    return Array.from({ length: count }, () => {
        const origin = point();
        return new Ray(origin, point().sub(origin).normalize());
    });
}

/** The corners of a hit triangle, whatever its place in the index. */
function corners(geometry, hit) {
    const position = geometry.attributes.position;
    const vertex = (corner) => new Vector3().fromBufferAttribute(position, corner).toArray().join();
    return [hit.face.a, hit.face.b, hit.face.c].map(vertex).join(';');
}

function assertSameHits(ours, theirs, count, least = count / 10) {
    let hits = 0;
    for (const ray of rays(count)) {
        const [a, b] = [ours, theirs].map((bvh) => bvh.raycastFirst(ray, DoubleSide));
        assert.equal(a?.distance, b?.distance);
        if (a) {
            hits++;
            assert.equal(corners(ours.geometry, a), corners(theirs.geometry, b));
        }
    }
    assert.ok(hits > least, `${hits} hits`);
}

test('a searched tree has the hits of the library’s own and costs less', async () => {
    const [geometry, other] = [scene(), scene()];
    const tree = await bake(geometry, { work: 3_000_000 });
    const theirs = new MeshBVH(other, { strategy: SAH, targetLeafSize: 1 });
    const ours = tree.toMeshBVH(geometry);
    assertSameHits(ours, theirs, 100_000);
    const [cost, own] = [tree.cost, await costOf(theirs)];
    assert.ok(cost < 0.9 * own, `${cost} beside ${own}`);
    assert.ok(Math.abs((await costOf(ours)) / cost - 1) < 1e-3);
});

test('a tree that divides triangles has the same first hits, costs less, and leaves the index as it is', async () => {
    const [geometry, other] = [scene(), scene()];
    const index = geometry.index?.array.slice();
    const [whole, divided] = await Promise.all([1, 1.3].map((references) => bake(geometry, { work: 3_000_000, references })));
    assertSameHits(divided.toMeshBVH(geometry), new MeshBVH(other, { strategy: SAH, targetLeafSize: 1 }), 30_000);
    assert.deepEqual(geometry.index?.array, index);
    assert.ok(divided.cost < 0.95 * whole.cost, `${divided.cost} beside ${whole.cost}`);
    assert.ok(Math.abs((await costOf(divided.toMeshBVH(geometry))) / divided.cost - 1) < 1e-3);
    assert.throws(() => divided.toMeshBVH(geometry, { indirect: false }), /indirect is false.*divides/);
});

/** Tests of boxes and triangles, by the structure of the tree: what `raycast` visits without a limit. */
function testsByHand(bvh, ray) {
    let [boxes, triangles] = [0, 0];
    bvh.traverse((depth, isLeaf, box, offset, count) => {
        boxes++;
        const [low, high] = [box.subarray(0, 3), box.subarray(3)].map((corner) => new Vector3(...corner));
        const isHit = ray.intersectsBox(new Box3(low, high));
        if (isLeaf && isHit) triangles += count;
        return !isHit;
    });
    return { boxes, triangles };
}

test('counted tests are those of a walk over the nodes, and the hits stay the same', async () => {
    const geometry = scene();
    const searched = (await bake(geometry, { work: 1_000_000 })).toMeshBVH(geometry);
    const own = new MeshBVH(scene(), { strategy: SAH, targetLeafSize: 1 });
    const sums = [searched, own].map((bvh) => {
        let sum = 0;
        for (const ray of rays(3000)) {
            const all = countTests(bvh, ray, { side: DoubleSide, query: 'raycast' });
            const { boxes, triangles } = testsByHand(bvh, ray);
            assert.deepEqual({ boxes: all.boxes, triangles: all.triangles }, { boxes, triangles });
            const first = countTests(bvh, ray, { side: DoubleSide });
            assert.equal(first.hit?.distance, bvh.raycastFirst(ray, DoubleSide)?.distance);
            assert.ok(first.boxes <= all.boxes && first.triangles <= all.triangles);
            sum += first.boxes + first.triangles;
        }
        return sum;
    });
    assert.ok(sums[0] < 0.9 * sums[1], sums.join());
});

test('no smooth mesh takes more tests with our tree than with the best of the library’s own', async () => {
    for (const smooth of [new TorusKnotGeometry(1, 0.35, 160, 24), new SphereGeometry(1, 90, 60)]) {
        const own = [1, 2, 4, 10].map((targetLeafSize) => new MeshBVH(smooth.clone(), { strategy: SAH, targetLeafSize }));
        const ours = (await bake(smooth, { work: 3_000_000 })).toMeshBVH(smooth);
        const next = random(3);
        const point = (size) => new Vector3(next(), next(), next()).subScalar(0.5).multiplyScalar(size);
        const within = Array.from({ length: 6000 }, () => new Ray(point(2), point(1).normalize()));
        const towards = within.map(({ origin, direction }) => {
            const eye = direction.clone().multiplyScalar(5);
            return new Ray(eye, origin.clone().sub(eye).normalize());
        });
        for (const all of [within, towards]) {
            const [searched, ...theirs] = [ours, ...own].map((bvh) => {
                let cost = 0;
                for (const ray of all) {
                    const { boxes, triangles } = countTests(bvh, ray, { side: DoubleSide });
                    cost += 0.9 * boxes + 1.25 * triangles;
                }
                return cost;
            });
            assert.ok(searched <= Math.min(...theirs), `${searched} beside ${theirs}`);
        }
    }
});

test('geometries without an index, with groups, with a draw range and with interleaved corners are traced', async () => {
    const grouped = scene();
    const half = 3 * Math.floor(grouped.index.count / 6);
    grouped.addGroup(0, half, 0);
    grouped.addGroup(half, grouped.index.count - half, 1);
    const partial = scene();
    partial.setDrawRange(half, 900);
    const interleaved = scene();
    const position = interleaved.attributes.position;
    const buffer = new InterleavedBuffer(new Float32Array(5 * position.count), 5);
    for (let vertex = 0; vertex < position.count; vertex++) {
        buffer.array.set(position.array.subarray(3 * vertex, 3 * vertex + 3), 5 * vertex + 1);
    }
    interleaved.setAttribute('position', new InterleavedBufferAttribute(buffer, 3, 1));
    for (const geometry of [scene({ isIndexed: false }), grouped, partial, interleaved]) {
        const theirs = new MeshBVH(geometry.clone(), {});
        const index = geometry.index?.array.slice();
        const ours = (await bake(geometry, { work: 200_000 })).toMeshBVH(geometry);
        assertSameHits(ours, theirs, 5000, geometry === partial ? 100 : 500);
        if (geometry === grouped || geometry === partial) assert.deepEqual(geometry.index.array, index);
    }
});

test('a worker finds the same tree, tells of its progress, and ends on a signal', async () => {
    const geometry = scene();
    const work = 2_000_000;
    const here = await bake(geometry, { work });
    const fractions = [];
    const there = await bakeInWorker(geometry, { work, onProgress: ({ fraction }) => fractions.push(fraction) });
    assert.deepEqual(there.save(), here.save());
    assert.ok(fractions.length > 2 && fractions.every((part) => part >= 0 && part <= 1));
    const ended = bakeInWorker(geometry, { seconds: 60, signal: AbortSignal.timeout(200) });
    await assert.rejects(ended, { name: 'TimeoutError' });
});

test('a time is kept, and an exception of onProgress ends the search', async () => {
    const start = performance.now();
    await bake(scene(), { seconds: 0.2 });
    assert.ok(performance.now() - start < 5000);
    const stop = new Error('enough');
    await assert.rejects(bake(scene(), { seconds: 60, onProgress: () => { throw stop; } }), stop);
});

test('a saved tree is the file of the program, and loads for its own geometry only', async () => {
    const geometry = scene();
    const bytes = (await bake(geometry, { work: 1_000_000, seed: 7 })).save();
    const tree = await Tree.load(bytes, scene());
    assert.equal(tree.cost, (await bake(geometry, { work: 1_000_000, seed: 7 })).cost);
    await assert.rejects(Tree.load(bytes, new TorusKnotGeometry()), /scene|objects/);
    await assert.rejects(Tree.load(bytes.subarray(1), geometry));
    if (!process.env.BVH) return;
    const folder = mkdtempSync(join(tmpdir(), 'bvh-'));
    const position = geometry.attributes.position.array;
    const lines = [];
    for (let at = 0; at < position.length; at += 3) lines.push(`v ${position.slice(at, at + 3).join(' ')}`);
    const index = geometry.index.array;
    for (let at = 0; at < index.length; at += 3) lines.push(`f ${[0, 1, 2].map((corner) => index[at + corner] + 1).join(' ')}`);
    const [mesh, out] = ['mesh.obj', 'tree.bvh'].map((name) => join(folder, name));
    writeFileSync(mesh, lines.join('\n'));
    execFileSync(process.env.BVH, ['bake', mesh, '--budget', '1Mwork', '--seed', '7', '--out', out], { stdio: 'pipe' });
    assert.ok(readFileSync(out).equals(bytes));
    const exported = join(folder, 'tree.bin');
    execFileSync(process.env.BVH, ['export', out, mesh, '--for', 'three-mesh-bvh', '--out', exported], { stdio: 'pipe' });
    const file = readFileSync(exported);
    const ours = loadExport(file.buffer.slice(file.byteOffset, file.byteOffset + file.length), scene());
    assertSameHits(ours, new MeshBVH(scene()), 20_000);
});

test('the example of the README runs', async () => {
    const readme = readFileSync(new URL('../README.md', import.meta.url), 'utf8');
    const example = new URL('./readme-example.mjs', import.meta.url);
    writeFileSync(example, readme.split('```js\n')[1].split('```')[0].replace('seconds: 5', 'seconds: 0.1'));
    globalThis.mesh = { geometry: scene() };
    try {
        await import(example.href);
    } finally {
        rmSync(example);
    }
    assert.ok(globalThis.mesh.geometry.boundsTree instanceof MeshBVH);
});

test('wrong arguments and geometries are named', async () => {
    for (const [options, name] of [[{ seconds: -1 }, 'seconds'], [{ work: 0.5 }, 'work'], [{ seed: '1' }, 'seed'], [{ references: 0 }, 'references']]) {
        await assert.rejects(bake(scene(), options), (error) => error instanceof RangeError && error.message.startsWith(`${name} is`));
    }
    await assert.rejects(bake(new BufferGeometry()), /no position/);
    const broken = scene();
    broken.attributes.position.array[10] = NaN;
    await assert.rejects(bake(broken), /object|box/);
    const tree = await bake(scene(), { work: 100_000 });
    assert.throws(() => tree.toMeshBVH(new TorusKnotGeometry()), /triangles; accepted/);
});
