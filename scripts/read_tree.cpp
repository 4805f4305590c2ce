// Reads a tree file (format: the documentation of bvh_core::file) on a little-endian machine: prints what it is.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <vector>

struct Header {
    char magic[8];
    uint32_t version, endianness, layout, objective;
    uint64_t nodes, objects, blocks;
    double cost, traversal, intersection;
    uint64_t seed, work, scene;
    float bounds[6];
    char method[64];
    uint64_t checksum;
};
struct Node {
    float min[3], max[3];
    uint32_t first, tagged_count;
};
static_assert(sizeof(Header) == 192 && sizeof(Node) == 32);

static uint64_t rotate(uint64_t x, int by) { return x << by | x >> (64 - by); }

static uint64_t mix(uint64_t h, uint64_t x) { return rotate((h ^ x) * 0x9e3779b97f4a7c15u, 29); }

static uint64_t quarter_sum(std::vector<char> bytes) {
    uint64_t lanes[32], result = bytes.size(), word;
    for (int k = 0; k < 32; ++k) lanes[k] = k + 1;
    bytes.resize((bytes.size() + 255) / 256 * 256);
    for (size_t i = 0; i < bytes.size() / 8; ++i) {
        std::memcpy(&word, &bytes[8 * i], 8);
        uint64_t& lane = lanes[i % 32];
        lane = rotate(lane ^ word, 16) * 33;
        lane ^= lane >> 23;
    }
    for (uint64_t lane : lanes) result = mix(result, lane);
    return result;
}

static uint64_t checksum(const char* bytes, size_t count) {
    const size_t quarter = (count + 1023) / 1024 * 256;
    uint64_t result = count;
    for (int k = 0; k < 4; ++k) {
        const char *begin = bytes + std::min(k * quarter, count), *end = bytes + std::min((k + 1) * quarter, count);
        result = mix(result, quarter_sum({begin, end}));
    }
    return result;
}

int main(int argc, char** argv) {
    std::ifstream file(argc > 1 ? argv[1] : "", std::ios::binary);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    Header header{};
    if (bytes.size() >= sizeof header) std::memcpy(&header, bytes.data(), sizeof header);
    if (std::memcmp(header.magic, "\x89" "BVH\r\n\x1a\n", 8) || header.version != 1 || header.endianness != 0x01020304 ||
        header.layout != 0 || bytes.size() != sizeof header + 32 * header.nodes + 4 * header.objects) {
        return std::fprintf(stderr, "not a tree file of version 1, or cut\n"), 1;
    }
    const uint64_t rest = checksum(bytes.data() + sizeof header, bytes.size() - sizeof header);
    std::memcpy(&bytes[184], &rest, sizeof rest);
    if (checksum(bytes.data(), sizeof header) != header.checksum) return std::fprintf(stderr, "damaged\n"), 1;
    std::vector<Node> nodes(header.nodes);
    if (!nodes.empty()) std::memcpy(nodes.data(), &bytes[192], 32 * nodes.size());
    std::vector<unsigned> depth(nodes.size() + 1);
    size_t leaves = 0;
    double area = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
        const Node& node = nodes[i];
        if (node.tagged_count >> 31) { ++leaves; continue; }
        double d[3];
        for (int k = 0; k < 3; ++k) d[k] = double(node.max[k]) - double(node.min[k]);
        area += d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
        for (uint32_t k = 0; k < node.tagged_count; ++k) depth.at(node.first + k) = depth[i] + 1;
    }
    std::printf("method: %.64s\nseed: %llu\nwork: %llu\nobjects: %llu\nnodes: %zu\ninner nodes: %zu\nleaves: %zu\ndepth: %u\n",
                header.method, (unsigned long long)header.seed, (unsigned long long)header.work,
                (unsigned long long)header.objects, nodes.size(), nodes.size() - leaves, leaves,
                *std::max_element(depth.begin(), depth.end()));
    std::printf("cost when saved: %.17g\ninternal area: %.17g\n", header.cost, area);
}
