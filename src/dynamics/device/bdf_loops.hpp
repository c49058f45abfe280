/// \file
/// What BDF does with its long vectors, coordinate by coordinate.
#pragma once

#include "dynamics/device/motion_arrays.hpp"

namespace espalier::dynamics {

/// Those that it works with on a GPU.
inline constexpr MotionVector kBdfVectors[] = {
    &MotionArrays::q,         &MotionArrays::v,        &MotionArrays::a,    &MotionArrays::theta,
    &MotionArrays::theta_hat, &MotionArrays::v_hat,    &MotionArrays::rate, &MotionArrays::weight_q,
    &MotionArrays::weight_v,  &MotionArrays::placed_q, &MotionArrays::dq,   &MotionArrays::dv,
    &MotionArrays::f,         &MotionArrays::work};
inline constexpr MotionVector kBdfRightSides[] = {&MotionArrays::tangential, &MotionArrays::normal};

/// Derivatives of the chart's coordinates by the formula, (theta - theta^)/h'; in a vector space the velocity.
struct FormulaRates {
  double inverse;  ///< 1/h'
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.rate[i] = (s.theta[i] - s.theta_hat[i]) * inverse;
  }
};

/// What takes q and v to the BDF formulas: h' (R1 + h' R2) and h' R2, from R1 = v - rate and R2 = a - (v - v^)/h'.
struct StageChanges {
  double hp, inverse;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    const double r1 = s.v[i] - s.rate[i], r2 = s.a[i] - (s.v[i] - s.v_hat[i]) * inverse;
    s.dq[i] = hp * (r1 + hp * r2);
    s.dv[i] = hp * r2;
  }
};

/// Right-hand side of the tangential solve, -F, of which the normal one has nothing.
struct RightSides {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.tangential[i] = -s.f[i];
    s.normal[i] = 0;
  }
};

/// The end of a pass: a, v and the changes of q and v by what was solved for; q itself is still to be moved by `work`.
struct PassChanges {
  double hp;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    const double da = s.tangential[i];
    s.a[i] += da + s.normal[i];
    s.v[i] += hp * da;
    s.work[i] = hp * hp * da;
    s.dv[i] += hp * da;
    s.dq[i] += s.work[i];
  }
};

/// Predicted accelerations.
struct FormulaAcceleration {
  double hp;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { s.a[i] = (s.v[i] - s.v_hat[i]) / hp; }
};

/// Weights of the error of v at the newest point.
struct VelocityWeights {
  double relative, absolute;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    const double v = s.past_v[0][i];
    s.weight_v[i] = 1 / (relative * (v < 0 ? -v : v) + absolute);
  }
};

/// to_theta = from_theta + the sum of weights[j] theta_j over past points, and the same of v. From null: zero.
struct PastSums {
  MotionVector from_theta = nullptr, from_v = nullptr, to_theta = nullptr, to_v = nullptr;
  double weights[kMotionPoints] = {};
  int count = 0;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    double theta = from_theta == nullptr ? 0.0 : (s.*from_theta)[i], v = from_v == nullptr ? 0.0 : (s.*from_v)[i];
    for (int j = 0; j < count; ++j) {
      theta += weights[j] * s.past_theta[j][i];
      v += weights[j] * s.past_v[j][i];
    }
    (s.*to_theta)[i] = theta;
    (s.*to_v)[i] = v;
  }
};

/// q from a chart's coordinates around the newest point, in a vector space.
struct PositionInChart {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.q[i] = s.past_q[0][i] + s.theta[i];
  }
};

/// And back.
struct ChartOfPosition {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.theta[i] = s.q[i] - s.past_q[0][i];
  }
};

/// work := how far q lies from where the factor was placed.
struct WayFromFactor {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { s.work[i] = s.q[i] - s.placed_q[i]; }
};

/// The trial state becomes the newest point, in whose chart all `count` points are taken.
struct NewPoint {
  int count;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    const double q = s.q[i];
    s.past_q[0][i] = q;
    s.past_v[0][i] = s.v[i];
    for (int j = 0; j < count; ++j) s.past_theta[j][i] = j == 0 ? 0.0 : s.past_q[j][i] - q;
  }
};

}  // namespace espalier::dynamics
