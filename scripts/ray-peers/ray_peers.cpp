// Traces rays with Embree and tinybvh for the harness: a mesh and rays in through standard input, seconds and distances
// out through standard output. `ray_peers "LIBRARY MODE"` traces by one mode. `ray_peers` alone lists all modes, a line
// each: instruction set, library, version and mode, between tabs.
//
// Compiled with -DDOUBLE, it traces in f64 instead: the same mesh and rays, whose numbers are exact in f64, with Embree's
// user geometry, tinybvh, and madmann91/bvh if its folder is given. Distances are rounded when the time is over.
//
// Everything is in the machine's byte order (little-endian on every supported one):
//
//   in:   u32 triangles, then 9 f32 for each
//   out:  f64 seconds that the build took
//   in:   u32 any hit (1) or nearest hit (0), u32 picture (1 or 0), u32 rays, u32 rays per part, then 8 f32 for each ray:
//         origin, t_min, direction (a unit vector), t_max
//   out:  f64 seconds for each part, then f32 for each ray: the distance of its hit, or infinity; for any hit 0 or infinity
//
// and so on until the input ends. The rays of a picture go from one point through its pixels, which are in Morton order
// from the upper left corner in right-handed coordinates. Only tinybvh's packets make use of it.

#define TINYBVH_IMPLEMENTATION
#include "tiny_bvh.h"

