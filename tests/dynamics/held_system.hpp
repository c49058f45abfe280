/// \file
/// Meshes of hexahedra and a static Newton solver for systems of solids in contact, for tests.
#pragma once

#include <Eigen/SparseCholesky>
#include <cmath>
#include <functional>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"

namespace espalier::dynamics {

/// From 0: equal steps up to `fine`, then growing ones up to `end`.
inline std::vector<double> graded(double step, double fine, double end, double growth) {
  std::vector<double> x = {0};
  while (x.back() < fine - 1e-9) x.push_back(x.back() + step);
  for (double h = step * growth; x.back() < end; h *= growth) x.push_back(x.back() + h);
  return x;
}

/// Hexahedra between rising coordinates; `move` shapes them. Face set "top": the side of the last z.
inline Mesh grid(const std::vector<double>& x, const std::vector<double>& y, const std::vector<double>& z,
                 const std::function<Vec3(const Vec3&)>& move) {
  Mesh mesh;
  for (const double c : z)
    for (const double b : y)
      for (const double a : x) {
        const Vec3 p = move({a, b, c});
        mesh.nodes.push_back({p[0], p[1], p[2]});
      }
  const auto node = [&](std::size_t i, std::size_t j, std::size_t k) {
    return static_cast<Index>((k * y.size() + j) * x.size() + i);
  };
  for (std::size_t k = 0; k + 1 < z.size(); ++k)
    for (std::size_t j = 0; j + 1 < y.size(); ++j)
      for (std::size_t i = 0; i + 1 < x.size(); ++i) {
        const std::array<Index, 8> nodes = {
            node(i, j, k),     node(i + 1, j, k),     node(i + 1, j + 1, k),     node(i, j + 1, k),
            node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)};
        const Index e = mesh.add_element(ElementType::hex8, nodes);
        if (k + 2 == z.size()) mesh.face_sets["top"].push_back({e, 1});
      }
  return mesh;
}

/// Newton's method for a system in which some coordinates do not move.
class HeldSystem {
 public:
  AssembledSystem system;
  std::vector<double> q;
  std::vector<char> held;

  void begin() {
    system.finish();
    const Sizes sizes = system.sizes();
    q.resize(static_cast<std::size_t>(sizes.configuration));
    held.assign(static_cast<std::size_t>(sizes.velocity), 0);
    std::vector<double> v(held.size());
    system.initial(q, v);
    zero_.assign(held.size(), 0);
  }
  [[nodiscard]] StateView state() const { return {0, q, zero_, zero_, {}}; }

  /// @return passes, or -1
  int solve() {
    for (int pass = 1; pass <= 40; ++pass) {
      system.update_pattern(q);
      const auto n = static_cast<Eigen::Index>(held.size());
      Eigen::VectorXd f(n);
      system.residual(state(), {f.data(), held.size()});
      const SparsePattern& p = system.tangent_pattern();
      std::vector<double> w(static_cast<std::size_t>(p.nonzeros()));
      system.tangent(state(), {0, 0, 1}, w);
      std::vector<Eigen::Triplet<double>> entries;
      for (Index j = 0; j < static_cast<Index>(n); ++j) {
        if (held[static_cast<std::size_t>(j)] != 0) entries.emplace_back(j, j, 1.0), f[j] = 0;
        for (Offset e = p.ptr[static_cast<std::size_t>(j)]; e < p.ptr[static_cast<std::size_t>(j) + 1]; ++e) {
          const Index i = p.ind[static_cast<std::size_t>(e)];
          if (held[static_cast<std::size_t>(i)] == 0 && held[static_cast<std::size_t>(j)] == 0)
            entries.emplace_back(i, j, w[static_cast<std::size_t>(e)]);
        }
      }
      Eigen::SparseMatrix<double> k(n, n);
      k.setFromTriplets(entries.begin(), entries.end());
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(k);
      const Eigen::VectorXd step = solver.solve(-f);
      double largest = 0, size = 0;
      for (std::size_t i = 0; i < q.size(); ++i) {
        q[i] += step[static_cast<Eigen::Index>(i)];
        largest = std::max(largest, std::abs(step[static_cast<Eigen::Index>(i)]));
        size = std::max(size, std::abs(q[i]));
      }
      if (!std::isfinite(largest)) return -1;
      if (largest < 1e-12 * size) return pass;
    }
    return -1;
  }

 private:
  std::vector<double> zero_;
};

inline FlexibleBody& add_body(HeldSystem& held, const char* name, const Mesh& mesh, double young, double poisson) {
  Material material;
  material.young = young;
  material.poisson = poisson;
  material.density = 1;
  return held.system.add(make_solid_body(name, mesh, material));
}

inline void hold(HeldSystem& held, const FlexibleBody& body, int axis, const std::function<bool(const Vec3&)>& where) {
  for (Index n = 0; n < body.nodes(); ++n) {
    const double* x = body.reference().data() + 3 * n;
    if (where({x[0], x[1], x[2]})) held.held[static_cast<std::size_t>(body.coordinate(n) + axis)] = 1;
  }
}

}  // namespace espalier::dynamics
