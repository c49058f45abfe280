#include "dynamics/mesh/survey.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "dynamics/mesh/face_functions.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

Point cross_of(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot_of(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point difference(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double length_of(const Point& a) { return std::sqrt(dot_of(a, a)); }

// Gauss points in [-1, 1]: exact up to degree 7, what second moments of quadratic faces need.
constexpr std::array<std::array<double, 2>, 4> kGauss = {{{-0.86113631159405257522, 0.34785484513745385737},
                                                          {-0.33998104358485626480, 0.65214515486254614263},
                                                          {0.33998104358485626480, 0.65214515486254614263},
                                                          {0.86113631159405257522, 0.34785484513745385737}}};

/// Calls take(x, normal * area) at all points of a face. @param origin  subtracted from the places
template <class Take>
void over_face(const Mesh& mesh, ElementType type, std::span<const Index> nodes, const Point& origin,
               const Take& take) {
  const bool triangle = shape_of(type).corners == 3;
  for (const auto& [u, wu] : kGauss)
    for (const auto& [v, wv] : kGauss) {
      // For a triangle: the square, one side of which is drawn together.
      const double r = triangle ? 0.25 * (1 + u) * (1 - v) : u, s = triangle ? 0.5 * (1 + v) : v;
      const double weight = wu * wv * (triangle ? 0.125 * (1 - v) : 1);
      const FaceFunctions f = face_functions(type, r, s);
      Point x{}, xr{}, xs{};
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        const Point p = difference(mesh.nodes[static_cast<std::size_t>(nodes[a])], origin);
        for (std::size_t d = 0; d < 3; ++d) {
          x[d] += f.n[a] * p[d];
          xr[d] += f.r[a] * p[d];
          xs[d] += f.s[a] * p[d];
        }
      }
      Point normal = cross_of(xr, xs);
      for (double& c : normal) c *= weight;
      take(x, normal);
    }
}

ElementType face_type(const Mesh& mesh, const MeshFace& face) {
  return shape_of(mesh.type(face.element)).faces[static_cast<std::size_t>(face.face)].type;
}

/// Edges of a solid between corners, from its faces.
template <class Take>
void over_edges(const Mesh& mesh, Index element, const Take& take) {
  const auto nodes = mesh.element(element);
  for (const FaceShape& face : shape_of(mesh.type(element)).faces) {
    const auto corners = static_cast<std::size_t>(shape_of(face.type).corners);
    for (std::size_t a = 0; a < corners; ++a) {
      const int from = face.nodes[a], to = face.nodes[(a + 1) % corners];
      if (from < to) take(nodes[static_cast<std::size_t>(from)], nodes[static_cast<std::size_t>(to)]);
    }
  }
}

/// The least of what the edges of a corner span over the product of their lengths: corners of three edges alone.
double shape_quality(const Mesh& mesh, Index element) {
  const auto nodes = mesh.element(element);
  const auto corners = static_cast<std::size_t>(shape_of(mesh.type(element)).corners);
  // Each corner's neighbours in the order in which faces pass: of faces anticlockwise seen from outside, the edge that
  // leaves a corner and the one that arrives at it turn about the corner.
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < corners; ++c) {
    std::vector<std::pair<int, int>> around;  // (next, previous) in each face at the corner
    for (const FaceShape& face : shape_of(mesh.type(element)).faces) {
      const auto n = static_cast<std::size_t>(shape_of(face.type).corners);
      for (std::size_t a = 0; a < n; ++a)
        if (face.nodes[a] == static_cast<int>(c))
          around.emplace_back(face.nodes[(a + 1) % n], face.nodes[(a + n - 1) % n]);
    }
    if (around.size() != 3) continue;  // the tip of a pyramid
    const int first = around[0].first, second = around[0].second;
    int third = around[1].first == first || around[1].first == second ? around[1].second : around[1].first;
    const auto edge = [&](int k) {
      return difference(mesh.nodes[static_cast<std::size_t>(nodes[static_cast<std::size_t>(k)])],
                        mesh.nodes[static_cast<std::size_t>(nodes[c])]);
    };
    const Point a = edge(first), b = edge(second), d = edge(third);
    const double product = length_of(a) * length_of(b) * length_of(d);
    // Seen from outside a and b turn anticlockwise, and d goes inwards.
    least = std::min(least, product > 0 ? -dot_of(cross_of(a, b), d) / product : 0);
  }
  return least;
}

void find_defects(const Mesh& mesh, MeshSurvey& s) {
  if (s.unused_nodes > 0)
    s.defects.push_back(fmt::format("{} nodes belong to no element; they are left out", s.unused_nodes));
  if (s.solids > 0 && !(s.least_shape > 0))
    s.defects.push_back(
        fmt::format("element {} is inverted or collapsed at a corner", element_name(mesh, s.worst_element)));
  if (s.solids > s.simulated)
    s.defects.push_back(
        fmt::format("{} solids are of shapes that are not simulated (pyramids)", s.solids - s.simulated));
  if (s.pieces.size() > 1) {
    std::string labels;
    for (std::size_t k = 0; k < std::min<std::size_t>(5, s.pieces.size()); ++k)
      labels += (k > 0 ? ", " : "") + node_name(mesh, s.pieces[k]);
    s.defects.push_back(fmt::format("{} pieces that share no node, with the nodes {}{}", s.pieces.size(), labels,
                                    s.pieces.size() > 5 ? ", ..." : ""));
  }
  std::map<Point, Index> places;
  Index doubled = 0, one = -1, other = -1;
  std::vector<char> used(mesh.nodes.size(), 0);
  for (Index e = 0; e < mesh.element_count(); ++e)
    for (const Index n : mesh.element(e)) used[static_cast<std::size_t>(n)] = 1;
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    if (used[n] == 0) continue;
    const auto [at, added] = places.emplace(mesh.nodes[n], static_cast<Index>(n));
    if (added) continue;
    if (doubled++ == 0) one = at->second, other = static_cast<Index>(n);
  }
  if (doubled > 0)
    s.defects.push_back(fmt::format("{} nodes lie where another lies, for instance {} on {}: bodies fall apart there",
                                    doubled, node_name(mesh, other), node_name(mesh, one)));
}

