// Ties: nodes of solids, shells and cables that keep their place, and directors their angle, on other bodies.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/joints/constant_products.hpp"
#include "dynamics/joints/node_equations.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/equations/tie_target.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

const BuiltBody& flexible_of(const std::string& name, const Place& place, const FrameBuilder& frames,
                             const Mechanism& out) {
  const BuiltBody* body = out.body(name);
  if (body == nullptr) frames.unknown_body(name, place);
  if (body->reduced != nullptr)
    fail(place, fmt::format("'{}' is reduced, and has no single nodes: take no 'reduce'", name));
  if (body->flexible == nullptr)
    fail(place, fmt::format("'{}' has no nodes; ties are between flexible bodies: take a fixed joint", name));
  return *body;
}

class TieBuilder {
 public:
  TieBuilder(const TieSpec& spec, const FrameBuilder& frames, Mechanism& out)
      : spec_(spec),
        frames_(frames),
        out_(out),
        body_(flexible_of(spec.where.body, spec.where.place, frames, out)),
        to_(flexible_of(spec.to_body, spec.to_place, frames, out)),
        shell_(std::get_if<ShellSpec>(&body_.spec.shape)) {
    if (body_.flexible->vertices_per_node() == 4)
      fail(spec.where.place,
           fmt::format("nodes of '{0}' turn with their sections: tie the nodes of the other body to it (to = {{ body = "
                       "\"{0}\" }}), or take a fixed joint",
                       spec.where.body));
    if (&body_ == &to_ && !body_.mesh && shell_ == nullptr)
      fail(spec.to_place, fmt::format("'{}' cannot be tied to itself", spec.to_body));
    at_place(spec.to_place, [&] { target_ = make_tie_target(to_, spec.to_face, frames); });
  }

  void run() {
    const std::vector<Index> nodes = frames_.nodes_of(spec_.where, body_);
    for (const Index node : nodes)
      if (!(to_.mesh && shell_ != nullptr ? tie_sides(node) : tie_node(node))) ++free_;
    const std::string to = to_.mesh ? fmt::format("the faces '{}' of '{}'", spec_.to_face, spec_.to_body)
                                    : fmt::format("'{}'", spec_.to_body);
    if (free_ == static_cast<long>(nodes.size()))
      fail(spec_.place,
           fmt::format("ties nothing: none of the nodes lies on {}; 'tolerance' says how far away they may be", to));
    if (equations_.empty() && products_.empty())
      fail(spec_.place, fmt::format("ties nothing: the nodes belong to {}", to));
    if (free_ > 0)
      out_.notices.push_back(fmt::format("{}: {} nodes lie too far from {} and stay free", spec_.name, free_, to));
    if (!equations_.empty()) out_.system.add(std::make_unique<NodeEquations>(spec_.name, std::move(equations_)));
    if (!products_.empty()) out_.system.add(std::make_unique<ConstantProducts>(spec_.name, std::move(products_)));
  }

 private:
  [[nodiscard]] Vec3 at_start(const FlexibleBody& body, Index vertex) const {
    return Eigen::Map<const Vec3>(frames_.initial_configuration().data() + body.configuration(vertex));
  }
  [[nodiscard]] bool is_far(const TiePoint& at) const {
    return at.distance > (spec_.tolerance > 0 ? spec_.tolerance : at.reach);
  }
  [[nodiscard]] std::string label(Index node) const {
    const Mesh* mesh = named_mesh(body_);
    return fmt::format("node {} of '{}'", mesh != nullptr ? mesh->node_label(node) : std::int64_t{node} + 1,
                       spec_.where.body);
  }

  /// Three equations: the sum of the own vertices is that of the others, but for what it is not at the start.
  void hold(const TiePoint::Terms& own, const TiePoint::Terms& other, const std::string& what) {
    constexpr double kNone = 1e-14;
    for (int d = 0; d < 3; ++d) {
      NodeEquation e;
      e.label = fmt::format("{}, {}", what, "xyz"[d]);
      const auto add = [&](const FlexibleBody* body, const TiePoint::Terms& parts, double sign) {
        for (const auto& [vertex, factor] : parts) {
          const NodeEquation::Term term{body, vertex, d, sign * factor};
          const auto known =
              std::find_if(e.terms.begin(), e.terms.end(), [&](const auto& t) { return t.same_coordinate(term); });
          if (known == e.terms.end())
            e.terms.push_back(term);
          else
            known->factor += term.factor;
        }
      };
      add(body_.flexible, own, 1);
      add(to_.flexible, other, -1);
      std::erase_if(e.terms, [](const NodeEquation::Term& t) { return std::abs(t.factor) <= kNone; });
      for (const NodeEquation::Term& t : e.terms) e.rest += t.factor * at_start(*t.body, t.vertex)[t.direction];
      if (e.terms.size() > 1) equations_.push_back(std::move(e));  // else the node belongs to the face itself
    }
  }

