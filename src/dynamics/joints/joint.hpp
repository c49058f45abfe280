/// \file
/// Joints: every one a list of scalar equations in relative coordinates of frames.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/dae/capabilities.hpp"
#include "dynamics/dae/frame_blocks.hpp"
#include "dynamics/joints/pair_function.hpp"
#include "dynamics/joints/relative.hpp"
#include "dynamics/joints/rigid_pair.hpp"
#include "dynamics/joints/rolling.hpp"
#include "dynamics/joints/time_function.hpp"
#include "dynamics/joints/turn_counter.hpp"

namespace espalier::dynamics {

/// One constraint equation: sum of factor * coordinate - offset - function(t) = 0.
struct JointRow {
  struct Term {
    Relative kind = Relative::global;
    int i = 0, j = 0;  ///< axes (see Relative)
    int a = 0, b = 1;  ///< frames of the joint
    double factor = 1;
    std::optional<RollingShape> rolling{};  ///< its coordinate in the direction i, instead of `kind`
    PairFunctionPtr function{};             ///< likewise
    [[nodiscard]] bool plain() const { return !rolling && !function; }
    /// Known up to whole turns.
    [[nodiscard]] bool turns() const { return plain() && is_angle(kind); }
  };
  std::string label;  ///< for people: "rotation about y"
  std::vector<Term> terms;
  double offset = 0;  ///< at the beginning; the joint keeps the present one
  TimeFunction function;
  bool driven = false;          ///< function is in use
  bool measure_offset = false;  ///< take the value at the first evaluation as the offset
  bool of_velocity = false;     ///< it holds for the rates of the terms alone: non-holonomic
};

/// The value of a term, whatever it is made of.
void evaluate(const JointRow::Term& term, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out);
void add_curvature(const JointRow::Term& term, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k);

/// What the functions of a joint remember of the last accepted state.
class PairMemory {
 public:
  virtual ~PairMemory() = default;
  virtual void accept(const FrameMotion& a, const FrameMotion& b) = 0;
  virtual void save(std::vector<double>& out) const = 0;
  /// @throws Error(invalid_input) if the numbers end too early
  virtual void restore(ConstSpan& in) = 0;
};

/// A coordinate in which a joint of two frames moves, with the names of its value and rate.
struct JointMotion {
  const char* value = "";
  const char* rate = "";
  PairCoordinate coordinate;
};

/// The force and moment that a joint exerts on a frame, at the frame's origin, in global axes.
struct Wrench {
  Vec3 force = Vec3::Zero();
  Vec3 moment = Vec3::Zero();
};

/// A joint between frames (two for nearly all kinds). Made by the functions below or from rows of one's own.
class Joint final : public Component, public Constrains, public Switching, public Remembers {
 public:
  /// `kind` is the word used in names, for instance "revolute".
  /// @throws std::invalid_argument if a row uses the rotation of a frame that has none
  Joint(std::string kind, std::string name, std::vector<std::unique_ptr<Frame>> frames, std::vector<JointRow> rows);

  [[nodiscard]] const std::string& kind() const { return kind_; }
  /// Follows the angle about z from x of frame 0 to x of frame 1 through its turns. Of joints whose z axes are one.
  void count_turns() { spin_.emplace(); }
  /// The counter of that angle; none where nobody follows it.
  [[nodiscard]] const std::optional<TurnCounter>& spin() const { return spin_; }
  /// Further coordinates that are quantities, and that limits act on.
  void add_motion(JointMotion motion) { motions_.push_back(std::move(motion)); }
  [[nodiscard]] const std::vector<JointMotion>& motions() const { return motions_; }
  /// The coordinate of that name; none: it has no such one.
  [[nodiscard]] const PairCoordinate* motion(std::string_view value) const;
  /// Gives the multiplier of a row a name among the quantities: a force, positive where it pulls its coordinate down.
  void name_row_force(const char* word, std::size_t row) { row_forces_.emplace_back(word, row); }
  [[nodiscard]] const std::vector<std::pair<const char*, std::size_t>>& row_forces() const { return row_forces_; }
  /// Shares the memory of its first two frames.
  void remember(std::shared_ptr<PairMemory> memory) { memory_ = std::move(memory); }
  [[nodiscard]] const std::vector<JointRow>& rows() const { return rows_; }
  /// Takes the present value of driven rows, distances and couplings as the one to go on from: of joints that are
  /// switched on in mid-motion and count from where they begin.
  void hold_here(double t, ConstSpan q);
  [[nodiscard]] int frames() const { return static_cast<int>(frames_.size()); }
  [[nodiscard]] const Frame& frame(int f) const { return *frames_.at(at(f)).frame; }
  /// Reaction on frame `f` of the joint.
  [[nodiscard]] Wrench reaction(const StateView& s, int f) const;
  /// Value of the relative coordinate of a row's first term (an angle: in (-pi, pi]).
  [[nodiscard]] double coordinate(ConstSpan q, int row) const;
  /// Motion of frame f at a state.
  [[nodiscard]] FrameMotion frame_motion(ConstSpan q, ConstSpan v, int f) const;

