// What the package promises: the library's own hits, the program's bytes, and errors that name what is wrong.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { pathToFileURL } from 'node:url';
import {
    BackSide, BatchedMesh, Box3, BoxGeometry, BufferAttribute, BufferGeometry, DoubleSide, Euler, FrontSide, Group,
    InstancedBufferGeometry, InstancedMesh, InterleavedBuffer, InterleavedBufferAttribute, Matrix3, Matrix4, Mesh,
    MeshBasicMaterial, MeshStandardMaterial, ObjectSpaceNormalMap, Ray, Raycaster, SkinnedMesh, SphereGeometry,
    Texture, TorusKnotGeometry, Vector3,
} from 'three';
import { mergeGeometries } from 'three/addons/utils/BufferGeometryUtils.js';
import { acceleratedRaycast, MeshBVH, SAH } from 'three-mesh-bvh';
import { bake, bakeInWorker, costOf, countTests, orient, Tree } from 'bvh-search';
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

const plain = Mesh.prototype.raycast;

/** All hits of three's own `raycast`, or of another one, with the materials that they name. */
function hitsOf(mesh, raycast, list = rays(400)) {
    mesh.raycast = raycast;
    const caster = new Raycaster();
    return list.map((ray) => {
        caster.set(ray.origin, ray.direction);
        return caster.intersectObject(mesh).map(({ distance, face, batchId }) => [
            distance.toFixed(5), face.materialIndex, [face.a, face.b, face.c].sort().join(), batchId,
        ].join());
    });
}

/** Materials that are seen from the sides. */
const materials = (...sides) => sides.map((side) => new MeshBasicMaterial({ side }));

/** Asserts that three finds the same in the geometry with its tree and without, also with its materials. */
function assertAsThree(geometry, boundsTree, least = 20) {
    geometry.boundsTree = boundsTree;
    for (const material of [materials(DoubleSide)[0], materials(FrontSide, BackSide, DoubleSide)]) {
        const mesh = new Mesh(geometry, material);
        const expected = hitsOf(mesh, plain);
        assert.deepEqual(hitsOf(mesh, acceleratedRaycast), expected);
        const hits = expected.flat().length;
        assert.ok(hits > least || Array.isArray(material) && geometry.groups.length === 0, `${hits} hits`);
    }
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
    // `raycast` meets a triangle once, whole or divided, here and in a file.
    assertAsThree(geometry, divided.toMeshBVH(geometry), 100);
    assertAsThree(geometry, (await Tree.load(divided.save(), geometry)).toMeshBVH(geometry), 100);
    assertAsThree(geometry, whole.toMeshBVH(geometry), 100);
});

test('a tree is applied twice, beside others, and to no other geometry than its own', async () => {
    const geometry = scene();
    const untouched = geometry.clone();
    const [first, second] = await Promise.all([1, 2].map((seed) => bake(geometry, { work: 200_000, seed })));
    const bytes = first.save();
    const bvhs = [first, second, first].map((tree) => tree.toMeshBVH(geometry));
    bvhs.push((await Tree.load(bytes, geometry)).toMeshBVH(geometry));
    // Hot reload bakes again.
    bvhs.push((await bake(geometry, { work: 200_000, seed: 3 })).toMeshBVH(geometry));
    bvhs.push(first.toMeshBVH(geometry));
    for (const bvh of bvhs) assertAsThree(geometry, bvh);
    // The first one alone reorders the index; a refit of one tree leaves the others.
    assert.deepEqual(bvhs.map(({ indirect }) => indirect), [false, true, false, false, true, false]);
    bvhs[0].geometry.attributes.position.array.fill(0);
    bvhs[0].refit();
    assertAsThree(untouched, first.toMeshBVH(untouched));
    assert.notDeepEqual(untouched.index.array, scene().index.array);

    const bare = scene({ isIndexed: false });
    const tree = await bake(bare, { work: 200_000 });
    for (let turn = 0; turn < 2; turn++) assertAsThree(bare, tree.toMeshBVH(bare));
    const moved = scene();
    const moving = bakeInWorker(moved, { work: 200_000 });
    const still = await bake(moved, { work: 200_000 });
    moved.translate(5, 0, 0);
    const flipped = scene();
    flipped.index.array.reverse();
    const others = [moved, flipped, scene().scale(2, 2, 2), geometry.clone().setIndex(null), new TorusKnotGeometry()];
    for (const other of others) {
        for (const baked of [still, await moving]) {
            assert.throws(() => baked.toMeshBVH(other), /accepted: the/);
            await assert.rejects(Tree.load(baked.save(), other));
        }
    }
});

