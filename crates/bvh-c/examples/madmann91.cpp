// Exports a tree, loads it into madmann91/bvh (version 2, its src on the include path), and compares 100 000 nearest hits
// with those in the tree that the library builds itself.

#include "bvh_search.h"
#include "load_madmann91.h"

#include <bvh/v2/default_builder.h>
#include <bvh/v2/stack.h>
#include <bvh/v2/tri.h>

#include <cstdio>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

using Vec3 = bvh::v2::Vec<float, 3>;
using Tri = bvh::v2::Tri<float, 3>;
using Triangles = std::vector<bvh::v2::PrecomputedTri<float>>;
using Ray = bvh::v2::Ray<float, 3>;

/// The nearest hit's distance, and the number of triangles that were tested.
std::pair<float, size_t> nearest(const Bvh &bvh, const Triangles &triangles, Ray ray) {
    bvh::v2::SmallStack<Bvh::Index, 64> stack;
    size_t tests = 0;
    bvh.intersect<false, true>(ray, bvh.get_root().index, stack, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; i++, tests++)
            if (auto hit = triangles[bvh.prim_ids[i]].intersect(ray)) ray.tmax = std::get<0>(*hit);
        return false;
    });
    return {ray.tmax, tests};
}

int main(int count, char **arguments) {
    const char *path = count > 1 ? arguments[1] : "example.bin";
    std::mt19937 random(1);
    std::uniform_real_distribution<float> uniform(-1, 1);
    auto point = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
    std::vector<float> corners;
    Triangles triangles;
    std::vector<bvh::v2::BBox<float, 3>> boxes;
    std::vector<Vec3> centers;
    for (int i = 0; i < 3000; i++) {
        // Long triangles along an axis, as in buildings.
        Vec3 at = point() * 5.0f, along(0.0f), across = point() * 0.2f;
        along[i % 3] = 2 * uniform(random);
        Tri triangle(at, at + along, at + across);
        triangles.emplace_back(triangle), boxes.push_back(triangle.get_bbox()), centers.push_back(triangle.get_center());
        for (const Vec3 &corner : {at, at + along, at + across})
            for (int axis = 0; axis < 3; axis++) corners.push_back(corner[axis]);
    }
    BvsBake search = {};
    search.objects.vertices = corners.data(), search.objects.count = triangles.size();
    search.references = 1.3, search.work = 3000000;
    BvsTree *tree = bvs_tree_bake(&search);
    if (!tree || bvs_tree_export(tree, "madmann91-bvh", 0, path) != BVS_STATUS_OK) return std::puts(bvs_last_error()), EXIT_FAILURE;
    bvs_tree_free(tree);
    Bvh ours = load(path);

    Bvh own = bvh::v2::DefaultBuilder<bvh::v2::Node<float, 3>>::build(boxes, centers, {});

    size_t hits = 0, wrong = 0, tests[2] = {0, 0};
    for (int i = 0; i < 100000; i++) {
        Ray ray(point() * 5.0f, point(), 0.0f, 100.0f);
        auto [a, tested] = nearest(ours, triangles, ray);
        auto [b, by_own] = nearest(own, triangles, ray);
        hits += a < 100.0f, wrong += a != b, tests[0] += tested, tests[1] += by_own;
    }
    std::printf("madmann91/bvh: %zu of 100000 rays hit, %zu unlike in its own tree; %zu triangles tested, %zu in its own\n", hits, wrong, tests[0], tests[1]);
    return wrong == 0 && hits > 10000 && ours.prim_ids.size() > triangles.size() ? EXIT_SUCCESS : EXIT_FAILURE;
}
