/// \file
/// How the velocity and acceleration levels of the constraints change with positions and velocities.
#pragma once

#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// The matrices d(Phi_q v - nu)/dq, d(Phi_q a - gamma)/dq and d(Phi_q a - gamma)/dv at a state. Row i depends on the
/// coordinates that row i of Phi_q has entries for, so all three have its pattern. Columns without a row in common are
/// moved together (A. R. Curtis, M. J. D. Powell, J. K. Reid, J. Inst. Math. Appl. 13, 1974): central differences of
/// fourth order by q; by v, of which gamma is a square, of second order.
class LevelDerivatives {
 public:
  /// @param steps  of the differences: n moves of the coordinates. @param equations  outlives the object
  LevelDerivatives(Equations& equations, std::vector<double> steps);

  /// Leaves the equations' constraints evaluated at the state.
  void evaluate(const State& s);
  // Values in the order of the pattern of Phi_q.
  [[nodiscard]] ConstSpan velocity_by_q() const { return velocity_by_q_; }
  [[nodiscard]] ConstSpan acceleration_by_q() const { return acceleration_by_q_; }
  [[nodiscard]] ConstSpan acceleration_by_v() const { return acceleration_by_v_; }

 private:
  struct Entry {
    Offset position;  // in the values
    Index row, column;
  };
  void color();
  void by_positions(const State& s, const std::vector<Entry>& entries);
  void by_velocities(const State& s, const std::vector<Entry>& entries);

  Equations& equations_;
  std::vector<double> steps_;
  std::uint64_t version_ = 0;
  bool colored_ = false;
  std::vector<std::vector<Entry>> colors_;  // entries of the columns that are moved together
  std::vector<double> velocity_by_q_, acceleration_by_q_, acceleration_by_v_;
};

}  // namespace espalier::dynamics
