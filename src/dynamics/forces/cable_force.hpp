/// \file
/// An elastic cable through rings, which can go slack and rubs in them.
#pragma once

#include "dynamics/dae/component.hpp"
#include "dynamics/forces/joint_friction.hpp"

namespace espalier::dynamics {

/// Pull of the cable from its stretch e = length of all its straight parts - rest: stiffness e + damping e', never
/// negative, and none where e < 0. In ring j it turns by the angle theta_j and slips with w_j into the part after it;
/// there the pull grows by exp(friction theta_j tanh(w_j / slip_speed)) (Eytelwein). The mean of the pulls over the
/// length is that of the stretch. The cable slips as if it were stretched evenly.
struct CableForceLaw {
  double stiffness = 0;  ///< force per length
  double damping = 0;
  double rest = 0;
  double friction = 0;
  double slip_speed = 1;
};

/// From the origin of the first frame through those of the others to the last one. The frames need no axes.
class CableForce final : public Component, public Switching {
 public:
  /// @throws std::invalid_argument where a number of the law is negative, or stiffness or slip speed are not positive
  CableForce(std::string name, std::vector<FramePtr> frames, const CableForceLaw& law);

  void set_active(bool active) { active_ = active; }
  [[nodiscard]] bool active() const { return active_; }
  [[nodiscard]] int frames() const { return static_cast<int>(frames_.size()); }
  [[nodiscard]] const Frame& frame(int f) const { return *frames_.at(at(f)); }
  /// Force on the origin of a frame, global axes.
  [[nodiscard]] Vec3 applied(const StateView& s, int f) const;

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  /// Where it goes slack.
  void branches(const StateView& s, Branches& out) const override;

  /// Numbers of the cable, with derivatives by the places x and velocities y of its frames, 3 each: rows of 6 n
  /// columns, x of all frames first.
  struct Number {
    double value = 0;
    Eigen::RowVectorXd by;
  };
  /// What a quantity may ask for: all its length, its rate, the pulls in the first and in the last part.
  enum class What { length, rate, first_pull, last_pull };
  [[nodiscard]] Number number(const StateView& s, What what, bool derivatives) const;

 private:
  struct Terms;
  [[nodiscard]] Terms parts(const StateView& s, bool derivatives) const;

  std::vector<FramePtr> frames_;
  CableForceLaw law_;
  bool active_ = true;
  FrameBlocks blocks_;
};

/// A number of it as a function of the state; 0 for pulls where it is switched off. The cable must outlive it.
[[nodiscard]] StateFunctionPtr cable_quantity(const CableForce& cable, CableForce::What what);

}  // namespace espalier::dynamics
