// Loads files of `bvh export --for tinybvh`, and makes tinybvh's other layouts of their trees. Needs tiny_bvh.h alone.

#pragma once

#include "tiny_bvh.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

/// Loads a file into an empty tree. There are three vertices for each triangle, which live as long as the tree.
inline void load(tinybvh::BVH &tree, const std::string &path, const tinybvh::bvhvec4 *vertices, uint32_t triangles) {
    struct { char magic[4]; uint32_t version, nodes, ids, rest[4]; } header;
    std::ifstream file(path, std::ios::binary);
    file.read(reinterpret_cast<char *>(&header), sizeof header);
    if (!file || std::memcmp(header.magic, "BVHX", 4) != 0 || header.version != 1) throw std::runtime_error(path + " is no file of bvh export");
    constexpr size_t NODE = sizeof(tinybvh::BVH::BVHNode);
    tree.usedNodes = tree.newNodePtr = header.nodes, tree.idxCount = header.ids, tree.triCount = triangles;
    // Leaves that are divided for other layouts need room.
    tree.allocatedNodes = header.nodes + 2 * header.ids;
    tree.bvhNode = static_cast<tinybvh::BVH::BVHNode *>(tree.AlignedAlloc(NODE * tree.allocatedNodes));
    tree.primIdx = static_cast<uint32_t *>(tree.AlignedAlloc(4 * size_t(header.ids)));
    file.read(reinterpret_cast<char *>(tree.bvhNode), std::streamsize(NODE * header.nodes));
    file.read(reinterpret_cast<char *>(tree.primIdx), std::streamsize(4 * size_t(header.ids)));
    if (!file) throw std::runtime_error(path + " is too short");
    tree.verts = tinybvh::bvhvec4slice(vertices, 3 * triangles, sizeof *vertices);
    tree.aabbMin = tree.bvhNode[0].aabbMin, tree.aabbMax = tree.bvhNode[0].aabbMax;
    tree.refittable = false;
}

/// Makes a layout by way of nodes of N children, each of whose leaves has one block of triangles: BVH4_CPU (N is 4) and BVH8_CPU
/// (8) have blocks of four, BVH8_CWBVH (8) of three. Changes the leaves of the tree, which must outlive the layout.
template <int N, class Layout> void convert(Layout &to, tinybvh::MBVH<N> &wide, tinybvh::BVH &tree, uint32_t block) {
    uint32_t first = 0;
    tree.CombineLeafs(block, first, 0);
    tree.SplitLeafs(block);
    tree.Compact();
    wide.ConvertFrom(tree);
    to.ConvertFrom(wide);
}
