#include "dynamics/integrators/history.hpp"

#include <algorithm>
#include <stdexcept>

namespace espalier::dynamics {

void derivative_weights(double t, std::span<const double> nodes, Span w) {
  // l_0'(t) = sum 1/(t - t_j);  l_j'(t) = prod_{i != j} (t - t_i) / [(t_j - t) prod_{i != j} (t_j - t_i)]
  w[0] = 0;
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    w[0] += 1 / (t - nodes[j]);
    double value = 1 / (nodes[j] - t);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (i != j) value *= (t - nodes[i]) / (nodes[j] - nodes[i]);
    }
    w[j + 1] = value;
  }
}

void value_weights(double t, std::span<const double> nodes, Span w) {
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    w[j] = 1;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (i != j) w[j] *= (t - nodes[i]) / (nodes[j] - nodes[i]);
    }
  }
}

History::History(const System& system) : system_(system) {
  const Sizes s = system.sizes();
  for (Point& p : points_) {
    p.q.resize(static_cast<std::size_t>(s.configuration));
    p.v.resize(static_cast<std::size_t>(s.velocity));
    p.theta.resize(static_cast<std::size_t>(s.velocity));
    p.lambda.resize(static_cast<std::size_t>(s.constraints));
  }
}

void History::push(double t, ConstSpan q, ConstSpan v, ConstSpan lambda) {
  if (count_ > 0 && t <= time(0)) throw std::invalid_argument("points of the history must increase in time");
  newest_ = (newest_ + 1) % kDepth;
  count_ = std::min(count_ + 1, kDepth);
  Point& p = points_[static_cast<std::size_t>(newest_)];
  p.t = t;
  std::copy(q.begin(), q.end(), p.q.begin());
  std::copy(v.begin(), v.end(), p.v.begin());
  std::copy(lambda.begin(), lambda.end(), p.lambda.begin());
  for (int j = 0; j < count_; ++j) {
    Point& past = points_[static_cast<std::size_t>((newest_ + kDepth - j) % kDepth)];
    times_[static_cast<std::size_t>(j)] = past.t;
    if (j == 0) {
      std::fill(past.theta.begin(), past.theta.end(), 0.0);
    } else {
      system_.local(p.q, past.q, past.theta);
    }
  }
}

}  // namespace espalier::dynamics
