// C interface of bvh-search, generated from crates/bvh-c/src. See the README.

#ifndef BVH_H
#define BVH_H

#include <stddef.h>
#include <stdint.h>

// The outcome of a call.
typedef enum {
    // The call succeeded.
    BVH_STATUS_OK = 0,
    // An argument or the contents of a file are invalid. The call changed nothing.
    BVH_STATUS_INVALID = 1,
    // A file could not be read or written.
    BVH_STATUS_FILE = 2,
    // The library has a fault. Please report it.
    BVH_STATUS_FAULT = 3,
} BvhStatus;

// A kind of cost. Tree files use the same numbers.
typedef enum {
    // The total half area of the inner nodes' boxes.
    BVH_COST_INTERNAL_AREA = 0,
    // The cost of Goldsmith and Salmon.
    BVH_COST_GOLDSMITH_SALMON = 1,
    // The surface area heuristic with both constants 1.
    BVH_COST_SAH = 2,
    // The cost of the layout that `bvh_tracer_new` makes.
    BVH_COST_LAYOUT = 3,
} BvhCost;

// Triangles in the wide layout. Any number of threads may use a tracer at the same time.
typedef struct BvhTracer BvhTracer;

// A tree with its objects. Any number of threads may read a tree at the same time. A thread that
// improves or frees it must be the only user.
typedef struct BvhTree BvhTree;

// A search with every choice. Fields that are 0 or null have their defaults; either `boxes` or
// `corners` is given.
typedef struct {
    // 6 floats for each of `count` boxes: the lower corner, then the upper corner.
    const float *boxes;
    // 9 floats for each of `count` triangles: three corners.
    const float *corners;
    // The number of boxes or triangles.
    size_t count;
    // 6 floats for each of `ray_count` recorded rays that the tree is for: its origin, then its
    // hit or a point outside the scene.
    const float *rays;
    // The number of rays; 0 for a tree for random lines.
    size_t ray_count;
    // The average number of parts into which triangles may be divided among leaves, up to 16; 0 is
    // 1, for whole triangles.
    double references;
    // The time of the search in seconds, if there is no `work` or if it is not 0.
    double seconds;
    // The largest number of nodes created or visited; 0 is no limit. With `work` and without
    // `seconds`, the tree is the same on every machine, and the same as from Python and from the
    // program `bvh`.
    uint64_t work;
    // The seed of the random numbers, which is 1 by default in Python and in the program `bvh`.
    uint64_t seed;
    // 1 lets the boxes of triangles lie in a frame where that saves area, as by default in Python
    // and in the program `bvh`: they are then no boxes for other tracers. 0 keeps the axes.
    uint32_t frame;
} BvhBake;

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
} BvhNode;

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
} BvhRay;

// The nearest triangle that a ray hits; of several at the same distance, the triangle with the
// lowest index. A ray without a hit has infinity and UINT32_MAX.
typedef struct {
    // The distance, in multiples of the direction's length.
    float t;
    // The index of the triangle.
    uint32_t object;
} BvhHit;

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
} BvhSurfaceHit;

// The point of the triangles that is closest to a given point. Without one, `distance` is
// infinity, `object` is UINT32_MAX, and the point is NaN.
typedef struct {
    // The closest point.
    double point[3];
    // Its distance from the given point.
    double distance;
    // The index of the triangle; of several at the same distance, the lowest.
    uint32_t object;
} BvhClosest;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the message of the last failed call of this thread, or an empty string if none has
// failed. The string is valid until another call of this thread fails.
const char *bvh_last_error(void);

// Searches for the best tree over `count` boxes for about `seconds`, 0 or more. Each box is 6
// floats: the lower corner, then the upper corner.
//
// `boxes` points to 6 * `count` floats.
BvhTree *bvh_tree_from_boxes(const float *boxes, size_t count, double seconds);

// Searches for the best tree over `count` triangles for about `seconds`, 0 or more. Each triangle
// is 9 floats: three corners. With `references` above 1, up to 16, triangles may be divided among
// leaves, on average into that many parts each.
//
// `corners` points to 9 * `count` floats.
BvhTree *bvh_tree_from_triangles(const float *corners, size_t count, double seconds, double references);

// Searches for the best tree with these choices.
//
// `bake` is a search whose arrays have the promised lengths.
BvhTree *bvh_tree_bake(const BvhBake *bake);

// Improves a tree for about `seconds`, 0 or more. Arrays from `bvh_tree_nodes` and
// `bvh_tree_object_ids` become invalid.
//
// `tree` is a tree that no other thread uses.
BvhStatus bvh_tree_improve(BvhTree *tree, double seconds);

// Improves a tree like `bvh_tree_improve`, and ends soon after `cancelled(context)` returns a
// number other than 0. The tree is then the best one so far, and the call succeeds. To cancel a
// search from its beginning, create the tree in 0 seconds first.
//
// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws no
// exception and that any number of threads may call at the same time until this call returns.
BvhStatus bvh_tree_improve_until(BvhTree *tree, double seconds, uint8_t (*cancelled)(void *context), void *context);

