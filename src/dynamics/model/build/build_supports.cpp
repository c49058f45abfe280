// Supports: equations for single nodes of flexible bodies.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

class SupportBuilder {
 public:
  SupportBuilder(const SupportSpec& spec, const FrameBuilder& frames, Mechanism& out)
      : spec_(spec), frames_(frames), out_(out), body_(body_of(spec, frames, out)), flexible_(*body_.flexible) {}

  void run() {
    std::array<int, 3> motion = {-1, -1, -1};
    std::vector<TimeFunction> motions;
    for (std::size_t i = 0; i < 3; ++i)
      if (spec_.motion[i]) {
        motion[i] = static_cast<int>(motions.size());
        motions.push_back(spec_.motion[i]->function(spec_.place.text()));
      }
    const int each = flexible_.vertices_per_node();
    const Mat3& axes = spec_.where.axes;
    for (const Index node : frames_.nodes_of(spec_.where, body_)) {
      const Index place = node * each;
      for (int i = 0; i < 3; ++i)
        if (spec_.held[at(i)])
          add(node, at_node(place, axes.col(i)), motion[at(i)],
              spec_.symmetry ? "the normal" : std::string(1, "xyz"[i]));
      if (each == 4 && spec_.slopes)  // the section's y and z
        for (const Index axis : {2, 3})
          for (int i = 0; i < 3; ++i)
            add(node, {{place + axis, Vec3::Unit(i)}}, -1, fmt::format("section {}{}", "yz"[axis - 2], "xyz"[i]));
      if (each == 4 && !spec_.slopes) hold_section(node, place, axes);
      if (each != 2) continue;
      if (spec_.slopes) clamp_slope(node, place + 1);
      if (spec_.symmetry) mirror_slope(node, place + 1, axes);
      if (!spec_.slopes && turning() > 0) hold_director(node, place + 1, axes);
    }
    if (free_ > 0)
      out_.notices.push_back(
          fmt::format("{}: rotations of {} nodes about the shell's normal are not held: nothing resists them there",
                      spec_.name, free_));
    if (skipped_ > 0)
      out_.notices.push_back(fmt::format("{}: {} equations are those of '{}' already, which bears their reactions",
                                         spec_.name, skipped_, skipped_for_));
    if (rows_.empty() && free_ == 0)
      fail(spec_.place, fmt::format("holds nothing that '{}' does not hold already; take it out", skipped_for_));
    auto support = std::make_unique<Support>(spec_.name, flexible_, std::move(rows_), std::move(motions));
    out_.supports.push_back(&out_.system.add(std::move(support)));
    for (auto& [vertex, held] : fresh_) out_.held[{spec_.where.body, vertex}].push_back(std::move(held));
  }

 private:
  static const BuiltBody& body_of(const SupportSpec& spec, const FrameBuilder& frames, const Mechanism& out) {
    const BuiltBody* body = out.body(spec.where.body);
    if (body == nullptr) frames.unknown_body(spec.where.body, spec.place);
    if (body->reduced != nullptr)
      fail(spec.place,
           fmt::format("'{}' is reduced, and has no single nodes to hold: take a joint (attach = \"mean\"), "
                       "or no 'reduce'",
                       body->spec.name));
    if (body->flexible == nullptr)
      fail(spec.place, fmt::format("'{}' has no nodes: supports hold those of flexible bodies; take a joint to the "
                                   "ground",
                                   body->spec.name));
    if (body->flexible->vertices_per_node() == 4 && spec.symmetry)
      fail(spec.place,
           fmt::format("nodes of '{}' turn: hold them in a plane with a planar joint to the ground; supports "
                       "clamp them (hold = \"all\") or hold their places (hold = \"xyz\")",
                       body->spec.name));
    const bool turns = body->flexible->vertices_per_node() == 4 || std::holds_alternative<ShellSpec>(body->spec.shape);
    if (std::find(spec.rotations.begin(), spec.rotations.end(), true) != spec.rotations.end() && !turns)
      fail(spec.place, fmt::format("nodes of '{}' do not turn: leave 'rotations' out", body->spec.name));
    return *body;
  }

