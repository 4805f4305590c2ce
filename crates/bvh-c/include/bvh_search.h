// C interface of bvh-search, generated from crates/bvh-c/src. See the README.

#ifndef BVH_SEARCH_H
#define BVH_SEARCH_H

#include <stddef.h>
#include <stdint.h>

#define BVS_VERSION_MAJOR 0
#define BVS_VERSION_MINOR 1
#define BVS_VERSION_PATCH 0

// The outcome of a call.
typedef enum {
    // The call succeeded.
    BVS_STATUS_OK = 0,
    // An argument or the contents of a file are invalid. The call changed nothing.
    BVS_STATUS_INVALID = 1,
    // A file could not be read or written.
    BVS_STATUS_FILE = 2,
    // The library has a fault. Please report it.
    BVS_STATUS_FAULT = 3,
} BvsStatus;

// A kind of cost. Tree files use the same numbers.
typedef enum {
    // The total half area of the inner nodes' boxes.
    BVS_COST_INTERNAL_AREA = 0,
    // The cost of Goldsmith and Salmon.
    BVS_COST_GOLDSMITH_SALMON = 1,
    // The surface area heuristic with both constants 1, relative to the root's box: in a frame
    // that makes this box smaller it may rise, although the area falls.
    BVS_COST_SAH = 2,
    // The cost of the layout that `bvs_tracer_new` makes.
    BVS_COST_LAYOUT = 3,
} BvsCost;

// The side from which a ray comes to a triangle.
typedef enum {
    // Either side. A ray in the plane of a triangle never hits it, whatever the orientation.
    BVS_ORIENTATION_ANY = 0,
    // Along the normal, on whose side the corners run counterclockwise: the ray leaves a solid.
    // Each crossing of the surface counts once, as in `bvs_tracer_all_hits`: a ray that touches an
    // edge or a corner enters as often as it leaves.
    BVS_ORIENTATION_EXITING = 1,
    // Against the normal: the ray enters a solid. Crossings count in the same way.
    BVS_ORIENTATION_ENTERING = 2,
} BvsOrientation;

// A scene of tracers in many places. Any number of threads may trace its rays at the same time. A
// thread that updates or frees it must be the only user.
typedef struct BvsInstances BvsInstances;

// Triangles in the wide layout. Any number of threads may trace rays at the same time. A thread
// that updates or frees a tracer must be the only user.
typedef struct BvsTracer BvsTracer;

// Triangles in f64 in the wide layout. Any number of threads may trace rays at the same time. A
// thread that frees a tracer must be the only user.
typedef struct BvsTracerF64 BvsTracerF64;

// A tree with its objects. Any number of threads may read a tree at the same time. A thread that
// improves, updates or frees it must be the only user.
typedef struct BvsTree BvsTree;

// Boxes, or triangles between vertices. One of `boxes`, `vertices` and `vertices_f64` is given;
// other fields that are 0 or null have their defaults. Coordinates are finite numbers.
typedef struct {
    // The number of boxes or triangles. 0 is an empty scene, also where arrays are given: calls
    // succeed, and the tree is empty.
    size_t count;
    // 6 floats for each of `count` boxes: the lower corner, then the upper corner.
    const float *boxes;
    // 3 floats for each vertex.
    const float *vertices;
    // 3 doubles for each vertex, at most 2^120 in size; below 2^-150 they count as 0. Trees over
    // them are traced by `bvs_tracer_f64_new`. Their boxes lie in a frame with its centre in the
    // middle.
    const double *vertices_f64;
    // The number of vertices; without `indices` 0 is 3 * `count`.
    size_t vertex_count;
    // The bytes from a vertex to the next one, a multiple of 4, or of 8 for doubles; 0 is 12 or 24.
    size_t vertex_stride;
    // The 3 vertices of each of `count` triangles, counted from 0; null for 0, 1, 2, then 3, 4, 5,
    // and so on.
    const uint32_t *indices;
    // The bytes from a triangle's indices to the next one's, a multiple of 4; 0 is 12.
    size_t index_stride;
} BvsObjects;

