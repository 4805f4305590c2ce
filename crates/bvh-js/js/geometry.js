// The triangles of a geometry, as three.js draws them.
import { BufferAttribute } from 'three';

/** Of an index that a tree has reordered: where the triangles of that tree's geometry are now. */
export const reordered = new WeakMap();

export function triangleCount(geometry) {
    return Math.floor((geometry.index ?? geometry.attributes.position).count / 3);
}

/** Rejects what a tree over the positions would be wrong for. */
function check(geometry) {
    if (!geometry?.isBufferGeometry) {
        const kind = geometry?.type ? `a ${geometry.type}` : String(geometry);
        const part = geometry?.isBatchedMesh ? ', its geometry in the draw range of one part' : ', such as mesh.geometry';
        throw new TypeError(`geometry is ${kind}; accepted: a BufferGeometry${part}`);
    }
    const { index, attributes, morphAttributes, drawRange, groups } = geometry;
    if (!attributes.position) throw new Error('the geometry has no position');
    const bent = (attributes.skinIndex && 'skin weights') || (morphAttributes.position?.length && 'morph targets');
    if (bent) {
        throw new Error(`the geometry has ${bent}, and its tree would know the pose without them only; accepted: `
            + 'one pose, as StaticGeometryGenerator of three-mesh-bvh makes it, or a copy without them');
    }
    const { count } = index ?? attributes.position;
    const ranges = [['the draw range', drawRange], ...groups.map((group, at) => [`group ${at}`, group])];
    for (const [name, { start, count: length }] of ranges) {
        for (const [verb, corner] of [['begins', start], ['ends', start + length]]) {
            if (corner < count && corner % 3 !== 0) {
                throw new RangeError(`${name} ${verb} at ${corner}; accepted: multiples of 3, the corners of a triangle`);
            }
        }
    }
}

/**
 * The corners of the triangles in the draw range; their ids, undefined for all triangles of the
 * geometry; and, if a tree has reordered the index, the places where its triangles are now.
 */
export function triangles(geometry) {
    check(geometry);
    const { index, drawRange, attributes: { position } } = geometry;
    const all = triangleCount(geometry);
    const first = Math.min(all, Math.max(0, drawRange.start / 3));
    const count = Math.max(0, Math.min(all, Math.floor((drawRange.start + drawRange.count) / 3)) - first);
    if (count === 0) throw new Error('the geometry has no triangles in its draw range; accepted: one or more');
    const corners = new Float32Array(9 * count);
    for (let corner = 0; corner < 3 * count; corner++) {
        const place = 3 * first + corner;
        const vertex = index ? index.getX(place) : place;
        if (!(vertex >= 0 && vertex < position.count)) {
            const accepted = `0 to ${position.count - 1}, the vertices of position`;
            throw new RangeError(`index[${place}] is ${vertex}; accepted: ${accepted}`);
        }
        const to = 3 * corner;
        corners[to] = position.getX(vertex);
        corners[to + 1] = position.getY(vertex);
        corners[to + 2] = position.getZ(vertex);
        // Not a number, too, if one of them is infinite.
        if (!(0 * (corners[to] + corners[to + 1] + corners[to + 2]) === 0)) {
            checkVertex(vertex, corners.subarray(to, to + 3));
        }
    }
    const ids = count === all ? undefined : Uint32Array.from({ length: count }, (_, at) => first + at);
    const places = index && !ids ? reordered.get(index) : undefined;
    return { corners, ids, places: places?.length === count ? places : undefined };
}

function checkVertex(vertex, corner) {
    if (!corner.every(Number.isFinite)) {
        throw new RangeError(`vertex ${vertex} is at ${corner.join(', ')}; accepted: finite numbers of single precision`);
    }
}

/** The corners of the triangles at these places. */
export function restored(places, corners) {
    const moved = new Float32Array(corners.length);
    places.forEach((place, to) => moved.set(corners.subarray(9 * place, 9 * place + 9), 9 * to));
    return moved;
}

/** Puts the triangles of the index into this order, and makes one where there is none. */
export function reorder(geometry, order) {
    const { index, attributes: { position } } = geometry;
    const { count } = position;
    const plain = () => new (count > 65_535 ? Uint32Array : Uint16Array)(count).map((_, vertex) => vertex);
    const to = index?.array ?? plain();
    const from = to.slice();
    order.forEach((id, place) => {
        for (let corner = 0; corner < 3; corner++) to[3 * place + corner] = from[3 * id + corner];
    });
    if (index) index.needsUpdate = true;
    else geometry.setIndex(new BufferAttribute(to, 1));
}

/** A hash of all bits: that of MurmurHash3 with 32 bits. */
export function fingerprint(corners) {
    let hash = corners.length;
    for (const word of new Uint32Array(corners.buffer)) {
        const mixed = Math.imul(word, 0xcc9e2d51);
        hash ^= Math.imul((mixed << 15) | (mixed >>> 17), 0x1b873593);
        hash = (Math.imul((hash << 13) | (hash >>> 19), 5) + 0xe6546b64) | 0;
    }
    return hash;
}
