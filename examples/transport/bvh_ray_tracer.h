// A ray tracer for xdg over the C interface of bvh-search: exact, in f64.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bvh_search.h"
#include "xdg/ray_tracing_interface.h"

namespace xdg {

class BvhRayTracer : public RayTracer {
public:
  // A tree is searched with `work_per_face` nodes created or visited for each of its faces; answers do
  // not depend on it. Queries about tetrahedra are passed on to `elements`, if there is one.
  explicit BvhRayTracer(uint64_t work_per_face = 1000, std::shared_ptr<RayTracer> elements = nullptr)
      : work_per_face_(work_per_face), elements_(std::move(elements)) {}

  RTLibrary library() const override { return RTLibrary::EMBREE; } // xdg has no name for others.

  void init() override {
    if (elements_) elements_->init();
  }

  std::pair<TreeID, TreeID> register_volume(const std::shared_ptr<MeshManager>& mesh, MeshID volume) override {
    TreeID faces = create_surface_tree(mesh, volume);
    return {faces, create_element_tree(mesh, volume)};
  }

  // The normals of the tree's copies of the faces point out of the volume: a face between two volumes
  // has one in each of their trees, with opposite sense.
  TreeID create_surface_tree(const std::shared_ptr<MeshManager>& mesh, MeshID volume) override {
    std::vector<Face> faces;
    for (MeshID surface : mesh->get_volume_surfaces(volume)) {
      auto [forward, reverse] = mesh->surface_senses(surface);
      if (volume != forward && volume != reverse)
        throw std::runtime_error("surface " + std::to_string(surface) + " does not bound volume " + std::to_string(volume));
      add_surface(*mesh, surface, volume == forward, faces);
      // The tree over all has a surface once.
      if (std::find(registered_.begin(), registered_.end(), surface) == registered_.end()) {
        registered_.push_back(surface);
        add_surface(*mesh, surface, true, all_faces_);
      }
    }
    return add_tree(std::move(faces));
  }

  void create_global_surface_tree() override { global_surface_tree_ = add_tree(all_faces_); }

  TreeID create_element_tree(const std::shared_ptr<MeshManager>& mesh, MeshID volume) override {
    return elements_ ? elements_->create_element_tree(mesh, volume) : TREE_NONE;
  }

  void create_global_element_tree() override {
    if (elements_) elements_->create_global_element_tree();
  }

  MeshID find_element(const Position& point) const override {
    return elements_ ? elements_->find_element(point) : ID_NONE;
  }

  MeshID find_element(TreeID tree, const Position& point) const override {
    return elements_ ? elements_->find_element(tree, point) : ID_NONE;
  }

  // The nearest face that counts, and its surface. Adds the face to those that are excluded.
  //
  // A hit point is rounded, perhaps across the next face, too, and a particle that starts there may
  // never leave its volume. So a particle that flies on from the last hit point of this thread keeps
  // its origin, and the next face is the first one at that distance or beyond:
  //
  //     origin ──────────── t ───── next face        the ray, in real arithmetic
  //                          ·                       the caller's rounded point
  std::pair<double, MeshID> ray_fire(TreeID tree, const Position& origin, const Direction& direction,
                                     const double dist_limit = INFTY,
                                     HitOrientation orientation = HitOrientation::EXITING,
                                     std::vector<MeshID>* const exclude_primitives = nullptr) override {
    const Tree& faces = trees_.at(tree);
    thread_local Flight flight;
    if (!exclude_primitives || exclude_primitives->empty() || !flight.goes_on(origin, direction))
      flight = {origin, direction, 0};
    const double end = flight.t + dist_limit;
    BvsHitF64 hit = nearest(faces, flight.origin, direction, end, orientation, exclude_primitives, flight.t);
    if (hit.object == UINT32_MAX) return {INFTY, ID_NONE};
    const double distance = hit.t - flight.t;
    flight.t = hit.t;
    const Label& label = faces.labels[hit.object];
    if (exclude_primitives) exclude_primitives->push_back(label.face);
    return {distance, label.surface};
  }

  // A point is inside if the half line from it leaves the volume before it enters it. Where it does
  // both at once, it meets an edge, and another half line decides. A point on a face is inside if the
  // half line leaves the volume there.
  bool point_in_volume(TreeID tree, const Position& point, const Direction* direction = nullptr,
                       const std::vector<MeshID>* exclude_primitives = nullptr) const override {
    const Tree& faces = trees_.at(tree);
    const std::array<Direction, 4> others{{{0.6, 0.5, 0.62}, {-0.3, 0.7, 0.65}, {0.2, -0.8, 0.57}, {0.7, 0.3, -0.65}}};
    for (size_t i = direction ? 0 : 1; i <= others.size(); i++) {
      const Direction& along = i == 0 ? *direction : others[i - 1];
      BvsHitF64 exit = nearest(faces, point, along, INFTY, HitOrientation::EXITING, exclude_primitives);
      if (exit.object == UINT32_MAX) return false;
      BvsHitF64 entry = nearest(faces, point, along, exit.t, HitOrientation::ENTERING, exclude_primitives);
      if (entry.object == UINT32_MAX || exit.t == 0) return true;
      if (entry.t < exit.t) return false;
    }
    return false;
  }

