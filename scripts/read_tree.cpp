// Prints the facts about a tree file on a little-endian machine. The documentation of
// bvh_core::file describes the format.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <vector>

#pragma pack(push, 4)
struct Header {
    char magic[8];
    uint32_t version, endianness, objective, scene;
    uint64_t nodes, objects, seed, work;
    double cost, traversal, intersection;
    float bounds[6];
    char method[64];
    uint64_t references;
    uint32_t flags, zeros[2], checksum;
};
struct Node {
    float min[3], max[3];
    uint32_t first, tagged_count;
};
#pragma pack(pop)
static_assert(sizeof(Header) == 192 && sizeof(Node) == 32);

// Returns the CRC-32 of zlib; `sum` is the checksum of the preceding bytes.
static uint32_t crc32(const char* bytes, size_t count, uint32_t sum = 0) {
    static const std::vector<uint32_t> table = [] {
        std::vector<uint32_t> table(256);
        for (uint32_t byte = 0; byte < 256; ++byte) {
            table[byte] = byte;
            for (int bit = 0; bit < 8; ++bit) table[byte] = table[byte] >> 1 ^ (table[byte] & 1) * 0xedb88320u;
        }
        return table;
    }();
    sum = ~sum;
    for (size_t i = 0; i < count; ++i) sum = sum >> 8 ^ table[(sum ^ uint8_t(bytes[i])) & 255];
    return ~sum;
}

int main(int argc, char** argv) {
    std::ifstream file(argc > 1 ? argv[1] : "", std::ios::binary);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    Header header{};
    if (bytes.size() >= sizeof header) std::memcpy(&header, bytes.data(), sizeof header);
    const bool visits = header.flags & 1;
    const size_t frame = header.flags & 2 ? 96 : 0;
    if (std::memcmp(header.magic, "\x89" "BVH\r\n\x1a\n", 8) || header.version != 4 || header.endianness != 0x01020304 ||
        bytes.size() != sizeof header + (visits ? 36 : 32) * header.nodes + 4 * header.references + frame) {
        return std::fprintf(stderr, "not a tree file of version 4, or cut\n"), 1;
    }
    const uint32_t body = crc32(bytes.data() + sizeof header, bytes.size() - sizeof header);
    if (crc32(bytes.data(), 188, body) != header.checksum) return std::fprintf(stderr, "damaged\n"), 1;
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
