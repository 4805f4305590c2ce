/* Two frames of a renderer with its own structures: vertices with normals, faces with materials, a few moving copies of the mesh,
 * and one ray at a time. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "bvh_search.h"

enum { SIDE = 20 };

typedef struct { float normal[3], at[3], uv[2]; } Vertex;
typedef struct { uint32_t material, vertices[3]; } Face;

static Vertex vertices[(SIDE + 1) * (SIDE + 1)];
static Face faces[2 * SIDE * SIDE];

/* The cloth as the library reads it where it lies. */
static BvsObjects cloth(void) {
    BvsObjects objects = {.count = sizeof faces / sizeof *faces};
    objects.vertices = vertices[0].at, objects.vertex_stride = sizeof(Vertex);
    objects.vertex_count = sizeof vertices / sizeof *vertices;
    objects.indices = faces[0].vertices, objects.index_stride = sizeof(Face);
    return objects;
}

/* A square cloth that hangs through by `depth`. */
static void hang(float depth) {
    for (int i = 0; i <= SIDE; i++)
        for (int j = 0; j <= SIDE; j++) {
            float x = (float)i / SIDE, y = (float)j / SIDE;
            float at[3] = {x, y, -16 * depth * x * (1 - x) * y * (1 - y)};
            for (int axis = 0; axis < 3; axis++) vertices[i * (SIDE + 1) + j].at[axis] = at[axis];
        }
}

/* The distance from (x, y, 9) down to a tracer. */
static float below(const BvsTracer *tracer, float x, float y) {
    BvsRay ray = {{x, y, 9}, 0, {0, 0, -1}, INFINITY};
    BvsHit hit;
    return bvs_nearest(tracer, &ray, &hit) == BVS_STATUS_OK ? hit.t : NAN;
}

static BvsInstance placed(float x) {
    BvsInstance instance = {0, {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0}};
    return instance;
}

int main(void) {
    printf("bvh_search %s, header %d.%d.%d\n", bvs_version(), BVS_VERSION_MAJOR, BVS_VERSION_MINOR, BVS_VERSION_PATCH);
    for (uint32_t i = 0; i < SIDE; i++)
        for (uint32_t j = 0; j < SIDE; j++) {
            uint32_t a = i * (SIDE + 1) + j, b = a + SIDE + 1;
            Face *face = &faces[2 * (i * SIDE + j)];
            face[0] = (Face){7, {a, b, a + 1}}, face[1] = (Face){7, {b, b + 1, a + 1}};
        }
    hang(0);
    BvsBake search = {.objects = cloth(), .seconds = 0.05};
    BvsTree *tree = bvs_tree_bake(&search);
    BvsTracer *tracer = tree ? bvs_tracer_new(tree) : NULL;
    float flat = tracer ? below(tracer, 0.5f, 0.5f) : NAN;

    /* The next frame: the layout follows. A tree of its own follows, too, for a search in the background. */
    hang(1);
    BvsObjects now = cloth();
    int is_right = tracer && bvs_tracer_update(tracer, &now) == 0 && bvs_tree_update(tree, &now) == 0;
    float deep = is_right ? below(tracer, 0.5f, 0.5f) : NAN;
    BvsRay past = {{2.5f, 0.5f, 9}, 0, {0, 0, -1}, INFINITY};
    unsigned char is_hit = 9, are_hit = 9;
    is_right = is_right && bvs_any(tracer, &past, &is_hit) == 0;

    /* Three copies beside each other, of which the last moves away. */
    const BvsTracer *parts[1] = {tracer};
    BvsInstance copies[3] = {placed(0), placed(1), placed(2)};
    BvsInstances *scene = is_right ? bvs_instances_new(parts, 1, copies, 3, 0) : NULL;
    BvsInstanceHit third = {0}, none = {0};
    is_right = scene && bvs_instances_nearest_hits(scene, &past, 1, &third) == 0;
    copies[2] = placed(5);
    is_right = is_right && bvs_instances_update(scene, copies, 3) == 0 &&
               bvs_instances_nearest_hits(scene, &past, 1, &none) == 0 &&
               bvs_instances_any_hits(scene, &past, 1, &are_hit) == 0;

    if (!is_right) puts(bvs_last_error());
    printf("the cloth is %g and %g away, copy %u %g\n", flat, deep, third.instance, third.t);
    is_right = is_right && flat == 9 && deep == 10 && is_hit == 0 && third.instance == 2 && third.t == 10 &&
               none.instance == UINT32_MAX && are_hit == 0;
    bvs_instances_free(scene);
    bvs_tracer_free(tracer);
    bvs_tree_free(tree);
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