  // The nearest face and its distance.
  std::pair<double, MeshID> closest(TreeID tree, const Position& point) override {
    const Tree& faces = trees_.at(tree);
    const double at[3] = {point.x, point.y, point.z};
    BvsClosest found;
    check(bvs_tracer_closest_points_f64(faces.tracer.get(), at, 1, &found) != BVS_STATUS_OK);
    if (found.object == UINT32_MAX) return {INFTY, ID_NONE};
    return {found.distance, faces.labels[found.object].face};
  }

  // Writes the distance of the nearest face on the ray, or INFTY.
  bool occluded(TreeID tree, const Position& origin, const Direction& direction, double& dist) const override {
    BvsHitF64 hit = nearest(trees_.at(tree), origin, direction, INFTY, HitOrientation::ANY, nullptr);
    dist = std::min(hit.t, INFTY);
    return hit.object != UINT32_MAX;
  }

private:
  struct Flight {
    Position origin;
    Direction direction;
    // The distance of the last hit.
    double t;

    // Whether a point is the last hit point, but for rounding, and the direction the same.
    bool goes_on(const Position& point, const Direction& along) const {
      double off = 0, size = 0;
      for (int axis = 0; axis < 3; axis++) {
        if (along[axis] != direction[axis]) return false;
        const double hit = origin[axis] + t * direction[axis];
        off = std::max(off, std::fabs(point[axis] - hit));
        size = std::max({size, std::fabs(hit), std::fabs(origin[axis])});
      }
      return off <= 0x1p-46 * size;
    }
  };

  struct Face {
    MeshID face;
    MeshID surface;
    std::array<double, 9> corners;
  };

  struct Label {
    MeshID face;
    MeshID surface;
  };

  struct Free {
    void operator()(BvsTree* tree) const { bvs_tree_free(tree); }
    void operator()(BvsTracerF64* tracer) const { bvs_tracer_f64_free(tracer); }
  };

  struct Tree {
    std::unique_ptr<BvsTracerF64, Free> tracer;
    // In the order of the faces' ids, which is that of the tracer's triangles.
    std::vector<Label> labels;
  };

  static void check(bool has_failed) {
    if (has_failed) throw std::runtime_error(std::string("bvh-search: ") + bvs_last_error());
  }

  static void add_surface(const MeshManager& mesh, MeshID surface, bool is_forward, std::vector<Face>& faces) {
    for (MeshID id : mesh.get_surface_faces(surface)) {
      auto vertices = mesh.face_vertices(id);
      if (!is_forward) std::swap(vertices[1], vertices[2]);
      Face face{id, surface, {}};
      for (int i = 0; i < 9; i++) face.corners[i] = vertices[i / 3][i % 3];
      faces.push_back(face);
    }
  }

  TreeID add_tree(std::vector<Face> faces) {
    std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.face < b.face; });
    BvsBake bake{};
    bake.objects.count = faces.size();
    bake.work = work_per_face_ * faces.size() + 1;
    bake.frame = 1;
    // Not null for a volume without faces.
    std::vector<double> corners;
    corners.reserve(9 * faces.size() + 9);
    Tree tree;
    for (const Face& face : faces) {
      corners.insert(corners.end(), face.corners.begin(), face.corners.end());
      tree.labels.push_back({face.face, face.surface});
    }
    bake.objects.vertices_f64 = corners.data();
    std::unique_ptr<BvsTree, Free> baked(bvs_tree_bake(&bake));
    check(!baked);
    tree.tracer.reset(bvs_tracer_f64_new(baked.get()));
    check(!tree.tracer);
    SurfaceTreeID id = next_surface_tree_id();
    surface_trees_.push_back(id);
    if (trees_.size() <= size_t(id)) trees_.resize(id + 1);
    trees_[id] = std::move(tree);
    return id;
  }

  static BvsHitF64 nearest(const Tree& tree, const Position& origin, const Direction& direction, double limit,
                           HitOrientation orientation, const std::vector<MeshID>* excluded, double t_min = 0) {
    BvsRayF64 ray{{origin.x, origin.y, origin.z}, t_min, {direction.x, direction.y, direction.z}, limit};
    // xdg counts from -1: either, exiting, entering.
    BvsSelect select{uint32_t(orientation + 1), 0, nullptr};
    thread_local std::vector<uint32_t> ids;
    if (excluded && !excluded->empty()) {
      ids.clear();
      for (MeshID face : *excluded) {
        auto before = [](const Label& label, MeshID id) { return label.face < id; };
        auto found = std::lower_bound(tree.labels.begin(), tree.labels.end(), face, before);
        if (found != tree.labels.end() && found->face == face) ids.push_back(uint32_t(found - tree.labels.begin()));
      }
      select.excluded_count = uint32_t(ids.size());
      select.excluded = ids.data();
    }
    BvsHitF64 hit;
    check(bvs_nearest_f64(tree.tracer.get(), &ray, &select, &hit) != BVS_STATUS_OK);
    return hit;
  }

  uint64_t work_per_face_;
  std::shared_ptr<RayTracer> elements_;
  std::vector<Tree> trees_;
  std::vector<MeshID> registered_;
  std::vector<Face> all_faces_;
};

} // namespace xdg