test('groups, gaps between them, draw ranges and parts of a batch keep their materials and triangles', async () => {
    const half = 3 * Math.floor(scene().index.count / 6);
    const count = scene().index.count;
    for (const [groups, range] of [
        [[[0, half, 0], [half, count - half, 1]], [0, Infinity]],
        [[[300, 300, 1], [half, 600, 2]], [0, Infinity]],
        [[[0, half + 300, 0], [half - 300, Infinity, 1]], [0, Infinity]],
        [[[0, half, 0], [half, count - half, 2]], [300, half]],
        [[], [half, 3000]],
    ]) {
        for (const isIndexed of [true, false]) {
            const geometry = scene({ isIndexed });
            geometry.setDrawRange(...range);
            for (const group of groups) geometry.addGroup(...group);
            const tree = await bake(geometry, { work: 100_000 });
            assertAsThree(geometry, tree.toMeshBVH(geometry), 10);
            assertAsThree(geometry, (await Tree.load(tree.save(), geometry)).toMeshBVH(geometry), 10);
            assert.throws(() => tree.toMeshBVH(geometry, { indirect: false }), /indirect is false.*(groups|part)/);
        }
    }
    for (const [change, expected] of [
        [(geometry) => geometry.setDrawRange(301, 900), /draw range begins at 301/],
        [(geometry) => geometry.setDrawRange(300, 901), /draw range ends at 1201/],
        [(geometry) => geometry.addGroup(4, 300), /group 0 begins at 4/],
    ]) {
        const geometry = scene();
        change(geometry);
        await assert.rejects(bake(geometry, { work: 1 }), expected);
    }
    const batch = new BatchedMesh(3, 4000, 20_000, materials(DoubleSide)[0]);
    const ids = [new BoxGeometry(2, 2, 2), new TorusKnotGeometry()].map((geometry) => batch.addGeometry(geometry));
    ids.forEach((id, x) => batch.setMatrixAt(batch.addInstance(id), new Matrix4().makeTranslation(x, 0, 0)));
    const expected = hitsOf(batch, BatchedMesh.prototype.raycast);
    batch.boundsTrees = [];
    for (const id of ids) {
        const { start, count } = batch.getGeometryRangeAt(id);
        batch.geometry.setDrawRange(start, count);
        batch.boundsTrees[id] = (await bake(batch.geometry, { work: 10_000 })).toMeshBVH(batch.geometry);
    }
    batch.geometry.setDrawRange(0, Infinity);
    Mesh.prototype.raycast = acceleratedRaycast;
    assert.deepEqual(hitsOf(batch, acceleratedRaycast).map((hits) => hits.sort()), expected.map((hits) => hits.sort()));
    assert.ok(expected.flat().length > 100);
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
    const own = await costOf(new MeshBVH(scene(), { strategy: SAH, targetLeafSize: 1 }));
    for (const budget of [{ work: 2_000_000 }, { seconds: 0.3 }]) {
        const all = [];
        for (const search of [bake, bakeInWorker]) {
            const told = [];
            const tree = await search(geometry, { ...budget, onProgress: (progress) => told.push(progress) });
            const fractions = told.map(({ fraction }) => fraction);
            assert.ok(fractions.length > 2);
            assert.deepEqual(fractions, fractions.toSorted((a, b) => a - b));
            assert.deepEqual(told.at(-1), { fraction: 1, cost: tree.cost });
            const costs = told.map(({ cost }) => cost).filter((cost) => cost !== undefined);
            assert.ok(costs.length > 2 && costs.every((cost) => cost > 0.97 * tree.cost && cost < 1.3 * own), `${costs}`);
            all.push(tree.save());
        }
        if (budget.work) assert.deepEqual(all[0], all[1]);
    }
    const ended = bakeInWorker(geometry, { seconds: 60, signal: AbortSignal.timeout(200) });
    await assert.rejects(ended, { name: 'TimeoutError' });
});

