import { MeshBVH } from 'three-mesh-bvh';
import * as wasm from '../wasm/bvh_js.js';
import { fingerprint, reorder, reordered, restored, triangleCount, triangles } from './geometry.js';
import { checkMesh, turn } from './orient.js';
import { checked, checkNames } from './options.js';
import { load } from '#load';
import { startWorker } from '#worker';

export { countTests } from './tests.js';

let loaded;
// After a failure, such as of the network, the next call tries again.
const ready = () => (loaded ??= load().catch((error) => {
    loaded = undefined;
    throw error;
}));

/** A tree over the triangles of a geometry. */
export class Tree {
    #parts;

    constructor([file, nodes, order, cost], { count, hash }) {
        this.#parts = { file, nodes, order, cost, count, hash };
    }

    static async load(bytes, geometry) {
        const file = copyOf(bytes);
        await ready();
        const { corners, places } = triangles(geometry);
        try {
            return new Tree(wasm.load(corners, file), identity(corners));
        } catch (error) {
            if (!places) throw error;
            const former = restored(places, corners);
            return new Tree(wasm.load(former, file), identity(former));
        }
    }

    get #kept() {
        if (!this.#parts) throw new Error('the tree is disposed; accepted: a tree in use');
        return this.#parts;
    }

    save() {
        return this.#kept.file.slice();
    }

    get cost() {
        return this.#kept.cost;
    }

    dispose() {
        this.#parts = undefined;
    }

    toMeshBVH(geometry, options = {}) {
        checkNames(options, ['indirect']);
        const { nodes, order: baked, count, hash } = this.#kept;
        const { corners, ids, places } = triangles(geometry);
        if (corners.length !== 9 * count) {
            throw new Error(`the geometry has ${corners.length / 9} triangles; accepted: the ${count} of the tree`);
        }
        let order = baked.slice();
        if (fingerprint(corners) !== hash) {
            if (!places || fingerprint(restored(places, corners)) !== hash) {
                throw new Error('the geometry has other triangles than the tree, or in another order; '
                    + 'accepted: the geometry as it was when its tree was baked');
            }
            order = order.map((id) => places[id]);
        }
        if (ids) order = order.map((id) => ids[id]);
        const isDivided = order.length > count;
        let unordered;
        if (ids) unordered = 'that is drawn in part';
        else if (geometry.groups.length > 0) unordered = 'with groups';
        else if (isDivided) unordered = 'whose triangles the tree divides';
        const isInOrder = order.every((id, place) => id === place);
        // Another tree may be in use that needs the index in its own order.
        const { indirect = unordered !== undefined || (places !== undefined && !isInOrder) } = options;
        if (typeof indirect !== 'boolean') throw new TypeError(`indirect is ${indirect}; accepted: true or false`);
        if (!indirect && unordered) throw new Error(`indirect is false; accepted: true for a geometry ${unordered}`);
        const data = { version: 1, roots: [nodes.slice().buffer], index: null, indirectBuffer: indirect ? order : null };
        if (!indirect && !(isInOrder && geometry.index)) {
            reorder(geometry, order);
            const after = new Uint32Array(count);
            baked.forEach((id, place) => { after[id] = place; });
            reordered.set(geometry.index, after);
        }
        const bvh = MeshBVH.deserialize(data, geometry, { setIndex: false });
        return isDivided ? withHitsOnce(bvh) : bvh;
    }
}

/** What tells a geometry from others. */
function identity(corners) {
    return { count: corners.length / 9, hash: fingerprint(corners) };
}

/** Lets `raycast` find a divided triangle once, not once for each part. */
function withHitsOnce(bvh) {
    bvh.raycast = (...query) => {
        const found = new Set();
        return MeshBVH.prototype.raycast.apply(bvh, query).filter(({ faceIndex, face }) => {
            const hit = `${faceIndex} ${face.materialIndex}`;
            return !found.has(hit) && found.add(hit);
        });
    };
    return bvh;
}

export async function orient(mesh) {
    checkMesh(mesh);
    const { corners } = triangles(mesh.geometry);
    await ready();
    return turn(mesh, wasm.axes(corners));
}

export async function bake(target, options = {}) {
    const { seconds, work, seed, references, orient: orients } = checked(options);
    if (orients) await orient(target);
    await ready();
    const { corners } = triangles(orients ? target.geometry : target);
    return new Promise((resolve, reject) => {
        const follow = follower(options.onProgress, reject);
        const parts = wasm.bake(corners, seconds, work, seed, references, follow);
        // What an asynchronous `onProgress` has thrown comes first.
        queueMicrotask(() => resolve(new Tree(parts, identity(corners))));
    });
}

export async function bakeInWorker(target, options = {}) {
    const { orient: orients, ...limits } = checked(options, ['signal']);
    const { onProgress, signal } = options;
    if (orients) {
        checkMesh(target);
        const { corners } = triangles(target.geometry);
        turn(target, await inWorker({ asks: 'axes', corners }, undefined, signal));
    }
    const { corners } = triangles(orients ? target.geometry : target);
    const known = identity(corners);
    const message = { asks: 'tree', ...limits, follows: Boolean(onProgress), corners };
    return new Tree(await inWorker(message, onProgress, signal), known);
}

/** What the worker answers to the message. Ends on the signal, or if `onProgress` throws. */
async function inWorker(message, onProgress, signal) {
    signal?.throwIfAborted();
    const worker = startWorker();
    const ended = new AbortController();
    try {
        return await new Promise((resolve, reject) => {
            const follow = follower(onProgress, reject);
            worker.hear((said) => {
                if (said.found) resolve(said.found);
                else if (said.error) reject(new Error(said.error));
                else {
                    try {
                        follow(said.fraction, said.cost);
                    } catch (error) {
                        reject(error);
                    }
                }
            });
            worker.fail(reject);
            signal?.addEventListener('abort', () => reject(signal.reason), { signal: ended.signal });
            worker.post(message);
        });
    } finally {
        ended.abort();
        worker.end();
    }
}

export async function costOf(meshBVH) {
    if (!(meshBVH instanceof MeshBVH)) throw new TypeError('costOf of another object; accepted: a MeshBVH of three-mesh-bvh');
    await ready();
    const { roots, indirectBuffer } = MeshBVH.serialize(meshBVH, { cloneBuffers: false });
    if (roots.length !== 1) throw new Error(`the tree has ${roots.length} roots; accepted: one`);
    const count = indirectBuffer?.length ?? triangleCount(meshBVH.geometry);
    return wasm.costOfRoot(new Uint8Array(roots[0]), count);
}

/**
 * Reports as objects; a cost is known only after an improvement. Passes the later exception of an
 * asynchronous function to `fail`.
 */
function follower(onProgress, fail) {
    return onProgress && ((fraction, cost) => {
        const answer = onProgress(Number.isNaN(cost) ? { fraction } : { fraction, cost });
        if (typeof answer?.then === 'function') answer.then(undefined, fail);
    });
}

/** A copy of bytes, whoever holds them. */
function copyOf(bytes) {
    if (ArrayBuffer.isView(bytes)) return new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength).slice();
    const kind = Object.prototype.toString.call(bytes).slice(8, -1);
    if (!/^(Shared)?ArrayBuffer$/.test(kind)) {
        throw new TypeError(`bytes is of type ${kind}; accepted: an ArrayBuffer or a Uint8Array`);
    }
    return new Uint8Array(bytes).slice();
}
