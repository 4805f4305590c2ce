/* How fast points see the sky: million rays per second of every way to trace them, in turns. scripts/sky builds and runs it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bvh_search.h"
#include "embree.h"

/* Rays of the sample are at most this long, which is beyond every scene. */
#define FAR 1e4f
enum { DIRECTIONS = 145, ROUNDS = 5, GROUP = 16, SAMPLE = 20000 };

typedef float Triangle[3][3];
static Triangle *triangles;
static size_t triangle_count, capacity;
static float (*points)[3], (*sorted)[3];
static size_t point_count;
static double directions[DIRECTIONS][3];
static BvsTracer *tracer;
static void *embree;
static const int valid[16] __attribute__((aligned(64))) = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};

static double uniform(void) {
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) / 9007199254740992.0;
}

static void add(const float *a, const float *b, const float *c) {
    if (triangle_count == capacity) {
        capacity = capacity ? 2 * capacity : 1024;
        triangles = realloc(triangles, capacity * sizeof *triangles);
        if (!triangles) abort();
    }
    float *to = triangles[triangle_count++][0];
    memcpy(to, a, 12), memcpy(to + 3, b, 12), memcpy(to + 6, c, 12);
}

/* Houses of 4 walls and a flat roof along streets 12 m wide, and the ground between: 12 triangles a house. */
static void city(int side) {
    for (int i = 0; i < side; i++)
        for (int j = 0; j < side; j++) {
            float width = 10 + 8 * (float)uniform(), depth = 10 + 8 * (float)uniform(), height = 6 + 18 * (float)(uniform() * uniform());
            float x = 30.0f * (float)i, y = 30.0f * (float)j, corners[8][3], ground[4][3];
            for (int k = 0; k < 8; k++) {
                corners[k][0] = x + ((k + 1) / 2 % 2 ? width : 0), corners[k][1] = y + (k / 2 % 2 ? depth : 0);
                corners[k][2] = k < 4 ? 0 : height;
            }
            for (int k = 0; k < 4; k++) {
                int next = (k + 1) % 4;
                add(corners[k], corners[next], corners[4 + next]), add(corners[k], corners[4 + next], corners[4 + k]);
                ground[k][0] = x + ((k + 1) / 2 % 2 ? 30 : 0), ground[k][1] = y + (k / 2 % 2 ? 30 : 0), ground[k][2] = 0;
            }
            add(corners[4], corners[5], corners[6]), add(corners[4], corners[6], corners[7]);
            add(ground[0], ground[1], ground[2]), add(ground[0], ground[2], ground[3]);
        }
}

/* Reads `v` and `f`, and makes fans of polygons. */
static void read_obj(const char *path) {
    FILE *file = fopen(path, "r");
    static char line[1 << 16];
    float(*vertices)[3] = NULL;
    long count = 0, room = 0;
    if (!file) perror(path), exit(EXIT_FAILURE);
    while (fgets(line, sizeof line, file)) {
        if (line[0] == 'v' && line[1] == ' ') {
            if (count == room) vertices = realloc(vertices, (size_t)(room = room ? 2 * room : 1024) * sizeof *vertices);
            sscanf(line + 2, "%f %f %f", &vertices[count][0], &vertices[count][1], &vertices[count][2]);
            count++;
        } else if (line[0] == 'f' && line[1] == ' ') {
            long corners[3], seen = 0;
            for (char *word = strtok(line + 2, " \r\n"); word; word = strtok(NULL, " \r\n")) {
                long index = strtol(word, NULL, 10);
                long corner = index < 0 ? count + index : index - 1;
                if (seen < 3) corners[seen] = corner;
                else corners[1] = corners[2], corners[2] = corner;
                if (++seen >= 3) add(vertices[corners[0]], vertices[corners[1]], vertices[corners[2]]);
            }
        }
    }
    free(vertices), fclose(file);
}