// A search with every choice. Fields that are 0 or null have their defaults.
typedef struct {
    // What the tree is over.
    BvsObjects objects;
    // 6 floats for each of `ray_count` recorded rays that the tree is for: its origin, then its
    // hit or a point outside the scene.
    const float *rays;
    // The number of rays; 0 for a tree for random lines.
    size_t ray_count;
    // The average number of parts into which triangles may be divided among leaves, up to 16; 1 is
    // for whole triangles, as triangles that will move should be (see `bvs_tree_update`). 0 is 1
    // with `work` or `seconds`, and chosen without.
    double references;
    // The time of the search in seconds; 0 is no limit. Without `seconds` and `work`, the search
    // chooses its work, its cost and its rays, as Python and the program `bvh` do.
    double seconds;
    // The largest number of nodes created or visited; 0 is no limit. With `work` and without
    // `seconds`, the tree is the same on every machine, and the same as from Python and from the
    // program `bvh`.
    uint64_t work;
    // The seed of the random numbers, which is 1 by default in Python and in the program `bvh`.
    uint64_t seed;
    // 1 lets the boxes of triangles lie in a frame where that saves area, as by default in Python
    // and in the program `bvh`: they are then no boxes for other tracers. The choice takes at most
    // a tenth of the budget. 0 keeps the axes.
    uint32_t frame;
} BvsBake;

// A binary node of 32 bytes with the layout of tinybvh's `BVH::BVHNode`. Node 0 is the root. If
// there are more nodes, node 1 is unused, so that both children of a node share a cache line.
typedef struct {
    // The lower corner of the box.
    float min[3];
    // The index of the first of two adjacent children, or the position of the leaf's first object
    // id.
    uint32_t first;
    // The upper corner of the box.
    float max[3];
    // The number of object ids of a leaf; 0 for an inner node.
    uint32_t count;
} BvsNode;

// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction may have any
// length except 0; `t_min` is 0 or more; `t_max` may be infinite.
typedef struct {
    // The point with t = 0.
    float origin[3];
    // The smallest distance.
    float t_min;
    // The vector from the origin to the point with t = 1.
    float direction[3];
    // The largest distance.
    float t_max;
} BvsRay;

// The nearest triangle that a ray hits; of several at the same distance, the triangle with the
// lowest index. A ray without a hit has infinity and UINT32_MAX.
typedef struct {
    // The distance, in multiples of the direction's length.
    float t;
    // The index of the triangle.
    uint32_t object;
} BvsHit;

// A hit with the surface there. Without a hit, `t` is infinity, `object` is UINT32_MAX, and all
// other numbers are 0.
typedef struct {
    // The distance, in multiples of the direction's length.
    float t;
    // The index of the triangle.
    uint32_t object;
    // The weight of the triangle's second corner.
    float u;
    // The weight of the triangle's third corner.
    float v;
    // The unit vector perpendicular to the triangle, on the side from which its corners run
    // counterclockwise.
    float normal[3];
} BvsSurfaceHit;

// The point of the triangles that is closest to a given point. Without one, `distance` is
// infinity, `object` is UINT32_MAX, and the point is NaN.
typedef struct {
    // The closest point.
    double point[3];
    // Its distance from the given point.
    double distance;
    // The index of the triangle; of several at the same distance, the lowest.
    uint32_t object;
} BvsClosest;

// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction may have any
// length except 0; `t_min` is 0 or more; `t_max` may be infinite. Coordinates are at most 2^120 in
// size, below 2^-150 they count as 0, and the largest component of a direction is from 2^-100 to
// 2^100.
//
// A ray hits a triangle if they meet in real arithmetic at the origin or in front of it, and the
// real distance, rounded once, is from `t_min` to `t_max`. Edges and corners belong to a triangle:
// where triangles share them, a ray hits all.
typedef struct {
    // The point with t = 0.
    double origin[3];
    // The smallest distance.
    double t_min;
    // The vector from the origin to the point with t = 1.
    double direction[3];
    // The largest distance.
    double t_max;
} BvsRayF64;

// Which triangles count.
typedef struct {
    // One of `BvsOrientation`.
    uint32_t orientation;
    // The number of ids in `excluded` for each ray.
    uint32_t excluded_count;
    // The indices of triangles that do not count, `excluded_count` for each ray. Those that no
    // triangle has, such as UINT32_MAX, are ignored.
    //
    // A particle that flies on in its direction keeps its origin: `t_min` becomes the distance of
    // the last hit, and all triangles met at this distance are excluded, not only the last, because
    // an edge has several. A ray from the hit point, which is rounded, may miss the next triangle.
    const uint32_t *excluded;
} BvsSelect;

// The nearest triangle that a ray hits, as in `BvsHit`. The distance is the real one, rounded
// once.
typedef struct {
    // The distance, in multiples of the direction's length.
    double t;
    // The index of the triangle.
    uint32_t object;
} BvsHitF64;

// A transformed copy of a part.
typedef struct {
    // The index of the part.
    uint32_t part;
    // The transform from the part's coordinates to the scene's, which has an inverse: three rows
    // of four numbers, the last of which is the translation, as in Vulkan, DirectX and OptiX.
    float transform[12];
} BvsInstance;

// The nearest hit of a ray among instances; of several at the same distance, the lowest instance.
// A ray without a hit has infinity and UINT32_MAX twice.
typedef struct {
    // The distance, in multiples of the direction's length.
    float t;
    // The index of the instance.
    uint32_t instance;
    // The index of the triangle in the instance's part.
    uint32_t triangle;
} BvsInstanceHit;

// Directions that many points look along, and what each is worth.
typedef struct {
    // 3 doubles for each direction, of any length except 0. A `BvsTracer` rounds them to floats.
    const double *directions;
    // The number of directions.
    size_t count;
    // The smallest distance, in multiples of a direction's length: 0 or more. A `BvsTracer` rounds
    // both distances to floats.
    double t_min;
    // The largest distance; 0 is no limit.
    double t_max;
    // `columns` doubles for each direction. Null makes every direction weigh 1, in one column.
    const double *weights;
    // The number of weights of each direction.
    size_t columns;
    // 1 if a weight counts by the cosine of the angle between its direction and the normal, 0 if
    // it counts whole.
    int32_t cosine;
} BvsSky;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the version of the library, such as "1.2.3". The version of the header is
// `BVS_VERSION_MAJOR`, `BVS_VERSION_MINOR` and `BVS_VERSION_PATCH`.
const char *bvs_version(void);

// Returns the message of the last failed call of this thread, or an empty string if none has
// failed. The string is valid until another call of this thread fails. Ask after the call that
// failed, in another statement: `printf("%d %s", f(), bvs_last_error())` may ask before.
const char *bvs_last_error(void);

// Searches for the best tree over `count` boxes for about `seconds`, 0 or more. Each box is 6
// floats: the lower corner, then the upper corner.
//
// `boxes` points to 6 * `count` floats.
BvsTree *bvs_tree_from_boxes(const float *boxes, size_t count, double seconds);

// Searches for the best tree over `count` triangles for about `seconds`, 0 or more. Each triangle
// is 9 floats: three vertices. With `references` above 1, up to 16, triangles may be divided among
// leaves, on average into that many parts each.
//
// `vertices` points to 9 * `count` floats.
BvsTree *bvs_tree_from_triangles(const float *vertices, size_t count, double seconds, double references);

