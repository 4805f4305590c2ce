/* A box at map coordinates in f64: rays from either side, points, and an array of particles with rays and hits inside. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bvh_search.h"

enum { COUNT = 1000 };

typedef struct { double energy; BvsRayF64 ray; BvsHitF64 hit; } Particle;

int main(void) {
    static const double at[3] = {512345.678, 5412345.678, 98.7};
    static const uint32_t quads[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    static Particle particles[COUNT];
    static unsigned char hits[COUNT];
    double vertices[8][3];
    uint32_t triangles[12][3];
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) vertices[i][axis] = at[axis] + (i >> (2 - axis) & 1 ? 0.5 : -0.5);
    for (int i = 0; i < 12; i++)
        for (int c = 0; c < 3; c++) triangles[i][c] = quads[i / 2][c == 0 ? 0 : c + i % 2];
    BvsObjects objects = {.count = 12, .vertices_f64 = &vertices[0][0], .vertex_count = 8, .indices = &triangles[0][0]};
    BvsBake bake = {.objects = objects, .work = 10000, .frame = 1};
    BvsTree *tree = bvs_tree_bake(&bake);
    BvsTracerF64 *tracer = tree ? bvs_tracer_f64_new(tree) : NULL;
    if (!tracer) {
        puts(bvs_last_error());
        return EXIT_FAILURE;
    }
    /* From two units before the box: in after 1.5, and out after 2.5, unless that face does not count. */
    BvsRayF64 ray = {{at[0] - 2, at[1] + 0.1, at[2] + 0.2}, 0, {1, 0, 0}, INFINITY};
    BvsSelect in = {BVS_ORIENTATION_ENTERING, 0, NULL}, out = {BVS_ORIENTATION_EXITING, 0, NULL};
    BvsHitF64 entry, exit;
    unsigned char another = 1;
    int is_right = bvs_nearest_f64(tracer, &ray, &in, &entry) == 0 && fabs(entry.t - 1.5) < 1e-8;
    is_right = is_right && bvs_nearest_f64(tracer, &ray, &out, &exit) == 0 && fabs(exit.t - 2.5) < 1e-8;
    BvsSelect rest = {BVS_ORIENTATION_EXITING, 1, &exit.object};
    is_right = is_right && bvs_any_f64(tracer, &ray, &rest, &another) == 0 && another == 0;
    for (int i = 0; i < COUNT; i++) particles[i].ray = (BvsRayF64){{at[0], at[1], at[2]}, 0, {cos(i), sin(i), 0.3}, 9};
    is_right = is_right && bvs_tracer_nearest_hits_f64(tracer, &particles[0].ray, sizeof(Particle), COUNT, 0, NULL,
                                                       &particles[0].hit, sizeof(Particle)) == 0;
    is_right = is_right && bvs_tracer_any_hits_f64(tracer, &particles[0].ray, sizeof(Particle), COUNT, 0, &in, hits, 0) == 0;
    for (int i = 0; i < COUNT; i++) {
        double side = particles[i].hit.t * fmax(fabs(cos(i)), fmax(fabs(sin(i)), 0.3));
        is_right = is_right && fabs(side - 0.5) < 1e-8 && hits[i] == 0;
    }
    BvsClosest closest;
    unsigned char inside = 0;
    double point[3] = {at[0] + 0.4, at[1], at[2]};
    bvs_tracer_closest_points_f64(tracer, point, 1, &closest);
    bvs_tracer_contains_f64(tracer, point, 1, &inside);
    is_right = is_right && fabs(closest.distance - 0.1) < 1e-8 && inside == 1;
    /* Beside the box, along x and z: with a normal, only the latter is above the surface. */
    double beside[3] = {at[0] + 0.6, at[1], at[2]}, up[3] = {-0.1, 0, 1}, directions[2][3] = {{1, 0, 0}, {0, 0, 1}};
    double seen = 0;
    BvsSky sky = {.directions = &directions[0][0], .count = 2, .t_max = INFINITY};
    is_right = is_right && bvs_tracer_visible_f64(tracer, &sky, beside, up, 1, NULL, &seen) == 0 && seen == 1;
    printf("in after %.9f, out after %.9f, closest %.9f\n", entry.t, exit.t, closest.distance);
    bvs_tracer_f64_free(tracer);
    bvs_tree_free(tree);
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
