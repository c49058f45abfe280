/// \file
/// Derivatives of the BDF formula for positions, which stands on a chart where there are rotations.
#pragma once

#include <span>
#include <vector>

#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics {

/// r = T(theta_0) (w_0 theta_0 + w_1 theta_1 + ...), theta_j = local(q_1, q_j), is the velocity at the new point q_0
/// that the formula gives; q_1 is the newest past point, on which the chart stands. D_j = dr/dq_j has a block on the
/// diagonal for each component with coordinates, in a vector space w_j I; the others by central differences of fourth
/// order.
class ChartRates {
 public:
  /// @param system  its components outlive the object
  explicit ChartRates(const AssembledSystem& system);

  /// @param q  the new configuration, then past ones, newest first @param weights  of the formula, as many
  void evaluate(std::span<const ConstSpan> q, ConstSpan weights);
  /// y += factor D_j^T x, n numbers each.
  void add_transposed(std::size_t j, double factor, ConstSpan x, Span y) const;

 private:
  struct Chart {
    const Curved* component;
    std::size_t first, count;                 // velocity coordinates
    std::vector<std::vector<double>> blocks;  // of each D_j, count x count, by columns
  };
  void by_point(std::span<const ConstSpan> q, std::size_t j);
  void rate(std::span<const ConstSpan> q, std::size_t moved, std::vector<double>& r);

  std::vector<Chart> curved_;
  std::vector<char> flat_;  // n
  std::vector<double> weights_;
  std::vector<std::vector<double>> theta_;  // of the points as they are
  std::vector<double> moved_;               // of a point that was moved
};

}  // namespace espalier::dynamics
