import type { BufferGeometry, Intersection, Material, Mesh, Ray, Side } from 'three';
import type { MeshBVH } from 'three-mesh-bvh';

export interface BakeOptions {
    /**
     * How long to search, in seconds. With `work`, the first that is spent ends the search; with neither, the bake chooses
     * its work by the number of triangles, as `bvh bake --for three-mesh-bvh` does: a fifth of a second for a thousand,
     * about ten seconds for fifty thousand.
     */
    seconds?: number | undefined;
    /**
     * How much to search, in nodes visited: the same tree on every machine, that of `bvh bake --for three-mesh-bvh --budget
     * 50Mwork` or the greedy one.
     */
    work?: number | undefined;
    /** Seed of the random numbers. */
    seed?: number | undefined;
    /**
     * Up to so many leaves per triangle on average, 1 to 16; 1 keeps triangles whole. In buildings, 1.3 makes the first
     * hits of rays much cheaper. `raycast` finds a divided triangle once, but `shapecast`, and `raycast` of a tree that
     * three-mesh-bvh has serialised, meet it once for each part. `MeshBVHUniformStruct` loses parts: for shaders, keep
     * triangles whole.
     */
    references?: number | undefined;
    /**
     * Called about twenty times a second with the part of the budget that is spent, after improvements with about the
     * `cost` that the tree would have, and at the end with 1 and its cost. An exception ends the search, and `bake` and
     * `bakeInWorker` reject with it.
     */
    onProgress?: (progress: { fraction: number; cost?: number }) => void;
}

/** A searched tree over the triangles of a geometry. It takes about 150 bytes of JavaScript's memory per triangle. */
export class Tree {
    /** Trees come from `bake`, `bakeInWorker` and `load`. */
    private constructor();
    /**
     * Reads a tree that was saved for this very geometry, of which `toMeshBVH` may have reordered the index since, but no
     * `new MeshBVH`; rejects damaged bytes and other geometries.
     *
     * @example
     * const bytes = await (await fetch('model.bvh')).arrayBuffer(); // of tree.save()
     * mesh.geometry.boundsTree = (await Tree.load(bytes, mesh.geometry)).toMeshBVH(mesh.geometry);
     */
    static load(bytes: ArrayBufferLike | ArrayBufferView, geometry: BufferGeometry): Promise<Tree>;
    /** The tree as a file, which the program `bvh` and the interfaces of other languages read. */
    save(): Uint8Array;
    /**
     * The tree as a `MeshBVH`, for `geometry.boundsTree`, `raycastFirst` and whatever takes one. Throws if the geometry,
     * or its draw range, is another one than when the tree was baked or saved.
     *
     * Puts the triangles of the geometry's index into the order of the tree, as `new MeshBVH` does. With `indirect`, the
     * index stays as it is and rays are a little slower. This is the default for geometries with groups or a draw range,
     * for divided triangles, and for an index that another tree has reordered, so that both trees stay right.
     */
    toMeshBVH(geometry: BufferGeometry, options?: { indirect?: boolean }): MeshBVH;
    /** The expected cost of a ray, in tests of a triangle weighed as three-mesh-bvh does; see `costOf`. */
    readonly cost: number;
    /** Drops the tree's memory at once; each `MeshBVH` has its own. Other calls then throw. */
    dispose(): void;
}

/**
 * Searches the best tree of a geometry in this thread. Where rays would take more tests in it than in a greedy tree, as in
 * some smooth meshes, gives the greedy tree; this is counted where it takes at most a quarter of `seconds`, without them at
 * most a second. The tree has the triangles of the draw range, also those in gaps between groups, which three.js draws with
 * a single material only.
 *
 * The greedy tree that a search begins with takes a second for a million triangles, whatever `seconds` is. The memory of
 * this thread's WebAssembly stays, 0.4 to 0.7 kB per triangle of the largest mesh, 1.5 with `references`; that of
 * `bakeInWorker` goes back.
 *
 * Rejects a geometry without triangles, with an index beyond its vertices (`RangeError`), with coordinates that are not
 * finite (`RangeError`), with morph targets or skin weights, and anything else than a geometry (`TypeError`).
 *
 * @example
 * const tree = await bake(mesh.geometry, { seconds: 5, onProgress: ({ fraction }) => { bar.value = fraction; } });
 * mesh.geometry.boundsTree = tree.toMeshBVH(mesh.geometry);
 */