test('a time is kept, also where every ray meets every triangle', async () => {
    const same = new BufferGeometry();
    const corners = Float32Array.from({ length: 180_000 }, (_, at) => [0, 0, 0, 1, 0, 0, 0, 1, 1][at % 9]);
    same.setAttribute('position', new BufferAttribute(corners, 3));
    await bake(scene(), { work: 1 });
    for (const [geometry, options, most] of [
        [scene(), { seconds: 0.2 }, 1000],
        [same, { seconds: 0.5 }, 2000],
        [same, { work: 1 }, 2000],
    ]) {
        const start = performance.now();
        await bake(geometry, options);
        assert.ok(performance.now() - start < most, `${performance.now() - start} ms`);
    }
});

test('what onProgress throws ends the search, in a worker too', async () => {
    const stop = new Error('enough');
    for (const search of [bake, bakeInWorker]) {
        await assert.rejects(search(scene(), { seconds: 60, onProgress: () => { throw stop; } }), stop);
        await assert.rejects(search(scene(), { seconds: 0.5, onProgress: async () => { throw stop; } }), stop);
    }
});

test('trees that nobody keeps take no memory, and neither do the last ones', async () => {
    const knot = new TorusKnotGeometry(1, 0.3, 200, 64);
    const resident = async () => {
        for (let turn = 0; turn < 25; turn++) await bake(knot, { work: 1 });
        return process.memoryUsage().rss;
    };
    const first = await resident();
    const grown = await resident() - first;
    assert.ok(grown < 60e6, `${grown} bytes more`);
    const tree = await bake(knot, { work: 1 });
    tree.dispose();
    assert.throws(() => tree.toMeshBVH(knot), /disposed/);
});

test('a program in the command line bakes in a worker', () => {
    const program = `import { BoxGeometry } from 'three'; import { bakeInWorker } from 'bvh-search';
        console.log((await bakeInWorker(new BoxGeometry(), { work: 1 })).cost > 0);`;
    const folder = new URL('..', import.meta.url);
    const said = execFileSync(process.execPath, ['--input-type=module', '-e', program], { cwd: folder, encoding: 'utf8' });
    assert.equal(said, 'true\n');
});

test('a saved tree is the file of the program, and loads for its own geometry only', async () => {
    const geometry = scene();
    const bytes = (await bake(geometry, { work: 1_000_000, seed: 7 })).save();
    const tree = await Tree.load(bytes, scene());
    assert.equal(tree.cost, (await bake(geometry, { work: 1_000_000, seed: 7 })).cost);
    await assert.rejects(Tree.load(bytes, new TorusKnotGeometry()), /scene|objects/);
    await assert.rejects(Tree.load(bytes.subarray(1), geometry));
    const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
    for (const form of [buffer, new DataView(buffer), Buffer.from(bytes)]) {
        assert.deepEqual((await Tree.load(form, geometry)).save(), bytes);
    }
    for (const form of ['bytes', Promise.resolve(buffer), 5, undefined]) {
        await assert.rejects(Tree.load(form, geometry), { name: 'TypeError', message: /bytes is .*accepted: an ArrayBuffer/ });
    }
    const chosen = (await bake(geometry)).save();
    const own = { work: 8000 * geometry.index.count / 3 };
    assert.deepEqual(chosen, (await bakeInWorker(geometry, own)).save());
    if (!process.env.BVH) return;
    const folder = mkdtempSync(join(tmpdir(), 'bvh-'));
    const [mesh, out] = ['mesh.obj', 'tree.bvh'].map((name) => join(folder, name));
    const baked = (geometry, ...options) => {
        const of = ({ array }, size, line) => Array.from({ length: array.length / size }, (_, at) => line([...array.slice(size * at, size * at + size)]));
        const lines = [...of(geometry.attributes.position, 3, (place) => `v ${place.join(' ')}`), ...of(geometry.index, 3, (face) => `f ${face.map((corner) => corner + 1).join(' ')}`)];
        writeFileSync(mesh, lines.join('\n'));
        execFileSync(process.env.BVH, ['bake', mesh, '--for', 'three-mesh-bvh', ...options, '--out', out], { stdio: 'pipe' });
        return readFileSync(out);
    };
    // Rays take fewer tests in a ball's greedy tree, which both keep.
    const ball = new SphereGeometry(1, 16, 8);
    assert.ok(baked(ball).equals((await bake(ball)).save()));
    assert.ok(baked(geometry, '--budget', '1Mwork', '--seed', '7').equals(bytes));
    assert.ok(baked(geometry).equals(chosen));
    const exported = join(folder, 'tree.bin');
    execFileSync(process.env.BVH, ['export', out, mesh, '--for', 'three-mesh-bvh', '--out', exported], { stdio: 'pipe' });
    const file = readFileSync(exported);
    const ours = loadExport(file.buffer.slice(file.byteOffset, file.byteOffset + file.length), scene());
    assertSameHits(ours, new MeshBVH(scene()), 20_000);
});

