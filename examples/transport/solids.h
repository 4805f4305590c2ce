// Nested solids with shared faces, and particles that fly through them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#ifdef WITH_XDG
#include "tests/mesh_mock.h"
namespace xdg { using AnyMesh = MeshMock; }
#else
#include "xdg/ray_tracing_interface.h"
namespace xdg { using AnyMesh = MeshManager; }
#endif

namespace xdg {

inline Position at(const Position& from, const Direction& direction, double t) {
  return {from.x + t * direction.x, from.y + t * direction.y, from.z + t * direction.z};
}

// Two halves of a box, in a ball, in a larger box, straight or turned, and far from the origin.
class Solids : public AnyMesh {
public:
  enum Volume { LEFT = 1, RIGHT, BALL, SPACE, OUTSIDE };
  static constexpr std::array<MeshID, 5> VOLUMES{LEFT, RIGHT, BALL, SPACE, OUTSIDE};

  explicit Solids(double offset, bool is_turned = true) : is_turned(is_turned), offset_(offset) {
    add_box({-1, -1, -1}, {0, 1, 1}, 1, LEFT, BALL);
    add_box({0, -1, -1}, {1, 1, 1}, 0, RIGHT, BALL);
    // The middle, whose normals point to the right.
    surfaces_of_[MIDDLE] = {LEFT, RIGHT};
    add_quad(MIDDLE, {0, -1, -1}, {0, 1, -1}, {0, 1, 1}, {0, -1, 1});
    add_ball(3, BALL, SPACE);
    add_box({-10, -10, -10}, {10, 10, 10}, 6, SPACE, OUTSIDE);
  }

  const bool is_turned;

  // The place of a point of the drawing, which is not turned and lies at the origin.
  Position place(double x, double y, double z) const {
    if (!is_turned) return {x + offset_, y + offset_, z - offset_};
    const double c = std::cos(0.3), s = std::sin(0.3), k = std::cos(1.1), l = std::sin(1.1);
    double u = c * x - s * y, v = s * x + c * y;
    return {u + offset_, k * v - l * z + offset_, l * v + k * z - offset_};
  }

  MeshID beyond(MeshID surface, MeshID volume) const {
    auto [behind, before] = surfaces_of_.at(surface);
    return volume == behind ? before : behind;
  }

  std::vector<MeshID> get_volume_surfaces(MeshID volume) const override {
    std::vector<MeshID> found;
    for (auto& [surface, sides] : surfaces_of_)
      if (sides.first == volume || sides.second == volume) found.push_back(surface);
    return found;
  }
  std::vector<MeshID> get_surface_faces(MeshID surface) const override { return faces_of_.at(surface); }
  std::array<Vertex, 3> face_vertices(MeshID face) const override { return faces_[face]; }
  std::pair<MeshID, MeshID> surface_senses(MeshID surface) const override { return surfaces_of_.at(surface); }
#ifdef WITH_XDG
  int num_surfaces() const override { return int(surfaces_of_.size()); }
  int num_surface_faces(MeshID surface) const override { return int(faces_of_.at(surface).size()); }
  std::vector<MeshID> get_volume_elements(MeshID) const override { return {}; }
#endif

  static constexpr MeshID MIDDLE = 100;

private:
  using Corner = std::array<double, 3>;

  void add_face(MeshID surface, const Corner& a, const Corner& b, const Corner& c) {
    auto vertex = [&](const Corner& p) { return place(p[0], p[1], p[2]); };
    faces_of_[surface].push_back(MeshID(faces_.size()));
    faces_.push_back({vertex(a), vertex(b), vertex(c)});
  }

  void add_quad(MeshID surface, const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
    add_face(surface, a, b, c);
    add_face(surface, a, c, d);
  }

  // All sides of a box but the one of the number `open`, counted as -x, +x, -y, +y, -z, +z.
  void add_box(const Corner& low, const Corner& high, int open, MeshID inside, MeshID outside) {
    for (int side = 0; side < 6; side++) {
      if (side == open) continue;
      int axis = side / 2, next = (axis + 1) % 3, last = (axis + 2) % 3;
      Corner corners[4];
      for (int i = 0; i < 4; i++) {
        corners[i][axis] = (side % 2 ? high : low)[axis];
        corners[i][next] = (i == 1 || i == 2 ? high : low)[next];
        corners[i][last] = (i >= 2 ? high : low)[last];
      }
      if (side % 2 == 0) std::swap(corners[1], corners[3]);
      MeshID surface = MeshID(10 * inside + side);
      surfaces_of_[surface] = {inside, outside};
      add_quad(surface, corners[0], corners[1], corners[2], corners[3]);
    }
  }

