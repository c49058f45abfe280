/// \file
/// Contact between rigid shapes.
#pragma once

#include <array>
#include <map>
#include <optional>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/contact/contact.hpp"
#include "dynamics/contact/impact.hpp"
#include "dynamics/contact/touch_motion.hpp"

namespace espalier::dynamics::contact {

/// A shape on a rigid body or on the ground.
struct RigidSurface {
  std::string name;
  const RigidBody* body = nullptr;  ///< null: the ground
  Shape shape;
  Vec3 point = Vec3::Zero();     ///< of the shape's origin, from the centre of mass, in body axes (ground: global)
  Mat3 axes = Mat3::Identity();  ///< columns: axes of the shape in body axes
};

/// Each pair of surfaces on different bodies (with `against` > 0: of the first `against` ones with the others) may
/// touch. Broad phase: boxes around the shapes in a tree, widened by `margin`; the list of pairs serves until a shape
/// leaves its widened box. The pattern of W holds the blocks of all pairs of bodies that were near each other when it
/// was made, within twice the margin, so it changes seldom; see update_pattern().
class RigidContact final : public Contact {
 public:
  /// @param margin 0: chosen from the shapes
  /// @throws std::invalid_argument where shapes, law or pairs make no sense
  RigidContact(std::string name, const ContactLaw& law, std::vector<RigidSurface> surfaces, std::size_t against = 0,
               double margin = 0);

  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  bool update_pattern(ConstSpan q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  void accept(const StateView& s) override;
  /// See rigid_steps.cpp.
  [[nodiscard]] double unseen(const StepPath& path) override;
  void add_falling(const StateView& s, std::vector<FallingForce>& out) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

  [[nodiscard]] ContactReport report(const StateView& s) override;
  [[nodiscard]] double gap(const StateView& s) override;
  [[nodiscard]] std::vector<Overlap> overlaps(ConstSpan q) override;
  // Impacts, where the law has `impulse` (rigid_impact.cpp). Touches are open, and then without any force, or resting:
  // held by the spring of the law until they open.

  /// Not negative where an open touch is closed and does not part: something strikes. Else minus its distance from
  /// that.
  [[nodiscard]] double closing(const StateView& s);
  /// How far time may go before a body could pass through another one.
  [[nodiscard]] double safe_time(const StateView& s);
  /// Adds all places that touch at a state, or nearly so.
  void add_impact_points(const StateView& s, std::vector<ImpactPoint>& points);
  /// Takes up what solve_impact() made of them. @pre no other call since add_impact_points()
  void take_impact(std::span<const ImpactPoint> points);
  [[nodiscard]] const std::vector<RigidSurface>& surfaces() const { return surfaces_; }
  /// How often the pattern was made.
  [[nodiscard]] long patterns() const { return patterns_; }

 private:
  using Pair = std::array<Index, 2>;  // surfaces, the lower one first (with `against`: one of the first ones)
  /// What a touch remembers between steps.
  struct Memory {
    Pair pair{};
    std::uint64_t id = 0;
    Vec3 normal;  // of the touch, in the axes of A
    SpringEnds ends;
    double damping = 0;  // a of its normal force
    double begin = 0;    // with impulses: penetration at which the spring begins, that of the instant of the impact
  };
  struct Active {
    Pair pair{};
    Touch touch;
    const Memory* memory = nullptr;
    double damping = 0;
  };

  static std::size_t slot(Index i) { return at(i); }
  [[nodiscard]] bool may_touch(Index i, Index j) const;
  [[nodiscard]] BodyMotion motion_of(Index body, ConstSpan q, ConstSpan v) const;
  void move_to(ConstSpan q, ConstSpan v);
  void place_shapes();
  [[nodiscard]] std::vector<Pair> near_pairs(double margin);
  void search();
  /// All touches with gaps below zero that have a force, in the order of pairs; found once for each state and memory.
  /// @pre move_to()
  const std::vector<Active>& find_active();
  /// All touches with gaps below `reach`, with what they remember. @pre move_to()
  const std::vector<Active>& find_touching(double reach);
  [[nodiscard]] ImpactPoint impact_point(const Active& active) const;
  [[nodiscard]] const Memory* memory_of(const Pair& pair, const Touch& touch, std::vector<char>& taken) const;
  [[nodiscard]] double first_damping(const Pair& pair, const Touch& touch) const;
  [[nodiscard]] double landing_damping(const Active& active) const;
  /// The speed of two surfaces, as far as two states of a step tell: how fast their points move at most.
  [[nodiscard]] double fastest_point(const Pair& pair, const StepPath& path) const;
  /// Two surfaces at a state: their bodies and their touches with gaps below `reach`.
  struct Meeting {
    BodyMotion a, b;
    std::vector<Touch> touches;
    [[nodiscard]] double gap(double reach) const;
  };
  [[nodiscard]] Meeting meeting(const Pair& pair, const State& s, double reach) const;
  [[nodiscard]] double turning_share(const StepPath& path);
  [[nodiscard]] double passing_share(const StepPath& path);
  [[nodiscard]] double passing_share(const Pair& pair, const StepPath& path) const;
  [[nodiscard]] Index body_of(Index surface) const { return body_index_[at(surface)]; }
  [[nodiscard]] TouchForce force_of(const Active& active, TouchTangent* tangent) const;
  void add_block(const Mat12& k, Index body_row, Index body_column, int row, int column, Span w_values) const;

  ContactLaw law_;
  std::vector<RigidSurface> surfaces_;
  std::size_t against_;
  double margin_;
  std::vector<const RigidBody*> bodies_;  // each once; null: the ground
  std::vector<Index> body_index_;         // of each surface
  std::vector<int> reach_;  // of each body: coordinates that forces act on and depend on, the first 3 or 6
  // At the state of the last move_to()
  std::vector<BodyMotion> motion_;
  std::vector<PlacedShape> placed_;
  std::vector<Box> boxes_;
  // Broad phase
  BoxTree tree_;
  std::vector<Index> bounded_, planes_;  // surfaces
  std::vector<Box> widened_;             // when pairs_ was made; empty: never
  std::vector<Pair> pairs_;
  std::vector<Active> active_touches_;
  bool found_active_ = false;              // at the state that follows, with the present memory
  std::vector<double> moved_q_, moved_v_;  // of the last move_to()
  std::vector<Touch> found_;
  std::vector<Active> struck_;  // of the last add_impact_points()
  // Pattern: for each pair of bodies (row, column), where its rows begin in each of its columns of W (3 or 6 of each)
  std::vector<std::array<Index, 2>> pattern_;  // pairs of bodies, sorted
  std::map<std::array<Index, 2>, std::array<Offset, 6>> places_;
  bool pattern_stale_ = true;
  long patterns_ = 0;
  // History
  std::vector<Memory> memory_;           // sorted by pair
  std::vector<double> last_q_, last_v_;  // accepted
  double impulse_ = 0, impacts_ = 0;     // so far
};

}  // namespace espalier::dynamics::contact