  [[nodiscard]] Sizes sizes() const override { return {0, 0, static_cast<Index>(rows_.size())}; }
  [[nodiscard]] std::string constraint_name(Index local_row) const override;
  [[nodiscard]] bool non_holonomic(Index local_row) const override { return rows_.at(at(local_row)).of_velocity; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  void branches(const StateView& s, Branches& out) const override;
  void accept(const StateView& s) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 private:
  struct Attached {
    std::unique_ptr<Frame> frame;
    FrameMotion motion;
    std::vector<double> projected;      // rows x nd: gradients by the body's coordinates
    std::vector<std::size_t> position;  // rows x nd: entries of Phi_q
  };
  void bind_rigid_pair(const SparsePattern& w);
  void evaluate_frames(ConstSpan q, ConstSpan v);
  void general_constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out);
  void rigid_constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out);
  [[nodiscard]] FrameBlocks::Derivatives derivatives(const StateView& s, double weight) const;
  struct Sum {
    double t = 0, phi = 0, curvature = 0;
  };
  void add_term(std::size_t r, std::size_t k, bool rates, RelativeValue& value, Sum& sum) const;
  void add_gradients(ConstSpan q, std::size_t f, Span phi_q_values);
  [[nodiscard]] TurnCounter followed(const JointRow::Term& term, TurnCounter turns, double t) const;

  std::string kind_;
  std::vector<Attached> frames_;
  std::vector<JointRow> rows_;
  std::vector<double> offsets_;                  // of the rows, side by side: each pass asks for them
  bool driven_ = false;                          // some row is
  std::vector<std::vector<TurnCounter>> turns_;  // rows x terms: of the angles that couplings add
  bool counts_turns_ = false;                    // some row adds angles
  std::optional<TurnCounter> spin_;
  std::vector<JointMotion> motions_;
  std::vector<std::pair<const char*, std::size_t>> row_forces_;
  std::shared_ptr<PairMemory> memory_;
  FrameBlocks blocks_;                             // its part of W
  std::vector<double> gradients_;                  // frames x rows x 6: of every equation by the motion of every frame
  std::size_t phi_q_begin_ = 0, phi_q_count_ = 0;  // its rows of Phi_q
  std::optional<RigidPair> pair_;                  // instead of all that, where rigid bodies and simple rows allow it
};

/// Frames of a two-frame joint.
using FramePtr = std::unique_ptr<Frame>;

// The kinds. Axis convention: z of the frames is the joint's axis; frames coincide (or agree as the kind asks) when the
// joint is assembled.
[[nodiscard]] std::unique_ptr<Joint> fixed_joint(std::string name, FramePtr a, FramePtr b);
[[nodiscard]] std::unique_ptr<Joint> revolute_joint(std::string name, FramePtr a, FramePtr b);
[[nodiscard]] std::unique_ptr<Joint> spherical_joint(std::string name, FramePtr a, FramePtr b);
/// Cross axes: x of frame A and y of frame B, which stay perpendicular.
[[nodiscard]] std::unique_ptr<Joint> universal_joint(std::string name, FramePtr a, FramePtr b);
[[nodiscard]] std::unique_ptr<Joint> cylindrical_joint(std::string name, FramePtr a, FramePtr b);
[[nodiscard]] std::unique_ptr<Joint> prismatic_joint(std::string name, FramePtr a, FramePtr b);
/// The origin of B stays in the plane z_A = 0 and z_B stays parallel to z_A.
[[nodiscard]] std::unique_ptr<Joint> planar_joint(std::string name, FramePtr a, FramePtr b);
/// The origin of B stays on the line z_A.
[[nodiscard]] std::unique_ptr<Joint> point_on_line(std::string name, FramePtr a, FramePtr b);
/// |r_B - r_A| = length (> 0).
[[nodiscard]] std::unique_ptr<Joint> distance_joint(std::string name, FramePtr a, FramePtr b, double length);
/// A massless link of the given length, revolute about z_A at A and spherical at B.
[[nodiscard]] std::unique_ptr<Joint> revolute_spherical_joint(std::string name, FramePtr a, FramePtr b, double length);
/// Motor: the angle about z_A from x_A to x_B is f(t).
[[nodiscard]] std::unique_ptr<Joint> rotation_motor(std::string name, FramePtr a, FramePtr b, TimeFunction f);
/// Linear actuator: (r_B - r_A) . z_A is f(t).
[[nodiscard]] std::unique_ptr<Joint> translation_motor(std::string name, FramePtr a, FramePtr b, TimeFunction f);
/// (r_B - r_A) . e_i = f(t) for the global axis i.
[[nodiscard]] std::unique_ptr<Joint> prescribed_coordinate(std::string name, FramePtr a, FramePtr b, int axis,
                                                           TimeFunction f);
