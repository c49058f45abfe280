#include "dynamics/forces/face_pressure.hpp"

#include <map>
#include <stdexcept>

#include "dynamics/elements/pressure.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::size_t kMost = 24;  // coordinates of a face of eight nodes

void gather(const std::vector<Index>& places, ConstSpan q, double* x) {
  for (std::size_t i = 0; i < places.size(); ++i) x[i] = q[static_cast<std::size_t>(places[i])];
}

}  // namespace

FacePressure::FacePressure(std::string name, const FlexibleBody& body, const Mesh& mesh,
                           std::span<const MeshFace> faces)
    : Component(std::move(name)) {
  if (body.vertices_per_node() != 1) throw std::invalid_argument("pressure acts on solid bodies only");
  std::map<Index, std::size_t> known;
  for (const MeshFace& face : faces) {
    Face next{shape_of(mesh.type(face.element)).faces[static_cast<std::size_t>(face.face)].type, {}, {}, {}, {}};
    const std::vector<Index> nodes = mesh.face_nodes(face);
    for (const Index node : nodes) {
      static_cast<void>(body.assembly().pattern().entry(node, nodes.front()));
      for (Index i = 0; i < 3; ++i) {
        const auto [it, fresh] = known.emplace(body.coordinate(node) + i, rows_.size());
        if (fresh) rows_.push_back(it->first);
        next.rows.push_back(it->first);
        next.places.push_back(body.configuration(node) + i);
        next.own.push_back(it->second);
      }
    }
    faces_.push_back(std::move(next));
  }
}

void FacePressure::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  for (const Face& face : faces_) w.add_block(face.rows, face.rows);
  pressure_.declare(rows_, w);
}

void FacePressure::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  for (Face& face : faces_) {
    face.entries.clear();
    for (const Index c : face.rows)
      for (const Index r : face.rows) face.entries.push_back(find_entry(w, c, r));
  }
  pressure_.bind(rows_, w);
}

void FacePressure::declare_multipliers(PatternBuilder& f_lambda) const {
  pressure_.declare_multipliers(rows_, f_lambda);
}

void FacePressure::bind_multipliers(const SparsePattern& f_lambda) { pressure_.bind_multipliers(rows_, f_lambda); }

std::vector<double> FacePressure::slope(ConstSpan q) const {
  std::vector<double> result(rows_.size(), 0.0);
  for (const Face& face : faces_) {
    double x[kMost], force[kMost] = {};
    gather(face.places, q, x);
    add_pressure_force(face.type, -load_factor(), x, force);
    for (std::size_t i = 0; i < face.own.size(); ++i) result[face.own[i]] += force[i];
  }
  return result;
}

void FacePressure::residual(const StateView& s, Span f) {
  if (!active_) return;
  const double p = function()->value(s);
  const std::vector<double> unit = slope(s.q);
  for (std::size_t i = 0; i < rows_.size(); ++i) f[static_cast<std::size_t>(rows_[i])] += p * unit[i];
}

void FacePressure::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (!active_) return;
  const double p = factor() * function()->value(s);
  for (const Face& face : faces_) {
    if (weights.q == 0) break;
    double x[kMost], k[kMost * kMost] = {};
    gather(face.places, s.q, x);
    add_pressure_tangent(face.type, p, -weights.q, x, k);
    for (std::size_t e = 0; e < face.entries.size(); ++e) w_values[static_cast<std::size_t>(face.entries[e])] += k[e];
  }
  if (!function()->coordinates().empty()) pressure_.add_tangent(s, 0, slope(s.q), weights, w_values);
}

void FacePressure::multiplier_tangent(const StateView& s, Span values) {
  if (active_ && !function()->multipliers().empty()) pressure_.add_multiplier_tangent(s, 0, slope(s.q), values);
}

namespace {

class ActingPressure final : public CompositeFunction {
 public:
  explicit ActingPressure(const FacePressure& pressure) : CompositeFunction({pressure.function()}), of_(pressure) {}
  [[nodiscard]] double value(const StateView& s) const override { return of_.factor() * parts().front()->value(s); }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override { add_part(s, 0, of_.factor(), out); }

 private:
  const FacePressure& of_;
};

}  // namespace

StateFunctionPtr pressure_of(const FacePressure& pressure) { return std::make_shared<ActingPressure>(pressure); }

}  // namespace espalier::dynamics
