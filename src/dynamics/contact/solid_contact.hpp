/// \file
/// Contact of faces (of solids or shells) or lines (cables, beams) with a rigid shape, or with others of them.
#pragma once

#include <memory>
#include <optional>
#include <set>

#include "dynamics/contact/contact.hpp"
#include "dynamics/contact/geometry/segments.hpp"
#include "dynamics/contact/line_hold.hpp"
#include "dynamics/contact/rigid_contact.hpp"

namespace espalier::dynamics::contact {

/// Stress between surfaces (of lines: force over length), integrated over the first one: its law takes areas without
/// stress, so that the elastic part is the gradient of an energy, and the tangent without friction and damping
/// symmetric. Points of integration are fixed to the material of the first surface within a step. Between solids they
/// are made of common polygons of both surfaces (see points_of_segments()) and made anew at the start of a step if
/// the surfaces have slid on each other; what a point remembers goes to the nearest new one on its face. Augmented
/// Lagrangian (Simo and Laursen, Comput. Struct. 42 (1992)): a pressure l at each point is raised, l <- max(0, l + k
/// penetration), until no point lies deeper than allowed. In the law this is a layer of thickness l / k.
class SolidContact final : public Contact, public Augmented {
 public:
  /// @param allowed penetration, > 0: augmented Lagrangian; the law then has exponent 1 without smoothing
  /// @throws std::invalid_argument where law or surfaces make no sense
  SolidContact(std::string name, const ContactLaw& law, FaceSurface first, RigidSurface second, double allowed);
  SolidContact(std::string name, const ContactLaw& law, FaceSurface first, FaceSurface second, double allowed,
               double reach = 0);