  [[nodiscard]] Vec3 at_start(Index vertex) const {
    return Eigen::Map<const Vec3>(frames_.initial_configuration().data() + flexible_.configuration(vertex));
  }

  using Terms = std::vector<Support::Term>;

  /// Where the node is, which may be beside the middle of a shell's thickness.
  [[nodiscard]] Terms at_node(Index place, const Vec3& direction) const {
    Terms parts = {{place, direction}};
    const auto* shell = std::get_if<ShellSpec>(&body_.spec.shape);
    if (shell != nullptr && shell->offset != 0 && !spec_.slopes)
      parts.push_back({place + 1, -shell->offset * direction});
    return parts;
  }

  /// How many rotations are held.
  [[nodiscard]] std::ptrdiff_t turning() const {
    return std::count(spec_.rotations.begin(), spec_.rotations.end(), true);
  }

  void add(Index node, Terms parts, int motion, const std::string& what) {
    const auto& [vertex, direction] = parts.front();
    if (const HeldDirection* first = holder(vertex, direction); first != nullptr) {
      if (motion >= 0 || first->moved)
        fail(spec_.place,
             fmt::format("node {} of '{}' is held along {} by '{}' already, and one of the two moves it; leave it out "
                         "of one of them",
                         label(node), spec_.where.body, what, first->by));
      ++skipped_;
      skipped_for_ = first->by;
      return;
    }
    for (const Support::Term& part : parts)
      fresh_.emplace_back(part.vertex, HeldDirection{part.direction.normalized(), spec_.name, motion >= 0});
    double rest = 0;
    for (const Support::Term& part : parts) rest += part.direction.dot(at_start(part.vertex));
    rows_.push_back(
        {std::move(parts), rest, motion, fmt::format("node {} of '{}', {}", label(node), spec_.where.body, what)});
  }

  /// The other support that holds a direction of a vertex already, as one that moves where there is one; else null.
  [[nodiscard]] const HeldDirection* holder(Index vertex, const Vec3& direction) const {
    constexpr double kNew = 1e-9;
    const auto known = out_.held.find({spec_.where.body, vertex});
    if (known == out_.held.end()) return nullptr;
    Vec3 rest = direction;
    std::vector<Vec3> basis;
    for (const HeldDirection& held : known->second) {
      Vec3 d = held.direction;
      for (const Vec3& b : basis) d -= b.dot(d) * b;
      if (!(d.norm() > kNew)) continue;
      basis.push_back(d.normalized());
      rest -= basis.back().dot(rest) * basis.back();
    }
    if (rest.norm() > kNew) return nullptr;
    const HeldDirection* first = nullptr;
    for (const HeldDirection& held : known->second) {
      if (!(std::abs(held.direction.dot(direction)) > kNew)) continue;
      if (held.moved) return &held;
      if (first == nullptr) first = &held;
    }
    return first;
  }

  /// Holds, of a shell, all of the director, whose length is the thickness; of a cable the direction.
  void clamp_slope(Index node, Index vertex) {
    const bool cable = std::holds_alternative<CableSpec>(body_.spec.shape);
    for (int i = 0; i < 3; ++i)
      if (!cable) add(node, {{vertex, Vec3::Unit(i)}}, -1, fmt::format("slope {}", "xyz"[i]));
    if (cable) hold_across(node, vertex, at_start(vertex).normalized());
  }
  /// What lies in the plane stays there, what is normal to it stays so.
  void mirror_slope(Index node, Index vertex, const Mat3& axes) {
    const double normal = axes.col(0).dot(at_start(vertex).normalized());
    if (std::abs(normal) < 0.5)
      add(node, {{vertex, axes.col(0)}}, -1, "slope in the plane");
    else
      hold_across(node, vertex, axes.col(0));
  }
  void hold_across(Index node, Index vertex, const Vec3& direction) {
    Eigen::Index least = 0;
    direction.cwiseAbs().minCoeff(&least);
    const Vec3 first = direction.cross(Vec3(Vec3::Unit(least))).normalized();
    add(node, {{vertex, first}}, -1, "slope");
    add(node, {{vertex, direction.cross(first)}}, -1, "slope");
  }

