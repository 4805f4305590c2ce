// Where a ray meets a triangle, for examples that trace a tree by themselves.

#pragma once

#include <cmath>

/// The distance from `t_min` on at which a ray meets a triangle of nine coordinates, infinity if it does not. Source: Möller and
/// Trumbore 1997, 'Fast, minimum storage ray/triangle intersection', in double precision.
inline double ray_triangle(const float *origin, const float *direction, float t_min, const float *corner) {
    double edge[2][3], from[3], across[3], around[3], det = 0, u = 0, v = 0, t = 0;
    for (int i = 0; i < 3; i++) {
        edge[0][i] = double(corner[3 + i]) - corner[i], edge[1][i] = double(corner[6 + i]) - corner[i];
        from[i] = double(origin[i]) - corner[i];
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        across[i] = direction[j] * edge[1][k] - direction[k] * edge[1][j];
        around[i] = from[j] * edge[0][k] - from[k] * edge[0][j];
    }
    for (int i = 0; i < 3; i++) {
        det += edge[0][i] * across[i], u += from[i] * across[i];
        v += direction[i] * around[i], t += edge[1][i] * around[i];
    }
    u /= det, v /= det, t /= det;
    return det != 0 && u >= 0 && v >= 0 && u + v <= 1 && t >= t_min ? t : INFINITY;
}
