/* Batches in the shape of two programs: an audio engine, which passes arrays of rays to callbacks and
 * wants distances, triangles and normals; and a LiDAR, which scans ring by ring. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bvh_search.h"

enum { MOST = 64, RINGS = 16, STEPS = 360 };

/* The structures of the audio engine, as in Steam Audio. */
typedef struct { float origin[3], direction[3]; } AudioRay;
typedef struct { float distance; int triangle; float normal[3]; } AudioHit;

/* The nearest hits of at most MOST rays; a miss has an infinite distance. */
static void batched_closest_hit(int count, const AudioRay *rays, const float *t_min, const float *t_max,
                                AudioHit *hits, void *tracer) {
    BvsRay batch[MOST];
    BvsSurfaceHit found[MOST];
    for (int i = 0; i < count; i++) {
        const float *o = rays[i].origin, *d = rays[i].direction;
        batch[i] = (BvsRay){{o[0], o[1], o[2]}, t_min[i], {d[0], d[1], d[2]}, t_max[i]};
    }
    bvs_tracer_surface_hits(tracer, batch, (size_t)count, 0, found);
    for (int i = 0; i < count; i++) {
        const float *n = found[i].normal;
        hits[i] = (AudioHit){found[i].t, (int)found[i].object, {n[0], n[1], n[2]}};
    }
}

/* Writes whether each of at most MOST rays is occluded. */
static void batched_any_hit(int count, const AudioRay *rays, const float *t_min, const float *t_max,
                            unsigned char *occluded, void *tracer) {
    BvsRay batch[MOST];
    for (int i = 0; i < count; i++) {
        const float *o = rays[i].origin, *d = rays[i].direction;
        batch[i] = (BvsRay){{o[0], o[1], o[2]}, t_min[i], {d[0], d[1], d[2]}, t_max[i]};
    }
    bvs_tracer_any_hits(tracer, batch, (size_t)count, 0, occluded);
}

/* Returns the mean distance of the points of one turn of a LiDAR. */
static double lidar_scan(const BvsTracer *tracer, const float at[3]) {
    static BvsRay rays[RINGS * STEPS];
    static BvsHit hits[RINGS * STEPS];
    for (int i = 0; i < RINGS * STEPS; i++) {
        double up = (i / STEPS - RINGS / 2) * 0.03, turn = (i % STEPS) * 6.283185307179586 / STEPS;
        float x = (float)(cos(up) * cos(turn)), y = (float)(cos(up) * sin(turn)), z = (float)sin(up);
        rays[i] = (BvsRay){{at[0], at[1], at[2]}, 0.1f, {x, y, z}, 200};
    }
    bvs_tracer_nearest_hits(tracer, rays, RINGS * STEPS, 1, hits);
    double sum = 0;
    for (int i = 0; i < RINGS * STEPS; i++) sum += hits[i].t;
    return sum / (RINGS * STEPS);
}

int main(void) {
    /* A box around the origin, two triangles per face: every ray from inside hits. */
    static const int quads[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    float corners[12][3][3];
    for (int i = 0; i < 12; i++) {
        const int *quad = quads[i / 2];
        int names[3] = {quad[0], quad[1 + i % 2], quad[2 + i % 2]};
        for (int c = 0; c < 3; c++)
            for (int axis = 0; axis < 3; axis++) corners[i][c][axis] = names[c] >> (2 - axis) & 1 ? 5 : -5;
    }
    BvsTree *tree = bvs_tree_from_triangles(&corners[0][0][0], 12, 0.05, 1.0);
    BvsTracer *tracer = tree ? bvs_tracer_new(tree) : NULL;
    if (!tracer) {
        puts(bvs_last_error());
        return EXIT_FAILURE;
    }
    AudioRay rays[2] = {{{0, 0, 0}, {1, 0, 0}}, {{9, 9, 9}, {1, 0, 0}}};
    float t_min[2] = {0, 0}, t_max[2] = {100, 100};
    AudioHit hits[2];
    unsigned char occluded[2];
    batched_closest_hit(2, rays, t_min, t_max, hits, tracer);
    batched_any_hit(2, rays, t_min, t_max, occluded, tracer);
    /* A line through the middle crosses the box twice, although diagonals meet there. */
    BvsRay line = {{-9, 0, 0}, 0, {1, 0, 0}, INFINITY};
    BvsHit all[4];
    uint32_t count;
    size_t total;
    bvs_tracer_all_hits(tracer, &line, 1, all, 4, &count, &total);
    float point[3] = {0, 0, 4};
    BvsClosest closest;
    unsigned char inside;
    bvs_tracer_closest_points(tracer, point, 1, &closest);
    bvs_tracer_contains(tracer, point, 1, &inside);
    /* From inside the sky is not to be seen; above the box its two directions are. */
    float places[2][3] = {{0, 0, 0}, {0, 0, 6}};
    double directions[2][3] = {{0, 0, 1}, {0, 1, 1}}, weights[2] = {1, 2}, hours[2];
    BvsSky sky = {&directions[0][0], 2, 0, INFINITY, weights, 1, 0};
    uint64_t free_bits[2];
    bvs_tracer_visible(tracer, &sky, &places[0][0], NULL, 2, free_bits, hours);
    float at[3] = {0, 0, 0};
    double mean = lidar_scan(tracer, at);
    printf("audio %g and %g, crossings %u, closest %g, mean of the scan %g\n", hits[0].distance,
           hits[1].distance, count, closest.distance, mean);
    int is_right = hits[0].distance == 5 && fabsf(hits[0].normal[0]) == 1 && isinf(hits[1].distance) &&
                   occluded[0] == 1 && occluded[1] == 0 && total == 2 && all[0].t == 4 && all[1].t == 14 &&
                   closest.distance == 1 && inside == 1 && free_bits[0] == 0 && free_bits[1] == 3 &&
                   hours[0] == 0 && hours[1] == 3 && mean > 5 && mean < 7;
    bvs_tracer_free(tracer);
    bvs_tree_free(tree);
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
