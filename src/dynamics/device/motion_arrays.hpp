/// \file
/// The long vectors of an integrator, loops over them that the host's threads and GPUs both run, and what is measured.
#pragma once

#include <cstddef>
#include <span>

#include "dynamics/elements/anywhere.hpp"

namespace espalier::dynamics {

inline constexpr int kMotionPoints = 7;  ///< past points at most: BDF's highest order + 2

/// The vectors of an integrator, n numbers each, where they lie; those that it does not work with are null.
struct MotionArrays {
  /// The trial state. Configurations are in the order of the velocity coordinates, and on a GPU alone.
  double *q = nullptr, *v = nullptr, *a = nullptr;
  double *f = nullptr, *work = nullptr;
  // BDF's; see BdfIntegrator for the words.
  double *theta = nullptr, *theta_hat = nullptr, *v_hat = nullptr, *weight_q = nullptr, *weight_v = nullptr;
  double *rate = nullptr, *dq = nullptr, *dv = nullptr, *placed_q = nullptr;
  double *tangential = nullptr, *normal = nullptr;  ///< n + m each: right-hand sides and solutions of K
  /// Past points, the newest first.
  double *past_q[kMotionPoints] = {}, *past_v[kMotionPoints] = {}, *past_theta[kMotionPoints] = {};
};

/// Which of the vectors.
using MotionVector = double* MotionArrays::*;

/// What an integrator works with on a GPU. Its lists live as long as the program.
struct MotionDemand {
  std::span<const MotionVector> vectors;      ///< of n numbers
  std::span<const MotionVector> right_sides;  ///< of n + m numbers
  int points = 0;                             ///< past ones
};

struct AddTo {
  MotionVector to, what;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { (s.*to)[i] += (s.*what)[i]; }
};

struct CopyOf {
  MotionVector to, what;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { (s.*to)[i] = (s.*what)[i]; }
};

/// What the host learns of long vectors.
struct MotionRecord {
  static constexpr int kLargest = 4, kSquares = 2;
  double largest[kLargest];  ///< |x|; a NaN is larger than all
  double square[kSquares];   ///< sums of (x w)^2
};

/// What it asks: null pointers for nothing.
struct MotionMeasure {
  MotionVector largest[MotionRecord::kLargest] = {};
  MotionVector x[MotionRecord::kSquares] = {}, weight[MotionRecord::kSquares] = {};  ///< no weight: 1
  ESPALIER_ANYWHERE void add(const MotionArrays& s, std::size_t i, MotionRecord& sum) const {
    for (int k = 0; k < MotionRecord::kLargest; ++k)
      if (largest[k] != nullptr) see((s.*largest[k])[i], sum.largest[k]);
    for (int k = 0; k < MotionRecord::kSquares; ++k) {
      if (x[k] == nullptr) continue;
      const double term = (s.*x[k])[i] * (weight[k] == nullptr ? 1.0 : (s.*weight[k])[i]);
      sum.square[k] += term * term;
    }
  }
  static ESPALIER_ANYWHERE void join(MotionRecord& sum, const MotionRecord& next) {
    for (int k = 0; k < MotionRecord::kLargest; ++k) see(next.largest[k], sum.largest[k]);
    for (int k = 0; k < MotionRecord::kSquares; ++k) sum.square[k] += next.square[k];
  }

 private:
  static ESPALIER_ANYWHERE void see(double x, double& most) {
    const double size = x < 0 ? -x : x;
    if (most == most && !(size <= most)) most = size;
  }
};

}  // namespace espalier::dynamics
