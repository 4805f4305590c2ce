// Finds a tree in a moment, traces its nodes as tinybvh does, and compares every hit with the library's own tracer.

#include "bvh_search.h"
#include "ray_triangle.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace {

/// tinybvh's BVH::BVHNode, field by field: 32 bytes, after Ingo Wald.
struct WaldNode {
    float aabbMin[3];
    uint32_t leftFirst;
    float aabbMax[3];
    uint32_t triCount;
};
static_assert(sizeof(WaldNode) == sizeof(BvsNode) && offsetof(WaldNode, leftFirst) == offsetof(BvsNode, first) &&
                  offsetof(WaldNode, aabbMax) == offsetof(BvsNode, max) && offsetof(WaldNode, triCount) == offsetof(BvsNode, count),
              "what the library lends is traced where it lies");

template <class T> T *checked(T *made) {
    if (made) return made;
    std::fprintf(stderr, "%s\n", bvs_last_error());
    std::exit(1);
}

void check(BvsStatus status) {
    if (status == BVS_STATUS_OK) return;
    std::fprintf(stderr, "%s\n", bvs_last_error());
    std::exit(1);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Where a ray enters a box before `nearest`, infinity if it does not.
float enters(const WaldNode &node, const BvsRay &ray, float nearest) {
    float low = ray.t_min, high = std::min(ray.t_max, nearest);
    for (int i = 0; i < 3; i++) {
        float a = (node.aabbMin[i] - ray.origin[i]) / ray.direction[i], b = (node.aabbMax[i] - ray.origin[i]) / ray.direction[i];
        low = std::fmax(low, std::fmin(a, b)), high = std::fmin(high, std::fmax(a, b) * 1.000001f);
    }
    return low <= high ? low : INFINITY;
}

BvsHit nearest_in(const WaldNode *nodes, const uint32_t *ids, const float *corners, const BvsRay &ray) {
    BvsHit hit = {INFINITY, UINT32_MAX};
    std::vector<uint32_t> open(1, 0);
    while (!open.empty()) {
        const WaldNode &node = nodes[open.back()];
        open.pop_back();
        if (enters(node, ray, hit.t) == INFINITY) continue;
        for (uint32_t i = 0; i < node.triCount; i++) {
            uint32_t id = ids[node.leftFirst + i];
            float t = float(ray_triangle(ray.origin, ray.direction, ray.t_min, corners + 9 * id));
            if (std::isinf(t) || t > ray.t_max) continue;
            if (t < hit.t || (t == hit.t && id < hit.object)) hit = {t, id};
        }
        if (node.triCount > 0) continue;
        // The nearer child is traced first.
        uint32_t near = node.leftFirst, far = node.leftFirst + 1;
        if (enters(nodes[far], ray, hit.t) < enters(nodes[near], ray, hit.t)) std::swap(near, far);
        open.push_back(far), open.push_back(near);
    }
    return hit;
}

/// Compares distances with those of the library, from which rounding errors may differ.
template <class Distance> void compare(const char *who, const std::vector<BvsHit> &hits, Distance distance) {
    auto start = std::chrono::steady_clock::now();
    size_t met = 0, wrong = 0;
    for (size_t i = 0; i < hits.size(); i++) {
        float t = distance(i), ours = hits[i].t;
        met += ours < INFINITY;
        wrong += std::isinf(t) != std::isinf(ours) || (!std::isinf(t) && std::fabs(t - ours) > 1e-4f * ours);
    }
    std::printf("%s: %zu of %zu rays hit, %zu unlike the library's, %.2f s\n", who, met, hits.size(), wrong, seconds_since(start));
    if (wrong > 0 || met == 0) std::exit(1);
}

} // namespace

int main() {
    std::mt19937 random(1);
    auto within = [&](float size) { return size * float(random()) / float(std::mt19937::max()); };
    std::vector<float> corners;
    for (int i = 0; i < 20000; i++) {
        float at[3] = {within(100), within(100), within(100)};
        for (int corner = 0; corner < 3; corner++)
            for (float c : at) corners.push_back(c + within(3));
    }
    size_t triangles = corners.size() / 9;

    BvsTree *tree = checked(bvs_tree_from_triangles(corners.data(), triangles, 0.0, 1.0));
    double first = 0, cost = 0;
    check(bvs_tree_cost(tree, BVS_COST_SAH, &first));
    check(bvs_tree_improve(tree, 1.0));
    // Another thread may end a search of any length.
    std::atomic<bool> enough = false;
    std::thread user([&] { std::this_thread::sleep_for(std::chrono::milliseconds(100)), enough = true; });
    auto is_enough = [](void *flag) { return uint8_t(static_cast<std::atomic<bool> *>(flag)->load()); };
    check(bvs_tree_improve_until(tree, 3600.0, is_enough, &enough));
    user.join();
    check(bvs_tree_cost(tree, BVS_COST_SAH, &cost));
    std::printf("%zu triangles: surface area heuristic %.2f, after a second %.2f\n", triangles, first, cost);

    std::vector<BvsRay> rays(100000);
    for (BvsRay &ray : rays) {
        ray.t_min = 0, ray.t_max = INFINITY;
        float length = 0;
        for (int i = 0; i < 3; i++) {
            ray.origin[i] = within(100), ray.direction[i] = within(2) - 1;
            length += ray.direction[i] * ray.direction[i];
        }
        for (float &component : ray.direction) component /= std::sqrt(length);
    }
    BvsTracer *tracer = checked(bvs_tracer_new(tree));
    std::vector<BvsHit> hits(rays.size());
    auto start = std::chrono::steady_clock::now();
    check(bvs_tracer_nearest_hits(tracer, rays.data(), rays.size(), 0, hits.data()));
    std::printf("the library: %zu rays, %.2f s\n", rays.size(), seconds_since(start));

    // A search for a frame would have turned the boxes.
    double frame[12];
    check(bvs_tree_frame(tree, frame));
    const double axes[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    if (!std::equal(frame, frame + 12, axes)) return 1;
    size_t node_count = 0, id_count = 0;
    const BvsNode *nodes = checked(bvs_tree_nodes(tree, &node_count));
    const uint32_t *ids = checked(bvs_tree_object_ids(tree, &id_count));
    std::vector<WaldNode> wald(node_count);
    std::memcpy(wald.data(), nodes, node_count * sizeof(WaldNode));
    compare("tinybvh's nodes", hits, [&](size_t i) { return nearest_in(wald.data(), ids, corners.data(), rays[i]).t; });

    bvs_tracer_free(tracer);
    bvs_tree_free(tree);
}
