#include "dynamics/joints/node_equations.hpp"

#include "base/at.hpp"

namespace espalier::dynamics {

NodeEquations::NodeEquations(std::string name, std::vector<NodeEquation> equations)
    : Component(std::move(name)), equations_(std::move(equations)) {}

std::string NodeEquations::constraint_name(Index local_row) const {
  return "equation \"" + name() + "\", " + equations_.at(at(local_row)).label;
}

void NodeEquations::declare(PatternBuilder& /*w*/, PatternBuilder& phi_q) const {
  Index row = placement().c;
  for (const NodeEquation& e : equations_) {
    for (const NodeEquation::Term& t : e.terms) phi_q.add(row, t.coordinate());
    ++row;
  }
}

void NodeEquations::bind(const SparsePattern& /*w*/, const SparsePattern& phi_q) {
  position_.clear();
  Index row = placement().c;
  for (const NodeEquation& e : equations_) {
    for (const NodeEquation::Term& t : e.terms) position_.push_back(at(find_entry(phi_q, row, t.coordinate())));
    ++row;
  }
}

void NodeEquations::constraints(double /*t*/, ConstSpan q, ConstSpan /*v*/, const ConstraintBuffers& out) {
  std::size_t row = at(placement().c), entry = 0;
  for (const NodeEquation& e : equations_) {
    if (!out.phi.empty()) {
      double sum = -e.rest;
      for (const NodeEquation::Term& t : e.terms) sum += t.factor * q[at(t.configuration())];
      out.phi[row] = sum;
    }
    if (!out.nu.empty()) out.nu[row] = 0;
    if (!out.gamma.empty()) out.gamma[row] = 0;
    if (!out.phi_q_values.empty())
      for (const NodeEquation::Term& t : e.terms) out.phi_q_values[position_[entry++]] = t.factor;
    ++row;
  }
}

NodeSpring::NodeSpring(std::string name, NodeEquation equation, double stiffness, double damping)
    : Component(std::move(name)), equation_(std::move(equation)), stiffness_(stiffness), damping_(damping) {}

void NodeSpring::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  for (const NodeEquation::Term& a : equation_.terms)
    for (const NodeEquation::Term& b : equation_.terms) w.add(a.coordinate(), b.coordinate());
}

void NodeSpring::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  position_.clear();
  for (const NodeEquation::Term& a : equation_.terms)
    for (const NodeEquation::Term& b : equation_.terms)
      position_.push_back(at(find_entry(w, a.coordinate(), b.coordinate())));
}

double NodeSpring::value(ConstSpan q) const {
  double sum = -equation_.rest;
  for (const NodeEquation::Term& t : equation_.terms) sum += t.factor * q[at(t.configuration())];
  return sum;
}

void NodeSpring::residual(const StateView& s, Span f) {
  double pull = stiffness_ * value(s.q);
  if (damping_ != 0 && !s.v.empty())
    for (const NodeEquation::Term& t : equation_.terms) pull += damping_ * t.factor * s.v[at(t.coordinate())];
  for (const NodeEquation::Term& t : equation_.terms) f[at(t.coordinate())] += pull * t.factor;
}

void NodeSpring::tangent(const StateView& /*s*/, const TangentWeights& weights, Span w_values) {
  const double each = weights.q * stiffness_ + weights.v * damping_;
  std::size_t entry = 0;
  for (const NodeEquation::Term& a : equation_.terms)
    for (const NodeEquation::Term& b : equation_.terms) w_values[position_[entry++]] += each * a.factor * b.factor;
}

Energy NodeSpring::energy(const StateView& s) {
  const double e = value(s.q);
  return {0, 0.5 * stiffness_ * e * e};
}

}  // namespace espalier::dynamics