#if defined(DOUBLE) && __has_include(<bvh/v2/bvh.h>)
#define MADMANN
#include <bvh/v2/bvh.h>
#include <bvh/v2/default_builder.h>
#include <bvh/v2/node.h>
#include <bvh/v2/stack.h>
#include <bvh/v2/tri.h>
#endif

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace {

constexpr float MISS = std::numeric_limits<float>::infinity();

struct Ray {
    float origin[3], t_min, direction[3], t_max;
};

struct Query {
    uint32_t any, picture, count, part;
};

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A structure over a mesh.
struct Tracer {
    virtual ~Tracer() = default;
    /// Answers `count` consecutive rays of a query, of which `rays` is the first, and returns the seconds of tracing alone.
    /// The harness makes its rays before its clock starts, so conversions to the library's rays are not timed either:
    /// they are made in blocks that stay in the first cache.
    virtual double trace(const Query &query, const Ray *rays, size_t count, float *distances) = 0;
};

constexpr size_t BLOCK = 256;

// ---------------------------------------------------------------------------------------------------------- Embree
// The part of Embree 4's interface that is used here, so that only its library is needed, not its headers.

/// Embree's packets of rays, by component: the same layout for 8 and 16 rays.
template <int N> struct alignas(4 * N) Rays {
    float org_x[N], org_y[N], org_z[N], tnear[N], dir_x[N], dir_y[N], dir_z[N], time[N], tfar[N];
    unsigned mask[N], id[N], flags[N];
};
template <int N> struct alignas(4 * N) Hits {
    float Ng_x[N], Ng_y[N], Ng_z[N], u[N], v[N];
    unsigned primID[N], geomID[N], instID[N], instPrimID[N];
};
template <int N> struct RayHits {
    Rays<N> ray;
    Hits<N> hit;
};
/// Embree has one struct for nearest hits and one for any hits, with the same members.
struct Arguments {
    unsigned flags, features;
    void *context, *filter, *callback;
    float min_width;
};

extern "C" {
struct RTCDeviceTy;
struct RTCSceneTy;
struct RTCGeometryTy;
struct alignas(16) RTCRay {
    float org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar;
    unsigned mask, id, flags;
};
struct alignas(16) RTCHit {
    float Ng_x, Ng_y, Ng_z, u, v;
    unsigned primID, geomID, instID, instPrimID;
};
struct RTCRayHit {
    RTCRay ray;
    RTCHit hit;
};
RTCDeviceTy *rtcNewDevice(const char *config);
ssize_t rtcGetDeviceProperty(RTCDeviceTy *device, int property);
RTCSceneTy *rtcNewScene(RTCDeviceTy *device);
void rtcSetSceneFlags(RTCSceneTy *scene, int flags);
void rtcSetSceneBuildQuality(RTCSceneTy *scene, int quality);
RTCGeometryTy *rtcNewGeometry(RTCDeviceTy *device, int type);
void *rtcSetNewGeometryBuffer(RTCGeometryTy *geometry, int type, unsigned slot, int format, size_t stride, size_t count);
void rtcCommitGeometry(RTCGeometryTy *geometry);
unsigned rtcAttachGeometry(RTCSceneTy *scene, RTCGeometryTy *geometry);
void rtcCommitScene(RTCSceneTy *scene);
void rtcIntersect1(RTCSceneTy *scene, RTCRayHit *ray, void *arguments);
void rtcOccluded1(RTCSceneTy *scene, RTCRay *ray, void *arguments);
void rtcIntersect8(const int *valid, RTCSceneTy *scene, RayHits<8> *rays, Arguments *arguments);
void rtcOccluded8(const int *valid, RTCSceneTy *scene, Rays<8> *rays, Arguments *arguments);
void rtcIntersect16(const int *valid, RTCSceneTy *scene, RayHits<16> *rays, Arguments *arguments);
void rtcOccluded16(const int *valid, RTCSceneTy *scene, Rays<16> *rays, Arguments *arguments);

struct RTCBounds {
    float lower[3], align0, upper[3], align1;
};
struct RTCBoundsArguments {
    void *data;
    unsigned primID, timeStep;
    RTCBounds *bounds;
};
/// The arguments of both functions of a user geometry. An occluded ray is the first member of its `RTCRayHit`.
struct RTCFunctionArguments {
    int *valid;
    void *data;
    unsigned primID;
    void *context;
    RTCRayHit *ray;
    unsigned count, geomID;
};
void rtcSetGeometryUserPrimitiveCount(RTCGeometryTy *geometry, unsigned count);
void rtcSetGeometryUserData(RTCGeometryTy *geometry, void *data);
void rtcSetGeometryBoundsFunction(RTCGeometryTy *geometry, void (*bounds)(const RTCBoundsArguments *), void *data);
void rtcSetGeometryIntersectFunction(RTCGeometryTy *geometry, void (*intersect)(const RTCFunctionArguments *));
void rtcSetGeometryOccludedFunction(RTCGeometryTy *geometry, void (*occluded)(const RTCFunctionArguments *));
}

#ifdef __AVX512F__
constexpr const char *INSTRUCTIONS = "AVX-512";
constexpr const char *EMBREE_CONFIG = "threads=1,set_affinity=0";
constexpr int PACKET = 16;
#else
constexpr const char *INSTRUCTIONS = "AVX2";
constexpr const char *EMBREE_CONFIG = "threads=1,set_affinity=0,isa=avx2";
constexpr int PACKET = 8;
#endif

template <int N> void intersect(const int *valid, RTCSceneTy *scene, RayHits<N> *rays, Arguments *arguments) {
    if constexpr (N == 8) rtcIntersect8(valid, scene, rays, arguments);
    else rtcIntersect16(valid, scene, rays, arguments);
}

template <int N> void occluded(const int *valid, RTCSceneTy *scene, Rays<N> *rays, Arguments *arguments) {
    if constexpr (N == 8) rtcOccluded8(valid, scene, rays, arguments);
    else rtcOccluded16(valid, scene, rays, arguments);
}

/// Embree, ray by ray.
class Embree : public Tracer {
protected:
    RTCSceneTy *scene;

public:
    Embree(const std::vector<float> &corners, bool high, bool robust) {
        constexpr int TRIANGLE = 0, INDEX = 0, VERTEX = 1, UINT3 = 0x5003, FLOAT3 = 0x9003;
        constexpr int ROBUST = 1 << 2, MEDIUM_QUALITY = 1, HIGH_QUALITY = 2;
        RTCDeviceTy *device = rtcNewDevice(EMBREE_CONFIG);
        scene = rtcNewScene(device);
        rtcSetSceneFlags(scene, robust ? ROBUST : 0);
        rtcSetSceneBuildQuality(scene, high ? HIGH_QUALITY : MEDIUM_QUALITY);
        RTCGeometryTy *mesh = rtcNewGeometry(device, TRIANGLE);
        size_t vertices = corners.size() / 3;
        memcpy(rtcSetNewGeometryBuffer(mesh, VERTEX, 0, FLOAT3, 12, vertices), corners.data(), 12 * vertices);
        auto *indices = static_cast<unsigned *>(rtcSetNewGeometryBuffer(mesh, INDEX, 0, UINT3, 12, vertices / 3));
        for (size_t i = 0; i < vertices; i++) indices[i] = unsigned(i);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcCommitScene(scene);
    }

    double trace(const Query &query, const Ray *rays, size_t count, float *distances) override {
        double seconds = 0;
        RTCRayHit block[BLOCK];
        for (size_t first = 0; first < count; first += BLOCK) {
            size_t size = std::min(BLOCK, count - first);
            for (size_t i = 0; i < size; i++) {
                const auto &[origin, t_min, direction, t_max] = rays[first + i];
                block[i].ray = {origin[0], origin[1], origin[2], t_min, direction[0], direction[1], direction[2], 0,
                                t_max, ~0u, 0, 0};
                block[i].hit.geomID = block[i].hit.instID = block[i].hit.instPrimID = ~0u;
            }
            double start = now();
            if (query.any)
                for (size_t i = 0; i < size; i++) rtcOccluded1(scene, &block[i].ray, nullptr);
            else
                for (size_t i = 0; i < size; i++) rtcIntersect1(scene, &block[i], nullptr);
            seconds += now() - start;
            for (size_t i = 0; i < size; i++) {
                bool hit = query.any ? block[i].ray.tfar < 0 : block[i].hit.geomID != ~0u;
                distances[first + i] = !hit ? MISS : query.any ? 0 : block[i].ray.tfar;
            }
        }
        return seconds;
    }
};

/// Embree by packets of the instruction set's width, of consecutive rays. The flag says how its packets are traversed.
class EmbreePackets : public Embree {
    Arguments arguments;

public:
    EmbreePackets(const std::vector<float> &corners, bool high, bool robust, bool coherent)
        : Embree(corners, high, robust), arguments{coherent ? 1u << 16 : 0u, ~0u, nullptr, nullptr, nullptr, 0} {}

    double trace(const Query &query, const Ray *rays, size_t count, float *distances) override {
        constexpr size_t PACKETS = BLOCK / PACKET;
        double seconds = 0;
        RayHits<PACKET> block[PACKETS];
        alignas(64) int valid[PACKETS][PACKET];
        for (size_t first = 0; first < count; first += BLOCK) {
            size_t size = std::min(BLOCK, count - first), packets = (size + PACKET - 1) / PACKET;
            for (size_t i = 0; i < packets * PACKET; i++) {
                // Lanes without a ray hold the last one, and are not valid.
                const auto &[origin, t_min, direction, t_max] = rays[first + std::min(i, size - 1)];
                Rays<PACKET> &to = block[i / PACKET].ray;
                size_t lane = i % PACKET;
                to.org_x[lane] = origin[0], to.org_y[lane] = origin[1], to.org_z[lane] = origin[2];
                to.dir_x[lane] = direction[0], to.dir_y[lane] = direction[1], to.dir_z[lane] = direction[2];
                to.tnear[lane] = t_min, to.tfar[lane] = t_max, to.time[lane] = 0;
                to.mask[lane] = ~0u, to.id[lane] = 0, to.flags[lane] = 0;
                Hits<PACKET> &hit = block[i / PACKET].hit;
                hit.geomID[lane] = hit.instID[lane] = hit.instPrimID[lane] = ~0u;
                valid[i / PACKET][lane] = i < size ? -1 : 0;
            }
            double start = now();
            if (query.any)
                for (size_t i = 0; i < packets; i++) occluded(valid[i], scene, &block[i].ray, &arguments);
            else
                for (size_t i = 0; i < packets; i++) intersect(valid[i], scene, &block[i], &arguments);
            seconds += now() - start;
            for (size_t i = 0; i < size; i++) {
                const auto &[ray, hit] = block[i / PACKET];
                size_t lane = i % PACKET;
                bool is_hit = query.any ? ray.tfar[lane] < 0 : hit.geomID[lane] != ~0u;
                distances[first + i] = !is_hit ? MISS : query.any ? 0 : ray.tfar[lane];
            }
        }
        return seconds;
    }
};

// --------------------------------------------------------------------------------------------------------- tinybvh

std::vector<tinybvh::bvhvec4> padded(const std::vector<float> &corners) {
    std::vector<tinybvh::bvhvec4> vertices;
    for (size_t i = 0; i < corners.size(); i += 3) vertices.emplace_back(corners[i], corners[i + 1], corners[i + 2], 0.f);
    return vertices;
}

float far_end(const Ray &ray) { return std::fmin(ray.t_max, BVH_FAR); }

/// tinybvh's rays begin at distance 0.
tinybvh::Ray to_tinybvh(const Ray &ray) {
    const float *o = ray.origin, *d = ray.direction;
    return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, far_end(ray)};
}