const OBLIQUE = new Matrix4().makeRotationFromEuler(new Euler(0.4, 0.5, 0.6));

/** Boards along the axes that the matrix turns to. */
function boards(matrix = OBLIQUE) {
    const next = random(4);
    const parts = Array.from({ length: 300 }, () => {
        const [width, height, depth] = [next(), next(), next()].map((x) => 0.02 + 3 * x ** 8);
        return new BoxGeometry(width, height, depth).translate(...[next(), next(), next()].map((x) => 4 * x - 2));
    });
    const geometry = mergeGeometries(parts).applyMatrix4(matrix);
    geometry.computeTangents();
    geometry.computeBoundingBox();
    geometry.computeBoundingSphere();
    return geometry;
}

/** Attributes that share a buffer, and small numbers in their place. */
function compressed() {
    const geometry = boards();
    const { position, normal } = geometry.attributes;
    const buffer = new InterleavedBuffer(new Float32Array(4 * position.count), 4);
    const interleaved = new InterleavedBufferAttribute(buffer, 3, 1);
    for (let vertex = 0; vertex < position.count; vertex++) {
        interleaved.setXYZ(vertex, position.getX(vertex), position.getY(vertex), position.getZ(vertex));
    }
    geometry.setAttribute('position', interleaved);
    geometry.setAttribute('normal', new BufferAttribute(Int8Array.from(normal.array, (x) => 127 * x), 3, true));
    return geometry;
}

const CHILDREN = ['child', 'still'];

/** A mesh with two children in a group whose scale is not the same along all axes. */
function placed(geometry, change = () => {}) {
    const mesh = new Mesh(geometry, materials(DoubleSide)[0]);
    mesh.position.set(1, 2, 3);
    mesh.quaternion.setFromEuler(new Euler(1, 2, 3));
    const [child, still] = [new Group(), new Group()];
    [child.name, still.name] = CHILDREN;
    child.position.set(3, 2, 1);
    child.scale.set(1, 2, 3);
    still.matrixAutoUpdate = false;
    still.matrix.makeShear(1, 0, 0, 0, 0, 0).setPosition(1, 1, 1);
    mesh.add(child, still);
    change(mesh);
    const group = new Group();
    group.scale.set(1, 2, 0.5);
    group.add(mesh);
    group.updateMatrixWorld();
    return mesh;
}

/** Where everything of a mesh is in the world: directions, as three's shaders have them, and points. */
function world(mesh) {
    const { position, normal, tangent } = mesh.geometry.attributes;
    const normalMatrix = new Matrix3().getNormalMatrix(mesh.matrixWorld);
    const vectors = (attribute, place) => Array.from({ length: attribute.count }, (_, vertex) =>
        place(new Vector3().fromBufferAttribute(attribute, vertex)));
    return {
        points: vectors(position, (point) => point.applyMatrix4(mesh.matrixWorld)),
        directions: [
            vectors(normal, (direction) => direction.applyMatrix3(normalMatrix)),
            vectors(tangent, (direction) => direction.transformDirection(mesh.matrixWorld)),
        ].flat(),
        signs: Array.from({ length: tangent.count }, (_, vertex) => tangent.getW(vertex)),
        children: CHILDREN.flatMap((name) => mesh.getObjectByName(name).matrixWorld.elements),
    };
}

/** The first hits of rays in the world. */
function hitsInWorld(mesh, raycast) {
    mesh.raycast = raycast;
    const caster = new Raycaster();
    return rays(400).map((ray) => {
        caster.set(ray.origin.add(mesh.getWorldPosition(new Vector3())), ray.direction);
        const [hit] = caster.intersectObject(mesh, false);
        return hit && { distance: hit.distance, corners: [hit.face.a, hit.face.b, hit.face.c].sort().join() };
    });
}

