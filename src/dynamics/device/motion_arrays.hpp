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
  // Generalized-alpha's; see GeneralizedAlpha for the words.
  double *q_start = nullptr, *v_start = nullptr, *a_start = nullptr;  ///< at the beginning of the step
  double *a_before = nullptr, *a_old = nullptr, *a_from = nullptr, *v_from = nullptr;
  double *a_base = nullptr, *v_base = nullptr, *delta_base = nullptr, *delta = nullptr, *a_step = nullptr;
  double *weight = nullptr, *force = nullptr, *second = nullptr;
  double* change = nullptr;       ///< n + m: right-hand side and solution of K
  const double* scale = nullptr;  ///< n + m: KktSolver::scale()
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
  static constexpr int kLargest = 5, kSums = 2;
  double largest[kLargest];  ///< |x|; a NaN is larger than all
  double sum[kSums];         ///< of (x w) (y w)
};

/// What it asks: null pointers for nothing, or for what they say.
struct MotionMeasure {
  struct Sum {
    MotionVector x = nullptr;
    MotionVector weight = nullptr;  ///< 1
    MotionVector y = nullptr;       ///< x once more
  };
  MotionVector largest[MotionRecord::kLargest] = {};
  Sum sums[MotionRecord::kSums] = {};
  ESPALIER_ANYWHERE void add(const MotionArrays& s, std::size_t i, MotionRecord& all) const {
    for (int k = 0; k < MotionRecord::kLargest; ++k)
      if (largest[k] != nullptr) keep_larger((s.*largest[k])[i], all.largest[k]);
    for (int k = 0; k < MotionRecord::kSums; ++k) {
      const Sum& of = sums[k];
      if (of.x == nullptr) continue;
      const double weight = of.weight == nullptr ? 1.0 : (s.*of.weight)[i], x = (s.*of.x)[i] * weight;
      all.sum[k] += x * (of.y == nullptr ? x : (s.*of.y)[i] * weight);
    }
  }
  static ESPALIER_ANYWHERE void join(MotionRecord& all, const MotionRecord& next) {
    for (int k = 0; k < MotionRecord::kLargest; ++k) keep_larger(next.largest[k], all.largest[k]);
    for (int k = 0; k < MotionRecord::kSums; ++k) all.sum[k] += next.sum[k];
  }

 private:
  static ESPALIER_ANYWHERE void keep_larger(double x, double& most) {
    const double size = x < 0 ? -x : x;
    if (most == most && !(size <= most)) most = size;
  }
};

}  // namespace espalier::dynamics
