#include "dynamics/forces/frame_force.hpp"

#include <algorithm>
#include <stdexcept>

namespace espalier::dynamics {

FrameForce::FrameForce(std::string name, FramePtr a, FramePtr b)
    : Component(std::move(name)), frames_{std::move(a), std::move(b)} {
  if (!frames_[0] || !frames_[1]) throw std::invalid_argument("force \"" + this->name() + "\": a frame is missing");
  blocks_ = FrameBlocks({frames_[0].get(), frames_[1].get()}, {});
}

void FrameForce::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  blocks_.declare(w);
  inputs_.declare(all_coordinates(), w);
}

std::vector<Index> FrameForce::all_coordinates() const {
  std::vector<Index> all;
  for (const auto& f : frames_) all.insert(all.end(), f->coordinates().begin(), f->coordinates().end());
  return all;
}

void FrameForce::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  blocks_.bind(w, pool());
  inputs_.bind(all_coordinates(), w);
}

void FrameForce::declare_multipliers(PatternBuilder& f_lambda) const {
  inputs_.declare_multipliers(all_coordinates(), f_lambda);
}

void FrameForce::bind_multipliers(const SparsePattern& f_lambda) {
  inputs_.bind_multipliers(all_coordinates(), f_lambda);
}

FrameForce::Pair FrameForce::pair(const StateView& s) const {
  Pair p;
  p.t = s.t;
  frames_[0]->motion(s.q, s.v, p.a);
  frames_[1]->motion(s.q, s.v, p.b);
  p.inputs = inputs_.values(s);
  return p;
}

std::vector<double> FrameForce::to_coordinates(ConstSpan q, const Pair& p, const Vec12& wrench) const {
  std::vector<double> all;
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t first = all.size();
    all.resize(first + frames_[k]->coordinates().size());
    if (all.size() == first) continue;
    frames_[k]->project(q, k == 0 ? p.a : p.b, wrench.data() + 6 * k, 1, all.data() + first);
  }
  for (double& x : all) x = -x;
  return all;
}

void FrameForce::residual(const StateView& s, Span f) {
  if (!active_) return;
  const Pair p = pair(s);
  const std::vector<double> own = to_coordinates(s.q, p, law(p));
  std::size_t i = 0;
  for (const auto& frame : frames_) {
    for (const Index c : frame->coordinates()) {
      if (c >= 0) f[at(c)] += own[i];
      ++i;
    }
  }
}

// F = -J^T w(x, J v, u):  F_v = -J^T d J,  F_q = -J^T (k J + d d(J v)/dq) - d(J^T)/dq w, and -J^T dw/du du/dx of inputs
void FrameForce::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (!active_) return;
  const Pair p = pair(s);
  Mat12 k = Mat12::Zero(), d = Mat12::Zero();
  law_derivatives(p, k, d);
  blocks_.add(s.q, s.v, {-weights.q * k - weights.v * d, -weights.q * d, -weights.q * law(p)}, pool(), w_values);
  for (std::size_t u = 0; u < inputs_.size(); ++u)
    inputs_.add_tangent(s, u, to_coordinates(s.q, p, law_by_input(p, u)), weights, w_values);
}

void FrameForce::multiplier_tangent(const StateView& s, Span values) {
  if (!active_ || inputs_.empty()) return;
  const Pair p = pair(s);
  for (std::size_t u = 0; u < inputs_.size(); ++u)
    inputs_.add_multiplier_tangent(s, u, to_coordinates(s.q, p, law_by_input(p, u)), values);
}

Vec12 FrameForce::wrenches(const StateView& s, Derivatives* derivatives) const {
  if (!active_) {
    if (derivatives != nullptr) derivatives->inputs.assign(inputs_.size(), Vec12::Zero());
    return Vec12::Zero();
  }
  const Pair p = pair(s);
  if (derivatives != nullptr) {
    law_derivatives(p, derivatives->k, derivatives->d);
    for (std::size_t u = 0; u < inputs_.size(); ++u) derivatives->inputs.push_back(law_by_input(p, u));
  }
  return law(p);
}

Energy FrameForce::energy(const StateView& s) { return {0, active_ ? potential(pair(s)) : 0.0}; }

void FrameForce::branches(const StateView& s, Branches& out) const {
  if (!active_) return;
  law_branches(s, out);
  for (const StateFunctionPtr& u : inputs_.functions()) u->branches(s, out);
}

Wrench FrameForce::applied(const StateView& s, int f) const {
  const Vec12 w = wrenches(s, nullptr);
  return {w.segment<3>(6 * f), w.segment<3>(6 * f + 3)};
}

}  // namespace espalier::dynamics
