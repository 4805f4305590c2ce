// Included before each source of xdg's tests: wherever they make their Embree tracer, ours is made.
#include "bvh_ray_tracer.h"
#include "xdg/embree/ray_tracer.h"
#define EmbreeRayTracer BvhRayTracer
