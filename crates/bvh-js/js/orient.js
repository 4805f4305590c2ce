// Turns the geometry of a mesh to other axes, and the mesh back.
import { BufferAttribute, Group, Matrix4, ObjectSpaceNormalMap, Quaternion } from 'three';

/** Rejects what would look different after the turn. */
export function checkMesh(mesh) {
    if (!mesh?.isMesh) {
        const kind = mesh?.type ? `a ${mesh.type}` : String(mesh);
        throw new TypeError(`mesh is ${kind}; accepted: a Mesh`);
    }
    const { geometry, material, scale } = mesh;
    for (const [kind, places] of [['SkinnedMesh', 'bones'], ['InstancedMesh', 'matrices'], ['BatchedMesh', 'matrices']]) {
        if (mesh[`is${kind}`]) {
            throw new TypeError(`mesh is of type ${kind}, whose ${places} place its vertices; accepted: a Mesh without them`);
        }
    }
    if (geometry.isInstancedBufferGeometry) {
        throw new TypeError('the geometry is an InstancedBufferGeometry, whose shader places its vertices; '
            + 'accepted: a BufferGeometry');
    }
    if (geometry.boundsTree) {
        throw new Error('the geometry has a boundsTree, whose boxes do not turn; accepted: a geometry without one yet');
    }
    if ([material].flat().some((one) => one?.normalMap && one.normalMapType === ObjectSpaceNormalMap)) {
        throw new Error('the material has a normal map in the axes of the geometry; accepted: one in tangent space');
    }
    if (mesh.pivot) throw new Error('the mesh has a pivot; accepted: a mesh that turns about its position');
    if (mesh.matrixAutoUpdate && !isUniform(scale)) {
        throw new Error(`mesh.scale is ${scale.toArray().join(', ')}; accepted: the same factor along all axes, or `
            + 'matrixAutoUpdate = false, for a matrix that is no longer of a position, a quaternion and a scale');
    }
    let root = mesh;
    while (root.parent) root = root.parent;
    root.traverse((other) => {
        if (other !== mesh && other.geometry === geometry) {
            throw new Error(`the geometry is also that of another object of the scene, "${other.name}"; `
                + 'accepted: a geometry of the mesh alone, such as its clone()');
        }
    });
}

/** Whether the factors differ by signs alone, up to a unit in the last place of single precision. */
function isUniform({ x, y, z }) {
    const sizes = [x, y, z].map(Math.abs);
    return Math.max(...sizes) - Math.min(...sizes) <= 2 ** -23 * Math.max(...sizes);
}

/**
 * Turns the geometry by `found`, nine numbers of a rotation, row by row, and the gain; and the mesh
 * back. Does nothing if there is nothing found.
 */
export function turn(mesh, found) {
    checkMesh(mesh);
    if (found.length === 0) return { turned: false, gain: 0 };
    const [xx, xy, xz, yx, yy, yz, zx, zy, zz, gain] = found;
    const rotation = new Matrix4().set(xx, xy, xz, 0, yx, yy, yz, 0, zx, zy, zz, 0, 0, 0, 0, 1);
    turnGeometry(mesh.geometry, rotation);
    const inverse = rotation.clone().transpose();
    if (isComposed(mesh) && isUniform(mesh.scale)) {
        // Behind a mirror, the rotation is the mirrored one.
        const mirror = new Matrix4().makeScale(...mesh.scale.toArray().map((factor) => (factor < 0 ? -1 : 1)));
        const mirrored = mirror.clone().multiply(inverse).multiply(mirror);
        mesh.quaternion.multiply(new Quaternion().setFromRotationMatrix(mirrored));
        mesh.updateMatrix();
    } else {
        mesh.matrix.multiply(inverse);
    }
    // Rays that are cast before the next frame need it.
    mesh.matrixWorld.multiply(inverse);
    mesh.matrixWorldNeedsUpdate = true;
    if (mesh.children.length > 0) {
        // Children, and clips that move them, stay in the old axes.
        const group = new Group();
        group.quaternion.setFromRotationMatrix(rotation);
        group.add(...mesh.children);
        mesh.add(group);
        group.updateMatrix();
        group.matrixWorld.multiplyMatrices(mesh.matrixWorld, group.matrix);
    }
    return { turned: true, gain };
}

/** Whether the matrix is, or will be, that of the position, the quaternion and the scale. */
function isComposed({ matrixAutoUpdate, matrix, position, quaternion, scale }) {
    return matrixAutoUpdate || matrix.equals(new Matrix4().compose(position, quaternion, scale));
}

function turnGeometry(geometry, rotation) {
    // A geometry of parameters would be saved as these, unturned.
    geometry.type = 'BufferGeometry';
    delete geometry.parameters;
    for (const name of ['position', 'normal', 'tangent']) {
        const attribute = geometry.attributes[name];
        if (attribute) geometry.setAttribute(name, turnedAttribute(attribute, rotation));
    }
    if (geometry.boundingBox) geometry.computeBoundingBox();
    if (geometry.boundingSphere) geometry.computeBoundingSphere();
}

/** A new attribute of single precision, because another geometry may have the old one. */
function turnedAttribute(attribute, { elements: [xx, yx, zx, , xy, yy, zy, , xz, yz, zz] }) {
    const { count, itemSize, name } = attribute;
    const array = new Float32Array(itemSize * count);
    for (let vertex = 0; vertex < count; vertex++) {
        const to = itemSize * vertex;
        const x = attribute.getX(vertex);
        const y = attribute.getY(vertex);
        const z = attribute.getZ(vertex);
        array[to] = xx * x + xy * y + xz * z;
        array[to + 1] = yx * x + yy * y + yz * z;
        array[to + 2] = zx * x + zy * y + zz * z;
        // Of a tangent, its handedness.
        if (itemSize > 3) array[to + 3] = attribute.getW(vertex);
    }
    const turned = new BufferAttribute(array, itemSize);
    turned.name = name;
    return turned.setUsage((attribute.data ?? attribute).usage);
}
