// Exports a tree of divided triangles, loads it into tinybvh (tiny_bvh.h on the include path), and compares 100 000 nearest hits
// in each of its layouts with the library's own.

#include "bvh_search.h"

#define TINYBVH_IMPLEMENTATION
#include "load_tinybvh.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

int main(int count, char **arguments) {
    const char *path = count > 1 ? arguments[1] : "example.bin";
    std::mt19937 random(1);
    auto within = [&](float size) { return size * (2 * float(random()) / float(std::mt19937::max()) - 1); };
    std::vector<float> corners;
    std::vector<tinybvh::bvhvec4> vertices;
    for (int i = 0; i < 3000; i++) {
        // Long triangles along an axis, as in buildings.
        float at[3] = {within(5), within(5), within(5)};
        for (int corner = 0; corner < 3; corner++) {
            float point[3];
            for (int axis = 0; axis < 3; axis++) {
                float along = axis == i % 3 ? within(2) : 0;
                point[axis] = at[axis] + (corner == 0 ? 0 : corner == 1 ? along : within(0.2f));
                corners.push_back(point[axis]);
            }
            vertices.emplace_back(point[0], point[1], point[2], 0.f);
        }
    }
    uint32_t triangles = uint32_t(vertices.size() / 3);
    BvsBake search = {};
    search.objects.vertices = corners.data(), search.objects.count = triangles;
    search.references = 1.3, search.work = 3000000;
    BvsTree *tree = bvs_tree_bake(&search);
    if (!tree || bvs_tree_export(tree, "tinybvh", 0, path) != BVS_STATUS_OK) return std::puts(bvs_last_error()), EXIT_FAILURE;

    std::vector<BvsRay> rays(100000);
    for (BvsRay &ray : rays) {
        ray.t_min = 0, ray.t_max = INFINITY;
        for (int axis = 0; axis < 3; axis++) ray.origin[axis] = within(5), ray.direction[axis] = within(1);
    }
    BvsTracer *tracer = bvs_tracer_new(tree);
    std::vector<BvsHit> expected(rays.size());
    if (!tracer || bvs_tracer_nearest_hits(tracer, rays.data(), rays.size(), 0, expected.data()) != BVS_STATUS_OK)
        return std::puts(bvs_last_error()), EXIT_FAILURE;

    bool is_right = true;
    auto compare = [&](const char *layout, const auto &theirs) {
        size_t hits = 0, unlike = 0;
        for (size_t i = 0; i < rays.size(); i++) {
            const auto &[o, t_min, d, t_max] = rays[i];
            // tinybvh makes directions unit vectors.
            float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            tinybvh::Ray ray({o[0], o[1], o[2]}, {d[0], d[1], d[2]});
            theirs.Intersect(ray);
            bool is_hit = ray.hit.t < BVH_FAR;
            hits += is_hit;
            unlike += is_hit != std::isfinite(expected[i].t) || (is_hit && std::fabs(ray.hit.t / length - expected[i].t) > 1e-4f * expected[i].t);
        }
        std::printf("tinybvh %s: %zu of %zu rays hit, %zu unlike the library's\n", layout, hits, rays.size(), unlike);
        // On edges rounding decides.
        is_right &= unlike <= 20 && hits > 10000;
    };
    tinybvh::BVH binary;
    load(binary, path, vertices.data(), triangles);
    is_right &= binary.idxCount > triangles;
    compare("BVH", binary);
    tinybvh::BVH_GPU gpu;
    gpu.ConvertFrom(binary);
    compare("BVH_GPU", gpu);
    tinybvh::MBVH<4> four;
    tinybvh::MBVH<8> eight, for_compressed;
    tinybvh::BVH4_CPU four_cpu;
    convert(four_cpu, four, binary, 4);
    compare("BVH4_CPU", four_cpu);
    tinybvh::BVH8_CWBVH compressed;
#ifdef BVH_USEAVX2
    tinybvh::BVH8_CPU eight_cpu;
    convert(eight_cpu, eight, binary, 4);
    compare("BVH8_CPU", eight_cpu);
    convert(compressed, for_compressed, binary, 3);
    compare("CWBVH", compressed);
#endif
    bvs_tracer_free(tracer);
    bvs_tree_free(tree);
    return is_right ? EXIT_SUCCESS : EXIT_FAILURE;
}