/* Points on triangles by turns, a thousandth of a unit above them. */
static void scatter(size_t count) {
    points = malloc(count * sizeof *points), sorted = malloc(count * sizeof *sorted);
    for (point_count = 0; point_count < count;) {
        Triangle *t = &triangles[(size_t)(uniform() * (double)triangle_count)];
        double u = uniform(), v = uniform(), e[2][3], n[3], length = 0;
        if (u + v > 1) u = 1 - u, v = 1 - v;
        for (int k = 0; k < 3; k++) e[0][k] = (*t)[1][k] - (*t)[0][k], e[1][k] = (*t)[2][k] - (*t)[0][k];
        for (int k = 0; k < 3; k++) {
            n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
            length += n[k] * n[k];
        }
        if (length == 0) continue;
        for (int k = 0; k < 3; k++)
            points[point_count][k] = (float)((*t)[0][k] + u * e[0][k] + v * e[1][k] + 1e-3 * n[k] / sqrt(length));
        point_count++;
    }
    memcpy(sorted, points, count * sizeof *sorted);
}

static int by_size(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static int axis;
static int by_axis(const void *a, const void *b) { return by_size((const float *)a + axis, (const float *)b + axis); }

/* Halves points along their longest extent, as ours are, so that packets of neighbours follow each other. */
static void sort(float (*from)[3], size_t count) {
    if (count <= GROUP) return;
    float size[3];
    for (int k = 0; k < 3; k++) {
        float low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; i++) low = fminf(low, from[i][k]), high = fmaxf(high, from[i][k]);
        size[k] = high - low;
    }
    axis = size[1] > size[0] ? (size[2] > size[1] ? 2 : 1) : (size[2] > size[0] ? 2 : 0);
    qsort(from, count, sizeof *from, by_axis);
    size_t half = (count / 2 + GROUP - 1) / GROUP * GROUP;
    sort(from, half), sort(from + half, count - half);
}

static void tregenza(void) {
    static const int in_row[] = {30, 30, 24, 24, 18, 12, 6, 1};
    int next = 0;
    for (int row = 0; row < 8; row++)
        for (int patch = 0; patch < in_row[row]; patch++, next++) {
            double up = row == 7 ? M_PI / 2 : (12 * row + 6) * M_PI / 180, turn = 2 * M_PI * patch / in_row[row];
            directions[next][0] = cos(up) * sin(turn), directions[next][1] = cos(up) * cos(turn), directions[next][2] = sin(up);
            for (int k = 0; k < 3; k++) directions[next][k] = (float)directions[next][k];
        }
}

/* Each way returns how many rays are free. */
static size_t visible(void) {
    BvsSky sky = {.directions = directions[0], .count = DIRECTIONS, .t_max = INFINITY};
    const size_t words = (DIRECTIONS + 63) / 64;
    uint64_t *bits = malloc(point_count * words * sizeof *bits);
    size_t free_count = 0;
    if (bvs_tracer_visible(tracer, &sky, points[0], NULL, point_count, bits, NULL)) puts(bvs_last_error()), exit(EXIT_FAILURE);
    for (size_t i = 0; i < point_count * words; i++) free_count += (size_t)__builtin_popcountll(bits[i]);
    free(bits);
    return free_count;
}

static size_t batches(int coherent) {
    size_t free_count = 0;
    for (size_t i = 0; i < point_count; i++) {
        BvsRay rays[DIRECTIONS];
        uint8_t hits[DIRECTIONS];
        for (int j = 0; j < DIRECTIONS; j++) {
            const double *d = directions[j];
            rays[j] = (BvsRay){{points[i][0], points[i][1], points[i][2]}, 0, {(float)d[0], (float)d[1], (float)d[2]}, INFINITY};
        }
        bvs_tracer_any_hits(tracer, rays, DIRECTIONS, coherent, hits);
        for (int j = 0; j < DIRECTIONS; j++) free_count += !hits[j];
    }
    return free_count;
}
static size_t batches_coherent(void) { return batches(1); }
static size_t batches_incoherent(void) { return batches(0); }