/// One of tinybvh's layouts, ray by ray.
template <class Layout> class TinyBvh : public Tracer {
    std::vector<tinybvh::bvhvec4> vertices;

protected:
    Layout layout;

public:
    TinyBvh(const std::vector<float> &corners, bool splits) : vertices(padded(corners)) {
        uint32_t triangles = uint32_t(vertices.size() / 3);
        if (splits) layout.BuildHQ(vertices.data(), triangles);
        else layout.Build(vertices.data(), triangles);
    }

    double trace(const Query &query, const Ray *rays, size_t count, float *distances) override {
        double seconds = 0;
        tinybvh::Ray block[BLOCK];
        bool occluded[BLOCK];
        for (size_t first = 0; first < count; first += BLOCK) {
            size_t size = std::min(BLOCK, count - first);
            for (size_t i = 0; i < size; i++) block[i] = to_tinybvh(rays[first + i]);
            double start = now();
            if (query.any)
                for (size_t i = 0; i < size; i++) occluded[i] = layout.IsOccluded(block[i]);
            else
                for (size_t i = 0; i < size; i++) layout.Intersect(block[i]);
            seconds += now() - start;
            for (size_t i = 0; i < size; i++) {
                bool hit = query.any ? occluded[i] : block[i].hit.t < far_end(rays[first + i]);
                distances[first + i] = !hit ? MISS : query.any ? 0 : block[i].hit.t;
            }
        }
        return seconds;
    }
};

