/// \file
/// Forces between frames: what all of them share, and the kinds.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/capabilities.hpp"
#include "dynamics/forces/force_inputs.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {

using Vec12 = Eigen::Matrix<double, 12, 1>;

/// A force element that acts on two frames (the second may be the ground). Its law is stated in twist coordinates
/// [A; B]; the assembly to the bodies' coordinates is done here.
class FrameForce : public Component, public Switching, public ReadsMultipliers {
 public:
  FrameForce(std::string name, FramePtr a, FramePtr b);

  /// Numbers of the state that the law depends on beside the motion of its frames. To be set before the system is
  /// finished; what each means is the law's own.
  void set_inputs(std::vector<StateFunctionPtr> inputs) { inputs_ = ForceInputs(std::move(inputs)); }
  [[nodiscard]] const ForceInputs& inputs() const { return inputs_; }
  /// A force that is switched off is zero; it keeps its place in the tangent.
  void set_active(bool active) { active_ = active; }
  [[nodiscard]] bool active() const { return active_; }
  [[nodiscard]] const Frame& frame(int f) const { return *frames_.at(at(f)); }

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  void declare_multipliers(PatternBuilder& f_lambda) const override;
  void bind_multipliers(const SparsePattern& f_lambda) override;
  void multiplier_tangent(const StateView& s, Span values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  /// The branches of its law and of its inputs.
  void branches(const StateView& s, Branches& out) const override;
  /// Force and moment on frame A (0) or B (1) at its origin, in global axes.
  [[nodiscard]] Wrench applied(const StateView& s, int f) const;

  struct Pair {
    double t = 0;
    FrameMotion a, b;
    std::vector<double> inputs;
  };
  /// Derivatives of the wrenches: by the twist increments (k), the twists (d), and each input.
  struct Derivatives {
    Mat12 k = Mat12::Zero(), d = Mat12::Zero();
    std::vector<Vec12> inputs;
  };
  /// All at once, for quantities made of this force. @return the wrenches; zero where it is switched off
  Vec12 wrenches(const StateView& s, Derivatives* derivatives) const;

 protected:
  /// The wrenches [force; moment] on A and on B at the origins of the frames, global axes.
  [[nodiscard]] virtual Vec12 law(const Pair& p) const = 0;
  /// Derivatives of the wrenches with respect to the twist increments (k) and the twists (d); both come in as zero.
  virtual void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const = 0;
  /// Derivative of the wrenches by input i.
  [[nodiscard]] virtual Vec12 law_by_input(const Pair& /*p*/, std::size_t /*i*/) const { return Vec12::Zero(); }
  [[nodiscard]] virtual double potential(const Pair& /*p*/) const { return 0; }
  virtual void law_branches(const StateView& /*s*/, Branches& /*out*/) const {}
  [[nodiscard]] Pair pair(const StateView& s) const;
  [[nodiscard]] std::vector<Index> all_coordinates() const;
  /// -J^T wrench in these coordinates.
  [[nodiscard]] std::vector<double> to_coordinates(ConstSpan q, const Pair& p, const Vec12& wrench) const;

 private:
  std::array<FramePtr, 2> frames_;
  ForceInputs inputs_;
  bool active_ = true;
  FrameBlocks blocks_;
};

/// Law of a spring with damper on a relative coordinate g: force s along g (positive pulls g down).
struct SpringLaw {
  double stiffness = 0;   ///< N/m or N m/rad
  double damping = 0;     ///< N s/m or N m s/rad
  double rest = 0;        ///< g at which the spring is free
  double preload = 0;     ///< added to s
  TimeFunction actuator;  ///< added to s when `active`
  bool active = false;
};

/// Spring-damper on a relative coordinate: distance (point to point), along (on an axis), angle (rotational, turns
/// counted). Inputs (set_inputs) are added to s.
[[nodiscard]] std::unique_ptr<FrameForce> spring_damper(std::string name, FramePtr a, FramePtr b, SpringLaw law);
[[nodiscard]] std::unique_ptr<FrameForce> axial_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law);
[[nodiscard]] std::unique_ptr<FrameForce> rotational_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law);

/// Bushing: six stiffnesses and dampings along and about the axes of frame A. The rotation is measured by the rotation
/// vector of A^T B; the elastic moment is the gradient of its quadratic energy, so it conserves energy at any angle.
struct BushingLaw {
  Vec3 stiffness = Vec3::Zero();          ///< N/m
  Vec3 damping = Vec3::Zero();            ///< N s/m
  Vec3 angular_stiffness = Vec3::Zero();  ///< N m/rad
  Vec3 angular_damping = Vec3::Zero();    ///< N m s/rad
};
[[nodiscard]] std::unique_ptr<FrameForce> bushing(std::string name, FramePtr a, FramePtr b, BushingLaw law);

/// Force and moment on a frame: direction times f(t). Global axes, or the frame's own (follower).
struct LoadLaw {
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
  TimeFunction factor = TimeFunction::constant(1);
  bool follower = false;
  /// Inputs that stand for parts: of components 0 to 2 of force, 3 to 5 of moment, and of the factor (6). -1: as above.
  std::array<int, 7> input = {-1, -1, -1, -1, -1, -1, -1};
};
[[nodiscard]] std::unique_ptr<FrameForce> load(std::string name, FramePtr a, LoadLaw law);

}  // namespace espalier::dynamics
