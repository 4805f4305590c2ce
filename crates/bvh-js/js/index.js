import { BufferAttribute } from 'three';
import { MeshBVH } from 'three-mesh-bvh';
import { Tree as Searched, costOfRoot } from '../wasm/bvh_js.js';
import { load } from '#load';
import { startWorker } from '#worker';

export { countTests } from './tests.js';

let loaded;
const ready = () => (loaded ??= load());

/** A tree over the triangles of a geometry. */
export class Tree {
    #searched;
    #ids;
    #fitted;

    constructor(searched, ids) {
        this.#searched = searched;
        this.#ids = ids;
    }

    static async load(bytes, geometry) {
        await ready();
        const { corners, ids } = triangles(geometry);
        return new Tree(Searched.load(corners, bytes), ids);
    }

    save() {
        return this.#searched.save();
    }

    /** The tree for three-mesh-bvh, fitted when it is first needed. */
    get #three() {
        return (this.#fitted ??= this.#searched.forThreeMesh());
    }

    /** Why the index of the geometry must not be changed, if it must not. */
    get #kept() {
        if (this.#ids !== null) return 'that is drawn in part';
        if (this.#three.order.length > this.#searched.triangles) return 'whose triangles the tree divides';
    }

    toMeshBVH(geometry, { indirect = geometry.groups.length > 0 || this.#kept !== undefined } = {}) {
        const count = this.#ids?.length ?? triangleCount(geometry);
        if (count !== this.#searched.triangles) {
            throw new Error(`the geometry has ${count} triangles; accepted: the ${this.#searched.triangles} of the tree`);
        }
        if (!indirect && this.#kept) throw new Error(`indirect is false; accepted: true for a geometry ${this.#kept}`);
        const three = this.#three;
        const roots = [three.nodes.buffer];
        let order = three.order;
        if (this.#ids !== null) order = order.map((id) => this.#ids[id]);
        if (indirect) {
            return MeshBVH.deserialize({ version: 1, roots, index: null, indirectBuffer: order }, geometry, { setIndex: false });
        }
        const from = geometry.index?.array;
        const vertices = geometry.attributes.position.count;
        const index = new (from?.constructor ?? (vertices > 65535 ? Uint32Array : Uint16Array))(3 * order.length);
        for (let to = 0; to < order.length; to++) {
            for (let corner = 0; corner < 3; corner++) {
                const at = 3 * order[to] + corner;
                index[3 * to + corner] = from ? from[at] : at;
            }
        }
        if (!from) geometry.setIndex(new BufferAttribute(index, 1));
        return MeshBVH.deserialize({ version: 1, roots, index, indirectBuffer: null }, geometry);
    }

    get cost() {
        return this.#three.cost;
    }
}

export async function bake(geometry, options = {}) {
    const { seconds, work, seed, references } = checked(options);
    await ready();
    const { corners, ids } = triangles(geometry);
    const follow = options.onProgress && follower(options.onProgress);
    return new Tree(Searched.bake(corners, seconds, work, seed, references, follow), ids);
}

export async function bakeInWorker(geometry, options = {}) {
    const limits = checked(options);
    const { onProgress, signal } = options;
    await ready();
    const { corners, ids } = triangles(geometry);
    signal?.throwIfAborted();
    const worker = startWorker();
    try {
        const bytes = await new Promise((resolve, reject) => {
            const follow = onProgress && follower(onProgress);
            worker.hear((said) => {
                if (said.bytes) resolve(said.bytes);
                else if (said.error) reject(new Error(said.error));
                else follow(said.fraction, said.cost);
            });
            worker.fail(reject);
            signal?.addEventListener('abort', () => reject(signal.reason), { once: true });
            worker.post({ ...limits, follows: Boolean(onProgress), corners: corners.slice() });
        });
        return new Tree(Searched.load(corners, bytes), ids);
    } finally {
        worker.end();
    }
}

export async function costOf(meshBVH) {
    await ready();
    const { roots, indirectBuffer } = MeshBVH.serialize(meshBVH, { cloneBuffers: false });
    if (roots.length !== 1) throw new Error(`the tree has ${roots.length} roots; accepted: one`);
    const count = indirectBuffer?.length ?? triangleCount(meshBVH.geometry);
    return costOfRoot(new Uint8Array(roots[0]), count);
}

/** Reports as objects; a cost is known only after an improvement. */
function follower(onProgress) {
    return (fraction, cost) => onProgress(Number.isNaN(cost) ? { fraction } : { fraction, cost });
}

function checked({ seconds, work, seed = 1, references = 1 }) {
    if (seconds === undefined && work === undefined) seconds = 1;
    const check = (name, value, accepted, isAccepted) => {
        if (value !== undefined && !(typeof value === 'number' && isAccepted(value))) {
            throw new RangeError(`${name} is ${value}; accepted: ${accepted}`);
        }
    };
    check('seconds', seconds, 'a number above 0', (value) => value > 0);
    check('work', work, 'a whole number above 0', (value) => value > 0 && Number.isSafeInteger(value));
    check('seed', seed, 'a whole number from 0 on', (value) => value >= 0 && Number.isSafeInteger(value));
    check('references', references, 'a number from 1 to 16', (value) => value >= 1 && value <= 16);
    return { seconds, work, seed, references };
}

function triangleCount(geometry) {
    return Math.floor((geometry.index ?? geometry.attributes.position).count / 3);
}

/**
 * The corners of the triangles that three-mesh-bvh would trace, and their ids; the ids are null
 * where it would trace all of them.
 */
function triangles(geometry) {
    const { index, groups, drawRange, attributes: { position } } = geometry;
    if (!position) throw new Error('the geometry has no position');
    const count = triangleCount(geometry);
    const isDrawn = (start, end) => {
        const first = Math.max(start, drawRange.start);
        const last = Math.min(end, drawRange.start + drawRange.count);
        return [Math.floor(first / 3), Math.min(count, Math.floor(last / 3))];
    };
    const ranges = groups.length > 0
        ? groups.map((group) => isDrawn(group.start, group.start + group.count))
        : [isDrawn(0, 3 * count)];
    const drawn = new Uint8Array(count);
    for (const [first, last] of ranges) drawn.fill(1, first, Math.max(first, last));
    let all = 0;
    for (const one of drawn) all += one;
    const ids = all === count ? null : new Uint32Array(all);
    const corners = new Float32Array(9 * all);
    for (let triangle = 0, to = 0; triangle < count; triangle++) {
        if (!drawn[triangle]) continue;
        if (ids) ids[to] = triangle;
        for (let corner = 0; corner < 3; corner++) {
            const vertex = index ? index.getX(3 * triangle + corner) : 3 * triangle + corner;
            const at = 9 * to + 3 * corner;
            corners[at] = position.getX(vertex);
            corners[at + 1] = position.getY(vertex);
            corners[at + 2] = position.getZ(vertex);
        }
        to++;
    }
    return { corners, ids };
}
