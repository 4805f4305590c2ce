// Measures tinybvh and madmann91/bvh (version 2) in their own trees and in searched ones, for the bench `interop` of the
// attic, which writes the folder:
//
//   interop FOLDER ROUNDS TREE...
//
// triangles.bin has 9 f32 for each, primary.bin, incoherent.bin and shadow.bin have 8 f32 for each ray, and TREE.TARGET.bin is
// a file of `bvh export`. Writes lines to standard output: 'tests' with hits, tests of boxes and of triangles; and 'times' with
// the seconds of each round.

#define TINYBVH_IMPLEMENTATION
#include "load_madmann91.h"
#include "load_tinybvh.h"
#include "ray_triangle.h"

#include <bvh/v2/default_builder.h>
#include <bvh/v2/stack.h>
#include <bvh/v2/tri.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace {

struct Ray {
    float origin[3], t_min, direction[3], t_max;
};
/// A binary node as tinybvh has it.
struct Node {
    float min[3];
    uint32_t first;
    float max[3];
    uint32_t count;
};
static_assert(sizeof(Node) == sizeof(tinybvh::BVH::BVHNode));

template <class T> std::vector<T> read(const std::string &path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error(path + " cannot be read");
    std::vector<char> from{std::istreambuf_iterator<char>(file), {}};
    std::vector<T> to(from.size() / sizeof(T));
    memcpy(to.data(), from.data(), to.size() * sizeof(T));
    return to;
}

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// ---------------------------------------------------------------------------------------------------------- counts

/// A tree of any width for counts.
struct Counted {
    struct Part {
        const float *min, *max;
        uint32_t first, count;
        std::vector<uint32_t> children;
    };
    std::vector<Part> parts;
    const uint32_t *ids;
    bool is_wide;
    /// Whether queries for any hit visit children in their order.
    bool any_in_order = false;
};

Counted counted(const Node *nodes, size_t count, const uint32_t *ids) {
    Counted tree{{}, ids, false};
    for (size_t i = 0; i < count; i++) {
        const Node &node = nodes[i];
        tree.parts.push_back({node.min, node.max, node.first, node.count, {}});
        if (node.count == 0) tree.parts.back().children = {node.first, node.first + 1};
    }
    return tree;
}

template <int M> Counted counted(const tinybvh::MBVH<M> &wide) {
    Counted tree{{}, wide.bvh.primIdx, true};
    for (uint32_t i = 0; i < wide.usedNodes; i++) {
        const auto &node = wide.mbvhNode[i];
        tree.parts.push_back({&node.aabbMin.x, &node.aabbMax.x, node.firstTri, node.triCount, {}});
        for (uint32_t child : node.child)
            if (child != 0) tree.parts.back().children.push_back(child);
    }
    return tree;
}

/// Counts boxes of a binary tree and triangles, or nodes of a wide tree and blocks of up to four triangles. Visits the nearer
/// children first, or children in their order, as the libraries do.
void count(const Counted &tree, const std::vector<float> &corners, const Ray &ray, bool any, uint64_t (&sums)[3]) {
    double nearest = ray.t_max;
    auto enters = [&](uint32_t index) {
        const auto &part = tree.parts[index];
        double low = ray.t_min, high = nearest;
        for (int i = 0; i < 3; i++) {
            double inverse = 1.0 / ray.direction[i];
            double a = (double(part.min[i]) - ray.origin[i]) * inverse, b = (double(part.max[i]) - ray.origin[i]) * inverse;
            low = std::fmax(low, std::fmin(a, b)), high = std::fmin(high, std::fmax(a, b));
        }
        return low <= high ? low : INFINITY;
    };
    std::vector<std::pair<double, uint32_t>> open = {{0, 0}}, hit;
    bool is_hit = false;
    while (!open.empty() && !(any && is_hit)) {
        auto [entry, index] = open.back();
        open.pop_back();
        if (entry > nearest) continue;
        const auto &part = tree.parts[index];
        if (part.count > 0) {
            sums[2] += tree.is_wide ? (part.count + 3) / 4 : 0;
            for (uint32_t i = 0; i < part.count && !(any && is_hit); i++) {
                double t = ray_triangle(ray.origin, ray.direction, ray.t_min, &corners[9 * size_t(tree.ids[part.first + i])]);
                sums[2] += !tree.is_wide;
                if (t < nearest) is_hit = true, nearest = t;
            }
            continue;
        }
        sums[1] += tree.is_wide ? 1 : 2;
        hit.clear();
        for (uint32_t child : part.children)
            if (double at = enters(child); at < INFINITY) hit.push_back({at, child});
        if (any && tree.any_in_order) std::reverse(hit.begin(), hit.end());
        else std::stable_sort(hit.begin(), hit.end(), [](auto &a, auto &b) { return a.first > b.first; });
        open.insert(open.end(), hit.begin(), hit.end());
    }
    sums[0] += is_hit;
}

// ----------------------------------------------------------------------------------------------------------- trees

struct Result {
    size_t hits;
    double seconds;
};

