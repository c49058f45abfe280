/// \file
/// Vectors that are functions of the state: motion of frames, reactions of joints, forces; and numbers made of them.
#pragma once

#include <Eigen/Core>

#include "dynamics/forces/frame_force.hpp"
#include "dynamics/forces/state_function.hpp"

namespace espalier::dynamics {

/// Three numbers y(t, q, v, lambda) in global axes with exact derivatives.
class VectorFunction {
 public:
  using Columns = Eigen::Matrix<double, 3, Eigen::Dynamic>;
  /// One column for every coordinate (q, v) and every multiplier (lambda).
  struct Derivatives {
    Columns q, v, lambda;
  };
  virtual ~VectorFunction() = default;
  [[nodiscard]] const std::vector<Index>& coordinates() const { return coordinates_; }
  [[nodiscard]] const std::vector<Index>& multipliers() const { return multipliers_; }
  [[nodiscard]] virtual Vec3 value(const StateView& s) const = 0;
  /// Sets the sizes of `out` and overwrites it. @return the value
  virtual Vec3 derivatives(const StateView& s, Derivatives& out) const = 0;

 protected:
  void clear(Derivatives& out) const;
  std::vector<Index> coordinates_, multipliers_;
};

using VectorFunctionPtr = std::shared_ptr<const VectorFunction>;

/// What of a frame's motion. Rotation: the rotation vector of its axes.
enum class Motion { position, velocity, rotation, angular_velocity };
[[nodiscard]] VectorFunctionPtr motion_of(std::shared_ptr<const Frame> frame, Motion what);
/// Force or moment of a joint on its frame `f`, at the frame's origin.
[[nodiscard]] VectorFunctionPtr reaction_of(const Joint& joint, int f, bool moment);
/// Force or moment of a force element on its frame `f`, at the frame's origin. Its inputs must be set already.
[[nodiscard]] VectorFunctionPtr wrench_of(const FrameForce& force, int f, bool moment);

/// Component x, y, z (0 to 2) or the Euclidean norm (3) of a vector; the norm of zero has no gradient and gets zero.
[[nodiscard]] StateFunctionPtr component_of(VectorFunctionPtr vector, int component);

/// A relative coordinate of two frames or its rate.
struct RelativeQuantity {
  const Frame* a = nullptr;
  const Frame* b = nullptr;
  PairCoordinate coordinate;
  const TurnCounter* turns = nullptr;  ///< of an angle: who counts its turns; null: in (-pi, pi]
  bool rate = false;
};
/// Everything pointed at must outlive the function.
[[nodiscard]] StateFunctionPtr relative_quantity(const RelativeQuantity& what);

}  // namespace espalier::dynamics