static size_t embree_single(void) {
    size_t free_count = 0;
    for (size_t i = 0; i < point_count; i++)
        for (int j = 0; j < DIRECTIONS; j++) {
            const double *d = directions[j];
            RTCRay ray = {{points[i][0], points[i][1], points[i][2]}, 0, {(float)d[0], (float)d[1], (float)d[2]}, 0, INFINITY, ~0u, 0, 0};
            rtcOccluded1(embree, &ray, NULL);
            free_count += !(ray.t_max < 0);
        }
    return free_count;
}

/* Packets of neighbours in one direction: origins, t_min, directions, time, t_max, mask, id and flags, each of `width` rays. */
static size_t packets(int width, int flags) {
    RTCOccludedArguments arguments = {.flags = flags, .features = -1};
    size_t free_count = 0;
    for (size_t i = 0; i < point_count; i += (size_t)width) {
        float rays[12 * 16] __attribute__((aligned(64))) = {0};
        size_t count = point_count - i < (size_t)width ? point_count - i : (size_t)width;
        for (int lane = 0; lane < width; lane++)
            for (int k = 0; k < 3; k++) rays[k * width + lane] = sorted[i + ((size_t)lane < count ? (size_t)lane : count - 1)][k];
        memset(&rays[9 * width], 0xff, sizeof(float) * (size_t)width);
        for (int j = 0; j < DIRECTIONS; j++) {
            for (int lane = 0; lane < width; lane++) {
                for (int k = 0; k < 3; k++) rays[(4 + k) * width + lane] = (float)directions[j][k];
                rays[8 * width + lane] = INFINITY;
            }
            (width == 8 ? rtcOccluded8 : rtcOccluded16)(valid, embree, rays, &arguments);
            for (size_t lane = 0; lane < count; lane++) free_count += !(rays[8 * (size_t)width + lane] < 0);
        }
    }
    return free_count;
}
static size_t packets_8(void) { return packets(8, 0); }
static size_t packets_8_coherent(void) { return packets(8, COHERENT); }
static size_t packets_16(void) { return packets(16, 0); }
static size_t packets_16_coherent(void) { return packets(16, COHERENT); }

static const struct { const char *library, *mode; size_t (*answer)(void); } WAYS[] = {
    {"ours", "visible", visible},
    {"ours", "batches in the user's order", batches_incoherent},
    {"ours", "batches in the user's order, coherent", batches_coherent},
    {"Embree", "single calls in the user's order", embree_single},
    {"Embree", "packets of 8 neighbours", packets_8},
    {"Embree", "packets of 8 neighbours, coherent", packets_8_coherent},
    {"Embree", "packets of 16 neighbours", packets_16},
    {"Embree", "packets of 16 neighbours, coherent", packets_16_coherent},
};
enum { COUNT = sizeof WAYS / sizeof *WAYS };

static double seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

/* sky_open3d.py reads the scene and prints a row. */
static void trace_by_open3d(const char *scene, size_t free_count) {
    const char *command = getenv("OPEN3D");
    if (!command) return;
    FILE *pipe = popen(command, "w");
    if (!pipe) perror(command), exit(EXIT_FAILURE);
    float rounded[DIRECTIONS][3];
    for (int j = 0; j < DIRECTIONS; j++)
        for (int k = 0; k < 3; k++) rounded[j][k] = (float)directions[j][k];
    fprintf(pipe, "%s\t%zu\t%zu\t%d\t%zu\n", scene, triangle_count, point_count, DIRECTIONS, free_count);
    fwrite(triangles, sizeof *triangles, triangle_count, pipe);
    fwrite(points, sizeof *points, point_count, pipe), fwrite(rounded, sizeof rounded, 1, pipe);
    if (pclose(pipe)) exit(EXIT_FAILURE);
}

