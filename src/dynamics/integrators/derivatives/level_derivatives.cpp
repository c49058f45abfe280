#include "dynamics/integrators/derivatives/level_derivatives.hpp"

#include <array>
#include <utility>

#include "base/at.hpp"

namespace espalier::dynamics {

LevelDerivatives::LevelDerivatives(Equations& equations, std::vector<double> steps)
    : equations_(equations), steps_(std::move(steps)) {}

// Greedily, column after column: the first color that no column of the same rows has.
void LevelDerivatives::color() {
  const SparsePattern& p = equations_.system().constraint_pattern();
  std::vector<std::vector<Entry>> columns(at(p.cols));
  for (Index i = 0; i < p.rows; ++i)
    for (Offset k = p.ptr[at(i)]; k < p.ptr[at(i) + 1]; ++k) columns[at(p.ind[at(k)])].push_back({k, i, p.ind[at(k)]});
  constexpr std::size_t kNone = at(-1);
  std::vector<std::size_t> color_of(columns.size(), kNone), taken_by;
  colors_.clear();
  for (std::size_t j = 0; j < columns.size(); ++j) {
    if (columns[j].empty()) continue;
    taken_by.resize(colors_.size() + 1, kNone);
    for (const Entry& e : columns[j])
      for (Offset k = p.ptr[at(e.row)]; k < p.ptr[at(e.row) + 1]; ++k)
        if (const std::size_t c = color_of[at(p.ind[at(k)])]; c != kNone) taken_by[c] = j;
    std::size_t c = 0;
    while (c < colors_.size() && taken_by[c] == j) ++c;
    if (c == colors_.size()) colors_.emplace_back();
    color_of[j] = c;
    colors_[c].insert(colors_[c].end(), columns[j].begin(), columns[j].end());
  }
  for (auto* x : {&velocity_by_q_, &acceleration_by_q_, &acceleration_by_v_}) x->assign(at(p.nonzeros()), 0.0);
  version_ = equations_.system().pattern_version();
  colored_ = true;
}

void LevelDerivatives::by_positions(const State& s, const std::vector<Entry>& entries) {
  std::vector<double> move(s.v.size()), q(s.q.size());
  std::array<std::vector<double>, 4> velocity, acceleration;
  constexpr std::array<double, 4> kWays = {-2, -1, 1, 2};
  for (std::size_t w = 0; w < kWays.size(); ++w) {
    for (const Entry& e : entries) move[at(e.column)] = kWays[w] * steps_[at(e.column)];
    equations_.system().retract(s.q, move, q);
    equations_.evaluate_constraints(s.t, q, s.v);
    velocity[w].resize(s.lambda.size());
    acceleration[w].resize(s.lambda.size());
    equations_.level(s.v, equations_.nu(), velocity[w]);
    equations_.level(s.a, equations_.gamma(), acceleration[w]);
  }
  const auto slope = [](const std::array<std::vector<double>, 4>& f, const Entry& e, double step) {
    const std::size_t i = at(e.row);
    return (8 * (f[2][i] - f[1][i]) - (f[3][i] - f[0][i])) / (12 * step);
  };
  for (const Entry& e : entries) {
    velocity_by_q_[at(e.position)] = slope(velocity, e, steps_[at(e.column)]);
    acceleration_by_q_[at(e.position)] = slope(acceleration, e, steps_[at(e.column)]);
  }
}

// @pre constraints evaluated at the state
void LevelDerivatives::by_velocities(const State& s, const std::vector<Entry>& entries) {
  const double largest = max_norm(s.v), step = largest > 0 ? largest : 1;
  std::array<std::vector<double>, 2> acceleration;
  std::vector<double> v = s.v;
  for (std::size_t w = 0; w < 2; ++w) {
    for (const Entry& e : entries) v[at(e.column)] = s.v[at(e.column)] + (w == 0 ? -step : step);
    equations_.evaluate_gamma(s.t, s.q, v);
    acceleration[w].resize(s.lambda.size());
    equations_.level(s.a, equations_.gamma(), acceleration[w]);
  }
  for (const Entry& e : entries)
    acceleration_by_v_[at(e.position)] = (acceleration[1][at(e.row)] - acceleration[0][at(e.row)]) / (2 * step);
}

void LevelDerivatives::evaluate(const State& s) {
  if (!colored_ || version_ != equations_.system().pattern_version()) color();
  for (const std::vector<Entry>& entries : colors_) by_positions(s, entries);
  equations_.evaluate_constraints(s.t, s.q, s.v);
  for (const std::vector<Entry>& entries : colors_) by_velocities(s, entries);
  equations_.evaluate_constraints(s.t, s.q, s.v);
}

}  // namespace espalier::dynamics
