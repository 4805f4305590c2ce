// What the tracer needs of xdg, for tests without a checkout of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

namespace xdg {

using MeshID = int32_t;
using TreeID = int32_t;
using SurfaceTreeID = TreeID;

constexpr MeshID ID_NONE{-1};
constexpr TreeID TREE_NONE{-1};
constexpr double INFTY{std::numeric_limits<double>::max()};

enum HitOrientation : int { ANY = -1, EXITING = 0, ENTERING = 1 };
enum class RTLibrary { EMBREE };

struct Position {
  double x, y, z;
  double operator[](size_t axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
using Direction = Position;
using Vertex = Position;

class MeshManager {
public:
  virtual ~MeshManager() = default;
  virtual std::vector<MeshID> get_volume_surfaces(MeshID volume) const = 0;
  virtual std::vector<MeshID> get_surface_faces(MeshID surface) const = 0;
  virtual std::array<Vertex, 3> face_vertices(MeshID face) const = 0;
  // The volumes behind the surface's normals and in front of them.
  virtual std::pair<MeshID, MeshID> surface_senses(MeshID surface) const = 0;
};

class RayTracer {
public:
  virtual ~RayTracer() = default;
  virtual void init() = 0;
  virtual std::pair<TreeID, TreeID> register_volume(const std::shared_ptr<MeshManager>& mesh, MeshID volume) = 0;
  virtual TreeID create_surface_tree(const std::shared_ptr<MeshManager>& mesh, MeshID volume) = 0;
  virtual TreeID create_element_tree(const std::shared_ptr<MeshManager>& mesh, MeshID volume) = 0;
  virtual void create_global_surface_tree() = 0;
  virtual void create_global_element_tree() = 0;
  virtual bool point_in_volume(TreeID tree, const Position& point, const Direction* direction,
                               const std::vector<MeshID>* exclude_primitives) const = 0;
  virtual std::pair<double, MeshID> ray_fire(TreeID tree, const Position& origin, const Direction& direction,
                                             const double dist_limit, HitOrientation orientation,
                                             std::vector<MeshID>* const exclude_primitives) = 0;
  virtual MeshID find_element(const Position& point) const = 0;
  virtual MeshID find_element(TreeID tree, const Position& point) const = 0;
  virtual std::pair<double, MeshID> closest(TreeID tree, const Position& point) = 0;
  virtual bool occluded(TreeID tree, const Position& origin, const Direction& direction, double& dist) const = 0;
  virtual RTLibrary library() const = 0;

protected:
  SurfaceTreeID next_surface_tree_id() { return ++last_surface_tree_id_; }

  SurfaceTreeID global_surface_tree_{TREE_NONE};
  SurfaceTreeID last_surface_tree_id_{0};
  std::vector<SurfaceTreeID> surface_trees_;
};

} // namespace xdg
