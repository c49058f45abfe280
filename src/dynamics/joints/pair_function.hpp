/// \file
/// Relative coordinates with data of their own (a curve, a surface, a sum), beside the plain ones of relative.hpp.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "dynamics/joints/relative.hpp"

namespace espalier::dynamics {

/// A scalar function of the places and axes of two frames.
class PairFunction {
 public:
  virtual ~PairFunction() = default;
  /// As evaluate() of a plain coordinate.
  virtual void evaluate(const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) const = 0;
  virtual void add_curvature(const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) const = 0;
  /// A length, or an angle.
  [[nodiscard]] virtual bool is_length() const { return true; }
  /// Whether it depends on the axes of frame B, too.
  [[nodiscard]] virtual bool turns_b() const { return false; }
};
using PairFunctionPtr = std::shared_ptr<const PairFunction>;

/// A function of p = A^T (r_B - r_A) alone: where the origin of frame B is, in the axes of frame A.
class PointFunction : public PairFunction {
 public:
  struct At {
    double value = 0;
    Vec3 gradient = Vec3::Zero();
    Mat3 hessian = Mat3::Zero();
  };
  [[nodiscard]] virtual At at(const Vec3& p) const = 0;

  void evaluate(const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) const final;
  void add_curvature(const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) const final;
};

/// A relative coordinate of two frames: a plain one, or a function.
struct PairCoordinate {
  Relative kind = Relative::distance;
  int axis = 0;                ///< i of evaluate()
  int other = 0;               ///< j of evaluate()
  PairFunctionPtr function{};  ///< instead of `kind`
  /// Known up to whole turns alone.
  [[nodiscard]] bool turns() const { return !function && is_angle(kind); }
};
/// A sum of factor times coordinate.
class PairSum final : public PairFunction {
 public:
  struct Term {
    double factor = 1;
    PairCoordinate coordinate;
    bool swapped = false;  ///< with the second frame as its A, the first as its B
  };
  explicit PairSum(std::vector<Term> parts) : parts_(std::move(parts)) {}
  void evaluate(const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) const override;
  void add_curvature(const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) const override;
  [[nodiscard]] bool turns_b() const override { return true; }

 private:
  std::vector<Term> parts_;
};

void evaluate(const PairCoordinate& g, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out);
void add_curvature(const PairCoordinate& g, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k);

}  // namespace espalier::dynamics