function assertSameWorld(after, before, size) {
    const farthest = (a, b) => Math.max(...a.map((vector, at) => vector.distanceTo(b[at])));
    assert.ok(farthest(after.points, before.points) <= 2 ** -23 * size);
    assert.ok(farthest(after.directions, before.directions) < 1e-6);
    assert.deepEqual(after.signs, before.signs);
    after.children.forEach((x, at) => assert.ok(Math.abs(x - before.children[at]) < 1e-12));
}

function assertSameWorldHits(after, before) {
    after.forEach((hit, at) => {
        assert.equal(hit?.corners, before[at]?.corners);
        if (hit) assert.ok(Math.abs(hit.distance - before[at].distance) < 1e-5);
    });
    assert.ok(after.filter(Boolean).length > 100);
}

test('a mesh that stands obliquely is turned, and nothing in the world moves', async () => {
    const still = (mesh) => {
        mesh.matrixAutoUpdate = false;
        mesh.updateMatrix();
    };
    for (const [geometry, change, isComposed] of [
        [boards(), undefined, true],
        [compressed(), (mesh) => mesh.scale.setScalar(0.5), true],
        [boards(), (mesh) => mesh.scale.set(-2, 2, 2), true],
        [boards(), (mesh) => mesh.scale.set(2, -2, -2), true],
        [boards(), (mesh) => mesh.scale.setScalar(-1), true],
        [boards(), still, true],
        [boards(), (mesh) => { mesh.scale.set(1, 2, 3); still(mesh); }, false],
        [boards(), (mesh) => { still(mesh); mesh.matrix.makeShear(1, 2, 0, 0, 0, 0); }, false],
    ]) {
        const mesh = placed(geometry, change);
        const attributes = { ...geometry.attributes };
        const arrays = Object.values(attributes).map((attribute) => attribute.array.slice());
        const [before, hits] = [world(mesh), hitsInWorld(mesh, plain)];
        const size = geometry.boundingSphere.radius * mesh.matrixWorld.getMaxScaleOnAxis();
        const { turned, gain } = await orient(mesh);
        assert.ok(turned && gain > 0.2 && gain < 1, `${turned} ${gain}`);
        assertSameWorld(world(mesh), before, size);
        assertSameWorldHits(hitsInWorld(mesh, plain), hits);
        mesh.parent.updateMatrixWorld(true);
        assertSameWorld(world(mesh), before, size);
        if (isComposed) {
            mesh.updateMatrix();
            mesh.parent.updateMatrixWorld(true);
            assertSameWorld(world(mesh), before, size);
        }
        // Another geometry may have the same attributes.
        assert.deepEqual(Object.values(attributes).map(({ array }) => array), arrays);
        const { position } = geometry.attributes;
        assert.notEqual(position, attributes.position);
        assert.deepEqual(geometry.boundingBox, new Box3().setFromBufferAttribute(position));
        const matrix = mesh.matrix.clone();
        assert.deepEqual(await orient(mesh), { turned: false, gain: 0 });
        assert.equal(geometry.attributes.position, position);
        assert.deepEqual(mesh.matrix, matrix);
    }
});

test('a bake that orients has the hits of three in the world, costs less, and leaves what stands well', async () => {
    const flat = await bake(boards(), { work: 1_000_000 });
    const files = [];
    for (const search of [bake, bakeInWorker]) {
        const mesh = placed(boards());
        const hits = hitsInWorld(mesh, plain);
        const tree = await search(mesh, { work: 1_000_000, orient: true });
        assert.ok(tree.cost < 0.7 * flat.cost, `${tree.cost} beside ${flat.cost}`);
        mesh.geometry.boundsTree = tree.toMeshBVH(mesh.geometry);
        assertSameWorldHits(hitsInWorld(mesh, acceleratedRaycast), hits);
        files.push(tree.save());
        // What the README says of a saved tree.
        const loaded = placed(boards());
        await assert.rejects(Tree.load(files[0], loaded.geometry));
        await orient(loaded);
        assert.equal((await Tree.load(files[0], loaded.geometry)).cost, tree.cost);
    }
    assert.deepEqual(files[0], files[1]);
    for (const geometry of [boards(new Matrix4()), new SphereGeometry()]) {
        const mesh = placed(geometry, ({ scale }) => scale.setScalar(3));
        const [{ position }, { matrix, quaternion }] = [geometry.attributes, mesh.clone()];
        assert.deepEqual(await orient(mesh), { turned: false, gain: 0 });
        assert.equal(geometry.attributes.position, position);
        assert.ok(mesh.matrix.equals(matrix) && mesh.quaternion.equals(quaternion));
        const [tree, same] = [await bake(mesh, { work: 1000, orient: true }), await bake(geometry, { work: 1000 })];
        assert.deepEqual(tree.save(), same.save());
    }
});

