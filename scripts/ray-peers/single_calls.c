/* What a call for one ray costs in C, beside Embree's rtcIntersect1 and rtcOccluded1: nanoseconds, the least of several rounds in
 * turn. scripts/single-calls builds and runs it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "bvh_search.h"
#include "embree.h"

enum { SIDE = 256, TRIANGLES = 2 * SIDE * SIDE, RAYS = 1 << 16, ROUNDS = 15 };

static float corners[TRIANGLES][3][3];
static BvsRay rays[RAYS];
static BvsTracer *tracer;
static void *embree;

static float uniform(void) {
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (float)(state >> 40) / 16777216;
}

/* Hills of height 0.1 over the unit square. */
static void hill(float *at, int i, int j) {
    float x = (float)i / SIDE, y = (float)j / SIDE;
    at[0] = x, at[1] = y, at[2] = 0.05f * (sinf(25 * x) * cosf(31 * y) + 0.2f * sinf(211 * x + 97 * y));
}

static RTCRay for_embree(const BvsRay *from) {
    const float *o = from->origin, *d = from->direction;
    return (RTCRay){{o[0], o[1], o[2]}, from->t_min, {d[0], d[1], d[2]}, 0, from->t_max, ~0u, 0, 0};
}

/* Each way answers all rays, and returns how many hit. */
static int ours_nearest(void) {
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        BvsHit hit;
        bvs_nearest(tracer, &rays[i], &hit);
        hits += hit.object != UINT32_MAX;
    }
    return hits;
}

static int batch_of_one(void) {
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        BvsHit hit;
        bvs_tracer_nearest_hits(tracer, &rays[i], 1, 0, &hit);
        hits += hit.object != UINT32_MAX;
    }
    return hits;
}

static int embree_nearest(void) {
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        RTCRayHit found = {for_embree(&rays[i]), {{0}, 0, 0, ~0u, ~0u, {~0u, ~0u}}};
        rtcIntersect1(embree, &found, NULL);
        hits += found.hit.geometry != ~0u;
    }
    return hits;
}

static int ours_any(void) {
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        uint8_t hit = 0;
        bvs_any(tracer, &rays[i], &hit);
        hits += hit;
    }
    return hits;
}

static int embree_any(void) {
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        RTCRay ray = for_embree(&rays[i]);
        rtcOccluded1(embree, &ray, NULL);
        hits += ray.t_max < 0;
    }
    return hits;
}

#ifdef MORE
int more_nearest(const BvsRay *rays, size_t count);
void more_new(const float *corners, size_t count);
static int more(void) { return more_nearest(rays, RAYS); }
#endif

static const struct { const char *name; int (*answer)(void); } WAYS[] = {
    {"bvs_nearest", ours_nearest},     {"a batch of one", batch_of_one}, {"rtcIntersect1", embree_nearest},
    {"bvs_any", ours_any},             {"rtcOccluded1", embree_any},
#ifdef MORE
    {"more", more},
#endif
};
enum { MOST = 8, COUNT = sizeof WAYS / sizeof *WAYS };

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec * 1e9 + (double)time.tv_nsec;
}

int main(void) {
    for (int i = 0; i < SIDE; i++)
        for (int j = 0; j < SIDE; j++) {
            float(*pair)[3][3] = &corners[2 * (i * SIDE + j)];
            hill(pair[0][0], i, j), hill(pair[0][1], i + 1, j), hill(pair[0][2], i, j + 1);
            hill(pair[1][0], i + 1, j), hill(pair[1][1], i + 1, j + 1), hill(pair[1][2], i, j + 1);
        }
    BvsTree *tree = bvs_tree_from_triangles(&corners[0][0][0], TRIANGLES, 2, 1);
    tracer = tree ? bvs_tracer_new(tree) : NULL;
    if (!tracer) return puts(bvs_last_error()), EXIT_FAILURE;
    void *device = rtcNewDevice("threads=1,set_affinity=0");
    embree = rtcNewScene(device);
    rtcSetSceneFlags(embree, ROBUST);
    embree_build(device, embree, &corners[0][0][0], TRIANGLES);
#ifdef MORE
    more_new(&corners[0][0][0], TRIANGLES);
#endif

    static const char *KINDS[] = {"past everything", "from above", "along the hills"};
    for (int kind = 0; kind < 3; kind++) {
        for (int i = 0; i < RAYS; i++) {
            float x = uniform(), y = uniform(), dx = uniform() - 0.5f, dy = uniform() - 0.5f;
            float up = kind == 0 ? 1 : kind == 1 ? -1 : 0.1f * (uniform() - 0.5f);
            rays[i] = (BvsRay){{x, y, kind == 2 ? 0.08f : 0.5f}, 0, {dx, dy, up}, INFINITY};
        }
        double least[MOST];
        int hits[MOST];
        for (int i = 0; i < COUNT; i++) least[i] = INFINITY;
        for (int round = 0; round < ROUNDS; round++)
            for (int i = 0; i < COUNT; i++) {
                double start = now();
                hits[i] = WAYS[i].answer();
                least[i] = fmin(least[i], (now() - start) / RAYS);
            }
        printf("%s, %.1f %% hit:", KINDS[kind], 100.0 * hits[0] / RAYS);
        for (int i = 0; i < COUNT; i++) {
            printf("%s %s %.0f ns", i ? "," : "", WAYS[i].name, least[i]);
            /* On edges rounding decides. */
            if (abs(hits[i] - hits[0]) > 2) return printf("\n%s finds %d hits, not %d\n", WAYS[i].name, hits[i], hits[0]), EXIT_FAILURE;
        }
        puts("");
    }
    bvs_tracer_free(tracer);
    bvs_tree_free(tree);
    return EXIT_SUCCESS;
}
