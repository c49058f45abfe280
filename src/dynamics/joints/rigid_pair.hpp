/// \file
/// The equations between two rigid bodies (or a body and the ground) written out: what nearly all joints of a rigid
/// mechanism are, at a fraction of the cost of the general way through frames.
#pragma once

#include <array>
#include <vector>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/joints/relative.hpp"

namespace espalier::dynamics {

/// Evaluates rows of the kinds `global`, `along` and `dot` of one pair of points. With R the rotation of a body, s the
/// point in body axes, C = R_A^T R_B, a and b the axes of a row in body axes of A and B, x~ y = x cross y, and
/// increments [dx; dtheta] of global translation and body rotation of each side:
///   global e:    e . (r_B - r_A)    gradients [-e; R_A^T e x s_A], [e; s_B x R_B^T e]
///   along a:     R_A a . (r_B - r_A)          [-R_A a; a x R_A^T (r_B - x_A)], [R_A a; s_B x C^T a]
///   dot a, b:    a . C b                      [0; a x C b], [0; b x C^T a]
class RigidPair {
 public:
  struct Side {
    Index q = -1;               ///< place of position and quaternion in q; -1: the ground
    Index v = -1;               ///< place of the 6 velocity coordinates in v; -1: the ground
    Vec3 point = Vec3::Zero();  ///< s, in body axes; for the ground in global ones
  };
  struct Row {
    Relative kind = Relative::global;
    int axis = 0;           ///< of `global`: e is that unit vector
    Vec3 a = Vec3::Zero();  ///< axis of side A, in body axes
    Vec3 b = Vec3::Zero();  ///< axis of side B, in body axes
  };
  /// Kinds that a row may have.
  [[nodiscard]] static bool knows(Relative kind) {
    return kind == Relative::global || kind == Relative::along || kind == Relative::dot;
  }

  RigidPair(const Side& a, const Side& b, std::vector<Row> rows);

  /// What evaluate() fills in, one number per row each, in the order of the rows. Null: not wanted.
  struct Results {
    double* value = nullptr;
    double* curvature = nullptr;  ///< (d/dt gradient) v; needs v
    /// rows x width(), row by row: 6 numbers for side A, then 6 for side B; a side on the ground has none.
    double* gradient = nullptr;
  };
  void evaluate(ConstSpan q, ConstSpan v, const Results& out) const;
  [[nodiscard]] std::size_t width() const { return (sides_[0].v < 0 ? 0U : 6U) + (sides_[1].v < 0 ? 0U : 6U); }

  /// Looks up where add_stiffness() adds to in W.
  void bind(const SparsePattern& w);
  /// Adds scale * d(sum lambda_r gradient_r)/dq to W.
  void add_stiffness(ConstSpan q, const double* lambda, double scale, Span w_values) const;

 private:
  std::array<Side, 2> sides_;
  std::vector<Row> rows_;
  bool has_axes_ = false;   // some row uses axes
  bool has_along_ = false;  // some row is `along`
  struct Target {
    std::uint8_t local;  // place in the 12 x 12 block, column by column
    std::size_t w;       // entry of W
  };
  std::vector<Target> targets_;
};

}  // namespace espalier::dynamics