/// tinybvh's packets of 16 × 16 primary rays through its binary tree; other rays go through the same tree one by one.
class TinyBvhPackets : public TinyBvh<tinybvh::BVH> {
    static constexpr uint32_t SIDE = 16;
    static_assert(SIDE * SIDE == BLOCK);

public:
    using TinyBvh::TinyBvh;

    double trace(const Query &query, const Ray *rays, size_t count, float *distances) override {
        // In Morton order every 256 pixels are a square of 16 × 16.
        if (query.any || !query.picture || count % BLOCK != 0) return TinyBvh::trace(query, rays, count, distances);
        double seconds = 0;
        tinybvh::Ray packet[BLOCK];
        for (size_t first = 0; first < count; first += BLOCK) {
            // The order that tinybvh expects: 4 × 4 blocks of 4 × 4 pixels, mirrored, as its pictures are left-handed.
            auto pixel = [&](uint32_t i) {
                uint32_t x = SIDE - 1 - (i / 16 % 4 * 4 + i % 4), y = i / 64 * 4 + i / 4 % 4;
                uint32_t morton = 0;
                for (uint32_t bit = 0; bit < 4; bit++) morton |= (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1);
                return first + morton;
            };
            for (uint32_t i = 0; i < BLOCK; i++) packet[i] = to_tinybvh(rays[pixel(i)]);
            double start = now();
            layout.Intersect256RaysSSE(packet);
            seconds += now() - start;
            for (uint32_t i = 0; i < BLOCK; i++)
                distances[pixel(i)] = packet[i].hit.t < far_end(rays[pixel(i)]) ? packet[i].hit.t : MISS;
        }
        return seconds;
    }
};

// --------------------------------------------------------------------------------------------------------- doubles

#ifdef DOUBLE
using Corners = std::vector<double>;

/// A library in f64, ray by ray. It has a type of rays, which it makes and whose distance it returns, infinite after a
/// miss, and functions that trace one.
template <class Library> class InDouble : public Tracer {
    Library library;

public:
    InDouble(const std::vector<float> &corners) : library(Corners(corners.begin(), corners.end())) {}

    double trace(const Query &query, const Ray *rays, size_t count, float *distances) override {
        double seconds = 0;
        std::vector<typename Library::Ray> block(BLOCK);
        bool occluded[BLOCK];
        for (size_t first = 0; first < count; first += BLOCK) {
            size_t size = std::min(BLOCK, count - first);
            for (size_t i = 0; i < size; i++) block[i] = Library::ray(rays[first + i]);
            double start = now();
            if (query.any)
                for (size_t i = 0; i < size; i++) occluded[i] = library.occluded(block[i]);
            else
                for (size_t i = 0; i < size; i++) library.intersect(block[i]);
            seconds += now() - start;
            for (size_t i = 0; i < size; i++)
                distances[first + i] = !query.any ? float(Library::distance(block[i])) : occluded[i] ? 0 : MISS;
        }
        return seconds;
    }
};