  /// A surface that touches itself, but for neighbouring faces. Each side is integrated against the other one with half
  /// of the stiffness, so that neither is preferred.
  /// @throws std::invalid_argument as the constructors; of lines
  [[nodiscard]] static std::unique_ptr<SolidContact> with_itself(std::string name, ContactLaw law,
                                                                 const FaceSurface& surface, double allowed,
                                                                 double reach = 0);

  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  bool update_pattern(ConstSpan q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  void accept(const StateView& s) override;
  /// Where friction drives at the end of a step since the slip turned round (see RigidContact), or surfaces touched in
  /// it that touch at neither end.
  [[nodiscard]] double unseen(const StepPath& path) override;
  void add_falling(const StateView& s, std::vector<FallingForce>& out) override;
  [[nodiscard]] bool augment(const StateView& s) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

  [[nodiscard]] ContactReport report(const StateView& s) override;
  [[nodiscard]] std::vector<Overlap> overlaps(ConstSpan q) override;
  /// Reports forces on the first surface instead of the second one.
  void set_reversed(bool reversed) { reversed_ = reversed; }
  [[nodiscard]] const FaceSurface& first() const { return first_; }
  [[nodiscard]] std::size_t points() const { return points_.size(); }
  /// Pressure at the nodes of the first surface: for each of first().nodes(), the mean over its share of the points.
  [[nodiscard]] std::vector<double> node_pressures(const StateView& s);

 private:
  /// What a point remembers between steps.
  struct Memory {
    double layer = 0;      ///< l / k
    bool touched = false;  ///< the rest counts; at lines: touched, or was near
    SpringEnds ends;       ///< a rigid shape: of the tangential spring
    FaceSpot anchor;       ///< a solid or line: where the spring holds on to the second surface
    LineHold hold;         ///< a line: where the spring ends beside its axis
  };
  /// A point that touches, with everything that acts there.
  struct Acting {
    std::size_t point = 0;
    double gap = 0;  ///< without the layer
    NormalForce normal;
    FrictionForce friction;
    Vec3 slip_rate = Vec3::Zero(), stretch = Vec3::Zero(), direction = Vec3::Zero();
    Touch touch;                       ///< with a rigid shape
    std::optional<FaceSpot> opposite;  ///< on a solid
  };
  /// Nodes with forces and tangent of them, three coordinates each.
  struct Local {
    std::vector<NodeRows> rows;
    VecX f;  ///< their share of F
    MatX k;  ///< weights.q F_q + weights.v F_v; empty: not wanted
  };

  [[nodiscard]] bool rigid() const { return !second_.has_value(); }
  void begin();
  /// @throws std::invalid_argument where a small round shape would need too many points of integration
  void check_points() const;
  [[nodiscard]] Memory remembered(const Acting& acting, const FacePlace& at) const;
  /// @param look_only  keeps the points of integration: what is asked for must not change the run
  void move_to(ConstSpan q, ConstSpan v, bool look_only = false);
  void make_points();
  [[nodiscard]] std::vector<NodeRows> rigid_rows() const;
  /// The share of the area: both sides are integrated where a surface touches itself.
  [[nodiscard]] double side_share() const { return with_itself_ ? 0.5 : 1; }
  [[nodiscard]] bool one_body() const { return second_ && &first_.body() == &second_->body(); }
  [[nodiscard]] std::optional<Acting> act_rigid(std::size_t k, const FacePlace& at) const;
  [[nodiscard]] std::optional<Acting> act_solid(std::size_t k, const FacePlace& at);
  [[nodiscard]] std::optional<FaceSpot> spot_opposite(std::size_t k, const FacePlace& at, double reach);
  [[nodiscard]] FacePlace place_of_point(std::size_t k) const;
  /// Lets the tangential spring end at a place beside a line: those of points near by begin without stretch, so that
  /// what slides into the contact is rubbed at once.
  void hold_on(Memory& memory, const FaceSpot& line, const Vec3& end) const;
  /// From the end of the tangential spring on the second surface to the point. @pre the point has touched
  [[nodiscard]] Vec3 from_spring_end(std::size_t k, const FacePlace& at) const;
  [[nodiscard]] Vec3 velocity_of_point(std::size_t k, const FacePlace& at) const;
  /// body(acting, place) for all points that touch.
  template <class Body>
  void for_acting(const Body& body);
  [[nodiscard]] Local local_rigid(const Acting& acting, const FacePlace& at, const TangentWeights* weights) const;
  [[nodiscard]] Local local_solid(const Acting& acting, const FacePlace& at, const TangentWeights* weights) const;
  [[nodiscard]] MatX tangent_solid(const Acting& acting, const FacePlace& at, FaceTouch& touch,
                                   const TangentWeights& weights, int anchor_nodes) const;
  void add_local(const Local& local, Span w_values) const;
  [[nodiscard]] double deepest(ConstSpan q);
  [[nodiscard]] double turning_share(const StepPath& path);
  [[nodiscard]] double passing_share(const StepPath& path);
  [[nodiscard]] bool touches(const State& s);
  [[nodiscard]] bool slid() const;
  void transfer(const std::vector<ContactPoint>& old_points, const std::vector<Memory>& old_memory);

  ContactLaw law_;
  FaceSurface first_;
  std::optional<FaceSurface> second_;
  RigidSurface shape_;
  double allowed_ = 0, reach_ = 0;
  bool with_itself_ = false;
  BodyMotion shape_motion_;
  PlacedShape placed_;
  std::vector<ContactPoint> points_;
  std::vector<Memory> memory_;
  std::vector<std::array<double, 2>> made_at_;  // of points between solids: the place opposite when they were made
  bool points_stale_ = true;
  std::set<std::array<Index, 2>> pattern_;  // pairs of faces
  const SparsePattern* w_ = nullptr;
  bool pattern_stale_ = false;
  bool reversed_ = false;
  std::vector<Box> widened_first_, widened_second_;  // when the points were made
};

template <class Body>
void SolidContact::for_acting(const Body& body) {
  if (!active()) return;
  const bool bounded = !second_ && !std::holds_alternative<PlaneShape>(shape_.shape);
  const Box around = bounded ? box_around(placed_) : Box{};
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (bounded) {
      Box face = first_.boxes()[static_cast<std::size_t>(points_[k].spot.face)];
      face.widen(memory_[k].layer);
      if (!face.meets(around)) continue;
    }
    const FacePlace at = place_of_point(k);
    const std::optional<Acting> acting = second_ ? act_solid(k, at) : act_rigid(k, at);
    if (acting) body(*acting, at);
  }
}

}  // namespace espalier::dynamics::contact
