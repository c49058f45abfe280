#include "dynamics/page/skin.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "dynamics/bodies/beam_axis.hpp"
#include "dynamics/elements/line_point.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/assembly/line_elements.hpp"
#include "dynamics/page/failing_faces.hpp"
#include "dynamics/page/skin_faces.hpp"

namespace espalier::dynamics::page {
namespace {

Vec3 vector_at(const double* x) { return {x[0], x[1], x[2]}; }
void store(const Vec3& x, double* to) { std::copy_n(x.data(), 3, to); }

/// Outer faces of a solid, or all, of which some are laid bare as elements fail.
std::vector<TwoSidedFace> drawn_faces(const Mesh& mesh, bool fails) {
  constexpr std::size_t kMost = 60'000;
  std::vector<TwoSidedFace> faces;
  if (fails) faces = all_faces(mesh);
  if (fails && faces.size() <= kMost) return faces;
  faces.clear();
  for (const MeshFace& face : mesh.boundary_faces()) faces.push_back({face});
  return faces;
}

class SolidSkin final : public Skin {
 public:
  SolidSkin(const Mesh& mesh, bool fails) {
    const std::vector<TwoSidedFace> faces = drawn_faces(mesh, fails);
    constexpr std::size_t kFine = 30'000;  // faces of which mid-side nodes are drawn, too
    constexpr std::size_t kOutlined = 40'000;
    coarse = faces.size() > kFine;
    std::vector<Index> number(mesh.nodes.size(), -1);
    for (const auto& [face, behind] : faces) {
      const std::vector<Index> own = mesh.face_nodes(face);
      const std::size_t corners = at(shape_of(shape_of(mesh.type(face.element)).faces[at(face.face)].type).corners);
      std::vector<Index> drawn(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(coarse ? corners : own.size()));
      for (Index& node : drawn) {
        Index& known = number[at(node)];
        if (known < 0) {
          known = static_cast<Index>(nodes_.size());
          nodes_.push_back(node);
          labels.push_back(mesh.node_label(node));
        }
        node = known;
      }
      add_triangles(drawn, corners, triangles);
      if (fails) owners.resize(triangles.size(), {face.element, behind});
      if (faces.size() <= kOutlined) add_outline(drawn, corners, edges);
    }
    remove_repeats(edges);
    add_loose_elements(mesh, number);
  }
  void place(const double* vertices, double* x) const override {
    for (std::size_t k = 0; k < nodes_.size(); ++k) std::copy_n(vertices + 3 * nodes_[k], 3, x + 3 * k);
  }
  [[nodiscard]] const std::vector<Index>& nodes() const override { return nodes_; }

 private:
  /// Surfaces and lines of the mesh that belong to no solid.
  void add_loose_elements(const Mesh& mesh, std::vector<Index>& number) {
    for (Index e = 0; e < mesh.element_count(); ++e) {
      const ElementShape& shape = shape_of(mesh.type(e));
      if (shape.dimension != 1 && shape.dimension != 2) continue;
      std::vector<Index> drawn;
      for (int k = 0; k < shape.corners; ++k) {
        const Index node = mesh.element(e)[at(k)];
        if (number[at(node)] < 0) {
          number[at(node)] = static_cast<Index>(nodes_.size());
          nodes_.push_back(node);
          labels.push_back(mesh.node_label(node));
        }
        drawn.push_back(number[at(node)]);
      }
      if (shape.dimension == 2)
        add_triangles(drawn, drawn.size(), triangles);
      else
        edges.push_back({drawn[0], drawn[1]});
    }
  }
  std::vector<Index> nodes_;
};

/// A chain of cables or beams with its section around it.
class LineSkin final : public Skin {
 public:
  /// @param section  points of the section's outline, along y and z, anticlockwise seen against x
  LineSkin(const LineChain& chain, int step, std::vector<std::array<double, 2>> section)
      : elements_(static_cast<Index>(chain.lengths.size())),
        first_(chain.first),
        step_(step),
        lengths_(chain.lengths),
        section_(std::move(section)) {
    const Index elements = elements_;
    pieces_ = std::clamp<Index>(240 / elements, 1, 6);
    const Index rings = elements * pieces_ + 1, around = static_cast<Index>(section_.size());
    for (Index ring = 0; ring < rings; ++ring)
      for (Index k = 0; k < around; ++k) labels.push_back(ring % pieces_ == 0 ? ring / pieces_ + 1 : 0);
    for (Index ring = 0; ring + 1 < rings; ++ring)
      for (Index k = 0; k < around; ++k) {
        const Index a = ring * around + k, b = ring * around + (k + 1) % around;
        triangles.push_back({a, b, b + around});
        triangles.push_back({a, b + around, a + around});
      }
    const Index last = (rings - 1) * around;
    for (Index k = 1; k + 1 < around; ++k) {
      triangles.push_back({0, k + 1, k});
      triangles.push_back({last, last + k, last + k + 1});
    }
    for (Index node = 0; node <= elements; ++node)
      for (Index k = 0; k < around; ++k)
        edges.push_back({node * pieces_ * around + k, node * pieces_ * around + (k + 1) % around});
  }
  void place(const double* vertices, double* x) const override { interpolate(vertices, vertices, x); }
  void rates(const double* vertices, const double* velocities, double* v) const override {
    interpolate(vertices, velocities, v);
  }

