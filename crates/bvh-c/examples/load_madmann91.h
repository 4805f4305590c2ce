// Loads files of `bvh export --for madmann91-bvh`. Needs madmann91/bvh alone, version 2, its src on the include path.

#pragma once

#include <bvh/v2/bvh.h>
#include <bvh/v2/node.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

using Bvh = bvh::v2::Bvh<bvh::v2::Node<float, 3>>;

inline Bvh load(const std::string &path) {
    struct { char magic[4]; uint32_t version, nodes, ids, rest[4]; } header;
    struct { float min[3]; uint32_t first; float max[3]; uint32_t count; } from;
    std::ifstream file(path, std::ios::binary);
    file.read(reinterpret_cast<char *>(&header), sizeof header);
    if (!file || std::memcmp(header.magic, "BVHX", 4) != 0 || header.version != 1) throw std::runtime_error(path + " is no file of bvh export");
    Bvh bvh;
    bvh.nodes.resize(header.nodes);
    for (auto &node : bvh.nodes) {
        file.read(reinterpret_cast<char *>(&from), sizeof from);
        node.set_bbox({{from.min[0], from.min[1], from.min[2]}, {from.max[0], from.max[1], from.max[2]}});
        node.index = Bvh::Index(from.first << Bvh::Index::prim_count_bits | from.count);
    }
    std::vector<uint32_t> ids(header.ids);
    file.read(reinterpret_cast<char *>(ids.data()), std::streamsize(4 * ids.size()));
    if (!file) throw std::runtime_error(path + " is too short");
    bvh.prim_ids.assign(ids.begin(), ids.end());
    return bvh;
}
