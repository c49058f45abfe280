/// \file
/// What generalized-alpha does with its long vectors, coordinate by coordinate.
#pragma once

#include "dynamics/device/motion_arrays.hpp"

namespace espalier::dynamics {

/// Those that it works with on a GPU.
inline constexpr MotionVector kAlphaVectors[] = {
    &MotionArrays::q,        &MotionArrays::v,       &MotionArrays::a,          &MotionArrays::f,
    &MotionArrays::work,     &MotionArrays::q_start, &MotionArrays::v_start,    &MotionArrays::a_start,
    &MotionArrays::a_before, &MotionArrays::a_old,   &MotionArrays::a_from,     &MotionArrays::v_from,
    &MotionArrays::a_base,   &MotionArrays::v_base,  &MotionArrays::delta_base, &MotionArrays::delta,
    &MotionArrays::a_step,   &MotionArrays::weight,  &MotionArrays::force,      &MotionArrays::second};
inline constexpr MotionVector kAlphaRightSides[] = {&MotionArrays::change};

/// What the formulas of a step have of its beginning: all but the multiples of a' at its end.
struct StepBases {
  double alpha_m, alpha_f, beta, gamma, h;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.a_base[i] = (alpha_f * s.a_start[i] - alpha_m * s.a_from[i]) / (1 - alpha_m);
    s.v_base[i] = s.v_from[i] + h * ((1 - gamma) * s.a_from[i] + gamma * s.a_base[i]);
    s.delta_base[i] = h * s.v_from[i] + h * h * ((0.5 - beta) * s.a_from[i] + beta * s.a_base[i]);
  }
};

/// On the line through the last two points.
struct PredictedAcceleration {
  double ahead;  ///< multiple of the last change
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.a_step[i] = s.a_start[i] + ahead * (s.a_start[i] - s.a_before[i]);
  }
};

/// The trial state that a' leads to, and its increment of q.
struct StateReached {
  double c_v, c_q;
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.a[i] = s.a_step[i];
    s.v[i] = s.v_base[i] + c_v * s.a_step[i];
    s.delta[i] = s.delta_base[i] + c_q * s.a_step[i];
  }
};

/// Its configuration, in a vector space.
struct PositionReached {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { s.q[i] = s.q_start[i] + s.delta[i]; }
};

/// Right-hand side of a pass, -F, and F in the scale of K.
struct ForcesOfPass {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.change[i] = -s.f[i];
    s.force[i] = s.f[i] * s.scale[i];
  }
};

/// work := the change of v' in the scale of K, as it was solved for.
struct ScaledChange {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.work[i] = s.change[i] / s.scale[i];
  }
};

/// The change is made, and the second difference of a', scaled, is what the method's own error follows from.
struct ChangedAcceleration {
  double ratio;  ///< of this step's length to that of the one before
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.a_step[i] += s.change[i];
    s.second[i] = (s.a_step[i] - s.a_start[i] - ratio * (s.a_start[i] - s.a_before[i])) / s.scale[i];
  }
};

/// work := a' in the scale of K.
struct ScaledAcceleration {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const { s.work[i] = s.a[i] / s.scale[i]; }
};

/// The last two changes of a', the older one in `second`.
struct LastChanges {
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.second[i] = s.a_start[i] - s.a_before[i];
    s.work[i] = s.a_step[i] - s.a_start[i];
  }
};

/// The end of a step becomes the beginning of the next one, in a vector space.
struct NextStep {
  double slope;  ///< (1 - alpha_f) / (1 - alpha_m)
  ESPALIER_ANYWHERE void operator()(const MotionArrays& s, std::size_t i) const {
    s.a_old[i] = s.a_base[i] + slope * s.a_step[i];
    s.a_before[i] = s.a_start[i];
    s.q_start[i] = s.q[i];
    s.v_start[i] = s.v[i];
    s.a_start[i] = s.a[i];
  }
};

}  // namespace espalier::dynamics
