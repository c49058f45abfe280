#include "dynamics/integrators/linearised.hpp"

#include <algorithm>

#include "base/at.hpp"

namespace espalier::dynamics {

TangentMatrices tangent_matrices(System& system, const State& state) {
  const SparsePattern& p = system.tangent_pattern();
  const auto part = [&](const TangentWeights& weights) {
    SparseMatrix a;
    a.rows = p.rows;
    a.cols = p.cols;
    a.col_ptr = p.ptr;
    a.row_ind = p.ind;
    a.values.resize(at(p.nonzeros()));
    system.tangent(state.view(), weights, a.values);
    return a;
  };
  return {part({1, 0, 0}), part({0, 1, 0}), part({0, 0, 1})};
}

std::vector<Index> kept_constraints(const Equations& equations) {
  const std::vector<char>& dropped = equations.dropped();
  std::vector<Index> rows;
  for (Index i = 0; i < equations.sizes().constraints; ++i)
    if (dropped.empty() || dropped[at(i)] == 0) rows.push_back(i);
  return rows;
}

Linearised linearise(Equations& equations, const State& state) {
  System& system = equations.system();
  TangentMatrices a = tangent_matrices(system, state);
  equations.evaluate_constraints(state.t, state.q, {});
  const SparsePattern& phi = system.constraint_pattern();
  const ConstSpan phi_q = equations.phi_q();
  Linearised out;
  out.n = a.mass.cols;
  out.rows = kept_constraints(equations);
  const auto size = static_cast<std::size_t>(out.size()), n = at(out.n);

  struct Entry {
    Index row;
    double value;
  };
  std::vector<std::vector<Entry>> columns(size);
  for (std::size_t j = 0; j < n; ++j)
    for (auto k = at(a.stiffness.col_ptr[j]); k < at(a.stiffness.col_ptr[j + 1]); ++k)
      columns[j].push_back({a.stiffness.row_ind[k], a.stiffness.values[k]});
  for (std::size_t r = 0; r < out.rows.size(); ++r) {
    const auto row = at(out.rows[r]);
    for (auto k = at(phi.ptr[row]); k < at(phi.ptr[row + 1]); ++k) {
      columns[at(phi.ind[k])].push_back({out.n + static_cast<Index>(r), phi_q[k]});
      columns[n + r].push_back({phi.ind[k], phi_q[k]});
    }
  }
  if (const SparsePattern* p = system.multiplier_pattern(); p != nullptr) {
    std::vector<double> f_lambda(at(p->nonzeros()));
    system.multiplier_tangent(state.view(), f_lambda);
    for (std::size_t r = 0; r < out.rows.size(); ++r) {
      const auto column = at(out.rows[r]);
      for (auto k = at(p->ptr[column]); k < at(p->ptr[column + 1]); ++k)
        columns[n + r].push_back({p->ind[k], f_lambda[k]});
    }
  }
  SparseMatrix& s = out.stiffness;
  s.rows = s.cols = out.size();
  s.col_ptr.assign(1, 0);
  for (const std::vector<Entry>& column : columns) {
    for (const Entry& e : column) {
      s.row_ind.push_back(e.row);
      s.values.push_back(e.value);
    }
    s.col_ptr.push_back(static_cast<Offset>(s.row_ind.size()));
  }
  for (SparseMatrix* m : {&a.mass, &a.damping}) {
    m->rows = m->cols = out.size();
    m->col_ptr.resize(size + 1, m->col_ptr.back());
  }
  out.mass = std::move(a.mass);
  out.damping = std::move(a.damping);
  return out;
}

SparseMatrix bordered(const SparseMatrix& a, const SparsePattern& phi, ConstSpan values,
                      const std::vector<Index>& rows) {
  struct Entry {
    Index row;
    double value;
  };
  std::vector<std::vector<Entry>> columns(at(a.cols) + rows.size());
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k) {
      const Index i = a.row_ind[at(k)];
      const double half = 0.5 * a.values[at(k)];
      columns[at(std::min(i, j))].push_back({std::max(i, j), i == j ? 2 * half : half});
    }
  for (std::size_t r = 0; r < rows.size() && !values.empty(); ++r)
    for (Offset k = phi.ptr[at(rows[r])]; k < phi.ptr[at(rows[r]) + 1]; ++k)
      columns[at(phi.ind[at(k)])].push_back({a.cols + static_cast<Index>(r), values[at(k)]});
  SparseMatrix out;
  out.rows = out.cols = static_cast<Index>(columns.size());
  out.storage = Storage::symmetric_lower;
  out.col_ptr.assign(1, 0);
  for (const std::vector<Entry>& column : columns) {
    for (const Entry& e : column) {
      out.row_ind.push_back(e.row);
      out.values.push_back(e.value);
    }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

}  // namespace espalier::dynamics
