/* Trees that live longer than a program: recorded rays, files, and trees over boxes. */
#include <stdio.h>
#include <stdlib.h>

#include "bvh.h"

enum { STEPS = 100 };

/* Bakes a tree over a row of triangles for the rays of the last frame, and saves it, after a file for another tracer. */
static int bake(const float *corners, size_t count, const char *path) {
    static float rays[STEPS][6]; /* an origin and a hit each */
    for (int i = 0; i < STEPS; i++) {
        float x = (float)(i % 10);
        float ray[6] = {x, 0.2f, 9, x + 0.1f, 0.2f, 0};
        for (int j = 0; j < 6; j++) rays[i][j] = ray[j];
    }
    BvhBake search = {.corners = corners, .count = count, .rays = &rays[0][0], .ray_count = STEPS};
    search.seconds = 0.05;
    BvhTree *tree = bvh_tree_bake(&search);
    int is_saved = tree && bvh_tree_export(tree, "obvhs", path) == 0 && bvh_tree_save(tree, path) == 0;
    bvh_tree_free(tree);
    return is_saved;
}

/* Returns whether a tree over boxes has the same cost when it is loaded again. */
static int keep_boxes(const float *boxes, size_t count, const char *path) {
    double saved = 0, loaded = -1;
    BvhTree *tree = bvh_tree_from_boxes(boxes, count, 0.05);
    if (!tree || bvh_tree_save(tree, path) != 0) return 0;
    bvh_tree_cost(tree, 0, &saved);
    bvh_tree_free(tree);
    tree = bvh_tree_load_boxes(path, boxes, count);
    if (!tree) return 0;
    bvh_tree_cost(tree, 0, &loaded);
    bvh_tree_free(tree);
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
    BvhTree *tree = bvh_tree_load_triangles(path, &corners[0][0], STEPS);
    is_right = is_right && tree;
    /* The file remembers its scene. */
    BvhTree *other = bvh_tree_load_triangles(path, &corners[0][0], STEPS - 1);
    printf("rejected: %s\n", bvh_last_error());
    is_right = is_right && !other && keep_boxes(&boxes[0][0], STEPS, path);
    bvh_tree_free(tree);
    if (!is_right) puts(bvh_last_error());
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