std::string guess_units(const Mesh& mesh, const MeshSurvey& s) {
  for (const MeshMaterial& m : mesh.materials) {
    if (m.density > 100 || m.young > 1e9) return "m, kg, s (the material's numbers)";
    if ((m.density > 0 && m.density < 1e-4) || (m.density == 0 && m.young > 1e3))
      return "mm, t, s: N and MPa (the material's numbers)";
  }
  double extent = 0;
  for (std::size_t d = 0; d < 3; ++d) extent = std::max(extent, s.most[d] - s.least[d]);
  return extent > 10 ? "mm (the size of the mesh); scale = 1e-3 makes them m" : "m (the size of the mesh)";
}

}  // namespace

VolumeIntegrals volume_integrals(const Mesh& mesh, std::span<const Index> elements) {
  VolumeIntegrals sum;
  const auto add = [&](Index e) {
    if (shape_of(mesh.type(e)).dimension != 3) return;
    const Point& origin = mesh.nodes[static_cast<std::size_t>(mesh.element(e).front())];
    double volume = 0;
    Point moment{};
    for (int f = 0; f < static_cast<int>(shape_of(mesh.type(e)).faces.size()); ++f)
      over_face(mesh, face_type(mesh, {e, f}), mesh.face_nodes({e, f}), origin,
                [&](const Point& x, const Point& normal) {
                  volume += dot_of(x, normal) / 3;
                  for (std::size_t d = 0; d < 3; ++d) moment[d] += 0.5 * x[d] * x[d] * normal[d];
                });
    sum.volume += volume;
    for (std::size_t d = 0; d < 3; ++d) sum.moment[d] += moment[d] + origin[d] * volume;
  };
  for (const Index e : elements) add(e);
  for (Index e = 0; elements.empty() && e < mesh.element_count(); ++e) add(e);
  return sum;
}

MeshSurvey survey_mesh(const Mesh& mesh) {
  MeshSurvey s;
  s.nodes = static_cast<Index>(mesh.nodes.size());
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  s.least.fill(kInfinity);
  s.most.fill(-kInfinity);
  s.shortest_edge = kInfinity;
  std::vector<char> used(mesh.nodes.size(), 0);
  std::vector<double> shapes;
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const ElementShape& shape = shape_of(mesh.type(e));
    ++s.elements[std::string(shape.name)];
    for (const Index n : mesh.element(e)) {
      used[static_cast<std::size_t>(n)] = 1;
      for (std::size_t d = 0; d < 3; ++d) {
        s.least[d] = std::min(s.least[d], mesh.nodes[static_cast<std::size_t>(n)][d]);
        s.most[d] = std::max(s.most[d], mesh.nodes[static_cast<std::size_t>(n)][d]);
      }
    }
    if (shape.dimension == 2)
      over_face(mesh, mesh.type(e), mesh.element(e), Point{},
                [&](const Point&, const Point& normal) { s.surface += length_of(normal); });
    if (shape.dimension != 3) continue;
    ++s.solids;
    if (is_simulated_solid(mesh.type(e))) ++s.simulated;
    over_edges(mesh, e, [&](Index a, Index b) {
      const double length =
          length_of(difference(mesh.nodes[static_cast<std::size_t>(a)], mesh.nodes[static_cast<std::size_t>(b)]));
      s.shortest_edge = std::min(s.shortest_edge, length);
      s.longest_edge = std::max(s.longest_edge, length);
    });
    shapes.push_back(shape_quality(mesh, e));
    if (s.worst_element < 0 || shapes.back() < s.least_shape) {
      s.worst_element = e;
      s.least_shape = shapes.back();
    }
  }
  if (s.solids == 0) s.shortest_edge = 0;
  if (mesh.element_count() == 0) s.least = s.most = {};
  s.unused_nodes = static_cast<Index>(std::count(used.begin(), used.end(), 0));
  if (!shapes.empty()) {
    std::nth_element(shapes.begin(), shapes.begin() + static_cast<std::ptrdiff_t>(shapes.size() / 2), shapes.end());
    s.median_shape = shapes[shapes.size() / 2];
  }
  for (const MeshFace& face : mesh.boundary_faces()) {
    ++s.outer_faces;
    over_face(mesh, face_type(mesh, face), mesh.face_nodes(face), Point{},
              [&](const Point&, const Point& normal) { s.surface += length_of(normal); });
  }
  const VolumeIntegrals v = volume_integrals(mesh);
  s.volume = v.volume;
  for (std::size_t d = 0; d < 3; ++d) s.centre[d] = v.volume != 0 ? v.moment[d] / v.volume : 0;
  if (mesh.element_count() > 0) s.pieces = mesh.pieces({});
  find_defects(mesh, s);
  s.units = guess_units(mesh, s);
  return s;
}

}  // namespace espalier::dynamics
