// Shared by the element tests: test states, rotations, finite differences.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <functional>
#include <random>

#include "dynamics/elements/element.hpp"
#include "dynamics/mesh/element_type.hpp"
#include "dynamics/parameters.hpp"

namespace espalier::dynamics::test {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

inline constexpr double kEps = 2.220446049250313e-16;

/// evaluate(input, output) of any element.
using Evaluate = std::function<bool(const ElementInput&, ElementOutput&)>;

struct Result {
  Vector force;
  Matrix tangent;
  double energy = 0;
  bool ok = false;
};

inline Result run(const Evaluate& evaluate, const Vector& x0, const Vector& x, const Vector& v, double damping,
                  double wq, double wv) {
  Result r;
  r.force.setConstant(x.size(), std::nan(""));
  r.tangent.setConstant(x.size(), x.size(), std::nan(""));
  ElementInput in{x0.data(), x.data(), v.size() == 0 ? nullptr : v.data(), damping, wq, wv};
  ElementOutput out{r.force.data(), r.tangent.data(), 0};
  r.ok = evaluate(in, out);
  r.energy = out.energy;
  return r;
}

/// Corner coordinates of the reference shape, mid-side nodes in the middle of their edges.
inline Vector regular_element(ElementType type) {
  static const double tet[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  static const double hex[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                   {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  static const double wedge[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  static const int wedge_edge[9][2] = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}};
  static const int tet_edge[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  static const int hex_edge[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                      {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  const auto& shape = shape_of(type);
  const double(*corners)[3] = shape.corners == 4 ? tet : shape.corners == 6 ? wedge : hex;
  const int(*edges)[2] = shape.corners == 4 ? tet_edge : shape.corners == 6 ? wedge_edge : hex_edge;
  Vector x(3 * shape.nodes);
  for (int a = 0; a < shape.corners; ++a)
    for (int i = 0; i < 3; ++i) x[3 * a + i] = corners[a][i];
  for (int a = shape.corners; a < shape.nodes; ++a) {
    const int* edge = edges[a - shape.corners];
    for (int i = 0; i < 3; ++i) x[3 * a + i] = 0.5 * (x[3 * edge[0] + i] + x[3 * edge[1] + i]);
  }
  return x;
}

inline Vector noise(Eigen::Index n, double size, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  Vector v(n);
  for (auto& value : v) value = uniform(generator);
  return v;
}

inline Eigen::Matrix3d rotation(double x, double y, double z) {
  const Eigen::Vector3d r(x, y, z);
  return Eigen::AngleAxisd(r.norm(), r.normalized()).toRotationMatrix();
}

/// R applied to every 3-vector.
inline Vector rotated(const Eigen::Matrix3d& r, const Vector& x) {
  Vector y(x.size());
  for (Eigen::Index a = 0; a < x.size() / 3; ++a) y.segment<3>(3 * a) = r * x.segment<3>(3 * a);
  return y;
}

/// Truth: central differences of the force. Step h = cbrt(eps) * size: error O(h^2) + O(eps / h) ~ eps^(2/3).
inline void expect_exact_tangent(const Evaluate& evaluate, const Vector& x0, const Vector& x, const Vector& v,
                                 double damping, double size) {
  const double h = std::cbrt(kEps) * size;
  const Result at = run(evaluate, x0, x, v, damping, 1, 0);
  const Result rate = run(evaluate, x0, x, v, damping, 0, 1);
  const Result mixed = run(evaluate, x0, x, v, damping, 0.7, 0.3);
  ASSERT_TRUE(at.ok);
  Matrix by_position(x.size(), x.size()), by_velocity(x.size(), x.size());
  Vector gradient(x.size());
  for (Eigen::Index d = 0; d < x.size(); ++d) {
    Vector hi = x, lo = x;
    hi[d] += h;
    lo[d] -= h;
    const Result a = run(evaluate, x0, hi, v, damping, 1, 0), b = run(evaluate, x0, lo, v, damping, 1, 0);
    by_position.col(d) = (a.force - b.force) / (hi[d] - lo[d]);
    gradient[d] = (a.energy - b.energy) / (hi[d] - lo[d]);
    if (v.size() == 0) continue;
    Vector vh = v, vl = v;
    vh[d] += size;
    vl[d] -= size;
    by_velocity.col(d) =
        (run(evaluate, x0, x, vh, damping, 1, 0).force - run(evaluate, x0, x, vl, damping, 1, 0).force) /
        (vh[d] - vl[d]);
  }
  const double scale = at.tangent.cwiseAbs().maxCoeff();
  const double tolerance = 300 * std::pow(kEps, 2.0 / 3) * scale;
  EXPECT_GT(scale, 0);
  EXPECT_LT((at.tangent - by_position).cwiseAbs().maxCoeff(), tolerance);
  if (v.size() == 0 || damping == 0) {
    EXPECT_LT((at.force - gradient).cwiseAbs().maxCoeff(), tolerance * size) << "force is the gradient of the energy";
    EXPECT_LT((at.tangent - at.tangent.transpose()).cwiseAbs().maxCoeff(), 100 * kEps * scale);
  }
  if (v.size() == 0) return;
  // The force is linear in the velocities: their differences are exact but for round-off.
  EXPECT_LT((rate.tangent - by_velocity).cwiseAbs().maxCoeff(), 1e5 * kEps * scale);
  EXPECT_LT((mixed.tangent - 0.7 * at.tangent - 0.3 * rate.tangent).cwiseAbs().maxCoeff(), 1e3 * kEps * scale);
}

/// Truth: the energy does not see a rigid motion, the force turns with it, and the tangent knows the six rigid modes.
inline void expect_frame_indifference(const Evaluate& evaluate, const Vector& x0, const Vector& x, double stiffness,
                                      bool positions_only) {
  const Eigen::Matrix3d r = rotation(0.7, -1.9, 1.2);
  Vector moved = rotated(r, x);
  if (positions_only)
    for (Eigen::Index a = 0; a < x.size() / 3; ++a) moved.segment<3>(3 * a) += Eigen::Vector3d(3, -2, 5);
  const Result before = run(evaluate, x0, x, Vector(), 0, 1, 0);
  const Result after = run(evaluate, x0, moved, Vector(), 0, 1, 0);
  ASSERT_TRUE(before.ok && after.ok);
  const double tolerance = 2e3 * kEps * stiffness;
  EXPECT_NEAR(after.energy, before.energy, tolerance);
  EXPECT_LT((after.force - rotated(r, before.force)).cwiseAbs().maxCoeff(), tolerance);
  const Result at_rest = run(evaluate, x0, rotated(r, x0), Vector(), 0, 1, 0);
  EXPECT_LT(at_rest.force.cwiseAbs().maxCoeff(), tolerance) << "a rotated stress-free element carries no force";
}

}  // namespace espalier::dynamics::test