 private:
  // Beams are linear in their vertices. A cable has a round section, whose own turn nobody knows: it moves with the
  // axis.
  void interpolate(const double* position, const double* values, double* x) const {
    const bool rates = values != position, cable = step_ == 2;
    Vec3 y = Vec3::Zero();
    for (Index e = 0; e < elements_; ++e)
      for (Index piece = e == 0 ? 0 : 1; piece <= pieces_; ++piece) {
        const double s = static_cast<double>(piece) / static_cast<double>(pieces_);
        const Hermite h(2 * s - 1, lengths_[at(e)]);
        const double *a = values + 3 * step_ * (first_ + e), *b = a + 3 * step_;
        const Vec3 r =
            h.n[0] * vector_at(a) + h.n[1] * vector_at(a + 3) + h.n[2] * vector_at(b) + h.n[3] * vector_at(b + 3);
        Vec3 z;
        if (cable) {
          const Vec3 along =
              h.d[0] * vector_at(a) + h.d[1] * vector_at(a + 3) + h.d[2] * vector_at(b) + h.d[3] * vector_at(b + 3);
          if (rates)
            y = z = Vec3::Zero();
          else
            next_axes(along, y, z);
        } else {
          y = (1 - s) * vector_at(a + 6) + s * vector_at(b + 6);
          z = (1 - s) * vector_at(a + 9) + s * vector_at(b + 9);
        }
        for (const auto& [of_y, of_z] : section_) {
          store(r + of_y * y + of_z * z, x);
          x += 3;
        }
      }
  }
  /// The y axis of the section before, carried on without twist.
  static void next_axes(const Vec3& along, Vec3& y, Vec3& z) {
    const Vec3 t = along.norm() > 0 ? Vec3(along.normalized()) : Vec3(Vec3::UnitX());
    Vec3 side = y - y.dot(t) * t;
    if (side.norm() < 1e-6) {
      Vec3::Index least = 0;
      t.cwiseAbs().minCoeff(&least);
      side = t.cross(Vec3(Vec3::Unit(least)));
    }
    y = side.normalized();
    z = t.cross(y);
  }
  Index elements_, first_;
  int step_;
  std::vector<double> lengths_;
  Index pieces_;
  std::vector<std::array<double, 2>> section_;
};

/// Several chains.
class FrameSkin final : public Skin {
 public:
  /// @param first  node of each chain @param mesh  with the labels of the nodes
  FrameSkin(std::vector<std::unique_ptr<LineSkin>> chains, const std::vector<Index>& first, const Mesh& mesh)
      : chains_(std::move(chains)) {
    for (std::size_t c = 0; c < chains_.size(); ++c) {
      const LineSkin& own = *chains_[c];
      const auto before = static_cast<Index>(labels.size());
      for (const std::int64_t label : own.labels)  // 0: between nodes
        labels.push_back(label > 0 ? mesh.node_label(first[c] + static_cast<Index>(label) - 1) : 0);
      for (const auto& t : own.triangles) triangles.push_back({t[0] + before, t[1] + before, t[2] + before});
      for (const auto& e : own.edges) edges.push_back({e[0] + before, e[1] + before});
    }
  }
  void place(const double* vertices, double* x) const override {
    for (const auto& chain : chains_) {
      chain->place(vertices, x);
      x += 3 * chain->points();
    }
  }
  void rates(const double* vertices, const double* velocities, double* v) const override {
    for (const auto& chain : chains_) {
      chain->rates(vertices, velocities, v);
      v += 3 * chain->points();
    }
  }