// Searches for the best tree with these choices. Searches and other work on large trees run on as
// many threads as the environment variable RAYON_NUM_THREADS says when the first begins, by default
// on all processors. Calls that trace rays or look up points run on the thread that calls: several
// threads may pass parts of an array each.
//
// `bake` is a search whose arrays have the promised lengths.
BvsTree *bvs_tree_bake(const BvsBake *bake);

// Improves a tree for about `seconds`, 0 or more. Arrays from `bvs_tree_nodes` and
// `bvs_tree_object_ids` become invalid.
//
// `tree` is a tree that no other thread uses.
BvsStatus bvs_tree_improve(BvsTree *tree, double seconds);

// Improves a tree like `bvs_tree_improve`, and ends soon after `cancelled(context)` returns a
// number other than 0. The tree is then the best one so far, and the call succeeds. To cancel a
// search from its beginning, create the tree in 0 seconds first.
//
// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws no
// exception and that any number of threads may call at the same time until this call returns.
BvsStatus bvs_tree_improve_until(BvsTree *tree, double seconds, uint8_t (*cancelled)(void *context), void *context);

// Moves the objects of the tree: as many boxes or triangles as it has, elsewhere. Boxes become
// tight again round whole objects, and nodes remain. Bake triangles that move with `references` =
// 1: every part of a divided triangle gets the box of the whole, even where nothing has moved, and
// the cost may grow severalfold. The growth of the cost tells when a search is worth its time.
// Arrays from `bvs_tree_nodes` and `bvs_tree_object_ids` become invalid. Tracers do not move.
//
// `tree` is a tree that no other thread uses; `objects` are objects whose arrays have the promised
// lengths.
BvsStatus bvs_tree_update(BvsTree *tree, const BvsObjects *objects);

// Writes the cost of the kind `kind`, one of `BvsCost`, to `cost`.
//
// `tree` is a tree; `cost` points to a double.
BvsStatus bvs_tree_cost(const BvsTree *tree, uint32_t kind, double *cost);

// Writes the frame of the tree's boxes: 9 numbers, the rows of a rotation, then 3, a centre. The
// boxes contain rotation * (p - centre) for the points p of their objects. Without a frame, these
// are the identity and 0.
//
// `tree` is a tree; `frame` points to 12 doubles.
BvsStatus bvs_tree_frame(const BvsTree *tree, double *frame);

// Returns the nodes of the tree, and writes their number to `count`. The nodes belong to the tree
// and are valid until it is improved, updated or freed. Their boxes lie in its frame, if it has
// one: see `bvs_tree_frame`.
//
// `tree` is a tree; `count` points to a size.
const BvsNode *bvs_tree_nodes(const BvsTree *tree, size_t *count);

// Returns the object ids, to which leaves refer by position, and writes their number to `count`.
// The ids belong to the tree and are valid until it is improved, updated or freed.
//
// `tree` is a tree; `count` points to a size.
const uint32_t *bvs_tree_object_ids(const BvsTree *tree, size_t *count);

// Loads the tree over these objects from the file `path`, in UTF-8.
//
// `path` is a string; `objects` are objects whose arrays have the promised lengths.
BvsTree *bvs_tree_load(const char *path, const BvsObjects *objects);

// Loads the tree over these objects from the bytes of a tree file.
//
// `bytes` points to `size` bytes; `objects` are objects whose arrays have the promised lengths.
BvsTree *bvs_tree_from_bytes(const uint8_t *bytes, size_t size, const BvsObjects *objects);

// Returns the bytes of the tree's file, and writes their number to `size`. `bvs_bytes_free` frees
// them.
//
// `tree` is a tree; `size` points to a size.
uint8_t *bvs_tree_to_bytes(const BvsTree *tree, size_t *size);

// Frees the bytes of a tree. Ignores null.
//
// `bytes` is null, or `size` bytes from `bvs_tree_to_bytes`.
void bvs_bytes_free(uint8_t *bytes, size_t size);

