#include "dynamics/model/build/element_notices.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <vector>

#include "dense/dense.hpp"

namespace espalier::dynamics::model {
namespace {

std::vector<Index> elements_of(const Mesh& mesh, const SolidSpec& solid) {
  if (!solid.element_set.empty()) return mesh.element_set(solid.element_set);
  std::vector<Index> all(at(mesh.element_count()));
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = static_cast<Index>(k);
  return all;
}

Eigen::Matrix3Xd places(std::span<const Index> nodes, const double* coordinates) {
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    x.col(static_cast<Eigen::Index>(a)) = Eigen::Map<const Vec3>(coordinates + 3 * nodes[a]);
  return x;
}

const double* reference_of_mesh(const Mesh& mesh) { return mesh.nodes.data()->data(); }

/// Whether walls or bars of the body are slender, and its elements so long beside their thickness that linear ones
/// lock: of full hex8 a part of about 0.4 (length / thickness)^2 of the stiffness is false. The thickness is twice the
/// volume over the surface; of bars half of it.
bool bends_coarsely(const BuiltBody& body, double longest_edge) {
  constexpr double kSlender = 0.125, kCoarse = 0.5;
  const double* reference = reference_of_mesh(*body.mesh);
  const Eigen::Map<const Eigen::Matrix3Xd> all(reference, 3, static_cast<Eigen::Index>(body.mesh->nodes.size()));
  double volume = 0, surface = 0;
  for (const MeshFace face : body.mesh->boundary_faces()) {
    const std::vector<Index> nodes = body.mesh->face_nodes(face);
    const Eigen::Matrix3Xd x = places(nodes, reference);
    const Eigen::Index corners = nodes.size() % 4 == 0 ? 4 : 3;
    for (Eigen::Index k = 1; k + 1 < corners; ++k) {
      const Vec3 twice = Vec3(x.col(k) - x.col(0)).cross(Vec3(x.col(k + 1) - x.col(0)));
      volume += x.col(0).dot(twice) / 6;
      surface += 0.5 * twice.norm();
    }
  }
  const double thickness = 2 * std::abs(volume) / surface;
  const double extent = (all.rowwise().maxCoeff() - all.rowwise().minCoeff()).norm();
  return thickness < kSlender * extent && longest_edge > kCoarse * thickness;
}

double longest_edge(const Eigen::Matrix3Xd& corners) {
  double longest = 0;
  for (Eigen::Index a = 0; a < corners.cols(); ++a)
    longest = std::max(longest, (corners.colwise() - corners.col(a)).colwise().norm().maxCoeff());
  return longest;
}

/// A hex20 with edges ten times as long as it is thick, bent by a tenth of its thickness: its membrane is strained by
/// bending.
bool is_curved_wall(const Eigen::Matrix3Xd& x) {
  constexpr double kThin = 0.1, kBent = 0.1;
  constexpr int kEdges[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                 {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  constexpr int kDirection[12] = {0, 1, 0, 1, 0, 1, 0, 1, 2, 2, 2, 2};
  double length[3] = {}, bent = 0;
  for (int e = 0; e < 12; ++e) {
    const Vec3 a = x.col(kEdges[e][0]), b = x.col(kEdges[e][1]), middle = x.col(8 + e);
    length[kDirection[e]] += 0.25 * (b - a).norm();
    bent = std::max(bent, (middle - 0.5 * (a + b)).norm());
  }
  const double thin = std::min({length[0], length[1], length[2]});
  return thin < kThin * std::max({length[0], length[1], length[2]}) && bent > kBent * thin;
}

/// How much a hex8 is compressed at its centre.
struct Compression {
  double stretch = 1;   ///< the least one
  double flatness = 1;  ///< extent of the element in that direction over its largest extent
};

Compression compression_of(const Eigen::Matrix3Xd& reference, const Eigen::Matrix3Xd& now) {
  Eigen::Matrix<double, 8, 3> slopes;  // of the shape functions there, times 8
  slopes << -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1;
  const Mat3 sides = reference * slopes, gradient = (now * slopes) * sides.inverse();
  // The squares of stretches lie within the norm of C - I from 1.
  constexpr double kHardly = 0.1;
  const double strain = (gradient.transpose() * gradient - Mat3::Identity()).norm();
  if (strain < kHardly) return {std::sqrt(1 - strain), 1};
  const dense::PrincipalAxes squares = dense::principal_axes(gradient.transpose() * gradient);
  const double along = (squares.axes.col(0).transpose() * sides).cwiseAbs().maxCoeff();
  return {std::sqrt(std::max(0.0, squares.values[0])), along / sides.colwise().norm().maxCoeff()};
}

}  // namespace

std::optional<std::string> locking_notice(const BuiltBody& body) {
  const auto* solid = std::get_if<SolidSpec>(&body.spec.shape);
  if (solid == nullptr || !body.mesh || body.mesh->nodes.empty()) return std::nullopt;  // reduced ones lock as well
  bool tets = false, wedges = false, walls = false;
  const Hex8Formulation hex8 = solid->options.hex8;
  const bool shear_locks = hex8 == Hex8Formulation::full || hex8 == Hex8Formulation::mean_dilatation;
  double longest = 0, count = 0;  // edges of linear elements that lock
  for (const Index e : elements_of(*body.mesh, *solid)) {
    const ElementType type = body.mesh->type(e);
    const bool tet = type == ElementType::tet4, hex = type == ElementType::hex8, wedge = type == ElementType::wedge6;
    tets = tets || tet;
    wedges = wedges || wedge;
    if (tet || wedge || (hex && shear_locks)) {
      longest += longest_edge(places(body.mesh->element(e), reference_of_mesh(*body.mesh))) / std::sqrt(3.0);
      ++count;
    } else if (type == ElementType::hex20 && !solid->options.reduced_hex20 && !walls) {
      walls = is_curved_wall(places(body.mesh->element(e), reference_of_mesh(*body.mesh)));
    }
  }
  if (count > 0 && bends_coarsely(body, longest / count))
    return tets || wedges
               ? fmt::format(
                     "'{}' has {} elements, which lock: in bending they are far too stiff. Take {}, or hexahedra",
                     body.spec.name, tets ? "tet4" : "wedge6", tets ? "tet10" : "wedge15")
               : fmt::format(
                     "'{}' has hex8 = \"{}\", which locks: in bending such elements are far too stiff. hex8 = "
                     "\"enhanced\" bends exactly",
                     body.spec.name, name_of(kHex8Formulations, hex8));
  if (walls)
    return fmt::format(
        "'{}' has hex20 elements that are thin and curved: with full integration they may be a third too stiff in "
        "bending. Take reduced_hex20 = true, or hex8 = \"shell\"",
        body.spec.name);
  return std::nullopt;
}

std::optional<std::string> compression_notice(const BuiltBody& body, ConstSpan q) {
  // The limits of cubes and longer ones, of flat ones: bench/dynamics/element_table.py.
  constexpr double kFlat = 0.4, kStable = 0.7, kStableFlat = 0.94;
  const auto* solid = std::get_if<SolidSpec>(&body.spec.shape);
  if (solid == nullptr || !body.mesh || body.flexible == nullptr || body.reduced != nullptr) return std::nullopt;
  const bool shell = solid->options.hex8 == Hex8Formulation::shell;
  if (!shell && solid->options.hex8 != Hex8Formulation::enhanced) return std::nullopt;
  double least = 1;
  const std::span<const char> failed = body.flexible->assembly().failed();
  std::unordered_map<std::int64_t, Index> numbers;
  if (!failed.empty()) numbers = body.flexible->assembly().numbers_by_label();
  for (const Index e : elements_of(*body.mesh, *solid)) {
    if (body.mesh->type(e) != ElementType::hex8) continue;
    if (!failed.empty() && failed[at(numbers.at(body.mesh->element_label(e)))] != 0) continue;
    const auto nodes = body.mesh->element(e);
    const double* now = q.data() + body.flexible->placement().q;
    const Compression c = compression_of(places(nodes, body.flexible->reference().data()), places(nodes, now));
    if (c.stretch < (c.flatness < kFlat ? kStableFlat : kStable)) least = std::min(least, c.stretch);
  }
  if (!(least < 1)) return std::nullopt;
  return fmt::format(
      "elements of '{}' are compressed to {:.2f} of their length: hex8 = \"{}\" may lose its stability there, in the "
      "shape of hourglasses, sooner the flatter they are; \"mean-dilatation\" and \"full\" do not",
      body.spec.name, least, name_of(kHex8Formulations, solid->options.hex8));
}

}  // namespace espalier::dynamics::model