/// A tree in a tracer.
struct Tree {
    std::string tracer, name;
    std::function<Result(const std::vector<Ray> &rays, bool any)> trace;
    /// Without parts, where other code counts or nothing does.
    Counted counted;
    bool has_any;
};

struct Scene {
    std::vector<float> corners;
    std::vector<tinybvh::bvhvec4> vertices;
    std::vector<Tree> trees;
};

// What is allocated below lives as long as the program.

template <class Layout> void add(Scene &scene, const char *tracer, const std::string &name, const Layout &layout, Counted counted, bool has_any) {
    auto trace = [&layout](const std::vector<Ray> &rays, bool any) {
        std::vector<tinybvh::Ray> theirs;
        for (const auto &[o, t_min, d, t_max] : rays)
            theirs.push_back({{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, std::fmin(t_max, BVH_FAR)});
        size_t hits = 0;
        double start = now();
        if (any)
            for (const auto &ray : theirs) hits += layout.IsOccluded(ray);
        else
            for (auto &ray : theirs) layout.Intersect(ray), hits += ray.hit.t < BVH_FAR;
        return Result{hits, now() - start};
    };
    scene.trees.push_back({tracer, name, trace, std::move(counted), has_any});
}

/// Adds a tree in all of tinybvh's layouts, each converted from a tree of its own.
void add_tinybvh(Scene &scene, const std::string &name, std::function<void(tinybvh::BVH &)> make) {
    auto made = [&]() -> tinybvh::BVH & {
        auto *tree = new tinybvh::BVH;
        make(*tree);
        // Room for leaves that are divided.
        auto *nodes = tree->bvhNode;
        tree->newNodePtr = tree->usedNodes, tree->allocatedNodes = tree->usedNodes + 2 * tree->idxCount;
        tree->bvhNode = (tinybvh::BVH::BVHNode *)tree->AlignedAlloc(tree->allocatedNodes * sizeof(Node));
        memcpy((void *)tree->bvhNode, nodes, tree->usedNodes * sizeof(Node));
        return *tree;
    };
    auto &binary = made();
    add(scene, "tinybvh", name, binary, counted((Node *)binary.bvhNode, binary.usedNodes, binary.primIdx), true);
    auto &gpu = *new tinybvh::BVH_GPU;
    gpu.ConvertFrom(binary);
    add(scene, "tinybvh BVH_GPU", name, gpu, {}, false);
    // The library divides a large leaf into a chain of nodes, which may overflow the stacks of its wide layouts.
    for (uint32_t i = 0; i < binary.usedNodes; i++)
        if (i != 1 && binary.bvhNode[i].triCount > 100) return;
    auto wide = [&](const char *tracer, auto &layout, auto &nodes, uint32_t block, bool is_on_cpu) {
        auto &tree = made();
        // The triangles of each subtree side by side.
        tree.Compact();
        convert(layout, nodes, tree, block);
        add(scene, tracer, name, layout, is_on_cpu ? counted(nodes) : Counted{}, is_on_cpu);
    };
    wide("tinybvh BVH4_CPU", *new tinybvh::BVH4_CPU, *new tinybvh::MBVH<4>, 4, true);
    wide("tinybvh BVH8_CPU", *new tinybvh::BVH8_CPU, *new tinybvh::MBVH<8>, 4, true);
    wide("tinybvh CWBVH", *new tinybvh::BVH8_CWBVH, *new tinybvh::MBVH<8>, 3, false);
}

using TheirNode = bvh::v2::Node<float, 3>;
using Vec3 = bvh::v2::Vec<float, 3>;
using Tri = bvh::v2::Tri<float, 3>;

void add_madmann91(Scene &scene, const std::string &name, const Bvh &tree) {
    auto *nodes = new std::vector<Node>;
    for (const TheirNode &node : tree.nodes) {
        auto [min, max] = std::pair(node.get_bbox().min, node.get_bbox().max);
        nodes->push_back({{min[0], min[1], min[2]}, uint32_t(node.index.first_id()), {max[0], max[1], max[2]}, uint32_t(node.index.prim_count())});
    }
    auto *ids = new std::vector<uint32_t>(tree.prim_ids.begin(), tree.prim_ids.end());
    // In the order of leaves, as in the library's examples.
    auto *triangles = new std::vector<bvh::v2::PrecomputedTri<float>>;
    for (size_t id : tree.prim_ids) {
        const float *at = &scene.corners[9 * id];
        triangles->emplace_back(Tri({at[0], at[1], at[2]}, {at[3], at[4], at[5]}, {at[6], at[7], at[8]}));
    }
    auto trace = [&tree, triangles](const std::vector<Ray> &rays, bool any) {
        std::vector<bvh::v2::Ray<float, 3>> theirs;
        for (const auto &[o, t_min, d, t_max] : rays)
            theirs.push_back({Vec3(o[0], o[1], o[2]), Vec3(d[0], d[1], d[2]), t_min, std::fmin(t_max, BVH_FAR)});
        bvh::v2::SmallStack<Bvh::Index, 64> stack;
        size_t hits = 0;
        double start = now();
        for (auto &ray : theirs) {
            bool is_hit = false;
            auto leaf = [&](size_t begin, size_t end) {
                for (size_t i = begin; i < end; i++)
                    if (auto hit = (*triangles)[i].intersect(ray)) {
                        ray.tmax = std::get<0>(*hit), is_hit = true;
                        if (any) return true;
                    }
                return is_hit;
            };
            stack.size = 0;
            if (any) tree.intersect<true, false>(ray, tree.get_root().index, stack, leaf);
            else tree.intersect<false, false>(ray, tree.get_root().index, stack, leaf);
            hits += is_hit;
        }
        return Result{hits, now() - start};
    };
    scene.trees.push_back({"madmann91-bvh", name, trace, counted(nodes->data(), nodes->size(), ids->data()), true});
    scene.trees.back().counted.any_in_order = true;
}

/// Builds madmann91's tree at its highest quality, which is its default.
Bvh *madmann91_built(const std::vector<float> &corners) {
    std::vector<bvh::v2::BBox<float, 3>> boxes;
    std::vector<Vec3> centers;
    for (size_t i = 0; i < corners.size(); i += 9) {
        const float *at = &corners[i];
        Tri triangle({at[0], at[1], at[2]}, {at[3], at[4], at[5]}, {at[6], at[7], at[8]});
        boxes.push_back(triangle.get_bbox()), centers.push_back(triangle.get_center());
    }
    return new Bvh(bvh::v2::DefaultBuilder<TheirNode>::build(boxes, centers, {}));
}

} // namespace