 private:
  std::vector<std::unique_ptr<LineSkin>> chains_;
};

/// Both sides of a plate.
class ShellSkin final : public Skin {
 public:
  explicit ShellSkin(const model::ShellSpec& spec) : half_(0.5 * spec.thickness) {
    const Mesh& mesh = *spec.mesh;
    below_ = static_cast<Index>(mesh.nodes.size());
    for (Index side = 0; side < 2; ++side)
      for (Index k = 0; k < below_; ++k) labels.push_back(mesh.node_label(k));
    std::map<std::pair<Index, Index>, std::pair<Index, Index>> rims;  // edges of one element, as it runs along them
    for (Index e = 0; e < mesh.element_count(); ++e) {
      const auto quad = mesh.element(e);
      std::vector<Index> top(quad.begin(), quad.end());
      std::vector<Index> bottom(top.rbegin(), top.rend());
      for (Index& k : bottom) k += below_;
      for (const auto* face : {&top, &bottom}) {
        add_triangles(*face, 4, triangles);
        add_outline(*face, 4, edges);
      }
      for (std::size_t a = 0; a < 4; ++a) {
        const Index from = quad[a], to = quad[(a + 1) % 4];
        if (const auto [known, fresh] = rims.emplace(std::minmax(from, to), std::pair{from, to}); !fresh)
          rims.erase(known);
      }
    }
    for (const auto& [edge, way] : rims) {
      const auto [a, b] = way;
      add_triangles({b, a, a + below_, b + below_}, 4, triangles);
    }
    remove_repeats(edges);
  }
  void place(const double* vertices, double* x) const override {
    for (const double side : {half_, -half_})
      for (Index k = 0; k < below_; ++k, x += 3)
        store(vector_at(vertices + 6 * k) + side * vector_at(vertices + 6 * k + 3), x);
  }

 private:
  double half_;
  Index below_ = 0;
};

/// Nodes with lines between some of them.
class NodeSkin final : public Skin {
 public:
  NodeSkin(const model::BuiltBody& body) : step_(body.flexible->vertices_per_node()) {
    const auto* parts = std::get_if<model::SubstructureSpec>(&body.spec.shape);
    for (Index k = 0; k < body.flexible->nodes(); ++k)
      labels.push_back(parts != nullptr && at(k) < parts->nodes.size() ? parts->nodes[at(k)].label : k + 1);
    if (parts == nullptr) return;
    for (const auto& [a, b] : parts->lines) {
      const auto from = parts->find(a), to = parts->find(b);
      if (from && to) edges.push_back({*from, *to});
    }
  }
  void place(const double* vertices, double* x) const override {
    for (Index k = 0; k < points(); ++k) std::copy_n(vertices + 3 * step_ * k, 3, x + 3 * k);
  }

 private:
  int step_;
};

std::vector<std::array<double, 2>> circle(double radius) {
  constexpr int kAround = 12;
  std::vector<std::array<double, 2>> points;
  for (int k = 0; k < kAround; ++k) {
    const double angle = 2 * std::numbers::pi * k / kAround;
    points.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  return points;
}

/// Whatever has these moments of area: J / I is 2 of a circle, 1.7 of a square.
std::vector<std::array<double, 2>> outline_of(const BeamSection& s, double length) {
  const double least = 1e-3 * length;
  const auto size = [&](double bending) { return std::max(least, std::sqrt(std::max(0.0, 12 * bending / s.axial))); };
  const double height = size(s.bending_z), width = size(s.bending_y);
  const double ratio = s.torsion / s.bending_y * s.section_normal / s.section_shear;
  if (std::abs(height - width) < 1e-6 * height && ratio > 1.9) return circle(height / std::sqrt(3.0));
  return {{-height / 2, -width / 2}, {height / 2, -width / 2}, {height / 2, width / 2}, {-height / 2, width / 2}};
}

std::vector<std::array<double, 2>> outline_of(const model::BuiltBody& body, const LineChain& chain, double length) {
  if (const auto* beam = std::get_if<model::BeamSpec>(&body.spec.shape))
    return outline_of(section_of_chain(*beam, chain).section, length);
  const CableSection s = section_of_chain(std::get<model::CableSpec>(body.spec.shape), chain);
  const double radius = 2 * std::sqrt(std::max(0.0, s.bending / s.axial));
  return circle(std::max(1e-3 * length, std::isfinite(radius) ? radius : 0.0));
}

}  // namespace

const std::vector<Index>& Skin::nodes() const {
  static const std::vector<Index> none;
  return none;
}

std::unique_ptr<Skin> make_skin(const model::BuiltBody& body) {
  if (body.mesh) return std::make_unique<SolidSkin>(*body.mesh, body.spec.erosion() != nullptr);
  if (const auto* shell = std::get_if<model::ShellSpec>(&body.spec.shape)) return std::make_unique<ShellSkin>(*shell);
  const std::vector<LineChain> chains = model::line_chains(body);
  if (chains.empty()) return std::make_unique<NodeSkin>(body);
  std::vector<std::unique_ptr<LineSkin>> skins;
  std::vector<Index> first;
  for (const LineChain& chain : chains) {
    const double length = std::accumulate(chain.lengths.begin(), chain.lengths.end(), 0.0);
    skins.push_back(
        std::make_unique<LineSkin>(chain, body.flexible->vertices_per_node(), outline_of(body, chain, length)));
    first.push_back(chain.first);
  }
  const model::LineFile* file = model::line_file(body);
  if (file == nullptr) return std::move(skins.front());
  return std::make_unique<FrameSkin>(std::move(skins), first, *file->mesh);
}

}  // namespace espalier::dynamics::page
