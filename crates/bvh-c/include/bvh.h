// C interface of bvh-search. Generated from crates/bvh-c/src; its README says how to build, link and call it.

#ifndef BVH_H
#define BVH_H

#include <stddef.h>
#include <stdint.h>

// What became of a call.
typedef enum {
    // It did what it says.
    BVH_STATUS_OK = 0,
    // An argument, or what a file holds, is not accepted. Nothing was changed.
    BVH_STATUS_INVALID = 1,
    // A file could not be read or written.
    BVH_STATUS_FILE = 2,
    // A fault of the library, which you may report.
    BVH_STATUS_FAULT = 3,
} BvhStatus;

// What a cost is; the numbers are those of tree files.
typedef enum {
    // Total half area of the inner nodes' boxes.
    BVH_COST_INTERNAL_AREA = 0,
    // Goldsmith and Salmon's.
    BVH_COST_GOLDSMITH_SALMON = 1,
    // The surface area heuristic with both constants 1.
    BVH_COST_SAH = 2,
    // The layout that `bvh_tracer_new` makes.
    BVH_COST_LAYOUT = 3,
} BvhCost;

// Triangles in the wide layout. Any number of threads may trace one at the same time.
typedef struct BvhTracer BvhTracer;

// A tree with its objects. Any number of threads may read one at the same time; whoever improves or frees it must be alone.
typedef struct BvhTree BvhTree;

// A binary node of 32 bytes, as tinybvh's `BVH::BVHNode`. Node 0 is the root. Where there are more, node 1 is not used, so that both
// children of a node share a cache line.
typedef struct {
    // Lower corner of the box.
    float min[3];
    // Index of the first of two adjacent children, or position of the leaf's first object id.
    uint32_t first;
    // Upper corner of the box.
    float max[3];
    // Number of object ids of a leaf; 0 for an inner node.
    uint32_t count;
} BvhNode;

// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction need not have length 1; `t_min` is 0 or more;
// `t_max` may be infinite.
typedef struct {
    // Where t is 0.
    float origin[3];
    // Smallest distance.
    float t_min;
    // The step by which t counts.
    float direction[3];
    // Largest distance.
    float t_max;
} BvhRay;

// The nearest triangle that a ray meets, of several at the same distance the one of the lowest index; infinity and
// UINT32_MAX if there is none.
typedef struct {
    // The distance, in multiples of the direction's length.
    float t;
    // Index of the triangle.
    uint32_t object;
} BvhHit;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Why the last call of this thread that failed did so; empty if none has. Valid until another call of this thread fails.
const char *bvh_last_error(void);

// The best tree over `count` boxes that is found in about `seconds`, 0 or more. Each box is 6 floats: lower corner, upper corner.
//
// `boxes` points to 6 * `count` floats.
BvhTree *bvh_tree_from_boxes(const float *boxes, size_t count, double seconds);

// The best tree over `count` triangles that is found in about `seconds`, 0 or more. Each triangle is 9 floats: three corners.
// With `references` above 1, up to 16, triangles may be divided among leaves, into so many parts each on average.
//
// `corners` points to 9 * `count` floats.
BvhTree *bvh_tree_from_triangles(const float *corners, size_t count, double seconds, double references);

// Improves a tree for about `seconds`, 0 or more. Arrays that `bvh_tree_nodes` and `bvh_tree_object_ids` lent end here.
//
// `tree` is a tree that no other thread uses.
BvhStatus bvh_tree_improve(BvhTree *tree, double seconds);

// As `bvh_tree_improve`, and ends soon after `cancelled(context)` is not 0, with the best tree until then, which is no failure. To
// cancel a search from its beginning, make the tree in 0 seconds first.
//
// `tree` is a tree that no other thread uses; `cancelled` is null, or a function that throws nothing, and that any threads may call, several
// at once, until this returns.
BvhStatus bvh_tree_improve_until(BvhTree *tree, double seconds, uint8_t (*cancelled)(void *context), void *context);

// Writes a cost of the tree, one of `BvhCost`, to `cost`.
//
// `tree` is a tree; `cost` points to a double.
BvhStatus bvh_tree_cost(const BvhTree *tree, uint32_t kind, double *cost);

// The nodes of the tree, and their number in `count`. They belong to the tree, until it is improved or freed.
//
// `tree` is a tree; `count` points to a size.
const BvhNode *bvh_tree_nodes(const BvhTree *tree, size_t *count);

// The object ids that leaves name by position, and their number in `count`. They belong to the tree, until it is improved or freed.
//
// `tree` is a tree; `count` points to a size.
const uint32_t *bvh_tree_object_ids(const BvhTree *tree, size_t *count);

// The tree over these boxes, as for `bvh_tree_from_boxes`, in the file `path`, UTF-8.
//
// `path` is a string; `boxes` points to 6 * `count` floats.
BvhTree *bvh_tree_load_boxes(const char *path, const float *boxes, size_t count);

// The tree over these triangles, as for `bvh_tree_from_triangles`, in the file `path`, UTF-8.
//
// `path` is a string; `corners` points to 9 * `count` floats.
BvhTree *bvh_tree_load_triangles(const char *path, const float *corners, size_t count);

// Writes the tree to the file `path`, UTF-8. One that is there is replaced when the new one is complete: after a failure it is the old one.
//
// `tree` is a tree; `path` is a string.
BvhStatus bvh_tree_save(const BvhTree *tree, const char *path);

// Frees a tree. Null is left alone. Tracers of the tree stay.
//
// `tree` is null, or a tree that nobody uses any more.
void bvh_tree_free(BvhTree *tree);

// Lays out a tree that was made from triangles. The tracer needs the tree no longer, and does not follow its changes.
//
// `tree` is a tree.
BvhTracer *bvh_tracer_new(const BvhTree *tree);

// The nearest hits of `count` rays, into as many `hits`. `coherent` is not 0 where consecutive rays begin close to each other and run the
// same way, which makes them faster and changes no answer.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each.
BvhStatus bvh_tracer_nearest_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, int32_t coherent, BvhHit *hits);

// Whether each of `count` rays meets any triangle: 1 or 0, into as many `hits`. `coherent` is as in `bvh_tracer_nearest_hits`.
//
// `tracer` is a tracer; `rays` and `hits` point to `count` elements each.
BvhStatus bvh_tracer_any_hits(const BvhTracer *tracer, const BvhRay *rays, size_t count, int32_t coherent, uint8_t *hits);

// Frees a tracer. Null is left alone.
//
// `tracer` is null, or a tracer that nobody uses any more.
void bvh_tracer_free(BvhTracer *tracer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* BVH_H */