// Writes the tree to the file `path`, in UTF-8. An existing file is replaced when the new one is
// complete; a failure leaves the old one.
//
// `tree` is a tree; `path` is a string.
BvsStatus bvs_tree_save(const BvsTree *tree, const char *path);

// Writes the tree to the file `path`, in UTF-8, for the tracer of another library, by its name for
// `bvh export` (docs/use/INTEROP.md). The file is the same as of that command. A query for all hits of
// three-mesh-bvh, of the crate bvh and of a reader of json finds a divided triangle more than once:
// for these, `divided` is 1 if your queries are for the nearest or any hit. 0 rejects such a tree.
//
// `tree` is a tree; `tracer` and `path` are strings.
BvsStatus bvs_tree_export(const BvsTree *tree, const char *tracer, uint32_t divided, const char *path);

// Frees a tree. Ignores null. Tracers of the tree remain valid.
//
// `tree` is null, or a tree that nobody uses any more.
void bvs_tree_free(BvsTree *tree);

// Creates a tracer of a tree over triangles. The tracer is independent of the tree: the tree may
// be freed, and later improvements do not change the tracer.
//
// `tree` is a tree.
BvsTracer *bvs_tracer_new(const BvsTree *tree);

// Moves the triangles of a tracer: as many as it has, elsewhere. Answers are those of a new
// tracer, which takes about twice as long; rays become slower as neighbours part, and at once where
// the tree divides triangles: bake with `references` = 1 what moves. Triangles with an area still
// have one, and others none, or the call fails. Instances of the tracer remain as they are.
//
// `tracer` is a tracer that no other thread uses; `objects` are triangles whose arrays have the
// promised lengths.
BvsStatus bvs_tracer_update(BvsTracer *tracer, const BvsObjects *objects);

// Writes the nearest hit of one ray to `hit`. Dozens of rays at once are faster in
// `bvs_tracer_nearest_hits`.
//
// `tracer` is a tracer; `ray` points to a ray, and `hit` to a hit.
BvsStatus bvs_nearest(const BvsTracer *tracer, const BvsRay *ray, BvsHit *hit);

// Writes to `hit` whether one ray hits any triangle: 1 or 0. Dozens of rays at once are faster in
// `bvs_tracer_any_hits`.
//
// `tracer` is a tracer; `ray` points to a ray, and `hit` to a byte.
BvsStatus bvs_any(const BvsTracer *tracer, const BvsRay *ray, uint8_t *hit);

// Writes the nearest hits of `count` rays to `hits`. Set `coherent` to 1 if consecutive rays begin
// close to each other and have similar directions, and to 0 otherwise. It changes the speed and no
// answer.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvsStatus bvs_tracer_nearest_hits(const BvsTracer *tracer, const BvsRay *rays, size_t count, int32_t coherent, BvsHit *hits);

// Writes to `hits` whether each of `count` rays hits any triangle: 1 or 0. `coherent` has the
// meaning that it has in `bvs_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvsStatus bvs_tracer_any_hits(const BvsTracer *tracer, const BvsRay *rays, size_t count, int32_t coherent, uint8_t *hits);

// Writes the nearest hits of `count` rays with the surfaces there to `hits`. `coherent` has the
// meaning that it has in `bvs_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvsStatus bvs_tracer_surface_hits(const BvsTracer *tracer, const BvsRay *rays, size_t count, int32_t coherent, BvsSurfaceHit *hits);

// Writes all crossings of `count` rays to `hits`, ray after ray and the nearest first, the number
// of each ray's hits to `counts`, and the number of all hits to `total`. Hits at the same distance
// are in the order of their triangles. Each crossing of the surface counts once, although
// triangles share edges and corners: a ray that touches one counts there as a ray beside it would,
// which may hit another of these triangles than `bvs_nearest` returns, or none. Only the first
// `capacity` hits are written; if `total` is greater, call again with room for them.
//
// `tracer` is a tracer; `rays` and `counts` point to `count` elements each, `hits` points to
// `capacity` elements, and `total` points to a size.
BvsStatus bvs_tracer_all_hits(const BvsTracer *tracer, const BvsRay *rays, size_t count, BvsHit *hits, size_t capacity, uint32_t *counts, size_t *total);