/// Gear: angle of B about z_A times `ratio` + angle of D about z_C = const (as at the first evaluation). The wheels
/// need their own revolute joints.
[[nodiscard]] std::unique_ptr<Joint> gear_joint(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d,
                                                double ratio);
/// Frame B stays on the plane z = 0 of frame A and rolls there without slip; an edge glides along itself.
[[nodiscard]] std::unique_ptr<Joint> rolling_joint(std::string name, FramePtr a, FramePtr b, const RollingShape& shape);
// Joints with an axis that moves, each in a file of its own name.
/// Along the axis by `lead` for every turn about it, right-handed where that is positive (from the first evaluation
/// on).
[[nodiscard]] std::unique_ptr<Joint> screw_joint(std::string name, FramePtr a, FramePtr b, double lead);
/// Origins coincide, and B turns against A about axes across z_A alone, up to its own turn: with z the shafts, both
/// turn at one speed whatever their bend. At the start the frames must not be turned against each other about their
/// shafts.
[[nodiscard]] std::unique_ptr<Joint> constant_velocity_joint(std::string name, FramePtr a, FramePtr b);
/// z_B stays parallel to z_A.
[[nodiscard]] std::unique_ptr<Joint> parallel_axes_joint(std::string name, FramePtr a, FramePtr b);
/// The origin of B stays in the plane z_A = 0.
[[nodiscard]] std::unique_ptr<Joint> in_plane_joint(std::string name, FramePtr a, FramePtr b);
/// Two wheels with parallel axes z and centres at the origins, wherever these move: radius_a and radius_b in proportion
/// to the numbers of teeth, negative for a wheel with inner teeth. The force acts where the pitch circles touch, along
/// them.
[[nodiscard]] std::unique_ptr<Joint> gear_pair(std::string name, FramePtr a, FramePtr b, double radius_a,
                                               double radius_b);
/// A rack along z_A and a pinion about z_B, perpendicular to it, with its centre at the origin of B, wherever they
/// move. The force acts along z_A at the pitch point, `radius` from the centre in the direction of z_A x z_B, or, where
/// it is negative, in the other one.
[[nodiscard]] std::unique_ptr<Joint> rack_pair(std::string name, FramePtr a, FramePtr b, double radius);
/// A worm about z_A, and a wheel as the pinion of rack_pair().
struct WormShape {
  double lead = 0;         ///< of the thread for a turn of the worm; positive: right-handed
  double radius = 0;       ///< pitch radius of the wheel, with the sign of rack_pair()
  double worm_radius = 0;  ///< pitch radius of the worm (> 0)
  [[nodiscard]] double lead_angle() const;
};
[[nodiscard]] std::unique_ptr<Joint> worm_joint(std::string name, FramePtr a, FramePtr b, const WormShape& shape);
/// How far the wheel's tooth has slid along the thread, up to a constant and whole turns.
[[nodiscard]] PairFunctionPtr worm_slip(const WormShape& shape);
/// How far apart two wheels stand: from the axis z of the first frame to the origin of the second one.
[[nodiscard]] PairFunctionPtr centre_distance();
/// Where the origin of the second frame is along `direction`, a unit vector in the axes of the first one.
[[nodiscard]] PairFunctionPtr distance_along(const Vec3& direction);
/// A cable without mass and stretch from the origin of the first frame through those of the others to the last one: the
/// sum of the distances is `length`.
[[nodiscard]] std::unique_ptr<Joint> cable_joint(std::string name, std::vector<FramePtr> frames, double length);
/// Rack and pinion: displacement of D along z_C = radius * angle of B about z_A + const (as at the first evaluation).
[[nodiscard]] std::unique_ptr<Joint> rack_and_pinion(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d,
                                                     double radius);

}  // namespace espalier::dynamics