export function bake(geometry: BufferGeometry, options?: BakeOptions & { orient?: false }): Promise<Tree>;

/** Turns the mesh as `orient` does, which `seconds` and `work` do not count, and searches the best tree of its geometry. */
export function bake(mesh: Mesh, options: BakeOptions & { orient: true }): Promise<Tree>;

/**
 * Searches as `bake` does in a worker, so that the page stays alive. `signal` ends it; after `orient`, the mesh stays turned.
 *
 * @example
 * const stop = new AbortController(); // stop.abort() ends the search, and the promise rejects
 * const tree = await bakeInWorker(mesh.geometry, { seconds: 30, signal: stop.signal });
 */
export function bakeInWorker(
    geometry: BufferGeometry, options?: BakeOptions & { orient?: false; signal?: AbortSignal },
): Promise<Tree>;
export function bakeInWorker(mesh: Mesh, options: BakeOptions & { orient: true; signal?: AbortSignal }): Promise<Tree>;

/**
 * Turns the geometry of a mesh to axes along which its boxes are small, and the mesh back. The world stays the same, but
 * for the turned vertices, which are rounded once, by up to half a unit in the last place. `gain` is the fraction of area
 * that a tree saves, in a sample of the triangles. Where no other axes certainly save some, `turned` is false, `gain` is 0,
 * and nothing changes. The same on every machine; takes a second or two.
 *
 * Changes the geometry: `position`, `normal` and `tangent` are new attributes of single precision, its
 * `parameters` go, and its `type` is `BufferGeometry`. Clone it first if meshes beyond the scene have it, too. Vectors in other attributes do not turn, and neither
 * do the coordinates that a shader of your own reads. Changes `quaternion`, or `matrix` alone if that is not of `position`,
 * `quaternion` and `scale`, and moves the children into a `Group`, so that they stay where they are, also in animations. To
 * animate the mesh itself, put it into a group, and animate that.
 *
 * Rejects what would look different or fall behind: `SkinnedMesh`, `InstancedMesh`, `BatchedMesh` and anything else than a
 * mesh (`TypeError`); an `InstancedBufferGeometry`, a `pivot`; a geometry with a `boundsTree` or of two objects of the scene; a normal map in the geometry's axes; a
 * scale that is not the same along all axes, up to signs, unless `matrixAutoUpdate` is false; and the geometries that
 * `bake` rejects.
 *
 * @example
 * const { turned, gain } = await orient(mesh); // then new MeshBVH(mesh.geometry), or bake(mesh.geometry)
 */
export function orient(mesh: Mesh): Promise<{ turned: boolean; gain: number }>;

/** The cost of a ray in any `MeshBVH` with one root, to compare with `Tree.cost`. */
export function costOf(meshBVH: MeshBVH): Promise<number>;

/**
 * Casts a ray by `meshBVH.raycastFirst` or, with `query`, by `meshBVH.raycast`, and counts the boxes of nodes and the
 * triangles that it tests. The counts are the same on every machine, and tell with your own rays which of two trees is
 * the better one.
 *
 * @example
 * const { boxes, triangles } = countTests(tree.toMeshBVH(mesh.geometry), ray); // in the mesh's own coordinates
 */
export function countTests(meshBVH: MeshBVH, ray: Ray, options: CountOptions & { query: 'raycast' }): {
    hit: Intersection[]; boxes: number; triangles: number;
};
export function countTests(meshBVH: MeshBVH, ray: Ray, options?: CountOptions & { query?: 'raycastFirst' }): {
    hit: Intersection | null; boxes: number; triangles: number;
};

/** What `countTests` hands on to `raycastFirst` or `raycast`. */
export interface CountOptions {
    side?: Side | Material | Material[];
    near?: number;
    far?: number;
}