// Writes the closest points of the triangles to `count` points, 3 floats each. Triangles without
// area do not count.
//
// `tracer` is a tracer; `points` points to 3 * `count` floats, and `closest` to `count` elements.
BvsStatus bvs_tracer_closest_points(const BvsTracer *tracer, const float *points, size_t count, BvsClosest *closest);

// Writes to `inside` whether each of `count` points, 3 floats each, is inside of the mesh: 1 or 0.
// A mesh with holes has an inside, too: there the generalised winding number decides, at a hundred
// times the cost, and near an open terrain, where it is nearly one half everywhere, at the cost of
// most triangles. A point on the surface of a mesh without holes counts as one a little below it in
// x, far less above it in y, and again less in z: where meshes share faces, it is in one of them.
// On other surfaces it may count as either. The first call for a tracer examines all edges.
//
// `tracer` is a tracer; `points` points to 3 * `count` floats, and `inside` to `count` bytes.
BvsStatus bvs_tracer_contains(const BvsTracer *tracer, const float *points, size_t count, uint8_t *inside);

// Frees a tracer. Ignores null.
//
// `tracer` is null, or a tracer that nobody uses any more.
void bvs_tracer_free(BvsTracer *tracer);

// Creates a tracer of a tree over triangles in f64. The tracer is independent of the tree.
//
// `tree` is a tree.
BvsTracerF64 *bvs_tracer_f64_new(const BvsTree *tree);

// Writes the nearest hit of one ray to `hit`. Dozens of rays at once are faster in
// `bvs_tracer_nearest_hits_f64`.
//
// `tracer` is a tracer; `ray` points to a ray, and `hit` to a hit; `select` is null, or what
// counts.
BvsStatus bvs_nearest_f64(const BvsTracerF64 *tracer, const BvsRayF64 *ray, const BvsSelect *select, BvsHitF64 *hit);

// Writes to `hit` whether one ray hits any triangle that counts: 1 or 0. Dozens of rays at once
// are faster in `bvs_tracer_any_hits_f64`.
//
// `tracer` is a tracer; `ray` points to a ray, and `hit` to a byte; `select` is null, or what
// counts.
BvsStatus bvs_any_f64(const BvsTracerF64 *tracer, const BvsRayF64 *ray, const BvsSelect *select, uint8_t *hit);

// Writes the nearest hits of `count` rays to `hits`. A ray begins `ray_stride` bytes after the one
// before, and a hit `hit_stride` bytes: multiples of 8; 0 is right behind it. `coherent` has the
// meaning that it has in `bvs_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, which do not overlap;
// `select` is null, or what counts.
BvsStatus bvs_tracer_nearest_hits_f64(const BvsTracerF64 *tracer, const BvsRayF64 *rays, size_t ray_stride, size_t count, int32_t coherent, const BvsSelect *select, BvsHitF64 *hits, size_t hit_stride);

// Writes to `hits` whether each of `count` rays hits any triangle that counts: 1 or 0. Strides are
// those of `bvs_tracer_nearest_hits_f64`; that of `hits` is any number of bytes.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, which do not overlap;
// `select` is null, or what counts.
BvsStatus bvs_tracer_any_hits_f64(const BvsTracerF64 *tracer, const BvsRayF64 *rays, size_t ray_stride, size_t count, int32_t coherent, const BvsSelect *select, uint8_t *hits, size_t hit_stride);

