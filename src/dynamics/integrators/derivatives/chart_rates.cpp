#include "dynamics/integrators/derivatives/chart_rates.hpp"

#include <algorithm>
#include <array>

#include "base/at.hpp"

namespace espalier::dynamics {

namespace {
constexpr double kMove = 1e-3;  // radians; positions, in which everything is linear, by as much of their size
}

ChartRates::ChartRates(const AssembledSystem& system) {
  flat_.assign(at(system.sizes().velocity), 1);
  for (const auto& component : system.components()) {
    const auto* const curved = dynamic_cast<const Curved*>(component.get());
    if (curved == nullptr) continue;
    const std::size_t count = at(component->sizes().velocity), first = at(component->placement().v);
    curved_.push_back({curved, first, count, {}});
    std::fill_n(flat_.begin() + static_cast<std::ptrdiff_t>(first), count, char{0});
  }
}

// r of the curved components; theta_ of all points but the moved one is known. Where that is the base, none is.
void ChartRates::rate(std::span<const ConstSpan> q, std::size_t moved, std::vector<double>& r) {
  for (const Chart& c : curved_) {
    const auto own = [&](std::vector<double>& x) { return Span(x).subspan(c.first, c.count); };
    std::fill_n(r.begin() + static_cast<std::ptrdiff_t>(c.first), c.count, 0.0);
    for (std::size_t j = q.size(); j-- > 0;) {  // the new point is the last: its theta stays in moved_
      const bool known = j != moved && moved != 1;
      if (!known || j == 0) c.component->local(q[1], q[j], moved_);
      const Span theta = known && j != 0 ? own(theta_[j]) : own(moved_);
      for (std::size_t i = 0; i < c.count; ++i) r[c.first + i] += weights_[j] * theta[i];
    }
    c.component->velocity_of_rate(moved_, r, r);
  }
}

void ChartRates::by_point(std::span<const ConstSpan> q, std::size_t j) {
  const std::size_t n = flat_.size();
  std::size_t most = 0;
  for (const Chart& c : curved_) most = std::max(most, c.count);
  std::vector<double> move(n, 0.0), size(n), q_moved(q[j].begin(), q[j].end());
  std::array<std::vector<double>, 4> r;
  for (std::vector<double>& x : r) x.resize(n);
  for (const Chart& c : curved_) c.component->magnitude(q[j], size);
  std::vector<ConstSpan> points(q.begin(), q.end());
  points[j] = q_moved;
  constexpr std::array<double, 4> kWays = {-2, -1, 1, 2};
  for (std::size_t i = 0; i < most; ++i) {  // coordinate i of all components that have it
    for (std::size_t w = 0; w < kWays.size(); ++w) {
      for (const Chart& c : curved_) {
        if (i < c.count) move[c.first + i] = kWays[w] * kMove * std::max(1.0, size[c.first + i]);
        c.component->retract(q[j], move, q_moved);
        if (i < c.count) move[c.first + i] = 0;
      }
      rate(points, j, r[w]);
    }
    for (Chart& c : curved_) {
      if (i >= c.count) continue;
      const double over = 1 / (12 * kMove * std::max(1.0, size[c.first + i]));
      for (std::size_t k = 0; k < c.count; ++k) {
        const std::size_t row = c.first + k;
        c.blocks[j][i * c.count + k] = over * (8 * (r[2][row] - r[1][row]) - (r[3][row] - r[0][row]));
      }
    }
  }
}

void ChartRates::evaluate(std::span<const ConstSpan> q, ConstSpan weights) {
  weights_.assign(weights.begin(), weights.end());
  if (curved_.empty()) return;
  moved_.resize(flat_.size());
  theta_.assign(q.size(), std::vector<double>(flat_.size()));
  for (Chart& c : curved_) {
    for (std::size_t j = 0; j < q.size(); ++j) c.component->local(q[1], q[j], theta_[j]);
    c.blocks.assign(q.size(), std::vector<double>(c.count * c.count));
  }
  for (std::size_t j = 0; j < q.size(); ++j) by_point(q, j);
}

void ChartRates::add_transposed(std::size_t j, double factor, ConstSpan x, Span y) const {
  for (std::size_t i = 0; i < flat_.size(); ++i)
    if (flat_[i] != 0) y[i] += factor * weights_[j] * x[i];
  for (const Chart& c : curved_)
    for (std::size_t i = 0; i < c.count; ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < c.count; ++k) sum += c.blocks[j][i * c.count + k] * x[c.first + k];
      y[c.first + i] += factor * sum;
    }
}

}  // namespace espalier::dynamics