/* Bakes for five seconds, for these rays if there are any, which end at their hits. */
static BvsTree *bake(const float *rays, size_t count) {
    BvsBake bake = {.rays = rays, .ray_count = count, .seconds = 5, .seed = 1, .frame = 1};
    bake.objects.count = triangle_count, bake.objects.vertices = triangles[0][0];
    BvsTree *tree = bvs_tree_bake(&bake);
    tracer = tree ? bvs_tracer_new(tree) : NULL;
    if (!tracer) puts(bvs_last_error()), exit(EXIT_FAILURE);
    return tree;
}

/* Bakes for such rays as will be traced: a sample of them, from points of its own. */
static BvsTree *bake_for_the_sky(void) {
    static float rays[SAMPLE][2][3];
    BvsTree *plain = bake(NULL, 0);
    scatter(SAMPLE);
    for (int i = 0; i < SAMPLE; i++) {
        const double *d = directions[(size_t)(uniform() * DIRECTIONS)];
        BvsRay ray = {{points[i][0], points[i][1], points[i][2]}, 0, {(float)d[0], (float)d[1], (float)d[2]}, FAR};
        BvsHit hit;
        if (bvs_nearest(tracer, &ray, &hit)) puts(bvs_last_error()), exit(EXIT_FAILURE);
        for (int k = 0; k < 3; k++) {
            rays[i][0][k] = ray.origin[k];
            rays[i][1][k] = ray.origin[k] + fminf(hit.t, FAR) * ray.direction[k];
        }
    }
    free(points), free(sorted);
    bvs_tracer_free(tracer), bvs_tree_free(plain);
    return bake(rays[0][0], SAMPLE);
}

static void measure(const char *scene, void *device) {
    BvsTree *tree = bake_for_the_sky();
    embree = rtcNewScene(device);
    embree_build(device, embree, triangles[0][0], triangle_count);
    static const size_t COUNTS[] = {30000, 300000};
    for (int k = 0; k < 2; k++) {
        scatter(COUNTS[k]);
        sort(sorted, point_count);
        float speeds[COUNT][ROUNDS];
        size_t found[COUNT];
        double rays = (double)point_count * DIRECTIONS;
        for (int round = 0; round < ROUNDS; round++)
            for (int i = 0; i < COUNT; i++) {
                double start = seconds();
                found[i] = WAYS[i].answer();
                speeds[i][round] = (float)(rays / (seconds() - start) * 1e-6);
                /* Where rays graze an edge, rounding decides in Embree. */
                if (fabs((double)found[i] - (double)found[0]) > 1e-4 * rays) {
                    fprintf(stderr, "%s, %s: %zu rays are free, not %zu\n", WAYS[i].library, WAYS[i].mode, found[i], found[0]);
                    exit(EXIT_FAILURE);
                }
            }
        for (int i = 0; i < COUNT; i++) {
            qsort(speeds[i], ROUNDS, sizeof speeds[i][0], by_size);
            printf("%s,%zu,%zu,%d,%s,\"%s\",%.2f,%.2f,%.2f,%.4f\n", scene, triangle_count, point_count, DIRECTIONS, WAYS[i].library,
                   WAYS[i].mode, speeds[i][ROUNDS / 2], speeds[i][0], speeds[i][ROUNDS - 1], (double)found[i] / rays);
        }
        fflush(stdout);
        trace_by_open3d(scene, found[0]);
        free(points), free(sorted);
    }
    rtcReleaseScene(embree), bvs_tracer_free(tracer), bvs_tree_free(tree);
    triangle_count = 0;
}

int main(int count, char **paths) {
    void *device = rtcNewDevice("threads=1,set_affinity=0");
    tregenza();
    puts("scene,triangles,points,directions,library,mode,million_per_s,million_per_s_least,million_per_s_most,free_fraction");
    city(58), measure("city", device);
    city(289), measure("large city", device);
    for (int i = 1; i < count; i++) {
        const char *name = strrchr(paths[i], '/');
        read_obj(paths[i]), measure(name ? name + 1 : paths[i], device);
    }
    return EXIT_SUCCESS;
}
