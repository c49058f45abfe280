// Supports: equations for single nodes of flexible bodies.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/builders.hpp"
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
        if (spec_.held[static_cast<std::size_t>(i)])
          add(node, place, axes.col(i), motion[static_cast<std::size_t>(i)],
              spec_.symmetry ? "the normal" : std::string(1, "xyz"[i]));
      if (each == 4 && spec_.slopes)  // the section's y and z
        for (const Index axis : {2, 3})
          for (int i = 0; i < 3; ++i)
            add(node, place + axis, Vec3::Unit(i), -1, fmt::format("section {}{}", "yz"[axis - 2], "xyz"[i]));
      if (each != 2) continue;
      if (spec_.slopes) clamp_slope(node, place + 1);
      if (spec_.symmetry) mirror_slope(node, place + 1, axes);
    }
    if (skipped_ > 0)
      out_.notices.push_back(fmt::format("{}: {} equations are those of '{}' already, which bears their reactions",
                                         spec_.name, skipped_, skipped_for_));
    if (rows_.empty())
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
    if (const auto* shell = std::get_if<ShellSpec>(&body->spec.shape))
      if (shell->offset != 0 && !spec.slopes)
        fail(spec.place,
             fmt::format("nodes of '{}' lie beside the middle of its thickness (offset), and supports hold the middle: "
                         "clamp them, or hold the edge by a joint to the ground",
                         body->spec.name));
    return *body;
  }

  [[nodiscard]] Vec3 at_start(Index vertex) const {
    return Eigen::Map<const Vec3>(frames_.initial_configuration().data() + flexible_.configuration(vertex));
  }

  void add(Index node, Index vertex, const Vec3& direction, int motion, const std::string& what) {
    constexpr double kNew = 1e-9;
    if (const auto known = out_.held.find({spec_.where.body, vertex}); known != out_.held.end()) {
      Vec3 rest = direction;
      std::vector<Vec3> basis;
      for (const HeldDirection& held : known->second) {
        Vec3 d = held.direction;
        for (const Vec3& b : basis) d -= b.dot(d) * b;
        if (!(d.norm() > kNew)) continue;
        basis.push_back(d.normalized());
        rest -= basis.back().dot(rest) * basis.back();
      }
      if (!(rest.norm() > kNew)) {
        const auto takes_part = [&](const HeldDirection& h) { return std::abs(h.direction.dot(direction)) > kNew; };
        const auto first = std::find_if(known->second.begin(), known->second.end(), takes_part);
        if (motion >= 0 ||
            std::any_of(first, known->second.end(), [&](const HeldDirection& h) { return takes_part(h) && h.moved; }))
          fail(
              spec_.place,
              fmt::format("node {} of '{}' is held along {} by '{}' already, and one of the two moves it; leave it out "
                          "of one of them",
                          label(node), spec_.where.body, what, first->by));
        ++skipped_;
        skipped_for_ = first->by;
        return;
      }
    }
    rows_.push_back({vertex, direction, direction.dot(at_start(vertex)), motion,
                     fmt::format("node {} of '{}', {}", label(node), spec_.where.body, what)});
    fresh_.emplace_back(vertex, HeldDirection{direction, spec_.name, motion >= 0});
  }

  /// Of a shell all of the director, whose length is the thickness; of a cable the direction.
  void clamp_slope(Index node, Index vertex) {
    const bool cable = std::holds_alternative<CableSpec>(body_.spec.shape);
    for (int i = 0; i < 3; ++i)
      if (!cable) add(node, vertex, Vec3::Unit(i), -1, fmt::format("slope {}", "xyz"[i]));
    if (cable) hold_across(node, vertex, at_start(vertex).normalized());
  }
  /// What lies in the plane stays there, what is normal to it stays so.
  void mirror_slope(Index node, Index vertex, const Mat3& axes) {
    const double normal = axes.col(0).dot(at_start(vertex).normalized());
    if (std::abs(normal) < 0.5)
      add(node, vertex, axes.col(0), -1, "slope in the plane");
    else
      hold_across(node, vertex, axes.col(0));
  }
  void hold_across(Index node, Index vertex, const Vec3& direction) {
    Eigen::Index least = 0;
    direction.cwiseAbs().minCoeff(&least);
    const Vec3 first = direction.cross(Vec3(Vec3::Unit(least))).normalized();
    add(node, vertex, first, -1, "slope");
    add(node, vertex, direction.cross(first), -1, "slope");
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
  int skipped_ = 0;
  std::string skipped_for_;
};

}  // namespace

void build_support(const SupportSpec& spec, const FrameBuilder& frames, Mechanism& out) {
  SupportBuilder(spec, frames, out).run();
}

}  // namespace espalier::dynamics::model
