/// \file
/// Meshes of hexahedra and a static Newton solver for systems of solids in contact, for tests.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "espalier/solver.hpp"

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
      const std::size_t n = held.size();
      std::vector<double> step(n);
      system.residual(state(), step);
      for (std::size_t i = 0; i < n; ++i) step[i] = held[i] != 0 ? 0 : -step[i];
      if (!solve_tangent(step)) return -1;
      double largest = 0, size = 0;
      for (std::size_t i = 0; i < q.size(); ++i) {
        q[i] += step[i];
        largest = std::max(largest, std::abs(step[i]));
        size = std::max(size, std::abs(q[i]));
      }
      if (!std::isfinite(largest)) return -1;
      if (largest < 1e-12 * size) return pass;
    }
    return -1;
  }

 private:
  /// The tangent's lower half, with the identity where coordinates are held.
  bool solve_tangent(std::vector<double>& b) {
    const SparsePattern& p = system.tangent_pattern();
    std::vector<double> w(static_cast<std::size_t>(p.nonzeros()));
    system.tangent(state(), {0, 0, 1}, w);
    SparseMatrix k;
    k.rows = k.cols = static_cast<Index>(held.size());
    k.storage = Storage::symmetric_lower;
    k.col_ptr = {0};
    for (Index j = 0; j < k.cols; ++j) {
      for (Offset e = p.ptr[static_cast<std::size_t>(j)]; e < p.ptr[static_cast<std::size_t>(j) + 1]; ++e) {
        const Index i = p.ind[static_cast<std::size_t>(e)];
        if (i < j) continue;
        const bool out = held[static_cast<std::size_t>(i)] != 0 || held[static_cast<std::size_t>(j)] != 0;
        k.row_ind.push_back(i);
        k.values.push_back(!out ? w[static_cast<std::size_t>(e)] : i == j ? 1 : 0);
      }
      k.col_ptr.push_back(static_cast<Offset>(k.row_ind.size()));
    }
    const bool known = k.col_ptr == last_.col_ptr && k.row_ind == last_.row_ind;
    if (!known && !solver_.analyze(k).status.ok()) return false;
    const FactorResult factor = known ? solver_.refactorize(k.values) : solver_.factorize(k);
    last_ = std::move(k);
    return factor.status.ok() && solver_.solve(b, b).status.ok();
  }

  std::vector<double> zero_;
  SparseMatrix last_;
  Solver solver_;
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
