// Queries and particles in solids whose answers are known.
#include <cstdio>
#include <cstdlib>

#include "bvh_ray_tracer.h"
#include "solids.h"

using namespace xdg;

static void expect(bool holds, const char* what, double found) {
  if (holds) return;
  std::printf("transport: %s: found %.17g\n", what, found);
  std::exit(EXIT_FAILURE);
}

static void is_near(double found, double expected, const char* what) {
  // Vertices at map coordinates are rounded to a billionth.
  expect(std::fabs(found - expected) < 1e-8, what, found);
}

static void check(double offset, bool is_turned, long steps) {
  auto mesh = std::make_shared<Solids>(offset, is_turned);
  BvhRayTracer tracer;
  Trees trees(tracer, mesh);
  auto tree = [&](MeshID volume) { return trees.of_volume.at(volume); };
  const Position origin = mesh->place(-0.5, 0.1, 0.2), far = mesh->place(0.5, 0.1, 0.2);
  const Direction right{far.x - origin.x, far.y - origin.y, far.z - origin.z};

  // From the left half through the middle: its face is leaving here, and entering there.
  std::vector<MeshID> passed;
  auto [half, middle] = tracer.ray_fire(tree(Solids::LEFT), origin, right, INFTY, EXITING, &passed);
  is_near(half, 0.5, "the middle from the left");
  expect(middle == Solids::MIDDLE, "the surface in the middle", middle);
  is_near(tracer.ray_fire(tree(Solids::RIGHT), origin, right, INFTY, ENTERING).first, 0.5, "the middle entered");
  is_near(tracer.ray_fire(tree(Solids::RIGHT), origin, right).first, 1.5, "the right half left");
  expect(tracer.ray_fire(tree(Solids::LEFT), origin, right, INFTY, EXITING, &passed).second == ID_NONE, "an excluded face", 0);
  expect(tracer.ray_fire(tree(Solids::LEFT), origin, right, 0.4).second == ID_NONE, "a face beyond the limit", 0);
  is_near(tracer.ray_fire(tree(Solids::OUTSIDE), origin, right, INFTY, ENTERING).first, 10.5, "the outside");

  double distance = 0;
  expect(tracer.occluded(tree(Solids::BALL), origin, right, distance), "an occluded ray", distance);
  is_near(distance, 1.5, "the distance of what occludes");
  const Position above = mesh->place(0, 0, 11);
  const Direction up{above.x - origin.x, above.y - origin.y, above.z - origin.z};
  expect(!tracer.occluded(tree(Solids::SPACE), above, up, distance), "a free ray", distance);

  auto [least, face] = tracer.closest(tree(Solids::LEFT), mesh->place(-0.9, 0.1, 0.2));
  is_near(least, 0.1, "the closest face");
  expect(mesh->get_surface_faces(10)[0] <= face && face <= mesh->get_surface_faces(10)[1], "the face on the left", face);

  // A point is in one volume, or in none of those that end.
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-11, 11);
  std::array<long, 5> inside{};
  for (int i = 0; i < 3000; i++) {
    double scale = i % 3 == 0 ? 1 : 0.11, x = unit(random) * scale, y = unit(random) * scale, z = unit(random) * scale;
    double most = std::max({std::fabs(x), std::fabs(y), std::fabs(z)});
    MeshID expected = most > 10 ? Solids::OUTSIDE : most < 1 ? (x < 0 ? Solids::LEFT : Solids::RIGHT) : 0;
    long before = inside[0];
    for (MeshID volume = Solids::LEFT; volume < Solids::OUTSIDE; volume++) {
      bool is_in = tracer.point_in_volume(tree(volume), mesh->place(x, y, z));
      inside[volume] += is_in;
      inside[0] += is_in;
      expect(expected == 0 || is_in == (volume == expected), "the volume of a point", volume);
    }
    expect(inside[0] - before == (most < 10), "volumes of a point", double(inside[0] - before));
  }
  for (long points : inside) expect(points > 100, "points of a volume", double(points));

  Flight flight = fly(tracer, trees, *mesh, steps, 2, 16);
  std::printf("transport: %s, offset %g: %ld steps, %ld particles lost, %ld of %ld misplaced\n", is_turned ? "turned" : "straight", offset, flight.steps,
              flight.lost, flight.misplaced, flight.looked_at);
  expect(flight.lost == 0, "lost particles", double(flight.lost));
  expect(flight.misplaced == 0, "misplaced particles", double(flight.misplaced));
}

int main(int count, char** arguments) {
  long steps = count > 1 ? std::atol(arguments[1]) : 200000;
  for (bool is_turned : {true, false})
    for (double offset : {0.0, 5412345.678}) check(offset, is_turned, steps);
}