// Writes the closest points of the triangles to `count` points, 3 doubles each, as
// `bvs_tracer_closest_points` does.
//
// `tracer` is a tracer; `points` points to 3 * `count` doubles, and `closest` to `count` elements.
BvsStatus bvs_tracer_closest_points_f64(const BvsTracerF64 *tracer, const double *points, size_t count, BvsClosest *closest);

// Writes to `inside` whether each of `count` points, 3 doubles each, is inside of the mesh: 1 or 0,
// as `bvs_tracer_contains` does.
//
// `tracer` is a tracer; `points` points to 3 * `count` doubles, and `inside` to `count` bytes.
BvsStatus bvs_tracer_contains_f64(const BvsTracerF64 *tracer, const double *points, size_t count, uint8_t *inside);

// Frees a tracer. Ignores null.
//
// `tracer` is null, or a tracer that nobody uses any more.
void bvs_tracer_f64_free(BvsTracerF64 *tracer);

// Creates a scene of `count` instances of `part_count` tracers, the parts. Searches for the best
// tree over the instances for about `seconds`, 0 or more. The parts are shared, not copied; their
// tracers may be freed.
//
// `parts` points to `part_count` tracers, and `instances` to `count` elements.
BvsInstances *bvs_instances_new(const BvsTracer *const *parts, size_t part_count, const BvsInstance *instances, size_t count, double seconds);

// Moves all instances, as many as there are, to other transforms. Their tree keeps its nodes; once
// the instances are far from where they were, a new scene of the same tracers makes rays faster.
//
// `scene` is a scene that no other thread uses; `instances` points to `count` elements.
BvsStatus bvs_instances_update(BvsInstances *scene, const BvsInstance *instances, size_t count);

// Writes the nearest hits of `count` rays to `hits`.
//
// `scene` is a scene; `rays` and `hits` point to `count` elements each, and do not overlap.
BvsStatus bvs_instances_nearest_hits(const BvsInstances *scene, const BvsRay *rays, size_t count, BvsInstanceHit *hits);

// Writes to `hits` whether each of `count` rays hits any instance: 1 or 0.
//
// `scene` is a scene; `rays` and `hits` point to `count` elements each, and do not overlap.
BvsStatus bvs_instances_any_hits(const BvsInstances *scene, const BvsRay *rays, size_t count, uint8_t *hits);

// Frees a scene of instances. Ignores null.
//
// `scene` is null, or a scene that nobody uses any more.
void bvs_instances_free(BvsInstances *scene);

// Writes what each of `count` points, 3 floats each, sees of a sky. A direction is free from a
// point if a ray along it hits nothing, as `bvs_any` says.
//
// `bits`, unless it is null, gets the directions themselves: (`sky.count` + 63) / 64 words for each
// point, in which direction j is free if bit j % 64 of word j / 64 is set. `sums`, unless it is
// null, gets the sums of the free directions' weights: `sky.columns` doubles for each point, or
// one without weights.
//
// `normals` are null, or 3 floats for each point: then directions d count as free only above the
// surface, where the dot product of normal and d is greater than 0.
//
// `tracer` is a tracer; `sky` points to a sky whose arrays have the promised lengths; `points` and
// `normals` point to 3 * `count` floats, unless `normals` is null; `bits` and `sums` point to as
// many elements as they get.
BvsStatus bvs_tracer_visible(const BvsTracer *tracer, const BvsSky *sky, const float *points, const float *normals, size_t count, uint64_t *bits, double *sums);

// Writes what each of `count` points, 3 doubles each, sees of a sky, as `bvs_tracer_visible` does.
//
// `tracer` is a tracer; `sky` points to a sky whose arrays have the promised lengths; `points` and
// `normals` point to 3 * `count` doubles, unless `normals` is null; `bits` and `sums` point to as
// many elements as they get.
BvsStatus bvs_tracer_visible_f64(const BvsTracerF64 *tracer, const BvsSky *sky, const double *points, const double *normals, size_t count, uint64_t *bits, double *sums);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* BVH_SEARCH_H */