/// Embree's boxes, and a function in f64 for each triangle, as particle transport calls Embree: robust, of high quality,
/// with boxes that are wider by a millionth of the scene. The functions exclude no triangle and ask for no side.
class EmbreeUser {
    RTCSceneTy *scene;
    Corners corners;
    double margin = 0;

public:
    /// Embree's ray, with what it is in f64. Embree returns it to the functions.
    struct Ray : RTCRayHit {
        double origin[3], direction[3], t_min, t;
    };

    EmbreeUser(Corners all) : corners(std::move(all)) {
        constexpr int USER = 120, ROBUST = 1 << 2, HIGH_QUALITY = 2;
        double size = 0;
        for (double coordinate : corners) size = std::max(size, std::fabs(coordinate));
        margin = 1e-6 * size;
        RTCDeviceTy *device = rtcNewDevice(EMBREE_CONFIG);
        scene = rtcNewScene(device);
        rtcSetSceneFlags(scene, ROBUST);
        rtcSetSceneBuildQuality(scene, HIGH_QUALITY);
        RTCGeometryTy *mesh = rtcNewGeometry(device, USER);
        rtcSetGeometryUserPrimitiveCount(mesh, unsigned(corners.size() / 9));
        rtcSetGeometryUserData(mesh, this);
        rtcSetGeometryBoundsFunction(mesh, bounds, nullptr);
        rtcSetGeometryIntersectFunction(mesh, intersect_one);
        rtcSetGeometryOccludedFunction(mesh, occluded_one);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcCommitScene(scene);
    }
    // The geometry points to this.
    EmbreeUser(const EmbreeUser &) = delete;

    static Ray ray(const ::Ray &from) {
        Ray ray{};
        const auto &[o, t_min, d, t_max] = from;
        ray.ray = {o[0], o[1], o[2], t_min, d[0], d[1], d[2], 0, t_max, ~0u, 0, 0};
        ray.hit.geomID = ray.hit.instID = ray.hit.instPrimID = ~0u;
        for (int axis = 0; axis < 3; axis++) ray.origin[axis] = o[axis], ray.direction[axis] = d[axis];
        ray.t_min = t_min, ray.t = t_max;
        return ray;
    }
    static double distance(const Ray &ray) { return ray.hit.geomID == ~0u ? MISS : ray.t; }
    void intersect(Ray &ray) { rtcIntersect1(scene, &ray, nullptr); }
    bool occluded(Ray &ray) {
        rtcOccluded1(scene, &ray.ray, nullptr);
        return ray.ray.tfar < 0;
    }

private:
    static void bounds(const RTCBoundsArguments *arguments) {
        auto *self = static_cast<EmbreeUser *>(arguments->data);
        const double *corner = &self->corners[9 * size_t(arguments->primID)];
        for (int axis = 0; axis < 3; axis++) {
            auto [least, most] = std::minmax({corner[axis], corner[3 + axis], corner[6 + axis]});
            arguments->bounds->lower[axis] = float(least - self->margin);
            arguments->bounds->upper[axis] = float(most + self->margin);
        }
    }

    /// Shortens the ray to a triangle that it hits by the signed volumes over its edges, and returns whether it does.
    static bool hits(const RTCFunctionArguments *arguments, Ray &ray) {
        const double *corner = &static_cast<EmbreeUser *>(arguments->data)->corners[9 * size_t(arguments->primID)];
        const double *d = ray.direction;
        double a[3], b[3], c[3];
        for (int axis = 0; axis < 3; axis++) {
            a[axis] = corner[axis] - ray.origin[axis];
            b[axis] = corner[3 + axis] - ray.origin[axis];
            c[axis] = corner[6 + axis] - ray.origin[axis];
        }
        auto volume = [](const double *x, const double *y, const double *z) {
            return x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0]);
        };
        double u = volume(d, c, b), v = volume(d, a, c), w = volume(d, b, a), whole = u + v + w;
        if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
        if (whole == 0) return false;
        double t = (u * a[0] + v * b[0] + w * c[0]) * d[0] + (u * a[1] + v * b[1] + w * c[1]) * d[1] +
                   (u * a[2] + v * b[2] + w * c[2]) * d[2];
        t /= whole * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if (!(ray.t_min <= t && t < ray.t)) return false;
        ray.t = t;
        return true;
    }
    static void intersect_one(const RTCFunctionArguments *arguments) {
        Ray &ray = static_cast<Ray &>(*arguments->ray);
        if (!*arguments->valid || !hits(arguments, ray)) return;
        ray.ray.tfar = float(ray.t);
        ray.hit.primID = arguments->primID;
        ray.hit.geomID = arguments->geomID;
    }
    static void occluded_one(const RTCFunctionArguments *arguments) {
        Ray &ray = static_cast<Ray &>(*arguments->ray);
        if (*arguments->valid && hits(arguments, ray)) ray.ray.tfar = -INFINITY;
    }
};

