/// \file
/// The lane type of one element: a number. See lane_algebra-inl.hpp.
#pragma once

#include <cmath>

namespace espalier::dynamics {

struct ScalarLane {
  using Mask = bool;
  static constexpr int kWidth = 1;
  double v;
  ScalarLane() = default;
  explicit ScalarLane(double x) : v(x) {}
  static ScalarLane load(const double* from) { return ScalarLane(*from); }
  void store(double* to) const { *to = v; }
  static Mask all() { return true; }
  static unsigned bits(Mask mask) { return mask ? 1 : 0; }
};
inline ScalarLane operator+(ScalarLane a, ScalarLane b) { return ScalarLane(a.v + b.v); }
inline ScalarLane operator-(ScalarLane a, ScalarLane b) { return ScalarLane(a.v - b.v); }
inline ScalarLane operator*(ScalarLane a, ScalarLane b) { return ScalarLane(a.v * b.v); }
inline ScalarLane operator/(ScalarLane a, ScalarLane b) { return ScalarLane(a.v / b.v); }
inline ScalarLane mul_add(ScalarLane a, ScalarLane b, ScalarLane c) { return ScalarLane(a.v * b.v + c.v); }
inline ScalarLane square_root(ScalarLane a) { return ScalarLane(std::sqrt(a.v)); }
inline ScalarLane log_one_plus(ScalarLane a) { return ScalarLane(std::log1p(a.v)); }
inline ScalarLane magnitude(ScalarLane a) { return ScalarLane(std::fabs(a.v)); }
inline ScalarLane larger(ScalarLane a, ScalarLane b) { return ScalarLane(a.v > b.v ? a.v : b.v); }
inline ScalarLane select(bool mask, ScalarLane yes, ScalarLane no) { return mask ? yes : no; }
inline bool and_positive(bool mask, ScalarLane a) { return mask && a.v > 0; }
inline bool mask_and(bool a, bool b) { return a && b; }
inline bool mask_or(bool a, bool b) { return a || b; }
inline bool mask_not(bool a) { return !a; }

}  // namespace espalier::dynamics
