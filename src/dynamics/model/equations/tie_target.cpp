#include "dynamics/model/equations/tie_target.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/elements/line_point.hpp"
#include "dynamics/model/assembly/line_elements.hpp"
#include "dynamics/model/equations/nearest_face.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kNear = 0.05;  // of the extent of a face, or the length of an element

using PlaceOf = std::function<Vec3(Index)>;  // a vertex, at the start

class SolidTarget final : public TieTarget {
 public:
  SolidTarget(const Mesh& mesh, const std::vector<MeshFace>& faces, PlaceOf place)
      : place_(std::move(place)), search_(mesh, faces, place_) {}
  [[nodiscard]] TiePoint nearest(const Vec3& point, Index /*own*/) const override {
    FacePoint at = search_.nearest(point);
    TiePoint out;
    out.normal = at.normal();
    out.distance = at.distance;
    out.reach = kNear * at.extent;
    out.axes.resize(3);
    for (std::size_t k = 0; k < 2; ++k) {
      out.axes[k].value = at.tangents[k];
      for (std::size_t a = 0; a < at.weights.size(); ++a)
        out.axes[k].parts.emplace_back(at.weights[a].first, at.slopes[k][a]);
    }
    out.axes[2].parts = at.weights;  // out of the element
    for (const Index node : at.behind)
      out.axes[2].parts.emplace_back(node, -1.0 / static_cast<double>(at.behind.size()));
    for (const auto& [node, share] : out.axes[2].parts) out.axes[2].value += share * place_(node);
    out.place = std::move(at.weights);
    return out;
  }

 private:
  PlaceOf place_;
  NearestFace search_;
};

/// Adds `factor` times the parts.
void add_parts(TiePoint::Terms& to, const TiePoint::Terms& parts, double factor) {
  for (const auto& [vertex, share] : parts) to.emplace_back(vertex, factor * share);
}

/// Moves a place to `point` along the vectors of the material there, so that it goes with them. @return the way, by
/// axis
Vec3 reach_for(const Vec3& point, const Vec3& from, TiePoint& out) {
  Mat3 basis;
  for (Eigen::Index k = 0; k < 3; ++k) basis.col(k) = out.axes[static_cast<std::size_t>(k)].value;
  Vec3 way = basis.inverse() * (point - from);
  for (std::size_t k = 0; k < 3; ++k)
    if (const double part = way[static_cast<Eigen::Index>(k)]; part != 0) add_parts(out.place, out.axes[k].parts, part);
  return way;
}

class ShellTarget final : public TieTarget {
 public:
  ShellTarget(const ShellSpec& shell, PlaceOf place)
      : place_(std::move(place)),
        search_(shell_quads(shell), [this](Index n) { return place_(2 * n); }),
        thickness_(shell.thickness) {}
  [[nodiscard]] TiePoint nearest(const Vec3& point, Index own) const override {
    const FacePoint at = search_.nearest(point, own);
    TiePoint out;
    out.distance = at.distance;
    if (at.weights.empty()) return out;  // all elements are those of the node itself: infinitely far
    out.axes.resize(3);
    Vec3 middle = Vec3::Zero();
    for (std::size_t a = 0; a < at.weights.size(); ++a) {
      const auto& [node, share] = at.weights[a];
      middle += share * place_(2 * node);
      out.place.emplace_back(2 * node, share);
      for (std::size_t k = 0; k < 2; ++k) out.axes[k].parts.emplace_back(2 * node, at.slopes[k][a]);
      out.axes[2].parts.emplace_back(2 * node + 1, share);
    }
    for (TiePoint::Axis& axis : out.axes)
      for (const auto& [vertex, share] : axis.parts) axis.value += share * place_(vertex);
    Vec3 way = reach_for(point, middle, out);
    const double half = 0.5 * thickness_;
    way[2] = std::copysign(std::max(0.0, std::abs(way[2]) - half), way[2]);  // the material begins at its surface
    for (std::size_t k = 0; k < 3; ++k) out.normal += way[static_cast<Eigen::Index>(k)] * out.axes[k].value;
    out.distance = out.normal.norm();
    out.reach = kNear * at.extent + half;
    out.normal.setZero();
    return out;
  }

 private:
  PlaceOf place_;
  NearestFace search_;
  double thickness_;
};

