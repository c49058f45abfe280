#include "dynamics/model/element_notices.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace espalier::dynamics::model {
namespace {

std::vector<Index> elements_of(const Mesh& mesh, const SolidSpec& solid) {
  if (!solid.element_set.empty()) return mesh.element_set(solid.element_set);
  std::vector<Index> all(static_cast<std::size_t>(mesh.element_count()));
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = static_cast<Index>(k);
  return all;
}

/// Shortest over longest edge of the box around some points.
double flatness(const Eigen::Matrix3Xd& points) {
  const Vec3 extent = points.rowwise().maxCoeff() - points.rowwise().minCoeff();
  return extent.minCoeff() / extent.maxCoeff();
}

Eigen::Matrix3Xd places(std::span<const Index> nodes, const double* coordinates) {
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    x.col(static_cast<Eigen::Index>(a)) = Eigen::Map<const Vec3>(coordinates + 3 * nodes[a]);
  return x;
}

/// Least stretch at the centre of a hex8.
double least_stretch(const Eigen::Matrix3Xd& reference, const Eigen::Matrix3Xd& now) {
  Eigen::Matrix<double, 8, 3> slopes;  // of the shape functions there, times 8
  slopes << -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1;
  const Mat3 gradient = (now * slopes) * (reference * slopes).inverse();
  // The squares of stretches lie within the norm of C - I from 1.
  constexpr double kHardly = 0.1;
  const double strain = (gradient.transpose() * gradient - Mat3::Identity()).norm();
  return strain < kHardly ? std::sqrt(1 - strain) : Eigen::JacobiSVD<Mat3>(gradient).singularValues()[2];
}

}  // namespace

std::optional<std::string> locking_notice(const BuiltBody& body) {
  constexpr double kSlender = 0.25, kThin = 0.1;
  const auto* solid = std::get_if<SolidSpec>(&body.spec.shape);
  if (solid == nullptr || !body.mesh || body.flexible == nullptr) return std::nullopt;
  const auto reference = body.flexible->reference();
  const Eigen::Map<const Eigen::Matrix3Xd> all(reference.data(), 3, static_cast<Eigen::Index>(reference.size() / 3));
  const bool slender = flatness(all) < kSlender;
  bool tets = false, stiff = false, walls = false;
  for (const Index e : elements_of(*body.mesh, *solid)) {
    const ElementType type = body.mesh->type(e);
    tets = tets || type == ElementType::tet4;
    stiff = stiff || (type == ElementType::hex8 && solid->options.hex8 == Hex8Formulation::full);
    walls = walls || (type == ElementType::hex20 && !solid->options.reduced_hex20 &&
                      flatness(places(body.mesh->element(e), reference.data())) < kThin);
  }
  if (slender && tets)
    return fmt::format(
        "'{}' has tet4 elements, which lock: in bending they are far too stiff. Take tet10, or hexahedra",
        body.spec.name);
  if (slender && stiff)
    return fmt::format(
        "'{}' has hex8 = \"full\", which locks: in bending such elements are far too stiff. hex8 = \"enhanced\" bends "
        "exactly",
        body.spec.name);
  if (walls)
    return fmt::format(
        "'{}' has hex20 elements that are thin: with full integration they may be a third too stiff on thin curved "
        "walls. Take reduced_hex20 = true, or hex8 = \"shell\"",
        body.spec.name);
  return std::nullopt;
}

std::optional<std::string> compression_notice(const BuiltBody& body, ConstSpan q) {
  constexpr double kStable = 0.94;
  const auto* solid = std::get_if<SolidSpec>(&body.spec.shape);
  if (solid == nullptr || !body.mesh || body.flexible == nullptr || body.reduced != nullptr) return std::nullopt;
  const bool shell = solid->options.hex8 == Hex8Formulation::shell;
  if (!shell && solid->options.hex8 != Hex8Formulation::enhanced) return std::nullopt;
  double least = 1;
  for (const Index e : elements_of(*body.mesh, *solid)) {
    if (body.mesh->type(e) != ElementType::hex8) continue;
    const auto nodes = body.mesh->element(e);
    const double* now = q.data() + body.flexible->placement().q;
    least = std::min(least, least_stretch(places(nodes, body.flexible->reference().data()), places(nodes, now)));
  }
  if (!(least < kStable)) return std::nullopt;
  return fmt::format(
      "elements of '{}' are compressed to {:.2f} of their length: hex8 = \"{}\" may lose its stability there, in the "
      "shape of hourglasses; \"mean-dilatation\" and \"full\" do not",
      body.spec.name, least, shell ? "shell" : "enhanced");
}

}  // namespace espalier::dynamics::model
