#include "dynamics/steady/rotating_system.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"

namespace espalier::dynamics {

RotatingSystem::RotatingSystem(AssembledSystem& system, SteadyRotation rotation)
    : system_(system), rotation_(std::move(rotation)) {
  for (const VectorCoordinates& x : vector_coordinates(system))
    if (std::find(rotation_.bodies.begin(), rotation_.bodies.end(), x.body) != rotation_.bodies.end())
      vectors_.push_back(x);
  v_.resize(at(system.sizes().velocity));
  a_.resize(v_.size());
  lay_out();
}

void RotatingSystem::lay_out() {
  const SparsePattern& w = system_.tangent_pattern();
  PatternBuilder builder(w.rows, w.cols, true);
  const auto rows_of = [&](Index column) {
    return std::span(w.ind).subspan(at(w.ptr[at(column)]), at(w.ptr[at(column) + 1] - w.ptr[at(column)]));
  };
  for (Index j = 0; j < w.cols; ++j) builder.add_block(rows_of(j), std::span(&j, 1));
  for (const VectorCoordinates& x : vectors_)
    for (Index j = x.v; j < x.v + 3; ++j)
      for (Index k = x.v; k < x.v + 3; ++k)
        if (k != j) builder.add_block(rows_of(k), std::span(&j, 1));
  pattern_ = builder.build();
  positions_.resize(at(w.nonzeros()));
  for (Index j = 0; j < w.cols; ++j) {
    Offset in = pattern_.ptr[at(j)];
    for (Offset k = w.ptr[at(j)]; k < w.ptr[at(j) + 1]; ++k) {
      while (pattern_.ind[at(in)] != w.ind[at(k)]) ++in;
      positions_[at(k)] = in;
    }
  }
  version_ = system_.pattern_version();
}

void RotatingSystem::update_pattern(ConstSpan q) {
  system_.update_pattern(q);
  if (version_ != system_.pattern_version()) lay_out();
}

void RotatingSystem::set_load_factor(double factor) {
  factor_ = factor;
  system_.set_load_factor(factor);
}

void RotatingSystem::set_motion(ConstSpan q, Span v, Span a) const {
  std::fill(v.begin(), v.end(), 0.0);
  std::fill(a.begin(), a.end(), 0.0);
  const Vec3 w = std::sqrt(std::max(factor_, 0.0)) * rotation_.rate;
  for (const VectorCoordinates& x : vectors_) {
    Eigen::Map<Vec3> velocity(&v[at(x.v)]), acceleration(&a[at(x.v)]);
    if (x.kind == VectorCoordinates::Kind::turn) {
      velocity = x.axes(q).transpose() * w;
      continue;
    }
    const bool place = x.kind == VectorCoordinates::Kind::place;
    velocity = w.cross(place ? Vec3(x.value(q) - rotation_.point) : x.value(q));
    acceleration = w.cross(Vec3(velocity));
  }
}

StateView RotatingSystem::turning(const StateView& s) {
  set_motion(s.q, v_, a_);
  StateView turned = s;
  turned.v = v_;
  turned.a = a_;
  return turned;
}

void RotatingSystem::residual(const StateView& s, Span f) { system_.residual(turning(s), f); }

void RotatingSystem::multiplier_tangent(const StateView& s, Span values) {
  system_.multiplier_tangent(turning(s), values);
}

// (F_v v_q + F_a a_q) of a vector's columns: v_q = w~ (of a turn, by body axes, w~ in those), a_q = w~ w~ (0).
void RotatingSystem::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  const StateView turned = turning(s);
  own_.resize(positions_.size());
  system_.tangent(turned, weights, own_);
  std::fill(w_values.begin(), w_values.end(), 0.0);
  for (std::size_t k = 0; k < own_.size(); ++k) w_values[at(positions_[k])] = own_[k];
  if (weights.q == 0) return;
  mass_.resize(own_.size());
  damping_.resize(own_.size());
  system_.tangent(turned, {weights.q, 0, 0}, mass_);
  system_.tangent(turned, {0, weights.q, 0}, damping_);
  const SparsePattern& p = system_.tangent_pattern();
  const Vec3 w = std::sqrt(std::max(factor_, 0.0)) * rotation_.rate;
  for (const VectorCoordinates& x : vectors_) {
    const bool turn = x.kind == VectorCoordinates::Kind::turn;
    const Mat3 of_v = skew(turn ? Vec3(x.axes(s.q).transpose() * w) : w);
    const Mat3 of_a = turn ? Mat3(Mat3::Zero()) : Mat3(of_v * of_v);
    for (Index from = 0; from < 3; ++from)
      for (Offset k = p.ptr[at(x.v + from)]; k < p.ptr[at(x.v + from) + 1]; ++k)
        for (Index to = 0; to < 3; ++to) {
          const double value = mass_[at(k)] * of_a(from, to) + damping_[at(k)] * of_v(from, to);
          if (value != 0) w_values[at(find_entry(pattern_, x.v + to, p.ind[at(k)]))] += value;
        }
  }
}

}  // namespace espalier::dynamics