test('a mesh that would look different if it were turned is refused as it is', async () => {
    const mapped = new MeshStandardMaterial({ normalMap: new Texture(), normalMapType: ObjectSpaceNormalMap });
    const geometry = boards();
    const morphing = boards();
    morphing.morphAttributes.position = [morphing.attributes.position];
    const changed = (change) => placed(geometry.clone(), change);
    for (const [mesh, name, message] of [
        [undefined, 'TypeError', /^mesh is undefined; accepted: a Mesh/],
        [geometry, 'TypeError', /^mesh is a BufferGeometry/],
        [new SkinnedMesh(geometry), 'TypeError', /^mesh is of type SkinnedMesh.*accepted/],
        [new InstancedMesh(geometry, mapped, 2), 'TypeError', /^mesh is of type InstancedMesh/],
        [new BatchedMesh(1, 3), 'TypeError', /^mesh is of type BatchedMesh/],
        [new Mesh(new InstancedBufferGeometry().copy(geometry)), 'TypeError', /InstancedBufferGeometry/],
        [changed(({ geometry }) => { geometry.boundsTree = {}; }), 'Error', /boundsTree/],
        [changed((mesh) => { mesh.material = [mesh.material, mapped]; }), 'Error', /normal map/],
        [changed((mesh) => { mesh.pivot = new Vector3(); }), 'Error', /pivot/],
        [changed(({ scale }) => scale.set(1, 2, 1)), 'Error', /^mesh.scale is 1, 2, 1; accepted: the same/],
        [changed(({ scale }) => scale.set(1, NaN, 1)), 'Error', /^mesh.scale is 1, NaN, 1/],
        [changed((mesh) => mesh.add(new Mesh(mesh.geometry))), 'Error', /another object/],
        [new Mesh(morphing), 'Error', /morph/],
    ]) {
        const [before, matrix] = [mesh?.geometry?.attributes.position, mesh?.matrix?.clone()];
        for (const search of [orient, bake, bakeInWorker]) {
            await assert.rejects(search(mesh, { work: 1, orient: true }), { name, message });
        }
        assert.equal(mesh?.geometry?.attributes.position, before);
        assert.deepEqual(mesh?.matrix, matrix);
    }
});

/** Runs the first block of JavaScript on a page. */
async function runExample(page) {
    const text = readFileSync(new URL(page, import.meta.url), 'utf8');
    const example = new URL('./page-example.mjs', import.meta.url);
    writeFileSync(example, text.split('```js\n')[1].split('```')[0].replace(/seconds: \d/, 'seconds: 0.1'));
    try {
        await import(`${example.href}?${page}`);
    } finally {
        rmSync(example);
    }
}

test('the examples of the README and of the cookbook run', async () => {
    globalThis.mesh = { geometry: scene() };
    await runExample('../README.md');
    assert.ok(globalThis.mesh.geometry.boundsTree instanceof MeshBVH);
    const shared = scene();
    const parts = [new Mesh(shared), new Mesh(shared), new Mesh(scene())];
    globalThis.model = new Group().add(...parts);
    await runExample('../../../docs/use/COOKBOOK.md');
    for (const { geometry } of parts) assert.ok(geometry.boundsTree instanceof MeshBVH);
});

test('children of a turned mesh move as before, and its geometry is saved as it is', async () => {
    const meshes = [placed(boards()), placed(boards())];
    const [turned, before] = meshes;
    Object.assign(turned.geometry, { type: 'BoxGeometry', parameters: { width: 1 } });
    assert.ok((await orient(turned)).turned);
    const places = meshes.map((mesh) => {
        const child = mesh.getObjectByName('child');
        child.position.set(7, 8, 9);
        mesh.parent.updateMatrixWorld();
        return child.getWorldPosition(new Vector3());
    });
    assert.ok(places[0].distanceTo(places[1]) < 1e-12);
    const { type, parameters, data } = turned.geometry.toJSON();
    assert.ok(type === 'BufferGeometry' && parameters === undefined && data.attributes.position);
    assert.equal(before.children.length, 2);
});

