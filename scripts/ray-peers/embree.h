/* The part of Embree 4's interface that the programs in C use, so that only its library is needed, not its headers. */
#pragma once
#include <stddef.h>

typedef struct __attribute__((aligned(16))) {
    float origin[3], t_min, direction[3], time, t_max;
    unsigned mask, id, flags;
} RTCRay;
typedef struct __attribute__((aligned(16))) {
    float normal[3], u, v;
    unsigned triangle, geometry, instance[2];
} RTCHit;
typedef struct { RTCRay ray; RTCHit hit; } RTCRayHit;
typedef struct {
    int flags, features;
    void *context, *filter, *occluded;
    float width;
} RTCOccludedArguments;
void *rtcNewDevice(const char *config);
void *rtcNewScene(void *device);
void rtcSetSceneFlags(void *scene, int flags);
void rtcSetSceneBuildQuality(void *scene, int quality);
void *rtcNewGeometry(void *device, int type);
void *rtcSetNewGeometryBuffer(void *geometry, int type, unsigned slot, int format, size_t stride, size_t count);
void rtcCommitGeometry(void *geometry);
unsigned rtcAttachGeometry(void *scene, void *geometry);
void rtcCommitScene(void *scene);
void rtcReleaseScene(void *scene);
void rtcIntersect1(void *scene, RTCRayHit *ray, void *arguments);
void rtcOccluded1(void *scene, RTCRay *ray, void *arguments);
void rtcOccluded8(const int *valid, void *scene, void *rays, void *arguments);
void rtcOccluded16(const int *valid, void *scene, void *rays, void *arguments);
enum { TRIANGLE = 0, INDEX = 0, VERTEX = 1, UINT3 = 0x5003, FLOAT3 = 0x9003, HIGH_QUALITY = 2, ROBUST = 4, COHERENT = 1 << 16 };

/* Adds a mesh of separate triangles to a scene, and builds it in high quality. */
static inline void embree_build(void *device, void *scene, const float *corners, size_t count) {
    rtcSetSceneBuildQuality(scene, HIGH_QUALITY);
    void *mesh = rtcNewGeometry(device, TRIANGLE);
    float *vertices = rtcSetNewGeometryBuffer(mesh, VERTEX, 0, FLOAT3, 12, 3 * count);
    unsigned *indices = rtcSetNewGeometryBuffer(mesh, INDEX, 0, UINT3, 12, count);
    for (size_t i = 0; i < 9 * count; i++) vertices[i] = corners[i];
    for (unsigned i = 0; i < 3 * count; i++) indices[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);
}
