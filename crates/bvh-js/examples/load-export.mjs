// Loads a file of `bvh export FILE.bvh SCENE --for three-mesh-bvh --out FILE.bin`; needs three-mesh-bvh alone.
import { MeshBVH } from 'three-mesh-bvh';

export function loadExport(buffer, geometry) {
    const [magic, version, nodes, ids] = new Uint32Array(buffer, 0, 4);
    if (magic !== 0x58485642 || version !== 1) throw new Error('no file of bvh export');
    if (ids < geometry.index.count / 3) throw new Error('the file is of another geometry');
    const roots = [buffer.slice(32, 32 + 32 * nodes)];
    const indirectBuffer = new Uint32Array(buffer, 32 + 32 * nodes, ids);
    return MeshBVH.deserialize({ version: 1, roots, index: null, indirectBuffer }, geometry, { setIndex: false });
}
