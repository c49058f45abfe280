#include "dynamics/integrators/history.hpp"

#include <algorithm>
#include <stdexcept>

#include "dynamics/dae/vectors.hpp"

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

History::History(const System& system, int depth) : system_(system), depth_(std::clamp(depth, 1, kDepth)) {
  const Sizes s = system.sizes();
  for (Point& p : std::span(points_).first(at(depth_))) {
    p.q.resize(at(s.configuration));
    p.v.resize(at(s.velocity));
    p.theta.resize(at(s.velocity));
    p.lambda.resize(at(s.constraints));
  }
}

void History::push(double t, ConstSpan q, ConstSpan v, ConstSpan lambda, base::ThreadPool* pool,
                   const DeviceShare* share) {
  if (count_ > 0 && t <= time(0)) throw std::invalid_argument("points of the history must increase in time");
  newest_ = (newest_ + 1) % depth_;
  count_ = std::min(count_ + 1, depth_);
  Point& p = points_[at(newest_)];
  p.t = t;
  copy(pool, q, p.q);
  copy(pool, v, p.v);
  std::copy(lambda.begin(), lambda.end(), p.lambda.begin());
  make_charts(pool, share);
}

void History::renew_charts(base::ThreadPool* pool) { make_charts(pool, nullptr); }

void History::make_charts(base::ThreadPool* pool, const DeviceShare* share) {
  const ConstSpan newest = points_[place(0)].q;
  for (int j = 0; j < count_; ++j) {
    Point& past = points_[place(j)];
    times_[at(j)] = past.t;
    if (share != nullptr) {
      for (const OwnCoordinates& c : share->owners) c.local(newest, past.q, past.theta);
    } else if (j == 0) {
      fill_zero(pool, past.theta);
    } else {
      system_.local(newest, past.q, past.theta);
    }
  }
}

void History::drop_newest() {
  newest_ = (newest_ + depth_ - 1) % depth_;
  --count_;
}

}  // namespace espalier::dynamics
