/// \file
/// Past configurations and velocities, and the polynomials through them that BDF formulas are made of.
#pragma once

#include <array>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// Highest BDF order.
inline constexpr int kMaxBdfOrder = 5;

/// Weights of the derivative at `t` of the polynomial through the nodes t, nodes[0..k-1]: w[0] belongs to t itself,
/// w[j] to nodes[j - 1].
void derivative_weights(double t, std::span<const double> nodes, Span w);
/// Weights of the value at `t` of the polynomial through the nodes.
void value_weights(double t, std::span<const double> nodes, Span w);

/// The last accepted points, newest first, in the chart around the newest configuration:
/// theta_j = local(q_newest, q_j). In a vector space these are differences, which saves digits; on a group they are
/// rotation vectors of a few steps, far from any singularity. BDF is then applied to theta and v, and
/// v = T(theta) d(theta)/dt links them, so the order of the formula is kept on the group.
class History {
 public:
  static constexpr int kDepth = kMaxBdfOrder + 2;
  /// @param depth  points that are held, at most kDepth: the order of the formulas + 2
  explicit History(const System& system, int depth = kDepth);

  void clear() { count_ = 0; }
  /// Adds a point; times must increase. @param pool  threads for long vectors; null: the calling one
  /// @param share  not null: theta(j) is made for the coordinates of the host alone, see renew_charts()
  void push(double t, ConstSpan q, ConstSpan v, ConstSpan lambda, base::ThreadPool* pool = nullptr,
            const DeviceShare* share = nullptr);
  /// Makes theta(j) for all coordinates.
  void renew_charts(base::ThreadPool* pool);
  /// Another push() will put its point in place of the newest. @pre size() > 1
  void drop_newest();
  /// Number of points held.
  [[nodiscard]] int size() const { return count_; }
  [[nodiscard]] int depth() const { return depth_; }
  [[nodiscard]] double time(int j) const { return slot(j).t; }
  /// Times of the newest `count` points, newest first.
  [[nodiscard]] std::span<const double> times(int count) const { return {times_.data(), at(count)}; }
  [[nodiscard]] ConstSpan theta(int j) const { return slot(j).theta; }
  [[nodiscard]] ConstSpan q(int j) const { return slot(j).q; }
  [[nodiscard]] ConstSpan v(int j) const { return slot(j).v; }
  [[nodiscard]] ConstSpan lambda(int j) const { return slot(j).lambda; }
  [[nodiscard]] Span theta(int j) { return points_[place(j)].theta; }
  [[nodiscard]] Span v(int j) { return points_[place(j)].v; }

 private:
  struct Point {
    double t = 0;
    std::vector<double> q, v, lambda, theta;
  };
  [[nodiscard]] std::size_t place(int j) const { return at((newest_ + depth_ - j) % depth_); }
  [[nodiscard]] const Point& slot(int j) const { return points_[place(j)]; }

  void make_charts(base::ThreadPool* pool, const DeviceShare* share);

  const System& system_;
  int depth_;
  std::array<Point, kDepth> points_;
  std::array<double, kDepth> times_{};
  int newest_ = 0;
  int count_ = 0;
};

}  // namespace espalier::dynamics
