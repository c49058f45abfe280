#include "dynamics/forces/body_load.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/elements/solid.hpp"

namespace espalier::dynamics {
namespace {

/// Consistent forces: on vertex a the integral of N_a times the force, with x = sum N_b x_b.
class LoadedMaterial final : public PressedFaces {
 public:
  LoadedMaterial(const FlexibleBody& body, const Mesh& mesh, std::span<const Index> elements,
                 const ElementMaterials& materials, const BodyLoadLaw& law)
      : body_(body),
        point_(law.point),
        of_spin_(law.spin.squaredNorm() * Mat3::Identity() - law.spin * law.spin.transpose()) {
    const VertexPattern& pattern = body.assembly().pattern();
    std::vector<double> mass(spins() ? pattern.ind.size() : 0, 0.0), constant(3 * at(body.vertices()), 0.0);
    std::vector<char> loaded(at(body.vertices()), 0);
    double x[3 * kMaxElementNodes], m[kMaxElementNodes * kMaxElementNodes];
    for (const Index e : elements) {
      const auto nodes = mesh.element(e);
      const std::size_t n = nodes.size();
      for (std::size_t a = 0; a < n; ++a) std::copy_n(&body.reference()[3 * at(nodes[a])], 3, x + 3 * a);
      solid_mass(mesh.type(e), 1, x, m);
      const double density = materials.at(e).density;
      const Vec3 force = law.per_volume + density * law.acceleration;
      for (std::size_t b = 0; b < n; ++b) {
        loaded[at(nodes[b])] = 1;
        const double volume = std::accumulate(m + b * n, m + (b + 1) * n, 0.0);
        for (int i = 0; i < 3; ++i) constant[3 * at(nodes[b]) + at(i)] += volume * force[i];
        if (spins())
          for (std::size_t a = 0; a < n; ++a) mass[at(pattern.entry(nodes[a], nodes[b]))] += density * m[b * n + a];
      }
    }
    note_vertices(loaded, constant, mass);
  }

  /// The same of all elements, whatever they are. Places of the material are linear in all vertices of a node, but the
  /// point and the acceleration count for those alone that are places themselves.
  LoadedMaterial(const FlexibleBody& body, const BodyLoadLaw& law)
      : body_(body),
        point_(law.point),
        of_spin_(law.spin.squaredNorm() * Mat3::Identity() - law.spin * law.spin.transpose()) {
    const VertexPattern& pattern = body.assembly().pattern();
    std::vector<double> constant(3 * at(body.vertices()), 0.0);
    const std::span<const double> mass = body.mass();
    for (Index b = 0; b < body.vertices(); ++b)
      for (auto e = at(pattern.ptr[at(b)]); e < at(pattern.ptr[at(b) + 1]); ++e)
        for (std::size_t i = 0; is_place(b) && i < 3; ++i)
          constant[3 * at(pattern.ind[e]) + i] += mass[e] * law.acceleration[static_cast<Eigen::Index>(i)];
    note_vertices(std::vector<char>(at(body.vertices()), 1), constant, mass);
  }

  [[nodiscard]] const char* value_name() const override { return "factor"; }
  /// Pairs of vertices that the body has, too; without a spin only which coordinates the load acts on.
  void declare(PatternBuilder& w) const override {
    for (const Index row : rows_) w.add(row, row);
    for (const Pair& pair : pairs_)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t i = 0; i < 3; ++i) w.add(rows_[3 * pair.row + i], rows_[3 * pair.column + j]);
  }
  void bind(const SparsePattern& w) override {
    entries_.clear();
    for (const Pair& pair : pairs_)
      for (Index j = 0; j < 3; ++j)
        entries_.push_back(find_entry(w, rows_[3 * pair.column + at(j)], rows_[3 * pair.row]));
  }
  [[nodiscard]] std::vector<double> slope(ConstSpan q) const override {
    std::vector<double> result(rows_.size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = -constant_[i];
    for (const Pair& pair : pairs_) {
      const Eigen::Map<const Vec3> x(&q[at(places_[pair.column])]);
      const Vec3 arm = pair.of_place ? Vec3(x - point_) : Vec3(x);
      Eigen::Map<Vec3>(&result[3 * pair.row]) -= pair.mass * (of_spin_ * arm);
    }
    return result;
  }
  void add_tangent(ConstSpan, double scale, Span w_values) const override {
    for (std::size_t k = 0; k < pairs_.size(); ++k)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i)
          w_values[at(entries_[3 * k + at(j)]) + at(i)] -= scale * pairs_[k].mass * of_spin_(i, j);
  }

 private:
  struct Pair {
    std::size_t row, column;  ///< of the vertices that are loaded
    double mass;
    bool of_place;  ///< the column's vertex is a place, not a director or slope
  };
  [[nodiscard]] bool is_place(Index vertex) const { return vertex % body_.vertices_per_node() == 0; }
  [[nodiscard]] bool spins() const { return !of_spin_.isZero(0); }

  void note_vertices(const std::vector<char>& loaded, const std::vector<double>& constant,
                     std::span<const double> mass) {
    std::vector<std::size_t> own(loaded.size());
    for (std::size_t v = 0; v < loaded.size(); ++v) {
      if (loaded[v] == 0) continue;
      own[v] = places_.size();
      places_.push_back(body_.configuration(static_cast<Index>(v)));
      for (Index i = 0; i < 3; ++i) rows_.push_back(body_.coordinate(static_cast<Index>(v)) + i);
      constant_.insert(constant_.end(), &constant[3 * v], &constant[3 * v] + 3);
    }
    const VertexPattern& pattern = body_.assembly().pattern();
    for (std::size_t b = 0; spins() && b < loaded.size(); ++b)
      for (auto e = at(pattern.ptr[b]); e < at(pattern.ptr[b + 1]); ++e)
        if (mass[e] != 0) pairs_.push_back({own[at(pattern.ind[e])], own[b], mass[e], is_place(static_cast<Index>(b))});
  }

  const FlexibleBody& body_;
  Vec3 point_;
  Mat3 of_spin_;                  // times the arm: w x (arm x w)
  std::vector<Index> places_;     // of the loaded vertices in the configuration
  std::vector<double> constant_;  // forces that do not depend on the place
  std::vector<Pair> pairs_;       // masses, where there is a spin
  std::vector<Offset> entries_;   // of W: the first of three rows, for each pair and column
};

}  // namespace

std::unique_ptr<PressedFaces> load_material(const FlexibleBody& body, const Mesh& mesh, std::span<const Index> elements,
                                            const ElementMaterials& materials, const BodyLoadLaw& law) {
  if (body.vertices_per_node() != 1) throw std::invalid_argument("body loads act on solids only");
  std::vector<Index> solids(elements.begin(), elements.end());
  if (elements.empty()) {
    solids.resize(at(mesh.element_count()));
    std::iota(solids.begin(), solids.end(), 0);
  }
  std::erase_if(solids, [&](Index e) { return !is_simulated_solid(mesh.type(e)); });
  return std::make_unique<LoadedMaterial>(body, mesh, solids, materials, law);
}

std::unique_ptr<PressedFaces> load_mass(const FlexibleBody& body, const BodyLoadLaw& law) {
  return std::make_unique<LoadedMaterial>(body, law);
}

}  // namespace espalier::dynamics
