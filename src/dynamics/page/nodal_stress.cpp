#include "dynamics/page/nodal_stress.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/at.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kGauss = 0.57735026918962576451;
constexpr double kTetNear = 0.58541019662496845446, kTetFar = 0.13819660112501051518;
constexpr int kTetEdges[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
constexpr int kHexEdges[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                  {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr int kHexSigns[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                 {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

bool is_tet(ElementType type) { return type == ElementType::tet4 || type == ElementType::tet10; }
bool is_quadratic(ElementType type) { return type == ElementType::tet10 || type == ElementType::hex20; }

/// Positions of an element's nodes, 3 numbers each, and its stress at a point.
struct StressOfElement {
  ElementType type;
  const Material& material;
  std::array<double, 3 * kMaxElementNodes> reference{}, position{};

  [[nodiscard]] Mat3 cauchy(const double* xi) const {
    const auto nodes = at(shape_of(type).nodes);
    std::array<double, 3 * kMaxElementNodes> dn{};
    shape_gradients(type, xi, dn.data());
    Mat3 from = Mat3::Zero(), to = Mat3::Zero();
    for (std::size_t a = 0; a < nodes; ++a)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t d = 0; d < 3; ++d) {
          from(static_cast<int>(i), static_cast<int>(d)) += reference[3 * a + i] * dn[d * nodes + a];
          to(static_cast<int>(i), static_cast<int>(d)) += position[3 * a + i] * dn[d * nodes + a];
        }
    const Mat3 f = to * from.inverse();
    Mat33 grad, rate = {};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) grad[i][j] = f(i, j) - (i == j ? 1.0 : 0.0);
    PointResponse point;
    if (material.law == SolidLaw::st_venant_kirchhoff)
      respond_svk(grad, rate, material.lambda(), material.mu(), 1.0, {}, point);
    else if (!respond_neo_hookean(grad, material.lambda(), material.mu(), {}, point))
      return Mat3::Constant(kNoNumber);
    Mat3 p;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) p(i, j) = point.p[i][j];
    return p * f.transpose() / f.determinant();
  }
};

void at_corners_of_tet(const StressOfElement& e, std::vector<Mat3>& corner) {
  std::array<Mat3, 4> inside;
  for (int k = 0; k < 4; ++k) {
    double xi[3] = {kTetFar, kTetFar, kTetFar};
    if (k > 0) xi[k - 1] = kTetNear;
    inside[at(k)] = e.cauchy(xi);
  }
  const Mat3 sum = inside[0] + inside[1] + inside[2] + inside[3];
  for (const Mat3& own : inside) corner.push_back((own - kTetFar * sum) / (kTetNear - kTetFar));
}

void at_corners_of_hex(const StressOfElement& e, std::vector<Mat3>& corner) {
  std::array<Mat3, 8> inside;
  for (int k = 0; k < 8; ++k) {
    const double xi[3] = {kGauss * kHexSigns[k][0], kGauss * kHexSigns[k][1], kGauss * kHexSigns[k][2]};
    inside[at(k)] = e.cauchy(xi);
  }
  for (const auto& c : kHexSigns) {
    Mat3 sum = Mat3::Zero();
    for (int k = 0; k < 8; ++k) {
      double weight = 1;
      for (int i = 0; i < 3; ++i) weight *= 0.5 * (1 + c[i] * kHexSigns[k][i] / kGauss);
      sum += weight * inside[at(k)];
    }
    corner.push_back(sum);
  }
}

/// At each node of the element.
std::vector<Mat3> at_nodes(const StressOfElement& e) {
  const auto nodes = at(shape_of(e.type).nodes);
  if (!is_quadratic(e.type)) {
    const double quarter = is_tet(e.type) ? 0.25 : 0, middle[3] = {quarter, quarter, quarter};
    return std::vector<Mat3>(nodes, e.cauchy(middle));
  }
  std::vector<Mat3> stress;
  if (is_tet(e.type)) {
    at_corners_of_tet(e, stress);
    for (const auto& edge : kTetEdges) stress.push_back(0.5 * (stress[at(edge[0])] + stress[at(edge[1])]));
  } else {
    at_corners_of_hex(e, stress);
    for (const auto& edge : kHexEdges) stress.push_back(0.5 * (stress[at(edge[0])] + stress[at(edge[1])]));
  }
  return stress;
}

double von_mises_of(const Mat3& stress) {
  const Mat3 deviator = stress - stress.trace() / 3 * Mat3::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

/// The principal stress of the largest magnitude, with its sign.
double principal_of(const Mat3& stress) {
  if (!stress.allFinite()) return kNoNumber;
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(0.5 * (stress + stress.transpose()), Eigen::EigenvaluesOnly);
  const double low = solver.eigenvalues()[0], high = solver.eigenvalues()[2];
  return -low > high ? low : high;
}

}  // namespace

NodalStress::NodalStress(const model::Mechanism& mechanism, const Drawn& drawn) {
  for (std::size_t b = 0; b < mechanism.bodies.size(); ++b) {
    const Skin* skin = drawn.skins()[b].get();
    if (skin == nullptr) continue;
    const std::size_t first = points_;
    points_ += at(skin->points());
    const model::BuiltBody& body = mechanism.bodies[b];
    if (!body.mesh) continue;
    Solid solid{&body, first, {}, std::vector<Index>(body.mesh->nodes.size(), -1), at(skin->points())};
    for (std::size_t k = 0; k < skin->nodes().size(); ++k) solid.point_of[at(skin->nodes()[k])] = static_cast<Index>(k);
    for (Index e = 0; e < body.mesh->element_count(); ++e) {
      const auto nodes = body.mesh->element(e);
      if (is_simulated_solid(body.mesh->type(e)) &&
          std::any_of(nodes.begin(), nodes.end(), [&](Index node) { return solid.point_of[at(node)] >= 0; }))
        solid.elements.push_back(e);
    }
    bodies_.push_back(std::move(solid));
  }
}

std::vector<std::vector<double>> NodalStress::positions(const State& s) const {
  std::vector<std::vector<double>> all;
  for (const Solid& solid : bodies_) {
    const model::BuiltBody& body = *solid.body;
    if (body.reduced != nullptr) {
      all.push_back(body.reduced->strained(s.q));
    } else {
      const double* from = &s.q[at(body.flexible->configuration(0))];
      all.emplace_back(from, from + 3 * body.flexible->vertices());
    }
  }
  return all;
}

void NodalStress::evaluate(const std::vector<std::vector<double>>& positions, std::vector<double>& von_mises,
                           std::vector<double>& principal) const {
  von_mises.assign(points_, kNoNumber);
  principal.assign(points_, kNoNumber);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Solid& solid = bodies_[b];
    const Mesh& mesh = *solid.body->mesh;
    std::vector<Mat3> sum(solid.points, Mat3::Zero());
    std::vector<int> count(solid.points, 0);
    for (const Index e : solid.elements) {
      StressOfElement element{mesh.type(e), solid.body->material};
      const auto nodes = mesh.element(e);
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        std::copy_n(solid.body->flexible->reference().data() + 3 * nodes[a], 3, &element.reference[3 * a]);
        std::copy_n(positions[b].data() + 3 * nodes[a], 3, &element.position[3 * a]);
      }
      const std::vector<Mat3> stress = at_nodes(element);
      for (std::size_t a = 0; a < nodes.size(); ++a)
        if (const Index point = solid.point_of[at(nodes[a])]; point >= 0) {
          sum[at(point)] += stress[a];
          ++count[at(point)];
        }
    }
    for (std::size_t k = 0; k < sum.size(); ++k) {
      if (count[k] == 0) continue;
      const Mat3 mean = sum[k] / count[k];
      von_mises[solid.first_point + k] = von_mises_of(mean);
      principal[solid.first_point + k] = principal_of(mean);
    }
  }
}

}  // namespace espalier::dynamics::page