/// tinybvh's binary tree in f64.
class TinyBvhDouble {
    std::vector<tinybvh::bvhdbl3> vertices;
    tinybvh::BVH_Double layout;

public:
    struct Ray : tinybvh::RayEx {
        double t_max;
    };

    TinyBvhDouble(const Corners &corners) {
        for (size_t i = 0; i < corners.size(); i += 3) vertices.emplace_back(corners[i], corners[i + 1], corners[i + 2]);
        layout.Build(vertices.data(), vertices.size() / 3);
    }
    static Ray ray(const ::Ray &from) {
        const float *o = from.origin, *d = from.direction;
        double t_max = std::fmin(from.t_max, BVH_DBL_FAR);
        return {{{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, t_max}, t_max};
    }
    static double distance(const Ray &ray) { return ray.hit.t < ray.t_max ? ray.hit.t : MISS; }
    void intersect(Ray &ray) const { layout.Intersect(ray); }
    bool occluded(const Ray &ray) const { return layout.IsOccluded(ray); }
};

#ifdef MADMANN
/// The binary tree of madmann91/bvh in f64, of its highest quality, with its precomputed triangles in the tree's order.
class Madmann {
    using Vec = bvh::v2::Vec<double, 3>;
    using Node = bvh::v2::Node<double, 3>;
    using Tree = bvh::v2::Bvh<Node>;
    Tree tree;
    std::vector<bvh::v2::PrecomputedTri<double>> triangles;

public:
    struct Ray {
        bvh::v2::Ray<double, 3> ray;
        bool is_hit;
    };