// Writes the cost of the kind `kind`, one of `BvhCost`, to `cost`.
//
// `tree` is a tree; `cost` points to a double.
BvhStatus bvh_tree_cost(const BvhTree *tree, uint32_t kind, double *cost);

// Writes the frame of the tree's boxes: 9 numbers, the rows of a rotation, then 3, a centre. The
// boxes contain rotation * (p - centre) for the points p of their objects. Without a frame, these
// are the identity and 0.
//
// `tree` is a tree; `frame` points to 12 doubles.
BvhStatus bvh_tree_frame(const BvhTree *tree, double *frame);

// Returns the nodes of the tree, and writes their number to `count`. The nodes belong to the tree
// and are valid until it is improved or freed. Their boxes lie in its frame, if it has one: see
// `bvh_tree_frame`.
//
// `tree` is a tree; `count` points to a size.
const BvhNode *bvh_tree_nodes(const BvhTree *tree, size_t *count);

// Returns the object ids, to which leaves refer by position, and writes their number to `count`.
// The ids belong to the tree and are valid until it is improved or freed.
//
// `tree` is a tree; `count` points to a size.
const uint32_t *bvh_tree_object_ids(const BvhTree *tree, size_t *count);

// Loads the tree over these boxes, given as for `bvh_tree_from_boxes`, from the file `path`, in
// UTF-8.
//
// `path` is a string; `boxes` points to 6 * `count` floats.
BvhTree *bvh_tree_load_boxes(const char *path, const float *boxes, size_t count);

// Loads the tree over these triangles, given as for `bvh_tree_from_triangles`, from the file
// `path`, in UTF-8.
//
// `path` is a string; `corners` points to 9 * `count` floats.
BvhTree *bvh_tree_load_triangles(const char *path, const float *corners, size_t count);

// Writes the tree to the file `path`, in UTF-8. An existing file is replaced when the new one is
// complete; a failure leaves the old one.
//
// `tree` is a tree; `path` is a string.
BvhStatus bvh_tree_save(const BvhTree *tree, const char *path);

// Writes the tree to the file `path`, in UTF-8, for the tracer of another library, by its name for
// `bvh export` (docs/INTEROP.md). The file is the same as of that command.
//
// `tree` is a tree; `tracer` and `path` are strings.
BvhStatus bvh_tree_export(const BvhTree *tree, const char *tracer, const char *path);

// Frees a tree. Ignores null. Tracers of the tree remain valid.
//
// `tree` is null, or a tree that nobody uses any more.
void bvh_tree_free(BvhTree *tree);

// Creates a tracer of a tree over triangles. The tracer is independent of the tree: the tree may
// be freed, and later improvements do not change the tracer.
//
// `tree` is a tree.
BvhTracer *bvh_tracer_new(const BvhTree *tree);

// Writes the nearest hits of `count` rays to `hits`. Set `coherent` to 1 if consecutive rays begin
// close to each other and have similar directions, and to 0 otherwise. It changes the speed and no
// answer.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvhStatus bvh_tracer_nearest_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, int32_t coherent, BvhHit *hits);

// Writes to `hits` whether each of `count` rays hits any triangle: 1 or 0. `coherent` has the
// meaning that it has in `bvh_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvhStatus bvh_tracer_any_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, int32_t coherent, uint8_t *hits);

// Writes the nearest hits of `count` rays with the surfaces there to `hits`. `coherent` has the
// meaning that it has in `bvh_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
BvhStatus bvh_tracer_surface_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, int32_t coherent, BvhSurfaceHit *hits);

// Writes all hits of `count` rays to `hits`, ray after ray and the nearest first, the number of
// each ray's hits to `counts`, and the number of all hits to `total`. Each crossing of the surface
// counts once, although triangles share edges and corners. Only the first `capacity` hits are
// written; if `total` is greater, call again with room for them.
//
// `tracer` is a tracer; `rays` and `counts` point to `count` elements each, `hits` points to
// `capacity` elements, and `total` points to a size.
BvhStatus bvh_tracer_all_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, BvhHit *hits, size_t capacity, uint32_t *counts, size_t *total);

// Writes the closest points of the triangles to `count` points, 3 floats each. Triangles without
// area do not count.
//
// `tracer` is a tracer; `points` points to 3 * `count` floats, and `closest` to `count` elements.
BvhStatus bvh_tracer_closest_points(const BvhTracer *tracer, const float *points, size_t count, BvhClosest *closest);

// Writes to `inside` whether each of `count` points, 3 floats each, is inside of the mesh: 1 or 0.
// A mesh with holes has an inside, too: there the generalised winding number decides. A point on
// the surface may count as either. The first call for a tracer examines all edges.
//
// `tracer` is a tracer; `points` points to 3 * `count` floats, and `inside` to `count` bytes.
BvhStatus bvh_tracer_contains(const BvhTracer *tracer, const float *points, size_t count, uint8_t *inside);

// Frees a tracer. Ignores null.
//
// `tracer` is null, or a tracer that nobody uses any more.
void bvh_tracer_free(BvhTracer *tracer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* BVH_H */