  void add_ball(double radius, MeshID inside, MeshID outside) {
    const int rings = 24, sectors = 48;
    const double pi = std::acos(-1.0);
    surfaces_of_[200] = {inside, outside};
    auto point = [&](int ring, int sector) {
      if (ring % rings == 0) return Corner{0, 0, ring ? -radius : radius};
      double up = pi * ring / rings, turn = 2 * pi * (sector % sectors) / sectors;
      return Corner{radius * std::sin(up) * std::cos(turn), radius * std::sin(up) * std::sin(turn), radius * std::cos(up)};
    };
    for (int i = 0; i < rings; i++)
      for (int j = 0; j < sectors; j++) {
        if (i > 0) add_face(200, point(i, j), point(i + 1, j), point(i, j + 1));
        if (i < rings - 1) add_face(200, point(i, j + 1), point(i + 1, j), point(i + 1, j + 1));
      }
  }

  double offset_;
  std::vector<std::array<Vertex, 3>> faces_;
  std::map<MeshID, std::vector<MeshID>> faces_of_;
  // The volumes behind the normals and in front of them.
  std::map<MeshID, std::pair<MeshID, MeshID>> surfaces_of_;
};

struct Trees {
  std::map<MeshID, TreeID> of_volume;

  Trees(RayTracer& tracer, const std::shared_ptr<Solids>& mesh) {
    for (MeshID volume : Solids::VOLUMES) of_volume[volume] = tracer.register_volume(mesh, volume).first;
    tracer.create_global_surface_tree();
    tracer.init();
  }
};

struct Flight {
  long steps = 0;
  // Particles that no face of their volume stops.
  long lost = 0;
  // Steps of which a point is not in the particle's volume alone, of those that are looked at.
  long misplaced = 0;
  long looked_at = 0;
};

// Particles fly straight from face to face, from each hit point without the faces there, and one step
// in four ends before the face, in another direction. One direction in three is that of an edge of the
// box, and of these every second that of a corner: rounding carries hit points across two faces there.
// Among straight solids, every second particle begins on a grid and flies along an axis or a diagonal:
// it meets edges and corners exactly.
inline Flight fly(RayTracer& tracer, const Trees& trees, const Solids& mesh, long steps, uint64_t seed, int look) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  auto is_in = [&](MeshID volume, const Position& point) {
    return tracer.point_in_volume(trees.of_volume.at(volume), point, nullptr, nullptr);
  };
  auto normalised = [](double x, double y, double z) {
    double length = std::sqrt(x * x + y * y + z * z);
    return Direction{x / length, y / length, z / length};
  };
  auto direction = [&](const Position& from) {
    double x = normal(random), y = normal(random), z = normal(random);
    if (random() % 3 == 0) {
      std::array<double, 3> to;
      for (double& at : to) at = random() % 2 ? 1 : -1;
      if (random() % 2) to[random() % 3] = 2 * unit(random) - 1;
      Position edge = mesh.place(to[0], to[1], to[2]);
      // A particle may be there.
      if (std::max({std::fabs(edge.x - from.x), std::fabs(edge.y - from.y), std::fabs(edge.z - from.z)}) > 1e-6)
        x = edge.x - from.x, y = edge.y - from.y, z = edge.z - from.z;
    }
    return normalised(x, y, z);
  };
  Flight flight;
  while (flight.steps < steps) {
    Position point = mesh.place(unit(random) * 8 - 4, unit(random) * 8 - 4, unit(random) * 8 - 4);
    Direction along = direction(point);
    if (!mesh.is_turned && random() % 2) {
      auto odd_eighth = [&] { return (2 * double(random() % 32) - 31) / 8; };
      point = mesh.place(odd_eighth(), odd_eighth(), odd_eighth());
      int sides = 1 + int(random() % 26);
      double x = sides % 3 - 1, y = sides / 3 % 3 - 1, z = sides / 9 - 1;
      if (x == 0 && y == 0 && z == 0) x = y = 1;
      along = normalised(x, y, z);
    }
    MeshID volume = Solids::LEFT;
    while (volume < Solids::OUTSIDE && !is_in(volume, point)) volume++;
    std::vector<MeshID> passed;
    while (volume != Solids::OUTSIDE && flight.steps < steps) {
      auto [t, surface] = tracer.ray_fire(trees.of_volume.at(volume), point, along, INFTY, HitOrientation::EXITING, &passed);
      flight.steps++;
      if (surface == ID_NONE) {
        flight.lost++;
        break;
      }
      // In a short step, rounding may carry a place across a face.
      const bool is_long = t > 1e-2;
      if (is_long && flight.steps % look == 0) {
        flight.looked_at++;
        // Not in the middle, where a ray may touch an edge of a smaller volume.
        const Position within = at(point, along, t * (0.1 + 0.8 * unit(random)));
        for (MeshID other = Solids::LEFT; other < Solids::OUTSIDE; other++)
          if (is_in(other, within) != (other == volume)) {
            flight.misplaced++;
            break;
          }
      }
      if (is_long && random() % 4 == 0) {
        point = at(point, along, t * (0.01 + 0.98 * unit(random)));
        along = direction(point);
        passed.clear();
        continue;
      }
      Position next = at(point, along, t);
      bool has_moved = next.x != point.x || next.y != point.y || next.z != point.z;
      if (has_moved) passed.erase(passed.begin(), passed.end() - 1);
      point = next;
      volume = mesh.beyond(surface, volume);
    }
  }
  return flight;
}

} // namespace xdg