int main(int words, char **arguments) {
    if (words < 3) return fprintf(stderr, "interop FOLDER ROUNDS TREE...\n"), 2;
    std::string folder = std::string(arguments[1]) + "/";
    size_t rounds = size_t(atoi(arguments[2]));
    Scene scene;
    scene.corners = read<float>(folder + "triangles.bin");
    uint32_t triangles = uint32_t(scene.corners.size() / 9);
    for (size_t i = 0; i < scene.corners.size(); i += 3)
        scene.vertices.emplace_back(scene.corners[i], scene.corners[i + 1], scene.corners[i + 2], 0.f);

    auto build = [&](tinybvh::BVH &tree) { tree.threadedBuild = false, tree.Build(scene.vertices.data(), triangles); };
    add_tinybvh(scene, "build", build);
    add_tinybvh(scene, "optimized", [&](tinybvh::BVH &tree) { build(tree), tree.Optimize(50); });
    add_tinybvh(scene, "HQ divided", [&](tinybvh::BVH &tree) { tree.threadedBuild = false, tree.BuildHQ(scene.vertices.data(), triangles); });
    add_madmann91(scene, "high quality", *madmann91_built(scene.corners));
    for (int i = 3; i < words; i++) {
        std::string name = arguments[i];
        add_tinybvh(scene, name, [&](tinybvh::BVH &tree) { load(tree, folder + name + ".tinybvh.bin", scene.vertices.data(), triangles); });
        add_madmann91(scene, name, *new Bvh(load(folder + name + ".madmann91-bvh.bin")));
    }
    for (const char *kind : {"primary", "incoherent", "shadow"}) {
        bool any = !strcmp(kind, "shadow");
        auto rays = read<Ray>(folder + kind + ".bin");
        std::vector<std::vector<double>> seconds(scene.trees.size());
        for (size_t round = 0; round < rounds; round++)
            for (size_t turn = 0; turn < scene.trees.size(); turn++) {
                size_t i = (turn + round) % scene.trees.size();
                const Tree &tree = scene.trees[i];
                if (!any || tree.has_any) seconds[i].push_back(tree.trace(rays, any).seconds);
            }
        for (size_t i = 0; i < scene.trees.size(); i++) {
            const Tree &tree = scene.trees[i];
            if (any && !tree.has_any) continue;
            size_t hits = tree.trace(rays, any).hits;
            if (!tree.counted.parts.empty()) {
                uint64_t sums[3] = {0, 0, 0};
                for (const Ray &ray : rays) count(tree.counted, scene.corners, ray, any, sums);
                printf("tests,%s,%s,%s,%llu %llu %llu\n", tree.tracer.c_str(), kind, tree.name.c_str(), (unsigned long long)sums[0],
                       (unsigned long long)sums[1], (unsigned long long)sums[2]);
                // Rays through edges may differ.
                double unlike = std::fabs(double(hits) - double(sums[0]));
                if (unlike > 0.001 * double(rays.size()))
                    return fprintf(stderr, "%s, %s, %s: %zu hits, and %llu counted\n", tree.tracer.c_str(), kind, tree.name.c_str(), hits, (unsigned long long)sums[0]), 1;
            }
            if (seconds[i].empty()) continue;
            printf("times,%s,%s,%s,", tree.tracer.c_str(), kind, tree.name.c_str());
            for (size_t round = 0; round < rounds; round++) printf("%s%.9f", round ? " " : "", seconds[i][round]);
            printf("\n");
        }
    }
}
