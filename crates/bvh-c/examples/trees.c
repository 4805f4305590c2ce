/* Trees that live longer than a program: recorded rays, files, and trees over boxes. */
#include <stdio.h>
#include <stdlib.h>

#include "bvh_search.h"

enum { STEPS = 100 };

/* Bakes a tree over a row of triangles for the rays of the last frame, and saves it, after a file for another tracer. */
static int bake(const float *corners, size_t count, const char *path) {
    static float rays[STEPS][6]; /* an origin and a hit each */
    for (int i = 0; i < STEPS; i++) {
        float x = (float)(i % 10);
        float ray[6] = {x, 0.2f, 9, x + 0.1f, 0.2f, 0};
        for (int j = 0; j < 6; j++) rays[i][j] = ray[j];
    }
    BvsBake search = {.objects = {.vertices = corners, .count = count}, .rays = &rays[0][0], .ray_count = STEPS};
    search.seconds = 0.05;
    BvsTree *tree = bvs_tree_bake(&search);
    int is_saved = tree && bvs_tree_export(tree, "obvhs", 0, path) == 0 && bvs_tree_save(tree, path) == 0;
    bvs_tree_free(tree);
    return is_saved;
}

/* Returns whether a tree over boxes has the same cost when it is loaded again. */
static int keep_boxes(const float *boxes, size_t count, const char *path) {
    double saved = 0, loaded = -1;
    BvsTree *tree = bvs_tree_from_boxes(boxes, count, 0.05);
    if (!tree || bvs_tree_save(tree, path) != 0) return 0;
    bvs_tree_cost(tree, 0, &saved);
    bvs_tree_free(tree);
    BvsObjects objects = {.boxes = boxes, .count = count};
    tree = bvs_tree_load(path, &objects);
    if (!tree) return 0;
    bvs_tree_cost(tree, 0, &loaded);
    bvs_tree_free(tree);
    return saved == loaded;
}

int main(int count, char **arguments) {
    const char *path = count > 1 ? arguments[1] : "example.bvh";
    float corners[STEPS][9], boxes[STEPS][6];
    for (int i = 0; i < STEPS; i++) {
        float x = (float)i;
        float triangle[9] = {x, 0, 0, x + 1, 0, 0, x, 1, 0}, box[6] = {x, 0, 0, x + 1, 1, 0};
        for (int j = 0; j < 9; j++) corners[i][j] = triangle[j];
        for (int j = 0; j < 6; j++) boxes[i][j] = box[j];
    }
    int is_right = bake(&corners[0][0], STEPS, path);
    BvsObjects objects = {.vertices = &corners[0][0], .count = STEPS};
    BvsTree *tree = bvs_tree_load(path, &objects);
    is_right = is_right && tree;
    /* An engine may keep the bytes in an asset of its own. They remember their scene. */
    size_t size = 0;
    uint8_t *bytes = tree ? bvs_tree_to_bytes(tree, &size) : NULL;
    BvsTree *copy = bvs_tree_from_bytes(bytes, size, &objects);
    objects.count = STEPS - 1;
    BvsTree *other = bvs_tree_from_bytes(bytes, size, &objects);
    printf("rejected: %s\n", bvs_last_error());
    bvs_bytes_free(bytes, size);
    is_right = is_right && copy && !other && keep_boxes(&boxes[0][0], STEPS, path);
    bvs_tree_free(copy);
    bvs_tree_free(tree);
    if (!is_right) puts(bvs_last_error());
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