    Madmann(const Corners &corners) {
        std::vector<bvh::v2::BBox<double, 3>> boxes;
        std::vector<Vec> centers;
        auto triangle = [&](size_t id) {
            auto corner = [&](size_t i) { return Vec(corners[i], corners[i + 1], corners[i + 2]); };
            return bvh::v2::Tri<double, 3>(corner(9 * id), corner(9 * id + 3), corner(9 * id + 6));
        };
        for (size_t id = 0; id < corners.size() / 9; id++) {
            boxes.push_back(triangle(id).get_bbox());
            centers.push_back(triangle(id).get_center());
        }
        tree = bvh::v2::DefaultBuilder<Node>::build(boxes, centers);
        for (size_t id : tree.prim_ids) triangles.emplace_back(triangle(id));
    }
    static Ray ray(const ::Ray &from) {
        const auto &[o, t_min, d, t_max] = from;
        return {{Vec(o[0], o[1], o[2]), Vec(d[0], d[1], d[2]), t_min, t_max}, false};
    }
    static double distance(const Ray &ray) { return ray.is_hit ? ray.ray.tmax : MISS; }
    void intersect(Ray &ray) const { trace<false>(ray); }
    bool occluded(Ray &ray) const {
        trace<true>(ray);
        return ray.is_hit;
    }

private:
    template <bool ANY> void trace(Ray &ray) const {
        bvh::v2::SmallStack<Tree::Index, 64> stack;
        tree.intersect<ANY, false>(ray.ray, tree.get_root().index, stack, [&](size_t begin, size_t end) {
            bool is_hit = false;
            for (size_t i = begin; i < end; i++) {
                if (auto hit = triangles[i].intersect(ray.ray)) {
                    ray.ray.tmax = std::get<0>(*hit);
                    is_hit = ray.is_hit = true;
                }
            }
            return is_hit;
        });
    }
};
#endif
#endif

// ------------------------------------------------------------------------------------------------------------ modes

struct Mode {
    const char *name;
    std::unique_ptr<Tracer> (*make)(const std::vector<float> &corners);
};

template <class T, bool... Settings> std::unique_ptr<Tracer> make(const std::vector<float> &corners) {
    return std::make_unique<T>(corners, Settings...);
}

constexpr Mode MODES[] = {
#ifdef DOUBLE
    {"embree functions in double", make<InDouble<EmbreeUser>>},
    {"tinybvh BVH in double", make<InDouble<TinyBvhDouble>>},
#ifdef MADMANN
    {"madmann91/bvh BVH in double", make<InDouble<Madmann>>},
#endif
#else
    {"embree medium", make<Embree, false, false>},
    {"embree high", make<Embree, true, false>},
    {"embree medium robust", make<Embree, false, true>},
    {"embree high robust", make<Embree, true, true>},
    {"embree medium, coherent packets", make<EmbreePackets, false, false, true>},
    {"embree medium, incoherent packets", make<EmbreePackets, false, false, false>},
    {"embree high, coherent packets", make<EmbreePackets, true, false, true>},
    {"embree high, incoherent packets", make<EmbreePackets, true, false, false>},
    {"embree medium robust, coherent packets", make<EmbreePackets, false, true, true>},
    {"embree medium robust, incoherent packets", make<EmbreePackets, false, true, false>},
    {"embree high robust, coherent packets", make<EmbreePackets, true, true, true>},
    {"embree high robust, incoherent packets", make<EmbreePackets, true, true, false>},
    {"tinybvh BVH4", make<TinyBvh<tinybvh::BVH4_CPU>, false>},
    {"tinybvh BVH4 splits", make<TinyBvh<tinybvh::BVH4_CPU>, true>},
    {"tinybvh BVH8", make<TinyBvh<tinybvh::BVH8_CPU>, false>},
    {"tinybvh BVH8 splits", make<TinyBvh<tinybvh::BVH8_CPU>, true>},
    {"tinybvh packets", make<TinyBvhPackets, false>},
    {"tinybvh packets splits", make<TinyBvhPackets, true>},
#endif
};

template <class T> bool read(std::vector<T> &values) {
    return fread(values.data(), sizeof(T), values.size(), stdin) == values.size();
}

template <class T> void write(const std::vector<T> &values) {
    fwrite(values.data(), sizeof(T), values.size(), stdout);
}

int serve(const Mode &mode) {
    std::vector<uint32_t> triangles(1);
    if (!read(triangles)) return 1;
    std::vector<float> corners(9 * size_t(triangles[0]));
    if (!read(corners)) return 1;
    double start = now();
    std::unique_ptr<Tracer> tracer = mode.make(corners);
    write(std::vector<double>{now() - start});
    fflush(stdout);
    std::vector<Query> query(1);
    while (read(query)) {
        std::vector<Ray> rays(query[0].count);
        if (!read(rays) || query[0].part == 0) return 1;
        std::vector<float> distances(rays.size());
        std::vector<double> seconds;
        for (size_t first = 0; first < rays.size(); first += query[0].part) {
            size_t count = std::min<size_t>(query[0].part, rays.size() - first);
            seconds.push_back(tracer->trace(query[0], &rays[first], count, &distances[first]));
        }
        write(seconds);
        write(distances);
        fflush(stdout);
    }
    return 0;
}

} // namespace

int main(int argc, char **argv) {
    if (argc < 2) {
        ssize_t embree = rtcGetDeviceProperty(rtcNewDevice(EMBREE_CONFIG), 0);
        for (const Mode &mode : MODES) {
            const char *space = strchr(mode.name, ' ');
            printf("%s\t%.*s\t", INSTRUCTIONS, int(space - mode.name), mode.name);
            if (mode.name[0] == 'e') printf("%zd.%zd.%zd", embree / 10000, embree / 100 % 100, embree % 100);
            else if (mode.name[0] == 'm') printf("2");
            else printf("%d.%d.%d", TINY_BVH_VERSION_MAJOR, TINY_BVH_VERSION_MINOR, TINY_BVH_VERSION_SUB);
            printf("\t%s\n", space + 1);
        }
        return 0;
    }
    for (const Mode &mode : MODES) {
        if (!strcmp(argv[1], mode.name)) return serve(mode);
    }
    fprintf(stderr, "ray_peers: %s is no mode; accepted: one of those that ray_peers alone lists\n", argv[1]);
    return 2;
}