test('wrong arguments and geometries are named', async () => {
    const changed = (change) => {
        const geometry = scene();
        change(geometry);
        return geometry;
    };
    const cases = [
        [scene(), { seconds: -1 }, 'RangeError', /^seconds is -1/],
        [scene(), { work: 0.5 }, 'RangeError', /^work is 0.5/],
        [scene(), { seed: '1' }, 'RangeError', /^seed is "1"/],
        [scene(), { references: 0 }, 'RangeError', /^references is 0/],
        [scene(), { second: 1 }, 'TypeError', /option "second"; accepted: seconds/],
        [scene(), null, 'TypeError', /^options is null/],
        [scene(), { orient: 1 }, 'TypeError', /^orient is 1; accepted: true or false/],
        [scene(), { onProgress: 5 }, 'TypeError', /^onProgress is 5; accepted: a function/],
        [scene(), { signal: 5 }, 'TypeError', /signal/],
        [undefined, {}, 'TypeError', /^geometry is undefined; accepted: a BufferGeometry/],
        [new Mesh(scene()), {}, 'TypeError', /^geometry is a Mesh; accepted: a BufferGeometry/],
        [new BufferGeometry(), {}, 'Error', /no position/],
        [changed((geometry) => geometry.setDrawRange(0, 0)), {}, 'Error', /no triangles/],
        [changed(({ index }) => index.setX(5, 65_000)), {}, 'RangeError', /^index\[5\] is 65000; accepted: 0 to \d+/],
        [changed((geometry) => geometry.setIndex(new BufferAttribute(Int32Array.of(0, 1, 2, 3, -1, 5), 1))), {}, 'RangeError', /^index\[4\] is -1/],
        [changed(({ attributes }) => attributes.position.setY(3, NaN)), {}, 'RangeError', /^vertex 3 .*NaN/],
        [changed(({ morphAttributes }) => { morphAttributes.position = [new BufferAttribute(new Float32Array(3), 3)]; }),
            {}, 'Error', /morph.*accepted/],
        [changed((geometry) => geometry.setAttribute('skinIndex', geometry.index)), {}, 'Error', /skin.*accepted/],
    ];
    for (const [geometry, options, name, message] of cases) {
        await assert.rejects(bakeInWorker(geometry, options), { name, message });
        await assert.rejects(bake(geometry, options), { name, message });
    }
    const tree = await bake(scene(), { work: 100_000 });
    assert.throws(() => tree.toMeshBVH(scene(), { indirekt: true }), { name: 'TypeError', message: /option "indirekt"/ });
    assert.throws(() => tree.toMeshBVH(scene(), { indirect: 'yes' }), { name: 'TypeError', message: /^indirect is yes/ });
    const bvh = tree.toMeshBVH(scene());
    assert.throws(() => countTests(bvh, new Ray(), { query: 'all' }), { name: 'TypeError', message: /^query is "all"/ });
    await assert.rejects(costOf(scene()), { name: 'TypeError', message: /MeshBVH/ });
    assert.throws(() => tree.toMeshBVH(new Mesh(scene())), { name: 'TypeError', message: /^geometry is a Mesh/ });
});

test('code that `vite dev` has moved finds the installed files, and other code those beside it', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'bvh-'));
    const installed = pathToFileURL(join(folder, 'node_modules/bvh-search/js/bake-web.js')).href;
    const served = async (place) => {
        mkdirSync(join(folder, place), { recursive: true });
        copyFileSync(new URL('../js/served-web.js', import.meta.url), join(folder, place, 'served.mjs'));
        const { served } = await import(pathToFileURL(join(folder, place, 'served.mjs')).href);
        return served('js/bake-web.js')?.href;
    };
    try {
        for (const cache of ['.vite/deps', '.cache/vite/client/deps']) {
            assert.equal(await served(`node_modules/${cache}`), installed);
        }
        for (const own of ['node_modules/bvh-search/js', 'node_modules/.pnpm/a/node_modules/bvh-search/js', 'assets']) {
            assert.equal(await served(own), undefined);
        }
    } finally {
        rmSync(folder, { recursive: true });
    }
});