  /// @return false: it lies too far away
  bool tie_node(Index node) {
    const Index place = body_.flexible->vertices_per_node() * node;
    const TiePoint at = target_->nearest(at_start(*body_.flexible, place), &body_ == &to_ ? node : -1);
    if (is_far(at)) return false;
    hold({{place, 1}}, at.place, label(node));
    if (shell_ != nullptr && !at.axes.empty()) tie_director(node, place + 1, at);
    return true;
  }

  /// A vector by those of the material.
  [[nodiscard]] static Vec3 shares_of(const Vec3& vector, const TiePoint& at) {
    Mat3 basis;
    for (Eigen::Index k = 0; k < 3; ++k) basis.col(k) = at.axes[static_cast<std::size_t>(k)].value;
    return basis.inverse() * vector;
  }

  /// A director turns with the material that it stands on. What it makes with the vectors there is linear where it
  /// lies along what turns as it does: the other director, the section of a beam. Across them their product is what
  /// stays; of two shells this leaves the turn within the plane of the other one free, which thin shells do not feel.
  void tie_director(Index node, Index vertex, const TiePoint& at) {
    constexpr double kAlong = 0.9;
    const Vec3 director = at_start(*body_.flexible, vertex);
    const auto shares = [&](const TiePoint::Axis& axis) {
      return std::abs(axis.value.normalized().dot(director.normalized()));
    };
    const bool is_beam = std::holds_alternative<BeamSpec>(to_.spec.shape);
    if (is_beam ? shares(at.axes[0]) <= std::sqrt(1 - kAlong * kAlong) : shares(at.axes[2]) >= kAlong) {
      const Vec3 by_axis = shares_of(director, at);
      TiePoint::Terms other;
      for (std::size_t k = 0; k < 3; ++k)
        for (const auto& [part, factor] : at.axes[k].parts)
          other.emplace_back(part, by_axis[static_cast<Eigen::Index>(k)] * factor);
      hold({{vertex, 1}}, other, label(node) + ", director");
      return;
    }
    for (std::size_t k = is_beam ? 1 : 2; k < 3; ++k)
      products_.push_back({{body_.flexible, {{vertex, 1}}},
                           {to_.flexible, at.axes[k].parts},
                           director.dot(at.axes[k].value),
                           label(node) + ", angle"});
  }

  /// A node of a shell at the faces of a solid: both sides of its thickness where it stands on them, at whatever slope,
  /// the nearer side where it lies on them. What of the director stands out of the faces turns with the material below.
  bool tie_sides(Index node) {
    constexpr double kLies = 0.9;
    const Index place = 2 * node;
    const Vec3 middle = at_start(*body_.flexible, place), director = at_start(*body_.flexible, place + 1);
    const double half = 0.5 * shell_->thickness;
    const auto side = [&](double s) { return target_->nearest(middle + s * half * director, -1); };
    const TiePoint top = side(1), bottom = side(-1), mean = side(0);
    if (std::abs(mean.normal.dot(director.normalized())) > kLies) {
      const bool up = top.distance <= bottom.distance;
      const TiePoint& outer = up ? top : bottom;
      const bool at_middle = mean.distance < outer.distance;
      if (is_far(at_middle ? mean : outer)) return false;
      hold(at_middle ? TiePoint::Terms{{place, 1}} : TiePoint::Terms{{place, 1}, {place + 1, up ? half : -half}},
           at_middle ? mean.place : outer.place, label(node));
      return true;
    }
    if (is_far(top) || is_far(bottom)) return false;
    TiePoint::Terms sum, difference;
    for (const auto& [vertex, factor] : top.place) {
      sum.emplace_back(vertex, 0.5 * factor);
      difference.emplace_back(vertex, 0.5 / half * factor);
    }
    for (const auto& [vertex, factor] : bottom.place) {
      sum.emplace_back(vertex, 0.5 * factor);
      difference.emplace_back(vertex, -0.5 / half * factor);
    }
    hold({{place, 1}}, sum, label(node));
    Vec3 out = director;
    for (const auto& [vertex, factor] : difference) out -= factor * at_start(*to_.flexible, vertex);
    constexpr double kRounding = 1e-12;
    if (out.norm() > kRounding * director.norm()) {
      const Vec3 by_axis = shares_of(out, mean);
      for (std::size_t k = 0; k < 3; ++k)
        for (const auto& [vertex, factor] : mean.axes[k].parts)
          difference.emplace_back(vertex, by_axis[static_cast<Eigen::Index>(k)] * factor);
    }
    hold({{place + 1, 1}}, difference, label(node) + ", director");
    return true;
  }

  const TieSpec& spec_;
  const FrameBuilder& frames_;
  Mechanism& out_;
  const BuiltBody &body_, &to_;
  const ShellSpec* shell_;  // null: the nodes are of a solid or a cable
  std::unique_ptr<TieTarget> target_;
  std::vector<NodeEquation> equations_;
  std::vector<ConstantProducts::Row> products_;
  long free_ = 0;
};

}  // namespace

void build_tie(const TieSpec& spec, const FrameBuilder& frames, Mechanism& out) { TieBuilder(spec, frames, out).run(); }

}  // namespace espalier::dynamics::model
