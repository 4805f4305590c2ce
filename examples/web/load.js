// Models that are dropped, as one geometry of positions.
import { Matrix4 } from 'three';
import { DRACOLoader } from 'three/addons/loaders/DRACOLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';
import { STLLoader } from 'three/addons/loaders/STLLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { merge, positions } from './scenes.js';

async function gltf(bytes) {
    const draco = new DRACOLoader().setDecoderPath('./node_modules/three/examples/jsm/libs/draco/gltf/');
    const loader = new GLTFLoader().setDRACOLoader(draco).setMeshoptDecoder(MeshoptDecoder);
    try {
        return (await loader.parseAsync(bytes, '')).scene;
    } finally {
        draco.dispose();
    }
}

const text = (bytes) => new TextDecoder().decode(bytes);
const loaders = {
    glb: gltf,
    gltf,
    obj: (bytes) => new OBJLoader().parse(text(bytes)),
    ply: (bytes) => new PLYLoader().parse(bytes),
    stl: (bytes) => new STLLoader().parse(bytes),
};

/** Reads a file, by the end of its name. */
export async function loadModel(file) {
    const kind = file.name.split('.').pop().toLowerCase();
    const read = loaders[kind];
    if (!read) throw new Error(`${file.name} ends in .${kind}; accepted: .${Object.keys(loaders).join(', .')}`);
    const model = await read(await file.arrayBuffer());
    const parts = model.isBufferGeometry ? [positions(model)] : meshes(model);
    if (parts.length === 0) throw new Error(`${file.name} has no triangles`);
    return merge(parts);
}

/** All meshes below an object, each copy of an instanced one, in the object's coordinates. */
function meshes(model) {
    const parts = [];
    model.updateMatrixWorld(true);
    model.traverse((mesh) => {
        if (!mesh.isMesh) return;
        const copies = mesh.isInstancedMesh ? mesh.count : 1;
        for (let copy = 0; copy < copies; copy++) {
            const place = new Matrix4();
            if (mesh.isInstancedMesh) mesh.getMatrixAt(copy, place);
            parts.push(positions(mesh.geometry).applyMatrix4(place.premultiply(mesh.matrixWorld)));
        }
    });
    return parts;
}