/// Beams and cables.
class LineTarget final : public TieTarget {
 public:
  LineTarget(const BuiltBody& body, PlaceOf place)
      : elements_(line_elements(body)), place_(std::move(place)), each_(body.flexible->vertices_per_node()) {}
  [[nodiscard]] TiePoint nearest(const Vec3& point, Index /*own*/) const override {
    const LineElement* best = nullptr;
    double xi = 0, least = std::numeric_limits<double>::infinity();
    for (const LineElement& e : elements_) {
      const double there = project(e, point);
      if (const double d = (point - at(e, there)).norm(); d < least) {
        best = &e;
        xi = there;
        least = d;
      }
    }
    return make(*best, xi, point);
  }

 private:
  [[nodiscard]] std::array<Index, 4> vertices(const LineElement& e) const {
    return {each_ * e.nodes[0], each_ * e.nodes[0] + 1, each_ * e.nodes[1], each_ * e.nodes[1] + 1};
  }
  [[nodiscard]] Vec3 at(const LineElement& e, double xi) const { return sum(e, Hermite(xi, e.length).n); }
  [[nodiscard]] Vec3 sum(const LineElement& e, const double (&factors)[4]) const {
    Vec3 x = Vec3::Zero();
    for (std::size_t k = 0; k < 4; ++k) x += factors[k] * place_(vertices(e)[k]);
    return x;
  }
  /// Gauss and Newton's steps, kept on the element.
  [[nodiscard]] double project(const LineElement& e, const Vec3& point) const {
    constexpr int kSteps = 50;
    constexpr double kRest = 1e-15;
    double xi = 0;
    for (int step = 0; step < kSteps; ++step) {
      const Hermite h(xi, e.length);
      const Vec3 slope = sum(e, h.d);
      const double to = std::clamp(xi + 2 / e.length * slope.dot(point - sum(e, h.n)) / slope.squaredNorm(), -1.0, 1.0);
      const double moved = std::abs(to - xi);
      xi = to;
      if (moved < kRest) break;
    }
    return xi;
  }
  [[nodiscard]] TiePoint make(const LineElement& e, double xi, const Vec3& point) const {
    const Hermite h(xi, e.length);
    TiePoint out;
    for (std::size_t k = 0; k < 4; ++k)
      if (h.n[k] != 0) out.place.emplace_back(vertices(e)[k], h.n[k]);
    const Vec3 axis = at(e, xi), slope = sum(e, h.d).normalized();
    out.distance = std::abs(slope.dot(point - axis));
    out.reach = kNear * e.length;
    if (each_ != 4) {
      out.distance = (point - axis).norm();
      return out;
    }
    out.axes.resize(3);
    for (std::size_t k = 0; k < 4; ++k)
      if (h.d[k] != 0) out.axes[0].parts.emplace_back(vertices(e)[k], h.d[k]);
    for (std::size_t k = 1; k < 3; ++k)
      for (std::size_t end = 0; end < 2; ++end)
        if (const double share = 0.5 * (end == 0 ? 1 - xi : 1 + xi); share != 0)
          out.axes[k].parts.emplace_back(4 * e.nodes[end] + 1 + static_cast<Index>(k), share);
    for (TiePoint::Axis& a : out.axes)
      for (const auto& [vertex, share] : a.parts) a.value += share * place_(vertex);
    reach_for(point, axis, out);
    return out;
  }

  std::vector<LineElement> elements_;
  PlaceOf place_;
  Index each_;
};

}  // namespace

std::unique_ptr<TieTarget> make_tie_target(const BuiltBody& body, const std::string& face, const FrameBuilder& frames) {
  PlaceOf place = [&frames, flexible = body.flexible](Index vertex) -> Vec3 {
    return Eigen::Map<const Vec3>(frames.initial_configuration().data() + flexible->configuration(vertex));
  };
  if (body.mesh) {
    if (face.empty())
      throw std::invalid_argument(
          fmt::format("needs 'face', the face set of '{}' that the nodes stay on", body.spec.name));
    return std::make_unique<SolidTarget>(*body.mesh, body.mesh->face_set(face), std::move(place));
  }
  if (!face.empty())
    throw std::invalid_argument(fmt::format(
        "'{}' has no face sets: leave 'face' out, the nodes stay on the place of it that is nearest", body.spec.name));
  if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape))
    return std::make_unique<ShellTarget>(*shell, std::move(place));
  return std::make_unique<LineTarget>(body, std::move(place));
}

}  // namespace espalier::dynamics::model
