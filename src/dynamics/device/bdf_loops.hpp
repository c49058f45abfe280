/// \file
/// What BDF does with its long vectors, coordinate by coordinate: loops that the host's threads and GPUs both run.
#pragma once

#include <cstddef>
#include <variant>

#include "dynamics/elements/anywhere.hpp"

namespace espalier::dynamics {

inline constexpr int kBdfPoints = 7;  ///< past points at most: the highest order + 2

/// The vectors of an integrator, n numbers each, where they lie. See BdfIntegrator for the words.
struct BdfArrays {
  /// On a GPU alone, like past_q: the configuration, in the order of the velocity coordinates.
  double* q = nullptr;
  double *v = nullptr, *a = nullptr, *theta = nullptr, *theta_hat = nullptr, *v_hat = nullptr;
  double *weight_q = nullptr, *weight_v = nullptr;
  double *rate = nullptr, *dq = nullptr, *dv = nullptr, *f = nullptr, *work = nullptr;
  double* placed_q = nullptr;                       ///< on a GPU alone
  double *tangential = nullptr, *normal = nullptr;  ///< n + m each: right-hand sides and solutions of K
  /// Past points, the newest first.
  double *past_q[kBdfPoints] = {}, *past_v[kBdfPoints] = {}, *past_theta[kBdfPoints] = {};
};

/// Which of the vectors.
using BdfVector = double* BdfArrays::*;

/// Derivatives of the chart's coordinates by the formula, (theta - theta^)/h'; in a vector space the velocity.
struct FormulaRates {
  double inverse;  ///< 1/h'
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    s.rate[i] = (s.theta[i] - s.theta_hat[i]) * inverse;
  }
};

/// What takes q and v to the BDF formulas: h' (R1 + h' R2) and h' R2, from R1 = v - rate and R2 = a - (v - v^)/h'.
struct StageChanges {
  double hp, inverse;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    const double r1 = s.v[i] - s.rate[i], r2 = s.a[i] - (s.v[i] - s.v_hat[i]) * inverse;
    s.dq[i] = hp * (r1 + hp * r2);
    s.dv[i] = hp * r2;
  }
};

/// Right-hand side of the tangential solve, -F, of which the normal one has nothing.
struct RightSides {
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    s.tangential[i] = -s.f[i];
    s.normal[i] = 0;
  }
};

/// The end of a pass: a, v and the changes of q and v by what was solved for; q itself is still to be moved by `work`.
struct PassChanges {
  double hp;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
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
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { s.a[i] = (s.v[i] - s.v_hat[i]) / hp; }
};

/// Weights of the error of v at the newest point.
struct VelocityWeights {
  double relative, absolute;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    const double v = s.past_v[0][i];
    s.weight_v[i] = 1 / (relative * (v < 0 ? -v : v) + absolute);
  }
};

/// to_theta = from_theta + the sum of weights[j] theta_j over past points, and the same of v. From null: zero.
struct PastSums {
  BdfVector from_theta = nullptr, from_v = nullptr, to_theta = nullptr, to_v = nullptr;
  double weights[kBdfPoints] = {};
  int count = 0;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    double theta = from_theta == nullptr ? 0.0 : (s.*from_theta)[i], v = from_v == nullptr ? 0.0 : (s.*from_v)[i];
    for (int j = 0; j < count; ++j) {
      theta += weights[j] * s.past_theta[j][i];
      v += weights[j] * s.past_v[j][i];
    }
    (s.*to_theta)[i] = theta;
    (s.*to_v)[i] = v;
  }
};

struct AddTo {
  BdfVector to, what;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { (s.*to)[i] += (s.*what)[i]; }
};

struct SetZero {
  BdfVector to;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { (s.*to)[i] = 0; }
};

struct CopyOf {
  BdfVector to, what;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { (s.*to)[i] = (s.*what)[i]; }
};

/// q from a chart's coordinates around the newest point, in a vector space.
struct PositionInChart {
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { s.q[i] = s.past_q[0][i] + s.theta[i]; }
};

/// And back.
struct ChartOfPosition {
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { s.theta[i] = s.q[i] - s.past_q[0][i]; }
};

/// work := how far q lies from where the factor was placed.
struct WayFromFactor {
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const { s.work[i] = s.q[i] - s.placed_q[i]; }
};

/// The trial state becomes the newest point, in whose chart all `count` points are taken.
struct NewPoint {
  int count;
  ESPALIER_ANYWHERE void operator()(const BdfArrays& s, std::size_t i) const {
    const double q = s.q[i];
    s.past_q[0][i] = q;
    s.past_v[0][i] = s.v[i];
    for (int j = 0; j < count; ++j) s.past_theta[j][i] = j == 0 ? 0.0 : s.past_q[j][i] - q;
  }
};

using BdfLoop =
    std::variant<FormulaRates, StageChanges, RightSides, PassChanges, FormulaAcceleration, VelocityWeights, PastSums,
                 AddTo, SetZero, CopyOf, PositionInChart, ChartOfPosition, WayFromFactor, NewPoint>;

/// What the host learns of long vectors.
struct BdfRecord {
  static constexpr int kLargest = 4, kSquares = 2;
  double largest[kLargest];  ///< |x|; a NaN is larger than all
  double square[kSquares];   ///< sums of (x w)^2
};

/// What it asks: null pointers for nothing.
struct BdfMeasure {
  BdfVector largest[BdfRecord::kLargest] = {};
  BdfVector x[BdfRecord::kSquares] = {}, weight[BdfRecord::kSquares] = {};  ///< no weight: 1
  ESPALIER_ANYWHERE void add(const BdfArrays& s, std::size_t i, BdfRecord& sum) const {
    for (int k = 0; k < BdfRecord::kLargest; ++k)
      if (largest[k] != nullptr) see((s.*largest[k])[i], sum.largest[k]);
    for (int k = 0; k < BdfRecord::kSquares; ++k) {
      if (x[k] == nullptr) continue;
      const double term = (s.*x[k])[i] * (weight[k] == nullptr ? 1.0 : (s.*weight[k])[i]);
      sum.square[k] += term * term;
    }
  }
  static ESPALIER_ANYWHERE void join(BdfRecord& sum, const BdfRecord& next) {
    for (int k = 0; k < BdfRecord::kLargest; ++k) see(next.largest[k], sum.largest[k]);
    for (int k = 0; k < BdfRecord::kSquares; ++k) sum.square[k] += next.square[k];
  }

 private:
  static ESPALIER_ANYWHERE void see(double x, double& most) {
    const double size = x < 0 ? -x : x;
    if (most == most && !(size <= most)) most = size;
  }
};

}  // namespace espalier::dynamics