  /// A director d turns by theta x d; what turns about d itself has no stiffness, and comes out as it likes. Two axes
  /// that are held leave the third one, w: d moves along w x d alone. One axis a leaves d what is across a x d.
  void hold_director(Index node, Index vertex, const Mat3& axes) {
    constexpr double kAlong = 1e-6, kAcross = 0.02;
    const Vec3 normal = at_start(vertex).normalized();
    if (turning() == 3) return hold_across(node, vertex, normal);
    const auto one = std::find(spec_.rotations.begin(), spec_.rotations.end(), turning() == 1);
    const Vec3 axis = axes.col(one - spec_.rotations.begin());
    const double along = std::abs(axis.dot(normal));
    const Vec3 tangent = axis - axis.dot(normal) * normal;
    if (turning() == 2) {
      if (tangent.norm() < kAlong) return hold_across(node, vertex, normal);
      return add(node, {{vertex, tangent.normalized()}}, -1, "rotation");
    }
    if (tangent.norm() < kAlong) {
      ++free_;
      return;
    }
    if (along > kAcross)
      fail(spec_.place,
           fmt::format("node {} of '{}': one rotation alone is held, about an axis that is oblique to the shell, and "
                       "it would turn about its normal as well as it likes: hold two rotations or all, or give axes "
                       "by 'rotation'",
                       label(node), spec_.where.body));
    add(node, {{vertex, axis.cross(normal).normalized()}}, -1, "rotation");
  }

  /// The section's y and z turn by theta x y and theta x z: with x = y x z the components of theta are
  /// x: 1/2 (z . dy - y . dz), y: x . dz, z: -x . dy.
  void hold_section(Index node, Index place, const Mat3& axes) {
    const Vec3 y = at_start(place + 2), z = at_start(place + 3), x = y.cross(z);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!spec_.rotations[i]) continue;
      const Vec3 a = axes.col(static_cast<Eigen::Index>(i));
      for (const Index axis : {2, 3})
        if (const auto known = out_.held.find({spec_.where.body, place + axis}); known != out_.held.end())
          fail(spec_.place,
               fmt::format("rotations of node {} of '{}' are held by '{}' already; hold them by one support",
                           label(node), spec_.where.body, known->second.front().by));
      Terms parts = {{place + 2, 0.5 * a.dot(x) * z - a.dot(z) * x}, {place + 3, a.dot(y) * x - 0.5 * a.dot(x) * y}};
      std::erase_if(parts, [](const Support::Term& part) { return part.direction.norm() < 1e-14; });
      add(node, std::move(parts), -1, fmt::format("rotation {}", "xyz"[i]));
    }
  }

  [[nodiscard]] std::int64_t label(Index node) const {
    const Mesh* mesh = named_mesh(body_);
    return mesh != nullptr ? mesh->node_label(node) : std::int64_t{node} + 1;
  }

  const SupportSpec& spec_;
  const FrameBuilder& frames_;
  Mechanism& out_;
  const BuiltBody& body_;
  const FlexibleBody& flexible_;
  std::vector<Support::Row> rows_;
  std::vector<std::pair<Index, HeldDirection>> fresh_;
  int skipped_ = 0, free_ = 0;
  std::string skipped_for_;
};

}  // namespace

void build_support(const SupportSpec& spec, const FrameBuilder& frames, Mechanism& out) {
  SupportBuilder(spec, frames, out).run();
}

}  // namespace espalier::dynamics::model
